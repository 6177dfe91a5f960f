// Site and measurement files: what is read, what is refused and how it is said.
#include "fit_test.h"

#include "base/base.h"
#include "fit/fit_inside.h"

#define HEADER "site,probe,x_mm,y_mm,z_mm,nx,ny,nz,penetration_mm,force_n\n"
#define SITE_HEADER "site,x_mm,y_mm,z_mm,nx,ny,nz,ux,uy,uz,vx,vy,vz,fat_mm\n"

static void reads_columns_in_any_order(void **state) {
  (void)state;
  const char *path = write_temporary("\xEF\xBB\xBF# computed\r\n"
                                     "force_n,extra,penetration_mm,nz,ny,nx,z_mm,y_mm,x_mm,probe,"
                                     "site\r\n"
                                     "\r\n"
                                     "1.5,hello,2,3,0,0,30,20,10,point,7\r\n"
                                     "# a remark\r\n"
                                     " 2.5 , x , 4e0 ,0,0,1,30,20,10, linear ,7");
  sonde_measurements m;
  sonde_error error;
  assert_ok(sonde_measurements_load(path, NULL, &m, &error), &error);
  assert_int_equal(m.count, 2);
  assert_int_equal(m.data[0].site, 7);
  assert_string_equal(m.data[0].probe, "point");
  assert_string_equal(m.data[1].probe, "linear");
  assert_near(m.data[0].penetration_m, 2e-3, 1e-18);
  assert_near(m.data[1].force_n, 2.5, 0);
  assert_near(m.position_m[0].x, 10e-3, 1e-17);
  assert_near(m.position_m[0].z, 30e-3, 1e-17);
  assert_near(m.normal[0].z, 1.0, 0);
  sonde_measurements_clear(&m);
}

// Any order of rows and single negative forces are as good as others; rectangles are probes.
static void reads_rows_in_any_order(void **state) {
  (void)state;
  const char *path = write_temporary(HEADER "1,rect:24x7.5,0,0,0,0,0,1,4,3\n"
                                            "0,point,0,0,0,0,0,1,2,-0.02\n"
                                            "1,rect:24x7.5,0,0,0,0,0,1,2,1\n");
  sonde_measurements m;
  sonde_error error;
  assert_ok(sonde_measurements_load(path, NULL, &m, &error), &error);
  assert_int_equal(m.count, 3);
  assert_string_equal(m.data[0].probe, "rect:24x7.5");
  assert_near(m.data[1].force_n, -0.02, 0);
  snprintf(m.remark, sizeof m.remark, "first\nsecond,line");
  assert_ok(sonde_measurements_save(path, &m, &error), &error);
  sonde_measurements_clear(&m);
  assert_ok(sonde_measurements_load(path, NULL, &m, &error), &error);
  assert_int_equal(m.count, 3);
  assert_int_equal(m.remark[0], 0);
  sonde_measurements_clear(&m);
}

// ---- what a fit leaves out ----------------------------------------------------------------

typedef struct remarks {
  uint32_t infos, warnings;
  char last[2][256]; // of each level
} remarks;

static void keep_remark(sonde_log_level level, const char *message, void *user) {
  remarks *r = user;
  ++*(level == SONDE_LOG_INFO ? &r->infos : &r->warnings);
  snprintf(r->last[level == SONDE_LOG_WARNING], sizeof r->last[0], "%s", message);
}

// Loads a table for sites 0..3 at the origin and plans a fit.
static sonde_status plan_of(const char *text, remarks *r, sonde_measurements *m,
                            sonde_fit_plan *plan, sonde_error *error) {
  static sonde_site site[4] = {{.id = 0}, {.id = 1}, {.id = 2}, {.id = 3}};
  static double fat_m[4];
  const sonde_site_table sites = {4, site, fat_m};
  *r = (remarks){0};
  assert_ok(sonde_measurements_load(write_temporary(text), &sites, m, error), error);
  sonde_set_log(keep_remark, r);
  sonde_status status = sonde_fit_plan_create(&sites, m, plan, error);
  sonde_set_log(NULL, NULL);
  return status;
}

