// Kernels of the fast engine (docs/world.md); lanes_*_hot.c include this file once per instruction
// set. Every sum has a fixed order: all sets give the same bits.
// linearise: springs and layers to the neighbours, normal and tangential springs, contact, matrix;
//            and the first sweep, in which every slice is solved for itself and goes on before the
//            next one looks, or the start of the conjugate gradients.
// sweep:     block Gauss-Seidel: the same with what the neighbours have moved since.
// restart:   residual after the sweeps.
// multiply, advance: parts of the conjugate gradients of Chronopoulos and Gear (1989), which
//            read and write every slice twice in an iteration.
// bend:      what a solution leaves unbalanced.
// accept, update: the solution's way into the motion, and the records that neighbours read.
// near:      slices in the probe's box. The contact itself: lanes_press_kernel.c.
#include "world/lanes_press_kernel.c"
#include "world/lanes_vector.h"

#include "base/base.h"

// Where slice s is after a step at velocity v: for springs, and for layers.
INLINE void publish_place(sonde_lanes *lanes, uint32_t s, const sonde_lane v[3],
                          const sonde_lane ue[3]) {
  const sonde_lane low[4] = {ue[0], ue[1], ue[2], v[0]}, high[4] = {v[1], v[2], {0}, {0}};
  size_t first = (size_t)s * SONDE_LANES * SONDE_RECORD;
  write_records(lanes->record + first, SONDE_RECORD, low);
  write_records(lanes->record + first + 4, SONDE_RECORD, high);
}

// indentation: where faces are evaluated; unseen: N.x of what was added since.
INLINE void publish_slide(sonde_lanes *lanes, uint32_t s, const sonde_lane ue[3],
                          sonde_lane indentation, sonde_lane unseen) {
  const sonde_lane *n = lanes->model[s].normal;
  sonde_lane along = dot(n, ue), slide[4];
  for (int c = 0; c < 3; ++c) slide[c] = ue[c] - along * n[c];
  slide[3] = indentation;
  const sonde_lane rest[4] = {unseen, {0}, {0}, {0}};
  float *record = lanes->slide + (size_t)s * SONDE_LANES * SONDE_RECORD;
  write_records(record, SONDE_RECORD, slide);
  write_records(record + 4, SONDE_RECORD, rest);
}

INLINE void publish_record(sonde_lanes *lanes, uint32_t s, const sonde_lane v[3]) {
  const sonde_slice *at = &lanes->slice[s];
  float h = lanes->law.dt;
  sonde_lane ue[3];
  for (int c = 0; c < 3; ++c) ue[c] = at->u[c] + h * v[c];
  if (lanes->law.springs) publish_place(lanes, s, v, ue);
  if (lanes->law.layered)
    publish_slide(lanes, s, ue, -dot(lanes->model[s].normal, ue), (sonde_lane){0});
}

// By what neighbours are coupled.
typedef struct coupled {
  bool springs, layers;
} coupled;

typedef struct node_sum {
  sonde_lane force[3], block[6];    // xx xy xz yy yz zz
  sonde_lane shear_force, coupling; // along N
  sonde_lane slide[3];              // the neighbours' tangential displacements times their weights
  sonde_lane pending;               // along N: what neighbours that went on do by the shear layer
} node_sum;

INLINE void add_rank_one(sonde_lane block[6], const sonde_lane n[3], sonde_lane scale,
                         sonde_lane flat) {
  sonde_lane x = scale * n[0], y = scale * n[1];
  block[0] += x * n[0] + flat;
  block[1] += x * n[1];
  block[2] += x * n[2];
  block[3] += y * n[1] + flat;
  block[4] += y * n[2];
  block[5] += scale * n[2] * n[2] + flat;
}

// The motion of a slice's rows where it is evaluated, and their indentation there.
typedef struct place {
  sonde_lane ue[3], ve[3], indentation;
} place;

