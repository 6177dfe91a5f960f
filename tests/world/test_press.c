// Laws of the fast engine's contact: what the probe does to each node, and the matrix of it, are
// those of the double engine. And of the order of a node's neighbours.
#include "../fixture.h"
#include "sparse/block.h"
#include "tissue/model.h"
#include "world/contact.h"
#include "world/lanes.h"
#include "world/state.h"
#include "geometry/internal.h"

typedef struct bench {
  sonde_state *precise, *fast;
} bench;

// Both states with the same dented and rumpled skin.
static bench make(const sonde_model *model, sonde_contact_law law) {
  sonde_world_def def = sonde_world_def_default();
  def.contact_law = law;
  bench b;
  assert_int_equal(sonde_state_create(model, &def, &b.precise, NULL), SONDE_OK);
  def.engine = SONDE_ENGINE_FAST;
  assert_int_equal(sonde_state_create(model, &def, &b.fast, NULL), SONDE_OK);
  uint32_t n = model->surface.vertex_count;
  sonde_vec3 *x = calloc(n, sizeof *x);
  uint64_t seed = 5;
  for (uint32_t i = 0; i < n; ++i)
    x[i] = v_add(model->surface.vertices[i], fixture_vector(&seed, 1e-3));
  sonde_state_set(b.precise, x, NULL);
  sonde_state_set(b.fast, x, NULL);
  sonde_lanes_import(b.fast->lanes, model->surface.vertices, x, b.fast->velocity, true);
  free(x);
  return b;
}

static void clear(bench *b) {
  sonde_state_destroy(b->precise);
  sonde_state_destroy(b->fast);
}

static sonde_vec3 press_of(const sonde_lanes *lanes, uint32_t i) {
  uint32_t at = lanes->press_of[i / SONDE_LANES];
  return at ? sonde_lane_vector(lanes->press[at - 1].force, i % SONDE_LANES) : vec3(0, 0, 0);
}

// The contact's part of the matrix times z, of the fast engine: from blocks of whole rows, or from
// those on the diagonal.
static sonde_vec3 product_of(const sonde_lanes *lanes, uint32_t i, sonde_vec3 z) {
  uint32_t at = lanes->press_of[i / SONDE_LANES], l = i % SONDE_LANES;
  if (!at) return vec3(0, 0, 0);
  const sonde_slice_press *press = &lanes->press[at - 1];
  double m[6];
  for (int c = 0; c < 6; ++c)
    m[c] = (double)press->block[c][l] - (lanes->tied ? (double)press->tied[c][l] : 0);
  sonde_vec3 whole =
      vec3(m[0] * z.x + m[1] * z.y + m[2] * z.z, m[1] * z.x + m[3] * z.y + m[4] * z.z,
           m[2] * z.x + m[4] * z.y + m[5] * z.z);
  sonde_quad carry = lanes->press[at - 1].carry[l];
  return v_sub(whole, vec3((double)carry[0], (double)carry[1], (double)carry[2]));
}

// The double engine clips faces to find shares of the volume, the fast one counts points.
static void compare_shares(const bench *b) {
  const sonde_state *precise = b->precise, *fast = b->fast;
  assert_int_equal(fast->touched_count, precise->touched_count);
  for (uint32_t k = 0; k < precise->touched_count; ++k) {
    uint32_t i = precise->touched[k];
    assert_int_equal(fast->touched[k], i);
    assert_near(fast->share_m3[i], precise->share_m3[i], 1e-12);
    assert_near(v_distance(fast->gradient[i], precise->gradient[i]), 0, 1e-9);
  }
  assert_near(fast->contact.area_m2, precise->contact.area_m2, 1e-9);
}

static void compare_forces(const bench *b) {
  uint32_t n = b->precise->model->surface.vertex_count;
  double most = 0, off = 0, volume = 0;
  for (uint32_t i = 0; i < n; ++i) {
    most = fmax(most, v_norm(b->precise->contact_force[i]));
    off = fmax(off, v_distance(press_of(b->fast->lanes, i), b->precise->contact_force[i]));
    volume += b->fast->share_m3[i];
  }
  assert_true(most > 1);
  assert_near(off, 0, 1e-4 * most);
  assert_near(b->fast->contact.volume_m3, volume, 1e-6 * volume);
  assert_int_equal(b->fast->contact.region_count, b->precise->contact.region_count);
}

static void compare_products(const bench *b) {
  uint32_t n = b->precise->model->surface.vertex_count;
  sonde_lanes *lanes = b->fast->lanes;
  sonde_vec3 *z = calloc(n, sizeof *z), *out = calloc(n, sizeof *out);
  uint64_t seed = 9;
  double most = 0, off = 0;
  for (uint32_t i = 0; i < n; ++i) {
    z[i] = fixture_vector(&seed, 1);
    const double c[3] = {z[i].x, z[i].y, z[i].z};
    for (int k = 0; k < 3; ++k) lanes->probe_way[i * SONDE_QUAD + (uint32_t)k] = (float)c[k];
  }
  lanes->kernels->carry(lanes, lanes->probe_way);
  sonde_active_set all = {b->precise->rows, n, b->precise->pairs, b->precise->pair_count};
  sonde_block_multiply(b->precise->matrix, &all, NULL, 0, z, out);
  for (uint32_t i = 0; i < n; ++i) {
    most = fmax(most, v_norm(out[i]));
    off = fmax(off, v_distance(product_of(lanes, i, z[i]), out[i]));
  }
  assert_true(most > 0);
  assert_near(off, 0, 2e-5 * most);
  free(z);
  free(out);
}

