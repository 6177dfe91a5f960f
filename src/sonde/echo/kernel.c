// Inner loops of the image; kernel_*_hot.c include this file once per instruction set.
//
// splat      scatterers through affine maps onto two columns and three samples each, carrier phase
//            included
// splat_some those of one map, with or without checks at the grid's border
// in_lumina  how much of them shows in the lumina
// make_parcel, lay_batch, lay_rest  those within the slab, closed up
// lay, lay_one  one vector of them, in order
// stream     blood along its streamlines
// spread_taps, tap_of  kernels' numbers over vectors
// lateral    symmetric complex kernels of rank three on one row
// axial      real kernels down the rows, noise, compensation, modulus, logarithm
// add_row, add_rows  its sums, as the registers allow
// gather_tissue, even_tissue, tissue  in kernel_walls.h, kernel_tissue.h
// merge      a row of the grid, times its gain, to even and odd columns
// widen, mix rows of the coarse plane, per line and between two
// fade       attenuation and clutter of a row
// convert    bilinear scan conversion of one row of pixels
#include "base/vector_records.h"

#include "base/base.h"
#include "echo/kernel.h"
#include "echo/kernel_walls.h"
#include "echo/kernel_tissue.h"

#include <string.h>

// A vector of scatterers: what each adds to its two columns, where, and the shares of the samples
// above and below; the nearest one gets the rest: a quadratic spline.
typedef struct parcel {
  _Alignas(sizeof(floats)) float record[4 * FLOATS];
  uint32_t cell[FLOATS];
  float up[FLOATS], down[FLOATS];
} parcel;

INLINE void lay_one(float *grid, uint32_t stride, const parcel *p, int lane) {
  const int place = lane % 4 * (FLOATS / 4) + lane / 4; // see vtranspose()
  const uint32_t cell = p->cell[lane];                  // of the row above
  float *above = grid + cell, *here = grid + stride + cell, *below = grid + 2 * stride + cell;
  float_x4 value = vload_float_x4(p->record + 4 * place);
  float_x4 up = p->up[lane] * value, down = p->down[lane] * value;
  vstore(above, vload_float_x4(above) + up);
  vstore(here, vload_float_x4(here) + (value - up - down));
  vstore(below, vload_float_x4(below) + down);
}

INLINE void lay(float *grid, uint32_t stride, const parcel *p) {
  for (int block = 0; block < FLOATS / 4; ++block)
    for (int k = 0; k < 4; ++k) lay_one(grid, stride, p, 4 * block + k);
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
enum { FLOCK = 128, BATCH = FLOCK / FLOATS };

typedef struct flock {
  uint32_t count;
  float line[FLOCK + FLOATS], depth[FLOCK + FLOATS], weight[FLOCK + FLOATS];
} flock;

INLINE void make_parcel(const splat_job *job, const flock *f, uint32_t from, parcel *p) {
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
INLINE void lay_batch(const splat_job *job, flock *f) {
  parcel batch[BATCH];
  for (uint32_t k = 0; k < BATCH; ++k) make_parcel(job, f, k * FLOATS, &batch[k]);
  for (uint32_t k = 0; k < BATCH; ++k) lay(job->grid, job->stride, &batch[k]);
  f->count -= FLOCK;
  vstore(f->line, vload(f->line + FLOCK)), vstore(f->depth, vload(f->depth + FLOCK));
  vstore(f->weight, vload(f->weight + FLOCK));
}

// Lanes beyond the last scatterer are numbers, but are not laid.
INLINE void lay_rest(const splat_job *job, flock *f) {
  parcel batch[BATCH];
  const uint32_t count = f->count, whole_ones = count / FLOATS;
  vstore(f->line + count, vset(0)), vstore(f->depth + count, vset(1));
  vstore(f->weight + count, vset(0));
  for (uint32_t k = 0; k * FLOATS < count; ++k) make_parcel(job, f, k * FLOATS, &batch[k]);
  for (uint32_t k = 0; k < whole_ones; ++k) lay(job->grid, job->stride, &batch[k]);
  for (uint32_t i = whole_ones * FLOATS; i < count; ++i)
    lay_one(job->grid, job->stride, &batch[whole_ones], (int)(i % FLOATS));
}

// Amplitude at places at rest: lumina show less of the tissue's scatterers.
INLINE floats in_lumina(const splat_job *job, const splat_map *map, floats x, floats y, floats z) {
  floats size = vset(1);
  for (const splat_lumen *l = job->lumen + map->lumen; l < job->lumen + map->lumen + map->lumens;
       ++l) {
    floats a = l->along[0] + l->along[1] * x + l->along[2] * y + l->along[3] * z;
    floats b = l->across[0] + l->across[1] * x + l->across[2] * y + l->across[3] * z;
    ints in = a * a + b * b < 1;
    if (l->chord < 1) {
      floats way = l->way[0] + l->way[1] * x + l->way[2] * y + l->way[3] * z;
      in = in & (a >= -l->chord - clot_surface(l->vessel, way, b));
    }
    size = vselect(in, vset(l->amplitude), size);
  }
  return size;
}

INLINE void splat_some(const splat_job *job, const splat_map *map, bool inside, flock *f) {
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
      floats row = depth + 0.5f; // as in make_parcel
      in = in & (line >= 0) & (line < right) & (row >= rows.first) & (row < rows.last);
    }
    floats weight = vload(sign + i) * height * amplitude;
    if (map->lumens) weight = weight * in_lumina(job, map, x, y, z);
    const uint32_t kept = vbits(in);
    vcompress(kept, line, f->line + f->count);
    vcompress(kept, depth, f->depth + f->count);
    vcompress(kept, weight, f->weight + f->count);
    f->count += (uint32_t)__builtin_popcount(kept);
    if (f->count >= FLOCK) lay_batch(job, f);
  }
}

