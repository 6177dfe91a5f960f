// sonde measure: the virtual robot presses a model at every site and writes a measurement file.
// A cancelled run still writes what was measured.
#include "options.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>

static const char VERB[] = "measure";
static const double RAD_PER_DEGREE = 3.14159265358979323846 / 180, SPACING_CV_MAX = 0.1;

typedef struct options {
  const char *model, *sites, *save_sites, *probe, *output, *log;
  sonde_robot_def def;
  sonde_sites_def places;
  double grid[2], bounds[4]; // degrees and mm
  bool json;
} options;

static void prepare(void *to) {
  options *o = to;
  o->def = sonde_robot_def_default();
  o->def.seed = 1;
  o->places = sonde_sites_def_default();
  o->grid[0] = o->grid[1] = 8;
  o->bounds[0] = NAN;
}

static const char *const CONTACTS[] = {"auto", "bonded", "probe", NULL};

static const app_option TABLE[] = {
    OPT_ARGUMENT(model, "MODEL", "the model file"),
    OPT_TEXT(sites, "sites", "CSV", "positions, normals and axes of the sites"),
    OPT_NUMBERS(
        bounds, "bounds", "A:B,C:D", -INFINITY, INFINITY,
        "regular sites from A to B degrees around the leg (its axis is parallel to z through "
        "the skin's centroid; 0 is +x, 90 is +y) and from z = C to D mm"),
    OPT_TEXT(places.painted, "painted", "FILE",
             "regular sites, on a square lattice, in a region: a mesh of that patch of skin (.ply, "
             ".obj, .stl), or a .csv file x_mm,y_mm,z_mm with the corners of its outline in order"),
    OPT_WHOLES(grid, "grid", "NxM", 1, 1000,
               "with --bounds: N sites around the leg, M along it; with --painted: N*M sites"),
    OPT_OUTPUT(save_sites, "save-sites", "CSV",
               "write the sites; without --probe and -o nothing else is done"),
    OPT_TEXT(
        probe, "probe", "NAME|FILE",
        "point, linear, square, sphere, a rectangle rect:AxB such as rect:24x12 with its sides "
        "in mm, or a convex mesh file in mm"),
    OPT_OUTPUT(output, "o,output", "CSV", "measurement file to write"),
    OPT_OUTPUT(log, "log", "CSV",
               "write one row per site: rows, how it ended, contact area, depth and force"),
    OPT_REAL(def.step_m, "step-mm", "S", 0.01, 20, 1e-3, "advance per step"),
    OPT_REAL(def.limit_n, "limit-n", "N", 0, 1e4, 1,
             "the first step above it is the last at a site"),
    OPT_REAL(def.depth_limit_m, "depth-mm", "D", 0.01, 100, 1e-3, "depth limit"),
    OPT_WORD(def.contact, "contact", "KIND", CONTACTS,
             "bonded: the skin under the footprint moves with it, as in the experiment (auto: of "
             "rectangular probes); probe: the body is pressed in"),
    OPT_REAL(def.noise_force_n, "noise-n", "S", 0, 100, 1,
             "standard deviation of the force sensor"),
    OPT_REAL(def.noise_penetration_m, "noise-mm", "S", 0, 10, 1e-3,
             "standard deviation of the penetration"),
    OPT_REAL(def.quantum_force_n, "quantise-n", "Q", 0, 100, 1,
             "readings are multiples of Q, after the noise; default: not quantised"),
    OPT_REAL(def.quantum_penetration_m, "quantise-mm", "Q", 0, 10, 1e-3,
             "the same for the penetration, at most the step; a reading that repeats an earlier "
             "penetration of its site is not recorded; default: not quantised"),
    OPT_INTEGER(def.seed, "seed", "K", 0, 2147483647, "of the noise"),
    OPT_REAL(def.relative_residual, "residual", "R", 1e-14, 0.1, 1,
             "relative residual of the equilibrium"),
    OPT_INTEGER(def.threads, "threads", "N", 1, 64,
                "threads; the result does not depend on them; default: one per core"),
    OPT_JSON(json)};

