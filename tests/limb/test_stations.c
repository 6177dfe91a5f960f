// Stations of limbs over seeds, sexes and body mass indices: probes that see their vein, the views'
// order of depth, bands of force, protocols.
#include "bare_limb.h"

#include <string.h>

enum { FAMILY = 40 };

static sonde_limb *member(uint32_t k, sonde_limb_side side) { return bare_limb(k, 3000, side); }

static sonde_limb *family[FAMILY];
static sonde_limb_station stations[FAMILY][SONDE_LIMB_STATIONS];

static int make_family(void **state) {
  (void)state;
  for (uint32_t k = 0; k < FAMILY; ++k) {
    family[k] = member(k, SONDE_LIMB_RIGHT);
    sonde_limb_stations(family[k], stations[k]);
  }
  return 0;
}

static int drop_family(void **state) {
  (void)state;
  for (uint32_t k = 0; k < FAMILY; ++k) sonde_limb_destroy(family[k]);
  return 0;
}

static const sonde_limb_station *station_of(uint32_t k, const char *name) {
  for (uint32_t i = 0; i < SONDE_LIMB_STATIONS; ++i)
    if (strcmp(stations[k][i].name, name) == 0) return &stations[k][i];
  fail_msg("no station %s", name);
  return NULL;
}

// A branch's point at the level of a station in the probe's frame: x across, z depth, m.
static sonde_vec3 seen(uint32_t k, const sonde_limb_station *s, const char *name) {
  const struct limb_vessels *v = family[k]->vessels;
  uint32_t b = limb_branch_find(v, name);
  if (b == VESSEL_NONE) fail_msg("no %s", name);
  sonde_vec3 p = limb_branch_point(v, b, limb_branch_at_level(v, b, s->level));
  return pose_apply_inverse(s->probe, p);
}

static void probes_stand_on_the_skin_and_face_their_vein(void **state) {
  (void)state;
  for (uint32_t k = 0; k < FAMILY; ++k)
    for (uint32_t i = 0; i < SONDE_LIMB_STATIONS; ++i) {
      const sonde_limb_station *s = &stations[k][i];
      double level, degrees, f;
      limb_place_of(family[k], s->skin_m, &level, &degrees, &f);
      double skin = limb_skin_radius(family[k], level, degrees * DEGREE);
      assert_true(fabs(f * limb_fascia_radius(family[k], level, degrees * DEGREE) - skin) < 2e-4);
      assert_true(fabs(v_norm(s->normal) - 1) < 1e-9);
      sonde_vec3 axis = q_rotate(s->probe.rotation, vec3(0, 0, 1));
      assert_true(v_dot(axis, s->normal) < -0.3);
      sonde_vec3 target = pose_apply_inverse(s->probe, s->target_m);
      if (fabs(target.x) > 0.019 || fabs(target.y) > 0.02 || target.z <= 0)
        fail_msg("member %u, %s: target at %.0f, %.0f, %.0f mm of the probe", k, s->name,
                 1e3 * target.x, 1e3 * target.y, 1e3 * target.z);
    }
}

static void every_station_names_its_veins(void **state) {
  (void)state;
  for (uint32_t k = 0; k < FAMILY; ++k)
    for (uint32_t i = 0; i < SONDE_LIMB_STATIONS; ++i) {
      const sonde_limb_station *s = &stations[k][i];
      assert_true(s->veins >= 1 && strlen(s->text) > 20);
      for (uint32_t j = 0; j < s->veins; ++j) {
        sonde_limb_vessel vein = sonde_limb_vessel_get(family[k], s->vein[j]);
        assert_true(vein.kind != SONDE_LIMB_ARTERY && s->arc_m[j] >= 0 &&
                    s->arc_m[j] <= vein.length_m);
        sonde_vec3 p = sonde_limb_vessel_place(family[k], s->vein[j], s->arc_m[j]).centre_m;
        assert_true(fabs(p.z - s->target_m.z) < 0.035);
      }
      assert_true(s->force_n[0] > 0 && s->force_n[1] > s->force_n[0]);
    }
}

