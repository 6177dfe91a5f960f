// Oracles of the solid: patch, Boussinesq, Hayes, Kirsch, Eshelby; locking with and without mean
// dilatation; volume.
#include "interior/blocks.h"

#include <stdio.h>

// Distances from the axis or from the surface: even to `a`, then growing to `end`.
static void graded(double *x, uint32_t even, uint32_t count, double a, double end) {
  double ratio = 1.0, step = a / even;
  for (double reach = 0; reach < end - a; ratio += 1e-3) {
    reach = 0;
    double d = step;
    for (uint32_t i = even + 1; i < count; ++i) d *= ratio, reach += d;
  }
  for (uint32_t i = 0; i < count; ++i) {
    double d = step * ratio;
    x[i] = i <= even ? step * i : x[i - 1];
    if (i > even) {
      for (uint32_t k = even + 1; k < i; ++k) d *= ratio;
      x[i] += d;
    }
  }
}

// A quarter of a round block: radii, quarter turn, depths; rests below and at the far side.
enum { TURN = 9, RADII = 24, DEPTHS = 22 };
static block quarter(const double *r, const double *z, uint32_t nz, double poisson) {
  block b = block_create(RADII, TURN, nz, 1e3, 1e3 * block_bulk(poisson));
  for (uint32_t k = 0; k < nz; ++k)
    for (uint32_t j = 0; j < TURN; ++j)
      for (uint32_t i = 0; i < RADII; ++i) {
        uint32_t node = block_node(&b, i, j, k);
        double t = SONDE_PI / 2 * j / (TURN - 1), radius = i == 0 ? 0.02 * r[1] : r[i];
        b.solid.node[node] = vec3(radius * cos(t), radius * sin(t), z[k]);
        if (j == 0) b.solid.held[node] |= 2;
        if (j == TURN - 1) b.solid.held[node] |= 1;
        if (k + 1 == nz || i + 1 == RADII) b.solid.held[node] = 7;
      }
  return b;
}

// Uniform pressure on a circle of a large block: stress on the axis p (1 - z^3/(a^2+z^2)^1.5) and
// the settlement of the centre p a (1 - nu)/G (Timoshenko and Goodier).
static void boussinesq_under_a_round_load(void **state) {
  (void)state;
  double r[RADII], z[DEPTHS], a = 1, nu = 0.49, pressure = 10;
  graded(r, 8, RADII, 1, 40);
  graded(z, 8, DEPTHS, 1.4, 40);
  block b = quarter(r, z, DEPTHS, nu);
  for (uint32_t j = 0; j + 1 < TURN; ++j)
    for (uint32_t i = 0; i < 8; ++i)
      for (uint32_t c = 0; c < 4; ++c) {
        uint32_t node = block_node(&b, i + (c == 1 || c == 2), j + (c >= 2), 0);
        double in = i == 0 ? 0 : r[i], out = r[i + 1], sector = SONDE_PI / 2 / (TURN - 1);
        b.last[node] = 1; // consistent forces of a ring sector: more goes to the outer corners
        double outer = sector *
                       ((out * out * out - in * in * in) / 3 - in * (out * out - in * in) / 2) /
                       (out - in);
        double all = sector * (out * out - in * in) / 2;
        b.load[3 * node + 2] += pressure * 0.5 * (c == 1 || c == 2 ? outer : all - outer);
      }
  block_solve(&b);
  double settled = sonde_solid_moved(&b.solid, block_node(&b, 0, 4, 0)).z;
  double expected = pressure * a * (1 - nu) / 1e3;
  print_message("settlement %.5f, half space %.5f\n", settled, expected);
  assert_true(fabs(settled - expected) < 0.04 * expected);
  double worst = 0;
  for (uint32_t k = 1; k < 13; ++k) {
    double mean = 0, depth = 0.5 * (z[k] + z[k + 1]);
    uint32_t h = k * (TURN - 1) * (RADII - 1);
    for (uint32_t j = 0; j + 1 < TURN; ++j)
      mean += sonde_solid_stress(&b.solid, b.solid.x, h + j * (RADII - 1)).m[2][2] / (TURN - 1);
    double exact = -pressure * (1 - pow(depth * depth / (a * a + depth * depth), 1.5));
    worst = fmax(worst, fabs(mean - exact));
  }
  print_message("stress on the axis: worst %.3f of the pressure\n", worst / pressure);
  assert_true(worst < 0.03 * pressure);
  block_clear(&b);
}

