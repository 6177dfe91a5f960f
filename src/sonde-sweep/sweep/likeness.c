// How like two images are.
#include "sweep/frames.h"

enum { WINDOW = 7, SUMS = 6 }; // known, a, b, aa, bb, ab

static double mean_ssim(const uint8_t *a, const uint8_t *b, const uint8_t *known, uint32_t width,
                        uint32_t height, double (*sums)[SUMS]) {
  double total = 0;
  uint64_t windows = 0;
  for (uint32_t row = 0; row + WINDOW <= height; ++row) {
    // The sums of each column run over the window's rows.
    for (uint32_t x = 0; x < width; ++x) {
      double *sum = sums[x];
      for (int k = 0; k < SUMS; ++k) sum[k] = 0;
      for (uint32_t y = row; y < row + WINDOW; ++y) {
        size_t i = (size_t)y * width + x;
        double p = a[i], q = b[i];
        sum[0] += !known || known[i];
        sum[1] += p, sum[2] += q, sum[3] += p * p, sum[4] += q * q, sum[5] += p * q;
      }
    }
    double s[SUMS] = {0};
    for (uint32_t x = 0; x < width; ++x) {
      for (int k = 0; k < SUMS; ++k) s[k] += sums[x][k] - (x >= WINDOW ? sums[x - WINDOW][k] : 0);
      if (x + 1 < WINDOW || s[0] < WINDOW * WINDOW) continue; // all sums are whole: no drift
      // The variances are those of samples (n - 1); C1 = (0.01 * 255)^2, C2 = (0.03 * 255)^2.
      const double n = WINDOW * WINDOW, c1 = 6.5025, c2 = 58.5225;
      double ma = s[1] / n, mb = s[2] / n;
      double va = (s[3] - n * ma * ma) / (n - 1), vb = (s[4] - n * mb * mb) / (n - 1);
      double ab = (s[5] - n * ma * mb) / (n - 1);
      total += (2 * ma * mb + c1) * (2 * ab + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
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
