// The force of a flat probe that slides on the skin without friction, over the force of the bonded
// footprint at the same depth: the bundled thigh against contact of the finite-element leg
// (tests/data/flat_contact). That leg has another mesh, so that only the ratio can be compared.
#include "fixture.h"

#include "sonde/robot.h"

#include <stdio.h>

enum { POINTS = 3, DEPTHS = 13 }; // 2, 4 ... 26 mm

static void read_study(sonde_site site[POINTS], double ratio[POINTS][DEPTHS]) {
  FILE *file = fopen(SONDE_SOURCE_DIR "/tests/data/flat_contact/contact_A.csv", "r");
  assert_non_null(file);
  char line[256];
  assert_non_null(fgets(line, sizeof line, file)); // the header
  for (int row = 0; row < POINTS * DEPTHS; ++row) {
    double x, y, z, nx, ny, nz, depth_mm, contact_n, bonded_n;
    unsigned point;
    assert_non_null(fgets(line, sizeof line, file));
    assert_int_equal(sscanf(line, "%u,linear,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf", &point, &x, &y,
                            &z, &nx, &ny, &nz, &depth_mm, &contact_n, &bonded_n),
                     10);
    assert_near(depth_mm, 2 * (row % DEPTHS + 1), 1e-9);
    sonde_vec3 normal = v_unit(vec3(nx, ny, nz), vec3(1, 0, 0));
    sonde_vec3 around = v_unit(vec3(-ny, nx, 0), vec3(0, 1, 0));
    site[row / DEPTHS] = (sonde_site){.id = point,
                                      .position_m = vec3(1e-3 * x, 1e-3 * y, 1e-3 * z),
                                      .normal = normal,
                                      .u = around,
                                      .v = v_cross(normal, around)};
    ratio[row / DEPTHS][row % DEPTHS] = contact_n / bonded_n;
  }
  fclose(file);
}

// Forces at 2, 4 ... 16 mm, where the live contact is meant to hold.
enum { COMPARED = 8 };
static void press(const sonde_model *model, sonde_site *site, sonde_robot_contact contact,
                  double force_n[POINTS][COMPARED]) {
  const sonde_site_table sites = {.count = POINTS, .sites = site};
  sonde_robot_def def = sonde_robot_def_default();
  def.probe = "linear";
  def.contact = contact;
  def.depth_limit_m = 2e-3 * COMPARED;
  sonde_measurements m;
  sonde_error error = {0};
  if (sonde_robot_run(model, &sites, &def, NULL, &m, NULL, &error)) fail_msg("%s", error.message);
  assert_int_equal(m.count, POINTS * COMPARED);
  for (uint32_t row = 0; row < m.count; ++row)
    force_n[row / COMPARED][row % COMPARED] = m.data[row].force_n;
  sonde_measurements_clear(&m);
}

static void sliding_probe_feels_its_share_of_the_bonded_force(void **state) {
  (void)state;
  sonde_site site[POINTS];
  double ratio[POINTS][DEPTHS], sliding[POINTS][COMPARED], bonded[POINTS][COMPARED];
  read_study(site, ratio);
  sonde_model *model = bundled_thigh();
  press(model, site, SONDE_ROBOT_PROBE, sliding);
  press(model, site, SONDE_ROBOT_BONDED, bonded);
  double low = 0, high = 0;
  for (int p = 0; p < POINTS; ++p)
    for (int d = 0; d < COMPARED; ++d) {
      double off = sliding[p][d] / bonded[p][d] / ratio[p][d] - 1;
      low = fmin(low, off), high = fmax(high, off);
    }
  print_message("2 to 16 mm: force of the sliding probe %+.1f to %+.1f %% off\n", 100 * low,
                100 * high);
  assert_true(low > -0.095 && high < 0.02);
  sonde_model_destroy(model);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(sliding_probe_feels_its_share_of_the_bonded_force),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
