// The search for the scanner whose pictures have the texture of some stills: an evolution strategy
// with one step per number (separable CMA-ES, Ros and Hansen 2008), which draws every candidate's
// pictures anew.
#include "scanner_fit.h"

#include "app.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { NUMBERS = 19, POPULATION = 10, PARENTS = 5, WIDE = 512 };

// What the search may change, and within what.
static const struct {
  const char *key;
  double low, high;
} SEARCHED[NUMBERS] = {
    {"frequency_mhz", 5, 12},      {"depth_mm", 30, 60},   {"gain_db", -10, 10},
    {"dynamic_range_db", 45, 80},  {"transmit_f", 2, 7},   {"receive_f", 1.5, 6},
    {"pulse_wavelengths", 0.9, 3}, {"look_deg", 0, 12},    {"noise_db", -100, -50},
    {"compensation_db", 35, 90},   {"haze_db", -60, -20},  {"white_db", 15, 45},
    {"map_gamma", 0.6, 2.8},       {"map_knee", 0, 0.8},   {"filter", 0, 0.8},
    {"filter_mm", 0.3, 1.2},       {"sharpening", 0, 1.2}, {"ghost_db", -30, -6},
    {"tgc_db_per_cm", -6, 2}};

typedef struct bench {
  settled scene[SCANNER_FIT_MODELS];
  sonde_pathology pathology;
  sonde_image image;
  texture_table *table;
} bench;

static double *member(sonde_scanner *scanner, int number, double *si) {
  uint32_t count;
  const sonde_scanner_number *all = sonde_scanner_numbers(&count);
  for (uint32_t k = 0; k < count; ++k)
    if (strcmp(all[k].key, SEARCHED[number].key) == 0) {
      *si = all[k].si;
      return (double *)(void *)((char *)scanner + all[k].offset);
    }
  assert(false);
  return NULL;
}

// Distance of a scanner's pictures from the stills: the mean square over all quantiles, in spreads
// of the stills, each at most 9, and over the share of dark patches.
static sonde_status judge(const scanner_fit *fit, bench *b, const sonde_scanner *scanner,
                          double found[TEXTURE_FEATURES][TEXTURE_QUANTILES], double *distance,
                          sonde_error *error) {
  sonde_status status = SONDE_OK;
  b->table->patches = b->table->dark = 0;
  for (uint32_t m = 0; m < fit->models && !status; ++m) {
    settled *s = &b->scene[m];
    sonde_echo *echo = NULL;
    sonde_echo_def def = sonde_echo_def_default();
    def.scanner = scanner, def.seed = m + 1;
    status = sonde_echo_create(s->interior, &def, &echo, error);
    for (uint32_t v = 0; v < fit->views && !status; ++v) {
      // Sites all along the leg; every other view turns along it.
      const uint32_t site = (v * s->model->site_count + m * s->model->site_count / fit->models) /
                            fit->views % s->model->site_count;
      sonde_pose pose = sonde_site_pose(&s->model->sites[site], 2e-3);
      if (v % 2) {
        const sonde_quat q = pose.rotation;
        const double h = sqrt(0.5);
        pose.rotation =
            (sonde_quat){h * (q.w - q.z), h * (q.x + q.y), h * (q.y - q.x), h * (q.z + q.w)};
      }
      const double aperture = scanner->aperture_m > 0 ? scanner->aperture_m : 2 * s->probe.half_x_m;
      sonde_echo_render(echo, pose, aperture, &b->pathology, &scanner->settings, &b->image);
      texture_add(b->table, &b->image, 24);
    }
    sonde_echo_destroy(echo);
  }
  *distance = 9;
  if (status || b->table->patches < 8) return status;
  texture_quantiles(b->table, found);
  double sum = 0;
  for (int n = 0; n < TEXTURE_FEATURES; ++n)
    for (int q = 0; q < TEXTURE_QUANTILES; ++q) {
      const double spread = fit->real[n][2] - fit->real[n][0] + 1e-3;
      const double off = 2.5 * (found[n][q] - fit->real[n][q]) / spread;
      sum += fmin(off * off, 9);
    }
  // Pictures are as much in the dark as the stills: a tenth more or less is one spread.
  const double dark = (double)b->table->dark / (b->table->dark + b->table->patches);
  const double off = 10 * (dark - fit->real_dark);
  sum += TEXTURE_QUANTILES * fmin(off * off, 9);
  *distance = sum / ((TEXTURE_FEATURES + 1) * TEXTURE_QUANTILES);
  return SONDE_OK;
}

