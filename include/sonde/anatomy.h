/**
 * @file anatomy.h
 * Thighs made from a few named parameters and a seed, or from scanned surfaces of a leg: skin,
 * femur, layers, vessels, compartments and the mechanics of a complete model. docs/anatomy.md.
 *
 * Frame of every thigh: x to the medial side, y to the front, z from the groin (0) to the knee. A
 * left leg is mirrored into it.
 */
#ifndef SONDE_ANATOMY_H
#define SONDE_ANATOMY_H

#include "sonde/tissue_anatomy.h"

#ifdef __cplusplus
extern "C" {
#endif

/**
 * The parameters: member, name and unit at the boundary, SI per unit, least and largest value (SI),
 * meaning. Distributions: docs/anatomy.md.
 */
#define SONDE_THIGH_LIST(X)                                                                        \
  X(length_m, "length-mm", 1e-3, 0.2, 0.4, "length from the groin crease to above the knee")       \
  X(girth_m, "girth-mm", 1e-3, 0.3, 0.9, "girth at mid-thigh")                                     \
  X(girth_proximal_m, "girth-proximal-mm", 1e-3, 0.3, 1.1, "girth at the groin")                   \
  X(girth_distal_m, "girth-distal-mm", 1e-3, 0.25, 0.8, "girth above the knee")                    \
  X(fat_front_m, "fat-front-mm", 1e-3, 0.002, 0.06, "fat at mid-thigh, front")                     \
  X(fat_back_m, "fat-back-mm", 1e-3, 0.002, 0.06, "fat at mid-thigh, back")                        \
  X(fat_inner_m, "fat-inner-mm", 1e-3, 0.002, 0.06, "fat at mid-thigh, medial side")               \
  X(fat_outer_m, "fat-outer-mm", 1e-3, 0.002, 0.06, "fat at mid-thigh, lateral side")              \
  X(skin_m, "skin-mm", 1e-3, 0.001, 0.004, "thickness of the skin")                                \
  X(oval, "oval", 1, 0, 0.12, "second harmonic of the section's radius")                           \
  X(femur_m, "femur-mm", 1e-3, 0.016, 0.04, "diameter of the femur's shaft")                       \
  X(femur_lateral_m, "femur-lateral-mm", 1e-3, 0, 0.045,                                           \
    "how far lateral of the middle the femur stands at the groin")                                 \
  X(femur_anterior_m, "femur-anterior-mm", 1e-3, 0, 0.025, "how far in front of the middle")       \
  X(vein_m, "vein-mm", 1e-3, 0.004, 0.018, "diameter of the common femoral vein")                  \
  X(artery_m, "artery-mm", 1e-3, 0.003, 0.014, "diameter of the common femoral artery")            \
  X(vein_angle_rad, "vein-angle-deg", 0.017453292519943295, 0.78, 1.57,                            \
    "where the vein enters, from medial towards the front")                                        \
  X(vein_cover_m, "vein-cover-mm", 1e-3, 0.001, 0.03, "tissue from fascia to vein at the groin")   \
  X(canal_cover_m, "canal-cover-mm", 1e-3, 0.003, 0.04, "the same at mid-thigh")                   \
  X(saphenous_m, "saphenous-mm", 1e-3, 0.001, 0.01, "diameter of the great saphenous vein")        \
  X(deep_branch_m, "deep-branch-mm", 1e-3, 0.015, 0.08, "from the groin to the deep artery")       \
  X(second_vein, "second-vein", 1, 0, 1, "1: the femoral vein is double in the middle")            \
  X(stiffness, "stiffness", 1, 0.2, 5, "of the soft tissue; 1: the bundled thigh's")               \
  X(damping_s, "damping-ms", 1e-3, 0.001, 0.2, "time of the normal dampers")

/** A thigh by its parameters; NaN (and SONDE_SEX_DRAWN) stands for one that is to be drawn. */
typedef struct sonde_thigh {
  sonde_sex sex;
#define SONDE_THIGH_MEMBER(member, name, unit, low, high, text) double member;
  SONDE_THIGH_LIST(SONDE_THIGH_MEMBER)
#undef SONDE_THIGH_MEMBER
} sonde_thigh;

/** The parameters in the order of SONDE_THIGH_LIST. @thread any */
SONDE_API const sonde_parameter *sonde_thigh_parameters(uint32_t *count);
/** A thigh of which everything is to be drawn. @thread any */
SONDE_API sonde_thigh sonde_thigh_unknown(void);

/**
 * Draws what is not known from the documented distributions; what is known steers what depends on
 * it (girth on fat, proximal and distal girth on girth). A value depends on seed and parameter
 * only, not on which others are known. Lengths are whole nanometres.
 * @return ARGUMENT naming a known parameter that is out of range and its range
 * @thread any
 */
SONDE_API sonde_status sonde_thigh_draw(const sonde_thigh *known, uint64_t seed, sonde_thigh *thigh,
                                        sonde_error *error);

/** Skin, femur and fat of a thigh as tables over angle and height. */
typedef struct sonde_thigh_shape sonde_thigh_shape;
SONDE_API void sonde_thigh_shape_destroy(sonde_thigh_shape *shape); /**< @thread owner */

/**
 * The shape that the parameters describe: a section with two harmonics whose girth is exact, fat
 * interpolated between the four sides.
 * @param[out] shape owned by the caller
 * @return ARGUMENT when fat and femur leave less than 12 mm of muscle somewhere, naming the girth
 *   that would do
 * @thread owner
 */
SONDE_API sonde_status sonde_thigh_shape_create(const sonde_thigh *thigh, sonde_thigh_shape **shape,
                                                sonde_error *error);

/** Which way x and y of scanned surfaces run in the patient; z runs to the head. */
typedef enum sonde_axes {
  SONDE_AXES_ANY, /**< unknown; the leg may lie anyhow */
  SONDE_AXES_RAS, /**< x to the right, y to the front, as in NIfTI files */
  SONDE_AXES_LPS  /**< x to the left, y to the back, as in DICOM files */
} sonde_axes;

/** Surfaces of a leg. Any resolution; holes and crossing triangles do not matter where the rays
    from the middle of the thigh still meet the outside. Model units (m). */
typedef struct sonde_leg_scan {
  const sonde_mesh *skin;  /**< longer than the thigh; without `femur` its upper end is the groin */
  const sonde_mesh *femur; /**< whole; NULL: from the parameters, `axes` must be known */
  const sonde_mesh *muscle; /**< envelope of the muscles; NULL: fat from the parameters */
  bool left;
  sonde_axes axes;        /**< a leg that is turned by more than 120 degrees from it is refused */
  const sonde_mesh *vein; /**< femoral; NULL: from the parameters */
  const sonde_mesh *artery;
  double length_m; /**< of the thigh, without `femur`; 0: 0.39 of a whole leg, else `thigh`'s */
} sonde_leg_scan;

/** What a scan was turned into. */
typedef struct sonde_leg_report {
  uint32_t rays, missed;         /**< of the skin; missed ones are filled from their neighbours */
  double femur_length_m;         /**< 0 without a femur */
  bool vein_found, artery_found; /**< beside the groin, so that they replace the parameters */
} sonde_leg_report;

/**
 * Finds hip, knee, front and medial side from the femur, cuts the thigh out between 9 % and 80 % of
 * the femur's length, and samples the surfaces from its middle. Without a femur the thigh begins at
 * the skin's upper end, its sides follow from the axes, and the bone is the parameters'.
 * @param thigh length, girths, fat (with `muscle`), femur (with `femur`), vein and artery (with
 *   theirs) are replaced by what is measured
 * @param[out] shape owned by the caller
 * @return MESH when the femur has no head or more than 5 % of the rays miss the skin, when femur
 *   and `left` or `axes` disagree (a mirrored leg, LPS for RAS), or when a length is that of a
 *   wrong unit; ARGUMENT when neither femur nor axes are known
 * @thread owner
 */
SONDE_API sonde_status sonde_thigh_shape_scan(const sonde_leg_scan *scan, sonde_thigh *thigh,
                                              sonde_thigh_shape **shape, sonde_leg_report *report,
                                              sonde_error *error);

/** Surfaces of a leg from a volume of labels; empty meshes for what has no label. */
typedef struct sonde_leg_labels {
  sonde_mesh skin;   /**< of everything that is labelled; open where the volume's side cuts it */
  sonde_mesh femur;  /**< largest part of what is called femur, else bone */
  sonde_mesh muscle; /**< of muscles and bones */
  sonde_mesh vein, artery;
  double voxel_m;      /**< longest edge of a voxel */
  double filled_share; /**< unlabelled holes, which are filled, of the leg's volume */
} sonde_leg_labels;

/**
 * Reads a volume of labels (.nii, .nii.gz; x to the right, y to the front, z to the head) and
 * makes closed surfaces of its tissues by marching tetrahedra at 1.5 mm or the voxel.
 * @param names_path text file with a number and a name on each line, in which one word is
 *   background, tissue, skin, fat, muscle, femur, bone, vein or artery; NULL: 1 skin, 2 fat,
 *   3 muscle, 4 bone, 5 vein, 6 artery
 * @param[out] labels released by sonde_leg_labels_clear()
 * @return FORMAT: no volume of whole numbers, neither sform nor qform, a wrong unit, a number
 *   without a name; MESH: nothing labelled, two legs, holes of more than 5 % of the leg; IO
 * @thread owner
 */
SONDE_API sonde_status sonde_leg_labels_load(const char *path, const char *names_path,
                                             sonde_leg_labels *labels, sonde_error *error);
SONDE_API void sonde_leg_labels_clear(sonde_leg_labels *labels); /**< @thread owner */

/** How the model of a thigh is made. */
typedef struct sonde_thigh_def {
  const char *name, *provenance;
  double edge_m;      /**< away from the vessels; default 6 mm */
  double fine_edge_m; /**< along the vein's course; default 3 mm */
} sonde_thigh_def;
SONDE_API sonde_thigh_def sonde_thigh_def_default(void); /**< @thread any */

/** Columns of sites beside the vein and rows along it; the middle column is above it. */
enum { SONDE_THIGH_COLUMNS = 5, SONDE_THIGH_ROWS = 12 };

/**
 * Makes the model: meshes, layers, vessels, compartments, sites along the vein's course, and the
 * mechanics by the rule that was fitted to the bundled thigh.
 * @param[out] model owned by the caller; has `anatomy`
 * @return ARGUMENT when the vessels find no room between bone and fat; MESH
 * @thread owner
 */
SONDE_API sonde_status sonde_thigh_build(const sonde_thigh *thigh, const sonde_thigh_shape *shape,
                                         const sonde_thigh_def *def, sonde_model **model,
                                         sonde_error *error);

/** Writes cross-sections of a model with anatomy at three landmarks as SVG. @thread owner */
SONDE_API sonde_status sonde_thigh_sections(const sonde_model *model, const char *path,
                                            sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
