// A scene file: the step, materials, bodies, pairs that may touch.
#include "scene/scene.h"

#include "base/bounds.h"
#include "base/maths.h"

#include <string.h>

static const sonde_material PLAIN = {
    .name = "", .stiffness_n_m3 = 1e8, .damping_s = 1e-3, .mu_static = 0, .mu_kinetic = 0};
static const double STRIBECK_M_S = 0.01, BOND_M = 1e-4, BOND_DAMPING_S = 1e-2;

static const sonde_scene_step STEP = {.dt_s = 1e-3,
                                      .lambda = 1,
                                      .newton_iterations = 1,
                                      .newton_residual = 1e-9,
                                      .line_search = true,
                                      .cast = true,
                                      .sleep_m = 5e-6,
                                      .solver = {1e-8, 1e-14, 1000},
                                      .substep_halvings = 8};

static void read_step(sonde_reader *reader, sonde_place at, sonde_scene *scene) {
  static const char *const KEYS[] = {"dt_s",
                                     "lambda",
                                     "method",
                                     "newton",
                                     "newton_residual",
                                     "line_search",
                                     "cast",
                                     "sleep_mm",
                                     "solver_relative",
                                     "solver_iterations",
                                     "substep_tolerance_mm",
                                     "substep_halvings",
                                     NULL};
  static const char *const METHODS[] = {"implicit", "explicit", "symplectic", NULL};
  sonde_scene_step *step = &scene->step;
  if (!at) return;
  sonde_read_keys(reader, at, "step", KEYS);
  int method = sonde_read_choice(reader, at, "method", METHODS, 0);
  if (method && sonde_read_find(reader, at, "lambda"))
    sonde_reader_fail(reader, at, SONDE_FORMAT, "lambda belongs to the implicit method");
  step->lambda = method ? 0 : sonde_read_real(reader, at, "lambda", 0, 1, step->lambda);
  step->symplectic = method == 2;
  step->dt_s = sonde_read_real(reader, at, "dt_s", SONDE_SCENE_SHORTEST_DT_S, 1, step->dt_s);
  step->newton_iterations = sonde_read_integer(reader, at, "newton", 1, SONDE_SCENE_MOST_NEWTON, 1);
  step->newton_residual =
      sonde_read_real(reader, at, "newton_residual", 0, 1, step->newton_residual);
  step->line_search = sonde_read_bool(reader, at, "line_search", step->line_search);
  step->cast = sonde_read_bool(reader, at, "cast", step->cast);
  step->sleep_m = 1e-3 * sonde_read_real(reader, at, "sleep_mm", 0, 1, step->sleep_m * 1e3);
  step->solver.relative_residual =
      sonde_read_real(reader, at, "solver_relative", 0, 1, step->solver.relative_residual);
  step->solver.max_iterations =
      sonde_read_integer(reader, at, "solver_iterations", 1, 1000000, step->solver.max_iterations);
  step->substep_tolerance_m = 1e-3 * sonde_read_real(reader, at, "substep_tolerance_mm", 0, 1e3, 0);
  step->substep_halvings = sonde_read_integer(reader, at, "substep_halvings", 1,
                                              SONDE_SCENE_MOST_HALVINGS, step->substep_halvings);
}

sonde_status sonde_scene_set_step(sonde_scene *scene, const sonde_scene_step *step,
                                  sonde_error *error) {
  SONDE_ASSERT(scene && step);
  if (!(step->dt_s >= SONDE_SCENE_SHORTEST_DT_S && step->dt_s <= 1))
    return sonde_fail(error, SONDE_ARGUMENT, "dt_s is %g, expected %g to 1", step->dt_s,
                      SONDE_SCENE_SHORTEST_DT_S);
  if (!(step->lambda >= 0 && step->lambda <= 1))
    return sonde_fail(error, SONDE_ARGUMENT, "lambda is %g, expected 0 to 1", step->lambda);
  if (step->symplectic && step->lambda > 0)
    return sonde_fail(error, SONDE_ARGUMENT, "symplectic needs lambda = 0, got %g", step->lambda);
  if (step->newton_iterations < 1 || step->newton_iterations > SONDE_SCENE_MOST_NEWTON)
    return sonde_fail(error, SONDE_ARGUMENT, "%u Newton iterations, expected 1 to %d",
                      step->newton_iterations, SONDE_SCENE_MOST_NEWTON);
  if (!(step->newton_residual >= 0) || !(step->substep_tolerance_m >= 0) || !(step->sleep_m >= 0))
    return sonde_fail(error, SONDE_ARGUMENT, "a tolerance is negative");
  if (!(step->solver.relative_residual >= 0) || !(step->solver.absolute_residual >= 0) ||
      step->solver.max_iterations < 1)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "the solver needs a residual of 0 or more and at least one iteration");
  if (step->substep_halvings < 1 || step->substep_halvings > SONDE_SCENE_MOST_HALVINGS)
    return sonde_fail(error, SONDE_ARGUMENT, "%u halvings, expected 1 to %d",
                      step->substep_halvings, SONDE_SCENE_MOST_HALVINGS);
  scene->step = *step;
  return SONDE_OK;
}

