// A leg under a probe: its ticks.
#include "leg_place.h"

#include "base/base.h"
#include "haptics/motion.h"

#include <string.h>

enum { WALKS_MOST = 4 };
static const double near_m = 2.5e-3;   // of the probe, where a place is handed over
static const double again_m = 3e-3;    // away from where there was no place
static const double drift_ticks = 100; // in which the drift follows the probe
static const double ahead_s = 0.2;     // in which a place is made
static const double walk_s = 0.08;     // in which it is walked to the probe
static const double farthest_m = 8e-3; // ahead of the probe
static const double still_m_s = 4e-3;
static const double passing_m_s = 80e-3; // a probe that is faster aside in the air passes by

static void want(sonde_solid_leg *leg, sonde_leg_step step, sonde_pose pose, uint32_t probe) {
  leg->step = step, leg->wanted_pose = pose, leg->wanted_probe = probe;
  atomic_fetch_add_explicit(&leg->wanted, 1, memory_order_release);
}

// Takes over what the builder has done.
static void take_step(sonde_solid_leg *leg, sonde_pose pose) {
  sonde_leg_moment *now = &leg->now;
  sonde_leg_place *place = leg->coming;
  if (place == NULL) {
    now->is_refused = true, now->refused = leg->wanted_pose, now->refused_probe = leg->wanted_probe;
    leg->step = SONDE_LEG_IDLE;
    ++leg->counts.refused;
    return;
  }
  const bool far =
      leg->step == SONDE_LEG_MAKE || sonde_equilibrium_way(place->live->e->pose, pose) > near_m;
  if (far && leg->walks < WALKS_MOST) {
    const double speed = fmax(v_norm(now->drift_m_s), 1e-3);
    ++leg->walks;
    sonde_pose to = pose;
    to.position = v_madd(pose.position, fmin(walk_s, near_m / speed), now->drift_m_s);
    want(leg, SONDE_LEG_WALK, to, place->probe);
    return;
  }
  // The hand goes on from what it felt.
  sonde_leg_place *before = atomic_load_explicit(&leg->current, memory_order_relaxed);
  sonde_solid_live *live = place->live;
  live->felt_n = before ? before->live->felt_n : vec3(0, 0, 0);
  live->felt_nm = before ? before->live->felt_nm : vec3(0, 0, 0);
  live->felt_pose = before ? before->live->felt_pose : pose;
  live->adopts = true;
  leg->given_back = before, leg->coming = NULL, leg->step = SONDE_LEG_IDLE;
  now->placed = true, now->place = place->asked, now->probe = place->probe;
  ++leg->counts.places;
  atomic_store(&leg->current, place);
}

// Whether the probe has left the place that serves, or is about to; `at` is where it will be when
// the next one is made.
static bool strays(const sonde_solid_leg *leg, const sonde_leg_place *place, uint32_t probe,
                   sonde_pose pose, sonde_pose *at) {
  const sonde_leg_moment *now = &leg->now;
  const double speed = v_norm(now->drift_m_s), ahead = fmin(ahead_s * speed, farthest_m);
  *at = pose;
  if (speed > 0) at->position = v_madd(pose.position, ahead / speed, now->drift_m_s);
  const sonde_vec3 axis = q_rotate(pose.rotation, vec3(0, 0, 1));
  const double aside = v_norm(v_cross(axis, now->drift_m_s));
  if (!(place != NULL && place->live->touches) && aside > passing_m_s) return false;
  if (now->is_refused && now->refused_probe == probe &&
      sonde_equilibrium_way(now->refused, pose) < again_m)
    return false;
  if (place != NULL && place->probe == probe) {
    const sonde_vec3 from = pose_apply_inverse(place->start, at->position);
    const double most_m = speed < still_m_s ? leg->def.still_m : leg->def.stray_m;
    if (fabs(from.x) < most_m && fabs(from.y) < most_m &&
        sonde_quat_angle(place->start.rotation, pose.rotation) < leg->def.stray_rad)
      return false;
  }
  return true;
}

