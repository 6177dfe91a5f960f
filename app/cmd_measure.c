// sonde measure: the virtual robot presses a model at every site and writes a measurement file.
// A cancelled run still writes what was measured.
//
// parse_def / parse_sites  options into definitions
// summarise     what the log says about all sites
// conclude      writes the tables, then says what they hold
// measure       runs the robot
#include "fit_common.h"

#include <math.h>

static const char VERB[] = "measure";
static const char HELP[] =
    "usage: sonde measure MODEL SITES --probe NAME|FILE -o CSV [options]\n"
    "\n"
    "Advances a probe along the normal of every site, step by step, until the force passes the "
    "limit,\n"
    "the depth limit is reached or no equilibrium is found. SITES is one of\n"
    "\n"
    "  --sites CSV        positions, normals and axes of the sites\n"
    "  --bounds A:B,C:D   regular sites from A to B degrees around the leg (its axis is parallel "
    "to "
    "z;\n"
    "                     0 is +x, 90 is +y) and from z = C to D mm\n"
    "  --painted FILE     regular sites in a region: a mesh of that patch of skin, or a CSV file\n"
    "                     x_mm,y_mm,z_mm with the corners of its outline\n"
    "\n"
    "  --grid NxM         with --bounds: N sites around the leg, M along it; with --painted: N*M\n"
    "                     sites; default 8x8\n"
    "  --save-sites CSV   write the sites; without --probe and -o nothing else is done\n"
    "  --probe NAME       point, linear, square, sphere, rect:AxB (mm), or a convex mesh file "
    "(mm)\n"
    "  -o CSV             measurement file to write\n"
    "  --log CSV          write one row per site: how it ended, contact area, depth and force\n"
    "  --step-mm S        default 2\n"
    "  --limit-n N        default 40; the first step above it is the last\n"
    "  --depth-mm D       default 30\n"
    "  --contact KIND     bonded: the skin under the footprint moves with it, as in the "
    "experiment\n"
    "                     (default of rectangular probes); probe: the body is pressed in\n"
    "  --noise-n S        standard deviation of the force sensor; default 0\n"
    "  --noise-mm S       standard deviation of the penetration; default 0\n"
    "  --quantise-n Q     readings are multiples of Q, after the noise; default: not quantised\n"
    "  --quantise-mm Q    the same for the penetration, at most the step\n"
    "  --seed K           of the noise; default 1\n"
    "  --residual R       relative residual of the equilibrium; default 1e-6\n"
    "  --threads N        default: one per core\n"
    "  --json             one JSON object instead of sentences\n"
    "  --help             this text\n"
    "\n"
    "Ctrl-C keeps finished sites and those with at least 3 steps; a first comment line says so.\n";

static const double RAD_PER_DEGREE = 3.14159265358979323846 / 180, SPACING_CV_MAX = 0.1;

typedef struct measure_arguments {
  const char *model, *sites, *bounds, *painted, *grid, *save_sites, *probe, *output, *log;
  const char *step, *limit, *depth, *contact, *noise_n, *noise_mm, *quantise_n, *quantise_mm;
  const char *seed, *residual, *threads;
  bool json, help;
} measure_arguments;

// ---- options ------------------------------------------------------------------------------

static bool check_choice(const measure_arguments *a) {
  int ways = (a->sites != NULL) + (a->bounds != NULL) + (a->painted != NULL);
  if (ways != 1)
    app_usage_error(VERB, "expected one of --sites, --bounds and --painted, got %d", ways);
  else if (a->grid && a->sites)
    app_usage_error(VERB, "--grid places sites and does not go with --sites");
  else
    return (a->save_sites && !a->probe && !a->output) ||
           (app_require(VERB, "--probe", a->probe) && app_require(VERB, "-o CSV", a->output));
  return false;
}

