// A measured subject on its part of a limb: the bundled thigh.
#include "limb_test.h"

#include "sonde/limb_model.h"

#include <stdlib.h>
#include <string.h>

static sonde_model *subject;
static sonde_limb_part part;

static int load_subject(void **state) {
  (void)state;
  const char *path = getenv("SONDE_TEST_MODEL");
  sonde_error error = {0};
  if (!path) fail_msg("SONDE_TEST_MODEL: expected the path of the bundled thigh");
  if (sonde_model_load(path, &subject, &error)) fail_msg("%s", error.message);
  part = (sonde_limb_part){subject, NAN};
  return 0;
}
static int drop_subject(void **state) {
  (void)state;
  sonde_model_destroy(subject);
  return 0;
}

// A body that takes what it does not know from the subject.
static sonde_limb_body as_subject(sonde_limb_body known) {
  sonde_error error = {0};
  sonde_limb_body body = {0};
  if (sonde_limb_part_body(&part, 3, &known, &error) || sonde_limb_draw(&known, 3, &body, &error))
    fail_msg("%s", error.message);
  return body;
}

static sonde_model *make(const sonde_limb_body *body, const sonde_limb_part *with,
                         const sonde_limb_setting *setting) {
  sonde_model *made = NULL;
  sonde_error error = {0};
  sonde_limb_model_def def = sonde_limb_model_def_default();
  def.part = with, def.setting = setting;
  if (sonde_limb_model(body, &def, &made, &error)) fail_msg("%s", error.message);
  return made;
}

static uint32_t nearest(const sonde_model *m, sonde_vec3 p) {
  uint32_t at = 0;
  for (uint32_t i = 1; i < m->surface.vertex_count; ++i)
    if (v_distance(m->surface.vertices[i], p) < v_distance(m->surface.vertices[at], p)) at = i;
  return at;
}

// The subject's site k is the limb's site 100 + k and has its springs. @return the worst ratio
static double compare_sites(const sonde_model *limb) {
  uint32_t found = 0;
  double worst = 1;
  for (uint32_t i = 0; i < limb->site_count; ++i) {
    if (limb->sites[i].id < 100) continue;
    const sonde_site *own = &limb->sites[i], *from = &subject->sites[own->id - 100];
    const uint32_t at = nearest(subject, from->position_m), on = nearest(limb, own->position_m);
    const double pair[][2] = {{limb->k0_n_m3[on], subject->k0_n_m3[at]},
                              {limb->xm_m[on], subject->xm_m[at]},
                              {limb->shear_share[on] * limb->law.shear_stiffness_n_m,
                               subject->shear_share[at] * subject->law.shear_stiffness_n_m},
                              {limb->limit_share[on] * limb->law.shear_limit,
                               subject->limit_share[at] * subject->law.shear_limit}};
    for (size_t k = 0; k < sizeof pair / sizeof *pair; ++k)
      worst = fmax(worst, fmax(pair[k][0] / pair[k][1], pair[k][1] / pair[k][0]));
    ++found;
  }
  assert_int_equal(found, subject->site_count);
  return worst;
}

static void the_body_is_as_thick_as_the_subject(void **state) {
  (void)state;
  sonde_limb_part_fit fit;
  sonde_limb_body known = sonde_limb_unknown();
  known.fat_front_m = 0.011;
  const sonde_limb_body body = as_subject(known);
  sonde_limb *limb;
  sonde_error error = {0};
  assert_int_equal(sonde_limb_create(&body, &limb, &error), SONDE_OK);
  assert_int_equal(sonde_limb_part_compare(&part, limb, &fit, &error), SONDE_OK);
  sonde_limb_destroy(limb);
  print_message("girths within %.2f %% from level %.2f to %.2f\n", 100 * fit.girth_rms,
                fit.from_level, fit.to_level);
  assert_in_range(1000 * fit.girth_rms, 0, 30);
  assert_near(0.5 * (fit.from_level + fit.to_level), 0.5, 1e-9);
  assert_near(body.fat_front_m, 0.011, 1e-12); // given
  assert_near(body.shaft_m, 0.028, 0.0005);    // radius 14 mm: data/thigh/CARD.md
  assert_near(body.skin_m, 0.0018, 0.0002);    // likewise
  assert_true(body.fat_medial_m > 1.5 * body.fat_lateral_m);
}

static void springs_are_the_subject_s_on_the_part_alone(void **state) {
  (void)state;
  const sonde_limb_body body = as_subject(sonde_limb_unknown());
  sonde_model *with = make(&body, &part, NULL), *plain = make(&body, NULL, NULL);
  const double worst = compare_sites(with);
  print_message("springs at %u sites: within a factor of %.4f\n", subject->site_count, worst);
  assert_true(worst < 1.03);
  // Beyond the part, where the mesh is the same, nothing has changed.
  const double knee_m =
      sonde_limb_to_model(sonde_limb_of(plain), vec3(0, 0, -body.thigh_length_m)).z;
  uint32_t same = 0;
  for (uint32_t i = 0; i < plain->surface.vertex_count; ++i) {
    if (plain->surface.vertices[i].z < knee_m + 0.03) continue;
    const uint32_t at = nearest(with, plain->surface.vertices[i]);
    if (v_distance(with->surface.vertices[at], plain->surface.vertices[i]) > 1e-9) continue;
    assert_true(with->k0_n_m3[at] == plain->k0_n_m3[i] && with->xm_m[at] == plain->xm_m[i]);
    assert_true(with->shear_share[at] == plain->shear_share[i]);
    ++same;
  }
  assert_in_range(same, 1000, UINT32_MAX);
  sonde_model_destroy(with);
  sonde_model_destroy(plain);
}

static void a_left_limb_that_lies_turned_has_them_too(void **state) {
  (void)state;
  sonde_limb_body known = sonde_limb_unknown();
  known.side = SONDE_LIMB_LEFT;
  const sonde_limb_body body = as_subject(known);
  const sonde_limb_setting turned = sonde_limb_setting_usual(SONDE_LIMB_SUPINE_TURNED);
  sonde_model *limb = make(&body, &part, &turned);
  const double worst = compare_sites(limb);
  print_message("springs of the left limb, turned: within a factor of %.4f\n", worst);
  assert_true(worst < 1.03);
  sonde_model_destroy(limb);
}

static void what_is_no_part_of_a_thigh_is_refused(void **state) {
  (void)state;
  sonde_error error = {0};
  sonde_limb_body known = sonde_limb_unknown();
  const sonde_limb_part low = {subject, 0.3};
  assert_int_equal(sonde_limb_part_body(&low, 3, &known, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "expected -0.05 to 1.05"));
  double origin[1] = {0}; // as a limb's model has it
  subject->map_origin = origin;
  assert_int_equal(sonde_limb_part_body(&part, 3, &known, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "expected a thigh of two layers"));
  subject->map_origin = NULL;
  const double exponent = subject->law.normal_exponent;
  subject->law.normal_exponent = 1;
  assert_int_equal(sonde_limb_part_body(&part, 3, &known, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "exponent 2"));
  subject->law.normal_exponent = exponent;
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_body_is_as_thick_as_the_subject),
      cmocka_unit_test(springs_are_the_subject_s_on_the_part_alone),
      cmocka_unit_test(a_left_limb_that_lies_turned_has_them_too),
      cmocka_unit_test(what_is_no_part_of_a_thigh_is_refused),
  };
  return cmocka_run_group_tests(tests, load_subject, drop_subject);
}