#define AT(site, probe, mm, n) #site "," #probe ",0,0,0,0,0,1," #mm "," #n "\n"
#define CURVE(site, probe) AT(site, probe, 2, 1) AT(site, probe, 4, 3) AT(site, probe, 6, 6)

static void short_curves_are_left_out_and_counted(void **state) {
  (void)state;
  remarks r;
  sonde_measurements m;
  sonde_fit_plan plan;
  sonde_error error;
  const char *text = HEADER AT(2, point, 2, 1) CURVE(0, point) CURVE(1, linear) AT(2, point, 4, 3)
      AT(3, square, 0, 0) AT(3, square, 2, 1) AT(3, square, 4, 1);
  assert_ok(plan_of(text, &r, &m, &plan, &error), &error);
  assert_int_equal(plan.excluded_curves, 2);
  assert_int_equal(plan.excluded_rows, 5);
  assert_int_equal(plan.row_count, 6);
  assert_int_equal(plan.curve_count, 2);
  assert_int_equal(plan.site_count, 2);
  assert_int_equal(plan.probe_count, 2); // the square went with its only curve
  assert_near(plan.mean_force_n[0], 10.0 / 3, 1e-12);
  assert_int_equal(r.warnings, 1);
  assert_non_null(strstr(r.last[1], "2 curves (5 rows)"));
  assert_non_null(strstr(r.last[1], "site 2, probe point"));
  for (uint32_t k = 0; k < plan.row_count; ++k) assert_true(m.data[plan.row[k]].site < 2);
  sonde_fit_plan_clear(&plan);
  sonde_measurements_clear(&m);
}

static void curves_without_force_are_left_out(void **state) {
  (void)state;
  remarks r;
  sonde_measurements m;
  sonde_fit_plan plan;
  sonde_error error;
  const char *text = HEADER CURVE(0, point) CURVE(0, linear) AT(1, point, 2, -1)
      AT(1, point, 4, 0.5) AT(1, point, 6, 0.5);
  assert_ok(plan_of(text, &r, &m, &plan, &error), &error);
  assert_int_equal(plan.excluded_rows, 3);
  assert_non_null(strstr(r.last[1], "not positive"));
  sonde_fit_plan_clear(&plan);
  sonde_measurements_clear(&m);
}

static void nothing_left_is_an_error(void **state) {
  (void)state;
  remarks r;
  sonde_measurements m;
  sonde_fit_plan plan;
  sonde_error error;
  const char *text = HEADER AT(0, point, 2, 1) AT(1, point, 2, 1) AT(1, point, 4, 1);
  assert_int_equal(plan_of(text, &r, &m, &plan, &error), SONDE_ARGUMENT);
  assert_says(&error, "none of the 2 curves");
  assert_null(plan.row);
  sonde_measurements_clear(&m);
}

static void order_and_a_lone_probe_are_remarked(void **state) {
  (void)state;
  remarks r;
  sonde_measurements m;
  sonde_fit_plan plan;
  sonde_error error;
  const char *text = HEADER AT(0, point, 6, 6) AT(1, point, 2, 1) AT(0, point, 4, 3)
      AT(1, point, 4, 2) AT(0, point, 2, 1) AT(1, point, 6, 4);
  assert_ok(plan_of(text, &r, &m, &plan, &error), &error);
  assert_int_equal(plan.unsorted_rows, 2);
  assert_int_equal(plan.excluded_rows, 0);
  assert_int_equal(r.infos, 1);
  assert_non_null(strstr(r.last[0], "2 measurements"));
  assert_int_equal(r.warnings, 1);
  assert_non_null(strstr(r.last[1], "one probe only (point)"));
  for (uint32_t k = 1; k < 3; ++k)
    assert_true(m.data[plan.row[k]].penetration_m > m.data[plan.row[k - 1]].penetration_m);
  sonde_fit_plan_clear(&plan);
  sonde_measurements_clear(&m);
  assert_ok(plan_of(HEADER CURVE(0, point) CURVE(0, linear), &r, &m, &plan, &error), &error);
  assert_int_equal(r.infos + r.warnings, 0);
  sonde_fit_plan_clear(&plan);
  sonde_measurements_clear(&m);
}

