// Inside of the model: the parts of its construction shared by build and load.
#ifndef SONDE_SRC_MODEL_H
#define SONDE_SRC_MODEL_H

#include "base/link.h"
#include "sonde/tissue.h"

// Every uniform stiffness of a law times scale > 0. @thread tick
SONDE_LINK void sonde_law_scale(sonde_surface_law *law, double scale);
// Allocates the per-node arrays for model->surface.vertex_count nodes.
SONDE_LINK sonde_status sonde_model_allocate_nodes(sonde_model *model, sonde_error *error);
// Topology, normals, areas, masses, rest lengths, areas and cotangents from surface and law.
SONDE_LINK sonde_status sonde_model_derive(sonde_model *model, sonde_error *error);
// Depths of the interfaces and of the bone below every node.
sonde_status sonde_model_measure_layers(sonde_model *model, const sonde_mesh *fat,
                                        const sonde_mesh *muscle, sonde_error *error);
// The sites' parameters carried to every node by kriging of their logarithms.
SONDE_LINK sonde_status sonde_model_interpolate(sonde_model *model, sonde_error *error);
// Femoral vein and artery below the examined area; beside_bone: no farther than the bone reaches.
sonde_status sonde_model_place_vessels(sonde_model *model, bool beside_bone, sonde_error *error);
// A rod for a bone, along the middles of the sections near the sites and inside the skin; a warning
// and no bone where the body is no limb.
sonde_status sonde_model_place_rod(sonde_model *model, sonde_error *error);
// Middle line of the leg through the femur (or the skin when there is none).
typedef struct sonde_leg_axis {
  sonde_vec3 origin, direction;
} sonde_leg_axis;
sonde_leg_axis sonde_model_axis(const sonde_model *model);
// Index into model->sites of the site nearest the middle of the examined area.
uint32_t sonde_model_central_site(const sonde_model *model);

#endif
