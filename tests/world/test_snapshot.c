// Saved states: going on from one gives the bits of the run that was never stopped, whatever the
// state did in between; blobs that are none are refused before anything changes.
#include "../fixture.h"
#include "world/snapshot.h"

typedef struct scene {
  sonde_model *model;
  sonde_state *state;
  sonde_probe probe;
} scene;

static sonde_world_def def_of(sonde_engine engine, sonde_contact_law law) {
  sonde_world_def def = fixture_world_def();
  def.engine = engine, def.contact_law = law;
  def.friction.mu_static = 0.6, def.friction.mu_kinetic = 0.4;
  def.sleep_displacement_m = 20e-6;
  return def;
}

static scene make(const sonde_world_def *def) {
  sonde_surface_law law = sonde_surface_law_default();
  law.shear_stiffness_n_m = 15;
  law.normal_exponent = 2;
  scene s = {.model = fixture_model(3, &law)};
  fixture_vary_shear(s.model);
  assert_int_equal(sonde_state_create(s.model, def, &s.state, NULL), SONDE_OK);
  assert_int_equal(sonde_probe_create("point", &s.probe, NULL), SONDE_OK);
  return s;
}

static void clear(scene *s) {
  sonde_state_destroy(s->state);
  sonde_model_destroy(s->model);
  sonde_probe_clear(&s->probe);
}

// Down to 8 mm, along the skin, off, down again elsewhere.
static void play(sonde_state *state, const sonde_probe *probe, int from, int to) {
  for (int k = from; k < to; ++k) {
    double depth = k < 100 ? 9e-5 * k - 0.001 : k < 260 ? 0.008 : k < 360 ? -0.004 : 0.005;
    sonde_pose pose = fixture_pose(depth);
    pose.position.y = k < 100 ? 0 : k < 260 ? 5e-5 * (k - 100) : 0.008;
    sonde_step(state, k % 97 == 96 ? NULL : probe, pose);
  }
}

static void *save(const sonde_state *state, size_t *bytes) {
  void *blob = sonde_calloc(1, sonde_state_size(state));
  assert_non_null(blob);
  *bytes = sonde_state_save(state, blob);
  assert_true(*bytes <= sonde_state_size(state));
  return blob;
}

// Saved at `at`; then the state goes astray, or another one is used, and comes back.
static void goes_on(const sonde_world_def *def, int at) {
  enum { END = 480 };
  scene s = make(def), t = make(def);
  size_t bytes, again;
  play(s.state, &s.probe, 0, at);
  void *blob = save(s.state, &bytes);
  assert_true(sonde_state_saved_hash(s.model, blob) == sonde_state_hash(s.state));
  play(s.state, &s.probe, at, END);
  uint64_t hash = sonde_state_hash(s.state), awake = sonde_state_awake(s.state);
  sonde_vec3 force = sonde_state_contact(s.state)->force_n;
  sonde_contact whole = *sonde_state_contact(s.state);
  void *last = save(s.state, &again);
  sonde_state *used[2] = {s.state, t.state};
  play(t.state, &t.probe, 0, 37);
  for (int k = 0; k < 2; ++k) {
    sonde_error error = {0};
    if (sonde_state_restore(used[k], blob, bytes, &error)) fail_msg("%s", error.message);
    assert_true(sonde_state_hash(used[k]) == sonde_state_saved_hash(s.model, blob));
    play(used[k], &s.probe, at, END);
    assert_true(sonde_state_hash(used[k]) == hash);
    assert_true(sonde_state_awake(used[k]) == awake);
    assert_memory_equal(&sonde_state_contact(used[k])->force_n, &force, sizeof force);
    assert_memory_equal(sonde_state_contact(used[k]), &whole, offsetof(sonde_contact, volume_m3));
    size_t count;
    void *end = save(used[k], &count);
    assert_int_equal(count, again);
    assert_memory_equal((char *)end + sizeof(sonde_snapshot_head),
                        (char *)last + sizeof(sonde_snapshot_head),
                        count - sizeof(sonde_snapshot_head));
    sonde_free(end);
  }
  sonde_free(blob);
  sonde_free(last);
  clear(&s);
  clear(&t);
}

static const int MOMENTS[] = {0, 60, 97, 180, 300, 371};

