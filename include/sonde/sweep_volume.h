/**
 * @file sweep_volume.h
 * Volumes from tracked frames, their files, pictures of them at rest and deformed, and pictures
 * pressed as the mechanical model presses the thigh.
 */
#ifndef SONDE_SWEEP_VOLUME_H
#define SONDE_SWEEP_VOLUME_H

#include "sonde/sweep_frames.h"

#ifdef __cplusplus
extern "C" {
#endif

/** 8-bit volume; owns its voxels. */
typedef struct sonde_volume {
  uint32_t size[3];
  sonde_affine world_from_voxel; /**< voxel centre (i, j, k) -> m */
  uint8_t *voxels;               /**< [size[2]*size[1]*size[0]], i runs fastest */
} sonde_volume;

SONDE_API sonde_status sonde_volume_create(const uint32_t size[3], sonde_volume *volume,
                                           sonde_error *error); /**< @thread owner */
SONDE_API void sonde_volume_clear(sonde_volume *volume);        /**< @thread owner */
/** MetaImage or NRRD with three axes, 8 bits. @thread owner */
SONDE_API sonde_status sonde_volume_load(const char *path, sonde_volume *volume,
                                         sonde_error *error);
/** By the name's end, .mha or .nrrd. @thread owner */
SONDE_API sonde_status sonde_volume_save(const char *path, const sonde_volume *volume,
                                         bool compressed, sonde_error *error);

typedef enum sonde_reconstruct_method {
  SONDE_RECONSTRUCT_LINEAR, /**< a pixel is shared among the eight voxels around it */
  SONDE_RECONSTRUCT_NEAREST /**< a pixel goes to the nearest voxel */
} sonde_reconstruct_method;

typedef struct sonde_reconstruct_options {
  double spacing_m; /**< default 0.5 mm */
  sonde_reconstruct_method method;
  double hole_fill_m;   /**< longest gap that is bridged, 0: none; default 3 mm */
  uint64_t most_voxels; /**< default 2^28; five bytes of work memory each */
} sonde_reconstruct_options;

SONDE_API sonde_reconstruct_options sonde_reconstruct_options_default(void); /**< @thread any */

typedef struct sonde_reconstruct_report {
  uint32_t frames;
  uint64_t voxels, touched, bridged; /**< all; holding a pixel; filled as holes */
} sonde_reconstruct_report;

/**
 * Volume of all used frames on a grid along the world's axes; voxels that no frame reaches are 0.
 * @return SONDE_ARGUMENT naming the spacing that would fit when the grid is too large
 * @thread owner
 */
SONDE_API sonde_status sonde_reconstruct(const sonde_sequence *sequence,
                                         const sonde_reconstruct_options *options,
                                         sonde_volume *volume, sonde_reconstruct_report *report,
                                         const sonde_progress *progress, sonde_error *error);

/** Picture of a plane of a volume, trilinear or nearest voxel; as sonde_slicer_render().
 *  @thread any, one per image */
SONDE_API uint64_t sonde_volume_slice(const sonde_volume *volume, bool nearest,
                                      const sonde_affine *world_from_pixel, sonde_image *image,
                                      uint8_t *known);

/** Field of offsets on a regular grid: what is seen at p in the world is read at p + offset. Beyond
 *  the grid its edge holds. Owns the offsets. */
typedef struct sonde_warp {
  uint32_t size[3];             /**< nodes, 2 to 1024 along each axis */
  sonde_affine world_from_node; /**< node (i, j, k) -> m */
  float *offsets_m;             /**< [size[2]*size[1]*size[0]][3], i runs fastest */
} sonde_warp;

/** Zero offsets, nodes 1 m apart. @thread owner */
SONDE_API sonde_status sonde_warp_create(const uint32_t size[3], sonde_warp *warp,
                                         sonde_error *error);
SONDE_API void sonde_warp_clear(sonde_warp *warp); /**< @thread owner */
/** Picture of a deformed volume, trilinear; the field is read every 16 x 8 pixels and bilinear
 *  between. @thread any, one per image */
SONDE_API uint64_t sonde_volume_slice_warped(const sonde_volume *volume, const sonde_warp *warp,
                                             const sonde_affine *world_from_pixel,
                                             sonde_image *image, uint8_t *known);

/** A volume laid out for many pictures: 2.4 bytes for each voxel. */
typedef struct sonde_volume_slicer sonde_volume_slicer;

/**
 * Copies the volume, which may then be cleared.
 * @return SONDE_ARGUMENT for one that is flat or has more than 2^31 / 2.4 voxels
 * @thread owner
 */
SONDE_API sonde_status sonde_volume_slicer_create(const sonde_volume *volume,
                                                  sonde_volume_slicer **slicer, sonde_error *error);
SONDE_API void sonde_volume_slicer_destroy(sonde_volume_slicer *slicer); /**< @thread owner */
/** The same picture as sonde_volume_slice(), or sonde_volume_slice_warped() with a field, sooner.
 *  @param warp NULL at rest @thread any, one per image */
SONDE_API uint64_t sonde_volume_slicer_render(const sonde_volume_slicer *slicer,
                                              const sonde_warp *warp,
                                              const sonde_affine *world_from_pixel,
                                              sonde_image *image, uint8_t *known);

/** How a picture of the thigh at rest is pressed. */
typedef struct sonde_image_press {
  const sonde_interior *interior; /**< updated to the pressed state; borrowed for the call */
  sonde_pose rest_pose;           /**< of the probe when the picture was taken, on the rest skin */
  sonde_pose pose;                /**< of the probe now */
  double shift_m[2]; /**< x, z from the model's rest plane to the picture, so that vessels meet */
} sonde_image_press;

/**
 * Deforms a picture in its plane: what is seen at a point is what was there at rest, by
 * sonde_interior_rest_point(). Both pictures have their top at the probe's face, their middle
 * column on its axis, and the sizes in their width_m and height_m. The field is read every few
 * pixels.
 * @param known [height*width] of `out`: 1 where the rest picture reaches; may be NULL
 * @return pixels that the rest picture reaches; the others are black
 * @thread owner
 */
SONDE_API uint64_t sonde_image_pressed(const sonde_image *rest, const sonde_image_press *press,
                                       sonde_image *out, uint8_t *known);

#ifdef __cplusplus
}
#endif
#endif
