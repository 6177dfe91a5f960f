// Tracked frames in an HDF5 file as the TUS-REC data sets hold them.
#ifndef SONDE_APP_FRAMES_HDF5_H
#define SONDE_APP_FRAMES_HDF5_H

#include "app.h"
#include "sonde/sweep_frames.h"

// Reads "frames" [count][height][width], 8 bits, and "tforms" [count][4][4], mm, from the probe's
// tool to the tracker: ProbeToTracker of each frame. A frame whose matrix is not finite has no
// pose.
// @return IO, MEMORY, FORMAT with what was expected; also where the program lacks libhdf5
sonde_status frames_hdf5_load(const char *path, sonde_sequence *sequence, sonde_error *error);
#endif
