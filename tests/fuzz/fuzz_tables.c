// Site and measurement tables: any bytes are either a table of finite rows or an error.
// An odd first byte means sites, an even one measurements.
#include "fuzz.h"

#include <math.h>

static void read_sites(const char *path) {
  sonde_site_table table;
  sonde_error error = {SONDE_OK, "", ""};
  sonde_status status = sonde_site_table_load(path, &table, &error);
  if (status) {
    fuzz_check_error(status, &error);
    return;
  }
  FUZZ_CHECK(table.count > 0);
  for (uint32_t i = 0; i < table.count; ++i) {
    sonde_vec3 n = table.sites[i].normal, p = table.sites[i].position_m;
    FUZZ_CHECK(fabs(n.x * n.x + n.y * n.y + n.z * n.z - 1.0) < 1e-9);
    FUZZ_CHECK(isfinite(p.x) && isfinite(p.y) && isfinite(p.z));
  }
  sonde_site_table_clear(&table);
}

static void read_measurements(const char *path) {
  sonde_measurements table;
  sonde_error error = {SONDE_OK, "", ""};
  sonde_status status = sonde_measurements_load(path, NULL, &table, &error);
  if (status) {
    fuzz_check_error(status, &error);
    return;
  }
  FUZZ_CHECK(table.count > 0);
  for (uint32_t i = 0; i < table.count; ++i) {
    FUZZ_CHECK(isfinite(table.data[i].force_n));
    FUZZ_CHECK(table.data[i].penetration_m >= 0 && isfinite(table.data[i].penetration_m));
  }
  sonde_measurements_clear(&table);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  if (count < 1) return 0;
  const char *path = fuzz_file("csv", bytes + 1, count - 1);
  if (bytes[0] % 2)
    read_sites(path);
  else
    read_measurements(path);
  unlink(path);
  return 0;
}
