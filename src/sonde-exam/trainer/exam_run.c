// A whole exam without a person: world, inside, operator and judge in lockstep. No picture is made:
// the operator reads the figures that a session's snapshot holds.
// open_rig:     the plan with its forces, the thigh, the probe, operator and judge.
// step:         one tick: hand, world.
// examine:      ticks until the operator is done.
// conclude:     decisions, score, files.
#include "trainer/bench.h"

// 21 looks per second.
enum { TICKS_PER_LOOK = 48, LOOKS_PER_REPORT = 20 };

typedef struct rig {
  const sonde_exam_def *def;
  const sonde_case_setup *setup;
  sonde_plan plan;
  sonde_bench bench;
  sonde_device hand;
  sonde_device_sample sample;
  sonde_operator *op;
  sonde_judge *judge;
} rig;

sonde_exam_def sonde_exam_def_default(void) {
  return (sonde_exam_def){.operator_name = "expert", .seed = 1, .limit_s = 1200};
}

static sonde_status make_plan(rig *r, const sonde_progress *progress, sonde_error *error) {
  if (r->def->plan) {
    r->plan = *r->def->plan;
    return SONDE_OK;
  }
  sonde_status status = sonde_plan_make(r->def->protocol, &r->setup->map, &r->plan, error);
  return status ? status : sonde_plan_find_targets(&r->plan, r->setup, progress, error);
}

static sonde_status open_rig(rig *r, const sonde_progress *progress, sonde_error *error) {
  const sonde_vein_map *map = &r->setup->map;
  sonde_status status = make_plan(r, progress, error);
  if (!status) status = sonde_judge_create(map, &r->plan, &r->judge, error);
  if (!status)
    status = sonde_operator_create(r->def->operator_name, r->def->seed, map, &r->plan, BENCH_STEP_S,
                                   &r->op, &r->hand, error);
  if (!status)
    status = sonde_bench_open(&r->bench, r->setup, &r->setup->findings, r->def->solid, error);
  return status;
}

static void close_rig(rig *r) {
  sonde_bench_close(&r->bench);
  if (r->hand.destroy) r->hand.destroy(r->hand.self);
  sonde_operator_destroy(r->op);
  sonde_judge_destroy(r->judge);
}

static void step(rig *r) {
  r->hand.read(r->hand.self, r->bench.tick, &r->sample);
  sonde_bench_step(&r->bench, r->sample.world_from_probe);
}

static sonde_status examine(rig *r, const sonde_progress *progress, sonde_error *error) {
  for (uint64_t looks = 0; !sonde_operator_done(r->op);) {
    step(r);
    if (r->bench.tick % TICKS_PER_LOOK != 0) continue;
    sonde_snapshot s = sonde_bench_look(&r->bench, r->sample.world_from_probe);
    if (!sonde_judge_feed(r->judge, &s)) return sonde_fail_memory(error);
    sonde_operator_see(r->op, &s);
    if (s.time_s > r->def->limit_s)
      return sonde_fail(error, SONDE_CONVERGENCE, "the %s found no end in %.0f s",
                        r->def->operator_name, r->def->limit_s);
    if (++looks % LOOKS_PER_REPORT != 0) continue;
    sonde_metrics m = sonde_judge_metrics(r->judge);
    double share = m.points ? (double)m.points_done / m.points : 0;
    if (!sonde_progress_report(progress, share, r->def->patient->id))
      return sonde_fail(error, SONDE_CANCELLED, "cancelled at %.0f s", s.time_s);
  }
  return sonde_judge_finish(r->judge) ? SONDE_OK : sonde_fail_memory(error);
}

static sonde_status conclude(rig *r, sonde_score *score, sonde_error *error) {
  for (uint32_t i = 0; i < r->setup->map.segment_count; ++i) {
    if (!sonde_judge_segment(r->judge, i).needed) continue;
    sonde_decision decision = sonde_operator_decision(r->op, i);
    sonde_status status = sonde_judge_decide(r->judge, i, decision, error);
    if (status) return status;
  }
  sonde_judge_score(r->judge, r->def->patient, score);
  sonde_score_note note = {
      .trainee = r->def->operator_name, .protocol = r->def->protocol->id, .guidance = "exam"};
  return sonde_score_save(r->judge, r->def->patient, score, &note, r->def->json_path,
                          r->def->csv_path, error);
}

sonde_status sonde_exam_run(const sonde_exam_def *def, const sonde_case_setup *setup,
                            const sonde_progress *progress, sonde_score *score,
                            sonde_error *error) {
  SONDE_ASSERT(def && def->patient && def->protocol && score);
  sonde_case_setup own = {0};
  rig r = {.def = def, .setup = setup ? setup : &own};
  sonde_status status = SONDE_OK;
  if (!setup) status = sonde_case_build(def->patient, def->bundled, def->directory, &own, error);
  if (!status) status = open_rig(&r, progress, error);
  if (!status) status = examine(&r, progress, error);
  if (!status) status = conclude(&r, score, error);
  close_rig(&r);
  sonde_case_setup_clear(&own);
  return status;
}
