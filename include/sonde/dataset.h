/**
 * @file dataset.h
 * Data sets for machine learning: a seeded population of legs, pressed by seeded operators, drawn
 * by scanners, with everything that is known of every pixel. docs/dataset.md.
 */
#ifndef SONDE_DATASET_H
#define SONDE_DATASET_H

#include "sonde/echo.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SONDE_DATASET_VERSION = 1, SONDE_DATASET_SCANNERS = 16, SONDE_DATASET_ARRAYS = 7 };

/** Arrays of a frame: name, bytes of a number, numbers of a pixel, meaning. */
#define SONDE_DATASET_ARRAY_LIST(X)                                                                \
  X(clot, 1, 1, "255 where the pixel shows a clot, else 0")                                        \
  X(displacement, 4, 3, "of the tissue from rest, m, in the probe's frame")                        \
  X(envelope, 4, 1, "echo amplitude before compression, a row for each depth, a column each line") \
  X(image, 1, 1, "the picture, grey values")                                                       \
  X(strain, 4, 6, "Green-Lagrange strain from rest, xx yy zz xy xz yz; NaN where there is none")   \
  X(tissue, 1, 1, "class of the tissue, see the data card")                                        \
  X(vessel, 1, 1, "0, or the number of the vessel whose wall, lumen or clot it is")

enum {
#define SONDE_DATASET_ARRAY_NUMBER(name, bytes, parts, text) SONDE_DATASET_##name,
  SONDE_DATASET_ARRAY_LIST(SONDE_DATASET_ARRAY_NUMBER)
#undef SONDE_DATASET_ARRAY_NUMBER
};

/** Whose legs they are. */
typedef enum sonde_dataset_legs {
  SONDE_DATASET_LIMBS,  /**< a drawn limb for each */
  SONDE_DATASET_BUNDLED /**< the bundled thigh for all */
} sonde_dataset_legs;

/** What a data set holds. Plain data; a file of it is YAML (docs/dataset.md). */
typedef struct sonde_dataset_plan {
  uint32_t version; /**< SONDE_DEF_VERSION, from sonde_dataset_plan_default() */
  char title[96];
  char licence[32];         /**< of the data set, its SPDX identifier, for the data card */
  uint64_t seed;            /**< below 2^32 */
  uint32_t legs;            /**< patients; a further one leaves those before it as they are */
  uint32_t presses, frames; /**< of each leg, of each press */
  uint32_t width, height;   /**< of pictures and labels */
  sonde_dataset_legs body;
  uint32_t levels;    /**< a bit for each sonde_case_level that is drawn */
  uint32_t positions; /**< a bit for each sonde_limb_position, and above them for straight */
  uint32_t arrays;    /**< a bit for each array that is written */
  uint32_t scanner_count;
  char scanner[SONDE_DATASET_SCANNERS][64]; /**< names or files, drawn evenly */
  double clot_share;                        /**< of the legs with a deep vein thrombosis */
  double station_share;                     /**< of the presses at a station of a limb */
  double along_share;                       /**< of the presses that look along the vein */
  double contact_n;                         /**< of a press's first frame */
  double force_low_n, force_high_n;         /**< of its last one, drawn evenly */
  double shift_m, tilt_rad, turn_rad;       /**< standard deviations of the operator's hand */
  double setting[SONDE_ECHO_SETTINGS][2];   /**< drawn evenly, in the order and the units of
                                                 sonde_echo_ranges(); NaN: the scanner's own */
} sonde_dataset_plan;

/** 12 legs, 4 presses of 6 frames, 256 x 256 pixels, half of the legs with a clot. @thread any */
SONDE_API sonde_dataset_plan sonde_dataset_plan_default(void);
/** Reads a plan over the default. @return FORMAT, ARGUMENT, VERSION "file:line: what was expected";
 *  IO @thread owner */
SONDE_API sonde_status sonde_dataset_plan_load(const char *path, sonde_dataset_plan *plan,
                                               sonde_error *error);
/** Whether its numbers are within their ranges. @return ARGUMENT @thread any */
SONDE_API sonde_status sonde_dataset_plan_check(const sonde_dataset_plan *plan, sonde_error *error);
/** The text of a file that loads to the same plan. @param[out] text freed by sonde_free()
 *  @return MEMORY @thread owner */