// The spring-damper of an edge, seen from the row; the neighbour finds the opposite, bit for bit.
INLINE void add_spring(const sonde_lane_law *law, const sonde_slot *slot, sonde_lane share,
                       const float *record, const place *at, node_sum *sum,
                       sonde_slot_tangent *tangent) {
  sonde_lane d[3], w[3], n[3], other[6];
  read_records(record, &tangent->node, other);
  for (int c = 0; c < 3; ++c) {
    d[c] = slot->rest[c] + (other[c] - at->ue[c]);
    w[c] = other[3 + c] - at->ve[c];
  }
  sonde_lane least = 0.05f * slot->length, length2 = larger(dot(d, d), least * least);
  sonde_lane inverse = inverse_root(length2), length = length2 * inverse;
  for (int c = 0; c < 3; ++c) n[c] = d[c] * inverse;
  sonde_lane stretch = length - slot->length;
  sonde_lane stiffness = share * pick(stretch < 0, all(law->edge_stiffness * law->edge_compression),
                                      all(law->edge_stiffness));
  sonde_lane tension = share * law->edge_pretension + stiffness * stretch;
  sonde_lane lateral = larger(tension, all(0)) * inverse, damper = share * law->edge_damper;
  sonde_lane along = stiffness - lateral, pull = tension + damper * dot(n, w);
  sonde_lane steep = law->stiffness_scale * along + law->damping_scale * damper;
  sonde_lane flat = law->stiffness_scale * lateral;
  for (int c = 0; c < 3; ++c) {
    sum->force[c] += pull * n[c];
    tangent->n[c] = n[c];
  }
  add_rank_one(sum->block, n, steep, flat);
  tangent->along = steep;
  tangent->lateral = flat;
}

// Of the shear layer in a face: the secant modulus m = q/g and (q' - m)/(g^2 A), without the
// cancellation of q' - m; from x^2 = (g/gm)^2, in which there is no root below the guard.
INLINE void shear_law(const sonde_slot_face *face, sonde_lane x2, sonde_lane *modulus,
                      sonde_lane *beyond) {
  const float most = 0.95f, most2 = most * most;
  sonde_lane held = smaller(x2, all(most2)), inverse = 1 / (1 - held);
  sonde_lane secant = face->shear * inverse, steep = 2 * secant * inverse;
  *modulus = secant;
  *beyond = steep * face->bend;
  sonde_lane_index past = x2 > most2;
  if (bits(past) == 0) return;
  sonde_lane safe = larger(x2, all(most2)), x = safe * inverse_root(safe);
  sonde_lane slope = secant + steep * most2;
  sonde_lane mean = (secant * most + slope * (x - most)) / x;
  *modulus = pick(past, mean, secant);
  *beyond = pick(past, (slope - mean) / safe, steep) * face->bend;
}

// What a face does along N to the row, and how it couples the row to both neighbours.
typedef struct face_part {
  sonde_lane force, before, here;
} face_part;

INLINE face_part shear_face(float scale, const sonde_slot_face *face, sonde_lane own,
                            sonde_lane before, sonde_lane here) {
  const sonde_lane d[3] = {before - here, here - own, own - before};
  sonde_lane across[3], modulus, beyond;
  for (int k = 0; k < 3; ++k) across[k] = face->cot[k] * d[k];
  sonde_lane sum = across[0] * d[0] + across[1] * d[1] + across[2] * d[2];
  shear_law(face, sum * face->bend, &modulus, &beyond);
  sonde_lane flux = across[2] - across[1], steep = beyond * flux;
  return (face_part){.force = modulus * flux,
                     .before = scale * (steep * (across[0] - across[2]) - modulus * face->cot[2]),
                     .here = scale * (steep * (across[1] - across[0]) - modulus * face->cot[1])};
}

