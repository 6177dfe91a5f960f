// Veins of a limb under the linear probe at the stations of an examination: forces that close them,
// against the bands that a half space gives for 22 mmHg at their depth (docs/limb_vessels.md).
#include "limb_test.h"
#include "sonde/interior.h"
#include "sonde/interior_findings.h"
#include "sonde/limb_model.h"
#include "sonde/world_path.h"

#include "interior/interior.h"

#include <string.h>

// Femoral vein at mid-thigh, popliteal, posterior tibial and peroneal veins.
static const int DEEP[] = {5, 8, 10, 11};

static sonde_model *model;
static sonde_interior *in;

// Section of a vein nearest to a place.
static const sonde_vessel_state *state_at(sonde_vec3 at) {
  const sonde_vessel_state *found = NULL;
  double nearest = INFINITY;
  for (uint32_t v = 0; v < in->vessel_count; ++v)
    for (uint32_t i = 0; i < in->course[v].count; ++i) {
      double d = v_distance(in->section[v][i].rest_m, at);
      if (in->course[v].kind != SONDE_VESSEL_VEIN || !(d < nearest)) continue;
      nearest = d, found = &in->state[v][i];
    }
  assert_true(nearest < 6e-3);
  return found;
}

// Presses at a station; areas of its veins, least area of the main artery.
static double press(const sonde_limb_station *station, double force_n,
                    double area[SONDE_LIMB_STATION_VEINS]) {
  const sonde_limb *limb = sonde_limb_of(model);
  sonde_probe probe;
  sonde_state *state;
  sonde_pathology healthy;
  sonde_path_result path;
  sonde_error error = {0};
  assert_int_equal(sonde_probe_create("linear", &probe, NULL), SONDE_OK);
  assert_int_equal(sonde_state_create(model, NULL, &state, NULL), SONDE_OK);
  assert_int_equal(sonde_pathology_preset("healthy", &healthy, NULL), SONDE_OK);
  sonde_vec3 z = q_rotate(station->probe.rotation, vec3(0, 0, 1));
  z.z = -z.z; // the model's z runs the other way
  const sonde_vec3 x = v_unit(v_cross(z, vec3(0, 0, 1)), vec3(1, 0, 0));
  const sonde_vec3 skin = sonde_limb_to_model(limb, station->skin_m);
  const sonde_quat turn = q_from_matrix(m_columns(x, v_cross(z, x), z));
  sonde_pose from = {v_madd(skin, -0.02, z), turn}, to = {v_madd(skin, 0.05, z), turn};
  sonde_path_def def = sonde_path_def_default();
  def.force_n = force_n, def.relative_residual = 1e-4, def.tolerance = 0.05, def.step_m = 6e-3;
  if (sonde_settle_path(state, &probe, from, to, &def, NULL, &path, &error))
    fail_msg("%s at %.1f N: %s", station->name, force_n, error.message);
  sonde_interior_update(in, &(sonde_interior_input){sonde_state_positions(state),
                                                    sonde_state_contact_forces(state), path.pose,
                                                    &healthy, -1, 1, probe.half_x_m, probe.half_y_m,
                                                    0, SONDE_POSTURE_SUPINE, NULL});
  for (uint32_t k = 0; k < station->veins; ++k) {
    sonde_vec3 at = sonde_limb_vessel_place(limb, station->vein[k], station->arc_m[k]).centre_m;
    area[k] = state_at(sonde_limb_to_model(limb, at))->area_ratio;
  }
  double artery = 1;
  for (uint32_t i = 0; i < in->course[1].count; ++i)
    artery = fmin(artery, in->state[1][i].area_ratio);
  sonde_state_destroy(state);
  sonde_probe_clear(&probe);
  return artery;
}

static int make_leg(void **state) {
  (void)state;
  sonde_limb_body body = sonde_limb_unknown();
  sonde_limb_model_def def = sonde_limb_model_def_default();
  sonde_error error = {0};
  body.bmi = 24, body.sex = SONDE_SEX_MALE;
  sonde_status status = sonde_limb_draw(&body, 2, &body, &error);
  if (!status) status = sonde_limb_model(&body, &def, &model, &error);
  if (!status) status = sonde_interior_create(model, &in, &error);
  if (status) fail_msg("%s", error.message);
  return (int)status;
}

static int clear_leg(void **state) {
  (void)state;
  sonde_interior_destroy(in);
  sonde_model_destroy(model);
  return 0;
}

