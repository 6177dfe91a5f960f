// The frames of one leg: presses that settle at rising forces, and all that is known at each.
#include "base/maths.h"
#include "dataset/dataset.h"
#include "sonde/limb_model.h"
#include "sonde/world_path.h"

#include <string.h>

static const double REACH_M = 0.07;  // from the start of a press
static const double RESIDUAL = 1e-6; // of the force, unbalanced at the end
// Longest step of a press; a press in steps of 1 mm ends at the same force within 0.3 % of its way.
static const double STEP_M = 2e-3;
static const double PROBE_M = 0.25e-3; // to either side, for the gradient of the displacement
static const double TICK_S = 1e-3;     // of heart and breath

// Everything that the frames of a leg share.
typedef struct leg {
  const sonde_dataset_def *def;
  uint32_t number;
  sonde_case patient;
  sonde_case_setup setup;
  sonde_probe probe;
  sonde_state *state;
  sonde_interior *interior;
  sonde_image image;
  uint8_t *clot;
  float *strain;
} leg;

static bool has(const leg *l, int array) { return l->def->plan->arrays >> array & 1; }

// Tells what is done; CANCELLED when nobody waits for it.
static sonde_status go_on(const sonde_dataset_def *def, double share, const char *what,
                          sonde_error *error) {
  return sonde_progress_report(def->progress, share, what)
             ? SONDE_OK
             : sonde_fail(error, SONDE_CANCELLED, "stopped; whole legs are kept");
}

