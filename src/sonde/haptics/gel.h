// Inside of the gel film.
#ifndef SONDE_SRC_GEL_H
#define SONDE_SRC_GEL_H

#include "base/link.h"
#include "sonde/haptics_gel.h"

struct sonde_gel {
  sonde_gel_def def;
  const sonde_model *model;
  double *film_m;    // [nodes]
  double *moisture;  // [nodes] 1 under a film, then fading
  double *change_m3; // [nodes] scratch of a step
  double *push_pa;   // [nodes] scratch of a step: pressure of the probe
  double *drag;      // [edges] flow (m^3/s) per film^3 and pressure difference
  double *half_m;    // [edges] half the edge's width over its length
  uint32_t *near;    // [nodes] scratch of a coupling
};

// One of the parts of sonde_gel_step(), to be taken in turn: what a tick can afford. The probe's
// pressure is that of the first part. @thread tick
SONDE_LINK void sonde_gel_part(sonde_gel *gel, const sonde_vec3 *contact_n, sonde_vec3 probe_m_s,
                               double dt_s, uint32_t part, uint32_t parts);
// sonde_gel_coupling() with another film [nodes] and scratch [nodes] of the caller.
SONDE_LINK void sonde_gel_coupling_of(const sonde_gel *gel, const double *film_m, uint32_t *near,
                                      const sonde_vec3 *skin_m, const sonde_vec3 *contact_n,
                                      const sonde_vec3 *point_m, uint32_t count, float *share);

// Volume on the skin, m^3. @thread tick
double sonde_gel_volume(const sonde_gel *gel);

#endif
