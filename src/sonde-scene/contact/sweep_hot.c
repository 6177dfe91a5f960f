// Which boxes overlap: sorted by their lower x, each is compared with those that begin before it
// ends. The last order is nearly right, so that insertion sorts it in linear time.
//
//   sort          boxes by lower x, equal ones by index
//   sort_pairs    the pairs by their first, then second index
#include "contact/sweep.h"

static uint64_t sort(sonde_sweep *sweep, const sonde_bounds *boxes, uint32_t count) {
  uint64_t moves = 0;
  if (count != sweep->count)
    for (uint32_t k = 0; k < count; ++k) sweep->order[k] = k;
  sweep->count = count;
  for (uint32_t k = 1; k < count; ++k) {
    uint32_t box = sweep->order[k], at = k;
    for (; at > 0; --at, ++moves) {
      uint32_t other = sweep->order[at - 1];
      double x = boxes[box].low.x, y = boxes[other].low.x;
      if (y < x || (y == x && other < box)) break;
      sweep->order[at] = other;
    }
    sweep->order[at] = box;
  }
  return moves;
}

static bool before(const uint32_t a[2], const uint32_t b[2]) {
  return a[0] != b[0] ? a[0] < b[0] : a[1] < b[1];
}

static void sort_pairs(uint32_t (*pairs)[2], uint32_t count) {
  for (uint32_t gap = count / 2; gap > 0; gap /= 2)
    for (uint32_t k = gap; k < count; ++k) {
      uint32_t pair[2] = {pairs[k][0], pairs[k][1]}, at = k;
      for (; at >= gap && before(pair, pairs[at - gap]); at -= gap) {
        pairs[at][0] = pairs[at - gap][0];
        pairs[at][1] = pairs[at - gap][1];
      }
      pairs[at][0] = pair[0];
      pairs[at][1] = pair[1];
    }
}

uint32_t sonde_sweep_pairs(sonde_sweep *sweep, const sonde_bounds *boxes, uint32_t count,
                           uint32_t (*pairs)[2], uint32_t capacity, uint64_t *work) {
  SONDE_ASSERT(sweep != NULL && count <= sweep->capacity);
  uint64_t tests = sort(sweep, boxes, count);
  uint32_t found = 0;
  for (uint32_t k = 0; k < count; ++k) {
    uint32_t a = sweep->order[k];
    for (uint32_t l = k + 1; l < count; ++l) {
      uint32_t b = sweep->order[l];
      ++tests;
      if (boxes[b].low.x > boxes[a].high.x) break;
      if (!bounds_meet(&boxes[a], &boxes[b], 0)) continue;
      if (found < capacity) {
        pairs[found][0] = a < b ? a : b;
        pairs[found][1] = a < b ? b : a;
      }
      ++found;
    }
  }
  sort_pairs(pairs, found < capacity ? found : capacity);
  if (work) *work += tests;
  return found;
}
