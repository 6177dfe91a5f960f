// Scripted operators: hands of different skill that examine the places of a plan.
#include "trainer/trainer.h"

#include "base/random.h"
#include "haptics/motion.h"

#include <string.h>

// What makes an operator. Ratios and forces are what the operator goes by, not the judge's.
typedef struct habit {
  const char *name;
  double skip;                         // share of the places that are left out
  double along_m, across_m, twist_rad; // spread of the aim
  double approach_m_s, press_m_s, travel_m_s;
  double share_from, share_to;       // stops at a share of the place's firm force, 0: by the image
  double beyond_from_n, beyond_to_n; // the same above the limit of force
  double closed_ratio, open_ratio;   // of the vein: called closed, called open
  double past_firm_n;                // above the place's firm force: ends a press on an open vein
  double pause_s, wander_m;          // looks for the vein before a press; how far it sways then
  double past_m;                     // a travel goes past its place by this spread, then back
  double rate_n_s;                   // slows down where the force rises faster
  uint32_t attempts;                 // at a place, until it is clear
  bool confirm, guess;               // repeats what looks open; calls what it has not seen
  bool hesitant;                     // stops while pressing
  bool patient;                      // waits while the patient strains
} habit;

static const habit HABIT[] = {
    {.name = "expert",
     .along_m = 0.001,
     .across_m = 0.0015,
     .twist_rad = 0.045,
     .approach_m_s = 0.03,
     .press_m_s = 0.012,
     .travel_m_s = 0.08,
     .closed_ratio = 0.08,
     .open_ratio = 0.33,
     .past_firm_n = 0.5,
     .pause_s = 0.2,
     .wander_m = 0,
     .rate_n_s = 12,
     .attempts = 2,
     .confirm = true,
     .patient = true},
    {.name = "novice",
     .skip = 0.5,
     .along_m = 0.006,
     .across_m = 0.007,
     .twist_rad = 0.42,
     .approach_m_s = 0.05,
     .press_m_s = 0.035,
     .travel_m_s = 0.05,
     .share_from = 0.25,
     .share_to = 0.8,
     .closed_ratio = 0.7,
     .open_ratio = 0.7,
     .pause_s = 4,
     .wander_m = 0.012,
     .past_m = 0.02,
     .hesitant = true,
     .rate_n_s = 40,
     .attempts = 1,
     .guess = true},
    {.name = "timid",
     .along_m = 0.002,
     .across_m = 0.002,
     .twist_rad = 0.08,
     .approach_m_s = 0.02,
     .press_m_s = 0.008,
     .travel_m_s = 0.05,
     .share_from = 0.2,
     .share_to = 0.36,
     .closed_ratio = 0.75,
     .open_ratio = 0.85,
     .pause_s = 0.6,
     .wander_m = 0.002,
     .rate_n_s = 8,
     .attempts = 1},
    {.name = "forceful",
     .along_m = 0.002,
     .across_m = 0.003,
     .twist_rad = 0.08,
     .approach_m_s = 0.05,
     .press_m_s = 0.03,
     .travel_m_s = 0.1,
     .beyond_from_n = 3,
     .beyond_to_n = 10,
     .closed_ratio = 0.1,
     .open_ratio = 0.3,
     .pause_s = 0.2,
     .rate_n_s = 50,
     .attempts = 1},
};
static const char *const NAMES[] = {"expert", "novice", "timid", "forceful", NULL};

static const double SETTLED_M = 0.003;
static const double LIFT_M = 0.006, DEEPEST_M = 0.060, TOUCH_N = 1.5, HOLD_S = 0.2;
static const double GIVES_WAY = 0.8; // share of the force so far, once above SLIP_SHARE
static const double SLIP_SHARE = 0.6, CALL_SHARE = 0.32; // of the place's firm force
static const double NEAR_LIMIT = 0.95, RELEASE_M_S = 0.08;
static const double ARCH_M = 0.03, ARCH_TURNED_M = 0.05; // out of a way through the air
static const double STRAINS_PA = 5 * SONDE_PA_PER_MMHG;  // above the calm pressure: wide veins
static const double FLIGHT = 2; // speed through the air over that along the skin

