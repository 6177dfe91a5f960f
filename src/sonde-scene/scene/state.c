// A scene's motion: memory, start, measures.
#include "scene/touch.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

// Room for contact. All pairs of a few bodies may touch at once; among many bodies those that do
// are shared a pool: a body meets about a dozen neighbours at most.
enum {
  POINTS_LEAST = 2048,
  POINTS_MOST = 32768,
  POINTS_PER_BODY = 512,
  POINTS_LIMIT = 262144,
  PIECES_LEAST = 4096,
  PIECES_MOST = 65536,
  REGIONS = 64,
  NEIGHBOURS = 12
};

// Counts bytes while block is NULL, else hands out aligned parts of it.
typedef struct carver {
  char *block;
  size_t used;
} carver;

static void *carve(carver *c, size_t count, size_t size) {
  size_t at = (c->used + 15u) & ~(size_t)15u;
  c->used = at + count * size;
  return c->block ? c->block + at : NULL;
}

#define CARVE(at, count) ((at) = carve(c, (count), sizeof *(at)))

static void lay_motion(const sonde_scene_state *state, carver *c, sonde_scene_motion *motion) {
  const sonde_scene *scene = state->scene;
  CARVE(motion->head, 1);
  CARVE(motion->position, scene->slot_count);
  CARVE(motion->velocity, scene->slot_count);
  CARVE(motion->increment, scene->slot_count);
  CARVE(motion->rotation, scene->body_count);
  CARVE(motion->hint, scene->touch_count);
  CARVE(motion->bond_first, scene->touch_count);
  CARVE(motion->entry, scene->touch_count);
  CARVE(motion->deep, scene->touch_count);
  CARVE(motion->release, scene->touch_count);
  CARVE(motion->pair, scene->touch_count);
  CARVE(motion->calm_s, scene->body_count);
  CARVE(motion->self_j, scene->body_count);
  CARVE(motion->asleep, scene->body_count);
  CARVE(motion->calm, scene->slot_count);
  CARVE(motion->bond, 0);
  motion->fixed = c->used;
  CARVE(motion->bond, state->bond_capacity);
}

static void lay_arrays(sonde_scene_state *s, carver *c) {
  const sonde_scene *scene = s->scene;
  size_t bodies = scene->body_count, touches = scene->touch_count;
  size_t slots = scene->slot_count;
  sonde_vec3 **const all[] = {
      &s->stage_position,  &s->stage_velocity, &s->force,     &s->product,   &s->contact_force,
      &s->contact_product, &s->residual,       &s->change,    &s->move,      &s->gain,
      &s->mean_velocity,   &s->scratch.r,      &s->scratch.z, &s->scratch.p, &s->scratch.q};
  for (size_t k = 0; k < SONDE_COUNT_OF(all); ++k) *all[k] = carve(c, slots, sizeof(sonde_vec3));
  CARVE(s->plain_diagonal, slots);
  CARVE(s->active_rows, slots);
  CARVE(s->moving, slots);
  CARVE(s->active_pairs, scene->pair_count);
  CARVE(s->part_rows, slots);
  CARVE(s->part_rim, slots);
  CARVE(s->part_edges, scene->pair_count);
  CARVE(s->in_rim, slots);
  uint32_t most = 0, faces = 0;
  for (uint32_t b = 0; b < scene->body_count; ++b) {
    const sonde_body *body = &scene->bodies[b];
    faces += body->surface.face_count;
    if (body->model && body->node_count > most) most = body->node_count;
  }
  CARVE(s->part_faces, faces);
  CARVE(s->moved_faces, faces);
  CARVE(s->moved_count, bodies);
  CARVE(s->face_first, bodies);
  CARVE(s->tissue_nodes, most);
  CARVE(s->stage_rotation, bodies);
  CARVE(s->surface, s->surface_count);
  CARVE(s->surface_first, bodies);
  CARVE(s->inertia, bodies);
  CARVE(s->reach_m, bodies);
  CARVE(s->thickness_m, bodies);
  CARVE(s->section_m2, bodies);
  CARVE(s->displacement, bodies);
  CARVE(s->cast_box, bodies);
  CARVE(s->cast_known, bodies);
  CARVE(s->fitted, bodies);
  CARVE(s->body_inverse, bodies);
  CARVE(s->solid, bodies);
  CARVE(s->part, bodies);
  CARVE(s->island, bodies);
  CARVE(s->loose, bodies);
  CARVE(s->keeps_awake, bodies);
  CARVE(s->is_held, bodies);
  CARVE(s->tree, bodies);
  CARVE(s->touch_of, bodies * bodies);
  CARVE(s->near, s->near_capacity);
  CARVE(s->near_touch, touches);
  CARVE(s->found_hint, touches);
  CARVE(s->bounds, bodies);
  CARVE(s->pushes, s->push_capacity);
  CARVE(s->grips, s->grip_capacity);
  CARVE(s->terms, s->term_capacity);
  CARVE(s->rows, s->row_capacity);
  CARVE(s->g, s->row_capacity);
  CARVE(s->bond_load, s->bond_capacity);
  CARVE(s->bond_sum, s->bond_capacity);
}

