// The estimation of the paper on our data: its stages, its errors (figure 7), its start, its
// simplified interaction, and the law of eq. (1) against straight lines.
#include "fit_forces.h"
#include "paper.h"
#include "paper_plot.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// ---- figure 7

enum { BARS = 60 };

static int by_value(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

// A histogram over the middle 99 % with the three densities of greatest likelihood.
static void draw_histogram(sonde_file *file, double top, const char *title, const double *errors,
                           uint32_t count, const sonde_distribution *fits) {
  static const char *const DASH[] = {"7 3", "2 3", NULL};
  double low = errors[count / 200], high = errors[count - 1 - count / 200];
  double reach = fmax(fabs(low), fabs(high)), step = 2 * reach / BARS, tallest = 0;
  double share[BARS] = {0}, points[4 * BARS + 1][2];
  for (uint32_t i = 0; i < count; ++i) {
    double at = (errors[i] + reach) / step;
    if (at >= 0 && at < BARS) share[(int)at] += 100.0 / count;
  }
  for (int k = 0; k < BARS; ++k) tallest = fmax(tallest, share[k]);
  paper_plot plot = {.file = file,
                     .left = 66,
                     .top = top,
                     .width = 520,
                     .height = 210,
                     .x_low = -reach,
                     .x_high = reach,
                     .y_high = 1.25 * tallest};
  plot_begin(&plot, title, "error: model minus measurement, N", "share per bar, %");
  for (int k = 0; k < BARS; ++k)
    if (share[k] > 0)
      plot_bar(&plot, -reach + k * step, -reach + (k + 1) * step, share[k], "#cfd8de");
  for (int d = 0; d < SONDE_DISTRIBUTIONS; ++d) {
    char name[64];
    uint32_t used = 0;
    for (int k = 0; k <= 4 * BARS; ++k) {
      double x = -reach + 0.25 * k * step;
      double y = 100 * step * sonde_distribution_density(&fits[d], x);
      points[used][0] = x, points[used++][1] = fmin(y, plot.y_high);
    }
    plot_line(&plot, (const double(*)[2])points, used, PLOT_COLOUR[d], DASH[d]);
    snprintf(name, sizeof name, "%s", sonde_distribution_name(fits[d].kind));
    if (fits[d].kind == SONDE_STUDENT)
      snprintf(name, sizeof name, "Student t, %.1f degrees", fits[d].freedom);
    plot_legend(&plot, 608, top + 16 + 20 * d, PLOT_COLOUR[d], DASH[d], -1, name);
  }
}

static double excess_kurtosis(const double *errors, uint32_t count) {
  double mean = 0, m2 = 0, m4 = 0;
  for (uint32_t i = 0; i < count; ++i) mean += errors[i] / count;
  for (uint32_t i = 0; i < count; ++i) {
    double d2 = (errors[i] - mean) * (errors[i] - mean);
    m2 += d2 / count, m4 += d2 * d2 / count;
  }
  return m4 / (m2 * m2) - 3;
}

static sonde_status judge_distribution(paper *p, sonde_error *error) {
  static const char *const TITLE[] = {"Stage 2, the paper's model",
                                      "Stage 3, with the shear layer, at equilibrium"};
  static const char *const KEY[2][3] = {{"stage2_mae_over_sd", "stage2_kurtosis", "stage2_freedom"},
                                        {"mae_over_sd", "excess_kurtosis", "student_freedom"}};
  const double PAPER_RATIO = 1.05 / 1.84, NORMAL_RATIO = sqrt(2 / 3.14159265358979);
  paper_claim *c = paper_begin(
      p, "error_distribution", "3.2, Fig. 7",
      "Figure 7 shows how many values exhibit a given error. The text does not call it normal: "
      "1.05 "
      "N over 1.84 N is 0.57, where a normal distribution has 0.80.",
      "Normal, Laplace and Student's t distributions of greatest likelihood to the errors of stage "
      "2 and 3, compared by their AIC.");
  double *errors = malloc(p->measurements.count * sizeof *errors);
  sonde_file *file = NULL;
  sonde_status status = errors ? SONDE_OK : (error->status = SONDE_MEMORY);
  if (!status)
    status = paper_figure_begin(p, 7, "Figure 7. Frequency distribution of the error", 780, 640,
                                &file, error);
  double ratio = NAN, freedom = NAN, kurtosis = NAN;
  int best = 0;
  for (int k = 0; k < 2 && !status; ++k) {
    const double *model_n = p->fit.stage_n[k + 1];
    uint32_t count = 0;
    for (uint32_t i = 0; i < p->measurements.count; ++i)
      if (isfinite(model_n[i])) errors[count++] = model_n[i] - p->measurements.data[i].force_n;
    qsort(errors, count, sizeof *errors, by_value);
    const sonde_error_statistics *all = k ? &p->fit.stage3.all : &p->fit.stage2.all;
    sonde_distribution fits[SONDE_DISTRIBUTIONS];
    for (int d = 0; d < SONDE_DISTRIBUTIONS && !status; ++d)
      if (!sonde_distribution_fit((sonde_distribution_kind)d, errors, count, &fits[d]))
        status = app_error(error, SONDE_CONVERGENCE, "the errors of a stage do not spread");
    if (status) break;
    for (int d = 0; d < SONDE_DISTRIBUTIONS; ++d) best = fits[d].aic < fits[best].aic ? d : best;
    draw_histogram(file, 44 + 310 * k, TITLE[k], errors, count, fits);
    ratio = all->mae_n / all->sd_n, freedom = fits[SONDE_STUDENT].freedom;
    kurtosis = excess_kurtosis(errors, count);
    paper_value(c, KEY[k][0], ratio);
    paper_value(c, KEY[k][1], kurtosis);
    paper_value(c, KEY[k][2], freedom);
    paper_samples(c, count, "errors");
  }
  paper_value(c, "paper_mae_over_sd", PAPER_RATIO);
  paper_value(c, "normal_mae_over_sd", NORMAL_RATIO);
  bool peaked = ratio < 0.5 * (NORMAL_RATIO + PAPER_RATIO);
  paper_say(c, peaked ? PAPER_HOLDS : PAPER_IN_PART,
            "Sharp peak and heavy tails, as the paper's two figures imply: MAE over SD is %.2f "
            "(paper 0.57, normal 0.80), excess kurtosis %.1f; %s describes the errors best (%.1f "
            "degrees of freedom).",
            ratio, kurtosis, best == SONDE_STUDENT ? "Student's t" : "another distribution",
            freedom);
  paper_caption(p->figure[6].caption, sizeof p->figure[6].caption,
                "Errors of %u forces in bars, over the middle 99 %%, with the distributions of "
                "greatest likelihood. Above: the paper's model and interaction; below: the same "
                "springs with a shear layer at the equilibrium of the whole skin. The error axes "
                "differ. Synthetic data.",
                c->samples);
  status = paper_figure_end(file, status, error);
  free(errors);
  return status;
}

// ---- claims

static void judge_errors(paper *p) {
  const sonde_error_statistics *two = &p->fit.stage2.all, *three = &p->fit.stage3.all;
  paper_claim *c = paper_begin(p, "few_unknowns", "3.2",
                               "Surface elements are uniform and normal springs vary around the "
                               "mesh, which keeps the unknowns few.",
                               "Count of the estimated parameters.");
  paper_samples(c, p->sites.count, "sites");
  paper_value(c, "paper_parameters", p->fit.stage2_parameters);
  paper_value(c, "shear_field_parameters", p->fit.parameters);
  paper_say(c, PAPER_HOLDS,
            "%u parameters for %u sites and two probes (a, b per site and one edge stiffness); our "
            "shear layer, which also varies, brings them to %u.",
            p->fit.stage2_parameters, p->sites.count, p->fit.parameters);

  c = paper_begin(p, "five_percent", "3.2",
                  "The mean absolute error is 1.05 N, its standard deviation 1.84 N, about 5 %.",
                  "The paper's two stages on our data, then the same normal springs with a shear "
                  "layer, fitted to the equilibrium of the whole skin (stage 3).");
  paper_samples(c, two->count, "forces");
  paper_value(c, "stage2_mae_n", two->mae_n);
  paper_value(c, "stage2_sd_n", two->sd_n);
  paper_value(c, "stage2_percent", two->mae_percent);
  paper_value(c, "stage3_mae_n", three->mae_n);
  paper_value(c, "stage3_sd_n", three->sd_n);
  paper_value(c, "stage3_percent", three->mae_percent);
  bool paper_reaches = two->mae_percent <= 5 && two->mae_n <= 1.05 && two->sd_n <= 1.84;
  bool ours_reaches = three->mae_percent <= 5 && three->mae_n <= 1.05 && three->sd_n <= 1.84;
  paper_say(c,
            paper_reaches  ? PAPER_HOLDS
            : ours_reaches ? PAPER_IN_PART
                           : PAPER_FAILS,
            "The paper's model leaves %.2f N (SD %.2f N), %.1f %% of the mean force: it cannot "
            "serve both footprints. With the shear layer %.3f N (SD %.3f N), %.2f %%.",
            two->mae_n, two->sd_n, two->mae_percent, three->mae_n, three->sd_n, three->mae_percent);
}

static sonde_status judge_lines(paper *p, sonde_error *error) {
  sonde_error_report lines;
  double *model_n = malloc(p->measurements.count * sizeof *model_n);
  sonde_status status = model_n ? SONDE_OK : (error->status = SONDE_MEMORY);
  if (!status) fit_linear_forces(&p->measurements, model_n);
  if (!status)
    status =
        sonde_error_report_of(p->measurements.data, model_n, p->measurements.count, &lines, error);
  free(model_n);
  if (status) return status;
  const sonde_error_statistics *law = &p->fit.stage1.all;
  paper_claim *c = paper_begin(
      p, "linear_inconvenient", "2",
      "A model that is linear in its deformation is inconvenient: tissue is not.",
      "Every curve by itself: the least squares line F = k x against eq. (1), f = x/(a x + b).");
  paper_samples(c, law->count, "forces");
  paper_value(c, "linear_percent", lines.all.mae_percent);
  paper_value(c, "linear_mae_n", lines.all.mae_n);
  paper_value(c, "eq1_percent", law->mae_percent);
  paper_value(c, "eq1_mae_n", law->mae_n);
  paper_value(c, "ratio", lines.all.mae_n / law->mae_n);
  paper_say(
      c, lines.all.mae_n >= 2 * law->mae_n ? PAPER_HOLDS : PAPER_FAILS,
      "Straight lines leave %.1f %% of the mean force (%.2f N), eq. (1) %.2f %% (%.3f N): %.0f "
      "times less with one more number per curve.",
      lines.all.mae_percent, lines.all.mae_n, law->mae_percent, law->mae_n,
      lines.all.mae_n / law->mae_n);
  return SONDE_OK;
}

// Deepest measurement over the asymptote, by curve in stage 1; slopes at the first and last depth.
static void judge_limit(paper *p) {
  double most = 0, stiffer = 0;
  for (uint32_t c = 0; c < p->fit.curve_count; ++c) {
    const sonde_curve_fit *f = &p->fit.curves[c];
    double deepest = 0, first, last;
    for (uint32_t i = 0; i < p->measurements.count; ++i)
      if (p->measurements.data[i].site == f->site &&
          strcmp(p->measurements.data[i].probe, f->probe) == 0)
        deepest = fmax(deepest, p->measurements.data[i].penetration_m);
    sonde_normal_pressure(1, f->k0_n_m3, f->xm_m, 0.97, 0, &first);
    sonde_normal_pressure(1, f->k0_n_m3, f->xm_m, 0.97, deepest, &last);
    most = fmax(most, deepest / f->xm_m);
    stiffer += last / first / p->fit.curve_count;
  }
  paper_claim *c =
      paper_begin(p, "incompressible", "3.2, eq. (1)",
                  "The springs model the incompressibility of the thigh after a certain "
                  "deformation: f grows without bound as x nears x_m = -b/a.",
                  "Deepest measurement over the fitted x_m of every curve; slope of eq. (1) there "
                  "over the slope at rest.");
  paper_samples(c, p->fit.curve_count, "curves");
  paper_value(c, "deepest_over_limit", most);
  paper_value(c, "slope_ratio", stiffer);
  paper_say(c, most < 1 ? PAPER_HOLDS : PAPER_FAILS,
            "No measurement is deeper than %.2f x_m; on average the spring is %.1f times stiffer "
            "there than at rest. The asymptote itself is extrapolated: no curve comes near it.",
            most, stiffer);
}

// ---- the start of stage 2

static sonde_status judge_start(paper *p, sonde_error *error) {
  uint32_t starts = p->quick ? 4 : 40, same = 0, worse = 0, failed = 0;
  double worst = 0, iterations = 0, warm_cost = p->fit.stage2.all.rmse_n;
  sonde_fit_def def = p->fit_def;
  def.stages = 2, def.cold_start = true;
  sonde_status status = SONDE_OK;
  for (uint32_t k = 0; k < starts && !status; ++k) {
    sonde_fit_result r = {0};
    def.cold_seed = k; // the first is the generic start
    status = sonde_fit(p->model, &p->sites, &p->measurements, &def, NULL, &r, error);
    if (!status) {
      double ratio = r.stage2.all.rmse_n / warm_cost;
      worst = fmax(worst, ratio);
      same += fabs(ratio - 1) <= 0.01, worse += ratio > 1.01;
      failed += !r.stage2_converged;
      iterations += (double)r.stage2_iterations / starts;
    }
    sonde_fit_result_clear(&r);
  }
  paper_claim *c = paper_begin(
      p, "start_avoids_minima", "3.2",
      "Fitting a simple model first and starting from its result avoids problems with local "
      "minima.",
      "Stage 2 from stage 1 against stage 2 from cold starts: a generic one, and random ones with "
      "ln k0, ln(x_m - deepest) and ln k_s normal, standard deviation 1.5.");
  if (status) return status;
  paper_samples(c, starts, "cold starts");
  paper_value(c, "same_optimum", same);
  paper_value(c, "worse", worse);
  paper_value(c, "not_converged", failed);
  paper_value(c, "worst_rmse_ratio", worst);
  paper_value(c, "cold_iterations", iterations);
  paper_value(c, "warm_iterations", p->fit.stage2_iterations);
  paper_say(
      c, worse ? PAPER_HOLDS : PAPER_IN_PART,
      "%u of %u cold starts end within 1 %% of the error that stage 1 leads to, %u above it, the "
      "worst at %.3f times. From stage 1 it takes %u iterations, from cold %.0f. %s",
      same, starts, worse, worst, p->fit.stage2_iterations, iterations,
      worse ? "There are minima to avoid, and stage 1 avoids them."
            : "The start saves work; no other minimum was met.");
  return SONDE_OK;
}

// ---- the simplified interaction

static sonde_status judge_interaction(paper *p, sonde_error *error) {
  double *full_n = malloc(p->measurements.count * sizeof *full_n), mean = 0, least = INFINITY,
         most = -INFINITY;
  uint32_t count = 0, missing = 0;
  sonde_status status = full_n ? SONDE_OK : (error->status = SONDE_MEMORY);
  if (!status)
    status = fit_stage2_in_full(p->model, &p->sites, &p->measurements, &p->fit, &p->progress,
                                full_n, error);
  paper_claim *c = paper_begin(
      p, "simplified_interaction", "3.2",
      "For the estimation the probe principally acts on one spring, and nodes without contact are "
      "kept stationary.",
      "The parameters estimated so, put into the static equilibrium of the whole skin (the dynamic "
      "model at rest), at every eighth site.");
  for (uint32_t i = 0; i < p->measurements.count && !status; ++i) {
    if (!isfinite(full_n[i])) {
      missing++;
      continue;
    }
    double ratio = full_n[i] / p->fit.stage_n[1][i];
    mean += ratio, count++;
    least = fmin(least, ratio), most = fmax(most, ratio);
  }
  free(full_n);
  if (status) return status;
  mean /= count ? count : 1;
  paper_samples(c, count, "forces");
  paper_value(c, "mean_ratio", count ? mean : NAN);
  paper_value(c, "least_ratio", count ? least : NAN);
  paper_value(c, "most_ratio", count ? most : NAN);
  if (!count)
    paper_say(c, PAPER_FAILS, "The whole skin finds no equilibrium with these parameters.");
  else
    paper_say(c, mean > 0.95 ? PAPER_HOLDS : PAPER_FAILS,
              "At rest the moving neighbours give way: the force is %.2f times the one that was "
              "fitted (%.2f to %.2f). The parameters do not carry over to the simulation.",
              mean, least, most);
  return SONDE_OK;
}

sonde_status paper_fit(paper *p, sonde_error *error) {
  p->fit_def = sonde_fit_def_default();
  p->fit_def.stages = 3;
  sonde_status status =
      sonde_fit(p->model, &p->sites, &p->measurements, &p->fit_def, &p->progress, &p->fit, error);
  if (status) return status;
  assert(p->fit.stage_n[0] && p->fit.stage_n[1] && p->fit.stage_n[2]);
  judge_errors(p);
  status = judge_distribution(p, error);
  if (!status) status = judge_start(p, error);
  if (!status) status = judge_interaction(p, error);
  if (!status) status = judge_lines(p, error);
  if (!status) judge_limit(p);
  return status;
}
