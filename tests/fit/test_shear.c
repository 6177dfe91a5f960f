// The scalar equilibrium of stage 3 against the full model, its rim, its adjoint derivatives, the
// spread of site parameters, their roughness, and recovery of known parameters.
#include "fit_test.h"

#include "base/maths.h"
#include "fit/press.h"
#include "fit/refit.h"
#include "fit/site_field.h"
#include "fit_plate.h"
#include "tissue/two_layer/linearise.h"

static const double HALF_U[2] = {0.003, 0.030}, HALF_V[2] = {0.003, 0.006};

// A thigh with uneven parameters and shear springs, without surface springs.
static bundled shear_thigh(double fine_mm) {
  bundled b = bundled_load("indentation.csv", fine_mm);
  sonde_surface_law law = sonde_surface_law_default();
  law.edge_stiffness_n_m = 0;
  law.shear_stiffness_n_m = 18;
  law.inplane_stiffness_n_m = 70;
  law.shear_limit = 0.9;
  law.normal_exponent = 2;
  for (uint32_t s = 0; s < b.sites.count; ++s) {
    b.sites.sites[s].k0_n_m3 = 1.6e5 * (1 + 0.3 * sin(1.0 + s));
    b.sites.sites[s].xm_m = 0.042 + 0.006 * cos(2.0 * s);
    b.sites.sites[s].shear_share = 1 + 0.3 * cos(1.5 * s);
    b.sites.sites[s].limit_share = 1 + 0.2 * sin(0.8 * s);
  }
  sonde_error error;
  assert_ok(sonde_model_set_parameters(b.model, &law, b.sites.sites, b.sites.count, &error),
            &error);
  return b;
}

// Logarithms of the model's fields, which a patch reads.
enum { FIELDS = 4 };
typedef struct fields {
  double *ln[FIELDS]; // of k0, xm, shares of G and gm
} fields;

static fields fields_of(const sonde_model *model) {
  uint32_t n = model->surface.vertex_count;
  const double *const from[FIELDS] = {model->k0_n_m3, model->xm_m, model->shear_share,
                                      model->limit_share};
  fields f;
  for (int k = 0; k < FIELDS; ++k) {
    f.ln[k] = SONDE_NEW(double, n);
    for (uint32_t i = 0; i < n; ++i) f.ln[k][i] = log(from[k][i]);
  }
  return f;
}

static void fields_clear(fields *f) {
  for (int k = 0; k < FIELDS; ++k) sonde_free(f->ln[k]);
}

static sonde_patch_law law_of(const sonde_model *model, const fields *f) {
  const sonde_surface_law *law = &model->law;
  return (sonde_patch_law){.ln_k0 = f->ln[0],
                           .ln_xm = f->ln[1],
                           .ln_shear = f->ln[2],
                           .ln_limit = f->ln[3],
                           .exponent = law->normal_exponent,
                           .shear_n_m = law->shear_stiffness_n_m,
                           .limit = law->shear_limit,
                           .guard = law->guard};
}

static sonde_patch_gradient gradient_of(uint32_t places) {
  sonde_patch_gradient g = {0};
  for (int k = 0; k < FIELDS; ++k) g.by_place[k] = SONDE_NEW(double, places);
  return g;
}

static void gradient_clear(sonde_patch_gradient *g) {
  for (int k = 0; k < FIELDS; ++k) sonde_free(g->by_place[k]);
}

typedef struct bench {
  sonde_patch patch;
  sonde_patch_solver solver;
  double *s_m;
  bool membrane; // tension, stiffness and stiffening in place of G and gm
} bench;

static void bench_create(bench *t, const bundled *b, uint32_t site, int probe, double reach_m) {
  sonde_error error;
  assert_ok(sonde_patch_create(b->model, &b->sites.sites[site], HALF_U[probe], HALF_V[probe],
                               reach_m, &t->patch, &error),
            &error);
  assert_ok(sonde_patch_solver_create(&t->patch, 1, &t->solver, &error), &error);
  t->s_m = SONDE_NEW(double, t->patch.place_count);
  t->membrane = false;
}

