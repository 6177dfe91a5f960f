// A solid with a probe: uniform strains are reproduced, a thick-walled tube, a thick-walled sphere
// and a ball on thick and thin ground meet theory, energy equals work, one depth has one force
// whatever the way, and a probe that contains another never does less work.
#include "pressing.h"
#include "sparse/dense.h"

#include <string.h>

// ---- uniform strain -------------------------------------------------------------------------

// Nodes inside follow a large uniform deformation of the boundary, whatever the elements' shape.
static void uniform_strain_is_reproduced(void **state) {
  (void)state;
  static const double f[3][3] = {{1.25, 0.3, 0}, {-0.1, 0.85, 0.2}, {0.05, 0, 0.95}};
  sonde_error error;
  sonde_hexes mesh;
  sonde_hexes_def fine = sonde_hexes_def_default();
  fine.half_u_m = fine.half_v_m = 5e-3, fine.reach_m = 15e-3;
  check(sonde_hexes_block(20e-3, 0, 0, &fine, &mesh, &error), &error);
  uint8_t *border = calloc(mesh.node_count, 1);
  for (uint32_t n = 0; n < mesh.node_count; ++n) {
    sonde_vec3 *p = &mesh.node[n];
    border[n] = fabs(p->x) > 14.9e-3 || fabs(p->y) > 14.9e-3 || p->z > -1e-6 || p->z < -19.9e-3;
    mesh.held[n] = 0;
    if (!border[n]) // crooked elements
      *p = v_add(*p, vec3(4e-4 * sin(900 * p->y), 4e-4 * sin(700 * p->z), 4e-4 * sin(800 * p->x)));
  }
  for (int kind = 0; kind < 3; ++kind) {
    const sonde_equilibrium_def def =
        one_material((sonde_hyperelastic){(sonde_strain_energy)kind, 3000, 4, 72e3});
    sonde_equilibrium *e;
    check(sonde_equilibrium_make(&mesh, border, &def, &e, &error), &error);
    e->def.bonded = true;
    for (uint32_t k = 0; k < e->zone_count; ++k) {
      const sonde_vec3 x = mesh.node[e->zone_node[k]];
      e->imposed[k] = 1;
      e->target[k] = v_sub(m_mul_v((sonde_mat3){{{f[0][0], f[0][1], f[0][2]},
                                                 {f[1][0], f[1][1], f[1][2]},
                                                 {f[2][0], f[2][1], f[2][2]}}},
                                   x),
                           x);
    }
    sonde_equilibrium_result r = {0};
    assert_true(sonde_equilibrium_solve(e, (sonde_pose){.rotation = {1, 0, 0, 0}}, &r));
    for (uint32_t n = 0; n < mesh.node_count; ++n) {
      const sonde_vec3 x = mesh.node[n];
      const sonde_vec3 want = vec3(f[0][0] * x.x + f[0][1] * x.y + f[0][2] * x.z - x.x,
                                   f[1][0] * x.x + f[1][1] * x.y + f[1][2] * x.z - x.y,
                                   f[2][0] * x.x + f[2][1] * x.y + f[2][2] * x.z - x.z);
      assert_near(v_distance(e->moved[n], want), 0, 1e-10);
    }
    sonde_equilibrium_destroy(e);
  }
  free(border);
  sonde_hexes_clear(&mesh);
}

// ---- tube and sphere ------------------------------------------------------------------------

typedef struct tube {
  double inner, outer;
  uint32_t around;
} tube;

static sonde_vec3 place_in_tube(const void *user, double level, uint32_t u, uint32_t v) {
  const tube *t = user;
  const double r = t->inner + (t->outer - t->inner) * level / 3, a = 2 * SONDE_PI * u / t->around;
  return vec3(r * cos(a), r * sin(a), 2e-3 * v);
}

