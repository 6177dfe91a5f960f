// A volumetric model from a skin and a bone: the mesh between them, and the model on its boundary.
#include "tissue/bulk/bulk.h"

#include "base/base.h"
#include "base/maths.h"
#include "geometry/internal.h"

#include <string.h>

// A bone that ends at the skin's cut ends, or passes through them, is shortened along itself until
// it lies inside the skin by `margin`.
static sonde_status shorten_bone(const sonde_mesh *skin, double margin, sonde_mesh *bone,
                                 sonde_error *error) {
  sonde_surface_index *index = NULL;
  sonde_status status = sonde_surface_index_create(skin, &index, error);
  sonde_vec3 first = bone->vertices[0], last = first;
  for (int pass = 0; pass < 2; ++pass) // the farthest from any point, and from that one
    for (uint32_t i = 0; i < bone->vertex_count; ++i) {
      sonde_vec3 from = pass == 0 ? bone->vertices[0] : first, *to = pass == 0 ? &first : &last;
      if (v_distance(bone->vertices[i], from) > v_distance(*to, from)) *to = bone->vertices[i];
    }
  sonde_vec3 middle = v_lerp(first, last, 0.5);
  sonde_vec3 axis = v_unit(v_sub(last, first), vec3(0, 0, 1));
  double length = v_distance(first, last), keep = length;
  for (uint32_t i = 0; !status && i < bone->vertex_count; ++i) {
    double along = fabs(v_dot(v_sub(bone->vertices[i], middle), axis));
    double inside = -sonde_surface_signed_distance(index, bone->vertices[i]);
    if (inside < margin) keep = fmin(keep, 2 * (along - (margin - inside)));
  }
  sonde_surface_index_destroy(index);
  if (status) return status;
  if (!(keep > 0.5 * length))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "the bone is not inside the skin: less than half of it would be left");
  for (uint32_t i = 0; keep < length && i < bone->vertex_count; ++i) {
    double along = v_dot(v_sub(bone->vertices[i], middle), axis);
    bone->vertices[i] = v_madd(bone->vertices[i], along * (keep / length - 1), axis);
  }
  return SONDE_OK;
}

// depths: NULL, or a model that the layers' depths are taken from.
static sonde_status build(const sonde_model_def *given, const sonde_tetrahedra_def *mesh,
                          const sonde_model *depths, sonde_model_kind kind,
                          const sonde_bulk_law *law, sonde_model **out, double *worst_rad,
                          sonde_error *error) {
  sonde_tetrahedra solid = {0};
  sonde_tetrahedra_report quality = {0};
  sonde_mesh outer = {0}, inner = {0};
  sonde_surface_index *index = NULL;
  sonde_model *model = NULL;
  *out = NULL;
  if (!given->femur || given->femur->face_count == 0)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "a volumetric model needs a bone that holds it, and none was given");
  sonde_status status = sonde_mesh_copy(given->femur, &inner, error);
  if (!status) status = shorten_bone(given->skin, mesh->edge_m, &inner, error);
  if (!status) status = sonde_tetrahedralise(given->skin, &inner, mesh, &solid, error);
  if (!status && worst_rad) status = sonde_tetrahedra_inspect(&solid, NULL, NULL, &quality, error);
  if (!status)
    status = sonde_mesh_create(&outer, solid.surface_count, solid.outer_face_count, error);
  if (!status) {
    memcpy(outer.vertices, solid.node, solid.surface_count * sizeof *outer.vertices);
    memcpy(outer.faces, solid.boundary.faces, solid.outer_face_count * sizeof *outer.faces);
    sonde_model_def def = *given;
    def.skin = &outer;
    def.fine_edge_m = 10, def.fine_reach_m = 0; // the skin's mesh stays as it is
    status = sonde_model_build(&def, &model, error);
  }
  // Depths of the layers from those of the other skin, which is near.
  if (!status && depths) status = sonde_surface_index_create(&depths->surface, &index, error);
  for (uint32_t i = 0; !status && depths && i < model->surface.vertex_count; ++i) {
    sonde_surface_point at = sonde_surface_closest(index, model->surface.vertices[i]);
    const uint32_t *v = depths->surface.faces[at.face];
    model->fat_depth_m[i] = model->muscle_depth_m[i] = 0;
    for (int k = 0; k < 3; ++k) {
      model->fat_depth_m[i] += at.weight[k] * depths->fat_depth_m[v[k]];
      model->muscle_depth_m[i] += at.weight[k] * depths->muscle_depth_m[v[k]];
    }
  }
  sonde_surface_index_destroy(index);
  if (!status) status = sonde_model_fill(model, &solid, kind, law, error);
  if (worst_rad) *worst_rad = quality.smallest_dihedral_rad;
  sonde_tetrahedra_clear(&solid);
  sonde_mesh_clear(&outer);
  sonde_mesh_clear(&inner);
  if (status)
    sonde_model_destroy(model);
  else
    *out = model;
  return status;
}

sonde_status sonde_bulk_build(const sonde_model_def *def, const sonde_bulk_mesh *mesh,
                              const sonde_model *layers, sonde_model_kind kind,
                              const sonde_bulk_law *law, sonde_model **model, double *worst_rad,
                              sonde_error *error) {
  *model = NULL;
  sonde_vec3 *fine = SONDE_NEW(sonde_vec3, def->site_count);
  if (!fine) return sonde_fail_memory(error);
  for (uint32_t k = 0; k < def->site_count; ++k) fine[k] = def->sites[k].position_m;
  const sonde_tetrahedra_def tetrahedra = {.edge_m = mesh->edge_m,
                                           .growth = mesh->growth,
                                           .fine = fine,
                                           .fine_count = def->site_count,
                                           .fine_edge_m = mesh->fine_edge_m,
                                           .fine_reach_m = mesh->fine_reach_m};
  sonde_status status = build(def, &tetrahedra, layers, kind, law, model, worst_rad, error);
  sonde_free(fine);
  return status;
}

sonde_status sonde_bulk_refine_at(const sonde_model *model, sonde_vec3 place_m, sonde_model **local,
                                  sonde_error *error) {
  const sonde_tetrahedra_def tetrahedra = {.edge_m = 20e-3,
                                           .growth = 2,
                                           .fine = &place_m,
                                           .fine_count = 1,
                                           .fine_edge_m = 2e-3,
                                           .fine_reach_m = 3e-3};
  SONDE_ASSERT(model->bulk);
  sonde_model_def def = sonde_model_def_default();
  def.name = model->name, def.provenance = model->provenance;
  def.skin = &model->surface, def.femur = &model->femur;
  def.sites = model->sites, def.site_count = model->site_count;
  def.law = model->law;
  // A condensed solid is the linear one, whose matrix is sparse.
  sonde_model_kind kind = model->kind == SONDE_CONDENSED_SOLID ? SONDE_LINEAR_SOLID : model->kind;
  return build(&def, &tetrahedra, model, kind, &model->bulk->law, local, NULL, error);
}
