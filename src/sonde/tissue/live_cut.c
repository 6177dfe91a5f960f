// A cut through the skin: a new model in which the nodes on the way are split (docs/cutting.md).
// mark_edges:    the edges that the way runs along.
// group_faces:   the faces around a node, joined across edges that stay whole.
// split_node:    a copy of the node for every group but the first.
// split_way:     all nodes on the way, in order.
// make_surface:  vertices with their copies.
// copy_nodes:    fields of the nodes, copies from where they were split.
// share_edges:   a spring belongs half to each face beside it.
// fill:          the new model from the old one.
#include "base/base.h"
#include "base/maths.h"
#include "tissue/live_cut.h"
#include "sonde/tissue_anatomy.h"
#include "tissue/model.h"

#include <string.h>

enum { NOWHERE = UINT32_MAX };

typedef struct splitter {
  const sonde_model *model;
  const sonde_places *places;
  uint8_t *is_cut;      // [edges]
  uint32_t *group;      // [faces of a node] the group's first face
  uint32_t (*faces)[3]; // [faces] of the new skin
  sonde_cut_map *map;
} splitter;

static uint32_t find_edge(const sonde_topology *t, uint32_t a, uint32_t b) {
  for (uint32_t k = t->start[a]; k < t->start[a + 1]; ++k)
    if (t->neighbour[k] == b) return t->neighbour_edge[k];
  return NOWHERE;
}

// Edges between any nodes of two places; one with a single face is cut already.
static void mark_between(splitter *s, uint32_t from, uint32_t to) {
  const sonde_topology *t = &s->model->topology;
  for (uint32_t i = from; i != NOWHERE; i = s->places->next[i])
    for (uint32_t j = to; j != NOWHERE; j = s->places->next[j]) {
      uint32_t e = find_edge(t, i, j);
      if (e == NOWHERE || t->edge_faces[e][1] == NOWHERE) continue;
      s->is_cut[e] = 1;
      s->map->split_edges++;
    }
}

static void mark_edges(splitter *s, const sonde_way *way) {
  SONDE_ASSERT(way->count >= 3);
  const sonde_vec3 *x = s->model->surface.vertices;
  for (uint32_t k = 0; k + !way->closed < way->count; ++k) {
    uint32_t from = way->place[k], to = way->place[(k + 1) % way->count];
    mark_between(s, from, to);
    s->map->length_m += v_distance(x[from], x[to]);
  }
}

static uint32_t index_of(const uint32_t *list, uint32_t count, uint32_t value) {
  uint32_t k = 0;
  while (k < count && list[k] != value) ++k;
  SONDE_ASSERT(k < count);
  return k;
}

static void join_groups(uint32_t *group, uint32_t count, uint32_t a, uint32_t b) {
  uint32_t low = a < b ? a : b, high = a < b ? b : a;
  for (uint32_t k = 0; k < count; ++k)
    if (group[k] == high) group[k] = low;
}

static void group_faces(splitter *s, uint32_t node) {
  const sonde_topology *t = &s->model->topology;
  const uint32_t *list = t->face_list + t->face_start[node];
  uint32_t count = t->face_start[node + 1] - t->face_start[node];
  for (uint32_t k = 0; k < count; ++k) s->group[k] = k;
  for (uint32_t k = t->start[node]; k < t->start[node + 1]; ++k) {
    uint32_t e = t->neighbour_edge[k];
    if (s->is_cut[e] || t->edge_faces[e][1] == NOWHERE) continue;
    uint32_t a = s->group[index_of(list, count, t->edge_faces[e][0])];
    uint32_t b = s->group[index_of(list, count, t->edge_faces[e][1])];
    if (a != b) join_groups(s->group, count, a, b);
  }
}

static void split_node(splitter *s, uint32_t node) {
  const sonde_topology *t = &s->model->topology;
  const uint32_t *list = t->face_list + t->face_start[node];
  uint32_t count = t->face_start[node + 1] - t->face_start[node];
  group_faces(s, node);
  for (uint32_t first = 1; first < count; ++first) {
    if (s->group[first] != first) continue;
    uint32_t copy = s->map->node_count + s->map->added;
    s->map->origin[s->map->added++] = node;
    for (uint32_t k = first; k < count; ++k) {
      if (s->group[k] != first) continue;
      uint32_t *corner = s->faces[list[k]];
      corner[index_of(s->model->surface.faces[list[k]], 3, node)] = copy;
    }
  }
}

static void split_way(splitter *s, const sonde_way *way) {
  for (uint32_t k = 0; k < way->count; ++k)
    for (uint32_t i = way->place[k]; i != NOWHERE; i = s->places->next[i]) split_node(s, i);
}

// Faces around all nodes of the way, and the most around one.
static uint32_t count_faces(const sonde_model *model, const sonde_places *places,
                            const sonde_way *way, uint32_t *most) {
  const uint32_t *start = model->topology.face_start;
  uint32_t sum = *most = 0;
  for (uint32_t k = 0; k < way->count; ++k)
    for (uint32_t i = way->place[k]; i != NOWHERE; i = places->next[i]) {
      uint32_t count = start[i + 1] - start[i];
      sum += count;
      if (count > *most) *most = count;
    }
  return sum;
}

