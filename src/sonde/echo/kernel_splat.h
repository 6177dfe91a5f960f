// Scatterers into the grid: through affine maps onto two columns and three samples each, with the
// carrier's phase, less of them in lumina; blood along its streamlines. Included by kernel.c only.
#ifndef SONDE_SRC_ECHO_KERNEL_SPLAT_H
#define SONDE_SRC_ECHO_KERNEL_SPLAT_H

#include "base/base.h"
#include "echo/kernel.h"
#include "echo/kernel_tissue.h"

#include <string.h>

// A vector of scatterers: what each adds to its two columns, where, and the shares of the samples
// above and below; the nearest one gets the rest: a quadratic spline.
typedef struct splat_vector {
  _Alignas(sizeof(floats)) float record[4 * FLOATS];
  uint32_t cell[FLOATS];
  float up[FLOATS], down[FLOATS];
} splat_vector;

// One scatterer to its two columns of three rows.
INLINE void add_scatterer(float *grid, uint32_t stride, const splat_vector *p, int lane) {
  const int place = lane % 4 * (FLOATS / 4) + lane / 4; // see vtranspose()
  const uint32_t cell = p->cell[lane];                  // of the row above
  float *above = grid + cell, *here = grid + stride + cell, *below = grid + 2 * stride + cell;
  float_x4 value = vload_float_x4(p->record + 4 * place);
  float_x4 up = p->up[lane] * value, down = p->down[lane] * value;
  vstore(above, vload_float_x4(above) + up);
  vstore(here, vload_float_x4(here) + (value - up - down));
  vstore(below, vload_float_x4(below) + down);
}

INLINE void add_vector(float *grid, uint32_t stride, const splat_vector *p) {
  for (int block = 0; block < FLOATS / 4; ++block)
    for (int k = 0; k < 4; ++k) add_scatterer(grid, stride, p, 4 * block + k);
}

// One coordinate of a map, spread over lanes.
typedef struct form {
  floats m[4];
} form;

INLINE form form_of(const float m[4][4], int c) {
  return (form){{vset(m[0][c]), vset(m[1][c]), vset(m[2][c]), vset(m[3][c])}};
}
INLINE floats along(const form *f, floats x, floats y, floats z) {
  return f->m[0] + f->m[1] * x + f->m[2] * y + f->m[3] * z;
}

// Scatterers within the slab, closed up, and vectors of them whose arithmetic goes on before the
// first of them is laid: it has long chains.
enum { BATCH = 128, VECTORS = BATCH / FLOATS };

typedef struct slab_batch {
  uint32_t count;
  float line[BATCH + FLOATS], depth[BATCH + FLOATS], weight[BATCH + FLOATS];
} slab_batch;

// Lines, samples and carrier phase of a vector of them.
INLINE void prepare(const splat_job *job, const slab_batch *f, uint32_t from, splat_vector *p) {
  floats line = vload(f->line + from), depth = vload(f->depth + from),
         weight = vload(f->weight + from);
  ints l = vint(line), n = vint(depth + 0.5f);
  floats a = line - vreal(l), b = depth - vreal(n), up = 0.5f - b, down = 0.5f + b, c, s;
  turn(depth * job->turns, &c, &s);
  floats re = weight * c, im = weight * s, re1 = a * re, im1 = a * im;
  ints at = (n & (int32_t)job->mask) * (int32_t)job->stride + 2 * l;
  const floats column[4] = {re - re1, im1 - im, re1, -im1};
  floats row[4];
  vtranspose(column, row);
  for (int k = 0; k < 4; ++k) vstore(p->record + k * FLOATS, row[k]);
  memcpy(p->cell, &at, sizeof at);
  vstore(p->up, 0.5f * up * up), vstore(p->down, 0.5f * down * down);
}

// A whole batch; what is more than that stays.
INLINE void lay_batch(const splat_job *job, slab_batch *f) {
  splat_vector batch[VECTORS];
  for (uint32_t k = 0; k < VECTORS; ++k) prepare(job, f, k * FLOATS, &batch[k]);
  for (uint32_t k = 0; k < VECTORS; ++k) add_vector(job->grid, job->stride, &batch[k]);
  f->count -= BATCH;
  vstore(f->line, vload(f->line + BATCH)), vstore(f->depth, vload(f->depth + BATCH));
  vstore(f->weight, vload(f->weight + BATCH));
}

// Lanes beyond the last scatterer are numbers, but are not laid.
INLINE void lay_rest(const splat_job *job, slab_batch *f) {
  splat_vector batch[VECTORS];
  const uint32_t count = f->count, whole_ones = count / FLOATS;
  vstore(f->line + count, vset(0)), vstore(f->depth + count, vset(1));
  vstore(f->weight + count, vset(0));
  for (uint32_t k = 0; k * FLOATS < count; ++k) prepare(job, f, k * FLOATS, &batch[k]);
  for (uint32_t k = 0; k < whole_ones; ++k) add_vector(job->grid, job->stride, &batch[k]);
  for (uint32_t i = whole_ones * FLOATS; i < count; ++i)
    add_scatterer(job->grid, job->stride, &batch[whole_ones], (int)(i % FLOATS));
}

