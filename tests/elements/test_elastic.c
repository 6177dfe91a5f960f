// The elastic solid: a uniform strain is reproduced, a rigid core in a ball and a load on a half
// space meet their closed forms also where the volume hardly changes, forces and displacements
// exchange (Betti), sensitivities are derivatives, wrong input is refused.
#include "../sanitized.h"
#include "solids.h"
#include "elements/elastic.h"

static const char *const NAMES[3] = {"patch", "node", "element"};

static sonde_elastic_scratch *make_scratch(const sonde_elastic *e) {
  sonde_elastic_scratch *s = NULL;
  assert_ok(sonde_elastic_scratch_create(e, &s, &shape_error));
  return s;
}

// The patch test: nodes inside follow a displacement of the boundary that is linear in place. It
// vanishes on the plane of three held nodes.
static void test_uniform_strain(void **state) {
  (void)state;
  sonde_mesh ball = shape_sphere(10, 0.05);
  const sonde_tetrahedra_def how = {.edge_m = 0.015};
  sonde_tetrahedra t = make_mesh(&ball, NULL, &how);
  const uint32_t corner[3] = {0, t.surface_count / 3, t.surface_count / 2};
  uint8_t *held = calloc(t.node_count, 1);
  uint32_t *imposed = calloc(t.surface_count, sizeof *imposed), count = 0;
  for (int k = 0; k < 3; ++k) held[corner[k]] = 7;
  for (uint32_t k = 0; k < t.surface_count; ++k)
    if (!held[k]) imposed[count++] = k;
  sonde_vec3 origin = t.node[corner[0]];
  sonde_vec3 normal = v_unit(
      v_cross(v_sub(t.node[corner[1]], origin), v_sub(t.node[corner[2]], origin)), vec3(0, 0, 0));
  static const sonde_vec3 way[3] = {{0.3, 0, 0}, {0, -0.2, 0.1}, {0.1, 0.2, 0.3}};
  for (int kind = 0; kind < 3; ++kind) {
    const sonde_elastic_def def = {.mesh = &t, .held = held, .dilatation = (sonde_dilatation)kind};
    sonde_elastic *e = make_solid(&def, 1e4, 0.45);
    sonde_elastic_scratch *s = make_scratch(e);
    double *u = calloc(3 * (size_t)e->count, sizeof *u),
           *f = calloc(3 * (size_t)e->count, sizeof *f);
    for (int w = 0; w < 3; ++w) {
      memset(f, 0, 3 * (size_t)e->count * sizeof *f);
      for (int pass = 0; pass < 2; ++pass) {
        for (uint32_t k = 0; k < e->count; ++k) {
          sonde_vec3 want = v_scale(way[w], v_dot(normal, v_sub(e->point[k], origin)));
          const double *got = u + 3 * (size_t)k;
          if (pass == 1) assert_near(v_distance(vec3(got[0], got[1], got[2]), want), 0, 1e-12);
          u[3 * k] = want.x, u[3 * k + 1] = want.y, u[3 * k + 2] = want.z;
        }
        if (pass == 0) assert_ok(sonde_elastic_solve(e, s, imposed, count, f, u, &shape_error));
      }
    }
    free(u);
    free(f);
    sonde_elastic_scratch_destroy(s);
    sonde_elastic_destroy(e);
  }
  free(held);
  free(imposed);
  sonde_tetrahedra_clear(&t);
  sonde_mesh_clear(&ball);
}

