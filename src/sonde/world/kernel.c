// Kernels of an engine (docs/world.md), compiled once per instruction set and precision
// with each deformable model. Every sum has a fixed order: all sets give the same bits. The tissue
// is in the model's kernel.h, the contact in kernel_contact.c; here are the sweeps and conjugate
// gradients over batches of nodes.
#include "world/batches.h"

#include "base/base.h"

#include SONDE_MODEL_KERNEL

#include "world/kernel_contact.c"

// coupled: corner couplings do their part; else a row's own block stands for all of them.
INLINE void add_contact(const sonde_batch_contact *contact, bool coupled_corners,
                        sonde_row_sum *sum) {
  for (int c = 0; c < 3; ++c) sum->force[c] += contact->force[c];
  for (int c = 0; c < 6; ++c)
    sum->block[c] +=
        coupled_corners ? contact->block[c] - contact->neighbours[c] : contact->block[c];
}

INLINE void factorise(const reals d[6], reals factor[6]) {
  factor[3] = 1 / d[0];
  factor[0] = d[1] * factor[3];
  factor[1] = d[2] * factor[3];
  factor[4] = 1 / (d[3] - factor[0] * d[1]);
  reals rest = d[4] - factor[1] * d[1];
  factor[2] = rest * factor[4];
  factor[5] = 1 / (d[5] - factor[1] * d[2] - factor[2] * rest);
}

INLINE void divide(const reals factor[6], const reals r[3], reals z[3]) {
  reals y = r[1] - factor[0] * r[0];
  z[2] = (r[2] - factor[1] * r[0] - factor[2] * y) * factor[5];
  z[1] = y * factor[4] - factor[2] * z[2];
  z[0] = r[0] * factor[3] - factor[0] * z[1] - factor[1] * z[2];
}

INLINE real most(reals a) {
  real value = 0;
  for (int l = 0; l < SONDE_BATCH; ++l) value = a[l] > value ? a[l] : value;
  return value;
}

typedef struct sums_of_rows {
  wide_sum rr[2], ff, rz, reaction[3], holder[3]; // rr: far from and near the probe
} sums_of_rows;

// Displacement and velocity where a batch is evaluated.
INLINE sonde_motion_at motion_at(const sonde_batches *body, uint32_t s) {
  const sonde_batch *at = &body->batch[s];
  sonde_motion_at here;
  for (int c = 0; c < 3; ++c)
    here.ve[c] = at->ve[c], here.ue[c] = at->u[c] + body->step.reach * at->ve[c];
  return here;
}

INLINE void write_place(sonde_batches *body, uint32_t s, const sonde_motion_at *at) {
  const reals low[4] = {at->ue[0], at->ue[1], at->ue[2], at->ve[0]};
  const reals high[4] = {at->ve[1], at->ve[2], {0}, {0}};
  real *record = body->tissue->published[0].place + (size_t)s * SONDE_BATCH * SONDE_RECORD;
  if (!body->tissue->reads_rows) return;
  write_records(record, SONDE_RECORD, low);
  write_records(record + 4, SONDE_RECORD, high);
}

INLINE void publish_record(sonde_batches *body, uint32_t s) {
  sonde_motion_at here = motion_at(body, s);
  write_place(body, s, &here);
  tissue_publish(body->tissue, s, &here);
}

INLINE void publish_direction(sonde_batches *body, uint32_t s, const reals z[3]) {
  real *direction = body->tissue->published[0].direction + (size_t)s * SONDE_BATCH * SONDE_QUAD;
  const reals whole_z[4] = {z[0], z[1], z[2], {0}};
  if (body->tissue->reads_rows || (body->corners_coupled && body->contact_of[s]))
    write_records(direction, SONDE_QUAD, whole_z);
  tissue_publish_direction(body->tissue, s, z);
}

