// Point response of rank three.
//
// The exact response at one depth is a matrix, lines by samples. Along depth every row of it is a
// sum of delayed pulses; three real kernels span these well for all depths at once. They are the
// leading singular vectors of all depths' rows together, found by subspace iteration from the pulse
// and its derivatives. Three complex lateral kernels per depth belong to them.
#include "echo/psf.h"

#include "base/base.h"
#include "base/maths.h"
#include "echo/echo.h"

#include <string.h>

enum { ROWS = 2 * SONDE_MOST_TAPS + 1, ITERATIONS = 40 };

static const double first_depth_m = 1.5e-3;
static const double lost = 1e-3;        // energy share beyond the kernel's reach
static const double sheet_weight = 0.2; // of a level sheet's echo against a point's

sonde_array sonde_beam_array(const beam_key *key) {
  sonde_array a = sonde_array_default();
  a.frequency_hz = key->frequency_hz;
  a.focus_m = key->focus_m;
  a.radius_m = key->radius_m;
  a.transmit_f = key->transmit_f, a.receive_f = key->receive_f;
  a.pulse_wavelengths = key->pulse_wavelengths;
  return a;
}

double sonde_psf_depth(const beam_psf *psf, double depth_m, int *above) {
  int b = 0, high = SONDE_PSF_DEPTHS - 2;
  while (b < high) {
    int middle = (b + high) / 2;
    if (depth_m > psf->depth_m[middle + 1])
      b = middle + 1;
    else
      high = middle;
  }
  *above = b;
  return clamp((depth_m - psf->depth_m[b]) / (psf->depth_m[b + 1] - psf->depth_m[b]), 0, 1);
}

static double weight_of(int line) { return line == 0 ? 1 : 2; } // both sides

// Inverse of what the splat widens, by least squares over all places between lines and samples,
// to fourth order in the differences d along an axis: 1 - second d^2 + fourth d^4. Two linear taps
// between lines, three quadratic ones between samples.
static const double line_second = 1.0 / 12, line_fourth = 7.0 / 720;
static const double sample_second = 1.0 / 8, sample_fourth = 0.01927;

static double sharpened(const double at[5], double second, double fourth) {
  double p = at[2] - second * (at[1] - 2 * at[2] + at[3]);
  return p + fourth * (at[0] - 4 * at[1] + 6 * at[2] - 4 * at[3] + at[4]);
}

static void orthonormalise(double v[SONDE_RANK][ROWS], int rows) {
  for (int k = 0; k < SONDE_RANK; ++k) {
    for (int m = 0; m < k; ++m) {
      double dot = 0;
      for (int i = 0; i < rows; ++i) dot += v[k][i] * v[m][i];
      for (int i = 0; i < rows; ++i) v[k][i] -= dot * v[m][i];
    }
    double norm = 0;
    for (int i = 0; i < rows; ++i) norm += v[k][i] * v[k][i];
    SONDE_ASSERT(norm > 0);
    for (int i = 0; i < rows; ++i) v[k][i] /= sqrt(norm);
  }
}

// Standard deviation of the pulse, rows.
static double pulse_rows(const beam_psf *psf) {
  sonde_array a = sonde_beam_array(&psf->key);
  return a.pulse_wavelengths * a.sound_m_s / a.frequency_hz / 2.35482 / psf->key.step_m;
}

