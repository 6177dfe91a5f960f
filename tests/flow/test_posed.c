// Flow in a limb that is held in a position: columns and lengths are those of the posed veins, a
// vein's blood runs along its posed way, and the cells of a box behind a bent knee carry it.
#include "flow/scene.h"

#include "fixture.h"
#include "sonde/limb_model.h"

#include <math.h>

static sonde_colour_cell cells[SONDE_COLOUR_CELLS];

static sonde_model *make(sonde_limb_position position) {
  sonde_limb_body known = sonde_limb_unknown(), body;
  known.bmi = 24, known.side = SONDE_LIMB_LEFT;
  sonde_limb_setting setting = sonde_limb_setting_usual(position);
  sonde_limb_model_def def = sonde_limb_model_def_default();
  sonde_model *model = NULL;
  sonde_error error = {0};
  def.setting = &setting, def.edge_m = 0.008;
  if (sonde_limb_draw(&known, 5, &body, &error) || sonde_limb_model(&body, &def, &model, &error))
    fail_msg("%s", error.message);
  return model;
}

// Standing, the deeper a segment lies the higher its column: that of the law of posture at its
// middle. A bent knee shortens what runs behind it.
static void test_columns(void **unused) {
  (void)unused;
  sonde_model *stands = make(SONDE_LIMB_STANDING);
  const sonde_limb_pose *pose = sonde_limb_pose_of(stands);
  sonde_flow_def def = sonde_flow_def_default(sonde_limb_of(stands)), lying = def;
  sonde_flow_def_hold(pose, &def);
  const double mmhg = SONDE_PA_PER_MMHG;
  print_message("standing: calf %.1f, knee %.1f, thigh %.1f, groin %.1f mmHg above lying\n",
                def.column_pa[SONDE_FLOW_CALF] / mmhg, def.column_pa[SONDE_FLOW_POPLITEAL] / mmhg,
                def.column_pa[SONDE_FLOW_FEMORAL] / mmhg,
                def.column_pa[SONDE_FLOW_COMMON_FEMORAL] / mmhg);
  for (int k = SONDE_FLOW_CALF; k < SONDE_FLOW_EXTERNAL_ILIAC; ++k)
    assert_true(def.column_pa[k] > def.column_pa[k + 1]);
  assert_near(def.column_pa[SONDE_FLOW_COMMON_ILIAC] / mmhg, 22, 0.1);
  assert_true(def.column_pa[SONDE_FLOW_CALF] > 45 * mmhg);
  assert_near(def.length_m[SONDE_FLOW_FEMORAL] / lying.length_m[SONDE_FLOW_FEMORAL], 1, 1e-3);
  // A straight knee narrows its vein.
  const double narrow =
      def.area_m2[SONDE_FLOW_POPLITEAL][0] / lying.area_m2[SONDE_FLOW_POPLITEAL][0];
  assert_true(narrow > pow(4.3 / 7.7, 2) && narrow < 0.8);
  // More pressure in every vein, and slower blood in it.
  sonde_flow flow[2];
  for (int n = 0; n < 2; ++n) {
    assert_int_equal(sonde_flow_start(n ? &def : &lying, &flow[n], NULL), SONDE_OK);
    for (int k = 0; k < 20000; ++k) sonde_flow_step(&flow[n], 1e-3);
  }
  for (int k = 0; k < SONDE_FLOW_SEGMENTS; ++k) {
    const sonde_flow_segment segment = (sonde_flow_segment)k;
    const double more =
        sonde_flow_pressure(&flow[1], segment) - sonde_flow_pressure(&flow[0], segment);
    // Less flow has less to overcome on its way.
    assert_true(more < def.column_pa[k] + 0.5 * mmhg && more > def.column_pa[k] - 4 * mmhg);
    if (k == SONDE_FLOW_POPLITEAL) continue;
    assert_true(sonde_flow_velocity(&flow[1], segment) <
                0.8 * sonde_flow_velocity(&flow[0], segment));
  }
  sonde_model_destroy(stands);
}

