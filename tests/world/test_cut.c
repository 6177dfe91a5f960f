// Laws of a cut between two steps: what goes on unchanged, what opens, what gets softer.
#include "../fixture.h"
#include "tissue/two_layer/linearise.h"

#include <stdio.h>

enum { LEVELS = 4 };

static sonde_surface_law coupled_law(void) {
  sonde_surface_law law = sonde_surface_law_default();
  law.edge_stiffness_n_m = 200;
  law.shear_stiffness_n_m = 60;
  return law;
}

typedef struct bench {
  sonde_model *model;
  sonde_state *state;
} bench;

static bench make(const sonde_surface_law *law, const sonde_world_def *def) {
  bench b = {.model = fixture_model(LEVELS, law)};
  const sonde_world_def usual = fixture_world_def();
  assert_int_equal(sonde_state_create(b.model, def ? def : &usual, &b.state, NULL), SONDE_OK);
  return b;
}

static void clear(bench *b) {
  sonde_state_destroy(b->state);
  sonde_model_destroy(b->model);
}

// A point of the skin as it is now, in the direction (1, y, z).
static sonde_vec3 on_skin(const bench *b, double y, double z) {
  sonde_vec3 out = v_unit(vec3(1, y, z), vec3(1, 0, 0)), best = vec3(0, 0, 0);
  double most = -1;
  for (uint32_t i = 0; i < b->model->surface.vertex_count; ++i) {
    double facing = v_dot(out, v_unit(b->model->surface.vertices[i], out));
    if (facing > most) most = facing, best = sonde_state_positions(b->state)[i];
  }
  return best;
}

// Cuts and lets the old state go.
static sonde_status cut(bench *b, const sonde_vec3 *path, uint32_t count, sonde_cut_map *map) {
  bench next;
  sonde_error error = {0};
  sonde_status status =
      sonde_state_cut(b->state, path, count, &next.model, &next.state, map, &error);
  if (status) return status;
  clear(b);
  *b = next;
  return SONDE_OK;
}

static void cut_line(bench *b, double y0, double z0, double y1, double z1, sonde_cut_map *map) {
  const sonde_vec3 path[2] = {on_skin(b, y0, z0), on_skin(b, y1, z1)};
  assert_int_equal(cut(b, path, 2, map), SONDE_OK);
}

static void poke(bench *b, const sonde_probe *probe, double depth_m, int steps) {
  for (int k = 1; k <= steps; ++k)
    sonde_step(b->state, probe, fixture_pose(depth_m * k / steps - 1e-3));
}

typedef struct motion {
  double mass, kinetic, elastic;
  sonde_vec3 momentum, push;
} motion;

static motion measure(const bench *b) {
  motion m = {.elastic = sonde_tissue_energy(b->model, sonde_state_positions(b->state))};
  for (uint32_t i = 0; i < b->model->surface.vertex_count; ++i) {
    sonde_vec3 v = sonde_state_velocities(b->state)[i];
    m.mass += b->model->mass_kg[i];
    m.kinetic += 0.5 * b->model->mass_kg[i] * v_norm2(v);
    m.momentum = v_madd(m.momentum, b->model->mass_kg[i], v);
    m.push = v_add(m.push, sonde_state_contact_forces(b->state)[i]);
  }
  return m;
}

// In the middle of a push, right through the patch under the probe.
static void motion_goes_on(void **state) {
  (void)state;
  sonde_surface_law law = coupled_law();
  law.edge_pretension_n = 0.2;
  sonde_world_def def = fixture_world_def();
  def.friction.mu_static = def.friction.mu_kinetic = 0.4;
  bench b = make(&law, &def);
  sonde_probe probe;
  assert_int_equal(sonde_probe_create("square", &probe, NULL), SONDE_OK);
  poke(&b, &probe, 8e-3, 40);
  motion was = measure(&b);
  sonde_contact contact = *sonde_state_contact(b.state);
  assert_true(was.kinetic > 1e-6 && v_norm(was.push) > 0.3);
  sonde_cut_map map;
  cut_line(&b, -0.4, 0.02, 0.4, 0.02, &map);
  assert_true(map.added > 4);
  motion is = measure(&b);
  assert_near(is.mass / was.mass, 1, 1e-12);
  assert_near(is.kinetic / was.kinetic, 1, 1e-12);
  assert_near(is.elastic / was.elastic, 1, 1e-12);
  assert_true(v_distance(is.momentum, was.momentum) < 1e-12 * v_norm(was.momentum));
  assert_true(v_distance(is.push, was.push) < 1e-12 * v_norm(was.push));
  assert_int_equal(sonde_state_tick(b.state), 40);
  assert_memory_equal(sonde_state_contact(b.state), &contact, sizeof contact);
  sonde_step(b.state, &probe, fixture_pose(7.2e-3));
  sonde_vec3 change = v_sub(sonde_state_contact(b.state)->force_n, contact.force_n);
  assert_true(v_norm(change) < 0.2 * v_norm(contact.force_n));
  assert_int_equal(sonde_state_flags(b.state), 0);
  sonde_cut_map_clear(&map);
  sonde_probe_clear(&probe);
  clear(&b);
}

