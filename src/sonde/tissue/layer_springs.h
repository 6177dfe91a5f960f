// Springs and law of a skin whose layers are known but which nobody has measured.
#ifndef SONDE_SRC_LAYER_SPRINGS_H
#define SONDE_SRC_LAYER_SPRINGS_H

#include "base/link.h"
#include "sonde/tissue.h"

// Stiffness (N/m^3) and asymptote (m) of the springs above layers of that thickness: layers in
// series, and an asymptote that is a share of the tissue's thickness (docs/anatomy_theory.md).
// `stiffness` 1: the bundled thigh's. Tissue counts as `least_m` thick at least. @thread any
SONDE_LINK void sonde_layer_springs(double fat_m, double muscle_m, double least_m, double stiffness,
                                    double *k0_n_m3, double *xm_m);
// The law of the surface layer that goes with these springs. @thread any
SONDE_LINK sonde_surface_law sonde_layered_law(double stiffness, double damping_s);

#endif
