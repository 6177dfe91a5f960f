// Environments side by side: creation, steps on several threads, starts.
#include "batch/environment.h"

#include "base/base.h"
#include "base/maths.h"
#include "base/parallel.h"
#include "sonde/files_scanner.h"

#include <string.h>

enum { MOST_ENVIRONMENTS = 4096 };
static const double ABOVE_M = 0.02; // the skin, where a probe starts

struct sonde_batch {
  sonde_batch_def def;
  sonde_scanner scanner;
  sonde_probe probe;
  sonde_patient *patients;         // [def.patient_count]
  sonde_environment *environments; // [def.count]
  double *pose, *wrench, *vessel, *time_s;
  uint32_t *flags;
  uint8_t *pixels;
  // of the step under way
  const double *actions;
  const uint8_t *mask;
};

const char *sonde_batch_drive_name(sonde_batch_drive drive) {
  static const char *const NAMES[SONDE_BATCH_DRIVES] = {"pose", "twist", "force"};
  SONDE_ASSERT(drive < SONDE_BATCH_DRIVES);
  return NAMES[drive];
}

const char *sonde_batch_vessel_name(uint32_t column) {
#define NAME(name, text) #name,
  static const char *const NAMES[] = {SONDE_BATCH_VESSEL_LIST(NAME)};
#undef NAME
  SONDE_ASSERT(column < SONDE_BATCH_VESSEL);
  return NAMES[column];
}

sonde_batch_def sonde_batch_def_default(void) {
  return (sonde_batch_def){.version = SONDE_DEF_VERSION,
                           .count = 1,
                           .probe = "linear",
                           .drive = SONDE_BATCH_BY_TWIST,
                           .ticks_per_step = 20,
                           .inside = true,
                           .friction = sonde_world_def_default().friction,
                           .speed_m_s = 0.2,
                           .speed_rad_s = 2,
                           .force_limit_n = 40,
                           .admittance_m_s_n = 0.02};
}

static sonde_status open_one(void *user, uint32_t worker, uint32_t item, const atomic_bool *stop,
                             sonde_error *error) {
  sonde_batch *batch = user;
  (void)worker, (void)stop;
  sonde_environment *env = &batch->environments[item];
  return env->subject ? SONDE_OK
                      : sonde_environment_open(
                            env, &batch->patients[item % batch->def.patient_count], error);
}

static sonde_status create_parts(sonde_batch *batch, sonde_error *error) {
  sonde_batch_def *def = &batch->def;
  const size_t n = def->count, picture = (size_t)def->width * def->height;
  batch->patients = SONDE_NEW(sonde_patient, def->patient_count);
  batch->environments = SONDE_NEW(sonde_environment, n);
  batch->pose = SONDE_NEW(double, SONDE_BATCH_POSE *n);
  batch->wrench = SONDE_NEW(double, SONDE_BATCH_WRENCH *n);
  batch->vessel = SONDE_NEW(double, SONDE_BATCH_VESSEL *n);
  batch->time_s = SONDE_NEW(double, n);
  batch->flags = SONDE_NEW(uint32_t, n);
  batch->pixels = picture ? SONDE_NEW(uint8_t, picture * n) : NULL;
  if (!batch->patients || !batch->environments || !batch->pose || !batch->wrench ||
      !batch->vessel || !batch->time_s || !batch->flags || (picture && !batch->pixels))
    return sonde_fail_memory(error);
  for (uint32_t k = 0; k < def->patient_count; ++k) {
    // A probe starts above the first station, else the first site, else the vein's groin end.
    const sonde_case_setup *setup = def->patients[k];
    sonde_pose above = {.rotation = quat_identity()};
    if (setup->map.station_count) {
      above = setup->map.station[0].probe;
    } else if (setup->model->site_count) {
      above = sonde_site_pose(setup->model->sites, 0);
    } else if (setup->map.point_count) {
      above = sonde_vein_pose(&setup->map.point[0], 0);
    }
    above.position = v_madd(above.position, -ABOVE_M, q_rotate(above.rotation, vec3(0, 0, 1)));
    batch->patients[k].setup = setup;
    batch->patients[k].start =
        (sonde_batch_start){above, setup->pathology, 1, 1, 1, batch->scanner.settings};
  }
  for (uint32_t i = 0; i < n; ++i) {
    sonde_environment *env = &batch->environments[i];
    env->def = def, env->probe = &batch->probe;
    env->pose = batch->pose + SONDE_BATCH_POSE * i;
    env->wrench = batch->wrench + SONDE_BATCH_WRENCH * i;
    env->vessel = batch->vessel + SONDE_BATCH_VESSEL * i;
    env->time_s = batch->time_s + i, env->flags = batch->flags + i;
    env->pixels = batch->pixels ? batch->pixels + picture * i : NULL;
  }
  // The first environment of each patient is made alone: the others start from its rest.
  sonde_status status = sonde_probe_create(def->probe, &batch->probe, error);
  uint32_t first = def->patient_count < def->count ? def->patient_count : def->count;
  uint32_t workers = sonde_parallel_workers(def->threads, first);
  if (!status) status = sonde_parallel_run(first, workers, open_one, batch, NULL, "", error);
  workers = sonde_parallel_workers(def->threads, def->count);
  return status ? status
                : sonde_parallel_run(def->count, workers, open_one, batch, NULL, "", error);
}