static void rest_stays_rest(void **state) {
  (void)state;
  sonde_surface_law law = coupled_law();
  bench b = make(&law, NULL);
  cut_line(&b, -0.4, 0.02, 0.4, 0.02, NULL);
  for (int k = 0; k < 100; ++k) sonde_step(b.state, NULL, fixture_pose(0));
  for (uint32_t i = 0; i < b.model->surface.vertex_count; ++i)
    assert_true(v_distance(sonde_state_positions(b.state)[i], b.model->surface.vertices[i]) == 0);
  assert_int_equal(sonde_state_awake(b.state), 0);
  assert_int_equal(sonde_state_flag_count(b.state), 0);
  clear(&b);
}

// What a probe feels in the step after a cut on the other side is what it feels without.
static void far_cut_is_not_felt(void **state) {
  (void)state;
  sonde_surface_law law = coupled_law();
  sonde_world_def def = fixture_world_def();
  def.friction.mu_static = def.friction.mu_kinetic = 0.4;
  def.pcg = (sonde_pcg_options){1e-13, 1e-300, 5000};
  def.newton_iterations = 8;
  bench a = make(&law, &def), b = make(&law, &def);
  sonde_probe probe;
  assert_int_equal(sonde_probe_create("square", &probe, NULL), SONDE_OK);
  poke(&a, &probe, 4e-3, 20);
  poke(&b, &probe, 4e-3, 20);
  const sonde_vec3 path[2] = {vec3(-0.06, 0, 0), vec3(-0.052, 0.03, 0)};
  assert_int_equal(cut(&b, path, 2, NULL), SONDE_OK);
  sonde_pose pose = fixture_pose(3.2e-3);
  pose.position.y += 1e-4;
  sonde_step(a.state, &probe, pose);
  sonde_step(b.state, &probe, pose);
  sonde_vec3 f = sonde_state_contact(a.state)->force_n, g = sonde_state_contact(b.state)->force_n;
  assert_true(v_norm(f) > 0.5 && fabs(f.y) > 1e-3);
  assert_true(v_distance(f, g) < 1e-10 * v_norm(f));
  sonde_probe_clear(&probe);
  clear(&a);
  clear(&b);
}

// Pull of the surface springs across the plane z = 0.02 x within |y| < 0.2 x: sum of their
// components along the plane's normal. A node belongs to the side of its faces.
static double tension_across(const bench *b) {
  const sonde_model *model = b->model;
  const sonde_vec3 *rest = model->surface.vertices, *x = sonde_state_positions(b->state);
  const sonde_vec3 across = v_unit(vec3(-0.02, 0, 1), vec3(0, 0, 1));
  double sum = 0;
  for (uint32_t e = 0; e < model->topology.edge_count; ++e) {
    double side[2];
    bool near = true;
    for (int k = 0; k < 2; ++k) {
      uint32_t i = model->topology.edges[e][k];
      near = near && rest[i].x > 0 && fabs(rest[i].y) < 0.2 * rest[i].x;
      side[k] = 0;
      for (uint32_t f = model->topology.face_start[i]; f < model->topology.face_start[i + 1]; ++f)
        for (int c = 0; c < 3; ++c)
          side[k] += v_dot(across, rest[model->surface.faces[model->topology.face_list[f]][c]]);
    }
    if (!near || (side[0] > 0) == (side[1] > 0)) continue;
    sonde_vec3 d = v_sub(x[model->topology.edges[e][1]], x[model->topology.edges[e][0]]);
    double share = model->edge_share ? model->edge_share[e] : 1, length = v_norm(d);
    double pull = model->law.edge_pretension_n +
                  model->law.edge_stiffness_n_m * (length - model->edge_rest_m[e]);
    sum += share * pull * fabs(v_dot(across, d)) / length;
  }
  return sum;
}

