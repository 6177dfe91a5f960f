// A whole exam without a person: world, inside, operator and judge in lockstep. No picture is made:
// the operator reads the figures that a session's snapshot holds.
// open_rig:     the thigh, the probe and the inside, made for speed.
// look:         a snapshot; the inside is worked out only under a pressing probe.
// step:         one tick: hand, world.
// examine:      ticks until the operator is done.
// conclude:     decisions, score, files.
#include "exam/vessels.h"
#include "trainer/trainer.h"

// The step of a session: in longer ones the skin under hard presses blows up. 21 looks per second. A
// force beyond FORCE_MAX_N is no hand's: the inside is not asked then.
static const double STEP_S = 0.001, FORCE_MAX_N = 150;
enum { TICKS_PER_LOOK = 48, LOOKS_PER_REPORT = 20 };

typedef struct rig {
  const sonde_exam_def *def;
  const sonde_case_setup *setup;
  sonde_plan plan;
  sonde_probe probe;
  sonde_state *state;
  sonde_interior *interior;
  sonde_device hand;
  sonde_device_sample sample;
  sonde_operator *op;
  sonde_judge *judge;
  uint64_t tick, looked_tick; // of the last look at the inside
  bool looked;
} rig;

sonde_exam_def sonde_exam_def_default(void) {
  return (sonde_exam_def){.operator_name = "expert", .seed = 1, .limit_s = 1200};
}

static sonde_status open_rig(rig *r, sonde_error *error) {
  sonde_world_def world = sonde_session_def_default().world;
  SONDE_ASSERT(world.dt_s == STEP_S); // its residuals belong to it
  const sonde_case *patient = r->def->patient;
  const sonde_vein_map *map = &r->setup->map;
  sonde_status status = sonde_plan_make(r->def->protocol, map, &patient->criteria, &r->plan, error);
  if (!status) status = sonde_judge_create(map, &r->plan, &r->judge, error);
  if (!status)
    status = sonde_operator_create(r->def->operator_name, r->def->seed, map, &r->plan, STEP_S,
                                   &r->op, &r->hand, error);
  if (!status) status = sonde_probe_create("linear", &r->probe, error);
  if (!status) status = sonde_state_create(r->setup->model, &world, &r->state, error);
  if (!status) status = sonde_interior_create(r->setup->model, &r->interior, error);
  if (!status) status = sonde_interior_set_findings(r->interior, &r->setup->findings, error);
  if (!status && !r->def->solid) sonde_interior_set_method(r->interior, SONDE_INTERIOR_COLUMNS);
  return status;
}

static void close_rig(rig *r) {
  sonde_interior_destroy(r->interior);
  sonde_state_destroy(r->state);
  sonde_probe_clear(&r->probe);
  if (r->hand.destroy) r->hand.destroy(r->hand.self);
  sonde_operator_destroy(r->op);
  sonde_judge_destroy(r->judge);
}

static void look_inside(rig *r, sonde_snapshot *s) {
  sonde_pathology pathology = r->setup->pathology;
  sonde_circulation_apply(&r->setup->circulation, r->tick, STEP_S, &pathology);
  sonde_interior_input input = {.positions_m = sonde_state_positions(r->state),
                                .contact_forces_n = sonde_state_contact_forces(r->state),
                                .world_from_probe = s->world_from_probe,
                                .pathology = &pathology,
                                .dt_s =
                                    r->looked ? (double)(r->tick - r->looked_tick) * STEP_S : -1,
                                .tick = r->tick,
                                .face_half_x_m = r->probe.half_x_m,
                                .face_half_y_m = r->probe.half_y_m};
  sonde_interior_update(r->interior, &input);
  r->looked_tick = r->tick;
  r->looked = true;
  sonde_snapshot_read_vessels(r->interior, s);
}

static sonde_snapshot look(rig *r) {
  const double nan_m = (double)NAN;
  const sonde_contact *contact = sonde_state_contact(r->state);
  sonde_pose pose = r->sample.world_from_probe;
  sonde_snapshot s = {.tick = r->tick,
                      .time_s = (double)r->tick * STEP_S,
                      .world_from_probe = pose,
                      .force_n = contact->force_n,
                      .force_normal_n =
                          -v_dot(contact->force_n, q_rotate(pose.rotation, vec3(0, 0, 1))),
                      .penetration_m = nan_m,
                      .vein_area_ratio = nan_m,
                      .artery_area_ratio = nan_m,
                      .other_vein_ratio = nan_m,
                      .vein_short_m = nan_m,
                      .vein_rest_m = {nan_m, nan_m, nan_m},
                      .vein_tilt_rad = nan_m};
  if (s.force_normal_n > 0.5 && s.force_normal_n < FORCE_MAX_N)
    look_inside(r, &s);
  else
    r->looked = false;
  return s;
}

static void step(rig *r) {
  r->hand.read(r->hand.self, r->tick, &r->sample);
  sonde_step(r->state, &r->probe, r->sample.world_from_probe);
  r->tick++;
}

static sonde_status examine(rig *r, const sonde_progress *progress, sonde_error *error) {
  for (uint64_t looks = 0; !sonde_operator_done(r->op);) {
    step(r);
    if (r->tick % TICKS_PER_LOOK != 0) continue;
    sonde_snapshot s = look(r);
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
  if (!status) status = open_rig(&r, error);
  if (!status) status = examine(&r, progress, error);
  if (!status) status = conclude(&r, score, error);
  close_rig(&r);
  sonde_case_setup_clear(&own);
  return status;
}
