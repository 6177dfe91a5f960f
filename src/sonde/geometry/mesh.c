// Triangle meshes in memory and what can be measured on them.
#include "geometry/internal.h"

#include <string.h>

sonde_status sonde_mesh_create(sonde_mesh *mesh, uint32_t vertices, uint32_t faces,
                               sonde_error *error) {
  SONDE_ASSERT(mesh != NULL);
  *mesh = (sonde_mesh){.vertex_count = vertices, .face_count = faces};
  mesh->vertices = SONDE_NEW(sonde_vec3, vertices);
  mesh->faces = sonde_calloc(faces, sizeof *mesh->faces);
  if (mesh->vertices && mesh->faces) return SONDE_OK;
  sonde_mesh_clear(mesh);
  return sonde_fail_memory(error);
}

void sonde_mesh_clear(sonde_mesh *mesh) {
  if (!mesh) return;
  sonde_free(mesh->vertices);
  sonde_free(mesh->faces);
  *mesh = (sonde_mesh){0};
}

sonde_status sonde_mesh_copy(const sonde_mesh *mesh, sonde_mesh *copy, sonde_error *error) {
  SONDE_ASSERT(mesh != copy);
  sonde_status status = sonde_mesh_create(copy, mesh->vertex_count, mesh->face_count, error);
  if (status) return status;
  if (mesh->vertex_count)
    memcpy(copy->vertices, mesh->vertices, mesh->vertex_count * sizeof *mesh->vertices);
  if (mesh->face_count) memcpy(copy->faces, mesh->faces, mesh->face_count * sizeof *mesh->faces);
  return SONDE_OK;
}

// Stable counting sort by low (or high) end; `start` has vertex_count + 1 entries.
static void sort_by_end(const sonde_half_edge *in, sonde_half_edge *out, size_t count, bool by_low,
                        size_t *start, uint32_t vertices) {
  memset(start, 0, (vertices + (size_t)1) * sizeof *start);
  SONDE_ASSERT(in != out);
  for (size_t i = 0; i < count; ++i) start[(by_low ? in[i].low : in[i].high) + (size_t)1]++;
  for (uint32_t v = 0; v < vertices; ++v) start[v + 1] += start[v];
  for (size_t i = 0; i < count; ++i) out[start[by_low ? in[i].low : in[i].high]++] = in[i];
}

sonde_status sonde_half_edges_sort(const sonde_mesh *mesh, sonde_half_edge **sorted,
                                   sonde_error *error) {
  *sorted = NULL;
  for (uint32_t f = 0; f < mesh->face_count; ++f)
    for (int k = 0; k < 3; ++k)
      if (mesh->faces[f][k] >= mesh->vertex_count)
        return sonde_fail(error, SONDE_MESH, "face %u names vertex %u, but there are only %u", f,
                          mesh->faces[f][k], mesh->vertex_count);
  size_t count = 3 * (size_t)mesh->face_count;
  sonde_half_edge *edges = SONDE_NEW(sonde_half_edge, count);
  sonde_half_edge *scratch = SONDE_NEW(sonde_half_edge, count);
  size_t *start = SONDE_NEW(size_t, mesh->vertex_count + (size_t)1);
  if (edges && scratch && start) {
    for (size_t i = 0; i < count; ++i) {
      uint32_t face = (uint32_t)(i / 3), a = mesh->faces[face][i % 3];
      uint32_t b = mesh->faces[face][(i + 1) % 3];
      edges[i] = a < b ? (sonde_half_edge){a, b, face, 1} : (sonde_half_edge){b, a, face, 0};
    }
    sort_by_end(edges, scratch, count, false, start, mesh->vertex_count);
    sort_by_end(scratch, edges, count, true, start, mesh->vertex_count);
    *sorted = edges;
    edges = NULL;
  }
  sonde_free(edges);
  sonde_free(scratch);
  sonde_free(start);
  return *sorted ? SONDE_OK : sonde_fail_memory(error);
}

// ---- inspection ---------------------------------------------------------------------------

