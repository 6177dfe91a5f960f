// Hashes of states, pictures, a limb and its blood are the same numbers with every compiler, at
// every level of optimisation, with every C library and processor: equal_bits.sh builds this
// program with other ones too.
#include "../echo/bench.h"
#include "../fixture.h"
#include "../sanitized.h"
#include "sonde/echo_scanner.h"
#include "sonde/flow.h"

#include <inttypes.h>

// SONDE_GOLDEN_SHORT leaves out what an emulated processor takes more than seconds for; sanitizers
// skip the drawn limb, which other tests draw.
static bool whole(void) { return getenv("SONDE_GOLDEN_SHORT") == NULL; }

// One hash beside the one that is expected; counts those that differ.
static uint32_t differs(const char *what, size_t index, uint64_t hash, uint64_t expected) {
  if (hash == expected) return 0;
  print_error("%s %zu: hash is 0x%016" PRIx64 "u, expected 0x%016" PRIx64 "u\n", what, index, hash,
              expected);
  return 1;
}

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
  for (size_t k = 0; k < SONDE_COUNT_OF(SCENES); k += whole() ? 1 : 5)
    wrong += differs("scene", k, run(&SCENES[k]), SCENES[k].hash);
  assert_int_equal(wrong, 0);
}

// A leg with vessels that a curved and a flat probe dent by a parabola: by columns, with a scanner
// of three looks, haze and webs; by finite elements, with the plain scanner; by every set of inner
// loops.
static void pictures_are_golden(void **state) {
  (void)state;
  const uint64_t expected[] = {0x31a316686a283615u, 0x91a56e0107e6d523u};
  sonde_scanner scanner = {0};
  uint32_t count, wrong = 0;
  const sonde_scanner_number *n = sonde_scanner_numbers(&count);
  for (uint32_t k = 0; k < count; ++k)
    *(double *)(void *)((char *)&scanner + n[k].offset) = n[k].plain * n[k].si;
  scanner.transmit_f = 5, scanner.receive_f = 4, scanner.looks = 3, scanner.look_rad = 0.15;
  static bench b;
  bench_create(&b, 0.08, 0.01, 12e-3, false, true);
  b.settings.depth_m = 0.05, b.pose = tube_pose(leg_radius - 6e-3, 0.15);
  const uint32_t nodes = b.leg.model.surface.vertex_count;
  sonde_vec3 *pressed = SONDE_NEW(sonde_vec3, nodes);
  for (uint32_t i = 0; i < nodes; ++i) {
    pressed[i] = b.leg.model.surface.vertices[i];
    const double x = pressed[i].x / 0.03, z = (pressed[i].z - 0.15) / 0.03;
    if (pressed[i].y > 0) pressed[i].y -= 6e-3 * fmax(1 - x * x - z * z, 0);
  }
  for (size_t k = 0; k < (whole() ? SONDE_COUNT_OF(expected) : 1); ++k) {
    sonde_echo_destroy(b.echo);
    sonde_echo_def def = {.version = SONDE_DEF_VERSION,
                          .seed = 7,
                          .line_count = 96,
                          .sample_count = 512,
                          .scanner = k ? NULL : &scanner};
    assert_int_equal(sonde_echo_create(b.interior, &def, &b.echo, NULL), SONDE_OK);
    assert_int_equal(sonde_echo_set_radius(b.echo, k ? 0 : 0.06, NULL), SONDE_OK);
    sonde_interior_set_method(b.interior, k ? SONDE_INTERIOR_SOLID : SONDE_INTERIOR_COLUMNS);
    const char *sets[] = {"base", "sse4", "avx2", "avx512"};
    for (size_t set = 0; set < SONDE_COUNT_OF(sets); ++set) {
      if (sonde_echo_set_kernels(b.echo, sets[set], NULL)) continue;
      look(&b, pressed);
      uint64_t grey = 0;
      for (uint32_t i = 0; i < 512 * 512; ++i) grey += b.image.pixels[i];
      assert_true(grey / (512 * 512) > 20); // there is something to see
      uint32_t lines, samples;
      const float *envelope = sonde_echo_envelope(b.echo, &lines, &samples);
      uint64_t hash = sonde_hash(0, b.image.pixels, 512 * 512);
      hash = sonde_hash(hash, envelope, (size_t)lines * samples * sizeof *envelope);
      wrong += differs(sets[set], k, hash, expected[k]);
    }
  }
  sonde_free(pressed);
  bench_clear(&b);
  assert_int_equal(wrong, 0);
}