// A map whose cube lies inside the grid needs no check per scatterer.
static void splat(const splat_job *job) {
  SONDE_ASSERT(((job->mask + 1) & job->mask) == 0 && job->rows.first >= 1);
  flock f;
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

// Streamlines are apart from each other: the compiler makes vectors of this.
static void stream(const stream_job *job) {
  const float *restrict z = job->z, *restrict speed = job->speed;
  float *restrict place = job->at, *restrict sign = job->sign;
  const double way = job->flowed;
  const uint32_t salt = job->salt * 0xc2b2ae3du, first = job->first;
  const int32_t segment = job->segment;
  SONDE_ASSERT(job->count <= 0x7fffffff);
  for (uint32_t i = 0; i < job->count; ++i) {
    double at = (double)z[i] + way * (double)speed[i], whole = __builtin_floor(at);
    uint32_t train = (uint32_t)(segment - (int32_t)whole);
    uint32_t h = train * 0x9e3779b1u ^ (first + i) * 0x85ebca77u ^ salt;
    h = (h ^ (h >> 15)) * 0x2c1b3c6du;
    h = (h ^ (h >> 12)) * 0x297a2d39u;
    h = (h ^ (h >> 15)) & 1;
    place[i] = (float)(at - whole - 0.5);
    sign[i] = (float)(2 * (int32_t)h - 1);
  }
}

// Where it takes more than a load to spread a number over a vector, taps are spread once per job.
enum { SPREAD = FLOATS == 4, LATERAL_SUMS = LATERAL_PARTS * SONDE_RANK };

typedef struct taps {
  const float *from;
  floats spread[SPREAD ? LATERAL_SUMS * (SONDE_MOST_TAPS + 1) : 1];
} taps;

INLINE void spread_taps(const float *from, int count, taps *out) {
  SONDE_ASSERT(count <= LATERAL_SUMS * (SONDE_MOST_TAPS + 1));
  out->from = from;
  for (int i = 0; SPREAD && i < count; ++i) out->spread[i] = vset(from[i]);
}
INLINE floats tap_of(const taps *t, int i) { return SPREAD ? t->spread[i] : vset(t->from[i]); }

INLINE void add_taps(const taps *tap, int first, floats x, floats y, floats sum[LATERAL_SUMS]) {
  const floats part[LATERAL_PARTS] = {x + y, x, y};
  for (int k = 0; k < LATERAL_SUMS; ++k) sum[k] += tap_of(tap, first + k) * part[k % LATERAL_PARTS];
}

// As many vectors of lines at once as there are registers for their sums.
enum { ABREAST = FLOATS == 16 ? 2 : 1 };

INLINE void lateral_some(const lateral_job *job, const taps *tap, uint32_t l, uint32_t vectors) {
  floats sum[ABREAST][LATERAL_SUMS];
  for (uint32_t v = 0; v < vectors; ++v) {
    for (int k = 0; k < LATERAL_SUMS; ++k) sum[v][k] = vset(0);
    add_taps(tap, 0, vload(job->re[0] + l + v * FLOATS), vload(job->im[0] + l + v * FLOATS),
             sum[v]);
  }
  for (int t = 1; t <= job->half; ++t) {
    const float *re = job->re[t % 2] + l, *im = job->im[t % 2] + l;
    int left = (t + 1) / 2, right = t / 2;
    READ_AFRESH;
    for (uint32_t v = 0; v < vectors; ++v, re += FLOATS, im += FLOATS)
      add_taps(tap, LATERAL_SUMS * t, vload(re - left) + vload(re + right),
               vload(im - left) + vload(im + right), sum[v]);
  }
  for (uint32_t v = 0; v < vectors; ++v)
    for (uint32_t k = 0; k < SONDE_RANK; ++k) {
      const floats *of = sum[v] + LATERAL_PARTS * k;
      float *out = job->out + 2 * k * job->lines + l + v * FLOATS;
      vstore(out, of[0] - of[2]), vstore(out + job->lines, of[0] + of[1]);
    }
}

static void lateral(const lateral_job *job) {
  SONDE_ASSERT(job->half >= 0 && job->half <= SONDE_MOST_TAPS);
  taps tap;
  spread_taps(&job->tap[0][0][0], LATERAL_SUMS * (job->half + 1), &tap);
  uint32_t l = 0;
  for (; l + ABREAST * FLOATS <= job->lines; l += ABREAST * FLOATS)
    lateral_some(job, &tap, l, ABREAST);
  for (; l < job->lines; l += FLOATS) lateral_some(job, &tap, l, 1);
}

// 20 log10 of a > 0 within 0.01 dB: exponent bits and a polynomial in the mantissa.
INLINE floats decibels(floats a) {
  ints bits = (ints)a;
  floats exponent = vreal((bits >> 23) - 127);
  floats t = (floats)((bits & 0x7fffff) | 0x3f800000) - 1;
  floats log2m = t * (1.4419f + t * (-0.7096f + t * (0.4175f + t * (-0.1943f + t * 0.0445f))));
  return 6.0205999f * (exponent + log2m);
}

INLINE void finish_axial(const axial_job *job, int sample, uint32_t l, const floats *sum) {
  const float *noise = job->noise[sample] + l;
  floats re = job->noise_size * vload(noise) + sum[0] + sum[2] + sum[4];
  floats im = job->noise_size * vload(noise + job->lines) + sum[1] + sum[3] + sum[5];
  floats size = job->compensation[sample] * vsqrt(re * re + im * im);
  vstore(job->envelope[sample] + l, size);
  floats grey = (decibels(vmax(size, vset(1e-20f))) + job->offset_db) * job->grey_per_db;
  vstore(job->grey[sample] + l, vmin(vmax(grey, vset(0)), vset(255)));
}

// Row t of the first sample's, for samples `first` up to `end`; parts: 0 real, 1 imaginary.
INLINE void add_row(const axial_job *job, const taps *tap, const float *row, int t, int part,
                    int parts, int first, int end, floats sum[AXIAL_MOST][RING_PLANES]) {
  READ_AFRESH;
  UNROLL for (int k = 0; k < SONDE_RANK; ++k) {
    floats number[2];
    UNROLL for (int p = part; p < parts; ++p) number[p] =
        vload(row + (uint32_t)(2 * k + p) * job->lines);
    UNROLL for (int s = first; s < end; ++s) {
      const floats u = tap_of(tap, SONDE_RANK * (t - s) + k);
      UNROLL for (int p = part; p < parts; ++p) sum[s][2 * k + p] += u * number[p];
    }
  }
}

// Rows that only some of the samples read come before and behind the loop.
INLINE void add_rows(const axial_job *job, const taps *tap, uint32_t l, int from, int samples,
                     int part, int parts, floats sum[AXIAL_MOST][RING_PLANES]) {
  const float *const *rows = job->rows + from;
  const int count = job->count;
  UNROLL for (int t = 0; t + 1 < samples; ++t)
      add_row(job, tap, rows[t] + l, t, part, parts, 0, t + 1, sum);
  for (int t = samples - 1; t < count; ++t)
    add_row(job, tap, rows[t] + l, t, part, parts, 0, samples, sum);
  UNROLL for (int s = 1; s < samples; ++s)
      add_row(job, tap, rows[count - 1 + s] + l, count - 1 + s, part, parts, s, samples, sum);
}

// Samples share the rows they read; each is summed from its first row to its last.
INLINE void axial_some(const axial_job *job, const taps *tap, uint32_t l, int from, int samples) {
  floats sum[AXIAL_MOST][RING_PLANES]; // apart: sums need not wait for each other
  for (int s = 0; s < samples; ++s)
    for (int k = 0; k < RING_PLANES; ++k) sum[s][k] = vset(0);
  if (FLOATS == 16) { // thirty-two registers hold both parts, sixteen one
    add_rows(job, tap, l, from, samples, 0, 2, sum);
  } else {
    add_rows(job, tap, l, from, samples, 0, 1, sum);
    add_rows(job, tap, l, from, samples, 1, 2, sum);
  }
  for (int s = 0; s < samples; ++s) finish_axial(job, from + s, l, sum[s]);
}

static void axial(const axial_job *job) {
  SONDE_ASSERT(job->count >= AXIAL_MOST && job->lines % ECHO_ALIGN == 0);
  SONDE_ASSERT(job->samples > 0 && job->samples <= AXIAL_MOST);
  taps tap;
  spread_taps(&job->tap[0][0], SONDE_RANK * job->count, &tap);
  for (uint32_t l = 0; l < job->lines; l += FLOATS) {
    if (job->samples == AXIAL_MOST)
      axial_some(job, &tap, l, 0, AXIAL_MOST);
    else
      for (int s = 0; s < job->samples; ++s) axial_some(job, &tap, l, s, 1);
  }
}

// Angle of (z, x), |x| < 2 z: arctangent of less than 50 degrees.
INLINE floats angle_of(floats x, floats z) {
  floats t = x / (z + vsqrt(x * x + z * z)), u = t * t; // half the angle
  floats p = 0.19961517305842502f + u * (-0.13722131260315293f + u * 0.07586774308787624f);
  return 2 * t * (0.9999999631898905f + u * (-0.33332396678715026f + u * p));
}

INLINE floats pixel_of(const convert_job *job, floats x) {
  floats from = vset(job->z + job->radius_m), v = angle_of(x, from) * job->radius_m;
  floats depth = vsqrt(x * x + from * from) - job->radius_m;
  floats line = v * job->lines_per_m + job->first_line, sample = depth * job->samples_per_m;
  float right = (float)(job->lines - 1), bottom = (float)(job->samples - 1);
  ints in = (line >= 0) & (line < right) & (sample >= 0) & (sample < bottom);
  line = vonly(in, line), sample = vonly(in, sample);
  ints l = vint(line), n = vint(sample), at = n * (int32_t)job->stride + l;
  floats a = line - vreal(l), b = sample - vreal(n);
  floats p = vgather(job->grey, at), q = vgather(job->grey, at + 1);
  at = at + (int32_t)job->stride;
  floats r = vgather(job->grey, at), s = vgather(job->grey, at + 1);
  p = p + a * (q - p), r = r + a * (s - r);
  return vonly(in, p + b * (r - p) + 0.5f);
}

// One depth for the whole row of pixels: first between samples, then between lines.
INLINE floats pixel_between(const convert_job *job, const float *mixed, bool close, floats x) {
  floats line = x * job->lines_per_m + job->first_line;
  ints in = (line >= 0) & (line < (float)(job->lines - 1));
  if (!vany(in)) return vset(0);
  line = vonly(in, line);
  ints l = vint(line);
  floats a = line - vreal(l), p, q;
  if (close) {
    const int32_t from = in[0] ? l[0] : 0;
    const ints at = in & (l - from);
    p = vlook_up(mixed + from, at), q = vlook_up(mixed + from + 1, at);
  } else {
    p = vgather(mixed, l), q = vgather(mixed, l + 1);
  }
  return vonly(in, p + a * (q - p) + 0.5f);
}

static void mix(const float *top, const float *low, float share, float *out, uint32_t count) {
  SONDE_ASSERT(count % ECHO_ALIGN == 0);
  for (uint32_t i = 0; i < count; i += FLOATS) {
    floats a = vload(top + i);
    vstore(out + i, a + share * (vload(low + i) - a));
  }
}

INLINE void mix_samples(const convert_job *job, float *mixed) {
  float sample = job->z * job->samples_per_m;
  uint32_t n = (uint32_t)sample < job->samples - 2 ? (uint32_t)sample : job->samples - 2;
  const float *top = job->grey + (size_t)n * job->stride;
  mix(top, top + job->stride, sample - (float)n, mixed, job->stride);
  vstore(mixed + job->stride, vset(0)); // read beside the last line, not used
}

typedef uint8_t bytes_wide __attribute__((vector_size(VECTOR_BYTES / 4)));

static void convert(const convert_job *job) {
  SONDE_ASSERT(job->lines_per_m > 0 && job->stride <= SONDE_MOST_LINES);
  float ramp[FLOATS], mixed[SONDE_MOST_LINES + FLOATS + 1];
  for (int k = 0; k < FLOATS; ++k) ramp[k] = (float)k;
  const bool flat = !(job->radius_m > 0),
             close = (FLOATS - 1) * job->dx * job->lines_per_m < FLOATS - 2;
  if (flat) mix_samples(job, mixed);
  for (uint32_t c = 0; c < job->width; c += FLOATS) {
    floats x = job->x + ((float)c + vload(ramp)) * job->dx;
    ints grey = vint(flat ? pixel_between(job, mixed, close, x) : pixel_of(job, x));
    bytes_wide bytes = __builtin_convertvector(grey, bytes_wide);
    if (c + FLOATS <= job->width)
      memcpy(job->out + c, &bytes, FLOATS);
    else
      memcpy(job->out + c, &bytes, job->width - c);
  }
}

// Numbers k, k + 4, k + 8, .. of 4 W.
INLINE void fields(const float *p, floats out[4]) {
#if defined(__AVX512F__)
  const __m512i pairs = _mm512_setr_epi32(0, 4, 8, 12, 16, 20, 24, 28, 1, 5, 9, 13, 17, 21, 25, 29);
  const __m512i others = _mm512_add_epi32(pairs, _mm512_set1_epi32(2));
  __m512 a = (__m512)vload(p), b = (__m512)vload(p + FLOATS);
  __m512 c = (__m512)vload(p + 2 * FLOATS), d = (__m512)vload(p + 3 * FLOATS);
  __m512 ab = _mm512_permutex2var_ps(a, pairs, b), cd = _mm512_permutex2var_ps(c, pairs, d);
  out[0] = (floats)_mm512_shuffle_f32x4(ab, cd, 0x44),
  out[1] = (floats)_mm512_shuffle_f32x4(ab, cd, 0xee);
  ab = _mm512_permutex2var_ps(a, others, b), cd = _mm512_permutex2var_ps(c, others, d);
  out[2] = (floats)_mm512_shuffle_f32x4(ab, cd, 0x44),
  out[3] = (floats)_mm512_shuffle_f32x4(ab, cd, 0xee);
#elif defined(__AVX2__)
  __m256 a = (__m256)vload(p), b = (__m256)vload(p + FLOATS);
  __m256 c = (__m256)vload(p + 2 * FLOATS), d = (__m256)vload(p + 3 * FLOATS);
  __m256 ac = _mm256_permute2f128_ps(a, c, 0x20), AC = _mm256_permute2f128_ps(a, c, 0x31);
  __m256 bd = _mm256_permute2f128_ps(b, d, 0x20), BD = _mm256_permute2f128_ps(b, d, 0x31);
  __m256 lo = _mm256_unpacklo_ps(ac, bd), LO = _mm256_unpacklo_ps(AC, BD);
  __m256 hi = _mm256_unpackhi_ps(ac, bd), HI = _mm256_unpackhi_ps(AC, BD);
  out[0] = (floats)_mm256_unpacklo_ps(lo, LO), out[1] = (floats)_mm256_unpackhi_ps(lo, LO);
  out[2] = (floats)_mm256_unpacklo_ps(hi, HI), out[3] = (floats)_mm256_unpackhi_ps(hi, HI);
#else
  float_x4 a = vload_float_x4(p), b = vload_float_x4(p + 4), c = vload_float_x4(p + 8),
           d = vload_float_x4(p + 12);
  for (int k = 0; k < 4; ++k) out[k] = (floats){a[k], b[k], c[k], d[k]};
#endif
}

INLINE floats gain_at(const merge_job *job, uint32_t l) {
  floats top = vload(job->top + l);
  return top + job->share * (vload(job->low + l) - top);
}

static void merge(const merge_job *job) {
  SONDE_ASSERT(job->count % ECHO_ALIGN == 0);
  for (uint32_t l = 0; l < job->count; l += FLOATS) {
    float *grid = job->grid + 4 * (size_t)l; // an even column and the odd one after it
    floats number[4], even = vset(1), odd = vset(1);
    fields(grid, number);
    if (job->top) even = gain_at(job, l), odd = 0.5f * (even + gain_at(job, l + 1));
    vstore(job->re[0] + l, even * number[0]), vstore(job->im[0] + l, even * number[1]);
    vstore(job->re[1] + l, odd * number[2]), vstore(job->im[1] + l, odd * number[3]);
    for (uint32_t k = 0; k < 4; ++k) vstore(grid + k * FLOATS, vset(0));
  }
}

static void widen(const widen_job *job) {
  SONDE_ASSERT(job->lines % ECHO_ALIGN == 0);
  for (uint32_t l = 0; l < job->lines; l += FLOATS) {
    const int32_t from = job->column[l];
    ints column, at;
    memcpy(&column, job->column + l, sizeof column);
    at = column - from;
    floats left, right;
    if (job->column[l + FLOATS - 1] - from < FLOATS)
      left = vlook_up(job->in + from, at), right = vlook_up(job->in + from + 1, at);
    else
      left = vgather(job->in, column), right = vgather(job->in + 1, column);
    vstore(job->out + l, left + vload(job->share + l) * (right - left));
  }
}

// What is left of the scattered amplitude behind the losses, and the clutter beside it.
static void fade(const fade_job *job) {
  SONDE_ASSERT(job->lines % ECHO_ALIGN == 0);
  SONDE_ASSERT(job->clutter >= 0 && job->kept <= 1);
  for (uint32_t l = 0; l < job->lines; l += FLOATS) {
    floats loss = vmin(vload(job->loss_db + l), vset(600)), tail = vload(job->tail + l);
    floats left = power2(loss * -0.16609640474f), facets = vload(job->rough + l) * left;
    floats own = vload(job->scatter + l) * left, power = own * own;
    vstore(job->gain + l, vsqrt(power + facets * facets + job->clutter * tail));
    vstore(job->tail + l, job->kept * (tail + job->fresh * (power - tail)));
  }
}

const echo_kernels SONDE_KERNELS = {SONDE_KERNELS_NAME,
                                    splat,
                                    gather_tissue,
                                    even_tissue,
                                    stream,
                                    lateral,
                                    axial,
                                    tissue,
                                    merge,
                                    widen,
                                    mix,
                                    fade,
                                    convert};
