// choose_nodes: held nodes, and the free ones within reach of them.
// add_edges:    edges inside the patch; those that leave it when the rim is held.
// build_rows:   pattern of the free places' matrix, ascending columns.
// find_entries: where each edge adds to it.
#include "fit/shear.h"

#include "base/maths.h"

enum { NOWHERE = UINT32_MAX };

static bool within_reach(const sonde_model *model, const sonde_footprint *f, uint32_t node,
                         double reach_m) {
  const sonde_vec3 *x = model->surface.vertices;
  for (uint32_t h = 0; h < f->held_count; ++h)
    if (v_norm2(v_sub(x[node], x[f->held[h]])) <= reach_m * reach_m) return true;
  return false;
}

// Half the size of the footprint, seen from its first held node.
static double extent(const sonde_model *model, const sonde_footprint *f) {
  double far = 0;
  for (uint32_t h = 0; h < f->held_count; ++h)
    far = fmax(
        far, v_distance(model->surface.vertices[f->held[h]], model->surface.vertices[f->held[0]]));
  return far;
}

// place[node] is set for every node of the patch, NOWHERE for the others.
static void choose_nodes(const sonde_model *model, const sonde_footprint *f, sonde_vec3 normal,
                         double reach_m, uint32_t *place, sonde_patch *p) {
  uint32_t nodes = model->surface.vertex_count;
  sonde_vec3 first = model->surface.vertices[f->held[0]];
  double far_m = extent(model, f) + reach_m;
  for (uint32_t i = 0; i < nodes; ++i) place[i] = NOWHERE;
  for (uint32_t h = 0; h < f->held_count; ++h) place[f->held[h]] = 0;
  for (uint32_t i = 0; i < nodes; ++i) {
    if (place[i] != NOWHERE) continue;
    if (v_distance(model->surface.vertices[i], first) > far_m) continue;
    if (!within_reach(model, f, i, reach_m)) continue;
    place[i] = p->free_count;
    p->node[p->free_count++] = i;
  }
  p->held_count = f->held_count;
  p->place_count = p->free_count + p->held_count + 1;
  SONDE_ASSERT(p->place_count <= nodes + 1);
  for (uint32_t h = 0; h < f->held_count; ++h) {
    uint32_t at = p->free_count + h, node = f->held[h];
    place[node] = at;
    p->node[at] = node;
    p->cosine[at] = v_dot(model->normal[node], normal);
    p->sliding_m2 += model->area_m2[node] * (1 - p->cosine[at] * p->cosine[at]);
  }
  p->node[p->place_count - 1] = f->held[0];
  for (uint32_t k = 0; k + 1 < p->place_count; ++k) p->area_m2[k] = model->area_m2[p->node[k]];
  for (uint32_t k = 0; k < p->free_count; ++k) p->point_m[k] = model->surface.vertices[p->node[k]];
}

static void add_edges(const sonde_model *model, const uint32_t *place, bool hold_rim,
                      sonde_patch *p) {
  for (uint32_t e = 0; e < model->topology.edge_count; ++e) {
    uint32_t a = place[model->topology.edges[e][0]], b = place[model->topology.edges[e][1]];
    if (a == NOWHERE && b == NOWHERE) continue;
    if ((a == NOWHERE || b == NOWHERE) && !hold_rim) continue;
    uint32_t k = p->edge_count++;
    p->edge[k][0] = a == NOWHERE ? p->place_count - 1 : a;
    p->edge[k][1] = b == NOWHERE ? p->place_count - 1 : b;
    p->rest_m[k] = model->edge_rest_m[e];
    p->dual_m[k] = model->edge_dual_m[e];
    SONDE_ASSERT(p->rest_m[k] > 0 && p->dual_m[k] >= 0);
  }
}

// Neighbours come in ascending node order and free places ascend with nodes: columns ascend.
static void build_rows(const sonde_model *model, const uint32_t *place, sonde_patch *p) {
  const sonde_topology *t = &model->topology;
  uint32_t count = 0;
  for (uint32_t r = 0; r < p->free_count; ++r) {
    uint32_t node = p->node[r];
    bool own = false;
    p->row_start[r] = count;
    for (uint32_t k = t->start[node]; k < t->start[node + 1]; ++k) {
      uint32_t other = place[t->neighbour[k]];
      if (other == NOWHERE || other >= p->free_count) continue;
      if (!own && other > r) {
        p->diagonal[r] = count;
        p->column[count++] = r;
        own = true;
      }
      SONDE_ASSERT(count == p->row_start[r] || p->column[count - 1] < other);
      p->column[count++] = other;
    }
    if (own) continue;
    p->diagonal[r] = count;
    p->column[count++] = r;
  }
  p->row_start[p->free_count] = count;
}