// A drawn body and the blood in a vein and an artery, as a Doppler gate hears it; the limb's skin
// and labels.
static void limb_and_blood_are_golden(void **state) {
  (void)state;
  const uint64_t expected[] = {0x444a5b95d1889ec7u, 0x74bf5a66d81bbd20u, 0xffa2ccdd01b5e99eu,
                               0x7784b376b31c89ecu};
  sonde_limb_body body = sonde_limb_unknown();
  assert_int_equal(sonde_limb_draw(&body, 3, &body, NULL), SONDE_OK);
  uint32_t wrong = differs("body", 0, sonde_hash(0, &body, sizeof body), expected[0]);
  sonde_flow_def def = sonde_flow_def_default(NULL);
  sonde_flow flow;
  sonde_doppler_def gate = sonde_doppler_def_default();
  sonde_doppler *doppler;
  double profile[SONDE_FLOW_RINGS] = {0}, beat[64];
  assert_int_equal(sonde_flow_start(&def, &flow, NULL), SONDE_OK);
  assert_int_equal(sonde_doppler_create(&gate, &doppler, NULL), SONDE_OK);
  for (int k = 0; k < 300; ++k) {
    sonde_flow_step(&flow, 1e-3);
    sonde_flow_follow(profile, 0.005, sonde_flow_velocity(&flow, SONDE_FLOW_FEMORAL), 1e-3);
    sonde_doppler_pulse(doppler, profile);
  }
  sonde_doppler_spectrum spectrum;
  sonde_doppler_read(doppler, &spectrum);
  uint64_t hash = sonde_hash(0, spectrum.power, sizeof spectrum.power);
  for (int k = 0; k < 64; ++k) beat[k] = sonde_flow_artery(k / 64.0);
  sonde_flow_pulsed(beat, 64, 0.0045, 1.2, 0.3, profile);
  wrong += differs("blood", 0, sonde_hash(hash, profile, sizeof profile), expected[1]);
  sonde_doppler_destroy(doppler);
  if (whole() && ROUNDS(true, false)) {
    sonde_limb *limb;
    sonde_mesh skin;
    assert_int_equal(sonde_limb_create(&body, &limb, NULL), SONDE_OK);
    assert_int_equal(sonde_limb_skin(limb, 0.02, &skin, NULL), SONDE_OK);
    hash = sonde_hash(0, skin.vertices, skin.vertex_count * sizeof *skin.vertices);
    wrong += differs("limb", 0, hash, expected[2]);
    hash = 0;
    for (int k = 0; k < 20000; ++k) {
      const double level = 1.8 * (k / 20000.0), share = 0.05 + 0.9 * (k % 97) / 97.0;
      const sonde_limb_label at =
          sonde_limb_at(limb, sonde_limb_point(limb, level, 0.1 * k, share));
      const uint32_t tissue = (uint32_t)at.tissue;
      hash = sonde_hash(hash, &tissue, sizeof tissue);
    }
    wrong += differs("limb", 1, hash, expected[3]);
    sonde_mesh_clear(&skin);
    sonde_limb_destroy(limb);
  }
  assert_int_equal(wrong, 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(hashes_are_golden),
                                     cmocka_unit_test(pictures_are_golden),
                                     cmocka_unit_test(limb_and_blood_are_golden)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
