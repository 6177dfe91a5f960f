/**
 * @file echo_scanner.h
 * A scanner as numbers: its beam, its receiver and what it does to the picture before it shows it.
 */
#ifndef SONDE_ECHO_SCANNER_H
#define SONDE_ECHO_SCANNER_H

#include "sonde/echo.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SONDE_SCANNER_SLIDERS = 8, SONDE_MOST_LOOKS = 5 };

/** A scanner. docs/echo.md explains every number, data/scanners holds some. */
typedef struct sonde_scanner {
  sonde_echo_settings settings; /**< with which it starts */
  double aperture_m;            /**< of its probe; 0: whatever probe is used */
  double radius_m;              /**< of a curved face; 0: flat */
  double transmit_f, receive_f; /**< focal depth over aperture */
  double pulse_wavelengths;     /**< envelope of the echo between half values, along depth */
  double sound_speeds;          /**< 1: tissues have their own speeds of sound; 0: 1540 m/s */
  double looks;                 /**< 1 to SONDE_MOST_LOOKS angles whose envelopes are averaged */
  double look_rad;              /**< from the middle look to the outermost */
  double noise_db;        /**< receiver's noise over muscle at the skin, before compensation */
  double compensation_db; /**< ceiling of the time-gain compensation */
  double slider_db[SONDE_SCANNER_SLIDERS]; /**< gain at even depths, face to bottom */
  double haze_db;     /**< power of the side lobes over the main lobe; -90: none */
  double ghost_db;    /**< echo of the probe's own face; -90: no reverberation */
  double white_db;    /**< white over the rms of muscle speckle */
  double map_gamma;   /**< exponent of the grey map */
  double map_knee;    /**< 0..1: share of a smooth step in it */
  double filter;      /**< 0..1: strength of the smoothing along lines */
  double filter_m;    /**< reach of it to either side */
  double sharpening;  /**< share of what a blur takes away that is added */
  double persistence; /**< 0..0.9: share of the pictures before in a live picture */
  double cubic;       /**< 1: bicubic scan conversion; 0: bilinear */
} sonde_scanner;

/** A number of a scanner as files give it. */
typedef struct sonde_scanner_number {
  const char *key;  /**< with the unit, e.g. "look_deg" */
  double low, high; /**< in that unit */
  double plain;     /**< of the plain scanner: one look, logarithm, nothing else */
  double si;        /**< factor to the unit of the member */
  size_t offset;    /**< of the member in sonde_scanner */
} sonde_scanner_number;

/** All numbers but the sliders. @param count of them @return [*count] @thread any */
SONDE_API const sonde_scanner_number *sonde_scanner_numbers(uint32_t *count);

#ifdef __cplusplus
}
#endif
#endif
