// Laws of the contact in batches: what the probe does to each node, and the matrix of it, are what
// a sum over the points of all faces gives in double precision. And of the order of a node's
// neighbours.
#include "../fixture.h"
#include "tissue/model.h"
#include "world/batches.h"
#include "world/contact.h"
#include "tissue/two_layer/fan.h"
#include "geometry/internal.h"

typedef struct bench {
  const sonde_model *model;
  sonde_state *state;
  sonde_batches *body;
  uint32_t n;
  sonde_vec3 *x, *force, *z,
      *out; // places, pushes, a vector and the matrix times it: the reference
} bench;

// A dented and rumpled skin.
static bench make(const sonde_model *model, sonde_contact_law law) {
  sonde_world_def def = fixture_world_def();
  def.contact_law = law;
  def.engine = sizeof(real) == sizeof(float) ? SONDE_ENGINE_FAST : SONDE_ENGINE_DOUBLE;
  bench b = {.model = model, .n = model->surface.vertex_count};
  assert_int_equal(sonde_state_create(model, &def, &b.state, NULL), SONDE_OK);
  sonde_vec3 **array[] = {&b.x, &b.force, &b.z, &b.out};
  for (int k = 0; k < 4; ++k) assert_non_null(*array[k] = SONDE_NEW(sonde_vec3, b.n));
  uint64_t seed = 5;
  for (uint32_t i = 0; i < b.n; ++i)
    b.x[i] = v_add(model->surface.vertices[i], fixture_vector(&seed, 1e-3));
  for (uint32_t i = 0; i < b.n; ++i) b.z[i] = fixture_vector(&seed, 1);
  sonde_state_set(b.state, b.x, NULL);
  b.body = sonde_batches_of(b.state);
  b.body->common.calls->import(&b.body->common, model->surface.vertices, b.x, b.state->velocity,
                               true);
  return b;
}

static void clear(bench *b) {
  sonde_vec3 *array[] = {b->x, b->force, b->z, b->out};
  for (int k = 0; k < 4; ++k) sonde_free(array[k]);
  sonde_state_destroy(b->state);
}

// Depth of a point and its gradient: under the plane of least weighted distance, or in the ball.
static bool depth_at(const sonde_state *s, sonde_vec3 x, double *depth, sonde_vec3 *slope) {
  if (s->ball_radius > 0) {
    sonde_vec3 d = v_sub(s->ball_centre, x);
    *depth = s->ball_radius - v_norm(d);
    *slope = v_scale(d, 1 / v_norm(d));
    return *depth > 0 && v_dot(*slope, s->inward) <= 1e-9;
  }
  *depth = INFINITY;
  for (uint32_t k = 0; k < s->plane_count; ++k) {
    double t = s->plane_weight[k] * (s->plane_offset[k] - v_dot(s->plane_normal[k], x));
    if (t < *depth) *depth = t, *slope = v_scale(s->plane_normal[k], -s->plane_weight[k]);
  }
  return *depth > 0 && v_dot(*slope, s->inward) <= 1e-9;
}

// Pressure kappa t + mu dt/dt at a point of some nodes, times its area, never a pull.
static void push_point(bench *b, const uint32_t *v, const double *w, int count, double area,
                       const sonde_motion *probe) {
  const double h = b->state->def.dt_s, kappa = b->state->def.contact_stiffness_n_m3;
  double depth, mu = b->state->def.contact_damping_n_s_m3;
  sonde_vec3 x = vec3(0, 0, 0), z = x, slope;
  for (int k = 0; k < count; ++k) x = v_madd(x, w[k], b->x[v[k]]), z = v_madd(z, w[k], b->z[v[k]]);
  if (!depth_at(b->state, x, &depth, &slope)) return;
  sonde_vec3 carried = v_add(probe->velocity, v_cross(probe->spin, v_sub(x, probe->origin)));
  double push = area * (kappa * depth - mu * v_dot(slope, carried));
  if (!(push > 0)) return;
  double along = area * (h * h * kappa + h * mu) * v_dot(slope, z);
  for (int k = 0; k < count; ++k) {
    b->force[v[k]] = v_madd(b->force[v[k]], -w[k] * push, slope);
    b->out[v[k]] = v_madd(b->out[v[k]], w[k] * along, slope);
  }
}

static void refer(bench *b, sonde_contact_law law, const sonde_motion *probe) {
  static const double points[4][3] = {{1.0 / 3, 1.0 / 3, 1.0 / 3},
                                      {2.0 / 3, 1.0 / 6, 1.0 / 6},
                                      {1.0 / 6, 2.0 / 3, 1.0 / 6},
                                      {1.0 / 6, 1.0 / 6, 2.0 / 3}};
  const double whole_node = 1;
  if (law == SONDE_CONTACT_NODES)
    for (uint32_t i = 0; i < b->n; ++i)
      push_point(b, &i, &whole_node, 1, b->model->area_m2[i], probe);
  else
    for (uint32_t f = 0; f < b->model->surface.face_count; ++f)
      for (int q = 0; q < 4; ++q)
        push_point(b, b->model->surface.faces[f], points[q], 3, b->model->face_area_m2[f] / 4,
                   probe);
}

