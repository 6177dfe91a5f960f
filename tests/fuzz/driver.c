// Plain driver of a fuzz target: runs every file of the corpus directories, and of each a fixed
// number of variants with bytes changed, cut off, repeated or replaced by words of the same file.
// The variants are the same every time. The reader must accept every file that no variant changed.
// usage: PROGRAM VARIANTS DIRECTORY...
#include "fuzz.h"

#include "base/random.h"

#include <dirent.h>

enum { INPUT_MAX = 1 << 18 };

static uint64_t draws;
static uint64_t draw(uint64_t below) { return sonde_random_bits(2026, draws++) % below; }

// Writes an extreme number or a bracket over the bytes at a place.
static void put_word(uint8_t *bytes, size_t count) {
  static const char *const WORDS[] = {
      "1e308", "-1",   "0",     "1e-9", "nan", "999999999",       "[[[[",
      "{}",    "\"\"", "---\n", "-0.5", "inf", "\xff\xff\xff\x7f"};
  const char *word = WORDS[draw(sizeof WORDS / sizeof WORDS[0])];
  size_t length = strlen(word), at = draw(count);
  memcpy(bytes + at, word, length < count - at ? length : count - at);
}

// Changes a copy of the input in place; returns its new length.
static size_t vary(uint8_t *bytes, size_t count) {
  for (uint64_t k = 1 + draw(4); k > 0 && count > 0; --k) switch (draw(8)) {
    case 0: bytes[draw(count)] = (uint8_t)draw(256); break;
    case 1: bytes[draw(count)] ^= (uint8_t)(1u << draw(8)); break;
    case 2: bytes[draw(count)] = (uint8_t) "0-9.,eE\n \"nxif+"[draw(15)]; break;
    case 3: count = draw(8) ? count : draw(count + 1); break;
    case 4: put_word(bytes, count); break;
    default: { // move a piece over another
      size_t from = draw(count), to = draw(count);
      size_t length = draw(32), room = count - (from > to ? from : to);
      memmove(bytes + to, bytes + from, length < room ? length : room);
    }
    }
  return count;
}

// Returns 1 when the file was read and accepted.
static int run_file(const char *path, long variants) {
  static uint8_t input[INPUT_MAX], copy[INPUT_MAX];
  FILE *stream = fopen(path, "rb");
  if (!stream) return 0;
  size_t count = fread(input, 1, sizeof input, stream);
  bool whole = fgetc(stream) == EOF;
  fclose(stream);
  if (!whole) fprintf(stderr, "%s: has more than %d bytes\n", path, INPUT_MAX);
  fuzz_accepted = false;
  fuzz_is_seed = true;
  LLVMFuzzerTestOneInput(input, count);
  fuzz_is_seed = false;
  bool accepted = fuzz_accepted && whole;
  if (!accepted) fprintf(stderr, "%s: the reader refuses this seed\n", path);
  for (long v = 0; v < variants; ++v) {
    memcpy(copy, input, count);
    size_t length = vary(copy, count);
    LLVMFuzzerTestOneInput(copy, length);
  }
  return accepted;
}

int main(int argc, char **argv) {
  int files = 0, accepted = 0;
  long variants = argc > 1 ? strtol(argv[1], NULL, 10) : 0;
  for (int i = 2; i < argc; ++i) {
    struct dirent **entries = NULL;
    int n = scandir(argv[i], &entries, NULL, alphasort);
    for (int k = 0; k < n; ++k) {
      char path[1024];
      snprintf(path, sizeof path, "%s/%s", argv[i], entries[k]->d_name);
      if (entries[k]->d_name[0] != '.') ++files, accepted += run_file(path, variants);
      free(entries[k]);
    }
    free(entries);
  }
  printf("%d files, %d accepted, %ld variants of each\n", files, accepted, variants);
  return files == 0 || accepted < files;
}