// Force that moves the outer surface of a ball (radius b) against a rigid core (a), over the closed
// form's. With e the way and z along it, u = P e + Q z x / r^2 is the sum of e, the dipole
// grad(z / r^3), Kelvin's solution ((3 - 4 nu) e + z x / r^2) / r, which carries the force, and
// alpha r^2 e + z x. P and Q vanish at a; P is the way and Q zero at b.
static double core_error(double poisson, sonde_dilatation kind, double edge_m) {
  const double a = 0.02, b = 0.05, young = 1e4;
  sonde_tetrahedra t = held_ball(b, a, edge_m);
  const sonde_elastic_def def = {.mesh = &t, .dilatation = kind};
  sonde_elastic *e = make_solid(&def, young, poisson);
  sonde_elastic_scratch *s = make_scratch(e);
  double *u = calloc(3 * (size_t)e->count, sizeof *u), *f = calloc(3 * (size_t)e->count, sizeof *f);
  uint32_t *imposed = calloc(t.surface_count, sizeof *imposed);
  for (uint32_t k = 0; k < t.surface_count; ++k)
    imposed[k] = k, u[3 * (size_t)e->unknown[k] + 2] = 1e-3;
  if (sonde_elastic_solve(e, s, imposed, t.surface_count, f, u, &shape_error))
    fail_msg("%s", shape_error.message);
  double force = 0;
  for (uint32_t k = 0; k < t.surface_count; ++k) force += f[3 * (size_t)e->unknown[k] + 2];
  double mu = young / (2 * (1 + poisson)), k = 1 / (1 - 2 * poisson);
  double alpha = -(2 * k + 1) / (k + 3), c4 = (a * a - b * b) / (pow(b, 5) - pow(a, 5));
  double c2 = (a * a + c4 * pow(a, 5)) / 3, way = 0;
  for (int side = 0; side < 2; ++side) {
    double r = side ? b : a, p = c2 / pow(r, 3) + (3 - 4 * poisson) / r + alpha * c4 * r * r;
    way += side ? -p : p;
  }
  double expected = 16 * SONDE_PI * mu * (1 - poisson) * 1e-3 / way;
  free(u);
  free(f);
  free(imposed);
  sonde_elastic_scratch_destroy(s);
  sonde_elastic_destroy(e);
  sonde_tetrahedra_clear(&t);
  return force / expected - 1;
}

static void test_core_in_a_ball(void **state) {
  (void)state;
  const double edge = 0.007;
  for (int p = SAMPLES(0, 1); p < 2; ++p) {
    double poisson = p ? 0.499 : 0.49, off[3];
    for (int kind = 0; kind < 3; ++kind)
      off[kind] = core_error(poisson, (sonde_dilatation)kind, edge);
    print_message("core, edge %g mm, Poisson %g: force off by %+.1f %% (patch), %+.1f %% (node), "
                  "%+.1f %% (element)\n",
                  edge * 1e3, poisson, 100 * off[0], 100 * off[1], 100 * off[2]);
    assert_true(fabs(off[0]) < 0.09);
    assert_true(fabs(off[1]) < 0.13);
    assert_true(off[2] > 0.5);
  }
}

// Boussinesq: a force on a half space sinks its surface by (1 - nu^2) F / (pi E r).
static void test_half_space(void **state) {
  (void)state;
  sonde_mesh box = shape_box(1, 1, 0.5);
  for (uint32_t i = 0; i < box.vertex_count; ++i) box.vertices[i].z -= 0.5;
  const sonde_vec3 origin = {0, 0, 0};
  const sonde_tetrahedra_def how = {.edge_m = 0.3,
                                    .growth = 0.35,
                                    .fine = &origin,
                                    .fine_count = 1,
                                    .fine_edge_m = 0.0015,
                                    .fine_reach_m = 0.006};
  sonde_tetrahedra t = make_mesh(&box, NULL, &how);
  uint8_t *held = calloc(t.node_count, 1);
  for (uint32_t i = 0; i < t.node_count; ++i)
    if (t.node[i].z < -0.999) held[i] = 7;
  for (int kind = 0; kind < SAMPLES(3, 1); kind += 2)
    for (int p = kind == 0 ? SAMPLES(0, 1) : 1; p < 2; ++p) {
      double poisson = p ? 0.49 : 0.3, young = 1e4, total = 1;
      const sonde_elastic_def def = {
          .mesh = &t, .held = held, .dilatation = (sonde_dilatation)kind};
      sonde_elastic *e = make_solid(&def, young, poisson);
      sonde_elastic_scratch *s = make_scratch(e);
      double *u = calloc(3 * (size_t)e->count, sizeof *u);
      double *f = calloc(3 * (size_t)e->count, sizeof *f);
      uint32_t near = v_nearest(t.node, t.surface_count, origin);
      f[3 * (size_t)e->unknown[near] + 2] = -total;
      assert_ok(sonde_elastic_solve(e, s, NULL, 0, f, u, &shape_error));
      double sum = 0, worst = 0;
      int count = 0;
      for (uint32_t i = 0; i < t.surface_count; ++i) {
        double r = v_distance(t.node[i], t.node[near]);
        if (fabs(t.node[i].z) > 1e-9 || r < 0.006 || r > 0.015) continue;
        double expected = -(1 - poisson * poisson) * total / (SONDE_PI * young * r);
        double off = u[3 * (size_t)e->unknown[i] + 2] / expected - 1;
        sum += off, worst = fmax(worst, fabs(off)), ++count;
      }
      print_message(
          "half space, %u nodes, Poisson %g, by %s: %+.1f %% in the mean, at most %.1f %% "
          "at %d nodes\n",
          e->count, poisson, NAMES[kind], 100 * sum / count, 100 * worst, count);
      // The nearest 0.5 m are free, which leaves 2 %; single tetrahedra lock.
      assert_true(kind == 0 ? worst < 0.05 : worst > 0.1);
      free(u);
      free(f);
      sonde_elastic_scratch_destroy(s);
      sonde_elastic_destroy(e);
    }
  free(held);
  sonde_tetrahedra_clear(&t);
  sonde_mesh_clear(&box);
}

