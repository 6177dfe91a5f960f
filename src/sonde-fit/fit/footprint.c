// Nodes under a footprint and the edges between them.
#include "base/maths.h"
#include "fit/fit_inside.h"
#include "geometry/internal.h"

#include <string.h>

static const double REACH_M = 0.03;  // curved skin under a 60 mm footprint stays within
static const double SHORTEST = 0.05; // of the rest length, as in the tissue

static uint32_t mark_held(const sonde_model *model, const double *covered_m2, uint32_t *held) {
  uint32_t count = 0, most = 0;
  double largest = 0.0;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    SONDE_ASSERT(model->area_m2[i] > 0);
    double share = covered_m2[i] / model->area_m2[i];
    if (share > 0.5) held[count++] = i;
    if (share > largest) {
      largest = share;
      most = i;
    }
  }
  if (count == 0 && largest > 0) held[count++] = most;
  return count;
}

// Gives back the memory beyond `count` items; keeps the larger block when there is no memory.
static void *shrink(void *array, uint32_t room, uint32_t count, size_t size) {
  SONDE_ASSERT(count <= room);
  void *small = sonde_calloc(count, size);
  if (!small) return array;
  if (count) memcpy(small, array, count * size);
  sonde_free(array);
  return small;
}

sonde_status sonde_footprint_create(const sonde_model *model, const sonde_site *site,
                                    double half_u_m, double half_v_m, sonde_coverage coverage,
                                    sonde_footprint *f, sonde_error *error) {
  SONDE_ASSERT(half_u_m > 0 && half_v_m > 0);
  *f = (sonde_footprint){0};
  const sonde_topology *t = &model->topology;
  uint32_t nodes = model->surface.vertex_count, edges = t->edge_count, next_held = 0;
  bool *is_held = SONDE_NEW(bool, nodes);
  f->node = SONDE_NEW(uint32_t, nodes);
  f->weight_m2 = SONDE_NEW(double, nodes);
  f->cosine = SONDE_NEW(double, nodes);
  f->held = SONDE_NEW(uint32_t, nodes);
  f->edge = SONDE_NEW(uint32_t, edges);
  f->rest_m = SONDE_NEW(double, edges);
  f->rise_m = SONDE_NEW(double, edges);
  sonde_status status = SONDE_OK;
  if (!is_held || !f->node || !f->weight_m2 || !f->cosine || !f->held || !f->edge || !f->rest_m ||
      !f->rise_m) {
    status = sonde_fail_memory(error);
    goto done;
  }
  sonde_mesh_footprint(&model->surface, site->position_m, site->normal, site->u, site->v, half_u_m,
                       half_v_m, REACH_M, f->weight_m2);
  f->held_count = mark_held(model, f->weight_m2, f->held);
  if (!f->held_count) {
    status = sonde_fail(error, SONDE_MISMATCH,
                        "site %u: no skin within %.0f mm under its footprint: sites and surface do "
                        "not belong together",
                        site->id, REACH_M * 1e3);
    goto done;
  }
  for (uint32_t h = 0; h < f->held_count; ++h) is_held[f->held[h]] = true;
  // weight_m2 has the covered area of every node so far and is packed in place.
  for (uint32_t i = 0; i < nodes; ++i) {
    next_held += is_held[i];
    double weight = f->weight_m2[i];
    if (coverage == SONDE_COVERAGE_CELLS) weight = is_held[i] ? model->area_m2[i] : 0.0;
    if (!(weight > 0)) continue;
    f->node[f->node_count] = i;
    f->weight_m2[f->node_count] = weight;
    f->cosine[f->node_count++] = v_dot(model->normal[i], site->normal);
  }
  SONDE_ASSERT(next_held == f->held_count);
  // Edges lead from a held node to a free one.
  for (uint32_t h = 0; h < f->held_count; ++h) {
    uint32_t i = f->held[h];
    for (uint32_t k = t->start[i]; k < t->start[i + 1]; ++k) {
      uint32_t j = t->neighbour[k], e = t->neighbour_edge[k];
      if (is_held[j]) continue;
      sonde_vec3 out = v_sub(model->surface.vertices[j], model->surface.vertices[i]);
      f->edge[f->edge_count] = e;
      f->rest_m[f->edge_count] = model->edge_rest_m[e];
      f->rise_m[f->edge_count++] = v_dot(out, site->normal);
    }
  }
  SONDE_ASSERT(f->edge_count <= edges);
  f->node = shrink(f->node, nodes, f->node_count, sizeof *f->node);
  f->weight_m2 = shrink(f->weight_m2, nodes, f->node_count, sizeof *f->weight_m2);
  f->cosine = shrink(f->cosine, nodes, f->node_count, sizeof *f->cosine);
  f->held = shrink(f->held, nodes, f->held_count, sizeof *f->held);
  f->edge = shrink(f->edge, edges, f->edge_count, sizeof *f->edge);
  f->rest_m = shrink(f->rest_m, edges, f->edge_count, sizeof *f->rest_m);
  f->rise_m = shrink(f->rise_m, edges, f->edge_count, sizeof *f->rise_m);
done:
  sonde_free(is_held);
  if (status) sonde_footprint_clear(f);
  return status;
}

