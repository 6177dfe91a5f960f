/**
 * @file trainer.h
 * Cases of the examination, as files that teachers write, and the vein that is examined:
 * docs/trainer.md. Protocols: sonde/trainer_protocol.h; judge and score: sonde/trainer_judge.h;
 * scripted operators: sonde/trainer_operator.h.
 */
#ifndef SONDE_TRAINER_H
#define SONDE_TRAINER_H

#include "sonde/anatomy.h"
#include "sonde/exam.h"
#include "sonde/interior_findings.h"
#include "sonde/limb_model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- the vein as the examination knows it ------------------------------------------------- */

/** A place on the femoral vein and the skin above it, at rest. */
typedef struct sonde_vein_point {
  double along_m; /**< along the vein from its end at the groin */
  double z_m;     /**< model z */
  sonde_vec3 vein_m, skin_m;
  sonde_vec3 normal; /**< outward, unit */
  sonde_vec3 across; /**< unit: direction of the probe's x for a transverse plane */
  double radius_m, depth_m;
} sonde_vein_point;

/** A probe's pose above a place: plane across the vein, face depth_m below the skin. @thread any */
SONDE_API sonde_pose sonde_vein_pose(const sonde_vein_point *place, double depth_m);

/** What a clot in a segment means. */
typedef enum sonde_segment_kind {
  SONDE_SEGMENT_MAIN,       /**< common femoral to popliteal: proximal deep vein thrombosis */
  SONDE_SEGMENT_DEEP,       /**< another proximal deep vein: likewise */
  SONDE_SEGMENT_CALF,       /**< a deep or muscle vein below the knee: distal thrombosis */
  SONDE_SEGMENT_SUPERFICIAL /**< saphenous: no deep vein thrombosis */
} sonde_segment_kind;

enum { SONDE_SEGMENT_VEINS = 4 };
/** Veins that get one finding: a stretch of the main vein, or branches beside it. */
typedef struct sonde_exam_segment {
  char name[32];
  double from_m, to_m; /**< model z; of branches: that they reach */
  sonde_segment_kind kind;
  uint32_t vein_count;                /**< 0: of the main vein */
  uint32_t vein[SONDE_SEGMENT_VEINS]; /**< as sonde_vein_crossing.vessel; of a pair both */
} sonde_exam_segment;

/** A station of the limb: where a probe is put. */
typedef struct sonde_map_station {
  char name[32];
  const char *text; /**< landmarks that must be seen, static; NULL: of a thigh */
  uint32_t segment; /**< that it examines unless a protocol says another one */
  sonde_pose probe; /**< on the skin, transverse, +z into the tissue */
  /** [segment] where its plane cuts the first of a segment's veins under the face (NaN: nowhere),
   * slid by slide_m along the leg, towards the foot, until it does. */
  sonde_vec3 vein_m[SONDE_SEGMENTS];
  double slide_m[SONDE_SEGMENTS];
} sonde_map_station;

enum { SONDE_MAP_MIDDLES = 32 };

/** Course and segments of the veins; nothing of a case's pathology. Plain data. */
typedef struct sonde_vein_map {
  uint32_t segment_count, point_count, branch_count, station_count;
  sonde_exam_segment segment[SONDE_SEGMENTS]; /**< of the main vein to the knee, then others */
  char branch[SONDE_BRANCHES][32];            /**< names of the vessels beside the femoral ones */
  sonde_map_station station[SONDE_LANDMARKS]; /**< of a limb, from groin to calf */
  /** Middle of the leg at equal steps of z from middle_z_m[0] to [1]; all 0: not known. */
  sonde_vec3 middle_m[SONDE_MAP_MIDDLES];
  double middle_z_m[2];
  uint32_t landmark_count;
  char landmark[SONDE_LANDMARKS][32]; /**< names of the model's landmarks */
  double landmark_z_m[SONDE_LANDMARKS];
  sonde_vein_point point[SONDE_VESSEL_POINTS];
  double length_m;
} sonde_vein_map;

/** Segments of the model's anatomy, cut to the vein's course; a model without anatomy gets the five
 *  of SONDE_SEGMENT names at fixed shares of the course. @return MESH for a model without a vein
 *  @thread owner */
