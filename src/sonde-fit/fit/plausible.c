// Measurements judged against known ranges before a fit.
#include "fit/plausible.h"
#include "fit/fit_inside.h"
#include "sonde/fit_sample.h"

#include "base/maths.h"
#include "base/order.h"

#include <string.h>

static const sonde_plausible_range RANGE[QUANTITIES] = {
    [QUANTITY_DEEPEST] = {"largest penetration", "mm", 0.1, 1, 60, 300,
                          "thighs: muscle 28 +- 7 mm and fat 10 +- 4 mm in front (Mechelli, "
                          "JCSM-CR v4i2.94)"},
    [QUANTITY_PEAK] = {"largest force", "N", 0.02, 0.1, 200, 2000,
                       "up to 34.5 N in 26 studies of examinations (Sensors 2025 25(11):3415)"},
    [QUANTITY_MODULUS] = {"apparent modulus at small depth", "kPa", 0.05, 0.2, 300, 3000,
                          "0.22 to 58.4 kPa, lower limbs (Zheng and Mak 1999, J Biomech Eng "
                          "121(3):330); silicone phantoms up to 130 kPa"},
    [QUANTITY_STIFFENING] = {"final over initial slope", "", -INFINITY, 0.5, INFINITY, INFINITY,
                             "load against depth is quadratic on limbs (Zheng, Mak and Lue 1999, "
                             "JRRD 36(2))"},
    [QUANTITY_ZERO] = {"depth of zero force", "mm", -INFINITY, -0.4, 0.4, INFINITY,
                       "the bundled thigh: -0.05 mm (linear), -0.21 mm (point)"},
    [QUANTITY_ASYMPTOTE] = {"asymptote x_m over the thickness of the tissue", "", 0, 0.15, 3,
                            INFINITY, "the bundled thigh: 0.67 +- 0.03 (docs/anatomy.md)"},
    [QUANTITY_SHARE] = {"penetration over the thickness of the body", "", -INFINITY, -INFINITY, 0.8,
                        1, "geometry: a probe does not leave the body on its other side"},
    [QUANTITY_BIAS] = {"mean residual of a quarter of the depths", "", -INFINITY, -0.15, 0.15,
                       INFINITY, "stage 3 on the bundled thigh: below 0.06"},
};

const sonde_plausible_range *sonde_plausible_ranges(uint32_t *count) {
  *count = QUANTITIES;
  return RANGE;
}

const sonde_plausible_range *sonde_plausible_range_of(sonde_quantity quantity) {
  SONDE_ASSERT(quantity < QUANTITIES);
  return &RANGE[quantity];
}

bool sonde_plausible(sonde_quantity quantity, double value, sonde_doubt_grade *grade) {
  const sonde_plausible_range *r = sonde_plausible_range_of(quantity);
  SONDE_ASSERT(grade && r->low <= r->high);
  if (value >= r->low && value <= r->high) return true;
  bool absurd = !(value >= r->absurd_low && value <= r->absurd_high);
  *grade = absurd ? SONDE_DOUBT_ABSURD : SONDE_DOUBT_IMPLAUSIBLE;
  return false;
}

static uint32_t line_of(const sonde_measurements *m, const sonde_datum *d) {
  return m->line ? m->line[d - m->data] : 0;
}

sonde_doubt *sonde_doubt_add(sonde_doubts *doubts, const char *kind, sonde_doubt_grade grade,
                             const sonde_measurements *m, const sonde_datum *first) {
  for (uint32_t k = 0; k < doubts->count; ++k) {
    sonde_doubt *d = &doubts->doubt[k];
    if (strcmp(d->kind, kind) != 0) continue;
    d->curves++;
    if (grade <= d->grade) return NULL;
    d->grade = grade;
    return d;
  }
  if (doubts->count == SONDE_DOUBTS) return NULL;
  sonde_doubt *d = &doubts->doubt[doubts->count++];
  *d = (sonde_doubt){.grade = grade, .kind = kind, .site = UINT32_MAX, .curves = 1};
  if (!first) return d;
  d->site = first->site;
  d->line = line_of(m, first);
  snprintf(d->probe, sizeof d->probe, "%s", first->probe);
  return d;
}

