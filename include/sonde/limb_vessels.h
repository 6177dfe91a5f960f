/**
 * @file limb_vessels.h
 * The vessels of a limb as a graph: arteries, deep, superficial, perforating and muscle veins from
 * the external iliac vessels to the ankle, their joints and valves, clots in them, and the stations
 * of an examination. docs/limb_vessels.md.
 *
 * Points are in the limb's frame (limb.h), those of a left limb mirrored in x. A branch begins at
 * its proximal end; arc counts from there, in metres. A vein's parent is the vein that it drains
 * into.
 */
#ifndef SONDE_LIMB_VESSELS_H
#define SONDE_LIMB_VESSELS_H

#include "sonde/limb.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SONDE_LIMB_VESSEL_NAME = 40, SONDE_LIMB_STATIONS = 15, SONDE_LIMB_STATION_VEINS = 4 };
#define SONDE_LIMB_NO_VESSEL UINT32_MAX

typedef enum sonde_limb_vessel_kind {
  SONDE_LIMB_ARTERY,
  SONDE_LIMB_DEEP_VEIN,
  SONDE_LIMB_SUPERFICIAL_VEIN,
  SONDE_LIMB_PERFORATOR,
  SONDE_LIMB_MUSCLE_VEIN
} sonde_limb_vessel_kind;

typedef enum sonde_limb_saphenous {
  SONDE_LIMB_GSV_SINGLE, /**< one trunk, medial */
  SONDE_LIMB_GSV_LATERAL,
  SONDE_LIMB_GSV_DOUBLE,
  SONDE_LIMB_GSV_LOOP,   /**< a second trunk leaves and comes back */
  SONDE_LIMB_GSV_PARTIAL /**< thin for a stretch, beside it a tributary outside the fascia */
} sonde_limb_saphenous;

typedef enum sonde_limb_small_saphenous {
  SONDE_LIMB_SSV_JUNCTION, /**< ends in the popliteal vein */
  SONDE_LIMB_SSV_EXTENDED, /**< the same, and a vein goes on into the thigh */
  SONDE_LIMB_SSV_THIGH     /**< no junction: goes on to the great saphenous vein */
} sonde_limb_small_saphenous;

typedef enum sonde_limb_popliteal_artery {
  SONDE_LIMB_POPLITEAL_USUAL,        /**< anterior tibial first, then the trunk */
  SONDE_LIMB_POPLITEAL_TRIFURCATION, /**< all three at one place */
  SONDE_LIMB_POPLITEAL_HIGH          /**< anterior tibial above the joint line */
} sonde_limb_popliteal_artery;

/** What kinds a limb's vessels are. Frequencies: docs/limb_vessels.md. */
typedef struct sonde_limb_variants {
  sonde_limb_saphenous great_saphenous;
  sonde_limb_small_saphenous small_saphenous;
  sonde_limb_popliteal_artery popliteal_artery;
  uint32_t second_femoral;      /**< 0: one femoral vein; 1 medial, 2 lateral second vein, 3 both */
  uint32_t second_popliteal;    /**< 0 none; 1 below the joint only; 2 true double vein */
  uint32_t deep_popliteal_link; /**< deep femoral vein goes on into the popliteal vein */
  uint32_t single_tibial, single_peroneal; /**< one vein instead of two */
  uint32_t common_sural_trunk; /**< a gastrocnemius vein ends in the small saphenous vein */
  uint32_t gastrocnemius[2];   /**< trunks of the medial and the lateral head, 1 or 2 */
  uint32_t perforators;        /**< number wanted */
} sonde_limb_variants;

/** One branch. */
typedef struct sonde_limb_vessel {
  char name[SONDE_LIMB_VESSEL_NAME];
  sonde_limb_vessel_kind kind;
  uint32_t parent; /**< joined at arc 0; SONDE_LIMB_NO_VESSEL: a root */
  double parent_arc_m;
  uint32_t joins; /**< joined at the distal end, or SONDE_LIMB_NO_VESSEL */
  double joins_arc_m;
  uint32_t mate; /**< artery beside a deep vein, or SONDE_LIMB_NO_VESSEL */
  double length_m;
  double pressure_pa; /**< at rest, supine: mean arterial, or venous at this height */
  uint32_t points, valves;
} sonde_limb_vessel;

/** A place on a branch. */
typedef struct sonde_limb_vessel_point {
  sonde_vec3 centre_m;
  sonde_vec3 direction; /**< unit, distal */
  double radius_m;      /**< of the lumen at rest */
  double wall_m;        /**< thickness */
  double area_m2;       /**< of the lumen at rest */
} sonde_limb_vessel_point;

/** A valve: two cusps across the lumen, a sinus behind each. */
typedef struct sonde_limb_valve {
  double arc_m;
  double cusp_m;  /**< length of a cusp: 1.2 diameters */
  double sinus_m; /**< the lumen's radius at the sinus' widest place */
} sonde_limb_valve;

/** Nearest vessel at a point. */
typedef struct sonde_limb_vessel_near {
  uint32_t vessel;
  double arc_m;
  double lumen_m; /**< signed distance to the lumen's surface, joints rounded; negative inside */
  double wall_m;  /**< thickness there; the outer face is at lumen_m = wall_m */
} sonde_limb_vessel_near;

/** Places that keep no distance; all 0 in a sound limb. */
typedef struct sonde_limb_vessel_faults {
  uint32_t walls;  /**< places whose wall is nearer than 0.3 mm to another vessel's */
  uint32_t bone;   /**< places nearer than 1.5 mm to bone */
  uint32_t lumen;  /**< of these, lumen in bone */
  uint32_t fascia; /**< deep places nearer than 0.3 mm to the deep fascia, or beyond it */
  uint32_t eye;    /**< saphenous places not between the two fasciae */
} sonde_limb_vessel_faults;

