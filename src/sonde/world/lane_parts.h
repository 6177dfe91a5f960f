// The kernels of sonde_lane_kernels over all parts of a body, on its one or two threads: the same
// bits on both. @thread tick
#ifndef SONDE_SRC_LANE_PARTS_H
#define SONDE_SRC_LANE_PARTS_H

#include "world/lanes.h"

sonde_lane_sums sonde_parts_linearise(sonde_lanes *lanes, bool sweep);
sonde_lane_sums sonde_parts_sweep(sonde_lanes *lanes);
sonde_lane_sums sonde_parts_restart(sonde_lanes *lanes);
double sonde_parts_multiply(sonde_lanes *lanes, bool first);
sonde_lane_sums sonde_parts_advance(sonde_lanes *lanes, bool first, float alpha, float beta);
double sonde_parts_bend(sonde_lanes *lanes);
void sonde_parts_accept(sonde_lanes *lanes);
double sonde_parts_update(sonde_lanes *lanes);

#endif