const sonde_doubt *sonde_doubts_gravest(const sonde_doubts *doubts) {
  const sonde_doubt *most = NULL;
  for (uint32_t k = 0; k < doubts->count; ++k)
    if (!most || doubts->doubt[k].grade > most->grade) most = &doubts->doubt[k];
  return most;
}

// ---- curves -------------------------------------------------------------------------------

enum { LEAST_ROWS = 6, ZERO_ROWS = 4, TURN_ROWS = 3 };

typedef struct course {
  const sonde_datum **row; // [count] by depth
  uint32_t count;
  double first_n_m, last_n_m; // slopes of the shallow and the deep third
  double modulus_pa;          // NaN when the probe has no rectangular footprint
  double peak_n, range_n, falls_n;
  double rise_n;           // mean force of the deep third minus that of the shallow one
  const sonde_datum *turn; // the deepest row, when the file goes down before and up after it
  const sonde_datum *fall; // row after the largest fall
} course;

static int compare_rows(const void *a, const void *b) {
  const sonde_datum *p = *(const sonde_datum *const *)a, *q = *(const sonde_datum *const *)b;
  if (p->site != q->site) return p->site < q->site ? -1 : 1;
  int names = strcmp(p->probe, q->probe);
  if (names) return names;
  if (p->penetration_m != q->penetration_m) return p->penetration_m < q->penetration_m ? -1 : 1;
  return (p > q) - (p < q);
}

// Slope of the least squares line through rows; 0 when all have one depth.
static double slope_of(const sonde_datum *const *row, uint32_t count) {
  double x = 0, f = 0, xx = 0, xf = 0;
  SONDE_ASSERT(count > 0);
  for (uint32_t k = 0; k < count; ++k)
    x += row[k]->penetration_m / count, f += row[k]->force_n / count;
  for (uint32_t k = 0; k < count; ++k) {
    double d = row[k]->penetration_m - x;
    xx += d * d, xf += d * (row[k]->force_n - f);
  }
  return xx > 0 ? xf / xx : 0;
}

static double mean_of(const sonde_datum *const *row, uint32_t count) {
  double sum = 0;
  for (uint32_t k = 0; k < count; ++k) sum += row[k]->force_n / count;
  return sum;
}

static int compare_order(const void *a, const void *b) {
  const sonde_datum *p = *(const sonde_datum *const *)a, *q = *(const sonde_datum *const *)b;
  return (p > q) - (p < q);
}

typedef struct courses {
  uint32_t count;
  course *curve;
  const sonde_datum **row, **order;
} courses;

