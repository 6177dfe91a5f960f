// Every one of twenty thighs comes to rest under the linear probe.
#include "anatomy_test.h"

static void twenty_thighs_settle(void **state) {
  (void)state;
  sonde_thigh_def def = coarse();
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    sonde_thigh thigh;
    sonde_model *model = make_thigh(NULL, seed, &def, &thigh);
    settles_at_three_sites(model, 0.01);
    sonde_model_destroy(model);
  }
}

static void lean_and_obese_thighs_settle(void **state) {
  (void)state;
  const double fat_m[] = {0.004, 0.030};
  sonde_thigh_def def = coarse();
  for (int k = 0; k < 2; ++k) {
    sonde_thigh known = sonde_thigh_unknown(), thigh;
    known.fat_front_m = known.fat_inner_m = known.fat_outer_m = known.fat_back_m = fat_m[k];
    sonde_model *model = make_thigh(&known, 1, &def, &thigh);
    settles_at_three_sites(model, 0.01);
    sonde_model_destroy(model);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(twenty_thighs_settle),
                                     cmocka_unit_test(lean_and_obese_thighs_settle)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