static void deep_veins_close_in_the_bands(void **state) {
  (void)state;
  sonde_limb_station station[SONDE_LIMB_STATIONS];
  sonde_limb_stations(sonde_limb_of(model), station);
  // At the band's upper end each is shut and the artery open; at the lower end the first is open.
  for (size_t k = 0; k < SONDE_COUNT_OF(DEEP); ++k) {
    const sonde_limb_station *at = &station[DEEP[k]];
    double band[2], area[SONDE_LIMB_STATION_VEINS];
    sonde_limb_force_band(at->depth_m, band);
    double artery = press(at, band[1], area);
    for (uint32_t v = 0; v < at->veins; ++v) {
      print_message("%s, vein %u of %u: %.1f N leave %.4f, artery %.3f\n", at->name, v + 1,
                    at->veins, band[1], area[v], artery);
      assert_true(area[v] < 0.05 && artery > 0.92);
    }
    if (k > 0) continue;
    (void)press(at, band[0], area);
    print_message("%.1f N leave %.3f\n", band[0], area[0]);
    assert_true(area[0] > 0.4); // 0.465
  }
}

// Sections of a vein that lie in the lumen of another, or less than their own diameter beyond its
// wall before they do: where the other one is closed, the greatest area among them.
static double most_open_mouth(uint32_t branch, double *closed) {
  double most = 0;
  *closed = 1;
  for (uint32_t i = 0; i < in->course[branch].count; ++i) {
    const sonde_vessel_section *at = &in->section[branch][i];
    for (uint32_t k = 0; k < in->course[0].count; ++k) {
      const sonde_vessel_section *main = &in->section[0][k];
      const double apart = v_distance(at->rest_m, main->rest_m) - main->radius_m;
      if (apart > at->radius_m || !(in->state[0][k].area_ratio < 0.05)) continue;
      *closed = fmin(*closed, in->state[0][k].area_ratio);
      most = fmax(most, in->state[branch][i].area_ratio);
    }
  }
  return most;
}

// A branch opens through a hole in the main vein's wall: where the main vein is closed so is the
// hole, whatever the press does to the branch farther on, though the great saphenous vein's arch
// runs along the beam. A clot in the branch fills the hole and stays.
static void a_mouth_closes_with_its_vein(void **state) {
  (void)state;
  static const struct {
    int station;
    double force_n;
    const char *branch;
  } MOUTH[] = {{2, 14, "great_saphenous"}, {3, 14, "deep_femoral_vein"}};
  sonde_limb_station station[SONDE_LIMB_STATIONS];
  sonde_limb_stations(sonde_limb_of(model), station);
  for (size_t k = 0; k < SONDE_COUNT_OF(MOUTH); ++k) {
    uint32_t branch = 2;
    while (strcmp(sonde_interior_vessel_name(in, (int)branch), MOUTH[k].branch) != 0) ++branch;
    double area[SONDE_LIMB_STATION_VEINS], closed;
    (void)press(&station[MOUTH[k].station], MOUTH[k].force_n, area);
    double mouth = most_open_mouth(branch, &closed), far = 0;
    for (uint32_t i = 0; i < in->course[branch].count; ++i)
      far = fmax(far, in->state[branch][i].area_ratio);
    print_message("%s: mouth %.4f where the main vein is at %.4f, elsewhere up to %.3f\n",
                  MOUTH[k].branch, mouth, closed, far);
    assert_true(closed < 0.05 && mouth < 0.05 && far > 0.9);
    if (k > 0) continue;
    static sonde_findings clot;
    clot.branch_count = 1;
    snprintf(clot.branch[0].branch, sizeof clot.branch[0].branch, "%s", MOUTH[k].branch);
    assert_int_equal(sonde_pathology_preset("acute_occlusive", &clot.branch[0].pathology, NULL),
                     SONDE_OK);
    assert_int_equal(sonde_interior_set_findings(in, &clot, NULL), SONDE_OK);
    (void)press(&station[MOUTH[k].station], MOUTH[k].force_n, area);
    mouth = most_open_mouth(branch, &closed);
    print_message("filled with clot %.3f\n", mouth);
    assert_true(closed < 0.05 && mouth > 0.7);
    assert_int_equal(sonde_interior_set_findings(in, NULL, NULL), SONDE_OK);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(deep_veins_close_in_the_bands),
                                     cmocka_unit_test(a_mouth_closes_with_its_vein)};
  return cmocka_run_group_tests(tests, make_leg, clear_leg);
}