// Amplitude at places at rest: lumina show less of the tissue's scatterers.
INLINE floats in_lumina(const splat_job *job, const splat_map *map, floats x, floats y, floats z) {
  floats size = vset(1);
  for (const splat_lumen *l = job->lumen + map->lumen; l < job->lumen + map->lumen + map->lumens;
       ++l) {
    floats a = l->along[0] + l->along[1] * x + l->along[2] * y + l->along[3] * z;
    floats b = l->across[0] + l->across[1] * x + l->across[2] * y + l->across[3] * z;
    ints in = a * a + b * b < 1;
    if (l->solid > 0) {
      floats along_m = l->axial[0] + l->axial[1] * x + l->axial[2] * y + l->axial[3] * z;
      in = in & (clot_depth(l->form, l->solid, l->vessel, along_m, a, b) <= 0);
    }
    size = vselect(in, vset(l->amplitude), size);
  }
  return size;
}

// Scatterers of one map within the slab and, unless all of them are inside, within the grid.
INLINE void splat_some(const splat_job *job, const splat_map *map, bool inside, slab_batch *f) {
  const float *px = job->x + map->from, *py = job->y + map->from, *pz = job->z + map->from;
  const float *sign = job->sign + map->from, right = job->right;
  const splat_limits rows = job->rows;
  const form to_line = form_of(map->m, 0), to_side = form_of(map->m, 1),
             to_depth = form_of(map->m, 2);
  const uint32_t count = map->count;
  const float amplitude = map->m[0][3];
  for (uint32_t i = 0; i < count; i += FLOATS) {
    floats x = vload(px + i), y = vload(py + i), z = vload(pz + i);
    floats side = along(&to_side, x, y, z), height = 1 - side * side;
    ints in = height > 0;
    if (!vany(in)) continue;
    floats line = along(&to_line, x, y, z), depth = along(&to_depth, x, y, z);
    if (!inside) {
      floats row = depth + 0.5f; // as prepare() rounds it
      in = in & (line >= 0) & (line < right) & (row >= rows.first) & (row < rows.last);
    }
    floats weight = vload(sign + i) * height * amplitude;
    if (map->lumens) weight = weight * in_lumina(job, map, x, y, z);
    const uint32_t kept = vbits(in);
    vcompress(kept, line, f->line + f->count);
    vcompress(kept, depth, f->depth + f->count);
    vcompress(kept, weight, f->weight + f->count);
    f->count += (uint32_t)__builtin_popcount(kept);
    if (f->count >= BATCH) lay_batch(job, f);
  }
}

// A map whose cube lies inside the grid needs no check per scatterer.
static void splat(const splat_job *job) {
  SONDE_ASSERT(((job->mask + 1) & job->mask) == 0 && job->rows.first >= 1);
  slab_batch f;
  f.count = 0;
  for (const splat_map *map = job->map; map < job->map + job->maps; ++map) {
    SONDE_ASSERT(map->count % ECHO_ALIGN == 0);
    const float(*m)[4] = map->m;
    float line =
        0.5f * (__builtin_fabsf(m[1][0]) + __builtin_fabsf(m[2][0]) + __builtin_fabsf(m[3][0])) +
        0.01f;
    float depth =
        0.5f * (__builtin_fabsf(m[1][2]) + __builtin_fabsf(m[2][2]) + __builtin_fabsf(m[3][2])) +
        0.01f;
    float row = m[0][2] + 0.5f;
    bool inside = job->cube && m[0][0] > line && m[0][0] + line < job->right &&
                  row - depth > job->rows.first && row + depth < job->rows.last;
    if (inside)
      splat_some(job, map, true, &f);
    else
      splat_some(job, map, false, &f);
  }
  lay_rest(job, &f);
}

INLINE uint32_t stream_hash(uint32_t h) {
  h = (h ^ (h >> 15)) * 0x2c1b3c6du;
  h = (h ^ (h >> 12)) * 0x297a2d39u;
  return h ^ (h >> 15);
}

// Blood on its streamlines, which are apart from each other: the compiler makes vectors of this.
static void stream(const stream_job *job) {
  const float *restrict z = job->z, *restrict speed = job->speed;
  float *restrict place = job->at, *restrict sign = job->sign;
  const double flowed = job->flowed;
  const uint32_t salt = job->salt * 0xc2b2ae3du, first = job->first;
  const uint32_t *restrict bundle = job->bundle;
  const float streaks = (float)job->streaks, even = 1 / __builtin_sqrtf(1 + streaks * streaks / 3);
  const int32_t segment = job->segment;
  SONDE_ASSERT(job->count <= 0x7fffffff);
  for (uint32_t i = 0; i < job->count; ++i) {
    double at = (double)z[i] + flowed * (double)speed[i], whole = __builtin_floor(at);
    uint32_t train = (uint32_t)(segment - (int32_t)whole);
    uint32_t h = stream_hash(train * 0x9e3779b1u ^ (first + i) * 0x85ebca77u ^ salt);
    uint32_t s = stream_hash(train * 0x9e3779b1u ^ bundle[i] * 0xb5297a4du ^ salt);
    place[i] = (float)(at - whole - 0.5);
    float size = even * (1 + streaks * ((float)(int32_t)(s >> 8) * 0x1p-23f - 1));
    sign[i] = (float)(2 * (int32_t)(h & 1) - 1) * size;
  }
}

#endif
