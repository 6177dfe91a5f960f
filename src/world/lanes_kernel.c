// Kernels of the fast engine (docs/world.md); lanes_*_hot.c include this file once per instruction
// set. Every sum has a fixed order: all sets give the same bits.
// evaluate:  where the step evaluates forces, and the records that neighbours read.
// shear:     slopes, forces and couplings of the faces.
// linearise: springs to the neighbours, normal and tangential springs, matrix.
// begin, multiply, advance: parts of the conjugate gradients of Chronopoulos and Gear (1989), which
//            read and write every slice twice in an iteration.
// accept, update: the solution's way into the motion.
// near:      slices in the probe's box.
#include "world/lanes_vector.h"

#include "base/base.h"

static void evaluate(sonde_lanes *lanes) {
  SONDE_ASSERT(lanes->awake_count <= lanes->slice_count);
  float h = lanes->law.dt;
  for (uint32_t a = 0; a < lanes->awake_count; ++a) {
    uint32_t s = lanes->awake[a];
    sonde_slice *at = &lanes->slice[s];
    for (int c = 0; c < 3; ++c) at->ue[c] = at->u[c] + h * at->ve[c];
    sonde_lane indentation = -dot(lanes->model[s].normal, at->ue);
    float *record = lanes->record + (size_t)s * SONDE_LANES * SONDE_RECORD;
    const sonde_lane low[4] = {at->ue[0], at->ue[1], at->ue[2], at->ve[0]};
    const sonde_lane high[4] = {at->ve[1], at->ve[2], indentation, indentation};
    write_records(record, SONDE_RECORD, low);
    write_records(record + 4, SONDE_RECORD, high);
  }
}

// Secant modulus m = q/g of the shear layer and (q' - m)/g^2, without the cancellation of q' - m.
INLINE void shear_law(const sonde_lane_law *law, sonde_lane g, sonde_lane *modulus,
                      sonde_lane *beyond) {
  float limit = 0.95f * law->shear_limit, rate = 1 / law->shear_limit;
  sonde_lane x = smaller(g, all(limit)) * rate;
  sonde_lane inverse = 1 / (1 - x * x), secant = law->shear * inverse;
  sonde_lane curve = 2 * law->shear * rate * rate * inverse * inverse;
  sonde_lane slope = secant + curve * x * x / (rate * rate);
  sonde_lane_index past = g > limit;
  sonde_lane safe = larger(g, all(limit));
  sonde_lane force = secant * limit + slope * (safe - limit);
  *modulus = pick(past, force / safe, secant);
  *beyond = pick(past, (slope - force / safe) / (safe * safe), curve);
}

static void shear(sonde_lanes *lanes) {
  SONDE_ASSERT(lanes->face_list_count <= lanes->face_slice_count);
  float scale = lanes->law.stiffness_scale;
  for (uint32_t a = 0; a < lanes->face_list_count; ++a) {
    const sonde_face_slice *face = &lanes->face[lanes->faces[a]];
    sonde_face_value *value = &lanes->face_value[lanes->faces[a]];
    sonde_lane s[3], across[3], flux[3], sum = {0}, modulus, beyond;
    for (int k = 0; k < 3; ++k) s[k] = gather(lanes->record + 6, face->node[k] * SONDE_RECORD);
    for (int k = 0; k < 3; ++k) {
      sonde_lane d = s[(k + 1) % 3] - s[(k + 2) % 3];
      across[k] = face->half_cotangent[k] * d;
      sum += across[k] * d;
    }
    for (int k = 0; k < 3; ++k) flux[k] = across[(k + 2) % 3] - across[(k + 1) % 3];
    sonde_lane inverse = 1 / face->area;
    shear_law(&lanes->law, root(larger(sum * inverse, all(0))), &modulus, &beyond);
    beyond = beyond * inverse;
    for (int k = 0; k < 3; ++k) {
      int i = (k + 1) % 3, j = (k + 2) % 3;
      value->force[k] = modulus * flux[k];
      value->diagonal[k] = scale * (modulus * (face->half_cotangent[i] + face->half_cotangent[j]) +
                                    beyond * flux[k] * flux[k]);
      value->coupling[k] = scale * (beyond * flux[i] * flux[j] - modulus * face->half_cotangent[k]);
    }
  }
}