// Single precision leaves 2^-24 of a number, and of the rest as much.
static void check_origin(const sonde_lane_probe *probe, sonde_vec3 place) {
  const double at[3] = {place.x, place.y, place.z};
  for (int c = 0; c < 3; ++c)
    assert_near((double)probe->origin[c] + (double)probe->origin_low[c], at[c],
                1e-14 * fabs(at[c]));
}

static void press_once(const char *name, sonde_contact_law law, double depth_m, double tilt_rad,
                       bool tied) {
  sonde_model *model = fixture_model(4, NULL);
  bench b = make(model, law);
  sonde_probe probe;
  assert_int_equal(sonde_probe_create(name, &probe, NULL), SONDE_OK);
  sonde_pose pose = fixture_pose(depth_m);
  pose.position = v_add(pose.position, vec3(0, 2.1e-4, -1.3e-4));
  double half = tilt_rad / 2;
  sonde_quat turn = {cos(half), 0, 0.6 * sin(half), 0.8 * sin(half)};
  pose.rotation = q_mul(turn, pose.rotation);
  const sonde_motion motion = {pose.position, vec3(-0.05, 0.02, 0.01), vec3(0.1, 0.3, -0.2)};
  const sonde_contact_scales scales = {1e-3, 1e-6};
  sonde_state_list_awake(b.precise);
  sonde_contact_detect(b.precise, &probe, pose);
  sonde_contact_apply(b.precise, &motion, &scales);
  b.fast->lanes->tied = tied;
  sonde_press_detect(b.fast, &probe, pose, &motion);
  check_origin(&b.fast->lanes->probe, pose.position);
  if (law == SONDE_CONTACT_NODES) compare_shares(&b);
  compare_forces(&b);
  compare_products(&b);
  clear(&b);
  sonde_probe_clear(&probe);
  sonde_model_destroy(model);
}

static void presses_like_the_double_engine(void **state) {
  (void)state;
  for (int tied = 0; tied < 2; ++tied) {
    press_once("linear", SONDE_CONTACT_FOUNDATION, 0.008, 0, tied);
    press_once("linear", SONDE_CONTACT_FOUNDATION, 0.012, 0.4, tied);
    press_once("sphere", SONDE_CONTACT_FOUNDATION, 0.012, 0.1, tied);
  }
  press_once("linear", SONDE_CONTACT_NODES, 0.008, 0.2, false);
  press_once("ball:20", SONDE_CONTACT_NODES, 0.012, 0, false);
}

static sonde_fan fan_of(const sonde_model *model, uint32_t i, uint32_t room[2][64]) {
  sonde_fan fan = {.node = room[0], .face = room[1]};
  sonde_lanes_fan(model, i, &fan);
  return fan;
}

// Every face around a node is in its fan once, between its two other corners.
static void check_fan(const sonde_model *model, uint32_t i) {
  uint32_t room[2][64], found = 0;
  sonde_fan fan = fan_of(model, i, room);
  const sonde_topology *t = &model->topology;
  for (uint32_t k = 0; k < fan.count; ++k) {
    if (fan.face[k] == SONDE_NO_FACE) continue;
    const uint32_t *v = model->surface.faces[fan.face[k]];
    uint32_t own = v[0] == i ? 0 : v[1] == i ? 1 : 2, before = k > 0 ? fan.node[k - 1] : fan.last;
    assert_int_equal(v[own], i);
    assert_int_equal(v[(own + 1) % 3], before);
    assert_int_equal(v[(own + 2) % 3], fan.node[k]);
    for (uint32_t p = 0; p < k; ++p) assert_int_not_equal(fan.face[p], fan.face[k]);
    found++;
  }
  assert_int_equal(found, t->face_start[i + 1] - t->face_start[i]);
  if (fan.count > 0 && fan.face[0] != SONDE_NO_FACE)
    assert_int_equal(fan.node[fan.turn - 1], fan.last);
  for (uint32_t e = t->start[i]; e < t->start[i + 1]; ++e) {
    uint32_t seen = 0;
    for (uint32_t k = 0; k < fan.count; ++k) seen += fan.node[k] == t->neighbour[e];
    assert_true(seen > 0);
  }
}

static void check_fans(uint32_t nodes, uint32_t count, uint32_t faces[][3]) {
  sonde_model model = {.surface = {.vertex_count = nodes, .face_count = count, .faces = faces}};
  model.surface.vertices = calloc(nodes, sizeof *model.surface.vertices);
  for (uint32_t i = 0; i < nodes; ++i)
    model.surface.vertices[i] = vec3(cos(i * 1.3), sin(i * 1.3), 0.1 * i);
  assert_int_equal(sonde_topology_build(&model.surface, &model.topology, NULL), SONDE_OK);
  for (uint32_t i = 0; i < nodes; ++i) check_fan(&model, i);
  sonde_topology_clear(&model.topology);
  free(model.surface.vertices);
}

static void fans_go_round_every_node(void **state) {
  (void)state;
  sonde_model *ball = fixture_model(2, NULL);
  check_fans(ball->surface.vertex_count, ball->surface.face_count, ball->surface.faces);
  sonde_model_destroy(ball);
  uint32_t strip[][3] = {{0, 1, 2}, {2, 1, 3}, {2, 3, 4}};
  check_fans(5, 3, strip);
  // Two sheets, and two closed cones, that meet in one node.
  uint32_t tie[][3] = {{0, 1, 2}, {0, 2, 3}, {0, 4, 5}};
  check_fans(6, 3, tie);
  uint32_t glass[][3] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {0, 4, 5}, {0, 5, 6}, {0, 6, 4}};
  check_fans(7, 6, glass);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(presses_like_the_double_engine),
                                     cmocka_unit_test(fans_go_round_every_node)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
