// A thigh under a probe without a session.
#include "trainer/bench.h"

#include "exam/vessels.h"
#include "interior/interior.h"

// A force beyond this is no hand's: the inside is not asked then. A lighter touch than the other
// does not move it.
static const double FORCE_MAX_N = 150, TOUCH_N = 0.5;

sonde_status sonde_bench_open(sonde_bench *bench, const sonde_case_setup *setup,
                              const sonde_findings *findings, bool solid, sonde_error *error) {
  sonde_world_def world = sonde_session_def_default().world;
  SONDE_ASSERT(world.dt_s == BENCH_STEP_S); // its residuals belong to it
  *bench = (sonde_bench){.circulation = setup->circulation, .pathology = setup->pathology};
  sonde_status status = sonde_probe_create("linear", &bench->probe, error);
  if (!status) status = sonde_state_create(setup->model, &world, &bench->state, error);
  if (!status) status = sonde_interior_create(setup->model, &bench->interior, error);
  if (!status) status = sonde_interior_set_findings(bench->interior, findings, error);
  if (!status && !solid) sonde_interior_set_method(bench->interior, SONDE_INTERIOR_COLUMNS);
  if (!status) sonde_interior_for_vessels(bench->interior, true);
  if (!status) sonde_interior_wait(bench->interior, true);
  return status;
}

void sonde_bench_close(sonde_bench *bench) {
  sonde_interior_destroy(bench->interior);
  sonde_state_destroy(bench->state);
  sonde_probe_clear(&bench->probe);
}

void sonde_bench_rest(sonde_bench *bench) {
  sonde_state_reset(bench->state);
  bench->tick = bench->looked_tick = 0;
  bench->looked = false;
}

void sonde_bench_step(sonde_bench *bench, sonde_pose probe) {
  sonde_step(bench->state, &bench->probe, probe);
  bench->tick++;
}

sonde_snapshot sonde_bench_look(sonde_bench *bench, sonde_pose probe) {
  SONDE_ASSERT(bench->looked_tick <= bench->tick);
  sonde_snapshot s = sonde_snapshot_of(bench->state, probe);
  bool pressing = s.force_normal_n > TOUCH_N && s.force_normal_n < FORCE_MAX_N;
  sonde_pathology pathology = bench->pathology;
  sonde_circulation_apply(&bench->circulation, bench->tick, BENCH_STEP_S, &pathology);
  s.venous_pressure_pa = pathology.venous_pressure_pa;
  s.arterial_pressure_pa = pathology.arterial_pressure_pa;
  if (pressing) { // vessels at the image plane
    double since_s = (double)(bench->tick - bench->looked_tick) * BENCH_STEP_S;
    sonde_interior_input input = {.positions_m = sonde_state_positions(bench->state),
                                  .contact_forces_n = sonde_state_contact_forces(bench->state),
                                  .world_from_probe = probe,
                                  .pathology = &pathology,
                                  .dt_s = bench->looked ? since_s : -1,
                                  .tick = bench->tick,
                                  .face_half_x_m = bench->probe.half_x_m,
                                  .face_half_y_m = bench->probe.half_y_m,
                                  .posture = bench->circulation.posture};
    sonde_interior_update(bench->interior, &input);
    bench->looked_tick = bench->tick;
    sonde_snapshot_read_vessels(bench->interior, &s);
  }
  bench->looked = pressing;
  return s;
}
