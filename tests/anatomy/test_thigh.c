// Laws of generated thighs.
#include "anatomy_test.h"
#include "../sanitized.h"
#include "anatomy/shape.h"
#include "tissue/anatomy.h"
#include "tissue/layer_springs.h"

#include <inttypes.h>

enum { SEEDS = ROUNDS(20, 5) };
static const double DEGREE = SONDE_PI / 180;

/* ---- parameters --------------------------------------------------------------------------- */

static void wrong_parameters_are_named(void **state) {
  (void)state;
  uint32_t count;
  const sonde_parameter *p = sonde_thigh_parameters(&count);
  for (uint32_t k = 0; k < count; ++k)
    for (int side = 0; side < 2; ++side) {
      sonde_thigh known = sonde_thigh_unknown(), thigh;
      double span = p[k].high - p[k].low;
      *sonde_parameter_of(&known, &p[k]) = side ? p[k].high + 0.1 * span : p[k].low - 0.1 * span;
      sonde_error error = {0};
      assert_int_equal(sonde_thigh_draw(&known, 1, &thigh, &error), SONDE_ARGUMENT);
      char range[64];
      snprintf(range, sizeof range, "expected %g to %g", p[k].low / p[k].unit,
               p[k].high / p[k].unit);
      assert_non_null(strstr(error.message, p[k].name));
      assert_non_null(strstr(error.message, range));
    }
}

static void impossible_thighs_are_refused(void **state) {
  (void)state;
  sonde_thigh known = sonde_thigh_unknown(), thigh;
  sonde_error error = {0};
  known.girth_m = 0.36;
  known.fat_front_m = known.fat_back_m = known.fat_inner_m = known.fat_outer_m = 0.03;
  if (sonde_thigh_draw(&known, 1, &thigh, &error)) fail_msg("%s", error.message);
  sonde_thigh_shape *shape = NULL;
  assert_int_equal(sonde_thigh_shape_create(&thigh, &shape, &error), SONDE_ARGUMENT);
  assert_null(shape);
  double enough = 0;
  const char *from = strstr(error.message, "from about ");
  assert_true(strstr(error.message, "girth-mm") && from);
  assert_int_equal(sscanf(from, "from about %lf", &enough), 1);
  // The girth that the message asks for does.
  known.girth_m = enough * 1.02e-3;
  assert_int_equal(sonde_thigh_draw(&known, 1, &thigh, &error), SONDE_OK);
  assert_int_equal(sonde_thigh_shape_create(&thigh, &shape, &error), SONDE_OK);
  sonde_thigh_shape_destroy(shape);
  known = sonde_thigh_unknown();
  known.girth_m = 0.5, known.girth_distal_m = 0.55;
  assert_int_equal(sonde_thigh_draw(&known, 1, &thigh, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "girth-distal-mm"));
}

// What is known is kept, and does not change what does not depend on it.
static void draws_do_not_disturb_each_other(void **state) {
  (void)state;
  sonde_thigh none = sonde_thigh_unknown(), known = none, a, b;
  known.length_m = 0.25;
  known.vein_m = 0.009;
  known.sex = SONDE_SEX_FEMALE;
  none.sex = SONDE_SEX_FEMALE;
  for (uint64_t seed = 1; seed <= 50; ++seed) {
    assert_int_equal(sonde_thigh_draw(&none, seed, &a, NULL), SONDE_OK);
    assert_int_equal(sonde_thigh_draw(&known, seed, &b, NULL), SONDE_OK);
    assert_true(b.length_m == 0.25 && b.vein_m == 0.009);
    b.length_m = a.length_m, b.vein_m = a.vein_m;
    assert_memory_equal(&a, &b, sizeof a);
  }
}

