// A law of compression fitted to one specimen, and stretches of it predicted by the others.
#include "sonde/fit_sample.h"

#include "base/maths.h"
#include "fit/bordered.h"
#include "base/csv.h"

#include <ctype.h>
#include <string.h>

// The deepest stretch is never left out: a law with an asymptote does not extrapolate.
enum { STRETCHES = 5, HELD_OUT = STRETCHES - 1, LEAST_ROWS = 10, NO_STRETCH = STRETCHES };
static const double GUARD = 0.999, EXPONENT_LOW = 0.2, EXPONENT_HIGH = 8;

// ---- reading ------------------------------------------------------------------------------

typedef struct unit {
  const char *name;
  double factor;
} unit;
static const unit LENGTH[] = {{"mm", 1e-3}, {"cm", 1e-2}, {"um", 1e-6}, {"m", 1}};
static const unit FORCE[] = {{"kn", 1e3}, {"mn", 1e-3}, {"n", 1}};
static const char *const COMPRESSION[] = {"compression", "penetration", "displacement", NULL};
static const char *const LOAD[] = {"load", "force", NULL};

static void lower(const char *from, char *to, size_t room) {
  size_t k = 0;
  for (; from[k] && k + 1 < room; ++k) to[k] = (char)tolower((unsigned char)from[k]);
  to[k] = 0;
}

// Factor to SI of a column whose name begins with one of some words and ends with a unit, as in
// "Load (N)" or "force_n"; 0: another column.
static double factor_of(const char *name, const char *const *words, const unit *units,
                        size_t count) {
  char text[64];
  bool named = false;
  lower(name, text, sizeof text);
  for (int k = 0; words[k]; ++k) named |= strncmp(text, words[k], strlen(words[k])) == 0;
  const char *at = named ? strpbrk(text, "(_[") : NULL;
  for (size_t k = 0; at && k < count; ++k) {
    size_t length = strlen(units[k].name);
    char after = at[0] && strncmp(at + 1, units[k].name, length) == 0 ? at[1 + length] : 'x';
    if (!isalnum((unsigned char)after)) return units[k].factor;
  }
  return 0;
}

typedef struct table {
  sonde_sample *sample;
  uint32_t column[2];
  double factor[2];
} table;

// "Cylinder Diameter: 50mm;": the number after a word, in metres; 0 when the line says none.
static double size_after(const char *line, const char *word) {
  char text[160];
  const char *end;
  lower(line, text, sizeof text);
  const char *at = strstr(text, word);
  at = at ? strchr(at, ':') : NULL;
  if (!at) return 0;
  ++at;
  double value = sonde_parse_real(at + strspn(at, " "), &end);
  end += strspn(end, " ");
  for (size_t k = 0; k < SONDE_COUNT_OF(LENGTH); ++k)
    if (strncmp(end, LENGTH[k].name, strlen(LENGTH[k].name)) == 0)
      return value > 0 && value < 1e6 ? value * LENGTH[k].factor : 0;
  return 0;
}

// Whether a line is the header; else what it says of the specimen.
static bool is_header(const sonde_csv *csv, void *user) {
  table *t = user;
  t->factor[0] = t->factor[1] = 0;
  for (uint32_t i = 0; i < csv->column_count; ++i) {
    double x = factor_of(csv->name[i], COMPRESSION, LENGTH, SONDE_COUNT_OF(LENGTH));
    double f = factor_of(csv->name[i], LOAD, FORCE, SONDE_COUNT_OF(FORCE));
    if (x > 0 && !(t->factor[0] > 0)) t->factor[0] = x, t->column[0] = i;
    if (f > 0 && !(t->factor[1] > 0)) t->factor[1] = f, t->column[1] = i;
  }
  if (t->factor[0] > 0 && t->factor[1] > 0) return true;
  double across = size_after(csv->name[0], "diameter"), height = size_after(csv->name[0], "height");
  if (across > 0) t->sample->area_m2 = SONDE_PI * across * across / 4;
  if (height > 0) t->sample->height_m = height;
  return false;
}

static int compare_rows(const void *a, const void *b) {
  const double *p = a, *q = b;
  return (p[0] > q[0]) - (p[0] < q[0]);
}

