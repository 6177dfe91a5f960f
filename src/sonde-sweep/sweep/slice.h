// Inside of the slicer: planes of the frames and the kernels over pixels.
#ifndef SONDE_SRC_SLICE_H
#define SONDE_SRC_SLICE_H

#include "sweep/frames.h"

enum { SLICE_TILE = 16, SLICE_BLOCK = 64 }; // pixels along a side

// Kriging: levels of a picture, steps of the tables between two frames, frames joined.
enum { SLICE_LEVELS = 6, SLICE_STEPS = 64, SLICE_JOINED = 4, SLICE_LAGS = 5 };

// Used part of a frame at falling resolution, each half as wide and high as the one before; level 0
// is the frame itself.
typedef struct slice_pyramid {
  const uint8_t *level[SLICE_LEVELS];
} slice_pyramid;

// Products of two frames' scales over a grid of points, their distance, for both ways of joining.
typedef struct slice_likeness {
  uint32_t a, b;               // frames
  float distance_m;            // between their middles
  float mean[2][SLICE_LEVELS]; // [across, along the sweep]: of the product of both
} slice_likeness;

// What kriging knows of a sequence; leaving frames out selects from it.
typedef struct slice_bank {
  const sonde_sequence *sequence;
  uint8_t *levels;               // all levels above 0
  uint8_t *shares[SLICE_LEVELS]; // of what changes in a pixel of a level; level 0: 0 or 255
  slice_pyramid *pyramids;       // [count of the sequence]
  uint32_t wide[SLICE_LEVELS], high[SLICE_LEVELS];
  size_t stride[SLICE_LEVELS];
  uint32_t used, *frames; // [used] with a pose
  slice_likeness *pairs;  // [used][SLICE_LAGS + 1]
} slice_bank;

// A frame at place (u, v) of a level, bilinear.
static inline float slice_level_at(const slice_bank *bank, const slice_pyramid *p, int k, float u,
                                   float v) {
  uint32_t i = (uint32_t)u, j = (uint32_t)v;
  uint32_t right = i + 1 < bank->wide[k];
  const uint8_t *q = p->level[k] + j * bank->stride[k] + i;
  const uint8_t *r = q + (j + 1 < bank->high[k] ? bank->stride[k] : 0);
  float a = u - (float)i, b = v - (float)j;
  float top = (float)q[0] + a * (float)(q[right] - q[0]);
  float low = (float)r[0] + a * (float)(r[right] - r[0]);
  return top + b * (low - top);
}

// r(d) = exp(-(d/length)^power)
typedef struct slice_decay {
  double variance, length_m, power;
} slice_decay;

// How frames are joined, how alike they are, and the error of frames made again.
typedef struct slice_model {
  bool along_sweep, by_order;
  slice_decay decays[SLICE_LEVELS];
  double error;
} slice_model;

// Weights of the levels of four frames: before, lower, upper, behind.
typedef struct slice_weights {
  float of[SLICE_JOINED][SLICE_LEVELS];
} slice_weights;

// Between a plane and the next one.
typedef struct slice_join {
  int32_t before, behind;                 // planes beyond both, -1 for none
  float to_before[2][3], to_behind[2][3]; // pixel of the lower, upper plane -> there
  slice_weights steps[SLICE_STEPS + 1];   // from the lower plane to the upper
} slice_join;

// Column u, row v and signed distance d (m) from a plane, linear in the pixel of the picture.
typedef struct slice_forms {
  double u[3], v[3], d[3]; // value at pixel (0, 0), per column, per row
} slice_forms;

typedef struct slice_plane {
  sonde_affine local_from_world; // rows u, v, d
  sonde_affine world_from_pixel;
  double pixel_m[2]; // length of a step in u and v
  sonde_vec3 normal;
  float last_shift[2], next_shift[2]; // slice_shift() to the planes before and behind
  const uint8_t *pixels;
  int32_t offset;               // bytes to its first used pixel in the layout
  const slice_pyramid *pyramid; // NULL without kriging
  uint32_t frame;               // of the sequence
  slice_forms forms;            // of the picture being rendered
} slice_plane;

