// The gel film: creation.
#include "haptics/gel.h"

#include "base/base.h"
#include "base/maths.h"
#include "haptics/ranges.h"

#include <stddef.h>

sonde_gel_def sonde_gel_def_default(void) {
  return (sonde_gel_def){.version = SONDE_DEF_VERSION,
                         .viscosity_pa_s = 10.0,
                         .lubricating_m = 20e-6,
                         .drying_m_s = 5e-8,
                         .moist_s = 60.0,
                         .moist_stickiness = 0.8};
}

#define RANGE(member, low, high)                                                                   \
  { #member, offsetof(sonde_gel_def, member), low, high }
static const sonde_range RANGES[] = {RANGE(viscosity_pa_s, 1e-3, 1e4),
                                     RANGE(lubricating_m, 1e-7, 1e-2), RANGE(drying_m_s, 0, 1e-3),
                                     RANGE(moist_s, 1e-3, 1e6), RANGE(moist_stickiness, 0, 10)};

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

sonde_status sonde_gel_create(const sonde_model *model, const sonde_gel_def *def, sonde_gel **out,
                              sonde_error *error) {
  SONDE_ASSERT(model != NULL && out != NULL);
  *out = NULL;
  sonde_gel_def wanted = def ? *def : sonde_gel_def_default();
  sonde_status status = sonde_def_check("gel", wanted.version, error);
  if (!status) status = sonde_ranges_check("gel", &wanted, RANGES, SONDE_COUNT_OF(RANGES), error);
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
  // The width of an edge's flow is a third of the area around it per direction.
  const sonde_vec3 *x = gel->model->surface.vertices;
  for (uint32_t e = 0; e < topology->edge_count; ++e) {
    uint32_t i = topology->edges[e][0], j = topology->edges[e][1];
    double length = fmax(v_distance(x[i], x[j]), 1e-6);
    double width = 0.3 * (gel->model->area_m2[i] + gel->model->area_m2[j]) / length;
    gel->drag[e] = width / (12.0 * gel->def.viscosity_pa_s * length);
    gel->half_m[e] = 0.5 * width / length;
  }
  *out = gel;
  return SONDE_OK;
}
