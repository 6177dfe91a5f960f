// Outlines of equal values in a square raster.
#ifndef SONDE_SRC_LIMB_TRACE_H
#define SONDE_SRC_LIMB_TRACE_H

#include "base/base.h"

typedef struct limb_raster {
  uint32_t size;   // pixels along a side; the border has the value 0
  uint16_t *value; // [size][size]
  uint8_t *done;   // [size][size], zero before the first outline of a value
} limb_raster;

// The next outer outline of a value, smoothed, in pixels; its corners, 0 when there is no further
// one. Outlines round holes are left out. @param xy [room][2]
uint32_t limb_trace(limb_raster *raster, uint16_t value, double (*xy)[2], uint32_t room,
                    uint32_t *start);

#endif