static double bench_force(bench *t, const sonde_patch_law *law, double depth_m,
                          sonde_patch_gradient *gradient) {
  double force_n;
  sonde_error error;
  sonde_patch_law used = *law;
  used.membrane = t->membrane;
  used.stiffening = 5;
  if (t->membrane) used.limit *= 20;
  sonde_patch_solver_use(&t->solver, &t->patch, &used);
  assert_ok(sonde_patch_settle(&t->solver, depth_m, 1e-12, 100, t->s_m, &error), &error);
  assert_ok(sonde_patch_force(&t->solver, depth_m, t->s_m, &force_n, gradient, &error), &error);
  return force_n;
}

static void bench_clear(bench *t) {
  sonde_patch_solver_clear(&t->solver);
  sonde_patch_clear(&t->patch);
  sonde_free(t->s_m);
}

// The dynamic model at rest gives the forces of the fit: without surface springs to rounding, with
// weak ones within 0.1 %, on the fit's 50 mm patch too.
static void scalar_equals_full_model(void **state) {
  (void)state;
  bundled b = shear_thigh(4.0);
  fields f = fields_of(b.model);
  sonde_patch_law law = law_of(b.model, &f);
  double worst_whole = 0, worst_patch = 0, worst_edges = 0, kept = 0.01;
  for (int probe = 0; probe < 2; ++probe) {
    uint32_t site = probe ? 27 : 12;
    bench whole, patch;
    sonde_bonded bonded[2];
    bench_create(&whole, &b, site, probe, 1.0);
    bench_create(&patch, &b, site, probe, 0.05);
    assert_true(whole.patch.free_count < whole.patch.place_count);
    assert_true(patch.patch.place_count < b.model->surface.vertex_count / 2);
    for (int edges = 0; edges < 2; ++edges) {
      b.model->law.edge_stiffness_n_m = edges ? kept : 0;
      assert_ok(sonde_bonded_create(b.model, &b.sites.sites[site], HALF_U[probe], HALF_V[probe],
                                    1e-7, 400, &bonded[edges], NULL),
                NULL);
    }
    for (double depth = 0.005; depth < 0.021; depth += 0.005) {
      double full = sonde_bonded_force(&bonded[0], depth);
      assert_true(isfinite(full));
      worst_whole = fmax(worst_whole, fabs(bench_force(&whole, &law, depth, NULL) / full - 1));
      worst_patch = fmax(worst_patch, fabs(bench_force(&patch, &law, depth, NULL) / full - 1));
      worst_edges = fmax(worst_edges, fabs(sonde_bonded_force(&bonded[1], depth) / full - 1));
    }
    bench_clear(&whole);
    bench_clear(&patch);
    for (int edges = 0; edges < 2; ++edges) sonde_bonded_clear(&bonded[edges]);
  }
  print_message("scalar against full: whole skin %.2g, patch %.2g; kept edges %.2g\n", worst_whole,
                worst_patch, worst_edges);
  assert_true(worst_whole < 1e-5);
  assert_true(worst_patch < 1e-3);
  assert_true(worst_edges < 1e-3);
  fields_clear(&f);
  bundled_clear(&b);
}

// A footprint's force hardly depends on where its sides fall between the nodes: meshes of 3 and
// 2 mm agree, which they do not when whole nodes are held.
static void force_does_not_depend_on_the_mesh(void **state) {
  (void)state;
  double force[2][2];
  for (int fine = 0; fine < 2; ++fine) {
    bundled b = shear_thigh(fine ? 2.0 : 3.0);
    fields f = fields_of(b.model);
    sonde_patch_law law = law_of(b.model, &f);
    for (int probe = 0; probe < 2; ++probe) {
      bench t;
      bench_create(&t, &b, 35, probe, 0.05);
      assert_false(t.patch.coarse);
      for (double depth = 0.004; depth < 0.017; depth += 0.004)
        force[fine][probe] = bench_force(&t, &law, depth, NULL);
      bench_clear(&t);
    }
    fields_clear(&f);
    bundled_clear(&b);
  }
  double point = force[1][0] / force[0][0] - 1, linear = force[1][1] / force[0][1] - 1;
  print_message("2 mm against 3 mm: point %.2g, linear %.2g\n", point, linear);
  assert_true(fabs(point) < 0.012 && fabs(linear) < 0.005);
}

// A 6 mm point on a mesh of 8 mm is named as too coarse; a 12 mm wide pad there is not.
static void coarse_meshes_are_named(void **state) {
  (void)state;
  bundled b = shear_thigh(8.0);
  for (int probe = 0; probe < 2; ++probe) {
    bench t;
    bench_create(&t, &b, 27, probe, 0.05);
    assert_int_equal(t.patch.coarse, !probe);
    bench_clear(&t);
  }
  bundled_clear(&b);
}

