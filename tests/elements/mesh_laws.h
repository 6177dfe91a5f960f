// Laws of every tetrahedral mesh. Include after the room's shapes or fixture, which have
// assert_near.
#ifndef SONDE_TESTS_MESH_LAWS_H
#define SONDE_TESTS_MESH_LAWS_H

#include "elements/tetrahedra.h"
#include "elements/index_map.h"

#define DEGREES (180 / SONDE_PI)

typedef struct mesh_bounds {
  double least_angle, most_angle; // degrees
  double off_edges;               // the boundary's distance from the surface over the edge
  double volume_share;            // of what is missing or too much
} mesh_bounds;

static inline uint64_t pair_key(uint32_t a, uint32_t b) {
  return a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a;
}

// Nodes - edges + faces - tetrahedra: 1 for a ball, 0 for a ring, 2 for a hollow ball.
static inline int euler_characteristic(const sonde_tetrahedra *t) {
  sonde_index_map edges = {0};
  bool added;
  for (uint32_t k = 0; k < t->count; ++k)
    for (int a = 0; a < 4; ++a)
      for (int b = a + 1; b < 4; ++b)
        assert_non_null(
            sonde_index_map_add(&edges, pair_key(t->corner[k][a], t->corner[k][b]), &added));
  // Every tetrahedron has four faces, of which two share those inside.
  int faces = (int)(4 * t->count + t->boundary.face_count) / 2;
  int value = (int)t->node_count - (int)edges.count + faces - (int)t->count;
  sonde_index_map_clear(&edges);
  return value;
}

static inline double volume_of(const sonde_mesh *mesh) {
  sonde_mesh_report report;
  assert_int_equal(sonde_mesh_inspect(mesh, &report, NULL), SONDE_OK);
  return report.volume_m3;
}

static inline sonde_tetrahedra make_mesh(const sonde_mesh *outer, const sonde_mesh *inner,
                                         const sonde_tetrahedra_def *def) {
  sonde_tetrahedra t;
  sonde_error error = {0};
  if (sonde_tetrahedralise(outer, inner, def, &t, &error)) fail_msg("%s", error.message);
  return t;
}

// Conforming, positive, angles, place of the boundary, volume.
static inline void holds_the_laws(const char *name, const sonde_tetrahedra *t,
                                  const sonde_mesh *outer, const sonde_mesh *inner, double edge_m,
                                  double volume_m3, const mesh_bounds *bounds) {
  sonde_tetrahedra_report r;
  sonde_error error = {0};
  assert_int_equal(sonde_tetrahedra_inspect(t, outer, inner, &r, &error), SONDE_OK);
  sonde_mesh_report skin;
  assert_int_equal(sonde_mesh_inspect(&t->boundary, &skin, &error), SONDE_OK);
  print_message(
      "%s: %u nodes, %u tetrahedra, %u + %u on the boundary, angles %.1f to %.1f degrees, "
      "edge %.2f, boundary off by %.3f edges, volume %+.2f %%\n",
      name, t->node_count, t->count, t->surface_count, t->held_count,
      r.smallest_dihedral_rad * DEGREES, r.largest_dihedral_rad * DEGREES, r.mean_edge_m / edge_m,
      r.off_surface_m / edge_m, 100 * (r.volume_m3 / volume_m3 - 1));
  assert_true(skin.closed && skin.outward);
  assert_int_equal(t->boundary.vertex_count, t->surface_count + t->held_count);
  assert_near(r.volume_m3, skin.volume_m3, 1e-11 * volume_m3);
  assert_true(r.smallest_volume_m3 > 0);
  assert_true(r.smallest_dihedral_rad * DEGREES >= bounds->least_angle);
  assert_true(r.largest_dihedral_rad * DEGREES <= bounds->most_angle);
  assert_true(r.off_surface_m <= bounds->off_edges * edge_m);
  assert_true(fabs(r.volume_m3 / volume_m3 - 1) <= bounds->volume_share);
  // Nodes of the boundary are the first ones; every other lies inside.
  sonde_surface_index *index = NULL;
  assert_int_equal(sonde_surface_index_create(&t->boundary, &index, NULL), SONDE_OK);
  for (uint32_t i = 0; i < t->node_count; ++i)
    if (i < t->boundary.vertex_count)
      assert_memory_equal(&t->node[i], &t->boundary.vertices[i], sizeof t->node[i]);
    else
      assert_true(sonde_surface_inside(index, t->node[i]));
  sonde_surface_index_destroy(index);
}

#endif
