// The virtual robot: presses at every site step by step until a limit holds, reads sensors with
// noise and quantisation, and writes what they read as a table.
#include "base/maths.h"
#include "base/random.h"
#include "fit/fit_inside.h"
#include "base/parallel.h"
#include "fit/press.h"
#include "sonde/robot.h"

#include <string.h>

enum { MAX_STEPS = 4096 };
static const double SAME_DEPTH_M = 1e-7; // tables have four decimals of mm

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
  char label[24]; // its column of the table
  bool bonded;
  uint32_t step_limit;
  sonde_press *press;        // [workers] of a body; NULL for a bonded footprint
  sonde_datum *row;          // [sites * step_limit]
  sonde_robot_visit *visits; // [sites]
} robot;

static double quantised(double value, double quantum) {
  return quantum > 0 ? quantum * round(value / quantum) : value;
}

static sonde_status press_steps(robot *r, sonde_press *press, uint32_t index, sonde_bonded *bonded,
                                const atomic_bool *stop, sonde_error *error) {
  sonde_robot_visit *visit = &r->visits[index];
  SONDE_ASSERT(index < r->sites->count && visit->end == SONDE_ROBOT_NOT_REACHED);
  sonde_datum *rows = &r->row[(size_t)index * r->step_limit];
  if (!r->bonded) sonde_state_reset(press->state);
  for (uint32_t step = 0; step < r->step_limit; ++step) {
    if (atomic_load(stop)) return sonde_fail(error, SONDE_CANCELLED, "cancelled");
    double depth_m = (step + 1) * r->def->step_m;
    double force_n = r->bonded ? sonde_bonded_force(bonded, depth_m)
                               : sonde_press_probe(press, &r->sites->sites[index], &r->probe,
                                                   depth_m - r->def->step_m, depth_m);
    if (isnan(force_n)) {
      visit->end = SONDE_ROBOT_NO_EQUILIBRIUM;
      return SONDE_OK;
    }
    if (!r->bonded)
      visit->area_m2 = fmax(visit->area_m2, sonde_state_contact(press->state)->area_m2);
    // The sensors: noise that depends on seed, site and step only, then quantisation.
    const sonde_robot_def *def = r->def;
    uint64_t counter = 2u * ((uint64_t)visit->site * MAX_STEPS + step);
    double read_m = depth_m + def->noise_penetration_m * sonde_random_normal(def->seed, counter);
    double read_n = force_n + def->noise_force_n * sonde_random_normal(def->seed, counter + 1);
    sonde_datum *datum = &rows[visit->rows];
    *datum = (sonde_datum){
        .site = visit->site,
        .penetration_m = fmax(0.0, quantised(read_m, def->quantum_penetration_m)),
        .force_n = quantised(read_n, def->quantum_force_n),
    };
    memcpy(datum->probe, r->label, sizeof datum->probe);
    visit->depth_m = depth_m;
    visit->force_n = force_n;
    // A penetration that was recorded before is not recorded again.
    bool repeated = false;
    for (uint32_t k = 0; k < visit->rows && !repeated; ++k)
      repeated = fabs(rows[k].penetration_m - datum->penetration_m) < SAME_DEPTH_M;
    if (!repeated) ++visit->rows;
    if (fmax(force_n, datum->force_n) > r->def->limit_n) {
      visit->end = SONDE_ROBOT_FORCE_LIMIT;
      return SONDE_OK;
    }
  }
  visit->end = SONDE_ROBOT_DEPTH_LIMIT;
  return SONDE_OK;
}

static sonde_status measure_site(void *user, uint32_t worker, uint32_t index,
                                 const atomic_bool *stop, sonde_error *error) {
  robot *r = user;
  const sonde_site *site = &r->sites->sites[index];
  sonde_bonded bonded = {0};
  sonde_status status = SONDE_OK;
  if (r->bonded)
    status = sonde_footprint_area(r->model, site, r->probe.half_x_m, r->probe.half_y_m,
                                  &r->visits[index].area_m2, error);
  if (r->bonded && !status)
    status = sonde_bonded_create(r->model, site, r->probe.half_x_m, r->probe.half_y_m,
                                 r->def->relative_residual, r->def->max_iterations, &bonded, error);
  sonde_press *press = r->bonded ? NULL : &r->press[worker];
  if (!status) status = press_steps(r, press, index, &bonded, stop, error);
  sonde_bonded_clear(&bonded);
  return status;
}

