// Robustness: short random poking of the fixture with every probe, law, engine and friction
// (bench/poke.h has the laws; bench_poke pokes for ten minutes), the push of a body that is
// narrower behind than at its middle, and contact that lasts.
#include "../../bench/poke.h"
#include "../fixture.h"

typedef struct scene {
  sonde_model *model;
  sonde_state *state;
  sonde_probe probe;
} scene;

static scene make(const char *probe, const sonde_world_def *def) {
  sonde_surface_law law = sonde_surface_law_default();
  law.shear_stiffness_n_m = 15;
  law.normal_exponent = 2;
  scene s = {.model = fixture_model(3, &law)};
  assert_int_equal(sonde_state_create(s.model, def, &s.state, NULL), SONDE_OK);
  assert_int_equal(sonde_probe_create(probe, &s.probe, NULL), SONDE_OK);
  return s;
}

static void clear(scene *s) {
  sonde_state_destroy(s->state);
  sonde_model_destroy(s->model);
  sonde_probe_clear(&s->probe);
}

static sonde_world_def def_of(int k) {
  sonde_world_def def = fixture_world_def();
  def.engine = k & 1 ? SONDE_ENGINE_DOUBLE : SONDE_ENGINE_FAST;
  def.contact_law = k & 2 ? SONDE_CONTACT_NODES : SONDE_CONTACT_FOUNDATION;
  if (k & 4) def.friction.mu_static = 0.5, def.friction.mu_kinetic = 0.3;
  return def;
}

static void poke_scene(scene *s, uint64_t seed, int ticks, poke_watch *watch) {
  poke_def def = poke_def_default();
  poke path = poke_begin(s->model, &def, seed);
  for (int k = 0; k < ticks; ++k) {
    sonde_pose pose = poke_next(&path, v_norm(sonde_state_contact(s->state)->force_n));
    sonde_step(s->state, &s->probe, pose);
    const char *broken = poke_check(watch, s->state, pose);
    if (broken)
      fail_msg("%s, seed %lu, tick %d: %s", s->probe.name, (unsigned long)seed, k, broken);
  }
}

static void random_poking_breaks_no_law(void **state) {
  (void)state;
  const char *probes[] = {"point", "linear", "square", "sphere", "ball:20", "rect:24x40"};
  double most_n = 0;
  uint64_t touching = 0;
  for (int k = 0; k < 48; ++k) {
    sonde_world_def def = def_of(k % 8);
    scene s = make(probes[k / 8], &def);
    poke_watch watch = {.least_forward = 1};
    poke_scene(&s, (uint64_t)k + 100, 600, &watch);
    touching += watch.touching;
    most_n = fmax(most_n, watch.most_force_n);
    clear(&s);
  }
  assert_true(most_n > 50 && touching > 48 * 600 / 4); // the paths were not too gentle to tell
}

static size_t allocations;
static void *counted(size_t bytes, void *user) {
  (void)user;
  allocations++;
  return malloc(bytes);
}
static void released(void *pointer, void *user) {
  (void)user;
  free(pointer);
}

static void poking_takes_no_memory(void **state) {
  (void)state;
  const sonde_allocator counter = {counted, released, NULL};
  sonde_set_allocator(&counter);
  for (int k = 0; k < 8; ++k) {
    sonde_world_def def = def_of(k);
    scene s = make("linear", &def);
    poke_watch watch = {.least_forward = 1};
    size_t before = allocations;
    poke_scene(&s, 7, 300, &watch);
    assert_int_equal(allocations, before);
    assert_true(before > 0);
    clear(&s);
  }
  const sonde_allocator plain = {0};
  sonde_set_allocator(&plain);
}

// A ball under the skin, its back in the skin: what is behind it must not draw it deeper.
static void back_of_a_ball_does_not_push(void **state) {
  (void)state;
  for (int k = 0; k < 4; ++k) {
    sonde_world_def def = def_of(k);
    scene s = make(k & 2 ? "ball:15" : "sphere", &def);
    for (int tick = 0; tick < 20; ++tick) {
      sonde_step(s.state, &s.probe, fixture_pose(0.026));
      double outwards = sonde_state_contact(s.state)->force_n.x;
      if (outwards < 0) fail_msg("law %d, tick %d: %g N into the skin", k, tick, outwards);
    }
    clear(&s);
  }
  sonde_world_def def = fixture_world_def();
  scene s = make("sphere", &def);
  sonde_settle(s.state, &s.probe, fixture_pose(0.027), 1e-6, 200);
  assert_true(sonde_state_contact(s.state)->force_n.x >= 0);
  clear(&s);
}

// Skin thrown against a probe that stands still touches it for many steps, the force rises from
// zero and falls to zero: penalty, not an impulse of one step.
static void contact_lasts(void **state) {
  (void)state;
  for (int engine = 0; engine < 2; ++engine) {
    sonde_world_def def = fixture_world_def();
    def.engine = engine ? SONDE_ENGINE_FAST : SONDE_ENGINE_DOUBLE;
    def.contact_stiffness_n_m3 = 1e7;
    def.contact_damping_n_s_m3 = 0;
    def.dt_s = 1e-4;
    scene s = make("square", &def);
    uint32_t n = s.model->surface.vertex_count;
    sonde_vec3 *v = calloc(n, sizeof *v);
    assert_non_null(v);
    for (uint32_t i = 0; i < n; ++i) v[i].x = 1;
    sonde_state_set(s.state, NULL, v);
    int touching = 0, rises = 0, falls = 0;
    double last = 0, most = 0;
    for (int k = 0; k < 400; ++k) {
      sonde_step(s.state, &s.probe, fixture_pose(-0.0005));
      double force = sonde_state_contact(s.state)->force_n.x;
      assert_true(force >= 0);
      touching += force > 0;
      rises += force > last;
      falls += force < last;
      most = fmax(most, force);
      last = force;
    }
    assert_true(most > 0.1 && last == 0);
    assert_true(touching > 20 && rises > 5 && falls > 5);
    free(v);
    clear(&s);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(random_poking_breaks_no_law),
      cmocka_unit_test(poking_takes_no_memory),
      cmocka_unit_test(back_of_a_ball_does_not_push),
      cmocka_unit_test(contact_lasts),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