INLINE void linearise_batch(sonde_batches *body, uint32_t s, bool moves, sums_of_rows *sums) {
  const sonde_step_scales *step = &body->step;
  const sonde_rows *rows = &body->rows[s];
  sonde_batch *at = &body->batch[s];
  sonde_row_sum sum = {{{0}}, {{0}}, {{0}}};
  const sonde_motion_at here = motion_at(body, s);
  tissue_evaluate(body->tissue, step, rows, s, &here, &sum);
  for (int c = 0; c < 3; ++c) sums->reaction[c] += widen(sum.force[c]);
  if (body->holds)
    for (int c = 0; c < 3; ++c) sums->holder[c] += widen(sum.force[c] * (1 - body->free[s]));
  if (body->contact_of[s])
    add_contact(&body->contact[body->contact_of[s] - 1], body->corners_coupled, &sum);
  reals force[3], r[3], x[3], mass = step->mass_scale * rows->mass;
  for (int c = 0; c < 3; ++c) {
    force[c] = step->force_scale * sum.force[c];
    r[c] = force[c] - mass * (here.ve[c] - at->v[c]) - sum.pending[c];
    if (body->holds) r[c] *= body->free[s];
  }
  reals yield = rows->yield / step->force_scale, force2 = dot(force, force);
  body->unrest2[s] = most(force2 * (yield * yield));
  factorise(sum.block, at->factor);
  divide(at->factor, r, x);
  sonde_motion_at moved = here;
  for (int c = 0; c < 3; ++c) {
    at->x[c] = moves ? x[c] : (reals){0}, moved.ve[c] += x[c];
    moved.ue[c] = at->u[c] + step->reach * moved.ve[c];
    if (!moves) at->r[c] = r[c], at->z[c] = x[c];
  }
  wide_sum *rr = &sums->rr[body->is_near[s]];
  *rr += widen(dot(r, r));
  sums->rz += widen(dot(r, x));
  sums->ff += widen(force2);
  if (moves) {
    write_place(body, s, &moved);
    tissue_publish_move(body->tissue, s, &here, &moved, x);
  }
  publish_direction(body, s, x);
}

static void linearise(sonde_batches *body, uint32_t part, bool moves, sonde_batch_sums *sums) {
  sums_of_rows rows = {{{0}}, {0}, {0}, {{0}}, {{0}}};
  SONDE_ASSERT(body->step.force_scale > 0 && body->step.mass_scale > 0);
  sums->slots = 0;
  for (uint32_t a = body->part_awake[part]; a < body->part_awake[part + 1]; ++a) {
    sums->slots += tissue_slots(body->tissue, body->awake[a]);
    linearise_batch(body, body->awake[a], moves, &rows);
  }
  sums->far2 = total(rows.rr[0]);
  sums->residual2 = sums->far2 + total(rows.rr[1]);
  sums->force2 = total(rows.ff);
  sums->product = total(rows.rz);
  const wide_sum *f = rows.reaction, *h = rows.holder;
  sums->reaction_n = (sonde_vec3){total(f[0]), total(f[1]), total(f[2])};
  sums->holder_n = (sonde_vec3){total(h[0]), total(h[1]), total(h[2])};
}

// q += A p without the diagonal blocks for a batch, p the directions.
INLINE void couple(sonde_batches *body, uint32_t s, reals q[3]) {
  tissue_multiply(body->tissue, &body->step, s, q);
  if (body->contact_of[s]) {
    const sonde_batch_contact *contact = &body->contact[body->contact_of[s] - 1];
    wholes rows;
    for (int l = 0; l < SONDE_BATCH; ++l) rows[l] = l;
    reals product[4];
    read_quads((const real *)contact->product, &rows, product);
    for (int c = 0; c < 3; ++c) q[c] -= product[c];
  }
  if (body->holds)
    for (int c = 0; c < 3; ++c) q[c] *= body->free[s];
}
// After a batch was solved for itself its residual is what its neighbours have moved since.
static void sweep(sonde_batches *body, uint32_t part, sonde_batch_sums *sums) {
  wide_sum rr[2] = {{0}, {0}};
  SONDE_ASSERT(body->awake_count <= body->common.batch_count);
  for (uint32_t a = body->part_awake[part]; a < body->part_awake[part + 1]; ++a) {
    uint32_t s = body->awake[a];
    sonde_batch *at = &body->batch[s];
    reals q[3] = {{0}, {0}, {0}}, r[3], z[3];
    couple(body, s, q);
    for (int c = 0; c < 3; ++c) r[c] = -q[c];
    divide(at->factor, r, z);
    for (int c = 0; c < 3; ++c) at->x[c] += z[c];
    wide_sum *sum = &rr[body->is_near[s]];
    *sum += widen(dot(r, r));
    publish_direction(body, s, z);
  }
  sums->far2 = total(rr[0]);
  sums->residual2 = sums->far2 + total(rr[1]);
}

