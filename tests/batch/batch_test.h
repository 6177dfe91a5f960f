// The bundled thigh as a patient, and a batch of it.
#ifndef SONDE_TESTS_BATCH_TEST_H
#define SONDE_TESTS_BATCH_TEST_H

#include "fixture.h"
#include "sonde/batch.h"

// A healthy patient.
static inline sonde_case_setup patient_of(sonde_model *model) {
  sonde_case_setup setup = {.model = model, .circulation = sonde_circulation_default()};
  sonde_error error = {0};
  if (sonde_vein_map_make(model, &setup.map, &error) ||
      sonde_pathology_preset("healthy", &setup.pathology, &error))
    fail_msg("%s", error.message);
  return setup;
}

static inline sonde_batch *batch_of(const sonde_batch_def *def) {
  sonde_batch *batch = NULL;
  sonde_error error = {0};
  if (sonde_batch_create(def, &batch, &error)) fail_msg("%s", error.message);
  return batch;
}

static inline void step(sonde_batch *batch, const double *actions) {
  assert_int_equal(sonde_batch_step(batch, actions, NULL, NULL), SONDE_OK);
}

// The same bits in every row of two batches, environment i of one against j of the other.
static inline void assert_alike(const sonde_batch *a, uint32_t i, const sonde_batch *b,
                                uint32_t j) {
  sonde_batch_view x = sonde_batch_look(a), y = sonde_batch_look(b);
  size_t picture = (size_t)x.width * x.height;
  assert_memory_equal(x.pose + 7 * i, y.pose + 7 * j, 7 * sizeof(double));
  assert_memory_equal(x.wrench + 6 * i, y.wrench + 6 * j, 6 * sizeof(double));
  const size_t columns = SONDE_BATCH_VESSEL;
  assert_memory_equal(x.vessel + columns * i, y.vessel + columns * j, columns * sizeof(double));
  assert_true(x.time_s[i] == y.time_s[j] && x.flags[i] == y.flags[j]);
  if (picture) assert_memory_equal(x.pixels + picture * i, y.pixels + picture * j, picture);
}

#endif