SONDE_API sonde_status sonde_vein_map_make(const sonde_model *model, sonde_vein_map *map,
                                           sonde_error *error);
/** The point at a distance from the groin end (clamped), interpolated. @thread any */
SONDE_API sonde_vein_point sonde_vein_at(const sonde_vein_map *map, double along_m);
/** Distance from the groin end of the point with that model z (clamped). @thread any */
SONDE_API double sonde_vein_along(const sonde_vein_map *map, double z_m);
/** Whether the thigh has a branch of that name. @thread any */
SONDE_API bool sonde_vein_has_branch(const sonde_vein_map *map, const char *name);
/** A segment by name, or the main vein's at a model z; else SONDE_SEGMENTS. @thread any */
SONDE_API uint32_t sonde_vein_segment(const sonde_vein_map *map, const char *name);
SONDE_API uint32_t sonde_vein_segment_at(const sonde_vein_map *map, double z_m); /**< @thread any */
/** Title of a segment for people, e.g. "Common femoral vein". @thread any */
SONDE_API const char *sonde_segment_title(const char *name);

/** A place in a file: a station, a share of a segment, a landmark, a share of the branch that the
 *  file speaks of, or (all empty) millimetres from the groin end. */
typedef struct sonde_station {
  char segment[32], landmark[32];
  char station[32]; /**< of the limb (docs/limb_model.md), or the place of a thigh's vein */
  bool of_branch;   /**< share and shift_m count along a branch from its proximal end */
  double share;     /**< 0 at the groin end of the segment, 1 at the other */
  double shift_m;   /**< added, towards the knee */
} sonde_station;

/** Where a place of the main vein is.
 * @return NOT_FOUND for a station, segment or landmark that the thigh has not, or a station of
 * another vein; ARGUMENT beyond the vein @thread any */
SONDE_API sonde_status sonde_station_find(const sonde_station *station, const sonde_vein_map *map,
                                          double *along_m, sonde_error *error);

/** How open the veins of a segment are in a snapshot: the greatest area ratio of those under the
 *  face; NaN when none is in view.
 *  @param[out] rest_m where the plane cuts the first of them; may be NULL @thread any */
SONDE_API double sonde_segment_ratio(const sonde_vein_map *map, uint32_t segment,
                                     const sonde_snapshot *snapshot, sonde_vec3 *rest_m);

/* ---- cases -------------------------------------------------------------------------------- */

enum { SONDE_CASE_VERSION = 3, SONDE_LOOK_ALIKES = 4 };

typedef enum sonde_case_level {
  SONDE_CASE_FIRST,
  SONDE_CASE_EASY,
  SONDE_CASE_HARD
} sonde_case_level;
typedef enum sonde_case_thigh {
  SONDE_CASE_BUNDLED,   /**< the model that ships with the program */
  SONDE_CASE_GENERATED, /**< from a seed and what is known */
  SONDE_CASE_MODEL,     /**< a model file, relative to the case file */
  SONDE_CASE_LEG        /**< a whole limb from a seed and what is known */
} sonde_case_thigh;

typedef enum sonde_decision {
  SONDE_DECISION_NONE,
  SONDE_DECISION_COMPRESSIBLE,
  SONDE_DECISION_CLOT,
  SONDE_DECISION_NOT_SEEN,
  SONDE_DECISIONS
} sonde_decision;
/** "first", "easy", "hard". @thread any */
SONDE_API const char *sonde_case_level_name(sonde_case_level level);
/** "", "compressible", "clot", "not_seen". @thread any */
SONDE_API const char *sonde_decision_name(sonde_decision decision);
/** @return false for an unknown name @thread any */
SONDE_API bool sonde_decision_parse(const char *name, sonde_decision *decision);

/** Stretch of a vein; whole: all of it. */
typedef struct sonde_case_extent {
  bool whole;
  sonde_station from, to;
} sonde_case_extent;

typedef struct sonde_case_lesion {
  sonde_lesion_kind kind;
  sonde_station station;
  double across_m; /**< from the vein's middle along the map's across direction */
  double depth_m;  /**< of the centre below the skin */
  sonde_vec3 half_m;
  double echogenicity;
} sonde_case_lesion;

