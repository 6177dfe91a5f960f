// A probe settled on a model: what `sonde press`, `sonde image`, `sonde slice --press` and the
// image's benchmark look at.
#ifndef SONDE_APP_SETTLED_H
#define SONDE_APP_SETTLED_H

#include "sonde/sonde.h"

typedef struct settled {
  sonde_model *model;
  sonde_state *state;
  sonde_probe probe;
  sonde_interior *interior;
  sonde_pose pose; // world_from_probe
  double depth_m;  // along the beam from where the press began
  double force_n;  // along the beam, onto the skin
  sonde_settle_result result;
  uint32_t iterations; // of all settling
} settled;

// preset: of damping and friction; NULL: none
sonde_status settled_open(settled *s, const char *model, const char *probe,
                          const sonde_preset *preset, sonde_error *error);
void settled_close(settled *s);
// A site of the model, and the pose at rest there. @return SONDE_NOT_FOUND naming the model's file
sonde_status settled_site(const settled *s, const char *model, long number, sonde_pose *above,
                          sonde_error *error);
// Where a pose's beam meets the rest skin, the pose moved there; false when it misses.
bool settled_on_skin(const settled *s, sonde_pose *pose);
// Settles with the face `depth_m` along the beam from `start`, coming from the last settled state.
void settled_at(settled *s, sonde_pose start, double depth_m, double residual);
// Presses along the beam from `start` on the skin until the settled force is force_n, to 1e-4;
// shows progress. @return SONDE_CONVERGENCE when it is not met, CANCELLED
sonde_status settled_force(settled *s, sonde_pose start, double force_n, sonde_error *error);
// The interior at the settled state.
void settled_update(const settled *s, const sonde_pathology *pathology, uint64_t tick);
sonde_pose settled_advance(sonde_pose pose, double along_beam_m);

#endif
