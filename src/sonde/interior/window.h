// The solid of a leg: a ring of elements from the femur to the skin, fine under the probe, growing
// away from it. Its topology never changes; placing it somewhere else gives it new corners and new
// numbers on the same pattern.
//
// Under the contact the skin's displacement is prescribed; everywhere else the skin is free and
// follows from equilibrium. The solid knows the compliance of the skin nodes near the probe, finds
// the forces that move the touched points as prescribed and recovers the inside from them.
//
// Two solutions: every touched point moves as it does (displacement), and the touched rectangle of
// the face moves by one length along the beam (stress per newton). A linear solid does not stiffen
// where a flat face digs in; the second lets the edges of the face carry what they carry in the
// finite-element study.
#ifndef SONDE_SRC_WINDOW_H
#define SONDE_SRC_WINDOW_H

#include "interior/grid.h"
#include "interior/solid.h"
#include "interior/fold_repair.h"

enum {
  SONDE_WINDOW_NEAR = SONDE_WINDOW_NEAR_T * SONDE_WINDOW_NEAR_S,
  SONDE_WINDOW_TOUCHED = 512 // points of contact that are used
};

enum { SONDE_WINDOW_BUDGET = 8000000 }; // multiplications per update of a running session

// One touched point of the skin.
typedef struct sonde_touched {
  uint32_t near[4]; // numbers among the near skin nodes
  double weight[4];
  double move[3]; // leg frame
} sonde_touched;

// What a solution was found for. While a still probe asks for the same again it stays.
typedef struct sonde_answer {
  uint32_t count;         // 0: none yet
  sonde_touched *touched; // [SONDE_WINDOW_TOUCHED]
  double along[3], reaction_n;
  float *x; // [3*unknowns] displacements
} sonde_answer;

typedef struct sonde_window {
  sonde_solid solid;
  sonde_grid grid;
  double *compliance; // [3 near][3 near] of the near skin nodes
  bool ready;         // factored
  uint32_t touched_count;
  sonde_touched *touched; // [SONDE_WINDOW_TOUCHED]
  double *scratch;        // of the contact's solver
  sonde_answer moved;     // by the motion as it is; x is the solid's
  sonde_answer pressed;   // by a unit motion of the touched rectangle
  double stress_scale;    // contact force over the reaction to the unit motion
  sonde_mat3 *stress;     // [hexes] under a unit motion, where felt
  bool *felt;             // [hexes] those around the vessels
  sonde_fold_repair repair;
  bool loaded;
  uint32_t iterations;
} sonde_window;

// Memory and pattern. @thread owner
sonde_status sonde_window_create(sonde_window **window, sonde_error *error);
void sonde_window_destroy(sonde_window *window);

// Corners and materials for a footprint; the numbers follow by steps. No allocation.
void sonde_window_begin(sonde_window *window, const sonde_interior *in, sonde_footprint footprint);
// True when done (window->ready) or failed.
bool sonde_window_step(sonde_window *window, uint64_t budget);

// Steps of that budget that a window takes, wherever it is.
uint32_t sonde_window_steps(const sonde_window *window, uint64_t budget);

// Reads the contact and solves. @return false when nothing is touched
bool sonde_window_update(sonde_window *window, const sonde_interior *in,
                         const sonde_interior_input *input);

// Displacement (leg frame: e1, e2, axis) at angle, row and radius; false beyond the ends.
bool sonde_window_field(const sonde_window *window, double theta, double s, double r, double u[3]);
// Cauchy stress (Pa, tension positive, leg frame), scaled to the contact force.
bool sonde_window_stress(const sonde_window *window, double theta, double s, double r,
                         sonde_mat3 *stress);

#endif