static int compare_triples(const void *a, const void *b) {
  const uint32_t *x = a, *y = b;
  for (int k = 0; k < 3; ++k)
    if (x[k] != y[k]) return x[k] < y[k] ? -1 : 1;
  return 0;
}

static void swap_down(uint32_t *low, uint32_t *high) {
  if (*low <= *high) return;
  uint32_t swap = *low;
  *low = *high;
  *high = swap;
}

sonde_status sonde_mesh_inspect(const sonde_mesh *mesh, sonde_mesh_report *report,
                                sonde_error *error) {
  SONDE_ASSERT(mesh != NULL && report != NULL);
  *report = (sonde_mesh_report){0};
  sonde_half_edge *sides = NULL;
  sonde_status status = sonde_half_edges_sort(mesh, &sides, error);
  if (status) return status;

  // Length of each edge; a closed surface has two sides of opposite direction at every one.
  size_t count = 3 * (size_t)mesh->face_count, next;
  report->closed = count > 0;
  for (size_t i = 0; i < count; i = next) {
    for (next = i + 1; next < count; ++next)
      if (sides[next].low != sides[i].low || sides[next].high != sides[i].high) break;
    bool pair = next - i == 2 && sides[i].forward != sides[i + 1].forward;
    if (!pair || sides[i].low == sides[i].high) report->closed = false;
    if (sides[i].low == sides[i].high) continue;
    double length = v_distance(mesh->vertices[sides[i].low], mesh->vertices[sides[i].high]);
    if (!report->edge_count || length < report->shortest_edge_m) report->shortest_edge_m = length;
    if (length > report->longest_edge_m) report->longest_edge_m = length;
    report->mean_edge_m += length;
    report->edge_count++;
    if (next - i == 1) report->boundary_edges++;
  }
  if (report->edge_count) report->mean_edge_m /= report->edge_count;
  sonde_free(sides);

  // Faces that have the same three vertices as another one.
  uint32_t(*sorted)[3] = sonde_calloc(mesh->face_count, sizeof *sorted);
  if (!sorted) return sonde_fail_memory(error);
  for (uint32_t f = 0; f < mesh->face_count; ++f) {
    memcpy(sorted[f], mesh->faces[f], sizeof *sorted);
    swap_down(&sorted[f][0], &sorted[f][1]);
    swap_down(&sorted[f][1], &sorted[f][2]);
    swap_down(&sorted[f][0], &sorted[f][1]);
  }
  qsort(sorted, mesh->face_count, sizeof *sorted, compare_triples);
  for (uint32_t f = 1; f < mesh->face_count; ++f)
    if (!compare_triples(sorted[f - 1], sorted[f])) report->duplicate_or_degenerate_faces++;
  sonde_free(sorted);

  // Area, enclosed volume and angles; faces with a repeated vertex or without area compared with
  // their longest side.
  report->smallest_angle_rad = mesh->face_count ? SONDE_PI : 0;
  sonde_vec3 origin = mesh->vertex_count ? mesh->vertices[0] : vec3(0, 0, 0);
  for (uint32_t f = 0; f < mesh->face_count; ++f) {
    const uint32_t *v = mesh->faces[f];
    sonde_vec3 cross = sonde_face_cross(mesh, f);
    double area = 0.5 * v_norm(cross), longest2 = 0;
    report->area_m2 += area;
    report->volume_m3 += v_dot(v_sub(mesh->vertices[v[0]], origin), cross) / 6.0;
    for (int k = 0; k < 3; ++k) {
      sonde_vec3 a = mesh->vertices[v[k]], b = mesh->vertices[v[(k + 1) % 3]];
      double angle = sonde_corner_angle(a, b, mesh->vertices[v[(k + 2) % 3]]);
      report->smallest_angle_rad = fmin(report->smallest_angle_rad, angle);
      longest2 = fmax(longest2, v_norm2(v_sub(a, b)));
    }
    bool repeated = v[0] == v[1] || v[1] == v[2] || v[2] == v[0];
    if (repeated || !(area > 1e-12 * longest2)) report->duplicate_or_degenerate_faces++;
  }
  report->outward = report->closed && report->volume_m3 > 0;
  return SONDE_OK;
}

