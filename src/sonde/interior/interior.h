// Inside of the interior room: the column table, the vessels' sections, what an update leaves.
//
// Columns run from the femur's axis straight out to the skin. A point has coordinates
// (theta, s, zeta): angle about the axis, position along it, depth fraction 0 (skin) .. 1 (bone).
// In a limb the columns of a plane of constant s run from where the bones' middle crosses it.
#ifndef SONDE_SRC_INTERIOR_H
#define SONDE_SRC_INTERIOR_H

#include "base/link.h"
#include "base/maths.h"
#include "interior/law.h"
#include "sonde/interior.h"
#include "sparse/direct.h"
#include "sonde/interior_findings.h"
#include "sonde/tissue_anatomy.h"

enum { SONDE_SECTIONS = 160, SONDE_VESSELS = 2 + SONDE_BRANCHES };
enum { SONDE_MEMORY_SECTIONS = 3072 }; // of all vessels of a leg, at most

// Constant facts of one column of the table.
typedef struct sonde_column {
  uint32_t node[3]; // skin triangle under the column
  double weight[3];
  sonde_vec3 rest_m;      // skin point
  sonde_vec3 round;       // unit, around the axis
  sonde_vec3 flux_normal; // (dq/dtheta) x (dq/ds), outward: m per rad
  double radius_m;        // R: axis to skin
  double slope_theta, slope_s;
} sonde_column;

// What the evaluation reads per column; single precision keeps the table in the cache.
// theta fluxes live at i+1/2, s fluxes at j+1/2.
typedef struct sonde_column_field {
  float radius_m, slope_theta_m, slope_s; // R and its derivatives
  float inflow;                           // W: volume entering per dtheta ds
  float flux_theta, flux_s;               // V
  float slide_theta, slide_s;             // S = H R t: the skin's motion along itself
  float spread;                           // D: divergence of S
  float fat_m, muscle_m, cosine;          // layer depths; cosine between column and skin normal
} sonde_column_field;

// Where the middle of a limb's bones crosses the plane of constant s, from the axis: m along e1 and
// e2, and its slope along s.
typedef struct sonde_bend {
  double x, y, slope_x, slope_y;
} sonde_bend;

// A limb's bone on a column: outer face of the outermost bone, from the column's start.
typedef struct sonde_column_bone {
  float radius_m, slope_theta_m, slope_s;
} sonde_column_bone;

// Where a point lies in the column table.
typedef struct sonde_column_point {
  double theta, s, r;
  double radius_m, depth_m; // of the column's skin; depth along the skin normal, < 0 outside
  double bone_m;            // radius of the bone
  double fat_m, muscle_m;
  double cosine; // between column and skin normal: depth over distance along the column
} sonde_column_point;

// Shear moduli of the layers around the vessels (docs/interior_theory.md).
static const double sonde_fat_pa = 1.5e3, sonde_muscle_pa = 3.6e3;

// Share of a vessel's area from whose loss on the tissue beside it is fully coupled to the wall.
static const double sonde_engaged_loss = 0.05;
// Rest radii over which a wall's motion fades.
static const double sonde_wall_reach = 3.0;
// Thinnest gap between touching walls that the tissue around them leaves, over the rest radius.
static const double sonde_least_lumen = 0.03;

struct sonde_window;
struct sonde_column_grid;

// Axes of a lesion at rest over its semi-axes: dot products with the offset from its centre are
// coordinates in which it is the unit ball.
typedef struct lesion_frame {
  sonde_vec3 x, y, z;
} lesion_frame;

// A vessel's constant section.
typedef struct sonde_vessel_section {
  sonde_vec3 rest_m, axis;
  double s_m;     // along the leg's axis
  double along_m; // along the vessel's own straight line, ascending
  double radius_m, depth_m;
  bool in_fat;     // not between muscles
  double tissue_m; // from the skin to the bone
  double coupling; // of the tissue by its wall: 0 where it opens into another vessel, 1 beyond
  uint64_t beside; // a bit per branch that its wall may meet
  // The vein that it opens into and the section there; SONDE_VESSELS: it is no mouth.
  uint32_t opens_into, opens_at;
} sonde_vessel_section;

// A vessel. Its sections count along a straight line of its own: the leg's axis, or for a vessel
// that also runs across the leg the one that it follows best.
typedef struct sonde_vessel_course {
  sonde_vessel_kind kind;
  uint32_t count;    // of sections; 0: a leg without this vessel
  sonde_vec3 line;   // unit
  bool tilted;       // not along the leg's axis
  bool lies[2];      // somewhere between muscles; in the fat
  sonde_vec3 middle; // of a ball around the sections at rest
  double ball_m;     // its radius
} sonde_vessel_course;

