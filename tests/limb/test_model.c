// The model of a limb: surfaces, layers and springs from the tissue below, the limb as tissue map,
// vessels and landmarks, its file.
#include "limb_test.h"

#include "sonde/limb_model.h"
#include "sonde/sonde.h"

#include <string.h>

enum { MODELS = 3 };
static sonde_model *model[MODELS];
static sonde_limb_body body[MODELS];

static sonde_model *make(const sonde_limb_body *of) {
  sonde_model *made = NULL;
  sonde_error error = {0};
  const sonde_limb_model_def def = sonde_limb_model_def_default();
  if (sonde_limb_model(of, &def, &made, &error)) fail_msg("%s", error.message);
  return made;
}

static int make_models(void **state) {
  (void)state;
  const double bmi[MODELS] = {20, 27, 35};
  for (uint32_t k = 0; k < MODELS; ++k) {
    body[k] = sonde_limb_unknown();
    body[k].bmi = bmi[k];
    body[k].side = k == 1 ? SONDE_LIMB_LEFT : SONDE_LIMB_RIGHT;
    assert_int_equal(sonde_limb_draw(&body[k], 40 + k, &body[k], NULL), SONDE_OK);
    model[k] = make(&body[k]);
  }
  return 0;
}
static int destroy_models(void **state) {
  (void)state;
  for (uint32_t k = 0; k < MODELS; ++k) sonde_model_destroy(model[k]);
  return 0;
}

static void surfaces_are_closed_and_the_map_lies_on_them(void **state) {
  (void)state;
  for (uint32_t k = 0; k < MODELS; ++k) {
    const sonde_model *m = model[k];
    const sonde_tissue_map *map = m->map;
    sonde_mesh_report report;
    assert_int_equal(sonde_mesh_inspect(&m->femur, &report, NULL), SONDE_OK);
    assert_true(report.closed && report.outward);
    double worst = 0, bone = 0, length = 0;
    uint32_t looked = 0, off = 0, surface = 0, apart = 0;
    for (uint32_t i = 0; i < m->surface.vertex_count; ++i)
      length = fmax(length, m->surface.vertices[i].z);
    for (uint32_t i = 0; i < m->surface.vertex_count; i += 7) {
      sonde_vec3 p = m->surface.vertices[i];
      sonde_tissue_depths d;
      if (p.z < 0.005 || p.z > length - 0.005) continue; // the cut ends
      map->depths(map->self, p, &d);
      worst = fmax(worst, fabs(d.skin_m));
      ++looked, off += fabs(d.skin_m) > 0.4e-3; // the sag of a face of 6 mm
      assert_true(d.skin_m < d.superficial_m && d.superficial_m < d.fascia_m);
    }
    for (uint32_t i = 0; i < m->femur.vertex_count; i += 7) {
      sonde_tissue_depths d;
      map->depths(map->self, m->femur.vertices[i], &d);
      bone = fmax(bone, fabs(d.bone_m));
      ++surface, apart += fabs(d.bone_m) > 0.5e-3;
    }
    print_message("limb %u: skin %.2f mm off its map, %u of %u more than 0.4 mm; bones %.2f mm\n",
                  k, 1e3 * worst, off, looked, 1e3 * bone);
    assert_true(off <= looked / 100 && worst < 4e-3);  // where the ramus lifts the skin
    assert_true(apart <= surface / 50 && bone < 3e-3); // where two bones touch
  }
}

// A point belongs to the cell of the least power, which is the muscle that the limb's label names.
static void powers_are_those_of_the_labels(void **state) {
  (void)state;
  uint32_t random = 3;
  for (uint32_t k = 0; k < MODELS; ++k) {
    const sonde_tissue_map *map = model[k]->map;
    const sonde_limb *limb = sonde_limb_of(model[k]);
    uint32_t muscles = 0;
    for (int n = 0; n < 4000; ++n) {
      double level = -0.1 + 2 * next_uniform(&random), angle = 2 * SONDE_PI * next_uniform(&random);
      sonde_vec3 p = sonde_limb_point(limb, level, angle, next_uniform(&random));
      sonde_limb_label label = sonde_limb_at(limb, p);
      sonde_vec3 rest = sonde_limb_to_model(limb, p);
      if (label.tissue != SONDE_LIMB_MUSCLE) continue;
      uint32_t seed[SONDE_MAP_SEEDS], best = 0;
      uint32_t count = map->seeds(map->self, rest, 0.02, SONDE_MAP_SEEDS, seed);
      double power[SONDE_MAP_SEEDS];
      sonde_vec3 at[SONDE_MAP_SEEDS];
      map->powers(map->self, rest, count, seed, power, at);
      for (uint32_t i = 1; i < count; ++i)
        if (power[i] < power[best]) best = i;
      sonde_map_seed facts = map->seed(map->self, seed[best], rest);
      assert_true(facts.muscle && facts.cell == label.index);
      assert_int_equal(map->tissue(map->self, rest), SONDE_TISSUE_MUSCLE);
      assert_near(v_norm(facts.fibre), 1, 1e-9);
      assert_true(facts.fibre.z > 0); // fibres run down, as the model's z
      ++muscles;
    }
    assert_true(muscles > 1000);
  }
}

