// A map from 64-bit keys to numbers, by open addressing. A key is not UINT64_MAX.
#ifndef SONDE_SRC_INDEX_MAP_H
#define SONDE_SRC_INDEX_MAP_H

#include "base/base.h"
#include "base/random.h"

typedef struct sonde_index_map {
  uint64_t *key;
  uint32_t *value;
  size_t room; // a power of two
  uint32_t count;
} sonde_index_map;

static inline void sonde_index_map_clear(sonde_index_map *map) {
  sonde_free(map->key);
  sonde_free(map->value);
  *map = (sonde_index_map){0};
}

// Place of a key, or the free one that it would take. Keys are stored one higher: 0 is free.
static inline size_t sonde_index_map_place(const sonde_index_map *map, uint64_t key) {
  size_t at = (size_t)sonde_random_mix(key) & (map->room - 1);
  while (map->key[at] != 0 && map->key[at] != key + 1) at = (at + 1) & (map->room - 1);
  return at;
}

// Number of a key; UINT32_MAX when it is not there.
static inline uint32_t sonde_index_map_find(const sonde_index_map *map, uint64_t key) {
  if (map->room == 0) return UINT32_MAX;
  size_t at = sonde_index_map_place(map, key);
  return map->key[at] ? map->value[at] : UINT32_MAX;
}

// Where the number of a key stands; *added tells whether the key is new. NULL: out of memory.
static inline uint32_t *sonde_index_map_add(sonde_index_map *map, uint64_t key, bool *added) {
  SONDE_ASSERT(key != UINT64_MAX);
  if (2 * (size_t)map->count >= map->room) {
    sonde_index_map more = {.room = map->room ? 2 * map->room : 1024, .count = map->count};
    more.key = SONDE_NEW(uint64_t, more.room);
    more.value = SONDE_NEW(uint32_t, more.room);
    if (!more.key || !more.value) {
      sonde_index_map_clear(&more);
      return NULL;
    }
    for (size_t k = 0; k < map->room; ++k) {
      if (map->key[k] == 0) continue;
      size_t at = sonde_index_map_place(&more, map->key[k] - 1);
      more.key[at] = map->key[k], more.value[at] = map->value[k];
    }
    sonde_index_map_clear(map);
    *map = more;
  }
  size_t at = sonde_index_map_place(map, key);
  *added = map->key[at] == 0;
  if (*added) map->key[at] = key + 1, map->value[at] = 0, ++map->count;
  return &map->value[at];
}

#endif
