// PLUS configurations (XML): any bytes are either transforms that locate a sequence's frames, or an
// error.
#include "fuzz.h"
#include "sweep/frames.h"

#include <math.h>

static void locate(const sonde_calibration *calibration) {
  sonde_sequence s;
  sonde_located located;
  sonde_error error = {SONDE_OK, "", ""};
  const sonde_affine probe = {{{1, 0, 0, 5}, {0, 1, 0, 6}, {0, 0, 1, 7}}};
  FUZZ_CHECK(sonde_sequence_create(8, 6, 2, &s, &error) == SONDE_OK);
  for (uint32_t f = 0; f < 2; ++f)
    FUZZ_CHECK(sonde_sequence_set_transform(&s, f, "ProbeToTracker", &probe, &error) == SONDE_OK);
  sonde_status status = sonde_sequence_locate(&s, calibration, NULL, &located, &error);
  FUZZ_CHECK(status ? error.status == status && error.message[0] : located.used == 2);
  sonde_sequence_clear(&s);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  sonde_calibration calibration;
  sonde_error error = {SONDE_OK, "", ""};
  const char *path = fuzz_file("calibration.xml", bytes, count);
  if (!fuzz_checked(sonde_calibration_load(path, &calibration, &error), &error)) return 0;
  FUZZ_CHECK(calibration.count <= 16);
  for (uint32_t k = 0; k < calibration.count; ++k)
    for (int i = 0; i < 12; ++i)
      FUZZ_CHECK(isfinite(calibration.transforms[k].to_from_from.m[i / 4][i % 4]));
  locate(&calibration);
  return 0;
}
