// Life of a session.
#include "exam/keyframes.h"

#include "base/base.h"
#include "base/maths.h"
#include "echo/lines.h"
#include "haptics/motion.h"
#include "haptics/ranges.h"

sonde_session_def sonde_session_def_default(void) {
  sonde_session_def def = {.world = sonde_world_def_default(),
                           .limits = sonde_safety_limits_default(),
                           .rendering = sonde_render_def_default(),
                           .circulation = sonde_circulation_default(),
                           .image_width = 512,
                           .image_height = 512,
                           .ticks_per_image = 20};
  def.controls.echo = sonde_echo_settings_default();
  def.controls.duplex = sonde_duplex_controls_default();
  def.controls.stiffness_scale = def.controls.damping_scale = def.controls.friction_scale = 1;
  sonde_status status = sonde_pathology_preset("healthy", &def.controls.pathology, NULL);
  SONDE_ASSERT(status == SONDE_OK);
  return def;
}

static const char *const *probe_names(const sonde_session_def *def) {
  return def->probe_names ? def->probe_names : sonde_probe_names();
}

// Offset of the next array in a mailbox slot.
static size_t place(size_t *end, size_t bytes) {
  size_t at = (*end + SONDE_MAILBOX_ALIGN - 1) / SONDE_MAILBOX_ALIGN * SONDE_MAILBOX_ALIGN;
  *end = at + bytes;
  return at;
}

static sonde_status create_parts(sonde_session *session, const sonde_session_def *def,
                                 sonde_error *error) {
  const char *const *names = probe_names(def);
  uint32_t count = 0, samples;
  while (names[count]) count++;
  session->probes = SONDE_NEW(sonde_probe, count);
  sonde_status status = session->probes ? SONDE_OK : sonde_fail_memory(error);
  for (; session->probe_count < count && !status; session->probe_count += !status)
    status = sonde_probe_create(names[session->probe_count], &session->probes[session->probe_count],
                                error);
  bool inside = def->model->femur.face_count > 0; // else forces only
  if (!status && !inside && def->findings)
    return sonde_fail(error, SONDE_MESH, "the model has no bone and no vessels for findings");
  if (!status && inside) status = sonde_interior_create(def->model, &session->interior, error);
  if (!status && inside)
    status = sonde_interior_set_findings(session->interior, def->findings, error);
  sonde_echo_def image = sonde_echo_def_default();
  image.scanner = def->scanner, image.rolling = def->scanner != NULL;
  if (!status && inside)
    status = sonde_echo_create(session->interior, &image, &session->echo, error);
  for (uint32_t i = 0; i < count && !status && session->scanner.radius_m > 0; ++i)
    status = sonde_echo_check_view(sight_aperture(&session->scanner, session->probes[i].half_x_m),
                                   session->scanner.radius_m, error);
  if (!status && inside)
    status =
        sonde_duplex_create(def->model, session->interior, session->echo, &session->duplex, error);
  if (!status) {
    size_t vectors = session->nodes * sizeof(sonde_vec3);
    size_t surface_end = sizeof(sonde_surface_slot), frame_end = sizeof(sonde_frame);
    session->positions_at = place(&surface_end, vectors);
    session->forces_at = place(&surface_end, vectors);
    session->film_at = place(&surface_end, session->nodes * sizeof(double));
    session->solid_at =
        place(&surface_end, def->solid ? SONDE_LEG_NODES_MOST * sizeof(sonde_vec3) : 0);
    session->skin_at = place(&frame_end, 3 * session->nodes * sizeof(float));
    session->pixels_at = place(&frame_end, (size_t)session->image_width * session->image_height);
    session->colour_at = place(&frame_end, (size_t)session->image_width * session->image_height);
    session->spectrum_at = place(&frame_end, SONDE_GATE_COLUMNS * sizeof(sonde_gate_column));
    status = sonde_mailbox_create(sizeof(sonde_session_controls), &session->control_box, error);
    if (!status) status = sonde_mailbox_create(surface_end, &session->surface_box, error);
    if (!status) status = sonde_mailbox_create(frame_end, &session->frame_box, error);
  }
  // One coupling of the gel per line of the image.
  if (session->echo) sonde_echo_envelope(session->echo, &session->lines, &samples);
  session->line_m = SONDE_NEW(sonde_vec3, session->lines);
  session->line_coupling = SONDE_NEW(float, session->lines);
  session->touched = SONDE_NEW(uint32_t, session->nodes);
  if (!status && !(session->line_m && session->line_coupling && session->touched))
    status = sonde_fail_memory(error);
  if (status) return status;
  session->controls =
      sonde_controls_clean(&def->controls, &session->controls, session->probe_count);
  sonde_setup setup = sonde_setup_of(def);
  status = sonde_subject_create(&setup, def->model, &def->world, &session->controls,
                                &session->subject, error);
  if (status) return status;
  session->state = session->subject->state;
  if (def->solid) {
    status = sonde_subject_give_solid(session->subject, session->interior, session->probes, count,
                                      error);
    session->solid_skin_m = SONDE_NEW(sonde_vec3, session->nodes);
    session->solid_pushes = SONDE_NEW(sonde_vec3, session->nodes);
    if (!status && !(session->solid_skin_m && session->solid_pushes))
      status = sonde_fail_memory(error);
    if (status) return status;
  }
  sonde_shared_controls_set(&session->requested, &session->controls);
  if (session->controls.stop) sonde_safety_trip(&session->safety, SONDE_FAULT_STOPPED);
  return sonde_session_create_recording(session, def, names, error);
}

