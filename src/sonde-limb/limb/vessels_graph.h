// The graph of a limb's vessels and what lies with it; inside of vessels*.c, variants.c, nerves.c
// and stations.c. All of a right limb, metres.
#ifndef SONDE_SRC_LIMB_VESSELS_GRAPH_H
#define SONDE_SRC_LIMB_VESSELS_GRAPH_H

#include "limb/vessels.h"
#include "sonde/limb_vessels.h"

#define DEGREE (SONDE_PI / 180)

enum {
  VESSEL_NODES = 8000,  // points of all centre lines; branches share those of their joints
  VESSEL_POINTS = 9000, // places of nodes in branches
  VESSEL_BRANCHES = 112,
  VESSEL_VALVES = 24, // of a branch
  VESSEL_LYMPH = 6,
  VESSEL_LINE = 700, // points of one line while it is laid
  VESSEL_NONE = SONDE_LIMB_NO_VESSEL
};

// Distance of the points of a centre line. A line that bends by a radius of 10 mm is off its
// polygon by 0.11 mm at this spacing, one of 50 mm by 0.02 mm.
#define VESSEL_STEP 0.003

// ---- what is drawn ------------------------------------------------------------------------------

// Mean diameters of men and women and their deviation, mm (docs/limb_vessels.md), supine.
// clang-format off
#define VESSEL_DIAMETERS(X) \
  X(DIA_EIV, 11.5, 10.5, 1.8) \
  X(DIA_CFV, 11.2, 9.9, 1.8) \
  X(DIA_FV, 6.85, 6.35, 1.3) \
  X(DIA_DFV, 6.5, 6.0, 1.3) \
  X(DIA_POPV, 7.7, 7.7, 1.5) \
  X(DIA_TPV, 6, 6, 1.2) \
  X(DIA_PTV, 2.7, 2.7, 0.7) \
  X(DIA_PERV, 3.2, 3.2, 0.9) \
  X(DIA_ATV, 1.8, 1.8, 0.5) \
  X(DIA_GSV_ARCH, 6.0, 6.0, 1.4) \
  X(DIA_GSV, 3.0, 3.0, 0.7) \
  X(DIA_GSV_CALF, 2.0, 2.0, 0.5) \
  X(DIA_SSV, 3.0, 3.0, 0.8) \
  X(DIA_GASTROCNEMIUS, 3.5, 3.5, 0.9) \
  X(DIA_SOLEAL, 5, 5, 1) \
  X(DIA_PERFORATOR, 1.3, 1.3, 0.56) \
  X(DIA_EIA, 8.6, 7.4, 1) \
  X(DIA_CFA, 10, 7.8, 0.9) \
  X(DIA_SFA, 7, 6, 0.8) \
  X(DIA_SFA_END, 6.2, 5.3, 0.8) \
  X(DIA_DFA, 6, 5, 0.8) \
  X(DIA_POPA, 7.2, 6.1, 0.8) \
  X(DIA_TPA, 4.5, 3.9, 0.6) \
  X(DIA_ATA, 3, 3, 0.5) \
  X(DIA_PTA, 2.8, 2.8, 0.5) \
  X(DIA_PERA, 2.8, 2.8, 0.5)
// clang-format on
typedef enum vessel_diameter {
#define ROW(name, male, female, deviation) name,
  VESSEL_DIAMETERS(ROW)
#undef ROW
      DIA_COUNT
} vessel_diameter;

// What differs between limbs besides the body: places, calibres, variants.
typedef struct vessel_draws {
  sonde_limb_variants variants;
  double radius[DIA_COUNT];
  double ligament_z, junction_z, bifurcation_z, confluence_z; // of the groin
  double hiatus, trifurcation, trunk_end;                     // levels
  double artery_cover; // depth of the common femoral artery's front wall below the fascia
  double wander[8];    // standard normal numbers of the lines' angles
} vessel_draws;

double limb_draw_normal(uint64_t seed, uint32_t what); // within 2.4 deviations
double limb_draw_uniform(uint64_t seed, uint32_t what);
// Width that is left of a vein's when it has taken a branch, by Murray's law.
double limb_murray_rest(double whole, double branch);
vessel_draws limb_vessel_draws(const sonde_limb *limb);

// ---- the graph ----------------------------------------------------------------------------------

// Where a branch lies: under the deep fascia; between it and the saphenous fascia; outside of both;
// anywhere (perforators).
typedef enum vessel_layer { LAYER_DEEP, LAYER_EYE, LAYER_OUTER, LAYER_ANY } vessel_layer;

typedef struct vessel_branch {
  char name[SONDE_LIMB_VESSEL_NAME];
  sonde_limb_vessel_kind kind;
  uint32_t first, count;      // places in point[]
  uint32_t parent, parent_at; // branch that it joins at its proximal end and the point there
  uint32_t joins, joins_at;   // the same at its distal end, when that ends on another branch
  uint32_t mate;              // artery that it accompanies
  vessel_layer layer;
  uint32_t valves;
  double valve[VESSEL_VALVES]; // arc, m
} vessel_branch;

typedef struct vessel_place {
  uint32_t node;
  double radius, wall, arc;
} vessel_place;

