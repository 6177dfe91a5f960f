// The model of a limb in a position: surfaces, map, vessels and stations are those of the posed
// limb, and its veins close at the pressure that the position gives them.
#include "interior/interior.h"
#include "limb_test.h"
#include "sonde/limb_model.h"
#include "sonde/world_path.h"

#include <string.h>

static const double MMHG = 133.322387415;

static sonde_model *make(const sonde_limb_body *body, const sonde_limb_setting *setting) {
  sonde_model *made = NULL;
  sonde_error error = {0};
  sonde_limb_model_def def = sonde_limb_model_def_default();
  def.setting = setting;
  if (sonde_limb_model(body, &def, &made, &error)) fail_msg("%s", error.message);
  return made;
}

static sonde_model *make_usual(const sonde_limb_body *body, sonde_limb_position position) {
  sonde_limb_setting setting = sonde_limb_setting_usual(position);
  return make(body, &setting);
}

// Standing turns no joint and has no bed: the model is the straight one, but for the popliteal
// vein, which a straight knee narrows, and for what the veins have inside.
static void a_standing_limb_is_straight(void **state) {
  (void)state;
  sonde_limb_body body = body_of_family(3, SONDE_LIMB_LEFT);
  sonde_model *straight = make(&body, NULL), *stands = make_usual(&body, SONDE_LIMB_STANDING);
  assert_null(sonde_limb_pose_of(straight));
  assert_non_null(sonde_limb_pose_of(stands));
  // Nodes are the same but where the stations' own places refine the skin.
  const sonde_vec3 *skin = straight->surface.vertices;
  uint32_t same = 0, alike = 0;
  for (uint32_t i = 0; i < stands->surface.vertex_count; ++i) {
    uint32_t at = v_nearest(skin, straight->surface.vertex_count, stands->surface.vertices[i]);
    if (v_distance(skin[at], stands->surface.vertices[i]) > 2e-9) continue;
    ++same, alike += fabs(stands->k0_n_m3[i] / straight->k0_n_m3[at] - 1) < 0.06;
  }
  print_message("%u of %u nodes the same, springs of %u\n", same, stands->surface.vertex_count,
                alike);
  assert_true(same > 0.9 * stands->surface.vertex_count && alike > 0.97 * same);
  assert_int_equal(straight->vein.count, stands->vein.count);
  double narrow = 1;
  for (uint32_t i = 0; i < straight->vein.count; ++i) {
    const sonde_vessel_point *a = &straight->vein.point[i], *b = &stands->vein.point[i];
    assert_near(v_distance(a->centre_m, b->centre_m), 0, 2e-9);
    narrow = fmin(narrow, b->radius_m / a->radius_m);
  }
  assert_near(narrow, 4.3 / 7.7, 0.02);
  // Where the probe has room at a station it stands where it does at the straight limb.
  uint32_t there = 0;
  for (uint32_t k = 0; k < SONDE_LIMB_STATIONS; ++k)
    there += v_distance(straight->sites[k].position_m, stands->sites[k].position_m) < 2e-3;
  print_message("%u stations at the same place\n", there);
  assert_true(there >= 10);
  sonde_model_destroy(straight);
  sonde_model_destroy(stands);
}