// The views' orders, each true in 95 of 100 limbs (docs/limb_vessels.md).
static void views_show_their_order(void **state) {
  (void)state;
  enum { V1, V2, V4, V5, V6, V7, V10, V11, VIEWS };
  static const char *const name[VIEWS] = {"V1", "V2", "V4", "V5", "V6", "V7", "V10", "V11"};
  uint32_t kept[VIEWS] = {0};
  for (uint32_t k = 0; k < FAMILY; ++k) {
    const struct limb_vessels *v = family[k]->vessels;
    // V1: vein medial of the artery (+x), the same depth to 6 mm, as wide to 1.6 times as wide.
    const sonde_limb_station *s = station_of(k, "common femoral vein");
    sonde_vec3 vein = seen(k, s, "common femoral vein"),
               artery = seen(k, s, "common femoral artery");
    double ratio = v->draws.radius[DIA_CFV] / v->draws.radius[DIA_CFA];
    kept[V1] +=
        vein.x > artery.x + 0.006 && fabs(vein.z - artery.z) < 0.006 && ratio >= 1 && ratio <= 1.6;
    // V2: artery lateral, saphenous vein medial or in front of the vein and shallower than both.
    s = station_of(k, "saphenofemoral junction");
    vein = seen(k, s, "common femoral vein"), artery = seen(k, s, "common femoral artery");
    double fork = limb_level(family[k], v->draws.junction_z - 0.012);
    uint32_t great = limb_branch_find(v, "great saphenous vein");
    sonde_vec3 p = pose_apply_inverse(
        s->probe, limb_branch_point(v, great, limb_branch_at_level(v, great, fork)));
    kept[V2] += artery.x < vein.x && p.z < vein.z && p.z < artery.z && p.x > artery.x;
    // V4: the deep femoral vein is deep and lateral of the femoral vein, between the arteries.
    s = station_of(k, "deep femoral confluence");
    double below = s->level + 0.03;
    const char *const four[4] = {"femoral vein", "deep femoral vein", "superficial femoral artery",
                                 "deep femoral artery"};
    sonde_vec3 q[4];
    for (int i = 0; i < 4; ++i) {
      uint32_t b = limb_branch_find(v, four[i]);
      q[i] =
          pose_apply_inverse(s->probe, limb_branch_point(v, b, limb_branch_at_level(v, b, below)));
    }
    kept[V4] += q[1].z > q[0].z && q[1].x < q[0].x && q[3].z > q[2].z;
    // V5: the vein deeper than its artery at mid-thigh.
    s = station_of(k, "femoral vein, middle");
    double turn = 0;
    sonde_vec3 a = limb_branch_point(v, 2, limb_branch_at_level(v, 2, s->level));
    turn = atan2(s->target_m.x - a.x, s->target_m.y - a.y) / DEGREE;
    kept[V5] += fabs(remainder(turn - 175, 360)) < 25;
    // V6: the vein behind the artery, on its lateral side; bone within 45 mm.
    s = station_of(k, "adductor canal");
    a = limb_branch_point(v, 2, limb_branch_at_level(v, 2, s->level));
    const double at[3] = {s->target_m.x, s->target_m.y, s->target_m.z};
    kept[V6] += s->target_m.y < a.y && s->target_m.x < a.x &&
                limb_bone_distance(family[k], at, NULL) < 0.045;
    // V7: nerve, vein, artery from the probe to the bone.
    s = station_of(k, "popliteal vein");
    vein = seen(k, s, "popliteal vein"), artery = seen(k, s, "popliteal artery");
    double least = INFINITY, nerve = 0;
    for (uint32_t i = 0; i < v->nerve[3].count; ++i) {
      sonde_vec3 n = pose_apply_inverse(s->probe, v->nerve[3].point[i]);
      if (fabs(n.y) < least) least = fabs(n.y), nerve = n.z;
    }
    kept[V7] +=
        nerve < vein.z && vein.z < artery.z && fabs(artery.x - vein.x) < artery.z - vein.z + 0.004;
    // V10: posterior tibial veins on both sides of their artery, the peroneal ones deeper.
    s = station_of(k, "posterior tibial veins");
    vein = seen(k, s, "posterior tibial vein"), artery = seen(k, s, "peroneal artery");
    kept[V10] += artery.z > vein.z + 0.006;
    // V11: gastrocnemius veins between skin and popliteal depth.
    s = station_of(k, "gastrocnemius veins");
    kept[V11] += s->depth_m > 0.006 && s->depth_m < 0.045;
  }
  for (int i = 0; i < VIEWS; ++i) {
    print_message("%s true in %u of %d\n", name[i], kept[i], FAMILY);
  }
  for (int i = 0; i < VIEWS; ++i) assert_true(kept[i] >= (i == V4 ? 0.8 : 0.95) * FAMILY);
}

