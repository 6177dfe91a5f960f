// The film of gel: volume is kept, it leaves where it is pressed, and one film drives two effects.
#include "test.h"
#include "../barrel_mesh.h"

#include "sonde/haptics_gel.h"
#include "haptics/gel.h"

// Round leg along z, closed, 60 mm in radius and 160 mm long.
enum { RINGS = 41, AROUND = 72 };
static void leg_mesh(sonde_mesh *mesh) {
  assert_int_equal(sonde_mesh_create(mesh, 2 + RINGS * AROUND, 2 * AROUND * RINGS, NULL), SONDE_OK);
  mesh->vertices[0] = vec3(0, 0, -0.08);
  mesh->vertices[1] = vec3(0, 0, 0.08);
  for (int i = 0; i < RINGS; ++i)
    for (int k = 0; k < AROUND; ++k) {
      double turn = 2 * SONDE_PI * k / AROUND, z = -0.08 + 0.004 * i;
      mesh->vertices[2 + i * AROUND + k] = vec3(0.06 * cos(turn), 0.06 * sin(turn), z);
    }
  assert_int_equal(barrel_mesh_faces(mesh, RINGS, AROUND), mesh->face_count);
}

static sonde_model *leg(void) {
  sonde_mesh skin;
  leg_mesh(&skin);
  sonde_site site = {.id = 1,
                     .position_m = vec3(0.06, 0, 0),
                     .normal = vec3(1, 0, 0),
                     .u = vec3(0, 1, 0),
                     .v = vec3(0, 0, 1),
                     .k0_n_m3 = 1.5e5,
                     .xm_m = 0.03};
  sonde_model_def def = sonde_model_def_default();
  def.name = "leg";
  def.skin = &skin;
  def.sites = &site;
  def.site_count = 1;
  def.fine_edge_m = 0.008;
  sonde_model *model = NULL;
  sonde_error error = {0};
  if (sonde_model_build(&def, &model, &error)) fail_msg("%s", error.message);
  sonde_mesh_clear(&skin);
  return model;
}

typedef struct scene {
  sonde_model *model;
  sonde_gel *gel;
  sonde_vec3 *contact_n; // 5 kPa at the site, falling to none at 10 mm
} scene;

static scene set_up(double drying) {
  scene s = {.model = leg()};
  sonde_gel_def def = sonde_gel_def_default();
  def.drying_m_s = drying;
  def.moist_s = 2.0;
  assert_int_equal(sonde_gel_create(s.model, &def, &s.gel, NULL), SONDE_OK);
  s.contact_n = SONDE_NEW(sonde_vec3, s.model->surface.vertex_count);
  for (uint32_t i = 0; i < s.model->surface.vertex_count; ++i) {
    double r = v_distance(s.model->surface.vertices[i], vec3(0.06, 0, 0)) / 0.01;
    if (r < 1.0) s.contact_n[i] = vec3(-5e3 * (1.0 - r * r) * s.model->area_m2[i], 0, 0);
  }
  return s;
}

static void tear_down(scene *s) {
  sonde_gel_destroy(s->gel);
  sonde_model_destroy(s->model);
  sonde_free(s->contact_n);
}

static const sonde_friction dry_skin = {
    .mu_static = 0.5, .mu_kinetic = 0.36, .stribeck_speed_m_s = 0.01, .mu_gel = 0.05};

static double mu(const scene *s) {
  sonde_friction f = sonde_gel_friction(s->gel, s->contact_n, &dry_skin);
  return sonde_friction_coefficient(&f, 0.1);
}

static double image(const scene *s) {
  const sonde_vec3 point = vec3(0.06, 0, 0);
  float share;
  sonde_gel_coupling(s->gel, s->model->surface.vertices, s->contact_n, &point, 1, &share);
  return (double)share;
}

static void volume_only_changes_hands(void **state) {
  (void)state;
  scene s = set_up(0.0);
  sonde_gel_put(s.gel, vec3(0.06, 0, 0), 0.015, 2e-6);
  assert_true(fabs(sonde_gel_volume(s.gel) - 2e-6) < 1e-15);
  sonde_gel_put(s.gel, vec3(0, 0.06, 0), 0.0, 1e-8); // no node there: the nearest one
  for (int i = 0; i < 2000; ++i) {
    sonde_gel_step(s.gel, s.contact_n, vec3(0, 0.03 * sin(0.01 * i), 0.02), 0.01);
    const double *film = sonde_gel_film(s.gel);
    for (uint32_t k = 0; k < s.model->surface.vertex_count; ++k) assert_true(film[k] >= 0.0);
  }
  assert_true(fabs(sonde_gel_volume(s.gel) - 2.01e-6) < 1e-14);
  tear_down(&s);
}

// Under the probe the film thins; friction rises and the image darkens, tick by tick together.
static void one_film_drives_friction_and_image(void **state) {
  (void)state;
  scene s = set_up(0.0);
  sonde_gel_put(s.gel, vec3(0.06, 0, 0), 0.012, 4e-8);
  double last_mu = mu(&s), last_image = image(&s);
  double first_mu = last_mu, first_image = last_image;
  for (int i = 0; i < 3000; ++i) {
    sonde_gel_step(s.gel, s.contact_n, vec3(0, 0, 0), 0.01);
    double now_mu = mu(&s), now_image = image(&s);
    assert_true(now_mu >= last_mu - 1e-9);
    assert_true(now_image <= last_image + 1e-6);
    last_mu = now_mu;
    last_image = now_image;
  }
  assert_true(last_mu > first_mu + 0.01 && last_image < first_image - 0.01);
  sonde_gel_wipe(s.gel); // the same tick: both at once
  assert_true(mu(&s) > 0.35 && image(&s) <= 0.0);
  sonde_gel_put(s.gel, vec3(0.06, 0, 0), 0.012, 1e-6);
  assert_true(mu(&s) < 0.06 && image(&s) > 0.99);
  tear_down(&s);
}

