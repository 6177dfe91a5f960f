/**
 * @file contact.h
 * Contact of any two bodies: trees of boxes over faces, the common volume of two closed triangle
 * meshes with its exact gradient, regions and columns, and the depth and the first touch of convex
 * bodies. Nothing that is marked `@thread tick` allocates. docs/contact.md.
 */
#ifndef SONDE_SRC_CONTACT_CONTACT_H
#define SONDE_SRC_CONTACT_CONTACT_H

#include "sonde/base.h"
#include "sonde/geometry.h"

/* ---- boxes and trees --------------------------------------------------------------------- */

/** Box with sides along the world's axes (m). */
typedef struct sonde_bounds {
  sonde_vec3 low, high;
} sonde_bounds;

/** Finds which of several boxes overlap; remembers the last order to sort quickly. */
typedef struct sonde_sweep sonde_sweep;
/** @param capacity the most boxes that will be given @thread owner */
sonde_status sonde_sweep_create(uint32_t capacity, sonde_sweep **sweep, sonde_error *error);
void sonde_sweep_destroy(sonde_sweep *sweep); /**< @thread owner */
/**
 * Pairs of boxes that overlap or touch, ascending, each with the smaller index first.
 * @param pairs [capacity] receives them; further ones are counted but not written
 * @param work incremented by the comparisons done; may be NULL
 * @return how many pairs there are, also when that is more than `capacity`
 * @thread tick
 */
uint32_t sonde_sweep_pairs(sonde_sweep *sweep, const sonde_bounds *boxes, uint32_t count,
                           uint32_t (*pairs)[2], uint32_t capacity, uint64_t *work);

/** Tree of boxes over the faces of a mesh whose vertices move. */
typedef struct sonde_face_tree sonde_face_tree;
/**
 * Builds the tree from the mesh as it stands and fits it. Keeps a copy of the faces; borrows
 * `mesh->vertices` until the first sonde_face_tree_refit().
 * @return SONDE_MESH when there is no face or a face names a missing vertex
 * @thread owner
 */
sonde_status sonde_face_tree_create(const sonde_mesh *mesh, sonde_face_tree **tree,
                                    sonde_error *error);
void sonde_face_tree_destroy(sonde_face_tree *tree); /**< @thread owner */
/**
 * Fits the boxes to new positions in time proportional to the faces.
 * @param vertices [vertex_count of the mesh] world (m); borrowed until the next refit: the calls
 *        that take the tree read them
 * @thread tick
 */
void sonde_face_tree_refit(sonde_face_tree *tree, const sonde_vec3 *vertices);
/**
 * The same where only some faces have moved since the last fit.
 * @param faces [count] the mesh's numbers of them
 * @thread tick
 */
void sonde_face_tree_refit_part(sonde_face_tree *tree, const sonde_vec3 *vertices,
                                const uint32_t *faces, uint32_t count);
/** Box of the whole mesh. @thread any (read only) */
sonde_bounds sonde_face_tree_bounds(const sonde_face_tree *tree);
/**
 * Pairs of faces whose boxes, each grown by half of `margin_m`, overlap. Always in the same order.
 * @param pairs [capacity] receives (face of a, face of b); further ones are counted only
 * @param work incremented by the box comparisons done; may be NULL
 * @return how many pairs there are, also when that is more than `capacity`
 * @thread tick
 */
uint32_t sonde_face_tree_pairs(const sonde_face_tree *a, const sonde_face_tree *b, double margin_m,
                               uint32_t (*pairs)[2], uint32_t capacity, uint64_t *work);

/**
 * Whether an edge of one of the mesh's first `count` faces passes through the inside of another
 * of them that shares at most one corner with it.
 * @param[out] faces of the first such pair, the lower number first
 * @thread tick
 */
bool sonde_face_tree_crosses(const sonde_face_tree *tree, uint32_t count, uint32_t faces[2]);

/** Count of faces whose boxes come within reach_m, of which `capacity` are written. @thread tick */
uint32_t sonde_face_tree_within(const sonde_face_tree *tree, sonde_vec3 from, double reach_m,
                                uint32_t *faces, uint32_t capacity);