static bool parse_arguments(int argc, char **argv, measure_arguments *a) {
  const app_option options[] = {{"--sites", &a->sites, NULL},
                                {"--bounds", &a->bounds, NULL},
                                {"--painted", &a->painted, NULL},
                                {"--grid", &a->grid, NULL},
                                {"--save-sites", &a->save_sites, NULL},
                                {"--probe", &a->probe, NULL},
                                {"-o", &a->output, NULL},
                                {"--output", &a->output, NULL},
                                {"--log", &a->log, NULL},
                                {"--step-mm", &a->step, NULL},
                                {"--limit-n", &a->limit, NULL},
                                {"--depth-mm", &a->depth, NULL},
                                {"--contact", &a->contact, NULL},
                                {"--noise-n", &a->noise_n, NULL},
                                {"--noise-mm", &a->noise_mm, NULL},
                                {"--quantise-n", &a->quantise_n, NULL},
                                {"--quantise-mm", &a->quantise_mm, NULL},
                                {"--seed", &a->seed, NULL},
                                {"--residual", &a->residual, NULL},
                                {"--threads", &a->threads, NULL},
                                {"--json", NULL, &a->json},
                                {"--help", NULL, &a->help}};
  if (!app_take_options(VERB, argc, argv, options, sizeof options / sizeof *options, &a->model))
    return false;
  if (a->help) return true;
  return app_require(VERB, "MODEL", a->model) && check_choice(a);
}

static bool parse_def(const measure_arguments *a, sonde_robot_def *def) {
  static const char *const CONTACTS[] = {"auto", "bonded", "probe", NULL};
  *def = sonde_robot_def_default();
  double step_mm = 2, depth_mm = 30, noise_mm = 0, quantum_mm = 0;
  long seed = 1, threads = 0;
  int contact = 0;
  const struct {
    const char *option, *text;
    double low, high, *value;
  } reals[] = {{"--step-mm", a->step, 0.01, 20, &step_mm},
               {"--limit-n", a->limit, 0, 1e4, &def->limit_n},
               {"--depth-mm", a->depth, 0.01, 100, &depth_mm},
               {"--noise-n", a->noise_n, 0, 100, &def->noise_force_n},
               {"--noise-mm", a->noise_mm, 0, 10, &noise_mm},
               {"--quantise-n", a->quantise_n, 0, 100, &def->quantum_force_n},
               {"--quantise-mm", a->quantise_mm, 0, 10, &quantum_mm},
               {"--residual", a->residual, 1e-14, 0.1, &def->relative_residual}};
  for (size_t i = 0; i < sizeof reals / sizeof *reals; ++i)
    if (reals[i].text && !app_parse_real(VERB, reals[i].option, reals[i].text, reals[i].low,
                                         reals[i].high, reals[i].value))
      return false;
  if (a->seed && !app_parse_integer(VERB, "--seed", a->seed, 0, 2147483647, &seed)) return false;
  if (a->threads && !app_parse_integer(VERB, "--threads", a->threads, 1, 64, &threads))
    return false;
  if (a->contact && !app_parse_word(VERB, "--contact", a->contact, CONTACTS, &contact))
    return false;
  def->probe = a->probe;
  def->contact = (sonde_robot_contact)contact;
  def->step_m = 1e-3 * step_mm;
  def->depth_limit_m = 1e-3 * depth_mm;
  def->noise_penetration_m = 1e-3 * noise_mm;
  def->quantum_penetration_m = 1e-3 * quantum_mm;
  def->seed = (uint64_t)seed;
  def->threads = (uint32_t)threads;
  return true;
}

// Reads numbers with one separator after each but the last; false when the text is anything else.
static bool parse_list(const char *text, const char *separators, double *values) {
  for (;; ++separators, ++values) {
    const char *end;
    *values = sonde_parse_real(text, &end);
    if (end == text || !isfinite(*values)) return false;
    if (!*separators) return !*end;
    if (*end != *separators) return false;
    text = end + 1;
  }
}

static bool parse_sites(const measure_arguments *a, sonde_sites_def *def) {
  *def = sonde_sites_def_default();
  double grid[2] = {8, 8}, bounds[4] = {0};
  if (a->grid &&
      !(parse_list(a->grid, "x", grid) && grid[0] >= 1 && grid[0] <= 1000 && grid[1] >= 1 &&
        grid[1] <= 1000 && floor(grid[0]) >= grid[0] && floor(grid[1]) >= grid[1])) {
    app_usage_error(VERB, "--grid expects two whole numbers such as 8x8, got '%s'", a->grid);
    return false;
  }
  if (a->bounds && !parse_list(a->bounds, ":,:", bounds)) {
    app_usage_error(VERB, "--bounds expects degrees and mm such as 0:100,83:217, got '%s'",
                    a->bounds);
    return false;
  }
  def->columns = (uint32_t)grid[0];
  def->rows = (uint32_t)grid[1];
  def->painted = a->painted;
  def->angle_low_rad = RAD_PER_DEGREE * bounds[0];
  def->angle_high_rad = RAD_PER_DEGREE * bounds[1];
  def->z_low_m = 1e-3 * bounds[2];
  def->z_high_m = 1e-3 * bounds[3];
  return true;
}