static void forces_grow_with_depth(void **state) {
  (void)state;
  const double table[][3] = {
      {0.015, 3, 6}, {0.02, 4.5, 8}, {0.025, 6, 11}, {0.03, 7.5, 15}, {0.04, 12, 24}};
  double before[2] = {0, 0}, band[2];
  for (int mm = 2; mm < 70; ++mm) {
    sonde_limb_force_band(1e-3 * mm, band);
    assert_true(band[0] >= before[0] && band[1] >= before[1]);
    before[0] = band[0], before[1] = band[1];
  }
  for (size_t k = 0; k < SONDE_COUNT_OF(table); ++k) {
    sonde_limb_force_band(table[k][0], band);
    assert_true(fabs(band[0] - table[k][1]) < 1e-9 && fabs(band[1] - table[k][2]) < 1e-9);
  }
}

static void a_left_limb_has_mirrored_stations(void **state) {
  (void)state;
  sonde_limb *left = member(5, SONDE_LIMB_LEFT);
  sonde_limb_station other[SONDE_LIMB_STATIONS];
  sonde_limb_stations(left, other);
  for (uint32_t i = 0; i < SONDE_LIMB_STATIONS; ++i) {
    const sonde_limb_station *a = &stations[5][i], *b = &other[i];
    assert_true(a->skin_m.x == -b->skin_m.x && a->normal.x == -b->normal.x &&
                a->depth_m == b->depth_m);
    sonde_vec3 x = q_rotate(b->probe.rotation, vec3(1, 0, 0)),
               z = q_rotate(b->probe.rotation, vec3(0, 0, 1));
    assert_true(v_dot(z, b->normal) < -0.5);
    assert_true(x.x > 0.3 || x.y < 0); // to the patient's left, or to the back
  }
  sonde_limb_destroy(left);
}

static void protocols_name_stations_from_groin_to_ankle(void **state) {
  (void)state;
  uint32_t count;
  const sonde_limb_protocol *p = sonde_limb_protocols(&count);
  assert_int_equal(count, 4);
  for (uint32_t k = 0; k < count; ++k)
    for (uint32_t i = 0; i < p[k].stations; ++i) {
      assert_true(p[k].station[i] < SONDE_LIMB_STATIONS);
      if (i > 0) assert_true(p[k].station[i] > p[k].station[i - 1]);
    }
  assert_int_equal(p[count - 1].stations, SONDE_LIMB_STATIONS);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(probes_stand_on_the_skin_and_face_their_vein),
      cmocka_unit_test(every_station_names_its_veins),
      cmocka_unit_test(views_show_their_order),
      cmocka_unit_test(forces_grow_with_depth),
      cmocka_unit_test(a_left_limb_has_mirrored_stations),
      cmocka_unit_test(protocols_name_stations_from_groin_to_ankle),
  };
  return cmocka_run_group_tests(tests, make_family, drop_family);
}
