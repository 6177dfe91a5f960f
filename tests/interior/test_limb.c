// The inside of a limb: columns about a bent middle of the bones, a bone that is no cylinder,
// tissue by a map, many vessels, also across the leg, blood that has weight.
#include "interior/tube.h"

#include "interior/vessels.h"
#include "sonde/tissue_anatomy.h"

#include <stdlib.h>

static const double radius = 0.08, length = 0.3, bone = 0.014;

static void assert_created(sonde_status status, const sonde_error *error) {
  if (status) fail_msg("%s", error->message);
}

// Middle of the bones at a height: slopes up to 0.35 along x and 0.2 along y.
static sonde_vec3 middle_of(double z, double bend) {
  double turn = 2 * SONDE_PI * z / length;
  return vec3(bend * 0.017 * sin(turn), bend * 0.0095 * cos(turn), z);
}

// A round leg with a bone about that middle, with a ridge towards +y where `ridge` says.
static tube bent_limb(double bend, double ridge) {
  enum { AROUND = 96, ROWS = 80, POINTS = 61 };
  tube t = tube_create(radius, bone, length, 0.012, 192, 110);
  sonde_vec3 *ring = SONDE_NEW(sonde_vec3, AROUND * ROWS);
  for (int k = 0; k < AROUND * ROWS; ++k) {
    double a = 2 * SONDE_PI * (k % AROUND) / AROUND, z = length * (k / AROUND) / (ROWS - 1);
    double r = bone + ridge * pow(0.5 + 0.5 * sin(a), 4);
    ring[k] = v_add(middle_of(z, bend), vec3(r * cos(a), r * sin(a), 0));
  }
  sonde_mesh_clear(&t.model.femur);
  tube_surface(&t.model.femur, AROUND, ROWS, ring);
  sonde_free(ring);
  t.model.bone_axis_m = SONDE_NEW(sonde_vec3, POINTS);
  t.model.bone_axis_count = POINTS;
  for (uint32_t k = 0; k < POINTS; ++k)
    t.model.bone_axis_m[k] = middle_of(length * k / (POINTS - 1), bend);
  return t;
}

static void clear_limb(tube *t) {
  sonde_free(t->model.bone_axis_m);
  sonde_free(t->model.anatomy);
  tube_clear(t);
}

static sonde_interior *inside_of(const tube *t) {
  sonde_interior *in = NULL;
  sonde_error error = {0};
  assert_created(sonde_interior_create(&t->model, &in, &error), &error);
  return in;
}

// The skin with a smooth dent of that depth under +y, and an update by the columns' field.
static sonde_vec3 *dent(sonde_interior *in, const tube *t, double depth, sonde_posture posture) {
  const uint32_t n = t->model.surface.vertex_count;
  sonde_vec3 *p = SONDE_NEW(sonde_vec3, n), *force = SONDE_NEW(sonde_vec3, n);
  sonde_pathology healthy;
  assert_int_equal(sonde_pathology_preset("healthy", &healthy, NULL), SONDE_OK);
  for (uint32_t i = 0; i < n; ++i) {
    sonde_vec3 q = t->model.surface.vertices[i];
    double x = q.x / 0.025, z = (q.z - length / 2) / 0.025, size = exp(-x * x - z * z);
    p[i] = q;
    if (q.y > 0) p[i].y -= depth * size;
  }
  sonde_interior_set_method(in, SONDE_INTERIOR_COLUMNS);
  sonde_interior_update(in, &(sonde_interior_input){.positions_m = p,
                                                    .contact_forces_n = force,
                                                    .world_from_probe = tube_pose(0.2, length / 2),
                                                    .pathology = &healthy,
                                                    .dt_s = -1,
                                                    .tick = 1,
                                                    .face_half_x_m = 0.02,
                                                    .face_half_y_m = 0.01,
                                                    .posture = posture});
  sonde_free(force);
  return p;
}

