// The comparison scene: a geodesic ellipsoid of N = 10 f^2 + 2 nodes, total mass 5 kg (times
// size^2), radial springs of 5e5 N/m^3 per area, surface springs of the stiffness asked for, a ball
// of 30 mm.
#include "bench_ellipsoid.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double RADII_M[3] = {0.10, 0.04, 0.04};
static const double RADIAL_N_M3 = 5e5, MASS_KG = 5, CONTACT_N_M3 = 2e7;

typedef struct point {
  double at[3];
  uint32_t place; // in the list with repetitions
} point;

static int by_place(const void *a, const void *b) {
  const point *p = a, *q = b;
  for (int c = 0; c < 3; ++c)
    if (fabs(p->at[c] - q->at[c]) > 1e-9) return p->at[c] < q->at[c] ? -1 : 1;
  return 0;
}

static uint32_t row_start(uint32_t f, uint32_t i) { return i * (f + 1) - i * (i - 1) / 2; }

// The icosahedron with each edge in f parts, on the ellipsoid.
static sonde_status geodesic(uint32_t f, double size, sonde_mesh *mesh, sonde_error *error) {
  assert(f > 0 && size > 0);
  uint32_t per_face = (f + 1) * (f + 2) / 2, count = 20 * per_face, used = 0;
  double v[12][3] = {0};
  int faces[20][3];
  sonde_status status = sonde_mesh_create(mesh, 10 * f * f + 2, 20 * f * f, error);
  if (status) return status;
  point *points = malloc(count * sizeof *points), *out = points;
  uint32_t *number = malloc(count * sizeof *number);
  if (!points || !number) {
    free(points);
    free(number);
    return error->status = SONDE_MEMORY;
  }

  // Vertices and faces of the icosahedron, a vertex on +z.
  double height = 1 / sqrt(5.0), ring = 2 / sqrt(5.0), turn = 4 * atan(1.0) / 5;
  v[0][2] = 1, v[11][2] = -1;
  for (int k = 0; k < 5; ++k) {
    for (int low = 0; low < 2; ++low) {
      double *p = v[1 + k + 5 * low], angle = turn * (2 * k + low);
      p[0] = ring * cos(angle), p[1] = ring * sin(angle), p[2] = low ? -height : height;
    }
    int a = 1 + k, b = 1 + (k + 1) % 5, c = 6 + k, d = 6 + (k + 1) % 5;
    const int four[4][3] = {{0, a, b}, {a, c, b}, {b, c, d}, {11, d, c}};
    memcpy(faces[4 * k], four, sizeof four);
  }

  // Points of every face on the unit sphere; those on its edges repeat.
  for (uint32_t k = 0; k < 20; ++k)
    for (uint32_t i = 0; i <= f; ++i)
      for (uint32_t j = 0; i + j <= f; ++j, ++out) {
        const int *face = faces[k];
        double radius = 0;
        for (int c = 0; c < 3; ++c) {
          out->at[c] = (f - i - j) * v[face[0]][c] + i * v[face[1]][c] + j * v[face[2]][c];
          radius += out->at[c] * out->at[c];
        }
        for (int c = 0; c < 3; ++c) out->at[c] /= sqrt(radius);
        out->place = (uint32_t)(out - points);
      }

  // Each place once, in the order of its coordinates.
  qsort(points, count, sizeof *points, by_place);
  for (uint32_t k = 0; k < count; ++k) {
    const double *at = points[k].at;
    if (k == 0 || by_place(&points[k - 1], &points[k]) != 0)
      mesh->vertices[used++] = (sonde_vec3){size * RADII_M[0] * at[0], size * RADII_M[1] * at[1],
                                            size * RADII_M[2] * at[2]};
    number[points[k].place] = used - 1;
  }
  assert(used == mesh->vertex_count);

  // Triangles, row by row of each face.
  uint32_t triangle = 0;
  for (uint32_t face = 0; face < 20; ++face)
    for (uint32_t i = 0; i < f; ++i)
      for (uint32_t j = 0; i + j < f; ++j) {
        const uint32_t *row = number + face * per_face + row_start(f, i);
        const uint32_t *next = number + face * per_face + row_start(f, i + 1);
        memcpy(mesh->faces[triangle++], ((uint32_t[3]){row[j], next[j], row[j + 1]}),
               sizeof *mesh->faces);
        if (i + j + 1 == f) continue;
        memcpy(mesh->faces[triangle++], ((uint32_t[3]){next[j], next[j + 1], row[j + 1]}),
               sizeof *mesh->faces);
      }
  free(points);
  free(number);
  return SONDE_OK;
}

sonde_status bench_ellipsoid_build(const bench_ellipsoid *def, sonde_model **model,
                                   sonde_error *error) {
  assert(def->nodes >= 42 && def->stiffness > 0);
  uint32_t f = (uint32_t)(sqrt((double)(def->nodes - 2) / 10) + 0.5);
  static const sonde_mesh NO_BONE = {0};
  sonde_mesh mesh = {0};
  sonde_mesh_report report;
  sonde_status status = geodesic(f > 1 ? f : 1, def->size, &mesh, error);
  if (!status) status = sonde_mesh_inspect(&mesh, &report, error);
  sonde_site site = {.position_m = {0, 0, def->size * RADII_M[2]},
                     .normal = {0, 0, 1},
                     .u = {0, 1, 0},
                     .v = {-1, 0, 0},
                     .k0_n_m3 = RADIAL_N_M3,
                     .xm_m = 1e3};
  sonde_model_def build = sonde_model_def_default();
  build.name = "ellipsoid";
  build.provenance = "synthetic: comparison scene";
  build.skin = &mesh;
  build.femur = &NO_BONE;
  build.sites = &site;
  build.site_count = 1;
  build.fine_edge_m = 1;
  build.law.edge_stiffness_n_m = def->stiffness;
  build.law.edge_compression = 1;
  build.law.tangential_stiffness_n_m3 = 1e6;
  build.law.normal_damping_s = 5e-3;
  if (!status) {
    build.law.surface_density_kg_m2 = MASS_KG * def->size * def->size / report.area_m2;
    status = sonde_model_build(&build, model, error);
  }
  // Springs act along the radii, as if fixed to an inner ellipsoid of 0.6 of the size.
  for (uint32_t i = 0; !status && i < (*model)->surface.vertex_count; ++i) {
    sonde_vec3 x = (*model)->surface.vertices[i];
    double r = sqrt(x.x * x.x + x.y * x.y + x.z * x.z);
    (*model)->normal[i] = (sonde_vec3){x.x / r, x.y / r, x.z / r};
  }
  sonde_mesh_clear(&mesh);
  return status;
}

sonde_world_def bench_ellipsoid_world(double dt_s) {
  sonde_world_def def = sonde_world_def_default();
  def.dt_s = dt_s;
  def.contact_law = SONDE_CONTACT_NODES;
  def.contact_stiffness_n_m3 = CONTACT_N_M3;
  def.contact_damping_n_s_m3 = 0;
  def.newton_iterations = 4;
  def.pcg = (sonde_pcg_options){0.1, 1e-12, 200};
  def.sleep_displacement_m = 5e-6;
  return def;
}

sonde_pose bench_ellipsoid_pose(const bench_ellipsoid *def, double time_s) {
  double depth = 0.02 * (time_s < 0.1 ? time_s / 0.1 : 1);
  double way = time_s > 0.3 ? 0.1 * (time_s - 0.3) : 0;
  // The beam axis z of the probe points down: half a turn about x.
  return (sonde_pose){{way, 0, def->size * RADII_M[2] - depth}, {0, 1, 0, 0}};
}
