// The table of a solid's materials: one row per layer.
#include "sonde/solid.h"

#include "base/base.h"
#include "base/csv.h"

#include <string.h>

static const char *const LAYER[] = {SONDE_SOLID_LAYER_NAMES};
static const char *const ENERGY[] = {SONDE_STRAIN_ENERGY_NAMES};
static const double pa_per_kpa = 1e3;

sonde_status sonde_moduli_save(const char *path, const sonde_hyperelastic layer[SONDE_SOLID_LAYERS],
                               const sonde_moduli_certainty *certainty, const char *remark,
                               sonde_error *error) {
  SONDE_ASSERT(path != NULL && layer != NULL);
  static const char *const FROM[2] = {"prior", "data"};
  sonde_file *file;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  if (remark) sonde_file_printf(file, "# %.*s\n", (int)strcspn(remark, "\r\n"), remark);
  sonde_file_printf(file, "layer,energy,shear_kpa,exponent,bulk_ratio%s\n",
                    certainty ? ",ln_shear_sd,shear_from,ln_exponent_sd,exponent_from" : "");
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) {
    const sonde_hyperelastic *m = &layer[k];
    sonde_file_printf(file, "%s,%s,%.9g,%.9g,%.9g", LAYER[k], ENERGY[m->energy],
                      m->shear_pa / pa_per_kpa, m->exponent, m->bulk_pa / m->shear_pa);
    for (int i = 0; i < 2 && certainty; ++i)
      sonde_file_printf(file, ",%.4g,%s", certainty->ln_sd[k][i], FROM[certainty->measured[k][i]]);
    sonde_file_printf(file, "\n");
  }
  return sonde_file_commit(file, error);
}

// Index of a cell among names; FORMAT naming them.
static sonde_status read_word(const sonde_csv *csv, uint32_t column, const char *const *names,
                              int *at, sonde_error *error) {
  for (*at = 0; *at < 3; ++*at)
    if (!strcmp(csv->cell[column], names[*at])) return SONDE_OK;
  return sonde_fail(error, SONDE_FORMAT, "%s: line %u: \"%s\": expected %s, %s or %s", csv->path,
                    csv->line, csv->cell[column], names[0], names[1], names[2]);
}

sonde_status sonde_moduli_load(const char *path, sonde_hyperelastic layer[SONDE_SOLID_LAYERS],
                               sonde_error *error) {
  SONDE_ASSERT(path != NULL && layer != NULL);
  static const char *const NAMES[] = {"layer", "energy", "shear_kpa", "exponent", "bulk_ratio"};
  sonde_csv csv;
  uint32_t column[SONDE_COUNT_OF(NAMES)];
  bool seen[SONDE_SOLID_LAYERS] = {false};
  sonde_status status = sonde_csv_open(&csv, path, error);
  if (!status) status = sonde_csv_require(&csv, NAMES, SONDE_COUNT_OF(NAMES), column, error);
  for (bool found = true; !status;) {
    status = sonde_csv_next(&csv, &found, error);
    if (status || !found) break;
    int k, energy;
    double number[3];
    status = read_word(&csv, column[0], LAYER, &k, error);
    if (!status) status = read_word(&csv, column[1], ENERGY, &energy, error);
    for (int i = 0; i < 3 && !status; ++i)
      status = sonde_csv_real(&csv, column[2 + i], &number[i], error);
    if (status) break;
    if (seen[k] || !(number[0] > 0 && number[0] <= 1e6 && number[2] > 0))
      status = sonde_fail(error, SONDE_FORMAT,
                          "%s: line %u: %s: expected each layer once, moduli up to 1e6 kPa and "
                          "ratios above 0",
                          path, csv.line, LAYER[k]);
    seen[k] = true;
    layer[k] = (sonde_hyperelastic){(sonde_strain_energy)energy, pa_per_kpa * number[0], number[1],
                                    pa_per_kpa * number[0] * number[2]};
  }
  for (int k = 0; k < SONDE_SOLID_LAYERS && !status; ++k)
    if (!seen[k])
      status = sonde_fail(error, SONDE_FORMAT, "%s: no row of the layer %s", path, LAYER[k]);
  sonde_csv_close(&csv);
  return status;
}