typedef struct sonde_case_branch {
  char branch[32];
  sonde_pathology pathology;
  sonde_case_extent extent;
} sonde_case_branch;

/** A patient with a question, and the answer. Plain data: a struct copy is a copy. */
typedef struct sonde_case {
  char id[48], title[96];
  sonde_case_level level;
  char history[1024]; /**< read by the learner */
  char note[1024];    /**< for teaching, after the exam */
  sonde_case_thigh thigh;
  uint64_t seed;
  sonde_thigh known;            /**< parameters that are not drawn */
  sonde_limb_body leg;          /**< the same of a limb */
  sonde_limb_position position; /**< of the leg at first; SONDE_LIMB_POSITIONS: straight, lying */
  uint32_t positions;           /**< a bit for each that the patient can take beside it */
  char model[256];
  sonde_circulation circulation;
  sonde_pathology pathology; /**< of the femoral vein; extent below */
  sonde_case_extent extent;
  uint32_t lesion_count, branch_count, truth_count;
  sonde_case_lesion lesion[SONDE_LESIONS];
  sonde_case_branch branch[SONDE_BRANCHES];
  double webs, oedema;
  char truth_segment[SONDE_SEGMENTS][32];
  sonde_decision truth[SONDE_SEGMENTS]; /**< compressible or clot */
  bool thrombosis;                      /**< of a deep vein, of the calf too: the diagnosis */
  char diagnosis[160];                  /**< in words */
  uint32_t look_alike_count;
  char look_alike[SONDE_LOOK_ALIKES][48];
} sonde_case;

/** A healthy vein in the bundled thigh without id or truth. @thread any */
SONDE_API sonde_case sonde_case_default(void);
/** Reads a case; everything in it is checked that needs no model.
 *  @return FORMAT, ARGUMENT, VERSION "file:line: what was expected"; IO @thread owner */
SONDE_API sonde_status sonde_case_load(const char *path, sonde_case *out, sonde_error *error);
/** The same from text. @param name of the text in messages @thread owner */
SONDE_API sonde_status sonde_case_parse(const char *text, const char *name, sonde_case *out,
                                        sonde_error *error);
/** Writes a file that loads to the same case, atomically. @thread owner */
SONDE_API sonde_status sonde_case_save(const sonde_case *from, const char *path,
                                       sonde_error *error);
/** The text of such a file. @param[out] text freed by sonde_free() @thread owner */
SONDE_API sonde_status sonde_case_text(const sonde_case *from, char **text, sonde_error *error);
/** What the case says of a segment, else what its findings put into the branches. @thread any */
SONDE_API sonde_decision sonde_case_truth(const sonde_case *of, const char *segment);
/** All *.yaml of a directory, by level, then title. @param cases [*count] freed by sonde_free
 *  @return what the first unreadable file says; ARGUMENT for an id that is there twice
 *  @thread owner */
SONDE_API sonde_status sonde_case_list(const char *directory, sonde_case **cases, uint32_t *count,
                                       sonde_error *error);
/** A case drawn by its seed: thigh, circulation, pathology, history, truth. Equal arguments, equal
 *  case. @thread any */
SONDE_API void sonde_case_generate(uint64_t seed, sonde_case_level level, sonde_case *out);

/** Whether the patient can take a position: the first one, or one that a leg's case allows. A case
 *  whose circulation has a posture keeps to it. @thread any */
SONDE_API bool sonde_case_takes(const sonde_case *of, sonde_limb_position position);
/** Key of a position in files, e.g. "prone_bent"; SONDE_LIMB_POSITIONS: "straight". @thread any */
SONDE_API const char *sonde_position_key(sonde_limb_position position);
/** The position of a key; false, and nothing written, for another text or NULL. @thread any */
SONDE_API bool sonde_position_parse(const char *key, sonde_limb_position *position);
/** What the patient does in a position, e.g. "prone, the knee bent". @thread any */
SONDE_API const char *sonde_position_title(sonde_limb_position position);

#ifdef __cplusplus
}
#endif
#endif
