// Volumetric models: from a skin and tetrahedra, and the stiffness between their nodes; cold.
#include "tissue/bulk/bulk.h"

#include "base/base.h"
#include "base/maths.h"
#include "base/morton.h"
#include "geometry/internal.h"
#include "tissue/nodes.h"

#include <string.h>

sonde_bulk_law sonde_bulk_law_default(sonde_model_kind kind) {
  sonde_bulk_law law = {.density_kg_m3 = 1000,
                        .damping_s = 0.02,
                        .skin_n_m = 50,
                        .spring_pa = {10e3, 10e3},
                        .steepening = 1,
                        .knee = 1,
                        .volume_pa = 0,
                        .young_pa = {5e3, 15e3},
                        .poisson = 0.45,
                        .stiffness_scale = 1};
  if (kind != SONDE_THREE_LAYER) return law;
  law.steepening = 5, law.knee = 0.15, law.volume_pa = 20e3;
  return law;
}

static sonde_status check_law(sonde_model_kind kind, const sonde_bulk_law *law,
                              sonde_error *error) {
  const sonde_bounded range[] = {
      {"density_kg_m3", law->density_kg_m3, 1, 1e5},
      {"damping_s", law->damping_s, 0, 100},
      {"skin_n_m", law->skin_n_m, 0, 1e7},
      {"spring_pa of fat", law->spring_pa[SONDE_LAYER_FAT], 0, 1e9},
      {"spring_pa of muscle", law->spring_pa[SONDE_LAYER_MUSCLE], 0, 1e9},
      {"steepening", law->steepening, 1, 1e4},
      {"knee", law->knee, 0, 100},
      {"volume_pa", law->volume_pa, 0, 1e10},
      {"young_pa of fat", law->young_pa[SONDE_LAYER_FAT], 0, 1e12},
      {"young_pa of muscle", law->young_pa[SONDE_LAYER_MUSCLE], 0, 1e12},
      {"poisson", law->poisson, 0, 0.4999},
      {"stiffness_scale", law->stiffness_scale, 1e-6, 1e6}};
  if (kind == SONDE_TWO_LAYER || kind > SONDE_CONDENSED_SOLID)
    return sonde_fail(error, SONDE_ARGUMENT, "model kind %d is not volumetric", (int)kind);
  return sonde_bounded_check(range, SONDE_COUNT_OF(range), error);
}

sonde_status sonde_model_set_bulk_law(sonde_model *model, const sonde_bulk_law *law,
                                      sonde_error *error) {
  SONDE_ASSERT(model->bulk);
  sonde_status status = check_law(model->kind, law, error);
  if (!status) model->bulk->law = *law;
  return status;
}

void sonde_bulk_destroy(sonde_bulk *bulk) {
  if (!bulk) return;
  void *arrays[] = {bulk->node,  bulk->mass_kg,   bulk->area_m2, bulk->shortest_m,
                    bulk->start, bulk->neighbour, bulk->element, bulk->layer};
  for (size_t k = 0; k < SONDE_COUNT_OF(arrays); ++k) sonde_free(arrays[k]);
  sonde_free(bulk);
}

double sonde_bulk_gradients(const sonde_bulk *bulk, uint32_t element, sonde_vec3 gradient[4]) {
  const uint32_t *v = bulk->element[element];
  sonde_vec3 x[4];
  for (int k = 0; k < 4; ++k) x[k] = bulk->node[v[k]];
  sonde_vec3 a = v_sub(x[1], x[0]), b = v_sub(x[2], x[0]), c = v_sub(x[3], x[0]);
  double six = v_dot(a, v_cross(b, c));
  SONDE_ASSERT(six > 0);
  gradient[1] = v_scale(v_cross(b, c), 1 / six);
  gradient[2] = v_scale(v_cross(c, a), 1 / six);
  gradient[3] = v_scale(v_cross(a, b), 1 / six);
  gradient[0] = v_neg(v_add(gradient[1], v_add(gradient[2], gradient[3])));
  return six / 6;
}

bool sonde_bulk_is_solid(const sonde_model *model) {
  return model->kind == SONDE_THREE_LAYER || model->kind == SONDE_NEO_HOOKEAN_SOLID;
}

