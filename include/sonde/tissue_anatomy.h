/**
 * @file tissue_anatomy.h
 * Named anatomy of a thigh beyond skin, femur and the two femoral vessels: further vessels,
 * landmarks, segments of the vein, fascia, muscle compartments and the direction of their fibres.
 * Kept in the model and its file (docs/model_file.md); made by sonde/anatomy.h. No part points into
 * another, so a struct copy is a copy.
 */
#ifndef SONDE_TISSUE_ANATOMY_H
#define SONDE_TISSUE_ANATOMY_H

#include "sonde/tissue.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum sonde_sex { SONDE_SEX_DRAWN, SONDE_SEX_FEMALE, SONDE_SEX_MALE } sonde_sex;

enum { SONDE_BRANCHES = 64, SONDE_LANDMARKS = 16, SONDE_SEGMENTS = 16, SONDE_LEVELS = 64 };

typedef enum sonde_vessel_kind { SONDE_VESSEL_VEIN, SONDE_VESSEL_ARTERY } sonde_vessel_kind;

/** A vessel beside the model's femoral vein and artery, from its junction with them downwards. */
typedef struct sonde_branch {
  char
      name[32]; /**< great_saphenous, deep_femoral_artery, deep_femoral_vein, second_femoral_vein */
  sonde_vessel_kind kind;
  sonde_vessel line;
} sonde_branch;

/** A place of the examination: where the probe is put to see the femoral vein there. */
typedef struct sonde_landmark {
  char name[32];
  sonde_vec3 skin_m; /**< above the vein */
  sonde_vec3 normal; /**< outward, unit */
  sonde_vec3 vein_m; /**< centre of the femoral vein */
  uint32_t site;     /**< id of the nearest site of the model */
} sonde_landmark;

/** A stretch of the femoral vein by model z. */
typedef struct sonde_segment {
  char name[32]; /**< common_femoral, femoral_proximal, femoral_mid, femoral_distal, popliteal
                  */
  double from_m, to_m;
} sonde_segment;

typedef enum sonde_compartment {
  SONDE_COMPARTMENT_ANTERIOR,  /**< quadriceps, sartorius */
  SONDE_COMPARTMENT_MEDIAL,    /**< adductors, gracilis */
  SONDE_COMPARTMENT_POSTERIOR, /**< hamstrings */
  SONDE_COMPARTMENTS
} sonde_compartment;

/** The compartments at one height: sheets from the femur to the fascia part them. */
typedef struct sonde_muscle_level {
  double z_m;
  double bone_x_m, bone_y_m; /**< middle of the femur */
  /** Directions about the femur, from +x towards +y, where each compartment ends when the angle
      grows: medial -> anterior, anterior -> posterior, posterior -> medial. Ascending. */
  double septum_rad[SONDE_COMPARTMENTS];
} sonde_muscle_level;

/** Everything named in a thigh. */
typedef struct sonde_thigh_anatomy {
  uint32_t branch_count, landmark_count, segment_count, level_count;
  sonde_branch branch[SONDE_BRANCHES];
  sonde_landmark landmark[SONDE_LANDMARKS];
  sonde_segment segment[SONDE_SEGMENTS];
  sonde_muscle_level level[SONDE_LEVELS];   /**< ascending z */
  double pennation_rad[SONDE_COMPARTMENTS]; /**< of the fibres, from the leg's axis to the bone */
  /** Fascia lata at node_muscle_depth: thickness at its medial and its lateral side. */
  double fascia_medial_m, fascia_lateral_m;
} sonde_thigh_anatomy;

/** Kinds of tissue beside vessels. */
typedef enum sonde_tissue {
  SONDE_TISSUE_OUTSIDE,
  SONDE_TISSUE_SKIN,
  SONDE_TISSUE_FAT,
  SONDE_TISSUE_FASCIA, /**< superficial or deep fascia, septum */
  SONDE_TISSUE_MUSCLE,
  SONDE_TISSUE_TENDON,
  SONDE_TISSUE_NERVE,
  SONDE_TISSUE_NODE, /**< lymph node */
  SONDE_TISSUE_BONE,
  SONDE_TISSUE_CUSPS /**< the two cusps of a vein's valve: a body, no tissue of a point */
} sonde_tissue;