// Rigid flat punch without friction on a layer bonded to a rigid base: F = 4 G a w k/(1 - nu)
// (Hayes, Keer, Herrmann and Mockros 1972, table 1).
static void hayes_punch_on_a_layer(void **state) {
  (void)state;
  static const struct {
    double poisson, aspect, factor;
  } row[] = {{0.45, 0.4, 1.599}, {0.45, 1.0, 3.085}, {0.30, 1.0, 2.480}};
  for (size_t n = 0; n < SONDE_COUNT_OF(row); ++n) {
    double r[RADII], z[14], height = 1 / row[n].aspect, w = 0.01, force = 0;
    graded(r, 10, RADII, 1, 6 * fmax(1, height));
    for (uint32_t k = 0; k < 14; ++k) z[k] = height * pow(k / 13.0, 1.4);
    block b = quarter(r, z, 14, row[n].poisson);
    for (uint32_t j = 0; j < TURN; ++j)
      for (uint32_t i = 0; i <= 10; ++i) block_give(&b, block_node(&b, i, j, 0), 2, w);
    block_solve(&b);
    for (uint32_t i = 0; i < b.solid.node_count; ++i) force += 4 * b.reaction[3 * i + 2];
    double got = force * (1 - row[n].poisson) / (4 * 1e3 * w);
    print_message("Hayes nu %.2f a/h %.1f: %.3f, table %.3f\n", row[n].poisson, row[n].aspect, got,
                  row[n].factor);
    assert_true(fabs(got - row[n].factor) < 0.05 * row[n].factor);
    block_clear(&b);
  }
}

// A plate in plane strain, polar grid from radius `inner` to `outer`, quarter of the turn; the
// displacement of the outside is given by `far`.
static block plate(double inner, double outer, uint32_t ni, double poisson,
                   sonde_vec3 (*far)(sonde_vec3 p, double poisson)) {
  enum { NJ = 17 };
  block b = block_create(ni, NJ, 2, 1e3, 1e3 * block_bulk(poisson));
  for (uint32_t k = 0; k < 2; ++k)
    for (uint32_t j = 0; j < NJ; ++j)
      for (uint32_t i = 0; i < ni; ++i) {
        uint32_t node = block_node(&b, i, j, k);
        double t = SONDE_PI / 2 * j / (NJ - 1), r = inner * pow(outer / inner, i / (ni - 1.0));
        b.solid.node[node] = vec3(r * cos(t), r * sin(t), 0.1 * k);
        b.solid.held[node] = (unsigned char)(4 | (j == 0 ? 2 : 0) | (j == NJ - 1 ? 1 : 0));
        if (i + 1 < ni) continue;
        sonde_vec3 u = far(b.solid.node[node], poisson);
        if (j < NJ - 1) block_give(&b, node, 0, u.x);
        if (j > 0) block_give(&b, node, 1, u.y);
      }
  return b;
}

// Plane strain around a hole of radius 1 under uniaxial tension S along x: displacement (2G = 2e3).
static sonde_vec3 kirsch(sonde_vec3 p, double nu) {
  double r = hypot(p.x, p.y), t = atan2(p.y, p.x), k = 3 - 4 * nu, s = 1, g = 1e3;
  double ur = s / (8 * g) *
              (r * (k - 1 + 2 * cos(2 * t)) + 2 / r * (1 + (k + 1) * cos(2 * t)) -
               2 / (r * r * r) * cos(2 * t));
  double ut = s / (8 * g) * (-2 * r - 2 / r * (k - 1) - 2 / (r * r * r)) * sin(2 * t);
  return vec3(ur * cos(t) - ut * sin(t), ur * sin(t) + ut * cos(t), 0);
}

static void kirsch_hole_concentrates_threefold(void **state) {
  (void)state;
  enum { NI = 41 };
  block b = plate(1, 10, NI, 0.49, kirsch);
  block_solve(&b);
  double exact[2] = {3, -1}, got[2];
  for (int side = 0; side < 2; ++side) { // hoop stress at the hole beside and along the tension
    uint32_t j = side == 0 ? 15 : 0;
    double first = 0, second = 0;
    sonde_mat3 m0 = sonde_solid_stress(&b.solid, b.solid.x, j * (NI - 1)),
               m1 = sonde_solid_stress(&b.solid, b.solid.x, j * (NI - 1) + 1);
    first = side == 0 ? m0.m[0][0] : m0.m[1][1], second = side == 0 ? m1.m[0][0] : m1.m[1][1];
    got[side] = 1.5 * first - 0.5 * second; // from the elements' middles to the hole
  }
  print_message("hoop stress at the hole: %.3f and %.3f\n", got[0], got[1]);
  for (int side = 0; side < 2; ++side) assert_true(fabs(got[side] - exact[side]) < 0.1);
  block_clear(&b);
}

static sonde_vec3 pure_shear(sonde_vec3 p, double nu) {
  (void)nu;
  return vec3(0.01 * p.x, -0.01 * p.y, 0);
}

