// What a case adds: branches that close by themselves, clots in them, lesions that lie in the
// tissue, refusals.
#include "interior/vessels.h"
#include "sanitized.h"
#include "interior/tube.h"

#include <stdio.h>
#include <string.h>

static const double leg = 0.08, middle_m = 0.15;

typedef struct limb {
  tube tube;
  sonde_thigh_anatomy anatomy;
  sonde_interior *in;
  sonde_vec3 *load;
  double at_m; // of the probe along the leg
} limb;

static void add_branch(limb *l, const char *name, sonde_vessel_kind kind, double depth, double x,
                       double radius) {
  sonde_branch *b = &l->anatomy.branch[l->anatomy.branch_count++];
  snprintf(b->name, sizeof b->name, "%s", name);
  b->kind = kind;
  double r = leg - depth;
  tube_vessel(&b->line, leg, r, SONDE_PI / 2 - x / r, 0.3, radius);
}

enum { SAPHENOUS = 2, SECOND, DEEP_ARTERY };

// Vein and artery 18 mm deep, a saphenous vein in the fat above them, a second vein beside the
// first.
static void create(limb *l) {
  *l = (limb){.tube = tube_create(leg, 0.014, 0.3, 0.012, 160, 80), .at_m = middle_m};
  add_branch(l, "great_saphenous", SONDE_VESSEL_VEIN, 7e-3, 4e-3, 1.8e-3);
  add_branch(l, "second_femoral_vein", SONDE_VESSEL_VEIN, 18e-3, 11e-3, 4e-3);
  add_branch(l, "deep_femoral_artery", SONDE_VESSEL_ARTERY, 32e-3, 0, 2.5e-3);
  l->tube.model.anatomy = &l->anatomy;
  l->load = SONDE_NEW(sonde_vec3, l->tube.model.surface.vertex_count);
  assert_int_equal(sonde_interior_create(&l->tube.model, &l->in, NULL), SONDE_OK);
  sonde_interior_set_method(l->in, SONDE_INTERIOR_COLUMNS);
}

static void destroy(limb *l) {
  sonde_interior_destroy(l->in);
  sonde_free(l->load);
  l->tube.model.anatomy = NULL;
  tube_clear(&l->tube);
}

// Even load below a 60 x 12 mm face and a dent that goes with it, so long after the last update;
// dt_s < 0: equilibrium.
static void press_for(limb *l, double force_n, double dent_m, double dt_s) {
  const sonde_mesh *skin = &l->tube.model.surface;
  sonde_pose pose = tube_pose(leg, l->at_m);
  sonde_vec3 *moved = SONDE_NEW(sonde_vec3, skin->vertex_count);
  sonde_pathology healthy;
  uint32_t touched = 0;
  assert_int_equal(sonde_pathology_preset("healthy", &healthy, NULL), SONDE_OK);
  for (int pass = 0; pass < 2; ++pass)
    for (uint32_t i = 0; i < skin->vertex_count; ++i) {
      sonde_vec3 q = pose_apply_inverse(pose, skin->vertices[i]);
      bool under = fabs(q.x) < 0.0301 && fabs(q.y) < 0.0061 && q.z < 0.02;
      double w = q.z < 0.04 ? exp(-(q.x * q.x + q.y * q.y) / 0.0008) : 0;
      touched += pass == 0 && under;
      l->load[i] = under && force_n > 0 ? vec3(0, -force_n / touched, 0) : vec3(0, 0, 0);
      moved[i] = v_madd(skin->vertices[i], -dent_m * w, vec3(0, 1, 0));
    }
  sonde_interior_update(l->in, &(sonde_interior_input){moved, l->load, pose, &healthy, dt_s, 1,
                                                       0.03, 0.006, 0, SONDE_POSTURE_SUPINE, NULL});
  sonde_free(moved);
}

static void press(limb *l, double force_n, double dent_m) { press_for(l, force_n, dent_m, -1); }

static sonde_vessel_state cut(const limb *l, int which) {
  sonde_vessel_state v;
  assert_true(sonde_interior_vessel_at_plane(l->in, which, tube_pose(leg, middle_m), &v));
  return v;
}