// Means and spreads of many draws are the published ones (docs/anatomy.md).
static void draws_follow_their_distributions(void **state) {
  (void)state;
  enum { MANY = 4000 };
  sonde_thigh none = sonde_thigh_unknown(), t;
  double fat = 0, fat2 = 0, vein = 0, girth = 0, wide = 0, female = 0, second = 0;
  for (uint64_t seed = 0; seed < MANY; ++seed) {
    assert_int_equal(sonde_thigh_draw(&none, seed, &t, NULL), SONDE_OK);
    assert_true(t.fat_inner_m > t.fat_outer_m); // medial thickest, lateral thinnest
    fat += t.fat_front_m / MANY, fat2 += t.fat_front_m * t.fat_front_m / MANY;
    vein += 0.25 * SONDE_PI * t.vein_m * t.vein_m / MANY;
    girth += t.girth_m / MANY;
    wide += (t.girth_m > 0.45 && t.girth_m < 0.61) / (double)MANY;
    female += (t.sex == SONDE_SEX_FEMALE) / (double)MANY;
    second += t.second_vein / MANY;
  }
  assert_near(fat, 0.0104, 0.0006);
  assert_near(sqrt(fat2 - fat * fat), 0.0041, 0.0007);
  assert_near(vein, 0.89e-4, 0.10e-4); // supine, m^2
  assert_near(girth, 0.53, 0.02);
  assert_true(wide > 0.85);
  assert_near(female, 0.5, 0.03);
  assert_near(second, 0.2, 0.03);
}

/* ---- meshes ------------------------------------------------------------------------------- */

static void check_surface(const sonde_mesh *mesh) {
  sonde_mesh_report r;
  assert_int_equal(sonde_mesh_inspect(mesh, &r, NULL), SONDE_OK);
  assert_true(r.closed && r.outward);
  assert_int_equal(r.duplicate_or_degenerate_faces, 0);
  assert_int_equal(mesh->vertex_count + mesh->face_count - r.edge_count, 2); // one sphere
  assert_true(r.smallest_angle_rad > 15 * DEGREE);
}

static void check_girths(const sonde_thigh *t, const sonde_mesh *mesh) {
  const double inset = 1e-6;
  assert_near(girth_of(mesh, inset, NULL), t->girth_proximal_m, 2e-3 * t->girth_proximal_m);
  assert_near(girth_of(mesh, 0.5 * t->length_m, NULL), t->girth_m, 2e-3 * t->girth_m);
  assert_near(girth_of(mesh, t->length_m - inset, NULL), t->girth_distal_m,
              2e-3 * t->girth_distal_m);
  // No section holds more than the circle of its girth, and a thigh's holds nearly as much.
  enum { CUTS = 100 };
  sonde_mesh_report r;
  assert_int_equal(sonde_mesh_inspect(mesh, &r, NULL), SONDE_OK);
  double round = 0;
  for (int k = 0; k < CUTS; ++k) {
    double girth = girth_of(mesh, t->length_m * (k + 0.5) / CUTS, NULL);
    round += girth * girth / (4 * SONDE_PI) * t->length_m / CUTS;
  }
  assert_true(r.volume_m3 < round && r.volume_m3 > 0.97 * round);
}

// Fat at the four sides of mid-thigh, at the nodes that look that way.
static void check_fat(const sonde_thigh *t, const sonde_model *model) {
  const double wanted[] = {t->fat_inner_m, t->fat_front_m, t->fat_outer_m, t->fat_back_m};
  sonde_vec3 middle;
  (void)girth_of(&model->surface, 0.5 * t->length_m, &middle);
  for (int side = 0; side < 4; ++side) {
    sonde_vec3 out = vec3(cos(side * SONDE_PI / 2), sin(side * SONDE_PI / 2), 0);
    double best = -INFINITY, fat = 0;
    for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
      sonde_vec3 d = v_sub(model->surface.vertices[i], middle);
      if (fabs(d.z) > 0.006 || v_norm(d) < 1e-3) continue;
      double along = v_dot(v_unit(d, out), out);
      if (along > best) best = along, fat = model->muscle_depth_m[i] - model->fat_depth_m[i];
    }
    assert_near(fat, wanted[side], 0.08 * wanted[side]);
  }
}

static void unlike_sides_keep_their_fat(void **state) {
  (void)state;
  sonde_thigh known = sonde_thigh_unknown(), thigh;
  sonde_thigh_def def = coarse();
  known.fat_inner_m = 0.022, known.fat_front_m = 0.008;
  known.fat_outer_m = 0.005, known.fat_back_m = 0.016;
  sonde_model *model = make_thigh(&known, 3, &def, &thigh);
  check_fat(&thigh, model);
  sonde_model_destroy(model);
}

/* ---- vessels ------------------------------------------------------------------------------ */

typedef struct inside {
  const sonde_model *model;
  sonde_surface_index *skin, *femur;
} inside;

