// Elastic energy of a volumetric body, one spring and one tetrahedron after the other.
#define SONDE_REAL_SCALAR
#include "elements/material.h"
#include "tissue/bulk/bulk.h"
#include "tissue/laws.h"
#include "tissue/nodes.h"

#include "base/base.h"
#include "base/maths.h"

double sonde_bulk_graph_energy(const sonde_model *model, const sonde_bulk_graph *graph,
                               const sonde_vec3 *position) {
  const sonde_bulk *bulk = model->bulk;
  uint32_t n = sonde_model_nodes(model).count;
  SONDE_ASSERT(n > 0 && graph->start != NULL);
  double energy = 0;
  // Both moving ends of a spring name it, of a spring to the bone one.
  for (uint32_t i = 0; graph->spring && i < n; ++i)
    for (uint32_t k = graph->start[i]; k < graph->start[i + 1]; ++k) {
      uint32_t j = graph->neighbour[k];
      const sonde_bulk_spring *spring = &graph->spring[k];
      double rest = v_distance(bulk->node[i], bulk->node[j]);
      double length = v_distance(position[i], j < n ? position[j] : bulk->node[j]);
      const biphasic_law law = {spring->stiffness_n_m, spring->steep_n_m, spring->knee * rest};
      energy += (j < n ? 0.5 : 1) * biphasic_energy(&law, rest, length);
    }
  // Of a constant stiffness u.K u/2; nodes on the bone do not move.
  for (uint32_t i = 0; graph->block && i < n; ++i) {
    sonde_vec3 u = v_sub(position[i], bulk->node[i]), f = m_mul_v(graph->own[i], u);
    for (uint32_t k = graph->start[i]; k < graph->start[i + 1]; ++k) {
      uint32_t j = graph->neighbour[k];
      if (j < n) f = v_add(f, m_mul_v(graph->block[k], v_sub(position[j], bulk->node[j])));
    }
    energy += 0.5 * v_dot(u, f);
  }
  uint32_t elements = sonde_bulk_is_solid(model) ? bulk->element_count : 0;
  for (uint32_t e = 0; e < elements; ++e) {
    const uint32_t *v = bulk->element[e];
    sonde_vec3 gradient[4];
    double volume = sonde_bulk_gradients(bulk, e, gradient), mu, lambda;
    double f[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    sonde_bulk_solid(model, e, &mu, &lambda);
    for (int c = 0; c < 4; ++c) {
      if (v[c] >= n) continue;
      sonde_vec3 u = v_sub(position[v[c]], bulk->node[v[c]]);
      const double move[3] = {u.x, u.y, u.z};
      const double slope[3] = {gradient[c].x, gradient[c].y, gradient[c].z};
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) f[3 * i + j] += move[i] * slope[j];
    }
    energy += volume * material_energy(SONDE_NEO_HOOKEAN, mu, lambda, f);
  }
  return energy;
}