// A piece of a centre line for the index: a cone with round ends, widened to a band for flat
// nerves.
typedef struct vessel_piece {
  sonde_vec3 a, along;  // start and vector to the end
  double inverse;       // 1 / |along|^2, or 0
  double radius, grows; // at the start, and what it gains by the end
  double half;          // extent of a flat nerve beyond its radius to either side
  sonde_vec3 side;      // of the flat nerve, unit
  uint32_t owner;       // branch, or branches + nerve, or branches + nerves + node
  uint32_t at;          // first of its two places
} vessel_piece;

typedef struct vessel_cell {
  uint32_t child;        // first of eight, or 0: a leaf
  uint32_t first, count; // of a leaf, in listed[]
  float clear;           // of a leaf: no point of it is nearer to a piece, m
} vessel_cell;

typedef struct limb_nerve {
  char name[SONDE_LIMB_VESSEL_NAME];
  uint32_t count;
  sonde_vec3 point[160], side[160];
  double half, radius; // of its flat section
} limb_nerve;

typedef struct limb_lymph {
  sonde_vec3 centre, axis;
  double length, radius; // semi-axes along and across
} limb_lymph;

enum { LIMB_NERVES = 5 };

struct limb_vessels {
  const sonde_limb *limb;
  vessel_draws draws;
  uint32_t nodes, places, branches, pieces, cells, listed_count;
  sonde_vec3 node[VESSEL_NODES];
  vessel_place place[VESSEL_POINTS];
  vessel_branch branch[VESSEL_BRANCHES];
  limb_nerve nerve[LIMB_NERVES];
  limb_lymph lymph[VESSEL_LYMPH];
  sonde_limb_vessel_faults faults;
  uint16_t shared[VESSEL_BRANCHES][VESSEL_BRANCHES][2]; // nodes that two branches share, plus 1
  vessel_piece *piece;
  vessel_cell *cell;
  uint32_t *listed;
  sonde_vec3 low; // corner of the index's cube
  double edge;    // of it
};

static inline const vessel_place *limb_branch_places(const struct limb_vessels *v, uint32_t b) {
  return &v->place[v->branch[b].first];
}
static inline sonde_vec3 limb_branch_point(const struct limb_vessels *v, uint32_t b, uint32_t k) {
  return v->node[v->place[v->branch[b].first + k].node];
}
uint32_t limb_branch_find(const struct limb_vessels *v, const char *name); // VESSEL_NONE: none
// Point of a branch nearest to a level, and the branch's centre there.
uint32_t limb_branch_at_level(const struct limb_vessels *v, uint32_t b, double level);
double limb_branch_length(const struct limb_vessels *v, uint32_t b);

// A point by level, degrees and fraction; by level, degrees and depth below the deep fascia.
sonde_vec3 limb_at(const sonde_limb *limb, double level, double degrees, double f);
sonde_vec3 limb_below_fascia(const sonde_limb *limb, double level, double degrees, double depth);
// Degrees and fraction of a point.
void limb_place_of(const sonde_limb *limb, sonde_vec3 p, double *level, double *degrees, double *f);

// ---- steps of the making ------------------------------------------------------------------------

// Lines while they are laid.
typedef struct vessel_line {
  uint32_t count;
  sonde_vec3 point[VESSEL_LINE];
} vessel_line;

typedef struct vessel_spec {
  const char *name;
  sonde_limb_vessel_kind kind;
  double from, to; // radii at the ends
  uint32_t parent; // joint at the line's start: the parent's nearest point; VESSEL_NONE: free
  uint32_t joins;  // joint at the line's end
  uint32_t mate;
  double wall;
  vessel_layer layer;
  double valves; // distance of its valves, 0: none
} vessel_spec;

// Points every VESSEL_STEP on the Catmull-Rom curve through knots.
void limb_line_through(const sonde_vec3 *knots, uint32_t count, vessel_line *line);
// Adds a branch of line's points [from, to]; returns its number.
uint32_t limb_branch_add(struct limb_vessels *v, const vessel_spec *spec, const vessel_line *line,
                         uint32_t from, uint32_t to);

void limb_vessels_lay_arteries(struct limb_vessels *v);
void limb_vessels_lay_veins(struct limb_vessels *v);
void limb_vessels_lay_deep_femoral(struct limb_vessels *v);
uint32_t limb_vessels_lay_great(struct limb_vessels *v); // the great saphenous vein's number
void limb_vessels_lay_tributaries(struct limb_vessels *v, uint32_t great);
void limb_vessels_lay_small(struct limb_vessels *v, uint32_t great);
void limb_vessels_lay_muscle_veins(struct limb_vessels *v);
void limb_vessels_lay_perforators(struct limb_vessels *v);
void limb_nerves_lay(struct limb_vessels *v);
void limb_lymph_lay(struct limb_vessels *v);
// Moves centre lines apart and away from bones and fascia, with `close` also companion veins to
// their arteries, with `sharp` each place for itself; counts what is left in faults.
sonde_status limb_vessels_relax(struct limb_vessels *v, uint32_t passes, bool close, bool sharp,
                                sonde_error *error);
sonde_status limb_vessels_count_faults(struct limb_vessels *v, sonde_error *error);
// @param fine false: larger cells, made sooner, that answer slower and the same
sonde_status limb_vessels_index(struct limb_vessels *v, bool fine, sonde_error *error);
// Nearest branch: signed distance to the lumen, its place; joints smoothed.
double limb_vessels_lumen(const struct limb_vessels *v, sonde_vec3 p, uint32_t *branch, double *arc,
                          double *wall);

#endif
