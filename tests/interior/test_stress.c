// Stress of the solid against the finite-element study of vessels, and vessels driven by it.
#include "interior/study.h"

typedef struct stress_row {
  double penetration_m, force_n;
  char point[12];
  double xx, yy, zz; // Pa, tension positive
} stress_row;

static uint32_t read_stress(stress_row *rows, uint32_t capacity) {
  FILE *file = fopen(SONDE_SOURCE_DIR "/../shared/data/vein_compression/stress_no_vessel.csv", "r");
  char line[512];
  uint32_t count = 0;
  while (file != NULL && count < capacity && fgets(line, sizeof line, file) != NULL) {
    double v[3], xx, yy, zz;
    stress_row *r = &rows[count];
    if (sscanf(line, "novessel,%lf,%lf,%lf,%11[a-z0-9],%lf,%lf,%lf", &v[0], &v[1], &v[2], r->point,
               &xx, &yy, &zz) != 7)
      continue;
    *r = (stress_row){.penetration_m = v[0] * 1e-3, .force_n = v[1], .xx = xx * 1e3,
                      .yy = yy * 1e3, .zz = zz * 1e3, .point = {0}};
    (void)sscanf(line, "novessel,%*f,%*f,%*f,%11[a-z0-9]", r->point);
    ++count;
  }
  if (file != NULL) fclose(file);
  return count;
}

static double effective(double xx, double yy, double zz) { return -(2 * (xx + yy) - zz) / 3; }

static void stress_follows_the_study(void **state) {
  (void)state;
  static stress_row rows[200];
  uint32_t count = read_stress(rows, 200), used = 0;
  if (count == 0) skip();
  sonde_pathology p;
  assert_int_equal(sonde_pathology_preset("healthy", &p, NULL), SONDE_OK);
  double sum = 0, worst = 0;
  tube t = study_thigh(25e-3);
  sonde_interior *in;
  assert_int_equal(sonde_interior_create(&t.model, &in, NULL), SONDE_OK);
  for (uint32_t i = 0; i < count; ++i) {
    double depth = atof(rows[i].point + (rows[i].point[0] == 'v' ? 4 : 3)) * 1e-3;
    double x = rows[i].point[0] == 'v' ? 0 : 11e-3;
    study_press(in, &t, rows[i].penetration_m, rows[i].force_n, &p);
    sonde_mat3 s;
    assert_true(sonde_interior_stress(in, vec3(x, study_radius - depth, study_length / 2), &s));
    double got = effective(s.m[0][0], s.m[1][1], s.m[2][2]),
           want = effective(rows[i].xx, rows[i].yy, rows[i].zz);
    if (fabs(fmod(rows[i].penetration_m * 1e3, 5)) < 1e-6)
      print_message("%s %4.1f N: effective %.3f (study %.3f) kPa/N; xx %.3f (%.3f) yy %.3f (%.3f) "
                    "zz %.3f (%.3f)\n",
                    rows[i].point, rows[i].force_n, got / rows[i].force_n * 1e-3,
                    want / rows[i].force_n * 1e-3, s.m[0][0] / rows[i].force_n * 1e-3,
                    rows[i].xx / rows[i].force_n * 1e-3, s.m[1][1] / rows[i].force_n * 1e-3,
                    rows[i].yy / rows[i].force_n * 1e-3, s.m[2][2] / rows[i].force_n * 1e-3,
                    rows[i].zz / rows[i].force_n * 1e-3);
    sum += fabs(got / want - 1), worst = fmax(worst, fabs(got / want - 1)), ++used;
  }
  print_message("%u rows: effective pressure off by %.3f on average, %.3f at most\n", used,
                sum / used, worst);
  assert_true(used > 50 && sum / used < 0.1);
  sonde_interior_destroy(in);
  tube_clear(&t);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(stress_follows_the_study),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
