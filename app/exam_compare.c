// sonde exam --compare: every case by every operator, and what tells the operators apart.
#include "exam_common.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { OPERATORS = 4, PATH_SIZE = 1200 };

typedef struct metric {
  const char *name;
  double (*of)(const sonde_score *score);
} metric;

#define METRIC(name, expression)                                                                   \
  static double name(const sonde_score *s) { return expression; }
METRIC(of_score, s->score)
METRIC(of_decisions, s->decisions)
METRIC(of_coverage, s->coverage)
METRIC(of_gap, 1e3 * s->metrics.gap_m)
METRIC(of_completeness, s->metrics.completeness)
METRIC(of_valid, s->metrics.valid_share)
METRIC(of_insufficient, s->metrics.presses[SONDE_PRESS_INSUFFICIENT])
METRIC(of_too_hard, s->metrics.presses[SONDE_PRESS_TOO_HARD])
METRIC(of_off_axis, s->metrics.presses[SONDE_PRESS_OFF_AXIS])
METRIC(of_peak, s->metrics.force_peak_n)
METRIC(of_p95, s->metrics.force_p95_n)
METRIC(of_time, s->metrics.time_s)
METRIC(of_path, 1e3 * s->metrics.path_m)
METRIC(of_press_time, s->metrics.time_s / s->metrics.press_count)
METRIC(of_press_path, 1e3 * s->metrics.path_m / s->metrics.press_count)
METRIC(of_smoothness, s->metrics.smoothness)
#undef METRIC

static const metric METRICS[] = {{"score", of_score},
                                 {"decisions", of_decisions},
                                 {"coverage", of_coverage},
                                 {"gap_mm", of_gap},
                                 {"completeness", of_completeness},
                                 {"valid_share", of_valid},
                                 {"insufficient", of_insufficient},
                                 {"too_hard", of_too_hard},
                                 {"off_axis", of_off_axis},
                                 {"force_peak_n", of_peak},
                                 {"force_p95_n", of_p95},
                                 {"time_s", of_time},
                                 {"path_mm", of_path},
                                 {"press_time_s", of_press_time},
                                 {"press_path_mm", of_press_path},
                                 {"smoothness", of_smoothness}};
enum { METRIC_COUNT = sizeof METRICS / sizeof METRICS[0] };

typedef struct table {
  const compare_options *o;
  sonde_case *cases;
  uint32_t case_count;
  sonde_score *score; // [case][operator][seed]
} table;

static sonde_score *cell(const table *t, uint32_t of, uint32_t op, long seed) {
  assert(of < t->case_count && op < OPERATORS && seed >= 0 && seed < t->o->seeds);
  return &t->score[(of * OPERATORS + op) * (uint32_t)t->o->seeds + (uint32_t)seed];
}

static double mean(const table *t, uint32_t op, const metric *m) {
  assert(op < OPERATORS && t->case_count > 0);
  double sum = 0;
  uint32_t count = 0;
  for (uint32_t of = 0; of < t->case_count; ++of)
    for (long seed = 0; seed < t->o->seeds; ++seed) {
      double value = m->of(cell(t, of, op, seed));
      if (isfinite(value)) sum += value, ++count;
    }
  return count ? sum / count : (double)NAN;
}

// Chance that an exam of operator a has more of a metric than one of b. 0.5: no difference; ties
// count half (the area under the ROC curve).
static double separation(const table *t, const metric *m, uint32_t a, uint32_t b) {
  assert(a < OPERATORS && b < OPERATORS && a != b);
  double more = 0;
  uint32_t pairs = 0;
  uint32_t exams = t->case_count * (uint32_t)t->o->seeds, seeds = (uint32_t)t->o->seeds;
  for (uint32_t i = 0; i < exams; ++i)
    for (uint32_t k = 0; k < exams; ++k) {
      double x = m->of(cell(t, i / seeds, a, i % seeds)),
             y = m->of(cell(t, k / seeds, b, k % seeds));
      if (!isfinite(x) || !isfinite(y)) continue;
      more += x > y ? 1 : x == y ? 0.5 : 0;
      pairs++;
    }
  return pairs ? more / pairs : (double)NAN;
}

static sonde_series series_of(const table *t, uint32_t op) {
  assert(op < OPERATORS);
  sonde_series series = {0};
  for (uint32_t of = 0; of < t->case_count; ++of)
    for (long seed = 0; seed < t->o->seeds; ++seed)
      sonde_series_add(&series, cell(t, of, op, seed));
  return series;
}

