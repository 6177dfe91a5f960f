// The gel film: creation.
#include "haptics/gel.h"

#include "base/base.h"
#include "base/maths.h"

sonde_gel_def sonde_gel_def_default(void) {
  return (sonde_gel_def){.viscosity_pa_s = 10.0,
                         .lubricating_m = 20e-6,
                         .drying_m_s = 5e-8,
                         .moist_s = 60.0,
                         .moist_stickiness = 0.8};
}

static sonde_status check(const sonde_gel_def *def, sonde_error *error) {
  const struct {
    const char *name;
    double value, low, high;
  } range[] = {{"viscosity_pa_s", def->viscosity_pa_s, 1e-3, 1e4},
               {"lubricating_m", def->lubricating_m, 1e-7, 1e-2},
               {"drying_m_s", def->drying_m_s, 0, 1e-3},
               {"moist_s", def->moist_s, 1e-3, 1e6},
               {"moist_stickiness", def->moist_stickiness, 0, 10}};
  for (size_t i = 0; i < SONDE_COUNT_OF(range); ++i)
    if (!(range[i].value >= range[i].low && range[i].value <= range[i].high))
      return sonde_fail(error, SONDE_ARGUMENT, "gel: %s is %g, expected %g to %g", range[i].name,
                        range[i].value, range[i].low, range[i].high);
  return SONDE_OK;
}

void sonde_gel_destroy(sonde_gel *gel) {
  if (!gel) return;
  sonde_free(gel->film_m);
  sonde_free(gel->moisture);
  sonde_free(gel->change_m3);
  sonde_free(gel->edge_m);
  sonde_free(gel);
}

sonde_status sonde_gel_create(const sonde_model *model, const sonde_gel_def *def, sonde_gel **out,
                              sonde_error *error) {
  SONDE_ASSERT(model != NULL && out != NULL);
  *out = NULL;
  sonde_gel_def wanted = def ? *def : sonde_gel_def_default();
  sonde_status status = check(&wanted, error);
  if (status) return status;
  const sonde_topology *topology = &model->topology;
  size_t nodes = model->surface.vertex_count;
  SONDE_ASSERT(topology->vertex_count == nodes);
  sonde_gel *gel = SONDE_NEW(sonde_gel, 1);
  if (!gel) return sonde_fail_memory(error);
  gel->def = wanted;
  gel->model = model;
  gel->film_m = SONDE_NEW(double, nodes);
  gel->moisture = SONDE_NEW(double, nodes);
  gel->change_m3 = SONDE_NEW(double, nodes);
  gel->edge_m = SONDE_NEW(double, topology->edge_count);
  if (!gel->film_m || !gel->moisture || !gel->change_m3 || !gel->edge_m) {
    sonde_gel_destroy(gel);
    return sonde_fail_memory(error);
  }
  const sonde_vec3 *x = model->surface.vertices;
  for (uint32_t e = 0; e < topology->edge_count; ++e)
    gel->edge_m[e] = fmax(v_distance(x[topology->edges[e][0]], x[topology->edges[e][1]]), 1e-6);
  *out = gel;
  return SONDE_OK;
}
