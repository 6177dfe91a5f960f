/**
 * @file echo_validate.h
 * Measures of the fast image against the exact reference, with scatterers in a bare medium.
 */
#ifndef SONDE_ECHO_VALIDATE_H
#define SONDE_ECHO_VALIDATE_H

#include "sonde/echo.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A view to measure: what sonde_echo_render() gets besides the tissue. */
typedef struct sonde_echo_view {
  sonde_echo *echo;
  double aperture_m;
  sonde_echo_settings settings;
} sonde_echo_view;

/** Correlation of the envelopes of the fast image and the reference (Pearson, means taken off) for
 *  `count` random scatterers of +-1 in a block of 7 mm x 3 mm about the middle line at depth_m;
 *  pixels nearer than 1.5 mm x 0.5 mm to its border do not count. @return SONDE_MEMORY
 *  @thread owner */
SONDE_API sonde_status sonde_echo_likeness(const sonde_echo_view *view, double depth_m,
                                           uint32_t count, uint64_t seed, double *likeness,
                                           sonde_error *error);

/** Full widths at half maximum of a point's envelope, m. */
typedef struct sonde_echo_widths {
  double axial_m, lateral_m;
} sonde_echo_widths;

/** Widths at a depth, from a point moved in steps of a tenth of a line and of a sample.
 *  @return SONDE_MEMORY @thread owner */
SONDE_API sonde_status sonde_echo_point_widths(const sonde_echo_view *view, double depth_m,
                                               sonde_echo_widths *fast,
                                               sonde_echo_widths *reference, sonde_error *error);

/** Change of the envelope when all scatterers move by a fraction of a sample and the picture is
 *  moved back by band-limited interpolation of the intensity: rms over rms, the mean square over
 *  seven fractions. @return SONDE_MEMORY @thread owner */
SONDE_API sonde_status sonde_echo_flicker(const sonde_echo_view *view, double depth_m,
                                          uint32_t count, uint64_t seed, double *flicker,
                                          sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