// Where skin at rest goes when it stretches about the site.
static sonde_vec3 stretched(sonde_vec3 rest, double stretch) {
  return vec3(rest.x, stretch * rest.y, stretch * rest.z);
}

// Pressed skin stretches: nodes move apart, below the probe it touches as before. The share follows
// the skin between its nodes without a step until the touch ends.
static void skin_touches_between_its_nodes(void **state) {
  (void)state;
  enum { STEPS = 400 };
  scene s = set_up(0.0);
  uint32_t nodes = s.model->surface.vertex_count;
  sonde_vec3 *skin_m = SONDE_NEW(sonde_vec3, nodes), point_m[STEPS];
  float share[STEPS];
  sonde_gel_put(s.gel, vec3(0.06, 0, 0), 0.04, 1e-6);
  for (double stretch = 1.0; stretch < 2.2; stretch += 0.25)
    for (int way = 0; way < 12; ++way) {
      for (uint32_t i = 0; i < nodes; ++i)
        skin_m[i] = stretched(s.model->surface.vertices[i], stretch);
      for (int k = 0; k < STEPS; ++k) {
        double r = 0.03 * k / STEPS, turn = r * cos(0.5 * way) / 0.06;
        sonde_vec3 rest = vec3(0.06 * cos(turn), 0.06 * sin(turn), r * sin(0.5 * way));
        point_m[k] = stretched(rest, stretch);
      }
      sonde_gel_coupling(s.gel, skin_m, s.contact_n, point_m, STEPS, share);
      for (int k = 1; k < STEPS; ++k) {
        if (k < STEPS * 7 / 30) assert_true(share[k] > 0.98f); // all around is pressed
        if (k > STEPS * 17 / 30) assert_true(share[k] <= 0.0f);
        assert_true(fabsf(share[k] - share[k - 1]) < 0.1f);
      }
    }
  sonde_free(skin_m);
  tear_down(&s);
}

// A narrow gap between face and skin is gel, a wide one is air.
static void a_gap_fades_the_image(void **state) {
  (void)state;
  scene s = set_up(0.0);
  sonde_gel_put(s.gel, vec3(0.06, 0, 0), 0.04, 1e-6);
  double last = 1.0;
  for (double gap_m = 0.0; gap_m < 6e-3; gap_m += 1e-4) {
    const sonde_vec3 point_m = vec3(0.06 + gap_m, 0, 0);
    float share;
    sonde_gel_coupling(s.gel, s.model->surface.vertices, s.contact_n, &point_m, 1, &share);
    assert_true((double)share <= last + 1e-6 && (double)share > last - 0.1);
    if (gap_m < 1.5e-3) assert_true(share > 0.98f);
    if (gap_m > 4.2e-3) assert_true(share <= 0.0f);
    last = (double)share;
  }
  tear_down(&s);
}

// A film that dries leaves moist skin, stickier than dry skin; that in turn dries.
static void moist_skin_sticks_more(void **state) {
  (void)state;
  scene s = set_up(1e-6);
  double dry = mu(&s), highest = 0.0;
  sonde_gel_put(s.gel, vec3(0.06, 0, 0), 0.03, 1e-8);
  for (int i = 0; i < 6000; ++i) {
    sonde_gel_step(s.gel, s.contact_n, vec3(0, 0, 0), 0.01);
    highest = fmax(highest, mu(&s));
  }
  assert_true(fabs(dry - 0.36) < 0.01);
  assert_true(highest > 1.5 * dry);
  assert_true(fabs(mu(&s) - dry) < 1e-3 && sonde_gel_volume(s.gel) <= 0.0);
  tear_down(&s);
}

static void a_slide_takes_gel_along(void **state) {
  (void)state;
  scene s = set_up(0.0);
  sonde_gel_put(s.gel, vec3(0.06, 0, 0), 0.012, 2e-7);
  for (int i = 0; i < 100; ++i) sonde_gel_step(s.gel, s.contact_n, vec3(0, 0.02, 0), 0.01);
  double moment = 0.0;
  for (uint32_t i = 0; i < s.model->surface.vertex_count; ++i)
    moment += sonde_gel_film(s.gel)[i] * s.model->area_m2[i] * s.model->surface.vertices[i].y;
  assert_true(moment / sonde_gel_volume(s.gel) > 1e-3);
  tear_down(&s);
}

static void bad_definitions_are_named(void **state) {
  (void)state;
  scene s = set_up(0.0);
  sonde_gel_def def = sonde_gel_def_default();
  def.lubricating_m = (double)NAN;
  sonde_gel *gel;
  sonde_error error;
  assert_int_equal(sonde_gel_create(s.model, &def, &gel, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "lubricating_m"));
  assert_null(gel);
  def = sonde_gel_def_default();
  def.version++;
  assert_int_equal(sonde_gel_create(s.model, &def, &gel, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "version"));
  tear_down(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(volume_only_changes_hands),
      cmocka_unit_test(one_film_drives_friction_and_image),
      cmocka_unit_test(skin_touches_between_its_nodes),
      cmocka_unit_test(a_gap_fades_the_image),
      cmocka_unit_test(moist_skin_sticks_more),
      cmocka_unit_test(a_slide_takes_gel_along),
      cmocka_unit_test(bad_definitions_are_named),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
