// The full model on the skin cut along a footprint: same law, same fields.
#include "base/maths.h"
#include "fit/cut.h"
#include "tissue/model.h"

static double between(const double *field, const uint32_t parent[3], const double share[3]) {
  double sum = 0;
  for (int k = 0; k < 3; ++k) sum += share[k] * log(field[parent[k]]);
  return exp(sum);
}

// The model's edge that the edge between two vertices is a part of; UINT32_MAX when it crosses a
// face.
static uint32_t edge_below(const sonde_model *model, const sonde_cut *cut, const uint32_t end[2]) {
  uint32_t node[2], count = 0;
  for (int v = 0; v < 2; ++v)
    for (int k = 0; k < 3; ++k) {
      uint32_t of = cut->parent[end[v]][k];
      if (!(cut->share[end[v]][k] > 0) || (count && of == node[0]) || (count > 1 && of == node[1]))
        continue;
      if (count == 2) return UINT32_MAX;
      node[count++] = of;
    }
  SONDE_ASSERT(count == 2);
  const sonde_topology *t = &model->topology;
  uint32_t k = t->start[node[0]];
  while (t->neighbour[k] != node[1]) ++k;
  SONDE_ASSERT(k < t->start[node[0] + 1]);
  return t->neighbour_edge[k];
}

sonde_status sonde_cut_model(const sonde_model *model, const sonde_cut *cut,
                             sonde_model **cut_model, sonde_error *error) {
  sonde_model *to = *cut_model = SONDE_NEW(sonde_model, 1);
  if (!to) return sonde_fail_memory(error);
  to->law = model->law;
  sonde_status status = sonde_mesh_create(&to->surface, cut->vertex_count, cut->face_count, error);
  for (uint32_t v = 0; v < cut->vertex_count && !status; ++v)
    to->surface.vertices[v] = sonde_cut_point(model, cut, v);
  for (uint32_t f = 0; f < cut->face_count && !status; ++f)
    for (int k = 0; k < 3; ++k) to->surface.faces[f][k] = cut->face[f][k];
  if (!status) status = sonde_model_allocate_nodes(to, error);
  if (!status) status = sonde_model_derive(to, error);
  if (!status && !(to->edge_share = SONDE_NEW(double, to->topology.edge_count)))
    status = sonde_fail_memory(error);
  if (status) {
    sonde_model_destroy(to);
    *cut_model = NULL;
    return status;
  }
  // Springs stay where they are: parts of one hang in series, so that each is as stiff as it is
  // short, and what the cut adds across faces carries none.
  for (uint32_t e = 0; e < to->topology.edge_count; ++e) {
    uint32_t of = edge_below(model, cut, to->topology.edges[e]);
    if (of == UINT32_MAX) continue;
    double whole = model->edge_share ? model->edge_share[of] : 1;
    to->edge_share[e] = whole * model->edge_rest_m[of] / to->edge_rest_m[e];
  }
  // Laws lie between the parents'; depths are the nearest parent's.
  for (uint32_t v = 0; v < cut->vertex_count; ++v) {
    const uint32_t *parent = cut->parent[v];
    const double *share = cut->share[v];
    uint32_t near = parent[0];
    double most = share[0];
    for (int k = 1; k < 3; ++k)
      if (share[k] > most) most = share[k], near = parent[k];
    to->normal[v] = sonde_cut_normal(model, cut, v);
    to->k0_n_m3[v] = between(model->k0_n_m3, parent, share);
    to->xm_m[v] = between(model->xm_m, parent, share);
    to->shear_share[v] = between(model->shear_share, parent, share);
    to->limit_share[v] = between(model->limit_share, parent, share);
    to->fat_depth_m[v] = model->fat_depth_m[near];
    to->muscle_depth_m[v] = model->muscle_depth_m[near];
    to->bone_depth_m[v] = model->bone_depth_m[near];
  }
  return SONDE_OK;
}