sonde_status sonde_footprint_area(const sonde_model *model, const sonde_site *site, double half_u_m,
                                  double half_v_m, double *area_m2, sonde_error *error) {
  double *covered_m2 = SONDE_NEW(double, model->surface.vertex_count);
  if (!covered_m2) return sonde_fail_memory(error);
  sonde_mesh_footprint(&model->surface, site->position_m, site->normal, site->u, site->v, half_u_m,
                       half_v_m, REACH_M, covered_m2);
  *area_m2 = 0;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) *area_m2 += covered_m2[i];
  sonde_free(covered_m2);
  return SONDE_OK;
}

void sonde_footprint_clear(sonde_footprint *f) {
  sonde_free(f->node);
  sonde_free(f->weight_m2);
  sonde_free(f->cosine);
  sonde_free(f->held);
  sonde_free(f->edge);
  sonde_free(f->rest_m);
  sonde_free(f->rise_m);
  *f = (sonde_footprint){0};
}

void sonde_footprint_edges(const sonde_footprint *f, double x, double compression,
                           double *per_stiffness_m, double *per_tension) {
  SONDE_ASSERT(x >= 0 && compression >= 0 && compression <= 1);
  double stretch_sum = 0.0, direction_sum = 0.0;
  for (uint32_t e = 0; e < f->edge_count; ++e) {
    double rest = f->rest_m[e], rise = f->rise_m[e];
    double length = fmax(sqrt(rest * rest + 2.0 * rise * x + x * x), SHORTEST * rest);
    double direction = (x + rise) / length, stretch = length - rest;
    direction_sum += direction;
    stretch_sum += (stretch < 0 ? compression : 1.0) * stretch * direction;
  }
  *per_stiffness_m = stretch_sum;
  *per_tension = direction_sum;
}

double sonde_footprint_force(const sonde_footprint *f, const sonde_model *model, double x) {
  const sonde_surface_law *law = &model->law;
  double force = 0.0, per_stiffness, per_tension;
  for (uint32_t k = 0; k < f->node_count; ++k) {
    uint32_t i = f->node[k];
    double pressure = sonde_normal_pressure(law->normal_exponent, model->k0_n_m3[i], model->xm_m[i],
                                            law->guard, x * f->cosine[k], NULL);
    force += f->weight_m2[k] * f->cosine[k] * pressure;
  }
  sonde_footprint_edges(f, x, law->edge_compression, &per_stiffness, &per_tension);
  return force + law->edge_stiffness_n_m * per_stiffness + law->edge_pretension_n * per_tension;
}
