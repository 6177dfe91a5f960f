// The linear system of a step of a body without masses whose compliance C = K^-1 is known, such as
// a condensed solid (Bro-Nielsen and Cotin 1996): only touched rows c enter. With w = ue +
// damping_s ve, the contact's forces f and matrix B, and the numbers h and s of the step,
//   s K x + B x = h (f - K w)   leads to   (s K_c + B_c) x_c = h (f_c - K_c w_c),  K_c = (C_cc)^-1
//   x = -(h/s) w + (1/s) C_.c p,  p = K_c (s x_c + h w_c)   what the contact pushes the rows by
#include "world/batches.h"

#include "base/base.h"
#include "base/maths.h"
#include "sparse/dense.h"

#include <string.h>

// Adds the contact's part of the matrix: products with unit vectors, since corners are coupled.
static void add_contact(sonde_response *r, sonde_batches *body) {
  const size_t quads = (size_t)SONDE_BATCH * SONDE_QUAD;
  uint32_t n = 3 * r->count;
  for (uint32_t k = 0; k < body->contact_count; ++k)
    memset(body->probe_move + body->contact_batch[k] * quads, 0, quads * sizeof(real));
  for (uint32_t i = 0; i < n; ++i) {
    static const int SYMMETRIC[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
    uint32_t row = r->row[i / 3], l = row % SONDE_BATCH;
    const sonde_batch_contact *own = &body->contact[body->contact_of[row / SONDE_BATCH] - 1];
    double *to = r->matrix + (size_t)i * n;
    for (uint32_t c = 0; c < 3; ++c) {
      int at = SYMMETRIC[i % 3][c];
      real taken = body->corners_coupled ? own->neighbours[at][l] : 0;
      to[i - i % 3 + c] += (double)(own->block[at][l] - taken);
    }
    if (!body->corners_coupled) continue;
    real *unit = &body->probe_move[(size_t)row * SONDE_QUAD + i % 3];
    *unit = 1;
    sonde_batches_couple(body, body->probe_move);
    *unit = 0;
    for (uint32_t j = 0; j < n; ++j) {
      uint32_t other = r->row[j / 3];
      const sonde_batch_contact *beside = &body->contact[body->contact_of[other / SONDE_BATCH] - 1];
      to[j] -= (double)beside->product[other % SONDE_BATCH][j % 3];
    }
  }
}

// Pushes of the touched rows into r->push. False: no solution.
static bool push_touched(sonde_response *r, const sonde_state *state, sonde_batches *body,
                         double scale) {
  const sonde_tissue *tissue = body->tissue;
  const double force_scale = (double)body->step.force_scale, gain = (double)tissue->gain;
  uint32_t n = 3 * state->touched_count;
  SONDE_ASSERT(n > 0 && n <= 3 * r->most);
  // The stiffness between the touched rows while all others follow, found anew for other rows.
  if (r->changed) {
    memcpy(r->row, state->touched, state->touched_count * sizeof *r->row);
    for (uint32_t i = 0; i < n; ++i) {
      const reals *column =
          tissue->compliance + 3 * (3 * (size_t)r->row[i / 3] + i % 3) * body->common.batch_count;
      for (uint32_t j = 0; j < n; ++j) {
        uint32_t s = r->row[j / 3] / SONDE_BATCH, l = r->row[j / 3] % SONDE_BATCH;
        r->matrix[(size_t)i * n + j] = (double)column[3 * s + j % 3][l];
      }
    }
    r->count = 0;
    if (!sonde_cholesky(r->matrix, n)) return false;
    sonde_cholesky_invert(r->matrix, n, r->stiffness);
    r->count = state->touched_count;
  }
  for (size_t k = 0; k < (size_t)n * n; ++k) r->matrix[k] = scale * r->stiffness[k];
  add_contact(r, body);
  for (uint32_t j = 0; j < n; ++j) {
    uint32_t s = r->row[j / 3] / SONDE_BATCH, l = r->row[j / 3] % SONDE_BATCH;
    const sonde_batch *at = &body->batch[s];
    r->way[j] = (double)at->u[j % 3][l] +
                (double)(body->step.reach + tissue->damping_s) * (double)at->ve[j % 3][l];
  }
  for (uint32_t i = 0; i < n; ++i) {
    uint32_t row = r->row[i / 3];
    const sonde_batch_contact *at = &body->contact[body->contact_of[row / SONDE_BATCH] - 1];
    double resisted = 0;
    for (uint32_t j = 0; j < n; ++j) resisted += r->stiffness[(size_t)i * n + j] * r->way[j];
    r->move[i] = force_scale * ((double)at->force[i % 3][row % SONDE_BATCH] - gain * resisted);
  }
  if (!sonde_cholesky(r->matrix, n)) return false;
  sonde_cholesky_solve(r->matrix, n, r->move);
  for (uint32_t j = 0; j < n; ++j) r->way[j] = scale * r->move[j] + force_scale * gain * r->way[j];
  for (uint32_t i = 0; i < n; ++i) {
    r->push[i] = 0;
    for (uint32_t j = 0; j < n; ++j) r->push[i] += r->stiffness[(size_t)i * n + j] * r->way[j];
  }
  return true;
}

bool sonde_batches_respond(sonde_state *state, sonde_batches *body, double *force2) {
  sonde_response *r = &body->response;
  const sonde_tissue *tissue = body->tissue;
  const sonde_step_scales *step = &body->step;
  double scale = (double)tissue->gain *
                 (double)(step->stiffness_scale + tissue->damping_s * step->damping_scale);
  uint32_t count = state->touched_count, batches = body->common.batch_count;
  r->changed = count != r->count || memcmp(r->row, state->touched, count * sizeof *r->row) != 0;
  if (count > r->most || !(scale > 0) || body->holds || body->region_push_count > 0) return false;
  if (count > 0 && !push_touched(r, state, body, scale)) return false;

  // The whole skin follows from the pushes; without them it creeps back.
  const real back = step->force_scale * tissue->gain / (real)scale;
  for (uint32_t s = 0; s < batches; ++s) {
    sonde_batch *at = &body->batch[s];
    for (int c = 0; c < 3; ++c)
      at->x[c] = -back * (at->u[c] + (step->reach + tissue->damping_s) * at->ve[c]);
  }
  if (count == 0) r->count = 0;
  sonde_vec3 sum = {0};
  *force2 = 0;
  for (uint32_t k = 0; k < 3 * count; ++k) {
    const reals *column = tissue->compliance + 3 * (3 * (size_t)r->row[k / 3] + k % 3) * batches;
    const real push = (real)(r->push[k] / scale);
    for (uint32_t s = 0; s < batches; ++s)
      for (int c = 0; c < 3; ++c) body->batch[s].x[c] += push * column[3 * s + (uint32_t)c];
    *force2 += r->push[k] * r->push[k];
  }
  for (uint32_t k = 0; k < count; ++k)
    sum = v_add(sum, vec3(r->push[3 * k], r->push[3 * k + 1], r->push[3 * k + 2]));
  body->reaction_n = v_scale(sum, -1 / (double)step->force_scale);
  body->common.bytes_moved += sizeof(reals) * batches * (12 + 9 * (size_t)count);
  state->solver.converged = true;
  state->solver.iterations += 1;
  return true;
}