struct sonde_operator {
  habit habit;
  sonde_vein_map map;
  sonde_plan plan;
  uint32_t held; // setup in whose position the patient is
  uint64_t seed, draws;
  sonde_device hand; // functions and self only; the session owns it
  bool visit[SONDE_PLAN_POINTS];
  uint32_t open[SONDE_SEGMENTS], closed[SONDE_SEGMENTS], unsure[SONDE_SEGMENTS];

  sonde_operator_phase phase;
  uint32_t place, attempt, opens;
  double along_m, across_m, twist_rad, depth_m; // where the hand is told to be, from the place
  bool flying;                                  // through the air to the place, from `left`
  double flown, way_m;                          // share of that way, its length
  sonde_pose left;
  double sway_m, sway_across_m;              // beside it, while looking
  double aim_m, aim_across_m, aim_twist_rad; // at this attempt
  double beyond_m;                           // the travel goes there first
  double stop_n, wait_s, last_s;
  double ratio, peak_n;        // of this press; NaN: not seen
  double felt_n, felt_depth_m; // at the last look
  double calm_pa;              // least venous pressure so far
  bool started;
};

const char *const *sonde_operator_names(void) { return NAMES; }

static double uniform(sonde_operator *op, double low, double high) {
  return low + (high - low) * sonde_random_uniform(op->seed, op->draws++);
}

// Cut at two and a half times the spread: hands do not jump.
static double spread(sonde_operator *op, double size) {
  return size * clamp(sonde_random_normal(op->seed, op->draws++), -2.5, 2.5);
}

// The errors of the hand at a place.
static void aim(sonde_operator *op) {
  const habit *h = &op->habit;
  double calm = op->attempt > 0 ? 0.5 : 1; // a second try is made with more care
  op->aim_m = calm * spread(op, h->along_m);
  op->aim_across_m = calm * spread(op, h->across_m);
  op->aim_twist_rad = calm * spread(op, h->twist_rad);
  const sonde_force_target *target = &op->plan.point[op->place].target;
  op->stop_n = NEAR_LIMIT * target->limit_n;
  if (h->share_to > 0) op->stop_n = target->firm_n * uniform(op, h->share_from, h->share_to);
  if (h->beyond_to_n > 0)
    op->stop_n = target->limit_n + uniform(op, h->beyond_from_n, h->beyond_to_n);
  op->ratio = (double)NAN;
  op->peak_n = op->felt_n = 0;
  op->felt_depth_m = -INFINITY;
  op->wait_s = h->pause_s * uniform(op, 0.5, 1.5);
  op->beyond_m = h->past_m > 0 ? spread(op, h->past_m) : 0;
}

// The middle of the leg at a height.
static sonde_vec3 middle_at(const sonde_vein_map *map, double z_m) {
  double low = map->middle_z_m[0], high = map->middle_z_m[1];
  if (!(high > low)) return vec3(0, 0, z_m);
  double at = clamp((z_m - low) / (high - low), 0, 1) * (SONDE_MAP_MIDDLES - 1);
  uint32_t k = (uint32_t)fmin(at, SONDE_MAP_MIDDLES - 2);
  sonde_vec3 middle = v_lerp(map->middle_m[k], map->middle_m[k + 1], at - k);
  return vec3(middle.x, middle.y, z_m);
}

