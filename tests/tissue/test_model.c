// Building, saving and loading the model.
#include "../fixture.h"

#include <unistd.h>
#include <zlib.h>

static const char *const FILE_NAME = "test_model.sonde";

static void mass_is_density_times_area(void **state) {
  (void)state;
  sonde_model *model = fixture_model(3, NULL);
  sonde_mesh_report report;
  assert_int_equal(sonde_mesh_inspect(&model->surface, &report, NULL), SONDE_OK);
  double mass = 0;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) mass += model->mass_kg[i];
  assert_near(mass, model->law.surface_density_kg_m2 * report.area_m2, 1e-12 * mass);
  sonde_model_destroy(model);
}

static void layers_are_ordered(void **state) {
  (void)state;
  sonde_model *model = fixture_model(3, NULL);
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    assert_true(model->fat_depth_m[i] > 0);
    assert_true(model->muscle_depth_m[i] >= model->fat_depth_m[i]);
    assert_true(model->bone_depth_m[i] > model->muscle_depth_m[i]);
  }
  sonde_model_destroy(model);
}

// A limb with two cut ends: the fixture's sphere three times as long, cut at 1.8 radii, with a site
// in the middle. Only a limb gets the default bone and vessels.
static sonde_model *limb_model(int levels) {
  sonde_mesh skin = fixture_sphere(levels, FIXTURE_RADIUS_M);
  double cut_m = 1.8 * FIXTURE_RADIUS_M;
  for (uint32_t i = 0; i < skin.vertex_count; ++i)
    skin.vertices[i].z = clamp(3 * skin.vertices[i].z, -cut_m, cut_m);
  sonde_site site = fixture_site();
  sonde_model_def def = sonde_model_def_default();
  def.name = "limb";
  def.skin = &skin;
  def.sites = &site;
  def.site_count = 1;
  def.fine_edge_m = 1;
  sonde_model *model = NULL;
  sonde_error error = {0};
  if (sonde_model_build(&def, &model, &error)) fail_msg("%s", error.message);
  sonde_mesh_clear(&skin);
  return model;
}

// The default femur is closed and outward, and the nearest node sees it at radius minus 14 mm.
static void default_femur_is_a_rod(void **state) {
  (void)state;
  sonde_model *model = limb_model(3);
  sonde_mesh_report report;
  assert_int_equal(sonde_mesh_inspect(&model->femur, &report, NULL), SONDE_OK);
  assert_true(report.closed && report.outward);
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i)
    if (fabs(model->surface.vertices[i].z) < 1e-9)
      assert_near(model->bone_depth_m[i], FIXTURE_RADIUS_M - 0.014, 3e-4);
  sonde_model_destroy(model);
}

static void vein_passes_below_the_site(void **state) {
  (void)state;
  sonde_model *model = limb_model(4);
  double nearest = INFINITY, depth = 0;
  for (uint32_t k = 0; k < model->vein.count; ++k) {
    sonde_vec3 c = model->vein.point[k].centre_m;
    if (fabs(c.z) < nearest) nearest = fabs(c.z), depth = FIXTURE_RADIUS_M - v_norm(c);
  }
  assert_true(model->vein.count > 2 && model->artery.count == model->vein.count);
  assert_near(depth, 0.018, 4e-4);
  for (uint32_t k = 0; k < model->vein.count; ++k) {
    double gap = v_distance(model->vein.point[k].centre_m, model->artery.point[k].centre_m);
    assert_true(gap > model->vein.point[k].radius_m + model->artery.point[k].radius_m);
  }
  sonde_model_destroy(model);
}

// Kriging returns the sites' own values at the sites and stays near their range between them.
static void parameters_pass_through_the_sites(void **state) {
  (void)state;
  sonde_mesh skin = fixture_sphere(4, FIXTURE_RADIUS_M);
  sonde_site sites[3] = {fixture_site(), fixture_site(), fixture_site()};
  const uint32_t node[3] = {0, 1, 2};
  const double k0[3] = {1e5, 2e5, 4e5}, xm[3] = {0.03, 0.05, 0.04};
  const double shear[3] = {0.8, 1.3, 0}, limit[3] = {1, 0, 0.9}; // 0: the law's
  for (uint32_t k = 0; k < 3; ++k) {
    sites[k].id = k;
    sites[k].position_m = skin.vertices[node[k]];
    sites[k].k0_n_m3 = k0[k];
    sites[k].xm_m = xm[k];
    sites[k].shear_share = shear[k];
    sites[k].limit_share = limit[k];
  }
  sonde_model_def def = sonde_model_def_default();
  def.skin = &skin;
  def.sites = sites;
  def.site_count = 3;
  def.fine_edge_m = 1;
  sonde_model *model;
  assert_int_equal(sonde_model_build(&def, &model, NULL), SONDE_OK);
  for (uint32_t k = 0; k < 3; ++k) {
    uint32_t at = 0;
    while (v_distance(model->surface.vertices[at], sites[k].position_m) > 1e-9) at++;
    assert_near(model->k0_n_m3[at], k0[k], 1e-4 * k0[k]);
    assert_near(model->xm_m[at], xm[k], 1e-4 * xm[k]);
    assert_near(model->shear_share[at], shear[k] > 0 ? shear[k] : 1, 1e-4);
    assert_near(model->limit_share[at], limit[k] > 0 ? limit[k] : 1, 1e-4);
  }
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i)
    assert_true(model->k0_n_m3[i] > 0.5e5 && model->k0_n_m3[i] < 8e5);
  sonde_model_destroy(model);
  sonde_mesh_clear(&skin);
}

