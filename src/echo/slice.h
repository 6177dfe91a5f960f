// Inside of the slicer: planes of the frames and the kernels over pixels.
#ifndef SONDE_SRC_SLICE_H
#define SONDE_SRC_SLICE_H

#include "echo/frames.h"

enum { SLICE_TILE = 16, SLICE_BLOCK = 64 }; // pixels along a side

// Column u, row v and signed distance d (m) from a plane, linear in the pixel of the picture.
typedef struct slice_forms {
  double u[3], v[3], d[3]; // value at pixel (0, 0), per column, per row
} slice_forms;

typedef struct slice_plane {
  sonde_affine local_from_world; // rows u, v, d
  sonde_affine world_from_pixel;
  double pixel_m[2]; // length of a step in u and v
  sonde_vec3 normal;
  const uint8_t *pixels;
  slice_forms forms; // of the picture being rendered
} slice_plane;

// The forms of one plane from a tile's first pixel on.
typedef struct slice_candidate {
  const slice_plane *plane;
  float u[3], v[3], d[3];
} slice_candidate;

// Scratch of one worker.
typedef struct slice_room {
  slice_candidate *candidates;       // [count]
  const slice_plane **block, **tile; // [count]
} slice_room;

struct sonde_slicer {
  sonde_slicer_options options;
  uint32_t width, count, workers;
  float low[2], high[2];     // used columns and rows
  slice_plane *planes;       // [count]
  const slice_plane **every; // [count]
  slice_room *rooms;         // [workers]
  sonde_image *image;        // of the render under way
  uint8_t *known;
  uint64_t *reached; // [workers] pixels
};

// One block; returns the pixels reached.
uint64_t sonde_slice_block(const sonde_slicer *slicer, uint32_t column, uint32_t row,
                           slice_room *room);

// One picture from a volume; voxel_from_pixel is linear in column and row.
uint64_t sonde_slice_voxels(const sonde_volume *volume, bool nearest,
                            const sonde_affine *voxel_from_pixel, sonde_image *image,
                            uint8_t *known);

#endif