static uint32_t entry_of(const sonde_patch *p, uint32_t row, uint32_t column) {
  uint32_t k = p->row_start[row];
  while (k < p->row_start[row + 1] && p->column[k] != column) ++k;
  SONDE_ASSERT(k < p->row_start[row + 1]);
  return k;
}

static void find_entries(sonde_patch *p) {
  for (uint32_t e = 0; e < p->edge_count; ++e) {
    uint32_t a = p->edge[e][0], b = p->edge[e][1];
    bool both = a < p->free_count && b < p->free_count;
    p->entry[e][0] = both ? entry_of(p, a, b) : NOWHERE;
    p->entry[e][1] = both ? entry_of(p, b, a) : NOWHERE;
  }
}

// Places of the patch are not known yet: room for `nodes` of them.
static bool allocate_nodes(sonde_patch *p, uint32_t nodes) {
  p->node = SONDE_NEW(uint32_t, nodes + 1);
  p->area_m2 = SONDE_NEW(double, nodes + 1);
  p->cosine = SONDE_NEW(double, nodes + 1);
  p->point_m = SONDE_NEW(sonde_vec3, nodes);
  return p->node && p->area_m2 && p->cosine && p->point_m;
}

static bool allocate_edges(sonde_patch *p, uint32_t edges) {
  p->edge = sonde_calloc(edges, sizeof *p->edge);
  p->entry = sonde_calloc(edges, sizeof *p->entry);
  p->rest_m = SONDE_NEW(double, edges);
  p->dual_m = SONDE_NEW(double, edges);
  p->row_start = SONDE_NEW(uint32_t, p->free_count + 1);
  p->diagonal = SONDE_NEW(uint32_t, p->free_count);
  p->column = SONDE_NEW(uint32_t, p->free_count + 2 * (size_t)edges);
  return p->edge && p->entry && p->rest_m && p->dual_m && p->row_start && p->diagonal && p->column;
}

static uint32_t count_edges(const sonde_model *model, const uint32_t *place) {
  uint32_t count = 0;
  for (uint32_t e = 0; e < model->topology.edge_count; ++e) {
    const uint32_t *pair = model->topology.edges[e];
    count += place[pair[0]] != NOWHERE || place[pair[1]] != NOWHERE;
  }
  return count;
}

// Gives back what the nodes outside the patch took.
static void shrink_nodes(sonde_patch *p, uint32_t nodes) {
  size_t room = (size_t)nodes + 1, count = p->place_count;
  void *node = sonde_realloc(p->node, room * sizeof *p->node, count * sizeof *p->node);
  void *area = sonde_realloc(p->area_m2, room * sizeof *p->area_m2, count * sizeof *p->area_m2);
  void *cosine = sonde_realloc(p->cosine, room * sizeof *p->cosine, count * sizeof *p->cosine);
  if (node) p->node = node;
  if (area) p->area_m2 = area;
  if (cosine) p->cosine = cosine;
  void *point = sonde_realloc(p->point_m, nodes * sizeof *p->point_m, count * sizeof *p->point_m);
  if (point) p->point_m = point;
}

sonde_status sonde_patch_create(const sonde_model *model, const sonde_footprint *footprint,
                                sonde_vec3 normal, double reach_m, bool hold_rim,
                                sonde_patch *patch, sonde_error *error) {
  SONDE_ASSERT(footprint->held_count > 0 && reach_m > 0);
  *patch = (sonde_patch){0};
  uint32_t nodes = model->surface.vertex_count;
  uint32_t *place = SONDE_NEW(uint32_t, nodes);
  sonde_status status = place && allocate_nodes(patch, nodes) ? SONDE_OK : sonde_fail_memory(error);
  if (status) goto done;
  choose_nodes(model, footprint, normal, reach_m, place, patch);
  shrink_nodes(patch, nodes);
  if (!patch->free_count) {
    status =
        sonde_fail(error, SONDE_ARGUMENT, "no free node within %g m of the footprint", reach_m);
    goto done;
  }
  if (!allocate_edges(patch, count_edges(model, place))) {
    status = sonde_fail_memory(error);
    goto done;
  }
  add_edges(model, place, hold_rim, patch);
  build_rows(model, place, patch);
  find_entries(patch);
done:
  sonde_free(place);
  if (status) sonde_patch_clear(patch);
  return status;
}

void sonde_patch_clear(sonde_patch *p) {
  sonde_free(p->node);
  sonde_free(p->area_m2);
  sonde_free(p->cosine);
  sonde_free(p->edge);
  sonde_free(p->rest_m);
  sonde_free(p->dual_m);
  sonde_free(p->row_start);
  sonde_free(p->column);
  sonde_free(p->diagonal);
  sonde_free(p->entry);
  sonde_free(p->point_m);
  *p = (sonde_patch){0};
}