static void file_returns_the_same_model(void **state) {
  (void)state;
  sonde_surface_law law = sonde_surface_law_default();
  law.inplane_stiffness_n_m = 35;
  sonde_model *a = fixture_model(3, &law), *b;
  static const sonde_datum data[2] = {{0, "linear", 0.002, 1.25}, {0, "point", 0.004, 0.5}};
  sonde_free(a->data);
  a->data = SONDE_NEW(sonde_datum, 2);
  memcpy(a->data, data, sizeof data);
  a->datum_count = 2;
  fixture_vary_shear(a);
  a->sites[0].shear_share = 1.25;
  a->sites[0].limit_share = 0.75;
  assert_int_equal(sonde_model_save(a, FILE_NAME, NULL), SONDE_OK);
  assert_int_equal(sonde_model_load(FILE_NAME, &b, NULL), SONDE_OK);
  size_t n = a->surface.vertex_count;
  assert_memory_equal(a->surface.vertices, b->surface.vertices, n * sizeof(sonde_vec3));
  assert_memory_equal(a->normal, b->normal, n * sizeof(sonde_vec3));
  assert_memory_equal(a->k0_n_m3, b->k0_n_m3, n * sizeof(double));
  assert_memory_equal(a->bone_depth_m, b->bone_depth_m, n * sizeof(double));
  assert_memory_equal(a->shear_share, b->shear_share, n * sizeof(double));
  assert_memory_equal(a->limit_share, b->limit_share, n * sizeof(double));
  assert_memory_equal(a->sites, b->sites, a->site_count * sizeof *a->sites);
  assert_memory_equal(a->face_half_cotangent, b->face_half_cotangent,
                      a->surface.face_count * sizeof *a->face_half_cotangent);
  assert_memory_equal(&a->law, &b->law, sizeof a->law);
  assert_true(b->law.inplane_stiffness_n_m == 35);
  assert_memory_equal(a->data, b->data, sizeof data);
  assert_memory_equal(&a->vein.point[1], &b->vein.point[1], sizeof a->vein.point[1]);
  assert_string_equal(a->name, b->name);
  assert_int_equal(a->checksum, b->checksum);
  assert_int_not_equal(a->checksum, 0);
  unlink(FILE_NAME);
  sonde_model_destroy(a);
  sonde_model_destroy(b);
}

static void write_bytes(const char *bytes, size_t count) {
  FILE *file = fopen(FILE_NAME, "wb");
  assert_non_null(file);
  assert_int_equal(fwrite(bytes, 1, count, file), count);
  fclose(file);
}

// Renames all arrays called `from` in the header.
static void rename_arrays(char *bytes, size_t count, const char *from, const char *to) {
  assert_int_equal(strlen(from), strlen(to));
  for (size_t k = 0; k + strlen(from) < count; ++k)
    if (memcmp(bytes + k, from, strlen(from)) == 0) memcpy(bytes + k, to, strlen(to));
}

// A file from before the shear layer's fields is one without their arrays: the shares are one. One
// from before the in-plane layer has no number for it: zero.
static void older_files_have_simpler_layers(void **state) {
  (void)state;
  sonde_surface_law law = sonde_surface_law_default();
  law.inplane_stiffness_n_m = 35;
  sonde_model *model = fixture_model(1, &law), *loaded;
  fixture_vary_shear(model);
  assert_int_equal(sonde_model_save(model, FILE_NAME, NULL), SONDE_OK);
  char *bytes;
  size_t count;
  assert_int_equal(sonde_file_load(FILE_NAME, &bytes, &count, NULL), SONDE_OK);
  assert_memory_equal(bytes, "SONDE-MODEL 4", 13);
  bytes[12] = '2';
  rename_arrays(bytes, count, "node_shear_share", "node_other_thing");
  rename_arrays(bytes, count, "inplane_stiffness_n_m", "some_other_number_n_m");
  uint32_t crc = (uint32_t)crc32_z(0, (const Bytef *)bytes, count - 4);
  memcpy(bytes + count - 4, &crc, 4);
  write_bytes(bytes, count);
  assert_int_equal(sonde_model_load(FILE_NAME, &loaded, NULL), SONDE_OK);
  for (uint32_t i = 0; i < loaded->surface.vertex_count; ++i)
    assert_true(loaded->shear_share[i] == 1 && loaded->limit_share[i] == 1);
  assert_true(loaded->law.inplane_stiffness_n_m == 0);
  assert_memory_equal(model->k0_n_m3, loaded->k0_n_m3,
                      model->surface.vertex_count * sizeof(double));
  sonde_free(bytes);
  unlink(FILE_NAME);
  sonde_model_destroy(model);
  sonde_model_destroy(loaded);
}