static sonde_findings clot_in(const char *branch, const char *name) {
  sonde_findings f = {.branch_count = 1};
  snprintf(f.branch[0].branch, sizeof f.branch[0].branch, "%s", branch);
  assert_int_equal(sonde_pathology_preset(name, &f.branch[0].pathology, NULL), SONDE_OK);
  return f;
}

static void branches_are_vessels(void **state) {
  (void)state;
  limb l;
  create(&l);
  assert_int_equal(sonde_interior_vessel_count(l.in), 5);
  assert_string_equal(sonde_interior_vessel_name(l.in, 0), "femoral_vein");
  assert_string_equal(sonde_interior_vessel_name(l.in, SECOND), "second_femoral_vein");
  assert_int_equal(sonde_interior_label(l.in, vec3(4e-3, leg - 7e-3, middle_m), NULL),
                   SONDE_LABEL_VEIN);
  assert_int_equal(sonde_interior_label(l.in, vec3(0, leg - 32e-3, middle_m), NULL),
                   SONDE_LABEL_ARTERY);
  destroy(&l);
}

static void superficial_vein_closes_first(void **state) {
  NOT_SANITIZED();
  (void)state;
  limb l;
  create(&l);
  press(&l, 0, 0);
  for (int k = 0; k < 5; ++k) assert_true(fabs(cut(&l, k).area_ratio - 1) < 1e-12);
  press(&l, 3.5, 0);
  double saphenous = cut(&l, SAPHENOUS).area_ratio, femoral = cut(&l, 0).area_ratio;
  print_message("3.5 N: saphenous %.3f, femoral %.3f, second %.3f, deep artery %.3f\n", saphenous,
                femoral, cut(&l, SECOND).area_ratio, cut(&l, DEEP_ARTERY).area_ratio);
  assert_true(saphenous < 0.1 && femoral > 0.5);
  assert_true(cut(&l, DEEP_ARTERY).area_ratio > 0.9);
  // Harder never opens a vein again.
  for (double f = 7; f < 25; f += 3) {
    double before[4] = {cut(&l, 0).area_ratio, 0, cut(&l, SAPHENOUS).area_ratio,
                        cut(&l, SECOND).area_ratio};
    press(&l, f, 0);
    for (int k = 0; k < 4; k += k == 0 ? 2 : 1) {
      double now = cut(&l, k).area_ratio;
      assert_true(now < before[k] || (now == before[k] && now < 1e-9)); // flat stays flat
    }
  }
  destroy(&l);
}

static void clot_in_one_vein_leaves_the_other(void **state) {
  (void)state;
  limb l;
  create(&l);
  press(&l, 16, 0);
  sonde_vessel_state free_vein = cut(&l, 0), free_second = cut(&l, SECOND);
  sonde_findings f = clot_in("second_femoral_vein", "subacute");
  assert_int_equal(sonde_interior_set_findings(l.in, &f, NULL), SONDE_OK);
  press(&l, 16, 0);
  sonde_vessel_state vein = cut(&l, 0), second = cut(&l, SECOND);
  print_message("16 N: femoral %.3f, second %.3f, with a clot %.3f\n", vein.area_ratio,
                free_second.area_ratio, second.area_ratio);
  assert_true(fabs(vein.area_ratio - free_vein.area_ratio) < 1e-12);
  assert_true(v_distance(vein.centre_m, free_vein.centre_m) < 1e-12);
  assert_true(free_second.area_ratio < 0.4 && second.area_ratio > 0.7);
  assert_true(second.outside_pa == free_second.outside_pa);
  sonde_vec3 inside = vec3(11e-3, sqrt(62e-3 * 62e-3 - 11e-3 * 11e-3), middle_m);
  assert_int_equal(sonde_interior_label(l.in, inside, NULL), SONDE_LABEL_THROMBUS);
  assert_int_equal(sonde_interior_set_findings(l.in, NULL, NULL), SONDE_OK);
  press(&l, 16, 0);
  assert_true(fabs(cut(&l, SECOND).area_ratio - free_second.area_ratio) < 1e-12);
  destroy(&l);
}

