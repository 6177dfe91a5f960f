// Laws of the fit of volumetric models: moduli that made the measurements are found again, and the
// condensed solid is the same solid.
#include "../fixture.h"
#include "sonde/fit_bulk.h"
#include "tissue/bulk/bulk.h"

#define BONE_M 0.02

static sonde_model_def ball(sonde_mesh *skin, sonde_mesh *bone, sonde_site *sites, uint32_t count) {
  *skin = fixture_sphere(4, FIXTURE_RADIUS_M), *bone = fixture_sphere(3, BONE_M);
  const sonde_vec3 way[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (uint32_t k = 0; k < count; ++k)
    sites[k] = (sonde_site){.id = k,
                            .position_m = v_scale(way[k], FIXTURE_RADIUS_M),
                            .normal = way[k],
                            .u = way[(k + 1) % 3],
                            .v = way[(k + 2) % 3]};
  sonde_model_def def = sonde_model_def_default();
  def.name = "ball";
  def.skin = skin, def.femur = bone;
  def.sites = sites, def.site_count = count;
  return def;
}

// Measurements made by a solid with known moduli give these moduli back.
static void moduli_are_found_again(void **unused) {
  (void)unused;
  enum { SITES = 2, DEPTHS = 4, ROWS = SITES * 2 * DEPTHS };
  sonde_mesh skin, bone;
  sonde_site sites[SITES];
  sonde_model_def def = ball(&skin, &bone, sites, SITES);
  sonde_bulk_law law = sonde_bulk_law_default(SONDE_LINEAR_SOLID);
  law.young_pa[SONDE_LAYER_FAT] = 8e3, law.young_pa[SONDE_LAYER_MUSCLE] = 20e3;
  const sonde_bulk_mesh mesh = {12e-3, 1, 12e-3, 0};
  sonde_model *truth = NULL, *found = NULL;
  sonde_error error = {0};
  assert_int_equal(
      sonde_bulk_build(&def, &mesh, NULL, SONDE_LINEAR_SOLID, &law, &truth, NULL, &error),
      SONDE_OK);

  sonde_site_table table = {.count = SITES, .sites = sites};
  sonde_datum data[ROWS];
  sonde_vec3 position[ROWS], normal[ROWS];
  for (uint32_t i = 0; i < ROWS; ++i) {
    const sonde_site *site = &sites[i / (2 * DEPTHS)];
    data[i] =
        (sonde_datum){.site = site->id, .penetration_m = 2e-3 * (i % DEPTHS + 1), .force_n = 1};
    strcpy(data[i].probe, i / DEPTHS % 2 ? "square" : "linear");
    position[i] = site->position_m, normal[i] = site->normal;
  }
  sonde_measurements m = {.count = ROWS, .data = data, .position_m = position, .normal = normal};
  sonde_predict_def predict = sonde_predict_def_default();
  predict.interaction = SONDE_INTERACTION_FULL;
  double force[ROWS];
  if (sonde_predict(truth, &table, &m, &predict, NULL, force, &error))
    fail_msg("%s", error.message);
  for (uint32_t i = 0; i < ROWS; ++i) data[i].force_n = force[i];

  sonde_fit_bulk_def options = sonde_fit_bulk_def_default();
  options.edge_m = options.fine_edge_m = 12e-3, options.fine_reach_m = 0;
  sonde_fit_bulk_result result;
  sonde_status status =
      sonde_fit_bulk(&def, &table, &m, &options, NULL, &found, &result, force, &error);
  if (status) fail_msg("%s", error.message);
  print_message("fat %.0f Pa, muscle %.0f Pa, error %.3f %%\n", result.value[0], result.value[1],
                result.all.all.mae_percent);
  // The ball that was found has chamfered once more, from the boundary of the boundary.
  assert_near(result.value[0] / 8e3, 1, 0.05);
  assert_near(result.value[1] / 20e3, 1, 0.05);
  assert_true(result.all.all.mae_percent < 1);
  assert_int_equal(result.parameter_count, 2);
  sonde_model_destroy(truth);
  sonde_model_destroy(found);
  sonde_mesh_clear(&skin);
  sonde_mesh_clear(&bone);
}

static void condensed_solid_is_the_same_solid(void **unused) {
  (void)unused;
  sonde_mesh skin, bone;
  sonde_site site;
  sonde_model_def def = ball(&skin, &bone, &site, 1);
  const sonde_bulk_law law = sonde_bulk_law_default(SONDE_LINEAR_SOLID);
  const sonde_bulk_mesh mesh = {12e-3, 1, 12e-3, 0};
  sonde_model *model = NULL;
  sonde_error error = {0};
  assert_int_equal(
      sonde_bulk_build(&def, &mesh, NULL, SONDE_LINEAR_SOLID, &law, &model, NULL, &error),
      SONDE_OK);
  sonde_condensed_cost cost;
  sonde_status status = sonde_condensed_measure(model, &site, 0.012, 0.012, 3e-3, 1, &cost, &error);
  if (status) fail_msg("%s", error.message);
  print_message("%u nodes, %u of the skin: %.3f N, %.2g from the whole solid, %.2g from the "
                "engine\n",
                cost.nodes, cost.skin_nodes, cost.force_n, cost.solve_difference,
                cost.engine_difference);
  assert_true(cost.force_n > 0.1 && cost.contact_nodes > 2);
  assert_true(cost.solve_difference < 1e-10);
  assert_true(cost.engine_difference < 1e-5);
  model->kind = SONDE_NEO_HOOKEAN_SOLID;
  assert_int_equal(sonde_condensed_measure(model, &site, 0.012, 0.012, 3e-3, 1, &cost, &error),
                   SONDE_ARGUMENT);
  sonde_model_destroy(model);
  sonde_mesh_clear(&skin);
  sonde_mesh_clear(&bone);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(condensed_solid_is_the_same_solid),
                                     cmocka_unit_test(moduli_are_found_again)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
