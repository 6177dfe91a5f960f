/**
 * @file geometry.h
 * Triangle meshes and their files, adjacency, areas, refinement, closest points, convex probes,
 * distance between convex bodies (GJK) and the exact clipped interpenetration volume.
 */
#ifndef SONDE_GEOMETRY_H
#define SONDE_GEOMETRY_H

#include "sonde/base.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Triangle mesh; arrays are owned by the mesh and released by sonde_mesh_clear(). */
typedef struct sonde_mesh {
  uint32_t vertex_count;
  uint32_t face_count;
  sonde_vec3 *vertices; /**< [vertex_count] m */
  uint32_t (*faces)[3]; /**< [face_count] counter-clockwise seen from outside */
} sonde_mesh;
/** Allocates arrays of the given sizes (zeroed). @thread owner */
SONDE_API sonde_status sonde_mesh_create(sonde_mesh *mesh, uint32_t vertices, uint32_t faces,
                                         sonde_error *error);
/** Releases the arrays and zeroes the struct; NULL and empty meshes are ignored. @thread owner */
SONDE_API void sonde_mesh_clear(sonde_mesh *mesh);
/** Deep copy. @thread owner */
SONDE_API sonde_status sonde_mesh_copy(const sonde_mesh *mesh, sonde_mesh *copy,
                                       sonde_error *error);

/**
 * Reads .ply (ascii, binary little/big endian), .obj or .stl (ascii, binary; vertices welded).
 * Polygons are split into fans (meant for convex ones); .stl triangles with equal corners dropped.
 * @param metres_per_unit scale of the file's coordinates; 1e-3 for millimetres
 * @return SONDE_FORMAT with file, line and what was expected; SONDE_IO when it cannot be opened
 * @thread owner
 */
SONDE_API sonde_status sonde_mesh_load(const char *path, double metres_per_unit, sonde_mesh *mesh,
                                       sonde_error *error);
/** Writes .ply or .obj (ascii) or .stl (binary), by extension, atomically. @thread owner */
SONDE_API sonde_status sonde_mesh_save(const char *path, double metres_per_unit,
                                       const sonde_mesh *mesh, sonde_error *error);

/** Facts about a mesh. */
typedef struct sonde_mesh_report {
  bool closed;  /**< every edge has exactly two faces with opposite direction */
  bool outward; /**< closed and the enclosed volume is positive */
  uint32_t edge_count;
  uint32_t boundary_edges;
  uint32_t duplicate_or_degenerate_faces;
  double area_m2;
  double volume_m3; /**< signed; meaningful when closed */
  double shortest_edge_m, longest_edge_m, mean_edge_m;
  double smallest_angle_rad;
} sonde_mesh_report;
/** Measures the mesh. @return SONDE_MESH when a face names a missing vertex. @thread owner */
SONDE_API sonde_status sonde_mesh_inspect(const sonde_mesh *mesh, sonde_mesh_report *report,
                                          sonde_error *error);

/** Mass, centre and inertia of the solid that a closed mesh bounds, uniform density. */
typedef struct sonde_mass {
  double mass_kg;
  sonde_vec3 centre_m;
  sonde_mat3 inertia_kg_m2; /**< about the centre */
} sonde_mass;
/** Exact polyhedral integrals. @return SONDE_MESH when not closed. @thread owner */
SONDE_API sonde_status sonde_mesh_mass(const sonde_mesh *mesh, double density_kg_m3,
                                       sonde_mass *mass, sonde_error *error);

/** Edges, neighbours and weights of a triangle surface. Released by sonde_topology_clear(). */
typedef struct sonde_topology {
  uint32_t vertex_count, edge_count;
  uint32_t (*edges)[2];      /**< [edge_count], first < second, sorted lexicographically */
  uint32_t *start;           /**< [vertex_count+1] rows of the two lists below */
  uint32_t *neighbour;       /**< [2*edge_count] neighbour vertices, ascending per row */
  uint32_t *neighbour_edge;  /**< [2*edge_count] edge to that neighbour */
  uint32_t *face_start;      /**< [vertex_count+1] rows of faces around a vertex */
  uint32_t *face_list;       /**< faces around each vertex, ascending */
  uint32_t (*edge_faces)[2]; /**< [edge_count] the faces beside; UINT32_MAX where none */
} sonde_topology;

/** Area-weighted outward vertex normals, unit. @param normals [vertex_count] @thread any */
SONDE_API void sonde_mesh_normals(const sonde_mesh *mesh, sonde_vec3 *normals);
/** A third of the adjacent face areas per vertex; sums to the mesh area. @thread any */
SONDE_API void sonde_mesh_areas(const sonde_mesh *mesh, double *areas_m2);

/** Spatial index over a mesh for closest points, rays and inside tests. Keeps a copy of the mesh.
 */
typedef struct sonde_surface_index sonde_surface_index;

/** @thread owner */
SONDE_API sonde_status sonde_surface_index_create(const sonde_mesh *mesh,
                                                  sonde_surface_index **index, sonde_error *error);
SONDE_API void sonde_surface_index_destroy(sonde_surface_index *index); /**< @thread owner */