void sonde_dataset_strain(const sonde_interior *interior, sonde_pose probe,
                          const sonde_truth *truth, float *strain) {
  SONDE_ASSERT(interior && truth && strain);
  static const bool NONE[SONDE_LABEL_COUNT] = {[SONDE_LABEL_OUTSIDE] = true,
                                               [SONDE_LABEL_BONE] = true,
                                               [SONDE_LABEL_VEIN] = true,
                                               [SONDE_LABEL_ARTERY] = true};
  static const int PAIR[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
  const sonde_mat3 axes = q_matrix(probe.rotation), local = m_transpose(axes);
  const size_t pixels = (size_t)truth->width * truth->height;
  for (size_t i = 0; i < pixels; ++i) {
    float *e = strain + 6 * i;
    for (int k = 0; k < 6; ++k) e[k] = NAN;
    if (NONE[truth->tissue[i]]) continue;
    const float *p = truth->place_m[i], *u = truth->displacement_m[i];
    const sonde_vec3 rest =
        pose_apply(probe, vec3((double)p[0] - (double)u[0], (double)p[1] - (double)u[1],
                               (double)p[2] - (double)u[2]));
    // Row k of the gradient is the derivative along the probe's axis k. Outside and in bone nothing
    // moves: there the difference is one-sided.
    double h[3][3];
    for (int k = 0; k < 3; ++k) {
      sonde_vec3 end[2], moved[2];
      for (int side = 0; side < 2; ++side) {
        end[side] = v_madd(rest, side ? PROBE_M : -PROBE_M, m_column(&axes, k));
        moved[side] = sonde_interior_displacement(interior, end[side]);
        if (v_norm2(moved[side]) > 0 || !NONE[sonde_interior_label(interior, end[side], NULL)])
          continue;
        end[side] = rest;
        moved[side] = sonde_interior_displacement(interior, rest);
      }
      const double apart = v_distance(end[0], end[1]);
      const sonde_vec3 d = m_mul_v(local, v_sub(moved[1], moved[0]));
      for (int j = 0; j < 3; ++j) h[k][j] = apart > 0 ? v_coordinate(d, j) / apart : (double)NAN;
    }
    for (int k = 0; k < 6; ++k) {
      const int a = PAIR[k][0], b = PAIR[k][1];
      double square = 0; // of F^T F - 1 beyond the sum of both slopes
      for (int j = 0; j < 3; ++j) square += h[a][j] * h[b][j];
      e[k] = (float)(0.5 * (h[a][b] + h[b][a] + square));
    }
  }
}

static void see_vessels(const leg *l, const sonde_echo *echo, sonde_dataset_moment *m) {
  const uint32_t count = sonde_interior_vessel_count(l->interior);
  const sonde_thigh_anatomy *anatomy = l->setup.model->anatomy;
  const sonde_vec3 normal = q_rotate(m->pose.rotation, vec3(0, 1, 0));
  m->vessel_count = 0;
  for (uint32_t k = 0; k < count && m->vessel_count < SONDE_COUNT_OF(m->vessel); ++k) {
    sonde_dataset_vessel *v = &m->vessel[m->vessel_count];
    *v = (sonde_dataset_vessel){.number = k + 1};
    if (!sonde_interior_vessel_at_plane(l->interior, (int)k, m->pose, &v->state)) continue;
    v->name = sonde_interior_vessel_name(l->interior, (int)k);
    v->artery = k == 1 || (k > 1 && anatomy && anatomy->branch[k - 2].kind == SONDE_VESSEL_ARTERY);
    v->tilt_rad = acos(fmin(1, fabs(v_dot(v->state.axis, normal))));
    const sonde_vec3 drawn = sonde_truth_drawn(echo, v->state.centre_m);
    v->x_m = drawn.x, v->z_m = drawn.z;
    for (size_t i = 0; i < (size_t)m->truth->width * m->truth->height; ++i) {
      if (m->truth->vessel[i] != v->number) continue;
      const uint8_t tissue = m->truth->tissue[i];
      v->clot += tissue == SONDE_LABEL_THROMBUS;
      v->lumen += tissue == (v->artery ? SONDE_LABEL_ARTERY : SONDE_LABEL_VEIN);
    }
    ++m->vessel_count;
  }
}

// The picture and the arrays of a settled state, into the store.
static sonde_status draw_frame(leg *l, sonde_echo *echo, sonde_dataset_moment *m,
                               sonde_dataset_store *store, sonde_dataset_tally *tally,
                               sonde_error *error) {
  const sonde_dataset_press *press = m->press;
  const uint64_t tick = (uint64_t)(press->at_s / TICK_S);
  m->pathology = l->setup.pathology;
  sonde_circulation_apply(&l->setup.circulation, tick, TICK_S, &m->pathology);
  sonde_interior_update(
      l->interior, &(sonde_interior_input){.positions_m = sonde_state_positions(l->state),
                                           .contact_forces_n = sonde_state_contact_forces(l->state),
                                           .world_from_probe = m->pose,
                                           .pathology = &m->pathology,
                                           .dt_s = -1,
                                           .tick = tick,
                                           .face_half_x_m = l->probe.half_x_m,
                                           .face_half_y_m = l->probe.half_y_m,
                                           .posture = l->setup.circulation.posture});
  sonde_echo_render(echo, m->pose, press->aperture_m, &m->pathology, &press->scanner.settings,
                    &l->image);
  sonde_truth truth = {0};
  sonde_status status = sonde_truth_create(echo, &l->image, &truth, error);
  if (status) return status;
  const size_t pixels = (size_t)truth.width * truth.height;
  m->truth = &truth;
  bool clot = false;
  for (size_t i = 0; i < pixels; ++i) {
    l->clot[i] = truth.tissue[i] == SONDE_LABEL_THROMBUS ? 255 : 0;
    ++tally->pixels[truth.tissue[i]];
    clot = clot || l->clot[i];
  }
  if (has(l, SONDE_DATASET_strain)) sonde_dataset_strain(l->interior, m->pose, &truth, l->strain);
  const float *envelope = sonde_echo_envelope(echo, &m->lines, &m->samples);
  see_vessels(l, echo, m);
  const bool there = m->vessel_count > 0 && m->vessel[0].number == 1;
  const double ratio = there ? m->vessel[0].state.area_ratio : 1;
  ++tally->closure[there ? (int)fmin(9, fmax(0, 10 * ratio)) : 10];
  ++tally->frames;
  tally->clots += clot;
  const void *data[SONDE_DATASET_ARRAYS] = {
      [SONDE_DATASET_clot] = l->clot,       [SONDE_DATASET_displacement] = truth.displacement_m,
      [SONDE_DATASET_envelope] = envelope,  [SONDE_DATASET_image] = l->image.pixels,
      [SONDE_DATASET_strain] = l->strain,   [SONDE_DATASET_tissue] = truth.tissue,
      [SONDE_DATASET_vessel] = truth.vessel};
  static const uint32_t SHAPE[SONDE_DATASET_ARRAYS][2] = {
#define SHAPE_OF(name, bytes, parts, text) {bytes, parts},
      SONDE_DATASET_ARRAY_LIST(SHAPE_OF)
#undef SHAPE_OF
  };
  sonde_dataset_frame frame = {0};
  snprintf(frame.key, sizeof frame.key, "%06u_%02u_%02u", m->leg % 1000000, m->press_number % 100,
           m->frame % 100);
  for (int k = 0; k < SONDE_DATASET_ARRAYS; ++k) {
    const bool lines = k == SONDE_DATASET_envelope;
    frame.array[k] = (sonde_dataset_array){.data = has(l, k) ? data[k] : NULL,
                                           .bytes = SHAPE[k][0],
                                           .parts = SHAPE[k][1],
                                           .rows = lines ? m->samples : truth.height,
                                           .columns = lines ? m->lines : truth.width};
  }
  char *json = NULL;
  status = sonde_dataset_describe(m, &json, &frame.json_bytes, error);
  frame.json = json;
  if (!status) status = sonde_dataset_store_put(store, &frame, error);
  sonde_free(json);
  sonde_truth_clear(&truth);
  return status;
}

// A press from rest: each frame settles at a force that is a constant times that of the one before.
static sonde_status do_press(leg *l, uint32_t number, sonde_dataset_store *store,
                             sonde_dataset_tally *tally, double from, double to,
                             sonde_error *error) {
  const sonde_dataset_plan *plan = l->def->plan;
  sonde_dataset_press press;
  sonde_status status = sonde_dataset_draw_press(l->def, l->number, number, &l->setup,
                                                 l->probe.half_x_m, &press, error);
  if (status) return status;
  sonde_echo_def drawing = sonde_echo_def_default();
  drawing.seed = sonde_dataset_key(plan->seed, l->number, 0, SONDE_DATASET_FOR_SPECKLE);
  drawing.scanner = &press.scanner;
  sonde_echo_flow flow = sonde_echo_flow_default();
  flow.t_s = press.at_s, flow.circulation = l->setup.circulation;
  sonde_echo *echo = NULL;
  status = sonde_echo_create(l->interior, &drawing, &echo, error);
  if (!status) sonde_echo_set_flow(echo, &flow);
  sonde_state_reset(l->state);
  const sonde_vec3 axis = q_rotate(press.start.rotation, vec3(0, 0, 1));
  sonde_pose at = press.start, far = at;
  far.position = v_madd(at.position, REACH_M, axis);
  sonde_dataset_moment m = {.leg = l->number,
                            .press_number = number,
                            .patient = &l->patient,
                            .setup = &l->setup,
                            .press = &press};
  sonde_vec3 first_m = at.position;
  for (m.frame = 0; m.frame < plan->frames && !status; ++m.frame) {
    const double share = plan->frames > 1 ? (double)m.frame / (plan->frames - 1) : 1;
    sonde_path_def way = sonde_path_def_default();
    way.relative_residual = RESIDUAL;
    way.step_m = STEP_M;
    way.force_n = plan->contact_n * pow(press.force_n / plan->contact_n, share);
    status =
        go_on(l->def, from + (to - from) * m.frame / plan->frames, "pressing and drawing", error);
    sonde_path_result path;
    if (!status) status = sonde_settle_path(l->state, &l->probe, at, far, &way, NULL, &path, error);
    if (status == SONDE_CONVERGENCE) { // the press ends here, the leg goes on
      ++tally->stopped;
      status = SONDE_OK;
      break;
    }
    if (status) break;
    at = m.pose = path.pose;
    if (m.frame == 0) first_m = at.position;
    m.way_m = m.frame > 0 ? v_dot(v_sub(at.position, first_m), axis) : 0;
    m.force_n = path.force_n, m.residual = path.settled.residual, m.jumps += path.jump_count;
    const sonde_contact *contact = sonde_state_contact(l->state);
    const sonde_quat back = q_conj(at.rotation);
    const sonde_vec3 force = q_rotate(back, contact->force_n),
                     torque = q_rotate(back, contact->torque_n_m);
    for (int k = 0; k < 3; ++k)
      m.force[k] = v_coordinate(force, k), m.torque[k] = v_coordinate(torque, k);
    status = draw_frame(l, echo, &m, store, tally, error);
  }
  sonde_echo_destroy(echo);
  return status;
}

sonde_status sonde_dataset_make_leg(const sonde_dataset_def *def, uint32_t number,
                                    sonde_dataset_store *store, sonde_dataset_tally *tally,
                                    double share_from, double share_to, sonde_error *error) {
  SONDE_ASSERT(def && store && tally);
  const sonde_dataset_plan *plan = def->plan;
  leg l = {.def = def, .number = number};
  *tally = (sonde_dataset_tally){0};
  sonde_world_def world = sonde_world_def_default();
  world.engine = SONDE_ENGINE_DOUBLE; // nothing but equilibria
  sonde_status status = go_on(def, share_from, "making a leg", error);
  if (status) return status;
  const size_t pixels = (size_t)plan->width * plan->height;
  l.clot = SONDE_NEW(uint8_t, pixels);
  l.strain = SONDE_NEW(float, 6 * pixels);
  status = l.clot && l.strain ? SONDE_OK : sonde_fail_memory(error);
  if (!status)
    status = sonde_dataset_draw_leg(plan, number, def->bundled, &l.patient, &l.setup, error);
  if (!status) status = sonde_probe_create("linear", &l.probe, error);
  if (!status) status = sonde_state_create(l.setup.model, &world, &l.state, error);
  if (!status) status = sonde_interior_create(l.setup.model, &l.interior, error);
  if (!status) status = sonde_interior_set_findings(l.interior, &l.setup.findings, error);
  if (!status) status = sonde_image_create(plan->width, plan->height, &l.image, error);
  for (uint32_t k = 0; k < plan->presses && !status; ++k) {
    const double step = (share_to - share_from) / plan->presses;
    status =
        do_press(&l, k, store, tally, share_from + k * step, share_from + (k + 1) * step, error);
  }
  sonde_image_clear(&l.image);
  sonde_interior_destroy(l.interior);
  sonde_state_destroy(l.state);
  sonde_probe_clear(&l.probe);
  sonde_case_setup_clear(&l.setup);
  sonde_free(l.strain);
  sonde_free(l.clot);
  return status;
}