static sonde_status allocate(sonde_scene_state *state, sonde_error *error) {
  // Room for contact: columns with a push and two tangents each, regions over all vertices twice.
  const sonde_scene *scene = state->scene;
  uint64_t points = 0, bonds = 0;
  uint32_t bulk = 0, creases = 0, bodies = scene->body_count;
  for (uint32_t b = 0; b < scene->body_count; ++b) {
    state->surface_count += scene->bodies[b].surface.vertex_count;
    bulk += scene->bodies[b].node_count;
    creases += scene->bodies[b].crease_count;
  }
  for (uint32_t t = 0; t < scene->touch_count; ++t) {
    const sonde_body *a = &scene->bodies[scene->touches[t].a];
    const sonde_body *b = &scene->bodies[scene->touches[t].b];
    points += 16 * ((uint64_t)a->surface.face_count + b->surface.face_count);
    if (scene->touches[t].mu_static > 0)
      bonds += (scene->touches[t].bond_side ? b : a)->surface.vertex_count;
  }
  uint32_t most = POINTS_PER_BODY * bodies < POINTS_LIMIT ? POINTS_PER_BODY * bodies : POINTS_LIMIT;
  if (most < POINTS_MOST) most = POINTS_MOST;
  if (scene->touch_count && points < POINTS_LEAST) points = POINTS_LEAST;
  uint32_t pairs = scene->touch_count, room = points < most ? (uint32_t)points : most;
  if (pairs > NEIGHBOURS * bodies) pairs = NEIGHBOURS * bodies;
  state->grip_capacity = room;
  state->push_capacity =
      room + REGIONS * pairs + 3 * scene->pin_count + creases + 2 * scene->self_nodes;
  state->term_capacity = state->push_capacity + 2 * room + bodies;
  state->bulk_row_capacity = bulk;
  state->row_capacity = bulk + 3 * 8 * room + 2 * state->surface_count + 4 * state->push_capacity;
  SONDE_ASSERT(state->row_capacity >= bulk + 12 * scene->pin_count + 4 * creases);
  uint64_t shared = NEIGHBOURS * (uint64_t)state->surface_count;
  state->bond_capacity = (uint32_t)(bonds < shared ? bonds : shared);
  state->near_capacity = scene->body_count * (scene->body_count - 1) / 2;
  sonde_scene_motion *const motion[] = {&state->now, &state->undo, &state->saved, &state->whole};
  for (size_t k = 0; k < SONDE_COUNT_OF(motion); ++k) {
    carver c = {0};
    lay_motion(state, &c, motion[k]);
    motion[k]->block = c.block = sonde_calloc(1, c.used);
    if (!motion[k]->block) return sonde_fail_memory(error);
    c.used = 0;
    lay_motion(state, &c, motion[k]);
  }
  carver arrays = {0};
  lay_arrays(state, &arrays);
  state->block = arrays.block = sonde_calloc(1, arrays.used);
  if (!state->block) return sonde_fail_memory(error);
  arrays.used = 0;
  lay_arrays(state, &arrays);
  uint32_t surface = 0, face = 0;
  for (uint32_t b = 0; b < scene->body_count; ++b) {
    const sonde_body *body = &scene->bodies[b];
    state->surface_first[b] = surface;
    state->face_first[b] = face;
    face += body->surface.face_count;
    surface += body->surface.vertex_count;
    double area = 0;
    state->thickness_m[b] = sonde_mesh_thickness(&body->surface, &area);
    state->section_m2[b] = area / 4;
    if (!sonde_body_is_rigid(body)) continue;
    // The inertia is symmetric: the columns of its inverse are the cross products of its rows.
    sonde_vec3 r[3];
    for (int i = 0; i < 3; ++i) {
      const double *row = body->mass.inertia_kg_m2.m[i];
      r[i] = vec3(row[0], row[1], row[2]);
    }
    double determinant = v_dot(r[0], v_cross(r[1], r[2]));
    SONDE_ASSERT(determinant > 0);
    sonde_mat3 inverse = m_columns(v_cross(r[1], r[2]), v_cross(r[2], r[0]), v_cross(r[0], r[1]));
    state->body_inverse[b] = m_scale(inverse, 1 / determinant);
    for (uint32_t i = 0; i < body->surface.vertex_count; ++i)
      state->reach_m[b] = fmax(state->reach_m[b], v_norm(body->surface.vertices[i]));
  }
  SONDE_ASSERT(surface == state->surface_count);
  return SONDE_OK;
}

