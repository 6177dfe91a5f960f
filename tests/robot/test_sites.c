// The site sampler: regular places on round, tapering and real skins, in bounds and in regions.
#include "fit/fit_thigh.h"

#include "base/maths.h"
#include "sonde/robot.h"

enum { SIDES = 180, RINGS = 60 };
static const double LENGTH_M = 0.24;

// A closed cone frustum along z, radius r0 at z = 0 and r1 at the other end, as far as the sampler
// needs a model: skin, normals and layers.
static sonde_model *frustum(double r0, double r1) {
  sonde_model *model = SONDE_NEW(sonde_model, 1);
  sonde_mesh *mesh = &model->surface;
  uint32_t n = SIDES * (RINGS + 1) + 2, f = 0;
  assert_ok(sonde_mesh_create(mesh, n, 2 * SIDES * RINGS + 2 * SIDES, NULL), NULL);
  for (uint32_t j = 0; j <= RINGS; ++j)
    for (uint32_t i = 0; i < SIDES; ++i) {
      double t = (double)j / RINGS, angle = 2 * SONDE_PI * i / SIDES, r = r0 + t * (r1 - r0);
      mesh->vertices[j * SIDES + i] = vec3(r * cos(angle), r * sin(angle), t * LENGTH_M);
    }
  mesh->vertices[n - 1] = vec3(0, 0, LENGTH_M);
  for (uint32_t i = 0; i < SIDES; ++i) {
    uint32_t next = (i + 1) % SIDES, top = RINGS * SIDES;
    for (uint32_t j = 0; j < RINGS; ++j) {
      uint32_t a = j * SIDES + i, b = j * SIDES + next;
      const uint32_t side[2][3] = {{a, b, b + SIDES}, {a, b + SIDES, a + SIDES}};
      memcpy(mesh->faces[f], side, sizeof side);
      f += 2;
    }
    const uint32_t cap[2][3] = {{n - 2, next, i}, {n - 1, top + i, top + next}};
    memcpy(mesh->faces[f], cap, sizeof cap);
    f += 2;
  }
  model->normal = SONDE_NEW(sonde_vec3, n);
  model->fat_depth_m = SONDE_NEW(double, n);
  model->muscle_depth_m = SONDE_NEW(double, n);
  sonde_mesh_normals(mesh, model->normal);
  for (uint32_t i = 0; i < n; ++i) {
    model->fat_depth_m[i] = 2e-3;
    model->muscle_depth_m[i] = 12e-3 + 0.05 * mesh->vertices[i].z;
  }
  return model;
}

static sonde_sites_def bounds(double a0, double a1, double z0_mm, double z1_mm, uint32_t columns,
                              uint32_t rows) {
  sonde_sites_def def = sonde_sites_def_default();
  def.columns = columns;
  def.rows = rows;
  def.angle_low_rad = a0 * SONDE_PI / 180;
  def.angle_high_rad = a1 * SONDE_PI / 180;
  def.z_low_m = 1e-3 * z0_mm;
  def.z_high_m = 1e-3 * z1_mm;
  return def;
}

static sonde_site_table place(const sonde_model *model, const sonde_sites_def *def) {
  sonde_site_table table;
  sonde_error error = {0};
  assert_ok(sonde_sites_place(model, def, &table, &error), &error);
  assert_int_equal(table.count, def->columns * def->rows);
  return table;
}