// The volume force of three layers is a solid without shear stiffness.
void sonde_bulk_solid(const sonde_model *model, uint32_t element, double *mu, double *lambda) {
  const sonde_bulk_law *law = &model->bulk->law;
  SONDE_ASSERT(element < model->bulk->element_count);
  double young = law->stiffness_scale * law->young_pa[model->bulk->layer[element]];
  *mu = young / (2 * (1 + law->poisson));
  *lambda = young * law->poisson / ((1 + law->poisson) * (1 - 2 * law->poisson));
  if (model->kind == SONDE_THREE_LAYER) *mu = 0, *lambda = law->stiffness_scale * law->volume_pa;
}

// ---- neighbours ---------------------------------------------------------------------------------

// Nodes below `limit` that share a tetrahedron with each of the `rows` first nodes, ascending.
static sonde_status find_neighbours(const sonde_bulk *bulk, uint32_t rows, uint32_t limit,
                                    uint32_t **start, uint32_t **neighbour, sonde_error *error) {
  uint32_t *around = SONDE_NEW(uint32_t, (size_t)rows + 1), most = 0;
  uint32_t *list = SONDE_NEW(uint32_t, 4 * (size_t)bulk->element_count), count = 0;
  *start = SONDE_NEW(uint32_t, (size_t)rows + 1);
  sonde_status status = around && list && *start ? SONDE_OK : sonde_fail_memory(error);
  // elements around each node
  for (uint32_t e = 0; !status && e < bulk->element_count; ++e)
    for (int c = 0; c < 4; ++c)
      if (bulk->element[e][c] < rows) ++around[bulk->element[e][c] + 1];
  for (uint32_t i = 0; !status && i < rows; ++i) {
    most = around[i + 1] > most ? around[i + 1] : most;
    around[i + 1] += around[i];
  }
  uint32_t *filled = SONDE_NEW(uint32_t, (size_t)rows + 1);
  uint32_t *found = SONDE_NEW(uint32_t, 3 * (size_t)most + 1);
  *neighbour = SONDE_NEW(uint32_t, status ? 1 : 3 * (size_t)around[rows] + 1);
  if (!status && (!filled || !found || !*neighbour)) status = sonde_fail_memory(error);
  for (uint32_t e = 0; !status && e < bulk->element_count; ++e)
    for (int c = 0; c < 4; ++c) {
      uint32_t i = bulk->element[e][c];
      if (i < rows) list[around[i] + filled[i]++] = e;
    }
  // their other corners, each once
  for (uint32_t i = 0; !status && i < rows; ++i) {
    uint32_t n = 0;
    for (uint32_t k = around[i]; k < around[i + 1]; ++k)
      for (int c = 0; c < 4; ++c) {
        uint32_t j = bulk->element[list[k]][c], at = 0;
        if (j == i || j >= limit) continue;
        while (at < n && found[at] < j) ++at;
        if (at < n && found[at] == j) continue;
        memmove(&found[at + 1], &found[at], (n - at) * sizeof *found);
        found[at] = j, ++n;
      }
    memcpy(*neighbour + count, found, n * sizeof *found);
    count += n;
    (*start)[i + 1] = count;
  }
  sonde_free(around);
  sonde_free(list);
  sonde_free(filled);
  sonde_free(found);
  return status;
}

// ---- making
// ---------------------------------------------------------------------------------------

sonde_status sonde_bulk_derive(sonde_bulk *bulk, const sonde_model *model, sonde_error *error) {
  uint32_t n = bulk->node_count, skin = model->surface.vertex_count;
  SONDE_ASSERT(n >= skin);
  bulk->mass_kg = SONDE_NEW(double, n);
  bulk->area_m2 = SONDE_NEW(double, n);
  bulk->shortest_m = SONDE_NEW(double, n);
  if (!bulk->mass_kg || !bulk->area_m2 || !bulk->shortest_m) return sonde_fail_memory(error);
  memcpy(bulk->area_m2, model->area_m2, skin * sizeof(double));
  for (uint32_t e = 0; e < bulk->element_count; ++e) {
    const uint32_t *v = bulk->element[e];
    sonde_vec3 gradient[4];
    double mass = bulk->law.density_kg_m3 * sonde_bulk_gradients(bulk, e, gradient) / 4;
    for (int a = 0; a < 4; ++a) {
      if (v[a] >= n) continue;
      bulk->mass_kg[v[a]] += mass;
      for (int b = 0; b < 4; ++b) {
        double edge = a == b ? INFINITY : v_distance(bulk->node[v[a]], bulk->node[v[b]]);
        double *shortest = &bulk->shortest_m[v[a]];
        if (*shortest == 0 || edge < *shortest) *shortest = edge;
      }
    }
  }
  for (uint32_t i = 0; i < n; ++i)
    if (!(bulk->mass_kg[i] > 0))
      return sonde_fail(error, SONDE_MESH, "node %u belongs to no tetrahedron", i);
  if (model->kind == SONDE_CONDENSED_SOLID) return sonde_bulk_derive_skin(bulk, model, error);
  return find_neighbours(bulk, n, n, &bulk->start, &bulk->neighbour, error);
}

