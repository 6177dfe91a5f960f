// sonde predict: errors of a settled model against measurements, per probe.
// table_of_model: the sites that the model carries, when no site file is given.
// print_bands:    mean error in percent by depth.
#include "fit_common.h"

#include <math.h>
#include <stdlib.h>

static const char VERB[] = "predict";
static const char HELP[] =
    "usage: sonde predict MODEL --measurements CSV [--sites CSV] [options]\n"
    "\n"
    "Presses the model as the experiment did (footprint bonded, moved along the normal) and "
    "compares\n"
    "the force at each measured penetration.\n"
    "\n"
    "  --measurements CSV   site,probe,x_mm,y_mm,z_mm,nx,ny,nz,penetration_mm,force_n\n"
    "  --sites CSV          positions and axes of the sites; default: those in the model\n"
    "  --interaction KIND   simplified (default): nodes beside the footprint stay at rest\n"
    "                       full: static equilibrium of the whole surface\n"
    "  --residual R         relative residual of the equilibrium; default 1e-6\n"
    "  --threads N          default: one per core\n"
    "  --bands              mean error by depth as well\n"
    "  --json               one JSON object instead of the table\n"
    "  --help               this text\n";

typedef struct predict_arguments {
  const char *model, *measurements, *sites, *interaction, *residual, *threads;
  bool json, help, bands;
} predict_arguments;

static const char *const INTERACTIONS[] = {"simplified", "full", NULL};

static bool parse_arguments(int argc, char **argv, predict_arguments *a) {
  const app_option options[] = {{"--measurements", &a->measurements, NULL},
                                {"--sites", &a->sites, NULL},
                                {"--interaction", &a->interaction, NULL},
                                {"--residual", &a->residual, NULL},
                                {"--threads", &a->threads, NULL},
                                {"--bands", NULL, &a->bands},
                                {"--json", NULL, &a->json},
                                {"--help", NULL, &a->help}};
  if (!app_take_options(VERB, argc, argv, options, sizeof options / sizeof *options, &a->model))
    return false;
  if (a->help) return true;
  return app_require(VERB, "MODEL", a->model) &&
         app_require(VERB, "--measurements", a->measurements);
}

static bool parse_def(const predict_arguments *a, sonde_predict_def *def) {
  int interaction = 0;
  long threads = 0;
  *def = sonde_predict_def_default();
  if (a->interaction &&
      !app_parse_word(VERB, "--interaction", a->interaction, INTERACTIONS, &interaction))
    return false;
  if (a->threads && !app_parse_integer(VERB, "--threads", a->threads, 1, 64, &threads))
    return false;
  if (a->residual &&
      !app_parse_real(VERB, "--residual", a->residual, 1e-14, 0.1, &def->relative_residual))
    return false;
  def->interaction = (sonde_interaction)interaction;
  def->threads = (uint32_t)threads;
  return true;
}

enum { BANDS = 32 };
static const double BAND_MM = 2.0;

// Mean of (model - measured)/measured mean per band of depth and probe.
static void print_bands(const sonde_measurements *m, const double *predicted_n,
                        const sonde_error_report *report) {
  printf("bias by depth, %% of the band's mean force\n  %-10s", "depth mm");
  for (uint32_t p = 0; p < report->probe_count; ++p) printf(" %10s", report->probe[p]);
  printf("\n");
  for (int band = 0; band < BANDS; ++band) {
    double error_n[SONDE_FIT_PROBES] = {0}, force_n[SONDE_FIT_PROBES] = {0};
    bool any = false;
    for (uint32_t i = 0; i < m->count; ++i) {
      long at = lround(m->data[i].penetration_m * 1e3 / BAND_MM);
      if (at != band || !isfinite(predicted_n[i])) continue;
      uint32_t p = 0;
      while (strcmp(report->probe[p], m->data[i].probe) != 0) ++p;
      error_n[p] += predicted_n[i] - m->data[i].force_n;
      force_n[p] += m->data[i].force_n;
      any = true;
    }
    if (!any) continue;
    printf("  %-10g", band * BAND_MM);
    for (uint32_t p = 0; p < report->probe_count; ++p)
      force_n[p] > 0 ? printf(" %+10.1f", 100 * error_n[p] / force_n[p]) : printf(" %10s", "-");
    printf("\n");
  }
}

static void print_result(const predict_arguments *a, const sonde_predict_def *def,
                         const sonde_measurements *m, const double *predicted_n,
                         const sonde_error_report *report, double seconds) {
  const char *interaction = INTERACTIONS[def->interaction];
  if (a->json) {
    app_json_begin();
    app_json_report(interaction, report);
    app_json_integer("not_converged", report->left_out);
    app_json_real("seconds", seconds);
    app_json_end();
    return;
  }
  char title[128];
  snprintf(title, sizeof title, "%s interaction, %.1f s", interaction, seconds);
  app_print_report(title, report);
  if (report->left_out) printf("%u rows left out: no equilibrium was found\n", report->left_out);
  if (a->bands) print_bands(m, predicted_n, report);
}

static sonde_status predict(const predict_arguments *a, const sonde_predict_def *def,
                            const sonde_model *model, const sonde_site_table *sites,
                            sonde_error *error) {
  double start = app_seconds(CLOCK_MONOTONIC);
  sonde_measurements m;
  sonde_status status = sonde_measurements_load(a->measurements, sites, &m, error);
  if (status) return status;
  double *predicted_n = calloc(m.count, sizeof *predicted_n);
  sonde_error_report report;
  sonde_progress progress = app_progress();
  if (!predicted_n) {
    *error = (sonde_error){.status = SONDE_MEMORY};
    status = SONDE_MEMORY;
  } else {
    status = sonde_predict(model, sites, &m, def, &progress, predicted_n, error);
  }
  app_progress_end();
  if (!status) status = sonde_error_report_of(m.data, predicted_n, m.count, &report, error);
  if (!status) print_result(a, def, &m, predicted_n, &report, app_seconds(CLOCK_MONOTONIC) - start);
  free(predicted_n);
  sonde_measurements_clear(&m);
  return status;
}

int old_predict(int argc, char **argv);
int old_predict(int argc, char **argv) {
  predict_arguments arguments = {0};
  sonde_predict_def def;
  if (!parse_arguments(argc, argv, &arguments)) return APP_BAD_INPUT;
  if (arguments.help) {
    fputs(HELP, stdout);
    return APP_OK;
  }
  if (!parse_def(&arguments, &def)) return APP_BAD_INPUT;
  sonde_model *model = NULL;
  sonde_site_table loaded = {0};
  sonde_error error = {0};
  sonde_status status = sonde_model_load(arguments.model, &model, &error);
  if (!status && arguments.sites) status = sonde_site_table_load(arguments.sites, &loaded, &error);
  if (!status) {
    sonde_site_table of_model = {.count = model->site_count, .sites = model->sites};
    status = predict(&arguments, &def, model, arguments.sites ? &loaded : &of_model, &error);
  }
  sonde_site_table_clear(&loaded);
  sonde_model_destroy(model);
  return status ? app_fail(VERB, &error) : APP_OK;
}
