/**
 * @file interior_findings.h
 * What a case adds to a thigh beside the femoral vein's own pathology: clots in further veins, and
 * bodies that can be taken for a clot.
 */
#ifndef SONDE_INTERIOR_FINDINGS_H
#define SONDE_INTERIOR_FINDINGS_H

#include "sonde/interior.h"
#include "sonde/tissue_anatomy.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SONDE_LESIONS = 8 };

typedef enum sonde_lesion_kind {
  SONDE_LESION_NODE,      /**< lymph node: dark rim, bright hilum */
  SONDE_LESION_CYST,      /**< fluid, e.g. Baker's cyst: black, enhancement behind */
  SONDE_LESION_HAEMATOMA, /**< inhomogeneous, dark */
  SONDE_LESION_KINDS
} sonde_lesion_kind;

/** An ellipsoid in the thigh at rest; it moves with the tissue around it and does not collapse. */
typedef struct sonde_lesion {
  sonde_lesion_kind kind;
  sonde_vec3 centre_m;
  sonde_vec3 axis;     /**< unit: direction of half_m.z */
  sonde_vec3 half_m;   /**< semi-axes: towards the skin and across (x), the other (y), along (z) */
  double echogenicity; /**< backscatter relative to muscle, 0..1 */
} sonde_lesion;

/** Clot in a vein of sonde_thigh_anatomy other than the femoral vein. */
typedef struct sonde_branch_finding {
  char branch[32];           /**< name of a branch of the model, e.g. great_saphenous */
  sonde_pathology pathology; /**< pressures are taken from the femoral vein's */
} sonde_branch_finding;

typedef struct sonde_findings {
  uint32_t lesion_count, branch_count;
  sonde_lesion lesion[SONDE_LESIONS];
  sonde_branch_finding branch[SONDE_BRANCHES];
  double webs;   /**< bright bands inside the femoral vein's old thrombus, 0 none .. 1 */
  double oedema; /**< fluid between the lobules of the fat, 0 none .. 1 */
} sonde_findings;

/** What the following updates add to the thigh; NULL: nothing. Branches that are not named hold
 *  what a healthy vein holds; clots are asked for in veins only.
 *  @param findings copied
 *  @return ARGUMENT for an unknown branch, one named twice, values out of range, or a lesion that
 *    is not inside the soft tissue
 *  @thread owner, before the next update */
SONDE_API sonde_status sonde_interior_set_findings(sonde_interior *interior,
                                                   const sonde_findings *findings,
                                                   sonde_error *error);

enum { SONDE_VESSEL_VIEWS = 32 };
/** Where a vessel is in the picture: the plane through the probe's x and z axes. */
typedef struct sonde_vessel_view {
  uint32_t vessel; /**< index of sonde_interior_vessel_name() */
  bool artery;
  double aside_m, depth_m; /**< of its middle now: along the probe's x, below the face */
  double half_m, flat_m;   /**< half of its greater and of its smaller diameter */
  double area_ratio;       /**< current / rest */
  double rest_z_m;         /**< model z of that place at rest */
} sonde_vessel_view;

#ifdef __cplusplus
}
#endif
#endif
