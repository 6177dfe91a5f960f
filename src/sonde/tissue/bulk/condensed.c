// A linear solid seen from its skin: K* = K_ss - K_si K_ii^-1 K_is as stiffness between all nodes
// of the skin.
#include "tissue/bulk/bulk.h"

#include "base/base.h"
#include "base/maths.h"
#include "elements/condense.h"
#include "geometry/internal.h"

#include <string.h>

enum { MOST_SKIN = 2500 };

sonde_status sonde_bulk_elastic_create(const sonde_model *model, sonde_bulk_elastic *out,
                                       sonde_error *error) {
  const sonde_bulk *bulk = model->bulk;
  uint32_t skin = model->surface.vertex_count, all = bulk->node_count + bulk->held_count;
  *out = (sonde_bulk_elastic){.mesh = {.node_count = all,
                                       .count = bulk->element_count,
                                       .surface_count = skin,
                                       .node = bulk->node,
                                       .corner = bulk->element}};
  if (skin > MOST_SKIN)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "the skin has %u nodes, expected at most %d: K* would take %.1f GB", skin,
                      MOST_SKIN, 72e-9 * skin * skin);
  SONDE_ASSERT(bulk->node_count >= skin);
  uint8_t *held = SONDE_NEW(uint8_t, all);
  uint32_t *last = SONDE_NEW(uint32_t, skin);
  double *young = SONDE_NEW(double, bulk->element_count);
  sonde_status status = held && last && young ? SONDE_OK : sonde_fail_memory(error);
  if (!status) {
    memset(held + bulk->node_count, 7, bulk->held_count);
    for (uint32_t i = 0; i < skin; ++i) last[i] = i;
    for (uint32_t e = 0; e < bulk->element_count; ++e)
      young[e] = bulk->law.stiffness_scale * bulk->law.young_pa[bulk->layer[e]];
    const sonde_elastic_def def = {&out->mesh, held, last, skin, SONDE_DILATATION_ELEMENT};
    status = sonde_elastic_create(&def, &out->elastic, error);
  }
  if (!status) status = sonde_elastic_set(out->elastic, young, bulk->law.poisson, 0, error);
  if (status) sonde_elastic_destroy(out->elastic), out->elastic = NULL;
  sonde_free(held);
  sonde_free(last);
  sonde_free(young);
  return status;
}

sonde_status sonde_bulk_condense(const sonde_model *model, sonde_bulk_graph *graph,
                                 sonde_error *error) {
  uint32_t skin = model->surface.vertex_count;
  sonde_bulk_elastic solid;
  sonde_condensed *c = NULL;
  sonde_status status = sonde_bulk_elastic_create(model, &solid, error);
  if (status) return status;
  // From here on K* and its inverse are all that is needed.
  size_t side = 3 * (size_t)skin;
  status = sonde_condensed_create(solid.elastic, 0, &c, NULL, error);
  sonde_elastic_destroy(solid.elastic);
  if (!status) graph->compliance = SONDE_NEW(double, side *side);
  if (!status && !graph->compliance) status = sonde_fail_memory(error);
  if (status) {
    sonde_condensed_destroy(c);
    return status;
  }
  for (uint32_t a = 0; a < skin; ++a)
    for (uint32_t b = 0; b < skin; ++b) {
      uint32_t i = c->node[a], j = c->node[b];
      SONDE_ASSERT(i < skin && j < skin);
      sonde_mat3 *to = i == j ? &graph->own[i] : &graph->block[graph->start[i] + j - (j > i)];
      for (size_t r = 0; r < 3; ++r) {
        memcpy(to->m[r], c->stiffness + (3 * a + r) * side + 3 * b, sizeof to->m[r]);
        memcpy(graph->compliance + (3 * i + r) * side + 3 * j,
               c->compliance + (3 * a + r) * side + 3 * b, sizeof to->m[r]);
      }
    }
  sonde_condensed_destroy(c);
  return SONDE_OK;
}

// Inner nodes do not move by themselves: the skin carries their masses, each on the face that is
// nearest, and every node of it has all others as neighbours.
sonde_status sonde_bulk_derive_skin(sonde_bulk *bulk, const sonde_model *model,
                                    sonde_error *error) {
  uint32_t skin = model->surface.vertex_count;
  sonde_surface_index *index = NULL;
  sonde_status status = sonde_surface_index_create(&model->surface, &index, error);
  for (uint32_t i = skin; i < bulk->node_count && !status; ++i) {
    sonde_surface_point at = sonde_surface_closest(index, bulk->node[i]);
    const uint32_t *v = model->surface.faces[at.face];
    for (int k = 0; k < 3; ++k) bulk->mass_kg[v[k]] += at.weight[k] * bulk->mass_kg[i];
    bulk->mass_kg[i] = 0;
  }
  sonde_surface_index_destroy(index);
  if (status) return status;
  bulk->start = SONDE_NEW(uint32_t, (size_t)bulk->node_count + 1);
  bulk->neighbour = SONDE_NEW(uint32_t, (size_t)skin * (skin - 1));
  if (!bulk->start || !bulk->neighbour) return sonde_fail_memory(error);
  for (uint32_t i = 0; i < bulk->node_count; ++i) {
    bulk->start[i + 1] = bulk->start[i] + (i < skin ? skin - 1 : 0);
    for (uint32_t k = 0; i < skin && k + 1 < skin; ++k)
      bulk->neighbour[bulk->start[i] + k] = k + (k >= i);
  }
  return SONDE_OK;
}
