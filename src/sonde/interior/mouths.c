// Mouths of branches. A mouth is the row of sections at a branch's end whose lumen is one with the
// lumen of the vein that the branch opens into.
#include "base/base.h"
#include "interior/interior.h"

// A mouth reaches this many diameters of the branch beyond the place where the two walls part: the
// hole in the vein's wall shapes the branch's lumen that far.
static const double mouth_diameters = 1;

// Finds the section of a vein that is nearest to a point at rest. *apart_m is the distance between
// the point and the vein's line; beyond the line's ends it is the distance to the last section.
static uint32_t nearest_section(const sonde_interior *in, uint32_t vein, sonde_vec3 rest_m,
                                double *apart_m) {
  uint32_t nearest = 0;
  double least = INFINITY;
  for (uint32_t i = 0; i < in->course[vein].count; ++i) {
    const double distance = v_distance(in->section[vein][i].rest_m, rest_m);
    if (distance < least) least = distance, nearest = i;
  }
  *apart_m = INFINITY;
  if (!isfinite(least)) return 0;
  const sonde_vessel_section *section = &in->section[vein][nearest];
  sonde_vec3 d = v_sub(rest_m, section->rest_m);
  const bool last = nearest == 0 || nearest + 1 == in->course[vein].count;
  *apart_m = last ? least : v_norm(v_madd(d, -v_dot(d, section->axis), section->axis));
  return nearest;
}

// A mouth begins at an end of the branch that lies in an earlier vein, and ends a diameter beyond
// the place where the two walls have parted. A branch of the two-layer thigh may begin beside its
// vein, since sections that do not advance along a course are left out; such a branch has a mouth
// when its first section still touches the vein's wall.
void sonde_sections_find_mouths(sonde_interior *in, uint32_t branch) {
  const uint32_t count = in->course[branch].count;
  SONDE_ASSERT(branch < in->vessel_count);
  if (in->course[branch].kind != SONDE_VESSEL_VEIN) return;
  for (int end = 0; end < 2 && count > 1; ++end) {
    sonde_vessel_section *section = in->section[branch];
    uint32_t into = SONDE_VESSELS;
    double least = 0, beyond_m = 0;
    for (uint32_t n = 0; n < count; ++n) {
      const uint32_t i = end ? count - 1 - n : n;
      const double radius_m = section[i].radius_m;
      for (uint32_t vein = 0; vein < branch && n == 0; ++vein) {
        double apart_m;
        const uint32_t at = nearest_section(in, vein, section[i].rest_m, &apart_m);
        if (in->course[vein].kind != SONDE_VESSEL_VEIN || in->course[vein].count < 2) continue;
        const double gap_m = apart_m - in->section[vein][at].radius_m - radius_m;
        if (gap_m < least) least = gap_m, into = vein;
      }
      if (into == SONDE_VESSELS) break;
      double apart_m;
      const uint32_t at = nearest_section(in, into, section[i].rest_m, &apart_m);
      if (n > 0 && (beyond_m > 0 || apart_m > in->section[into][at].radius_m + radius_m))
        beyond_m += v_distance(section[i].rest_m, section[end ? i + 1 : i - 1].rest_m);
      section[i].opens_into = into, section[i].opens_at = at;
      if (beyond_m > mouth_diameters * 2 * radius_m) break; // the whole piece in which it ends
    }
  }
}