// On a cylinder equal distances are equal angles and heights, normals are radial.
static void cylinder_sites_are_where_they_must_be(void **state) {
  (void)state;
  sonde_model *model = frustum(0.06, 0.06);
  sonde_sites_def def = bounds(-30, 60, 50, 170, 7, 4);
  sonde_site_table t = place(model, &def);
  for (uint32_t k = 0; k < t.count; ++k) {
    const sonde_site *s = &t.sites[k];
    double angle = (-30 + 15.0 * (k % 7)) * SONDE_PI / 180, z = 0.05 + 0.04 * (k / 7);
    assert_int_equal(s->id, k);
    assert_near(v_distance(s->position_m, vec3(0.06 * cos(angle), 0.06 * sin(angle), z)), 0, 5e-5);
    assert_near(v_dot(s->normal, vec3(cos(angle), sin(angle), 0)), 1, 1e-5);
    assert_near(v_dot(s->u, vec3(-sin(angle), cos(angle), 0)), 1, 1e-5);
    assert_near(s->v.z, 1, 1e-5);
    assert_near(t.fat_depth_m[k], 0.01 + 0.05 * z, 1e-6);
  }
  sonde_site_table_clear(&t);
  sonde_model_destroy(model);
}

// Across the seam of the angle, all around.
static void sites_go_around_the_leg(void **state) {
  (void)state;
  sonde_model *model = frustum(0.06, 0.06);
  sonde_sites_def def = bounds(90, 420, 100, 100.001, 12, 1);
  sonde_site_table t = place(model, &def);
  sonde_site_spacing spacing = sonde_site_spacing_of(&t);
  assert_near(spacing.mean_m, 2 * 0.06 * sin(15 * SONDE_PI / 180), 1e-5);
  assert_true(spacing.cv < 1e-3);
  sonde_site_table_clear(&t);
  sonde_model_destroy(model);
}

// Distances between neighbours in each row and each column of a grid: least and largest of a
// direction, and its coefficient of variation.
static double grid_cv(const sonde_site_table *t, uint32_t columns, uint32_t step) {
  double sum = 0, squares = 0, n = 0;
  for (uint32_t k = 0; k + step < t->count; ++k) {
    if (step == 1 && k % columns == columns - 1) continue;
    double d = v_distance(t->sites[k].position_m, t->sites[k + step].position_m);
    sum += d;
    squares += d * d;
    n += 1;
  }
  return sqrt(squares / n - sum * sum / n / n) * n / sum;
}

static void thigh_sites_are_regular_and_match_the_measured_ones(void **state) {
  (void)state;
  bundled b = bundled_load("indentation.csv", 4.0);
  sonde_sites_def def = bounds(0, 100, 83, 217, 8, 8);
  sonde_site_table t = place(b.model, &def);
  sonde_site_spacing spacing = sonde_site_spacing_of(&t);
  // Columns go by length: chords of a row differ by the leg's curvature only.
  for (uint32_t k = 0; k + 2 < t.count; ++k) {
    if (k % 8 > 5) continue;
    double d = v_distance(t.sites[k].position_m, t.sites[k + 1].position_m);
    double next = v_distance(t.sites[k + 1].position_m, t.sites[k + 2].position_m);
    assert_near(next / d, 1, 0.01);
  }
  double around = grid_cv(&t, 8, 1), along = grid_cv(&t, 8, 8), far_m = 0, turned = 0;
  for (uint32_t k = 0; k < t.count; ++k) {
    far_m = fmax(far_m, v_distance(t.sites[k].position_m, b.sites.sites[k].position_m));
    turned = fmax(turned, acos(v_dot(t.sites[k].normal, b.sites.sites[k].normal)));
  }
  print_message("nearest neighbours CV %.4f, around %.4f, along %.4f; from the measured sites "
                "%.2f mm, normals %.2f degrees\n",
                spacing.cv, around, along, far_m * 1e3, turned * 180 / SONDE_PI);
  assert_true(spacing.cv < 0.1 && around < 0.1 && along < 0.1);
  assert_true(far_m < 2e-3); // one table goes by angle, the other by length
  assert_true(turned < SONDE_PI / 180);
  assert_ok(sonde_sites_check_on_surface(b.model, &t, 1e-4, NULL), NULL);
  // Without layers there is no fat thickness to tell.
  for (uint32_t k = 0; k < t.count; ++k) assert_true(isnan(t.fat_depth_m[k]));
  sonde_site_table_clear(&t);
  bundled_clear(&b);
}

