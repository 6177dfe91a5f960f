// Queries of the anatomy that a thigh model carries: branches, compartments, fascia, fibres.
#ifndef SONDE_SRC_TISSUE_ANATOMY_H
#define SONDE_SRC_TISSUE_ANATOMY_H

#include "base/link.h"
#include "sonde/tissue_anatomy.h"

// The branch of that name, NULL when absent. @thread any
SONDE_LINK const sonde_branch *sonde_anatomy_branch(const sonde_thigh_anatomy *anatomy,
                                                    const char *name);
// The compartment at a point of the muscle. @thread any
sonde_compartment sonde_anatomy_compartment(const sonde_thigh_anatomy *anatomy, sonde_vec3 rest_m);
// Thickness of the fascia lata above a point. @thread any
double sonde_anatomy_fascia(const sonde_thigh_anatomy *anatomy, sonde_vec3 rest_m);
// Unit direction of the muscle fibres there, towards the knee. @thread any
sonde_vec3 sonde_anatomy_fibre(const sonde_thigh_anatomy *anatomy, sonde_vec3 rest_m);

#endif
