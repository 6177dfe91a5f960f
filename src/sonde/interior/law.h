// Laws of the vessels: areas and shapes under a pressure from outside, pressures in time and by
// height. Constants and sources: docs/interior_theory.md.
#ifndef SONDE_SRC_INTERIOR_LAW_H
#define SONDE_SRC_INTERIOR_LAW_H

#include "sonde/interior.h"
#include "sonde/tissue_anatomy.h"

#include "base/link.h"

// Area ratio of a vein between muscles or in the fat.
double sonde_vein_area_in(const sonde_pathology *pathology, double outside_pa, bool in_fat);
// Ellipse of a vein or artery with that area ratio: half axes over the rest radius.
void sonde_vessel_shape(sonde_vessel_kind kind, const sonde_pathology *pathology, bool clot,
                        double ratio, double *half_short, double *half_long);
// Radius of the vein at rest relative to the healthy one at 10 mmHg.
double sonde_vein_rest_scale(const sonde_pathology *pathology, bool clot, bool in_fat);
// Radius of the artery at its pressure relative to that at 95 mmHg.
double sonde_artery_rest_scale(const sonde_pathology *pathology);
// Pressure (Pa) at a point that lies `below_m` below the groin: in a vein all of it, in an artery
// the blood's weight from there. The law of every vein at rest. @thread any
SONDE_LINK double sonde_posture_pressure(sonde_posture posture, sonde_vessel_kind kind,
                                         double below_m);
// What a limb's place adds to the pressures of a pathology or a circulation (Pa), at a point of the
// model: the blood's weight, and in a model that says how it is held also what the groin's veins
// have more than lying. 0 in a thigh, which ends above the knee. @thread any
double sonde_hydrostatic_pressure(const sonde_interior *interior, sonde_posture posture,
                                  sonde_vessel_kind kind, sonde_vec3 rest_m);
// True where a thrombus lies.
bool sonde_pathology_clot(const sonde_pathology *pathology, double z_m);

// Area of the vein relative to its rest area at an effective outside pressure (Pa), for a lumen
// pressure and thrombus (tube law, docs/interior_theory.md). Monotone, > 0. @thread any
double sonde_vein_area_ratio(const sonde_pathology *pathology, double outside_pa);
// Area of the artery relative to its rest area at an effective outside pressure (Pa). @thread any
double sonde_artery_area_ratio(const sonde_pathology *pathology, double outside_pa);
// Pressure inside an empty vein's wall (Pa) that holds it at `area_ratio` of its stress-free area
// glued to muscle, for a wall of that shear modulus. Monotone. @thread any
double sonde_vein_tube_pressure(double area_ratio, double wall_shear_pa);
// Pressure in the common femoral vein (Pa) at time t: posture, breath, Valsalva
// (docs/interior_theory.md). A function of t only. @thread any
double sonde_venous_pressure(const sonde_circulation *circulation, double t_s);
// Pressure in the femoral artery (Pa) at time t: between diastolic and systolic, periodic.
// @thread any
double sonde_arterial_pressure(const sonde_circulation *circulation, double t_s);

#endif
