// The state hash of fixed scenes is the same number with gcc and clang, in debug and release. The
// scenes use square roots and divisions only, which IEEE 754 defines to the last bit.
#include "../fixture.h"

#include <inttypes.h>

typedef struct scene {
  const char *probe;
  double lambda;
  sonde_contact_law law;
  double shear_n_m, inplane_n_m; // with an in-plane layer there are no surface springs
  sonde_engine engine;
  uint64_t hash;
} scene;

static const scene SCENES[] = {
    {"point", 1.0, SONDE_CONTACT_FOUNDATION, 0, 0, SONDE_ENGINE_DOUBLE, 0xc6f5c30457b636b3u},
    {"linear", 0.5, SONDE_CONTACT_FOUNDATION, 15, 0, SONDE_ENGINE_DOUBLE, 0x94146dc9f67a6d9eu},
    {"square", 1.0, SONDE_CONTACT_VOLUME, 0, 0, SONDE_ENGINE_DOUBLE, 0x77cf364f5ad1324au},
    {"linear", 1.0, SONDE_CONTACT_FOUNDATION, 15, 0, SONDE_ENGINE_FAST, 0x8b6fc9cf79d67ec5u},
    {"ball:20", 1.0, SONDE_CONTACT_NODES, 0, 0, SONDE_ENGINE_FAST, 0x05c3c7816a425b0du},
    {"linear", 1.0, SONDE_CONTACT_FOUNDATION, 15, 35, SONDE_ENGINE_DOUBLE, 0xd800cf2e61d44ea9u},
    {"linear", 1.0, SONDE_CONTACT_FOUNDATION, 15, 35, SONDE_ENGINE_FAST, 0x79bdbb3c968728d6u},
};

static uint64_t run(const scene *s) {
  sonde_surface_law law = sonde_surface_law_default();
  law.shear_stiffness_n_m = s->shear_n_m;
  law.inplane_stiffness_n_m = s->inplane_n_m;
  if (s->inplane_n_m > 0) law.edge_stiffness_n_m = 0;
  sonde_world_def def = fixture_world_def();
  def.implicitness = s->lambda;
  def.contact_law = s->law;
  def.engine = s->engine;
  sonde_model *model = fixture_model(4, &law);
  sonde_state *state;
  sonde_probe probe;
  assert_int_equal(sonde_state_create(model, &def, &state, NULL), SONDE_OK);
  assert_int_equal(sonde_probe_create(s->probe, &probe, NULL), SONDE_OK);
  for (int k = 0; k < 250; ++k) {
    sonde_pose pose = fixture_pose(k < 150 ? 6e-5 * k - 0.001 : 0.008);
    pose.position.y = k < 150 ? 0 : 1e-4 * (k - 150);
    sonde_step(state, &probe, pose);
  }
  assert_true(v_norm(sonde_state_contact(state)->force_n) > 0.1);
  uint64_t hash = sonde_state_hash(state);
  sonde_probe_clear(&probe);
  sonde_state_destroy(state);
  sonde_model_destroy(model);
  return hash;
}

static void hashes_are_golden(void **state) {
  (void)state;
  uint32_t wrong = 0;
  for (size_t k = 0; k < SONDE_COUNT_OF(SCENES); ++k) {
    uint64_t hash = run(&SCENES[k]);
    if (hash == SCENES[k].hash) continue;
    print_error("scene %zu: hash is 0x%016" PRIx64 "u, expected 0x%016" PRIx64 "u\n", k, hash,
                SCENES[k].hash);
    wrong++;
  }
  assert_int_equal(wrong, 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(hashes_are_golden)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