// Half way between the two normals, in local coordinates of a: its own normal moves nothing. Planes
// that stand across each other are met at their feet.
static inline void slice_shift(const slice_plane *a, const slice_plane *b, float shift[2]) {
  double c = v_dot(a->normal, b->normal);
  for (int k = 0; k < 2; ++k) {
    const double *r = a->local_from_world.m[k];
    double along = r[0] * b->normal.x + r[1] * b->normal.y + r[2] * b->normal.z;
    shift[k] = c > 0 ? (float)(along / (1 + c)) : 0;
  }
}

// The forms of one plane from a tile's first pixel on.
typedef struct slice_candidate {
  const slice_plane *plane;
  float u[3], v[3], d[3];
} slice_candidate;

// What is linear in the picture's pixels between two planes, in front (d < 0) and behind: column
// and row where a pixel's line meets the plane behind, the same in front, distance of both (m).
// Value at pixel (0, 0), per column, per row.
enum { SLICE_FORMS = 6, SLICE_STRIPS = 16 };
typedef struct slice_strips {
  double *forms[SLICE_FORMS][3]; // [count + SLICE_STRIPS]
  float *steps[SLICE_FORMS][2];  // per column and row, rounded
  int32_t *offset[2];            // bytes to the frames: behind and in front
  double *lean[2]; // most columns and rows from a pixel's foot to where its line meets, per metre
  uint32_t count;
} slice_strips;

typedef struct slice_kernels slice_kernels;

// Lines of a processor's memory hold tiles of 6 x 10 pixels, each 5 x 9 from the next, so that the
// four pixels around a place stand within eight bytes of one line.
enum { SLICE_LINE = 64, SLICE_LINE_WIDE = 6, SLICE_LINE_HIGH = 10 };

// Pixel (i, j) of the used part of a frame is `frame + i + j row + (i / 5) column_line + (j / 9)
// row_line` bytes after `pixels`.
typedef struct slice_layout {
  const uint8_t *pixels;
  uint8_t *lines;                     // owned; NULL: `pixels` are the sequence's, row by row
  int32_t row, column_line, row_line; // bytes
} slice_layout;

// Distances of planes, each form's numbers one after the other; their range over a rectangle.
typedef struct slice_spans {
  double *form[3], *low, *high; // [count]
} slice_spans;

// Scratch of one worker.
typedef struct slice_room {
  slice_candidate *candidates;       // [count]
  const slice_plane **block, **tile; // [count]
  slice_spans spans;                 // of the block's planes
  slice_strips strips;               // of the block, none where planes cross
  bool covered;                      // by both frames of each strip
} slice_room;

struct sonde_slicer {
  sonde_slicer_options options;
  const slice_kernels *kernels;
  uint32_t width, count, workers;
  bool has_strips; // frames are joined across
  slice_layout layout;
  float low[2], high[2];     // used columns and rows
  slice_plane *planes;       // [count]
  const slice_plane **every; // [count]
  double *forms;             // [3][count] distances of the planes
  slice_room *rooms;         // [workers]
  sonde_image *image;        // of the render under way
  uint8_t *known;
  uint64_t *reached; // [workers] pixels
  slice_bank *bank;  // with kriging
  bool owns_bank;
  slice_join *joins;             // [count - 1] planes that follow each other
  slice_model model, pose_model; // of the sweep's own pictures, of any pose
  slice_weights *far; // [SLICE_FAR][SLICE_STEPS + 1] two frames that do not, by their gap
};

enum { SLICE_FAR = 32 };

sonde_status sonde_slice_bank_create(const sonde_sequence *sequence, slice_bank **bank,
                                     sonde_error *error);
