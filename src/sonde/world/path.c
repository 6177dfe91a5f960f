// The static equilibrium that a slow press ends in: the probe follows a straight way in steps.
#include "base/base.h"
#include "base/maths.h"
#include "world/state.h"

#include "sonde/world_path.h"

#include <string.h>

static const double forgiven_n = 2e-3; // two forces that differ by less agree
static const double quick = 1e-3;      // relative residual of an equilibrium on the way
static const double closely = 1e-4;    // of one whose force has to be met
static const double met = 1e-4;        // a force is met within this share of the force asked for

// An equilibrium on the way.
typedef struct equilibrium {
  double share; // of the way
  double force_n;
  sonde_settle_result settled;
  sonde_vec3 *position; // [nodes]
  uint8_t *touched;     // [nodes] pushed by the probe
} equilibrium;

typedef struct path {
  sonde_state *state;
  const sonde_probe *probe;
  const sonde_path_def *def;
  sonde_pose from, to;
  double length_m; // of the way of the face's farthest corner
  sonde_path_result *result;
  equilibrium here, half, whole, end; // the step's start; after half, in one, and after two halves
} path;

static uint32_t nodes(const path *p) { return p->state->nodes.count; }

static sonde_pose pose_at(const path *p, double share) {
  sonde_quat a = p->from.rotation, b = p->to.rotation;
  double sign = a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z < 0 ? -share : share,
         rest = 1 - share;
  sonde_quat q = {rest * a.w + sign * b.w, rest * a.x + sign * b.x, rest * a.y + sign * b.y,
                  rest * a.z + sign * b.z};
  return (sonde_pose){v_lerp(p->from.position, p->to.position, share), q_unit(q)};
}

// The equilibrium one step on from another. The touched skin goes along with the probe first, as it
// does under a slow press: left behind it would lie deep inside the probe, where some of it is
// nearer to a side than to the face.
static void settle_from(path *p, const equilibrium *from, double share, double residual,
                        equilibrium *to) {
  sonde_state *state = p->state;
  sonde_pose was = pose_at(p, from->share), is = pose_at(p, share);
  SONDE_ASSERT(share >= 0 && share <= 1);
  sonde_state_publish(state);
  memcpy(state->position, from->position, nodes(p) * sizeof *from->position);
  for (uint32_t i = 0; i < nodes(p); ++i) {
    if (!from->touched[i]) continue;
    const sonde_vec3 at = from->position[i];
    sonde_vec3 move = v_sub(pose_apply(is, pose_apply_inverse(was, at)), at);
    state->position[i] =
        v_add(at, sonde_model_bounded_move(state->model, i, v_sub(at, state->nodes.rest[i]), move));
  }
  to->settled = sonde_settle(state, p->probe, is, residual, p->def->max_iterations);
  to->share = share;
  to->force_n = -v_dot(state->contact.force_n, q_rotate(is.rotation, vec3(0, 0, 1)));
  memcpy(to->position, state->position, nodes(p) * sizeof *to->position);
  for (uint32_t i = 0; i < nodes(p); ++i) to->touched[i] = v_norm2(state->contact_force[i]) > 0;
  p->result->iterations += to->settled.iterations;
}

static void swap_equilibria(equilibrium *a, equilibrium *b) {
  SONDE_ASSERT(a != b);
  equilibrium c = *a;
  *a = *b, *b = c;
}

// From `here`, at most *step_m on; `end` is the new equilibrium. The first half of a step that was
// too long is the next, shorter one taken at once. A shortest step whose halves end elsewhere is
// told as a jump.
static void take_step(path *p, double *step_m) {
  sonde_path_result *r = p->result;
  double step = *step_m, left = (1 - p->here.share) * p->length_m;
  SONDE_ASSERT(step > 0 && left > 0);
  for (bool known = false;; known = true) {
    double share = step >= 0.999 * left ? 1 : p->here.share + step / p->length_m;
    double middle = 0.5 * (p->here.share + share);
    if (!known) settle_from(p, &p->here, share, quick, &p->whole);
    settle_from(p, &p->here, middle, quick, &p->half);
    settle_from(p, &p->half, share, quick, &p->end);
    step = fmin(step, left);
    double least = fmax(p->def->tolerance * fabs(p->end.force_n), forgiven_n);
    bool same = p->whole.settled.converged && p->half.settled.converged &&
                p->end.settled.converged && fabs(p->whole.force_n - p->end.force_n) <= least;
    if (same || 0.5 * step < p->def->least_step_m) {
      double length_m = v_distance(p->from.position, p->to.position);
      if (!same && r->jump_count < SONDE_PATH_JUMPS)
        r->jump[r->jump_count] =
            (sonde_path_jump){p->here.share * length_m, p->end.share * length_m, p->here.force_n,
                              p->whole.force_n, p->end.force_n};
      r->jump_count += !same;
      *step_m = same ? fmin(2 * step, p->def->step_m) : step;
      ++r->steps;
      return;
    }
    swap_equilibria(&p->whole, &p->half);
    step *= 0.5;
  }
}