static sonde_status search(scanner_fit *fit, bench *b, sonde_error *error) {
  const double n = NUMBERS, mu = PARENTS / 1.3;
  const double learn_step = (mu + 2) / (n + mu + 3);
  const double learn_rank = fmin(0.5, (n + 2) / 3 * 2 * mu / ((n + 2) * (n + 2) + mu));
  double mean[NUMBERS], spread[NUMBERS], path[NUMBERS] = {0}, size = 0.18, best = INFINITY;
  double x[POPULATION][NUMBERS], cost[POPULATION], found[TEXTURE_FEATURES][TEXTURE_QUANTILES];
  uint64_t state = fit->seed * 0x9e3779b97f4a7c15u + 88172645463325252u;
  sonde_scanner chosen = fit->scanner;
  for (int i = 0; i < NUMBERS; ++i) {
    double si, value = *member(&fit->scanner, i, &si) / si;
    mean[i] = fmin(fmax((value - SEARCHED[i].low) / (SEARCHED[i].high - SEARCHED[i].low), 0), 1);
    spread[i] = 1;
  }
  sonde_status status = judge(fit, b, &fit->scanner, fit->found, &fit->before, error);
  best = fit->after = fit->before;
  for (uint32_t done = 0; done < fit->evaluations && !status && !app_interrupted();
       done += (uint32_t)POPULATION) {
    int order[POPULATION];
    for (int k = 0; k < POPULATION && !status; ++k) {
      // A candidate: normal numbers by the polar form about the mean, mirrored at the ends.
      sonde_scanner candidate = fit->scanner;
      for (int i = 0; i < NUMBERS; ++i) {
        double u[2], si, *value = member(&candidate, i, &si);
        for (int pair = 0; pair < 2; ++pair) {
          state ^= state << 13, state ^= state >> 7, state ^= state << 17;
          u[pair] = ((double)(state >> 11) + 0.5) * 0x1p-53;
        }
        const double normal = sqrt(-2 * log(u[0])) * cos(6.283185307179586 * u[1]);
        double at = mean[i] + size * sqrt(spread[i]) * normal;
        at = at < 0 ? fmin(-at, 1) : at > 1 ? fmax(2 - at, 0) : at;
        *value = si * (SEARCHED[i].low + at * (SEARCHED[i].high - SEARCHED[i].low));
        x[k][i] = at;
      }
      candidate.settings.focus_m = 0.5 * candidate.settings.depth_m;
      status = judge(fit, b, &candidate, found, &cost[k], error);
      if (!status && cost[k] < best) {
        best = cost[k], chosen = candidate;
        memcpy(fit->found, found, sizeof found);
      }
      // Sorted by cost as they come.
      int at = k;
      for (; at > 0 && cost[order[at - 1]] > cost[k]; --at) order[at] = order[at - 1];
      order[at] = k;
      sonde_progress p = app_progress();
      p.report(fmin(1, ((double)done + k + 1) / fit->evaluations), "fitting the scanner", p.user);
    }
    // The mean moves to the better half; paths and spreads follow.
    double length = 0;
    for (int i = 0; i < NUMBERS && !status; ++i) {
      double to = 0, square = 0;
      for (int k = 0; k < PARENTS; ++k) {
        const double d = (x[order[k]][i] - mean[i]) / size;
        to += d / PARENTS, square += d * d / PARENTS;
      }
      mean[i] += size * to;
      path[i] = (1 - learn_step) * path[i] +
                sqrt(learn_step * (2 - learn_step) * mu) * to / sqrt(spread[i]);
      spread[i] = fmax((1 - learn_rank) * spread[i] + learn_rank * square, 0.02);
      length += path[i] * path[i];
    }
    size *= exp(fmin(0.4, learn_step * (sqrt(length) / (sqrt(n) * (1 - 1 / (4 * n))) - 1)));
    size = fmin(fmax(size, 0.01), 0.3);
  }
  fit->scanner = chosen, fit->after = best;
  return status;
}

sonde_status scanner_fit_run(scanner_fit *fit, sonde_error *error) {
  assert(fit->models > 0 && fit->models <= SCANNER_FIT_MODELS && fit->views > 0);
  bench b = {0};
  sonde_status status = sonde_pathology_preset("healthy", &b.pathology, error);
  app_progress_begin("fitting the scanner");
  if (!status) status = sonde_image_create(WIDE, WIDE, &b.image, error);
  b.table = calloc(1, sizeof *b.table);
  if (!status && !b.table) status = app_error(error, SONDE_MEMORY, "no memory for the patches");
  for (uint32_t m = 0; m < fit->models && !status; ++m) {
    status = settled_open(&b.scene[m], fit->model[m], "linear", NULL, true, error);
    if (!status) settled_update(&b.scene[m], &b.pathology, 0, sonde_state_tick(b.scene[m].state));
  }
  if (!status) status = search(fit, &b, error);
  app_progress_end();
  for (uint32_t m = 0; m < fit->models; ++m) settled_close(&b.scene[m]);
  sonde_image_clear(&b.image);
  free(b.table);
  return status;
}