// Both layers around the rows of a slice. A slot's coupling is of its own face and the next one's;
// the face of the first slot goes round to the slot `turn` - 1. All faces are evaluated at one
// state, or their corners would feel forces that do not cancel: what neighbours have moved since
// counts by the matrix.
INLINE void add_layers(sonde_lanes *lanes, const sonde_slice_model *fixed, sonde_lane own,
                       node_sum *sum) {
  float scale = lanes->law.stiffness_scale;
  sonde_slot_layer *slot = lanes->slot_layer + fixed->first_slot;
  const sonde_slot_face *face = lanes->slot_face + fixed->first_slot;
  sonde_lane other[6], before, moved_before, open = {0}, round = {0};
  read_records(lanes->slide, &fixed->last, other);
  before = other[3], moved_before = other[4];
  for (uint32_t k = 0; k < fixed->slot_count; ++k) {
    read_records(lanes->slide, &slot[k].node, other);
    face_part part = shear_face(scale, &face[k], own, before, other[3]);
    for (int c = 0; c < 3; ++c) sum->slide[c] += slot[k].weight * other[c];
    sum->shear_force += part.force;
    sum->coupling += part.before + part.here;
    sum->pending += part.before * moved_before + part.here * other[4];
    if (k == 0)
      round = part.before;
    else
      slot[k - 1].coupling = open + (part.before + pick(fixed->turn == (int32_t)k, round, all(0)));
    open = part.here;
    before = other[3], moved_before = other[4];
  }
  uint32_t count = fixed->slot_count;
  if (count > 0)
    slot[count - 1].coupling = open + pick(fixed->turn == (int32_t)count, round, all(0));
}

// The part of a across the unit vector n.
INLINE void project(const sonde_lane n[3], sonde_lane a[3]) {
  sonde_lane along = dot(n, a);
  for (int c = 0; c < 3; ++c) a[c] -= along * n[c];
}

// Pressure of the normal spring and its slope; exponents above 1 go on straight for s < 0.
INLINE sonde_lane normal_pressure(const sonde_slice_model *fixed, int exponent, sonde_lane s,
                                  sonde_lane *slope) {
  sonde_lane held = smaller(s, fixed->limit), x = held / fixed->xm;
  if (exponent > 1) x = larger(x, all(0));
  sonde_lane power = exponent > 2 ? x * x * x : exponent > 1 ? x * x : x;
  sonde_lane inverse = 1 / (1 - power);
  sonde_lane bend = (1 + ((float)exponent - 1) * power) * inverse * inverse;
  *slope = fixed->k0 * bend;
  sonde_lane pressure = fixed->k0 * fixed->xm * (x * inverse);
  // Straight parts: beyond the guard, and below zero where x was cut.
  sonde_lane straight = exponent > 1 ? s - pick(held < 0, all(0), held) : s - held;
  return pressure + *slope * straight;
}

INLINE void add_anchor(const sonde_lane_law *law, const sonde_slice_model *fixed, const place *at,
                       node_sum *sum) {
  const sonde_lane *n = fixed->normal;
  sonde_lane s = at->indentation, rate = dot(n, at->ve), slope;
  sonde_lane pressure = normal_pressure(fixed, law->exponent, s, &slope);
  sonde_lane damper = law->normal_damping_s * fixed->k0 * fixed->area;
  sonde_lane tangent = law->tangential * fixed->area, slow = law->normal_damping_s * tangent;
  sonde_lane push = pressure * fixed->area - damper * rate + sum->shear_force;
  sonde_lane inplane = law->inplane * fixed->weight, hold = tangent + inplane;
  if (law->layered) project(n, sum->slide);
  for (int c = 0; c < 3; ++c)
    sum->force[c] += push * n[c] - hold * (at->ue[c] + s * n[c]) -
                     slow * (at->ve[c] - rate * n[c]) + law->inplane * sum->slide[c];
  sonde_lane flat = law->stiffness_scale * hold + law->damping_scale * slow;
  sonde_lane steep =
      law->stiffness_scale * slope * fixed->area + law->damping_scale * damper - sum->coupling;
  add_rank_one(sum->block, n, steep - flat, flat + fixed->mass);
}