static void release(sonde_session *session) {
  sonde_session_release_recording(session);
  sonde_mailbox_destroy(session->control_box);
  sonde_mailbox_destroy(session->surface_box);
  sonde_mailbox_destroy(session->frame_box);
  sonde_duplex_destroy(session->duplex);
  sonde_echo_destroy(session->echo);
  sonde_interior_destroy(session->interior);
  sonde_leg_place_give_back(session->place);
  sonde_subject_destroy(session->subject);
  sonde_free(session->solid_skin_m);
  sonde_free(session->solid_pushes);
  sonde_free(session->line_m);
  sonde_free(session->line_coupling);
  sonde_free(session->touched);
  for (uint32_t i = 0; i < session->probe_count; ++i) sonde_probe_clear(&session->probes[i]);
  sonde_free(session->probes);
  sonde_free(session);
}

sonde_status sonde_session_create(const sonde_session_def *def, sonde_device *device,
                                  sonde_session **out, sonde_error *error) {
  SONDE_ASSERT(def != NULL && out != NULL);
  *out = NULL;
  uint32_t probes = 0;
  while (probe_names(def)[probes]) probes++;
  if (!def->model) return sonde_fail(error, SONDE_ARGUMENT, "session: no model");
  if (!device || !device->read || !device->write)
    return sonde_fail(error, SONDE_ARGUMENT, "session: no device");
  if (def->controls.probe >= probes)
    return sonde_fail(error, SONDE_ARGUMENT, "session: probe %u of %u, expected less",
                      def->controls.probe, probes);
  if (def->image_width < 16 || def->image_width > 4096 || def->image_height < 16 ||
      def->image_height > 4096)
    return sonde_fail(error, SONDE_ARGUMENT, "session: image of %u x %u, expected 16 to 4096 each",
                      def->image_width, def->image_height);
  if (def->ticks_per_image == 0)
    return sonde_fail(error, SONDE_ARGUMENT, "session: 0 ticks per image, expected 1 or more");
  sonde_status status = sonde_hand_check(&def->limits, &def->rendering, error);
  if (status) return status;
  // The patient: pulse and breath, gel, tissue.
  const sonde_circulation *c = &def->circulation;
  const double numbers[] = {c->heart_rate_hz,  c->systolic_pa,     c->diastolic_pa,
                            c->breath_rate_hz, c->valsalva_from_s, c->valsalva_to_s,
                            c->breath_pa,      c->valsalva_pa};
  for (size_t i = 0; i < SONDE_COUNT_OF(numbers); ++i)
    if (!isfinite(numbers[i]))
      return sonde_fail(error, SONDE_ARGUMENT, "session: a circulation with a number that is none");
  if (!(c->valve_leak >= 0 && c->valve_leak <= 1))
    return sonde_fail(error, SONDE_ARGUMENT, "session: valves that leak %g, expected 0 to 1",
                      c->valve_leak);
  if (!(def->gel_m3 >= 0 && def->gel_m3 <= 1e-3))
    return sonde_fail(error, SONDE_ARGUMENT, "session: %g m^3 of gel, expected 0 to 0.001",
                      def->gel_m3);
  if (def->preset_count > SONDE_SESSION_PRESETS)
    return sonde_fail(error, SONDE_ARGUMENT, "session: %u presets, expected at most %d",
                      def->preset_count, SONDE_SESSION_PRESETS);
  for (uint32_t i = 0; i < def->preset_count && !status; ++i)
    status = sonde_preset_apply(&def->presets[i], NULL, NULL, error);
  if (status) return status;
  sonde_session *session = SONDE_NEW(sonde_session, 1);
  if (!session) return sonde_fail_memory(error);
  pthread_mutex_init(&session->note_lock, NULL);
  session->watch = def->watch;
  session->watch_user = def->watch_user;
  session->model = def->model;
  session->nodes = def->model->surface.vertex_count;
  session->dt_s = def->world.dt_s;
  session->ticks_per_image = def->ticks_per_image;
  session->keyframe_period = (uint64_t)ceil(SONDE_KEYFRAME_PERIOD_S / session->dt_s);
  session->keyframe_tick = session->keyframe_period;
  session->image_width = def->image_width;
  session->image_height = def->image_height;
  session->sample.world_from_probe.rotation = quat_identity();
  session->controls = sonde_session_def_default().controls;
  session->has_findings = def->findings != NULL;
  if (def->findings) session->findings = *def->findings;
  if (def->scanner) session->scanner = *def->scanner;
  sonde_safety_init(&session->safety, &def->limits);
  sonde_render_def rendering = def->rendering;
  rendering.dt_s = session->dt_s;
  sonde_render_init(&session->render, &rendering);
  status = create_parts(session, def, error);
  if (status) {
    release(session);
    return status;
  }
  session->device = *device;
  *device = (sonde_device){0};
  *out = session;
  return SONDE_OK;
}