// Pressure that widens an incompressible tube in plane strain from A to a: the integral over the
// wall of (sigma_hoop - sigma_radial)/r, here by Simpson's rule.
static double tube_pressure(const sonde_hyperelastic *m, double inner, double outer, double now) {
  enum { PARTS = 400 };
  const double grown = now * now - inner * inner;
  double sum = 0;
  for (int k = 0; k <= PARTS; ++k) {
    const double rest = inner + (outer - inner) * k / PARTS, r = sqrt(rest * rest + grown);
    const double l = r / rest, a = m->exponent;
    const double apart = 2 * m->shear_pa / a * (pow(l, a) - pow(l, -a));
    const double dr = rest / r * (outer - inner) / PARTS; // dr = R dR / r
    sum += (k % 2 ? 4 : k % PARTS ? 2 : 1) * apart / r * dr / 3;
  }
  return sum;
}

static void thick_tube_at_large_strain(void **state) {
  (void)state;
  const tube t = {10e-3, 20e-3, 32};
  static const double exponents[2] = {2, 6};
  for (int kind = 0; kind < 2; ++kind) {
    double last = 0;
    for (int fine = 1; fine <= 2; ++fine) {
      sonde_error error;
      sonde_hexes mesh;
      sonde_levels levels = {.count = 3 * (uint32_t)fine * 2 + 1};
      for (uint32_t k = 0; k < levels.count; ++k) levels.at[k] = 3.0 * k / (levels.count - 1);
      const sonde_grid_shape shape = {&levels, t.around, 2, true, place_in_tube, &t};
      check(sonde_hexes_bend(&shape, &mesh, &error), &error);
      uint8_t *inside = calloc(mesh.node_count, 1);
      for (uint32_t n = 0; n < mesh.node_count; ++n) {
        mesh.held[n] = 4;
        inside[n] = hypot(mesh.node[n].x, mesh.node[n].y) < t.inner * 1.001;
      }
      // K = 2000 mu: nearly incompressible.
      const sonde_hyperelastic m = ogden(3 * kpa, exponents[kind], 2000);
      const sonde_equilibrium_def def = one_material(m);
      sonde_equilibrium *e;
      check(sonde_equilibrium_make(&mesh, inside, &def, &e, &error), &error);
      e->def.bonded = true;
      const double now = 14e-3;
      sonde_equilibrium_result r = {0};
      for (int step = 1; step <= 2; ++step) {
        for (uint32_t k = 0; k < e->zone_count; ++k) {
          e->imposed[k] = 1;
          e->target[k] = v_scale(mesh.node[e->zone_node[k]], step * (now - t.inner) / t.inner / 2);
          e->target[k].z = 0;
        }
        assert_true(sonde_equilibrium_solve(e, (sonde_pose){.rotation = {1, 0, 0, 0}}, &r));
      }
      double radial = 0;
      for (uint32_t k = 0; k < e->zone_count; ++k) {
        const sonde_vec3 p = v_unit(mesh.node[e->zone_node[k]], vec3(1, 0, 0));
        const sonde_vec3 q = v_unit(vec3(p.x, p.y, 0), vec3(1, 0, 0));
        const double *f = e->force + 3 * (size_t)(sonde_zone_first(e) + k);
        radial += f[0] * q.x + f[1] * q.y;
      }
      // The polygon's perimeter is what the pressure acts on.
      const double side = 2 * now * sin(SONDE_PI / t.around);
      const double got = radial / (side * t.around * cos(SONDE_PI / t.around) * 2e-3);
      const double want = tube_pressure(&m, t.inner, t.outer, now);
      print_message("tube, exponent %g, %u levels: %.2f Pa, closed form %.2f (%+.2f %%)\n",
                    exponents[kind], levels.count - 1, got, want, 100 * (got / want - 1));
      last = got / want - 1;
      free(inside);
      sonde_equilibrium_destroy(e);
      sonde_hexes_clear(&mesh);
    }
    assert_true(fabs(last) <= 0.015);
  }
}

// A piece of a thick sphere around its z axis.
static sonde_vec3 place_in_sphere(const void *user, double level, uint32_t u, uint32_t v) {
  const tube *t = user;
  const double r = t->inner + (t->outer - t->inner) * level / 3, half = 0.5 * t->around;
  const double a = 0.3 * (u / half - 1), b = 0.3 * (v / half - 1);
  return v_scale(v_unit(vec3(tan(a), tan(b), 1), vec3(0, 0, 1)), r);
}

