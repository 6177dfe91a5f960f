// Prediction: the simplified interaction against the full model with pinned neighbours, thread
// counts.
#include "fit_test.h"

#include "base/maths.h"

#include "fit/press.h"
#include "fit_thigh.h"

// Holds every node: those of the footprint moved, all others at rest. The force on the footprint
// is what the world computes there, which nothing in the fit room evaluates.
static double pinned_force(sonde_press *press, const sonde_site *site, const sonde_footprint *f,
                           double depth_m) {
  const sonde_mesh *mesh = &press->model->surface;
  uint32_t n = mesh->vertex_count, *nodes = SONDE_NEW(uint32_t, n), others = 0, next = 0;
  sonde_vec3 *rest = SONDE_NEW(sonde_vec3, n);
  sonde_vec3 *position = SONDE_NEW(sonde_vec3, n);
  for (uint32_t i = 0; i < n; ++i) position[i] = mesh->vertices[i];
  for (uint32_t i = 0; i < n; ++i) {
    if (next < f->held_count && f->held[next] == i) {
      ++next;
      position[i].x -= depth_m * site->normal.x;
      position[i].y -= depth_m * site->normal.y;
      position[i].z -= depth_m * site->normal.z;
    } else {
      nodes[others++] = i;
    }
  }
  for (uint32_t i = 0; i < n; ++i) rest[i] = position[i];
  // All held: sum of the forces on the others and on the footprint, then on the others alone.
  sonde_vec3 *ordered = SONDE_NEW(sonde_vec3, n);
  uint32_t *all = SONDE_NEW(uint32_t, n);
  for (uint32_t i = 0; i < n; ++i) all[i] = i;
  sonde_vec3 total, outer;
  assert_true(sonde_settle_bonded(press->state, all, position, n, 1e-12, 5, &total).converged);
  for (uint32_t k = 0; k < others; ++k) ordered[k] = rest[nodes[k]];
  // The footprint stays where the first call left it when no iteration is allowed.
  sonde_settle_bonded(press->state, nodes, ordered, others, 1e-12, 0, &outer);
  sonde_free(nodes);
  sonde_free(rest);
  sonde_free(position);
  sonde_free(ordered);
  sonde_free(all);
  return (total.x - outer.x) * site->normal.x + (total.y - outer.y) * site->normal.y +
         (total.z - outer.z) * site->normal.z;
}

static void simplified_equals_full_with_pinned_neighbours(void **state) {
  (void)state;
  bundled b = bundled_load("indentation.csv", 6.0);
  double worst = 0;
  for (int tension = 0; tension < 2; ++tension) {
    sonde_surface_law law = b.model->law;
    law.edge_stiffness_n_m = 120;
    law.edge_compression = 0.3;
    law.edge_pretension_n = tension ? 0.05 : 0.0;
    law.tangential_stiffness_n_m3 = 0; // the simplified interaction has neither
    law.shear_stiffness_n_m = 0;
    set_uneven_parameters(&b, &law);
    sonde_press press;
    assert_ok(sonde_press_create(b.model, 1e-12, 5, &press, NULL), NULL);
    for (uint32_t s = 3; s < b.sites.count; s += 20)
      for (int probe = 0; probe < 2; ++probe) {
        sonde_footprint f;
        assert_ok(sonde_footprint_create(b.model, &b.sites.sites[s], probe ? 0.03 : 0.003,
                                         probe ? 0.006 : 0.003, SONDE_COVERAGE_CELLS, &f, NULL),
                  NULL);
        for (double depth = 0.002; depth < 0.03; depth += 0.009) {
          double full = pinned_force(&press, &b.sites.sites[s], &f, depth);
          double simplified = sonde_footprint_force(&f, b.model, depth);
          worst = fmax(worst, fabs(simplified / full - 1));
        }
        sonde_footprint_clear(&f);
      }
    sonde_press_clear(&press);
  }
  print_message("simplified against pinned full: %.2g\n", worst);
  assert_true(worst < 1e-10);
  bundled_clear(&b);
}

// Free neighbours follow the dimple: the full force is smaller, and not zero.
static void full_is_softer_than_simplified(void **state) {
  (void)state;
  bundled b = soft_thigh();
  b.m.count = 6; // one curve, up to 12 mm
  double full[6], simplified[6], alone[6];
  sonde_predict_def def = sonde_predict_def_default();
  sonde_error error;
  assert_ok(sonde_predict(b.model, &b.sites, &b.m, &def, NULL, simplified, &error), &error);
  def.interaction = SONDE_INTERACTION_FULL;
  assert_ok(sonde_predict(b.model, &b.sites, &b.m, &def, NULL, full, &error), &error);
  def.threads = 1;
  assert_ok(sonde_predict(b.model, &b.sites, &b.m, &def, NULL, alone, &error), &error);
  for (int i = 0; i < 6; ++i) {
    assert_true(isfinite(full[i]));
    assert_near(full[i], alone[i], 0);
    assert_true(full[i] > 0 && full[i] < simplified[i]);
    if (i) assert_true(full[i] > full[i - 1]);
  }
  bundled_clear(&b);
}

static void sites_off_the_skin_are_refused(void **state) {
  (void)state;
  bundled b = soft_thigh();
  sonde_predict_def def = sonde_predict_def_default();
  sonde_error error;
  double *predicted_n = SONDE_NEW(double, b.m.count);
  sonde_site *site = &b.sites.sites[7];
  site->position_m = v_madd(site->position_m, 0.02, site->normal);
  assert_int_equal(sonde_predict(b.model, &b.sites, &b.m, &def, NULL, predicted_n, &error),
                   SONDE_MISMATCH);
  assert_says(&error, "site 7");
  sonde_free(predicted_n);
  bundled_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(simplified_equals_full_with_pinned_neighbours),
      cmocka_unit_test(full_is_softer_than_simplified),
      cmocka_unit_test(sites_off_the_skin_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