// Forces and diagonal blocks of a slice's springs, the blocks of its edges.
INLINE void add_springs(sonde_lanes *lanes, const sonde_slice_model *fixed, coupled by,
                        const place *at, node_sum *sum) {
  uint32_t first = fixed->first_slot, whole = fixed->whole_count;
  for (uint32_t k = first; by.springs && k < first + fixed->slot_count; ++k)
    add_spring(&lanes->law, &lanes->slot[k], k < first + whole ? all(1) : lanes->share[k],
               lanes->record, at, sum, &lanes->tangent[k]);
  if (by.layers) add_layers(lanes, fixed, at->indentation, sum);
  add_anchor(&lanes->law, fixed, at, sum);
}

// tied: ties couple neighbours; else a row's own block stands for all of them.
INLINE void add_press(const sonde_slice_press *press, bool tied, node_sum *sum) {
  for (int c = 0; c < 3; ++c) sum->force[c] += press->force[c];
  for (int c = 0; c < 6; ++c)
    sum->block[c] += tied ? press->block[c] - press->tied[c] : press->block[c];
}

// L E L^T without pivoting: stable for positive definite blocks however long and thin.
INLINE void factorise(const sonde_lane d[6], sonde_lane factor[6]) {
  factor[3] = 1 / d[0];
  factor[0] = d[1] * factor[3];
  factor[1] = d[2] * factor[3];
  factor[4] = 1 / (d[3] - factor[0] * d[1]);
  sonde_lane rest = d[4] - factor[1] * d[1];
  factor[2] = rest * factor[4];
  factor[5] = 1 / (d[5] - factor[1] * d[2] - factor[2] * rest);
}

INLINE void divide(const sonde_lane factor[6], const sonde_lane r[3], sonde_lane z[3]) {
  sonde_lane y = r[1] - factor[0] * r[0];
  z[2] = (r[2] - factor[1] * r[0] - factor[2] * y) * factor[5];
  z[1] = y * factor[4] - factor[2] * z[2];
  z[0] = r[0] * factor[3] - factor[0] * z[1] - factor[1] * z[2];
}

INLINE void publish_direction(sonde_lanes *lanes, uint32_t s, const sonde_lane z[3]) {
  const sonde_lane *n = lanes->model[s].normal;
  size_t first = (size_t)s * SONDE_LANES * SONDE_QUAD;
  const sonde_lane whole[4] = {z[0], z[1], z[2], {0}};
  if (lanes->law.springs || (lanes->tied && lanes->press_of[s]))
    write_records(lanes->direction + first, SONDE_QUAD, whole);
  if (!lanes->law.layered) return;
  sonde_lane along = dot(n, z), parts[4];
  for (int c = 0; c < 3; ++c) parts[c] = z[c] - along * n[c];
  parts[3] = along;
  write_records(lanes->layer_direction + first, SONDE_QUAD, parts);
}

INLINE float most(sonde_lane a) {
  float value = 0;
  for (int l = 0; l < SONDE_LANES; ++l) value = a[l] > value ? a[l] : value;
  return value;
}

typedef struct sums_of_rows {
  lane_double rr[2], ff, rz, reaction[3]; // rr: far from and near the probe
} sums_of_rows;