static sonde_pose pose_at(const sonde_operator *op) {
  // Where the hand is once it has come to the place: along the main vein the skin's curve is
  // followed, at a station its plane.
  const sonde_plan_point *place = &op->plan.point[op->place < op->plan.count ? op->place : 0];
  sonde_vein_point p = place->at;
  double along_m = op->along_m + op->sway_m;
  if (!place->station) p = sonde_vein_at(&op->map, place->at.along_m + along_m);
  sonde_vec3 z = v_neg(p.normal), y = v_cross(z, p.across);
  double c = cos(op->twist_rad), s = sin(op->twist_rad);
  sonde_vec3 x = v_add(v_scale(p.across, c), v_scale(y, s));
  sonde_vec3 at = v_madd(p.skin_m, op->across_m + op->sway_across_m, p.across);
  if (place->station) at = v_madd(at, y.z < 0 ? -along_m : along_m, y);
  sonde_pose there = {v_madd(at, -op->depth_m, p.normal),
                      q_from_matrix(m_columns(x, v_cross(z, x), z))};
  if (!op->flying) return there;

  // The way there from another side of the leg, around its middle and outside of it: height,
  // direction and distance from the middle change evenly, farther out in between.
  double t = op->flown, z_m = op->left.position.z + t * (there.position.z - op->left.position.z);
  sonde_vec3 from = v_sub(op->left.position, middle_at(&op->map, op->left.position.z));
  sonde_vec3 to = v_sub(there.position, middle_at(&op->map, there.position.z));
  double start = atan2(from.y, from.x), turn = remainder(atan2(to.y, to.x) - start, 2 * SONDE_PI);
  double near_m = hypot(from.x, from.y), far_m = hypot(to.x, to.y);
  double arch = (ARCH_M + ARCH_TURNED_M * fabs(turn) / SONDE_PI) * sin(SONDE_PI * t);
  double angle = start + t * turn, out_m = near_m + t * (far_m - near_m) + arch;
  sonde_vec3 out = vec3(out_m * cos(angle), out_m * sin(angle), 0);
  // The beam keeps looking at the leg: the probe turns with the direction, the rest evenly.
  sonde_quat goal = q_mul(q_conj(q_about(2, turn)), there.rotation);
  return (sonde_pose){v_add(middle_at(&op->map, z_m), out),
                      q_mul(q_about(2, t * turn), sonde_quat_slerp(op->left.rotation, goal, t))};
}

// The next place that is visited, or the end. Between two places of the main vein the hand goes
// along it, else through the air.
static void begin_place(sonde_operator *op, uint32_t place) {
  while (place < op->plan.count && !op->visit[place]) ++place;
  const uint32_t before = op->place;
  const bool turns = place < op->plan.count && op->plan.point[place].held != op->held;
  const bool any = op->started && before < op->plan.count && place < op->plan.count && !turns;
  if (any && before != place) {
    const sonde_plan_point *old = &op->plan.point[before], *next = &op->plan.point[place];
    op->left = pose_at(op);
    op->flying = (old->station || next->station) && !sonde_same_stand(old, next);
    op->flown = 0;
    sonde_vec3 a = op->left.position, b = next->at.skin_m;
    sonde_vec3 from = v_sub(a, middle_at(&op->map, a.z)), to = v_sub(b, middle_at(&op->map, b.z));
    double turn = acos(clamp(v_dot(from, to) / (v_norm(from) * v_norm(to)), -1, 1));
    double out_m = fmax(v_norm(from), v_norm(to)) + ARCH_M + ARCH_TURNED_M * turn / SONDE_PI;
    op->way_m = hypot(turn * out_m, a.z - b.z) + 2 * (ARCH_M + ARCH_TURNED_M);
    op->along_m += old->station || next->station ? 0 : old->at.along_m - next->at.along_m;
    if (op->flying) op->along_m = op->across_m = 0;
  }
  op->place = place;
  op->attempt = op->opens = 0;
  op->phase = place >= op->plan.count ? SONDE_OPERATOR_DONE
              : turns                 ? SONDE_OPERATOR_TURN
                                      : SONDE_OPERATOR_TRAVEL;
  if (op->phase == SONDE_OPERATOR_TRAVEL) aim(op);
}

uint32_t sonde_operator_wants(const sonde_operator *op) {
  return op->phase == SONDE_OPERATOR_TURN ? op->plan.point[op->place].held : op->held;
}

sonde_status sonde_operator_hold(sonde_operator *op, uint32_t held, const sonde_vein_map *map,
                                 double dt_s, sonde_device *device, sonde_error *error) {
  SONDE_ASSERT(op && op->phase == SONDE_OPERATOR_TURN && map && device &&
               held == sonde_operator_wants(op));
  op->map = *map, op->held = held;
  op->last_s = op->along_m = op->across_m = op->twist_rad = 0;
  op->depth_m = -LIFT_M;
  op->flying = false;
  op->phase = SONDE_OPERATOR_TRAVEL;
  aim(op);
  sonde_status status = sonde_device_page(pose_at(op), dt_s, device, error);
  if (!status) op->hand = *device;
  return status;
}