static void the_fast_engine_goes_on(void **state) {
  (void)state;
  const sonde_contact_law laws[] = {SONDE_CONTACT_FOUNDATION, SONDE_CONTACT_NODES};
  for (size_t l = 0; l < SONDE_COUNT_OF(laws); ++l)
    for (size_t k = 0; k < SONDE_COUNT_OF(MOMENTS); ++k) {
      sonde_world_def def = def_of(SONDE_ENGINE_FAST, laws[l]);
      goes_on(&def, MOMENTS[k]);
    }
}

static void the_double_engine_goes_on(void **state) {
  (void)state;
  const sonde_contact_law laws[] = {SONDE_CONTACT_FOUNDATION, SONDE_CONTACT_VOLUME,
                                    SONDE_CONTACT_NODES};
  for (size_t l = 0; l < SONDE_COUNT_OF(laws); ++l)
    for (size_t k = 1; k < SONDE_COUNT_OF(MOMENTS); k += 2) {
      sonde_world_def def = def_of(SONDE_ENGINE_DOUBLE, laws[l]);
      goes_on(&def, MOMENTS[k]);
    }
}

// The doubles are newer than the fast engine's own numbers until the next step.
static void positions_that_were_set_are_kept(void **state) {
  (void)state;
  sonde_world_def def = def_of(SONDE_ENGINE_FAST, SONDE_CONTACT_FOUNDATION);
  scene s = make(&def);
  uint32_t n = s.model->surface.vertex_count;
  sonde_vec3 *x = SONDE_NEW(sonde_vec3, n);
  for (uint32_t i = 0; i < n; ++i)
    x[i] = v_madd(s.model->surface.vertices[i], -1e-3 / 3, s.model->normal[i]);
  sonde_state_set(s.state, x, NULL);
  size_t bytes;
  void *blob = save(s.state, &bytes);
  assert_true(sonde_state_saved_hash(s.model, blob) == sonde_state_hash(s.state));
  play(s.state, &s.probe, 0, 90);
  uint64_t hash = sonde_state_hash(s.state);
  assert_int_equal(sonde_state_restore(s.state, blob, bytes, NULL), SONDE_OK);
  assert_memory_equal(sonde_state_positions(s.state), x, n * sizeof *x);
  play(s.state, &s.probe, 0, 90);
  assert_true(sonde_state_hash(s.state) == hash);
  sonde_free(x);
  sonde_free(blob);
  clear(&s);
}

static void blobs_that_do_not_fit_are_refused(void **state) {
  (void)state;
  sonde_world_def def = def_of(SONDE_ENGINE_FAST, SONDE_CONTACT_FOUNDATION);
  scene s = make(&def);
  play(s.state, &s.probe, 0, 120);
  size_t bytes;
  unsigned char *blob = save(s.state, &bytes);
  uint64_t hash = sonde_state_hash(s.state);
  sonde_error error = {0};
  for (size_t cut = 0; cut < bytes; cut += 1 + cut / 3)
    assert_int_equal(sonde_state_restore(s.state, blob, cut, &error), SONDE_FORMAT);
  // every byte of the head and of the list of nodes: refused, or a number that may be any
  sonde_snapshot_parts parts = sonde_snapshot_layout(s.state, false, s.state->touched_count);
  scene other = make(&def);
  for (size_t i = 0; i < bytes;
       i += i < sizeof(sonde_snapshot_head) || i >= parts.touched ? 1 : 997) {
    blob[i] ^= 0x81;
    sonde_status status = sonde_state_restore(other.state, blob, bytes, &error);
    if (!status) play(other.state, &s.probe, 120, 122);
    blob[i] ^= 0x81;
  }
  s.model->checksum ^= 1;
  assert_int_equal(sonde_state_restore(s.state, blob, bytes, &error), SONDE_MISMATCH);
  s.model->checksum ^= 1;
  def.engine = SONDE_ENGINE_DOUBLE;
  scene exact = make(&def);
  assert_int_equal(sonde_state_restore(exact.state, blob, bytes, &error), SONDE_MISMATCH);
  assert_true(sonde_state_hash(s.state) == hash);
  sonde_free(blob);
  clear(&s);
  clear(&other);
  clear(&exact);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_fast_engine_goes_on),
      cmocka_unit_test(the_double_engine_goes_on),
      cmocka_unit_test(positions_that_were_set_are_kept),
      cmocka_unit_test(blobs_that_do_not_fit_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
