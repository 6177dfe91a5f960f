// Moduli of the hyperelastic solid: those that made the forces come back, with the contact zero and
// the tare of a curve where they are sought; what the data do not say is said to be the prior's.
#include "fit_plate.h"

#include "sonde/fit_solid.h"

static const char *const LAYER[] = {SONDE_SOLID_LAYER_NAMES};

// A coarse solid that is quickly solved.
static sonde_fit_solid_def coarse(void) {
  sonde_fit_solid_def def = sonde_fit_solid_def_default();
  def.mesh.edge_m = 12e-3, def.mesh.growth = 3;
  def.mesh.muscle = 2, def.mesh.fat = 1, def.mesh.reach_m = 0.06;
  return def;
}

// Rows of some sites down to a depth, of one probe or all.
static sonde_measurements rows_of(const bundled *b, const uint32_t *site, uint32_t count,
                                  double deepest_m, const char *probe) {
  sonde_error error;
  sonde_measurements rows;
  uint32_t kept = 0;
  assert_ok(sonde_measurements_select(&b->m, &b->sites, site, count, 0, &rows, &error), &error);
  for (uint32_t i = 0; i < rows.count; ++i)
    if ((!probe || !strcmp(rows.data[i].probe, probe)) &&
        rows.data[i].penetration_m < deepest_m + 1e-6)
      rows.data[kept++] = rows.data[i];
  rows.count = kept;
  return rows;
}

// Forces of these layers in place of the measured ones.
static void replace_forces(const bundled *b, sonde_measurements *rows, sonde_fit_solid_def def,
                           const sonde_hyperelastic layer[SONDE_SOLID_LAYERS]) {
  sonde_error error;
  double *force_n = calloc(rows->count, sizeof *force_n);
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) def.contact.layer[k] = layer[k];
  assert_ok(sonde_predict_solid(b->model, &b->sites, rows, &def, NULL, force_n, &error), &error);
  for (uint32_t i = 0; i < rows->count; ++i) {
    assert_true(force_n[i] > 0);
    rows->data[i].force_n = force_n[i];
  }
  free(force_n);
}

static const sonde_hyperelastic TRUTH[SONDE_SOLID_LAYERS] = {
    {SONDE_ENERGY_OGDEN, 4.2e3, 7, 24 * 4.2e3},
    {SONDE_ENERGY_OGDEN, 0.9e3, 11, 24 * 0.9e3},
    {SONDE_ENERGY_OGDEN, 40e3, 9, 24 * 40e3}};

// Two sites under both probes, three depths each; what is believed beforehand hardly counts. The
// moduli that made the forces come back, and so do the forces of a site that was left out.
static void moduli_come_back(void **state) {
  const bundled b = *(const bundled *)*state;
  enum { ROWS = 12 };
  static const uint32_t SITES[] = {8, 27}, OTHER[] = {30};
  sonde_error error;
  sonde_fit_solid_def def = coarse();
  def.ln_shear_sd = 3, def.ln_exponent_sd = 1, def.relative_sd = 1e-3, def.force_sd_n = 1e-4;
  sonde_measurements all = rows_of(&b, SITES, 2, 12e-3, NULL), rows;
  sonde_measurements other = rows_of(&b, OTHER, 1, 4e-3, "point");
  assert_ok(sonde_measurements_select(&all, &b.sites, NULL, 0, 3, &rows, &error), &error);
  sonde_measurements_clear(&all);
  assert_int_equal(rows.count, ROWS);
  for (uint32_t i = 0; i < rows.count; ++i) // of six rows every second, the deepest among them
    assert_near(rows.data[i].penetration_m, 4e-3 * (i % 3 + 1), 1e-9);
  replace_forces(&b, &rows, def, TRUTH);
  replace_forces(&b, &other, def, TRUTH);
  double fitted_n[ROWS], other_n[2];
  sonde_fit_solid_result r;
  assert_ok(sonde_fit_solid(b.model, &b.sites, &rows, &def, NULL, &r, fitted_n, &error), &error);
  print_message("%u steps, rms of ln from %.3f to %.1e\n", r.steps, r.start_rms, r.rms);
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) {
    print_message("%s %.4f kPa (%.4f), exponent %.3f (%.3f), sd of ln %.4f %.4f\n", LAYER[k],
                  1e-3 * r.layer[k].shear_pa, 1e-3 * TRUTH[k].shear_pa, r.layer[k].exponent,
                  TRUTH[k].exponent, r.certainty.ln_sd[k][0], r.certainty.ln_sd[k][1]);
    assert_near(log(r.layer[k].shear_pa / TRUTH[k].shear_pa), 0, 0.01);
    assert_near(log(r.layer[k].exponent / TRUTH[k].exponent), 0, 0.01);
    assert_near(r.layer[k].bulk_pa / r.layer[k].shear_pa, 24, 1e-9);
    assert_true(r.certainty.measured[k][0] && r.certainty.measured[k][1]);
  }
  assert_true(r.converged && r.row_count == ROWS && r.start_rms > 0.05);
  assert_true(r.rms < 3e-4);
  assert_near(sonde_ln_rms(rows.data, fitted_n, ROWS), r.rms, 1e-9);
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) def.contact.layer[k] = r.layer[k];
  assert_ok(sonde_predict_solid(b.model, &b.sites, &other, &def, NULL, other_n, &error), &error);
  assert_true(sonde_ln_rms(other.data, other_n, other.count) < 1e-3);
  sonde_fit_solid_result_clear(&r);
  sonde_measurements_clear(&rows);
  sonde_measurements_clear(&other);
}

