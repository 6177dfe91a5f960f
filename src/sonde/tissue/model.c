// Building, changing and releasing the thigh model.
#include "tissue/model.h"
#include "sonde/tissue_anatomy.h"
#include "tissue/bulk/bulk.h"

#include "base/base.h"
#include "base/maths.h"
#include "base/morton.h"
#include "geometry/internal.h"

#include <string.h>

enum { DEFAULT_K0 = 180000 }; // N/m^3
static const double DEFAULT_XM_M = 0.05;
static const double FOOTPRINT_U_M = 0.030, FOOTPRINT_V_M = 0.006;

sonde_surface_law sonde_surface_law_default(void) {
  return (sonde_surface_law){.edge_stiffness_n_m = 50,
                             .edge_damping_s = 1e-3,
                             .edge_compression = 0.05,
                             .edge_pretension_n = 0,
                             .tangential_stiffness_n_m3 = 1e6,
                             .inplane_stiffness_n_m = 0,
                             .shear_stiffness_n_m = 0,
                             .shear_limit = 1.0,
                             .normal_exponent = 1,
                             .normal_damping_s = 0.02,
                             .surface_density_kg_m2 = 20,
                             .guard = 0.999};
}

sonde_model_def sonde_model_def_default(void) {
  return (sonde_model_def){.version = SONDE_DEF_VERSION,
                           .name = "thigh",
                           .provenance = "",
                           .fine_edge_m = 0.003,
                           .fine_reach_m = 0.015,
                           .law = sonde_surface_law_default()};
}

static sonde_status check_law(const sonde_surface_law *law, sonde_error *error) {
  const sonde_bounded range[] = {
      {"edge_stiffness_n_m", law->edge_stiffness_n_m, 0, 1e7},
      {"edge_damping_s", law->edge_damping_s, 0, 10},
      {"edge_compression", law->edge_compression, 0, 1},
      {"edge_pretension_n", law->edge_pretension_n, 0, 1e3},
      {"tangential_stiffness_n_m3", law->tangential_stiffness_n_m3, 0, 1e10},
      {"inplane_stiffness_n_m", law->inplane_stiffness_n_m, 0, 1e7},
      {"shear_stiffness_n_m", law->shear_stiffness_n_m, 0, 1e7},
      {"shear_limit", law->shear_limit, 1e-3, 1e3},
      {"normal_damping_s", law->normal_damping_s, 0, 100},
      {"surface_density_kg_m2", law->surface_density_kg_m2, 1e-3, 1e4},
      {"normal_exponent", law->normal_exponent, 1, 3},
      {"guard", law->guard, 0.5, 0.99999}};
  sonde_status status = sonde_bounded_check(range, SONDE_COUNT_OF(range), error);
  if (status) return status;
  if (law->normal_exponent != floor(law->normal_exponent))
    return sonde_fail(error, SONDE_ARGUMENT, "normal_exponent is %g, expected 1, 2 or 3",
                      law->normal_exponent);
  return SONDE_OK;
}

sonde_status sonde_model_allocate_nodes(sonde_model *model, sonde_error *error) {
  uint32_t n = model->surface.vertex_count;
  double **array[] = {&model->area_m2,      &model->mass_kg,     &model->k0_n_m3,
                      &model->xm_m,         &model->fat_depth_m, &model->muscle_depth_m,
                      &model->bone_depth_m, &model->shear_share, &model->limit_share};
  bool ok = true;
  for (size_t k = 0; k < SONDE_COUNT_OF(array); ++k)
    ok &= (*array[k] = SONDE_NEW(double, n)) != NULL;
  for (uint32_t i = 0; i < n && ok; ++i) model->shear_share[i] = model->limit_share[i] = 1;
  model->normal = SONDE_NEW(sonde_vec3, n);
  return ok && model->normal ? SONDE_OK : sonde_fail_memory(error);
}