static void test_bent_knee(void **unused) {
  (void)unused;
  sonde_model *model = make(SONDE_LIMB_PRONE_BENT);
  const sonde_limb *limb = sonde_limb_of(model);
  sonde_interior *in = NULL;
  sonde_echo *echo = NULL;
  sonde_flow_scene *scene = NULL;
  assert_int_equal(sonde_interior_create(model, &in, NULL), SONDE_OK);
  sonde_interior_set_method(in, SONDE_INTERIOR_COLUMNS);
  assert_int_equal(sonde_echo_create(in, NULL, &echo, NULL), SONDE_OK);
  const uint32_t station = 8;
  const sonde_pose pose = sonde_site_pose(&model->sites[station], 0);
  sonde_vec3 *still = SONDE_NEW(sonde_vec3, model->surface.vertex_count);
  sonde_pathology healthy;
  assert_int_equal(sonde_pathology_preset("healthy", &healthy, NULL), SONDE_OK);
  sonde_interior_update(in, &(sonde_interior_input){.positions_m = model->surface.vertices,
                                                    .contact_forces_n = still,
                                                    .world_from_probe = pose,
                                                    .pathology = &healthy,
                                                    .dt_s = -1,
                                                    .tick = 1,
                                                    .face_half_x_m = 0.02,
                                                    .face_half_y_m = 0.01});
  sonde_image image;
  sonde_echo_settings settings = sonde_echo_settings_default();
  assert_int_equal(sonde_image_create(64, 64, &image, NULL), SONDE_OK);
  sonde_echo_render(echo, pose, 0.04, &healthy, &settings, &image);
  sonde_image_clear(&image);
  assert_int_equal(sonde_flow_scene_create(limb, in, &scene, NULL), SONDE_OK);

  // A line of the model runs away from the heart, but for what comes from the belly; the main one's
  // last stretch is the popliteal vein.
  uint32_t sections = 0, wrong = 0;
  for (uint32_t v = 0; v < in->vessel_count; ++v) {
    if (strstr(sonde_interior_vessel_name(in, (int)v), "epigastric")) continue;
    for (uint32_t i = 1; i < in->course[v].count; ++i) {
      const sonde_vec3 away = v_sub(in->section[v][i].rest_m, in->section[v][i - 1].rest_m);
      ++sections;
      wrong += scene->section[v][i].upwards * v_dot(in->section[v][i].axis, away) > 0;
    }
  }
  print_message("%u of %u sections run the wrong way\n", wrong, sections);
  assert_true(sections > 500 && wrong <= 2);
  const sonde_segment *popliteal = &model->anatomy->segment[4];
  for (uint32_t i = 0; i < in->course[0].count; ++i) {
    const double z = in->section[0][i].rest_m.z;
    if (z > popliteal->from_m + 0.01)
      assert_int_equal(scene->section[0][i].segment, SONDE_FLOW_POPLITEAL);
  }

  // The blood of the popliteal vein is what the network lets through it, and runs to the heart.
  sonde_flow_def def = sonde_flow_def_default(limb);
  sonde_flow_def_hold(sonde_limb_pose_of(model), &def);
  def.breath_pa = 0;
  sonde_flow flow;
  assert_int_equal(sonde_flow_start(&def, &flow, NULL), SONDE_OK);
  sonde_flow_scene_run(scene, &flow, 1.0);
  const sonde_colour_box box = {-0.02, 0.02, 0.003, 0.043, 0, 0};
  sonde_flow_scene_cells(scene, echo, &box, cells);
  double through = 0;
  uint32_t count = 0;
  const double cell = 0.04 / SONDE_COLOUR_LINES * 0.04 / SONDE_COLOUR_ROWS;
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) {
    if (cells[i].vessel != 0) continue;
    through += (double)cells[i].across_m_s * cell, ++count;
  }
  const double wanted = sonde_flow_through(&flow, SONDE_FLOW_POPLITEAL, 0);
  print_message("popliteal vein behind a bent knee: %.2f ml/s in %u cells of %.2f\n", 1e6 * through,
                count, 1e6 * wanted);
  assert_true(count > 200);
  assert_near(through / wanted, 1, 0.1);
  assert_true(sonde_flow_scene_velocity(scene, 0, pose) > 0);
  sonde_flow_scene_destroy(scene);
  sonde_echo_destroy(echo);
  sonde_interior_destroy(in);
  sonde_free(still);
  sonde_model_destroy(model);
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_columns),
                                     cmocka_unit_test(test_bent_knee)};
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
