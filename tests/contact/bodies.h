// Bodies and sums that the tests of the contact room share.
#ifndef SONDE_TESTS_CONTACT_BODIES_H
#define SONDE_TESTS_CONTACT_BODIES_H

#include "geometry/shapes.h"
#include "contact/contact.h"

static inline sonde_face_tree *body_tree(const sonde_mesh *mesh) {
  sonde_face_tree *tree = NULL;
  assert_ok(sonde_face_tree_create(mesh, &tree, &shape_error));
  return tree;
}

// A concave body: a ball whose surface waves.
static inline sonde_mesh body_wavy(uint32_t n, double radius) {
  sonde_mesh mesh = shape_sphere(n, 1);
  for (uint32_t v = 0; v < mesh.vertex_count; ++v) {
    sonde_vec3 p = mesh.vertices[v];
    double wave = 1 + 0.3 * sin(5 * p.x) * sin(4 * p.y + 1) + 0.2 * sin(7 * p.z);
    mesh.vertices[v] = v_scale(p, radius * wave);
  }
  return mesh;
}

static inline void body_shift(sonde_mesh *mesh, double x, double y, double z) {
  shape_move(mesh, (sonde_pose){{x, y, z}, {1, 0, 0, 0}});
}

// A box of nx x ny x nz cells around the origin from which the cells where keep() is false are
// missing: closed, concave, with corners inwards and outwards. Spacing h (m).
typedef bool (*keep_fn)(int x, int y, int z);

static inline sonde_mesh body_cells(int nx, int ny, int nz, double h, keep_fn keep) {
  static const int way[6][3] = {{1, 0, 0},  {-1, 0, 0}, {0, 1, 0},
                                {0, -1, 0}, {0, 0, 1},  {0, 0, -1}};
  const int n[3] = {nx, ny, nz};
  size_t corners = (size_t)(nx + 1) * (size_t)(ny + 1) * (size_t)(nz + 1);
  size_t room = 12 * (size_t)nx * (size_t)ny * (size_t)nz;
  uint32_t *number = malloc(corners * sizeof *number), vertices = 0, faces = 0;
  sonde_mesh mesh;
  assert_ok(sonde_mesh_create(&mesh, (uint32_t)corners, (uint32_t)room, &shape_error));
  memset(number, 0xff, corners * sizeof *number);
  for (int cell = 0; cell < nx * ny * nz; ++cell) {
    const int at[3] = {cell % nx, cell / nx % ny, cell / nx / ny};
    if (!keep(at[0], at[1], at[2])) continue;
    for (int w = 0; w < 6; ++w) {
      int next[3], out = 0;
      for (int k = 0; k < 3; ++k) {
        next[k] = at[k] + way[w][k];
        out |= next[k] < 0 || next[k] >= n[k];
      }
      if (!out && keep(next[0], next[1], next[2])) continue;
      int axis = w / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
      uint32_t quad[4];
      for (int q = 0; q < 4; ++q) {
        int p[3] = {at[0], at[1], at[2]};
        int turn = w % 2 ? 3 - q : q; // outwards
        p[axis] += w % 2 ? 0 : 1;
        p[u] += turn == 1 || turn == 2;
        p[v] += turn >= 2;
        size_t c =
            (size_t)p[0] + (size_t)(nx + 1) * ((size_t)p[1] + (size_t)(ny + 1) * (size_t)p[2]);
        if (number[c] == UINT32_MAX) {
          number[c] = vertices;
          mesh.vertices[vertices++] =
              vec3((p[0] - 0.5 * nx) * h, (p[1] - 0.5 * ny) * h, (p[2] - 0.5 * nz) * h);
        }
        quad[q] = number[c];
      }
      memcpy(mesh.faces[faces++], (uint32_t[3]){quad[0], quad[1], quad[2]}, sizeof mesh.faces[0]);
      memcpy(mesh.faces[faces++], (uint32_t[3]){quad[0], quad[2], quad[3]}, sizeof mesh.faces[0]);
    }
  }
  mesh.vertex_count = vertices;
  mesh.face_count = faces;
  free(number);
  return mesh;
}

// An overlap of two meshes as they stand.
typedef struct body_pair {
  const sonde_mesh *a, *b;
  sonde_face_tree *tree_a, *tree_b;
  sonde_overlap *overlap;
  const sonde_overlap_result *result;
} body_pair;

static inline body_pair body_pair_make(const sonde_mesh *a, const sonde_mesh *b) {
  body_pair pair = {a, b, body_tree(a), body_tree(b), NULL, NULL};
  assert_ok(sonde_overlap_create(pair.tree_a, pair.tree_b, NULL, &pair.overlap, &shape_error));
  pair.result = sonde_overlap_get(pair.overlap);
  return pair;
}

static inline void body_pair_clear(body_pair *pair) {
  sonde_overlap_destroy(pair->overlap);
  sonde_face_tree_destroy(pair->tree_a);
  sonde_face_tree_destroy(pair->tree_b);
}

// Volume at the present vertices.
static inline double body_volume(body_pair *pair, sonde_vec3 hint) {
  sonde_face_tree_refit(pair->tree_a, pair->a->vertices);
  sonde_face_tree_refit(pair->tree_b, pair->b->vertices);
  sonde_overlap_compute(pair->overlap, pair->tree_a, pair->tree_b, hint);
  assert_int_equal(pair->result->flags, 0);
  return pair->result->volume_m3;
}

// Volume common to two closed meshes by points on a jittered grid over the boxes' common part:
// inside tests only.
static inline double body_counted(const sonde_mesh *a, const sonde_mesh *b, uint32_t cells) {
  sonde_surface_index *ia = NULL, *ib = NULL;
  assert_ok(sonde_surface_index_create(a, &ia, &shape_error));
  assert_ok(sonde_surface_index_create(b, &ib, &shape_error));
  sonde_vec3 low = vec3(-INFINITY, -INFINITY, -INFINITY), high = v_neg(low);
  const sonde_mesh *mesh[2] = {a, b};
  for (int m = 0; m < 2; ++m) {
    sonde_vec3 l = vec3(INFINITY, INFINITY, INFINITY), h = v_neg(l);
    for (uint32_t v = 0; v < mesh[m]->vertex_count; ++v) {
      sonde_vec3 p = mesh[m]->vertices[v];
      l = vec3(fmin(l.x, p.x), fmin(l.y, p.y), fmin(l.z, p.z));
      h = vec3(fmax(h.x, p.x), fmax(h.y, p.y), fmax(h.z, p.z));
    }
    low = vec3(fmax(low.x, l.x), fmax(low.y, l.y), fmax(low.z, l.z));
    high = vec3(fmin(high.x, h.x), fmin(high.y, h.y), fmin(high.z, h.z));
  }
  uint64_t seed = 17, inside = 0;
  sonde_vec3 step = v_scale(v_sub(high, low), 1.0 / cells);
  for (uint32_t i = 0; i < cells * cells * cells; ++i) {
    sonde_vec3 p = low;
    p.x += step.x * (i % cells + shape_uniform(&seed, 0, 1));
    p.y += step.y * (i / cells % cells + shape_uniform(&seed, 0, 1));
    p.z += step.z * (i / cells / cells + shape_uniform(&seed, 0, 1));
    inside += sonde_surface_inside(ia, p) && sonde_surface_inside(ib, p);
  }
  sonde_surface_index_destroy(ia);
  sonde_surface_index_destroy(ib);
  return (double)inside * step.x * step.y * step.z;
}

#endif
