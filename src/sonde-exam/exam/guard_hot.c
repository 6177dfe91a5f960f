// What keeps the skin from being turned inside out: a probe that is led where no press leads is
// taken off, the skin goes back to rest, and the probe acts again when it has left the body.
#include "exam/subject.h"

#include "base/base.h"
#include "base/maths.h"
#include "world/state.h"

static const double spare_m = 5e-3; // of the contact and of the mesh, beyond the asymptote
static const double jump_m = 5e-3;  // in one tick: what lay between is unknown
static const double clear_m = 5e-3; // of the resting skin
static const double shown_s = 0.5;  // how long viewers are told afterwards

// Asymptote xm of the anchors at the nearest skin, by which nothing gives way further.
static double depth_beyond(const sonde_subject *subject, sonde_vec3 point_m) {
  sonde_surface_point at = sonde_surface_closest(subject->rest_skin, point_m);
  const uint32_t *node = subject->model->surface.faces[at.face];
  double limit_m = spare_m;
  for (int k = 0; k < 3; ++k) limit_m += at.weight[k] * subject->model->xm_m[node[k]];
  SONDE_ASSERT(limit_m >= 0);
  if (at.distance_m <= limit_m) return at.distance_m - limit_m;
  bool inside = sonde_surface_inside(subject->rest_skin, point_m);
  return inside ? at.distance_m - limit_m : -INFINITY;
}

static double length_of(const sonde_probe *probe) {
  double least = 0;
  for (uint32_t k = 0; k < probe->body.hull.vertex_count; ++k)
    least = fmin(least, probe->body.hull.vertices[k].z);
  return -least;
}

bool sonde_subject_guard(sonde_subject *subject, const sonde_probe *probe, sonde_pose pose) {
  sonde_subject_moment *now = &subject->now;
  SONDE_ASSERT(probe != NULL && v_finite(pose.position));
  if (now->off) {
    // The probe acts again when the ends, corners and middle of its box are clear of the body. What
    // lies between them may reach into the skin a little: the skin is at rest then and gives way as
    // to any probe that is put on it.
    double length_m = length_of(probe), x = probe->half_x_m, y = probe->half_y_m;
    now->off = false;
    for (int k = 0; k < 11 && !now->off; ++k) {
      sonde_vec3 corner = vec3(k & 1 ? x : -x, k & 2 ? y : -y, k & 4 ? 0 : -length_m);
      sonde_vec3 at = pose_apply(pose, k < 8 ? corner : vec3(0, 0, -0.5 * (k - 8) * length_m));
      now->off = sonde_surface_closest(subject->rest_skin, at).distance_m < clear_m ||
                 sonde_surface_inside(subject->rest_skin, at);
    }
  } else {
    // Where the way to the pose is unknown, the probe's face may have come out at the other side of
    // the body: then its handle's end tells.
    const bool jumped = !now->placed || v_distance(pose.position, now->pose.position) > jump_m;
    const sonde_vec3 handle = pose_apply(pose, vec3(0, 0, -length_of(probe)));
    now->off = now->carried || depth_beyond(subject, pose.position) > 0 ||
               (jumped && depth_beyond(subject, handle) > 0);
    if (now->off) {
      now->restores++;
      sonde_state_relax(subject->state);
    }
  }
  if (now->off) now->off_tick = sonde_state_tick(subject->state);
  return now->off;
}

uint32_t sonde_subject_flags(const sonde_subject *subject) {
  uint32_t flags = sonde_state_flags(subject->state);
  if (subject->now.broken) flags |= SONDE_FLAG_NON_FINITE;
  const sonde_subject_moment *now = &subject->now;
  double since_s = (double)(sonde_state_tick(subject->state) - now->off_tick) * subject->dt_s;
  return now->restores > 0 && since_s < shown_s ? flags | SONDE_FLAG_INSIDE_OUT : flags;
}
