// A thigh under a probe without a session: the world in steps of a session, and the inside when it
// is looked at. No picture is made.
#ifndef SONDE_SRC_TRAINER_BENCH_H
#define SONDE_SRC_TRAINER_BENCH_H

#include "trainer/trainer.h"

// The step of a session: in longer ones the skin under hard presses blows up.
static const double BENCH_STEP_S = 0.001;

typedef struct sonde_bench {
  sonde_circulation circulation;
  sonde_pathology pathology; // of the femoral vein, before the circulation
  sonde_probe probe;
  sonde_state *state;
  sonde_interior *interior;
  uint64_t tick, looked_tick; // now; of the last look at the inside
  bool looked;
} sonde_bench;

// @param setup outlives the bench @param findings copied; their branches may be none
// @param solid the inside by finite elements, else by columns
sonde_status sonde_bench_open(sonde_bench *bench, const sonde_case_setup *setup,
                              const sonde_findings *findings, bool solid, sonde_error *error);
// Also after a failed open.
void sonde_bench_close(sonde_bench *bench);
// The tissue back at rest, tick 0.
void sonde_bench_rest(sonde_bench *bench);
// One step of the world with the probe there.
void sonde_bench_step(sonde_bench *bench, sonde_pose probe);
// What a session's snapshot holds; vessels only under a probe that presses.
sonde_snapshot sonde_bench_look(sonde_bench *bench, sonde_pose probe);

#endif
