/**
 * @file limb.h
 * A lower limb from a body and a seed, external iliac vessels to ankle: bones, muscles, fasciae,
 * fat, skin, vessels and nerves, with an exact label at every point. docs/limb.md.
 *
 * Frame: origin at the centre of the hip joint, x to the medial side, y to the front, z up; metres.
 * The knee joint line is at (0, 0, -thigh_length_m), the ankle joint calf_length_m below it. A left
 * limb is the mirror in x, so that x of a left limb points to the lateral side.
 * Level: -0.2 to 1 from above the hip (0) to the knee joint line (1), 1 to 2 from there to the
 * ankle joint. Angle: from the front (0) through medial (pi/2), back (pi) and lateral, on both
 * sides.
 */
#ifndef SONDE_LIMB_H
#define SONDE_LIMB_H

#include "sonde/geometry.h"
#include "sonde/tissue_anatomy.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum sonde_limb_side { SONDE_LIMB_RIGHT, SONDE_LIMB_LEFT } sonde_limb_side;

/**
 * The parameters of a body: member, name and unit at the boundary, SI per unit, least and largest
 * value (SI), meaning. Distributions: docs/limb.md.
 */
#define SONDE_LIMB_LIST(X)                                                                         \
  X(age_y, "age-y", 1, 18, 95, "age in years")                                                     \
  X(stature_m, "stature-cm", 1e-2, 1.4, 2.1, "stature")                                            \
  X(bmi, "bmi", 1, 15, 45, "body mass index, kg/m2")                                               \
  X(thigh_length_m, "thigh-length-mm", 1e-3, 0.32, 0.54, "hip joint centre to knee joint line")    \
  X(calf_length_m, "calf-length-mm", 1e-3, 0.28, 0.52, "knee joint line to ankle joint")           \
  X(girth_thigh_m, "girth-thigh-mm", 1e-3, 0.38, 1, "girth of the thigh at the gluteal fold")      \
  X(girth_knee_m, "girth-knee-mm", 1e-3, 0.27, 0.65, "girth of the thigh above the patella")       \
  X(girth_calf_m, "girth-calf-mm", 1e-3, 0.25, 0.6, "largest girth of the calf")                   \
  X(girth_ankle_m, "girth-ankle-mm", 1e-3, 0.16, 0.33, "least girth above the ankle")              \
  X(fat_front_m, "fat-front-mm", 1e-3, 0.002, 0.06, "fat at mid-thigh, front")                     \
  X(fat_medial_m, "fat-medial-mm", 1e-3, 0.002, 0.08, "fat at mid-thigh, medial side")             \
  X(fat_lateral_m, "fat-lateral-mm", 1e-3, 0.0015, 0.06, "fat at mid-thigh, lateral side")         \
  X(fat_back_m, "fat-back-mm", 1e-3, 0.002, 0.06, "fat at mid-thigh, back")                        \
  X(fat_groin_m, "fat-groin-mm", 1e-3, 0.002, 0.07, "fat in front of the femoral vessels")         \
  X(fat_popliteal_m, "fat-popliteal-mm", 1e-3, 0.002, 0.04, "fat behind the knee")                 \
  X(fat_calf_m, "fat-calf-mm", 1e-3, 0.002, 0.04, "fat behind the calf")                           \
  X(fat_calf_medial_m, "fat-calf-medial-mm", 1e-3, 0.002, 0.04, "fat of the calf, medial side")    \
  X(fat_shin_m, "fat-shin-mm", 1e-3, 0.001, 0.015, "fat on the tibia's medial face")               \
  X(skin_m, "skin-mm", 1e-3, 0.001, 0.003, "thickness of the skin")                                \
  X(head_m, "femoral-head-mm", 1e-3, 0.034, 0.06, "diameter of the femoral head")                  \
  X(offset_m, "femoral-offset-mm", 1e-3, 0.022, 0.062, "centre of the head to the shaft's axis")   \
  X(neck_shaft_rad, "neck-shaft-deg", 0.017453292519943295, 1.92, 2.62, "neck to shaft")           \
  X(anteversion_rad, "anteversion-deg", 0.017453292519943295, -0.26, 0.7, "neck before the plane") \
  X(shaft_m, "femoral-shaft-mm", 1e-3, 0.02, 0.036, "diameter of the femur at mid-shaft")          \
  X(bow_m, "femoral-bow-mm", 1e-3, 0.5, 2.5, "radius of the shaft's anterior bow")                 \
  X(epicondylar_m, "epicondylar-mm", 1e-3, 0.06, 0.1, "width of the condyles")                     \
  X(condyle_m, "condyle-mm", 1e-3, 0.046, 0.08, "condyles, front to back")                         \
  X(patella_m, "patella-mm", 1e-3, 0.032, 0.056, "height of the patella")                          \
  X(plateau_m, "plateau-mm", 1e-3, 0.056, 0.095, "width of the tibial plateau")                    \
  X(tibia_m, "tibial-shaft-mm", 1e-3, 0.016, 0.032, "width of the tibia half-way down")            \
  X(torsion_rad, "tibial-torsion-deg", 0.017453292519943295, 0, 1.05, "external tibial torsion")   \
  X(fibula_m, "fibula-mm", 1e-3, 0.009, 0.018, "diameter of the fibula's shaft")                   \
  X(malleoli_m, "malleoli-mm", 1e-3, 0.052, 0.095, "width over the malleoli with skin")

