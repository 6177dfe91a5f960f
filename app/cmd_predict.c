// sonde predict: errors of a settled model against measurements, per probe.
#include "fit_common.h"
#include "options.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>

static const char VERB[] = "predict";

typedef struct options {
  const char *model, *measurements, *sites;
  sonde_predict_def def;
  bool json, bands;
} options;

static void prepare(void *to) { ((options *)to)->def = sonde_predict_def_default(); }

static const char *const INTERACTIONS[] = {"simplified", "full", NULL};

static const app_option TABLE[] = {
    OPT_ARGUMENT(model, "MODEL", "the model file"),
    OPT_TEXT(measurements, "measurements", "CSV",
             "force against penetration: "
             "site,probe,x_mm,y_mm,z_mm,nx,ny,nz,penetration_mm,force_n"),
    OPT_TEXT(sites, "sites", "CSV", "positions and axes of the sites; default: those in the model"),
    OPT_WORD(def.interaction, "interaction", "KIND", INTERACTIONS,
             "simplified: nodes beside the footprint stay at rest; full: static equilibrium of the "
             "whole surface"),
    OPT_REAL(def.relative_residual, "residual", "R", 1e-14, 0.1, 1,
             "relative residual of the equilibrium"),
    OPT_INTEGER(def.threads, "threads", "N", 1, 64,
                "threads; the result does not depend on them; default: one per core"),
    OPT_FLAG(bands, "bands", "mean error by depth as well"),
    OPT_JSON(json)};

static int run(void *from) {
  const options *a = from;
  assert(a->model && a->measurements);
  sonde_model *model = NULL;
  sonde_site_table loaded = {0};
  sonde_measurements m = {0};
  sonde_error error = {0};
  sonde_error_report report;
  double start = app_seconds(CLOCK_MONOTONIC), *predicted_n = NULL;

  // The sites are those of the table, else those that the model carries.
  sonde_status status = sonde_limb_model_load(a->model, &model, &error);
  if (!status && a->sites) status = sonde_site_table_load(a->sites, &loaded, &error);
  if (status) goto done;
  sonde_site_table sites =
      a->sites ? loaded : (sonde_site_table){.count = model->site_count, .sites = model->sites};
  status = sonde_measurements_load(a->measurements, &sites, &m, &error);
  if (status) goto done;

  // The model's force at every measured penetration.
  predicted_n = calloc(m.count, sizeof *predicted_n);
  sonde_progress progress = app_progress();
  status = predicted_n ? sonde_predict(model, &sites, &m, &a->def, &progress, predicted_n, &error)
                       : (error.status = SONDE_MEMORY);
  app_progress_end();
  if (!status) status = sonde_error_report_of(m.data, predicted_n, m.count, &report, &error);
  if (!status) {
    double seconds = app_seconds(CLOCK_MONOTONIC) - start;
    const char *interaction = INTERACTIONS[a->def.interaction];
    if (a->json) {
      app_json_begin();
      app_json_report(interaction, &report);
      app_json("not_converged:%u seconds:%g", report.left_out, seconds);
      app_json_end();
    } else {
      char title[128];
      snprintf(title, sizeof title, "%s interaction, %.1f s", interaction, seconds);
      app_print_report(title, &report);
      if (report.left_out) printf("%u rows left out: no equilibrium was found\n", report.left_out);
      if (a->bands) {

        // Mean of (model - measured)/measured mean per band of depth and probe.
        enum { BANDS = 32 };
        const double BAND_MM = 2.0;
        printf("bias by depth, %% of the band's mean force\n  %-10s", "depth mm");
        for (uint32_t p = 0; p < report.probe_count; ++p) printf(" %10s", report.probe[p]);
        printf("\n");
        for (int band = 0; band < BANDS; ++band) {
          double error_n[SONDE_FIT_PROBES] = {0}, force_n[SONDE_FIT_PROBES] = {0};
          bool any = false;
          for (uint32_t i = 0; i < m.count; ++i) {
            long at = lround(m.data[i].penetration_m * 1e3 / BAND_MM);
            if (at != band || !isfinite(predicted_n[i])) continue;
            uint32_t p = 0;
            while (strcmp(report.probe[p], m.data[i].probe) != 0) ++p;
            error_n[p] += predicted_n[i] - m.data[i].force_n;
            force_n[p] += m.data[i].force_n;
            any = true;
          }
          if (!any) continue;
          printf("  %-10g", band * BAND_MM);
          for (uint32_t p = 0; p < report.probe_count; ++p)
            force_n[p] > 0 ? printf(" %+10.1f", 100 * error_n[p] / force_n[p])
                           : printf(" %10s", "-");
          printf("\n");
        }
      }
    }
  }
done:
  free(predicted_n);
  sonde_measurements_clear(&m);
  sonde_site_table_clear(&loaded);
  sonde_model_destroy(model);
  return status ? app_fail(VERB, &error) : APP_OK;
}

const app_command cmd_predict = {
    .verb = "predict",
    .summary = "compare a model's forces with measurements",
    .usage = "MODEL --measurements CSV [--sites CSV] [options]",
    .text = "Presses the model as the experiment did, with the footprint bonded and moved along "
            "the normal, and compares the force at each measured penetration.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .prepare = prepare,
    .required = "MODEL measurements",
    .run = run};