static void a_straight_limb_is_a_thigh(void **state) {
  (void)state;
  tube limb = bent_limb(0, 0), thigh = tube_create(radius, bone, length, 0.012, 192, 110);
  sonde_interior *a = inside_of(&limb), *b = inside_of(&thigh);
  sonde_vec3 *p = dent(a, &limb, 2e-3, SONDE_POSTURE_SUPINE);
  sonde_free(p);
  p = dent(b, &thigh, 2e-3, SONDE_POSTURE_SUPINE);
  double worst = 0, most = 0;
  for (double x = -0.04; x <= 0.04; x += 5e-3)
    for (double y = 0.02; y < 0.07; y += 4e-3)
      for (double z = 0.11; z < 0.19; z += 7e-3) {
        sonde_vec3 u = sonde_interior_column_field(a, vec3(x, y, z));
        sonde_vec3 w = sonde_interior_column_field(b, vec3(x, y, z));
        worst = fmax(worst, v_distance(u, w)), most = fmax(most, v_norm(w));
      }
  print_message("limb and thigh: %.4f mm of %.3f mm\n", worst * 1e3, most * 1e3);
  assert_true(most > 1e-3 && worst < 2e-6); // a femur of 48 sides, met by rays
  sonde_free(p);
  sonde_interior_destroy(a), sonde_interior_destroy(b);
  clear_limb(&limb), tube_clear(&thigh);
}

// rms divergence over strain below the dent.
static double divergence(const sonde_interior *in) {
  double sum = 0, scale = 0, h = 1e-3;
  for (double x = -0.03; x <= 0.0301; x += 3e-3)
    for (double z = 0.115; z <= 0.1851; z += 3.7e-3)
      for (double y = 0.027; y < 0.07; y += 4e-3) {
        const sonde_vec3 c = vec3(x, y, z), e[3] = {vec3(h, 0, 0), vec3(0, h, 0), vec3(0, 0, h)};
        sonde_vec3 g[3];
        for (int k = 0; k < 3; ++k)
          g[k] = v_scale(v_sub(sonde_interior_column_field(in, v_add(c, e[k])),
                               sonde_interior_column_field(in, v_sub(c, e[k]))),
                         1 / (2 * h));
        double div = g[0].x + g[1].y + g[2].z;
        sum += div * div, scale += v_norm2(g[0]) + v_norm2(g[1]) + v_norm2(g[2]);
      }
  return sqrt(sum / scale);
}

static void a_bent_limb_keeps_volume_skin_and_bone(void **state) {
  (void)state;
  tube t = bent_limb(1, 8e-3);
  sonde_interior *in = inside_of(&t);
  sonde_vec3 *p = dent(in, &t, 1e-3, SONDE_POSTURE_SUPINE);
  double local = divergence(in), skin = 0, held = 0, ridge = 0;
  for (uint32_t i = 0; i < t.around * t.rows; ++i) {
    sonde_vec3 rest = t.model.surface.vertices[i];
    if (fabs(rest.z - length / 2) > 0.05) continue;
    sonde_vec3 u = sonde_interior_column_field(in, v_madd(rest, -1e-4, t.model.normal[i]));
    skin = fmax(skin, v_distance(u, v_sub(p[i], rest)));
  }
  // The bone's outer face is met within what the smoothing takes from a ridge of 8 mm.
  for (double z = 0.1; z < 0.2; z += 0.01)
    for (double a = 0; a < 2 * SONDE_PI; a += 0.3) {
      double r = bone + 8e-3 * pow(0.5 + 0.5 * sin(a), 4);
      sonde_vec3 at = v_add(middle_of(z, 1), vec3(r * cos(a), r * sin(a), 0));
      sonde_column_point c;
      (void)sonde_interior_locate(in, at, &c);
      ridge = fmax(ridge, fabs(c.bone_m - r));
      held = fmax(held, v_norm(sonde_interior_column_field(in, at)));
    }
  print_message("divergence %.4f, skin %.4f mm, bone %.3f mm off, moves %.4f mm\n", local,
                skin * 1e3, ridge * 1e3, held * 1e3);
  assert_true(local < 0.0136 && skin < 0.015e-3 && ridge < 0.5e-3 && held < 3e-6);
  sonde_free(p);
  sonde_interior_destroy(in);
  clear_limb(&t);
}

