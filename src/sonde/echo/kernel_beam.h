// The beam: rows of the grid times their gain; symmetric complex lateral kernels of rank three on
// one row; real axial kernels down the rows with noise, compensation, modulus and logarithm.
// Included by kernel.c only.
#ifndef SONDE_SRC_ECHO_KERNEL_BEAM_H
#define SONDE_SRC_ECHO_KERNEL_BEAM_H

#include "base/base.h"
#include "echo/kernel.h"

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

// Gain of even columns between two rows of the march.
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

// Adds a column after some quarter turns.
INLINE void add_turned(const float *re, const float *im, int turns, floats *x, floats *y) {
  const floats a = vload(re), b = vload(im);
  if (turns == 0) *x = *x + a, *y = *y + b;
  if (turns == 1) *x = *x - b, *y = *y + a;
  if (turns == 2) *x = *x - a, *y = *y - b;
  if (turns == 3) *x = *x + b, *y = *y - a;
}

// A merged row of a look: aberration spreads it, side lobes join, and every column turns by the
// look's phase.
static void look(const look_job *job) {
  SONDE_ASSERT(job->count % ECHO_ALIGN == 0);
  for (int part = 0; part < SONDE_FINE; ++part)
    for (uint32_t l = 0; l < job->count; l += FLOATS) {
      const float *re = job->re[part] + l, *im = job->im[part] + l;
      floats x = vload(re), y = vload(im);
      if (job->kept) {
        const floats top = vload(job->kept + l);
        const floats kept = top + job->share * (vload(job->kept_low + l) - top);
        const floats lost = vsqrt(vmax(1 - kept * kept, vset(0)));
        const int32_t *at = job->halo->offset;
        floats u = vset(0), v = vset(0);
        UNROLL for (int t = 0; t < HALO_TAPS; ++t)
            add_turned(re + at[t], im + at[t], halo_turns[t], &u, &v);
        x = kept * x + halo_size * lost * u, y = kept * y + halo_size * lost * v;
      }
      if (job->haze) {
        const int32_t *at = job->haze->offset;
        floats u = vset(0), v = vset(0);
        UNROLL for (int t = 0; t < HAZE_TAPS; ++t)
            add_turned(re + at[t], im + at[t], haze_turns[t], &u, &v);
        x = x + job->haze->size * u, y = y + job->haze->size * v;
      }
      floats c = vload(job->ramp_re[part] + l), s = vload(job->ramp_im[part] + l);
      vstore(job->out_re[part] + l, x * c - y * s), vstore(job->out_im[part] + l, y * c + x * s);
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

// Adds one tap of all kernels, times the sum of the two columns to its left and right.
INLINE void add_taps(const taps *tap, int first, floats x, floats y, floats sum[LATERAL_SUMS]) {
  const floats part[LATERAL_PARTS] = {x + y, x, y};
  for (int k = 0; k < LATERAL_SUMS; ++k) sum[k] += tap_of(tap, first + k) * part[k % LATERAL_PARTS];
}

// As many vectors of lines at once as there are registers for their sums.
enum { ABREAST = FLOATS == 16 ? 2 : 1 };

// Sums of all kernels for some vectors of lines.
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

static void compress(const compress_job *job) {
  SONDE_ASSERT(job->looks > 0 && job->lines % ECHO_ALIGN == 0);
  for (uint32_t l = 0; l < job->lines; l += FLOATS) {
    floats mean = vload(job->look[0] + l);
    for (uint32_t k = 1; k < job->looks; ++k) mean = mean + vload(job->look[k] + l);
    mean = mean * (1.0f / (float)job->looks);
    floats grey = (decibels(vmax(mean, vset(1e-20f))) + job->offset_db) * job->grey_per_db;
    vstore(job->envelope + l, mean);
    vstore(job->grey + l, vmin(vmax(grey, vset(0)), vset(255)));
  }
}

// Noise, compensation, modulus and logarithm of a vector of lines.
INLINE void finish_axial(const axial_job *job, int sample, uint32_t l, const floats *sum) {
  const float *noise = job->noise[sample] + l;
  floats re = job->noise_size * vload(noise) + sum[0] + sum[2] + sum[4];
  floats im = job->noise_size * vload(noise + job->lines) + sum[1] + sum[3] + sum[5];
  floats size = job->compensation[sample] * vsqrt(re * re + im * im);
  vstore(job->envelope[sample] + l, size);
  if (!job->grey[sample]) return;
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

#endif
