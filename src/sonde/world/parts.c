// The kernels over a whole body: one part, or two beside each other, and their sums.
#include "world/batches.h"

#include "world/second_thread.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

// The first four read neighbours.
typedef enum phase { LINEARISE, SWEEP, RESTART, MULTIPLY, ADVANCE, BEND, ACCEPT, UPDATE } phase;

typedef struct job {
  sonde_batches *body;
  phase phase;
  bool flag; // sweep, or first
  real alpha, beta;
  double value[SONDE_PARTS];
  sonde_batch_sums sums[SONDE_PARTS];
} job;

static void copy_rows(real *rows, uint32_t to, const uint32_t *from, uint32_t count, size_t size) {
  for (uint32_t k = 0; k < count; ++k)
    memcpy(rows + (to + k) * size, rows + from[k] * size, size * sizeof *rows);
}

// The rows of part 1 - `part` are those that this part sees.
static void look(void *with, uint32_t part) {
  const job *j = with;
  sonde_batches *body = j->body;
  uint32_t other = 1 - part, first = body->part_seen[other];
  uint32_t count = body->part_seen[other + 1] - first;
  uint32_t to = body->common.batch_count * SONDE_BATCH + first;
  const uint32_t *from = body->seen + first;
  for (int k = 0; k < SONDE_PUBLISHED; ++k) {
    const sonde_published *rows = &body->tissue->published[k];
    if (!rows->place || (k == 0 && !body->tissue->reads_rows)) continue;
    if (j->phase == LINEARISE)
      copy_rows(rows->place, to, from, count, SONDE_RECORD);
    else
      copy_rows(rows->direction, to, from, count, SONDE_QUAD);
  }
}

static void run_part(void *with, uint32_t part) {
  job *j = with;
  sonde_batches *body = j->body;
  const sonde_kernels *kernels = body->kernels;
  sonde_batch_sums *sums = &j->sums[part];
  switch (j->phase) {
  case LINEARISE: kernels->linearise(body, part, j->flag, sums); break;
  case SWEEP: kernels->sweep(body, part, sums); break;
  case RESTART: kernels->restart(body, part, sums); break;
  case MULTIPLY: j->value[part] = kernels->multiply(body, part, j->flag); break;
  case ADVANCE: kernels->advance(body, part, j->flag, j->alpha, j->beta, sums); break;
  case BEND: j->value[part] = kernels->bend(body, part); break;
  case ACCEPT: kernels->accept(body, part); break;
  case UPDATE: j->value[part] = kernels->update(body, part); break;
  }
}

// The sums of all parts end up in those of the first.
static void run(job *j) {
  if (j->body->part_count == 1) {
    run_part(j, 0);
    return;
  }
  if (j->phase <= MULTIPLY) sonde_second_thread_run(j->body->thread, look, j);
  sonde_second_thread_run(j->body->thread, run_part, j);
  sonde_batch_sums *sum = &j->sums[0];
  const sonde_batch_sums *more = &j->sums[1];
  j->value[0] += j->value[1];
  sum->residual2 += more->residual2, sum->far2 += more->far2;
  sum->force2 += more->force2, sum->product += more->product;
  sum->reaction_n = v_add(sum->reaction_n, more->reaction_n);
  sum->holder_n = v_add(sum->holder_n, more->holder_n);
  sum->slots += more->slots;
}

sonde_batch_sums sonde_parts_linearise(sonde_batches *body, bool sweep) {
  job j = {.body = body, .phase = LINEARISE, .flag = sweep};
  run(&j);
  body->reaction_n = j.sums[0].reaction_n;
  body->holder_n = j.sums[0].holder_n;
  body->slot_total = j.sums[0].slots;
  return j.sums[0];
}

sonde_batch_sums sonde_parts_sweep(sonde_batches *body) {
  job j = {.body = body, .phase = SWEEP};
  run(&j);
  return j.sums[0];
}

sonde_batch_sums sonde_parts_restart(sonde_batches *body) {
  job j = {.body = body, .phase = RESTART};
  run(&j);
  return j.sums[0];
}

double sonde_parts_multiply(sonde_batches *body, bool first) {
  job j = {.body = body, .phase = MULTIPLY, .flag = first};
  run(&j);
  return j.value[0];
}

sonde_batch_sums sonde_parts_advance(sonde_batches *body, bool first, real alpha, real beta) {
  job j = {.body = body, .phase = ADVANCE, .flag = first, .alpha = alpha, .beta = beta};
  run(&j);
  return j.sums[0];
}

double sonde_parts_bend(sonde_batches *body) {
  job j = {.body = body, .phase = BEND};
  run(&j);
  return j.value[0];
}

void sonde_parts_accept(sonde_batches *body) {
  job j = {.body = body, .phase = ACCEPT};
  run(&j);
}

double sonde_parts_update(sonde_batches *body) {
  job j = {.body = body, .phase = UPDATE};
  run(&j);
  return j.value[0];
}