// The pressure that widens an incompressible sphere from A to a is the integral over the wall of
// 2 (sigma_hoop - sigma_radial)/r, stretches r/R twice and (R/r)^2. Sides of the piece move as they
// do in the whole sphere; its outer surface is free.
static void thick_sphere_at_large_strain(void **state) {
  (void)state;
  enum { PARTS = 400 };
  const tube t = {10e-3, 20e-3, 6};
  const double now = 13e-3, grown = pow(now, 3) - pow(t.inner, 3), exponent = 4;
  sonde_error error;
  sonde_hexes mesh;
  sonde_levels levels = {.count = 13};
  for (uint32_t k = 0; k < levels.count; ++k) levels.at[k] = 3.0 * k / (levels.count - 1);
  const sonde_grid_shape shape = {&levels, t.around + 1, t.around + 1, false, place_in_sphere, &t};
  check(sonde_hexes_bend(&shape, &mesh, &error), &error);
  const uint32_t lines = t.around + 1, sheet = lines * lines;
  uint8_t *moves = calloc(mesh.node_count, 1);
  for (uint32_t n = 0; n < mesh.node_count; ++n) {
    const uint32_t u = n / lines % lines, v = n % lines;
    mesh.held[n] = 0;
    moves[n] = n < sheet || u == 0 || v == 0 || u == t.around || v == t.around;
  }
  const sonde_equilibrium_def def = one_material(ogden(3 * kpa, exponent, 2000));
  sonde_equilibrium *e;
  check(sonde_equilibrium_make(&mesh, moves, &def, &e, &error), &error);
  e->def.bonded = true;
  sonde_equilibrium_result r = {0};
  for (int step = 1; step <= 3; ++step) {
    for (uint32_t k = 0; k < e->zone_count; ++k) {
      const sonde_vec3 p = mesh.node[e->zone_node[k]];
      const double rest = v_norm(p), at = cbrt(pow(rest, 3) + grown * step / 3);
      e->imposed[k] = 1, e->target[k] = v_scale(p, at / rest - 1);
    }
    assert_true(sonde_equilibrium_solve(e, (sonde_pose){.rotation = {1, 0, 0, 0}}, &r));
  }
  // Of the node in the middle of the inner surface: force over a quarter of the faces around it.
  const uint32_t middle = t.around / 2 * lines + t.around / 2;
  double area = 0, got = 0, want = 0;
  for (uint32_t k = 0; k < 4; ++k) {
    const uint32_t at = middle - (k % 2) - (k / 2 ? lines : 0);
    const sonde_vec3 p = mesh.node[at];
    area += 0.25 * v_norm(v_cross(v_sub(mesh.node[at + 1], p), v_sub(mesh.node[at + lines], p)));
  }
  area *= pow(now / t.inner, 2);
  for (uint32_t k = 0; k < e->zone_count; ++k)
    if (e->zone_node[k] == middle) got = e->force[3 * (size_t)(sonde_zone_first(e) + k) + 2] / area;
  for (int k = 0; k <= PARTS; ++k) { // Simpson's rule
    const double rest = t.inner + (t.outer - t.inner) * k / PARTS, at = cbrt(pow(rest, 3) + grown);
    const double l = at / rest, dr = pow(rest / at, 2) * (t.outer - t.inner) / PARTS;
    const double apart = 2 * 3 * kpa / exponent * (pow(l, exponent) - pow(l, -2 * exponent));
    want += (k % 2 ? 4 : k % PARTS ? 2 : 1) * 2 * apart / at * dr / 3;
  }
  print_message("sphere: %.2f Pa, closed form %.2f (%+.2f %%), %u unknowns\n", got, want,
                100 * (got / want - 1), 3 * e->unknown_count);
  assert_near(got / want, 1, 0.02);
  free(moves);
  sonde_equilibrium_destroy(e);
  sonde_hexes_clear(&mesh);
}

// ---- contact --------------------------------------------------------------------------------