// Points of every wall come to lie on its ellipse, whatever the vessels beside it do.
static void each_wall_is_exact(void **state) {
  NOT_SANITIZED();
  (void)state;
  limb l;
  create(&l);
  press(&l, 16, 0);
  for (int which = 0; which <= SECOND; ++which) {
    sonde_vessel_state v;
    assert_true(sonde_vessel_at(l.in, (uint32_t)which, 0, &v));
    sonde_vec3 across = v_cross(v.axis, v.flat_axis);
    assert_true(1 - v.area_ratio > 0.06); // the wall leads fully
    for (int k = 0; k < 12; ++k) {
      double c = cos(k * SONDE_PI / 6), s = sin(k * SONDE_PI / 6);
      sonde_vec3 rest = v_madd(v.rest_centre_m, c * v.rest_radius_m, v.flat_axis);
      rest = v_madd(rest, s * v.rest_radius_m, across);
      sonde_vec3 d = v_sub(v_add(rest, sonde_interior_displacement(l.in, rest)), v.centre_m);
      double a = v_dot(d, v.flat_axis) / v.half_short_m, b = v_dot(d, across) / v.half_long_m;
      assert_true(fabs(hypot(a, b) - 1) * v.half_short_m < 1e-9);
    }
  }
  destroy(&l);
}

static void lesions_lie_in_the_tissue(void **state) {
  (void)state;
  limb l;
  create(&l);
  sonde_findings f = {.lesion_count = 2};
  f.lesion[0] = (sonde_lesion){SONDE_LESION_NODE, vec3(-0.025, 0.05, middle_m), vec3(0, 0, 1),
                               vec3(4e-3, 6e-3, 9e-3), 0.3};
  f.lesion[1] = (sonde_lesion){SONDE_LESION_CYST, vec3(0, -0.06, middle_m), vec3(0, 0, 1),
                               vec3(5e-3, 5e-3, 5e-3), 0};
  assert_int_equal(sonde_interior_set_findings(l.in, &f, NULL), SONDE_OK);
  press(&l, 8, 4e-3);
  assert_int_equal(sonde_interior_label(l.in, f.lesion[0].centre_m, NULL), SONDE_LABEL_NODE);
  assert_int_equal(sonde_interior_label(l.in, f.lesion[1].centre_m, NULL), SONDE_LABEL_CYST);
  // 4 mm towards the skin, 6 across, 9 along.
  sonde_vec3 out = v_unit(vec3(-0.025, 0.05, 0), vec3(0, 1, 0)), side = v_cross(vec3(0, 0, 1), out);
  const sonde_vec3 axis[3] = {out, side, vec3(0, 0, 1)};
  const double half[3] = {4e-3, 6e-3, 9e-3};
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 in = v_madd(f.lesion[0].centre_m, 0.98 * half[k], axis[k]);
    sonde_vec3 beyond = v_madd(f.lesion[0].centre_m, 1.02 * half[k], axis[k]);
    assert_int_equal(sonde_interior_label(l.in, in, NULL), SONDE_LABEL_NODE);
    assert_int_equal(sonde_interior_label(l.in, beyond, NULL), SONDE_LABEL_MUSCLE);
  }
  // The label belongs to the rest point: it goes where the tissue goes.
  sonde_vec3 now =
      v_add(f.lesion[0].centre_m, sonde_interior_displacement(l.in, f.lesion[0].centre_m));
  assert_true(v_distance(now, f.lesion[0].centre_m) > 1e-4);
  assert_int_equal(sonde_interior_label(l.in, sonde_interior_rest_point(l.in, now), NULL),
                   SONDE_LABEL_NODE);
  destroy(&l);
}

static void refuse(const limb *l, const sonde_findings *f, const char *word) {
  sonde_error error = {0};
  assert_int_equal(sonde_interior_set_findings(l->in, f, &error), SONDE_ARGUMENT);
  if (strstr(error.message, word) == NULL) fail_msg("'%s' lacks '%s'", error.message, word);
}

