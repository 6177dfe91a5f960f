// Pictures from a volume, at rest or through a field of offsets.
//
// The field is read at the corners of cells of 16 x 8 pixels; between them the places in the volume
// are bilinear. A field that is linear over a cell comes out exactly.
//
// sonde_warp_create, sonde_warp_clear
// sonde_warp_at            trilinear in the field, its edge beyond it
// places_of_row            places in the volume at the corners of a row of cells
// slice_cells
// voxel_at, slice_plainly  pixel by pixel: the nearest voxel, flat and very large volumes
// sonde_volume_slice_with, sonde_volume_slice, sonde_volume_slice_warped
#include "echo/slice.h"

#include <string.h>

enum { CELLS = 64 }; // corners held at once along a row

sonde_status sonde_warp_create(const uint32_t size[3], sonde_warp *warp, sonde_error *error) {
  SONDE_ASSERT(size != NULL && warp != NULL);
  *warp = (sonde_warp){.world_from_node = affine_identity()};
  for (int k = 0; k < 3; ++k)
    if (size[k] < 2 || size[k] > 1024)
      return sonde_fail(error, SONDE_ARGUMENT,
                        "field of %u x %u x %u nodes, expected 2 to 1024 along each axis", size[0],
                        size[1], size[2]);
  memcpy(warp->size, size, sizeof warp->size);
  warp->offsets_m = SONDE_NEW(float, (size_t)3 * size[0] * size[1] * size[2]);
  return warp->offsets_m ? SONDE_OK : sonde_fail_memory(error);
}

void sonde_warp_clear(sonde_warp *warp) {
  if (!warp) return;
  sonde_free(warp->offsets_m);
  *warp = (sonde_warp){0};
}

sonde_vec3 sonde_warp_at(const sonde_warp *warp, sonde_vec3 node) {
  const double at[3] = {node.x, node.y, node.z};
  const float *p = warp->offsets_m;
  size_t stride[3] = {3, 3 * (size_t)warp->size[0], 3 * (size_t)warp->size[0] * warp->size[1]};
  double t[3], sum[3];
  for (int k = 0; k < 3; ++k) {
    double x = clamp(at[k], 0, warp->size[k] - 1.0);
    size_t i = (size_t)x;
    if (i > warp->size[k] - 2) i = warp->size[k] - 2;
    t[k] = x - (double)i;
    p += i * stride[k];
  }
  for (int c = 0; c < 3; ++c) {
    double line[4];
    for (int k = 0; k < 4; ++k) {
      const float *q = p + (k & 1 ? stride[1] : 0) + (k & 2 ? stride[2] : 0) + c;
      line[k] = (1 - t[0]) * (double)q[0] + t[0] * (double)q[3];
    }
    sum[c] = (1 - t[2]) * ((1 - t[1]) * line[0] + t[1] * line[1]) +
             t[2] * ((1 - t[1]) * line[2] + t[1] * line[3]);
  }
  return vec3(sum[0], sum[1], sum[2]);
}

typedef struct maps {
  const sonde_warp *warp; // NULL at rest
  sonde_affine voxel_from_world, node_from_world, world_from_pixel;
} maps;

static sonde_vec3 place_of(const maps *m, double u, double v) {
  sonde_vec3 p = affine_apply(&m->world_from_pixel, vec3(u, v, 0));
  if (m->warp) p = v_add(p, sonde_warp_at(m->warp, affine_apply(&m->node_from_world, p)));
  return affine_apply(&m->voxel_from_world, p);
}

static void places_of_row(const maps *m, uint32_t column, uint32_t row, uint32_t count,
                          float (*places)[3]) {
  for (uint32_t c = 0; c < count; ++c) {
    sonde_vec3 p = place_of(m, column + (double)c * SLICE_CELL_WIDE, row);
    places[c][0] = (float)p.x, places[c][1] = (float)p.y, places[c][2] = (float)p.z;
  }
}