// ---- sites --------------------------------------------------------------------------------

static void print_spacing(const measure_arguments *a, const sonde_site_table *sites) {
  if (a->sites && !a->save_sites) return;
  sonde_site_spacing s = sonde_site_spacing_of(sites);
  if (a->json) {
    app_json_integer("sites_placed", sites->count);
    app_json_real("spacing_mean_mm", 1e3 * s.mean_m);
    app_json_real("spacing_cv", s.cv);
    return;
  }
  printf("%u sites, nearest neighbours %.2f mm apart (%.2f to %.2f mm, CV %.1f %%)%s%s\n",
         sites->count, 1e3 * s.mean_m, 1e3 * s.least_m, 1e3 * s.largest_m, 100 * s.cv,
         a->save_sites ? ", written to " : "", a->save_sites ? a->save_sites : "");
  if (s.cv > SPACING_CV_MAX)
    fprintf(stderr, "sonde measure: the sites are not regular: CV %.1f %%, expected at most %.0f\n",
            100 * s.cv, 100 * SPACING_CV_MAX);
}

// ---- robot --------------------------------------------------------------------------------

typedef struct summary {
  uint32_t sites, ends[4]; // with rows; by sonde_robot_end
  double force_max_n, area_mean_m2, area_low_m2, area_high_m2;
} summary;

static summary summarise(const sonde_measurements *m, const sonde_robot_log *log) {
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
  return s;
}

static void print_json(const measure_arguments *a, const sonde_measurements *m, const summary *s,
                       bool cancelled, double seconds) {
  app_json_text("file", a->output);
  app_json_text("probe", a->probe);
  app_json_integer("sites", s->sites);
  app_json_integer("rows", m->count);
  app_json_integer("force_limit", s->ends[SONDE_ROBOT_FORCE_LIMIT]);
  app_json_integer("depth_limit", s->ends[SONDE_ROBOT_DEPTH_LIMIT]);
  app_json_integer("not_converged", s->ends[SONDE_ROBOT_NO_EQUILIBRIUM]);
  app_json_real("force_max_n", s->force_max_n);
  app_json_real("contact_area_mean_mm2", 1e6 * s->area_mean_m2);
  app_json_real("contact_area_low_mm2", 1e6 * s->area_low_m2);
  app_json_real("contact_area_high_mm2", 1e6 * s->area_high_m2);
  app_json_bool("cancelled", cancelled);
  app_json_real("seconds", seconds);
}

static void print_result(const measure_arguments *a, const sonde_measurements *m, const summary *s,
                         bool cancelled, uint32_t wanted, double seconds) {
  if (a->json) {
    print_json(a, m, s, cancelled, seconds);
    return;
  }
  printf("wrote %s: %u of %u sites, %u rows, at most %.2f N, %.1f s\n", a->output, s->sites, wanted,
         m->count, s->force_max_n, seconds);
  printf("probe %s: contact area %.1f mm2 (%.1f to %.1f); ended by force %u, by depth %u\n",
         a->probe, 1e6 * s->area_mean_m2, 1e6 * s->area_low_m2, 1e6 * s->area_high_m2,
         s->ends[SONDE_ROBOT_FORCE_LIMIT], s->ends[SONDE_ROBOT_DEPTH_LIMIT]);
}

static sonde_status save_log(const char *path, const char *probe, const sonde_robot_log *log,
                             sonde_error *error) {
  static const char *const ENDS[] = {"cancelled", "force_limit", "depth_limit", "no_equilibrium"};
  sonde_file *file;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  sonde_file_printf(file, "# probe %s\nsite,rows,end,contact_area_mm2,depth_mm,force_n\n", probe);
  for (uint32_t i = 0; i < log->count; ++i) {
    const sonde_robot_visit *v = &log->visits[i];
    sonde_file_printf(file, "%u,%u,%s,%.3f,%.4f,%.4f\n", v->site, v->rows, ENDS[v->end],
                      1e6 * v->area_m2, 1e3 * v->depth_m, v->force_n);
  }
  return sonde_file_commit(file, error);
}