static void nonsense_is_refused(void **state) {
  (void)state;
  limb l;
  create(&l);
  sonde_findings good = clot_in("great_saphenous", "acute"), f = good;
  assert_int_equal(sonde_interior_set_findings(l.in, &good, NULL), SONDE_OK);
  f = clot_in("small_saphenous", "acute"), refuse(&l, &f, "small_saphenous");
  f = clot_in("deep_femoral_artery", "acute"), refuse(&l, &f, "artery");
  f = good, f.branch_count = 2, f.branch[1] = f.branch[0], refuse(&l, &f, "twice");
  f = good, f.branch[0].pathology.thrombus_fraction = 1.5, refuse(&l, &f, "range");
  f = good, f.webs = -0.1, refuse(&l, &f, "webs");
  f = good, f.oedema = (double)NAN, refuse(&l, &f, "oedema");
  f = good, f.lesion_count = 9, refuse(&l, &f, "9 lesions");
  const sonde_lesion node = {SONDE_LESION_NODE, vec3(0, 0.05, middle_m), vec3(0, 0, 1),
                             vec3(4e-3, 4e-3, 4e-3), 0.3};
  f = good, f.lesion_count = 1;
  f.lesion[0] = node, f.lesion[0].centre_m.y = 0.079, refuse(&l, &f, "soft tissue");
  f.lesion[0] = node, f.lesion[0].centre_m.y = 0.017, refuse(&l, &f, "soft tissue");
  f.lesion[0] = node, f.lesion[0].centre_m.z = 0.4, refuse(&l, &f, "soft tissue");
  f.lesion[0] = node, f.lesion[0].axis.z = 2, refuse(&l, &f, "unit axis");
  f.lesion[0] = node, f.lesion[0].half_m.y = 0, refuse(&l, &f, "semi-axes");
  f.lesion[0] = node, f.lesion[0].echogenicity = 2, refuse(&l, &f, "echogenicity");
  press(&l, 16, 0); // what was set before is still there
  assert_true(cut(&l, SAPHENOUS).area_ratio > 0.5);
  destroy(&l);
}

// An update for the vessels alone leaves the areas of a whole one, under a press that folds tissue.
static void vessels_alone_have_the_same_areas(void **state) {
  (void)state;
  enum { VESSELS = 5, MOST = VESSELS * SONDE_SECTIONS };
  static double area[MOST], outside[MOST];
  static sonde_vec3 middle[MOST];
  double apart = 0; // of the middles: what the repair of folded tissue moves them by
  limb l;
  create(&l);
  for (sonde_interior_method m = SONDE_INTERIOR_SOLID; m <= SONDE_INTERIOR_COLUMNS; ++m) {
    uint32_t closed = 0;
    sonde_interior_set_method(l.in, m);
    for (int alone = 0; alone < 2; ++alone) {
      sonde_interior_for_vessels(l.in, alone);
      for (int twice = 0; twice < 2; ++twice) press(&l, 12, 34e-3); // an area rounds with its last
      assert_int_equal(sonde_interior_used_method(l.in), m);
      for (int which = 0, at = 0; which < VESSELS; ++which) {
        uint32_t count;
        const sonde_vessel_state *v = sonde_interior_vessel(l.in, which, &count);
        for (uint32_t i = 0; i < count; ++i, ++at) {
          assert_true(at < MOST);
          if (!alone) {
            area[at] = v[i].area_ratio, outside[at] = v[i].outside_pa, middle[at] = v[i].centre_m;
            closed += v[i].area_ratio < 0.1;
            continue;
          }
          assert_true(v[i].area_ratio == area[at] && v[i].outside_pa == outside[at]);
          apart = fmax(apart, v_distance(v[i].centre_m, middle[at]));
        }
      }
    }
    assert_true(closed > 0);
  }
  print_message("middles at most %.2f mm apart\n", 1e3 * apart);
  assert_true(apart > 0 && apart < 4e-3);
  destroy(&l);
}

