// The gel film: creation.
// check: the definition. measure_edges: what flows across each.
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
  sonde_free(gel->push_pa);
  sonde_free(gel->drag);
  sonde_free(gel->half_m);
  sonde_free(gel->near);
  sonde_free(gel);
}

// The width of an edge's flow: a third of the area around it per direction.
static void measure_edges(sonde_gel *gel) {
  const sonde_topology *topology = &gel->model->topology;
  const sonde_vec3 *x = gel->model->surface.vertices;
  for (uint32_t e = 0; e < topology->edge_count; ++e) {
    uint32_t i = topology->edges[e][0], j = topology->edges[e][1];
    double length = fmax(v_distance(x[i], x[j]), 1e-6);
    double width = 0.3 * (gel->model->area_m2[i] + gel->model->area_m2[j]) / length;
    gel->drag[e] = width / (12.0 * gel->def.viscosity_pa_s * length);
    gel->half_m[e] = 0.5 * width / length;
  }
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
  gel->push_pa = SONDE_NEW(double, nodes);
  gel->drag = SONDE_NEW(double, topology->edge_count);
  gel->half_m = SONDE_NEW(double, topology->edge_count);
  gel->near = SONDE_NEW(uint32_t, nodes);
  if (!gel->film_m || !gel->moisture || !gel->change_m3 || !gel->push_pa || !gel->drag ||
      !gel->half_m || !gel->near) {
    sonde_gel_destroy(gel);
    return sonde_fail_memory(error);
  }
  measure_edges(gel);
  *out = gel;
  return SONDE_OK;
}