static void print_table(const table *t) {
  printf("%-22s", "score (* passed)");
  for (uint32_t op = 0; op < OPERATORS; ++op) printf("%10s", sonde_operator_names()[op]);
  putchar('\n');
  for (uint32_t of = 0; of < t->case_count; ++of)
    for (long seed = 0; seed < t->o->seeds; ++seed) {
      printf("%-22s", seed ? "" : t->cases[of].id);
      for (uint32_t op = 0; op < OPERATORS; ++op) {
        const sonde_score *s = cell(t, of, op, seed);
        printf("%8.1f%c%c", s->score, s->passed ? '*' : ' ', s->correct ? ' ' : '!');
      }
      putchar('\n');
    }
  puts("!: wrong or no diagnosis\n");

  printf("%-14s%10s%10s%10s%10s  separation expert/novice, /timid, /forceful\n", "mean", "expert",
         "novice", "timid", "forceful");
  for (size_t k = 0; k < METRIC_COUNT; ++k) {
    printf("%-14s", METRICS[k].name);
    for (uint32_t op = 0; op < OPERATORS; ++op) printf("%10.2f", mean(t, op, &METRICS[k]));
    printf("  %.2f %.2f %.2f\n", separation(t, &METRICS[k], 0, 1), separation(t, &METRICS[k], 0, 2),
           separation(t, &METRICS[k], 0, 3));
  }
  for (uint32_t op = 0; op < OPERATORS; ++op) {
    sonde_series s = series_of(t, op);
    printf("%-9s sensitivity %.2f, specificity %.2f, unanswered %u, passed %u of %u\n",
           sonde_operator_names()[op], sonde_series_sensitivity(&s), sonde_series_specificity(&s),
           s.unanswered, s.passed, s.exams);
  }
}

static void print_json(const table *t) {
  app_json_begin();
  app_json_text("protocol", t->o->protocol->id);
  app_json_integer("cases", t->case_count);
  app_json_integer("exams_each", t->o->seeds);
  uint32_t wrong_passed = 0;
  for (uint32_t i = 0; i < t->case_count * OPERATORS * (uint32_t)t->o->seeds; ++i)
    wrong_passed += t->score[i].passed && !t->score[i].correct;
  app_json_integer("wrong_passed", wrong_passed);
  for (uint32_t op = 0; op < OPERATORS; ++op) {
    sonde_series s = series_of(t, op);
    app_json_object(sonde_operator_names()[op]);
    for (size_t k = 0; k < METRIC_COUNT; ++k)
      app_json_real(METRICS[k].name, mean(t, op, &METRICS[k]));
    app_json_real("sensitivity", sonde_series_sensitivity(&s));
    app_json_real("specificity", sonde_series_specificity(&s));
    app_json_integer("passed", s.passed);
    app_json_close();
  }
  app_json_object("separation");
  for (size_t k = 0; k < METRIC_COUNT; ++k)
    app_json_real(METRICS[k].name, separation(t, &METRICS[k], 0, 1));
  app_json_close();
  app_json_end();
}

int exam_compare(const compare_options *options) {
  sonde_error error = {0};
  table t = {.o = options};
  sonde_progress progress = app_progress();
  char directory[1100];
  sonde_status status = sonde_case_list(options->library->cases, &t.cases, &t.case_count, &error);
  if (!status && options->only) {
    t.case_count = 1;
    status = exam_find_case(options->library, options->only, &t.cases[0], directory,
                            sizeof directory, &error);
  }
  if (!status && t.case_count == 0)
    status = app_error(&error, SONDE_NOT_FOUND, "no cases in '%.300s'", options->library->cases);
  if (!status && options->directory)
    status = sonde_directory_make(options->directory, 0777, false, &error);
  size_t exams = (size_t)t.case_count * OPERATORS * (size_t)options->seeds;
  if (!status && !(t.score = calloc(exams, sizeof *t.score))) status = error.status = SONDE_MEMORY;
  for (uint32_t of = 0; of < t.case_count && !status; ++of) {
    // One case: its thigh once, then every operator and seed.
    const compare_options *o = t.o;
    sonde_exam_setups setups;
    sonde_plan plan;
    const char *bundled = o->library->has_bundled ? o->library->bundled : NULL;
    status = sonde_exam_prepare(&t.cases[of], o->protocol, bundled, o->library->cases, &progress,
                                &setups, &plan, &error);
    if (!status) {
      for (uint32_t op = 0; op < OPERATORS && !status; ++op)
        for (long seed = 0; seed < o->seeds && !status; ++seed) {
          char json[PATH_SIZE], csv[PATH_SIZE];
          // The bar runs over all exams; the shares that one exam reports fill its part.
          double before = (double)(of * OPERATORS + op) * (double)o->seeds + (double)seed;
          double all = (double)t.case_count * OPERATORS * (double)o->seeds;
          app_progress_part(before / all, (before + 1) / all);
          sonde_exam_def def = sonde_exam_def_default();
          def.patient = &t.cases[of];
          def.protocol = o->protocol;
          def.plan = &plan;
          def.operator_name = sonde_operator_names()[op];
          def.seed = (uint64_t)(o->seed + seed);
          def.solid = o->solid;
          if (o->directory) {
            snprintf(json, sizeof json, "%.900s/%s-%s-%ld.json", o->directory, t.cases[of].id,
                     def.operator_name, o->seed + seed);
            snprintf(csv, sizeof csv, "%.900s/%s-%s-%ld.csv", o->directory, t.cases[of].id,
                     def.operator_name, o->seed + seed);
            def.json_path = json;
            def.csv_path = csv;
          }
          status = sonde_exam_run(&def, &setups, &progress, cell(&t, of, op, seed), &error);
        }
      sonde_exam_setups_clear(&setups);
    }
  }
  app_progress_end();
  if (!status && options->json) print_json(&t);
  if (!status && !options->json) print_table(&t);
  free(t.score);
  sonde_free(t.cases);
  return status ? app_fail("exam", &error) : APP_OK;
}