// The cut keeps the area of the skin, and the held faces are the footprint along the skin.
static void cut_faces_are_the_footprint(void **state) {
  (void)state;
  bundled b = shear_thigh(3.0);
  for (int probe = 0; probe < 2; ++probe) {
    sonde_cut cut;
    assert_ok(sonde_cut_create(b.model, &b.sites.sites[27], HALF_U[probe], HALF_V[probe], INFINITY,
                               &cut, NULL),
              NULL);
    double held = 0, all = 0, skin = 0, nominal = 4 * HALF_U[probe] * HALF_V[probe];
    for (uint32_t f = 0; f < cut.face_count; ++f) {
      const uint32_t *v = cut.face[f];
      sonde_vec3 x[3];
      for (int k = 0; k < 3; ++k) x[k] = sonde_cut_point(b.model, &cut, v[k]);
      double area = 0.5 * v_norm(v_cross(v_sub(x[1], x[0]), v_sub(x[2], x[0])));
      all += area;
      for (int k = 0; k < 3; ++k) // fine where a side runs
        if (cut.held[v[k]] && !cut.held[v[(k + 1) % 3]])
          assert_true(v_distance(x[k], x[(k + 1) % 3]) <= 2.1e-3);
      if (cut.held[v[0]] && cut.held[v[1]] && cut.held[v[2]]) held += area;
    }
    for (uint32_t i = 0; i < b.model->surface.vertex_count; ++i) skin += b.model->area_m2[i];
    print_message("held area %.2f of %.2f mm2\n", held * 1e6, nominal * 1e6);
    assert_near(all / skin, 1, 1e-9);
    assert_near(held / nominal, 1, 0.01); // corners are vertices
    sonde_cut_clear(&cut);
  }
  bundled_clear(&b);
}

// Energy of the surface springs alone, nodes moved by a pattern and cut points with their faces.
static double spring_energy(sonde_model *model, const sonde_model *whole, const sonde_cut *cut) {
  uint32_t n = model->surface.vertex_count;
  sonde_vec3 *x = SONDE_NEW(sonde_vec3, n);
  double energy[2];
  for (uint32_t i = 0; i < n; ++i) {
    x[i] = vec3(0, 0, 0);
    for (int k = 0; k < 3; ++k) {
      uint32_t of = cut ? cut->parent[i][k] : i;
      sonde_vec3 moved = v_add(whole->surface.vertices[of],
                               vec3(4e-3 * sin(of), 5e-3 * cos(3.0 * of), 2e-3 * sin(2.0 * of)));
      x[i] = v_madd(x[i], cut ? cut->share[i][k] : (k == 0), moved);
    }
  }
  for (int edges = 0; edges < 2; ++edges) {
    model->law.edge_stiffness_n_m = edges ? 50 : 0;
    energy[edges] = sonde_tissue_energy(model, x);
  }
  sonde_free(x);
  return energy[1] - energy[0];
}

// A cut skin has the springs of the whole one: as much energy in whatever its faces keep straight.
static void a_cut_divides_the_springs(void **state) {
  (void)state;
  bundled b = shear_thigh(4.0);
  sonde_cut cut;
  sonde_model *model;
  assert_ok(
      sonde_cut_create(b.model, &b.sites.sites[27], HALF_U[1], HALF_V[1], INFINITY, &cut, NULL),
      NULL);
  assert_ok(sonde_cut_model(b.model, &cut, &model, NULL), NULL);
  assert_true(model->topology.edge_count > b.model->topology.edge_count + 500);
  double whole = spring_energy(b.model, b.model, NULL);
  assert_true(whole > 0);
  assert_near(spring_energy(model, b.model, &cut) / whole, 1, 1e-9);
  sonde_model_destroy(model);
  sonde_cut_clear(&cut);
  bundled_clear(&b);
}

