// Clots in the lumen: which points they fill, what area they leave open (docs/limb_vessels.md).
//
// In a section of radius 1 a mural clot is the part of the disc beyond a chord, a floating one a
// disc in the middle, a recanalised one all but a disc that touches the upper wall at a tenth of
// the radius.
#include "limb/vessels_graph.h"

sonde_status sonde_limb_clot_check(const sonde_limb *limb, const sonde_limb_clot *clot,
                                   sonde_error *error) {
  SONDE_ASSERT(limb && clot);
  if (clot->vessel >= limb->vessels->branches)
    return sonde_fail(error, SONDE_ARGUMENT, "clot in vessel %u, expected 0 to %u", clot->vessel,
                      limb->vessels->branches - 1);
  const char *name = limb->vessels->branch[clot->vessel].name;
  double length = limb_branch_length(limb->vessels, clot->vessel);
  if (!(clot->from_m >= 0 && clot->from_m < clot->to_m && clot->to_m <= length + 1e-9))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "clot from %.1f to %.1f mm in the %s, expected a stretch of 0 to %.1f mm",
                      clot->from_m * 1e3, clot->to_m * 1e3, name, length * 1e3);
  if ((unsigned)clot->kind > SONDE_LIMB_CLOT_RECANALISED)
    return sonde_fail(error, SONDE_ARGUMENT, "clot of kind %d, expected 0 to %d", (int)clot->kind,
                      SONDE_LIMB_CLOT_RECANALISED);
  if (!(clot->share > 0 && clot->share <= 1) ||
      (clot->kind == SONDE_LIMB_CLOT_OCCLUSIVE && clot->share < 1))
    return sonde_fail(
        error, SONDE_ARGUMENT,
        "clot fills %g of the %s, expected more than 0 and up to 1, an occlusive one 1",
        clot->share, name);
  if (!(clot->age_days >= 0))
    return sonde_fail(error, SONDE_ARGUMENT, "clot is %g days old, expected 0 or more",
                      clot->age_days);
  return SONDE_OK;
}

// Share of the section that a clot fills at an arc: its ends are rounded over 1.5 radii, the tail
// of a floating clot not.
static double share_at(const sonde_limb_clot *clot, double arc, double radius) {
  if (arc < clot->from_m || arc > clot->to_m) return 0;
  double reach = fmin(1.5 * radius, 0.5 * (clot->to_m - clot->from_m));
  double tail = clot->kind == SONDE_LIMB_CLOT_FLOATING ? 1 : fmin(1, (clot->to_m - arc) / reach);
  double near = fmin(fmin(1, (arc - clot->from_m) / reach), tail);
  return clot->share * near * (2 - near); // area of a spheroid's sections
}

double sonde_limb_clot_open(const sonde_limb *limb, const sonde_limb_clot *clot, double arc_m) {
  sonde_limb_vessel_point p = sonde_limb_vessel_place(limb, clot->vessel, arc_m);
  return p.area_m2 * (1 - share_at(clot, arc_m, p.radius_m));
}

uint32_t sonde_limb_clot_at(const sonde_limb *limb, const sonde_limb_clot *clots, uint32_t count,
                            sonde_vec3 point_m) {
  SONDE_ASSERT(limb && (clots || count == 0));
  sonde_limb_vessel_near near = sonde_limb_vessel_at(limb, point_m);
  if (near.lumen_m > 0) return count;
  for (uint32_t k = 0; k < count; ++k) {
    if (clots[k].vessel != near.vessel) continue;
    sonde_limb_vessel_point p = sonde_limb_vessel_place(limb, near.vessel, near.arc_m);
    double share = share_at(&clots[k], near.arc_m, p.radius_m);
    if (share <= 0) continue;
    // Place in the section: up is the front, as far as it lies across the vessel.
    sonde_vec3 off = v_scale(v_sub(point_m, p.centre_m), 1 / p.radius_m);
    sonde_vec3 front = vec3(0, 1, 0),
               up = v_unit(v_madd(front, -v_dot(front, p.direction), p.direction), front);
    double r = sqrt(v_norm2(off)), high = v_dot(off, up), channel = sqrt(1 - share),
           raise = fmax(0.9 - channel, 0);
    // Whether the disc below the point's height has less than the clot's share of the area.
    double h = clamp(high, -1, 1), below = (acos(-h) + h * sqrt(1 - h * h)) / SONDE_PI;
    bool filled = clots[k].kind == SONDE_LIMB_CLOT_MURAL      ? below < share
                  : clots[k].kind == SONDE_LIMB_CLOT_FLOATING ? r < sqrt(share)
                  : clots[k].kind == SONDE_LIMB_CLOT_OCCLUSIVE
                      ? r < sqrt(share) || share >= 1
                      : v_norm(v_madd(off, -raise, up)) > channel;
    if (filled) return k;
  }
  return count;
}