// Of every position: surfaces are closed, the map's skin and bones lie on them, the map tells the
// tissue that the pose tells, vessels pass through the posed places, the main ones downwards.
static void models_are_those_of_the_posed_limb(void **state) {
  (void)state;
  uint32_t random = 7;
  for (uint32_t k = 0; k < SONDE_LIMB_POSITIONS; ++k) {
    sonde_limb_body body =
        body_of_family(2 * k + k % 2, k % 2 ? SONDE_LIMB_LEFT : SONDE_LIMB_RIGHT);
    sonde_model *m = make_usual(&body, (sonde_limb_position)k);
    const sonde_limb_pose *pose = sonde_limb_pose_of(m);
    const sonde_limb *limb = sonde_limb_of(m);
    const sonde_tissue_map *map = m->map;
    sonde_mesh_report report;
    sonde_error error = {0};
    if (sonde_mesh_inspect(&m->surface, &report, &error)) fail_msg("%s", error.message);
    assert_true(report.closed && report.outward);
    assert_int_equal(sonde_mesh_inspect(&m->femur, &report, NULL), SONDE_OK);
    assert_true(report.closed && report.outward);
    double skin = 0, bone = 0, edge = 0;
    uint32_t looked = 0, off = 0, apart = 0, surface = 0;
    for (uint32_t i = 0; i < m->topology.edge_count; ++i) edge = fmax(edge, m->edge_rest_m[i]);
    for (uint32_t i = 0; i < m->surface.vertex_count; i += 7) {
      sonde_vec3 p = m->surface.vertices[i];
      sonde_tissue_depths d;
      sonde_vec3 rest;
      double level, angle, f;
      if (!sonde_limb_pose_rest(pose, sonde_limb_to_model(limb, p), &rest)) continue;
      sonde_limb_polar(limb, rest, &level, &angle, &f);
      if (level < -0.17 || level > 1.97) continue; // the cut ends
      map->depths(map->self, p, &d);
      skin = fmax(skin, fabs(d.skin_m));
      ++looked, off += fabs(d.skin_m) > 0.5e-3;
      assert_true(d.skin_m < d.superficial_m && d.superficial_m < d.fascia_m);
    }
    for (uint32_t i = 0; i < m->femur.vertex_count; i += 7) {
      sonde_tissue_depths d;
      map->depths(map->self, m->femur.vertices[i], &d);
      bone = fmax(bone, fabs(d.bone_m));
      ++surface, apart += fabs(d.bone_m) > 0.5e-3;
    }
    print_message(
        "%s: skin %.2f mm off its map, %u of %u more than 0.5 mm; bones %.2f mm; edges to "
        "%.1f mm\n",
        sonde_limb_position_name((sonde_limb_position)k), 1e3 * skin, off, looked, 1e3 * bone,
        1e3 * edge);
    assert_true(off <= looked / 50 && skin < 4e-3 && edge < 0.025); // where it lies
    assert_true(apart <= surface / 50 && bone < 3e-3);
    // The tissue by the pose's labels, away from vessels.
    uint32_t asked = 0, same = 0;
    for (int n = 0; n < 3000; ++n) {
      double level = -0.1 + 2 * next_uniform(&random), angle = 2 * SONDE_PI * next_uniform(&random);
      sonde_vec3 rest = sonde_limb_point(limb, level, angle, 1.1 * next_uniform(&random));
      sonde_vec3 p = sonde_limb_pose_point(pose, rest);
      sonde_limb_label label = sonde_limb_pose_at(pose, p);
      if (label.tissue != SONDE_LIMB_MUSCLE && label.tissue != SONDE_LIMB_FAT &&
          label.tissue != SONDE_LIMB_BONE && label.tissue != SONDE_LIMB_TENDON)
        continue;
      sonde_tissue tissue = map->tissue(map->self, sonde_limb_to_model(limb, p));
      same += tissue == (label.tissue == SONDE_LIMB_MUSCLE ? SONDE_TISSUE_MUSCLE
                         : label.tissue == SONDE_LIMB_FAT  ? SONDE_TISSUE_FAT
                         : label.tissue == SONDE_LIMB_BONE ? SONDE_TISSUE_BONE
                                                           : SONDE_TISSUE_TENDON);
      ++asked;
      if (label.tissue != SONDE_LIMB_MUSCLE || n % 4) continue;
      // The cell of the least power is the muscle of the label; its fibres are the pose's.
      uint32_t seed[SONDE_MAP_SEEDS], best = 0;
      sonde_vec3 at = sonde_limb_to_model(limb, p), fibre;
      double power[SONDE_MAP_SEEDS];
      uint32_t count = map->seeds(map->self, at, 0.02, SONDE_MAP_SEEDS, seed);
      map->powers(map->self, at, count, seed, power, NULL);
      for (uint32_t i = 1; i < count; ++i)
        if (power[i] < power[best]) best = i;
      sonde_map_seed facts = map->seed(map->self, seed[best], at);
      assert_true(facts.muscle && facts.cell == label.index);
      if (sonde_limb_pose_fibre(pose, p, &fibre))
        assert_true(fabs(v_dot(facts.fibre, vec3(fibre.x, fibre.y, -fibre.z))) > 0.999);
    }
    assert_true(asked > 2000 && same > 0.995 * asked);
    // Vessels.
    for (uint32_t i = 1; i < m->vein.count; ++i)
      assert_true(m->vein.point[i].centre_m.z > m->vein.point[i - 1].centre_m.z);
    uint32_t femoral = sonde_limb_vessel_find(limb, "femoral vein");
    double length = sonde_limb_vessel_get(limb, femoral).length_m;
    for (int n = 1; n < 9; ++n) {
      sonde_vec3 p =
          sonde_limb_to_model(limb, sonde_limb_pose_place(pose, femoral, n * length / 9).centre_m);
      double near = INFINITY;
      for (uint32_t i = 1; i < m->vein.count; ++i) {
        sonde_vec3 a = m->vein.point[i - 1].centre_m, d = v_sub(m->vein.point[i].centre_m, a);
        double t = clamp(v_dot(v_sub(p, a), d) / v_norm2(d), 0, 1);
        near = fmin(near, v_distance(p, v_madd(a, t, d)));
      }
      assert_true(near < 0.6e-3);
    }
    // Landmarks lie on the skin, and what they look at is in the limb below them.
    for (uint32_t i = 0; i < SONDE_LIMB_STATIONS; ++i) {
      const sonde_landmark *mark = &m->anatomy->landmark[i];
      sonde_tissue_depths d;
      map->depths(map->self, mark->skin_m, &d);
      assert_true(fabs(d.skin_m) < 1e-3);
      assert_true(v_dot(v_sub(mark->skin_m, mark->vein_m), mark->normal) > 0);
    }
    sonde_model_destroy(m);
  }
}