/** A point on a mesh. */
typedef struct sonde_surface_point {
  uint32_t face;
  double weight[3]; /**< barycentric, of the face's three vertices */
  sonde_vec3 point_m;
  double distance_m; /**< from the query, >= 0 */
} sonde_surface_point;
/** Closest point of the surface. @thread any (read only) */
SONDE_API sonde_surface_point sonde_surface_closest(const sonde_surface_index *index,
                                                    sonde_vec3 query);
/** First hit of a ray, from either side; false when it misses within max_distance_m. @thread any */
SONDE_API bool sonde_surface_raycast(const sonde_surface_index *index, sonde_vec3 origin,
                                     sonde_vec3 direction, double max_distance_m,
                                     sonde_surface_point *hit);
/** Whether a point lies inside a closed mesh; points on its surface do not. @thread any */
SONDE_API bool sonde_surface_inside(const sonde_surface_index *index, sonde_vec3 query);

/* ---- convex bodies ---------------------------------------------------------------------- */

/** A closed convex polyhedron with its face planes. Released by sonde_convex_clear(). */
typedef struct sonde_convex {
  sonde_mesh hull;          /**< triangulated, closed, outward */
  uint32_t plane_count;     /**< distinct face planes (coplanar triangles merged) */
  sonde_vec3 *plane_normal; /**< [plane_count] unit, outward */
  double *plane_offset_m;   /**< [plane_count] n.x <= offset inside */
  sonde_topology topology;  /**< of the hull, for hill climbing support */
  double radius_m;          /**< bounding sphere about the origin */
} sonde_convex;

/** Simplex kept between calls; zero it before the first. */
typedef struct sonde_gjk_cache {
  uint32_t count;
  uint32_t a[4], b[4];
} sonde_gjk_cache;
/** Distance between two convex bodies. */
typedef struct sonde_gjk_result {
  double distance_m;    /**< 0 when they touch or overlap */
  sonde_vec3 point_a_m; /**< closest points, world */
  sonde_vec3 point_b_m;
  uint32_t iterations;
  uint32_t support_calls; /**< work counter: dot products evaluated for supports */
  bool overlap;
} sonde_gjk_result;
/**
 * Distance of two convex bodies (Gilbert, Johnson and Keerthi 1988) within 1e-9 m; closer than
 * 1e-10 m counts as touching. Without a cache linear in the vertices; with one it goes on from the
 * last call's simplex. Of the bodies it reads the hull's vertices and the topology.
 * @param cache may be NULL
 * @thread tick (no allocation)
 */
SONDE_API sonde_gjk_result sonde_gjk_distance(const sonde_convex *a, sonde_pose world_from_a,
                                              const sonde_convex *b, sonde_pose world_from_b,
                                              sonde_gjk_cache *cache);

/** What one triangle contributes to the interpenetration of a convex body with a surface. */
typedef struct sonde_clip_result {
  double volume_m3;       /**< of the columns along `direction` over the clipped triangle */
  double share_m3[3];     /**< the same volume split by the vertices' shape functions */
  sonde_vec3 gradient[3]; /**< dV/dx of the three vertices (m^2): integral of phi_i n dA */
  double area_m2;         /**< clipped area */
  double depth_max_m;     /**< deepest column */
} sonde_clip_result;

/* ---- probes ------------------------------------------------------------------------------ */

/** A probe with more planes is refused; the contact keeps room for that many. */
enum { SONDE_MAX_PROBE_PLANES = 4096 };

/**
 * A probe: rigid convex body in its own frame. Origin at the centre of the contact face, x lateral
 * (across the image), y elevational, z the beam axis pointing INTO the tissue; the body fills z<0.
 */
typedef struct sonde_probe {
  char name[64];
  sonde_convex body;
  double half_x_m, half_y_m; /**< half extent of the contact face */
  double ball_radius_m;      /**< > 0: pushes as a ball about (0, 0, -radius); 0: as the body */
  bool rectangular; /**< the footprint is the full rectangle (point, linear, square, rect:AxB) */
} sonde_probe;
/** Names of the built-in probes, NULL-terminated: point, linear, square, sphere. @thread any */
SONDE_API const char *const *sonde_probe_names(void);

/**
 * Builds a probe by name, or from a mesh file (path with .ply/.obj/.stl, mm; the convex hull is
 * used, leaving out detail below 0.05 mm; +z of the file points into the tissue and the file's
 * lowest-z end is the handle). The file's highest z becomes 0 and the middle of the vertices within
 * 1 mm of it the origin; the box of the hull within 1 mm of it gives the half extents, which are
 * more than 0 for a tip or an edge too.
 * point 6x6 mm, linear 60x12 mm, square 24x24 mm, rect:AxB with sides A (x) and B (y) from 0.1 to
 * 200 mm (flat boxes); sphere radius 15 mm, ball:R a true ball of radius R, 1 to 200 mm.
 * @return SONDE_NOT_FOUND for an unknown name, listing the known ones
 * @thread owner
 */
SONDE_API sonde_status sonde_probe_create(const char *name_or_path, sonde_probe *probe,
                                          sonde_error *error);
SONDE_API void sonde_probe_clear(sonde_probe *probe); /**< @thread owner */

#ifdef __cplusplus
}
#endif
#endif