static void read_friction(sonde_reader *reader, sonde_place map, double *mu_static,
                          double *mu_kinetic) {
  *mu_static = sonde_read_real(reader, map, "friction_static", 0, 10, *mu_static);
  double most = *mu_static, fallback = *mu_kinetic < most ? *mu_kinetic : most;
  if (sonde_read_find(reader, map, "friction_static")) fallback = most;
  *mu_kinetic = sonde_read_real(reader, map, "friction_kinetic", 0, 10, fallback);
  if (*mu_kinetic > most)
    sonde_reader_fail(reader, map, SONDE_ARGUMENT,
                      "friction_kinetic is %g, expected friction_static (%g) or less", *mu_kinetic,
                      most);
}

// Two foundations in series; friction by the geometric mean.
static sonde_touch touch_of(const sonde_scene *scene, uint32_t a, uint32_t b) {
  SONDE_ASSERT(a < scene->body_count && b < scene->body_count && a != b);
  const sonde_material *p = &scene->bodies[a].material, *q = &scene->bodies[b].material;
  double stiffness = 1 / (1 / p->stiffness_n_m3 + 1 / q->stiffness_n_m3);
  double time = 0.5 * (p->damping_s + q->damping_s);
  return (sonde_touch){.a = a,
                       .b = b,
                       .law = SONDE_TOUCH_FOUNDATION,
                       .stiffness = stiffness,
                       .damping = stiffness * time,
                       .mu_static = sqrt(p->mu_static * q->mu_static),
                       .mu_kinetic = sqrt(p->mu_kinetic * q->mu_kinetic),
                       .stribeck_m_s = STRIBECK_M_S,
                       .bond_m = BOND_M,
                       .bond_damping_s = BOND_DAMPING_S};
}

static bool moves(const sonde_body *body) { return body->motion == SONDE_BODY_FREE; }

static double mean_edge(const sonde_mesh *mesh) {
  SONDE_ASSERT(mesh->face_count > 0);
  double sum = 0;
  for (uint32_t f = 0; f < mesh->face_count; ++f)
    for (int k = 0; k < 3; ++k)
      sum += v_distance(mesh->vertices[mesh->faces[f][k]],
                        mesh->vertices[mesh->faces[f][(k + 1) % 3]]);
  return sum / (3.0 * mesh->face_count);
}

// Bonds live on the finer surface.
static void add_touch(sonde_scene *scene, sonde_touch touch) {
  const sonde_body *a = &scene->bodies[touch.a], *b = &scene->bodies[touch.b];
  touch.bond_side = mean_edge(&b->surface) < mean_edge(&a->surface);
  scene->touches[scene->touch_count++] = touch;
}

static uint32_t read_end(sonde_reader *reader, sonde_place list, uint32_t index,
                         const sonde_scene *scene) {
  sonde_place at = sonde_read_item(reader, list, index);
  const char *name = sonde_read_text_at(reader, at, "a body's name");
  uint32_t body = name ? sonde_scene_find(scene, name) : 0;
  if (body == UINT32_MAX) {
    sonde_reader_fail(reader, at, SONDE_NOT_FOUND, "no body '%s'", name);
    return 0;
  }
  return body;
}

