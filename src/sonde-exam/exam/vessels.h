// What the image plane cuts of the vessels, for whoever fills a snapshot.
#ifndef SONDE_SRC_EXAM_VESSELS_H
#define SONDE_SRC_EXAM_VESSELS_H

#include "sonde/exam.h"

// Whether a branch lies beside the main vein as its double, so that both must close. @thread any
bool sonde_vein_is_double(const char *branch);

// Vein, artery and the other veins in the image plane of the snapshot's pose; members without
// a vessel in view keep what they hold. No allocation. @thread of the interior's updates
void sonde_snapshot_read_vessels(const sonde_interior *interior, sonde_snapshot *snapshot);

#endif