static sonde_status curve_list(const sonde_measurements *m, courses *list, sonde_error *error) {
  *list = (courses){.curve = SONDE_NEW(course, m->count),
                    .row = SONDE_NEW(const sonde_datum *, m->count),
                    .order = SONDE_NEW(const sonde_datum *, m->count)};
  if (!list->curve || !list->row || !list->order) return sonde_fail_memory(error);
  for (uint32_t i = 0; i < m->count; ++i) list->row[i] = &m->data[i];
  qsort(list->row, m->count, sizeof *list->row, compare_rows);
  for (uint32_t i = 0, end; i < m->count; i = end) {
    const sonde_datum *one = list->row[i];
    for (end = i + 1; end < m->count && list->row[end]->site == one->site &&
                      strcmp(list->row[end]->probe, one->probe) == 0;)
      ++end;
    const sonde_datum **row = list->row + i;
    const uint32_t count = end - i;
    SONDE_ASSERT(count > 0 && row && list->order);
    uint32_t third = count / 3 > 3 ? count / 3 : count < 3 ? count : 3;
    course c = {.row = row, .count = count};
    const sonde_datum *const *tail = row + count - third;
    double low = INFINITY, most = 0;
    c.first_n_m = slope_of(row, third);
    c.last_n_m = slope_of(tail, third);
    c.rise_n = mean_of(tail, third) - mean_of(row, third);
    // A flat punch of radius a on a half space of Young's modulus E, Poisson's ratio 1/2:
    // F = 2 a E x/(1 - 1/4).
    sonde_probe probe;
    c.modulus_pa = NAN;
    if (!sonde_probe_create(row[0]->probe, &probe, NULL)) {
      double radius_m = sqrt(4 * probe.half_x_m * probe.half_y_m / SONDE_PI);
      if (probe.rectangular && radius_m > 0) c.modulus_pa = 0.75 * c.first_n_m / (2 * radius_m);
      sonde_probe_clear(&probe);
    }
    c.peak_n = -INFINITY;
    for (uint32_t j = 0; j < count; ++j) {
      c.peak_n = fmax(c.peak_n, row[j]->force_n);
      low = fmin(low, row[j]->force_n);
      double fall = j ? row[j - 1]->force_n - row[j]->force_n : 0;
      c.falls_n += fmax(fall, 0);
      if (fall > most) most = fall, c.fall = row[j];
    }
    c.range_n = c.peak_n - low;

    // The turning point of a curve whose rows go down and come up again in the order of the table.
    memcpy(list->order, row, count * sizeof *list->order);
    qsort(list->order, count, sizeof *list->order, compare_order);
    uint32_t j = 1;
    while (j < count && list->order[j]->penetration_m > list->order[j - 1]->penetration_m) ++j;
    uint32_t down = j;
    while (j < count && list->order[j]->penetration_m < list->order[j - 1]->penetration_m) ++j;
    bool turns = j == count && down >= TURN_ROWS && count - down >= TURN_ROWS;
    if (turns) c.turn = list->order[down - 1];
    // A fit leaves out curves that are too short or do not press.
    uint32_t steps = 0;
    for (uint32_t k = 0; k < c.count; ++k) steps += c.row[k]->penetration_m > 0;
    if (steps >= SONDE_FIT_LEAST_STEPS && mean_of(c.row, c.count) > 0)
      list->curve[list->count++] = c;
  }
  return SONDE_OK;
}

static void clear_list(courses *list) {
  sonde_free(list->curve);
  sonde_free(list->row);
  sonde_free(list->order);
}

// ---- the whole table ----------------------------------------------------------------------

static double median_modulus(const courses *list) {
  double *all = SONDE_NEW(double, list->count + 1);
  uint32_t count = 0;
  for (uint32_t k = 0; all && k < list->count; ++k)
    if (isfinite(list->curve[k].modulus_pa)) all[count++] = list->curve[k].modulus_pa;
  if (count) qsort(all, count, sizeof *all, sonde_compare_reals);
  double median = count ? all[count / 2] : NAN;
  sonde_free(all);
  return median;
}

// A unit other than the table's, and what makes the table's of it.
typedef struct other_unit {
  const char *name;
  double factor;
} other_unit;
static const other_unit LENGTH[] = {{"metres", 1e3}, {"micrometres", 1e-3}};
static const other_unit FORCE[] = {
    {"millinewtons", 1e-3}, {"gram-force", 9.80665e-3}, {"kilonewtons", 1e3}};

// The unit that brings a value outside its range nearest to the middle of it; NULL: none does.
static const char *likely_unit(sonde_quantity quantity, double value, const other_unit *unit,
                               size_t count) {
  const sonde_plausible_range *r = &RANGE[quantity];
  const char *best = NULL;
  double middle = sqrt(r->low * r->high), nearest = INFINITY;
  if (value >= r->low && value <= r->high) return NULL;
  for (size_t k = 0; k < count; ++k) {
    double right = value * unit[k].factor, off = fabs(log(right / middle));
    if (!(right >= r->low && right <= r->high) || off >= nearest) continue;
    nearest = off, best = unit[k].name;
  }
  return best;
}