INLINE void linearise_slice(sonde_lanes *lanes, uint32_t s, coupled by, bool moves,
                            sums_of_rows *sums) {
  const sonde_slice_model *fixed = &lanes->model[s];
  sonde_slice *at = &lanes->slice[s];
  float h = lanes->law.dt;
  node_sum sum = {{{0}}, {{0}}, {0}, {0}, {{0}}, {0}};
  place here;
  for (int c = 0; c < 3; ++c) here.ve[c] = at->ve[c], here.ue[c] = at->u[c] + h * at->ve[c];
  here.indentation = -dot(fixed->normal, here.ue);
  add_springs(lanes, fixed, by, &here, &sum);
  for (int c = 0; c < 3; ++c) sums->reaction[c] += widen(sum.force[c]);
  if (lanes->press_of[s]) add_press(&lanes->press[lanes->press_of[s] - 1], lanes->tied, &sum);
  sonde_lane force[3], r[3], x[3];
  for (int c = 0; c < 3; ++c) {
    force[c] = h * sum.force[c];
    r[c] = force[c] - fixed->mass * (here.ve[c] - at->v[c]);
    if (by.layers) r[c] -= sum.pending * fixed->normal[c];
  }
  sonde_lane yield = fixed->yield / h, force2 = dot(force, force);
  lanes->unrest2[s] = most(force2 * (yield * yield));
  factorise(sum.block, at->factor);
  divide(at->factor, r, x);
  for (int c = 0; c < 3; ++c) {
    at->x[c] = moves ? x[c] : (sonde_lane){0}, here.ve[c] += x[c];
    here.ue[c] = at->u[c] + h * here.ve[c];
    if (!moves) at->r[c] = r[c], at->z[c] = x[c];
  }
  lane_double *rr = &sums->rr[lanes->is_near[s]];
  *rr += widen(dot(r, r));
  sums->rz += widen(dot(r, x));
  sums->ff += widen(force2);
  if (moves && by.springs) publish_place(lanes, s, here.ve, here.ue);
  if (moves && by.layers) publish_slide(lanes, s, here.ue, here.indentation, dot(fixed->normal, x));
  publish_direction(lanes, s, x);
}

static void linearise(sonde_lanes *lanes, uint32_t part, bool moves, sonde_lane_sums *sums) {
  const sonde_lane_law *law = &lanes->law;
  sums_of_rows all_rows = {{{0}}, {0}, {0}, {{0}}};
  sums->slots = 0;
  for (uint32_t a = lanes->part_awake[part]; a < lanes->part_awake[part + 1]; ++a) {
    sums->slots += lanes->model[lanes->awake[a]].slot_count;
    if (law->springs && law->layered)
      linearise_slice(lanes, lanes->awake[a], (coupled){true, true}, moves, &all_rows);
    else if (law->layered)
      linearise_slice(lanes, lanes->awake[a], (coupled){false, true}, moves, &all_rows);
    else
      linearise_slice(lanes, lanes->awake[a], (coupled){true, false}, moves, &all_rows);
  }
  sums->far2 = total(all_rows.rr[0]);
  sums->left2 = sums->far2 + total(all_rows.rr[1]);
  sums->force2 = total(all_rows.ff);
  sums->product = total(all_rows.rz);
  const lane_double *reaction = all_rows.reaction;
  sums->reaction_n = (sonde_vec3){total(reaction[0]), total(reaction[1]), total(reaction[2])};
}

// q += A p without the diagonal blocks.
INLINE void multiply_slice(sonde_lanes *lanes, const sonde_slice_model *fixed, coupled by,
                           sonde_lane q[3]) {
  uint32_t first = fixed->first_slot;
  sonde_lane along = {0}, slide[3] = {{0}, {0}, {0}};
  for (uint32_t k = first; k < first + fixed->slot_count; ++k) {
    sonde_lane p[4];
    if (by.springs) {
      const sonde_slot_tangent *tangent = &lanes->tangent[k];
      read_quads(lanes->direction, &tangent->node, p);
      sonde_lane pull = tangent->along * dot(tangent->n, p);
      for (int c = 0; c < 3; ++c) q[c] -= pull * tangent->n[c] + tangent->lateral * p[c];
    }
    if (!by.layers) continue;
    const sonde_slot_layer *layer = &lanes->slot_layer[k];
    read_quads(lanes->layer_direction, &layer->node, p);
    along += layer->coupling * p[3];
    for (int c = 0; c < 3; ++c) slide[c] += layer->weight * p[c];
  }
  if (!by.layers) return;
  project(fixed->normal, slide);
  float inplane = lanes->law.stiffness_scale * lanes->law.inplane;
  for (int c = 0; c < 3; ++c) q[c] += along * fixed->normal[c] - inplane * slide[c];
}