static sonde_status save_tables(const measure_arguments *a, const sonde_site_table *sites,
                                const sonde_measurements *m, const sonde_robot_log *log,
                                sonde_error *error) {
  sonde_status status = sonde_measurements_save(a->output, m, error);
  if (!status && a->log) status = save_log(a->log, a->probe, log, error);
  if (!status && a->save_sites) status = sonde_site_table_save(a->save_sites, sites, error);
  return status;
}

// A cancelled robot without rows leaves no file.
static int conclude(const measure_arguments *a, const sonde_site_table *sites,
                    const sonde_measurements *m, const sonde_robot_log *log, bool cancelled,
                    double seconds) {
  sonde_error error = {0};
  if (cancelled && !m->count) {
    fprintf(stderr, "sonde measure: cancelled before a site had %d steps; nothing was written\n",
            SONDE_ROBOT_LEAST_ROWS);
    return APP_FAILED;
  }
  if (save_tables(a, sites, m, log, &error)) return app_fail(VERB, &error);
  summary s = summarise(m, log);
  if (a->json) app_json_begin();
  print_spacing(a, sites);
  print_result(a, m, &s, cancelled, log->count, seconds);
  if (a->json) app_json_end();
  if (s.ends[SONDE_ROBOT_NO_EQUILIBRIUM])
    fprintf(stderr, "sonde measure: %u sites ended before the limit: no equilibrium was found\n",
            s.ends[SONDE_ROBOT_NO_EQUILIBRIUM]);
  if (cancelled)
    fprintf(stderr, "sonde measure: cancelled; %s holds %u sites (%s)\n", a->output, s.sites,
            m->remark);
  return cancelled ? APP_FAILED : APP_OK;
}

static int measure(const measure_arguments *a, const sonde_robot_def *def, const sonde_model *model,
                   const sonde_site_table *sites) {
  sonde_measurements m;
  sonde_robot_log log;
  sonde_error error = {0};
  double start = app_seconds(CLOCK_MONOTONIC);
  sonde_progress progress = app_progress();
  sonde_status status = sonde_robot_run(model, sites, def, &progress, &m, &log, &error);
  app_progress_end();
  bool cancelled = status == SONDE_CANCELLED;
  int code = status && !cancelled
                 ? app_fail(VERB, &error)
                 : conclude(a, sites, &m, &log, cancelled, app_seconds(CLOCK_MONOTONIC) - start);
  sonde_measurements_clear(&m);
  sonde_robot_log_clear(&log);
  return code;
}

static int save_sites_only(const measure_arguments *a, const sonde_site_table *sites) {
  sonde_error error = {0};
  if (sonde_site_table_save(a->save_sites, sites, &error)) return app_fail(VERB, &error);
  if (a->json) app_json_begin();
  print_spacing(a, sites);
  if (a->json) app_json_end();
  return APP_OK;
}

int old_measure(int argc, char **argv);
int old_measure(int argc, char **argv) {
  measure_arguments arguments = {0};
  sonde_robot_def def;
  sonde_sites_def sites_def;
  if (!parse_arguments(argc, argv, &arguments)) return APP_BAD_INPUT;
  if (arguments.help) {
    fputs(HELP, stdout);
    return APP_OK;
  }
  if (!parse_def(&arguments, &def) || !parse_sites(&arguments, &sites_def)) return APP_BAD_INPUT;
  const char *const outputs[] = {arguments.output, arguments.log, arguments.save_sites};
  for (size_t i = 0; i < sizeof outputs / sizeof *outputs; ++i) {
    int unwritable = app_check_output(VERB, outputs[i]);
    if (unwritable) return unwritable;
  }
  sonde_model *model = NULL;
  sonde_site_table sites = {0};
  sonde_error error = {0};
  sonde_status status = sonde_model_load(arguments.model, &model, &error);
  if (!status)
    status = arguments.sites ? sonde_site_table_load(arguments.sites, &sites, &error)
                             : sonde_sites_place(model, &sites_def, &sites, &error);
  int code;
  if (status)
    code = app_fail(VERB, &error);
  else if (arguments.probe)
    code = measure(&arguments, &def, model, &sites);
  else
    code = save_sites_only(&arguments, &sites);
  sonde_site_table_clear(&sites);
  sonde_model_destroy(model);
  return code;
}