// The contact has the radius sqrt(R d).
static void ball_on_a_half_space(void **state) {
  (void)state;
  const double d = 0.25e-3, radius = 40e-3, edge = 0.75e-3, shear = 3 * kpa;
  const sonde_lines line = lines_from_middle(edge, 5, 2, 0.3);
  const ball_lines lines = {line, line, line};
  sonde_equilibrium_def def = one_material(ogden(shear, 2, 24));
  def.zone_m = 1e-3;
  bench b;
  make_ball_bench(&b, radius, &lines, &def);
  const double want = hertz_n(shear, 24, radius, d), got = 4 * find(&b, d).force_n.z;
  print_message("Hertz: %.5f N, closed form %.5f (%+.1f %%), %u unknowns, %.1f faces per radius\n",
                got, want, 100 * (got / want - 1), 3 * b.e->unknown_count, sqrt(radius * d) / edge);
  assert_near(got / want, 1, 0.05);
  // A hundredth of the way, none at all and none again: what rounding leaves of the forces of
  // elements of 0.2 m is no lack of equilibrium.
  assert_true(find(&b, d / 100).force_n.z > 0);
  for (int again = 0; again < 2; ++again) assert_near(find(&b, 0).force_n.z, 0, 1e-9);
  drop_bench(&b);
}

// Gauss-Legendre points and weights on 0 to 1, by Newton's method on the polynomial.
static void gauss(uint32_t count, double *at, double *weight) {
  for (uint32_t k = 0; k < count; ++k) {
    double x = cos(SONDE_PI * (k + 0.75) / (count + 0.5)), slope = 1;
    for (int step = 0; step < 50; ++step) {
      double p[2] = {1, x};
      for (uint32_t n = 2; n <= count; ++n) {
        const double next = ((2 * n - 1) * x * p[1] - (n - 1) * p[0]) / n;
        p[0] = p[1], p[1] = next;
      }
      slope = count * (p[0] - x * p[1]) / (1 - x * x);
      x -= p[1] / slope;
    }
    at[k] = 0.5 * (1 - x), weight[k] = 1 / ((1 - x * x) * slope * slope);
  }
}

// A ball of radius 1 that touches a layer, bonded to a rigid base, within the radius 1.
typedef struct layer_contact {
  double depth, over_hertz; // d R/a^2; force over that on a half space at the same depth
} layer_contact;

// Hayes, Keer, Herrmann and Mockros 1972. A pressure with the Hankel transform A(x) moves the skin
// by (1 - nu)/G integral of A M(x h) J0(x r) dx, with k = 3 - 4 nu and
//   M(w) = (2 k sinh 2w - 4 w)/(2 k cosh 2w + 1 + k^2 + 4 w^2).
// A = integral over 0 to a of f(t) cos(x t) leaves none outside of the contact. Inside, with
// K(x, t) = integral of (M(w h) - 1) cos(w x) cos(w t) dw and up to a factor,
//   f(x) + 2/pi integral over 0 to a of K(x, t) f(t) dt = d - x^2/R,
// f(a) = 0 as the pressure ends at 0, and the force is 8/3 / (2/3) integral of f over that of M
// = 1.
static layer_contact hayes(double radius_over_thickness, double nu) {
  enum { NODES = 24, WAVES = 80 };
  double x[NODES + 1], weight[NODES + 1], w[WAVES], part[WAVES];
  double matrix[NODES * NODES], edge[NODES], one[NODES], square[NODES];
  gauss(NODES, x, weight), gauss(WAVES, w, part);
  x[NODES] = 1, weight[NODES] = 1;
  const double k = 3 - 4 * nu, most = 20; // M = 1 to 1e-14 beyond
  for (uint32_t i = 0; i <= NODES; ++i)
    for (uint32_t j = 0; j < NODES; ++j) {
      double kernel = 0;
      for (uint32_t n = 0; n < WAVES; ++n) {
        const double v = most * w[n], wave = v * radius_over_thickness;
        const double m =
            (2 * k * sinh(2 * v) - 4 * v) / (2 * k * cosh(2 * v) + 1 + k * k + 4 * v * v);
        kernel +=
            most * radius_over_thickness * part[n] * (m - 1) * cos(wave * x[i]) * cos(wave * x[j]);
      }
      kernel *= 2 / SONDE_PI * sqrt(weight[i] * weight[j]); // symmetric
      if (i < NODES)
        matrix[i * NODES + j] = kernel + (i == j);
      else
        edge[j] = kernel;
    }
  for (uint32_t i = 0; i < NODES; ++i)
    one[i] = sqrt(weight[i]), square[i] = sqrt(weight[i]) * x[i] * x[i];
  assert_true(sonde_cholesky(matrix, NODES));
  sonde_cholesky_solve(matrix, NODES, one);
  sonde_cholesky_solve(matrix, NODES, square);
  double at_edge[2] = {1, 1}, sum[2] = {0, 0};
  for (uint32_t i = 0; i < NODES; ++i) {
    at_edge[0] -= edge[i] * one[i], sum[0] += sqrt(weight[i]) * one[i];
    at_edge[1] -= edge[i] * square[i], sum[1] += sqrt(weight[i]) * square[i];
  }
  const double depth = at_edge[1] / at_edge[0];
  return (layer_contact){depth, 1.5 * (depth * sum[0] - sum[1]) / pow(depth, 1.5)};
}

