/**
 * @file anatomy_limb.h
 * From scanned surfaces of a leg to the body of a limb (sonde/limb.h): lengths, girths, fat and
 * bones that the scan shows. docs/limb_scan.md.
 */
#ifndef SONDE_ANATOMY_LIMB_H
#define SONDE_ANATOMY_LIMB_H

#include "sonde/anatomy.h"
#include "sonde/limb.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SONDE_LEG_GIRTHS = 300 };

/** Girths of a scanned leg at the levels of a limb, from above downwards. */
typedef struct sonde_leg_girths {
  uint32_t count;
  double level[SONDE_LEG_GIRTHS], girth_m[SONDE_LEG_GIRTHS];
} sonde_leg_girths;

/**
 * Measures a limb's body on a scan. With a femur the limb runs from the centre of the femoral head,
 * a sphere fitted to it, through the middle of the condyles. Without one the scan must be a leg
 * from the groin (level 0.05) to below the ankle: its least girth is that of the ankle
 * (level 1.866), the largest above it that of the calf (level 1.28), and knee and hip follow.
 * @param scan vessels and `length_m` are not looked at; @c left is the side of the body
 * @param seed of what will be drawn: stature and BMI, where they are not known, become those from
 * which the rules draw this seed's thigh as long and as thick
 * @param[in,out] body members that are NaN are set where the scan shows them within their range:
 * lengths, four girths; with `muscle` fat at eight places (below a skin of 1.8 mm where its
 * thickness is not known); with `femur` head, shaft and condyles. The others stay; the side becomes
 * the scan's
 * @param[out] girths every 5 mm, for sonde_leg_compare()
 * @return MESH when the femur is none (sonde_thigh_shape_scan()) or the skin shows no calf and
 * ankle; ARGUMENT when neither femur nor axes are known
 * @thread owner
 */
SONDE_API sonde_status sonde_leg_scan_body(const sonde_leg_scan *scan, uint64_t seed,
                                           sonde_limb_body *body, sonde_leg_girths *girths,
                                           sonde_error *error);

/** Root mean square of the logarithm of a limb's girths over the scan's, from level 0.12 to 1.9.
 * @thread any */
SONDE_API double sonde_leg_compare(const sonde_leg_girths *girths, const sonde_limb *limb);

#ifdef __cplusplus
}
#endif

#endif
