// sonde measure: the virtual robot presses a model at every site and writes a measurement file.
// A cancelled run still writes the sites that were finished.
#include "fit_common.h"

#include <math.h>

static const char VERB[] = "measure";
static const char HELP[] =
    "usage: sonde measure MODEL --sites CSV --probe NAME|FILE -o CSV [options]\n"
    "\n"
    "Advances a probe along the normal of every site, step by step, until the force passes the "
    "limit,\n"
    "the depth limit is reached or no equilibrium is found.\n"
    "\n"
    "  --sites CSV        positions, normals and axes of the sites\n"
    "  --probe NAME       point, linear, square, sphere, or a mesh file (mm)\n"
    "  -o CSV             measurement file to write\n"
    "  --step-mm S        default 2\n"
    "  --limit-n N        default 40; the first step above it is the last\n"
    "  --depth-mm D       default 30\n"
    "  --contact KIND     bonded: the skin under the footprint moves with it, as in the "
    "experiment\n"
    "                     (default of rectangular probes); probe: the body is pressed in\n"
    "  --noise-n S        standard deviation of the force sensor; default 0\n"
    "  --noise-mm S       standard deviation of the penetration; default 0\n"
    "  --seed K           of the noise; default 1\n"
    "  --residual R       relative residual of the equilibrium; default 1e-6\n"
    "  --threads N        default: one per core\n"
    "  --json             one JSON object instead of a sentence\n"
    "  --help             this text\n";

typedef struct measure_arguments {
  const char *model, *sites, *probe, *output, *step, *limit, *depth, *contact, *noise_n, *noise_mm;
  const char *seed, *residual, *threads;
  bool json, help;
} measure_arguments;

static bool parse_arguments(int argc, char **argv, measure_arguments *a) {
  const app_option options[] = {
      {"--sites", &a->sites, NULL},     {"--probe", &a->probe, NULL},
      {"-o", &a->output, NULL},         {"--output", &a->output, NULL},
      {"--step-mm", &a->step, NULL},    {"--limit-n", &a->limit, NULL},
      {"--depth-mm", &a->depth, NULL},  {"--contact", &a->contact, NULL},
      {"--noise-n", &a->noise_n, NULL}, {"--noise-mm", &a->noise_mm, NULL},
      {"--seed", &a->seed, NULL},       {"--residual", &a->residual, NULL},
      {"--threads", &a->threads, NULL}, {"--json", NULL, &a->json},
      {"--help", NULL, &a->help}};
  if (!app_take_options(VERB, argc, argv, options, sizeof options / sizeof *options, &a->model))
    return false;
  if (a->help) return true;
  return app_require(VERB, "MODEL", a->model) && app_require(VERB, "--sites", a->sites) &&
         app_require(VERB, "--probe", a->probe) && app_require(VERB, "-o CSV", a->output);
}

static bool parse_def(const measure_arguments *a, sonde_robot_def *def) {
  static const char *const CONTACTS[] = {"auto", "bonded", "probe", NULL};
  *def = sonde_robot_def_default();
  double step_mm = 2, depth_mm = 30, noise_mm = 0;
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
  def->seed = (uint64_t)seed;
  def->threads = (uint32_t)threads;
  return true;
}

// Sites in the table; rows of one site follow each other.
static uint32_t count_sites(const sonde_measurements *m) {
  uint32_t count = 0;
  for (uint32_t i = 0; i < m->count; ++i) count += !i || m->data[i].site != m->data[i - 1].site;
  return count;
}

static void print_result(const measure_arguments *a, const sonde_measurements *m, uint32_t stopped,
                         bool cancelled, uint32_t wanted, double seconds) {
  double force_max_n = 0;
  for (uint32_t i = 0; i < m->count; ++i) force_max_n = fmax(force_max_n, m->data[i].force_n);
  uint32_t sites = count_sites(m);
  if (a->json) {
    app_json_begin();
    app_json_text("file", a->output);
    app_json_integer("sites", sites);
    app_json_integer("rows", m->count);
    app_json_integer("not_converged", stopped);
    app_json_real("force_max_n", force_max_n);
    app_json_bool("cancelled", cancelled);
    app_json_real("seconds", seconds);
    app_json_end();
  } else {
    printf("wrote %s: %u of %u sites, %u rows, at most %.2f N, %.1f s\n", a->output, sites, wanted,
           m->count, force_max_n, seconds);
  }
  if (stopped)
    fprintf(stderr, "sonde measure: %u sites ended before the limit: no equilibrium was found\n",
            stopped);
}

static int measure(const measure_arguments *a, const sonde_robot_def *def, const sonde_model *model,
                   const sonde_site_table *sites) {
  sonde_measurements m;
  sonde_error error = {0}, write_error = {0};
  uint32_t stopped = 0;
  double start = app_seconds();
  sonde_progress progress = app_progress();
  sonde_status status = sonde_robot_run(model, sites, def, &progress, &m, &stopped, &error);
  app_progress_end();
  bool cancelled = status == SONDE_CANCELLED;
  if (status && !cancelled) return app_fail(VERB, &error);
  int code = APP_OK;
  if (sonde_measurements_save(a->output, &m, &write_error)) {
    code = app_fail(VERB, &write_error);
  } else {
    print_result(a, &m, stopped, cancelled, sites->count, app_seconds() - start);
    if (cancelled) {
      fprintf(stderr, "sonde measure: cancelled; %s holds the %u sites that were finished\n",
              a->output, count_sites(&m));
      code = APP_FAILED;
    }
  }
  sonde_measurements_clear(&m);
  return code;
}

int cmd_measure(int argc, char **argv) {
  measure_arguments arguments = {0};
  sonde_robot_def def;
  if (!parse_arguments(argc, argv, &arguments)) return APP_BAD_INPUT;
  if (arguments.help) {
    fputs(HELP, stdout);
    return APP_OK;
  }
  if (!parse_def(&arguments, &def)) return APP_BAD_INPUT;
  sonde_model *model = NULL;
  sonde_site_table sites = {0};
  sonde_error error = {0};
  sonde_status status = sonde_model_load(arguments.model, &model, &error);
  if (!status) status = sonde_site_table_load(arguments.sites, &sites, &error);
  int code = status ? app_fail(VERB, &error) : measure(&arguments, &def, model, &sites);
  sonde_site_table_clear(&sites);
  sonde_model_destroy(model);
  return code;
}