sonde_status sonde_operator_create(const char *name, uint64_t seed, const sonde_vein_map *map,
                                   const sonde_plan *plan, double dt_s, sonde_operator **out,
                                   sonde_device *device, sonde_error *error) {
  SONDE_ASSERT(name && map && plan && out && device && dt_s > 0);
  *out = NULL;
  size_t k = 0;
  while (k < SONDE_COUNT_OF(HABIT) && strcmp(HABIT[k].name, name) != 0) ++k;
  if (k == SONDE_COUNT_OF(HABIT))
    return sonde_fail(error, SONDE_NOT_FOUND,
                      "no operator '%s', expected expert, novice, timid or forceful", name);
  sonde_operator *op = SONDE_NEW(sonde_operator, 1);
  if (!op) return sonde_fail_memory(error);
  *op = (sonde_operator){.habit = HABIT[k], .map = *map, .plan = *plan, .seed = seed};
  for (uint32_t i = 0; i < plan->count; ++i) op->visit[i] = uniform(op, 0, 1) >= op->habit.skip;
  op->depth_m = -LIFT_M;
  begin_place(op, 0);
  sonde_status status = sonde_device_page(pose_at(op), dt_s, device, error);
  if (status) {
    sonde_free(op);
    return status;
  }
  op->hand = *device;
  *out = op;
  return SONDE_OK;
}

void sonde_operator_destroy(sonde_operator *op) { sonde_free(op); }

// ---- phases

static double towards(double from, double to, double step) {
  return fabs(to - from) <= step ? to : from + (to > from ? step : -step);
}

// What a finished press showed. Closed once is closed: a vein that can be emptied has no clot
// there.
static void weigh_press(sonde_operator *op) {
  const habit *h = &op->habit;
  SONDE_ASSERT(op->place < op->plan.count);
  uint32_t segment = op->plan.point[op->place].segment;
  bool by_image = !(h->share_to > 0);
  bool closed = op->ratio <= h->closed_ratio + (by_image ? 0.02 : 0);
  double firm_n = (by_image ? 1 : CALL_SHARE) * op->plan.point[op->place].target.firm_n;
  bool firm = op->peak_n >= firm_n;
  bool open = !closed && op->ratio >= h->open_ratio && firm;
  op->attempt++;
  op->opens += open;
  bool clear = closed || (open && (!h->confirm || op->opens >= 2));
  if (!clear && op->attempt < h->attempts) {
    op->phase = SONDE_OPERATOR_TRAVEL;
    aim(op);
    return;
  }
  if (closed)
    op->closed[segment]++;
  else if (open)
    op->open[segment]++;
  else
    op->unsure[segment]++;
  begin_place(op, op->place + 1);
}

