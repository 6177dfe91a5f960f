// Tetrahedral meshes of thighs: the bundled one and generated ones, with their femurs.
#include "anatomy_test.h"
#include "elements/mesh_laws.h"

static void thigh_is_filled(const char *name, const sonde_model *model, double edge_m,
                            const mesh_bounds *bounds) {
  const sonde_tetrahedra_def def = {.edge_m = edge_m};
  sonde_tetrahedra t = make_mesh(&model->surface, &model->femur, &def);
  double volume = volume_of(&model->surface) - volume_of(&model->femur);
  holds_the_laws(name, &t, &model->surface, &model->femur, edge_m, volume, bounds);
  assert_true(t.held_count > 50);
  sonde_tetrahedra_clear(&t);
}

static void bundled_thigh_is_filled(void **state) {
  (void)state;
  sonde_model *model = bundled_thigh();
  const mesh_bounds bounds = {25, 149, 0.35, 0.005};
  static const double edge[3] = {0.012, 0.009, 0.006};
  for (int k = 0; k < 3; ++k) thigh_is_filled("bundled thigh", model, edge[k], &bounds);
  sonde_model_destroy(model);
}

static void fine_under_the_sites(void **state) {
  (void)state;
  sonde_model *model = bundled_thigh();
  sonde_vec3 sites[64];
  for (uint32_t k = 0; k < 64; ++k) sites[k] = model->sites[k].position_m;
  const sonde_tetrahedra_def def = {.edge_m = 0.012,
                                    .growth = 0.8,
                                    .fine = sites,
                                    .fine_count = 64,
                                    .fine_edge_m = 0.004,
                                    .fine_reach_m = 0.015};
  sonde_tetrahedra t = make_mesh(&model->surface, &model->femur, &def);
  double volume = volume_of(&model->surface) - volume_of(&model->femur);
  const mesh_bounds bounds = {24, 150, 0.35, 0.005};
  holds_the_laws("fine under the sites", &t, &model->surface, &model->femur, def.edge_m, volume,
                 &bounds);
  sonde_tetrahedra_clear(&t);
  sonde_model_destroy(model);
}

static void generated_thighs_are_filled(void **state) {
  (void)state;
  const mesh_bounds bounds = {25, 149, 0.6, 0.006};
  sonde_thigh_def def = coarse();
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    sonde_thigh thigh;
    sonde_model *model = make_thigh(NULL, seed, &def, &thigh);
    thigh_is_filled("generated thigh", model, 0.01, &bounds);
    sonde_model_destroy(model);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(bundled_thigh_is_filled),
      cmocka_unit_test(fine_under_the_sites),
      cmocka_unit_test(generated_thighs_are_filled),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
