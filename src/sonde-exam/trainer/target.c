// The force of each place: what closes a healthy vein there.
#include "base/base.h"
#include "base/parallel.h"
#include "trainer/bench.h"

// The probe starts above the skin, and the vein is looked at every 25 ms. While the vein is wide
// open the probe comes down fast; from then on it presses as a careful hand does, and the tissue
// loses the viscous force of the fast way before the vein closes (docs/trainer_theory.md).
static const double LIFT_M = 0.002, FAST_M_S = 0.048, SPEED_M_S = 0.012;
static const double WIDE_RATIO = 0.85, DEEPEST_M = 0.060, FORCE_MOST_N = 60;
// A bench takes 1 s to open: several places share it.
enum { TICKS_PER_LOOK = 25, PLACES_PER_BENCH = 6 };
static const double ROOM = 1.2, ROOM_N = 2; // from the target to the limit

sonde_force_target sonde_force_target_make(double closes_n) {
  SONDE_ASSERT(closes_n > 0);
  return (sonde_force_target){
      .closes_n = closes_n, .firm_n = ceil(closes_n), .limit_n = ceil(ROOM * closes_n + ROOM_N)};
}

uint32_t sonde_plan_nearest(const sonde_plan *plan, uint32_t held, sonde_vec3 face_m) {
  SONDE_ASSERT(plan && plan->count <= SONDE_PLAN_POINTS);
  uint32_t nearest = SONDE_PLAN_POINTS;
  double least = INFINITY;
  for (uint32_t i = 0; i < plan->count; ++i) {
    double distance = v_distance(plan->point[i].at.skin_m, face_m);
    if (plan->point[i].held == held && distance < least) least = distance, nearest = i;
  }
  return nearest;
}

// Places of one setup that a bench presses one after the other.
typedef struct bench_work {
  uint32_t held, count;
  uint32_t place[PLACES_PER_BENCH];
} bench_work;

typedef struct target_work {
  sonde_plan *plan;
  const sonde_case_setup *setup; // [by bench_work.held] of the case
  bench_work bench[SONDE_PLAN_POINTS];
  uint32_t pressed_most; // places that are pressed in all
  atomic_uint pressed;
  const sonde_progress *progress; // the caller's
} target_work;

// Presses healthy veins from above the skin: at a station those of all its places. @return the
// force at which the area passes `closed_ratio` of that at rest, between two looks; NaN: it never
// does
static double find_closing_force(sonde_bench *bench, const sonde_plan *plan,
                                 const sonde_vein_map *map, uint32_t place) {
  const sonde_vein_point *at = &plan->point[place].at;
  const double closed_ratio = plan->criteria.closed_ratio;
  double depth_m = -LIFT_M, before_n = 0, before = 1;
  sonde_bench_rest(bench);
  while (depth_m < DEEPEST_M) {
    sonde_pose pose = sonde_vein_pose(at, depth_m);
    const double speed_m_s = before > WIDE_RATIO ? FAST_M_S : SPEED_M_S;
    for (int k = 0; k < TICKS_PER_LOOK; ++k) {
      depth_m += speed_m_s * BENCH_STEP_S;
      pose = sonde_vein_pose(at, depth_m);
      sonde_bench_step(bench, pose);
    }
    sonde_snapshot s = sonde_bench_look(bench, pose);
    double ratio = sonde_segment_ratio(map, plan->point[place].segment, &s, NULL);
    for (uint32_t i = 0; i < plan->count && isfinite(ratio); ++i)
      if (sonde_same_stand(&plan->point[i], &plan->point[place]))
        ratio = fmax(ratio, sonde_segment_ratio(map, plan->point[i].segment, &s, NULL));
    if (s.force_normal_n > FORCE_MOST_N) break;
    if (!isfinite(ratio)) continue;
    if (ratio <= closed_ratio) {
      double share = before > ratio ? (before - closed_ratio) / (before - ratio) : 1;
      return before_n + clamp(share, 0, 1) * (s.force_normal_n - before_n);
    }
    before = ratio;
    before_n = s.force_normal_n;
  }
  return (double)NAN;
}