// Every vessel goes on to the bit from where it was remembered, wherever it was since then.
static void memory_holds_every_vessel(void **state) {
  (void)state;
  enum { ALL = 2 * SONDE_SECTIONS };
  static limb l;
  static sonde_interior_memory memory;
  static sonde_vessel_state after[SONDE_VESSELS][ALL];
  create(&l);
  press(&l, 9, 6e-3);
  sonde_interior_remember(l.in, &memory);
  press_for(&l, 2, 2e-3, 0.03);
  for (uint32_t which = 0; which < l.in->vessel_count; ++which) {
    assert_true(l.in->course[which].count > 0 && l.in->course[which].count <= ALL);
    memcpy(after[which], l.in->state[which], l.in->course[which].count * sizeof after[0][0]);
  }
  press(&l, 0, 0);
  assert_int_equal(sonde_interior_recall(l.in, &memory, NULL), SONDE_OK);
  press_for(&l, 2, 2e-3, 0.03);
  for (uint32_t which = 0; which < l.in->vessel_count; ++which)
    for (uint32_t i = 0; i < l.in->course[which].count; ++i) {
      const sonde_vessel_state *a = &after[which][i], *b = &l.in->state[which][i];
      if (a->area_ratio != b->area_ratio || v_distance(a->flat_axis, b->flat_axis) > 0)
        fail_msg("vessel %u, section %u: area %.17g, was %.17g", which, i, b->area_ratio,
                 a->area_ratio);
    }
  memory.area_ratio[SONDE_MEMORY_SECTIONS - 1] = (double)NAN;
  assert_int_equal(sonde_interior_recall(l.in, &memory, NULL), SONDE_FORMAT);
  destroy(&l);
}

// In equilibrium the vessels are those of the place, wherever the probe was before and whatever
// window was being built.
static void equilibrium_forgets_where_the_probe_was(void **state) {
  NOT_SANITIZED();
  (void)state;
  static limb fresh, used;
  create(&fresh), create(&used);
  sonde_interior_set_method(fresh.in, SONDE_INTERIOR_SOLID);
  sonde_interior_set_method(used.in, SONDE_INTERIOR_SOLID);
  press(&used, 6, 6e-3);
  used.at_m += 5e-3;
  for (int k = 0; k < 3; ++k) press_for(&used, 6, 6e-3, 0.02);
  assert_true(used.in->building);
  fresh.at_m = used.at_m = middle_m + 6e-3;
  press(&fresh, 6, 6e-3), press(&used, 6, 6e-3);
  assert_true(fresh.in->solid && used.in->solid);
  for (uint32_t which = 0; which < fresh.in->vessel_count; ++which)
    for (uint32_t i = 0; i < fresh.in->course[which].count; ++i)
      assert_true(fresh.in->state[which][i].outside_pa == used.in->state[which][i].outside_pa);
  destroy(&fresh), destroy(&used);
}

// A probe at 60 mm/s outruns the windows of a session; one whose updates wait stays with the solid.
static void who_waits_keeps_the_solid(void **state) {
  NOT_SANITIZED();
  (void)state;
  static limb l;
  create(&l);
  sonde_interior_set_method(l.in, SONDE_INTERIOR_SOLID);
  for (int waits = 0; waits < 2; ++waits) {
    int lost = 0;
    sonde_interior_wait(l.in, waits);
    l.at_m = middle_m;
    press(&l, 6, 6e-3);
    for (int k = 0; k < 15; ++k) {
      l.at_m += 1e-3;
      press_for(&l, 6, 6e-3, 1 / 60.0);
      lost += !l.in->solid;
    }
    print_message("waits %d: %d of 15 updates without the solid\n", waits, lost);
    assert_true((lost == 0) == waits);
  }
  destroy(&l);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(branches_are_vessels),
      cmocka_unit_test(superficial_vein_closes_first),
      cmocka_unit_test(clot_in_one_vein_leaves_the_other),
      cmocka_unit_test(each_wall_is_exact),
      cmocka_unit_test(lesions_lie_in_the_tissue),
      cmocka_unit_test(vessels_alone_have_the_same_areas),
      cmocka_unit_test(memory_holds_every_vessel),
      cmocka_unit_test(equilibrium_forgets_where_the_probe_was),
      cmocka_unit_test(who_waits_keeps_the_solid),
      cmocka_unit_test(nonsense_is_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
