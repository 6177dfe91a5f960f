// The field for many points in single precision against the field itself.
#include "base/random.h"
#include "interior/fields.h"
#include "interior/study.h"

enum { ROW = 25, ROWS = 400 };

static float draw(double half, uint64_t *next) {
  return (float)(half * (2 * sonde_random_uniform(3, (*next)++) - 1));
}

// Rows of points within 60 mm of the probe; returns the worst difference and the largest motion.
static double compare(const sonde_interior *in, sonde_vec3 corner, double *most) {
  sonde_fields *fields = SONDE_NEW(sonde_fields, 1);
  uint64_t next = 0;
  double worst = 0;
  *most = 0;
  sonde_fields_begin(fields, in, corner);
  for (int row = 0; row < ROWS; ++row) {
    float_x4 rest[ROW], got[ROW];
    uint32_t count = 1 + (uint32_t)row % ROW; // any number of points
    for (uint32_t k = 0; k < count; ++k)
      rest[k] = (float_x4){draw(0.06, &next), draw(0.06, &next), draw(0.06, &next), 0};
    sonde_fields_at(fields, count, rest, got);
    for (uint32_t k = 0; k < count; ++k) {
      sonde_vec3 way = vec3((double)rest[k][0], (double)rest[k][1], (double)rest[k][2]);
      sonde_vec3 due = sonde_interior_field(in, v_add(corner, way));
      sonde_vec3 is = vec3((double)got[k][0], (double)got[k][1], (double)got[k][2]);
      worst = fmax(worst, v_distance(due, is)), *most = fmax(*most, v_norm(due));
    }
  }
  sonde_free(fields);
  return worst;
}

// Around the whole leg, beyond its ends, in the bone and in the air.
static void fields_are_the_field(void **state) {
  (void)state;
  tube t = study_thigh(25e-3);
  sonde_interior *in;
  sonde_pathology p;
  double most;
  assert_int_equal(sonde_pathology_preset("healthy", &p, NULL), SONDE_OK);
  assert_int_equal(sonde_interior_create(&t.model, &in, NULL), SONDE_OK);
  for (int k = 0; k < 3; ++k) {
    study_press(in, &t, 4e-3 + 5e-3 * k, 5 + 10 * k, &p);
    assert_true(in->solid);
    sonde_vec3 corner = vec3(0.01 * k, study_radius - 0.05 * k, study_length / 2);
    double worst = compare(in, corner, &most);
    print_message("solid: %.2g nm off, moved by up to %.2g mm\n", worst * 1e9, most * 1e3);
    assert_true(worst < 0.1e-6 && most > 2e-3);
  }
  in->solid = false; // the columns' field, as before the solid is factored
  sonde_vec3 *now = t.model.surface.vertices;
  for (uint32_t i = 0; i < t.model.surface.vertex_count; ++i)
    now[i].y -= now[i].y > 0.07 ? 5e-3 : 0;
  sonde_interior_solve(in, now);
  double worst = compare(in, vec3(0, study_radius, study_length / 2), &most);
  print_message("columns: %.2g nm off, moved by up to %.2g mm\n", worst * 1e9, most * 1e3);
  assert_true(worst < 0.1e-6 && most > 2e-3);
  sonde_interior_destroy(in);
  tube_clear(&t);
}

static void angles_are_angles(void **state) {
  (void)state;
  double worst = 0;
  for (int k = -1800; k <= 1800; ++k) {
    double angle = k * SONDE_PI / 1800, r = k % 7 ? 0.08 : 1e-4;
    float x = (float)(r * cos(angle)), y = (float)(r * sin(angle));
    float_x4 got = vangle(vset_float_x4(x), vset_float_x4(y));
    double off = remainder((double)got[k & 3] - atan2((double)y, (double)x), 2 * SONDE_PI);
    worst = fmax(worst, fabs(off));
  }
  print_message("angles %.2g rad off\n", worst);
  assert_true(worst < 5e-7);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(fields_are_the_field),
      cmocka_unit_test(angles_are_angles),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