// The last sweep left a batch what those after it and its own rows moved since: moves of batches
// before it, which it saw, are taken back before it looks.
static void restart(sonde_batches *body, uint32_t part, sonde_batch_sums *sums) {
  wide_sum rz = {0}, rr = {0};
  const reals none[3] = {{0}, {0}, {0}};
  for (uint32_t a = body->part_awake[part]; a < body->part_awake[part + 1]; ++a) {
    sonde_batch *at = &body->batch[body->awake[a]];
    reals q[3] = {{0}, {0}, {0}};
    couple(body, body->awake[a], q);
    for (int c = 0; c < 3; ++c) at->r[c] = -q[c];
    publish_direction(body, body->awake[a], none);
  }
  for (uint32_t a = body->part_awake[part]; a < body->part_awake[part + 1]; ++a) {
    sonde_batch *at = &body->batch[body->awake[a]];
    divide(at->factor, at->r, at->z);
    rz += widen(dot(at->r, at->z));
    rr += widen(dot(at->r, at->r));
    publish_direction(body, body->awake[a], at->z);
  }
  sums->product = total(rz);
  sums->residual2 = total(rr);
}

// The diagonal blocks' part of A z is r.
static double multiply(sonde_batches *body, uint32_t part, bool first) {
  wide_sum sum = {0};
  for (uint32_t a = body->part_awake[part]; a < body->part_awake[part + 1]; ++a) {
    uint32_t s = body->awake[a];
    sonde_batch *at = &body->batch[s];
    reals q[3] = {at->r[0], at->r[1], at->r[2]}, *out = first ? at->q : at->w;
    couple(body, s, q);
    for (int c = 0; c < 3; ++c) out[c] = q[c];
    sum += widen(dot(at->z, q));
  }
  return total(sum);
}

INLINE void advance_batch(sonde_batch *at, bool first, real alpha, real beta) {
  for (int c = 0; c < 3; ++c) {
    reals p = first ? at->z[c] : at->z[c] + beta * at->p[c];
    reals q = first ? at->q[c] : at->w[c] + beta * at->q[c];
    at->x[c] += alpha * p;
    at->r[c] -= alpha * q;
    at->p[c] = p;
    if (!first) at->q[c] = q;
  }
}

static void advance(sonde_batches *body, uint32_t part, bool first, real alpha, real beta,
                    sonde_batch_sums *sums) {
  wide_sum rz = {0}, rr = {0};
  for (uint32_t a = body->part_awake[part]; a < body->part_awake[part + 1]; ++a) {
    sonde_batch *at = &body->batch[body->awake[a]];
    if (first)
      advance_batch(at, true, alpha, beta);
    else
      advance_batch(at, false, alpha, beta);
    reals r[3] = {at->r[0], at->r[1], at->r[2]}, z[3];
    divide(at->factor, r, z);
    for (int c = 0; c < 3; ++c) at->z[c] = z[c];
    rz += widen(dot(r, z));
    rr += widen(dot(r, r));
    publish_direction(body, body->awake[a], z);
  }
  sums->product = total(rz);
  sums->residual2 = total(rr);
}

// What the linear system does not see of the move that x makes, as an impulse, like the residual.
static double bend(sonde_batches *body, uint32_t part) {
  wide_sum sum = {0};
  for (uint32_t a = body->part_awake[part]; a < body->part_awake[part + 1]; ++a) {
    uint32_t s = body->awake[a];
    const sonde_batch *at = &body->batch[s];
    reals moved2 = body->step.reach * body->step.reach * dot(at->x, at->x);
    reals unseen =
        body->step.force_scale * moved2 * tissue_unseen(body->tissue, &body->rows[s], s, at->u);
    sum += widen(unseen * unseen);
  }
  return total(sum);
}

static void accept(sonde_batches *body, uint32_t part) {
  for (uint32_t a = body->part_awake[part]; a < body->part_awake[part + 1]; ++a) {
    sonde_batch *at = &body->batch[body->awake[a]];
    for (int c = 0; c < 3; ++c) at->ve[c] += at->x[c], at->x[c] = (reals){0};
    publish_record(body, body->awake[a]);
  }
}

