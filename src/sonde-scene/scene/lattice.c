// Bodies of springs: surfaces from edges, lattices from cubes or from tetrahedra of a file.
// (tetrahedra: tetgen.c)
//
// A cube of edge s with springs k/4 along its 12 edges and k/2 along its 12 face diagonals has the
// energy of an isotropic solid with E = 2.5 k/s and Poisson's ratio 1/4, the only one that central
// forces allow (Cauchy): C11 = 3 k/s, C12 = C44 = k/s. docs/scene_theory.md.
#include "scene/lattice.h"

#include "base/base.h"
#include "base/maths.h"
#include "scene/shape.h"
#include "geometry/internal.h"

#include <string.h>

sonde_status sonde_body_allocate(sonde_body *body, uint32_t nodes, uint32_t springs,
                                 sonde_error *error) {
  SONDE_ASSERT(!body->node);
  body->node_count = nodes;
  body->spring_count = springs;
  body->node = SONDE_NEW(sonde_vec3, nodes);
  body->node_mass_kg = SONDE_NEW(double, nodes);
  body->held = SONDE_NEW(uint8_t, nodes);
  body->load_n = SONDE_NEW(sonde_vec3, nodes);
  body->pairs = sonde_calloc(springs, sizeof *body->pairs);
  body->spring = SONDE_NEW(sonde_spring, springs);
  bool good =
      body->node && body->node_mass_kg && body->held && body->load_n && body->pairs && body->spring;
  return good ? SONDE_OK : sonde_fail_memory(error);
}

// Total mass from the one of mass_kg, density_kg_m3 (closed) and density_kg_m2 that is given.
static double read_surface_mass(sonde_reader *reader, sonde_place at, const sonde_body *body) {
  static const char *const KEYS[] = {"mass_kg", "density_kg_m2", "density_kg_m3"};
  int found = -1;
  for (int k = 0; k < 3; ++k)
    if (sonde_read_find(reader, at, KEYS[k])) {
      if (found >= 0)
        sonde_reader_fail(reader, at, SONDE_FORMAT, "%s and %s are both given", KEYS[found],
                          KEYS[k]);
      found = k;
    }
  if (found < 0) {
    sonde_reader_fail(reader, at, SONDE_FORMAT,
                      "mass_kg, density_kg_m2 or density_kg_m3 is missing");
    return 0;
  }
  double value = sonde_read_real(reader, at, KEYS[found], 1e-9, 1e9, NAN);
  if (found == 0) return value;
  sonde_mesh_report report = {0};
  sonde_error error = {0};
  if (sonde_mesh_inspect(&body->surface, &report, &error)) sonde_reader_pass(reader, at, &error);
  if (found == 1) return value * report.area_m2;
  if (!report.closed || !report.outward)
    sonde_reader_fail(reader, at, SONDE_MESH,
                      "density_kg_m3 needs a closed mesh, this one has %u boundary edges",
                      report.boundary_edges);
  return value * report.volume_m3;
}