// Presses the places of one bench.
static sonde_status press_places(void *user, uint32_t worker, uint32_t item,
                                 const atomic_bool *stop, sonde_error *error) {
  (void)worker;
  target_work *work = user;
  const bench_work *on = &work->bench[item];
  sonde_case_setup healthy = work->setup[on->held];
  const sonde_findings findings = {.oedema = healthy.findings.oedema};
  healthy.circulation.breath_pa = 0;
  healthy.circulation.valsalva_from_s = healthy.circulation.valsalva_to_s = 0;
  sonde_bench bench = {0};
  sonde_status status = sonde_pathology_preset("healthy", &healthy.pathology, error);
  if (!status) status = sonde_bench_open(&bench, &healthy, &findings, true, error);
  for (uint32_t k = 0; k < on->count && !status; ++k) {
    sonde_plan_point *point = &work->plan->point[on->place[k]];
    if (atomic_load(stop)) status = SONDE_CANCELLED;
    const double closes_n =
        status ? 0 : find_closing_force(&bench, work->plan, &healthy.map, on->place[k]);
    if (!status && !isfinite(closes_n))
      status =
          sonde_fail(error, SONDE_MISMATCH,
                     "'%s': a healthy vein of this thigh, %.0f mm below the skin, does not close "
                     "at %.0f N; compression decides nothing there",
                     point->title, 1e3 * point->at.depth_m, FORCE_MOST_N);
    if (!status) point->target = sonde_force_target_make(closes_n);
    atomic_fetch_add(&work->pressed, 1);
  }
  sonde_bench_close(&bench);
  return status;
}

// Tells the caller the share of the places, not that of the benches.
static bool report_places(double fraction, const char *what, void *user) {
  (void)fraction;
  target_work *work = user;
  const double pressed = atomic_load(&work->pressed);
  return sonde_progress_report(work->progress, pressed / work->pressed_most, what);
}

sonde_status sonde_plan_find_targets(sonde_plan *plan, const sonde_case_setup *setup,
                                     const sonde_progress *progress, sonde_error *error) {
  SONDE_ASSERT(plan && setup && setup->model);
  target_work work = {.plan = plan, .setup = setup, .progress = progress};

  // Each place where the probe stands is pressed once. The plan alone decides which places share a
  // bench, so that the forces do not depend on the number of threads.
  bench_work *open[SONDE_EXAM_SETUPS] = {NULL}; // of each setup, the bench that has room
  uint32_t stand[SONDE_PLAN_POINTS], benches = 0;
  for (uint32_t i = 0; i < plan->count; ++i) {
    const sonde_plan_point *point = &plan->point[i];
    SONDE_ASSERT(point->held < SONDE_EXAM_SETUPS);
    stand[i] = 0;
    while (stand[i] < i && !sonde_same_stand(&plan->point[stand[i]], point)) ++stand[i];
    if (stand[i] < i) continue;
    bench_work **bench = &open[point->held];
    if (!*bench || (*bench)->count == PLACES_PER_BENCH) *bench = &work.bench[benches++];
    (*bench)->held = point->held;
    (*bench)->place[(*bench)->count++] = i;
    ++work.pressed_most;
  }

  // One core is left to the session that goes on meanwhile.
  const uint32_t cores = sonde_parallel_workers(0, benches + 1);
  const sonde_progress report = {report_places, &work};
  sonde_status status = sonde_parallel_run(benches, cores > 1 ? cores - 1 : 1, press_places, &work,
                                           &report, "force of every place", error);
  for (uint32_t i = 0; i < plan->count && !status; ++i)
    plan->point[i].target = plan->point[stand[i]].target;
  return status;
}