static void object(const sonde_measurements *m, sonde_doubts *doubts, sonde_quantity quantity,
                   const char *column, double value, const char *unit, const sonde_datum *row) {
  sonde_doubt_grade grade;
  const sonde_plausible_range *r = &RANGE[quantity];
  if (sonde_plausible(quantity, value, &grade)) return;
  sonde_doubt *d = sonde_doubt_add(doubts, column, unit ? SONDE_DOUBT_ABSURD : grade, m, NULL);
  if (!d) return;
  d->line = line_of(m, row);
  snprintf(d->sentence, sizeof d->sentence, "column %s%s%s: %s %.3g %s, expected %g to %g %s",
           column, unit ? " looks like " : " is implausible", unit ? unit : "", r->quantity, value,
           r->unit, r->low, r->high, r->unit);
}

// ---- one curve ----------------------------------------------------------------------------

static const double LEAST_RISE = 0.1;                      // of the peak
static const double MOST_FALLS = 0.15, FALLS_FREE_N = 0.5; // of the range, and for noise
static const double LEAST_GAIN = 0.02, GAIN_BEFORE = 0.05; // over two steps, of the peak
static const double MOST_APART = 20;                       // modulus over that of all curves

static void judge_course(const sonde_measurements *m, const course *c, sonde_doubts *doubts) {
  SONDE_ASSERT(c->count > 0);
  sonde_doubt *d;
  const sonde_datum *first = c->row[0], *last = c->row[c->count - 1];
  if (c->rise_n < LEAST_RISE * fabs(c->peak_n)) {
    bool falls = c->rise_n < -LEAST_RISE * fabs(c->peak_n);
    d = sonde_doubt_add(doubts, falls ? "falling" : "constant", SONDE_DOUBT_ABSURD, m, first);
    if (d)
      snprintf(d->sentence, sizeof d->sentence,
               "the force %s with depth: %.3g N at %.3g mm, %.3g N at %.3g mm; expected a force "
               "that rises",
               falls ? "falls" : "does not change", first->force_n, 1e3 * first->penetration_m,
               last->force_n, 1e3 * last->penetration_m);
  } else if (c->turn) {
    d = sonde_doubt_add(doubts, "loading_and_unloading", SONDE_DOUBT_IMPLAUSIBLE, m, c->turn);
    if (d)
      snprintf(d->sentence, sizeof d->sentence,
               "the penetration rises to %.3g mm and falls again: loading and unloading in one "
               "curve; give a column phase (loading, unloading), of which loading is fitted",
               1e3 * c->turn->penetration_m);
  } else if (c->falls_n > MOST_FALLS * c->range_n + FALLS_FREE_N) {
    d = sonde_doubt_add(doubts, "loading_and_unloading", SONDE_DOUBT_IMPLAUSIBLE, m, c->fall);
    if (d)
      snprintf(d->sentence, sizeof d->sentence,
               "the force goes up and down with depth (falls add up to %.3g N of %.3g N): loading "
               "and unloading, or repeats, in one curve; give a column phase (loading, unloading) "
               "or repeat",
               c->falls_n, c->range_n);
  }
}