sonde_status sonde_batch_create(const sonde_batch_def *def, sonde_batch **out, sonde_error *error) {
  SONDE_ASSERT(def != NULL && out != NULL);
  *out = NULL;
  sonde_status status = sonde_def_check("sonde_batch_def", def->version, error);
  if (status) return status;
  if (!def->patients || !def->patient_count)
    return sonde_fail(error, SONDE_ARGUMENT, "batch: no patients");
  const sonde_bounded ranges[] = {{"count", def->count, 1, MOST_ENVIRONMENTS},
                                  {"ticks_per_step", def->ticks_per_step, 1, 1000},
                                  {"drive", (double)def->drive, 0, SONDE_BATCH_DRIVES - 1},
                                  {"width", def->width ? def->width : 16, 16, 4096},
                                  {"height", def->width ? def->height : 16, 16, 4096},
                                  {"speed_m_s", def->speed_m_s, 1e-3, 2},
                                  {"speed_rad_s", def->speed_rad_s, 1e-3, 20},
                                  {"force_limit_n", def->force_limit_n, 0.1, 200},
                                  {"admittance_m_s_n", def->admittance_m_s_n, 1e-4, 0.1}};
  status = sonde_bounded_check(ranges, SONDE_COUNT_OF(ranges), error);
  if (status) return status;
  if (def->width && !def->inside)
    return sonde_fail(error, SONDE_ARGUMENT, "batch: pictures need `inside`");
  for (uint32_t k = 0; k < def->patient_count; ++k)
    if (def->inside && !def->patients[k]->model->femur.face_count)
      return sonde_fail(error, SONDE_MESH, "batch: patient %u has no bone and no vessels", k);
  sonde_batch *batch = SONDE_NEW(sonde_batch, 1);
  if (!batch) return sonde_fail_memory(error);
  batch->def = *def;
  if (!def->width) batch->def.height = 0;
  batch->scanner = def->scanner ? *def->scanner : sonde_scanner_plain();
  batch->def.scanner = def->scanner ? &batch->scanner : NULL;
  status = create_parts(batch, error);
  if (status) {
    sonde_batch_destroy(batch);
    return status;
  }
  *out = batch;
  return SONDE_OK;
}

