// FNV-1a, 64 bits: the state hash of recordings and golden tests.
#include "base/base.h"

uint64_t sonde_hash(uint64_t seed, const void *bytes, size_t count) {
  SONDE_ASSERT(bytes || count == 0);
  const unsigned char *byte = bytes;
  uint64_t hash = seed ? seed : 0xcbf29ce484222325u;
  for (size_t i = 0; i < count; ++i) hash = (hash ^ byte[i]) * 0x100000001b3u;
  return hash;
}