// Lateral kernels that belong to the axial ones at a depth, and how far they reach.
static void find_lateral(beam_psf *psf, int b) {
  int rows = 2 * psf->half_rows + 1;
  double energy = 0, kept[SONDE_MOST_TAPS + 1], whole = 0;
  for (int l = 0; l <= psf->half_lines; ++l) {
    const double *p = psf->table[b][l];
    kept[l] = 0;
    for (int i = 0; i < 2 * rows; ++i) whole += weight_of(l) * p[i] * p[i];
    for (int k = 0; k < SONDE_RANK; ++k) {
      double re = 0, im = 0;
      for (int i = 0; i < rows; ++i)
        re += p[2 * i] * psf->axial[k][i], im += p[2 * i + 1] * psf->axial[k][i];
      float *tap = psf->lateral[b][l][k];
      tap[0] = (float)re, tap[1] = (float)(im - re), tap[2] = (float)(re + im);
      kept[l] += weight_of(l) * (re * re + im * im);
    }
    energy += kept[l];
  }
  psf->share[b] = energy / whole;
  double square = 0;
  for (int l = 0; l <= psf->half_lines; ++l) square += kept[l] * kept[l] / weight_of(l);
  psf->cell_columns[b] = energy * energy / square;
  double beyond = 0;
  int half = psf->half_lines;
  while (half > 1 && beyond + kept[half] < lost * energy) beyond += kept[half--];
  psf->half[b] = half;
  // Every column of a level sheet holds 1 on a row: the lateral kernels add up, and the echo's
  // energy along the rows is that of a plain pulse whose peak is the sheet's echo. Of the three
  // rows that a point is shared between, the middle one holds 3/4.
  const double beside = 0.125, middle = 0.75;
  double sum[SONDE_RANK][2], sheet_energy = 0, before[2] = {0}, here[2] = {0};
  for (int k = 0; k < SONDE_RANK; ++k) {
    sum[k][0] = sum[k][1] = 0;
    for (int l = 0; l <= psf->half[b]; ++l) {
      const float *tap = psf->lateral[b][l][k];
      sum[k][0] += weight_of(l) * (double)tap[0];
      sum[k][1] += weight_of(l) * ((double)tap[2] - (double)tap[0]);
    }
  }
  for (int i = 0; i <= 2 * psf->half_rows + 2; ++i) {
    double next[2] = {0};
    for (int k = 0; k < SONDE_RANK && i <= 2 * psf->half_rows; ++k)
      next[0] += sum[k][0] * psf->axial[k][i], next[1] += sum[k][1] * psf->axial[k][i];
    for (int part = 0; part < 2; ++part) {
      double echo = beside * before[part] + middle * here[part] + beside * next[part];
      sheet_energy += echo * echo, before[part] = here[part], here[part] = next[part];
    }
  }
  psf->sheet[b] = sqrt(sheet_energy / (pulse_rows(psf) * sqrt(SONDE_PI)));
  SONDE_ASSERT(psf->sheet[b] > 0);
}

static int taps(double reach_m, double step_m) {
  return (int)clamp(ceil(reach_m / step_m), 3, SONDE_MOST_TAPS);
}

bool sonde_psf_is_for(const beam_psf *psf, const beam_key *key) {
  SONDE_ASSERT(psf != NULL && key != NULL);
  return memcmp(&psf->key, key, sizeof *key) == 0;
}

void sonde_psf_begin(beam_psf *psf, const beam_key *key) {
  SONDE_ASSERT(psf != NULL && key->pitch_m > 0 && key->step_m > 0 && key->depth_m > 0);
  double wavelength = sonde_sound_m_s / key->frequency_hz;
  psf->key = *key;
  psf->half_lines = taps(12 * wavelength, key->pitch_m);
  psf->half_rows = taps(2.3 * wavelength, key->step_m);
  psf->step = 0;
  memset(psf->gram, 0, sizeof psf->gram);
}

