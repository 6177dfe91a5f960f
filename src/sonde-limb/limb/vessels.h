// Vessels, nerves and nodes of a limb, as the label and the muscles ask for them.
#ifndef SONDE_SRC_LIMB_VESSELS_H
#define SONDE_SRC_LIMB_VESSELS_H

#include "limb/frame.h"

// What a vessel, a nerve or a node is at a point, in the order of priority.
typedef enum limb_part {
  LIMB_PART_NONE,
  LIMB_PART_LUMEN,
  LIMB_PART_WALL,
  LIMB_PART_NERVE,
  LIMB_PART_NODE,
  LIMB_PART_SHEATH // loose fat around deep vessels; the femoral sheath
} limb_part;

typedef struct limb_vessel_hit {
  limb_part part;
  uint32_t index;    // of the vessel, nerve or node; what limb_vessels_name() takes
  double distance_m; // to the nearest lumen, nerve or node; negative inside
} limb_vessel_hit;

// Makes limb->vessels from the body, the surface and the bones of limb.
sonde_status limb_vessels_make(sonde_limb *limb, sonde_error *error);
void limb_vessels_destroy(struct limb_vessels *vessels);
// What is at a point of a right limb. NULL vessels: nothing.
limb_vessel_hit limb_vessels_at(const struct limb_vessels *vessels, const double xyz[3]);
// Whether a point is so far from every vessel, nerve and node that none of them nor the fat around
// it is there. False also where they may be.
bool limb_vessels_clear(const struct limb_vessels *vessels, const double xyz[3]);
const char *limb_vessels_name(const struct limb_vessels *vessels, limb_part part, uint32_t index);

// Distance to the outer face of the nearest deep bundle (wall, nerve) of a right limb that muscles
// give way to; perforators and the veins inside soleus and gastrocnemius do not count.
double limb_vessels_bundle(const struct limb_vessels *vessels, const double xyz[3]);

// A nerve, node or tendon where it comes nearest to a point.
typedef struct limb_body {
  sonde_vec3 centre, axis, side; // side: along the wide semi-axis; units
  double wide, thick, length;    // semi-axes, m; length 0: a cord
  bool ends;                     // the point lies beyond an end
  bool node;
} limb_body;

// Nerves, then nodes: which < limb_nerve_bodies().
uint32_t limb_nerve_bodies(const struct limb_vessels *vessels);
limb_body limb_nerve_body(const struct limb_vessels *vessels, uint32_t which, sonde_vec3 p);

#endif
