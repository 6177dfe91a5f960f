// measure_site: step by step at one site until a stop rule holds.
// add_noise:    sensor errors that depend only on (seed, site, step).
// gather:       finished sites in table order.
// sonde_robot_run: sites in parallel.
#include "base/maths.h"
#include "base/random.h"
#include "fit/fit_inside.h"
#include "fit/parallel.h"
#include "fit/press.h"

#include <string.h>

enum { MAX_STEPS = 4096 };

sonde_robot_def sonde_robot_def_default(void) {
  return (sonde_robot_def){.probe = "linear",
                           .step_m = 2e-3,
                           .limit_n = 40,
                           .depth_limit_m = 30e-3,
                           .relative_residual = 1e-6,
                           .max_iterations = 200};
}

typedef struct robot {
  const sonde_model *model;
  const sonde_site_table *sites;
  const sonde_robot_def *def;
  sonde_probe probe;
  bool bonded;
  uint32_t step_limit;
  sonde_press *crew;
  sonde_datum *row;  // [sites * step_limit]
  uint32_t *rows_of; // [sites]
  bool *done, *lost; // [sites] finished; ended without equilibrium
} robot;

static sonde_status check_def(const sonde_robot_def *def, sonde_error *error) {
  const struct {
    const char *name;
    double value, low, high;
  } range[] = {{"step_m", def->step_m, 1e-5, 0.1},
               {"limit_n", def->limit_n, 0, 1e4},
               {"depth_limit_m", def->depth_limit_m, def->step_m, 0.2},
               {"noise_force_n", def->noise_force_n, 0, 1e3},
               {"noise_penetration_m", def->noise_penetration_m, 0, 0.1},
               {"relative_residual", def->relative_residual, 1e-14, 0.1},
               {"max_iterations", def->max_iterations, 1, 1e6}};
  for (size_t k = 0; k < SONDE_COUNT_OF(range); ++k)
    if (!(range[k].value >= range[k].low && range[k].value <= range[k].high))
      return sonde_fail(error, SONDE_ARGUMENT, "%s is %g, expected %g to %g", range[k].name,
                        range[k].value, range[k].low, range[k].high);
  if (def->depth_limit_m / def->step_m > MAX_STEPS)
    return sonde_fail(error, SONDE_ARGUMENT, "more than %d steps per site", MAX_STEPS);
  return SONDE_OK;
}

static void add_noise(const sonde_robot_def *def, uint32_t step, sonde_datum *datum) {
  SONDE_ASSERT(step < MAX_STEPS);
  uint64_t counter = 2u * ((uint64_t)datum->site * MAX_STEPS + step);
  double depth = def->noise_penetration_m * sonde_random_normal(def->seed, counter);
  datum->penetration_m = fmax(0.0, datum->penetration_m + depth);
  datum->force_n += def->noise_force_n * sonde_random_normal(def->seed, counter + 1);
}

// The probe's column: its name without folders, fit for a table.
static void probe_label(const char *name, char label[24]) {
  const char *slash = strrchr(name, '/');
  snprintf(label, 24, "%.23s", slash ? slash + 1 : name);
  for (char *c = label; *c; ++c)
    if (*c == ',' || *c == '#' || *c == ' ') *c = '_';
}

static sonde_status press_steps(robot *r, sonde_press *press, uint32_t index,
                                const sonde_footprint *footprint, const atomic_bool *stop,
                                sonde_error *error) {
  const sonde_site *site = &r->sites->sites[index];
  SONDE_ASSERT(index < r->sites->count && !r->done[index]);
  sonde_datum *rows = &r->row[(size_t)index * r->step_limit];
  sonde_state_reset(press->state);
  for (uint32_t step = 0; step < r->step_limit; ++step) {
    if (atomic_load(stop)) return sonde_fail(error, SONDE_CANCELLED, "cancelled");
    double depth_m = (step + 1) * r->def->step_m;
    double force_n = r->bonded ? sonde_press_bonded(press, site, footprint, depth_m)
                               : sonde_press_probe(press, site, &r->probe, depth_m);
    r->lost[index] = isnan(force_n);
    if (r->lost[index]) break;
    sonde_datum *datum = &rows[r->rows_of[index]++];
    *datum = (sonde_datum){.site = site->id, .penetration_m = depth_m, .force_n = force_n};
    probe_label(r->probe.name, datum->probe);
    add_noise(r->def, step, datum);
    if (datum->force_n > r->def->limit_n) break;
  }
  r->done[index] = true;
  return SONDE_OK;
}