// rank[node of the solid]: the model's number. Nodes of the skin have the model's own, which is
// found by their places; inner nodes follow along a space-filling curve, held nodes come last.
static sonde_status rank_nodes(const sonde_model *model, const sonde_tetrahedra *solid,
                               uint32_t *rank, sonde_error *error) {
  uint32_t skin = model->surface.vertex_count, moving = solid->node_count - solid->held_count;
  sonde_keyed *list = SONDE_NEW(sonde_keyed, solid->node_count);
  sonde_keyed *own = SONDE_NEW(sonde_keyed, skin);
  sonde_status status = list && own ? SONDE_OK : sonde_fail_memory(error);
  for (uint32_t i = 0; !status && i < skin; ++i) {
    own[i] = (sonde_keyed){sonde_morton_key(model->surface.vertices[i]), i};
    list[i] = (sonde_keyed){sonde_morton_key(solid->node[i]), i};
  }
  if (!status) {
    qsort(own, skin, sizeof *own, sonde_keyed_compare);
    qsort(list, skin, sizeof *list, sonde_keyed_compare);
  }
  for (uint32_t k = 0; !status && k < skin; ++k) {
    // Keys are rounded places: nodes with one key are told apart by their places.
    uint32_t from = k, found = UINT32_MAX;
    while (from > 0 && own[from - 1].key == list[k].key) --from;
    for (; from < skin && own[from].key == list[k].key; ++from)
      if (v_distance(model->surface.vertices[own[from].index], solid->node[list[k].index]) == 0)
        found = own[from].index;
    if (found == UINT32_MAX)
      status = sonde_fail(error, SONDE_MISMATCH, "the skin is not the solid's outer boundary");
    else
      rank[list[k].index] = found;
  }
  uint32_t inner = 0, first = skin + solid->held_count;
  for (uint32_t i = first; !status && i < solid->node_count; ++i)
    list[inner++] = (sonde_keyed){sonde_morton_key(solid->node[i]), i};
  if (!status) qsort(list, inner, sizeof *list, sonde_keyed_compare);
  for (uint32_t k = 0; !status && k < inner; ++k) rank[list[k].index] = skin + k;
  for (uint32_t k = 0; !status && k < solid->held_count; ++k) rank[skin + k] = moving + k;
  sonde_free(list);
  sonde_free(own);
  return status;
}