/** Muscles that have a volume of their own factor. */
enum { SONDE_LIMB_MUSCLES = 32 };

/** A body by its parameters; NaN (and SONDE_SEX_DRAWN) stands for one that is to be drawn. */
typedef struct sonde_limb_body {
  sonde_sex sex;
  sonde_limb_side side;
  uint64_t seed; /**< of what has no parameter: muscle shares, vessels' variants */
#define SONDE_LIMB_MEMBER(member, name, unit, low, high, text) double member;
  SONDE_LIMB_LIST(SONDE_LIMB_MEMBER)
#undef SONDE_LIMB_MEMBER
  double share[SONDE_LIMB_MUSCLES]; /**< volume of each muscle against the rule; NaN: drawn */
} sonde_limb_body;

/** The parameters in the order of SONDE_LIMB_LIST. @thread any */
SONDE_API const sonde_parameter *sonde_limb_parameters(uint32_t *count);
/** A right limb of which everything is to be drawn. @thread any */
SONDE_API sonde_limb_body sonde_limb_unknown(void);

/**
 * Draws what is not known by the population's rules. A value depends on the seed, its parameter and
 * what its rule names (girths on stature and BMI, for instance), not on which others are known.
 * @return ARGUMENT naming a known parameter out of range, or two that no body has together
 * @thread any
 */
SONDE_API sonde_status sonde_limb_draw(const sonde_limb_body *known, uint64_t seed,
                                       sonde_limb_body *body, sonde_error *error);

/** Bones, in this order. The pelvis is the part beside the groin. */
typedef enum sonde_limb_bone {
  SONDE_LIMB_PELVIS,
  SONDE_LIMB_FEMUR,
  SONDE_LIMB_PATELLA,
  SONDE_LIMB_TIBIA,
  SONDE_LIMB_FIBULA,
  SONDE_LIMB_BONES
} sonde_limb_bone;

/** A limb. */
typedef struct sonde_limb sonde_limb;

/**
 * Makes the limb of a drawn body.
 * @param[out] limb owned by the caller
 * @return ARGUMENT when fat and bones leave no room for muscle, naming the level
 * @thread owner
 */
SONDE_API sonde_status sonde_limb_create(const sonde_limb_body *body, sonde_limb **limb,
                                         sonde_error *error);
SONDE_API void sonde_limb_destroy(sonde_limb *limb); /**< NULL is ignored. @thread owner */

/** Tissues, those of higher priority last. */
typedef enum sonde_limb_tissue {
  SONDE_LIMB_OUTSIDE,
  SONDE_LIMB_SKIN,
  SONDE_LIMB_FAT, /**< under the skin; index 1: between the muscles, and what fills pelvis and knee
                   */
  SONDE_LIMB_SUPERFICIAL_FASCIA,
  SONDE_LIMB_FASCIA,
  SONDE_LIMB_SEPTUM,
  SONDE_LIMB_MUSCLE,
  SONDE_LIMB_TENDON,
  SONDE_LIMB_SHEATH, /**< loose fat around vessels */
  SONDE_LIMB_NODE,
  SONDE_LIMB_NERVE,
  SONDE_LIMB_WALL,
  SONDE_LIMB_LUMEN,
  SONDE_LIMB_BONE,
  SONDE_LIMB_TISSUES
} sonde_limb_tissue;

