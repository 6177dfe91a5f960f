// sonde fit --model: a volumetric model, its moduli and errors.
#include "fit_bulk.h"

#include "fit_common.h"

#include <assert.h>
#include <stdio.h>
#include <stdlib.h>

const char *const fit_bulk_kinds[] = {SONDE_MODEL_KIND_NAMES, NULL};

sonde_status fit_bulk_run(const fit_bulk_job *job, sonde_error *error) {
  sonde_progress progress = app_progress();
  sonde_fit_bulk_result r;
  sonde_model *model = NULL;
  uint32_t count = job->measurements->count;
  assert(count > 0 && job->options->kind != SONDE_TWO_LAYER);
  double *predicted_n = calloc(count, sizeof *predicted_n);
  if (!predicted_n) return SONDE_MEMORY;
  sonde_status status = sonde_fit_bulk(job->def, job->sites, job->measurements, job->options,
                                       &progress, &model, &r, predicted_n, error);
  app_progress_end();
  if (!status) status = sonde_model_save(model, job->output, error);
  const char *kind = fit_bulk_kinds[job->options->kind];
  if (!status && job->json) {
    app_json_begin();
    app_json_report("full", &r.all);
    app_json_text("kind", kind);
    app_json_object("moduli");
    for (uint32_t k = 0; k < r.parameter_count; ++k) app_json_real(r.parameter[k], r.value[k]);
    app_json_close();
    app_json("parameters:%u iterations:%u converged:%hhd nodes:%u skin_nodes:%u elements:%u "
             "mesh_s:%g fit_s:%g predict_s:%g model:%s",
             r.parameter_count, r.steps, r.converged, r.node_count, r.skin_nodes, r.element_count,
             r.mesh_s, r.fit_s, r.predict_s, job->output);
    app_json_end();
  } else if (!status) {
    char title[128];
    snprintf(title, sizeof title, "%s: %u parameters for the whole thigh", kind, r.parameter_count);
    app_print_report(title, &r.all);
    for (uint32_t k = 0; k < r.parameter_count; ++k)
      printf("%s%s %.4g", k ? ", " : "", r.parameter[k], r.value[k]);
    printf("\n%u nodes (%u of the skin), %u tetrahedra; mesh %.1f s, fit %.1f s, all rows %.1f s\n",
           r.node_count, r.skin_nodes, r.element_count, r.mesh_s, r.fit_s, r.predict_s);
    if (!r.converged) printf("the moduli had not settled when the limit of steps was reached\n");
    printf("wrote %s\n", job->output);
  }
  sonde_model_destroy(model);
  free(predicted_n);
  return status;
}