sonde_status sonde_model_fill(sonde_model *model, const sonde_tetrahedra *solid,
                              sonde_model_kind kind, const sonde_bulk_law *law,
                              sonde_error *error) {
  uint32_t skin = model->surface.vertex_count, n = solid->node_count, count = solid->count;
  sonde_status status = check_law(kind, law, error);
  if (status) return status;
  if (solid->surface_count != skin)
    return sonde_fail(error, SONDE_MISMATCH, "the skin has %u nodes, the solid's boundary %u", skin,
                      solid->surface_count);
  sonde_surface_index *index = NULL;
  sonde_bulk *bulk = SONDE_NEW(sonde_bulk, 1);
  uint32_t *rank = SONDE_NEW(uint32_t, n);
  if (!bulk || !rank) status = sonde_fail_memory(error);
  if (!status) {
    bulk->law = *law;
    bulk->node_count = n - solid->held_count, bulk->held_count = solid->held_count;
    bulk->element_count = count;
    bulk->node = SONDE_NEW(sonde_vec3, n);
    bulk->element = sonde_calloc(count, sizeof *bulk->element);
    bulk->layer = SONDE_NEW(uint32_t, count);
    if (!bulk->node || !bulk->element || !bulk->layer) status = sonde_fail_memory(error);
  }
  if (!status) status = rank_nodes(model, solid, rank, error);
  if (!status) {
    for (uint32_t i = 0; i < n; ++i) bulk->node[rank[i]] = solid->node[i];
    for (uint32_t e = 0; e < count; ++e)
      for (int c = 0; c < 4; ++c) bulk->element[e][c] = rank[solid->corner[e][c]];
    status = sonde_surface_index_create(&model->surface, &index, error);
  }
  // The layer of every element, from its depth below the skin.
  for (uint32_t e = 0; !status && e < count; ++e) {
    sonde_vec3 middle = vec3(0, 0, 0);
    for (int c = 0; c < 4; ++c) middle = v_madd(middle, 0.25, bulk->node[bulk->element[e][c]]);
    sonde_surface_point hit = sonde_surface_closest(index, middle);
    const uint32_t *v = model->surface.faces[hit.face];
    double fat = 0;
    for (int k = 0; k < 3; ++k) fat += model->muscle_depth_m[v[k]] / 3;
    bulk->layer[e] = hit.distance_m < fat ? SONDE_LAYER_FAT : SONDE_LAYER_MUSCLE;
  }
  sonde_surface_index_destroy(index);
  sonde_model_kind before = model->kind;
  model->kind = kind;
  if (!status) status = sonde_bulk_derive(bulk, model, error);
  sonde_free(rank);
  if (status) {
    model->kind = before;
    sonde_bulk_destroy(bulk);
    return status;
  }
  sonde_bulk_destroy(model->bulk);
  model->bulk = bulk;
  return SONDE_OK;
}

// ---- stiffness between nodes
// ------------------------------------------------------------------------

void sonde_bulk_graph_clear(sonde_bulk_graph *graph) {
  sonde_free(graph->start);
  sonde_free(graph->neighbour);
  sonde_free(graph->spring);
  sonde_free(graph->block);
  sonde_free(graph->own);
  sonde_free(graph->compliance);
  *graph = (sonde_bulk_graph){0};
}

static uint32_t slot_of(const sonde_bulk_graph *graph, uint32_t i, uint32_t j) {
  uint32_t at = graph->start[i];
  while (at < graph->start[i + 1] && graph->neighbour[at] != j) ++at;
  SONDE_ASSERT(at < graph->start[i + 1]);
  return at;
}

// The springs of an element's six edges stand for a modulus E: stiffness E V/L^2 each (Van Gelder
// 1998), which leaves the same stiffness whatever the size of the mesh.
static void add_element_springs(const sonde_model *model, uint32_t e, sonde_bulk_graph *graph) {
  const sonde_bulk *bulk = model->bulk;
  const sonde_bulk_law *law = &bulk->law;
  const uint32_t *v = bulk->element[e];
  sonde_vec3 gradient[4];
  uint32_t layer = model->kind == SONDE_LATTICE ? SONDE_LAYER_MUSCLE : bulk->layer[e];
  double strength = sonde_bulk_gradients(bulk, e, gradient) * law->spring_pa[layer];
  for (int a = 0; a < 4; ++a)
    for (int b = 0; b < 4; ++b) {
      if (a == b || v[a] >= bulk->node_count) continue;
      sonde_vec3 d = v_sub(bulk->node[v[b]], bulk->node[v[a]]);
      double stiffness = law->stiffness_scale * strength / v_norm2(d);
      sonde_bulk_spring *spring = &graph->spring[slot_of(graph, v[a], v[b])];
      spring->stiffness_n_m += stiffness;
      spring->steep_n_m += law->steepening * stiffness;
      spring->knee = law->knee;
    }
}

