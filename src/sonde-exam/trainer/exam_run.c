// A whole exam without a person: world, inside, operator and judge in lockstep. No picture is made:
// the operator reads the figures that a session's snapshot holds.
#include "trainer/bench.h"

// 21 looks per second.
enum { TICKS_PER_LOOK = 48, LOOKS_PER_REPORT = 20 };

sonde_exam_def sonde_exam_def_default(void) {
  return (sonde_exam_def){.operator_name = "expert", .seed = 1, .limit_s = 1200};
}

sonde_status sonde_exam_run(const sonde_exam_def *def, const sonde_case_setup *setup,
                            const sonde_progress *progress, sonde_score *score,
                            sonde_error *error) {
  SONDE_ASSERT(def && def->patient && def->protocol && score);
  sonde_case_setup own = {0};
  sonde_plan plan;
  sonde_bench bench = {0};
  sonde_device hand = {0};
  sonde_operator *op = NULL;
  sonde_judge *judge = NULL;
  sonde_status status = SONDE_OK;

  // The thigh, the plan with its forces, judge, operator and bench.
  if (!setup) status = sonde_case_build(def->patient, def->bundled, def->directory, &own, error);
  if (!setup) setup = &own;
  if (def->plan) plan = *def->plan;
  if (!status && !def->plan) status = sonde_plan_make(def->protocol, &setup->map, &plan, error);
  if (!status && !def->plan) status = sonde_plan_find_targets(&plan, setup, progress, error);
  if (!status) status = sonde_judge_create(&setup->map, &plan, &judge, error);
  if (!status)
    status = sonde_operator_create(def->operator_name, def->seed, &setup->map, &plan, BENCH_STEP_S,
                                   &op, &hand, error);
  // Columns stand on one bone: below the knee of a limb they are far from what closes its veins.
  bool solid = def->solid || setup->map.station_count > 0;
  if (!status) status = sonde_bench_open(&bench, setup, &setup->findings, solid, error);

  // Ticks until the operator is done.
  sonde_device_sample sample = {0};
  for (uint64_t looks = 0; !status && !sonde_operator_done(op);) {
    hand.read(hand.self, bench.tick, &sample);
    sonde_bench_step(&bench, sample.world_from_probe);
    if (bench.tick % TICKS_PER_LOOK != 0) continue;
    sonde_snapshot s = sonde_bench_look(&bench, sample.world_from_probe);
    if (!sonde_judge_feed(judge, &s)) {
      status = sonde_fail_memory(error);
      break;
    }
    sonde_operator_see(op, &s);
    if (s.time_s > def->limit_s) {
      status = sonde_fail(error, SONDE_CONVERGENCE, "the %s found no end in %.0f s",
                          def->operator_name, def->limit_s);
      break;
    }
    if (++looks % LOOKS_PER_REPORT != 0) continue;
    sonde_metrics m = sonde_judge_metrics(judge);
    double share = m.points ? (double)m.points_done / m.points : 0;
    if (!sonde_progress_report(progress, share, def->patient->id))
      status = sonde_fail(error, SONDE_CANCELLED, "cancelled at %.0f s", s.time_s);
  }
  if (!status && !sonde_judge_finish(judge)) status = sonde_fail_memory(error);

  // Findings, score and files.
  for (uint32_t i = 0; !status && i < setup->map.segment_count; ++i)
    if (sonde_judge_segment(judge, i).needed)
      status = sonde_judge_decide(judge, i, sonde_operator_decision(op, i), error);
  if (!status) {
    sonde_score_note note = {
        .trainee = def->operator_name, .protocol = def->protocol->id, .guidance = "exam"};
    sonde_judge_score(judge, def->patient, score);
    SONDE_ASSERT(score->score >= 0 && score->score <= 100 + 1e-9);
    status =
        sonde_score_save(judge, def->patient, score, &note, def->json_path, def->csv_path, error);
  }
  sonde_bench_close(&bench);
  if (hand.destroy) hand.destroy(hand.self);
  sonde_operator_destroy(op);
  sonde_judge_destroy(judge);
  sonde_case_setup_clear(&own);
  return status;
}
