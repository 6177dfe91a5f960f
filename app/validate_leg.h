// A round synthetic leg of known layers: what the image is measured on.
#ifndef SONDE_VALIDATE_LEG_H
#define SONDE_VALIDATE_LEG_H

#include "sonde/sonde.h"

// Radius, femur radius, depth where muscle begins, depth of the vessels' centres; vessels lie above
// each other along the leg under +y when `vessels`. @param model owned by the caller
sonde_status validate_leg_build(double radius_m, double bone_m, double muscle_m,
                                double vein_depth_m, bool vessels, sonde_model *model,
                                sonde_error *error);
void validate_leg_clear(sonde_model *model);
// Probe face at a distance from the axis under +y at height z, beam into the leg.
sonde_pose validate_leg_pose(double face_m, double z_m);

#endif