// Depth of the fascia below the skin nearest to a point, by the nearest node.
static double fascia_above(const sonde_model *model, sonde_vec3 p, double *skin_m) {
  uint32_t best = 0;
  double nearest = INFINITY;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    sonde_vec3 n = model->normal[i];
    double d = v_distance(model->surface.vertices[i], p);
    if (d < nearest && fabs(n.z) < 0.7) nearest = d, best = i;
  }
  *skin_m = nearest;
  return model->muscle_depth_m[best];
}

static void check_line(const inside *in, const char *name, const sonde_vessel *line) {
  bool superficial = strcmp(name, "great_saphenous") == 0;
  assert_true(line->count >= 20);
  for (uint32_t k = 0; k < line->count; k += 3) {
    const sonde_vessel_point *p = &line->point[k];
    assert_true(sonde_surface_inside(in->skin, p->centre_m));
    assert_false(sonde_surface_inside(in->femur, p->centre_m));
    assert_true(sonde_surface_closest(in->femur, p->centre_m).distance_m > p->radius_m);
    double skin, fascia = fascia_above(in->model, p->centre_m, &skin);
    const double slack = 0.0008; // nodes are up to 3 mm aside
    if (!superficial) assert_true(skin - p->radius_m > fascia - slack);
    if (superficial && k * 3 > line->count) assert_true(skin + p->radius_m < fascia + slack);
    if (k > 2) assert_true(p->centre_m.z > line->point[k - 3].centre_m.z);
  }
}

// Balls along both lines stay apart.
static void check_apart(const sonde_vessel *a, const sonde_vessel *b) {
  enum { FINE = 8 };
  for (uint32_t i = 0; i < a->count; ++i)
    for (uint32_t j = 0; j + 1 < b->count; ++j)
      for (int s = 0; s < FINE; ++s) {
        double t = (double)s / FINE;
        sonde_vec3 q = v_lerp(b->point[j].centre_m, b->point[j + 1].centre_m, t);
        double r = b->point[j].radius_m + t * (b->point[j + 1].radius_m - b->point[j].radius_m);
        if (!(v_distance(a->point[i].centre_m, q) > a->point[i].radius_m + r))
          fail_msg("an artery meets a vein at z = %g m", q.z);
      }
}

static void check_vessels(const sonde_thigh *t, const sonde_model *model) {
  const sonde_thigh_anatomy *a = model->anatomy;
  inside in = {model, NULL, NULL};
  assert_int_equal(sonde_surface_index_create(&model->surface, &in.skin, NULL), SONDE_OK);
  assert_int_equal(sonde_surface_index_create(&model->femur, &in.femur, NULL), SONDE_OK);
  check_line(&in, "vein", &model->vein);
  check_line(&in, "artery", &model->artery);
  check_apart(&model->vein, &model->artery);
  assert_near(2 * model->vein.point[0].radius_m, t->vein_m, 1e-4);
  assert_int_equal(a->branch_count, t->second_vein > 0 ? 4 : 3);
  assert_true((sonde_anatomy_branch(a, "second_femoral_vein") != NULL) == (t->second_vein > 0));
  for (uint32_t b = 0; b < a->branch_count; ++b) {
    const sonde_branch *branch = &a->branch[b];
    bool vein = branch->kind == SONDE_VESSEL_VEIN;
    check_line(&in, branch->name, &branch->line);
    check_apart(&branch->line, vein ? &model->artery : &model->vein);
    for (uint32_t c = 0; c < b; ++c)
      if (a->branch[c].kind != branch->kind) check_apart(&branch->line, &a->branch[c].line);
    // It begins in the lumen that it joins.
    const sonde_vessel *parent = vein ? &model->vein : &model->artery;
    double nearest = INFINITY;
    for (uint32_t k = 0; k < parent->count; ++k)
      nearest =
          fmin(nearest, v_distance(parent->point[k].centre_m, branch->line.point[0].centre_m) -
                            parent->point[k].radius_m);
    assert_true(nearest < 0);
  }
  sonde_surface_index_destroy(in.skin);
  sonde_surface_index_destroy(in.femur);
}