typedef struct node_sum {
  sonde_lane force[3], block[6]; // xx xy xz yy yz zz
  sonde_lane shear_force, shear_diagonal;
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

// The spring-damper of an edge, seen from the row; the neighbour finds the opposite, bit for bit.
INLINE void add_spring(const sonde_lane_law *law, const sonde_slot *slot, const float *record,
                       const sonde_slice *at, node_sum *sum, sonde_slot_tangent *tangent) {
  sonde_lane d[3], w[3], n[3], other[6];
  read_records(record, &slot->node, other);
  for (int c = 0; c < 3; ++c) {
    d[c] = slot->rest[c] + (other[c] - at->ue[c]);
    w[c] = other[3 + c] - at->ve[c];
  }
  sonde_lane length = larger(root(dot(d, d)), 0.05f * slot->length), inverse = 1 / length;
  for (int c = 0; c < 3; ++c) n[c] = d[c] * inverse;
  sonde_lane stretch = length - slot->length, share = slot->whole ? all(1) : slot->share;
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

INLINE void add_coupling(const sonde_slot *slot, const float *values, node_sum *sum,
                         sonde_slot_tangent *tangent) {
  sum->shear_force += gather(values, slot->corner);
  sum->shear_diagonal += gather(values + 3 * SONDE_LANES, slot->corner);
  tangent->shear = gather(values + 6 * SONDE_LANES, slot->opposite_a) +
                   gather(values + 6 * SONDE_LANES, slot->opposite_b);
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

INLINE void add_anchor(const sonde_lane_law *law, const sonde_slice_model *fixed,
                       const sonde_slice *at, node_sum *sum) {
  const sonde_lane *n = fixed->normal;
  sonde_lane s = -dot(n, at->ue), rate = dot(n, at->ve), slope;
  sonde_lane pressure = normal_pressure(fixed, law->exponent, s, &slope);
  sonde_lane damper = law->normal_damping_s * fixed->k0 * fixed->area;
  sonde_lane tangent = law->tangential * fixed->area, slow = law->normal_damping_s * tangent;
  sonde_lane push = pressure * fixed->area - damper * rate + sum->shear_force;
  for (int c = 0; c < 3; ++c)
    sum->force[c] +=
        push * n[c] - tangent * (at->ue[c] + s * n[c]) - slow * (at->ve[c] - rate * n[c]);
  sonde_lane flat = law->stiffness_scale * tangent + law->damping_scale * slow;
  sonde_lane steep = law->stiffness_scale * slope * fixed->area + law->damping_scale * damper +
                     sum->shear_diagonal;
  add_rank_one(sum->block, n, steep - flat, flat + fixed->mass);
}

INLINE void linearise_slice(sonde_lanes *lanes, uint32_t s, bool sheared, node_sum *sum) {
  const sonde_slice_model *fixed = &lanes->model[s];
  const sonde_slice *at = &lanes->slice[s];
  const sonde_slot *slot = lanes->slot + fixed->first_slot;
  sonde_slot_tangent *tangent = lanes->tangent + fixed->first_slot;
  for (uint32_t k = 0; k < fixed->slot_count; ++k) {
    add_spring(&lanes->law, &slot[k], lanes->record, at, sum, &tangent[k]);
    if (sheared) add_coupling(&slot[k], (const float *)lanes->face_value, sum, &tangent[k]);
  }
  add_anchor(&lanes->law, fixed, at, sum);
}

static void linearise(sonde_lanes *lanes) {
  bool sheared = lanes->law.shear > 0;
  lane_double reaction[3] = {{0}};
  for (uint32_t a = 0; a < lanes->awake_count; ++a) {
    uint32_t s = lanes->awake[a];
    sonde_slice *at = &lanes->slice[s];
    node_sum sum = {{{0}}, {{0}}, {0}, {0}};
    if (sheared)
      linearise_slice(lanes, s, true, &sum);
    else
      linearise_slice(lanes, s, false, &sum);
    for (int c = 0; c < 3; ++c) {
      at->r[c] = sum.force[c];
      reaction[c] += widen(sum.force[c]);
    }
    for (int c = 0; c < 6; ++c) at->diagonal[c] = sum.block[c];
  }
  lanes->reaction_n = (sonde_vec3){total(reaction[0]), total(reaction[1]), total(reaction[2])};
}

// Adjugate over determinant.
INLINE void invert(const sonde_lane d[6], sonde_lane inverse[6]) {
  sonde_lane xx = d[3] * d[5] - d[4] * d[4], xy = d[2] * d[4] - d[1] * d[5];
  sonde_lane xz = d[1] * d[4] - d[2] * d[3];
  sonde_lane scale = 1 / (d[0] * xx + d[1] * xy + d[2] * xz);
  inverse[0] = xx * scale;
  inverse[1] = xy * scale;
  inverse[2] = xz * scale;
  inverse[3] = (d[0] * d[5] - d[2] * d[2]) * scale;
  inverse[4] = (d[1] * d[2] - d[0] * d[4]) * scale;
  inverse[5] = (d[0] * d[3] - d[1] * d[1]) * scale;
}

INLINE void symmetric(const sonde_lane m[6], const sonde_lane a[3], sonde_lane out[3]) {
  out[0] = m[0] * a[0] + m[1] * a[1] + m[2] * a[2];
  out[1] = m[1] * a[0] + m[3] * a[1] + m[4] * a[2];
  out[2] = m[2] * a[0] + m[4] * a[1] + m[5] * a[2];
}

INLINE void multiply_slice(sonde_lanes *lanes, uint32_t s, bool sheared, sonde_lane q[3]) {
  const sonde_slice_model *fixed = &lanes->model[s];
  const sonde_slot *slot = lanes->slot + fixed->first_slot;
  const sonde_slot_tangent *tangent = lanes->tangent + fixed->first_slot;
  sonde_lane along_normal = {0};
  for (uint32_t k = 0; k < fixed->slot_count; ++k) {
    sonde_lane p[4];
    read_directions(lanes->direction, &slot[k].node, p);
    sonde_lane pull = tangent[k].along * dot(tangent[k].n, p);
    for (int c = 0; c < 3; ++c) q[c] -= pull * tangent[k].n[c] + tangent[k].lateral * p[c];
    if (sheared) along_normal += tangent[k].shear * p[3];
  }
  for (int c = 0; sheared && c < 3; ++c) q[c] += along_normal * fixed->normal[c];
}

static double multiply(sonde_lanes *lanes) {
  bool sheared = lanes->law.shear > 0;
  lane_double sum = {0};
  for (uint32_t a = 0; a < lanes->awake_count; ++a) {
    uint32_t s = lanes->awake[a];
    sonde_slice *at = &lanes->slice[s];
    sonde_lane q[3];
    symmetric(at->diagonal, at->z, q);
    if (sheared)
      multiply_slice(lanes, s, true, q);
    else
      multiply_slice(lanes, s, false, q);
    for (int c = 0; c < 3; ++c) at->w[c] = q[c];
    sum += widen(dot(at->z, q));
  }
  return total(sum);
}

INLINE void publish_direction(sonde_lanes *lanes, uint32_t s) {
  const sonde_slice *at = &lanes->slice[s];
  const sonde_lane out[4] = {at->z[0], at->z[1], at->z[2], dot(lanes->model[s].normal, at->z)};
  write_records(lanes->direction + (size_t)s * SONDE_LANES * SONDE_DIRECTION, SONDE_DIRECTION, out);
}

INLINE float most(sonde_lane a) {
  float value = 0;
  for (int l = 0; l < SONDE_LANES; ++l) value = a[l] > value ? a[l] : value;
  return value;
}

static void begin(sonde_lanes *lanes, double sums[3]) {
  float h = lanes->law.dt;
  lane_double rz = {0}, rr = {0}, ff = {0};
  for (uint32_t a = 0; a < lanes->awake_count; ++a) {
    sonde_slice *at = &lanes->slice[lanes->awake[a]];
    sonde_lane mass = lanes->model[lanes->awake[a]].mass, force[3];
    for (int c = 0; c < 3; ++c) {
      force[c] = h * at->r[c];
      at->r[c] = force[c] - mass * (at->ve[c] - at->v[c]);
    }
    sonde_lane yield = lanes->model[lanes->awake[a]].yield / h;
    lanes->unrest2[lanes->awake[a]] = most(dot(force, force) * (yield * yield));
    invert(at->diagonal, at->inverse);
    symmetric(at->inverse, at->r, at->z);
    rz += widen(dot(at->r, at->z));
    rr += widen(dot(at->r, at->r));
    ff += widen(dot(force, force));
    publish_direction(lanes, lanes->awake[a]);
  }
  sums[0] = total(rz);
  sums[1] = total(rr);
  sums[2] = total(ff);
}

static void advance(sonde_lanes *lanes, float alpha, float beta, double sums[2]) {
  lane_double rz = {0}, rr = {0};
  for (uint32_t a = 0; a < lanes->awake_count; ++a) {
    sonde_slice *at = &lanes->slice[lanes->awake[a]];
    for (int c = 0; c < 3; ++c) {
      at->p[c] = beta == 0 ? at->z[c] : at->z[c] + beta * at->p[c];
      at->q[c] = beta == 0 ? at->w[c] : at->w[c] + beta * at->q[c];
      at->x[c] = beta == 0 ? alpha * at->p[c] : at->x[c] + alpha * at->p[c];
      at->r[c] -= alpha * at->q[c];
    }
    symmetric(at->inverse, at->r, at->z);
    rz += widen(dot(at->r, at->z));
    rr += widen(dot(at->r, at->r));
    publish_direction(lanes, lanes->awake[a]);
  }
  sums[0] = total(rz);
  sums[1] = total(rr);
}

static void accept(sonde_lanes *lanes) {
  for (uint32_t a = 0; a < lanes->awake_count; ++a) {
    sonde_slice *at = &lanes->slice[lanes->awake[a]];
    for (int c = 0; c < 3; ++c) at->ve[c] += at->x[c];
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

static double update(sonde_lanes *lanes) {
  float h = lanes->law.dt;
  SONDE_ASSERT(h > 0);
  lane_double sum = {0};
  for (uint32_t a = 0; a < lanes->awake_count; ++a) {
    uint32_t s = lanes->awake[a];
    sonde_slice *at = &lanes->slice[s];
    sonde_lane move[3], v[3];
    for (int c = 0; c < 3; ++c) v[c] = at->ve[c], move[c] = h * v[c];
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
  int any = 0;
  for (int l = 0; l < SONDE_LANES; ++l) any |= inside[l];
  return any != 0;
}

static void near(sonde_lanes *lanes, const float low[3], const float high[3], float edges) {
  float h = lanes->law.dt;
  uint32_t count = 0;
  for (uint32_t s = 0; s < lanes->slice_count; ++s) {
    const sonde_slice_model *fixed = &lanes->model[s];
    float margin = edges * fixed->reach, way = margin + 1e-4f;
    way += __builtin_sqrtf(lanes->way2[s]) + 3 * h * __builtin_sqrtf(lanes->speed2[s]);
    bool apart = false;
    for (int c = 0; c < 3; ++c)
      apart |= fixed->low[c] - way > high[c] || fixed->high[c] + way < low[c];
    if (apart || !reaches(fixed, &lanes->slice[s], h, low, high, margin)) continue;
    lanes->near_probe[count++] = s;
  }
  SONDE_ASSERT(count <= lanes->slice_count);
  lanes->near_probe_count = count;
}

const sonde_lane_kernels SONDE_KERNELS = {.name = SONDE_KERNELS_NAME,
                                          .evaluate = evaluate,
                                          .shear = shear,
                                          .linearise = linearise,
                                          .begin = begin,
                                          .multiply = multiply,
                                          .advance = advance,
                                          .accept = accept,
                                          .update = update,
                                          .near = near};