static void read_touch(sonde_reader *reader, sonde_place at, sonde_scene *scene) {
  static const char *const KEYS[] = {"between",
                                     "law",
                                     "stiffness_n_m3",
                                     "stiffness_n_m5",
                                     "damping_s",
                                     "friction_static",
                                     "friction_kinetic",
                                     "stribeck_m_s",
                                     "bond_mm",
                                     "bond_damping_s",
                                     NULL};
  bool plain = !sonde_read_is_map(reader, at);
  if (!plain) sonde_read_keys(reader, at, "a contact", KEYS);
  sonde_place ends = plain ? at : sonde_read_find(reader, at, "between");
  if (sonde_read_count(reader, ends) != 2)
    sonde_reader_fail(reader, at, SONDE_FORMAT, "a contact must name two bodies: [a, b]");
  if (!sonde_reader_good(reader)) return;
  uint32_t a = read_end(reader, ends, 0, scene), b = read_end(reader, ends, 1, scene);
  if (sonde_reader_good(reader) && a == b)
    sonde_reader_fail(reader, at, SONDE_ARGUMENT, "a body does not touch itself");
  if (sonde_reader_good(reader) && !moves(&scene->bodies[a]) && !moves(&scene->bodies[b]))
    sonde_reader_fail(reader, at, SONDE_ARGUMENT, "neither '%s' nor '%s' can move freely",
                      scene->bodies[a].name, scene->bodies[b].name);
  for (uint32_t t = 0; t < scene->touch_count; ++t) {
    const sonde_touch *other = &scene->touches[t];
    if ((other->a == a && other->b == b) || (other->a == b && other->b == a))
      sonde_reader_fail(reader, at, SONDE_ARGUMENT, "these two bodies are named twice");
  }
  if (!sonde_reader_good(reader)) return;
  sonde_touch touch = touch_of(scene, a, b);
  if (!plain) {
    // The energy law's stiffness is per volume squared.
    static const char *const LAWS[] = {"foundation", "volume", "energy", NULL};
    touch.law = (sonde_touch_law)sonde_read_choice(reader, at, "law", LAWS, SONDE_TOUCH_FOUNDATION);
    bool energy = touch.law == SONDE_TOUCH_ENERGY;
    const char *used = energy ? "stiffness_n_m5" : "stiffness_n_m3";
    const char *other = energy ? "stiffness_n_m3" : "stiffness_n_m5";
    sonde_place wrong = sonde_read_find(reader, at, other);
    if (wrong)
      sonde_reader_fail(reader, wrong, SONDE_FORMAT, "this law takes %s, not %s", used, other);
    double time = touch.damping / touch.stiffness;
    touch.stiffness = sonde_read_real(reader, at, used, 1, 1e20, energy ? NAN : touch.stiffness);
    touch.damping = touch.stiffness * sonde_read_real(reader, at, "damping_s", 0, 1e3, time);
    read_friction(reader, at, &touch.mu_static, &touch.mu_kinetic);
    touch.stribeck_m_s = sonde_read_real(reader, at, "stribeck_m_s", 1e-6, 1e3, touch.stribeck_m_s);
    touch.bond_m = 1e-3 * sonde_read_real(reader, at, "bond_mm", 1e-6, 10, touch.bond_m * 1e3);
    touch.bond_damping_s =
        sonde_read_real(reader, at, "bond_damping_s", 0, 1, touch.bond_damping_s);
  }
  if (sonde_reader_good(reader)) add_touch(scene, touch);
}

static void read_touches(sonde_reader *reader, sonde_place root, sonde_scene *scene) {
  sonde_place at = sonde_read_find(reader, root, "contacts");
  uint32_t n = scene->body_count, listed = 0;
  bool all = !at;
  if (at && sonde_read_is_text(reader, at)) {
    static const char *const WORDS[] = {"all", "none", NULL};
    all = sonde_read_choice(reader, root, "contacts", WORDS, 0) == 0;
  } else
    listed = sonde_read_count(reader, at);
  if (!sonde_reader_good(reader)) return;
  uint32_t most = all ? n * (n - 1) / 2 : listed;
  scene->touches = SONDE_NEW(sonde_touch, most);
  if (!scene->touches) {
    sonde_reader_fail(reader, root, SONDE_MEMORY, "out of memory");
    return;
  }
  for (uint32_t a = 0; all && a < n; ++a)
    for (uint32_t b = a + 1; b < n; ++b)
      if ((moves(&scene->bodies[a]) || moves(&scene->bodies[b])) &&
          !sonde_bodies_attached(scene, a, b))
        add_touch(scene, touch_of(scene, a, b));
  for (uint32_t k = 0; k < listed; ++k) read_touch(reader, sonde_read_item(reader, at, k), scene);
  SONDE_ASSERT(scene->touch_count <= most);
}

