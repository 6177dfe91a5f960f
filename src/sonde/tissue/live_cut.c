// A cut through the skin: a new model in which the nodes that the cut runs through are split, with
// a copy for each group of faces that hang together beside it (docs/cutting.md).
#include "tissue/live_cut.h"
#include "base/base.h"
#include "base/maths.h"
#include "geometry/internal.h"
#include "sonde/tissue_anatomy.h"
#include "tissue/model.h"

#include <string.h>

typedef struct splitter {
  const sonde_model *model;
  const sonde_copies *copies;
  uint8_t *is_cut;      // [edges]
  uint32_t *group;      // [faces of a node] the group's first face
  uint32_t (*faces)[3]; // [faces] of the new skin
  sonde_cut_map *map;
} splitter;

static uint32_t index_of(const uint32_t *list, uint32_t count, uint32_t value) {
  uint32_t k = 0;
  while (k < count && list[k] != value) ++k;
  SONDE_ASSERT(k < count);
  return k;
}

// A copy of the node for every group of its faces but the first.
static void split_node(splitter *s, uint32_t node) {
  const sonde_topology *t = &s->model->topology;
  const uint32_t *list = t->face_list + t->face_start[node];
  uint32_t count = t->face_start[node + 1] - t->face_start[node], *group = s->group;

  // Faces that share an edge which stays whole form a group.
  for (uint32_t k = 0; k < count; ++k) group[k] = k;
  for (uint32_t k = t->start[node]; k < t->start[node + 1]; ++k) {
    uint32_t e = t->neighbour_edge[k];
    if (s->is_cut[e] || t->edge_faces[e][1] == SONDE_NONE) continue;
    uint32_t a = group[index_of(list, count, t->edge_faces[e][0])];
    uint32_t b = group[index_of(list, count, t->edge_faces[e][1])];
    uint32_t low = a < b ? a : b, high = a < b ? b : a;
    for (uint32_t i = 0; i < count; ++i)
      if (group[i] == high) group[i] = low;
  }

  for (uint32_t first = 1; first < count; ++first) {
    if (group[first] != first) continue;
    uint32_t copy = s->map->node_count + s->map->added;
    s->map->origin[s->map->added++] = node;
    for (uint32_t k = first; k < count; ++k) {
      if (group[k] != first) continue;
      uint32_t *corner = s->faces[list[k]];
      corner[index_of(s->model->surface.faces[list[k]], 3, node)] = copy;
    }
  }
}

// New corners into faces[], copies into the map.
static sonde_status split_skin(const sonde_model *model, const sonde_copies *copies,
                               const sonde_cut_path *path, uint32_t (*faces)[3], sonde_cut_map *map,
                               sonde_error *error) {
  SONDE_ASSERT(path->count >= 3);
  const sonde_topology *t = &model->topology;
  const sonde_vec3 *x = model->surface.vertices;
  uint32_t most = 0, room = 0; // most faces around one node of the path; around all
  for (uint32_t k = 0; k < path->count; ++k)
    for (uint32_t i = path->node[k]; i != SONDE_NONE; i = copies->next[i]) {
      uint32_t count = t->face_start[i + 1] - t->face_start[i];
      room += count;
      if (count > most) most = count;
    }
  splitter s = {model, copies, SONDE_NEW(uint8_t, t->edge_count), SONDE_NEW(uint32_t, most),
                faces, map};
  map->origin = SONDE_NEW(uint32_t, room);
  map->path = SONDE_NEW(uint32_t, path->count);
  sonde_status status = SONDE_OK;
  if (s.is_cut && s.group && map->origin && map->path) {
    map->node_count = model->surface.vertex_count;
    map->path_count = path->count;
    map->closed = path->closed;
    map->work = path->work;
    memcpy(map->path, path->node, path->count * sizeof *path->node);
    memcpy(faces, model->surface.faces, model->surface.face_count * sizeof *faces);

    // Edges between any copies of two nodes are cut; one with a single face is cut already.
    for (uint32_t k = 0; k + !path->closed < path->count; ++k) {
      uint32_t from = path->node[k], to = path->node[(k + 1) % path->count];
      map->length_m += v_distance(x[from], x[to]);
      for (uint32_t i = from; i != SONDE_NONE; i = copies->next[i])
        for (uint32_t j = to; j != SONDE_NONE; j = copies->next[j]) {
          uint32_t e = sonde_topology_edge(t, i, j);
          if (e == SONDE_NONE || t->edge_faces[e][1] == SONDE_NONE) continue;
          s.is_cut[e] = 1;
          map->split_edges++;
        }
    }
    for (uint32_t k = 0; k < path->count; ++k)
      for (uint32_t i = path->node[k]; i != SONDE_NONE; i = copies->next[i]) split_node(&s, i);
    SONDE_ASSERT(map->added <= room);
    if (!map->added)
      status = sonde_fail(error, SONDE_ARGUMENT,
                          "the cut opens nothing: its path follows an earlier cut");
  } else {
    status = sonde_fail_memory(error);
  }
  sonde_free(s.is_cut);
  sonde_free(s.group);
  return status;
}

/* ---- the new model ------------------------------------------------------------------------ */

static void copy_field(const sonde_cut_map *map, const double *from, double *to) {
  memcpy(to, from, map->node_count * sizeof *to);
  for (uint32_t k = 0; k < map->added; ++k) to[map->node_count + k] = from[map->origin[k]];
}

static void copy_vectors(const sonde_cut_map *map, const sonde_vec3 *from, sonde_vec3 *to) {
  memcpy(to, from, map->node_count * sizeof *to);
  for (uint32_t k = 0; k < map->added; ++k) to[map->node_count + k] = from[map->origin[k]];
}