// Topology, normals, areas and masses of the nodes, rest lengths of the edges; area, edges and half
// cotangents of the faces.
sonde_status sonde_model_derive(sonde_model *model, sonde_error *error) {
  const sonde_mesh *mesh = &model->surface;
  const sonde_vec3 *x = mesh->vertices;
  sonde_status status = check_law(&model->law, error);
  if (!status) status = sonde_topology_build(mesh, &model->topology, error);
  if (status) return status;
  uint32_t edges = model->topology.edge_count;
  model->edge_rest_m = SONDE_NEW(double, edges);
  model->face_area_m2 = SONDE_NEW(double, mesh->face_count);
  model->face_half_cotangent = sonde_calloc(mesh->face_count, sizeof *model->face_half_cotangent);
  model->face_edge = sonde_calloc(mesh->face_count, sizeof *model->face_edge);
  if (!model->edge_rest_m || !model->face_area_m2 || !model->face_half_cotangent ||
      !model->face_edge)
    return sonde_fail_memory(error);

  sonde_mesh_normals(mesh, model->normal);
  sonde_mesh_areas(mesh, model->area_m2);
  for (uint32_t i = 0; i < mesh->vertex_count; ++i)
    model->mass_kg[i] = model->law.surface_density_kg_m2 * model->area_m2[i];
  for (uint32_t e = 0; e < edges; ++e) {
    const uint32_t *pair = model->topology.edges[e];
    model->edge_rest_m[e] = v_distance(x[pair[0]], x[pair[1]]);
    if (!(model->edge_rest_m[e] > 1e-7))
      return sonde_fail(error, SONDE_MESH, "the skin has an edge of zero length at vertex %u",
                        pair[0]);
  }
  for (uint32_t f = 0; f < mesh->face_count; ++f) {
    const uint32_t *v = mesh->faces[f];
    model->face_area_m2[f] =
        0.5 * v_norm(v_cross(v_sub(x[v[1]], x[v[0]]), v_sub(x[v[2]], x[v[0]])));
    if (!(model->face_area_m2[f] > 0))
      return sonde_fail(error, SONDE_MESH, "face %u of the skin has no area", f);
    for (int k = 0; k < 3; ++k) {
      uint32_t a = v[(k + 1) % 3], b = v[(k + 2) % 3];
      sonde_vec3 to_a = v_sub(x[a], x[v[k]]), to_b = v_sub(x[b], x[v[k]]);
      double sine = v_norm(v_cross(to_a, to_b));
      model->face_half_cotangent[f][k] = sine > 0 ? 0.5 * v_dot(to_a, to_b) / sine : 0;
      model->face_edge[f][k] = sonde_topology_edge(&model->topology, a, b);
      SONDE_ASSERT(model->face_edge[f][k] != SONDE_NONE);
    }
  }
  return SONDE_OK;
}

static double outside(double value, double limit) {
  double excess = fabs(value) - limit;
  return excess > 0 ? excess : 0;
}

// Edges become fine within fine_reach_m of a site's largest footprint.
static double target_edge(sonde_vec3 point, void *user) {
  const sonde_model_def *def = user;
  for (uint32_t k = 0; k < def->site_count; ++k) {
    const sonde_site *site = &def->sites[k];
    sonde_vec3 d = v_sub(point, site->position_m);
    double du = outside(v_dot(d, site->u), FOOTPRINT_U_M);
    double dv = outside(v_dot(d, site->v), FOOTPRINT_V_M);
    double dn = outside(v_dot(d, site->normal), 0.02);
    if (du * du + dv * dv + dn * dn <= def->fine_reach_m * def->fine_reach_m)
      return def->fine_edge_m;
  }
  return 1e9;
}

// Numbers the vertices along a space-filling curve, so that neighbours lie together in memory.
static sonde_status order_vertices(sonde_mesh *mesh, sonde_error *error) {
  uint32_t n = mesh->vertex_count;
  sonde_keyed *list = SONDE_NEW(sonde_keyed, n);
  uint32_t *rank = SONDE_NEW(uint32_t, n);
  sonde_vec3 *old = SONDE_NEW(sonde_vec3, n);
  sonde_status status = list && rank && old ? SONDE_OK : sonde_fail_memory(error);
  if (status) goto done;
  for (uint32_t i = 0; i < n; ++i) list[i] = (sonde_keyed){sonde_morton_key(mesh->vertices[i]), i};
  qsort(list, n, sizeof *list, sonde_keyed_compare);
  memcpy(old, mesh->vertices, n * sizeof *old);
  for (uint32_t k = 0; k < n; ++k) {
    rank[list[k].index] = k;
    mesh->vertices[k] = old[list[k].index];
  }
  for (uint32_t f = 0; f < mesh->face_count; ++f)
    for (int k = 0; k < 3; ++k) mesh->faces[f][k] = rank[mesh->faces[f][k]];
done:
  sonde_free(list);
  sonde_free(rank);
  sonde_free(old);
  return status;
}