/** Signed distances of a rest point, m; negative inside. */
typedef struct sonde_tissue_depths {
  double skin_m;        /**< to the skin's outer face */
  double superficial_m; /**< to the superficial fascia */
  double fascia_m;      /**< to the deep fascia */
  double bone_m;        /**< to the nearest bone */
} sonde_tissue_depths;

/** Most cells that are in reach of one picture. */
enum { SONDE_MAP_SEEDS = 24 };

/**
 * A cell of the power diagram that parts the muscles: a point of a section belongs to the cell of
 * the seed with the least |p - seed|^2 - weight.
 */
typedef struct sonde_map_seed {
  uint32_t cell;        /**< seeds with one cell have no boundary between them */
  uint32_t section;     /**< compartment; a septum parts two of them */
  bool muscle;          /**< false: fat between muscles */
  sonde_vec3 fibre;     /**< unit, along the belly's fibres */
  double pennation_rad; /**< between fibres and belly */
  double lean;          /**< of the fibres: way outward per way along z, from the belly's axis */
} sonde_map_seed;

/** A nerve, tendon, lymph node or a valve's cusps. */
typedef struct sonde_map_body {
  sonde_tissue tissue;
  sonde_vec3 axis; /**< unit, along it */
  /** Semi-axes across, the wide and the thick one, and along it; 0: a cord. Of cusps: the lumen's
   * radius twice and their length. */
  sonde_vec3 half_m;
} sonde_map_body;

/**
 * What knows the tissue of a model at every rest point, from a description finer than its layers.
 * All functions answer for points of the model's frame, from any thread, without allocation.
 */
typedef struct sonde_tissue_map {
  void *self;
  void (*depths)(const void *self, sonde_vec3 rest_m, sonde_tissue_depths *depths);
  /** Vessels are not in it: they are the model's. */
  sonde_tissue (*tissue)(const void *self, sonde_vec3 rest_m);
  /** Seeds that matter within a distance of a point, nearest first, at most `room`; their number.
   */
  uint32_t (*seeds)(const void *self, sonde_vec3 rest_m, double within_m, uint32_t room,
                    uint32_t *seed);
  sonde_map_seed (*seed)(const void *self, uint32_t seed, sonde_vec3 rest_m);
  /** |p - seed|^2 - weight of seeds at a rest point, m^2, and where the seeds are there. */
  void (*powers)(const void *self, sonde_vec3 rest_m, uint32_t count, const uint32_t *seed,
                 double *power_m2, sonde_vec3 *at_m);
  /** Nerves, tendons, nodes and cusps that come within a distance of a point, at most `room`;
   * their number.
   */
  uint32_t (*bodies)(const void *self, sonde_vec3 rest_m, double within_m, uint32_t room,
                     uint32_t *body);
  /** Facts of a body where it comes nearest to a point. */
  sonde_map_body (*body)(const void *self, uint32_t body, sonde_vec3 rest_m);
  /** Place of a point in a body over its semi-axes; along a cord in m. Far beyond its end. Of
   * cusps: across the lumen from one to the other, beside that, and from their roots towards the
   * heart. */
  sonde_vec3 (*body_place)(const void *self, uint32_t body, sonde_vec3 rest_m);
  void (*destroy)(struct sonde_tissue_map *map);
} sonde_tissue_map;

/** The landmark or branch with that name, NULL when absent. @thread any */
SONDE_API const sonde_landmark *sonde_anatomy_landmark(const sonde_thigh_anatomy *anatomy,
                                                       const char *name);

#ifdef __cplusplus
}
#endif
#endif