// A skin under tension, asleep, opens along the cut and nowhere else.
static void stretched_skin_opens(void **state) {
  (void)state;
  sonde_surface_law law = sonde_surface_law_default();
  law.edge_pretension_n = 0.5;
  bench b = make(&law, NULL);
  sonde_vec3 *still = SONDE_NEW(sonde_vec3, b.model->surface.vertex_count);
  sonde_state_set(b.state, NULL, still); // awake
  for (int k = 0; k < 500; ++k) sonde_step(b.state, NULL, fixture_pose(0));
  assert_int_equal(sonde_state_awake(b.state), 0);
  assert_true(tension_across(&b) > 1);
  sonde_cut_map map;
  cut_line(&b, -0.4, 0.02, 0.4, 0.02, &map);
  assert_true(sonde_state_awake(b.state) >= 2 * map.added);
  const sonde_vec3 *x = sonde_state_positions(b.state);
  for (uint32_t k = 0; k < map.added; ++k)
    assert_true(v_distance(x[map.origin[k]], x[map.node_count + k]) == 0);
  for (int k = 0; k < 500; ++k) sonde_step(b.state, NULL, fixture_pose(0));
  x = sonde_state_positions(b.state);
  double widest = 0;
  for (uint32_t k = 0; k < map.added; ++k) {
    double gap = v_distance(x[map.origin[k]], x[map.node_count + k]);
    assert_true(gap > 1e-5);
    widest = fmax(widest, gap);
  }
  assert_true(widest > 5e-4 && widest < 0.02);
  assert_true(tension_across(&b) == 0);
  assert_int_equal(sonde_state_flag_count(b.state), 0);
  sonde_free(still);
  sonde_cut_map_clear(&map);
  clear(&b);
}

// Skin beside the probe helps to carry it until it is cut off.
static void pressing_beside_a_cut_is_softer(void **state) {
  (void)state;
  sonde_surface_law law = coupled_law();
  bench b = make(&law, NULL);
  sonde_probe probe;
  assert_int_equal(sonde_probe_create("point", &probe, NULL), SONDE_OK);
  sonde_settle_result whole = sonde_settle(b.state, &probe, fixture_pose(5e-3), 1e-9, 200);
  cut_line(&b, -0.4, 0.12, 0.4, 0.12, NULL);
  sonde_settle_result beside = sonde_settle(b.state, &probe, fixture_pose(5e-3), 1e-9, 200);
  cut_line(&b, -0.4, -0.12, 0.4, -0.12, NULL);
  sonde_settle_result between = sonde_settle(b.state, &probe, fixture_pose(5e-3), 1e-9, 200);
  assert_true(whole.converged && beside.converged && between.converged);
  assert_true(beside.contact_n < 0.98 * whole.contact_n);
  assert_true(between.contact_n < 0.98 * beside.contact_n);
  assert_near(between.reaction_n / between.contact_n, 1, 1e-6);
  sonde_probe_clear(&probe);
  clear(&b);
}

// A stroke of up to 30 mm on the +x half.
static void random_stroke(const bench *b, uint64_t *seed, sonde_vec3 path[2]) {
  double y = fixture_random(seed), z = fixture_random(seed);
  path[0] = on_skin(b, y, z);
  path[1] = on_skin(b, y + 0.4 * fixture_random(seed), z + 0.4 * fixture_random(seed));
}

// Strokes on the moving skin while the probe wanders over them.
static void many_cuts_and_pokes(void **state) {
  (void)state;
  sonde_surface_law law = coupled_law();
  bench b = make(&law, NULL);
  sonde_probe probe;
  assert_int_equal(sonde_probe_create("square", &probe, NULL), SONDE_OK);
  uint64_t seed = 77;
  uint32_t done = 0, refused = 0;
  double work = 0, mass = 0, area = 0;
  while (done < 50 && refused < 100) {
    sonde_pose pose = fixture_pose(4e-3 * fixture_random(&seed));
    for (int k = 0; k < 4; ++k) sonde_step(b.state, &probe, pose);
    sonde_vec3 path[2];
    random_stroke(&b, &seed, path);
    sonde_cut_map map;
    sonde_status status = cut(&b, path, 2, &map);
    work += (double)map.work;
    done += status == SONDE_OK;
    refused += status != SONDE_OK;
    sonde_cut_map_clear(&map);
  }
  assert_int_equal(done, 50);
  printf("50 cuts of %u nodes: %.0f edges looked at, %u refused\n", b.model->surface.vertex_count,
         work / done, refused);
  for (int k = 0; k < 1000; ++k) {
    double t = k * 1e-3;
    sonde_pose pose = fixture_pose(5e-3 * sin(40 * t));
    pose.position.y = 0.02 * sin(7 * t);
    pose.position.z = 0.02 * sin(11 * t);
    sonde_step(b.state, &probe, pose);
    assert_int_equal(sonde_state_flags(b.state), 0);
    assert_true(v_norm(sonde_state_contact(b.state)->force_n) < 200);
  }
  for (uint32_t i = 0; i < b.model->surface.vertex_count; ++i) {
    assert_true(v_finite(sonde_state_positions(b.state)[i]));
    mass += b.model->mass_kg[i];
    area += b.model->area_m2[i];
  }
  bench fresh = make(&law, NULL);
  motion was = measure(&fresh);
  assert_near(mass / was.mass, 1, 1e-12);
  assert_near(area * law.surface_density_kg_m2 / was.mass, 1, 1e-12);
  clear(&fresh);
  sonde_probe_clear(&probe);
  clear(&b);
}

