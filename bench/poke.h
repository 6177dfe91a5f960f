// Random poking of a model with a probe, and the laws that every tick must obey. The path depends
// on the seed and on the forces felt, so that equal runs repeat.
#ifndef SONDE_BENCH_POKE_H
#define SONDE_BENCH_POKE_H

#include "sonde/world.h"

// What a path may do.
typedef struct poke_def {
  double dt_s;
  double fastest_m_s;  // of the probe
  double deepest_m;    // below the skin at rest
  double most_force_n; // felt more: the probe is lifted
} poke_def;

typedef struct poke {
  const sonde_model *model;
  poke_def def;
  uint64_t random;
  const sonde_site *site;
  double at[6], goal[6]; // depth, way along u and v (m), tilts about u and v, turn (rad)
  uint32_t left;         // ticks of this move
} poke;

poke_def poke_def_default(void);
// Starts 5 mm above a random site. @param model borrowed
poke poke_begin(const sonde_model *model, const poke_def *def, uint64_t seed);
// The next number of the path's own sequence, from low to high.
double poke_uniform(poke *path, double low, double high);
// Pose of the next tick, after the force of the last was felt.
sonde_pose poke_next(poke *path, double felt_n);

// What a run has seen.
typedef struct poke_watch {
  double most_force_n, most_share; // of the way to x_m
  double most_move_m;              // of a node from rest
  double least_forward; // (force out of the skin)/(sum of the nodes' forces), without friction >= 0
  double push_n;        // sum of the nodes' forces at the last tick
  uint64_t ticks, touching, pressed, not_converged, full; // pressed: above 50 N
} poke_watch;

// Looks at the state after a step: NULL, or the law that is broken. All numbers are finite and no
// NON_FINITE flag is set; no region pushes the wrong way; the probe is not drawn into the skin,
// apart from friction (which is at most mu_static times the normal push, of this tick or the last);
// no node is at its asymptote or has left the scene.
const char *poke_check(poke_watch *watch, sonde_state *state, sonde_pose pose);

#endif
