// A limb's own surfaces, laid into a scanner's coordinates, give back the body that it was made
// from.
#include "../sanitized.h"
#include "anatomy_test.h"
#include "sonde/anatomy_limb.h"

// The last one has no less girth below the knee than at the calf.
static const struct {
  const char *name;
  uint64_t seed;
  sonde_sex sex;
  sonde_limb_side side;
  double bmi;
} KINDS[] = {{"right, lean", 5, SONDE_SEX_FEMALE, SONDE_LIMB_RIGHT, 21},
             {"left, heavy", 6, SONDE_SEX_MALE, SONDE_LIMB_LEFT, 31},
             {"right, wide knee", 23, SONDE_SEX_FEMALE, SONDE_LIMB_RIGHT, 27}};

typedef struct scanned {
  sonde_limb_body body;
  sonde_limb *limb;
  sonde_mesh skin, femur, fascia;
  sonde_leg_scan scan;
} scanned;

// To a patient who lies a little turned.
static void lay(sonde_mesh *mesh) {
  const sonde_quat turned = q_unit((sonde_quat){1, 0.03, 0.04, 0.05});
  sonde_limb_to_patient(mesh);
  for (uint32_t i = 0; i < mesh->vertex_count; ++i)
    mesh->vertices[i] = v_add(q_rotate(turned, mesh->vertices[i]), vec3(0.1, 0.05, 0.9));
}

// The deep fascia as an open tube.
static sonde_mesh fascia_of(const sonde_limb *limb) {
  enum { ROWS = 121, COLUMNS = 120 };
  sonde_mesh mesh = {0};
  const uint32_t vertices = ROWS * COLUMNS, faces = 2 * (ROWS - 1) * COLUMNS;
  assert_int_equal(sonde_mesh_create(&mesh, vertices, faces, NULL), SONDE_OK);
  for (uint32_t r = 0; r < ROWS; ++r)
    for (uint32_t c = 0; c < COLUMNS; ++c)
      mesh.vertices[r * COLUMNS + c] =
          sonde_limb_point(limb, -0.15 + 2.1 * r / (ROWS - 1), 2 * SONDE_PI * c / COLUMNS, 1);
  for (uint32_t r = 0, f = 0; r + 1 < ROWS; ++r)
    for (uint32_t c = 0; c < COLUMNS; ++c, f += 2) {
      const uint32_t a = r * COLUMNS + c, b = r * COLUMNS + (c + 1) % COLUMNS;
      const uint32_t two[2][3] = {{a, b, a + COLUMNS}, {b, b + COLUMNS, a + COLUMNS}};
      memcpy(mesh.faces[f], two, sizeof two);
    }
  return mesh;
}

static scanned make(int kind) {
  scanned s = {0};
  sonde_limb_body known = sonde_limb_unknown();
  sonde_error error = {0};
  known.sex = KINDS[kind].sex, known.side = KINDS[kind].side, known.bmi = KINDS[kind].bmi;
  if (sonde_limb_draw(&known, KINDS[kind].seed, &s.body, &error) ||
      sonde_limb_create(&s.body, &s.limb, &error) ||
      sonde_limb_skin(s.limb, 0.005, &s.skin, &error) ||
      sonde_limb_bone_mesh(s.limb, SONDE_LIMB_FEMUR, 0.004, &s.femur, &error))
    fail_msg("%s", error.message);
  s.fascia = fascia_of(s.limb);
  lay(&s.skin);
  lay(&s.femur);
  lay(&s.fascia);
  s.scan = (sonde_leg_scan){.left = known.side == SONDE_LIMB_LEFT, .axes = SONDE_AXES_LPS};
  return s;
}

static void clear(scanned *s) {
  sonde_mesh_clear(&s->skin);
  sonde_mesh_clear(&s->femur);
  sonde_mesh_clear(&s->fascia);
  sonde_limb_destroy(s->limb);
}

// Measures all members that the scan shows against the body's, then makes the limb of them.
static sonde_limb_body measured(scanned *s, const char *what, double most_length,
                                double most_girth) {
  sonde_limb_body got = sonde_limb_unknown(), drawn;
  sonde_leg_girths girths;
  sonde_error error = {0};
  sonde_limb *limb = NULL;
  got.sex = s->body.sex;
  if (sonde_leg_scan_body(&s->scan, 77, &got, &girths, &error)) fail_msg("%s", error.message);
  uint32_t count;
  const sonde_parameter *p = sonde_limb_parameters(&count);
  for (uint32_t k = 0; k < count; ++k) {
    const double found = *sonde_parameter_of(&got, &p[k]),
                 true_value = *sonde_parameter_of(&s->body, &p[k]);
    if (isnan(found) || strcmp(p[k].name, "stature-cm") == 0 || strcmp(p[k].name, "bmi") == 0)
      continue;
    print_message("%s: %-20s %8.2f of %8.2f\n", what, p[k].name, found / p[k].unit,
                  true_value / p[k].unit);
    const bool length = strstr(p[k].name, "-length-") != NULL, fat = strstr(p[k].name, "fat-");
    const double most = length                        ? most_length * true_value
                        : strstr(p[k].name, "girth-") ? most_girth * true_value
                        : fat                         ? 0.0008 + 0.06 * true_value
                                                      : 0.05 * true_value;
    if (!(fabs(found - true_value) <= most)) fail_msg("%s: %s", what, p[k].name);
  }
  assert_int_equal(got.side, s->body.side);
  if (sonde_limb_draw(&got, 77, &drawn, &error) || sonde_limb_create(&drawn, &limb, &error))
    fail_msg("%s", error.message);
  const double rms = sonde_leg_compare(&girths, limb), own = sonde_leg_compare(&girths, s->limb);
  print_message("%s: girths of the limb within %.2f %% of the scan's, of its own %.2f %%\n", what,
                100 * rms, 100 * own);
  assert_true(rms < most_girth && own < most_girth);
  sonde_limb_destroy(limb);
  return got;
}