// One bad measurement file: the status, and parts of its sentence.
typedef struct bad_file {
  const char *text;
  sonde_status status;
  const char *says[3];
} bad_file;

static const bad_file BAD_MEASUREMENTS[] = {
    {"", SONDE_FORMAT, {"is empty", "header", "fit_test_"}},
    {"# only remarks\n\n", SONDE_FORMAT, {"is empty", "", ""}},
    {HEADER, SONDE_FORMAT, {"no rows", "", ""}},
    {"site,probe,x_mm,y_mm,z_mm,nx,ny,nz,penetration_mm\n",
     SONDE_FORMAT,
     {":1:", "'force_n'", "missing"}},
    {"site,site,probe\n", SONDE_FORMAT, {":1:", "'site'", "twice"}},
    {HEADER "0,point,0,0,0,0,0,1,2,abc\n", SONDE_FORMAT, {":2:", "force_n", "number, found 'abc'"}},
    {HEADER "0,point,0,0,0,0,0,1,2,1.5N\n", SONDE_FORMAT, {":2:", "force_n", "found '1.5N'"}},
    {HEADER "0,point,0,0,0,0,0,1,2,\n", SONDE_FORMAT, {":2:", "force_n", "expected a number"}},
    {HEADER "0,point,0,0,0,0,0,1,2,1\n0,point,0,0,0,0,0,1,nan,1\n",
     SONDE_FORMAT,
     {":3:", "penetration_mm", "finite"}},
    {HEADER "0,point,0,0,0,0,0,1,2,inf\n", SONDE_FORMAT, {":2:", "force_n", "finite"}},
    {HEADER "0,point,0,0,0,0,0,1,-2,1\n", SONDE_FORMAT, {":2:", "penetration_mm", ">= 0"}},
    {HEADER "0,point,0,0,0,0,0,1,2,1e300\n", SONDE_FORMAT, {":2:", "force_n", "1e6 N"}},
    {HEADER "0,point,0,0,0,0,0,1,1e9,1\n", SONDE_FORMAT, {":2:", "penetration_mm", "1000"}},
    {HEADER "0,point,0,0,0,0,0,0,2,1\n", SONDE_FORMAT, {":2:", "nx..nz", "zero vector"}},
    {HEADER "0,spoon,0,0,0,0,0,1,2,1\n", SONDE_FORMAT, {":2:", "'spoon'", "linear"}},
    {HEADER "1.5,point,0,0,0,0,0,1,2,1\n", SONDE_FORMAT, {":2:", "column site", "whole number"}},
    {HEADER "0,point,0,0,0,0,0,1,2\n", SONDE_FORMAT, {":2:", "9 cells", "expected 10"}},
    {HEADER "0,point,0,0,0,0,0,1,2,1\n0,linear,0,0,0,0,0,1,2,1\n0,point,0,0,0,0,0,1,2.0,3\n",
     SONDE_FORMAT,
     {":4:", "repeats line 2", "penetration_mm 2"}},
    {HEADER "9,point,0,0,0,0,0,1,2,1\n", SONDE_FORMAT, {":2:", "site 9", "not in the sites file"}},
    {HEADER "0,point,40,0,0,0,0,1,2,1\n", SONDE_MISMATCH, {":2:", "40.0 mm", "x_mm"}},
    {HEADER "0,rect:24,0,0,0,0,0,1,2,1\n", SONDE_FORMAT, {":2:", "'rect:24'", "rect:AxB"}},
    {HEADER "0,rect:24.000000000x24.00000000,0,0,0,0,0,1,2,1\n",
     SONDE_FORMAT,
     {":2:", "23", "rect"}},
    {HEADER "0,point,0,0,0,0,0,1,2,-1\n0,point,0,0,0,0,0,1,4,-3\n",
     SONDE_FORMAT,
     {"force_n", "mean is -2 N", "sign"}},
};

