/**
 * @file sweep_strain.h
 * Axial strain as scanners show it: envelopes of two pictures are tracked, the slope of the
 * displacement along the lines is the strain.
 */
#ifndef SONDE_SWEEP_STRAIN_H
#define SONDE_SWEEP_STRAIN_H

#include "sonde/echo.h"

#ifdef __cplusplus
extern "C" {
#endif

/** How envelopes are tracked; lengths in m along the lines. */
typedef struct sonde_strain_def {
  uint32_t version; /**< SONDE_DEF_VERSION, from sonde_strain_def_default() */
  double window_m;  /**< of what is compared; default 2 mm */
  double hop_m;     /**< between places; default 0.5 mm */
  double most_m;    /**< displacement to either side that is searched; default 1 mm */
  double slope_m;   /**< over which the slope is fitted; default 4 mm */
  uint32_t beside;  /**< lines to either side that are compared with each; default 3 */
} sonde_strain_def;
SONDE_API sonde_strain_def sonde_strain_def_default(void); /**< @thread any */

/** Fields at places [row * lines + line]; owns its arrays. */
typedef struct sonde_strain {
  uint32_t rows, lines;
  double first_m, hop_m; /**< depth of the first row, and between rows */
  double slope_m;        /**< as asked for */
  float *displacement_m; /**< along the line, positive deeper */
  float *likeness;       /**< greatest correlation of the two windows, -1..1 */
  float *strain;         /**< slope of the displacement; negative: compressed */
} sonde_strain;

/**
 * Tracks envelopes of two pictures of one view by normalised cross-correlation, its peak between
 * samples by a parabola.
 * @param before, after [samples*lines] sample-major, as sonde_echo_envelope() gives them
 * @param step_m between samples @param def NULL: the default @param[out] strain owned by the caller
 * @return ARGUMENT when the windows do not fit into the samples; MEMORY @thread owner
 */
SONDE_API sonde_status sonde_strain_track(const float *before, const float *after, uint32_t lines,
                                          uint32_t samples, double step_m,
                                          const sonde_strain_def *def, sonde_strain *strain,
                                          sonde_error *error);
/** Slopes of any displacement at the same places, such as a true one, by weighted least squares.
 *  @param displacement_m [rows*lines] @param weight [rows*lines], NULL: all alike
 *  @param[out] slope [rows*lines] @thread any */
SONDE_API void sonde_strain_slopes(const sonde_strain *strain, const float *displacement_m,
                                   const float *weight, float *slope);
SONDE_API void sonde_strain_clear(sonde_strain *strain); /**< @thread owner */

#ifdef __cplusplus
}
#endif
#endif
