/**
 * @file limb_model.h
 * A limb as a model that can be pressed and imaged: skin, bones, layers, springs, vessels,
 * stations, and the limb itself as the model's tissue map. docs/limb_model.md.
 *
 * Frame of the model, as of every model of a leg: x and y as in limb.h, z downwards, 0 at the
 * limb's upper end.
 */
#ifndef SONDE_LIMB_MODEL_H
#define SONDE_LIMB_MODEL_H

#include "sonde/limb_pose.h"
#include "sonde/tissue.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A part of a thigh that a robot measured. Its model has the axes of a limb's: x medial, y to the
 * front, z downwards, of a right leg. */
typedef struct sonde_limb_part {
  const sonde_model *model; /**< as sonde fit makes it: two layers, exponent 2; the caller's */
  double from_m; /**< of its z = 0 below the hip joint; NaN: its middle at that of the thigh */
} sonde_limb_part;

/**
 * Takes from a measured part what a body does not know yet: girths of thigh and knee that follow
 * the subject's, fat, skin and the femur's diameter at the middle of the thigh.
 * @param[in,out] known numbers that are known stay @param seed of what is drawn for the rest
 * @return ARGUMENT for a subject that is no thigh along z, or lies beyond the thigh
 * @thread owner
 */
SONDE_API sonde_status sonde_limb_part_body(const sonde_limb_part *part, uint64_t seed,
                                            sonde_limb_body *known, sonde_error *error);

/** How a limb goes with a part. */
typedef struct sonde_limb_part_fit {
  double from_level, to_level; /**< where the part lies: 0 hip, 1 knee joint line */
  double girth_rms;            /**< of ln(girth of the subject / girth of the limb) on the part */
} sonde_limb_part_fit;
/** @return as sonde_limb_part_body() @thread owner */
SONDE_API sonde_status sonde_limb_part_compare(const sonde_limb_part *part, const sonde_limb *limb,
                                               sonde_limb_part_fit *fit, sonde_error *error);

/** How the model of a limb is made. */
typedef struct sonde_limb_model_def {
  const char *name, *provenance;
  double edge_m;      /**< of the skin; default 6 mm */
  double fine_edge_m; /**< along the main vein and at the stations; default 3 mm */
  double stiffness;   /**< of the soft tissue, 0.2 to 5; 1: that of the bundled thigh */
  double damping_s;   /**< time of the normal dampers; 20 ms */
  /** NULL: the straight limb, lying; else in this position, whose pressures its veins have */
  const sonde_limb_setting *setting;
  /** NULL, or whose springs the skin has where the part lies; from 42 to 12 mm before its ends
   * they go over into those that follow from the layers */
  const sonde_limb_part *part;
} sonde_limb_model_def;
SONDE_API sonde_limb_model_def sonde_limb_model_def_default(void); /**< @thread any */

/**
 * Makes the limb of a drawn body and its model. Vein: external iliac to popliteal; artery likewise;
 * all other vessels are branches, with '_' for ' ' in their names. Landmarks and sites 0 to 14 are
 * the stations; further sites stand along the main vein. Springs follow from the layers below each
 * node, tendon being stiffer than muscle. In a position (limb_pose.h) all of it is that of the
 * posed limb; vessels keep the radius of 10 mmHg, which the interior changes with their pressure.
 * @param[out] model owned by the caller; owns the limb
 * @return ARGUMENT for a body without room for muscle or a def out of range; MESH
 * @thread owner
 */
SONDE_API sonde_status sonde_limb_model(const sonde_limb_body *body,
                                        const sonde_limb_model_def *def, sonde_model **model,
                                        sonde_error *error);
/** As sonde_model_load(), and makes the limb of such a model again; a model that is no limb's stays
 *  as it is. @return VERSION when this program makes another limb of the file's body @thread owner
 */
SONDE_API sonde_status sonde_limb_model_load(const char *path, sonde_model **model,
                                             sonde_error *error);
/** The limb of such a model, NULL of any other; the model's. @thread any */
SONDE_API const sonde_limb *sonde_limb_of(const sonde_model *model);
/** The position of such a limb, NULL of a straight one or any other model; the model's.
 *  @thread any */
SONDE_API const sonde_limb_pose *sonde_limb_pose_of(const sonde_model *model);
/** That position; SONDE_LIMB_POSITIONS: straight, or no limb. @thread any */
SONDE_API sonde_limb_position sonde_limb_position_of(const sonde_model *model);
/** A point of the limb's frame, posed when the limb is, in the model's, or the other way.
 *  @thread any */
SONDE_API sonde_vec3 sonde_limb_to_model(const sonde_limb *limb, sonde_vec3 point_m);

#ifdef __cplusplus
}
#endif
#endif