// A layer as thick as makes a ball's force three times that on a half space.
static void ball_on_a_thin_layer(void **state) {
  (void)state;
  const double nu = poisson(24), radius = 0.2, a = 6e-3, shear = 3 * kpa;
  assert_near(hayes(1e-3, nu).over_hertz, 1, 2e-3);
  double low = 0.1, high = 5;
  while (high - low > 1e-9) {
    const double middle = 0.5 * (low + high);
    *(hayes(middle, nu).over_hertz < 3 ? &low : &high) = middle;
  }
  const layer_contact c = hayes(low, nu);
  const double thick = a / low, d = c.depth * a * a / radius;
  ball_lines lines = {.down = lines_from_middle(thick / 6, 6, 2, thick * (1 - 1e-9))};
  lines.u = lines.v = lines_from_middle(a / 6, 8, 1.4, a + 6 * thick);
  sonde_equilibrium_def def = one_material(ogden(shear, 2, 24));
  def.zone_m = 1e-3, def.contact_n_m3 = 1e10;
  bench b;
  make_ball_bench(&b, radius, &lines, &def);
  const double want = 3 * hertz_n(shear, 24, radius, d), got = 4 * find(&b, d).force_n.z;
  print_message("Hayes: a/h %.4f, d R/a^2 %.4f: %.5f N, integral equation %.5f (%+.1f %%), %u "
                "unknowns\n",
                low, c.depth, got, want, 100 * (got / want - 1), 3 * b.e->unknown_count);
  assert_near(got / want, 1, 0.02);
  drop_bench(&b);
}

// Energy equals work: the force is the change of the energy with depth, by a difference of fourth
// order, bonded and sliding.
static void energy_equals_work(void **state) {
  (void)state;
  for (int bonded = 0; bonded < 2; ++bonded) {
    bench b;
    sonde_hexes_def fine = sonde_hexes_def_default();
    fine.half_u_m = fine.half_v_m = 6e-3, fine.edge_m = 3e-3, fine.reach_m = 0.03;
    fine.muscle = 3;
    sonde_equilibrium_def def = one_material(ogden(3 * kpa, 8, 24));
    def.bonded = bonded, def.rounding_m = bonded ? 0 : 2e-3, def.tolerance = 1e-10;
    make_bench(&b, "rect:12x12", 0.03, &fine, &def);
    const double h = bonded ? 1e-4 : 2e-6, at = 5e-3;
    double energy[4], force = find(&b, at).force_n.z;
    static const double where[4] = {-2, -1, 1, 2};
    for (int k = 0; k < 4; ++k) {
      const sonde_equilibrium_result r = find(&b, at + where[k] * h);
      energy[k] = r.tissue_j + r.contact_j;
    }
    const double slope = (energy[0] - 8 * energy[1] + 8 * energy[2] - energy[3]) / (12 * h);
    print_message("%s: force %.9f N, change of the energy %.9f N\n", bonded ? "bonded" : "slip",
                  force, slope);
    assert_near(slope / force, 1, 1e-6);
    drop_bench(&b);
  }
}