// At the groin the vein is medial of the artery, in the middle behind it, above the knee behind and
// lateral; it comes from the front to the back of the medial side.
static void check_topography(const sonde_model *model) {
  const sonde_vessel *v = &model->vein, *a = &model->artery;
  uint32_t last = v->count - 1, middle = v->count / 2;
  assert_true(v->point[0].centre_m.x > a->point[0].centre_m.x + 0.006);
  assert_true(v->point[middle].centre_m.y < a->point[middle].centre_m.y - 0.006);
  assert_true(v->point[last].centre_m.y < a->point[last].centre_m.y);
  assert_true(v->point[last].centre_m.x < a->point[last].centre_m.x);
  const sonde_muscle_level *knee = &model->anatomy->level[model->anatomy->level_count - 1];
  assert_true(v->point[0].centre_m.y > model->anatomy->level[0].bone_y_m + 0.03);
  assert_true(v->point[last].centre_m.y < knee->bone_y_m);
  assert_true(v->point[middle].centre_m.x > model->anatomy->level[16].bone_x_m + 0.015);
}

static void check_names(const sonde_model *model) {
  static const char *const NAME[] = {
      "common_femoral", "saphenofemoral_junction", "femoral_confluence", "femoral_proximal",
      "femoral_mid",    "femoral_distal",          "popliteal"};
  const sonde_thigh_anatomy *a = model->anatomy;
  double last = 0;
  for (size_t k = 0; k < SONDE_COUNT_OF(NAME); ++k) {
    const sonde_landmark *m = sonde_anatomy_landmark(a, NAME[k]);
    assert_non_null(m);
    assert_true(m->skin_m.z > last);
    last = m->skin_m.z;
    assert_near(v_norm(m->normal), 1, 1e-9);
    double depth = v_dot(v_sub(m->skin_m, m->vein_m), m->normal);
    assert_true(depth > 0.01 && depth < 0.075);
    assert_near(v_distance(m->skin_m, m->vein_m), depth, 2e-3); // straight below
    const sonde_site *site = sonde_model_site(model, m->site);
    assert_true(site && v_distance(site->position_m, m->skin_m) < 0.02);
  }
  assert_null(sonde_anatomy_landmark(a, "elbow"));
  assert_true(a->segment_count == 5 && a->segment[0].from_m == 0);
  for (uint32_t k = 1; k < a->segment_count; ++k)
    assert_true(a->segment[k].from_m == a->segment[k - 1].to_m &&
                a->segment[k].to_m > a->segment[k].from_m);
}

static void check_mechanics(const sonde_model *model) {
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    assert_true(model->fat_depth_m[i] <= model->muscle_depth_m[i]);
    assert_true(model->muscle_depth_m[i] <= model->bone_depth_m[i]);
    assert_true(model->k0_n_m3[i] > 2e4 && model->k0_n_m3[i] < 3e6);
    assert_true(model->xm_m[i] > 0.01 && model->xm_m[i] < 0.12);
  }
}

static void twenty_thighs_are_valid(void **state) {
  (void)state;
  sonde_thigh_def def = sonde_thigh_def_default();
  for (uint64_t seed = 1; seed <= SEEDS; ++seed) {
    sonde_thigh thigh;
    sonde_model *model = make_thigh(NULL, seed, &def, &thigh);
    check_surface(&model->surface);
    check_surface(&model->femur);
    check_girths(&thigh, &model->surface);
    check_fat(&thigh, model);
    check_vessels(&thigh, model);
    check_topography(model);
    check_names(model);
    check_mechanics(model);
    sonde_model_destroy(model);
  }
}

/* ---- muscles ------------------------------------------------------------------------------ */

static void compartments_lie_around_the_femur(void **state) {
  (void)state;
  sonde_thigh thigh;
  sonde_thigh_def def = coarse();
  sonde_model *model = make_thigh(NULL, 4, &def, &thigh);
  const sonde_thigh_anatomy *a = model->anatomy;
  for (uint32_t k = 0; k < a->level_count; ++k) {
    const sonde_muscle_level *l = &a->level[k];
    sonde_vec3 bone = vec3(l->bone_x_m, l->bone_y_m, l->z_m);
    sonde_vec3 front = v_add(bone, vec3(-0.01, 0.03, 0)), back = v_add(bone, vec3(-0.01, -0.04, 0));
    assert_int_equal(sonde_anatomy_compartment(a, front), SONDE_COMPARTMENT_ANTERIOR);
    assert_int_equal(sonde_anatomy_compartment(a, back), SONDE_COMPARTMENT_POSTERIOR);
    // The vessels run between the front and the medial compartment.
    sonde_vec3 v = vec3(cos(l->septum_rad[0]), sin(l->septum_rad[0]), 0), side = vec3(-v.y, v.x, 0);
    sonde_vec3 at = v_madd(bone, 0.03, v);
    assert_int_equal(sonde_anatomy_compartment(a, v_madd(at, 0.003, side)),
                     SONDE_COMPARTMENT_ANTERIOR);
    assert_int_equal(sonde_anatomy_compartment(a, v_madd(at, -0.003, side)),
                     SONDE_COMPARTMENT_MEDIAL);
    sonde_vec3 fibre = sonde_anatomy_fibre(a, front);
    assert_near(v_norm(fibre), 1, 1e-12);
    assert_true(fibre.z > cos(30 * DEGREE) && v_dot(fibre, v_sub(bone, front)) > 0);
    assert_true(sonde_anatomy_fascia(a, v_add(bone, vec3(-0.06, 0, 0))) >
                sonde_anatomy_fascia(a, v_add(bone, vec3(0.06, 0, 0))));
  }
  sonde_model_destroy(model);
}