static uint64_t slice_cells(const slice_kernels *kernels, const slice_voxels *v, const maps *m) {
  uint64_t reached = 0;
  for (uint32_t left = 0; left < v->image->width; left += CELLS * SLICE_CELL_WIDE) {
    float places[2][CELLS + 1][3], corners[4][3];
    uint32_t cells = (v->image->width - left + SLICE_CELL_WIDE - 1) / SLICE_CELL_WIDE;
    if (cells > CELLS) cells = CELLS;
    places_of_row(m, left, 0, cells + 1, places[0]);
    for (uint32_t row = 0, k = 0; row < v->image->height; row += SLICE_CELL_HIGH, k ^= 1) {
      places_of_row(m, left, row + SLICE_CELL_HIGH, cells + 1, places[k ^ 1]);
      for (uint32_t c = 0; c < cells; ++c) {
        memcpy(corners[0], places[k][c], 2 * sizeof corners[0]); // upper corners, then lower ones
        memcpy(corners[2], places[k ^ 1][c], 2 * sizeof corners[0]);
        reached += kernels->cell(v, (const float(*)[3])corners, left + c * SLICE_CELL_WIDE, row);
      }
    }
  }
  return reached;
}

static double voxel_at(const sonde_volume *v, bool nearest, const double at[3]) {
  double value = 0, t[3];
  size_t step[3] = {1, v->size[0], (size_t)v->size[0] * v->size[1]}, from = 0;
  for (int k = 0; k < 3; ++k) {
    double x = clamp(at[k], 0, v->size[k] - 1.0);
    if (nearest) x = floor(x + 0.5);
    double i = floor(fmin(x, fmax(v->size[k] - 2.0, 0)));
    t[k] = x - i;
    from += (size_t)i * step[k];
  }
  for (int corner = 0; corner < 8; ++corner) {
    size_t place = from;
    double w = 1;
    for (int k = 0; k < 3; ++k) {
      bool high = corner >> k & 1;
      place += high && t[k] > 0 ? step[k] : 0;
      w *= high ? t[k] : 1 - t[k];
    }
    if (w > 0) value += w * v->voxels[place];
  }
  return value;
}

static uint64_t slice_plainly(const sonde_volume *v, bool nearest, const maps *m,
                              sonde_image *image, uint8_t *known) {
  uint64_t reached = 0;
  for (uint32_t row = 0; row < image->height; ++row)
    for (uint32_t x = 0; x < image->width; ++x) {
      sonde_vec3 p = place_of(m, x, row);
      const double at[3] = {p.x, p.y, p.z};
      bool inside = true;
      for (int k = 0; k < 3; ++k) inside &= at[k] >= -1e-3 && at[k] <= v->size[k] - 1 + 1e-3;
      size_t i = (size_t)row * image->width + x;
      image->pixels[i] = inside ? (uint8_t)(voxel_at(v, nearest, at) + 0.5) : 0;
      if (known) known[i] = inside;
      reached += inside;
    }
  return reached;
}

uint64_t sonde_volume_slice_with(const slice_kernels *kernels, const sonde_volume *volume,
                                 bool nearest, const sonde_warp *warp,
                                 const sonde_affine *world_from_pixel, sonde_image *image,
                                 uint8_t *known) {
  SONDE_ASSERT(volume != NULL && volume->voxels != NULL && image != NULL && image->pixels);
  maps m = {.warp = warp, .world_from_pixel = *world_from_pixel};
  size_t pixels = (size_t)image->width * image->height;
  if (!affine_inverse(&volume->world_from_voxel, &m.voxel_from_world) ||
      (warp && !affine_inverse(&warp->world_from_node, &m.node_from_world))) {
    memset(image->pixels, 0, pixels);
    if (known) memset(known, 0, pixels);
    return 0;
  }
  const uint32_t *n = volume->size;
  uint64_t row = n[0], sheet = row * n[1], all = sheet * n[2];
  bool fits = n[0] > 1 && n[1] > 1 && n[2] > 1 && all >= row + sheet + 4 && all < INT32_MAX;
  if (!kernels || !fits || nearest) return slice_plainly(volume, nearest, &m, image, known);
  slice_voxels v = {.voxels = volume->voxels, .image = image, .known = known};
  memcpy(v.size, volume->size, sizeof v.size);
  return slice_cells(kernels, &v, &m);
}

uint64_t sonde_volume_slice(const sonde_volume *volume, bool nearest,
                            const sonde_affine *world_from_pixel, sonde_image *image,
                            uint8_t *known) {
  return sonde_volume_slice_with(sonde_slice_kernels_find(NULL), volume, nearest, NULL,
                                 world_from_pixel, image, known);
}

uint64_t sonde_volume_slice_warped(const sonde_volume *volume, const sonde_warp *warp,
                                   const sonde_affine *world_from_pixel, sonde_image *image,
                                   uint8_t *known) {
  SONDE_ASSERT(warp != NULL && warp->offsets_m != NULL);
  return sonde_volume_slice_with(sonde_slice_kernels_find(NULL), volume, false, warp,
                                 world_from_pixel, image, known);
}
