// The force of each place: what closes a healthy vein there.
#include "trainer/bench.h"

// The probe starts above the skin and presses as a careful hand does, looked at 40 times a second.
static const double LIFT_M = 0.002, SPEED_M_S = 0.012, DEEPEST_M = 0.060, FORCE_MOST_N = 60;
enum { TICKS_PER_LOOK = 25 };
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

// Presses healthy veins: at a station those of all its places. @return the force at which the area
// passes `closed_ratio` of that at rest, between two looks; NaN: it never does
static double find_closing_force(sonde_bench *bench, const sonde_plan *plan,
                                 const sonde_vein_map *map, uint32_t place) {
  const sonde_vein_point *at = &plan->point[place].at;
  const double closed_ratio = plan->criteria.closed_ratio;
  double depth_m = -LIFT_M, before_n = 0, before = 1;
  while (depth_m < DEEPEST_M) {
    sonde_pose pose = sonde_vein_pose(at, depth_m);
    for (int k = 0; k < TICKS_PER_LOOK; ++k) {
      depth_m += SPEED_M_S * BENCH_STEP_S;
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

sonde_status sonde_plan_find_targets(sonde_plan *plan, const sonde_case_setup *setup,
                                     const sonde_progress *progress, sonde_error *error) {
  SONDE_ASSERT(plan && setup && setup->model);
  sonde_status status = SONDE_OK;
  sonde_findings findings = {.oedema = setup->findings.oedema};
  for (uint32_t i = 0; i < plan->count && !status; ++i) {
    sonde_plan_point *point = &plan->point[i];
    sonde_case_setup healthy = setup[point->held];
    healthy.circulation.breath_pa = 0;
    healthy.circulation.valsalva_from_s = healthy.circulation.valsalva_to_s = 0;
    status = sonde_pathology_preset("healthy", &healthy.pathology, error);
    if (status) return status;
    if (!sonde_progress_report(progress, (double)i / plan->count, point->title))
      return sonde_fail(error, SONDE_CANCELLED, "cancelled");
    uint32_t known = 0;
    while (known < i && !sonde_same_stand(&plan->point[known], point)) ++known;
    point->target = plan->point[known].target;
    if (known < i) continue;
    sonde_bench bench;
    status = sonde_bench_open(&bench, &healthy, &findings, true, error);
    double closes_n = status ? 0 : find_closing_force(&bench, plan, &healthy.map, i);
    sonde_bench_close(&bench);
    if (status) return status;
    if (!isfinite(closes_n))
      return sonde_fail(
          error, SONDE_MISMATCH,
          "'%s': a healthy vein of this thigh, %.0f mm below the skin, does not close "
          "at %.0f N; compression decides nothing there",
          point->title, 1e3 * point->at.depth_m, FORCE_MOST_N);
    point->target = sonde_force_target_make(closes_n);
  }
  return status;
}