static void column_places_come_back(void **state) {
  (void)state;
  tube t = bent_limb(1, 8e-3);
  sonde_interior *in = inside_of(&t);
  double worst = 0;
  for (double z = 0.02; z < 0.28; z += 0.013)
    for (double a = 0; a < 2 * SONDE_PI; a += 0.4)
      for (double r = 0.02; r < 0.055; r += 0.01) {
        sonde_vec3 at = v_add(middle_of(z, 1), vec3(r * cos(a), r * sin(a), 0));
        sonde_column_point c;
        assert_true(sonde_interior_locate(in, at, &c));
        worst = fmax(worst, fabs(c.r - r));
      }
  print_message("distance from the bent middle: %.3f mm off\n", worst * 1e3);
  assert_true(worst < 0.17e-3); // the middle is smoothed over 12 mm
  sonde_interior_destroy(in);
  clear_limb(&t);
}

// ---- vessels --------------------------------------------------------------------------------

static void lay(sonde_branch *branch, const char *name, sonde_vec3 from, sonde_vec3 to, double r) {
  snprintf(branch->name, sizeof branch->name, "%s", name);
  branch->line.count = 12;
  for (uint32_t k = 0; k < 12; ++k)
    branch->line.point[k] = (sonde_vessel_point){v_lerp(from, to, k / 11.0), r, 0};
}

static void vessels_across_the_leg_live(void **state) {
  (void)state;
  tube t = bent_limb(1, 0);
  t.model.anatomy = SONDE_NEW(sonde_thigh_anatomy, 1);
  t.model.anatomy->branch_count = 1;
  sonde_vec3 from = vec3(-0.02, -0.07, 0.15), to = vec3(0.03, -0.05, 0.15);
  lay(&t.model.anatomy->branch[0], "perforator", from, to, 2e-3);
  sonde_interior *in = inside_of(&t);
  assert_true(in->course[2].tilted && in->course[2].count >= 10);
  for (double share = 0.05; share < 1; share += 0.1) {
    sonde_vec3 at = v_lerp(from, to, share);
    assert_int_equal(sonde_interior_label(in, at, NULL), SONDE_LABEL_VEIN);
    at.z += 2.2e-3;
    assert_int_equal(sonde_interior_label(in, at, NULL), SONDE_LABEL_VEIN_WALL);
  }
  sonde_interior_destroy(in);
  clear_limb(&t);
}

