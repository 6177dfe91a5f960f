/**
 * @file fit_plausible.h
 * Whether measurements and the parameters fitted to them can belong to soft tissue: units, the
 * course of every curve, published ranges. Bounds and their sources: docs/fit.md.
 */
#ifndef SONDE_FIT_PLAUSIBLE_H
#define SONDE_FIT_PLAUSIBLE_H

#include "sonde/fit.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum sonde_doubt_grade {
  SONDE_DOUBT_WARNING,     /**< worth a look; a fit goes on */
  SONDE_DOUBT_IMPLAUSIBLE, /**< outside what is known of tissue; a fit goes on only when asked to */
  SONDE_DOUBT_ABSURD,      /**< another unit, or no press at all; never fitted */
} sonde_doubt_grade;

/** One objection. */
typedef struct sonde_doubt {
  sonde_doubt_grade grade;
  const char *kind;   /**< short name, e.g. "contact_zero"; static storage */
  uint32_t site;      /**< of the first curve concerned; UINT32_MAX: the whole table */
  char probe[24];     /**< of that curve */
  uint32_t line;      /**< of the measurement file; 0: none */
  uint32_t curves;    /**< curves concerned */
  char sentence[440]; /**< what was found, and what was expected */
} sonde_doubt;

enum { SONDE_DOUBTS = 24 };
typedef struct sonde_doubts {
  uint32_t count;
  sonde_doubt doubt[SONDE_DOUBTS]; /**< at most one per kind */
} sonde_doubts;

/** A quantity with the ranges outside which it is implausible and absurd. */
typedef struct sonde_plausible_range {
  const char *quantity, *unit;
  double absurd_low, low, high, absurd_high;
  const char *source;
} sonde_plausible_range;

/** The table of all ranges, [*count]; static storage. @thread any */
SONDE_API const sonde_plausible_range *sonde_plausible_ranges(uint32_t *count);

/**
 * Examines measurements before a fit: penetration and force in the units of the table, an apparent
 * stiffness within published ranges, forces that rise and stiffen with depth, one phase per curve,
 * forces that vanish at zero depth. Adds to doubts. @thread any
 */
SONDE_API sonde_status sonde_measurements_examine(const sonde_measurements *measurements,
                                                  sonde_doubts *doubts, sonde_error *error);
/**
 * Examines a result: residuals that run with depth, asymptotes against the tissue's thickness,
 * penetrations against the body's. Adds to doubts.
 * @param model what the result was fitted on @thread any
 */
SONDE_API sonde_status sonde_fit_examine(const sonde_model *model,
                                         const sonde_measurements *measurements,
                                         const sonde_fit_result *result, sonde_doubts *doubts,
                                         sonde_error *error);
/** The gravest doubt; NULL when there is none. @thread any */
SONDE_API const sonde_doubt *sonde_doubts_gravest(const sonde_doubts *doubts);

#ifdef __cplusplus
}
#endif
#endif