static void read_bodies(const sonde_scene_source *source, sonde_place root, sonde_scene *scene) {
  sonde_reader *reader = source->reader;
  sonde_place list = sonde_read_find(reader, root, "bodies");
  uint32_t count = sonde_read_count(reader, list);
  if (!count) sonde_reader_fail(reader, root, SONDE_FORMAT, "bodies is missing or empty");
  if (!sonde_reader_good(reader)) return;
  scene->bodies = SONDE_NEW(sonde_body, count);
  if (!scene->bodies) {
    sonde_reader_fail(reader, root, SONDE_MEMORY, "out of memory");
    return;
  }
  for (uint32_t i = 0; i < count && sonde_reader_good(reader); ++i) {
    sonde_body *body = &scene->bodies[i];
    body->material = PLAIN;
    sonde_place at = sonde_read_item(reader, list, i);
    sonde_read_body(source, at, scene, body);
    if (sonde_scene_find(scene, body->name) != UINT32_MAX)
      sonde_reader_fail(reader, at, SONDE_FORMAT, "two bodies are named '%s'", body->name);
    scene->body_count++;
  }
}

// Contact and friction of the bodies' skins.
static void read_materials(sonde_reader *reader, sonde_place root, sonde_scene *scene) {
  static const char *const KEYS[] = {
      "name", "contact_stiffness_n_m3", "contact_damping_s", "friction_static", "friction_kinetic",
      NULL};
  sonde_place list = sonde_read_find(reader, root, "materials");
  uint32_t count = sonde_read_count(reader, list);
  scene->materials = SONDE_NEW(sonde_material, count);
  if (!scene->materials) {
    sonde_reader_fail(reader, root, SONDE_MEMORY, "out of memory");
    return;
  }
  for (uint32_t i = 0; i < count; ++i) {
    sonde_place at = sonde_read_item(reader, list, i);
    sonde_material *material = &scene->materials[i];
    *material = PLAIN;
    sonde_read_keys(reader, at, "a material", KEYS);
    const char *name = sonde_read_text(reader, at, "name", true);
    snprintf(material->name, sizeof material->name, "%s", name ? name : "");
    material->stiffness_n_m3 =
        sonde_read_real(reader, at, "contact_stiffness_n_m3", 1, 1e15, PLAIN.stiffness_n_m3);
    material->damping_s = sonde_read_real(reader, at, "contact_damping_s", 0, 1e3, PLAIN.damping_s);
    read_friction(reader, at, &material->mu_static, &material->mu_kinetic);
  }
  scene->material_count = count;
}

static void read_scene(const sonde_scene_source *source, sonde_scene *scene) {
  static const char *const KEYS[] = {"sonde_scene", "title",  "gravity_m_s2", "duration_s",  "step",
                                     "materials",   "bodies", "contacts",     "attachments", NULL};
  sonde_reader *reader = source->reader;
  sonde_place root = sonde_reader_root(reader);
  sonde_read_keys(reader, root, "a scene", KEYS);
  double version = sonde_read_real(reader, root, "sonde_scene", 0, 1000, NAN);
  if (sonde_reader_good(reader) && version != 1)
    sonde_reader_fail(reader, sonde_read_find(reader, root, "sonde_scene"), SONDE_VERSION,
                      "sonde_scene: 1 expected, got %g", version);
  const char *title = sonde_read_text(reader, root, "title", false);
  snprintf(scene->title, sizeof scene->title, "%s", title ? title : "");
  scene->gravity_m_s2 = sonde_read_vector(reader, root, "gravity_m_s2", 1e3, vec3(0, 0, 0));
  scene->duration_s = sonde_read_real(reader, root, "duration_s", 0, SONDE_SCENE_LONGEST_S, 1);
  read_step(reader, sonde_read_find(reader, root, "step"), scene);
  read_materials(reader, root, scene);
  read_bodies(source, root, scene);
  if (sonde_reader_good(reader)) sonde_read_attachments(reader, root, scene);
  if (sonde_reader_good(reader)) read_touches(reader, root, scene);
  // Bodies that may touch have to bound a solid.
  for (uint32_t i = 0; i < scene->body_count; ++i) {
    const sonde_body *body = &scene->bodies[i];
    bool touches = false;
    for (uint32_t t = 0; t < scene->touch_count; ++t)
      touches |= scene->touches[t].a == i || scene->touches[t].b == i;
    sonde_error error = {0};
    if (!touches || sonde_body_is_rigid(body) || !sonde_reader_good(reader)) continue;
    if (sonde_mesh_check_solid(&body->surface, &error))
      sonde_reader_fail(reader, body->place, error.status, "'%s' may touch others: %.300s",
                        body->name, error.message);
  }
}

