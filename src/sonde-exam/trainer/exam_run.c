// A whole exam without a person: world, inside, operator and judge in lockstep. No picture is made:
// the operator reads the figures that a session's snapshot holds.
#include "trainer/bench.h"

// 21 looks per second.
enum { TICKS_PER_LOOK = 48, LOOKS_PER_REPORT = 20 };

sonde_exam_def sonde_exam_def_default(void) {
  return (sonde_exam_def){.operator_name = "expert", .seed = 1, .limit_s = 1200};
}

// What an exam without a person moves.
typedef struct exam_hands {
  const sonde_exam_setups *setups;
  uint32_t held;
  bool solid;
  sonde_bench bench;
  sonde_device hand;
  sonde_operator *op;
  sonde_judge *judge;
} exam_hands;

// The patient turns as the operator wants: another model under another hand, while breath and
// strain go on.
static sonde_status turn_patient(exam_hands *e, sonde_error *error) {
  e->held = sonde_operator_wants(e->op);
  SONDE_ASSERT(e->held < e->setups->count);
  const sonde_case_setup *setup = &e->setups->held[e->held];
  const double before_s = sonde_judge_state(e->judge).time_s;
  if (!sonde_judge_hold(e->judge, e->held, &setup->map)) return sonde_fail_memory(error);
  sonde_bench_close(&e->bench);
  sonde_status status = sonde_bench_open(&e->bench, setup, &setup->findings, e->solid, error);
  e->bench.circulation.valsalva_from_s -= before_s;
  e->bench.circulation.valsalva_to_s -= before_s;
  if (e->hand.destroy) e->hand.destroy(e->hand.self);
  e->hand = (sonde_device){0};
  if (!status)
    status = sonde_operator_hold(e->op, e->held, &setup->map, BENCH_STEP_S, &e->hand, error);
  return status;
}

sonde_status sonde_exam_run(const sonde_exam_def *def, const sonde_exam_setups *setups,
                            const sonde_progress *progress, sonde_score *score,
                            sonde_error *error) {
  SONDE_ASSERT(def && def->patient && def->protocol && score);
  sonde_exam_setups own = {.count = 0};
  sonde_plan plan;
  exam_hands e = {.setups = setups ? setups : &own};
  sonde_status status = SONDE_OK;

  // The thigh, the plan with its forces, judge, operator and bench.
  if (!setups)
    status = sonde_exam_prepare(def->patient, def->protocol, def->bundled, def->directory, progress,
                                &own, &plan, error);
  const sonde_case_setup *first = &e.setups->held[0];
  if (setups && def->plan) plan = *def->plan;
  if (setups && !def->plan) status = sonde_plan_make(def->protocol, &first->map, &plan, error);
  if (setups && !def->plan && !status)
    status = sonde_plan_find_targets(&plan, first, progress, error);
  if (!status) status = sonde_judge_create(&first->map, &plan, &e.judge, error);
  if (!status)
    status = sonde_operator_create(def->operator_name, def->seed, &first->map, &plan, BENCH_STEP_S,
                                   &e.op, &e.hand, error);
  // Columns stand on one bone: below the knee of a limb they are far from what closes its veins.
  e.solid = def->solid || (!status && first->map.station_count > 0);
  if (!status) status = sonde_bench_open(&e.bench, first, &first->findings, e.solid, error);

  // Ticks until the operator is done.
  sonde_device_sample sample = {0};
  for (uint64_t looks = 0; !status && !sonde_operator_done(e.op);) {
    if (sonde_operator_wants(e.op) != e.held) status = turn_patient(&e, error);
    if (status) break;
    e.hand.read(e.hand.self, e.bench.tick, &sample);
    sonde_bench_step(&e.bench, sample.world_from_probe);
    if (e.bench.tick % TICKS_PER_LOOK != 0) continue;
    sonde_snapshot s = sonde_bench_look(&e.bench, sample.world_from_probe);
    if (!sonde_judge_feed(e.judge, &s)) {
      status = sonde_fail_memory(error);
      break;
    }
    sonde_operator_see(e.op, &s);
    const double time_s = sonde_judge_state(e.judge).time_s;
    if (time_s > def->limit_s) {
      status = sonde_fail(error, SONDE_CONVERGENCE, "the %s found no end in %.0f s",
                          def->operator_name, def->limit_s);
      break;
    }
    if (++looks % LOOKS_PER_REPORT != 0) continue;
    sonde_metrics m = sonde_judge_metrics(e.judge);
    double share = m.points ? (double)m.points_done / m.points : 0;
    if (!sonde_progress_report(progress, share, def->patient->id))
      status = sonde_fail(error, SONDE_CANCELLED, "cancelled at %.0f s", time_s);
  }
  if (!status && !sonde_judge_finish(e.judge)) status = sonde_fail_memory(error);

  // Findings, score and files.
  for (uint32_t i = 0; !status && i < first->map.segment_count; ++i)
    if (sonde_judge_segment(e.judge, i).needed)
      status = sonde_judge_decide(e.judge, i, sonde_operator_decision(e.op, i), error);
  if (!status) {
    sonde_score_note note = {
        .trainee = def->operator_name, .protocol = def->protocol->id, .guidance = "exam"};
    sonde_judge_score(e.judge, def->patient, score);
    SONDE_ASSERT(score->score >= 0 && score->score <= 100 + 1e-9);
    status = sonde_score_save(e.judge, def->patient, score, &note, NULL, NULL, def->json_path,
                              def->csv_path, error);
  }
  sonde_bench_close(&e.bench);
  if (e.hand.destroy) e.hand.destroy(e.hand.self);
  sonde_operator_destroy(e.op);
  sonde_judge_destroy(e.judge);
  sonde_exam_setups_clear(&own);
  return status;
}