static sonde_vec3 force_of(const sonde_batches *body, uint32_t i) {
  uint32_t at = body->contact_of[i / SONDE_BATCH];
  return at ? sonde_batch_vector(body->contact[at - 1].force, i % SONDE_BATCH) : vec3(0, 0, 0);
}

// The contact's part of the matrix times z: from blocks of whole rows, or from those on the
// diagonal.
static sonde_vec3 product_of(const sonde_batches *body, uint32_t i, sonde_vec3 z) {
  uint32_t at = body->contact_of[i / SONDE_BATCH], l = i % SONDE_BATCH;
  if (!at) return vec3(0, 0, 0);
  const sonde_batch_contact *contact = &body->contact[at - 1];
  double m[6];
  for (int c = 0; c < 6; ++c)
    m[c] = (double)contact->block[c][l] -
           (body->corners_coupled ? (double)contact->neighbours[c][l] : 0);
  sonde_vec3 rows = vec3(m[0] * z.x + m[1] * z.y + m[2] * z.z, m[1] * z.x + m[3] * z.y + m[4] * z.z,
                         m[2] * z.x + m[4] * z.y + m[5] * z.z);
  quad taken = contact->product[l];
  return v_sub(rows, vec3((double)taken[0], (double)taken[1], (double)taken[2]));
}

// Shares of the volume of the law NODES: a column of the depth under each node.
static void check_shares(const bench *b) {
  const sonde_state *s = b->state;
  double area = 0;
  uint32_t touched = 0;
  for (uint32_t i = 0; i < b->n; ++i) {
    double depth;
    sonde_vec3 slope;
    if (!depth_at(s, b->x[i], &depth, &slope)) continue;
    assert_int_equal(s->touched[touched++], i);
    assert_near(s->share_m3[i], b->model->area_m2[i] * depth, 1e-12);
    sonde_vec3 g = v_scale(v_unit(slope, slope), b->model->area_m2[i]);
    assert_near(v_distance(s->gradient[i], g), 0, 1e-9);
    area += b->model->area_m2[i];
  }
  assert_int_equal(s->touched_count, touched);
  assert_near(s->contact.area_m2, area, 1e-9);
}

static void compare(bench *b) {
  const double exact = sizeof(real) == sizeof(double) ? 1e-8 : 1;
  double force = 0, force_off = 0, product = 0, product_off = 0, volume = 0;
  for (uint32_t i = 0; i < b->n; ++i) {
    const double c[3] = {b->z[i].x, b->z[i].y, b->z[i].z};
    for (int k = 0; k < 3; ++k) b->body->probe_move[i * SONDE_QUAD + (uint32_t)k] = (real)c[k];
  }
  sonde_batches_couple(b->body, b->body->probe_move);
  for (uint32_t i = 0; i < b->n; ++i) {
    force = fmax(force, v_norm(b->force[i]));
    force_off = fmax(force_off, v_distance(force_of(b->body, i), b->force[i]));
    product = fmax(product, v_norm(b->out[i]));
    product_off = fmax(product_off, v_distance(product_of(b->body, i, b->z[i]), b->out[i]));
    volume += b->state->share_m3[i];
  }
  assert_true(force > 1 && product > 0);
  assert_near(force_off, 0, 1e-4 * exact * force);
  assert_near(product_off, 0, 2e-5 * exact * product);
  assert_near(b->state->contact.volume_m3, volume, 1e-6 * volume);
  assert_true(b->state->contact.region_count > 0);
}

// Single precision leaves 2^-24 of a number, and of the rest as much.
static void check_origin(const sonde_batch_probe *probe, sonde_vec3 place) {
  const double at[3] = {place.x, place.y, place.z};
  for (int c = 0; c < 3; ++c)
    assert_near((double)probe->origin[c] + (double)probe->origin_low[c], at[c],
                1e-14 * fabs(at[c]));
}

static void push_once(const char *name, sonde_contact_law law, double depth_m, double tilt_rad,
                      bool coupled) {
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
  b.body->corners_coupled = coupled;
  sonde_batches_detect(b.state, b.body, &probe, pose, &motion);
  check_origin(&b.body->probe, pose.position);
  refer(&b, law, &motion);
  if (law == SONDE_CONTACT_NODES) check_shares(&b);
  compare(&b);
  clear(&b);
  sonde_probe_clear(&probe);
  sonde_model_destroy(model);
}

static void pushes_are_those_of_all_points(void **state) {
  (void)state;
  for (int coupled = 0; coupled < 2; ++coupled) {
    push_once("linear", SONDE_CONTACT_FOUNDATION, 0.008, 0, coupled);
    push_once("linear", SONDE_CONTACT_FOUNDATION, 0.012, 0.4, coupled);
    push_once("sphere", SONDE_CONTACT_FOUNDATION, 0.012, 0.1, coupled);
  }
  push_once("linear", SONDE_CONTACT_NODES, 0.008, 0.2, false);
  push_once("ball:20", SONDE_CONTACT_NODES, 0.012, 0, false);
}

static sonde_fan fan_of(const sonde_model *model, uint32_t i, uint32_t room[2][64]) {
  sonde_fan fan = {.node = room[0], .face = room[1]};
  sonde_fan_find(model, i, &fan);
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
  const struct CMUnitTest tests[] = {cmocka_unit_test(pushes_are_those_of_all_points),
                                     cmocka_unit_test(fans_go_round_every_node)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
