// Random poking (poke.h).
// poke_uniform:   numbers that repeat.
// turn, aim:  rotations as quaternions; z of the probe looks into the skin.
// choose:     the next move: press, slide, tilt, lift, hold, tremble or jump.
// forward:    the law of the push.
#include "poke.h"

#include <math.h>

poke_def poke_def_default(void) { return (poke_def){1e-3, 1, 0.05, 100}; }

double poke_uniform(poke *p, double low, double high) {
  p->random = p->random * 6364136223846793005u + 1442695040888963407u;
  return low + (high - low) * (double)(p->random >> 11) / 9007199254740992.0;
}

static double dot(sonde_vec3 a, sonde_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static sonde_vec3 along(sonde_vec3 a, double s, sonde_vec3 b) {
  return (sonde_vec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}
static double norm(sonde_vec3 a) { return sqrt(dot(a, a)); }

static sonde_quat times(sonde_quat a, sonde_quat b) {
  return (sonde_quat){
      a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
      a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}

static sonde_quat turn(sonde_vec3 axis, double angle) {
  double s = sin(angle / 2);
  return (sonde_quat){cos(angle / 2), s * axis.x, s * axis.y, s * axis.z};
}

// The shortest turn of z onto the inward normal.
static sonde_quat aim(sonde_vec3 outward) {
  sonde_quat q = {1 - outward.z, outward.y, -outward.x, 0};
  double size = sqrt(q.w * q.w + q.x * q.x + q.y * q.y);
  if (size < 1e-6) return (sonde_quat){0, 1, 0, 0};
  return (sonde_quat){q.w / size, q.x / size, q.y / size, 0};
}

static sonde_vec3 axis_of(sonde_quat q) {
  return (sonde_vec3){2 * (q.x * q.z + q.w * q.y), 2 * (q.y * q.z - q.w * q.x),
                      1 - 2 * (q.x * q.x + q.y * q.y)};
}

static sonde_pose pose_of(const poke *p) {
  const sonde_site *s = p->site;
  sonde_pose pose = {.position = along(s->position_m, -p->at[0], s->normal)};
  pose.position = along(along(pose.position, p->at[1], s->u), p->at[2], s->v);
  sonde_quat q = times(aim(s->normal), turn((sonde_vec3){0, 0, 1}, p->at[5]));
  pose.rotation = times(turn(s->u, p->at[3]), times(turn(s->v, p->at[4]), q));
  return pose;
}

// Above another place, or already in it.
static void jump(poke *p, double depth_m) {
  p->site = &p->model->sites[(uint32_t)poke_uniform(p, 0, p->model->site_count)];
  p->at[0] = p->goal[0] = depth_m;
  for (int k = 1; k < 6; ++k)
    p->at[k] = p->goal[k] = k < 3 ? poke_uniform(p, -0.02, 0.02) : poke_uniform(p, -0.5, 0.5);
}

// The ticks that the way takes at a speed; turns count 5 cm per radian.
static void start_move(poke *p, double speed_m_s) {
  double way = 0;
  for (int k = 0; k < 6; ++k) way += fabs(p->goal[k] - p->at[k]) * (k < 3 ? 1 : 0.05);
  p->left = (uint32_t)ceil(way / (speed_m_s * p->def.dt_s));
}

static void choose(poke *p) {
  double fastest = p->def.fastest_m_s, speed = fastest * pow(0.01, poke_uniform(p, 0, 1));
  double deepest = p->def.deepest_m;
  int kind = (int)poke_uniform(p, 0, 12);
  if (kind < 4) {
    p->goal[0] = poke_uniform(p, -0.005, deepest);
  } else if (kind < 6) {
    for (int k = 1; k < 3; ++k) p->goal[k] = poke_uniform(p, -0.04, 0.04);
  } else if (kind < 8) {
    for (int k = 3; k < 6; ++k) p->goal[k] = poke_uniform(p, -0.7, 0.7);
  } else if (kind == 8) {
    p->goal[0] = -0.01, speed = fastest;
  } else if (kind == 9) {
    p->left = (uint32_t)poke_uniform(p, 1, 200);
    return;
  } else if (kind == 10) {
    for (int k = 0; k < 3; ++k) p->goal[k] = p->at[k] + poke_uniform(p, -0.001, 0.001);
    speed = fastest;
  } else {
    jump(p, poke_uniform(p, -0.005, 0.3 * deepest));
    p->left = (uint32_t)poke_uniform(p, 1, 50);
    return;
  }
  start_move(p, speed);
}

poke poke_begin(const sonde_model *model, const poke_def *def, uint64_t seed) {
  poke p = {.model = model, .def = *def, .random = seed * 0x9e3779b97f4a7c15u + 1};
  for (int k = 0; k < 8; ++k) poke_uniform(&p, 0, 1);
  jump(&p, -0.005);
  return p;
}

sonde_pose poke_next(poke *p, double felt_n) {
  if (felt_n > p->def.most_force_n && p->goal[0] > -0.01) {
    p->goal[0] = -0.01;
    start_move(p, p->def.fastest_m_s);
  }
  if (p->left == 0) choose(p);
  for (int k = 0; k < 6 && p->left > 0; ++k) p->at[k] += (p->goal[k] - p->at[k]) / p->left;
  if (p->left > 0) p->left--;
  return pose_of(p);
}

static bool finite3(sonde_vec3 a) { return isfinite(a.x + a.y + a.z); }

static const char *look_at_nodes(poke_watch *watch, sonde_state *state) {
  const sonde_model *model = sonde_state_model(state);
  const sonde_vec3 *x = sonde_state_positions(state), *v = sonde_state_velocities(state);
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    if (!finite3(x[i]) || !finite3(v[i])) return "a position or velocity is not finite";
    sonde_vec3 move = along(x[i], -1, model->surface.vertices[i]);
    double share = -dot(model->normal[i], move) / model->xm_m[i];
    watch->most_share = fmax(watch->most_share, share);
    watch->most_move_m = fmax(watch->most_move_m, norm(move));
  }
  if (watch->most_share >= 1) return "a node reached its asymptote x_m";
  if (watch->most_move_m > 0.2) return "a node has left the scene";
  return NULL;
}

// A push straight to the side points ahead by this share where it is rounded, and by more of what
// is left where pushes to both sides cancel.
static double rounded(const sonde_state *state) {
  return sonde_state_def(state)->engine == SONDE_ENGINE_FAST ? 1e-5 : 1e-7;
}

// The probe pushes forwards at every node; with friction the sum may be drawn in by mu_static
// times the normal push.
static const char *forward(poke_watch *watch, const sonde_state *state, sonde_vec3 inward) {
  uint32_t nodes = sonde_state_model(state)->surface.vertex_count;
  const sonde_vec3 *f = sonde_state_contact_forces(state);
  double mu = sonde_state_def(state)->friction.mu_static, push = 0, sum = 0;
  double share = rounded(state);
  bool drawn = false;
  for (uint32_t i = 0; i < nodes; ++i) {
    double size = norm(f[i]), ahead = dot(f[i], inward);
    push += size;
    sum += ahead;
    drawn |= !(mu > 0) && ahead < -share * size;
  }
  double most = fmax(push, watch->push_n);
  watch->push_n = push;
  if (push > 1e-3) watch->least_forward = fmin(watch->least_forward, sum / most);
  if (drawn) return "a node is pulled out of the skin";
  if (sum < -(mu + share) * most) return "the probe is drawn into the skin";
  return NULL;
}

const char *poke_check(poke_watch *watch, sonde_state *state, sonde_pose pose) {
  const sonde_contact *contact = sonde_state_contact(state);
  double force = norm(contact->force_n);
  uint32_t flags = sonde_state_flags(state);
  watch->ticks++;
  watch->touching += contact->region_count > 0;
  watch->pressed += force > 50;
  watch->not_converged += (flags & SONDE_FLAG_NOT_CONVERGED) != 0;
  watch->full += (flags & SONDE_FLAG_CONTACT_FULL) != 0;
  watch->most_force_n = fmax(watch->most_force_n, force);
  if (flags & SONDE_FLAG_NON_FINITE) return "the flag NON_FINITE is set";
  if (!isfinite(force) || !finite3(contact->torque_n_m)) return "the wrench is not finite";
  for (uint32_t r = 0; r < contact->region_count; ++r)
    if (!(contact->region[r].force_n >= 0) || !isfinite(contact->region[r].volume_m3))
      return "a region pulls, or its volume is not finite";
  const char *broken = look_at_nodes(watch, state);
  return broken ? broken : forward(watch, state, axis_of(pose.rotation));
}