// Any flipped byte and any cut is refused with a sentence that names the file.
static void damage_is_refused(void **state) {
  (void)state;
  sonde_model *model = fixture_model(1, NULL), *loaded;
  assert_int_equal(sonde_model_save(model, FILE_NAME, NULL), SONDE_OK);
  char *bytes;
  size_t count;
  assert_int_equal(sonde_file_load(FILE_NAME, &bytes, &count, NULL), SONDE_OK);
  for (size_t k = 0; k < count; k += 1 + k / 40) {
    sonde_error error = {0};
    bytes[k] ^= 0x10;
    write_bytes(bytes, count);
    assert_int_not_equal(sonde_model_load(FILE_NAME, &loaded, &error), SONDE_OK);
    assert_null(loaded);
    assert_non_null(strstr(error.message, FILE_NAME));
    bytes[k] ^= 0x10;
  }
  for (size_t cut = 0; cut < count; cut += count / 23) {
    write_bytes(bytes, cut);
    assert_int_not_equal(sonde_model_load(FILE_NAME, &loaded, NULL), SONDE_OK);
  }
  sonde_free(bytes);
  unlink(FILE_NAME);
  sonde_model_destroy(model);
}

// A whole file whose numbers are those of no body, each at the end of its range.
static void absurd_numbers_are_refused(void **state) {
  (void)state;
  sonde_model *model = limb_model(3), *loaded;
  double *const number[] = {
      &model->surface.vertices[0].x, &model->femur.vertices[0].z, &model->xm_m[0],
      &model->bone_depth_m[0],       &model->sites[0].k0_n_m3,    &model->vein.point[0].radius_m};
  const char *const name[] = {"surface_vertices[0]", "femur_vertices[2]", "node_xm[0]",
                              "node_bone_depth[0]",  "site[0]",           "vein[0]"};
  for (int k = 0; k < 6; ++k) {
    sonde_error error = {0};
    double right = *number[k];
    *number[k] = 1e13;
    assert_int_equal(sonde_model_save(model, FILE_NAME, NULL), SONDE_OK);
    assert_int_equal(sonde_model_load(FILE_NAME, &loaded, &error), SONDE_FORMAT);
    if (!strstr(error.message, name[k])) fail_msg("%s is not in %s", name[k], error.message);
    *number[k] = right;
  }
  unlink(FILE_NAME);
  sonde_model_destroy(model);
}

static void open_skin_is_refused(void **state) {
  (void)state;
  sonde_mesh skin = fixture_sphere(2, FIXTURE_RADIUS_M);
  skin.face_count--;
  sonde_site site = fixture_site();
  sonde_model_def def = sonde_model_def_default();
  def.skin = &skin;
  def.sites = &site;
  def.site_count = 1;
  sonde_model *model;
  sonde_error error;
  assert_int_equal(sonde_model_build(&def, &model, &error), SONDE_MESH);
  assert_non_null(strstr(error.message, "open edges"));
  sonde_mesh_clear(&skin);
}

static void bad_law_is_refused(void **state) {
  (void)state;
  sonde_model *model = fixture_model(1, NULL);
  sonde_surface_law law = model->law;
  law.edge_compression = 1.5;
  sonde_error error;
  assert_int_equal(sonde_model_set_parameters(model, &law, model->sites, 1, &error),
                   SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "edge_compression"));
  sonde_model_destroy(model);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(mass_is_density_times_area),
                                     cmocka_unit_test(layers_are_ordered),
                                     cmocka_unit_test(default_femur_is_a_rod),
                                     cmocka_unit_test(vein_passes_below_the_site),
                                     cmocka_unit_test(parameters_pass_through_the_sites),
                                     cmocka_unit_test(file_returns_the_same_model),
                                     cmocka_unit_test(older_files_have_simpler_layers),
                                     cmocka_unit_test(damage_is_refused),
                                     cmocka_unit_test(absurd_numbers_are_refused),
                                     cmocka_unit_test(open_skin_is_refused),
                                     cmocka_unit_test(bad_law_is_refused)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