static uint64_t run_with_cut(uint64_t *skin) {
  sonde_surface_law law = coupled_law();
  bench b = make(&law, NULL);
  sonde_probe probe;
  assert_int_equal(sonde_probe_create("square", &probe, NULL), SONDE_OK);
  poke(&b, &probe, 6e-3, 30);
  cut_line(&b, -0.4, 0.02, 0.4, 0.12, NULL);
  poke(&b, &probe, 6e-3, 30);
  *skin = sonde_hash(0, b.model->surface.faces,
                     b.model->surface.face_count * sizeof *b.model->surface.faces);
  uint64_t hash = sonde_state_hash(b.state);
  sonde_probe_clear(&probe);
  clear(&b);
  return hash;
}

static void equal_cuts_are_equal(void **state) {
  (void)state;
  uint64_t skin[2], hash[2];
  for (int k = 0; k < 2; ++k) hash[k] = run_with_cut(&skin[k]);
  assert_true(hash[0] == hash[1] && skin[0] == skin[1]);
  printf("state %016llx, skin %016llx\n", (unsigned long long)hash[0], (unsigned long long)skin[0]);
}

// A refused cut leaves the state as it was.
static void refused_cut_changes_nothing(void **state) {
  (void)state;
  bench b = make(NULL, NULL);
  uint64_t hash = sonde_state_hash(b.state);
  const sonde_vec3 path[2] = {vec3(0.06, 0, 0), vec3(0.1, 0, 0)};
  sonde_model *model;
  sonde_state *after;
  sonde_cut_map map;
  sonde_error error = {0};
  assert_int_equal(sonde_state_cut(b.state, path, 2, &model, &after, &map, &error), SONDE_ARGUMENT);
  assert_null(model);
  assert_null(after);
  assert_null(map.path);
  assert_true(sonde_state_hash(b.state) == hash);
  clear(&b);
}

static uint32_t allocations_left, blocks;

static void *allocate(size_t bytes, void *user) {
  (void)user;
  if (allocations_left == 0) return NULL;
  allocations_left--;
  blocks++;
  return malloc(bytes);
}

static void release(void *pointer, void *user) {
  (void)user;
  if (pointer) blocks--;
  free(pointer);
}

// Whichever allocation fails, the cut says so, leaks nothing and leaves the state alone.
static void every_allocation_may_fail(void **state) {
  (void)state;
  allocations_left = UINT32_MAX;
  sonde_set_allocator(&(sonde_allocator){allocate, release, NULL});
  bench b = make(NULL, NULL);
  uint64_t hash = sonde_state_hash(b.state);
  const sonde_vec3 path[2] = {on_skin(&b, -0.4, 0.02), on_skin(&b, 0.4, 0.02)};
  uint32_t before = blocks, n = 0;
  for (sonde_status status = SONDE_MEMORY; status; ++n) {
    sonde_model *model;
    sonde_state *after;
    sonde_cut_map map;
    allocations_left = n;
    status = sonde_state_cut(b.state, path, 2, &model, &after, &map, NULL);
    assert_true(status == SONDE_OK || status == SONDE_MEMORY);
    sonde_cut_map_clear(&map);
    sonde_state_destroy(after);
    sonde_model_destroy(model);
    assert_int_equal(blocks, before);
  }
  assert_true(n > 20 && sonde_state_hash(b.state) == hash);
  clear(&b);
  assert_int_equal(blocks, 0);
  sonde_set_allocator(&(sonde_allocator){NULL, NULL, NULL});
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(motion_goes_on),
      cmocka_unit_test(rest_stays_rest),
      cmocka_unit_test(far_cut_is_not_felt),
      cmocka_unit_test(stretched_skin_opens),
      cmocka_unit_test(pressing_beside_a_cut_is_softer),
      cmocka_unit_test(many_cuts_and_pokes),
      cmocka_unit_test(equal_cuts_are_equal),
      cmocka_unit_test(refused_cut_changes_nothing),
      cmocka_unit_test(every_allocation_may_fail),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
