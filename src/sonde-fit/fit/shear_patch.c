// The patch of a footprint: places, areas and cotangents of its faces, pattern of its matrix.
#include "fit/shear.h"

#include "base/maths.h"

#include <stdlib.h>
#include <string.h>

enum { NOWHERE = UINT32_MAX };
// Normal springs of a strip this wide stand for the skin beyond the rim: a dent that dies away over
// a length l meets there what an endless skin would offer, k0 l per length.
static const double RIM_WIDTH_M = 0.009;

static int compare_nodes(const void *a, const void *b) {
  uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
  return (x > y) - (x < y);
}

// Areas and cotangents of the cut faces.
static void measure_faces(const sonde_model *model, const sonde_cut *cut, const uint32_t *place,
                          sonde_patch *p) {
  for (uint32_t f = 0; f < cut->face_count; ++f) {
    sonde_patch_face *face = &p->face[p->face_count++];
    sonde_vec3 x[3];
    for (int k = 0; k < 3; ++k) {
      x[k] = sonde_cut_point(model, cut, cut->face[f][k]);
      face->place[k] = place[cut->face[f][k]];
    }
    double twice = v_norm(v_cross(v_sub(x[1], x[0]), v_sub(x[2], x[0])));
    SONDE_ASSERT(twice > 0);
    face->area_m2 = 0.5 * twice;
    for (int k = 0; k < 3; ++k) {
      sonde_vec3 a = v_sub(x[(k + 1) % 3], x[k]), b = v_sub(x[(k + 2) % 3], x[k]);
      face->half_cotangent[k] = 0.5 * v_dot(a, b) / twice;
      p->area_m2[face->place[k]] += face->area_m2 / 3;
    }
  }
}

static int compare(const void *a, const void *b) {
  uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
  return (x > y) - (x < y);
}

// Pairs (row, column) of all faces and the diagonal, sorted, each once.
static sonde_status build_rows(sonde_patch *p, sonde_error *error) {
  uint64_t *pair = SONDE_NEW(uint64_t, 6 * (size_t)p->face_count + p->free_count);
  if (!pair) return sonde_fail_memory(error);
  size_t count = 0;
  for (uint32_t r = 0; r < p->free_count; ++r) pair[count++] = (uint64_t)r << 32 | r;
  for (uint32_t f = 0; f < p->face_count; ++f)
    for (int k = 0; k < 6; ++k) {
      uint32_t a = p->face[f].place[k % 3], b = p->face[f].place[(k + 1 + k / 3) % 3];
      if (a < p->free_count && b < p->free_count) pair[count++] = (uint64_t)a << 32 | b;
    }
  qsort(pair, count, sizeof *pair, compare);
  p->column = SONDE_NEW(uint32_t, count);
  if (!p->column) {
    sonde_free(pair);
    return sonde_fail_memory(error);
  }
  uint32_t kept = 0;
  for (size_t k = 0; k < count; ++k) {
    if (k && pair[k] == pair[k - 1]) continue;
    uint32_t row = (uint32_t)(pair[k] >> 32), column = (uint32_t)pair[k];
    if (row == column) p->diagonal[row] = kept;
    p->column[kept++] = column;
    p->row_start[row + 1] = kept;
  }
  sonde_free(pair);
  return SONDE_OK;
}

// The entry of the matrix at a row and a column; NOWHERE outside the free places.
static uint32_t entry_of(const sonde_patch *p, uint32_t row, uint32_t column) {
  if (row >= p->free_count || column >= p->free_count) return NOWHERE;
  uint32_t k = p->row_start[row];
  while (k < p->row_start[row + 1] && p->column[k] != column) ++k;
  SONDE_ASSERT(k < p->row_start[row + 1]);
  return k;
}

static sonde_status analyse(const sonde_model *model, const sonde_cut *cut, sonde_patch *p,
                            sonde_error *error) {
  sonde_vec3 *point_m = SONDE_NEW(sonde_vec3, p->free_count);
  if (!point_m) return sonde_fail_memory(error);
  uint32_t free = 0;
  for (uint32_t v = 0; v < cut->vertex_count; ++v)
    if (!cut->held[v]) point_m[free++] = sonde_cut_point(model, cut, v);
  const sonde_symbolic_def def = {.node_count = p->free_count,
                                  .block = 1,
                                  .points = point_m,
                                  .row_start = p->row_start,
                                  .column = p->column};
  sonde_status status = sonde_symbolic_create(&def, &p->symbolic, error);
  sonde_free(point_m);
  return status;
}