static void the_mask_leaves_out_no_wall(void **state) {
  (void)state;
  tube t = bent_limb(1, 0);
  t.model.anatomy = SONDE_NEW(sonde_thigh_anatomy, 1);
  t.model.anatomy->branch_count = SONDE_BRANCHES;
  for (uint32_t b = 0; b < SONDE_BRANCHES; ++b) {
    double a = 2.4 * b, z = 0.02 + 0.26 * b / SONDE_BRANCHES, r = 0.03 + 0.04 * (b % 7) / 7;
    double w = a + 0.5 * (b % 3), far = b % 4 == 0 ? z : z + 0.06; // some across the leg
    char name[32];
    snprintf(name, sizeof name, "vein_%u", b);
    lay(&t.model.anatomy->branch[b], name, vec3(r * cos(a), r * sin(a), z),
        vec3(0.05 * cos(w), 0.05 * sin(w), fmin(far, 0.29)), 1e-3 + 1e-3 * (b % 5));
  }
  sonde_interior *in = inside_of(&t);
  sonde_vec3 *p = dent(in, &t, 6e-3, SONDE_POSTURE_STANDING);
  uint32_t moved = 0, asked = 0, all = 0;
  for (uint32_t v = 0; v < in->vessel_count; ++v) // walls lead everywhere
    for (uint32_t i = 0; i < in->course[v].count; ++i)
      in->state[v][i].coupling = 1, in->state[v][i].half_short_m *= 0.5;
  for (double x = -0.06; x <= 0.06; x += 4.1e-3)
    for (double y = -0.06; y <= 0.06; y += 4.3e-3)
      for (double z = 0.01; z < 0.29; z += 11e-3) {
        sonde_vessel_state near[SONDE_VESSELS], every[SONDE_VESSELS];
        const sonde_vec3 at = vec3(x, y, z);
        sonde_column_point c;
        (void)sonde_interior_locate(in, at, &c);
        uint32_t count = sonde_vessels_near(in, at, c.s, near), total = 0;
        for (uint32_t v = 0; v < in->vessel_count; ++v)
          total += sonde_vessel_at(in, v, sonde_vessel_along(in, v, at, c.s), &every[total]);
        sonde_vec3 a = sonde_vessels_warp(near, count, at),
                   b = sonde_vessels_warp(every, total, at);
        assert_memory_equal(&a, &b, sizeof a);
        moved += v_distance(a, at) > 0, asked += count, all += total;
      }
  print_message("%u points moved, %u of %u vessels asked\n", moved, asked, all);
  assert_true(moved > 2000 && 4 * asked < 3 * all);
  sonde_free(p);
  sonde_interior_destroy(in);
  clear_limb(&t);
}