SONDE_API sonde_status sonde_dataset_plan_text(const sonde_dataset_plan *plan, char **text,
                                               sonde_error *error);

/** "clot", ... @param array less than SONDE_DATASET_ARRAYS @thread any */
SONDE_API const char *sonde_dataset_array_name(uint32_t array);
/** What it holds, a sentence's end. @thread any */
SONDE_API const char *sonde_dataset_array_text(uint32_t array);

/** One array of a frame: uint8, or little-endian float32 when `bytes` is 4. */
typedef struct sonde_dataset_array {
  const void *data; /**< [rows*columns*parts] borrowed; NULL: not written */
  uint32_t bytes, rows, columns, parts;
} sonde_dataset_array;

/** A frame as a format writes it; all borrowed. */
typedef struct sonde_dataset_frame {
  char key[32];                                    /**< leg, press and frame: 000012_03_05 */
  sonde_dataset_array array[SONDE_DATASET_ARRAYS]; /**< by number */
  const char *json;                                /**< what else is known, one JSON object */
  size_t json_bytes;
} sonde_dataset_frame;

/** A file format that the program adds: the frames of one leg become one file, made in memory.
 *  The same frames must give the same bytes. */
typedef struct sonde_dataset_format {
  const char *ending; /**< of the files: "h5" */
  sonde_status (*open)(void **leg, sonde_error *error);
  sonde_status (*put)(void *leg, const sonde_dataset_frame *frame, sonde_error *error);
  /** @param[out] bytes [*count] freed by free() */
  sonde_status (*bytes)(void *leg, void **bytes, size_t *count, sonde_error *error);
  void (*close)(void *leg);
} sonde_dataset_format;

/** How a data set is written. */
typedef struct sonde_dataset_def {
  uint32_t version;                   /**< SONDE_DEF_VERSION, from sonde_dataset_def_default() */
  const sonde_dataset_plan *plan;     /**< borrowed */
  const char *directory;              /**< made when absent */
  const char *bundled;                /**< path of the bundled model; may be NULL for limbs */
  const char *scanners;               /**< directory of the scanners that ship */
  uint32_t shard, shards;             /**< of 1 to `shards`; default 1 of 1 */
  bool folder;                        /**< a folder of files for each leg instead of a tar file */
  const sonde_dataset_format *format; /**< instead of both; NULL, the default: none */
  const sonde_progress *progress;     /**< may be NULL */
} sonde_dataset_def;
/** @thread any */
SONDE_API sonde_dataset_def sonde_dataset_def_default(void);

/** What a data set, or what of it there is, holds. */
typedef struct sonde_dataset_count {
  uint32_t legs;    /**< that are there, whole */
  uint32_t made;    /**< of them by this call */
  uint32_t frames;  /**< of the legs that are there */
  uint32_t stopped; /**< presses that ended early: no equilibrium, or force out of reach */
  uint32_t clots;   /**< frames that show a clot */
  uint64_t bytes;   /**< of all files of frames */
  bool whole;       /**< every leg of the plan is there, manifest and data card were written */
} sonde_dataset_count;

/**
 * Makes the legs of a shard, those before it that are whole already left as they are. Whoever ends
 * last writes manifest.json, SHA256SUMS, README.md and card.json. Everything but the plan stands
 * aside until it is whole, so that a killed or failed call can be made again; its bytes depend on
 * the plan and the format alone, not on shards, threads or order.
 * @param[out] count also after a failure
 * @return MISMATCH for a directory with another plan or format, or made by another version; IO,
 *   DISK, MEMORY; CANCELLED; NOT_FOUND for a scanner
 * @thread owner
 */
SONDE_API sonde_status sonde_dataset_write(const sonde_dataset_def *def, sonde_dataset_count *count,
                                           sonde_error *error);
/**
 * Reads every file of a whole data set and compares it with its SHA-256.
 * @param[out] files that are right
 * @return CHECKSUM naming the first that differs, IO for one that is missing, FORMAT
 * @thread owner
 */
SONDE_API sonde_status sonde_dataset_verify(const char *directory, const sonde_progress *progress,
                                            uint32_t *files, sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