/** A point of a mesh and the way to it from a point beside it. */
typedef struct sonde_face_point {
  uint32_t face;
  double weight[3];   /**< barycentric */
  double depth_m;     /**< distance; negative when the point beside lies outside */
  sonde_vec3 outward; /**< unit, along the line through both points, from the inside outwards */
} sonde_face_point;
/** Point of the mesh nearest to another. @thread tick */
sonde_face_point sonde_face_tree_nearest(const sonde_face_tree *tree, sonde_vec3 from);

/* ---- common volume of two closed meshes --------------------------------------------------- */

/** Room of an overlap; 0 selects the default. */
typedef struct sonde_overlap_config {
  uint32_t max_pieces;  /**< pairs of faces above each other; default 8 per face, at least 4096 */
  uint32_t max_regions; /**< default 64 */
  uint32_t max_points;  /**< column points over all regions; default as many as pieces */
  /**
   * Column points per piece: 3 integrates depth times shape functions exactly, 1 only the depth;
   * UINT32_MAX makes none. Default 3.
   */
  uint32_t points_per_piece;
  /** The largest bodies that will be compared; default those of the trees at creation. */
  uint32_t max_faces, max_vertices;
} sonde_overlap_config;

/** Something did not fit: what is beyond the room is left out of the result. */
enum {
  SONDE_OVERLAP_PIECES_FULL = 1,  /**< volume and gradient are wrong */
  SONDE_OVERLAP_REGIONS_FULL = 2, /**< the last region holds the remaining ones as well */
  SONDE_OVERLAP_POINTS_FULL = 4   /**< columns are missing */
};

/** One connected part of the common volume. */
typedef struct sonde_overlap_region {
  double volume_m3;
  double area_m2;         /**< |sum of the gradients of A|: the area seen along `direction` */
  sonde_vec3 direction;   /**< unit, out of A into B: pushing B along it parts the bodies */
  sonde_vec3 centre_m;    /**< centroid of the contact, weighted by gradient . direction */
  double depth_m;         /**< longest column along `direction`; mean depth if none were made */
  uint32_t face_count[2]; /**< faces of A and of B with a part inside the other body */
  uint32_t first_entry[2], entry_count[2]; /**< its rows in `entries` of A and of B */
  uint32_t first_point, point_count;       /**< its rows in `points` */
} sonde_overlap_region;

/** How the volume of a region changes with one vertex. */
typedef struct sonde_overlap_entry {
  uint32_t vertex, region;
  sonde_vec3 gradient_m2; /**< dV/dx = integral of (shape function) n dA over the part inside */
} sonde_overlap_entry;

/**
 * A column of the common volume along its region's direction, from a point on a face of B (below)
 * to one on a face of A (above): the points of the elastic foundation. Equal and opposite forces
 * along the direction, shared by the weights, keep linear and angular momentum.
 */
typedef struct sonde_overlap_point {
  uint32_t face_a, face_b, region;
  double weight_a[3], weight_b[3]; /**< barycentric, >= 0 within rounding, sum 1 */
  double area_m2;                  /**< of its share, across the direction */
  double depth_m;                  /**< >= 0: (point on A - point on B) . direction */
} sonde_overlap_point;

/** What the last compute found; the arrays live in the overlap and change with the next one. */
typedef struct sonde_overlap_result {
  double volume_m3; /**< sum over the regions */
  uint32_t flags;   /**< SONDE_OVERLAP_... */
  uint32_t region_count, point_count;
  const sonde_overlap_region *regions;   /**< by first vertex of A, bodies inside A last */
  const sonde_overlap_entry *entries[2]; /**< of A and of B, by region, then vertex ascending */
  uint32_t entry_count[2];
  const sonde_overlap_point *points; /**< by region */
  uint64_t box_tests;                /**< work: pairs of boxes compared */
  uint64_t face_pairs;               /**< work: pairs of faces clipped */
} sonde_overlap_result;

typedef struct sonde_overlap sonde_overlap;
/**
 * One overlap serves any number of pairs, one after the other.
 * @param a,b trees of two bodies, for their sizes only
 * @thread owner
 */
sonde_status sonde_overlap_create(const sonde_face_tree *a, const sonde_face_tree *b,
                                  const sonde_overlap_config *config, sonde_overlap **overlap,
                                  sonde_error *error);
