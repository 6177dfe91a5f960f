// Stress of the solid against the finite-element study of vessels, and vessels driven by it.
#include "interior/study.h"
#include "interior/window.h"
#include "interior/vessels.h"

static void stress_follows_the_study(void **state) {
  (void)state;
  static stress_row rows[200];
  uint32_t count = read_stress(rows, 200), used = 0;
  assert_true(count > 0);
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

// ---- areas ----------------------------------------------------------------------------------

typedef struct area_row {
  char name[24];
  double depth_m, venous_mmhg, wall_pa, thrombus_pa, penetration_m, force_n;
  double vein, artery, short_m;
  double got_vein, got_artery, got_short_m;
} area_row;

static uint32_t read_areas(area_row *rows, uint32_t capacity) {
  FILE *file = fopen(SONDE_SOURCE_DIR "/tests/data/vein_compression/area_force.csv", "r");
  char line[512];
  uint32_t count = 0;
  while (file != NULL && count < capacity && fgets(line, sizeof line, file) != NULL) {
    char *field[32] = {0}, *at = line;
    for (int i = 0; i < 32 && at != NULL; ++i) field[i] = strsep(&at, ",");
    if (field[18] == NULL || strcmp(field[0], "case") == 0) continue;
    if (strstr(field[0], "mesh2") == NULL) continue; // the reference meshes
    area_row *r = &rows[count];
    *r = (area_row){.depth_m = atof(field[1]) * 1e-3,
                    .venous_mmhg = atof(field[2]),
                    .wall_pa = atof(field[3]) * 1e3,
                    .thrombus_pa = atof(field[4]) * 1e3,
                    .penetration_m = atof(field[7]) * 1e-3,
                    .force_n = atof(field[8]),
                    .vein = atof(field[11]),
                    .artery = atof(field[18]),
                    .short_m = atof(field[13]) * 1e-3};
    snprintf(r->name, sizeof r->name, "%s", field[0]);
    if (r->penetration_m > 0) ++count;
  }
  if (file != NULL) fclose(file);
  return count;
}

static void press_row(area_row *row) {
  sonde_pathology p;
  assert_int_equal(sonde_pathology_preset("healthy", &p, NULL), SONDE_OK);
  p.wall_shear_pa = row->wall_pa;
  p.sheath = 1; // the study's vessels are glued to the muscle
  if (row->venous_mmhg > 0) p.venous_pressure_pa = row->venous_mmhg * SONDE_PA_PER_MMHG;
  if (row->thrombus_pa > 0) {
    p.thrombus_fraction = 1;
    p.thrombus_modulus_pa = 3 * row->thrombus_pa;
  }
  static tube t;
  static sonde_interior *in;
  static double depth;
  if (in == NULL || fabs(depth - row->depth_m) > 1e-6) {
    if (in != NULL) {
      sonde_interior_destroy(in);
      tube_clear(&t);
    }
    t = study_thigh(row->depth_m), depth = row->depth_m;
    assert_int_equal(sonde_interior_create(&t.model, &in, NULL), SONDE_OK);
  }
  sonde_vessel_state vein, artery;
  study_press(in, &t, row->penetration_m, row->force_n, &p);
  assert_true(sonde_interior_vessel_at_plane(in, 0, study_pose(0), &vein));
  assert_true(sonde_interior_vessel_at_plane(in, 1, study_pose(0), &artery));
  row->got_vein = vein.area_ratio, row->got_artery = artery.area_ratio;
  row->got_short_m = 2 * vein.half_short_m;
}

// Force at which the area passes 0.2 of rest, by the rows; 0 when it does not.
static double force_at_fifth(const area_row *rows, uint32_t count, const char *name, bool got) {
  for (uint32_t i = 1; i < count; ++i) {
    double a = got ? rows[i - 1].got_vein : rows[i - 1].vein,
           b = got ? rows[i].got_vein : rows[i].vein;
    if (strcmp(rows[i].name, name) != 0 || strcmp(rows[i - 1].name, name) != 0) continue;
    if (a >= 0.2 && b < 0.2)
      return rows[i - 1].force_n + (a - 0.2) / (a - b) * (rows[i].force_n - rows[i - 1].force_n);
  }
  return 0;
}

static void areas_follow_the_study(void **state) {
  (void)state;
  static area_row rows[300];
  uint32_t count = read_areas(rows, 300), from = 0;
  assert_true(count > 0);
  for (uint32_t i = 0; i < count; ++i) press_row(&rows[i]);
  while (from < count) {
    uint32_t to = from, used = 0;
    double vein = 0, artery = 0, mm = 0;
    for (; to < count && strcmp(rows[to].name, rows[from].name) == 0; ++to) {
      if (rows[to].vein < 0.03) continue; // walls have crossed: beyond the study
      vein += fabs(rows[to].got_vein - rows[to].vein);
      artery += fabs(rows[to].got_artery - rows[to].artery);
      mm += fabs(rows[to].got_short_m - rows[to].short_m) * 1e3;
      ++used;
    }
    double f = force_at_fifth(rows, count, rows[from].name, false),
           g = force_at_fifth(rows, count, rows[from].name, true);
    print_message("%-16s %2u rows: vein %.3f artery %.3f of rest, short diameter %.2f mm; 20 %% at "
                  "%.2f N (study %.2f)\n",
                  rows[from].name, used, vein / used, artery / used, mm / used, g, f);
    assert_true(used > 5 && vein / used <= 0.06 && artery / used <= 0.06);
    if (f > 0) assert_true(fabs(g / f - 1) < 0.1);
    from = to;
  }
}

// The solid under the probe keeps its volume; the reaction it is scaled by is the contact force.
static void the_solid_keeps_volume(void **state) {
  (void)state;
  tube t = study_thigh(25e-3);
  sonde_interior *in;
  sonde_pathology p;
  assert_int_equal(sonde_pathology_preset("healthy", &p, NULL), SONDE_OK);
  assert_int_equal(sonde_interior_create(&t.model, &in, NULL), SONDE_OK);
  study_press(in, &t, 1e-3, 1, &p);
  assert_int_equal(sonde_interior_used_method(in), SONDE_INTERIOR_SOLID);
  double change = 0, all = 0;
  const sonde_solid *solid = &in->live->solid;
  for (uint32_t h = 0; h < solid->hex_count; ++h) {
    double rest, dilatation = sonde_solid_dilatation(solid, h, &rest);
    change += fabs(dilatation) * rest, all += rest;
  }
  print_message("1 mm of penetration: volume changes by %.5f on average\n", change / all);
  assert_true(change / all < 0.005);
  sonde_interior_destroy(in);
  tube_clear(&t);
}

// A point of the wall at rest lies on the wall's ellipse when pressed, and is found again.
static void walls_move_with_the_mechanics(void **state) {
  (void)state;
  tube t = study_thigh(18e-3);
  sonde_interior *in;
  sonde_pathology p;
  sonde_vessel_state v;
  assert_int_equal(sonde_pathology_preset("healthy", &p, NULL), SONDE_OK);
  assert_int_equal(sonde_interior_create(&t.model, &in, NULL), SONDE_OK);
  for (int glued = 0; glued < 2; ++glued) {
    p.sheath = glued;
    study_press(in, &t, glued ? 16e-3 : 9e-3, glued ? 12 : 5, &p);
    assert_true(sonde_vessel_at(in, 0, 0, &v));
    sonde_vec3 across = v_cross(v.axis, v.flat_axis);
    double worst = 0, lost = 0;
    for (int k = 0; k < 24; ++k) {
      double a = 2 * SONDE_PI * k / 24;
      sonde_vec3 d = v_madd(v_scale(v.flat_axis, cos(a)), sin(a), across);
      for (double r = 0.5; r < 1.01; r += 0.4999) {
        sonde_vec3 rest = v_madd(v.rest_centre_m, r * v.rest_radius_m, d);
        sonde_vec3 now = v_add(rest, sonde_interior_displacement(in, rest));
        sonde_vec3 from = v_sub(now, v.centre_m);
        double x = v_dot(from, v.flat_axis) / v.half_short_m;
        double y = v_dot(from, across) / v.half_long_m;
        worst = fmax(worst, fabs(hypot(x, y) - r));
        if (r < 0.9) lost = fmax(lost, v_distance(sonde_interior_rest_point(in, now), rest));
      }
    }
    print_message("area %.3f: wall within %.3f of its ellipse, rest points within %.2g m\n",
                  v.area_ratio, worst, lost);
    assert_true(v.area_ratio < 0.4 && worst < 0.08 && lost < 3e-4);
  }
  sonde_interior_destroy(in);
  tube_clear(&t);
}

static void press_for(sonde_interior *in, const tube *t, double penetration, sonde_mat3 *stress,
                      sonde_vec3 *moved) {
  sonde_pathology p;
  sonde_vec3 at = vec3(3e-3, study_radius - 20e-3, study_length / 2);
  assert_int_equal(sonde_pathology_preset("healthy", &p, NULL), SONDE_OK);
  study_press(in, t, penetration, 10, &p);
  assert_true(sonde_interior_stress(in, at, stress));
  *moved = sonde_interior_displacement(in, at);
}

// The solid keeps its last answers; what it says depends on the press alone.
static void answers_do_not_depend_on_the_past(void **state) {
  (void)state;
  tube t = study_thigh(25e-3);
  sonde_interior *in, *fresh;
  sonde_mat3 stress[4];
  sonde_vec3 moved[4];
  assert_int_equal(sonde_interior_create(&t.model, &in, NULL), SONDE_OK);
  assert_int_equal(sonde_interior_create(&t.model, &fresh, NULL), SONDE_OK);
  press_for(in, &t, 9e-3, &stress[0], &moved[0]);
  press_for(in, &t, 6e-3, &stress[1], &moved[1]);
  press_for(in, &t, 6e-3, &stress[2], &moved[2]);
  press_for(fresh, &t, 6e-3, &stress[3], &moved[3]);
  assert_true(v_distance(moved[0], moved[1]) > 0.5e-3);
  for (int k = 2; k < 4; ++k) {
    assert_memory_equal(&stress[k], &stress[1], sizeof stress[1]);
    assert_memory_equal(&moved[k], &moved[1], sizeof moved[1]);
  }
  sonde_interior_destroy(in);
  sonde_interior_destroy(fresh);
  tube_clear(&t);
}

static void pressures_follow_the_clock(void **state) {
  (void)state;
  sonde_circulation c = sonde_circulation_default();
  double low = INFINITY, high = -INFINITY, mean = 0, last = sonde_arterial_pressure(&c, 0);
  for (int k = 0; k < 1000; ++k) {
    double p = sonde_arterial_pressure(&c, k / 1000.0 / c.heart_rate_hz);
    low = fmin(low, p), high = fmax(high, p), mean += p / 1000;
    assert_true(fabs(p - last) < 0.05 * (c.systolic_pa - c.diastolic_pa));
    last = p;
  }
  assert_true(fabs(low - c.diastolic_pa) < 1 && fabs(high - c.systolic_pa) < 1);
  assert_true(mean > low + 0.25 * (high - low) && mean < low + 0.5 * (high - low));
  double beat = sonde_arterial_pressure(&c, 0.3),
         next = sonde_arterial_pressure(&c, 0.3 + 1 / c.heart_rate_hz);
  assert_true(fabs(beat - next) < 1e-6);
  double supine = sonde_venous_pressure(&c, 0);
  assert_true(fabs(supine - 10 * SONDE_PA_PER_MMHG) < 1);
  assert_true(sonde_venous_pressure(&c, 1) > supine && sonde_venous_pressure(&c, 3) < supine);
  c.valsalva_from_s = 10, c.valsalva_to_s = 14;
  assert_true(fabs(sonde_venous_pressure(&c, 12) - 30 * SONDE_PA_PER_MMHG) < 1);
  for (int posture = 0; posture + 1 < SONDE_POSTURE_COUNT; ++posture) {
    c.posture = (sonde_posture)posture;
    double lower = sonde_venous_pressure(&c, 0);
    c.posture = (sonde_posture)(posture + 1);
    assert_true(sonde_venous_pressure(&c, 0) > lower + 900);
  }
  sonde_pathology p;
  assert_int_equal(sonde_pathology_preset("healthy", &p, NULL), SONDE_OK);
  sonde_circulation_apply(&c, 12000, 1e-3, &p);
  assert_true(p.venous_pressure_pa > 52 * SONDE_PA_PER_MMHG - 1); // standing and straining
  // Stiffer walls give way less to the pressure that fills them.
  assert_true(sonde_vein_tube_pressure(1.3, 60e3) > sonde_vein_tube_pressure(1.3, 15e3) + 500);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(stress_follows_the_study),
      cmocka_unit_test(areas_follow_the_study),
      cmocka_unit_test(the_solid_keeps_volume),
      cmocka_unit_test(walls_move_with_the_mechanics),
      cmocka_unit_test(answers_do_not_depend_on_the_past),
      cmocka_unit_test(pressures_follow_the_clock),

  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