// What lies beyond the patch hardly matters at 30 mm depth; beyond 10 mm it does.
static void rim_does_not_matter(void **state) {
  (void)state;
  bundled b = shear_thigh(4.0);
  fields f = fields_of(b.model);
  sonde_patch_law law = law_of(b.model, &f);
  double force[3];
  const double reach_m[3] = {1.0, 0.05, 0.01};
  for (int k = 0; k < 3; ++k) {
    bench t;
    bench_create(&t, &b, 35, 1, reach_m[k]);
    for (double depth = 0.01; depth < 0.031; depth += 0.01)
      force[k] = bench_force(&t, &law, depth, NULL);
    bench_clear(&t);
  }
  print_message("cut rim: %.2g at 50 mm, %.2g at 10 mm\n", 1 - force[1] / force[0],
                1 - force[2] / force[0]);
  assert_true(fabs(1 - force[1] / force[0]) < 3e-3 && 1 - force[2] / force[0] > 0.02);
  fields_clear(&f);
  bundled_clear(&b);
}

// A field of its own for every parameter.
static double pattern(int field, uint32_t node) {
  static const double RATE[FIELDS] = {0.7, 0.4, 0.9, 0.3};
  return sin(RATE[field] * node + field);
}

// The force along a straight line in the logarithms of all parameters: the fields, G, gm.
static double force_along(bench *t, const bundled *b, double h, const double direction[FIELDS + 2],
                          double depth_m) {
  uint32_t n = b->model->surface.vertex_count;
  fields f = fields_of(b->model);
  for (int k = 0; k < FIELDS; ++k)
    for (uint32_t i = 0; i < n; ++i) f.ln[k][i] += h * direction[k] * pattern(k, i);
  sonde_patch_law law = law_of(b->model, &f);
  law.shear_n_m *= exp(h * direction[FIELDS]);
  law.limit *= exp(h * direction[FIELDS + 1]);
  double force_n = bench_force(t, &law, depth_m, NULL);
  fields_clear(&f);
  return force_n;
}

static double by_adjoint(bench *t, const bundled *b, const double direction[FIELDS + 2],
                         double depth_m) {
  uint32_t n = t->patch.place_count;
  sonde_patch_gradient g = gradient_of(n);
  fields f = fields_of(b->model);
  sonde_patch_law law = law_of(b->model, &f);
  (void)bench_force(t, &law, depth_m, &g);
  fields_clear(&f);
  double sum = direction[FIELDS] * g.by_ln_shear + direction[FIELDS + 1] * g.by_ln_limit;
  for (uint32_t p = 0; p < n; ++p) {
    const uint32_t *of = t->patch.parent[p];
    const double *share = t->patch.share[p];
    for (int k = 0; k < FIELDS; ++k)
      for (int c = 0; c < 3; ++c)
        sum += direction[k] * g.by_place[k][p] * share[c] * pattern(k, of[c]);
  }
  gradient_clear(&g);
  return sum;
}

static void adjoint_equals_finite_differences(void **state) {
  (void)state;
  bundled b = shear_thigh(5.0);
  enum { DIRECTIONS = 7 };
  const double direction[DIRECTIONS][FIELDS + 2] = {{1, 0, 0, 0, 0, 0},
                                                    {0, 1, 0, 0, 0, 0},
                                                    {0, 0, 1, 0, 0, 0},
                                                    {0, 0, 0, 1, 0, 0},
                                                    {0, 0, 0, 0, 1, 0},
                                                    {0, 0, 0, 0, 0, 1},
                                                    {0.4, -0.6, 0.5, 0.2, 0.8, -0.3}};
  for (int law = 0; law < 4; ++law) {
    int probe = law % 2;
    bench t;
    bench_create(&t, &b, 20, probe, 0.05);
    t.membrane = law > 1;
    for (double depth = 0.008; depth < 0.025; depth += 0.008)
      for (int d = 0; d < DIRECTIONS; ++d) {
        double adjoint = by_adjoint(&t, &b, direction[d], depth), h = 1e-4;
        double difference = (force_along(&t, &b, h, direction[d], depth) -
                             force_along(&t, &b, -h, direction[d], depth)) /
                            (2 * h);
        double scale = fmax(fabs(difference), 1e-3 * force_along(&t, &b, 0, direction[d], depth));
        assert_near(adjoint / scale, difference / scale, 1e-4);
      }
    bench_clear(&t);
  }
  bundled_clear(&b);
}