sonde_status sonde_sample_load(const char *path, sonde_sample *sample, sonde_error *error) {
  *sample = (sonde_sample){0};
  table t = {.sample = sample};
  sonde_csv csv;
  double(*row)[2] = NULL;
  sonde_status status = sonde_csv_open_after(&csv, path, is_header, &t, error);
  if (status == SONDE_FORMAT && csv.text && !(t.factor[0] > 0 && t.factor[1] > 0))
    status = sonde_fail(error, SONDE_FORMAT,
                        "%s: no header names a compression and a force with their units, expected "
                        "e.g. 'Compression (mm)' and 'Load (N)'",
                        path);
  if (!status) {
    uint32_t room = sonde_csv_lines_left(&csv) + 1;
    row = sonde_calloc(room, sizeof *row);
    sample->compression_m = SONDE_NEW(double, room);
    sample->force_n = SONDE_NEW(double, room);
    bool ok = row && sample->compression_m && sample->force_n;
    if (!ok) status = sonde_fail_memory(error);
    for (bool found = true; !status;) {
      status = sonde_csv_next(&csv, &found, error);
      if (status || !found) break;
      double *at = row[sample->count];
      for (int k = 0; k < 2 && !status; ++k) {
        status = sonde_csv_real(&csv, t.column[k], &at[k], error);
        at[k] *= t.factor[k];
      }
      if (!status && (at[0] > 1 || fabs(at[1]) > 1e6))
        status =
            sonde_fail(error, SONDE_FORMAT,
                       "%s:%u: %g m and %g N, expected at most 1 m and 1e6 N: are the units right?",
                       csv.path, csv.line, at[0], at[1]);
      if (!status) sample->count += at[0] >= 0;
    }
  }
  if (!status && sample->count < LEAST_ROWS)
    status = sonde_fail(error, SONDE_FORMAT, "%s: %u rows of compression, expected at least %d",
                        path, sample->count, LEAST_ROWS);
  if (!status) {
    qsort(row, sample->count, sizeof *row, compare_rows);
    for (uint32_t i = 0; i < sample->count; ++i)
      sample->compression_m[i] = row[i][0], sample->force_n[i] = row[i][1];
  }
  sonde_free(row);
  sonde_csv_close(&csv);
  if (status) sonde_sample_clear(sample);
  return status;
}

void sonde_sample_clear(sonde_sample *sample) {
  if (!sample) return;
  sonde_free(sample->compression_m);
  sonde_free(sample->force_n);
  *sample = (sonde_sample){0};
}

// ---- fitting ------------------------------------------------------------------------------

typedef struct spring {
  double stiffness_n_m, asymptote_m, exponent;
} spring;

// Straight beyond the guard, as in the model.
static double force_of(spring l, double s_m, double *slope) {
  double at = fmin(s_m, GUARD * l.asymptote_m), q = pow(at / l.asymptote_m, l.exponent);
  double force_n = l.stiffness_n_m * at / (1 - q);
  *slope = l.stiffness_n_m * (1 + (l.exponent - 1) * q) / ((1 - q) * (1 - q));
  return force_n + *slope * (s_m - at);
}

typedef struct fitting {
  const sonde_sample *sample;
  double floor_m, exponent; // exponent 0: the border's
  int left_out;
} fitting;

static int stretch_of(const sonde_sample *s, uint32_t row) {
  int k = (int)(STRETCHES * s->compression_m[row] / s->compression_m[s->count - 1]);
  return k < STRETCHES ? k : STRETCHES - 1;
}

static spring spring_of(const fitting *f, const double theta[2], const double *border) {
  double n = f->exponent > 0 ? f->exponent : exp(border[0]);
  return (spring){exp(theta[0]), f->floor_m + exp(theta[1]), n};
}

static void sample_row(const void *user, uint32_t block, uint32_t row, const double theta[2],
                       const double *border, double *residual, double *jacobian) {
  (void)block;
  const fitting *f = user;
  memset(jacobian, 0, (2 + BORDER_MOST) * sizeof *jacobian);
  *residual = 0;
  if (stretch_of(f->sample, row) == f->left_out) return;
  spring l = spring_of(f, theta, border);
  double s = f->sample->compression_m[row], x = s / l.asymptote_m;
  double q = pow(x, l.exponent), gap = 1 - q, force_n = l.stiffness_n_m * s / gap;
  *residual = force_n - f->sample->force_n[row];
  jacobian[0] = force_n;
  jacobian[1] = -force_n / gap * l.exponent * q / l.asymptote_m * exp(theta[1]);
  jacobian[2] = x > 0 && !(f->exponent > 0) ? force_n / gap * q * log(x) * l.exponent : 0;
}