void sonde_batch_destroy(sonde_batch *batch) {
  if (!batch) return;
  for (uint32_t i = 0; batch->environments && i < batch->def.count; ++i)
    sonde_environment_close(&batch->environments[i]);
  for (uint32_t k = 0; batch->patients && k < batch->def.patient_count; ++k)
    sonde_free(batch->patients[k].rest);
  sonde_probe_clear(&batch->probe);
  void *const parts[] = {batch->patients, batch->environments, batch->pose,  batch->wrench,
                         batch->vessel,   batch->time_s,       batch->flags, batch->pixels};
  for (size_t k = 0; k < SONDE_COUNT_OF(parts); ++k) sonde_free(parts[k]);
  sonde_free(batch);
}

sonde_batch_view sonde_batch_look(const sonde_batch *batch) {
  const sonde_batch_def *def = &batch->def;
  double depth_m = batch->environments[0].now.start.settings.depth_m;
  double width_m = def->width ? depth_m * def->width / def->height : 0;
  return (sonde_batch_view){def->count,
                            def->width,
                            def->height,
                            batch->pose,
                            batch->wrench,
                            batch->vessel,
                            batch->time_s,
                            batch->flags,
                            batch->pixels,
                            width_m,
                            def->width ? depth_m : 0};
}

sonde_batch_start sonde_batch_start_default(const sonde_batch *batch, uint32_t index) {
  SONDE_ASSERT(index < batch->def.count);
  return batch->patients[index % batch->def.patient_count].start;
}

sonde_status sonde_batch_reset(sonde_batch *batch, uint32_t index, const sonde_batch_start *start,
                               sonde_error *error) {
  SONDE_ASSERT(index < batch->def.count);
  return sonde_environment_reset(&batch->environments[index], start, error);
}

static sonde_status step_one(void *user, uint32_t worker, uint32_t item, const atomic_bool *stop,
                             sonde_error *error) {
  sonde_batch *batch = user;
  (void)worker, (void)stop, (void)error;
  if (batch->mask && !batch->mask[item]) return SONDE_OK;
  sonde_environment_step(&batch->environments[item], batch->actions + SONDE_BATCH_ACTION * item,
                         batch->def.ticks_per_step);
  sonde_environment_look(&batch->environments[item]);
  return SONDE_OK;
}

sonde_status sonde_batch_step(sonde_batch *batch, const double *actions, const uint8_t *mask,
                              sonde_error *error) {
  SONDE_ASSERT(actions != NULL);
  batch->actions = actions, batch->mask = mask;
  uint32_t workers = sonde_parallel_workers(batch->def.threads, batch->def.count);
  return sonde_parallel_run(batch->def.count, workers, step_one, batch, NULL, "", error);
}

size_t sonde_batch_size(const sonde_batch *batch, uint32_t index) {
  SONDE_ASSERT(index < batch->def.count);
  return sonde_environment_size(&batch->environments[index]);
}

void sonde_batch_save(const sonde_batch *batch, uint32_t index, void *blob) {
  SONDE_ASSERT(index < batch->def.count && blob != NULL);
  sonde_environment_save(&batch->environments[index], blob);
}

sonde_status sonde_batch_restore(sonde_batch *batch, uint32_t index, const void *blob, size_t bytes,
                                 sonde_error *error) {
  SONDE_ASSERT(index < batch->def.count && blob != NULL);
  return sonde_environment_restore(&batch->environments[index], blob, bytes, error);
}

uint64_t sonde_batch_hash(sonde_batch *batch) {
  uint64_t hash = 0;
  for (uint32_t i = 0; i < batch->def.count; ++i) {
    uint64_t own = sonde_state_hash(batch->environments[i].subject->state);
    hash = sonde_hash(hash, &own, sizeof own);
    hash = sonde_hash(hash, batch->environments[i].pose, SONDE_BATCH_POSE * sizeof(double));
  }
  return hash;
}

const sonde_snapshot *sonde_batch_snapshot(const sonde_batch *batch, uint32_t index) {
  SONDE_ASSERT(index < batch->def.count);
  return &batch->environments[index].now.snapshot;
}
