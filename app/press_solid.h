// A probe pressed on the hyperelastic solid of a model's site: what `sonde press --solid` does.
#ifndef SONDE_APP_PRESS_SOLID_H
#define SONDE_APP_PRESS_SOLID_H

#include "sonde/sonde.h"

typedef struct press_solid {
  const char *model, *probe, *moduli; // moduli NULL: those of the study
  long site;
  double friction;         // coefficient between skin and probe
  double depth_m, force_n; // NaN: which of them is sought; both are found
  double reaction_n;       // |force on the probe|
  sonde_equilibrium_result result;
  sonde_vec3 *rest; // displacements of the nodes at rest while it is sought: 0
} press_solid;

// @return NOT_FOUND for a site that the model has not; CONVERGENCE where no depth up to 60 mm bears
// the force
sonde_status press_solid_find(press_solid *press, sonde_error *error);

#endif
