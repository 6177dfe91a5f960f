// Image files: any bytes are either a sound sequence or volume, or an error.
// The first byte chooses: even a sequence, odd a volume.
#include "fuzz.h"

static void read_sequence(const char *path) {
  sonde_sequence s;
  sonde_error error = {SONDE_OK, "", ""};
  sonde_status status = sonde_sequence_load(path, &s, &error);
  if (status) {
    fuzz_check_error(status, &error);
    return;
  }
  uint64_t sum = 0;
  for (size_t i = 0; i < (size_t)s.width * s.height * s.count; ++i) sum += s.pixels[i];
  FUZZ_CHECK(sum <= 255ull * s.width * s.height * s.count);
  sonde_located located;
  status = sonde_sequence_locate(&s, NULL, NULL, &located, &error);
  if (status)
    fuzz_check_error(status, &error);
  else
    FUZZ_CHECK(located.used > 0 && located.used <= s.count);
  sonde_sequence_clear(&s);
}

static void read_volume(const char *path) {
  sonde_volume v;
  sonde_error error = {SONDE_OK, "", ""};
  sonde_status status = sonde_volume_load(path, &v, &error);
  if (status) {
    fuzz_check_error(status, &error);
    return;
  }
  FUZZ_CHECK(v.size[0] > 0 && v.size[1] > 0 && v.size[2] > 0);
  sonde_volume_clear(&v);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  if (count < 1) return 0;
  const char *path = fuzz_file("mha", bytes + 1, count - 1);
  if (bytes[0] % 2)
    read_volume(path);
  else
    read_sequence(path);
  unlink(path);
  return 0;
}