// Where slopes are small a membrane's tension is the shear layer's G; where they are not, its force
// is smaller, for it turns with the skin, and its stiffness adds to it.
static void a_membrane_begins_as_a_shear_layer(void **state) {
  (void)state;
  bundled b = shear_thigh(4.0);
  fields f = fields_of(b.model);
  sonde_patch_law law = law_of(b.model, &f);
  law.limit = 1e6; // G alone
  bench t;
  bench_create(&t, &b, 20, 0, 0.05);
  double ratio[3];
  for (int k = 0; k < 3; ++k) {
    double depth = k ? 0.015 : 2e-5;
    t.membrane = false;
    law.limit = 1e6;
    double layer = bench_force(&t, &law, depth, NULL);
    t.membrane = true;
    law.limit = k > 1 ? 1 : 1e-9;
    ratio[k] = bench_force(&t, &law, depth, NULL) / layer;
  }
  print_message("membrane over shear layer: %.6f, deep %.3f, with stiffness %.3f\n", ratio[0],
                ratio[1], ratio[2]);
  assert_near(ratio[0], 1, 1e-4);
  assert_true(ratio[1] < 0.9 && ratio[2] > 1.05 * ratio[1]);
  bench_clear(&t);
  fields_clear(&f);
  bundled_clear(&b);
}

// Ended early, the force with derivatives errs with the square of the residual, the one without
// with the residual; and the adjoint is the motion of the free skin per depth.
static void adjoint_corrects_the_force(void **state) {
  (void)state;
  bundled b = shear_thigh(4.0);
  fields f = fields_of(b.model);
  sonde_patch_law law = law_of(b.model, &f);
  for (int probe = 0; probe < 2; ++probe) {
    bench t;
    bench_create(&t, &b, 20, probe, 0.05);
    uint32_t n = t.patch.place_count;
    sonde_patch_gradient g = gradient_of(n);
    double exact = bench_force(&t, &law, 0.012, &g), moved = 0, most = 0, plain, corrected;
    double *before = SONDE_NEW(double, n), *motion = SONDE_NEW(double, n);
    memcpy(before, t.s_m, n * sizeof *before);
    memcpy(motion, t.solver.multiplier, n * sizeof *motion);
    (void)bench_force(&t, &law, 0.01201, NULL);
    for (uint32_t k = 0; k < t.patch.free_count; ++k) {
      moved = fmax(moved, fabs((t.s_m[k] - before[k]) / 1e-5 - motion[k]));
      most = fmax(most, motion[k]);
    }
    assert_true(most > 0.5 && moved < 0.01);
    for (uint32_t k = 0; k < t.patch.free_count; ++k) t.s_m[k] = 0.98 * before[k];
    assert_ok(sonde_patch_settle(&t.solver, 0.012, 1, 1, t.s_m, NULL), NULL); // stays there
    assert_ok(sonde_patch_force(&t.solver, 0.012, t.s_m, &plain, NULL, NULL), NULL);
    assert_ok(sonde_patch_force(&t.solver, 0.012, t.s_m, &corrected, &g, NULL), NULL);
    print_message("2 %% off the equilibrium: force off by %.2g, corrected %.2g\n",
                  plain / exact - 1, corrected / exact - 1);
    assert_true(fabs(corrected / exact - 1) < 0.1 * fabs(plain / exact - 1));
    gradient_clear(&g);
    sonde_free(before);
    sonde_free(motion);
    bench_clear(&t);
  }
  fields_clear(&f);
  bundled_clear(&b);
}

static void basis_is_the_models_interpolation(void **state) {
  (void)state;
  bundled b = shear_thigh(8.0);
  uint32_t nodes = b.model->surface.vertex_count, count = b.sites.count;
  double *basis = SONDE_NEW(double, (size_t)nodes *count), worst = 0;
  assert_ok(sonde_site_basis(b.model, &b.sites, basis, NULL), NULL);
  for (uint32_t i = 0; i < nodes; ++i) {
    double ln_k = 0, ln_x = 0;
    for (uint32_t s = 0; s < count; ++s) {
      ln_k += basis[(size_t)i * count + s] * log(b.sites.sites[s].k0_n_m3);
      ln_x += basis[(size_t)i * count + s] * log(b.sites.sites[s].xm_m);
    }
    worst = fmax(worst, fabs(ln_k - log(b.model->k0_n_m3[i])));
    worst = fmax(worst, fabs(ln_x - log(b.model->xm_m[i])));
  }
  assert_true(worst < 1e-9);
  sonde_free(basis);
  bundled_clear(&b);
}

