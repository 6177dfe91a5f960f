// Monotone cubic through knots.
#include "limb/knots.h"

#include "base/maths.h"

double limb_through(const double *knots, uint32_t count, uint32_t columns, uint32_t column,
                    double x) {
  SONDE_ASSERT(count >= 2 && column > 0 && column < columns);
#define AT(i) knots[(size_t)(i)*columns]
#define OF(i) knots[(size_t)(i)*columns + column]
  if (x <= AT(0)) return OF(0);
  if (x >= AT(count - 1)) return OF(count - 1);
  uint32_t k = 0;
  while (AT(k + 1) < x) ++k;
  double h = AT(k + 1) - AT(k), u = (x - AT(k)) / h, rise = (OF(k + 1) - OF(k)) / h;
  double tangent[2];
  for (uint32_t end = 0; end < 2; ++end) {
    bool inner = end ? k + 2 < count : k > 0;
    double beyond = rise, width = h;
    if (inner) {
      uint32_t other = end ? k + 1 : k - 1;
      width = AT(other + 1) - AT(other), beyond = (OF(other + 1) - OF(other)) / width;
    }
    // A knot higher or lower than both neighbours gets a level tangent; else the parabola's, at
    // most three times the smaller slope (Fritsch and Carlson 1980).
    double slope = (beyond * h + rise * width) / (h + width);
    double most = 3 * fmin(fabs(beyond), fabs(rise));
    tangent[end] = beyond * rise <= 0 ? 0 : clamp(slope, -most, most);
  }
  double v = 1 - u;
  return OF(k) * v * v * (1 + 2 * u) + OF(k + 1) * u * u * (3 - 2 * u) +
         h * u * v * (tangent[0] * v - tangent[1] * u);
#undef AT
#undef OF
}
