// Statistics of a picture's texture: grey levels, widths and lags of the autocorrelation, direction
// and strength of lines, and energy by scale, of patches of 64 x 64 pixels.
#include "texture.h"

#include "app.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = 64, WIDTH = 512, LAGS = 24, LEVELS = 5 };

static const char *const NAMES[TEXTURE_FEATURES] = {
    "grey mean",       "grey deviation", "grey 5 %",       "grey 50 %",      "grey 95 %",
    "skewness",        "kurtosis",       "axial width",    "lateral width",  "axial lag 4",
    "lateral lag 4",   "axial lag 8",    "lateral lag 8",  "line direction", "line strength",
    "energy at 1 px",  "energy at 2 px", "energy at 4 px", "energy at 8 px", "tails at 1 px",
    "tails at 4 px",   "axial lag 1",    "axial lag 2",    "lateral lag 1",  "lateral lag 2",
    "skewness at 1 px"};

const char *texture_name(uint32_t feature) {
  assert(feature < TEXTURE_FEATURES);
  return NAMES[feature];
}

// Gaussian blur of a patch whose border mirrors.
static void blur(const double *in, double sigma, double *out) {
  double kernel[2 * SIDE], pass[SIDE * SIDE], sum = 0;
  const int half = (int)(3 * sigma + 0.5);
  for (int k = -half; k <= half; ++k) sum += kernel[k + half] = exp(-0.5 * k * k / (sigma * sigma));
  for (int axis = 0; axis < 2; ++axis) {
    const double *from = axis ? pass : in;
    double *to = axis ? out : pass;
    const int along = axis ? SIDE : 1, beside = axis ? 1 : SIDE;
    for (int j = 0; j < SIDE; ++j)
      for (int i = 0; i < SIDE; ++i) {
        double value = 0;
        for (int k = -half; k <= half; ++k) {
          int at = abs(i + k);
          if (at >= SIDE) at = 2 * SIDE - 2 - at;
          value += kernel[k + half] * from[j * beside + at * along];
        }
        to[j * beside + i * along] = value / sum;
      }
  }
}

// Mean, deviation, skewness and excess kurtosis.
static void moments(const double *p, double m[4]) {
  double mean = 0, square = 0, cube = 0, fourth = 0;
  for (int i = 0; i < SIDE * SIDE; ++i) mean += p[i] / (SIDE * SIDE);
  for (int i = 0; i < SIDE * SIDE; ++i) {
    const double d = p[i] - mean;
    square += d * d, cube += d * d * d, fourth += d * d * d * d;
  }
  const double s = sqrt(square / (SIDE * SIDE)) + 1e-6;
  m[0] = mean, m[1] = s, m[2] = cube / (SIDE * SIDE) / (s * s * s);
  m[3] = fourth / (SIDE * SIDE) / (s * s * s * s) - 3;
}

static double correlation(const double *p, int down, int across) {
  double sum = 0;
  for (int j = 0; j + down < SIDE; ++j)
    for (int i = 0; i + across < SIDE; ++i)
      sum += p[j * SIDE + i] * p[(j + down) * SIDE + i + across];
  return sum;
}

// Full width of the autocorrelation at half its height, pixels.
static double half_width(const double *lag) {
  for (int k = 1; k < LAGS; ++k)
    if (lag[k] < 0.5) return 2 * (k - 1 + (lag[k - 1] - 0.5) / (lag[k - 1] - lag[k] + 1e-9));
  return 2.0 * LAGS;
}