// Between `here`, which has less than the force, and `end`, which has as much: the Illinois form of
// regula falsi, each trial pressed on from below, since skin that comes back from deeper may settle
// elsewhere.
static void meet_force(path *p) {
  double wanted = p->def->force_n, high = p->end.share;
  SONDE_ASSERT(isfinite(wanted) && p->here.share < high);
  double low_f = p->here.force_n - wanted, high_f = p->end.force_n - wanted;
  for (int k = 0; k < 60 && fabs(p->end.force_n - wanted) > met * wanted; ++k) {
    double low = p->here.share;
    settle_from(p, &p->here, low - low_f * (high - low) / (high_f - low_f), closely, &p->end);
    double weight = k % 3 == 2 ? 0.5 : 1;
    if (p->end.force_n < wanted) {
      p->here.share = p->end.share, p->here.force_n = p->end.force_n;
      p->here.settled = p->end.settled;
      memcpy(p->here.position, p->end.position, nodes(p) * sizeof *p->here.position);
      memcpy(p->here.touched, p->end.touched, nodes(p));
      low_f = p->here.force_n - wanted, high_f *= weight;
    } else {
      high = p->end.share, high_f = p->end.force_n - wanted, low_f *= weight;
    }
  }
}

// False when cancelled.
static bool follow(path *p, const sonde_progress *progress) {
  double step_m = p->def->step_m;
  settle_from(p, &p->here, 0, closely, &p->end);
  while (p->end.settled.converged && p->end.share < 1 && p->end.force_n < p->def->force_n &&
         p->length_m > 0) {
    swap_equilibria(&p->here, &p->end);
    double met_share = isfinite(p->def->force_n) ? p->here.force_n / p->def->force_n : 0;
    double done = clamp(fmax(p->here.share, met_share), 0, 1);
    if (!sonde_progress_report(progress, done, "pressing")) return false;
    take_step(p, &step_m);
  }
  return true;
}

static sonde_status check_def(const sonde_path_def *d, sonde_error *error) {
  sonde_status status = sonde_def_check("path", d->version, error);
  if (status) return status;
  const sonde_bounded range[] = {{"step_m", d->step_m, 1e-6, 0.1},
                                 {"least_step_m", d->least_step_m, 1e-7, d->step_m},
                                 {"tolerance", d->tolerance, 1e-6, 1},
                                 {"force_n", d->force_n, 1e-6, INFINITY},
                                 {"relative_residual", d->relative_residual, 1e-14, 0.1},
                                 {"max_iterations", d->max_iterations, 1, 1e6}};
  return sonde_bounded_check(range, SONDE_COUNT_OF(range), error);
}

sonde_path_def sonde_path_def_default(void) {
  return (sonde_path_def){.version = SONDE_DEF_VERSION,
                          .step_m = 1e-3,
                          .least_step_m = 0.125e-3,
                          .tolerance = 0.01,
                          .force_n = INFINITY,
                          .relative_residual = 1e-9,
                          .max_iterations = 400};
}

// Exact at the end; says why when that is not where the press was to go.
static sonde_status conclude(path *p, sonde_error *error) {
  sonde_path_result *r = p->result;
  double share = p->end.share, way_m = share * v_distance(p->from.position, p->to.position);
  settle_from(p, &p->end, share, p->def->relative_residual, &p->end);
  r->settled = p->end.settled;
  r->pose = pose_at(p, share);
  r->way_m = way_m;
  r->force_n = p->end.force_n;
  if (!r->settled.converged)
    return sonde_fail(error, SONDE_CONVERGENCE,
                      "no equilibrium was found %.2f mm down the press: residual %.2g of %.3g N",
                      way_m * 1e3, r->settled.residual, r->force_n);
  if (isfinite(p->def->force_n) && fabs(r->force_n - p->def->force_n) > 50 * met * p->def->force_n)
    return sonde_fail(error, SONDE_CONVERGENCE, "%g N was not reached: %.4g N at %.2f mm%s",
                      p->def->force_n, r->force_n, way_m * 1e3,
                      r->jump_count ? ", after a jump of the skin" : "");
  return SONDE_OK;
}

sonde_status sonde_settle_path(sonde_state *state, const sonde_probe *probe, sonde_pose from,
                               sonde_pose to, const sonde_path_def *def,
                               const sonde_progress *progress, sonde_path_result *result,
                               sonde_error *error) {
  const sonde_path_def usual = sonde_path_def_default();
  SONDE_ASSERT(state && probe && result && v_finite(from.position) && v_finite(to.position));
  *result = (sonde_path_result){.pose = from};
  path p = {.state = state, .probe = probe, .def = def ? def : &usual};
  p.from = from, p.to = to, p.result = result;
  sonde_quat a = from.rotation, b = to.rotation;
  double angle = 2 * acos(fmin(1, fabs(a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z)));
  p.length_m =
      v_distance(from.position, to.position) + angle * hypot(probe->half_x_m, probe->half_y_m);
  sonde_status status = check_def(p.def, error);
  equilibrium *const all[] = {&p.here, &p.half, &p.whole, &p.end};
  for (size_t k = 0; k < SONDE_COUNT_OF(all) && !status; ++k) {
    all[k]->position = SONDE_NEW(sonde_vec3, nodes(&p));
    all[k]->touched = SONDE_NEW(uint8_t, nodes(&p));
    if (!all[k]->position || !all[k]->touched) status = sonde_fail_memory(error);
  }
  if (!status) {
    sonde_state_publish(state);
    memcpy(p.here.position, state->position, nodes(&p) * sizeof *p.here.position);
    if (!follow(&p, progress)) status = sonde_fail(error, SONDE_CANCELLED, "cancelled");
  }
  if (!status && p.end.settled.converged && p.end.force_n >= p.def->force_n && p.end.share > 0)
    meet_force(&p);
  if (!status) status = conclude(&p, error);
  for (size_t k = 0; k < SONDE_COUNT_OF(all); ++k) {
    sonde_free(all[k]->position);
    sonde_free(all[k]->touched);
  }
  return status;
}
