// Primitive bodies as closed triangle meshes.
//              per square, whose diagonals alternate.
#include "scene/shape.h"

#include "base/base.h"
#include "base/maths.h"
#include "scene/scene.h"

// Cells of at most edge_m along a length; one cell when edge_m is 0.
static sonde_status cells(double length_m, double edge_m, uint32_t most, uint32_t *count,
                          sonde_error *error) {
  double wanted = edge_m > 0 ? fmax(1, ceil(length_m / edge_m - 1e-9)) : 1;
  if (!(wanted <= most))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "edge_mm is %g, which makes %.6g edges along %g mm; expected at most %u, an "
                      "edge_mm of %.3g or more",
                      edge_m * 1e3, wanted, length_m * 1e3, most, 1.005e3 * length_m / most);
  *count = (uint32_t)wanted;
  return SONDE_OK;
}

uint32_t sonde_grid_index(const uint32_t n[3], const uint32_t at[3]) {
  return (at[2] * (n[1] + 1) + at[1]) * (n[0] + 1) + at[0];
}

typedef struct grid {
  uint32_t n[3];
  uint32_t *number; // [grid points] index in the mesh + 1, 0 for none yet
  uint32_t *place;  // [vertices] index in the grid
  uint32_t vertices, faces;
  sonde_mesh *mesh;
} grid;

static void add_face(grid *g, uint32_t a, uint32_t b, uint32_t c) {
  SONDE_ASSERT(a != b && b != c && g->faces < g->mesh->face_count);
  uint32_t *f = g->mesh->faces[g->faces++];
  f[0] = a, f[1] = b, f[2] = c;
}

// One side: axis `a` held at its low or high end; u, v turn right-handed around the outward normal.
static void add_side(grid *g, int a, bool high) {
  int u = high ? (a + 1) % 3 : (a + 2) % 3, v = high ? (a + 2) % 3 : (a + 1) % 3;
  uint32_t at[3];
  for (uint32_t j = 0; j < g->n[v]; ++j)
    for (uint32_t i = 0; i < g->n[u]; ++i) {
      uint32_t corner[4];
      for (uint32_t k = 0; k < 4; ++k) {
        at[a] = high ? g->n[a] : 0;
        at[u] = i + (k == 1 || k == 2);
        at[v] = j + (k >= 2);
        uint32_t index = sonde_grid_index(g->n, at);
        if (!g->number[index]) {
          SONDE_ASSERT(g->vertices < g->mesh->vertex_count);
          g->mesh->vertices[g->vertices] = vec3(at[0], at[1], at[2]);
          g->place[g->vertices] = index;
          g->number[index] = ++g->vertices;
        }
        corner[k] = g->number[index] - 1;
      }
      uint32_t turn = (i + j + at[a]) & 1u;
      add_face(g, corner[turn], corner[turn + 1], corner[(turn + 2) & 3u]);
      add_face(g, corner[turn], corner[(turn + 2) & 3u], corner[(turn + 3) & 3u]);
    }
}

sonde_status sonde_grid_skin(const uint32_t n[3], sonde_mesh *mesh, uint32_t **place,
                             sonde_error *error) {
  SONDE_ASSERT(n[0] && n[1] && n[2]);
  uint32_t squares = 2 * (n[0] * n[1] + n[1] * n[2] + n[2] * n[0]);
  uint32_t points = (n[0] + 1) * (n[1] + 1) * (n[2] + 1);
  grid g = {.n = {n[0], n[1], n[2]}, .mesh = mesh};
  sonde_status status = sonde_mesh_create(mesh, squares + 2, 2 * squares, error);
  if (status) return status;
  g.number = SONDE_NEW(uint32_t, points);
  g.place = SONDE_NEW(uint32_t, squares + 2);
  if (!g.number || !g.place) {
    sonde_free(g.number);
    sonde_free(g.place);
    sonde_mesh_clear(mesh);
    return sonde_fail_memory(error);
  }
  for (int a = 0; a < 3; ++a) {
    add_side(&g, a, false);
    add_side(&g, a, true);
  }
  SONDE_ASSERT(g.vertices == mesh->vertex_count && g.faces == mesh->face_count);
  sonde_free(g.number);
  *place = g.place;
  return SONDE_OK;
}

