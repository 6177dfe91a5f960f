// A snapshot from the world, and what the image plane cuts of the vessels.
#ifndef SONDE_SRC_EXAM_VESSELS_H
#define SONDE_SRC_EXAM_VESSELS_H

#include "sonde/exam.h"

// Tick, time, pose and contact of a world whose probe is at `pose`; NaN, or 0, where it takes more
// than the world to know. No allocation. @thread tick
sonde_snapshot sonde_snapshot_of(const sonde_state *state, sonde_pose pose);

// Whether a branch lies beside the main vein as its double, so that both must close. @thread any
bool sonde_vein_is_double(const char *branch);

// Vein, artery and the other veins in the image plane of the snapshot's pose; members without
// a vessel in view keep what they hold. No allocation. @thread of the interior's updates
void sonde_snapshot_read_vessels(const sonde_interior *interior, sonde_snapshot *snapshot);

#endif