static void refuses_bad_measurements(void **state) {
  (void)state;
  sonde_site site = {.id = 0};
  double fat_m = 0;
  const sonde_site_table sites = {1, &site, &fat_m};
  for (size_t i = 0; i < sizeof BAD_MEASUREMENTS / sizeof *BAD_MEASUREMENTS; ++i) {
    const bad_file *bad = &BAD_MEASUREMENTS[i];
    sonde_measurements m;
    sonde_error error = {0};
    sonde_status status = sonde_measurements_load(write_temporary(bad->text), &sites, &m, &error);
    if (status != bad->status) fail_msg("case %zu: status %d: %s", i, status, error.message);
    assert_int_equal(error.status, bad->status);
    for (int k = 0; k < 3; ++k) assert_says(&error, bad->says[k]);
    assert_null(m.data);
    assert_int_equal(m.count, 0);
  }
}

static const bad_file BAD_SITES[] = {
    {SITE_HEADER, SONDE_FORMAT, {"no rows", "", ""}},
    {"site,x_mm,y_mm,z_mm,nx,ny,nz,ux,uy,uz\n", SONDE_FORMAT, {":1:", "'vx'", "missing"}},
    {SITE_HEADER "0,0,0,0,0,0,1,1,0,0,0,1,0,9\n0,0,0,0,0,0,1,1,0,0,0,1,0,9\n",
     SONDE_FORMAT,
     {":3:", "site 0", "twice"}},
    {SITE_HEADER "0,0,0,0,0,0,0,1,0,0,0,1,0,9\n", SONDE_FORMAT, {":2:", "nx..nz", "zero vector"}},
    {SITE_HEADER "0,0,0,0,0,0,1,0,0,2,0,1,0,9\n",
     SONDE_FORMAT,
     {":2:", "ux..uz", "along the normal"}},
    {SITE_HEADER "0,0,0,0,0,0,1,1,0,0,0,1,0,thick\n", SONDE_FORMAT, {":2:", "fat_mm", "'thick'"}},
    {SITE_HEADER "-1,0,0,0,0,0,1,1,0,0,0,1,0,9\n", SONDE_FORMAT, {":2:", "column site", "'-1'"}},
};

static void refuses_bad_sites(void **state) {
  (void)state;
  for (size_t i = 0; i < sizeof BAD_SITES / sizeof *BAD_SITES; ++i) {
    sonde_site_table table;
    sonde_error error = {0};
    sonde_status status = sonde_site_table_load(write_temporary(BAD_SITES[i].text), &table, &error);
    if (status != BAD_SITES[i].status) fail_msg("case %zu: %s", i, error.message);
    for (int k = 0; k < 3; ++k) assert_says(&error, BAD_SITES[i].says[k]);
    assert_null(table.sites);
  }
}

static void refuses_absent_files(void **state) {
  (void)state;
  sonde_measurements m;
  sonde_site_table table;
  sonde_error error;
  assert_int_equal(sonde_measurements_load("/nowhere/a.csv", NULL, &m, &error), SONDE_IO);
  assert_says(&error, "/nowhere/a.csv");
  assert_int_equal(sonde_site_table_load("/nowhere/a.csv", &table, &error), SONDE_IO);
  assert_int_equal(sonde_measurements_load("/nowhere/a.csv", NULL, &m, NULL), SONDE_IO);
}

static void zero_bytes_are_not_text(void **state) {
  (void)state;
  const char *path = write_temporary(HEADER);
  FILE *file = fopen(path, "ab");
  fwrite("0\0,", 1, 3, file);
  fclose(file);
  sonde_measurements m;
  sonde_error error;
  assert_int_equal(sonde_measurements_load(path, NULL, &m, &error), SONDE_FORMAT);
  assert_says(&error, "zero byte");
}