// A tree of a body's faces as they are at the start, unless there is one.
static sonde_status make_tree(sonde_scene_state *state, uint32_t b, sonde_error *error) {
  if (state->tree[b]) return SONDE_OK;
  sonde_mesh start = state->scene->bodies[b].surface;
  start.vertices = state->surface + state->surface_first[b];
  sonde_surface_at(state, b, state->now.position, state->now.rotation, start.vertices);
  return sonde_face_tree_create(&start, &state->tree[b], error);
}

// The common volumes of all pairs are found one after the other in the same memory, which has room
// for the largest pair: large faces of rigid bodies carry three columns per piece, others one.
static sonde_status make_overlaps(sonde_scene_state *state, sonde_error *error) {
  const sonde_scene *scene = state->scene;
  sonde_overlap_config config[2] = {{.points_per_piece = 1}, {.points_per_piece = 3}};
  const sonde_face_tree *tree[2] = {NULL, NULL};
  sonde_status status = SONDE_OK;
  for (uint32_t t = 0; t < scene->touch_count && !status; ++t) {
    const sonde_touch *touch = &scene->touches[t];
    bool rigid = sonde_body_is_rigid(&scene->bodies[touch->a]) &&
                 sonde_body_is_rigid(&scene->bodies[touch->b]);
    int k = touch->law == SONDE_TOUCH_FOUNDATION && rigid;
    const uint32_t ends[2] = {touch->a, touch->b};
    uint32_t pieces = 0;
    for (int s = 0; s < 2 && !status; ++s) {
      const sonde_mesh *mesh = &scene->bodies[ends[s]].surface;
      pieces += 16 * mesh->face_count;
      if (mesh->face_count > config[k].max_faces) config[k].max_faces = mesh->face_count;
      if (mesh->vertex_count > config[k].max_vertices) config[k].max_vertices = mesh->vertex_count;
      status = make_tree(state, ends[s], error);
    }
    if (pieces > config[k].max_pieces) config[k].max_pieces = pieces;
    tree[k] = state->tree[touch->a];
  }
  // What may go through itself is looked at without others, too.
  for (uint32_t b = 0; b < scene->body_count && !status; ++b)
    if (!sonde_body_is_rigid(&scene->bodies[b])) status = make_tree(state, b, error);
  for (int k = 0; k < 2 && !status; ++k) {
    if (!tree[k]) continue;
    if (config[k].max_pieces < PIECES_LEAST) config[k].max_pieces = PIECES_LEAST;
    if (config[k].max_pieces > PIECES_MOST) config[k].max_pieces = PIECES_MOST;
    config[k].max_points = 2 * config[k].max_pieces;
    config[k].max_regions = REGIONS;
    status = sonde_overlap_create(tree[k], tree[k], &config[k], &state->overlap[k], error);
  }
  return status;
}