/** What is at a point. */
typedef struct sonde_limb_label {
  sonde_limb_tissue tissue;
  uint32_t index; /**< of the muscle, bone, tendon, septum, vessel, nerve or node */
  sonde_limb_side side;
} sonde_limb_label;

/** Name of a tissue: "muscle". Never NULL. @thread any */
SONDE_API const char *sonde_limb_tissue_name(sonde_limb_tissue tissue);
/** Name of a structure: "vastus lateralis"; that of the tissue when the structure has none.
 * @thread any */
SONDE_API const char *sonde_limb_name(const sonde_limb *limb, sonde_limb_label label);
/** The label of a point (m): bone before lumen, wall, nerve, node, sheath, tendon, muscle, septum,
 * fascia and fat. @thread any */
SONDE_API sonde_limb_label sonde_limb_at(const sonde_limb *limb, sonde_vec3 point);

/** Signed distances of a point, m; negative inside. */
typedef struct sonde_limb_distances {
  double skin;   /**< to the skin's outer face */
  double fascia; /**< to the deep fascia */
  double bone;   /**< to the nearest bone */
  double vessel; /**< to the nearest lumen, nerve or node; infinite without vessels */
} sonde_limb_distances;
/** Distances, exact to first order at the surface. @thread any */
SONDE_API sonde_limb_distances sonde_limb_distance(const sonde_limb *limb, sonde_vec3 point);

/** Unit direction of the muscle fibres at a point, downwards; false outside muscles. @thread any */
SONDE_API bool sonde_limb_fibre(const sonde_limb *limb, sonde_vec3 point, sonde_vec3 *direction);

/** A point by level, angle (rad) and fraction of the fascia's radius. @thread any */
SONDE_API sonde_vec3 sonde_limb_point(const sonde_limb *limb, double level, double angle, double f);
/** @thread any */
SONDE_API void sonde_limb_polar(const sonde_limb *limb, sonde_vec3 point, double *level,
                                double *angle, double *f);

/**
 * Closed surface of the skin, genus 0.
 * @param edge_m wanted edge length, 1.5 mm or more
 * @param[out] mesh released by sonde_mesh_clear()
 * @thread owner
 */
SONDE_API sonde_status sonde_limb_skin(const sonde_limb *limb, double edge_m, sonde_mesh *mesh,
                                       sonde_error *error);
/** Turns a surface from the limb's frame, which is left-handed (x to the patient's left, y to the
 * front, z up), to the patient's left, back and head (LPS), as files have it. @thread owner */
SONDE_API void sonde_limb_to_patient(sonde_mesh *mesh);
/** Closed surface of one bone, genus 0; as sonde_limb_skin(). @thread owner */
SONDE_API sonde_status sonde_limb_bone_mesh(const sonde_limb *limb, sonde_limb_bone bone,
                                            double edge_m, sonde_mesh *mesh, sonde_error *error);

/** A muscle of a limb, as measured. */
typedef struct sonde_limb_muscle {
  const char *name;
  double volume_m3;
  double rule_m3;    /**< by the rule of stature, mass, sex and age with the muscle's own share */
  double largest_m2; /**< area of the largest cross-section */
  double largest_level;
  double pennation_rad, fibre_m;
} sonde_limb_muscle;
/** Number of muscles. @thread any */
SONDE_API uint32_t sonde_limb_muscle_count(void);
/** Measures a muscle, index below the number of muscles. @thread any */
SONDE_API sonde_limb_muscle sonde_limb_muscle_at(const sonde_limb *limb, uint32_t index);
/** Area of a muscle at a level, and that of its rule times the section's common scale; m2.
 * @thread any */
SONDE_API double sonde_limb_muscle_section(const sonde_limb *limb, uint32_t index, double level,
                                           double *rule_m2);
/** Girth of the skin at a level, m. @thread any */
SONDE_API double sonde_limb_girth(const sonde_limb *limb, double level);
/** The body of a limb. @thread any */
SONDE_API const sonde_limb_body *sonde_limb_body_of(const sonde_limb *limb);

/** Draws the labelled section at a level, -0.2 to 2, as SVG, seen from the feet. @thread owner */
SONDE_API sonde_status sonde_limb_section_svg(const sonde_limb *limb, double level,
                                              const char *path, sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