struct sonde_interior {
  const sonde_model *model;
  sonde_surface_index *skin;
  sonde_vec3 origin, axis, e1, e2; // femur axis and the directions of theta = 0 and pi/2
  double bone_radius_m;            // of a thigh's femur; of a limb's shafts, about
  sonde_bend *bend;                // [s_count] NULL: the columns start on the axis
  sonde_column_bone *bone;         // as column; NULL: bone_radius_m everywhere
  double s_first_m, s_step_m, s_low_m, s_high_m; // table rows; ends of the leg
  double theta_step;
  uint32_t theta_count, s_count;
  sonde_column *column;      // [s_count*theta_count] theta fastest
  sonde_column_field *field; // same shape
  sonde_direct *surface;     // Laplacian of the skin's columns
  double *potential;
  struct sonde_column_grid *column_grid; // keeps the columns' field from folding
  struct sonde_window *live, *next;      // the solid in use and the one that is being factored
  bool building;                         // next has a footprint and is not in use yet
  bool ahead;                            // the coming update's share of it is done
  uint32_t built, whole;                 // updates that it has been building, that a build takes
  struct sonde_window **cache; // [cache_count] of other footprints, factored, latest first, or NULL
  uint32_t cache_count;        // 0 in a running session
  bool solid;                  // the last update was solved by the solid of the window
  const sonde_interior_tissue *tissue; // of the last update; NULL: the window or the columns
  sonde_interior_method method;
  bool vessels_only;     // of the updates: no tissue is read beside the vessels
  bool waits;            // of the updates: for their windows
  uint32_t vessel_count; // femoral vein, femoral artery, branches
  sonde_vessel_course course[SONDE_VESSELS];
  sonde_vessel_section *section[SONDE_VESSELS]; // [count], of the femoral vessels [SONDE_SECTIONS]
  sonde_vessel_state *state[SONDE_VESSELS];     // same shape
  bool *strained[SONDE_VESSELS];                // same shape; of the update: tissue may fold there
  uint64_t *reached; // [s_count*theta_count] a bit per branch whose wall may move tissue there
  sonde_pathology pathology[SONDE_VESSELS]; // of the last update
  sonde_findings findings;
  lesion_frame lesion[SONDE_LESIONS];
  bool ready; // an update has happened
  uint64_t tick;
};

// Where the columns start at row s; between two rows of the table on a straight line. @thread any
static inline sonde_bend sonde_bend_at(const sonde_interior *in, double s_m) {
  if (in->bend == NULL) return (sonde_bend){0, 0, 0, 0};
  const double last = in->s_count - 1, j = clamp((s_m - in->s_first_m) / in->s_step_m, 0, last);
  const double low = fmin(floor(j), last - 1), t = j - low;
  const sonde_bend *a = &in->bend[(size_t)low], *b = a + 1;
  return (sonde_bend){a->x + t * (b->x - a->x), a->y + t * (b->y - a->y),
                      (b->x - a->x) / in->s_step_m, (b->y - a->y) / in->s_step_m};
}
// Facts of the column at angle theta and row s; r and depth_m of its skin. @thread any
SONDE_LINK void sonde_interior_column(const sonde_interior *interior, double theta, double s,
                                      sonde_column_point *at);
// Displacement of the column field, whatever the method. @thread any
sonde_vec3 sonde_interior_column_field(const sonde_interior *interior, sonde_vec3 rest_m);
// Displacement anywhere; outside the skin it continues with the skin's. @thread any
sonde_vec3 sonde_interior_field(const sonde_interior *interior, sonde_vec3 rest_m);
// Inversion of the field from a first guess; *error_m receives the last correction. @thread any
sonde_vec3 sonde_interior_invert(const sonde_interior *interior, sonde_vec3 point_m,
                                 sonde_vec3 guess_m, int iterations, double *error_m);
// Whether a point of the leg lies in bone: by the model's map, else by its column. @thread any
bool sonde_interior_in_bone(const sonde_interior *interior, sonde_vec3 rest_m,
                            const sonde_column_point *at);
// Column coordinates and layers of a rest point; false beyond the leg's ends. @thread any
SONDE_LINK bool sonde_interior_locate(const sonde_interior *interior, sonde_vec3 rest_m,
                                      sonde_column_point *at);

// Coordinates of a rest point in a lesion: unit ball. @thread any
sonde_vec3 sonde_lesion_point(const sonde_interior *interior, uint32_t lesion, sonde_vec3 rest_m);
// Label of the lesion at a rest point, LABEL_COUNT when there is none. @thread any
sonde_label sonde_lesion_label(const sonde_interior *interior, sonde_vec3 rest_m);