// Sites on a flat grid: planes cost nothing, a single raised site does.
static void roughness_spares_planes(void **state) {
  (void)state;
  enum { SIDE = 4, COUNT = SIDE * SIDE };
  sonde_site site[COUNT];
  for (uint32_t s = 0; s < COUNT; ++s)
    site[s] = (sonde_site){.id = s,
                           .position_m = {0.02 * (s % SIDE), 0.019 * (s / SIDE), 0},
                           .normal = {0, 0, 1},
                           .u = {1, 0, 0},
                           .v = {0, 1, 0}};
  const sonde_site_table table = {.count = COUNT, .sites = site};
  double rows[COUNT * COUNT];
  assert_ok(sonde_site_roughness(&table, rows, NULL), NULL);
  for (uint32_t s = 0; s < COUNT; ++s) {
    double level = 0, plane = 0;
    for (uint32_t t = 0; t < COUNT; ++t) {
      level += rows[s * COUNT + t];
      plane += rows[s * COUNT + t] * (3 * site[t].position_m.x - 5 * site[t].position_m.y);
    }
    assert_near(level, 0, 1e-12);
    assert_near(plane, 0, 3e-3); // not 0: the ridge on slopes; the field changes by 0.46
    assert_near(rows[s * COUNT + s], 1, 1e-12);
  }
}

// ---- recovery -----------------------------------------------------------------------------

enum { KEPT = 9 };

enum { PARAMETERS = FIELDS * KEPT + 2 };
typedef struct recovery {
  bundled b;
  sonde_fit_plan plan;
  sonde_fit_def def;
  sonde_refit *refit;
  double truth[PARAMETERS];
  double *force_n;
} recovery;

// Measurements replaced by the solver's own forces for smooth known parameters.
static void recovery_create(recovery *r) {
  sonde_error error;
  r->b = bundled_load("indentation.csv", 6.0);
  keep_nine_sites(&r->b);
  r->def = sonde_fit_def_default();
  assert_ok(sonde_fit_plan_create(&r->b.sites, &r->b.m, &r->plan, &error), &error);
  r->force_n = SONDE_NEW(double, r->b.m.count);
  assert_ok(sonde_refit_create(r->b.model, &r->b.sites, &r->b.m, &r->plan, &r->def, 0.05, &r->refit,
                               &error),
            &error);
  for (uint32_t s = 0; s < KEPT; ++s) {
    r->truth[s] = log(1.5e5) + 0.08 * (s % 3) - 0.05 * (s / 3);
    r->truth[KEPT + s] = log(0.046) - 0.03 * (s % 3) + 0.04 * (s / 3);
  }
  for (uint32_t s = 0; s < KEPT; ++s) { // of mean 1 in the logarithm: the rest is G and gm
    r->truth[2 * KEPT + s] = 0.1 * ((int)(s % 3) - 1);
    r->truth[3 * KEPT + s] = 0.05 * ((int)(s / 3) - 1);
  }
  r->truth[PARAMETERS - 2] = log(22.0);
  r->truth[PARAMETERS - 1] = log(1.2);
  assert_ok(sonde_refit_forces(r->refit, r->truth, r->force_n, NULL, NULL, &error), &error);
  for (uint32_t k = 0; k < r->b.m.count; ++k) r->b.m.data[r->plan.row[k]].force_n = r->force_n[k];
}

static void recovery_clear(recovery *r) {
  sonde_refit_destroy(r->refit);
  sonde_fit_plan_clear(&r->plan);
  sonde_free(r->force_n);
  bundled_clear(&r->b);
}

static void known_parameters_are_recovered(void **state) {
  (void)state;
  recovery r;
  recovery_create(&r);
  sonde_fit_result result;
  sonde_error error;
  r.def.stages = 3;
  assert_ok(sonde_fit(r.b.model, &r.b.sites, &r.b.m, &r.def, NULL, &result, &error), &error);
  assert_true(result.converged);
  assert_int_equal(result.parameters, PARAMETERS);
  print_message("recovery: %u iterations, cost %.3g from %.3g, error %.2g %%\n", result.iterations,
                result.cost, result.start_cost, result.stage3.all.mae_percent);
  assert_true(result.cost < 2e-4 * result.start_cost); // the shares differ from 1
  assert_true(result.stage3.all.mae_percent < 0.05);
  for (uint32_t s = 0; s < KEPT; ++s) {
    assert_near(log(result.sites[s].k0_n_m3), r.truth[s], 0.01);
    assert_near(log(result.sites[s].xm_m), r.truth[KEPT + s], 0.01);
    assert_near(log(result.sites[s].shear_share), r.truth[2 * KEPT + s], 0.015);
    assert_near(log(result.sites[s].limit_share), r.truth[3 * KEPT + s], 0.015);
  }
  assert_near(log(result.law.shear_stiffness_n_m), r.truth[PARAMETERS - 2], 0.01);
  assert_near(log(result.law.shear_limit), r.truth[PARAMETERS - 1], 0.01);
  assert_near(result.law.edge_stiffness_n_m, r.def.kept_edge_n_m, 0);
  sonde_fit_result_clear(&result);
  recovery_clear(&r);
}

