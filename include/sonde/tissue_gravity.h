/**
 * @file tissue_gravity.h
 * Posture of a leg, and where down is in a model that says so.
 */
#ifndef SONDE_TISSUE_GRAVITY_H
#define SONDE_TISSUE_GRAVITY_H

#include "sonde/geometry.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Posture of the leg. */
typedef enum sonde_posture {
  SONDE_POSTURE_SUPINE,
  SONDE_POSTURE_SITTING,
  SONDE_POSTURE_STANDING,
  SONDE_POSTURE_COUNT
} sonde_posture;

/** How the leg of a model is held. */
typedef struct sonde_gravity {
  sonde_posture posture;
  sonde_vec3 up;      /**< unit, against gravity; 0, 0, 0: the model does not say */
  sonde_vec3 groin_m; /**< from where columns of blood count */
} sonde_gravity;

#ifdef __cplusplus
}
#endif
#endif