sonde_status sonde_scene_state_create(const sonde_scene *scene, sonde_scene_state **out,
                                      sonde_error *error) {
  SONDE_ASSERT(scene && out);
  *out = NULL;
  sonde_scene_state *state = SONDE_NEW(sonde_scene_state, 1);
  if (!state) return sonde_fail_memory(error);
  state->scene = scene;
  sonde_status status = allocate(state, error);
  if (!status) {
    sonde_scene_state_reset(state);
    uint32_t n = scene->body_count;
    status = sonde_sweep_create(n, &state->sweep, error);
    for (uint32_t b = 0; b < n; ++b) // beyond everything, so that it meets nothing
      state->bounds[b] = (sonde_bounds){{1e9 + 10 * b, 1e9, 1e9}, {1e9 + 10 * b + 1, 1e9, 1e9}};
    for (uint32_t t = 0; t < scene->touch_count; ++t) {
      const sonde_touch *touch = &scene->touches[t];
      state->touch_of[touch->a * n + touch->b] = state->touch_of[touch->b * n + touch->a] = t + 1;
    }
    if (!status) status = make_overlaps(state, error);
  }
  if (!status)
    status = sonde_block_matrix_create(scene->slot_count, scene->pair_count,
                                       (const uint32_t(*)[2])scene->pairs, &state->matrix, error);
  for (uint32_t b = 0; b < scene->body_count && !status; ++b)
    if (scene->bodies[b].solid)
      status = sonde_bulk_blocks_create(scene->bodies[b].solid, &state->solid[b], error);
  if (status) {
    sonde_scene_state_destroy(state);
    return status;
  }
  for (uint32_t b = 0; b < scene->body_count; ++b) {
    const sonde_body *body = &scene->bodies[b];
    bool anchored = body->model || (body->solid && body->solid->bulk->held_count);
    state->loose[b] = body->motion == SONDE_BODY_FREE && !anchored;
    for (uint32_t k = 0; k < body->node_count; ++k) state->loose[b] &= !body->held[k];
  }
  for (uint32_t k = 0; k < scene->pin_count; ++k)
    for (int s = 0; s < 2; ++s)
      if (scene->pins[k].end[1 - s].body == UINT32_MAX)
        state->loose[scene->pins[k].end[s].body] = false;
  sonde_sleep_list(state);
  *out = state;
  return SONDE_OK;
}

void sonde_scene_state_destroy(sonde_scene_state *state) {
  if (!state) return;
  for (uint32_t b = 0; state->block && b < state->scene->body_count; ++b) {
    sonde_face_tree_destroy(state->tree[b]);
    sonde_bulk_blocks_destroy(state->solid[b]);
  }
  sonde_overlap_destroy(state->overlap[0]);
  sonde_overlap_destroy(state->overlap[1]);
  sonde_sweep_destroy(state->sweep);
  sonde_block_matrix_destroy(state->matrix);
  sonde_free(state->now.block);
  sonde_free(state->undo.block);
  sonde_free(state->saved.block);
  sonde_free(state->whole.block);
  sonde_free(state->block);
  sonde_free(state);
}

