// Outlines of a raster: the boundary is followed along pixel edges with the value on its left, then
// smoothed.
#include "limb/trace.h"

#include "base/maths.h"

static bool inside(const limb_raster *r, int x, int y, uint16_t value) {
  int n = (int)r->size;
  return x >= 0 && y >= 0 && x < n && y < n && r->value[y * n + x] == value;
}

uint32_t limb_trace(limb_raster *r, uint16_t value, double (*xy)[2], uint32_t room,
                    uint32_t *start) {
  SONDE_ASSERT(r && xy && room >= 16 && value > 0);
  static const int STEP[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
  // Pixels to the left and to the right ahead of a corner, by the direction of travel.
  static const int LEFT[4][2] = {{0, -1}, {0, 0}, {-1, 0}, {-1, -1}};
  static const int RIGHT[4][2] = {{0, 0}, {-1, 0}, {-1, -1}, {0, -1}};
  uint32_t n = r->size;
  for (uint32_t at = *start; at < n * n; ++at) {
    // An upper edge that no outline has passed: travel with the pixel on the right.
    int x = (int)(at % n), y = (int)(at / n);
    if (!inside(r, x, y, value) || inside(r, x, y - 1, value) || r->done[at]) continue;
    uint32_t count = 0, direction = 0;
    int x0 = x, y0 = y;
    double twice = 0;
    do {
      if (direction == 0) r->done[(uint32_t)y * n + (uint32_t)x] = 1;
      int nx = x + STEP[direction][0], ny = y + STEP[direction][1];
      if (count < room) xy[count][0] = nx, xy[count][1] = ny;
      ++count;
      twice += (double)x * ny - (double)nx * y;
      x = nx, y = ny;
      bool left = inside(r, x + LEFT[direction][0], y + LEFT[direction][1], value);
      bool right = inside(r, x + RIGHT[direction][0], y + RIGHT[direction][1], value);
      if (left && right)
        direction = (direction + 3) % 4;
      else if (!right)
        direction = (direction + 1) % 4;
    } while ((x != x0 || y != y0 || direction != 0) && count < 8 * n * n);
    *start = at + 1;
    if (twice <= 0 || count < 8 || count > room) continue; // a hole, a speck
    // Each corner moves to the mean of its neighbourhood, four times.
    for (uint32_t pass = 0; pass < 4; ++pass)
      for (uint32_t axis = 0; axis < 2; ++axis) {
        double first = xy[0][axis], before = xy[count - 1][axis];
        for (uint32_t i = 0; i < count; ++i) {
          double here = xy[i][axis], after = i + 1 < count ? xy[i + 1][axis] : first;
          xy[i][axis] = 0.25 * before + 0.5 * here + 0.25 * after;
          before = here;
        }
      }
    return count;
  }
  return 0;
}
