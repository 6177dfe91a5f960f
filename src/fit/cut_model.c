// The full model on the skin cut along a footprint: same law, same fields.
#include "base/maths.h"
#include "fit/cut.h"
#include "tissue/model.h"

static double between(const double *field, const uint32_t parent[3], const double share[3]) {
  double sum = 0;
  for (int k = 0; k < 3; ++k) sum += share[k] * log(field[parent[k]]);
  return exp(sum);
}

static uint32_t nearest_parent(const sonde_cut *cut, uint32_t vertex) {
  int best = 0;
  for (int k = 1; k < 3; ++k)
    if (cut->share[vertex][k] > cut->share[vertex][best]) best = k;
  return cut->parent[vertex][best];
}

static void fill(const sonde_model *model, const sonde_cut *cut, sonde_model *to) {
  for (uint32_t v = 0; v < cut->vertex_count; ++v) {
    const uint32_t *parent = cut->parent[v];
    uint32_t near = nearest_parent(cut, v);
    to->normal[v] = sonde_cut_normal(model, cut, v);
    to->k0_n_m3[v] = between(model->k0_n_m3, parent, cut->share[v]);
    to->xm_m[v] = between(model->xm_m, parent, cut->share[v]);
    to->shear_share[v] = between(model->shear_share, parent, cut->share[v]);
    to->limit_share[v] = between(model->limit_share, parent, cut->share[v]);
    to->fat_depth_m[v] = model->fat_depth_m[near];
    to->muscle_depth_m[v] = model->muscle_depth_m[near];
    to->bone_depth_m[v] = model->bone_depth_m[near];
  }
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
  if (!status) {
    fill(model, cut, to);
    return SONDE_OK;
  }
  sonde_model_destroy(to);
  *cut_model = NULL;
  return status;
}