// A curve that begins 0.8 mm late with a sensor that reads 0.15 N in the air.
static void contact_zero_and_tare_come_back(void **state) {
  const bundled b = *(const bundled *)*state;
  static const uint32_t SITE[] = {27};
  const double zero_m = 0.8e-3, tare_n = 0.15;
  sonde_error error;
  sonde_fit_solid_def def = coarse();
  def.ln_shear_sd = 0.05, def.ln_exponent_sd = 0.02, def.relative_sd = 1e-3;
  def.force_sd_n = 1e-3, def.contact.bonded = false, def.contact.rounding_m = 3e-3;
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) def.contact.layer[k] = TRUTH[k];
  sonde_measurements rows = rows_of(&b, SITE, 1, 10e-3, "linear");
  const uint32_t kept = rows.count;
  replace_forces(&b, &rows, def, TRUTH);
  for (uint32_t i = 0; i < kept; ++i)
    rows.data[i].penetration_m += zero_m, rows.data[i].force_n += tare_n;
  def.zero_sd_m = 2e-3, def.tare_sd_n = 0.5;
  double *fitted_n = calloc(kept, sizeof *fitted_n);
  sonde_fit_solid_result r;
  assert_ok(sonde_fit_solid(b.model, &b.sites, &rows, &def, NULL, &r, fitted_n, &error), &error);
  assert_int_equal(r.curve_count, 1);
  print_message("%u rows: contact zero %.3f mm, tare %.4f N\n", kept, 1e3 * r.curves[0].zero_m,
                r.curves[0].tare_n);
  assert_near(r.curves[0].zero_m, zero_m, 0.05e-3);
  assert_near(r.curves[0].tare_n, tare_n, 0.02);
  free(fitted_n);
  sonde_fit_solid_result_clear(&r);
  sonde_measurements_clear(&rows);
}

// One shallow press says nothing of exponents: they stay at what was believed, as wide, and are
// said not to be measured.
static void what_the_data_do_not_say_is_said(void **state) {
  const bundled b = *(const bundled *)*state;
  static const uint32_t SITE[] = {27};
  sonde_error error;
  sonde_fit_solid_def def = coarse();
  sonde_measurements rows = rows_of(&b, SITE, 1, 6e-3, NULL);
  const uint32_t kept = rows.count;
  replace_forces(&b, &rows, def, TRUTH);
  double *fitted_n = calloc(kept, sizeof *fitted_n);
  sonde_fit_solid_result r;
  assert_ok(sonde_fit_solid(b.model, &b.sites, &rows, &def, NULL, &r, fitted_n, &error), &error);
  const sonde_moduli_certainty *c = &r.certainty;
  assert_false(c->measured[SONDE_SOLID_SKIN][1]);
  assert_near(c->ln_sd[SONDE_SOLID_SKIN][1], def.ln_exponent_sd, 0.1 * def.ln_exponent_sd);
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) {
    const double off[2] = {log(r.layer[k].shear_pa / TRUTH[k].shear_pa),
                           log(r.layer[k].exponent / TRUTH[k].exponent)};
    for (int i = 0; i < 2; ++i) {
      print_message("%s: off by %.2f of ln, sd %.2f, %s\n", LAYER[k], off[i], c->ln_sd[k][i],
                    c->measured[k][i] ? "data" : "prior");
      assert_true(fabs(off[i]) < 2 * c->ln_sd[k][i]); // the truth lies in the interval
    }
  }
  free(fitted_n);
  sonde_fit_solid_result_clear(&r);
  sonde_measurements_clear(&rows);
}

static void bad_input_is_refused(void **state) {
  const bundled b = *(const bundled *)*state;
  static const uint32_t NONE[] = {99};
  sonde_error error;
  sonde_fit_solid_def def = coarse();
  sonde_measurements rows;
  double force_n[1];
  assert_int_equal(sonde_measurements_select(&b.m, &b.sites, NONE, 1, 4, &rows, &error),
                   SONDE_ARGUMENT);
  assert_says(&error, "site 99 has no measurements");
  def.relative_sd = NAN;
  assert_int_equal(sonde_predict_solid(b.model, &b.sites, &b.m, &def, NULL, force_n, &error),
                   SONDE_ARGUMENT);
  assert_says(&error, "relative_sd");
  sonde_fit_solid_result r;
  def = coarse(), def.contact.layer[SONDE_SOLID_FAT].exponent = -2;
  assert_int_equal(sonde_fit_solid(b.model, &b.sites, &b.m, &def, NULL, &r, force_n, &error),
                   SONDE_ARGUMENT);
  assert_says(&error, "-2");
  def = coarse(), def.version = 0;
  assert_int_equal(sonde_predict_solid(b.model, &b.sites, &b.m, &def, NULL, force_n, &error),
                   SONDE_ARGUMENT);
}

static bundled thigh;
static int load(void **state) {
  thigh = bundled_load("indentation.csv", 8.0);
  *state = &thigh;
  return 0;
}

static int drop(void **state) {
  bundled_clear(*state);
  return 0;
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(moduli_come_back), cmocka_unit_test(contact_zero_and_tare_come_back),
      cmocka_unit_test(what_the_data_do_not_say_is_said), cmocka_unit_test(bad_input_is_refused)};
  return cmocka_run_group_tests(tests, load, drop);
}