static void judge_stiffening(const sonde_measurements *m, const course *c, sonde_doubts *doubts) {
  sonde_doubt *d;
  sonde_doubt_grade grade;
  if (c->count < LEAST_ROWS || !(c->first_n_m > 0)) return;
  const sonde_datum *const *end = c->row + c->count - 1;
  double gain = end[0]->force_n - end[-2]->force_n, before = end[-2]->force_n - end[-4]->force_n;
  double ratio = c->last_n_m / c->first_n_m;
  if (!sonde_plausible(QUANTITY_STIFFENING, ratio, &grade)) {
    d = sonde_doubt_add(doubts, "saturating", grade, m, c->row[0]);
    if (d)
      snprintf(d->sentence, sizeof d->sentence,
               "the force levels off: slope %.3g N/mm at first, %.3g N/mm at %.3g mm; expected "
               "tissue, which stiffens with depth",
               1e-3 * c->first_n_m, 1e-3 * c->last_n_m, 1e3 * end[0]->penetration_m);
  } else if (gain < LEAST_GAIN * c->peak_n && before > GAIN_BEFORE * c->peak_n) {
    d = sonde_doubt_add(doubts, "clipped", SONDE_DOUBT_IMPLAUSIBLE, m, end[-2]);
    if (d)
      snprintf(d->sentence, sizeof d->sentence,
               "the force stays at %.4g N over the last three steps; expected it to rise: is the "
               "sensor at its limit?",
               end[0]->force_n);
  } else if (ratio < 0.8) {
    d = sonde_doubt_add(doubts, "hardly_stiffening", SONDE_DOUBT_WARNING, m, c->row[0]);
    if (d)
      snprintf(d->sentence, sizeof d->sentence,
               "the force grows more slowly with depth (%.3g N/mm at first, %.3g N/mm at last), "
               "tissue stiffens",
               1e-3 * c->first_n_m, 1e-3 * c->last_n_m);
  }
}

// ---- contact zero and tare ----------------------------------------------------------------

// Force at zero depth and slope there: least squares of A + B x + C x^3 through the first rows,
// since a spring that stiffens evenly to both sides has no square term.
static bool extrapolate(const course *c, double *force_n, double *slope_n_m) {
  uint32_t count = c->count < ZERO_ROWS ? c->count : (uint32_t)ZERO_ROWS;
  double m[3][4] = {{0}};
  SONDE_ASSERT(c->count > 0);
  if (count < ZERO_ROWS) return false;
  double scale = c->row[count - 1]->penetration_m;
  for (uint32_t k = 0; k < count; ++k) {
    double x = c->row[k]->penetration_m / scale, p[3] = {1, x, x * x * x};
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) m[i][j] += p[i] * p[j];
      m[i][3] += p[i] * c->row[k]->force_n;
    }
  }
  for (int i = 0; i < 3; ++i) {
    double pivot = m[i][i];
    if (!(fabs(pivot) > 1e-9)) return false;
    for (int j = 0; j < 4; ++j) m[i][j] /= pivot;
    for (int k = 0; k < 3; ++k)
      for (int j = 3; k != i && j >= i; --j) m[k][j] -= m[k][i] * m[i][j];
  }
  *force_n = m[0][3], *slope_n_m = m[1][3] / scale;
  return *slope_n_m > 0;
}

