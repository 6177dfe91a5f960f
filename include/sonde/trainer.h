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

/** Course and segments of the femoral vein; nothing of a case's pathology. Plain data. */
typedef struct sonde_vein_map {
  uint32_t segment_count, point_count, branch_count;
  sonde_segment segment[SONDE_SEGMENTS]; /**< from the groin to the knee */
  char branch[SONDE_BRANCHES][32];       /**< names of the vessels beside the femoral ones */
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
/** Index of a segment by name or of the one at a model z; SONDE_SEGMENTS when there is none.
 *  @thread any */
SONDE_API uint32_t sonde_vein_segment(const sonde_vein_map *map, const char *name);
SONDE_API uint32_t sonde_vein_segment_at(const sonde_vein_map *map, double z_m); /**< @thread any */
/** Title of a segment for people, e.g. "Common femoral vein". @thread any */
SONDE_API const char *sonde_segment_title(const char *name);

/** A place in a file: a share of a segment, a landmark, or (both empty) millimetres from the groin
 *  end. */
typedef struct sonde_station {
  char segment[32], landmark[32];
  double share;   /**< 0 at the groin end of the segment, 1 at the other */
  double shift_m; /**< added, towards the knee */
} sonde_station;

/** @return NOT_FOUND for a segment or landmark that the thigh has not; ARGUMENT beyond the vein
 * @thread any */
SONDE_API sonde_status sonde_station_find(const sonde_station *station, const sonde_vein_map *map,
                                          double *along_m, sonde_error *error);

/* ---- cases -------------------------------------------------------------------------------- */

enum { SONDE_CASE_VERSION = 2, SONDE_LOOK_ALIKES = 4 };

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
  sonde_thigh known;   /**< parameters that are not drawn */
  sonde_limb_body leg; /**< the same of a limb */
  char model[256];
  sonde_circulation circulation;
  sonde_pathology pathology; /**< of the femoral vein; extent below */
  sonde_case_extent extent;
  uint32_t lesion_count, branch_count;
  sonde_case_lesion lesion[SONDE_LESIONS];
  sonde_case_branch branch[SONDE_BRANCHES];
  double webs, oedema;
  uint32_t truth_count;
  char truth_segment[SONDE_SEGMENTS][32];
  sonde_decision truth[SONDE_SEGMENTS]; /**< compressible or clot */
  bool thrombosis;                      /**< of a deep vein: the overall diagnosis */
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
/** All *.yaml of a directory, by level, then title. @param cases [*count] freed by sonde_free
 *  @return what the first unreadable file says; ARGUMENT for an id that is there twice
 *  @thread owner */
SONDE_API sonde_status sonde_case_list(const char *directory, sonde_case **cases, uint32_t *count,
                                       sonde_error *error);
/** A case drawn by its seed: thigh, circulation, pathology, history, truth. Equal arguments, equal
 *  case. @thread any */
SONDE_API void sonde_case_generate(uint64_t seed, sonde_case_level level, sonde_case *out);

/** A case on its thigh. */
typedef struct sonde_case_setup {
  sonde_model *model; /**< owned */
  sonde_vein_map map;
  sonde_pathology pathology;
  sonde_findings findings;
  sonde_circulation circulation;
} sonde_case_setup;

/** Loads or makes the thigh, places everything on it and checks the truth against it.
 *  @param bundled path of the bundled model; may be NULL when the case does not use it
 *  @param directory of the case file, for model paths; NULL: the working directory
 *  @param[out] setup released by sonde_case_setup_clear()
 *  @return MISMATCH when the truth calls a segment what its vein is not; NOT_FOUND, ARGUMENT naming
 *    the place; what loading or making the model says
 *  @thread owner */
SONDE_API sonde_status sonde_case_build(const sonde_case *from, const char *bundled,
                                        const char *directory, sonde_case_setup *setup,
                                        sonde_error *error);
SONDE_API void sonde_case_setup_clear(sonde_case_setup *setup); /**< @thread owner */
/** Model, pathology, findings, posture and circulation of a session; the setup must outlive it.
 *  @thread owner */
SONDE_API void sonde_case_session(const sonde_case_setup *setup, sonde_session_def *def);

#ifdef __cplusplus
}
#endif
#endif