// Stages of an update.
void sonde_findings_apply(sonde_interior *interior, const sonde_pathology *pathology);
void sonde_interior_solve(sonde_interior *interior, const sonde_vec3 *positions_m);
void sonde_interior_vessels(sonde_interior *interior, const sonde_interior_input *input);
// Keeps a factored window under the probe and solves it; false when the columns have to do.
bool sonde_interior_follow(sonde_interior *interior, const sonde_interior_input *input);

// What the next updates depend on besides their input; a copy of it is enough to go on bit for bit.
typedef struct sonde_interior_memory {
  uint64_t tick;
  uint32_t ready, live_ready, building, built;
  double live[4], next[4]; // footprints: angle, position, half extents
  // Of all vessels, one after the other.
  double area_ratio[SONDE_MEMORY_SECTIONS];
  sonde_vec3 flat_axis[SONDE_MEMORY_SECTIONS];
} sonde_interior_memory;

// The next update's share of a window that is being built, so that the update is quicker; nothing
// else changes. @thread owner
SONDE_LINK void sonde_interior_build_ahead(sonde_interior *in);

// No allocation. @thread of the updates
SONDE_LINK void sonde_interior_remember(const sonde_interior *interior,
                                        sonde_interior_memory *memory);
// Goes on from there. Factors the window in use unless it or one like it in the cache is at hand;
// one that was being built is made when it is due. @return FORMAT @thread owner
SONDE_LINK sonde_status sonde_interior_recall(sonde_interior *interior,
                                              const sonde_interior_memory *memory,
                                              sonde_error *error);
// For the vessels alone, no picture follows: the following updates leave tissue folded that the
// load folds, and let no wall shape the tissue beside it. Pressures and areas of all sections are
// the same to the bit; their middles lack what the repair would have moved them. @thread owner
SONDE_LINK void sonde_interior_for_vessels(sonde_interior *interior, bool only);
// Whether an update waits for a window that the probe's way asks for, some 0.4 s each, instead of
// sharing its factorisation among many updates: for work that no hand waits for. @thread owner
SONDE_LINK void sonde_interior_wait(sonde_interior *interior, bool waits);
// Room for factored windows that are not in use. @thread owner
SONDE_LINK sonde_status sonde_interior_cache_windows(sonde_interior *interior, uint32_t count,
                                                     sonde_error *error);
// Makes in->next a window for a footprint: from the cache when it is there. Without a cache no
// allocation.
void sonde_interior_next_window(sonde_interior *interior, const double footprint[4]);

// Stages of a creation.
sonde_status sonde_columns_create(sonde_interior *interior, sonde_error *error);
sonde_status sonde_sections_create(sonde_interior *interior, sonde_error *error);
// Which sections of a branch are its mouths, and where they open.
void sonde_sections_find_mouths(sonde_interior *interior, uint32_t branch);
// Where the branches' walls can move tissue, as wide as their lumina may be.
void sonde_sections_mark(sonde_interior *interior);

// Layer depths of the table again as the model gives them; windows have to be made again.
void sonde_columns_refresh(sonde_interior *interior);

// Normal stresses (Pa, compression positive) below a uniformly loaded rectangle on an
// incompressible half space: lateral x, axial y, normal z (docs/interior_theory.md, superposed
// corners).
// @param half_x_m,half_y_m rectangle @param x_m,y_m,z_m point, z_m > 0 depth @thread any
sonde_vec3 sonde_rectangle_stress(double pressure_pa, double half_x_m, double half_y_m, double x_m,
                                  double y_m, double z_m);
// Displacement (m) of many points, as sonde_interior_displacement(). @param rest_m,out_m [count]
// @thread any
void sonde_interior_displacements(const sonde_interior *interior, uint32_t count,
                                  const sonde_vec3 *rest_m, sonde_vec3 *out_m);
// Cauchy stress (Pa, tension positive, world axes) at a rest point, of the window scaled so that
// its reaction is the contact force; without vessels. @return false (zero stress) where the solid
// does not reach: no contact, outside the leg or its window, in a thigh's bone. @thread any
bool sonde_interior_stress(const sonde_interior *interior, sonde_vec3 rest_m, sonde_mat3 *stress);
// Sections of the vein (0), the artery (1) or a branch; 0 when the leg lacks it.
// @thread any, not during an update
const sonde_vessel_state *sonde_interior_vessel(const sonde_interior *interior, int which,
                                                uint32_t *count);

#endif