// One force for one depth: in one step, in small ones, from deeper, from aside.
static void one_force_for_one_depth(void **state) {
  (void)state;
  bench b;
  sonde_error error;
  sonde_hexes_def fine = sonde_hexes_def_default();
  fine.half_u_m = 10e-3, fine.half_v_m = 5e-3, fine.edge_m = 3.4e-3, fine.reach_m = 0.04;
  fine.muscle = 3;
  sonde_equilibrium_def def = one_material(ogden(3 * kpa, 9, 24));
  def.rounding_m = 2e-3;
  make_bench(&b, "rect:20x10", 0.04, &fine, &def);
  const double d = 6e-3;
  const sonde_equilibrium_result small = find(&b, d);
  (void)find(&b, 9e-3);
  const sonde_equilibrium_result back = find(&b, d);
  sonde_pose aside = above(8e-3);
  aside.position.x = 3e-3;
  sonde_equilibrium_result other;
  check(sonde_equilibrium_find(b.e, aside, &other, &error), &error);
  const sonde_equilibrium_result slid = find(&b, d);
  (void)find(&b, -1e-3);
  b.e->def.step_m = 1;
  const sonde_equilibrium_result whole = find(&b, d);
  print_message("steps %.9f N, from deeper %.9f, from aside %.9f, at once %.9f (%u steps)\n",
                small.force_n.z, back.force_n.z, slid.force_n.z, whole.force_n.z, whole.steps);
  assert_near(back.force_n.z / small.force_n.z, 1, 1e-6);
  assert_near(slid.force_n.z / small.force_n.z, 1, 1e-6);
  assert_near(whole.force_n.z / small.force_n.z, 1, 1e-6);
  assert_near((whole.tissue_j + whole.contact_j) / (small.tissue_j + small.contact_j), 1, 1e-6);
  drop_bench(&b);
}

// ---- change of the force ----------------------------------------------------------------------

// Layers of one material each under a rectangle; the force at a depth with these layers.
static double layered_force(const sonde_hexes *mesh, const sonde_probe *probe,
                            const sonde_equilibrium_def *def, double depth_m,
                            sonde_force_change *change) {
  sonde_error error;
  sonde_equilibrium *e;
  sonde_equilibrium_result r;
  check(sonde_equilibrium_create(mesh, probe, above(0), def, &e, &error), &error);
  check(sonde_equilibrium_find(e, above(depth_m), &r, &error), &error);
  if (change) check(sonde_equilibrium_change(e, vec3(0, 0, -1), change, &error), &error);
  sonde_equilibrium_destroy(e);
  return r.force_n.z;
}

// The derivative of the force by depth, by every shear modulus and by every exponent is the
// difference between two equilibria, whatever the contact; of all shear moduli together it is the
// force itself where the contact has no stiffness of its own.
static void force_changes_match_differences(void **state) {
  (void)state;
  sonde_error error;
  sonde_hexes mesh;
  sonde_probe probe;
  sonde_hexes_def fine = sonde_hexes_def_default();
  fine.half_u_m = 8e-3, fine.half_v_m = 4e-3, fine.edge_m = 4e-3, fine.reach_m = 0.03;
  fine.muscle = 2;
  check(sonde_probe_create("rect:16x8", &probe, &error), &error);
  check(sonde_hexes_block(25e-3, 2e-3, 8e-3, &fine, &mesh, &error), &error);
  for (int contact = 0; contact < 4; ++contact) { // bonded, slip, slip and round, Fung
    sonde_equilibrium_def def = sonde_equilibrium_def_default();
    def.bonded = contact == 0, def.tolerance = 1e-11, def.zone_m = 8e-3;
    def.rounding_m = contact == 2 ? 2e-3 : 0;
    for (int k = 0; k < SONDE_SOLID_LAYERS && contact == 3; ++k)
      def.layer[k].energy = SONDE_ENERGY_FUNG, def.layer[k].exponent = 2;
    const double depth = 6e-3;
    sonde_force_change change;
    const double force = layered_force(&mesh, &probe, &def, depth, &change);
    const double h = 1e-5, high = layered_force(&mesh, &probe, &def, depth + h, NULL);
    const double slope = (high - layered_force(&mesh, &probe, &def, depth - h, NULL)) / (2 * h);
    double worst = fabs(change.way_n_m / slope - 1), sum = 0;
    for (int k = 0; k < 2 * SONDE_SOLID_LAYERS; ++k) {
      const double step = 1e-3;
      double two[2];
      for (int side = 0; side < 2; ++side) {
        sonde_equilibrium_def other = def;
        sonde_hyperelastic *m = &other.layer[k / 2];
        const double by = side ? step : -step;
        if (k % 2)
          m->exponent += by;
        else
          m->shear_pa *= exp(by), m->bulk_pa *= exp(by);
        two[side] = layered_force(&mesh, &probe, &other, depth, NULL);
      }
      const double want = (two[1] - two[0]) / (2 * step);
      const double got = k % 2 ? change.exponent_n[k / 2] : change.ln_shear_n[k / 2];
      worst = fmax(worst, fabs(got - want) / force);
      sum += k % 2 ? 0 : got;
    }
    print_message("contact %d: force %.4f N, slope %.1f N/m, changes off by %.1e\n", contact, force,
                  change.way_n_m, worst);
    assert_true(worst <= 1e-5);
    if (contact == 0) assert_near(sum, force, 1e-5 * force);
  }
  sonde_hexes_clear(&mesh);
  sonde_probe_clear(&probe);
}