static double stiffness_at(const sonde_model *m, const char *landmark) {
  const sonde_landmark *mark = sonde_anatomy_landmark(m->anatomy, landmark);
  if (!mark) fail_msg("no landmark %s", landmark);
  return m->sites[mark->site].k0_n_m3;
}

// Where the map says nerve, tendon or node, one of the bodies in reach of that kind holds the
// point, and inside a body, away from its rim, the map says so.
static void bodies_are_those_of_the_labels(void **state) {
  (void)state;
  enum { KINDS = 3, ROOM = 16 };
  static const sonde_tissue kind[KINDS] = {SONDE_TISSUE_NERVE, SONDE_TISSUE_TENDON,
                                           SONDE_TISSUE_NODE};
  uint32_t labelled[KINDS] = {0}, held[KINDS] = {0};
  const sonde_model *m = model[1];
  const sonde_tissue_map *map = m->map;
  double length = 0;
  for (uint32_t i = 0; i < m->surface.vertex_count; ++i)
    length = fmax(length, m->surface.vertices[i].z);
  for (double z = 0.02; z < length - 0.03; z += 0.004)
    for (double x = -0.1; x < 0.1; x += 1.7e-3)
      for (double y = -0.1; y < 0.1; y += 1.7e-3) {
        const sonde_vec3 p = vec3(x, y, z);
        const sonde_tissue tissue = map->tissue(map->self, p);
        for (uint32_t k = 0; k < KINDS; ++k) {
          if (tissue != kind[k]) continue;
          uint32_t id[ROOM];
          const uint32_t count = map->bodies(map->self, p, 0.02, ROOM, id);
          bool in = false;
          for (uint32_t i = 0; i < count; ++i) {
            const sonde_map_body b = map->body(map->self, id[i], p);
            const sonde_vec3 q = map->body_place(map->self, id[i], p);
            // A flat nerve's section is a band with round ends, its body's an ellipse.
            const double along = b.half_m.z > 0 ? q.z : 0;
            in = in || (b.tissue == tissue && q.x * q.x + q.y * q.y + along * along < 1.35);
          }
          ++labelled[k], held[k] += in;
        }
      }
  for (uint32_t k = 0; k < KINDS; ++k) {
    print_message("kind %u: %u of %u points in a body\n", k, held[k], labelled[k]);
    assert_true(labelled[k] > (k == 2 ? 5 : 100));
    assert_true(held[k] > 0.95 * labelled[k]);
  }
}

// The mean grey of the picture across a vein, from 0.15 to 0.85 of its radius on both sides of its
// middle. The beam looks at the vein from the skin over it.
static double lumen_grey(sonde_echo *echo, const sonde_model *m, sonde_vec3 middle, sonde_vec3 up,
                         double radius_m) {
  sonde_vec3 beam = vec3(-middle.x, -middle.y, 0);
  beam = v_unit(v_madd(beam, -v_dot(beam, up), up), vec3(0, 1, 0));
  sonde_vec3 face = middle;
  sonde_tissue_depths d = {0};
  for (int k = 0; k < 60; ++k) {
    m->map->depths(m->map->self, face, &d);
    face = v_madd(face, d.skin_m, beam);
  }
  const sonde_pose pose = {face, q_from_matrix(m_columns(v_cross(up, beam), up, beam))};
  sonde_pathology healthy;
  sonde_echo_settings settings = sonde_echo_settings_default();
  sonde_image image;
  enum { SIZE = 400 };
  assert_int_equal(sonde_pathology_preset("healthy", &healthy, NULL), SONDE_OK);
  assert_int_equal(sonde_image_create(SIZE, SIZE, &image, NULL), SONDE_OK);
  settings.depth_m = 0.06;
  sonde_echo_render(echo, pose, 0.03, &healthy, &settings, &image);
  const double per_m = SIZE / image.height_m, reach = radius_m * per_m,
               deep = v_dot(v_sub(middle, face), beam) * per_m;
  double sum = 0;
  uint32_t count = 0;
  for (int y = (int)(deep - 0.85 * reach); y < deep + 0.85 * reach; ++y)
    for (int x = SIZE / 2 - 12; fabs(y - deep) > 0.15 * reach && x < SIZE / 2 + 12; ++x)
      sum += image.pixels[y * SIZE + x], ++count;
  sonde_image_clear(&image);
  return sum / count;
}

