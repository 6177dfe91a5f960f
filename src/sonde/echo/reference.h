// The slow, exact image of point scatterers: every path from a transmitting to a receiving element.
// The fast image takes its beam from here and is validated against it.
#ifndef SONDE_SRC_ECHO_REFERENCE_H
#define SONDE_SRC_ECHO_REFERENCE_H

#include "sonde/echo.h"

/** An array, its pulse and its focusing. One line looks along z from the middle of its own
 *  aperture; the elements go on to both sides as far as the aperture asks. */
typedef struct sonde_array {
  double frequency_hz, sound_m_s;
  double focus_m;               /**< of the transmitted beam */
  double transmit_f, receive_f; /**< focal depth over aperture; the receive aperture grows */
  double pitch_m, width_m;      /**< of the elements */
  double radius_m;              /**< of a curved face; 0 linear */
  double pulse_wavelengths;     /**< envelope of the echo between half values, along depth */
  double height_m, lens_m;      /**< elevation aperture, depth of the lens's focus */
  uint32_t most_elements;       /**< of an aperture */
} sonde_array;

/** 7.5 MHz, 1540 m/s, focus 25 mm at F/2.5, receive F/2, pitch 0.3 mm, pulse 1.1 wavelengths.
 *  @thread any */
sonde_array sonde_array_default(void);

/** Complex baseband echo of a unit scatterer at (x, z) seen by the line at the depth of one sample:
 *  the plain double sum over transmitting and receiving elements of
 *  pulse(depth - path/2) exp(-i 2 pi path / wavelength), with the obliquity of a soft baffle, the
 *  width of the elements and cylindrical spreading. @param echo real, imaginary @thread any */
void sonde_array_echo(const sonde_array *array, double x_m, double z_m, double depth_m,
                      double echo[2]);

/** The same for `count` samples from first_m on, by tabulating the transmitted wave at the
 *  scatterer; agrees with sonde_array_echo() to 1e-3 of the peak. @param echo [2*count]
 *  @thread any */
void sonde_array_line(const sonde_array *array, double x_m, double z_m, double first_m,
                      double step_m, uint32_t count, double *echo);

/** Two-way amplitude beside the image plane over that in it, at depth z: Fresnel integral of the
 *  lens-focused elevation aperture, squared. @thread any */
double sonde_array_elevation(const sonde_array *array, double y_m, double z_m);

/** Half width h of the kernel 1 - (y/h)^2 with the half values of sonde_array_elevation().
 *  @thread any */
double sonde_array_elevation_half(const sonde_array *array, double z_m);

/** A unit scatterer in the plane or beside it, probe frame. */
typedef struct sonde_echo_point {
  double x_m, y_m, z_m, amplitude;
} sonde_echo_point;

/** Image of points without tissue, noise and compensation by the fast chain of a renderer; read it
 *  with sonde_echo_envelope(). @thread owner */
void sonde_echo_render_points(sonde_echo *echo, double aperture_m,
                              const sonde_echo_settings *settings, const sonde_echo_point *points,
                              uint32_t count);

/** The same by sonde_array_line(): envelope [sample_count*line_count], sample-major, of the lines
 *  first_line to last_line and samples first_sample to last_sample, zero elsewhere. Elevation by
 *  sonde_array_elevation(). Slow. @return SONDE_MEMORY @thread owner */
sonde_status sonde_echo_reference_points(const sonde_echo *echo, double aperture_m,
                                         const sonde_echo_settings *settings,
                                         const sonde_echo_point *points, uint32_t count,
                                         const uint32_t lines[2], const uint32_t samples[2],
                                         float *envelope, sonde_error *error);

#endif
