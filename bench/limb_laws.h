// Laws of a limb as counts: places of vessels that keep no distance, views of an examination with
// the order and the depths that they must show (docs/limb_vessels.md). Used by bench_limb and by
// the tests of the room limb.
#ifndef SONDE_BENCH_LIMB_LAWS_H
#define SONDE_BENCH_LIMB_LAWS_H

#include "sonde/limb_vessels.h"

enum { LIMB_VIEWS = 11 };

// A view of one limb. Depths are from the skin to the front wall along the beam, mm.
typedef struct limb_view {
  const char *missing; // the first condition that does not hold; NULL: the view is true
  double depth_mm;     // of the structure that the view is named for; NaN: not seen
  double band_mm[2];   // of this depth at the limb's body mass index
} limb_view;

// Pictures every view of a limb: its probe slides up to 8 mm (V3, V4: as far as the view says) and
// tilts up to 15 degrees until all conditions hold in one plane.
void limb_views(const sonde_limb *limb, limb_view view[LIMB_VIEWS]);

// Volume of what is labelled as muscle against the muscles' rule, for those whose largest section
// is in the thigh or in the calf; without gluteus and iliopsoas, which end outside of the limb.
// Fascia, septa and the loose tissue between muscles have labels of their own and do not count.
void limb_muscle_ratio(const sonde_limb *limb, double ratio[2]);

// Depth of the front wall of the common femoral vein below the skin by body mass, mm.
double limb_vein_depth_mm(double bmi);

#endif