static void site_axes_become_orthonormal(void **state) {
  (void)state;
  sonde_site_table t;
  sonde_error error;
  const char *path = write_temporary(SITE_HEADER "3,1,2,3,0,0,2,3,0,1,0,5,0.5,9\n");
  assert_ok(sonde_site_table_load(path, &t, &error), &error);
  const sonde_site *s = t.sites;
  assert_near(s->normal.z, 1, 0);
  assert_near(s->u.x, 1, 1e-15);
  assert_near(s->u.z, 0, 1e-15);
  assert_near(s->v.y, 1, 1e-15);
  assert_near(t.fat_depth_m[0], 9e-3, 1e-15);
  sonde_site_table_clear(&t);
}

static void bundled_files_round_trip(void **state) {
  (void)state;
  sonde_site_table sites, sites2;
  sonde_measurements m, m2;
  sonde_error error;
  assert_ok(sonde_site_table_load(DATA_DIR "sites.csv", &sites, &error), &error);
  assert_ok(sonde_measurements_load(DATA_DIR "indentation.csv", &sites, &m, &error), &error);
  assert_int_equal(sites.count, 64);
  assert_int_equal(m.count, 1828);
  const char *path = write_temporary("");
  assert_ok(sonde_measurements_save(path, &m, &error), &error);
  assert_ok(sonde_measurements_load(path, &sites, &m2, &error), &error);
  assert_int_equal(m2.count, m.count);
  for (uint32_t i = 0; i < m.count; ++i) {
    assert_int_equal(m.data[i].site, m2.data[i].site);
    assert_string_equal(m.data[i].probe, m2.data[i].probe);
    assert_near(m.data[i].penetration_m, m2.data[i].penetration_m, 1e-15);
    assert_near(m.data[i].force_n, m2.data[i].force_n, 1e-12);
    assert_near(m.normal[i].x, m2.normal[i].x, 1e-6);
  }
  assert_ok(sonde_site_table_save(path, &sites, &error), &error);
  assert_ok(sonde_site_table_load(path, &sites2, &error), &error);
  assert_int_equal(sites2.count, 64);
  for (uint32_t i = 0; i < 64; ++i) {
    assert_near(sites.sites[i].position_m.y, sites2.sites[i].position_m.y, 1e-9);
    assert_near(sites.sites[i].u.y, sites2.sites[i].u.y, 1e-8);
    assert_near(sites.fat_depth_m[i], sites2.fat_depth_m[i], 1e-7);
  }
  sonde_site_table_clear(&sites);
  sonde_site_table_clear(&sites2);
  sonde_measurements_clear(&m);
  sonde_measurements_clear(&m2);
}

static void unwritable_place_leaves_nothing(void **state) {
  (void)state;
  sonde_measurements m = {0};
  sonde_error error;
  assert_int_equal(sonde_measurements_save("/nowhere/a.csv", &m, &error), SONDE_IO);
  assert_says(&error, "/nowhere/a.csv");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(reads_columns_in_any_order),
      cmocka_unit_test(reads_rows_in_any_order),
      cmocka_unit_test(short_curves_are_left_out_and_counted),
      cmocka_unit_test(curves_without_force_are_left_out),
      cmocka_unit_test(nothing_left_is_an_error),
      cmocka_unit_test(order_and_a_lone_probe_are_remarked),
      cmocka_unit_test(refuses_bad_measurements),
      cmocka_unit_test(refuses_bad_sites),
      cmocka_unit_test(refuses_absent_files),
      cmocka_unit_test(zero_bytes_are_not_text),
      cmocka_unit_test(site_axes_become_orthonormal),
      cmocka_unit_test(bundled_files_round_trip),
      cmocka_unit_test(unwritable_place_leaves_nothing),
  };
  return cmocka_run_group_tests(tests, NULL, remove_temporary);
}