void sonde_scene_state_reset(sonde_scene_state *state) {
  sonde_scene_motion_unbond(&state->now);
  memset(state->now.block, 0, state->now.fixed);
  state->report = (sonde_scene_report){0};
  sonde_touch_forget(state);
  for (uint32_t b = 0; b < state->scene->body_count; ++b) {
    const sonde_body *body = &state->scene->bodies[b];
    state->now.rotation[b] = quat_identity();
    if (sonde_body_is_rigid(body)) {
      SONDE_ASSERT(body->slot_count == 2);
      uint32_t s = body->first_slot;
      state->now.position[s] = pose_apply(body->start, body->mass.centre_m);
      state->now.rotation[b] = body->start.rotation;
      if (body->motion != SONDE_BODY_FREE) continue;
      state->now.velocity[s] = body->velocity_m_s;
      state->now.velocity[s + 1] = body->spin_rad_s;
      continue;
    }
    for (uint32_t i = 0; i < body->node_count; ++i) {
      sonde_vec3 arm = v_sub(body->node[i], body->mass.centre_m);
      state->now.position[body->first_slot + i] = body->node[i];
      if (!body->held[i])
        state->now.velocity[body->first_slot + i] =
            v_add(body->velocity_m_s, v_cross(body->spin_rad_s, arm));
    }
  }
  sonde_sleep_start(state);
}

// ---- readers

sonde_scene_report sonde_scene_last(const sonde_scene_state *state) { return state->report; }
uint64_t sonde_scene_flag_count(const sonde_scene_state *state) {
  return state->now.head->flag_count;
}
uint32_t sonde_scene_all_flags(const sonde_scene_state *state) {
  return state->now.head->all_flags;
}
sonde_scene_event sonde_scene_first(const sonde_scene_state *state, uint32_t flag) {
  uint32_t k = 0;
  while (k < SONDE_SCENE_FLAGS && flag != 1u << k) ++k;
  SONDE_ASSERT(k < SONDE_SCENE_FLAGS);
  return state->now.head->event[k];
}
uint64_t sonde_scene_tick(const sonde_scene_state *state) { return state->now.head->tick; }
double sonde_scene_time(const sonde_scene_state *state) { return state->now.head->time_s; }

uint64_t sonde_scene_hash(const sonde_scene_state *state) {
  return sonde_hash(0, state->now.block, sonde_scene_motion_bytes(&state->now));
}

const sonde_vec3 *sonde_scene_nodes(const sonde_scene_state *state, uint32_t b) {
  SONDE_ASSERT(b < state->scene->body_count);
  const sonde_body *body = &state->scene->bodies[b];
  return sonde_body_is_rigid(body) ? NULL : state->now.position + body->first_slot;
}

const sonde_vec3 *sonde_scene_node_velocities(const sonde_scene_state *state, uint32_t b) {
  SONDE_ASSERT(b < state->scene->body_count);
  const sonde_body *body = &state->scene->bodies[b];
  return sonde_body_is_rigid(body) ? NULL : state->now.velocity + body->first_slot;
}

void sonde_scene_set_nodes(sonde_scene_state *state, uint32_t b, const sonde_vec3 *positions,
                           const sonde_vec3 *velocities) {
  SONDE_ASSERT(b < state->scene->body_count);
  const sonde_body *body = &state->scene->bodies[b];
  size_t bytes = body->node_count * sizeof(sonde_vec3);
  if (positions) memcpy(state->now.position + body->first_slot, positions, bytes);
  if (velocities) memcpy(state->now.velocity + body->first_slot, velocities, bytes);
  memset(state->now.calm + body->first_slot, 0, body->slot_count);
  sonde_touch_forget(state);
  state->now.asleep[b] = 0;
  state->now.calm_s[b] = 0;
}

void sonde_scene_surface(const sonde_scene_state *state, uint32_t b, sonde_vec3 *vertices) {
  SONDE_ASSERT(b < state->scene->body_count);
  sonde_surface_at(state, b, state->now.position, state->now.rotation, vertices);
}

sonde_pair_measure sonde_scene_pair_measure(const sonde_scene_state *state, uint32_t pair) {
  SONDE_ASSERT(pair < state->scene->touch_count);
  return state->now.pair[pair];
}