void sonde_read_springs(const sonde_scene_source *source, sonde_place at, sonde_body *body) {
  static const char *const KEYS[] = {
      "stiffness_n_m", "damping_n_s_m",     "bulk_n_m5", "thickness_mm",
      "bending_n_m",   "bending_damping_s", NULL};
  sonde_reader *reader = source->reader;
  sonde_topology topology = {0};
  sonde_error error = {0};
  sonde_status status = sonde_topology_build(&body->surface, &topology, &error);
  if (!status)
    status = sonde_body_allocate(body, body->surface.vertex_count, topology.edge_count, &error);
  if (status)
    sonde_reader_pass(reader, at, &error);
  else {
    sonde_place springs = sonde_read_find(reader, at, "springs");
    if (!springs) sonde_reader_fail(reader, at, SONDE_FORMAT, "springs is missing");
    sonde_read_keys(reader, springs, "springs", KEYS);
    double stiffness = sonde_read_real(reader, springs, "stiffness_n_m", 0, 1e9, NAN);
    double damper = sonde_read_real(reader, springs, "damping_n_s_m", 0, 1e6, 0);
    body->bulk_n_m5 = sonde_read_real(reader, springs, "bulk_n_m5", 0, 1e18, 0);
    memcpy(body->node, body->surface.vertices, body->node_count * sizeof *body->node);
    for (uint32_t e = 0; e < body->spring_count; ++e) {
      const uint32_t *pair = topology.edges[e];
      memcpy(body->pairs[e], pair, sizeof body->pairs[e]);
      body->spring[e] =
          (sonde_spring){v_distance(body->node[pair[0]], body->node[pair[1]]), stiffness, damper};
    }
    double mass_kg = read_surface_mass(reader, at, body);
    if (sonde_reader_good(reader)) {
      // The mass is shared by area; the last node takes what rounding left, so that the sum is the
      // mass.
      SONDE_ASSERT(mass_kg > 0 && body->node_count > 0);
      sonde_mesh_areas(&body->surface, body->node_mass_kg);
      double area = 0, sum = 0;
      for (uint32_t i = 0; i < body->node_count; ++i) area += body->node_mass_kg[i];
      for (uint32_t i = 0; i < body->node_count; ++i) {
        body->node_mass_kg[i] *= mass_kg / area;
        sum += body->node_mass_kg[i];
      }
      body->node_mass_kg[body->node_count - 1] += mass_kg - sum;
      sonde_read_sheet(reader, springs, body);
    }
  }
  sonde_topology_clear(&topology);
}

typedef struct cubes {
  uint32_t n[3];
  double side_m, youngs_pa, damping_s, density_kg_m3;
} cubes;

static const int DIRECTION[9][3] = {{1, 0, 0}, {0, 1, 0},  {0, 0, 1}, {1, 1, 0}, {1, -1, 0},
                                    {1, 0, 1}, {1, 0, -1}, {0, 1, 1}, {0, 1, -1}};

// Cells that contain both ends; 0 when the other end is outside the grid.
static uint32_t cells_around(const cubes *c, const uint32_t at[3], const int d[3],
                             uint32_t other[3]) {
  uint32_t cells = 1;
  for (int k = 0; k < 3; ++k) {
    int64_t to = (int64_t)at[k] + d[k];
    if (to < 0 || to > c->n[k]) return 0;
    other[k] = (uint32_t)to;
    if (d[k] == 0) cells *= (uint32_t)(at[k] > 0) + (uint32_t)(at[k] < c->n[k]);
  }
  return cells;
}

// The springs that start at one grid point; with a body, they are added to it.
static uint32_t point_springs(const cubes *c, const uint32_t at[3], sonde_body *body,
                              uint32_t used) {
  uint32_t i = sonde_grid_index(c->n, at), count = 0, other[3];
  for (int d = 0; d < 9; ++d) {
    uint32_t cells = cells_around(c, at, DIRECTION[d], other);
    if (!cells) continue;
    uint32_t e = used + count++, j = sonde_grid_index(c->n, other);
    if (!body) continue;
    double k = (d < 3 ? 0.1 : 0.2) * c->youngs_pa * c->side_m * cells;
    double rest = c->side_m * (d < 3 ? 1 : sqrt(2.0));
    body->pairs[e][0] = i < j ? i : j;
    body->pairs[e][1] = i < j ? j : i;
    body->spring[e] = (sonde_spring){rest, k, k * c->damping_s};
  }
  return count;
}

