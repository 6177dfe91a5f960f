// Plain driver of a fuzz target: runs every file of the corpus directories, and of each a fixed
// number of variants with bytes changed, cut off or repeated. The variants are the same every time.
// usage: PROGRAM VARIANTS DIRECTORY...
#include "fuzz.h"

#include "base/random.h"

#include <dirent.h>

enum { INPUT_MAX = 1 << 16 };

static uint64_t draws;
static uint64_t draw(uint64_t below) { return sonde_random_bits(2026, draws++) % below; }

// Changes a copy of the input in place; returns its new length.
static size_t vary(uint8_t *bytes, size_t count) {
  for (uint64_t k = 1 + draw(4); k > 0 && count > 0; --k) switch (draw(6)) {
    case 0: bytes[draw(count)] = (uint8_t)draw(256); break;
    case 1: bytes[draw(count)] ^= (uint8_t)(1u << draw(8)); break;
    case 2: bytes[draw(count)] = (uint8_t) "0-9.,eE\n \"nxif+"[draw(15)]; break;
    case 3: count = draw(count + 1); break;
    default: { // move a piece over another
      size_t from = draw(count), to = draw(count);
      size_t length = draw(32), room = count - (from > to ? from : to);
      memmove(bytes + to, bytes + from, length < room ? length : room);
    }
    }
  return count;
}

static size_t run_file(const char *path, long variants) {
  static uint8_t input[INPUT_MAX], copy[INPUT_MAX];
  FILE *stream = fopen(path, "rb");
  if (!stream) return 0;
  size_t count = fread(input, 1, sizeof input, stream);
  fclose(stream);
  LLVMFuzzerTestOneInput(input, count);
  for (long v = 0; v < variants; ++v) {
    memcpy(copy, input, count);
    size_t length = vary(copy, count);
    LLVMFuzzerTestOneInput(copy, length);
  }
  return 1;
}

int main(int argc, char **argv) {
  size_t files = 0;
  long variants = argc > 1 ? strtol(argv[1], NULL, 10) : 0;
  for (int i = 2; i < argc; ++i) {
    struct dirent **entries = NULL;
    int n = scandir(argv[i], &entries, NULL, alphasort);
    for (int k = 0; k < n; ++k) {
      char path[1024];
      snprintf(path, sizeof path, "%s/%s", argv[i], entries[k]->d_name);
      if (entries[k]->d_name[0] != '.') files += run_file(path, variants);
      free(entries[k]);
    }
    free(entries);
  }
  printf("%zu files, %ld variants of each\n", files, variants);
  return files == 0;
}