// The cusps whose root is a place of the model; there is one such body.
static sonde_map_body cusps_at(const sonde_tissue_map *map, sonde_vec3 root, uint32_t *which) {
  enum { ROOM = 64 };
  uint32_t id[ROOM], found = 0;
  sonde_map_body cusps = {0};
  const uint32_t count = map->bodies(map->self, root, 0.002, ROOM, id);
  for (uint32_t i = 0; i < count; ++i) {
    const sonde_map_body b = map->body(map->self, id[i], root);
    if (b.tissue != SONDE_TISSUE_CUSPS || v_norm(map->body_place(map->self, id[i], root)) > 1e-6)
      continue;
    cusps = b, *which = id[i], ++found;
  }
  assert_int_equal(found, 1);
  return cusps;
}

// Each valve's cusps are a body rooted on the vein's middle, whose length runs along the vein
// towards the heart.
static void cusps_stand_in_their_veins(void **state) {
  (void)state;
  uint32_t seen = 0;
  for (uint32_t k = 0; k < MODELS; ++k) {
    const sonde_limb *limb = sonde_limb_of(model[k]);
    const sonde_tissue_map *map = model[k]->map;
    for (uint32_t v = 0; v < sonde_limb_vessel_count(limb); ++v)
      for (uint32_t n = 0; n < sonde_limb_vessel_get(limb, v).valves; ++n, ++seen) {
        const sonde_limb_valve valve = sonde_limb_vessel_valve(limb, v, n);
        const double above = fmax(valve.arc_m - 0.8 * valve.cusp_m, 0);
        const sonde_vec3 root =
            sonde_limb_to_model(limb, sonde_limb_vessel_place(limb, v, valve.arc_m).centre_m);
        const sonde_vec3 end =
            sonde_limb_to_model(limb, sonde_limb_vessel_place(limb, v, above).centre_m);
        uint32_t which;
        const sonde_map_body cusps = cusps_at(map, root, &which);
        assert_near(cusps.half_m.z, valve.cusp_m, 1e-9);
        if (!(above > 0)) continue;
        const sonde_vec3 q = map->body_place(map->self, which, end);
        assert_true(q.z > 0.6 && q.z < 0.81 && v_dot(cusps.axis, v_sub(end, root)) > 0);
      }
  }
  print_message("%u valves\n", seen);
  assert_true(seen > 150);
}

