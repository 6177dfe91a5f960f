// Pictures from a volume, at rest or through a field of offsets.
//
// The field is read at the corners of cells of 16 x 8 pixels; between them the places in the volume
// are bilinear. A field that is linear over a cell comes out exactly.
#include "sweep/slice.h"

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
  sonde_affine node_from_pixel, voxel_from_pixel;
} maps;

static bool find_maps(const sonde_affine *world_from_voxel, const sonde_warp *warp,
                      const sonde_affine *world_from_pixel, maps *m) {
  *m = (maps){.warp = warp, .world_from_pixel = *world_from_pixel};
  if (!affine_inverse(world_from_voxel, &m->voxel_from_world)) return false;
  m->voxel_from_pixel = affine_mul(&m->voxel_from_world, world_from_pixel);
  if (!warp) return true;
  if (!affine_inverse(&warp->world_from_node, &m->node_from_world)) return false;
  m->node_from_pixel = affine_mul(&m->node_from_world, world_from_pixel);
  return true;
}

typedef float four __attribute__((vector_size(16)));

// Cell of the grid along an axis, and how far in it.
static inline size_t cell_of(double at, uint32_t nodes, float *t) {
  double last = nodes - 1.0, x = at > 0 ? (at < last ? at : last) : 0;
  int32_t i = (int32_t)x;
  i = i < (int32_t)nodes - 2 ? i : (int32_t)nodes - 2;
  *t = (float)(x - i);
  return (size_t)i;
}

// Between two nodes that follow each other; reads nothing beyond them.
static inline four triple(const float *p, four t) {
  four a, b;
  memcpy(&a, p, sizeof a);
  memcpy(&b, p + 2, sizeof b);
  b = (four){b[1], b[2], b[3], 0};
  return a + t * (b - a);
}

static inline four offset_at(const sonde_warp *warp, const double at[3]) {
  float t[3];
  const uint32_t *n = warp->size;
  size_t row = 3 * (size_t)n[0], sheet = row * n[1];
  const float *p = warp->offsets_m + 3 * cell_of(at[0], n[0], &t[0]) +
                   row * cell_of(at[1], n[1], &t[1]) + sheet * cell_of(at[2], n[2], &t[2]);
  four x = {t[0], t[0], t[0], t[0]};
  four a = triple(p, x), b = triple(p + row, x);
  four c = triple(p + sheet, x), d = triple(p + sheet + row, x);
  a = a + t[1] * (b - a), c = c + t[1] * (d - c);
  return a + t[2] * (c - a);
}

static void locate_row(const maps *m, uint32_t column, uint32_t row, uint32_t count,
                       float (*positions)[3]) {
  const double(*voxel)[4] = m->voxel_from_pixel.m, (*node)[4] = m->node_from_pixel.m;
  const double(*turn)[4] = m->voxel_from_world.m;
  for (uint32_t c = 0; c < count; ++c) {
    double u = column + (double)c * SLICE_CELL_WIDE, v = row, at[3], p[3];
    for (int k = 0; k < 3; ++k) p[k] = voxel[k][0] * u + voxel[k][1] * v + voxel[k][3];
    if (m->warp) {
      for (int k = 0; k < 3; ++k) at[k] = node[k][0] * u + node[k][1] * v + node[k][3];
      four o = offset_at(m->warp, at);
      for (int k = 0; k < 3; ++k)
        p[k] += turn[k][0] * (double)o[0] + turn[k][1] * (double)o[1] + turn[k][2] * (double)o[2];
    }
    for (int k = 0; k < 3; ++k) positions[c][k] = (float)p[k];
  }
}

