// A measured part of a thigh on a limb.
#ifndef SONDE_SRC_LIMB_PART_H
#define SONDE_SRC_LIMB_PART_H

#include "limb/map.h"
#include "sonde/limb_model.h"

// A subject laid on a limb: sections of both.
typedef struct limb_measured limb_measured;
// @return ARGUMENT for a part that the limb's thigh does not hold
sonde_status limb_measured_make(const limb_held *held, const sonde_limb_part *part,
                                limb_measured **out, sonde_error *error);
void limb_measured_destroy(limb_measured *measured); // NULL is ignored
// Place on the limb of the subject's site k: level and angle.
void limb_measured_site(const limb_measured *measured, uint32_t k, double *level,
                        double *angle_rad);
// Gives the nodes of the limb's model that lie on the part the subject's springs; towards the
// part's ends they go over into those that the nodes have.
void limb_measured_springs(const limb_measured *measured, sonde_model *model);

#endif
