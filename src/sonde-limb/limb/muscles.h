// Muscles as a power diagram of each section with prescribed areas.
#ifndef SONDE_SRC_LIMB_MUSCLES_H
#define SONDE_SRC_LIMB_MUSCLES_H

#include "limb/frame.h"

enum {
  LIMB_CELL_ROWS = 111, // rows of the diagram, from LIMB_TOP to the ankle
  LIMB_SEEDS = 96,
  LIMB_FILLERS = 5,
  LIMB_CELLS = SONDE_LIMB_MUSCLES + LIMB_FILLERS, // fat that fills what no muscle takes
  LIMB_SEED_KNOTS = 7
};
#define LIMB_CELL_STEP 0.02

// Compartments; a septum stands between two of them.
typedef enum limb_compartment {
  LIMB_HIP,
  LIMB_ANTERIOR,
  LIMB_MEDIAL,
  LIMB_POSTERIOR,
  LIMB_LEG_ANTERIOR,
  LIMB_LEG_LATERAL,
  LIMB_LEG_SUPERFICIAL,
  LIMB_LEG_DEEP,
  LIMB_FILLING
} limb_compartment;

// How the fibres stand to the belly's axis: along it; from the deep sheet down and outward; from
// the superficial sheet down and inward; from a central septum down to both sides.
typedef enum limb_pennate { LIMB_STRAP, LIMB_OUTWARD, LIMB_INWARD, LIMB_CENTRAL } limb_pennate;

// Places of a cell's seeds at one level: degrees and f of each.
typedef struct limb_seed_knot {
  double level, place[5][2];
} limb_seed_knot;

// A muscle by the tables of docs/limb_theory.md. volume_cm3 0: areas (mm2) at levels instead.
typedef struct limb_muscle {
  const char *name;
  double volume_cm3, from, to, peak, spread;
  double pennation_deg;
  limb_pennate pennate;
  limb_compartment compartment;
  double fibre_mm;
  uint32_t seeds;
  limb_seed_knot knot[LIMB_SEED_KNOTS];
  double area[7][2];
} limb_muscle;
extern const limb_muscle limb_muscle_table[SONDE_LIMB_MUSCLES];

typedef struct limb_seed {
  float x, y, weight; // in mean radii of the section
} limb_seed;

struct limb_muscles {
  uint32_t seed_count;
  uint8_t cell_of[LIMB_SEEDS];
  double radius[LIMB_CELL_ROWS]; // mean radius of the fascia, m
  limb_seed seed[LIMB_CELL_ROWS][LIMB_SEEDS];
  uint8_t active_count[LIMB_CELL_ROWS]; // seeds that have room in this row or the next
  uint8_t active[LIMB_CELL_ROWS][LIMB_SEEDS];
  double target[LIMB_CELL_ROWS][LIMB_CELLS]; // m2; 0: absent
  double area[LIMB_CELL_ROWS][LIMB_CELLS];   // as solved
  double scale[LIMB_CELL_ROWS];              // area of the muscles against their rule
};

// The cell of a point within the fascia.
typedef struct limb_cell {
  uint32_t cell, second; // muscle, or SONDE_LIMB_MUSCLES + filler; the cell beyond the boundary
  double boundary_m;     // distance to that boundary
  uint32_t seed;
  uint32_t row;
} limb_cell;

// Where a level lies among the rows of the diagram.
typedef struct limb_row {
  uint32_t row;
  float u;       // share of the way to the next row
  double radius; // mean radius of the fascia there, m
} limb_row;
limb_row limb_row_at(const struct limb_muscles *muscles, double level);
// |p - seed|^2 - weight of a seed there, for a point in mean radii from the section's centre; *x
// and *y receive the seed's place.
static inline float limb_seed_power(const struct limb_muscles *m, const limb_row *at, uint32_t seed,
                                    float px, float py, float *x, float *y) {
  const limb_seed *a = &m->seed[at->row][seed], *b = &m->seed[at->row + 1][seed];
  const float u = at->u, v = 1 - u;
  *x = v * a->x + u * b->x, *y = v * a->y + u * b->y;
  float dx = px - *x, dy = py - *y;
  return dx * dx + dy * dy - (v * a->weight + u * b->weight);
}

sonde_status limb_muscles_make(sonde_limb *limb, sonde_error *error);
limb_cell limb_cell_at(const sonde_limb *limb, double level, double x, double y);
// Area by the rule at a level, m2: volume, length and profile of a muscle; 0 beyond its ends.
double limb_muscle_area(const sonde_limb_body *body, uint32_t muscle, double level);
// Unit direction of the fibres, downwards.
sonde_vec3 limb_fibre(const sonde_limb *limb, const limb_cell *cell, sonde_vec3 p);
limb_compartment limb_cell_compartment(uint32_t cell);

// Tendons: flat or round strips, along the fascia.
int limb_tendon_at(const sonde_limb *limb, double level, double x, double y);
// Place in a tendon at a level over its semi-axes, along the fascia and outward, and the tendon's
// middle and semi-axes there, m; false beyond its ends.
bool limb_tendon_place(const sonde_limb *limb, uint32_t which, double level, double x, double y,
                       double place[2]);
bool limb_tendon_body(const sonde_limb *limb, uint32_t which, double level, sonde_vec3 *middle,
                      double *wide, double *thick);
const char *limb_tendon_name(int tendon);
uint32_t limb_tendon_count(void);

#endif