static uint32_t origin_of(const sonde_cut_map *map, uint32_t node) {
  return node < map->node_count ? node : map->origin[node - map->node_count];
}

static uint32_t faces_beside(const sonde_topology *t, uint32_t e) {
  return t->edge_faces[e][1] == SONDE_NONE ? 1 : 2;
}

// Vertices, fields and springs of the new model; takes over the faces.
static sonde_status fill(const sonde_model *model, const sonde_cut_map *map, uint32_t (*faces)[3],
                         sonde_model *cut, sonde_error *error) {
  SONDE_ASSERT(map->added > 0);
  sonde_mesh *skin = &cut->surface;
  skin->faces = faces;
  skin->face_count = model->surface.face_count;
  skin->vertices = SONDE_NEW(sonde_vec3, map->node_count + (size_t)map->added);
  if (!skin->vertices) return sonde_fail_memory(error);
  skin->vertex_count = map->node_count + map->added;
  copy_vectors(map, model->surface.vertices, skin->vertices);
  sonde_status status = sonde_model_allocate_nodes(cut, error);
  if (status) return status;

  // What a cut leaves as it is: names, law, sites, data, vessels, anatomy, bone.
  memcpy(cut->name, model->name, sizeof cut->name);
  memcpy(cut->provenance, model->provenance, sizeof cut->provenance);
  cut->law = model->law;
  cut->vein = model->vein;
  cut->artery = model->artery;
  if (model->anatomy) {
    cut->anatomy = SONDE_NEW(sonde_thigh_anatomy, 1);
    if (!cut->anatomy) return sonde_fail_memory(error);
    *cut->anatomy = *model->anatomy;
  }
  cut->sites = SONDE_NEW(sonde_site, model->site_count);
  cut->data = SONDE_NEW(sonde_datum, model->datum_count);
  if (!cut->sites || !cut->data) return sonde_fail_memory(error);
  cut->site_count = model->site_count;
  cut->datum_count = model->datum_count;
  if (model->site_count) memcpy(cut->sites, model->sites, model->site_count * sizeof *cut->sites);
  if (model->datum_count) memcpy(cut->data, model->data, model->datum_count * sizeof *cut->data);
  status = sonde_mesh_copy(&model->femur, &cut->femur, error);
  if (!status) status = sonde_model_derive(cut, error);
  if (status) return status;

  copy_vectors(map, model->normal, cut->normal); // those of the whole skin
  copy_field(map, model->k0_n_m3, cut->k0_n_m3);
  copy_field(map, model->xm_m, cut->xm_m);
  copy_field(map, model->shear_share, cut->shear_share);
  copy_field(map, model->limit_share, cut->limit_share);
  copy_field(map, model->fat_depth_m, cut->fat_depth_m);
  copy_field(map, model->muscle_depth_m, cut->muscle_depth_m);
  copy_field(map, model->bone_depth_m, cut->bone_depth_m);

  // A spring belongs half to each face beside it: an edge with as many faces as before keeps all of
  // it, one that is left with one of two faces keeps half.
  const sonde_topology *now = &cut->topology, *was = &model->topology;
  cut->edge_share = SONDE_NEW(double, now->edge_count);
  if (!cut->edge_share) return sonde_fail_memory(error);
  for (uint32_t e = 0; e < now->edge_count; ++e) {
    uint32_t a = origin_of(map, now->edges[e][0]), b = origin_of(map, now->edges[e][1]);
    uint32_t old = sonde_topology_edge(was, a, b);
    SONDE_ASSERT(old != SONDE_NONE);
    double share = model->edge_share ? model->edge_share[old] : 1;
    cut->edge_share[e] = share * faces_beside(now, e) / faces_beside(was, old);
    SONDE_ASSERT(cut->edge_share[e] > 0 && cut->edge_share[e] <= 1);
  }
  return SONDE_OK;
}

sonde_status sonde_model_cut(const sonde_model *model, const sonde_vec3 *position_m,
                             const sonde_vec3 *path_m, uint32_t count, sonde_model **out,
                             sonde_cut_map *map, sonde_error *error) {
  SONDE_ASSERT(model && path_m && out);
  *out = NULL;
  if (model->bulk)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "a volumetric model cannot be cut, expected a two-layer one");
  sonde_cut_map own = {0};
  sonde_copies copies = {0};
  sonde_cut_path path = {0};
  const sonde_vec3 *position = position_m ? position_m : model->surface.vertices;
  sonde_model *cut = SONDE_NEW(sonde_model, 1);
  uint32_t(*faces)[3] = sonde_calloc(model->surface.face_count, sizeof *faces);
  sonde_status status = cut && faces ? SONDE_OK : sonde_fail_memory(error);
  if (!status) status = sonde_copies_find(model, &copies, error);
  if (!status) status = sonde_cut_path_find(model, &copies, position, path_m, count, &path, error);
  if (!status) status = split_skin(model, &copies, &path, faces, &own, error);
  if (!status) {
    status = fill(model, &own, faces, cut, error);
    faces = NULL;
  }
  sonde_free(faces);
  sonde_free(path.node);
  sonde_copies_clear(&copies);
  if (map) *map = (sonde_cut_map){0};
  if (status || !map)
    sonde_cut_map_clear(&own);
  else
    *map = own;
  if (status)
    sonde_model_destroy(cut);
  else
    *out = cut;
  return status;
}

void sonde_cut_map_clear(sonde_cut_map *map) {
  sonde_free(map->origin);
  sonde_free(map->path);
  *map = (sonde_cut_map){0};
}
