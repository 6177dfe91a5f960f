// Inside of the gel film.
#ifndef SONDE_SRC_GEL_H
#define SONDE_SRC_GEL_H

#include "sonde/haptics_gel.h"

struct sonde_gel {
  sonde_gel_def def;
  const sonde_model *model;
  double *film_m;    // [nodes]
  double *moisture;  // [nodes] 1 under a film, then fading
  double *change_m3; // [nodes] scratch of a step
  double *edge_m;    // [edges] length at rest
};

#endif
