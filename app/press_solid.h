// A probe pressed on the hyperelastic solid of a model, and what it does to the inside: what
// `sonde press --solid` does.
#ifndef SONDE_APP_PRESS_SOLID_H
#define SONDE_APP_PRESS_SOLID_H

#include "settled.h"

typedef struct press_solid {
  const char *moduli;      // NULL: those of the study
  double friction;         // coefficient between skin and probe
  double depth_m, force_n; // NaN: which of them is sought
  sonde_equilibrium_result result;
  sonde_hexes mesh; // the tissue's
  sonde_vec3 *rest; // displacements of the nodes at rest while it is sought: 0
} press_solid;

// Presses the scene's probe from `start`, on the skin at rest; the scene receives pose, depth,
// force and tissue. @return CONVERGENCE where no depth up to 60 mm bears the force
sonde_status press_solid_find(press_solid *press, settled *scene, sonde_pose start,
                              sonde_error *error);
// After the scene is closed.
void press_solid_clear(press_solid *press);

#endif