void sonde_slice_bank_destroy(slice_bank *bank);
// Chooses the way of joining and fills the tables of weights.
sonde_status sonde_slicer_krige(sonde_slicer *slicer, sonde_error *error);
// r(d) of a scale.
static inline double slice_likeness_at(const slice_decay *d, double distance_m) {
  return distance_m > 0 ? exp(-pow(distance_m / d->length_m, d->power)) : 1;
}
// Weights of n frames at `at` for the place x, of least expected square error for one scale; with
// `whole` they add up to one.
void slice_krige_scale(const slice_decay *d, int n, const double *at, double x, bool whole,
                       double *weights);
// The picture of deviations, whose planes' forms are set. Returns the pixels reached.
uint64_t sonde_slicer_deviate(const sonde_slicer *slicer, sonde_image *image, uint8_t *known);
sonde_status sonde_slicer_check(const sonde_sequence *sequence, const sonde_slicer_options *options,
                                sonde_error *error);
// The same as sonde_slicer_create with a bank of the caller's, NULL to make one when needed.
sonde_status sonde_slicer_create_with(const sonde_sequence *sequence,
                                      const sonde_slicer_options *options, slice_bank *bank,
                                      sonde_slicer **slicer, sonde_error *error);
// Frames that the options leave out.
bool sonde_slice_is_left_out(const sonde_sequence *sequence, const sonde_slicer_options *options,
                             uint32_t frame);

// Weighted sum of frames' levels, each frame by a map from the picture's pixels to its own.
typedef struct slice_sum {
  const sonde_slicer *slicer;
  sonde_image *image;
  uint8_t *known;
  int n;
  const slice_plane *planes[SLICE_JOINED];
  float maps[SLICE_JOINED][2][3];
  float weights[SLICE_JOINED][SLICE_LEVELS];
} slice_sum;

// A volume that a picture is taken from; cells of the picture share four places in the volume.
// Voxel (i, j, k) is sum(i step + i / 3 line_step) bytes after `voxels`; in lines of memory that
// hold bricks of 4 x 4 x 4 voxels, each 3 from the next, or row by row.
enum { SLICE_CELL_WIDE = 16, SLICE_CELL_HIGH = 8, SLICE_BRICK = 4 };
typedef struct slice_voxels {
  const uint8_t *voxels;
  bool lines;
  int32_t step[3], line_step[3]; // bytes
  uint32_t size[3];              // at least two each
  sonde_image *image;
  uint8_t *known;
} slice_voxels;

struct slice_kernels {
  const char *name;
  // One block; returns the pixels reached.
  uint64_t (*block)(const sonde_slicer *slicer, uint32_t column, uint32_t row, slice_room *room);
  // Known where at least half of the frames are.
  uint64_t (*sum)(const slice_sum *sum);
  uint64_t (*cell)(const slice_voxels *v, const float corners[4][3], uint32_t column, uint32_t row);
};

// The widest kernels that this processor runs, or those called `name` (NULL: widest).
const slice_kernels *sonde_slice_kernels_find(const char *name);
extern const slice_kernels sonde_slice_kernels_base;
#ifdef __x86_64__
extern const slice_kernels sonde_slice_kernels_avx2, sonde_slice_kernels_avx512;
#endif

// With kernels of a name, NULL: pixel by pixel in double precision; see sonde_volume_slice.
uint64_t sonde_volume_slice_with(const slice_kernels *kernels, const sonde_volume *volume,
                                 bool nearest, const sonde_warp *warp,
                                 const sonde_affine *world_from_pixel, sonde_image *image,
                                 uint8_t *known);
// The same from the lines of a volume's slicer.
uint64_t sonde_volume_slicer_render_with(const slice_kernels *kernels,
                                         const sonde_volume_slicer *slicer, const sonde_warp *warp,
                                         const sonde_affine *world_from_pixel, sonde_image *image,
                                         uint8_t *known);
// Offset at a place of the grid.
sonde_vec3 sonde_warp_at(const sonde_warp *warp, sonde_vec3 node);

#endif
