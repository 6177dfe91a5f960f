// A tick: unilateral contact of the skin's quadrature points on the tangent that a pass has shown,
// by projected Gauss-Seidel. docs/solid_theory.md.
#include "live.h"

#include "base/base.h"
#include "base/vector.h"

#include <string.h>

enum { SWEEPS_MOST = 60 };
static const double margin_m = 1e-3; // points this far from the probe may come to bear
static const float relax = 1.3F, fine = 1e-3F;
static const double easing_s = 0.15; // in which what is eased out falls to 1/e, at the latest
static const float least_n = 1e-6F;  // change of all loads that does not count

// Points that lie in the probe or near it, with the depth that they would have without any force.
static uint32_t find_candidates(sonde_solid_live *l, sonde_pose pose) {
  const sonde_vec3 *free_m = l->shown[l->serving].free_m;
  const sonde_mat3 turn = q_matrix(pose.rotation), back = m_transpose(turn);
  uint32_t count = 0;
  bool touches = false;
  for (uint32_t n = 0; n < l->point_count; ++n) {
    sonde_live_point *p = &l->point[n];
    sonde_vec3 now = vec3(0, 0, 0), free = now, out;
    sonde_mat3 bend;
    double depth;
    for (int c = 0; c < 4; ++c) {
      now = v_madd(now, p->share[c], l->skin[p->node[c]]);
      free = v_madd(free, p->share[c], free_m[p->node[c]]);
    }
    const sonde_vec3 arm = v_sub(now, pose.position), there = v_sub(free, pose.position);
    touches =
        touches || sonde_touch_depth(&l->e->shape, m_mul_v(back, there), 0, &depth, &out, &bend);
    if (!sonde_touch_depth(&l->e->shape, m_mul_v(back, arm), margin_m, &depth, &out, &bend)) {
      p->load_n = 0;
      continue;
    }
    sonde_live_candidate *k = &l->candidate[count];
    *k = (sonde_live_candidate){.point = p, .out = m_mul_v(turn, out), .arm = arm};
    k->depth_m = (float)(depth + v_dot(k->out, v_sub(now, free)));
    for (int c = 0; c < 4; ++c) {
      k->part[3 * c] = (float)(p->share[c] * k->out.x);
      k->part[3 * c + 1] = (float)(p->share[c] * k->out.y);
      k->part[3 * c + 2] = (float)(p->share[c] * k->out.z);
    }
    k->row = l->rows + (size_t)count++ * l->width;
  }
  // Where the skin without forces stays clear of the probe, it costs no energy to be there.
  for (uint32_t n = 0; n < l->point_count && !touches; ++n) l->point[n].load_n = 0;
  return touches ? count : 0;
}

static inline float way_out(const sonde_live_candidate *k, const float *moved) {
  float sum = 0;
  for (int c = 0; c < 4; ++c) {
    const float *x = moved + 3 * (size_t)k->point->node[c];
    sum += k->part[3 * c] * x[0] + k->part[3 * c + 1] * x[1] + k->part[3 * c + 2] * x[2];
  }
  return sum;
}

// moved += more row, rows of the tangent or sums of them.
static inline void add_row(const sonde_solid_live *l, float *moved, float more, const float *row) {
  for (uint32_t j = 0; j < l->width; j += 4)
    *(float_x4_near *)(moved + j) += more * *(const float_x4_near *)(row + j);
}

// Displacements of the zone for a force on the point.
static void make_row(const sonde_solid_live *l, sonde_live_candidate *k) {
  memset(k->row, 0, l->width * sizeof *k->row);
  for (uint32_t i = 0; i < 12; ++i)
    add_row(l, k->row, k->part[i],
            l->shown[l->serving].give_m_n + (3 * (size_t)k->point->node[i / 3] + i % 3) * l->width);
  k->give_m_n = way_out(k, k->row) + (float)k->point->soft_m_n;
}

// Loads >= 0 with load times softness = depth where there is load: over-relaxed sweeps.
static uint32_t solve(sonde_solid_live *l, uint32_t count) {
  uint32_t sweeps = 0;
  memset(l->moved, 0, l->width * sizeof *l->moved);
  for (uint32_t n = 0; n < count; ++n) {
    sonde_live_candidate *k = &l->candidate[n];
    if (k->point->load_n <= 0) continue;
    make_row(l, k);
    add_row(l, l->moved, k->point->load_n, k->row);
  }
  for (float change = 1, sum = 0; sweeps < SWEEPS_MOST && change > fine * sum + least_n; ++sweeps) {
    change = sum = 0;
    for (uint32_t n = 0; n < count; ++n) {
      sonde_live_candidate *k = &l->candidate[n];
      const float before = k->point->load_n;
      const float lack = k->depth_m - way_out(k, l->moved) - (float)k->point->soft_m_n * before;
      if (before <= 0 && lack <= 0) continue;
      if (k->give_m_n <= 0) make_row(l, k);
      float after = before + relax * lack / k->give_m_n;
      if (after < 0) after = 0;
      add_row(l, l->moved, after - before, k->row);
      k->point->load_n = after;
      sum += after, change += after > before ? after - before : before - after;
    }
  }
  return sweeps;
}