static int check(void *from) {
  options *o = from;
  sonde_sites_def *places = &o->places;
  o->def.probe = o->probe;
  places->columns = (uint32_t)o->grid[0];
  places->rows = (uint32_t)o->grid[1];
  if (app_option_given("bounds")) {
    places->angle_low_rad = RAD_PER_DEGREE * o->bounds[0];
    places->angle_high_rad = RAD_PER_DEGREE * o->bounds[1];
    places->z_low_m = 1e-3 * o->bounds[2];
    places->z_high_m = 1e-3 * o->bounds[3];
  }
  if (app_option_given("grid") && o->sites)
    return app_usage_error(VERB, "--grid places sites and does not go with --sites");
  if (o->save_sites && !o->probe && !o->output) return APP_OK;
  if (!o->probe) return app_usage_error(VERB, "--probe is missing");
  return o->output ? APP_OK : app_usage_error(VERB, "-o CSV is missing");
}

static void print_spacing(const options *a, const sonde_site_table *sites) {
  assert(sites->count > 0);
  if (a->sites && !a->save_sites) return;
  sonde_site_spacing s = sonde_site_spacing_of(sites);
  if (a->json) {
    app_json("sites_placed:%u spacing_mean_mm:%g spacing_cv:%g", sites->count, 1e3 * s.mean_m,
             s.cv);
    return;
  }
  printf("%u sites, nearest neighbours %.2f mm apart (%.2f to %.2f mm, CV %.1f %%)%s%s\n",
         sites->count, 1e3 * s.mean_m, 1e3 * s.least_m, 1e3 * s.largest_m, 100 * s.cv,
         a->save_sites ? ", written to " : "", a->save_sites ? a->save_sites : "");
  if (s.cv > SPACING_CV_MAX)
    fprintf(stderr, "sonde measure: the sites are not regular: CV %.1f %%, expected at most %.0f\n",
            100 * s.cv, 100 * SPACING_CV_MAX);
}

typedef struct summary {
  uint32_t sites, ends[4]; // with rows; by sonde_robot_end
  double force_max_n, area_mean_m2, area_low_m2, area_high_m2;
} summary;

// A cancelled robot without rows leaves no file.
static int conclude(const options *a, const sonde_site_table *sites, const sonde_measurements *m,
                    const sonde_robot_log *log, bool cancelled, double seconds) {
  sonde_error error = {0};
  if (cancelled && !m->count) {
    fprintf(stderr, "sonde measure: cancelled before a site had %d steps; nothing was written\n",
            SONDE_ROBOT_LEAST_ROWS);
    return APP_FAILED;
  }
  sonde_status status = sonde_measurements_save(a->output, m, &error);
  sonde_file *file = NULL;
  if (!status && a->log) status = sonde_file_create(a->log, &file, &error);
  if (file) {
    static const char *const ENDS[] = {"cancelled", "force_limit", "depth_limit", "no_equilibrium"};
    sonde_file_printf(file, "# probe %s\nsite,rows,end,contact_area_mm2,depth_mm,force_n\n",
                      a->probe);
    for (const sonde_robot_visit *v = log->visits; v < log->visits + log->count; ++v)
      sonde_file_printf(file, "%u,%u,%s,%.3f,%.4f,%.4f\n", v->site, v->rows, ENDS[v->end],
                        1e6 * v->area_m2, 1e3 * v->depth_m, v->force_n);
    status = sonde_file_commit(file, &error);
  }
  if (!status && a->save_sites) status = sonde_site_table_save(a->save_sites, sites, &error);
  if (status) return app_fail(VERB, &error);

  // What the log says of all sites.
  summary s = {.area_low_m2 = INFINITY};
  for (uint32_t i = 0; i < m->count; ++i) s.force_max_n = fmax(s.force_max_n, m->data[i].force_n);
  for (uint32_t i = 0; i < log->count; ++i) {
    const sonde_robot_visit *v = &log->visits[i];
    ++s.ends[v->end];
    if (!v->rows) continue;
    ++s.sites;
    s.area_mean_m2 += v->area_m2;
    s.area_low_m2 = fmin(s.area_low_m2, v->area_m2);
    s.area_high_m2 = fmax(s.area_high_m2, v->area_m2);
  }
  if (s.sites) s.area_mean_m2 /= s.sites;

  if (a->json) app_json_begin();
  print_spacing(a, sites);
  if (a->json) {
    app_json("file:%s probe:%s sites:%u rows:%u force_limit:%u depth_limit:%u not_converged:%u "
             "force_max_n:%g contact_area_mean_mm2:%g contact_area_low_mm2:%g "
             "contact_area_high_mm2:%g cancelled:%hhd seconds:%g",
             a->output, a->probe, s.sites, m->count, s.ends[SONDE_ROBOT_FORCE_LIMIT],
             s.ends[SONDE_ROBOT_DEPTH_LIMIT], s.ends[SONDE_ROBOT_NO_EQUILIBRIUM], s.force_max_n,
             1e6 * s.area_mean_m2, 1e6 * s.area_low_m2, 1e6 * s.area_high_m2, cancelled, seconds);
  } else {
    printf("wrote %s: %u of %u sites, %u rows, at most %.2f N, %.1f s\n", a->output, s.sites,
           log->count, m->count, s.force_max_n, seconds);
    printf("probe %s: contact area %.1f mm2 (%.1f to %.1f); ended by force %u, by depth %u\n",
           a->probe, 1e6 * s.area_mean_m2, 1e6 * s.area_low_m2, 1e6 * s.area_high_m2,
           s.ends[SONDE_ROBOT_FORCE_LIMIT], s.ends[SONDE_ROBOT_DEPTH_LIMIT]);
  }
  if (a->json) app_json_end();
  if (s.ends[SONDE_ROBOT_NO_EQUILIBRIUM])
    fprintf(stderr, "sonde measure: %u sites ended before the limit: no equilibrium was found\n",
            s.ends[SONDE_ROBOT_NO_EQUILIBRIUM]);
  if (cancelled)
    fprintf(stderr, "sonde measure: cancelled; %s holds %u sites (%s)\n", a->output, s.sites,
            m->remark);
  return cancelled ? APP_FAILED : APP_OK;
}