static uint64_t slice_cells(const slice_kernels *kernels, const slice_voxels *v, const maps *m) {
  uint64_t reached = 0;
  for (uint32_t left = 0; left < v->image->width; left += CELLS * SLICE_CELL_WIDE) {
    float positions[2][CELLS + 1][3], corners[4][3];
    uint32_t cells = (v->image->width - left + SLICE_CELL_WIDE - 1) / SLICE_CELL_WIDE;
    if (cells > CELLS) cells = CELLS;
    locate_row(m, left, 0, cells + 1, positions[0]);
    for (uint32_t row = 0, k = 0; row < v->image->height; row += SLICE_CELL_HIGH, k ^= 1) {
      locate_row(m, left, row + SLICE_CELL_HIGH, cells + 1, positions[k ^ 1]);
      for (uint32_t c = 0; c < cells; ++c) {
        memcpy(corners[0], positions[k][c],
               2 * sizeof corners[0]); // upper corners, then lower ones
        memcpy(corners[2], positions[k ^ 1][c], 2 * sizeof corners[0]);
        reached += kernels->cell(v, (const float(*)[3])corners, left + c * SLICE_CELL_WIDE, row);
      }
    }
  }
  return reached;
}

static uint64_t slice_plainly(const sonde_volume *v, bool nearest, const maps *m,
                              sonde_image *image, uint8_t *known) {
  uint64_t reached = 0;
  for (uint32_t row = 0; row < image->height; ++row)
    for (uint32_t x = 0; x < image->width; ++x) {
      sonde_vec3 p = affine_apply(&m->world_from_pixel, vec3(x, row, 0));
      if (m->warp) p = v_add(p, sonde_warp_at(m->warp, affine_apply(&m->node_from_world, p)));
      p = affine_apply(&m->voxel_from_world, p);
      const double at[3] = {p.x, p.y, p.z};
      bool inside = true;
      for (int k = 0; k < 3; ++k) inside &= at[k] >= -1e-3 && at[k] <= v->size[k] - 1 + 1e-3;
      size_t i = (size_t)row * image->width + x;
      double value = 0, t[3];
      size_t step[3] = {1, v->size[0], (size_t)v->size[0] * v->size[1]}, from = 0;
      for (int k = 0; k < 3; ++k) {
        double corner_at = clamp(at[k], 0, v->size[k] - 1.0);
        if (nearest) corner_at = floor(corner_at + 0.5);
        double cell = floor(fmin(corner_at, fmax(v->size[k] - 2.0, 0)));
        t[k] = corner_at - cell;
        from += (size_t)cell * step[k];
      }
      for (int corner = 0; corner < 8; ++corner) {
        size_t corner_at = from;
        double w = 1;
        for (int k = 0; k < 3; ++k) {
          bool high = corner >> k & 1;
          corner_at += high && t[k] > 0 ? step[k] : 0;
          w *= high ? t[k] : 1 - t[k];
        }
        if (w > 0) value += w * v->voxels[corner_at];
      }
      image->pixels[i] = inside ? (uint8_t)(value + 0.5) : 0;
      if (known) known[i] = inside;
      reached += inside;
    }
  return reached;
}

static uint64_t blacken(sonde_image *image, uint8_t *known) {
  size_t pixels = (size_t)image->width * image->height;
  memset(image->pixels, 0, pixels);
  if (known) memset(known, 0, pixels);
  return 0;
}

