// The table of moduli: what is written is read, and a bad table is refused by name and line.
#include "fixture.h"
#include "sonde/solid.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

static char path[256];

static void what_is_written_is_read(void **state) {
  (void)state;
  sonde_error error;
  sonde_hyperelastic out[SONDE_SOLID_LAYERS], in[SONDE_SOLID_LAYERS];
  const sonde_moduli_certainty certainty = {.ln_sd = {{0.1, 0.2}}, .measured = {{true, false}}};
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k)
    out[k] = (sonde_hyperelastic){(sonde_strain_energy)k, 1234.5678 * (k + 1), 2.5 + k,
                                  (20 + k) * 1234.5678 * (k + 1)};
  for (int told = 0; told < 2; ++told) {
    assert_int_equal(sonde_moduli_save(path, out, told ? &certainty : NULL, "a, \"b\"\nc", &error),
                     SONDE_OK);
    assert_int_equal(sonde_moduli_load(path, in, &error), SONDE_OK);
    for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) {
      assert_int_equal(in[k].energy, out[k].energy);
      assert_near(in[k].shear_pa / out[k].shear_pa, 1, 1e-8);
      assert_near(in[k].exponent / out[k].exponent, 1, 1e-8);
      assert_near(in[k].bulk_pa / out[k].bulk_pa, 1, 1e-8);
    }
  }
}

static void bad_tables_are_refused(void **state) {
  (void)state;
  static const char HEAD[] = "layer,energy,shear_kpa,exponent,bulk_ratio\n";
  static const char *const BAD[][2] = {{"muscle,ogden,3,9,24\nfat,ogden,1,8,24\n", "skin"},
                                       {"muscle,ogden,3,9,24\nmuscle,ogden,1,8,24\n", "line 3"},
                                       {"bone,ogden,3,9,24\n", "bone"},
                                       {"muscle,hooke,3,9,24\n", "hooke"},
                                       {"muscle,ogden,-3,9,24\n", "line 2"},
                                       {"muscle,ogden,3,x,24\n", "exponent"},
                                       {"muscle,ogden,3,9,0\n", "line 2"}};
  for (size_t k = 0; k < sizeof BAD / sizeof *BAD; ++k) {
    sonde_error error = {0};
    sonde_hyperelastic layer[SONDE_SOLID_LAYERS];
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "%s%s", HEAD, BAD[k][0]);
    fclose(file);
    assert_int_equal(sonde_moduli_load(path, layer, &error), SONDE_FORMAT);
    if (!strstr(error.message, BAD[k][1])) fail_msg("%s: %s", BAD[k][0], error.message);
  }
}

int main(void) {
  snprintf(path, sizeof path, "%s/moduli_%d.csv", SONDE_BINARY_DIR, (int)getpid());
  const struct CMUnitTest tests[] = {cmocka_unit_test(what_is_written_is_read),
                                     cmocka_unit_test(bad_tables_are_refused)};
  const int failed = cmocka_run_group_tests(tests, NULL, NULL);
  unlink(path);
  return failed;
}