static void blood_has_weight(void **state) {
  (void)state;
  tube t = bent_limb(0, 0);
  sonde_interior *in = inside_of(&t);
#define ADDS(posture, kind, z)                                                                     \
  sonde_hydrostatic_pressure(in, SONDE_POSTURE_##posture, SONDE_VESSEL_##kind, vec3(0, 0, z))
  const double at_groin = 0.09 * length, at_ankle = length;
  assert_true(ADDS(SUPINE, VEIN, length / 2) == 0);
  // Per metre of a leg that stands: published 76 to 79 mmHg at the ankle over 32 at the groin, 0.83
  // m apart; arteries carry all of it.
  double vein = ADDS(STANDING, VEIN, at_ankle), artery = ADDS(STANDING, ARTERY, at_ankle);
  double ankle_mmhg = 32 + vein / SONDE_PA_PER_MMHG / (at_ankle - at_groin) * 0.83;
  assert_true(ankle_mmhg > 76 && ankle_mmhg < 79);
  assert_true(fabs(artery / (at_ankle - at_groin) / 9.81 - 1055) < 1);
  assert_true(fabs(ADDS(STANDING, VEIN, at_groin)) < 1e-6);
  // Sitting the thigh is level and the calf hangs.
  assert_true(ADDS(SITTING, VEIN, 0.05) == 0);
  assert_true(ADDS(SITTING, VEIN, at_ankle) > 1000);
  // A model that says how it is held keeps to that whatever posture is asked for, and brings what
  // the groin's veins have more than lying: 15 mmHg sitting. Columns count from its own groin along
  // its own up, here across the leg.
  t.model.gravity = (sonde_gravity){SONDE_POSTURE_SITTING, vec3(0, 1, 0), vec3(0, 0.05, 0)};
  assert_true(fabs(ADDS(SUPINE, VEIN, at_ankle) - (15 * SONDE_PA_PER_MMHG + 1055 * 9.81 * 0.05)) <
              1);
  assert_true(fabs(ADDS(STANDING, ARTERY, at_ankle) - 1055 * 9.81 * 0.05) < 1);
  t.model.gravity = (sonde_gravity){0};
#undef ADDS
  // A vein that stands is the wider the lower it is.
  sonde_vec3 *p = dent(in, &t, 0, SONDE_POSTURE_STANDING);
  const sonde_vessel_state *v = in->state[0];
  assert_true(v[in->course[0].count - 1].rest_radius_m > 1.02 * v[0].rest_radius_m);
  sonde_free(p);
  sonde_interior_destroy(in);
  clear_limb(&t);
}

// ---- a map ----------------------------------------------------------------------------------

// Bone within 10 mm of (0.02, 0.02), a nerve about (0, 0.05), tendon for x below -0.04.
static void depths_of(const void *self, sonde_vec3 p, sonde_tissue_depths *d) {
  (void)self;
  *d = (sonde_tissue_depths){hypot(p.x, p.y) - radius, hypot(p.x, p.y) - radius + 6e-3,
                             hypot(p.x, p.y) - radius + 12e-3,
                             hypot(p.x - 0.02, p.y - 0.02) - 10e-3};
}
static sonde_tissue tissue_of(const void *self, sonde_vec3 p) {
  sonde_tissue_depths d;
  depths_of(self, p, &d);
  if (d.bone_m < 0) return SONDE_TISSUE_BONE;
  if (hypot(p.x, p.y - 0.05) < 4e-3) return SONDE_TISSUE_NERVE;
  if (d.fascia_m > 0) return SONDE_TISSUE_FAT;
  return p.x < -0.04 ? SONDE_TISSUE_TENDON : SONDE_TISSUE_MUSCLE;
}

static void the_map_tells_tissue_and_bone(void **state) {
  (void)state;
  tube t = bent_limb(0, 0);
  struct sonde_tissue_map map = {.depths = depths_of, .tissue = tissue_of};
  t.model.map = &map;
  t.model.anatomy = SONDE_NEW(sonde_thigh_anatomy, 1);
  t.model.anatomy->branch_count = 2;
  lay(&t.model.anatomy->branch[0], "in_fat", vec3(-0.072, 0, 0.05), vec3(-0.072, 0, 0.2), 1e-3);
  lay(&t.model.anatomy->branch[1], "deep", vec3(-0.05, 0, 0.05), vec3(-0.05, 0, 0.2), 1e-3);
  sonde_interior *in = inside_of(&t);
  sonde_vec3 *p = dent(in, &t, 4e-3, SONDE_POSTURE_SUPINE);
  assert_int_equal(sonde_interior_label(in, vec3(0, 0.05, 0.15), NULL), SONDE_LABEL_NERVE);
  assert_int_equal(sonde_interior_label(in, vec3(-0.05, 0.02, 0.15), NULL), SONDE_LABEL_TENDON);
  assert_int_equal(sonde_interior_label(in, vec3(0.02, 0.02, 0.15), NULL), SONDE_LABEL_BONE);
  assert_int_equal(sonde_interior_label(in, vec3(0, 0.062, 0.15), NULL), SONDE_LABEL_VEIN);
  assert_int_equal(sonde_interior_label(in, vec3(0.012, 0.03, 0.15), NULL), SONDE_LABEL_MUSCLE);
  assert_true(v_norm(sonde_interior_displacement(in, vec3(0.02, 0.028, 0.15))) == 0);
  assert_true(v_norm(sonde_interior_displacement(in, vec3(0.02, 0.0302, 0.15))) > 0);
  assert_true(in->section[2][3].in_fat && !in->section[3][3].in_fat);
  sonde_free(p);
  sonde_interior_destroy(in);
  t.model.map = NULL;
  clear_limb(&t);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_straight_limb_is_a_thigh),
      cmocka_unit_test(a_bent_limb_keeps_volume_skin_and_bone),
      cmocka_unit_test(column_places_come_back),
      cmocka_unit_test(vessels_across_the_leg_live),
      cmocka_unit_test(the_mask_leaves_out_no_wall),
      cmocka_unit_test(blood_has_weight),
      cmocka_unit_test(the_map_tells_tissue_and_bone),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