static void a_body_comes_back(void **state) {
  (void)state;
  for (int kind = 0; kind < ROUNDS((int)SONDE_COUNT_OF(KINDS), 1); ++kind) {
    scanned s = make(kind);
    s.scan.skin = &s.skin, s.scan.femur = &s.femur, s.scan.muscle = &s.fascia;
    sonde_limb_body got = measured(&s, KINDS[kind].name, 0.015, 0.015);
    assert_false(isnan(got.thigh_length_m) || isnan(got.calf_length_m) ||
                 isnan(got.girth_ankle_m) || isnan(got.fat_front_m) || isnan(got.fat_groin_m) ||
                 isnan(got.head_m));
    // A number that is given is not measured.
    sonde_limb_body given = sonde_limb_unknown();
    sonde_leg_girths girths;
    given.girth_calf_m = 0.4;
    assert_int_equal(sonde_leg_scan_body(&s.scan, 1, &given, &girths, NULL), SONDE_OK);
    assert_true(given.girth_calf_m == 0.4 && given.girth_knee_m == got.girth_knee_m);
    // The bone itself is no skin around it.
    sonde_error bare = {0};
    s.scan.skin = &s.femur;
    assert_int_equal(sonde_leg_scan_body(&s.scan, 1, &given, &girths, &bare), SONDE_MESH);
    assert_non_null(strstr(bare.message, "around the femur"));
    s.scan.skin = &s.skin;
    // As a leg of the other side its condyles stand in front.
    sonde_error error = {0};
    s.scan.left = !s.scan.left, s.scan.axes = SONDE_AXES_ANY;
    assert_int_equal(sonde_leg_scan_body(&s.scan, 1, &given, &girths, &error), SONDE_MESH);
    assert_non_null(strstr(error.message, "in front of its shaft"));
    clear(&s);
  }
}

// Takes away the skin above the groin crease.
static double cut_at_crease(scanned *s) {
  double top = -INFINITY;
  for (uint32_t i = 0; i < s->skin.vertex_count; ++i) top = fmax(top, s->skin.vertices[i].z);
  const double crease = top - 0.25 * s->body.thigh_length_m;
  uint32_t kept = 0;
  for (uint32_t f = 0; f < s->skin.face_count; ++f)
    if (s->skin.vertices[s->skin.faces[f][0]].z < crease)
      memcpy(s->skin.faces[kept++], s->skin.faces[f], sizeof s->skin.faces[f]);
  s->skin.face_count = kept;
  for (uint32_t i = 0; i < s->skin.vertex_count; ++i)
    s->skin.vertices[i].z = fmin(s->skin.vertices[i].z, crease);
  return crease;
}

static void skin_alone_gives_lengths_and_girths(void **state) {
  (void)state;
  for (int kind = 0; kind < ROUNDS((int)SONDE_COUNT_OF(KINDS), 1); ++kind) {
    scanned s = make(kind);
    s.scan.skin = &s.skin;
    // Of a skin that reaches above the groin the thigh's length has to be given.
    sonde_limb_body uncut = sonde_limb_unknown();
    sonde_leg_girths above;
    uncut.sex = s.body.sex, uncut.thigh_length_m = s.body.thigh_length_m;
    assert_int_equal(sonde_leg_scan_body(&s.scan, 77, &uncut, &above, NULL), SONDE_OK);
    print_message("%s, uncut: girth of the thigh %.1f of %.1f mm\n", KINDS[kind].name,
                  1e3 * uncut.girth_thigh_m, 1e3 * s.body.girth_thigh_m);
    assert_true(fabs(uncut.girth_thigh_m / s.body.girth_thigh_m - 1) < 0.03);
    assert_true(sonde_leg_compare(&above, s.limb) < 0.02);
    const double knee = cut_at_crease(&s) - s.body.thigh_length_m;
    sonde_limb_body got = measured(&s, KINDS[kind].name, 0.045, 0.02);
    assert_true(isnan(got.head_m) && isnan(got.fat_front_m));

    sonde_leg_girths girths;
    sonde_error error = {0};
    s.scan.axes = SONDE_AXES_ANY;
    assert_int_equal(sonde_leg_scan_body(&s.scan, 1, &got, &girths, &error), SONDE_ARGUMENT);
    assert_non_null(strstr(error.message, "expected RAS or LPS"));
    // A thigh alone shows no calf.
    s.scan.axes = SONDE_AXES_LPS;
    for (uint32_t i = 0; i < s.skin.vertex_count; ++i)
      s.skin.vertices[i].z = fmax(s.skin.vertices[i].z, knee) * 1.6;
    assert_int_equal(sonde_leg_scan_body(&s.scan, 1, &got, &girths, &error), SONDE_MESH);
    print_message("%s\n", error.message);
    assert_non_null(strstr(error.message, "expected a leg from the groin to below the ankle"));
    clear(&s);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_body_comes_back),
      cmocka_unit_test(skin_alone_gives_lengths_and_girths),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