sonde_status sonde_shape_box(sonde_vec3 size, double edge_m, sonde_mesh *mesh, sonde_error *error) {
  SONDE_ASSERT(size.x > 0 && size.y > 0 && size.z > 0);
  const double length_m[3] = {size.x, size.y, size.z};
  uint32_t n[3], *place = NULL;
  sonde_status status = SONDE_OK;
  for (int k = 0; k < 3 && !status; ++k) status = cells(length_m[k], edge_m, 400, &n[k], error);
  if (!status) status = sonde_grid_skin(n, mesh, &place, error);
  if (status) return status;
  sonde_free(place);
  for (uint32_t i = 0; i < mesh->vertex_count; ++i) {
    sonde_vec3 *p = &mesh->vertices[i];
    *p = vec3((p->x / n[0] - 0.5) * size.x, (p->y / n[1] - 0.5) * size.y,
              (p->z / n[2] - 0.5) * size.z);
  }
  return SONDE_OK;
}

static double spread(double t) { return tan(SONDE_PI / 4 * (2 * t - 1)); }

// A cube's grid blown up to the sphere, then scaled along the axes.
sonde_status sonde_shape_ellipsoid(sonde_vec3 radii, double edge_m, sonde_mesh *mesh,
                                   sonde_error *error) {
  SONDE_ASSERT(radii.x > 0 && radii.y > 0 && radii.z > 0);
  double largest = fmax(radii.x, fmax(radii.y, radii.z));
  uint32_t side = 8;
  sonde_status status =
      edge_m > 0 ? cells(0.5 * SONDE_PI * largest, edge_m, 200, &side, error) : SONDE_OK;
  if (status) return status;
  if (side < 2) side = 2;
  const uint32_t n[3] = {side, side, side};
  uint32_t *place = NULL;
  status = sonde_grid_skin(n, mesh, &place, error);
  if (status) return status;
  sonde_free(place);
  for (uint32_t i = 0; i < mesh->vertex_count; ++i) {
    sonde_vec3 p = mesh->vertices[i];
    p = v_unit(vec3(spread(p.x / side), spread(p.y / side), spread(p.z / side)), vec3(0, 0, 1));
    mesh->vertices[i] = vec3(p.x * radii.x, p.y * radii.y, p.z * radii.z);
  }
  return SONDE_OK;
}

sonde_status sonde_shape_sheet(double x_m, double y_m, double edge_m, sonde_mesh *mesh,
                               sonde_error *error) {
  SONDE_ASSERT(x_m > 0 && y_m > 0);
  uint32_t n[2] = {1, 1};
  sonde_status status = cells(x_m, edge_m, 400, &n[0], error);
  if (!status) status = cells(y_m, edge_m, 400, &n[1], error);
  if (!status) status = sonde_mesh_create(mesh, (n[0] + 1) * (n[1] + 1), 2 * n[0] * n[1], error);
  if (status) return status;
  for (uint32_t i = 0; i < mesh->vertex_count; ++i)
    mesh->vertices[i] = vec3((1.0 * (i % (n[0] + 1)) / n[0] - 0.5) * x_m,
                             (1.0 * (i / (n[0] + 1)) / n[1] - 0.5) * y_m, 0);
  for (uint32_t f = 0; f < n[0] * n[1]; ++f) {
    uint32_t first = f / n[0] * (n[0] + 1) + f % n[0], turn = (f % n[0] + f / n[0]) & 1u;
    const uint32_t corner[4] = {first, first + 1, first + n[0] + 2, first + n[0] + 1};
    for (uint32_t k = 0; k < 2; ++k)
      for (uint32_t c = 0; c < 3; ++c)
        mesh->faces[2 * f + k][c] = corner[(turn + (c ? c + k : 0)) & 3u];
  }
  return SONDE_OK;
}