static void read_cells(const sonde_scene_source *source, sonde_place at, sonde_place lattice,
                       cubes *c, sonde_body *body) {
  static const int HERE[3] = {0, 0, 0};
  sonde_reader *reader = source->reader;
  sonde_place shape = sonde_read_find(reader, at, "shape");
  sonde_place box = sonde_read_find(reader, shape, "box_mm");
  if (!box) {
    sonde_reader_fail(reader, shape ? shape : at, SONDE_FORMAT,
                      "a lattice needs shape: {box_mm: [x, y, z]} or lattice: {tetrahedra: FILE}");
    return;
  }
  // Cells along each side: the box has to be made of whole cubes.
  sonde_vec3 size = sonde_read_vector_at(reader, box, "box_mm", SONDE_SCENE_FAR_MM);
  double edge_mm = sonde_read_real(reader, lattice, "cell_mm", 1e-3, 1e4, NAN), nodes = 1;
  const double length[3] = {size.x, size.y, size.z};
  for (int k = 0; k < 3 && sonde_reader_good(reader); ++k) {
    double whole = round(length[k] / edge_mm);
    if (!(whole >= 1) || fabs(whole * edge_mm - length[k]) > 1e-6 * edge_mm)
      sonde_reader_fail(reader, box, SONDE_ARGUMENT,
                        "a side of %g mm is not a whole number of cells of %g mm", length[k],
                        edge_mm);
    c->n[k] = (uint32_t)whole;
    nodes *= whole + 1;
  }
  if (sonde_reader_good(reader) && nodes > 2e5)
    sonde_reader_fail(reader, lattice, SONDE_ARGUMENT, "%.0f nodes, expected 200000 or fewer",
                      nodes);
  c->side_m = edge_mm * 1e-3;
  if (!sonde_reader_good(reader)) return;
  SONDE_ASSERT(c->n[0] && c->n[1] && c->n[2]);
  sonde_error error = {0};
  uint32_t rows = c->n[0] + 1, layers = rows * (c->n[1] + 1), points = layers * (c->n[2] + 1);
  uint32_t count = 0, used = 0, other[3];
  for (uint32_t i = 0; i < points; ++i)
    count +=
        point_springs(c, (const uint32_t[3]){i % rows, i % layers / rows, i / layers}, NULL, 0);
  sonde_status status = sonde_grid_skin(c->n, &body->surface, &body->surface_node, &error);
  if (!status) status = sonde_body_allocate(body, points, count, &error);
  if (status) {
    sonde_reader_pass(reader, at, &error);
    return;
  }
  double side = c->side_m, cube_kg = c->density_kg_m3 * side * side * side;
  for (uint32_t i = 0; i < points; ++i) {
    const uint32_t p[3] = {i % rows, i % layers / rows, i / layers};
    body->node[i] = vec3((p[0] - 0.5 * c->n[0]) * side, (p[1] - 0.5 * c->n[1]) * side,
                         (p[2] - 0.5 * c->n[2]) * side);
    body->node_mass_kg[i] = cube_kg / 8 * cells_around(c, p, HERE, other);
    used += point_springs(c, p, body, used);
  }
  SONDE_ASSERT(used == body->spring_count);
  for (uint32_t i = 0; i < body->surface.vertex_count; ++i)
    body->surface.vertices[i] = body->node[body->surface_node[i]];
}

void sonde_read_lattice(const sonde_scene_source *source, sonde_place at, sonde_body *body) {
  static const char *const KEYS[] = {"youngs_pa",  "damping_s", "cell_mm",
                                     "tetrahedra", "unit_mm",   NULL};
  sonde_reader *reader = source->reader;
  sonde_place lattice = sonde_read_find(reader, at, "lattice");
  if (!lattice) sonde_reader_fail(reader, at, SONDE_FORMAT, "lattice is missing");
  sonde_read_keys(reader, lattice, "lattice", KEYS);
  cubes c = {.youngs_pa = sonde_read_real(reader, lattice, "youngs_pa", 1, 1e12, NAN),
             .damping_s = sonde_read_real(reader, lattice, "damping_s", 0, 1e3, 0),
             .density_kg_m3 = sonde_read_real(reader, at, "density_kg_m3", 1e-3, 1e5, NAN)};
  if (!sonde_reader_good(reader)) return;
  const char *file = sonde_read_text(reader, lattice, "tetrahedra", false);
  if (file)
    sonde_read_tetrahedra(source, lattice, file,
                          (sonde_solid){c.youngs_pa, c.damping_s, c.density_kg_m3}, body);
  else
    read_cells(source, at, lattice, &c, body);
}