sonde_status sonde_session_destroy(sonde_session *session, sonde_error *error) {
  if (!session) return SONDE_OK;
  sonde_session_stop(session);
  sonde_status status = SONDE_OK;
  if (sonde_session_ticks(session) > 0 || session->setup_stored)
    status = sonde_session_finish(session, error);
  if (session->device.destroy) session->device.destroy(session->device.self);
  release(session);
  return status;
}

void sonde_session_control(sonde_session *session, const sonde_session_controls *controls) {
  SONDE_ASSERT(controls != NULL);
  sonde_session_controls before = sonde_shared_controls_get(&session->requested);
  sonde_session_controls clean = sonde_controls_clean(controls, &before, session->probe_count);
  *(sonde_session_controls *)sonde_mailbox_write_slot(session->control_box) = clean;
  sonde_mailbox_publish(session->control_box);
  if (clean.stop) atomic_store_explicit(&session->stop_pressed, true, memory_order_release);
  sonde_shared_controls_set(&session->requested, &clean);
}

sonde_session_controls sonde_session_controls_now(const sonde_session *session) {
  return sonde_shared_controls_get(&session->requested);
}

sonde_device *sonde_session_device(sonde_session *session) { return &session->device; }

const sonde_probe *sonde_session_probe(const sonde_session *session, uint32_t index) {
  SONDE_ASSERT(index < session->probe_count);
  return &session->probes[index];
}

sonde_fault sonde_session_fault(const sonde_session *session) {
  return (sonde_fault)atomic_load_explicit(&session->fault, memory_order_relaxed);
}

uint64_t sonde_session_ticks(const sonde_session *session) {
  return atomic_load_explicit(&session->ticks, memory_order_acquire);
}

uint64_t sonde_session_images(const sonde_session *session) {
  return atomic_load_explicit(&session->images, memory_order_acquire);
}

uint64_t sonde_session_hash(sonde_session *session) {
  return atomic_load(&session->loop) ? 0 : sonde_subject_hash(session->subject);
}