// q += A p without the diagonal blocks for a slice, p the directions.
INLINE void couple(sonde_lanes *lanes, uint32_t s, sonde_lane q[3]) {
  if (lanes->law.springs && lanes->law.layered)
    multiply_slice(lanes, &lanes->model[s], (coupled){true, true}, q);
  else if (lanes->law.layered)
    multiply_slice(lanes, &lanes->model[s], (coupled){false, true}, q);
  else
    multiply_slice(lanes, &lanes->model[s], (coupled){true, false}, q);
  if (lanes->press_of[s] == 0) return;
  const sonde_slice_press *press = &lanes->press[lanes->press_of[s] - 1];
  const sonde_lane_index rows = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  sonde_lane carried[4];
  read_quads((const float *)press->carry, &rows, carried);
  for (int c = 0; c < 3; ++c) q[c] -= carried[c];
}

// After a slice was solved for itself its residual is what its neighbours have moved since.
static void sweep(sonde_lanes *lanes, uint32_t part, sonde_lane_sums *sums) {
  lane_double rr[2] = {{0}, {0}};
  SONDE_ASSERT(lanes->awake_count <= lanes->slice_count);
  for (uint32_t a = lanes->part_awake[part]; a < lanes->part_awake[part + 1]; ++a) {
    uint32_t s = lanes->awake[a];
    sonde_slice *at = &lanes->slice[s];
    sonde_lane q[3] = {{0}, {0}, {0}}, r[3], z[3];
    couple(lanes, s, q);
    for (int c = 0; c < 3; ++c) r[c] = -q[c];
    divide(at->factor, r, z);
    for (int c = 0; c < 3; ++c) at->x[c] += z[c];
    lane_double *sum = &rr[lanes->is_near[s]];
    *sum += widen(dot(r, r));
    publish_direction(lanes, s, z);
  }
  sums->far2 = total(rr[0]);
  sums->left2 = sums->far2 + total(rr[1]);
}

// The last sweep left a slice what those after it and its own rows moved since: moves of slices
// before it, which it saw, are taken back before it looks.
static void restart(sonde_lanes *lanes, uint32_t part, sonde_lane_sums *sums) {
  lane_double rz = {0}, rr = {0};
  const sonde_lane none[3] = {{0}, {0}, {0}};
  for (uint32_t a = lanes->part_awake[part]; a < lanes->part_awake[part + 1]; ++a) {
    sonde_slice *at = &lanes->slice[lanes->awake[a]];
    sonde_lane q[3] = {{0}, {0}, {0}};
    couple(lanes, lanes->awake[a], q);
    for (int c = 0; c < 3; ++c) at->r[c] = -q[c];
    publish_direction(lanes, lanes->awake[a], none);
  }
  for (uint32_t a = lanes->part_awake[part]; a < lanes->part_awake[part + 1]; ++a) {
    sonde_slice *at = &lanes->slice[lanes->awake[a]];
    divide(at->factor, at->r, at->z);
    rz += widen(dot(at->r, at->z));
    rr += widen(dot(at->r, at->r));
    publish_direction(lanes, lanes->awake[a], at->z);
  }
  sums->product = total(rz);
  sums->left2 = total(rr);
}

