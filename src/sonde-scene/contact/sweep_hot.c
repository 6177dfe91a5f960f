// Which boxes overlap: sorted by their lower x, each is compared with those that begin before it
// ends. The last order is nearly right, so that insertion sorts it in linear time.
#include "contact/tree.h"

uint32_t sonde_sweep_pairs(sonde_sweep *sweep, const sonde_bounds *boxes, uint32_t count,
                           uint32_t (*pairs)[2], uint32_t capacity, uint64_t *work) {
  SONDE_ASSERT(sweep != NULL && count <= sweep->capacity);
  // The boxes are sorted by their lower x, equal ones by index.
  uint64_t tests = 0;
  if (count != sweep->count)
    for (uint32_t k = 0; k < count; ++k) sweep->order[k] = k;
  sweep->count = count;
  for (uint32_t k = 1; k < count; ++k) {
    uint32_t box = sweep->order[k], at = k;
    for (; at > 0; --at, ++tests) {
      uint32_t other = sweep->order[at - 1];
      double x = boxes[box].low.x, y = boxes[other].low.x;
      if (y < x || (y == x && other < box)) break;
      sweep->order[at] = other;
    }
    sweep->order[at] = box;
  }
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
  // The pairs are sorted by their first, then by their second index.
  uint32_t written = found < capacity ? found : capacity;
  for (uint32_t gap = written / 2; gap > 0; gap /= 2)
    for (uint32_t k = gap; k < written; ++k) {
      uint32_t first = pairs[k][0], second = pairs[k][1], at = k;
      for (; at >= gap; at -= gap) {
        const uint32_t *other = pairs[at - gap];
        if (other[0] != first ? other[0] < first : other[1] <= second) break;
        pairs[at][0] = other[0];
        pairs[at][1] = other[1];
      }
      pairs[at][0] = first;
      pairs[at][1] = second;
    }
  if (work) *work += tests;
  return found;
}