// A section through the cusps of a femoral valve is brighter inside than one below their roots.
static void pictures_show_cusps(void **state) {
  (void)state;
  const sonde_model *m = model[0];
  const sonde_limb *limb = sonde_limb_of(m);
  sonde_interior *in = NULL;
  sonde_echo *echo = NULL;
  sonde_pathology healthy;
  sonde_vec3 *still = SONDE_NEW(sonde_vec3, m->surface.vertex_count);
  assert_int_equal(sonde_interior_create(m, &in, NULL), SONDE_OK);
  sonde_interior_set_method(in, SONDE_INTERIOR_COLUMNS);
  assert_int_equal(sonde_pathology_preset("healthy", &healthy, NULL), SONDE_OK);
  assert_int_equal(sonde_echo_create(in, NULL, &echo, NULL), SONDE_OK);
  sonde_interior_update(in, &(sonde_interior_input){.positions_m = m->surface.vertices,
                                                    .contact_forces_n = still,
                                                    .world_from_probe = {{0, 0, 0}, {1, 0, 0, 0}},
                                                    .pathology = &healthy,
                                                    .dt_s = -1,
                                                    .tick = 1,
                                                    .face_half_x_m = 0.02,
                                                    .face_half_y_m = 0.01});
  const uint32_t femoral = sonde_limb_vessel_find(limb, "femoral vein");
  uint32_t shown = 0, brighter = 0, which;
  for (uint32_t n = 0; n < sonde_limb_vessel_get(limb, femoral).valves; ++n) {
    const sonde_limb_valve valve = sonde_limb_vessel_valve(limb, femoral, n);
    const double above = valve.arc_m - 0.8 * valve.cusp_m;
    if (!(above > 0)) continue;
    const sonde_limb_vessel_point at = sonde_limb_vessel_place(limb, femoral, valve.arc_m);
    const sonde_vec3 root = sonde_limb_to_model(limb, at.centre_m);
    const sonde_vec3 end =
        sonde_limb_to_model(limb, sonde_limb_vessel_place(limb, femoral, above).centre_m);
    const sonde_vec3 up = cusps_at(m->map, root, &which).axis;
    const double grey = lumen_grey(echo, m, end, up, at.radius_m),
                 below = lumen_grey(echo, m, v_madd(root, -2e-3, up), up, at.radius_m);
    // Cusps that open lean against the wall and leave the lumen's middle dark.
    sonde_vessel_blood blood[2 + SONDE_BRANCHES] = {{.path_m = 0}};
    sonde_echo_flow flow = sonde_echo_flow_default();
    double leaning[2];
    flow.blood = blood;
    for (int k = 0; k < 2; ++k) {
      for (size_t v = 0; v < SONDE_COUNT_OF(blood); ++v) blood[v].shut = k ? 0.2 : 0.7;
      sonde_echo_set_flow(echo, &flow);
      leaning[k] = lumen_grey(echo, m, end, up, 0.6 * at.radius_m);
    }
    flow.blood = NULL, sonde_echo_set_flow(echo, &flow);
    print_message("%.0f mm: grey %.1f through the cusps, %.1f below; middle %.1f shut, %.1f open\n",
                  1e3 * valve.arc_m, grey, below, leaning[0], leaning[1]);
    ++shown, brighter += grey > below + 3 && leaning[0] > leaning[1] + 3;
  }
  assert_true(shown >= 2 && brighter == shown);
  sonde_echo_destroy(echo);
  sonde_interior_destroy(in);
  sonde_free(still);
}

static void springs_follow_the_tissue_below(void **state) {
  (void)state;
  for (uint32_t k = 0; k < MODELS; ++k) {
    const sonde_model *m = model[k];
    const sonde_limb *limb = sonde_limb_of(m);
    // Over the shin there is no muscle, over mid-thigh there is most of it.
    sonde_vec3 shin = sonde_limb_point(limb, 1.4, 35 * DEGREE, 1.05);
    uint32_t over =
        v_nearest(m->surface.vertices, m->surface.vertex_count, sonde_limb_to_model(limb, shin));
    assert_true(m->bone_depth_m[over] < 0.02);
    assert_true(m->k0_n_m3[over] > 2 * stiffness_at(m, "femoral_mid"));
    assert_true(m->xm_m[over] < 0.5 * m->sites[5].xm_m);
    for (uint32_t i = 0; i < m->surface.vertex_count; ++i)
      assert_true(m->fat_depth_m[i] <= m->muscle_depth_m[i] &&
                  m->muscle_depth_m[i] < m->bone_depth_m[i]);
  }
}

static void vessels_run_down_under_their_landmarks(void **state) {
  (void)state;
  for (uint32_t k = 0; k < MODELS; ++k) {
    const sonde_model *m = model[k];
    const sonde_limb *limb = sonde_limb_of(m);
    for (uint32_t i = 1; i < m->vein.count; ++i)
      assert_true(m->vein.point[i].centre_m.z > m->vein.point[i - 1].centre_m.z);
    assert_int_equal(m->anatomy->landmark_count, SONDE_LIMB_STATIONS);
    assert_int_equal(m->anatomy->branch_count + 8, sonde_limb_vessel_count(limb)); // two chains
    for (uint32_t i = 0; i < m->anatomy->segment_count; ++i)
      assert_true(m->anatomy->segment[i].to_m > m->anatomy->segment[i].from_m);
    // The vein of the model passes through the places of the graph.
    uint32_t femoral = sonde_limb_vessel_find(limb, "femoral vein");
    double length = sonde_limb_vessel_get(limb, femoral).length_m;
    for (int n = 1; n < 9; ++n) {
      sonde_vec3 p = sonde_limb_to_model(
          limb, sonde_limb_vessel_place(limb, femoral, n * length / 9).centre_m);
      double near = INFINITY;
      for (uint32_t i = 1; i < m->vein.count; ++i) {
        sonde_vec3 a = m->vein.point[i - 1].centre_m, d = v_sub(m->vein.point[i].centre_m, a);
        double t = clamp(v_dot(v_sub(p, a), d) / v_norm2(d), 0, 1);
        near = fmin(near, v_distance(p, v_madd(a, t, d)));
      }
      assert_true(near < 0.5e-3);
    }
  }
}