uint32_t sonde_solid_leg_tick(sonde_solid_leg *leg, uint32_t probe, sonde_pose pose, uint32_t told,
                              sonde_solid_contact *contact) {
  SONDE_ASSERT(leg != NULL && probe < leg->def.probe_count && contact != NULL);
  sonde_leg_moment *now = &leg->now;
  const double dt_s = 1e-3;
  const sonde_vec3 way = now->moved ? v_sub(pose.position, now->last.position) : vec3(0, 0, 0);
  const sonde_vec3 speed = v_scale(way, 1 / dt_s);
  now->drift_m_s = v_madd(now->drift_m_s, 1 / drift_ticks, v_sub(speed, now->drift_m_s));
  now->last = pose, now->moved = true;
  ++leg->counts.ticks;
  uint32_t did = 0;
  const bool due = now->ticks++ % leg->def.live.pass_ticks == 0;
  sonde_leg_place *place = atomic_load_explicit(&leg->current, memory_order_relaxed);
  const sonde_vec3 felt_n = place ? place->live->felt_n : vec3(0, 0, 0);
  if (due) {
    const bool built =
        leg->step != SONDE_LEG_IDLE && atomic_load_explicit(&leg->built, memory_order_acquire) ==
                                           atomic_load_explicit(&leg->wanted, memory_order_relaxed);
    if (built && told & (SONDE_LEG_PLACE | SONDE_LEG_AS_DONE)) {
      take_step(leg, pose);
      did |= SONDE_LEG_PLACE;
    }
    place = atomic_load_explicit(&leg->current, memory_order_relaxed);
    sonde_pose at;
    if (leg->step == SONDE_LEG_IDLE && strays(leg, place, probe, pose, &at)) {
      leg->walks = 0, now->is_refused = false;
      want(leg, SONDE_LEG_MAKE, at, probe);
    }
  }
  *contact = (sonde_solid_contact){0};
  // Skin that may touch surrounds the footprint by so much: beyond it the face is not borne.
  const sonde_vec3 from =
      place ? pose_apply_inverse(place->start, pose.position) : vec3(INFINITY, 0, 0);
  const double zone_m = leg->def.live.solid.zone_m;
  const bool borne =
      place && place->probe == probe && fabs(from.x) < zone_m && fabs(from.y) < zone_m;
  leg->counts.without_place += !borne && sonde_surface_inside(leg->def.skin, pose.position);
  if (place == NULL) return did;
  const bool done = sonde_live_is_done(place->live);
  if (due && done && told & (SONDE_LEG_PASS | SONDE_LEG_AS_DONE)) did |= SONDE_LEG_PASS;
  leg->counts.late += due && !(did & SONDE_LEG_PASS);
  const bool handed_over = place->live->adopts;
  sonde_live_step(place->live, pose, did & SONDE_LEG_PASS, contact);
  if (handed_over)
    leg->counts.handed_over_n =
        fmax(leg->counts.handed_over_n, v_distance(contact->force_n, felt_n));
  return did;
}

bool sonde_solid_leg_remember(const sonde_solid_leg *leg, sonde_leg_moment *moment) {
  const sonde_leg_place *place = atomic_load_explicit(&leg->current, memory_order_relaxed);
  if (leg->step != SONDE_LEG_IDLE || (place && !sonde_live_is_at_rest(place->live))) return false;
  *moment = leg->now;
  if (place == NULL) return true;
  moment->asked[0] = place->live->asked_before, moment->asked[1] = place->live->asked_pose;
  return true;
}

sonde_leg_place *sonde_solid_leg_offer(sonde_solid_leg *leg, sonde_vec3 *moved) {
  sonde_leg_place *place = atomic_load_explicit(&leg->current, memory_order_relaxed);
  if (place == NULL) return NULL;
  SONDE_ASSERT(place->mesh.node_count <= SONDE_LEG_NODES_MOST);
  atomic_fetch_add(&place->readers, 1);
  memcpy(moved, place->live->shown[place->live->serving].moved,
         place->mesh.node_count * sizeof *moved);
  return place;
}