// ---- painted regions ----------------------------------------------------------------------

static void inside_outline(const sonde_site_table *t) {
  for (uint32_t k = 0; k < t->count; ++k) {
    sonde_vec3 p = t->sites[k].position_m;
    double angle = atan2(p.y, p.x) * 180 / SONDE_PI;
    assert_true(angle > 149 || angle < -149);
    assert_true(p.z > 0.0595 && p.z < 0.1605);
  }
}

// A triangle on the skin opposite +x, where the angle jumps.
static void outline_is_filled_regularly(void **state) {
  (void)state;
  sonde_model *model = frustum(0.08, 0.06);
  const char *path = write_temporary("# drawn\nx_mm,y_mm,z_mm\n-65.0,-37.5,60\n-65.0,37.5,60\n"
                                     "-66.66,0,160\n");
  const uint32_t wanted[][2] = {{8, 8}, {1, 1}, {17, 2}, {6, 5}};
  for (int k = 0; k < 4; ++k) {
    sonde_sites_def def = bounds(0, 0, 0, 0, wanted[k][0], wanted[k][1]);
    def.painted = path;
    sonde_site_table t = place(model, &def);
    sonde_site_spacing spacing = sonde_site_spacing_of(&t);
    inside_outline(&t);
    assert_true(spacing.cv < 0.1);
    if (t.count > 1) {
      // A square lattice has one site per square of the pitch: here a triangle of 78 x 100 mm / 2.
      double pitch_m = sqrt(0.5 * 0.0785 * 0.1005 / t.count);
      assert_near(spacing.mean_m, pitch_m, 0.2 * pitch_m);
    }
    sonde_site_table_clear(&t);
  }
  sonde_model_destroy(model);
}

// A patch cut out of the skin itself gives sites on that patch only.
static void patch_is_filled_regularly(void **state) {
  (void)state;
  sonde_model *model = frustum(0.07, 0.06);
  sonde_mesh patch;
  assert_ok(sonde_mesh_copy(&model->surface, &patch, NULL), NULL);
  uint32_t kept = 0;
  for (uint32_t f = 0; f < patch.face_count; ++f) {
    sonde_vec3 p = patch.vertices[patch.faces[f][0]];
    if (hypot(p.x - 0.065, hypot(p.y, p.z - 0.12)) > 0.045 || p.x < 0.01) continue;
    memmove(patch.faces[kept++], patch.faces[f], sizeof patch.faces[f]);
  }
  patch.face_count = kept;
  const char *path = SONDE_BINARY_DIR "/robot_test_patch.stl"; // keeps used vertices only
  assert_ok(sonde_mesh_save(path, 1e-3, &patch, NULL), NULL);
  sonde_mesh_clear(&patch);
  sonde_sites_def def = bounds(0, 0, 0, 0, 6, 5);
  def.painted = path;
  sonde_site_table t = place(model, &def);
  assert_true(sonde_site_spacing_of(&t).cv < 0.1);
  for (uint32_t k = 0; k < t.count; ++k)
    assert_true(v_distance(t.sites[k].position_m, vec3(0.065, 0, 0.12)) < 0.052);
  sonde_site_table_clear(&t);
  sonde_model_destroy(model);
  unlink(path);
}

// ---- what is refused ----------------------------------------------------------------------

static void refuses(const sonde_model *model, const sonde_sites_def *def, sonde_status status,
                    const char *says) {
  sonde_site_table t;
  sonde_error error = {0};
  sonde_status got = sonde_sites_place(model, def, &t, &error);
  if (got != status) fail_msg("status %d: %s", (int)got, error.message);
  assert_says(&error, says);
  assert_null(t.sites);
}