typedef struct cylinder {
  uint32_t around, along, rings; // segments of a circle, of the side, and of a cap's radius
  double radius_m, length_m;
  sonde_mesh *mesh;
  uint32_t vertices, faces;
} cylinder;

static uint32_t ring(cylinder *c, double radius_m, double z_m) {
  SONDE_ASSERT(c->vertices + c->around <= c->mesh->vertex_count);
  uint32_t first = c->vertices;
  for (uint32_t i = 0; i < c->around; ++i) {
    double angle = 2 * SONDE_PI * i / c->around;
    c->mesh->vertices[c->vertices++] = vec3(radius_m * cos(angle), radius_m * sin(angle), z_m);
  }
  return first;
}

static void triangle(cylinder *c, uint32_t p, uint32_t q, uint32_t r, bool flip) {
  SONDE_ASSERT(c->faces < c->mesh->face_count);
  uint32_t *f = c->mesh->faces[c->faces++];
  f[0] = p, f[1] = flip ? r : q, f[2] = flip ? q : r;
}

// A band between two circles; seen with `inner` below `outer`, facing the viewer unless flipped.
static void band(cylinder *c, uint32_t lower, uint32_t upper, bool flip) {
  for (uint32_t i = 0; i < c->around; ++i) {
    uint32_t j = (i + 1) % c->around;
    triangle(c, lower + i, lower + j, upper + j, flip);
    triangle(c, lower + i, upper + j, upper + i, flip);
  }
}

// Rings from the rim inwards, then a fan around the middle.
static void cap(cylinder *c, uint32_t rim, double z_m, bool bottom) {
  uint32_t outer = rim;
  for (uint32_t k = c->rings - 1; k > 0; --k) {
    uint32_t inner = ring(c, c->radius_m * k / c->rings, z_m);
    band(c, outer, inner, bottom);
    outer = inner;
  }
  uint32_t middle = c->vertices;
  c->mesh->vertices[c->vertices++] = vec3(0, 0, z_m);
  for (uint32_t i = 0; i < c->around; ++i)
    triangle(c, outer + i, outer + (i + 1) % c->around, middle, bottom);
}

sonde_status sonde_shape_cylinder(double radius_m, double length_m, double edge_m, sonde_mesh *mesh,
                                  sonde_error *error) {
  SONDE_ASSERT(radius_m > 0 && length_m > 0);
  cylinder c = {.around = 48, .radius_m = radius_m, .length_m = length_m, .mesh = mesh};
  sonde_status status = cells(length_m, edge_m, 2000, &c.along, error);
  if (!status) status = cells(radius_m, edge_m, 400, &c.rings, error);
  if (!status && edge_m > 0)
    status = cells(2 * SONDE_PI * radius_m, edge_m, 2000, &c.around, error);
  if (status) return status;
  if (c.around < 12) c.around = 12;
  uint32_t vertices = c.around * (c.along + 1 + 2 * (c.rings - 1)) + 2;
  uint32_t faces = 2 * c.around * (c.along + 2 * (c.rings - 1)) + 2 * c.around;
  status = sonde_mesh_create(mesh, vertices, faces, error);
  if (status) return status;
  uint32_t bottom = ring(&c, radius_m, -0.5 * length_m), lower = bottom;
  for (uint32_t k = 1; k <= c.along; ++k) {
    uint32_t upper = ring(&c, radius_m, length_m * (1.0 * k / c.along - 0.5));
    band(&c, lower, upper, false);
    lower = upper;
  }
  cap(&c, bottom, -0.5 * length_m, true);
  cap(&c, lower, 0.5 * length_m, false);
  SONDE_ASSERT(c.vertices == vertices && c.faces == faces);
  return SONDE_OK;
}