// K_ab = V (lambda g_a g_b^T + mu g_b g_a^T + mu g_a.g_b I) of a linear tetrahedron.
static void add_solids(const sonde_model *model, sonde_bulk_graph *graph) {
  const sonde_bulk *bulk = model->bulk;
  for (uint32_t e = 0; e < bulk->element_count; ++e) {
    const uint32_t *v = bulk->element[e];
    sonde_vec3 gradient[4];
    double size = sonde_bulk_gradients(bulk, e, gradient), mu, lambda;
    sonde_bulk_solid(model, e, &mu, &lambda);
    for (int a = 0; a < 4; ++a)
      for (int b = 0; b < 4; ++b) {
        if (v[a] >= bulk->node_count) continue;
        const double x[3] = {gradient[a].x, gradient[a].y, gradient[a].z};
        const double y[3] = {gradient[b].x, gradient[b].y, gradient[b].z};
        double flat = mu * v_dot(gradient[a], gradient[b]);
        sonde_mat3 block;
        for (int i = 0; i < 3; ++i)
          for (int j = 0; j < 3; ++j)
            block.m[i][j] = size * (lambda * x[i] * y[j] + mu * y[i] * x[j] + (i == j) * flat);
        sonde_mat3 *to = &graph->own[v[a]];
        if (a != b) to = graph->block ? &graph->block[slot_of(graph, v[a], v[b])] : NULL;
        if (to) *to = m_add(*to, block);
      }
  }
}

sonde_status sonde_bulk_graph_create(const sonde_model *model, sonde_bulk_graph *graph,
                                     sonde_error *error) {
  const sonde_bulk *bulk = model->bulk;
  bool condensed = model->kind == SONDE_CONDENSED_SOLID;
  uint32_t n = sonde_model_nodes(model).count, all = bulk->node_count + bulk->held_count;
  bool springs = model->kind == SONDE_LATTICE || model->kind == SONDE_THREE_LAYER;
  bool blocks = model->kind == SONDE_LINEAR_SOLID || condensed;
  *graph = (sonde_bulk_graph){0};
  sonde_status status = SONDE_OK;
  if (condensed) {
    graph->start = SONDE_NEW(uint32_t, (size_t)n + 1);
    graph->neighbour = SONDE_NEW(uint32_t, bulk->start[n]);
    if (!graph->start || !graph->neighbour) status = sonde_fail_memory(error);
    if (!status) {
      memcpy(graph->start, bulk->start, ((size_t)n + 1) * sizeof *graph->start);
      memcpy(graph->neighbour, bulk->neighbour, bulk->start[n] * sizeof *graph->neighbour);
    }
  } else
    status = find_neighbours(bulk, n, all, &graph->start, &graph->neighbour, error);
  if (!status) {
    size_t slots = graph->start[n];
    graph->own = SONDE_NEW(sonde_mat3, n);
    if (springs) graph->spring = SONDE_NEW(sonde_bulk_spring, slots);
    if (blocks) graph->block = SONDE_NEW(sonde_mat3, slots);
    if (!graph->own || (springs && !graph->spring) || (blocks && !graph->block))
      status = sonde_fail_memory(error);
  }
  if (!status && springs) {
    for (uint32_t e = 0; e < bulk->element_count; ++e) add_element_springs(model, e, graph);
    // The skin as a membrane: an edge takes a part of the stiffness by the areas at its sides.
    const sonde_bulk_law *law = &bulk->law;
    uint32_t faces = model->kind == SONDE_THREE_LAYER ? model->surface.face_count : 0;
    for (uint32_t k = 0; k < 3 * faces; ++k) {
      uint32_t f = k / 3, i = model->surface.faces[f][k % 3],
               j = model->surface.faces[f][(k + 1) % 3];
      double length2 = v_norm2(v_sub(bulk->node[j], bulk->node[i]));
      double stiffness = law->stiffness_scale * law->skin_n_m * model->face_area_m2[f] / length2;
      for (int side = 0; side < 2; ++side) {
        sonde_bulk_spring *spring =
            &graph->spring[side == 0 ? slot_of(graph, i, j) : slot_of(graph, j, i)];
        spring->stiffness_n_m += stiffness;
        spring->steep_n_m += law->steepening * stiffness;
      }
    }
    for (uint32_t i = 0; i < n; ++i)
      for (uint32_t k = graph->start[i]; k < graph->start[i + 1]; ++k) {
        sonde_vec3 d = v_sub(bulk->node[graph->neighbour[k]], bulk->node[i]);
        graph->own[i] =
            m_add(graph->own[i], m_rank1(v_unit(d, d), graph->spring[k].stiffness_n_m, 0));
      }
  }
  if (!status && condensed) status = sonde_bulk_condense(model, graph, error);
  if (!status && !condensed && model->kind != SONDE_LATTICE) add_solids(model, graph);
  if (status) sonde_bulk_graph_clear(graph);
  return status;
}
