// Scripted learners who look for the view of a place, with errors of search, with and without
// guidance in the picture.
#include "sonde/trainer_picture.h"

#include "base/random.h"
#include "exam/vessels.h"
#include "interior/interior.h"
#include "trainer/judge.h"

static const double BESIDE_M[2] = {0.040, 0.015}, TWIST_RAD = 20 * SONDE_PI / 180; // at first
static const double SPEED_M_S = 0.040, LOOK_S = 0.2, STEP_M = 0.015, SWEEP_M = 0.015;
static const double LENGTH_ERROR = 0.25, WAY_RAD = 15 * SONDE_PI / 180;
static const double MIDDLE_M = 0.008, KNOWS = 1.0 / 3; // a look in three without names
static const double STRAIGHTENS = 0.7; // share of the twist that is left after a look

// The hand: where it is beside the place, along the leg and across it.
typedef struct hand {
  double along_m, across_m, twist_rad;
} hand;

typedef struct learner {
  uint64_t seed, draws;
  hand start, now, goal;
  uint32_t step; // of the own search
} learner;

static double draw(learner *l) { return sonde_random_normal(l->seed, l->draws++); }

// On the plane that touches the skin at the place.
static sonde_pose pose_of(const sonde_plan_point *point, const hand *h) {
  const sonde_vein_point *at = &point->at;
  const sonde_vec3 z = v_neg(at->normal), y = v_cross(z, at->across);
  const sonde_vec3 x = v_add(v_scale(at->across, cos(h->twist_rad)), v_scale(y, sin(h->twist_rad)));
  const sonde_vec3 face_m = v_madd(v_madd(at->skin_m, h->across_m, at->across), h->along_m, y);
  return (sonde_pose){face_m, q_from_matrix(m_columns(x, v_cross(z, x), z))};
}

// One learner on a leg whose inside is at rest.
static sonde_search search_once(const sonde_case_setup *setup, const sonde_plan *one,
                                const sonde_state *state, const sonde_interior *interior,
                                sonde_guidance_level level, uint64_t seed) {
  learner l = {.seed = seed};
  sonde_search search = {0};
  sonde_judge *judge = NULL;
  const double along_m = BESIDE_M[0] * draw(&l), across_m = BESIDE_M[1] * draw(&l);
  l.start = l.now = l.goal = (hand){along_m, across_m, TWIST_RAD * draw(&l)};
  if (sonde_judge_create(&setup->map, one, &judge, NULL)) return search;
  while (!search.found && search.ticks < 1000 * SONDE_SEARCH_S) {
    sonde_snapshot s = sonde_snapshot_of(state, pose_of(one->point, &l.now));
    s.tick = search.ticks + 1, s.time_s = 1e-3 * search.ticks;
    sonde_snapshot_read_vessels(interior, &s);
    sonde_judge_feed(judge, &s);
    // One look, and the way until the next one.
    sonde_picture all, shown;
    sonde_picture_read(judge, setup, &s, SONDE_GUIDANCE_FULL, &all);
    sonde_picture_read(judge, setup, &s, level, &shown);
    bool seen = false, middle = false;
    for (uint32_t k = 0; k < all.count; ++k) {
      seen |= all.mark[k].wanted;
      middle |= all.mark[k].wanted && fabs(all.mark[k].aside_m) <= MIDDLE_M;
    }
    seen = seen && fabs(l.now.along_m) <= one->criteria.reach_m;
    search.found = seen && middle && sonde_judge_guidance(judge).angle_ok;
    if (search.found) break;
    // Where the hand goes next: the way that is shown, what is recognised, or an own search to and
    // fro along the leg, each time farther, and at each stop to either side.
    const bool names = shown.count > 0, led = isfinite(shown.aside_m);
    if (led) {
      const double longer = 1 + LENGTH_ERROR * draw(&l),
                   turned = WAY_RAD * draw(&l) + l.now.twist_rad;
      const double x = longer * shown.aside_m, y = longer * shown.along_m;
      l.goal.across_m = l.now.across_m + cos(turned) * x - sin(turned) * y;
      l.goal.along_m = l.now.along_m + sin(turned) * x + cos(turned) * y;
    } else if ((names || sonde_random_uniform(l.seed, l.draws++) < KNOWS) && seen) {
      for (uint32_t k = 0; k < all.count; ++k)
        if (all.mark[k].wanted) l.goal.across_m = l.now.across_m + all.mark[k].aside_m;
      l.goal.along_m = l.now.along_m;
    } else if (l.goal.along_m == l.now.along_m && l.goal.across_m == l.now.across_m) {
      const uint32_t stop = l.step / 3, side = l.step % 3;
      const double far_m = STEP_M * ((stop + 1) / 2);
      l.step++;
      l.goal.along_m = l.start.along_m + (stop % 2 ? far_m : -far_m);
      l.goal.across_m = l.start.across_m + SWEEP_M * ((double)side - 1);
    }
    const double x_m = l.goal.across_m - l.now.across_m, y_m = l.goal.along_m - l.now.along_m;
    const double share = fmin(1, SPEED_M_S * LOOK_S / fmax(hypot(x_m, y_m), 1e-9));
    search.path_m += share * hypot(x_m, y_m);
    search.ticks += (uint32_t)lround(1e3 * LOOK_S);
    l.now.twist_rad *= STRAIGHTENS;
    l.now.across_m = share < 1 ? l.now.across_m + share * x_m : l.goal.across_m;
    l.now.along_m = share < 1 ? l.now.along_m + share * y_m : l.goal.along_m;
  }
  sonde_judge_destroy(judge);
  return search;
}

sonde_status sonde_learner_search(const sonde_exam_setups *setups, const sonde_plan *plan,
                                  uint32_t place, uint32_t learners, sonde_search *search,
                                  sonde_error *error) {
  SONDE_ASSERT(setups && plan && place < plan->count && search && learners > 0);
  const sonde_case_setup *setup = &setups->held[plan->point[place].held];
  sonde_plan one = {.criteria = plan->criteria, .count = 1};
  one.point[0] = plan->point[place];
  one.point[0].held = 0;
  sonde_interior *interior = NULL;
  sonde_state *state = NULL;
  const sonde_world_def world = sonde_session_def_default().world;
  sonde_status status = sonde_state_create(setup->model, &world, &state, error);
  if (!status) status = sonde_interior_create(setup->model, &interior, error);
  if (!status) {
    const hand there = {0, 0, 0};
    sonde_interior_set_method(interior, SONDE_INTERIOR_COLUMNS);
    const sonde_interior_input input = {.positions_m = sonde_state_positions(state),
                                        .contact_forces_n = sonde_state_contact_forces(state),
                                        .world_from_probe = pose_of(one.point, &there),
                                        .pathology = &setup->pathology,
                                        .dt_s = -1,
                                        .face_half_x_m = INFINITY,
                                        .face_half_y_m = INFINITY,
                                        .posture = setup->circulation.posture};
    sonde_interior_update(interior, &input);
    for (uint32_t k = 0; k < SONDE_GUIDANCE_LEVELS * learners; ++k)
      search[k] = search_once(setup, &one, state, interior, (sonde_guidance_level)(k / learners),
                              1 + k % learners);
  }
  sonde_interior_destroy(interior);
  sonde_state_destroy(state);
  return status;
}