static sonde_status measure_site(void *user, uint32_t worker, uint32_t index,
                                 const atomic_bool *stop, sonde_error *error) {
  robot *r = user;
  sonde_footprint footprint = {0};
  sonde_status status = SONDE_OK;
  if (r->bonded)
    status = sonde_footprint_create(r->model, &r->sites->sites[index], r->probe.half_x_m,
                                    r->probe.half_y_m, SONDE_COVERAGE_CLIPPED, &footprint, error);
  if (!status) status = press_steps(r, &r->crew[worker], index, &footprint, stop, error);
  sonde_footprint_clear(&footprint);
  return status;
}

static sonde_status gather(const robot *r, sonde_measurements *m, uint32_t *stopped,
                           sonde_error *error) {
  uint32_t rows = 0, lost = 0;
  for (uint32_t i = 0; i < r->sites->count; ++i) rows += r->done[i] ? r->rows_of[i] : 0;
  sonde_status status = sonde_measurements_create(m, rows, error);
  if (status) return status;
  for (uint32_t i = 0; i < r->sites->count; ++i) {
    if (!r->done[i]) continue;
    lost += r->lost[i];
    for (uint32_t k = 0; k < r->rows_of[i]; ++k, ++m->count) {
      m->data[m->count] = r->row[(size_t)i * r->step_limit + k];
      m->position_m[m->count] = r->sites->sites[i].position_m;
      m->normal[m->count] = r->sites->sites[i].normal;
    }
  }
  SONDE_ASSERT(m->count == rows);
  if (stopped) *stopped = lost;
  return SONDE_OK;
}

static sonde_status choose_contact(robot *r, sonde_error *error) {
  sonde_robot_contact contact = r->def->contact;
  if (contact == SONDE_ROBOT_BONDED && !r->probe.rectangular)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "probe '%s' has no rectangular footprint to bond, expected contact 'probe'",
                      r->def->probe);
  r->bonded = r->probe.rectangular && contact != SONDE_ROBOT_PROBE;
  return SONDE_OK;
}

static sonde_status allocate_rows(robot *r, sonde_error *error) {
  uint32_t sites = r->sites->count;
  r->step_limit = (uint32_t)floor(r->def->depth_limit_m / r->def->step_m * (1 + 1e-12));
  SONDE_ASSERT(r->step_limit >= 1);
  r->row = SONDE_NEW(sonde_datum, (size_t)sites * r->step_limit);
  r->rows_of = SONDE_NEW(uint32_t, sites);
  r->done = SONDE_NEW(bool, sites);
  r->lost = SONDE_NEW(bool, sites);
  if (!r->row || !r->rows_of || !r->done || !r->lost) return sonde_fail_memory(error);
  return SONDE_OK;
}

static void clear_robot(robot *r, uint32_t workers) {
  sonde_press_crew_destroy(r->crew, workers);
  sonde_probe_clear(&r->probe);
  sonde_free(r->row);
  sonde_free(r->rows_of);
  sonde_free(r->done);
  sonde_free(r->lost);
}

sonde_status sonde_robot_run(const sonde_model *model, const sonde_site_table *sites,
                             const sonde_robot_def *def, const sonde_progress *progress,
                             sonde_measurements *measurements, uint32_t *stopped,
                             sonde_error *error) {
  *measurements = (sonde_measurements){0};
  sonde_status status = check_def(def, error);
  if (status) return status;
  robot r = {.model = model, .sites = sites, .def = def};
  uint32_t workers = sonde_parallel_workers(def->threads, sites->count);
  status = sonde_probe_create(def->probe, &r.probe, error);
  if (!status) status = choose_contact(&r, error);
  if (!status) status = allocate_rows(&r, error);
  if (!status)
    status = sonde_press_crew_create(model, def->relative_residual, def->max_iterations, workers,
                                     &r.crew, error);
  if (!status)
    status =
        sonde_parallel_run(sites->count, workers, measure_site, &r, progress, "measuring", error);
  if (!status || status == SONDE_CANCELLED) {
    sonde_status gathered = gather(&r, measurements, stopped, status ? NULL : error);
    if (gathered) status = gathered;
  }
  clear_robot(&r, workers);
  return status;
}