// ---- integrals ----------------------------------------------------------------------------

sonde_status sonde_mesh_mass(const sonde_mesh *mesh, double density_kg_m3, sonde_mass *mass,
                             sonde_error *error) {
  *mass = (sonde_mass){0};
  SONDE_ASSERT(mesh != NULL);
  if (!(density_kg_m3 >= 0 && isfinite(density_kg_m3)))
    return sonde_fail(error, SONDE_ARGUMENT, "density %g kg/m^3, expected 0 or more",
                      density_kg_m3);
  sonde_mesh_report report;
  sonde_status status = sonde_mesh_inspect(mesh, &report, error);
  if (status) return status;
  if (!report.closed)
    return sonde_fail(error, SONDE_MESH,
                      "the mesh is not closed (%u boundary edges), expected a closed surface",
                      report.boundary_edges);

  // Signed integrals of 1, x and x x^T over the tetrahedra (origin, face), about a point near the
  // body, so that nothing large cancels. With s = a + b + c and D = a . (b x c): volume D/6, first
  // moment D s/24, second moment D (a a^T + b b^T + c c^T + s s^T)/120.
  sonde_vec3 origin = mesh->vertices[mesh->faces[0][0]], first = vec3(0, 0, 0);
  double volume = 0;
  sonde_mat3 second = m_zero();
  for (uint32_t f = 0; f < mesh->face_count; ++f) {
    const uint32_t *v = mesh->faces[f];
    sonde_vec3 a = v_sub(mesh->vertices[v[0]], origin), b = v_sub(mesh->vertices[v[1]], origin);
    sonde_vec3 c = v_sub(mesh->vertices[v[2]], origin), s = v_add(a, v_add(b, c));
    double det = v_dot(a, v_cross(b, c));
    volume += det / 6.0;
    first = v_madd(first, det / 24.0, s);
    const sonde_vec3 terms[4] = {a, b, c, s};
    for (int k = 0; k < 4; ++k) second = m_add(second, m_rank1(terms[k], det / 120.0, 0));
  }
  if (!(volume > 0))
    return sonde_fail(error, SONDE_MESH,
                      "the mesh encloses no positive volume, expected faces "
                      "counter-clockwise seen from outside");

  sonde_vec3 centre = v_scale(first, 1.0 / volume);
  sonde_mat3 covariance = m_add(second, m_rank1(centre, -volume, 0));
  double trace = covariance.m[0][0] + covariance.m[1][1] + covariance.m[2][2];
  mass->mass_kg = density_kg_m3 * volume;
  mass->centre_m = v_add(origin, centre);
  mass->inertia_kg_m2 = m_scale(m_add(m_diag(trace), m_scale(covariance, -1.0)), density_kg_m3);
  return SONDE_OK;
}

void sonde_mesh_normals(const sonde_mesh *mesh, sonde_vec3 *normals) {
  if (mesh->vertex_count) memset(normals, 0, mesh->vertex_count * sizeof *normals);
  for (uint32_t f = 0; f < mesh->face_count; ++f) {
    sonde_vec3 cross = sonde_face_cross(mesh, f);
    for (int k = 0; k < 3; ++k) {
      SONDE_ASSERT(mesh->faces[f][k] < mesh->vertex_count);
      sonde_vec3 *normal = &normals[mesh->faces[f][k]];
      *normal = v_add(*normal, cross);
    }
  }
  for (uint32_t v = 0; v < mesh->vertex_count; ++v) normals[v] = v_unit(normals[v], vec3(0, 0, 1));
}

void sonde_mesh_areas(const sonde_mesh *mesh, double *areas_m2) {
  for (uint32_t v = 0; v < mesh->vertex_count; ++v) areas_m2[v] = 0;
  for (uint32_t f = 0; f < mesh->face_count; ++f) {
    double third = v_norm(sonde_face_cross(mesh, f)) / 6.0;
    for (int k = 0; k < 3; ++k) {
      SONDE_ASSERT(mesh->faces[f][k] < mesh->vertex_count);
      areas_m2[mesh->faces[f][k]] += third;
    }
  }
}