// u += h (v + lambda dv), v += dv: ve with x is v + lambda dv, or, explicit, x is dv.
static double update(sonde_batches *body, uint32_t part) {
  real h = body->step.dt, lambda = body->step.lambda;
  SONDE_ASSERT(h > 0 && lambda >= 0 && lambda <= 1);
  wide_sum sum = {0};
  for (uint32_t a = body->part_awake[part]; a < body->part_awake[part + 1]; ++a) {
    uint32_t s = body->awake[a];
    sonde_batch *at = &body->batch[s];
    reals move[3], v[3];
    for (int c = 0; c < 3; ++c) {
      v[c] = at->ve[c] + at->x[c], move[c] = h * v[c];
      if (lambda == 0)
        move[c] = h * at->ve[c];
      else if (lambda < 1)
        v[c] = at->v[c] + (v[c] - at->v[c]) / lambda;
    }
    tissue_bound(body->tissue, s, h, at->u, move, v);
    for (int c = 0; c < 3; ++c) {
      at->u[c] += move[c];
      at->ve[c] = v[c] + lambda * (v[c] - at->v[c]);
      at->v[c] = v[c];
    }
    reals speed2 = dot(at->v, at->v), moved2 = dot(at->u, at->u);
    body->speed2[s] = most(speed2);
    body->moved2[s] = most(moved2);
    body->common.published[s] = 0;
    publish_record(body, s);
    sum += widen(speed2 + moved2);
  }
  return total(sum);
}

// Whether a node of the batch is inside the box where it is evaluated.
INLINE bool reaches(const sonde_rows *rows, const sonde_batch *at, real reach, const real low[3],
                    const real high[3], real margin) {
  wholes inside = (wholes){0} == (wholes){0};
  for (int c = 0; c < 3; ++c) {
    reals x = rows->place[c] + (at->u[c] + reach * at->ve[c]);
    inside &= (x >= low[c] - margin) & (x <= high[c] + margin);
  }
  return bits(inside) != 0;
}

// Of a batch of batches those whose nodes may be inside: bits. A node moves by less than three
// times what its speed takes it.
INLINE uint32_t nearby(const sonde_batches *body, uint32_t group, const real low[3],
                       const real high[3], real edges) {
  const sonde_batch_boxes *box = &body->box[group];
  const reals least = all((real)1e-20);
  reals moved2 = larger(*(const reals *)(body->moved2 + group * SONDE_BATCH), least);
  reals speed2 = larger(*(const reals *)(body->speed2 + group * SONDE_BATCH), least);
  reals unused, moved = root_and_inverse(moved2, &unused),
                speed = root_and_inverse(speed2, &unused);
  reals margin = edges * box->reach + (real)1e-4 + moved + 3 * body->step.dt * speed;
  wholes apart = {0};
  for (int c = 0; c < 3; ++c)
    apart |= (box->low[c] - margin > high[c]) | (box->high[c] + margin < low[c]);
  return bits(~apart);
}

static void near(sonde_batches *body, const real low[3], const real high[3], real edges) {
  uint32_t count = 0;
  for (uint32_t group = 0; group * SONDE_BATCH < body->common.batch_count; ++group)
    for (uint32_t rest = nearby(body, group, low, high, edges); rest; rest &= rest - 1) {
      uint32_t l = (uint32_t)__builtin_ctz(rest), s = group * SONDE_BATCH + l;
      real margin = edges * body->box[group].reach[l];
      if (reaches(&body->rows[s], &body->batch[s], body->step.reach, low, high, margin))
        body->near_probe[count++] = s;
    }
  SONDE_ASSERT(count <= body->common.batch_count);
  body->near_probe_count = count;
}

static void record(sonde_batches *body, uint32_t s) { publish_record(body, s); }

const sonde_kernels SONDE_KERNELS = {.name = SONDE_KERNELS_NAME,
                                     .record = record,
                                     .linearise = linearise,
                                     .sweep = sweep,
                                     .restart = restart,
                                     .multiply = multiply,
                                     .advance = advance,
                                     .bend = bend,
                                     .accept = accept,
                                     .update = update,
                                     .near = near,
                                     .locate = locate,
                                     .locate_moves = locate_moves,
                                     .push_faces = push_faces,
                                     .push_nodes = push_nodes,
                                     .advance_faces = advance_faces,
                                     .advance_nodes = advance_nodes,
                                     .couple_corners = couple_corners};