// The vein of `model` nearest to the target of a station, at rest or under a cuff.
static const sonde_vessel_state *vein_at(const sonde_interior *in, sonde_vec3 at) {
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

static void update(const sonde_model *m, sonde_interior *in, double cuff_pa) {
  sonde_vec3 *none = SONDE_NEW(sonde_vec3, m->surface.vertex_count);
  sonde_pathology healthy;
  assert_int_equal(sonde_pathology_preset("healthy", &healthy, NULL), SONDE_OK);
  sonde_interior_set_method(in, SONDE_INTERIOR_COLUMNS);
  sonde_interior_update(in,
                        &(sonde_interior_input){.positions_m = m->surface.vertices,
                                                .contact_forces_n = none,
                                                .world_from_probe = sonde_site_pose(m->sites, 0),
                                                .pathology = &healthy,
                                                .dt_s = -1,
                                                .face_half_x_m = INFINITY,
                                                .face_half_y_m = INFINITY,
                                                .cuff_pa = cuff_pa});
  sonde_free(none);
}

// Cuffs that close the posterior tibial veins: published 20 to 25 mmHg lying, 50 to 60 sitting,
// about 70 standing. The popliteal vein widens from 4.3 to 7.7 mm as the knee bends, and a vein's
// area at rest is that of the pose.
static void cuffs_close_by_position(void **state) {
  (void)state;
  enum { TIBIAL = 10, POPLITEAL = 8 };
  sonde_limb_body body = draw_body(2, SONDE_SEX_MALE, 24, SONDE_LIMB_RIGHT);
  const sonde_limb_position as[] = {SONDE_LIMB_SUPINE_TURNED, SONDE_LIMB_SITTING,
                                    SONDE_LIMB_STANDING, SONDE_LIMB_PRONE, SONDE_LIMB_PRONE_BENT};
  double popliteal[SONDE_COUNT_OF(as)];
  for (size_t k = SAMPLES(0, 1); k < SONDE_COUNT_OF(as); ++k) {
    sonde_model *m = make_usual(&body, as[k]);
    sonde_interior *in = NULL;
    sonde_error error = {0};
    if (sonde_interior_create(m, &in, &error)) fail_msg("%s", error.message);
    update(m, in, 0);
    popliteal[k] = vein_at(in, m->anatomy->landmark[POPLITEAL].vein_m)->half_short_m;
    const sonde_vec3 target = m->anatomy->landmark[TIBIAL].vein_m;
    double low = 0, high = 150;
    while (high - low > 0.05) {
      double middle = 0.5 * (low + high);
      update(m, in, middle * MMHG);
      if (vein_at(in, target)->area_ratio > 0.05)
        low = middle;
      else
        high = middle;
    }
    print_message("%s: posterior tibial veins close at %.1f mmHg, popliteal vein %.2f mm\n",
                  sonde_limb_position_name(as[k]), high, 2e3 * popliteal[k]);
    const double band[][2] = {{19.9, 25}, {46, 60}, {65, 76}};
    assert_true(high > band[k < 3 ? k : 0][0] && high < band[k < 3 ? k : 0][1]);
    sonde_interior_destroy(in);
    sonde_model_destroy(m);
  }
  assert_near(popliteal[3] / popliteal[4], 4.3 / 7.7, 0.01);
}

// Area that a press leaves of a station's vein.
static double press(const sonde_model *m, uint32_t station, double force_n) {
  sonde_probe probe;
  sonde_state *state = NULL;
  sonde_interior *in = NULL;
  sonde_pathology healthy;
  sonde_path_result path;
  sonde_error error = {0};
  const sonde_landmark *mark = &m->anatomy->landmark[station];
  const sonde_pose on = sonde_site_pose(sonde_model_site(m, mark->site), 0);
  sonde_pose to = on;
  sonde_path_def def = sonde_path_def_default();
  def.relative_residual = 1e-4, def.tolerance = 0.05, def.step_m = 6e-3, def.force_n = force_n;
  to.position = v_madd(on.position, 0.05, q_rotate(on.rotation, vec3(0, 0, 1)));
  assert_int_equal(sonde_probe_create("linear", &probe, NULL), SONDE_OK);
  assert_int_equal(sonde_pathology_preset("healthy", &healthy, NULL), SONDE_OK);
  assert_int_equal(sonde_state_create(m, NULL, &state, NULL), SONDE_OK);
  if (sonde_interior_create(m, &in, &error)) fail_msg("%s", error.message);
  if (sonde_settle_path(state, &probe, on, to, &def, NULL, &path, &error))
    fail_msg("%s at %.1f N: %s", mark->name, force_n, error.message);
  sonde_interior_update(
      in, &(sonde_interior_input){.positions_m = sonde_state_positions(state),
                                  .contact_forces_n = sonde_state_contact_forces(state),
                                  .world_from_probe = path.pose,
                                  .pathology = &healthy,
                                  .dt_s = -1,
                                  .tick = 1,
                                  .face_half_x_m = probe.half_x_m,
                                  .face_half_y_m = probe.half_y_m});
  double area = vein_at(in, mark->vein_m)->area_ratio;
  sonde_state_destroy(state);
  sonde_interior_destroy(in);
  sonde_probe_clear(&probe);
  return area;
}

// The popliteal vein behind the bent knee closes within the band of its depth.
static void a_vein_closes_in_its_band(void **state) {
  (void)state;
  enum { POPLITEAL = 8 };
  sonde_limb_body body = draw_body(2, SONDE_SEX_MALE, 24, SONDE_LIMB_RIGHT);
  sonde_model *m = make_usual(&body, SONDE_LIMB_PRONE_BENT);
  sonde_limb_station station[SONDE_LIMB_STATIONS];
  sonde_limb_pose_stations(sonde_limb_pose_of(m), station);
  const sonde_limb_station *s = &station[POPLITEAL];
  double least = press(m, POPLITEAL, 0.8 * s->force_n[0]),
         most = press(m, POPLITEAL, 1.1 * s->force_n[1]);
  print_message("%.0f mm: %.1f N leave %.3f, %.1f N %.3f\n", 1e3 * s->depth_m, 0.8 * s->force_n[0],
                least, 1.1 * s->force_n[1], most);
  assert_true(least > 0.4 && most < 0.05); // 0.62
  sonde_model_destroy(m);
}

static void a_file_brings_the_same_position_back(void **state) {
  (void)state;
  static const char path[] = "test_posed_limb.sonde";
  sonde_limb_body body = body_of_family(5, SONDE_LIMB_LEFT);
  sonde_model *m = make_usual(&body, SONDE_LIMB_SITTING), *read = NULL;
  sonde_error error = {0};
  assert_int_equal(sonde_model_save(m, path, NULL), SONDE_OK);
  if (sonde_limb_model_load(path, &read, &error)) fail_msg("%s", error.message);
  const sonde_limb_setting a = sonde_limb_pose_setting(sonde_limb_pose_of(m)),
                           b = sonde_limb_pose_setting(sonde_limb_pose_of(read));
  assert_int_equal(a.position, b.position);
  assert_near(a.hip_flexion_rad, b.hip_flexion_rad, 0);
  assert_near(a.knee_flexion_rad, b.knee_flexion_rad, 0);
  assert_int_equal(read->gravity.posture, SONDE_POSTURE_SITTING);
  assert_near(v_distance(read->gravity.up, m->gravity.up), 0, 0);
  assert_near(v_distance(read->gravity.groin_m, m->gravity.groin_m), 0, 0);
  uint32_t random = 5;
  for (int n = 0; n < 500; ++n) {
    sonde_vec3 p = m->surface.vertices[(uint32_t)(next_uniform(&random) * m->surface.vertex_count)];
    p = v_madd(p, 0.02 * next_uniform(&random), vec3(0, 0, 1));
    assert_int_equal(read->map->tissue(read->map->self, p), m->map->tissue(m->map->self, p));
  }
  // libsonde alone keeps the veins' pressures too.
  sonde_model *plain = NULL;
  assert_int_equal(sonde_model_load(path, &plain, NULL), SONDE_OK);
  assert_int_equal(plain->gravity.posture, SONDE_POSTURE_SITTING);
  sonde_model_destroy(plain);
  // Another angle is another limb; a direction that is none is said.
  read->map_origin[read->map_origin_count - 1] += 0.1;
  assert_int_equal(sonde_model_save(read, path, NULL), SONDE_OK);
  sonde_model *wrong = NULL;
  assert_int_equal(sonde_limb_model_load(path, &wrong, &error), SONDE_VERSION);
  assert_non_null(strstr(error.message, "make it again"));
  read->gravity.up = vec3(0, 0, 2);
  assert_int_equal(sonde_model_save(read, path, NULL), SONDE_OK);
  assert_int_equal(sonde_model_load(path, &wrong, &error), SONDE_FORMAT);
  assert_non_null(strstr(error.message, "gravity"));
  sonde_model_destroy(read);
  sonde_model_destroy(m);
  remove(path);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_standing_limb_is_straight),
      cmocka_unit_test(models_are_those_of_the_posed_limb),
      cmocka_unit_test(cuffs_close_by_position),
      cmocka_unit_test(a_vein_closes_in_its_band),
      cmocka_unit_test(a_file_brings_the_same_position_back),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