void sonde_overlap_destroy(sonde_overlap *overlap); /**< @thread owner */
/**
 * Common volume of two bodies within its room at the positions of their trees. Exact for closed
 * outward meshes, concave or not. With face i of A and j of B that cover each other along k, s = +1
 * for a face that looks along k and -1 for one that looks back,
 *
 *     V = - sum over i, j of s_i s_j * integral over the overlap of max(0, z_i - z_j)
 *
 * and dV/dx is the integral of (shape function) n dA over the same polygons. Where a face of A
 * meets two separate parts of B (or the reverse), each is a region of its own.
 * @param hint about the direction out of A into B, e.g. of the last step; zero selects the axis
 *        along which the boxes overlap least. It changes the work, and the result by rounding only.
 * @return whether anything overlaps
 * @thread tick
 */
bool sonde_overlap_compute(sonde_overlap *overlap, const sonde_face_tree *a,
                           const sonde_face_tree *b, sonde_vec3 hint);
/** Result of the last compute. @thread tick */
const sonde_overlap_result *sonde_overlap_get(const sonde_overlap *overlap);

/* ---- convex bodies ------------------------------------------------------------------------ */

/** How deep two convex bodies overlap. */
typedef struct sonde_depth_result {
  bool overlap;         /**< false: all else but the counters is 0 */
  bool converged;       /**< false: `depth_m` is still an upper bound */
  double depth_m;       /**< moving B by depth_m * direction makes them touch */
  sonde_vec3 direction; /**< unit, world, out of A into B */
  sonde_vec3 point_a_m; /**< deepest point of A, world; the one of B lies depth_m back */
  uint32_t iterations;
  uint32_t support_calls; /**< work counter as in sonde_gjk_result */
} sonde_depth_result;
/**
 * Depth by displacement (Joukhadar, Deguet and Laugier 1998): B is moved out along a trial
 * direction, GJK measures the gap there, and the shortfall of the direction is corrected until it
 * no longer shrinks. So from the direction given and from some of 26 fixed ones, the shallowest
 * wins. Close to exact for shallow overlap, an upper bound always.
 * @param direction trial out of A into B, e.g. of the last step or the last separation; zero takes
 *        the line between the centres
 * @thread tick
 */
sonde_depth_result sonde_convex_displace(const sonde_convex *a, sonde_pose world_from_a,
                                         const sonde_convex *b, sonde_pose world_from_b,
                                         sonde_vec3 direction);
/** Motion of a rigid body from a pose, with constant velocity of its origin and constant spin. */
typedef struct sonde_motion {
  sonde_pose start;
  sonde_vec3 velocity_m_s;
  sonde_vec3 spin_rad_s;
} sonde_motion;
/** Pose after a time. @thread any */
sonde_pose sonde_motion_pose(const sonde_motion *motion, double time_s);

/** First touch of two moving bodies. */
typedef struct sonde_cast_result {
  bool hit;             /**< they come within the margin before the end */
  double time_s;        /**< when; the duration without a hit, 0 when they already touch */
  double distance_m;    /**< then */
  sonde_vec3 point_m;   /**< on A, world, then */
  sonde_vec3 direction; /**< unit, out of A into B; zero when they overlap from the start */
  uint32_t iterations;
  uint32_t support_calls;
} sonde_cast_result;
/**
 * Conservative advancement (Mirtich 1996): never steps past the first touch, however fast or thin
 * the bodies are.
 * @param margin_m more than 0: being closer than that is a touch
 * @thread tick
 */
sonde_cast_result sonde_convex_cast(const sonde_convex *a, const sonde_motion *motion_a,
                                    const sonde_convex *b, const sonde_motion *motion_b,
                                    double duration_s, double margin_m);
/**
 * The same of a convex body A against the faces of a mesh B at the positions of its tree, which
 * stand still. A body wholly inside the mesh touches nothing.
 * @thread tick
 */
sonde_cast_result sonde_convex_cast_faces(const sonde_convex *a, const sonde_motion *motion_a,
                                          const sonde_face_tree *b, double duration_s,
                                          double margin_m);

#endif
