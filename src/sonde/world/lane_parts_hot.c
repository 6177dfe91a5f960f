// The kernels over a whole body: one part, or two beside each other, and their sums.
// look:   what a part sees of the other, before the kernels that read neighbours.
// run:    a kernel over all parts; run_part: over one.
#include "world/lane_parts.h"

#include "world/crew.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

typedef enum phase { LINEARISE, SWEEP, RESTART, MULTIPLY, ADVANCE, BEND, ACCEPT, UPDATE } phase;

typedef struct job {
  sonde_lanes *lanes;
  phase phase;
  bool flag; // sweep, or first
  float alpha, beta;
  double value[SONDE_PARTS];
  sonde_lane_sums sums[SONDE_PARTS];
} job;

static void copy_rows(float *rows, uint32_t to, const uint32_t *from, uint32_t count, size_t size) {
  for (uint32_t k = 0; k < count; ++k)
    memcpy(rows + (to + k) * size, rows + from[k] * size, size * sizeof *rows);
}

// The rows of part 1 - `part` are those that this part sees.
static void look(void *with, uint32_t part) {
  const job *j = with;
  sonde_lanes *lanes = j->lanes;
  uint32_t other = 1 - part, first = lanes->part_seen[other];
  uint32_t count = lanes->part_seen[other + 1] - first;
  uint32_t to = lanes->slice_count * SONDE_LANES + first;
  const uint32_t *from = lanes->seen + first;
  bool places = j->phase == LINEARISE;
  if (places && lanes->law.springs) copy_rows(lanes->record, to, from, count, SONDE_RECORD);
  if (places && lanes->law.layered) copy_rows(lanes->slide, to, from, count, SONDE_RECORD);
  if (!places && lanes->law.springs) copy_rows(lanes->direction, to, from, count, SONDE_QUAD);
  if (!places && lanes->law.layered) copy_rows(lanes->layer_direction, to, from, count, SONDE_QUAD);
}

static void run_part(void *with, uint32_t part) {
  job *j = with;
  sonde_lanes *lanes = j->lanes;
  const sonde_lane_kernels *kernels = lanes->kernels;
  sonde_lane_sums *sums = &j->sums[part];
  switch (j->phase) {
  case LINEARISE: kernels->linearise(lanes, part, j->flag, sums); break;
  case SWEEP: kernels->sweep(lanes, part, sums); break;
  case RESTART: kernels->restart(lanes, part, sums); break;
  case MULTIPLY: j->value[part] = kernels->multiply(lanes, part, j->flag); break;
  case ADVANCE: kernels->advance(lanes, part, j->flag, j->alpha, j->beta, sums); break;
  case BEND: j->value[part] = kernels->bend(lanes, part); break;
  case ACCEPT: kernels->accept(lanes, part); break;
  case UPDATE: j->value[part] = kernels->update(lanes, part); break;
  }
}

static bool reads_neighbours(phase p) {
  return p == LINEARISE || p == SWEEP || p == RESTART || p == MULTIPLY;
}

// The sums of all parts end up in those of the first.
static void run(job *j) {
  if (j->lanes->part_count == 1) {
    run_part(j, 0);
    return;
  }
  if (reads_neighbours(j->phase)) sonde_crew_run(j->lanes->crew, look, j);
  sonde_crew_run(j->lanes->crew, run_part, j);
  sonde_lane_sums *sum = &j->sums[0];
  const sonde_lane_sums *more = &j->sums[1];
  j->value[0] += j->value[1];
  sum->left2 += more->left2, sum->far2 += more->far2;
  sum->force2 += more->force2, sum->product += more->product;
  sum->reaction_n = v_add(sum->reaction_n, more->reaction_n);
  sum->slots += more->slots;
}

sonde_lane_sums sonde_parts_linearise(sonde_lanes *lanes, bool sweep) {
  job j = {.lanes = lanes, .phase = LINEARISE, .flag = sweep};
  run(&j);
  lanes->reaction_n = j.sums[0].reaction_n;
  lanes->slot_total = j.sums[0].slots;
  return j.sums[0];
}

sonde_lane_sums sonde_parts_sweep(sonde_lanes *lanes) {
  job j = {.lanes = lanes, .phase = SWEEP};
  run(&j);
  return j.sums[0];
}

sonde_lane_sums sonde_parts_restart(sonde_lanes *lanes) {
  job j = {.lanes = lanes, .phase = RESTART};
  run(&j);
  return j.sums[0];
}

double sonde_parts_multiply(sonde_lanes *lanes, bool first) {
  job j = {.lanes = lanes, .phase = MULTIPLY, .flag = first};
  run(&j);
  return j.value[0];
}

sonde_lane_sums sonde_parts_advance(sonde_lanes *lanes, bool first, float alpha, float beta) {
  job j = {.lanes = lanes, .phase = ADVANCE, .flag = first, .alpha = alpha, .beta = beta};
  run(&j);
  return j.sums[0];
}

double sonde_parts_bend(sonde_lanes *lanes) {
  job j = {.lanes = lanes, .phase = BEND};
  run(&j);
  return j.value[0];
}

void sonde_parts_accept(sonde_lanes *lanes) {
  job j = {.lanes = lanes, .phase = ACCEPT};
  run(&j);
}

double sonde_parts_update(sonde_lanes *lanes) {
  job j = {.lanes = lanes, .phase = UPDATE};
  run(&j);
  return j.value[0];
}
