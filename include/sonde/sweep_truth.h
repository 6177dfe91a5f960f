/**
 * @file sweep_truth.h
 * What every pixel of a rendered picture shows: tissue, vessel, where it came from, how it flows.
 */
#ifndef SONDE_SWEEP_TRUTH_H
#define SONDE_SWEEP_TRUTH_H

#include "sonde/echo.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Beside a picture, row by row like it; vectors are in the probe frame: across, beside the plane,
 *  down. Owns its arrays. */
typedef struct sonde_truth {
  uint32_t width, height;
  double width_m, height_m;   /**< of the picture */
  uint64_t tick;              /**< of the state, as in the picture */
  uint8_t *tissue;            /**< [height*width] sonde_label; outside where nothing is drawn */
  uint8_t *vessel;            /**< [height*width] 0, or 1 + number of the vessel whose wall, lumen
                                   or clot it is */
  float (*place_m)[3];        /**< [height*width] true place of what the pixel draws; other than
                                   the pixel's own where tissues have their own sound speeds */
  float (*displacement_m)[3]; /**< [height*width] of the tissue from rest to that place */
  float (*velocity_m_s)[3];   /**< [height*width] of flowing blood, else 0 */
} sonde_truth;

/**
 * The truth beside the picture that the renderer drew last.
 * @param image that picture @param[out] truth owned by the caller
 * @return MEMORY @thread owner of the echo, not while the interior updates; slow (some seconds for
 * 512 x 512 pixels)
 */
SONDE_API sonde_status sonde_truth_create(const sonde_echo *echo, const sonde_image *image,
                                          sonde_truth *truth, sonde_error *error);
SONDE_API void sonde_truth_clear(sonde_truth *truth); /**< @thread owner */

/** Where the picture drawn last shows a point of the world, in the probe frame: elsewhere than it
 * is where tissues have their own sound speeds. @thread owner of the echo */
SONDE_API sonde_vec3 sonde_truth_drawn(const sonde_echo *echo, sonde_vec3 point_m);

/** Name of a label: "vein_wall". Never NULL. @thread any */
SONDE_API const char *sonde_truth_label_name(sonde_label label);

/** Writes vectors of a truth as NRRD: float, little endian, raw, axes vector, x and y, spacing in
 * mm.
 * @param vectors [height*width] of the truth @param unit e.g. "m" @return IO, DISK @thread owner */
SONDE_API sonde_status sonde_truth_save_vectors(const sonde_truth *truth, const float (*vectors)[3],
                                                const char *unit, const char *path,
                                                sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