sonde_status sonde_scene_parse(const char *text, const char *name, const char *thigh,
                               sonde_scene **out, sonde_error *error) {
  SONDE_ASSERT(text && name && out);
  *out = NULL;
  sonde_scene_source source = {.thigh = thigh};
  const char *slash = strrchr(name, '/');
  if (slash && (size_t)(slash + 1 - name) >= sizeof source.directory)
    return sonde_fail(error, SONDE_ARGUMENT, "the path of the scene is too long");
  if (slash) memcpy(source.directory, name, (size_t)(slash + 1 - name));
  sonde_status status = sonde_reader_create(text, name, &source.reader, error);
  if (status) return status;
  sonde_scene *scene = SONDE_NEW(sonde_scene, 1);
  if (scene) {
    scene->step = STEP;
    read_scene(&source, scene);
    status = sonde_reader_status(source.reader, error);
    // A rigid body has two slots, its velocity and its spin; a deformable one has a slot per node.
    for (uint32_t k = 0; k < scene->body_count && !status; ++k) {
      sonde_body *b = &scene->bodies[k];
      b->first_slot = scene->slot_count;
      b->slot_count = sonde_body_is_rigid(b) ? 2 : b->node_count;
      scene->self_nodes += b->self_m > 0 ? b->node_count : 0;
      b->first_pair = scene->pair_count;
      scene->slot_count += b->slot_count;
      scene->pair_count += b->model ? b->model->topology.edge_count : b->spring_count;
    }
    scene->pairs = sonde_calloc(scene->pair_count, sizeof *scene->pairs);
    if (!status && !scene->pairs) status = sonde_fail_memory(error);
    for (uint32_t i = 0; i < scene->body_count && !status; ++i) {
      const sonde_body *b = &scene->bodies[i];
      uint32_t count = b->model ? b->model->topology.edge_count : b->spring_count;
      for (uint32_t e = 0; e < 2 * count; ++e) {
        const uint32_t *pair = b->model ? b->model->topology.edges[e / 2] : b->pairs[e / 2];
        SONDE_ASSERT(pair[0] < pair[1] && pair[1] < b->node_count);
        scene->pairs[b->first_pair + e / 2][e % 2] = b->first_slot + pair[e % 2];
      }
    }
    // The checksum covers the text and all geometry that other files hold.
    uint64_t hash = sonde_hash(0, text, strlen(text));
    for (uint32_t i = 0; i < scene->body_count && !status; ++i) {
      const sonde_body *b = &scene->bodies[i];
      hash = sonde_hash(hash, b->surface.vertices, b->surface.vertex_count * sizeof(sonde_vec3));
      hash = sonde_hash(hash, b->surface.faces, b->surface.face_count * sizeof *b->surface.faces);
      hash = sonde_hash(hash, b->node, b->node_count * sizeof *b->node);
      const sonde_model *model = b->model ? b->model : b->solid;
      if (model) hash = sonde_hash(hash, &model->checksum, sizeof model->checksum);
    }
    scene->checksum = hash;
  } else
    status = sonde_fail_memory(error);
  sonde_reader_destroy(source.reader);
  if (status)
    sonde_scene_destroy(scene);
  else
    *out = scene;
  return status;
}

sonde_status sonde_scene_load(const char *path, const char *thigh, sonde_scene **scene,
                              sonde_error *error) {
  SONDE_ASSERT(path && scene);
  char *text = NULL;
  size_t count;
  *scene = NULL;
  sonde_status status = sonde_bounded_load_text(path, &sonde_limits_yaml, &text, &count, error);
  if (!status) status = sonde_scene_parse(text, path, thigh, scene, error);
  sonde_free(text);
  return status;
}

void sonde_scene_destroy(sonde_scene *scene) {
  if (!scene) return;
  // A body that was only begun is beyond the count, but its memory is zeroed.
  for (uint32_t i = 0; i < scene->body_count; ++i) sonde_body_clear(&scene->bodies[i]);
  sonde_free(scene->bodies);
  sonde_free(scene->touches);
  sonde_free(scene->materials);
  sonde_free(scene->pairs);
  sonde_free(scene->pins);
  sonde_free(scene);
}
