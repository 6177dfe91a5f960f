// Tables of sites, of measurements and of motion: any bytes are either a table of finite rows or an
// error. The first byte chooses the table. What is read is compared with the leg, or summarised.
#include "fuzz.h"

#include <math.h>

static void read_sites(const char *path) {
  sonde_site_table table;
  sonde_error error = {SONDE_OK, "", ""};
  if (!fuzz_checked(sonde_site_table_load(path, &table, &error), &error)) return;
  FUZZ_CHECK(table.count > 0);
  for (uint32_t i = 0; i < table.count; ++i) {
    sonde_vec3 n = table.sites[i].normal, p = table.sites[i].position_m;
    FUZZ_CHECK(fabs(n.x * n.x + n.y * n.y + n.z * n.z - 1.0) < 1e-9);
    FUZZ_CHECK(isfinite(p.x) && isfinite(p.y) && isfinite(p.z));
  }
  sonde_status status = sonde_sites_check_on_surface(fuzz_leg(), &table, 5e-3, &error);
  if (status) FUZZ_CHECK(error.status == status && error.message[0]);
  sonde_site_table_clear(&table);
}

static void read_measurements(const char *path) {
  sonde_measurements table;
  sonde_error error = {SONDE_OK, "", ""};
  if (!fuzz_checked(sonde_measurements_load(path, NULL, &table, &error), &error)) return;
  FUZZ_CHECK(table.count > 0);
  for (uint32_t i = 0; i < table.count; ++i) {
    FUZZ_CHECK(isfinite(table.data[i].force_n));
    FUZZ_CHECK(table.data[i].penetration_m >= 0 && isfinite(table.data[i].penetration_m));
  }
  sonde_measurements_clear(&table);
}

static void read_motion(const char *path) {
  sonde_motion_record record;
  sonde_relaxation holds[SONDE_HOLDS];
  sonde_slide slides[SONDE_HOLDS];
  uint32_t count;
  sonde_error error = {SONDE_OK, "", ""};
  if (!fuzz_checked(sonde_motion_record_load(path, &record, &error), &error)) return;
  FUZZ_CHECK(record.count >= 2);
  for (uint32_t i = 0; i < record.count; ++i) {
    FUZZ_CHECK(isfinite(record.samples[i].normal_n));
    FUZZ_CHECK(i == 0 || record.samples[i].time_s > record.samples[i - 1].time_s);
  }
  sonde_status status = record.protocol == SONDE_PROTOCOL_SLIDE
                            ? sonde_slide_read(&record, slides, &count, &error)
                            : sonde_relaxation_read(&record, holds, &count, &error);
  FUZZ_CHECK(status ? error.status == status : count <= SONDE_HOLDS);
  sonde_motion_record_clear(&record);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  if (count < 1) return 0;
  const char *path = fuzz_file("table.csv", bytes + 1, count - 1);
  switch (bytes[0] % 3) {
  case 0: read_measurements(path); break;
  case 1: read_sites(path); break;
  default: read_motion(path); break;
  }
  return 0;
}