// A left limb is the mirror of the right one of the same body.
static void a_left_model_is_the_mirror(void **state) {
  (void)state;
  sonde_limb_body left = body[0];
  left.side = SONDE_LIMB_LEFT;
  sonde_model *m = make(&left);
  assert_int_equal(m->vein.count, model[0]->vein.count);
  for (uint32_t i = 0; i < m->vein.count; ++i) {
    sonde_vec3 a = m->vein.point[i].centre_m, b = model[0]->vein.point[i].centre_m;
    assert_near(a.x, -b.x, 1e-8);
    assert_near(a.y, b.y, 1e-8);
    assert_near(a.z, b.z, 1e-8);
  }
  sonde_mesh_report report;
  assert_int_equal(sonde_mesh_inspect(&m->surface, &report, NULL), SONDE_OK);
  assert_true(report.closed && report.outward);
  sonde_model_destroy(m);
}

static void a_file_brings_the_same_limb_back(void **state) {
  (void)state;
  static const char path[] = "test_limb_model.sonde";

  assert_int_equal(sonde_model_save(model[1], path, NULL), SONDE_OK);
  sonde_model *read = NULL;
  sonde_error error = {0};
  if (sonde_limb_model_load(path, &read, &error)) fail_msg("%s", error.message);
  assert_non_null(sonde_limb_of(read));
  assert_int_equal(read->surface.vertex_count, model[1]->surface.vertex_count);
  assert_memory_equal(read->k0_n_m3, model[1]->k0_n_m3,
                      read->surface.vertex_count * sizeof *read->k0_n_m3);
  uint32_t random = 5;
  for (int n = 0; n < 500; ++n) {
    const sonde_tissue_map *a = read->map, *b = model[1]->map;
    sonde_vec3 p = vec3(0.1 * next_uniform(&random) - 0.05, 0.1 * next_uniform(&random) - 0.05,
                        0.8 * next_uniform(&random));
    assert_int_equal(a->tissue(a->self, p), b->tissue(b->self, p));
  }
  // The library without limbs reads the same file, and has no map.
  sonde_model *plain = NULL;
  assert_int_equal(sonde_model_load(path, &plain, NULL), SONDE_OK);
  assert_null(plain->map);
  sonde_model_destroy(plain);
  // Another body's numbers do not belong to this file's vein.
  read->map_origin[8] += 0.02;
  assert_int_equal(sonde_model_save(read, path, NULL), SONDE_OK);
  sonde_model *wrong = NULL;
  assert_int_equal(sonde_limb_model_load(path, &wrong, &error), SONDE_VERSION);
  assert_null(wrong);
  assert_non_null(strstr(error.message, "make it again"));
  read->map_origin[0] = 99;
  assert_int_equal(sonde_model_save(read, path, NULL), SONDE_OK);
  assert_int_equal(sonde_limb_model_load(path, &wrong, &error), SONDE_VERSION);
  sonde_model_destroy(read);
  remove(path);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(surfaces_are_closed_and_the_map_lies_on_them),
      cmocka_unit_test(powers_are_those_of_the_labels),
      cmocka_unit_test(bodies_are_those_of_the_labels),
      cmocka_unit_test(cusps_stand_in_their_veins),
      cmocka_unit_test(pictures_show_cusps),
      cmocka_unit_test(springs_follow_the_tissue_below),
      cmocka_unit_test(vessels_run_down_under_their_landmarks),
      cmocka_unit_test(a_left_model_is_the_mirror),
      cmocka_unit_test(a_file_brings_the_same_limb_back),
  };
  return cmocka_run_group_tests(tests, make_models, destroy_models);
}
