// Reading the vessels of an interior: where a point lies beside them, and where their walls take
// the tissue.
#ifndef SONDE_SRC_INTERIOR_VESSELS_H
#define SONDE_SRC_INTERIOR_VESSELS_H

#include "interior/interior.h"

// Position of a rest point along a vessel's line; that of a vessel along the leg is s. @thread any
static inline double sonde_vessel_along(const sonde_interior *in, uint32_t which, sonde_vec3 rest_m,
                                        double s_m) {
  const sonde_vessel_course *course = &in->course[which];
  return course->tilted ? v_dot(v_sub(rest_m, in->origin), course->line) : s_m;
}
// Sections i and i + 1 of a vessel around a position along its line and the share between them,
// 0..1; false beyond the vessel's ends. @thread any
bool sonde_vessel_sections(const sonde_interior *interior, uint32_t which, double along_m,
                           uint32_t *i, double *share);
// State of a vessel interpolated at a position along its line. @thread any
bool sonde_vessel_at(const sonde_interior *interior, uint32_t which, double along_m,
                     sonde_vessel_state *state);
// Branches whose walls may move a rest point at axial position s, a bit each. @thread any
uint64_t sonde_vessels_reaching(const sonde_interior *interior, sonde_vec3 rest_m, double s_m);
// Where the wall warps a point given relative to the centre of the undisturbed cross-section,
// at rest: the tissue's gradient takes a point of the lumen from there to the lumen as it is.
// Keeps orientation, fades out with distance. @thread any
void sonde_vessel_warp(const sonde_vessel_state *state, double *short_m, double *long_m);
// Where the tissue's gradient carries it. @thread any
void sonde_vessel_tissue(const sonde_vessel_state *state, double *short_m, double *long_m);
// Wall, lumen or clot at a rest point at axial position s, and of which vessel (NULL: not asked
// for); SONDE_LABEL_COUNT beside them. @thread any
sonde_label sonde_vessels_label(const sonde_interior *interior, sonde_vec3 rest_m, double s_m,
                                uint32_t *which);
// A point goes first to where the walls near it warp the tissue, at rest still, then with the
// field, and last to where the walls smooth the field's bends: the position of a rest point that
// was warped to `warped_m` and that the field took to `moved_m`. @thread any
sonde_vec3 sonde_vessels_warp(const sonde_vessel_state *near, uint32_t count, sonde_vec3 rest_m);
sonde_vec3 sonde_vessels_smooth(const sonde_vessel_state *near, uint32_t count, sonde_vec3 rest_m,
                                sonde_vec3 warped_m, sonde_vec3 moved_m);
// Vessels whose walls can move a rest point at axial position s; their number. @thread any
uint32_t sonde_vessels_near(const sonde_interior *interior, sonde_vec3 rest_m, double s_m,
                            sonde_vessel_state near[SONDE_VESSELS]);
typedef struct sonde_wall_steps {
  sonde_vec3 warped_m, moved_m, smoothed_m;
} sonde_wall_steps;
// The steps of a rest point beside these vessels: warp, field, smoothing. @thread any
sonde_wall_steps sonde_vessels_trace(const sonde_interior *interior, const sonde_vessel_state *near,
                                     uint32_t count, sonde_vec3 rest_m);
// Displacement of a rest point at s, vessels included, also beyond the skin. @thread any
sonde_vec3 sonde_vessels_displace(const sonde_interior *interior, sonde_vec3 rest_m, double s_m);
// Whether the wall of a branch can move a point; cheaper than its state. @thread any
bool sonde_vessel_reaches(const sonde_interior *interior, uint32_t which, double along_m,
                          sonde_vec3 rest_m, double beyond_m);

#endif