uint64_t sonde_volume_slice_with(const slice_kernels *kernels, const sonde_volume *volume,
                                 bool nearest, const sonde_warp *warp,
                                 const sonde_affine *world_from_pixel, sonde_image *image,
                                 uint8_t *known) {
  SONDE_ASSERT(volume != NULL && volume->voxels != NULL && image != NULL && image->pixels);
  maps m;
  if (!find_maps(&volume->world_from_voxel, warp, world_from_pixel, &m))
    return blacken(image, known);
  const uint32_t *n = volume->size;
  uint64_t row = n[0], sheet = row * n[1], voxels = sheet * n[2];
  bool fits = n[0] > 1 && n[1] > 1 && n[2] > 1 && voxels < INT32_MAX;
  if (!kernels || !fits || nearest) return slice_plainly(volume, nearest, &m, image, known);
  slice_voxels v = {.voxels = volume->voxels,
                    .step = {1, (int32_t)row, (int32_t)sheet},
                    .image = image,
                    .known = known};
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

struct sonde_volume_slicer {
  sonde_affine world_from_voxel;
  uint8_t *lines;
  slice_voxels voxels; // without a picture
};

sonde_status sonde_volume_slicer_create(const sonde_volume *volume, sonde_volume_slicer **out,
                                        sonde_error *error) {
  SONDE_ASSERT(volume != NULL && volume->voxels != NULL && out != NULL);
  *out = NULL;
  uint32_t bricks[3];
  uint64_t bytes = SLICE_LINE;
  for (int k = 0; k < 3; ++k) {
    bricks[k] = (volume->size[k] + SLICE_BRICK - 3) / (SLICE_BRICK - 1);
    bytes *= bricks[k];
  }
  const uint32_t *n = volume->size;
  if (n[0] < 2 || n[1] < 2 || n[2] < 2 || bytes >= INT32_MAX)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "volume of %u x %u x %u voxels: expected 2 and more along each axis and at "
                      "most 9e8 in all",
                      n[0], n[1], n[2]);
  sonde_volume_slicer *slicer = SONDE_NEW(sonde_volume_slicer, 1);
  uint8_t *lines = slicer ? SONDE_NEW(uint8_t, bytes) : NULL;
  if (!lines) {
    sonde_free(slicer);
    return sonde_fail_memory(error);
  }
  int32_t row = (int32_t)bricks[0] * SLICE_LINE, sheet = row * (int32_t)bricks[1];
  const int32_t lose = SLICE_BRICK - 1; // voxels of a brick that the next one begins with
  *slicer =
      (sonde_volume_slicer){.world_from_voxel = volume->world_from_voxel,
                            .lines = lines,
                            .voxels = {.voxels = lines,
                                       .lines = true,
                                       .step = {1, SLICE_BRICK, SLICE_BRICK * SLICE_BRICK},
                                       .line_step = {SLICE_LINE - lose, row - lose * SLICE_BRICK,
                                                     sheet - lose * SLICE_BRICK * SLICE_BRICK}}};
  memcpy(slicer->voxels.size, n, sizeof slicer->voxels.size);
  uint8_t *line = lines;
  const uint32_t step = SLICE_BRICK - 1;
  for (uint32_t z = 0; z < bricks[2]; ++z)
    for (uint32_t y = 0; y < bricks[1]; ++y)
      for (uint32_t x = 0; x < bricks[0]; ++x, line += SLICE_LINE)
        for (uint32_t k = 0; k < SLICE_BRICK && step * z + k < n[2]; ++k)
          for (uint32_t j = 0; j < SLICE_BRICK && step * y + j < n[1]; ++j) {
            const uint8_t *from =
                volume->voxels + ((size_t)(step * z + k) * n[1] + step * y + j) * n[0] + step * x;
            uint8_t *to = line + (SLICE_BRICK * k + j) * SLICE_BRICK;
            if (step * x + SLICE_BRICK <= n[0])
              memcpy(to, from, SLICE_BRICK);
            else
              memcpy(to, from, n[0] - step * x);
          }
  *out = slicer;
  return SONDE_OK;
}

void sonde_volume_slicer_destroy(sonde_volume_slicer *slicer) {
  if (!slicer) return;
  sonde_free(slicer->lines);
  sonde_free(slicer);
}

uint64_t sonde_volume_slicer_render_with(const slice_kernels *kernels,
                                         const sonde_volume_slicer *slicer, const sonde_warp *warp,
                                         const sonde_affine *world_from_pixel, sonde_image *image,
                                         uint8_t *known) {
  SONDE_ASSERT(slicer != NULL && kernels != NULL && image != NULL && image->pixels);
  maps m;
  if (!find_maps(&slicer->world_from_voxel, warp, world_from_pixel, &m))
    return blacken(image, known);
  slice_voxels v = slicer->voxels;
  v.image = image, v.known = known;
  return slice_cells(kernels, &v, &m);
}

uint64_t sonde_volume_slicer_render(const sonde_volume_slicer *slicer, const sonde_warp *warp,
                                    const sonde_affine *world_from_pixel, sonde_image *image,
                                    uint8_t *known) {
  return sonde_volume_slicer_render_with(sonde_slice_kernels_find(NULL), slicer, warp,
                                         world_from_pixel, image, known);
}