sonde_status sonde_fit_sample(const sonde_sample *s, double exponent, sonde_sample_law *law,
                              sonde_error *error) {
  *law = (sonde_sample_law){0};
  if (s->count < LEAST_ROWS || !(s->compression_m[s->count - 1] > 0))
    return sonde_fail(error, SONDE_ARGUMENT, "%u rows, expected at least %d and a compression",
                      s->count, LEAST_ROWS);
  if (exponent < 0 || exponent > EXPONENT_HIGH)
    return sonde_fail(error, SONDE_ARGUMENT, "exponent is %g, expected 0 to %g", exponent,
                      EXPONENT_HIGH);
  double sum_n = 0, peak_n = 0, held_n = 0, held_sum_n = 0, slope;
  spring whole = {0};
  for (int k = 0; k <= HELD_OUT; ++k) { // the last leaves nothing out
    fitting f = {.sample = s, .exponent = exponent, .left_out = k < HELD_OUT ? k : NO_STRETCH};
    spring found = {0};
    bool converged = false;
    double deepest_m = 0, xf = 0, xx = 0, theta[1][2], border[BORDER_MOST] = {0};
    for (uint32_t i = 0; i < s->count; ++i) {
      double x = s->compression_m[i];
      if (stretch_of(s, i) == f.left_out) continue;
      deepest_m = fmax(deepest_m, x);
      if (x < 0.3 * s->compression_m[s->count - 1]) xf += x * s->force_n[i], xx += x * x;
    }
    for (uint32_t i = 0; i < s->count && !(xf > 0); ++i)
      xf += s->compression_m[i] * s->force_n[i], xx += s->compression_m[i] * s->compression_m[i];
    if (!(xf > 0)) return sonde_fail(error, SONDE_ARGUMENT, "the specimen does not press back");
    f.floor_m = deepest_m / GUARD;
    theta[0][0] = log(xf / xx);
    theta[0][1] = log(0.5 * deepest_m);
    const uint32_t rows[2] = {0, s->count};
    sonde_bordered_problem problem = {.block_count = 1,
                                      .border_count = f.exponent > 0 ? 0 : 1,
                                      .row_start = rows,
                                      .row = sample_row,
                                      .user = &f,
                                      .low = {-30, -14},
                                      .high = {30, 4},
                                      .border_low = {log(EXPONENT_LOW)},
                                      .border_high = {log(EXPONENT_HIGH)},
                                      .loss_scale = 1,
                                      .max_iterations = 400};
    sonde_bordered_result result;
    sonde_status status = sonde_bordered_minimise(&problem, theta, border, &result, error);
    found = spring_of(&f, theta[0], border);
    converged = !status && result.converged;
    if (status) return status;
    for (uint32_t i = 0; i < s->count; ++i) {
      if (stretch_of(s, i) != f.left_out) continue;
      held_n += fabs(force_of(found, s->compression_m[i], &slope) - s->force_n[i]);
      held_sum_n += s->force_n[i];
    }
    if (k == HELD_OUT) whole = found, law->converged = converged;
  }
  for (uint32_t i = 0; i < s->count; ++i) {
    double off = force_of(whole, s->compression_m[i], &slope) - s->force_n[i];
    law->mae_n += fabs(off) / s->count;
    law->rms_n += off * off / s->count;
    sum_n += s->force_n[i];
    peak_n = fmax(peak_n, s->force_n[i]);
  }
  law->rms_n = sqrt(law->rms_n);
  law->exponent = whole.exponent;
  law->stiffness_n_m = whole.stiffness_n_m;
  law->asymptote_m = whole.asymptote_m;
  law->mae_percent = 100 * law->mae_n * s->count / sum_n;
  law->rms_percent = 100 * law->rms_n / peak_n;
  law->held_out_percent = 100 * held_n / held_sum_n;
  return SONDE_OK;
}