// The rows in the order of the sites; those of sites under way that are too few are dropped.
static sonde_status gather(robot *r, bool cancelled, sonde_measurements *m, sonde_error *error) {
  uint32_t rows = 0, whole = 0, parts = 0;
  for (uint32_t i = 0; i < r->sites->count; ++i) {
    sonde_robot_visit *visit = &r->visits[i];
    bool under_way = visit->end == SONDE_ROBOT_NOT_REACHED;
    SONDE_ASSERT(cancelled || !under_way);
    if (under_way && visit->rows < SONDE_ROBOT_LEAST_ROWS) visit->rows = 0;
    rows += visit->rows;
    whole += !under_way;
    parts += under_way && visit->rows;
  }
  sonde_status status = sonde_measurements_create(m, rows, error);
  if (status) return status;
  if (cancelled)
    snprintf(m->remark, sizeof m->remark,
             "partial: cancelled after %u of %u sites; the last steps of %u sites are missing",
             whole, r->sites->count, parts);
  for (uint32_t i = 0; i < r->sites->count; ++i) {
    for (uint32_t k = 0; k < r->visits[i].rows; ++k, ++m->count) {
      m->data[m->count] = r->row[(size_t)i * r->step_limit + k];
      m->position_m[m->count] = r->sites->sites[i].position_m;
      m->normal[m->count] = r->sites->sites[i].normal;
    }
  }
  SONDE_ASSERT(m->count == rows);
  return SONDE_OK;
}

static sonde_status choose_probe(robot *r, sonde_error *error) {
  sonde_robot_contact contact = r->def->contact;
  sonde_status status = sonde_probe_create(r->def->probe, &r->probe, error);
  if (status) return status;
  if (contact == SONDE_ROBOT_BONDED && !r->probe.rectangular)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "probe '%s' has no rectangular footprint to bond, expected contact 'probe'",
                      r->def->probe);
  if (r->probe.rectangular && strlen(r->probe.name) > 23)
    return sonde_fail(error, SONDE_ARGUMENT, "probe '%s': expected a name of at most 23 characters",
                      r->def->probe);
  r->bonded = r->probe.rectangular && contact != SONDE_ROBOT_PROBE;
  // The name without folders, fit for a table.
  const char *slash = strrchr(r->probe.name, '/');
  snprintf(r->label, sizeof r->label, "%.23s", slash ? slash + 1 : r->probe.name);
  for (char *c = r->label; *c; ++c)
    if (*c == ',' || *c == '#' || *c == ' ') *c = '_';
  return SONDE_OK;
}

void sonde_robot_log_clear(sonde_robot_log *log) {
  if (!log) return;
  sonde_free(log->visits);
  *log = (sonde_robot_log){0};
}

sonde_status sonde_robot_run(const sonde_model *model, const sonde_site_table *sites,
                             const sonde_robot_def *def, const sonde_progress *progress,
                             sonde_measurements *measurements, sonde_robot_log *log,
                             sonde_error *error) {
  *measurements = (sonde_measurements){0};
  if (log) *log = (sonde_robot_log){0};
  const sonde_bounded range[] = {
      {"step_m", def->step_m, 1e-5, 0.1},
      {"limit_n", def->limit_n, 0, 1e4},
      {"depth_limit_m", def->depth_limit_m, def->step_m, 0.2},
      {"noise_force_n", def->noise_force_n, 0, 1e3},
      {"noise_penetration_m", def->noise_penetration_m, 0, 0.1},
      {"quantum_force_n", def->quantum_force_n, 0, 1e3},
      {"quantum_penetration_m", def->quantum_penetration_m, 0, def->step_m},
      {"relative_residual", def->relative_residual, 1e-14, 0.1},
      {"max_iterations", def->max_iterations, 1, 1e6}};
  sonde_status status = sonde_bounded_check(range, SONDE_COUNT_OF(range), error);
  if (status) return status;
  if (def->depth_limit_m / def->step_m > MAX_STEPS)
    return sonde_fail(error, SONDE_ARGUMENT, "more than %d steps per site", MAX_STEPS);
  status = sonde_sites_check_on_surface(model, sites, SONDE_SITE_TOLERANCE_M, error);
  if (status) return status;
  robot r = {.model = model, .sites = sites, .def = def};
  uint32_t workers = sonde_parallel_workers(def->threads, sites->count);
  status = choose_probe(&r, error);
  if (!status) {
    r.step_limit = (uint32_t)floor(def->depth_limit_m / def->step_m * (1 + 1e-12));
    SONDE_ASSERT(r.step_limit >= 1);
    r.row = SONDE_NEW(sonde_datum, (size_t)sites->count * r.step_limit);
    r.visits = SONDE_NEW(sonde_robot_visit, sites->count);
    if (!r.row || !r.visits) status = sonde_fail_memory(error);
  }
  for (uint32_t i = 0; i < sites->count && !status; ++i) r.visits[i].site = sites->sites[i].id;
  if (!status && !r.bonded)
    status = sonde_press_pool_create(model, def->relative_residual, def->max_iterations, workers,
                                     &r.press, error);
  if (!status)
    status =
        sonde_parallel_run(sites->count, workers, measure_site, &r, progress, "measuring", error);
  bool cancelled = status == SONDE_CANCELLED;
  if (!status || cancelled) {
    sonde_status gathered = gather(&r, cancelled, measurements, cancelled ? NULL : error);
    if (gathered) status = gathered;
    if (log && !gathered) {
      *log = (sonde_robot_log){sites->count, r.visits};
      r.visits = NULL;
    }
  }
  sonde_press_pool_destroy(r.press, workers);
  sonde_probe_clear(&r.probe);
  sonde_free(r.row);
  sonde_free(r.visits);
  return status;
}