// Jacobian over the sites by differences of the whole forward model, rows of every curve.
static void site_jacobian_equals_finite_differences(void **state) {
  (void)state;
  recovery r;
  recovery_create(&r);
  uint32_t n = sonde_refit_parameters(r.refit), rows = r.plan.row_count;
  double *jacobian = SONDE_NEW(double, (size_t)rows *n), *ahead = SONDE_NEW(double, rows);
  double *behind = SONDE_NEW(double, rows), h = 2e-3;
  assert_ok(sonde_refit_forces(r.refit, r.truth, r.force_n, jacobian, NULL, NULL), NULL);
  const uint32_t some[] = {
      0, 4, KEPT + 2, KEPT + 4, 2 * KEPT + 3, 3 * KEPT + 5, PARAMETERS - 2, PARAMETERS - 1};
  for (size_t k = 0; k < SONDE_COUNT_OF(some); ++k) {
    double kept = r.truth[some[k]], worst = 0;
    r.truth[some[k]] = kept + h;
    assert_ok(sonde_refit_forces(r.refit, r.truth, ahead, NULL, NULL, NULL), NULL);
    r.truth[some[k]] = kept - h;
    assert_ok(sonde_refit_forces(r.refit, r.truth, behind, NULL, NULL, NULL), NULL);
    r.truth[some[k]] = kept;
    for (uint32_t row = 0; row < rows; ++row) {
      double slope = (ahead[row] - behind[row]) / (2 * h);
      worst = fmax(worst, fabs(slope - jacobian[(size_t)row * n + some[k]]) / r.force_n[row]);
    }
    assert_true(worst < 1e-3);
  }
  sonde_free(jacobian);
  sonde_free(ahead);
  sonde_free(behind);
  recovery_clear(&r);
}

static bool refuse(double fraction, const char *what, void *user) {
  (void)fraction;
  (void)user;
  return strncmp(what, "stage 3", 7) != 0;
}

static void progress_cancels_stage_3(void **state) {
  (void)state;
  recovery r;
  recovery_create(&r);
  const sonde_progress progress = {refuse, NULL};
  sonde_fit_result result;
  sonde_error error;
  r.def.stages = 3;
  assert_int_equal(sonde_fit(r.b.model, &r.b.sites, &r.b.m, &r.def, &progress, &result, &error),
                   SONDE_CANCELLED);
  assert_null(result.sites);
  r.def.kept_edge_n_m = -1;
  assert_int_equal(sonde_fit(r.b.model, &r.b.sites, &r.b.m, &r.def, NULL, &result, &error),
                   SONDE_ARGUMENT);
  assert_says(&error, "kept_edge_n_m");
  recovery_clear(&r);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(scalar_equals_full_model),
      cmocka_unit_test(force_does_not_depend_on_the_mesh),
      cmocka_unit_test(coarse_meshes_are_named),
      cmocka_unit_test(cut_faces_are_the_footprint),
      cmocka_unit_test(a_cut_divides_the_springs),
      cmocka_unit_test(rim_does_not_matter),
      cmocka_unit_test(adjoint_equals_finite_differences),
      cmocka_unit_test(a_membrane_begins_as_a_shear_layer),
      cmocka_unit_test(adjoint_corrects_the_force),
      cmocka_unit_test(basis_is_the_models_interpolation),
      cmocka_unit_test(roughness_spares_planes),
      cmocka_unit_test(known_parameters_are_recovered),
      cmocka_unit_test(site_jacobian_equals_finite_differences),
      cmocka_unit_test(progress_cancels_stage_3),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