// Betti: the work of one load along the displacement of another is the same the other way round.
// Compliance by columns holds the same numbers.
static void test_exchange(void **state) {
  (void)state;
  sonde_tetrahedra t = held_ball(0.05, 0.02, 0.014);
  const sonde_elastic_def def = {.mesh = &t};
  sonde_elastic *e = make_solid(&def, 1e4, 0.48);
  sonde_elastic_scratch *s = make_scratch(e);
  const size_t n = 3 * (size_t)e->count;
  double *u[2], *f[2];
  const uint32_t nodes[2] = {3, t.surface_count / 2};
  for (int k = 0; k < 2; ++k) {
    u[k] = calloc(n, sizeof *u[k]), f[k] = calloc(n, sizeof *f[k]);
    f[k][3 * (size_t)e->unknown[nodes[k]] + (size_t)k] = 2.0 + k;
    assert_ok(sonde_elastic_solve(e, s, NULL, 0, f[k], u[k], &shape_error));
  }
  double work = sonde_dot(f[0], u[1], (uint32_t)n);
  assert_near(sonde_dot(f[1], u[0], (uint32_t)n), work, 1e-10 * fabs(work));
  for (int k = 0; k < 2; ++k) free(u[k]), free(f[k]);
  sonde_elastic_scratch_destroy(s);
  sonde_elastic_destroy(e);
  sonde_tetrahedra_clear(&t);
}

static void test_refusals(void **state) {
  (void)state;
  sonde_tetrahedra t = held_ball(0.05, 0.02, 0.02);
  sonde_elastic *e = NULL;
  uint8_t *held = calloc(t.node_count, 1);
  sonde_elastic_def def = {.mesh = &t, .held = held};
  assert_int_equal(sonde_elastic_create(&def, &e, &shape_error), SONDE_ARGUMENT);
  assert_null(e);
  // Held in one point only it can turn.
  held[0] = 7;
  double *young = calloc(t.count, sizeof *young);
  for (uint32_t k = 0; k < t.count; ++k) young[k] = 1e4;
  def.held = NULL;
  const uint32_t twice[2] = {4, 4};
  def.last = twice, def.last_count = 2;
  assert_int_equal(sonde_elastic_create(&def, &e, &shape_error), SONDE_ARGUMENT);
  def.last_count = 0;
  assert_ok(sonde_elastic_create(&def, &e, &shape_error));
  assert_int_equal(sonde_elastic_set(e, young, 0.5, 0, &shape_error), SONDE_ARGUMENT);
  assert_int_equal(sonde_elastic_set(e, young, NAN, 0, &shape_error), SONDE_ARGUMENT);
  assert_int_equal(sonde_elastic_set(e, young, 0.3, -1, &shape_error), SONDE_ARGUMENT);
  young[3] = 0;
  assert_int_equal(sonde_elastic_set(e, young, 0.3, 0, &shape_error), SONDE_ARGUMENT);
  free(held);
  free(young);
  sonde_elastic_destroy(e);
  sonde_tetrahedra_clear(&t);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_uniform_strain), cmocka_unit_test(test_core_in_a_ball),
      cmocka_unit_test(test_half_space),     cmocka_unit_test(test_exchange),
      cmocka_unit_test(test_refusals),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