static sonde_status fill(sonde_model *model, const sonde_model_def *def, sonde_error *error) {
  snprintf(model->name, sizeof model->name, "%s", def->name ? def->name : "thigh");
  snprintf(model->provenance, sizeof model->provenance, "%s",
           def->provenance ? def->provenance : "");
  model->law = def->law;
  sonde_mesh_report report;
  sonde_status status = sonde_mesh_inspect(def->skin, &report, error);
  if (status) return status;
  if (!report.closed)
    return sonde_fail(error, SONDE_MESH, "the skin is not closed: %u open edges",
                      report.boundary_edges);
  if (!report.outward)
    return sonde_fail(error, SONDE_MESH, "the skin's faces point inward, expected outward");
  if (report.duplicate_or_degenerate_faces)
    return sonde_fail(error, SONDE_MESH, "the skin has %u duplicate or degenerate faces",
                      report.duplicate_or_degenerate_faces);

  // sites, those without a fit with the default parameters, and their measurements
  model->sites = SONDE_NEW(sonde_site, def->site_count);
  model->data = SONDE_NEW(sonde_datum, def->datum_count);
  if (!model->sites || !model->data) return sonde_fail_memory(error);
  model->site_count = def->site_count;
  model->datum_count = def->datum_count;
  for (uint32_t k = 0; k < def->site_count; ++k) {
    model->sites[k] = def->sites[k];
    if (model->sites[k].k0_n_m3 > 0) continue;
    model->sites[k].k0_n_m3 = DEFAULT_K0;
    model->sites[k].xm_m = DEFAULT_XM_M;
  }
  if (def->datum_count) memcpy(model->data, def->data, def->datum_count * sizeof *model->data);

  // refined skin, what follows from it, bone, layers, springs, vessels
  status =
      sonde_mesh_refine(def->skin, target_edge, (void *)(uintptr_t)def, &model->surface, error);
  if (!status) status = order_vertices(&model->surface, error);
  if (!status) status = sonde_model_allocate_nodes(model, error);
  if (!status) status = sonde_model_derive(model, error);
  if (!status)
    status = def->femur ? sonde_mesh_copy(def->femur, &model->femur, error)
                        : sonde_model_place_rod(model, error);
  if (!status)
    status = sonde_model_measure_layers(model, def->fat_interface, def->muscle_interface, error);
  if (!status) status = sonde_model_interpolate(model, error);
  if (!status && model->femur.vertex_count)
    status = sonde_model_place_vessels(model, def->femur == NULL, error);
  return status;
}

sonde_status sonde_model_build(const sonde_model_def *def, sonde_model **out, sonde_error *error) {
  SONDE_ASSERT(def && out);
  *out = NULL;
  sonde_status status = sonde_def_check("model", def->version, error);
  if (status) return status;
  if (!def->skin || !def->sites || def->site_count == 0)
    return sonde_fail(error, SONDE_ARGUMENT, "a model needs a skin and at least one site");
  if (!(def->fine_edge_m > 1e-4) || !(def->fine_reach_m >= 0))
    return sonde_fail(error, SONDE_ARGUMENT, "fine_edge_m is %g, expected more than 0.1 mm",
                      def->fine_edge_m);
  sonde_model *model = SONDE_NEW(sonde_model, 1);
  if (!model) return sonde_fail_memory(error);
  status = fill(model, def, error);
  if (status)
    sonde_model_destroy(model);
  else
    *out = model;
  return status;
}

sonde_status sonde_model_set_parameters(sonde_model *model, const sonde_surface_law *law,
                                        const sonde_site *sites, uint32_t count,
                                        sonde_error *error) {
  SONDE_ASSERT(model && law && sites);
  if (count != model->site_count)
    return sonde_fail(error, SONDE_ARGUMENT, "%u sites given, expected %u", count,
                      model->site_count);
  sonde_status status = check_law(law, error);
  if (status) return status;
  model->law = *law;
  memcpy(model->sites, sites, count * sizeof *sites);
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i)
    model->mass_kg[i] = law->surface_density_kg_m2 * model->area_m2[i];
  return sonde_model_interpolate(model, error);
}

void sonde_model_destroy(sonde_model *model) {
  if (!model) return;
  void *arrays[] = {
      model->normal,      model->area_m2,     model->mass_kg,      model->k0_n_m3,
      model->xm_m,        model->fat_depth_m, model->bone_depth_m, model->muscle_depth_m,
      model->edge_rest_m, model->edge_share,  model->face_area_m2, model->face_half_cotangent,
      model->face_edge,   model->sites,       model->data,         model->anatomy,
      model->shear_share, model->limit_share, model->bone_axis_m,  model->map_origin};
  for (size_t k = 0; k < SONDE_COUNT_OF(arrays); ++k) sonde_free(arrays[k]);
  if (model->map) model->map->destroy(model->map);
  sonde_bulk_destroy(model->bulk);
  sonde_topology_clear(&model->topology);
  sonde_mesh_clear(&model->surface);
  sonde_mesh_clear(&model->femur);
  sonde_free(model);
}

const sonde_site *sonde_model_site(const sonde_model *model, uint32_t id) {
  SONDE_ASSERT(model != NULL);
  for (uint32_t k = 0; k < model->site_count; ++k)
    if (model->sites[k].id == id) return &model->sites[k];
  return NULL;
}
