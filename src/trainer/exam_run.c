// A whole exam without a person: session, operator and judge in lockstep.
// open_session:  a session of the case with the operator's hand, made for speed.
// examine:       ticks until the operator is done.
// conclude:      decisions, score, files.
#include "trainer/trainer.h"

#include "exam/session.h"

// Steps of 4 ms change forces by less than 2 % against 1 ms (docs/trainer.md); 21 looks per second.
static const double STEP_S = 0.004;
enum { TICKS_PER_LOOK = 12, LOOKS_PER_REPORT = 20 };

typedef struct run {
  const sonde_exam_def *def;
  const sonde_case_setup *setup;
  sonde_plan plan;
  sonde_session *session;
  sonde_operator *op;
  sonde_judge *judge;
} run;

sonde_exam_def sonde_exam_def_default(void) {
  return (sonde_exam_def){.operator_name = "expert", .seed = 1, .limit_s = 1200};
}

static sonde_status open_session(run *r, sonde_device *hand, sonde_error *error) {
  static const char *const PROBES[] = {"linear", NULL};
  sonde_session_def def = sonde_session_def_default();
  def.world.dt_s = STEP_S;
  def.world.pcg.absolute_residual = 1e-3 * STEP_S; // 1 mN
  def.probe_names = PROBES;
  def.image_width = def.image_height = 16; // nobody looks at them
  def.ticks_per_image = TICKS_PER_LOOK;
  def.record_path = r->def->record_path;
  def.model_path = r->def->patient->id;
  sonde_case_session(r->setup, &def);
  sonde_status status = sonde_session_create(&def, hand, &r->session, error);
  if (!status && !r->def->solid)
    sonde_interior_set_method(r->session->interior, SONDE_INTERIOR_COLUMNS);
  return status;
}

static sonde_status examine(run *r, const sonde_progress *progress, sonde_error *error) {
  sonde_frame frame;
  for (uint64_t looks = 0; !sonde_operator_done(r->op);) {
    sonde_session_tick(r->session);
    if (!sonde_session_frame(r->session, &frame)) continue;
    double time_s = frame.snapshot.time_s;
    if (!sonde_judge_feed(r->judge, &frame.snapshot)) return sonde_fail_memory(error);
    sonde_operator_see(r->op, &frame.snapshot);
    if (time_s > r->def->limit_s)
      return sonde_fail(error, SONDE_CONVERGENCE, "the %s found no end in %.0f s",
                        r->def->operator_name, r->def->limit_s);
    sonde_metrics m = sonde_judge_metrics(r->judge);
    double share = m.points ? (double)m.points_done / m.points : 0;
    if (++looks % LOOKS_PER_REPORT == 0 &&
        !sonde_progress_report(progress, share, r->def->patient->id))
      return sonde_fail(error, SONDE_CANCELLED, "cancelled at %.0f s", time_s);
  }
  return sonde_judge_finish(r->judge) ? SONDE_OK : sonde_fail_memory(error);
}

static sonde_status conclude(run *r, sonde_score *score, sonde_error *error) {
  for (uint32_t i = 0; i < r->setup->map.segment_count; ++i) {
    if (!sonde_judge_segment(r->judge, i).needed) continue;
    sonde_status status = sonde_judge_decide(r->judge, i, sonde_operator_decision(r->op, i), error);
    if (status) return status;
  }
  sonde_judge_score(r->judge, r->def->patient, score);
  sonde_score_note note = {
      .trainee = r->def->operator_name, .protocol = r->def->protocol->id, .guidance = "exam"};
  return sonde_score_save(r->judge, r->def->patient, score, &note, r->def->json_path,
                          r->def->csv_path, error);
}

static sonde_status prepare(run *r, sonde_device *hand, sonde_error *error) {
  const sonde_case *patient = r->def->patient;
  sonde_status status =
      sonde_plan_make(r->def->protocol, &r->setup->map, &patient->criteria, &r->plan, error);
  if (!status) status = sonde_judge_create(&r->setup->map, &r->plan, &r->judge, error);
  if (!status)
    status = sonde_operator_create(r->def->operator_name, r->def->seed, &r->setup->map, &r->plan,
                                   STEP_S, &r->op, hand, error);
  if (!status) status = open_session(r, hand, error);
  return status;
}

sonde_status sonde_exam_run(const sonde_exam_def *def, const sonde_case_setup *setup,
                            const sonde_progress *progress, sonde_score *score,
                            sonde_error *error) {
  SONDE_ASSERT(def && def->patient && def->protocol && score);
  sonde_case_setup own = {0};
  run r = {.def = def, .setup = setup ? setup : &own};
  sonde_device hand = {0};
  sonde_status status = SONDE_OK;
  if (!setup) status = sonde_case_build(def->patient, def->bundled, def->directory, &own, error);
  if (!status) status = prepare(&r, &hand, error);
  if (!status) status = examine(&r, progress, error);
  if (!status) status = conclude(&r, score, error);
  sonde_status closed = sonde_session_destroy(r.session, status ? NULL : error);
  if (hand.destroy) hand.destroy(hand.self);
  sonde_operator_destroy(r.op);
  sonde_judge_destroy(r.judge);
  sonde_case_setup_clear(&own);
  return status ? status : closed;
}
