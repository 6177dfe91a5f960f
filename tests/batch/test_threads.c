// Environments do not depend on threads or on each other. A sphere without an inside: forces only.
#include "batch_test.h"

static void push_all(sonde_batch *batch, uint32_t count, int steps) {
  double actions[16 * SONDE_BATCH_ACTION] = {0};
  for (int k = 0; k < steps; ++k) {
    for (uint32_t i = 0; i < count; ++i) {
      actions[SONDE_BATCH_ACTION * i + 2] = 0.1 - 0.01 * i;
      actions[SONDE_BATCH_ACTION * i + 3] = 0.02 * k;
    }
    step(batch, actions);
  }
}

static void threads_give_the_same(void **state) {
  (void)state;
  sonde_model *model = fixture_model(3, NULL);
  sonde_case_setup setup = {.model = model, .circulation = sonde_circulation_default()};
  assert_int_equal(sonde_pathology_preset("healthy", &setup.pathology, NULL), SONDE_OK);
  const sonde_case_setup *patients[] = {&setup};
  sonde_batch_def def = sonde_batch_def_default();
  def.patients = patients, def.patient_count = 1;
  def.inside = false, def.probe = "point", def.count = 6;
  def.threads = 1;
  sonde_batch *one = batch_of(&def);
  def.threads = 3;
  sonde_batch *three = batch_of(&def);
  def.count = 1;
  sonde_batch *alone = batch_of(&def);
  push_all(one, 6, 20);
  push_all(three, 6, 20);
  push_all(alone, 1, 20);
  sonde_batch_view view = sonde_batch_look(one);
  assert_true(-view.wrench[2] > 1 && view.wrench[2] < view.wrench[5 * 6 + 2]);
  for (uint32_t i = 0; i < 6; ++i) assert_alike(one, i, three, i);
  assert_alike(one, 0, alone, 0);
  assert_true(sonde_batch_hash(one) == sonde_batch_hash(three));
  assert_true(sonde_batch_hash(one) != sonde_batch_hash(alone));
  sonde_batch_destroy(one);
  sonde_batch_destroy(three);
  sonde_batch_destroy(alone);
  sonde_model_destroy(model);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(threads_give_the_same)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
