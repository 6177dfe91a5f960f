// Data sets as HDF5 files, where libhdf5 was there when the program was built.
#ifndef SONDE_APP_DATASET_HDF5_H
#define SONDE_APP_DATASET_HDF5_H

#include "app.h"

// A file for each leg: a dataset for each array, its first axis the frames; key and json beside
// them. NULL: the program was built without libhdf5.
const sonde_dataset_format *dataset_hdf5(void);

#endif
