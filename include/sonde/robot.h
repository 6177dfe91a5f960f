/**
 * @file robot.h
 * The virtual robot: places sites on a model's skin and presses there as the experiment did.
 * docs/robot.md.
 */
#ifndef SONDE_ROBOT_H
#define SONDE_ROBOT_H

#include "sonde/fit.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- sites ------------------------------------------------------------------------------- */

/** What sonde_sites_place() places. Lengths in m, angles in rad. */
typedef struct sonde_sites_def {
  uint32_t columns, rows; /**< around and along the leg; with `painted` columns * rows sites */
  /** Part of the skin around the leg's axis (parallel to z through the skin's centroid): angles
      from +x towards +y, heights z. Used without `painted`. */
  double angle_low_rad, angle_high_rad;
  double z_low_m, z_high_m;
  /** NULL, or a file with the region: a mesh (.ply, .obj, .stl, mm) of the patch of skin, or a CSV
      file `x_mm,y_mm,z_mm` with the corners of its outline in order. */
  const char *painted;
  double smoothing_m; /**< normals are means over the skin with this standard deviation; 5 mm */
} sonde_sites_def;

SONDE_API sonde_sites_def sonde_sites_def_default(void); /**< @thread any */

/** Distances of sites to their nearest neighbour. */
typedef struct sonde_site_spacing {
  double mean_m, least_m, largest_m;
  double cv; /**< standard deviation over mean */
} sonde_site_spacing;

/**
 * Places sites regularly. Bounds: rows at equal distances along the middle of the region, columns
 * at equal distances around the leg, first and last ones on the bounds. Painted: a square lattice
 * of that number of sites inside the region. Ids count columns first; u runs around the leg, v
 * along it, +z; fat_depth_m is the model's fat thickness, NaN when its layers were not measured.
 * @param[out] table released by sonde_site_table_clear()
 * @return ARGUMENT, MISMATCH when the region is not on the skin, FORMAT, IO
 * @thread owner
 */
SONDE_API sonde_status sonde_sites_place(const sonde_model *model, const sonde_sites_def *def,
                                         sonde_site_table *table, sonde_error *error);

/** Nearest-neighbour distances; zeroes with fewer than two sites. @thread any */
SONDE_API sonde_site_spacing sonde_site_spacing_of(const sonde_site_table *table);

/* ---- robot ------------------------------------------------------------------------------- */

typedef enum sonde_robot_contact {
  SONDE_ROBOT_AUTO,   /**< bonded for rectangular probes, else probe */
  SONDE_ROBOT_BONDED, /**< the footprint's skin moves rigidly, as in the experiment */
  SONDE_ROBOT_PROBE,  /**< the convex body is pressed in */
} sonde_robot_contact;

typedef struct sonde_robot_def {
  const char *probe; /**< name, rect:AxB (mm) or mesh file */
  sonde_robot_contact contact;
  double step_m;        /**< default 2 mm */
  double limit_n;       /**< the first row above it is the last; default 40 N */
  double depth_limit_m; /**< default 30 mm */
  double noise_force_n; /**< standard deviations of the sensors; default 0 */
  double noise_penetration_m;
  double
      quantum_force_n; /**< readings are multiples of these, after the noise; 0 (default): none */
  double quantum_penetration_m;
  uint64_t seed;
  double relative_residual; /**< default 1e-6 */
  uint32_t max_iterations;  /**< default 200 */
  uint32_t threads;         /**< 0: one per online core */
} sonde_robot_def;

SONDE_API sonde_robot_def sonde_robot_def_default(void); /**< @thread any */

/** Why the robot left a site. */
typedef enum sonde_robot_end {
  SONDE_ROBOT_NOT_REACHED,    /**< cancelled before or on the way */
  SONDE_ROBOT_FORCE_LIMIT,    /**< the last row is the only one above the limit */
  SONDE_ROBOT_DEPTH_LIMIT,    /**< reached without passing the force limit */
  SONDE_ROBOT_NO_EQUILIBRIUM, /**< the step after the last row had none */
} sonde_robot_end;

/** What happened at one site. */
typedef struct sonde_robot_visit {
  uint32_t site; /**< id */
  uint32_t rows; /**< kept in the table */
  sonde_robot_end end;
  double area_m2; /**< skin covered by a bonded footprint; skin touched by a body, the largest */
  double depth_m, force_n; /**< commanded depth and true force of the last step */
} sonde_robot_visit;

/** Released by sonde_robot_log_clear(). */
typedef struct sonde_robot_log {
  uint32_t count;
  sonde_robot_visit *visits; /**< [count] in table order */
} sonde_robot_log;

SONDE_API void sonde_robot_log_clear(sonde_robot_log *log); /**< @thread owner */

/** With fewer rows a site that was under way is not kept when the robot is cancelled. */
enum { SONDE_ROBOT_LEAST_ROWS = 3 };

/**
 * Presses the model at every site, step by step, until force or reading pass the limit, the depth
 * limit is reached or no equilibrium is found. A reading of a penetration that repeats an earlier
 * one of its site (noise, quantisation) is not recorded.
 * @param[out] measurements in table order. When CANCELLED too: finished sites and those under way
 *   with SONDE_ROBOT_LEAST_ROWS rows; its remark says so
 * @param[out] log may be NULL; filled also when CANCELLED
 * @return MISMATCH when a site is off the skin; NOT_FOUND, ARGUMENT
 * @thread owner
 */
SONDE_API sonde_status sonde_robot_run(const sonde_model *model, const sonde_site_table *sites,
                                       const sonde_robot_def *def, const sonde_progress *progress,
                                       sonde_measurements *measurements, sonde_robot_log *log,
                                       sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