/* ---- mechanics ---------------------------------------------------------------------------- */

static void springs_follow_the_layers(void **state) {
  (void)state;
  double k0, xm, k1, xm1;
  sonde_layer_springs(0.01, 0.05, 0.02, 1, &k0, &xm);
  sonde_layer_springs(0.01, 0.05, 0.02, 2, &k1, &xm1);
  assert_near(k1, 2 * k0, 1e-9 * k0);
  assert_near(xm1, xm, 1e-15);
  sonde_layer_springs(0.02, 0.05, 0.02, 1, &k1, &xm1);
  assert_true(k1 < k0 && xm1 > xm); // more fat: softer, deeper
  sonde_layer_springs(0.02, 0.10, 0.02, 1, &k1, &xm1);
  double base, unused;
  sonde_layer_springs(0.01, 0.05, 0.02, 1, &base, &unused);
  assert_near(k1, 0.5 * base, 1e-9 * base); // twice the layers, half the stiffness
  sonde_layer_springs(0, 0, 0.02, 1, &k1, &xm1);
  assert_true(isfinite(k1) && xm1 > 0.01); // at the cut ends the bone comes to the skin
}

// The rule stands for the fitted sites of the bundled thigh to 8 % RMS.
static void springs_match_the_bundled_thigh(void **state) {
  (void)state;
  sonde_model *model = bundled_thigh();
  double sum_k = 0, sum_x = 0;
  for (uint32_t s = 0; s < model->site_count; ++s) {
    const sonde_site *site = &model->sites[s];
    uint32_t at = 0;
    for (uint32_t i = 0; i < model->surface.vertex_count; ++i)
      if (v_distance(model->surface.vertices[i], site->position_m) <
          v_distance(model->surface.vertices[at], site->position_m))
        at = i;
    double k0, xm;
    sonde_layer_springs(model->muscle_depth_m[at] - model->fat_depth_m[at],
                        model->bone_depth_m[at] - model->muscle_depth_m[at], 0.02, 1, &k0, &xm);
    sum_k += pow(log(k0 / site->k0_n_m3), 2) / model->site_count;
    sum_x += pow(log(xm / site->xm_m), 2) / model->site_count;
  }
  print_message("rule against %u sites: k0 %.1f %%, xm %.1f %% RMS\n", model->site_count,
                100 * sqrt(sum_k), 100 * sqrt(sum_x));
  assert_true(sqrt(sum_k) < 0.08 && sqrt(sum_x) < 0.08);
  sonde_model_destroy(model);
}

static void a_coarse_thigh_settles(void **state) {
  (void)state;
  sonde_thigh thigh;
  sonde_thigh_def def = coarse();
  sonde_model *model = make_thigh(NULL, 1, &def, &thigh);
  settles_at_three_sites(model, 0.009);
  sonde_model_destroy(model);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(wrong_parameters_are_named),
      cmocka_unit_test(impossible_thighs_are_refused),
      cmocka_unit_test(draws_do_not_disturb_each_other),
      cmocka_unit_test(draws_follow_their_distributions),
      cmocka_unit_test(twenty_thighs_are_valid),
      cmocka_unit_test(unlike_sides_keep_their_fat),
      cmocka_unit_test(compartments_lie_around_the_femur),
      cmocka_unit_test(springs_follow_the_layers),
      cmocka_unit_test(springs_match_the_bundled_thigh),
      cmocka_unit_test(a_coarse_thigh_settles),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