// The exact response at one depth: of unit energy, and sharpened.
static void tabulate(beam_psf *psf, int b) {
  SONDE_ASSERT(b >= 0 && b < SONDE_PSF_DEPTHS);
  const beam_key *key = &psf->key;
  const sonde_array array = sonde_beam_array(key);
  // Depths lie at even steps up to a knee before the focus, below which the response changes most,
  // and from there on at steps that grow with the power 3/2 of the depth.
  double knee = fmax(0.7 * key->focus_m, 0.125 * key->depth_m);
  double first = first_depth_m / knee, last = key->depth_m / knee;
  if (last > 1) last = 3 - 2 / sqrt(last);
  double u = first + (last - first) * b / (SONDE_PSF_DEPTHS - 1);
  const double z = knee * (u < 1 ? u : 4 / ((3 - u) * (3 - u)));
  // What the lines see there, without the carrier's phase, which the splat brings.
  const double k = 2 * SONDE_PI * key->frequency_hz / sonde_sound_m_s;
  const int rows = 2 * psf->half_rows + 1;
  psf->depth_m[b] = z, psf->elevation_m[b] = sonde_array_elevation_half(&array, z);
  for (int l = 0; l <= psf->half_lines; ++l) {
    double x = l * key->pitch_m, depth = z;
    if (key->radius_m > 0) {
      double angle = x / key->radius_m;
      x = (key->radius_m + z) * sin(angle);
      depth = (key->radius_m + z) * cos(angle) - key->radius_m;
    }
    double *out = psf->table[b][l], c = cos(2 * k * z), s = sin(2 * k * z);
    sonde_array_line(&array, x, depth, z - psf->half_rows * key->step_m, key->step_m,
                     (uint32_t)rows, out);
    for (int n = 0; n < rows; ++n) {
      double re = out[2 * n], im = out[2 * n + 1];
      out[2 * n] = re * c - im * s, out[2 * n + 1] = re * s + im * c;
    }
  }
  double energy = 0;
  for (int l = 0; l <= psf->half_lines; ++l)
    for (int i = 0; i < 2 * rows; ++i)
      energy += weight_of(l) * psf->table[b][l][i] * psf->table[b][l][i];
  const double scale = energy > 0 ? 1 / sqrt(energy) : 0;
  for (int l = 0; l <= psf->half_lines; ++l)
    for (int i = 0; i < 2 * rows; ++i) psf->table[b][l][i] *= scale;
  // It is sharpened across the samples of each line, then across the lines.
  double at[5], row[2 * ROWS], column[SONDE_MOST_TAPS + 1];
  for (int l = 0; l <= psf->half_lines; ++l) {
    memcpy(row, psf->table[b][l], sizeof row);
    for (int i = 0; i < 2 * rows; ++i) {
      for (int n = -2; n <= 2; ++n) {
        int j = i + 2 * n;
        at[n + 2] = j >= 0 && j < 2 * rows ? row[j] : 0;
      }
      psf->table[b][l][i] = sharpened(at, sample_second, sample_fourth);
    }
  }
  for (int i = 0; i < 2 * rows; ++i) {
    for (int l = 0; l <= psf->half_lines; ++l) column[l] = psf->table[b][l][i];
    for (int l = 0; l <= psf->half_lines; ++l) {
      for (int n = -2; n <= 2; ++n)
        at[n + 2] = abs(l + n) <= psf->half_lines ? column[abs(l + n)] : 0;
      psf->table[b][l][i] = sharpened(at, line_second, line_fourth);
    }
  }
}

bool sonde_psf_step(beam_psf *psf) {
  SONDE_ASSERT(psf != NULL && psf->step >= 0 && psf->step <= SONDE_PSF_STEPS);
  if (psf->step == SONDE_PSF_STEPS) return true;
  const int rows = 2 * psf->half_rows + 1;
  if (psf->step < SONDE_PSF_DEPTHS) {
    tabulate(psf, psf->step);
    // Adds the rows of a response to the lower triangle of the Gram matrix. Interfaces are the
    // brightest echoes: what a level sheet echoes, the sum over the lines, counts besides.
    double sum[2 * ROWS] = {0};
    for (int l = 0; l <= psf->half_lines; ++l) {
      const double *p = psf->table[psf->step][l];
      double w = weight_of(l);
      for (int i = 0; i < rows; ++i)
        for (int j = 0; j <= i; ++j)
          psf->gram[i][j] += w * (p[2 * i] * p[2 * j] + p[2 * i + 1] * p[2 * j + 1]);
      for (int i = 0; i < 2 * rows; ++i) sum[i] += w * p[i];
    }
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j <= i; ++j)
        psf->gram[i][j] +=
            sheet_weight * (sum[2 * i] * sum[2 * j] + sum[2 * i + 1] * sum[2 * j + 1]);
  } else if (psf->step == SONDE_PSF_DEPTHS) {
    // Shared axial kernels: the leading vectors of the Gram matrix by subspace iteration.
    double product[SONDE_RANK][ROWS], sigma = pulse_rows(psf);
    for (int i = 0; i < rows; ++i)
      for (int j = 0; j < i; ++j) psf->gram[j][i] = psf->gram[i][j];
    for (int i = 0; i < rows; ++i) {
      double x = (i - psf->half_rows) / sigma, e = exp(-0.5 * x * x);
      psf->axial[0][i] = e, psf->axial[1][i] = x * e, psf->axial[2][i] = (x * x - 1) * e;
    }
    orthonormalise(psf->axial, rows);
    for (int step = 0; step < ITERATIONS; ++step) {
      for (int k = 0; k < SONDE_RANK; ++k)
        for (int i = 0; i < rows; ++i) {
          double sum = 0;
          for (int j = 0; j < rows; ++j) sum += psf->gram[i][j] * psf->axial[k][j];
          product[k][i] = sum;
        }
      memcpy(psf->axial, product, sizeof product);
      orthonormalise(psf->axial, rows);
    }
  } else {
    for (int b = 0; b < SONDE_PSF_DEPTHS; ++b) find_lateral(psf, b);
  }
  return ++psf->step == SONDE_PSF_STEPS;
}