static sonde_status fill(const sonde_model *model, const sonde_cut *cut, const sonde_site *site,
                         sonde_patch *p, sonde_error *error) {
  uint32_t *place = SONDE_NEW(uint32_t, cut->vertex_count);
  sonde_vec3 *normal = SONDE_NEW(sonde_vec3, cut->vertex_count);
  size_t places = cut->vertex_count;
  p->parent = sonde_calloc(places, sizeof *p->parent);
  p->share = sonde_calloc(places, sizeof *p->share);
  p->among = sonde_calloc(places, sizeof *p->among);
  p->node = SONDE_NEW(uint32_t, cut->node_count);
  p->area_m2 = SONDE_NEW(double, places);
  p->cosine = SONDE_NEW(double, places);
  p->face = SONDE_NEW(sonde_patch_face, cut->face_count);
  p->side = SONDE_NEW(uint32_t, cut->face_count);
  p->row_start = SONDE_NEW(uint32_t, p->free_count + 1);
  p->diagonal = SONDE_NEW(uint32_t, p->free_count);
  bool ok = place && normal &&
            (p->parent && p->share && p->among && p->node && p->area_m2 && p->cosine && p->face &&
             p->side && p->row_start && p->diagonal);
  sonde_status status = ok ? SONDE_OK : sonde_fail_memory(error);
  if (!status) {
    // Free places come first; they ascend with the nodes.
    uint32_t free = 0, held = p->free_count;
    for (uint32_t v = 0; v < cut->vertex_count; ++v) {
      uint32_t at = place[v] = cut->held[v] ? held++ : free++;
      memcpy(p->parent[at], cut->parent[v], sizeof p->parent[at]);
      memcpy(p->share[at], cut->share[v], sizeof p->share[at]);
      p->area_m2[at] = v < cut->node_count ? RIM_WIDTH_M * cut->rim_m[v] : 0;
      normal[at] = sonde_cut_normal(model, cut, v);
      if (cut->held[v]) p->cosine[at] = v_dot(normal[at], site->normal);
    }
    SONDE_ASSERT(free == p->free_count && held == p->place_count);
    // Vertices that are nodes come first and ascend: places find their nodes by bisection.
    p->node_count = cut->node_count;
    for (uint32_t v = 0; v < cut->node_count; ++v) p->node[v] = cut->parent[v][0];
    for (uint32_t v = 0; v < cut->vertex_count; ++v)
      for (int k = 0; k < 3; ++k) {
        const uint32_t *at =
            bsearch(&cut->parent[v][k], p->node, p->node_count, sizeof *p->node, compare_nodes);
        SONDE_ASSERT(at != NULL);
        p->among[place[v]][k] = (uint32_t)(at - p->node);
      }
    measure_faces(model, cut, place, p);
    status = sonde_patch_drag(p, &model->law, normal, site->normal, error);
  }
  sonde_free(place);
  sonde_free(normal);
  if (!status) status = build_rows(p, error);
  // Each face adds to its entries of the matrix; faces with a held and a free corner are the sides.
  for (uint32_t f = 0; f < p->face_count && !status; ++f) {
    sonde_patch_face *face = &p->face[f];
    uint32_t held = 0;
    for (int k = 0; k < 3; ++k) held += face->place[k] >= p->free_count;
    if (held == 1 || held == 2) p->side[p->side_count++] = f;
    for (int k = 0; k < 3; ++k) {
      uint32_t a = face->place[(k + 1) % 3], b = face->place[(k + 2) % 3];
      face->entry[k][0] = entry_of(p, a, b);
      face->entry[k][1] = entry_of(p, b, a);
    }
  }
  if (!status) status = analyse(model, cut, p, error);
  return status;
}

sonde_status sonde_patch_create(const sonde_model *model, const sonde_site *site, double half_u_m,
                                double half_v_m, double reach_m, sonde_patch *patch,
                                sonde_error *error) {
  *patch = (sonde_patch){0};
  sonde_cut cut;
  sonde_status status = sonde_cut_create(model, site, half_u_m, half_v_m, reach_m, &cut, error);
  if (status) return status;
  patch->place_count = cut.vertex_count;
  patch->free_count = cut.vertex_count - cut.held_count;
  patch->coarse = cut.coarse;
  if (!patch->free_count)
    status =
        sonde_fail(error, SONDE_ARGUMENT, "no free node within %g m of the footprint", reach_m);
  else
    status = fill(model, &cut, site, patch, error);
  sonde_cut_clear(&cut);
  if (status) sonde_patch_clear(patch);
  return status;
}

void sonde_patch_clear(sonde_patch *p) {
  sonde_free(p->parent);
  sonde_free(p->share);
  sonde_free(p->among);
  sonde_free(p->node);
  sonde_free(p->area_m2);
  sonde_free(p->cosine);
  sonde_free(p->face);
  sonde_free(p->side);
  sonde_free(p->row_start);
  sonde_free(p->column);
  sonde_free(p->diagonal);
  sonde_symbolic_destroy(p->symbolic);
  *p = (sonde_patch){0};
}