// A state that is restored has the force that it had, and the state of other materials is found
// from it.
static void a_state_is_restored(void **state) {
  (void)state;
  bench b;
  sonde_hexes_def fine = sonde_hexes_def_default();
  fine.half_u_m = fine.half_v_m = 6e-3, fine.edge_m = 6e-3, fine.reach_m = 0.03, fine.muscle = 2;
  const sonde_equilibrium_def def = one_material(ogden(3 * kpa, 8, 24));
  make_bench(&b, "rect:12x12", 0.03, &fine, &def);
  const double force = find(&b, 5e-3).force_n.z;
  sonde_vec3 *kept = calloc(b.mesh.node_count, sizeof *kept);
  memcpy(kept, sonde_equilibrium_state(b.e), b.mesh.node_count * sizeof *kept);
  (void)find(&b, 1e-3);
  sonde_equilibrium_restore(b.e, above(5e-3), kept);
  const sonde_equilibrium_result again = find(&b, 5e-3);
  assert_near(again.force_n.z, force, 1e-9 * force);
  assert_true(again.steps == 0);
  // A sliding probe imposes nothing that a deck could hold.
  sonde_error error;
  assert_int_equal(sonde_equilibrium_export(b.e, "no/such/deck.inp", &error), SONDE_ARGUMENT);
  free(kept);
  drop_bench(&b);
}

// A probe that contains another takes at least as much work, at every depth.
static void a_larger_probe_never_does_less_work(void **state) {
  (void)state;
  static const char *const names[4] = {"rect:12x6", "rect:20x10", "rect:20x10", "rect:24x14"};
  static const double rounding[4] = {0, 0, 2e-3, 2e-3};
  double before[2] = {0, 0};
  for (int k = 0; k < 4; ++k) {
    bench b;
    sonde_hexes_def fine = sonde_hexes_def_default();
    fine.half_u_m = 10e-3, fine.half_v_m = 5e-3, fine.edge_m = 3.4e-3, fine.reach_m = 0.04;
    fine.muscle = 3;
    sonde_equilibrium_def def = one_material(ogden(3 * kpa, 9, 24));
    def.rounding_m = rounding[k];
    make_bench(&b, names[k], 0.03, &fine, &def);
    for (int d = 0; d < 2; ++d) {
      const sonde_equilibrium_result r = find(&b, d ? 6e-3 : 2e-3);
      const double work = r.tissue_j + r.contact_j;
      print_message("%s round %.0f mm at %d mm: %.3f mJ\n", names[k], 1e3 * rounding[k], d ? 6 : 2,
                    1e3 * work);
      assert_true(work > before[d]);
      before[d] = work;
    }
    drop_bench(&b);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(uniform_strain_is_reproduced),
      cmocka_unit_test(thick_tube_at_large_strain),
      cmocka_unit_test(thick_sphere_at_large_strain),
      cmocka_unit_test(ball_on_a_half_space),
      cmocka_unit_test(ball_on_a_thin_layer),
      cmocka_unit_test(energy_equals_work),
      cmocka_unit_test(one_force_for_one_depth),
      cmocka_unit_test(force_changes_match_differences),
      cmocka_unit_test(a_state_is_restored),
      cmocka_unit_test(a_larger_probe_never_does_less_work),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