sonde_body_measure sonde_scene_measure(const sonde_scene_state *state, uint32_t b) {
  SONDE_ASSERT(b < state->scene->body_count);
  const sonde_body *body = &state->scene->bodies[b];
  sonde_body_measure m = {0};
  if (sonde_body_is_rigid(body)) {
    m.centre_m = state->now.position[body->first_slot];
    m.velocity_m_s = state->now.velocity[body->first_slot];
    m.spin_rad_s = state->now.velocity[body->first_slot + 1];
    m.rotation = state->now.rotation[b];
    sonde_vec3 angular =
        m_mul_v(sonde_inertia_world(body->mass.inertia_kg_m2, m.rotation), m.spin_rad_s);
    m.momentum_kg_m_s = v_scale(m.velocity_m_s, body->mass.mass_kg);
    m.angular_kg_m2_s = v_add(angular, v_cross(m.centre_m, m.momentum_kg_m_s));
    m.kinetic_j = 0.5 * (v_dot(m.velocity_m_s, m.momentum_kg_m_s) + v_dot(m.spin_rad_s, angular));
  } else {
    const sonde_vec3 *x = state->now.position + body->first_slot;
    const sonde_vec3 *v = state->now.velocity + body->first_slot;
    sonde_vec3 sum = vec3(0, 0, 0);
    for (uint32_t i = 0; i < body->node_count; ++i) {
      sonde_vec3 p = v_scale(v[i], body->node_mass_kg[i]);
      sum = v_madd(sum, body->node_mass_kg[i], x[i]);
      m.momentum_kg_m_s = v_add(m.momentum_kg_m_s, p);
      m.angular_kg_m2_s = v_add(m.angular_kg_m2_s, v_cross(x[i], p));
      m.kinetic_j += 0.5 * v_dot(v[i], p);
    }
    m.centre_m = v_scale(sum, 1 / body->mass.mass_kg);
    m.velocity_m_s = v_scale(m.momentum_kg_m_s, 1 / body->mass.mass_kg);
    m.rotation = quat_identity();
    m.elastic_j = body->model   ? sonde_tissue_energy(body->model, x)
                  : body->solid ? sonde_bulk_energy(state->solid[b], x)
                                : sonde_network_energy(body, x);
    m.elastic_j += state->now.self_j[b];
  }
  if (body->motion == SONDE_BODY_FREE && sonde_body_weighs(body))
    m.gravity_j = -body->mass.mass_kg * v_dot(state->scene->gravity_m_s2, m.centre_m);
  return m;
}

// ---- facts about the scene

uint32_t sonde_scene_body_count(const sonde_scene *scene) { return scene->body_count; }
const char *sonde_scene_title(const sonde_scene *scene) { return scene->title; }
double sonde_scene_duration(const sonde_scene *scene) { return scene->duration_s; }
sonde_vec3 sonde_scene_gravity(const sonde_scene *scene) { return scene->gravity_m_s2; }
uint32_t sonde_scene_pair_count(const sonde_scene *scene) { return scene->touch_count; }
sonde_scene_step sonde_scene_get_step(const sonde_scene *scene) { return scene->step; }

sonde_body_info sonde_scene_body(const sonde_scene *scene, uint32_t b) {
  SONDE_ASSERT(b < scene->body_count);
  const sonde_body *body = &scene->bodies[b];
  uint32_t springs = body->model ? body->model->topology.edge_count : body->spring_count;
  return (sonde_body_info){.name = body->name,
                           .kind = body->kind,
                           .motion = body->motion,
                           .node_count = body->node_count,
                           .spring_count = springs,
                           .surface = &body->surface,
                           .mass = body->mass};
}

uint32_t sonde_scene_find(const sonde_scene *scene, const char *name) {
  for (uint32_t b = 0; b < scene->body_count; ++b)
    if (strcmp(scene->bodies[b].name, name) == 0) return b;
  return UINT32_MAX;
}

sonde_scene_pair sonde_scene_pair_at(const sonde_scene *scene, uint32_t pair) {
  SONDE_ASSERT(pair < scene->touch_count);
  const sonde_touch *t = &scene->touches[pair];
  return (sonde_scene_pair){t->a,       t->b,         t->law,       t->stiffness,
                            t->damping, t->mu_static, t->mu_kinetic};
}