void sonde_operator_see(sonde_operator *op, const sonde_snapshot *s) {
  SONDE_ASSERT(op && s);
  const habit *h = &op->habit;
  double dt_s = op->started ? clamp(s->time_s - op->last_s, 0, 0.2) : 0;
  op->calm_pa = op->started ? fmin(op->calm_pa, s->venous_pressure_pa) : s->venous_pressure_pa;
  op->started = true;
  op->last_s = s->time_s;
  double vein = (double)NAN; // how open the veins are that the place asks for
  if (op->place < op->plan.count)
    vein = sonde_segment_ratio(&op->map, op->plan.point[op->place].segment, s, NULL);
  if (op->phase == SONDE_OPERATOR_PRESS || op->phase == SONDE_OPERATOR_HOLD) {
    op->ratio = fmin(op->ratio, vein);
    op->peak_n = fmax(op->peak_n, s->force_normal_n);
  }
  switch (op->phase) {
  case SONDE_OPERATOR_TRAVEL: {
    double step = h->travel_m_s * dt_s, goal_m = op->aim_m + op->beyond_m;
    if (op->flying) {
      op->flown = fmin(1, op->flown + FLIGHT * step / op->way_m);
      op->flying = op->flown < 1;
      break;
    }
    // Along the course of the vein at a small height, so that the skin's curve is followed.
    op->along_m = towards(op->along_m, goal_m, step);
    op->across_m = towards(op->across_m, op->aim_across_m, step);
    op->twist_rad = towards(op->twist_rad, op->aim_twist_rad, dt_s);
    if (op->along_m != goal_m || op->across_m != op->aim_across_m ||
        op->twist_rad != op->aim_twist_rad)
      break;
    if (op->beyond_m != 0) { // back, and again a little too far
      op->beyond_m = fabs(op->beyond_m) > SETTLED_M ? -0.5 * op->beyond_m : 0;
      break;
    }
    op->wait_s -= dt_s;
    double reach_m = h->wander_m * clamp(op->wait_s, 0, 1); // comes to rest in the end
    op->sway_m = reach_m * sin(2 * SONDE_PI * 0.45 * s->time_s);
    op->sway_across_m = reach_m * sin(2 * SONDE_PI * 0.7 * s->time_s);
    bool strains = h->patient && s->venous_pressure_pa > op->calm_pa + STRAINS_PA;
    if (op->wait_s <= 0 && !strains) op->phase = SONDE_OPERATOR_PRESS;
    break;
  }
  case SONDE_OPERATOR_PRESS: {
    // One look of a press, and whether it ends.
    double force_n = s->force_normal_n, speed = force_n < TOUCH_N ? h->approach_m_s : h->press_m_s;
    double stiffness = (force_n - op->felt_n) / (op->depth_m - op->felt_depth_m);
    if (stiffness > 0) speed = fmin(speed, h->rate_n_s / stiffness);
    op->felt_n = force_n;
    op->felt_depth_m = op->depth_m;
    bool stops = h->hesitant && sin(2 * SONDE_PI * 1.1 * s->time_s) > 0.3;
    if (!stops) op->depth_m += dt_s * speed;

    bool ends = force_n >= op->stop_n || op->depth_m >= DEEPEST_M;
    // The skin slips from the probe; a light touch may bounce.
    double place_n = op->plan.point[op->place].target.firm_n;
    ends |= op->peak_n > SLIP_SHARE * place_n && force_n < GIVES_WAY * op->peak_n;
    // Who goes by the image ends at a closed vein, and at one that stays open at a firm force.
    double firm_n = place_n + h->past_firm_n;
    if (!(h->share_to > 0 || h->beyond_to_n > 0))
      ends |= vein <= h->closed_ratio || (force_n >= firm_n && vein >= h->open_ratio);
    if (!ends) break;
    op->phase = SONDE_OPERATOR_HOLD;
    op->wait_s = HOLD_S;
    break;
  }
  case SONDE_OPERATOR_HOLD:
    op->wait_s -= dt_s;
    if (op->wait_s <= 0) op->phase = SONDE_OPERATOR_RELEASE;
    break;
  case SONDE_OPERATOR_RELEASE:
    op->depth_m = towards(op->depth_m, -LIFT_M, RELEASE_M_S * dt_s);
    if (op->depth_m <= -LIFT_M) weigh_press(op);
    break;
  case SONDE_OPERATOR_TURN:
  case SONDE_OPERATOR_DONE: break;
  }
  if (op->phase != SONDE_OPERATOR_DONE && op->phase != SONDE_OPERATOR_TURN)
    sonde_device_page_goal(&op->hand, pose_at(op));
}

sonde_operator_phase sonde_operator_doing(const sonde_operator *op, uint32_t *place,
                                          uint32_t *attempt) {
  SONDE_ASSERT(op && place && attempt);
  *place = op->place, *attempt = op->attempt;
  return op->phase;
}

bool sonde_operator_done(const sonde_operator *op) { return op->phase == SONDE_OPERATOR_DONE; }

sonde_decision sonde_operator_decision(const sonde_operator *op, uint32_t segment) {
  SONDE_ASSERT(segment < SONDE_SEGMENTS);
  if (op->open[segment]) return SONDE_DECISION_CLOT;
  if (op->habit.guess) return SONDE_DECISION_COMPRESSIBLE;
  if (op->closed[segment] && !op->unsure[segment]) return SONDE_DECISION_COMPRESSIBLE;
  return SONDE_DECISION_NOT_SEEN;
}