// The diagonal blocks' part of A z is r.
static double multiply(sonde_lanes *lanes, uint32_t part, bool first) {
  lane_double sum = {0};
  for (uint32_t a = lanes->part_awake[part]; a < lanes->part_awake[part + 1]; ++a) {
    uint32_t s = lanes->awake[a];
    sonde_slice *at = &lanes->slice[s];
    sonde_lane q[3] = {at->r[0], at->r[1], at->r[2]}, *out = first ? at->q : at->w;
    couple(lanes, s, q);
    for (int c = 0; c < 3; ++c) out[c] = q[c];
    sum += widen(dot(at->z, q));
  }
  return total(sum);
}

INLINE void advance_slice(sonde_slice *at, bool first, float alpha, float beta) {
  for (int c = 0; c < 3; ++c) {
    sonde_lane p = first ? at->z[c] : at->z[c] + beta * at->p[c];
    sonde_lane q = first ? at->q[c] : at->w[c] + beta * at->q[c];
    at->x[c] += alpha * p;
    at->r[c] -= alpha * q;
    at->p[c] = p;
    if (!first) at->q[c] = q;
  }
}

static void advance(sonde_lanes *lanes, uint32_t part, bool first, float alpha, float beta,
                    sonde_lane_sums *sums) {
  lane_double rz = {0}, rr = {0};
  for (uint32_t a = lanes->part_awake[part]; a < lanes->part_awake[part + 1]; ++a) {
    sonde_slice *at = &lanes->slice[lanes->awake[a]];
    if (first)
      advance_slice(at, true, alpha, beta);
    else
      advance_slice(at, false, alpha, beta);
    sonde_lane r[3] = {at->r[0], at->r[1], at->r[2]}, z[3];
    divide(at->factor, r, z);
    for (int c = 0; c < 3; ++c) at->z[c] = z[c];
    rz += widen(dot(r, z));
    rr += widen(dot(r, r));
    publish_direction(lanes, lanes->awake[a], z);
  }
  sums->product = total(rz);
  sums->left2 = total(rr);
}

// What the linear system does not see of the move d = h x: an edge of length L that is left
// sideways by d pulls by k d^2/2L, and the normal springs' slope changes. As squares of impulses,
// like the residual's.
static double bend(sonde_lanes *lanes, uint32_t part) {
  const sonde_lane_law *law = &lanes->law;
  float h = law->dt;
  lane_double sum = {0};
  for (uint32_t a = lanes->part_awake[part]; a < lanes->part_awake[part + 1]; ++a) {
    const sonde_slice_model *fixed = &lanes->model[lanes->awake[a]];
    const sonde_slice *at = &lanes->slice[lanes->awake[a]];
    sonde_lane way2 = h * h * dot(at->x, at->x);
    sonde_lane gap = 1 + dot(fixed->normal, at->u) / fixed->xm;
    gap = larger(gap, all(0.05f));
    sonde_lane slope = fixed->k0 * fixed->area / (fixed->xm * gap * gap * gap);
    sonde_lane left = h * way2 * (law->edge_stiffness * fixed->bend + slope);
    sum += widen(left * left);
  }
  return total(sum);
}

static void accept(sonde_lanes *lanes, uint32_t part) {
  for (uint32_t a = lanes->part_awake[part]; a < lanes->part_awake[part + 1]; ++a) {
    sonde_slice *at = &lanes->slice[lanes->awake[a]];
    for (int c = 0; c < 3; ++c) at->ve[c] += at->x[c], at->x[c] = (sonde_lane){0};
    publish_record(lanes, lanes->awake[a], at->ve);
  }
}

// Keeps the indentation below x_m: at most 95 % of the remaining gap per step.
INLINE void bound(const sonde_slice_model *fixed, float h, const sonde_slice *at,
                  sonde_lane move[3], sonde_lane v[3]) {
  sonde_lane gap = 0.95f * (fixed->xm + dot(fixed->normal, at->u));
  sonde_lane over = -dot(fixed->normal, move) - larger(gap, all(0));
  over = larger(over, all(0));
  for (int c = 0; c < 3; ++c) {
    move[c] += over * fixed->normal[c];
    v[c] += over * fixed->normal[c] / h;
  }
}

