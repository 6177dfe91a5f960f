// Image files (MetaImage or NRRD): any bytes are either a sound sequence or volume, or an error.
// The first byte chooses: even a sequence, which is located, sliced and made a volume; odd a
// volume, which is sliced.
#include "fuzz.h"

enum { WIDTH = 24, HEIGHT = 16 };

static const sonde_affine PLANE = {{{1e-3, 0, 0, 0}, {0, 1e-3, 0, 0}, {0, 0, 1e-3, 1e-3}}};

static void use_sequence(const sonde_sequence *s) {
  sonde_slicer_options options = sonde_slicer_options_default();
  sonde_reconstruct_options grid = sonde_reconstruct_options_default();
  sonde_reconstruct_report report;
  sonde_slicer *slicer = NULL;
  sonde_volume volume = {0};
  sonde_image image = {0};
  sonde_error error = {SONDE_OK, "", ""};
  options.threads = 1;
  grid.most_voxels = 1 << 15;
  FUZZ_CHECK(sonde_image_create(WIDTH, HEIGHT, &image, &error) == SONDE_OK);
  if (sonde_slicer_create(s, &options, &slicer, &error) == SONDE_OK)
    FUZZ_CHECK(sonde_slicer_render(slicer, &PLANE, &image, NULL) <= WIDTH * HEIGHT);
  sonde_slicer_destroy(slicer);
  sonde_status status = sonde_reconstruct(s, &grid, &volume, &report, NULL, &error);
  if (status) FUZZ_CHECK(error.status == status && error.message[0]);
  sonde_volume_clear(&volume);
  sonde_image_clear(&image);
}

static void read_sequence(const char *path) {
  sonde_sequence s;
  sonde_located located;
  sonde_error error = {SONDE_OK, "", ""};
  if (!fuzz_checked(sonde_sequence_load(path, &s, &error), &error)) return;
  uint64_t sum = 0;
  for (size_t i = 0; i < (size_t)s.width * s.height * s.count; ++i) sum += s.pixels[i];
  FUZZ_CHECK(sum <= 255ull * s.width * s.height * s.count);
  sonde_status status = sonde_sequence_locate(&s, NULL, NULL, &located, &error);
  if (status) {
    FUZZ_CHECK(error.status == status && error.message[0]);
  } else {
    FUZZ_CHECK(located.used > 0 && located.used <= s.count);
    if ((size_t)s.width * s.height * s.count < 1 << 16) use_sequence(&s);
  }
  sonde_sequence_clear(&s);
}

static void read_volume(const char *path) {
  sonde_volume v;
  sonde_image image;
  sonde_error error = {SONDE_OK, "", ""};
  if (!fuzz_checked(sonde_volume_load(path, &v, &error), &error)) return;
  FUZZ_CHECK(v.size[0] > 0 && v.size[1] > 0 && v.size[2] > 0);
  FUZZ_CHECK(sonde_image_create(WIDTH, HEIGHT, &image, &error) == SONDE_OK);
  FUZZ_CHECK(sonde_volume_slice(&v, false, &PLANE, &image, NULL) <= WIDTH * HEIGHT);
  sonde_image_clear(&image);
  sonde_volume_clear(&v);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t count) {
  if (count < 1) return 0;
  const char *path = fuzz_file("frames.mha", bytes + 1, count - 1);
  if (bytes[0] % 2)
    read_volume(path);
  else
    read_sequence(path);
  return 0;
}