static void measure(const double *p, double f[TEXTURE_FEATURES]) {
  double level[LEVELS][SIDE * SIDE], rest[SIDE * SIDE], sorted[SIDE * SIDE], m[4], b[4];
  moments(p, m);
  memcpy(sorted, p, sizeof sorted);
  f[0] = m[0], f[1] = m[1], f[5] = m[2], f[6] = m[3];
  f[2] = app_quantile(sorted, SIDE * SIDE, 0.05), f[3] = sorted[SIDE * SIDE / 2];
  f[4] = sorted[SIDE * SIDE * 19 / 20];
  // Autocorrelation of what a blur of 8 pixels leaves.
  static const double SIGMA[LEVELS] = {0, 1, 2, 4, 8};
  memcpy(level[0], p, sizeof level[0]);
  for (int k = 1; k < LEVELS; ++k) blur(p, SIGMA[k], level[k]);
  for (int i = 0; i < SIDE * SIDE; ++i) rest[i] = p[i] - level[4][i];
  double down[LAGS], across[LAGS], zero = fmax(correlation(rest, 0, 0), 1e-9);
  for (int k = 0; k < LAGS; ++k)
    down[k] = correlation(rest, k, 0) / zero, across[k] = correlation(rest, 0, k) / zero;
  f[7] = half_width(down), f[8] = half_width(across);
  f[21] = down[1], f[22] = down[2], f[23] = across[1], f[24] = across[2];
  f[9] = down[4], f[10] = across[4], f[11] = down[8], f[12] = across[8];
  // Structure tensor of the patch.
  double h[SIDE * SIDE], xx = 1e-6, yy = 1e-6, xy = 0;
  blur(p, 1.5, h);
  for (int j = 1; j < SIDE - 1; ++j)
    for (int i = 1; i < SIDE - 1; ++i) {
      const double *at = h + j * SIDE + i, x = at[1] - at[-1], y = at[SIDE] - at[-SIDE];
      xx += x * x, yy += y * y, xy += x * y;
    }
  f[13] = log(yy / xx), f[14] = hypot(xx - yy, 2 * xy) / (xx + yy);
  // Bands between the levels: energy, and how heavy the tails are.
  for (int k = 0; k + 1 < LEVELS; ++k) {
    for (int i = 0; i < SIDE * SIDE; ++i) rest[i] = level[k][i] - level[k + 1][i];
    moments(rest, b);
    f[15 + k] = log(b[1] / m[1] + 1e-6);
    if (k == 0) f[25] = b[2];
    if (k == 0 || k == 2) f[19 + k / 2] = log(b[3] + 3.01);
  }
}

void texture_add(texture_table *table, const sonde_image *image, uint32_t most) {
  assert(table != NULL && image->width > 0);
  const double scale = (double)image->width / WIDTH;
  const int height = (int)(image->height / scale);
  uint32_t taken = 0, fit = 0;
  const uint32_t rows = height > SIDE + 24 ? (uint32_t)(height - SIDE - 24) / (SIDE / 2) + 1 : 0;
  const uint32_t columns = (WIDTH - SIDE - 20) / (SIDE / 2) + 1, all = rows * columns;
  for (uint32_t k = 0; k < all && taken < most && table->patches < TEXTURE_MOST_PATCHES; ++k) {
    // Patches all over the picture, in an order that spreads the first ones.
    const uint32_t which = (uint32_t)((uint64_t)k * 7919 % all);
    const int left = 12 + (int)(which % columns) * SIDE / 2;
    const int top = 16 + (int)(which / columns) * SIDE / 2;
    double p[SIDE * SIDE], mean = 0, f[TEXTURE_FEATURES];
    uint32_t dark = 0;
    for (int i = 0; i < SIDE * SIDE; ++i) {
      // The mean of the picture's pixels below one of the patch's, or between its neighbours.
      const double x = (left + i % SIDE + 0.5) * scale - 0.5,
                   y = (top + i / SIDE + 0.5) * scale - 0.5;
      double sum = 0, weight = 0;
      const double reach = fmax(scale, 1);
      for (int v = (int)floor(y - reach) + 1; v < y + reach; ++v)
        for (int u = (int)floor(x - reach) + 1; u < x + reach; ++u) {
          if (u < 0 || v < 0 || u >= (int)image->width || v >= (int)image->height) continue;
          const double w = (1 - fabs(u - x) / reach) * (1 - fabs(v - y) / reach);
          sum += w * image->pixels[(size_t)v * image->width + (size_t)u], weight += w;
        }
      p[i] = weight > 0 ? sum / weight : 0;
      mean += p[i] / (SIDE * SIDE), dark += p[i] < 2;
    }
    if (mean < 8 || dark > 0.4 * SIDE * SIDE) {
      ++table->dark;
      continue;
    }
    measure(p, f);
    fit = table->patches++;
    ++taken;
    for (uint32_t n = 0; n < TEXTURE_FEATURES; ++n) table->feature[n][fit] = f[n];
  }
}

void texture_quantiles(texture_table *table, double quantile[TEXTURE_FEATURES][TEXTURE_QUANTILES]) {
  static const double SHARE[TEXTURE_QUANTILES] = {0.1, 0.5, 0.9};
  for (uint32_t n = 0; n < TEXTURE_FEATURES; ++n)
    for (int q = 0; q < TEXTURE_QUANTILES; ++q)
      quantile[n][q] = app_quantile(table->feature[n], table->patches, SHARE[q]);
}