static double update(sonde_lanes *lanes, uint32_t part) {
  float h = lanes->law.dt;
  SONDE_ASSERT(h > 0);
  lane_double sum = {0};
  for (uint32_t a = lanes->part_awake[part]; a < lanes->part_awake[part + 1]; ++a) {
    uint32_t s = lanes->awake[a];
    sonde_slice *at = &lanes->slice[s];
    sonde_lane move[3], v[3];
    for (int c = 0; c < 3; ++c) v[c] = at->ve[c] + at->x[c], move[c] = h * v[c];
    bound(&lanes->model[s], h, at, move, v);
    for (int c = 0; c < 3; ++c) {
      at->u[c] += move[c];
      at->ve[c] = v[c] + (v[c] - at->v[c]);
      at->v[c] = v[c];
    }
    sonde_lane speed2 = dot(at->v, at->v), way2 = dot(at->u, at->u);
    lanes->speed2[s] = most(speed2);
    lanes->way2[s] = most(way2);
    lanes->published[s] = 0;
    publish_record(lanes, s, at->ve);
    sum += widen(speed2 + way2);
  }
  return total(sum);
}

// Whether a node of the slice is inside the box where it is evaluated.
INLINE bool reaches(const sonde_slice_model *fixed, const sonde_slice *at, float h,
                    const float low[3], const float high[3], float margin) {
  sonde_lane_index inside = (sonde_lane_index){0} == (sonde_lane_index){0};
  for (int c = 0; c < 3; ++c) {
    sonde_lane x = fixed->place[c] + (at->u[c] + h * at->ve[c]);
    inside &= (x >= low[c] - margin) & (x <= high[c] + margin);
  }
  return bits(inside) != 0;
}

// Of 16 slices those whose nodes may be inside: bits. A node moves by less than three times its
// way at its speed.
INLINE uint32_t nearby(const sonde_lanes *lanes, uint32_t group, const float low[3],
                       const float high[3], float edges) {
  const sonde_slice_boxes *box = &lanes->box[group];
  const sonde_lane least = all(1e-20f);
  sonde_lane way2 = larger(*(const sonde_lane *)(lanes->way2 + group * SONDE_LANES), least);
  sonde_lane speed2 = larger(*(const sonde_lane *)(lanes->speed2 + group * SONDE_LANES), least);
  sonde_lane way = edges * box->reach + 1e-4f + way2 * inverse_root(way2) +
                   3 * lanes->law.dt * (speed2 * inverse_root(speed2));
  sonde_lane_index apart = {0};
  for (int c = 0; c < 3; ++c)
    apart |= (box->low[c] - way > high[c]) | (box->high[c] + way < low[c]);
  return bits(~apart);
}

static void near(sonde_lanes *lanes, const float low[3], const float high[3], float edges) {
  uint32_t count = 0;
  for (uint32_t group = 0; group * SONDE_LANES < lanes->slice_count; ++group)
    for (uint32_t rest = nearby(lanes, group, low, high, edges); rest; rest &= rest - 1) {
      uint32_t l = (uint32_t)__builtin_ctz(rest), s = group * SONDE_LANES + l;
      float margin = edges * lanes->box[group].reach[l];
      if (reaches(&lanes->model[s], &lanes->slice[s], lanes->law.dt, low, high, margin))
        lanes->near_probe[count++] = s;
    }
  SONDE_ASSERT(count <= lanes->slice_count);
  lanes->near_probe_count = count;
}

const sonde_lane_kernels SONDE_KERNELS = {.name = SONDE_KERNELS_NAME,
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
                                          .hand_on = hand_on,
                                          .press_faces = press_faces,
                                          .press_nodes = press_nodes,
                                          .meet_faces = meet_faces,
                                          .meet_nodes = meet_nodes,
                                          .carry = carry};
