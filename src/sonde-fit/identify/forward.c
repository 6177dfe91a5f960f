// A motion driven over the model, the skin settled before it begins.
#include "identify/forward.h"

#include "base/maths.h"

sonde_status sonde_drive_create(const sonde_model *model, uint32_t site, const char *probe,
                                char axis, uint32_t count, sonde_drive *drive, sonde_error *error) {
  *drive = (sonde_drive){.count = count};
  drive->site = sonde_model_site(model, site);
  if (!drive->site)
    return sonde_fail(error, SONDE_NOT_FOUND, "no site %u, the model %s has %u sites", site,
                      model->name, model->site_count);
  if (axis != 'u' && axis != 'v')
    return sonde_fail(error, SONDE_ARGUMENT, "axis is '%c', expected u or v", axis);
  drive->axis = axis == 'u' ? drive->site->u : drive->site->v;
  sonde_status status = sonde_probe_create(probe, &drive->probe, error);
  if (status) return status;
  drive->time_s = SONDE_NEW(double, count);
  if (drive->time_s) return SONDE_OK;
  sonde_drive_clear(drive);
  return sonde_fail_memory(error);
}

void sonde_drive_clear(sonde_drive *drive) {
  sonde_probe_clear(&drive->probe);
  sonde_track_clear(&drive->penetration);
  sonde_track_clear(&drive->slide);
  sonde_free(drive->time_s);
  *drive = (sonde_drive){0};
}

sonde_status sonde_drive_from_record(const sonde_model *model, const sonde_motion_record *record,
                                     sonde_drive *drive, sonde_error *error) {
  const sonde_motion_sample *s = record->samples;
  const size_t stride = sizeof *s / sizeof(double);
  _Static_assert(sizeof *s % sizeof(double) == 0, "samples are walked as numbers");
  *drive = (sonde_drive){0};
  if (record->site == UINT32_MAX || !record->probe[0])
    return sonde_fail(error, SONDE_ARGUMENT, "the record does not say its %s",
                      record->probe[0] ? "site" : "probe");
  sonde_status status = sonde_drive_create(model, record->site, record->probe, record->axis,
                                           record->count, drive, error);
  if (status) return status;
  status = sonde_track_fit(&s->time_s, &s->penetration_m, stride, record->count,
                           &drive->penetration, error);
  if (!status)
    status = sonde_track_fit(&s->time_s, &s->slide_m, stride, record->count, &drive->slide, error);
  for (uint32_t k = 0; k < record->count; ++k) drive->time_s[k] = s[k].time_s;
  if (status) sonde_drive_clear(drive);
  return status;
}

sonde_pose sonde_drive_pose(const sonde_drive *drive, double time_s) {
  const sonde_site *site = drive->site;
  sonde_vec3 z = v_neg(site->normal), x = site->u, y = v_cross(z, x);
  sonde_vec3 p =
      v_madd(site->position_m, -sonde_track_at(&drive->penetration, time_s), site->normal);
  p = v_madd(p, sonde_track_at(&drive->slide, time_s), drive->axis);
  return (sonde_pose){p, q_from_matrix(m_columns(x, y, z))};
}

typedef struct reading {
  double time_s, normal_n, tangential_n;
} reading;

static reading read_sensors(const sonde_drive *drive, const sonde_state *state, double time_s) {
  sonde_vec3 f = sonde_state_contact(state)->force_n;
  return (reading){time_s, v_dot(f, drive->site->normal), -v_dot(f, drive->axis)};
}

static sonde_status run(const sonde_drive *drive, sonde_state *state, const atomic_bool *stop,
                        const sonde_progress *progress, double *normal_n, double *tangential_n,
                        sonde_error *error) {
  double h = sonde_state_def(state)->dt_s, first = drive->time_s[0];
  double length = drive->time_s[drive->count - 1] - first;
  // A probe that begins inside the skin settles from above, 2 mm at a time.
  double depth = sonde_track_at(&drive->penetration, first);
  for (double above = depth - 2e-3, last = INFINITY; depth > 0 && last > 0; above -= 2e-3) {
    sonde_pose on_the_way = sonde_drive_pose(drive, first);
    on_the_way.position = v_madd(on_the_way.position, fmax(above, 0), drive->site->normal);
    sonde_settle(state, &drive->probe, on_the_way, 1e-6, 200);
    last = above;
  }
  sonde_step(state, &drive->probe, sonde_drive_pose(drive, first));
  reading before = read_sensors(drive, state, first), now = before;
  uint32_t next = 0;
  for (uint64_t tick = 1; next < drive->count; ++tick) {
    while (next < drive->count && drive->time_s[next] <= now.time_s + 1e-9 * h) {
      double span = now.time_s - before.time_s;
      double share = span > 0 ? (drive->time_s[next] - before.time_s) / span : 1;
      normal_n[next] = before.normal_n + share * (now.normal_n - before.normal_n);
      tangential_n[next] = before.tangential_n + share * (now.tangential_n - before.tangential_n);
      ++next;
    }
    before = now;
    double time_s = first + (double)tick * h;
    sonde_step(state, &drive->probe, sonde_drive_pose(drive, time_s));
    now = read_sensors(drive, state, time_s);
    if (sonde_state_flags(state) & SONDE_FLAG_NON_FINITE)
      return sonde_fail(error, SONDE_CONVERGENCE, "site %u: the motion diverged at %g s",
                        drive->site->id, time_s);
    if (tick % 64 == 0 &&
        ((stop && atomic_load(stop)) ||
         (progress && !sonde_progress_report(progress, (time_s - first) / length, "moving"))))
      return sonde_fail(error, SONDE_CANCELLED, "cancelled");
  }
  return SONDE_OK;
}

sonde_status sonde_drive_run(const sonde_drive *drive, const sonde_model *model,
                             const sonde_world_def *def, const atomic_bool *stop,
                             const sonde_progress *progress, double *normal_n, double *tangential_n,
                             sonde_error *error) {
  SONDE_ASSERT(drive->count > 1 && drive->penetration.count > 0 && drive->slide.count > 0);
  sonde_state *state = NULL;
  sonde_status status = sonde_state_create(model, def, &state, error);
  if (!status) status = run(drive, state, stop, progress, normal_n, tangential_n, error);
  sonde_state_destroy(state);
  return status;
}

sonde_status sonde_model_borrow(const sonde_model *model, double stiffness_scale, sonde_model *copy,
                                sonde_error *error) {
  SONDE_ASSERT(stiffness_scale > 0);
  *copy = *model;
  sonde_law_scale(&copy->law, stiffness_scale);
  copy->k0_n_m3 = SONDE_NEW(double, model->surface.vertex_count);
  if (!copy->k0_n_m3) return sonde_fail_memory(error);
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i)
    copy->k0_n_m3[i] = stiffness_scale * model->k0_n_m3[i];
  return SONDE_OK;
}

void sonde_model_return(sonde_model *copy) {
  sonde_free(copy->k0_n_m3);
  *copy = (sonde_model){0};
}