// New corners into faces[], copies into the map.
static sonde_status split(const sonde_model *model, const sonde_places *places,
                          const sonde_way *way, uint32_t (*faces)[3], sonde_cut_map *map,
                          sonde_error *error) {
  uint32_t most, room = count_faces(model, places, way, &most);
  splitter s = {
      model, places, SONDE_NEW(uint8_t, model->topology.edge_count), SONDE_NEW(uint32_t, most),
      faces, map};
  map->origin = SONDE_NEW(uint32_t, room);
  map->way = SONDE_NEW(uint32_t, way->count);
  sonde_status status = SONDE_OK;
  if (s.is_cut && s.group && map->origin && map->way) {
    map->node_count = model->surface.vertex_count;
    map->way_count = way->count;
    map->closed = way->closed;
    map->work = way->work;
    memcpy(map->way, way->place, way->count * sizeof *way->place);
    memcpy(faces, model->surface.faces, model->surface.face_count * sizeof *faces);
    mark_edges(&s, way);
    split_way(&s, way);
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

static void copy_nodes(const sonde_model *model, const sonde_cut_map *map, sonde_model *cut) {
  copy_vectors(map, model->normal, cut->normal);
  copy_field(map, model->k0_n_m3, cut->k0_n_m3);
  copy_field(map, model->xm_m, cut->xm_m);
  copy_field(map, model->shear_share, cut->shear_share);
  copy_field(map, model->limit_share, cut->limit_share);
  copy_field(map, model->fat_depth_m, cut->fat_depth_m);
  copy_field(map, model->muscle_depth_m, cut->muscle_depth_m);
  copy_field(map, model->bone_depth_m, cut->bone_depth_m);
}

static uint32_t origin_of(const sonde_cut_map *map, uint32_t node) {
  return node < map->node_count ? node : map->origin[node - map->node_count];
}

static uint32_t faces_beside(const sonde_topology *t, uint32_t e) {
  return t->edge_faces[e][1] == NOWHERE ? 1 : 2;
}

// What an edge keeps of the spring that it was: all with as many faces beside it as before, half
// when one of two is left.
static sonde_status share_edges(const sonde_model *model, const sonde_cut_map *map,
                                sonde_model *cut, sonde_error *error) {
  const sonde_topology *now = &cut->topology, *was = &model->topology;
  cut->edge_share = SONDE_NEW(double, now->edge_count);
  if (!cut->edge_share) return sonde_fail_memory(error);
  for (uint32_t e = 0; e < now->edge_count; ++e) {
    uint32_t a = origin_of(map, now->edges[e][0]), b = origin_of(map, now->edges[e][1]);
    uint32_t old = find_edge(was, a, b);
    SONDE_ASSERT(old != NOWHERE);
    double share = model->edge_share ? model->edge_share[old] : 1;
    cut->edge_share[e] = share * faces_beside(now, e) / faces_beside(was, old);
    SONDE_ASSERT(cut->edge_share[e] > 0 && cut->edge_share[e] <= 1);
  }
  return SONDE_OK;
}

static sonde_status copy_rest(const sonde_model *model, sonde_model *cut, sonde_error *error) {
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
  return sonde_mesh_copy(&model->femur, &cut->femur, error);
}

// Takes over the faces.
static sonde_status make_surface(const sonde_model *model, const sonde_cut_map *map,
                                 uint32_t (*faces)[3], sonde_model *cut, sonde_error *error) {
  sonde_mesh *skin = &cut->surface;
  skin->faces = faces;
  skin->face_count = model->surface.face_count;
  skin->vertices = SONDE_NEW(sonde_vec3, map->node_count + (size_t)map->added);
  if (!skin->vertices) return sonde_fail_memory(error);
  SONDE_ASSERT(map->added > 0);
  skin->vertex_count = map->node_count + map->added;
  copy_vectors(map, model->surface.vertices, skin->vertices);
  return SONDE_OK;
}

static sonde_status fill(const sonde_model *model, const sonde_vec3 *position,
                         const sonde_vec3 *path, uint32_t count, sonde_cut_map *map,
                         sonde_model *cut, sonde_error *error) {
  sonde_places places = {0};
  sonde_way way = {0};
  uint32_t(*faces)[3] = sonde_calloc(model->surface.face_count, sizeof *faces);
  sonde_status status = faces ? SONDE_OK : sonde_fail_memory(error);
  if (!status) status = sonde_places_find(model, &places, error);
  if (!status) status = sonde_way_find(model, &places, position, path, count, &way, error);
  if (!status) status = split(model, &places, &way, faces, map, error);
  if (!status) {
    status = make_surface(model, map, faces, cut, error);
    faces = NULL;
  }
  if (!status) status = sonde_model_allocate_nodes(cut, error);
  if (!status) status = copy_rest(model, cut, error);
  if (!status) status = sonde_model_derive(cut, error);
  if (!status) status = share_edges(model, map, cut, error);
  if (!status) copy_nodes(model, map, cut); // also the normals: those of the whole skin
  sonde_free(faces);
  sonde_free(way.place);
  sonde_places_clear(&places);
  return status;
}

sonde_status sonde_model_cut(const sonde_model *model, const sonde_vec3 *position_m,
                             const sonde_vec3 *path_m, uint32_t count, sonde_model **out,
                             sonde_cut_map *map, sonde_error *error) {
  *out = NULL;
  sonde_cut_map own = {0};
  sonde_model *cut = SONDE_NEW(sonde_model, 1);
  const sonde_vec3 *position = position_m ? position_m : model->surface.vertices;
  sonde_status status =
      cut ? fill(model, position, path_m, count, &own, cut, error) : sonde_fail_memory(error);
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
  sonde_free(map->way);
  *map = (sonde_cut_map){0};
}