SONDE_API const sonde_limb_variants *
sonde_limb_vessel_variants(const sonde_limb *limb); /**< Owned by limb. @thread any */
SONDE_API sonde_limb_vessel_faults
sonde_limb_vessel_check(const sonde_limb *limb);                    /**< @thread any */
SONDE_API uint32_t sonde_limb_vessel_count(const sonde_limb *limb); /**< @thread any */
/** A branch by number, 0 to count - 1. @thread any */
SONDE_API sonde_limb_vessel sonde_limb_vessel_get(const sonde_limb *limb, uint32_t vessel);
/** @return the first branch of that name, or SONDE_LIMB_NO_VESSEL. @thread any */
SONDE_API uint32_t sonde_limb_vessel_find(const sonde_limb *limb, const char *name);
/** Place at an arc, which is kept on the branch. @thread any */
SONDE_API sonde_limb_vessel_point sonde_limb_vessel_place(const sonde_limb *limb, uint32_t vessel,
                                                          double arc_m);
/** @param k 0 to valves - 1, proximal first. @thread any */
SONDE_API sonde_limb_valve sonde_limb_vessel_valve(const sonde_limb *limb, uint32_t vessel,
                                                   uint32_t k);
/** Nearest vessel. Below a microsecond; never waits. @thread any */
SONDE_API sonde_limb_vessel_near sonde_limb_vessel_at(const sonde_limb *limb, sonde_vec3 point_m);

/** How a clot fills the lumen. */
typedef enum sonde_limb_clot_kind {
  SONDE_LIMB_CLOT_OCCLUSIVE, /**< all of the lumen; ends rounded */
  SONDE_LIMB_CLOT_MURAL,     /**< `share` of the area, against the wall that lies lowest, supine */
  SONDE_LIMB_CLOT_FLOATING,  /**< `share` of the area in the middle, blood all around; held distally
                              */
  SONDE_LIMB_CLOT_RECANALISED /**< all but a channel of 1 - `share` of the area */
} sonde_limb_clot_kind;

/** A clot in a branch, from its proximal end (the head) to its distal end (the tail). */
typedef struct sonde_limb_clot {
  uint32_t vessel;
  double from_m, to_m; /**< arcs, from < to */
  double share;        /**< of the lumen's area, 0 to 1; OCCLUSIVE: 1 */
  sonde_limb_clot_kind kind;
  double age_days;
} sonde_limb_clot;

/** @return ARGUMENT naming what is wrong with a clot of this limb. @thread any */
SONDE_API sonde_status sonde_limb_clot_check(const sonde_limb *limb, const sonde_limb_clot *clot,
                                             sonde_error *error);
/** Area of the lumen that a checked clot leaves open at an arc, at rest, m2. @thread any */
SONDE_API double sonde_limb_clot_open(const sonde_limb *limb, const sonde_limb_clot *clot,
                                      double arc_m);
/** @return the first of `count` checked clots that fills the point, or count. @thread any */
SONDE_API uint32_t sonde_limb_clot_at(const sonde_limb *limb, const sonde_limb_clot *clots,
                                      uint32_t count, sonde_vec3 point_m);

/** How the patient lies for a station. */
typedef enum sonde_limb_position {
  SONDE_LIMB_SUPINE_TURNED, /**< head up 10-20 degrees, hip turned out 30, knee bent 20-30 */
  SONDE_LIMB_PRONE_BENT,    /**< prone or on the side, knee bent 20-30 */
  SONDE_LIMB_SITTING,       /**< leg hangs */
  SONDE_LIMB_SUPINE,        /**< leg straight: the limb as it is made */
  SONDE_LIMB_PRONE,
  SONDE_LIMB_STANDING,
  SONDE_LIMB_POSITIONS
} sonde_limb_position;

/** A station of an examination on one limb. */
typedef struct sonde_limb_station {
  const char *name;
  const char *text; /**< landmarks that must be seen, one sentence */
  const char *view; /**< of docs/limb_vessels.md: "V1" to "V11" */
  sonde_limb_position position;
  uint32_t veins; /**< that are to be judged here */
  uint32_t vein[SONDE_LIMB_STATION_VEINS];
  double arc_m[SONDE_LIMB_STATION_VEINS];
  double level;
  sonde_vec3 target_m; /**< centre of the first vein */
  sonde_vec3 skin_m;   /**< where the probe's face is put */
  sonde_vec3 normal;   /**< of the skin, outward */
  sonde_pose probe;    /**< transverse: +z into the tissue, +x to the patient's left or the back */
  double depth_m;      /**< skin to the front wall of the first vein */
  double force_n[2];   /**< within which a healthy vein at this depth closes, supine */
} sonde_limb_station;

/** The stations of a limb from groin to ankle. @thread any */
SONDE_API void sonde_limb_stations(const sonde_limb *limb,
                                   sonde_limb_station stations[SONDE_LIMB_STATIONS]);
/** Forces between which a healthy deep vein at a depth closes under a 40 x 8 to 50 x 12 mm face, N.
 * @thread any */
SONDE_API void sonde_limb_force_band(double depth_m, double force_n[2]);

/** A protocol: which stations, and how often between the first and the last. */
typedef struct sonde_limb_protocol {
  const char *name, *text;
  uint32_t stations, station[SONDE_LIMB_STATIONS]; /**< numbers of sonde_limb_stations() */
  double every_m; /**< also a compression this far apart from first to last; 0: stations alone */
} sonde_limb_protocol;

/** The protocols. @thread any */
SONDE_API const sonde_limb_protocol *sonde_limb_protocols(uint32_t *count);

#ifdef __cplusplus
}
#endif
#endif
