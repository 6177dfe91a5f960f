// How like two images are.
//
// sums_of_row      column sums of seven rows
// window_ssim      one window
// mean_ssim        uniform windows of 7 x 7, constants of Wang et al. 2004
// sonde_image_likeness
#include "sweep/frames.h"

enum { WINDOW = 7, SUMS = 6 }; // known, a, b, aa, bb, ab

static void sums_of_row(const uint8_t *a, const uint8_t *b, const uint8_t *known, uint32_t width,
                        uint32_t row, double (*sums)[SUMS]) {
  for (uint32_t x = 0; x < width; ++x) {
    double *s = sums[x];
    for (int k = 0; k < SUMS; ++k) s[k] = 0;
    for (uint32_t y = row; y < row + WINDOW; ++y) {
      size_t i = (size_t)y * width + x;
      double p = a[i], q = b[i];
      s[0] += !known || known[i];
      s[1] += p, s[2] += q, s[3] += p * p, s[4] += q * q, s[5] += p * q;
    }
  }
}

// Sample variances (n - 1), C1 = (0.01 * 255)^2, C2 = (0.03 * 255)^2.
static double window_ssim(const double s[SUMS]) {
  const double n = WINDOW * WINDOW, c1 = 6.5025, c2 = 58.5225;
  double ma = s[1] / n, mb = s[2] / n;
  double va = (s[3] - n * ma * ma) / (n - 1), vb = (s[4] - n * mb * mb) / (n - 1);
  double ab = (s[5] - n * ma * mb) / (n - 1);
  return (2 * ma * mb + c1) * (2 * ab + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
}

static double mean_ssim(const uint8_t *a, const uint8_t *b, const uint8_t *known, uint32_t width,
                        uint32_t height, double (*sums)[SUMS]) {
  double total = 0;
  uint64_t windows = 0;
  for (uint32_t row = 0; row + WINDOW <= height; ++row) {
    sums_of_row(a, b, known, width, row, sums);
    double s[SUMS] = {0};
    for (uint32_t x = 0; x < width; ++x) {
      for (int k = 0; k < SUMS; ++k) s[k] += sums[x][k] - (x >= WINDOW ? sums[x - WINDOW][k] : 0);
      if (x + 1 < WINDOW || s[0] < WINDOW * WINDOW) continue; // all sums are whole: no drift
      total += window_ssim(s);
      ++windows;
    }
  }
  return windows ? total / (double)windows : (double)NAN;
}

sonde_status sonde_image_likeness(const uint8_t *a, const uint8_t *b, const uint8_t *known,
                                  uint32_t width, uint32_t height, sonde_likeness *out,
                                  sonde_error *error) {
  SONDE_ASSERT(a != NULL && b != NULL && out != NULL && width > 0 && height > 0);
  double sa = 0, sb = 0, aa = 0, bb = 0, ab = 0, absolute = 0;
  sonde_likeness l = {0};
  for (size_t i = 0; i < (size_t)width * height; ++i) {
    if (known && !known[i]) continue;
    double p = a[i], q = b[i];
    ++l.count;
    sa += p, sb += q, aa += p * p, bb += q * q, ab += p * q, absolute += fabs(p - q);
  }
  double n = (double)l.count, square = (aa - 2 * ab + bb) / n;
  if (!l.count)
    return sonde_fail(error, SONDE_MISMATCH, "the two images share no pixel that is known");
  double(*sums)[SUMS] = sonde_calloc(width, sizeof *sums);
  if (!sums) return sonde_fail_memory(error);
  l.rms_grey = sqrt(square);
  l.mae_grey = absolute / n;
  l.psnr_db = square > 0 ? 10 * log10(255.0 * 255.0 / square) : (double)INFINITY;
  double va = aa - sa * sa / n, vb = bb - sb * sb / n;
  l.ncc = va > 0 && vb > 0 ? (ab - sa * sb / n) / sqrt(va * vb) : (double)NAN;
  l.ssim = mean_ssim(a, b, known, width, height, sums);
  sonde_free(sums);
  *out = l;
  return SONDE_OK;
}