static void refuses_bad_regions(void **state) {
  (void)state;
  sonde_model *model = frustum(0.06, 0.06);
  sonde_sites_def def = bounds(0, 100, 50, 150, 8, 0);
  refuses(model, &def, SONDE_ARGUMENT, "8 x 0 sites");
  def = bounds(100, 0, 50, 150, 8, 8);
  refuses(model, &def, SONDE_ARGUMENT, "100 to 0 degrees");
  def = bounds(0, 361, 50, 150, 8, 8);
  refuses(model, &def, SONDE_ARGUMENT, "360");
  def = bounds(0, 100, 150, 50, 8, 8);
  refuses(model, &def, SONDE_ARGUMENT, "150 to 50 mm");
  def = bounds(0, 100, 50, 500, 8, 8);
  refuses(model, &def, SONDE_MISMATCH, "no skin");
  def.painted = "/nowhere/region.csv";
  refuses(model, &def, SONDE_IO, "/nowhere/region.csv");
  def.painted = write_temporary("x_mm,y_mm\n1,2\n");
  refuses(model, &def, SONDE_FORMAT, "z_mm");
  def.painted = write_temporary("x_mm,y_mm,z_mm\n60,0,50\n60,0,60\n");
  refuses(model, &def, SONDE_FORMAT, "2 corners");
  def.painted = write_temporary("x_mm,y_mm,z_mm\n60,0,50\n60,0,90\n80,20,60\n");
  refuses(model, &def, SONDE_MISMATCH, "point 2 lies");
  def.painted = write_temporary("x_mm,y_mm,z_mm\n60,0,50\n60,0,90\n60,0,60\n");
  refuses(model, &def, SONDE_MISMATCH, "no skin");
  sonde_model_destroy(model);
}

// Sites that do not lie on the skin, or look into it, are named with their distance or angle.
static void sites_off_the_skin_are_named(void **state) {
  (void)state;
  sonde_model *model = frustum(0.06, 0.06);
  sonde_sites_def def = bounds(0, 90, 50, 150, 4, 4);
  sonde_site_table t = place(model, &def);
  sonde_error error;
  assert_ok(sonde_sites_check_on_surface(model, &t, 5e-3, &error), &error);
  t.sites[9].position_m = v_madd(t.sites[9].position_m, 0.012, t.sites[9].normal);
  t.sites[11].position_m = v_madd(t.sites[11].position_m, 0.02, t.sites[11].normal);
  assert_int_equal(sonde_sites_check_on_surface(model, &t, 5e-3, &error), SONDE_MISMATCH);
  assert_says(&error, "site 9 lies 12.0 mm");
  assert_says(&error, "at most 5.0 mm");
  assert_says(&error, "2 of 16");
  assert_ok(sonde_sites_check_on_surface(model, &t, 25e-3, &error), &error);
  t.sites[3].normal = v_neg(t.sites[3].normal);
  assert_int_equal(sonde_sites_check_on_surface(model, &t, 25e-3, &error), SONDE_MISMATCH);
  assert_says(&error, "site 3: its normal is 180 degrees");
  assert_says(&error, "inward");
  for (int degrees = 28; degrees <= 32; degrees += 4) {
    double a = degrees * SONDE_PI / 180;
    t.sites[3].normal = vec3(0, cos(a), sin(a)); // the skin there looks along y
    sonde_status status = sonde_sites_check_on_surface(model, &t, 25e-3, &error);
    assert_int_equal(status, degrees < 30 ? SONDE_OK : SONDE_MISMATCH);
  }
  sonde_site_table_clear(&t);
  sonde_model_destroy(model);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(cylinder_sites_are_where_they_must_be),
      cmocka_unit_test(sites_go_around_the_leg),
      cmocka_unit_test(thigh_sites_are_regular_and_match_the_measured_ones),
      cmocka_unit_test(outline_is_filled_regularly),
      cmocka_unit_test(patch_is_filled_regularly),
      cmocka_unit_test(refuses_bad_regions),
      cmocka_unit_test(sites_off_the_skin_are_named),
  };
  return cmocka_run_group_tests(tests, NULL, remove_temporary);
}