// The contact at a pose on the tangent that serves; the skin's places go with it.
// @return whether any skin may bear a force
static bool touch(sonde_solid_live *l, sonde_pose pose, sonde_solid_contact *contact) {
  *contact = (sonde_solid_contact){0};
  const uint32_t count = find_candidates(l, pose);
  contact->sweeps = solve(l, count);
  for (uint32_t n = 0; n < count; ++n) {
    const sonde_live_candidate *k = &l->candidate[n];
    if (k->point->load_n <= 0) continue;
    const sonde_vec3 push = v_scale(k->out, -(double)k->point->load_n);
    contact->force_n = v_add(contact->force_n, push);
    contact->torque_nm = v_add(contact->torque_nm, v_cross(k->arm, push));
    contact->area_m2 += 1 / (k->point->soft_m_n * l->e->def.contact_n_m3);
    ++contact->points;
  }
  const sonde_vec3 *free_m = l->shown[l->serving].free_m;
  for (uint32_t k = 0; k < l->e->zone_count; ++k) {
    const float *x = l->moved + 3 * (size_t)k;
    l->skin[k] = v_add(free_m[k], vec3((double)x[0], (double)x[1], (double)x[2]));
  }
  return count > 0;
}

// What the hand feels: the contact and what is still to be eased out. The force changes no faster
// than the whole skin held to the probe would make it, and the easing.
static void ease(sonde_solid_live *l, sonde_pose pose, bool touches, sonde_solid_contact *contact) {
  const double size = v_norm(l->easing_n), most = 1e-3 * l->def.ease_n_s;
  const double left = fmin(size - most - 1e-3 * size / easing_s, v_norm(contact->force_n));
  const double share = left > 0 ? left / size : 0;
  // A probe that touches nothing has nothing left to ease.
  sonde_vec3 force = v_madd(contact->force_n, touches ? share : 0, l->easing_n);
  sonde_vec3 torque = v_madd(contact->torque_nm, touches ? share : 0, l->easing_nm);
  const double way = sonde_equilibrium_way(l->felt_pose, pose);
  const double change = v_distance(force, l->felt_n);
  const double limit = most + l->shown[l->serving].stiffness_n_m * way;
  if (change > limit) {
    force = v_madd(l->felt_n, limit / change, v_sub(force, l->felt_n));
    torque = v_madd(l->felt_nm, limit / change, v_sub(torque, l->felt_nm));
  }
  l->easing_n = v_sub(force, contact->force_n), l->easing_nm = v_sub(torque, contact->torque_nm);
  contact->force_n = l->felt_n = force, contact->torque_nm = l->felt_nm = torque;
  l->felt_pose = pose;
}

void sonde_live_step(sonde_solid_live *l, sonde_pose pose, bool take,
                     sonde_solid_contact *contact) {
  SONDE_ASSERT(l != NULL && contact != NULL);
  sonde_solid_contact last;
  ++l->ticks;
  if (take) {
    const uint32_t asked = atomic_load_explicit(&l->asked, memory_order_relaxed);
    SONDE_ASSERT(sonde_live_is_done(l));
    (void)touch(l, pose, &last);
    l->serving = asked & 1, l->asked_before = l->asked_pose, l->asked_pose = pose;
    atomic_store_explicit(&l->asked, asked + 1, memory_order_release);
  }
  l->touches = touch(l, pose, contact);
  // The hand goes on from what it would have felt on the last tangent, or felt on another solid.
  if (take) {
    l->easing_n = v_add(l->easing_n, v_sub(last.force_n, contact->force_n));
    l->easing_nm = v_add(l->easing_nm, v_sub(last.torque_nm, contact->torque_nm));
  }
  if (l->adopts) {
    l->easing_n = v_sub(l->felt_n, contact->force_n);
    l->easing_nm = v_sub(l->felt_nm, contact->torque_nm);
    l->adopts = false;
  }
  ease(l, pose, l->touches, contact);
}

void sonde_solid_live_tick(sonde_solid_live *l, sonde_pose pose, sonde_solid_contact *contact) {
  SONDE_ASSERT(l != NULL && contact != NULL);
  const bool due = l->ticks % l->def.pass_ticks == 0, take = due && sonde_live_is_done(l);
  l->late += due && !take;
  sonde_live_step(l, pose, take, contact);
}