sonde_status sonde_measurements_examine(const sonde_measurements *m, sonde_doubts *doubts,
                                        sonde_error *error) {
  courses list;
  if (!m->count) return SONDE_OK;
  sonde_status status = curve_list(m, &list, error);
  bool flat = false;
  for (uint32_t k = 0; k < list.count && !status; ++k) judge_course(m, &list.curve[k], doubts);
  const sonde_doubt *gravest = sonde_doubts_gravest(doubts);
  flat = gravest && gravest->grade == SONDE_DOUBT_ABSURD;
  if (status || flat || !list.count) goto done;

  // Lengths and forces in another unit than the table's.
  const sonde_datum *deepest = &m->data[0], *peak = &m->data[0];
  for (uint32_t i = 0; i < m->count; ++i) {
    if (m->data[i].penetration_m > deepest->penetration_m) deepest = &m->data[i];
    if (m->data[i].force_n > peak->force_n) peak = &m->data[i];
  }
  uint32_t before = doubts->count;
  double median = median_modulus(&list), kpa = 1e-3 * median, mm = 1e3 * deepest->penetration_m;
  const char *unit = likely_unit(QUANTITY_DEEPEST, mm, LENGTH, SONDE_COUNT_OF(LENGTH));
  object(m, doubts, QUANTITY_DEEPEST, "penetration_mm", mm, unit, deepest);
  if (doubts->count > before) goto done;
  unit = likely_unit(QUANTITY_MODULUS, kpa, FORCE, SONDE_COUNT_OF(FORCE));
  object(m, doubts, QUANTITY_PEAK, "force_n", peak->force_n, unit, peak);
  if (doubts->count == before && isfinite(kpa) && kpa > 0)
    object(m, doubts, QUANTITY_MODULUS, "force_n", kpa, unit, peak);
  if (doubts->count == before) {
    for (uint32_t k = 0; k < list.count; ++k) {
      judge_stiffening(m, &list.curve[k], doubts);
      const course *c = &list.curve[k];
      double times = c->modulus_pa / median;
      if (!(c->modulus_pa > 0) || (times < MOST_APART && times > 1 / MOST_APART)) continue;
      sonde_doubt *d = sonde_doubt_add(doubts, "apart", SONDE_DOUBT_IMPLAUSIBLE, m, c->row[0]);
      if (d)
        snprintf(d->sentence, sizeof d->sentence,
                 "apparent modulus %.3g kPa where the table's median is %.3g kPa, expected one "
                 "within a factor %g: another unit in this curve?",
                 1e-3 * c->modulus_pa, 1e-3 * median, MOST_APART);
    }
    char names[SONDE_FIT_PROBES][24];
    uint32_t probes = 0, count[SONDE_FIT_PROBES] = {0};
    double force[SONDE_FIT_PROBES] = {0}, square[SONDE_FIT_PROBES] = {0};
    double slope[SONDE_FIT_PROBES] = {0};
    for (uint32_t k = 0; k < list.count; ++k) {
      double f, b;
      uint32_t p = sonde_probe_index(names, &probes, list.curve[k].row[0]->probe);
      if (p == UINT32_MAX || !extrapolate(&list.curve[k], &f, &b)) continue;
      ++count[p], force[p] += f, square[p] += f * f, slope[p] += b;
    }
    for (uint32_t p = 0; p < probes; ++p) {
      if (!count[p]) continue;
      double mean = force[p] / count[p], b = slope[p] / count[p];
      double sure = sqrt(fmax(square[p] / count[p] - mean * mean, 0) / count[p]);
      double zero_mm = -1e3 * mean / b;
      sonde_doubt_grade grade;
      if (sonde_plausible(QUANTITY_ZERO, zero_mm, &grade) || fabs(mean) < 3 * sure) continue;
      sonde_doubt *d = sonde_doubt_add(doubts, "contact_zero", SONDE_DOUBT_WARNING, NULL, NULL);
      if (!d) continue;
      d->curves = count[p];
      snprintf(
          d->sentence, sizeof d->sentence,
          "column %s: the forces of probe %s extrapolate to %+.2g N at zero depth (no force at "
          "%+.2g mm), expected none: contact zero or tare may be wrong; see --estimate-zero and "
          "--estimate-tare",
          mean < 0 ? "penetration_mm" : "force_n", names[p], mean, zero_mm);
    }
  }
done:
  clear_list(&list);
  return status;
}

sonde_status sonde_sample_examine(const sonde_sample *sample, sonde_doubts *doubts,
                                  sonde_error *error) {
  sonde_measurements m = {.count = sample->count, .data = SONDE_NEW(sonde_datum, sample->count)};
  courses list;
  if (!m.data) return sonde_fail_memory(error);
  for (uint32_t i = 0; i < m.count; ++i)
    m.data[i] = (sonde_datum){
        .penetration_m = sample->compression_m[i], .force_n = sample->force_n[i], .probe = "point"};
  sonde_status status = curve_list(&m, &list, error);
  uint32_t before = doubts->count;
  for (uint32_t k = 0; k < list.count && !status; ++k) {
    judge_course(&m, &list.curve[k], doubts);
    if (doubts->count == before) judge_stiffening(&m, &list.curve[k], doubts);
  }
  for (uint32_t k = before; k < doubts->count; ++k) doubts->doubt[k].site = UINT32_MAX;
  clear_list(&list);
  sonde_free(m.data);
  return status;
}