static int run(void *from) {
  const options *a = from;
  assert(a->model && (a->probe || a->save_sites));
  sonde_model *model = NULL;
  sonde_site_table sites = {0};
  sonde_error error = {0};
  sonde_status status = sonde_limb_model_load(a->model, &model, &error);
  if (!status)
    status = a->sites ? sonde_site_table_load(a->sites, &sites, &error)
                      : sonde_sites_place(model, &a->places, &sites, &error);
  if (!status && !a->probe) {
    status = sonde_site_table_save(a->save_sites, &sites, &error);
    if (!status && a->json) app_json_begin();
    if (!status) print_spacing(a, &sites);
    if (!status && a->json) app_json_end();
  }
  int code = status ? app_fail(VERB, &error) : APP_OK;
  if (!status && a->probe) {
    sonde_measurements m;
    sonde_robot_log log;
    double start = app_seconds(CLOCK_MONOTONIC);
    sonde_progress progress = app_progress();
    status = sonde_robot_run(model, &sites, &a->def, &progress, &m, &log, &error);
    app_progress_end();
    bool cancelled = status == SONDE_CANCELLED;
    code = status && !cancelled
               ? app_fail(VERB, &error)
               : conclude(a, &sites, &m, &log, cancelled, app_seconds(CLOCK_MONOTONIC) - start);
    sonde_measurements_clear(&m);
    sonde_robot_log_clear(&log);
  }
  sonde_site_table_clear(&sites);
  sonde_model_destroy(model);
  return code;
}

const app_command cmd_measure = {
    .verb = "measure",
    .summary = "press a model at its sites with the virtual robot",
    .usage = "MODEL (--sites CSV | --bounds A:B,C:D | --painted FILE) --probe NAME|FILE -o CSV "
             "[options]",
    .text = "Advances a probe along the normal of every site, step by step, until the force "
            "passes the limit, the depth limit is reached or no equilibrium is found.",
    .tail = "Ctrl-C keeps finished sites, and of those under way the ones with at least 3 steps; "
            "the first line of the file then is a comment that says so. With less than that no "
            "file is written.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .prepare = prepare,
    .required = "MODEL",
    .one_of = "sites bounds painted",
    .check = check,
    .run = run};