// A cylinder in an incompressible matrix under far pure shear strains evenly by 2/(1 + mu_i/mu_m)
// of it (Eshelby 1957, plane strain).
static void eshelby_inclusion_strains_evenly(void **state) {
  (void)state;
  enum { NI = 49, NJ = 17 };
  static const double ratio[] = {0.1, 0.5, 4, 20};
  for (size_t n = 0; n < SONDE_COUNT_OF(ratio); ++n) {
    block b = plate(0.005, 25, NI, 0.499, pure_shear);
    uint32_t inside = (uint32_t)lround((NI - 1) * log(1 / 0.005) / log(25 / 0.005));
    double edge = 0.005 * pow(25 / 0.005, inside / (NI - 1.0));
    for (uint32_t h = 0; h < b.solid.hex_count; ++h)
      if (h % (NI - 1) < inside) b.solid.hex[h].shear_pa *= ratio[n];
    block_solve(&b);
    double expected = 2 / (1 + ratio[n]) * 0.01;
    sonde_vec3 x = sonde_solid_moved(&b.solid, block_node(&b, inside, 0, 0)),
               y = sonde_solid_moved(&b.solid, block_node(&b, inside, NJ - 1, 0));
    sonde_vec3 half = sonde_solid_moved(&b.solid, block_node(&b, inside / 2, 0, 0));
    double half_r = b.solid.node[block_node(&b, inside / 2, 0, 0)].x;
    print_message("Eshelby %.1f: strain %.5f %.5f, half way %.5f, expected %.5f\n", ratio[n],
                  x.x / edge, -y.y / edge, half.x / half_r, expected);
    assert_true(fabs(x.x / edge - expected) < 0.03 * expected);
    assert_true(fabs(y.y / edge + expected) < 0.03 * expected);
    assert_true(fabs(half.x / half_r - expected) < 0.04 * expected);
    block_clear(&b);
  }
}

// A bonded layer pressed by a frictionless punch: the force of full integration runs away with the
// bulk modulus on a coarse mesh, mean dilatation keeps it.
static double layer_force(double poisson, bool plain) {
  double r[RADII], z[4] = {0, 0.25, 0.6, 1}, force = 0;
  graded(r, 4, RADII, 0.5, 8);
  block b = quarter(r, z, 4, poisson);
  b.solid.plain = plain;
  for (uint32_t j = 0; j < TURN; ++j)
    for (uint32_t i = 0; i <= 4; ++i) block_give(&b, block_node(&b, i, j, 0), 2, 0.01);
  block_solve(&b);
  for (uint32_t i = 0; i < b.solid.node_count; ++i) force += b.reaction[3 * i + 2];
  block_clear(&b);
  return force;
}

static void mean_dilatation_does_not_lock(void **state) {
  (void)state;
  double soft[2], hard[2];
  for (int plain = 0; plain < 2; ++plain) {
    soft[plain] = layer_force(0.45, plain), hard[plain] = layer_force(0.4999, plain);
    print_message("%s: force at nu 0.45 %.2f, at 0.4999 %.2f\n", plain ? "plain" : "mean",
                  soft[plain], hard[plain]);
  }
  // The exact ratio at a/h = 0.5 is about (1.85/0.5)/(1.8/0.55) = 1.15 (Hayes' table).
  assert_true(hard[0] / soft[0] < 1.35);
  assert_true(hard[1] / soft[1] > 2.0);
}

// Bricks of any shape under a linear motion strain evenly.
static void skewed_bricks_pass_the_patch(void **state) {
  (void)state;
  block b = block_create(4, 4, 4, 1e3, 30e3);
  for (uint32_t i = 0; i < b.solid.node_count; ++i) {
    uint32_t x = i % 4, y = i / 4 % 4, z = i / 16;
    bool middle = x % 3 && y % 3 && z % 3;
    double d = middle ? 0.15 : 0;
    b.solid.node[i] = vec3(x + d * sin(3.0 * i), y + d * cos(5.0 * i), z + d * sin(7.0 * i));
    if (middle) continue;
    sonde_vec3 p = b.solid.node[i];
    block_give(&b, i, 0, 1e-3 * (p.x + 2 * p.y));
    block_give(&b, i, 1, 1e-3 * (3 * p.y - p.z));
    block_give(&b, i, 2, 1e-3 * (-2 * p.z + p.x));
  }
  block_solve(&b);
  for (uint32_t h = 0; h < b.solid.hex_count; ++h) {
    sonde_mat3 s = sonde_solid_stress(&b.solid, b.solid.x, h);
    double volume = (30e3 - 2e3 / 3) * 2e-3;
    assert_true(fabs(s.m[0][0] - 2 - volume) < 0.03 && fabs(s.m[1][1] - 6 - volume) < 0.03);
    assert_true(fabs(s.m[0][1] - 2) < 0.03 && fabs(s.m[0][2] - 1) < 0.03);
  }
  block_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(skewed_bricks_pass_the_patch),
      cmocka_unit_test(mean_dilatation_does_not_lock),
      cmocka_unit_test(boussinesq_under_a_round_load),
      cmocka_unit_test(hayes_punch_on_a_layer),
      cmocka_unit_test(kirsch_hole_concentrates_threefold),
      cmocka_unit_test(eshelby_inclusion_strains_evenly),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
