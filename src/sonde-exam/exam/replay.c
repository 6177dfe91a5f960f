// Playing a recording again: the recorded inputs drive the world in lockstep.
#include "exam/record.h"
#include "exam/subject.h"

#include "base/base.h"

#include <string.h>

static void destroy_probes(sonde_probe *probes, uint32_t count) {
  for (uint32_t i = 0; probes && i < count; ++i) sonde_probe_clear(&probes[i]);
  sonde_free(probes);
}

sonde_status sonde_recording_probes(const sonde_recording *recording, const char *path,
                                    sonde_probe *probes, sonde_error *error) {
  for (uint32_t i = 0; i < recording->probe_count; ++i) {
    const char *name = recording->probe_names[i];
    sonde_status status = sonde_probe_create(name, &probes[i], error);
    if (status) return status;
    if (sonde_probe_hash(&probes[i]) != recording->probe_hashes[i])
      return sonde_fail(error, SONDE_MISMATCH,
                        "%s: the probe \"%s\" has another shape than when it was recorded", path,
                        name);
  }
  return SONDE_OK;
}

sonde_status sonde_recording_fits(const sonde_recording *recording, const char *path,
                                  const sonde_model *model, sonde_error *error) {
  if (recording->model_checksum == model->checksum) return SONDE_OK;
  return sonde_fail(error, SONDE_MISMATCH,
                    "%s: recorded on the model %s (checksum %016llx), this one is %s (%016llx)",
                    path, recording->model_name, (unsigned long long)recording->model_checksum,
                    model->name, (unsigned long long)model->checksum);
}

// A state hash on the way; those of images are the player's.
static void compare(const sonde_record_check *check, sonde_state *state,
                    sonde_replay_result *result) {
  if (check->kind != SONDE_CHECK_STATE || check->tick != sonde_state_tick(state)) return;
  result->checks++;
  if (result->different_tick || sonde_state_hash(state) == check->hash) return;
  result->different_tick = check->tick;
}

// The checks of a tick come some records behind it: `ahead` reads on to find them in time.
typedef struct ahead {
  sonde_recording at;
  sonde_record_check check;
  bool any;
} ahead;

static void next_check(ahead *a) {
  sonde_record record;
  a->any = false;
  while (!a->any && sonde_recording_next(&a->at, &record)) {
    a->any = record.tag == SONDE_RECORD_CHECK && record.check.kind == SONDE_CHECK_STATE;
    a->check = record.check;
  }
}

static sonde_status play(sonde_recording *recording, const sonde_probe *probes,
                         sonde_subject *subject, const sonde_progress *progress,
                         sonde_replay_result *result, sonde_error *error) {
  uint32_t probe = 0;
  uint64_t ticks = recording->told.ticks;
  sonde_record record;
  ahead a = {.at = *recording};
  next_check(&a);
  while (sonde_recording_next(recording, &record)) {
    if (record.tag == SONDE_RECORD_CONTROLS) {
      probe = record.controls.probe;
      sonde_subject_control(subject, &record.controls);
    }
    if (record.tag != SONDE_RECORD_TICK) continue;
    SONDE_ASSERT(probe < recording->probe_count && sonde_state_tick(subject->state) == record.tick);
    sonde_subject_step(subject, &probes[probe], record.sample.world_from_probe);
    for (; a.any && a.check.tick <= record.tick + 1; next_check(&a))
      compare(&a.check, subject->state, result);
    double fraction = (double)(record.tick + 1) / (double)ticks;
    if (record.tick % 256 == 255 && !sonde_progress_report(progress, fraction, "replay"))
      return sonde_fail(error, SONDE_CANCELLED, "the replay was cancelled after %llu of %llu ticks",
                        (unsigned long long)record.tick + 1, (unsigned long long)ticks);
  }
  return SONDE_OK;
}

sonde_status sonde_replay_run(const char *path, const sonde_model *model,
                              const sonde_progress *progress, sonde_replay_result *result,
                              sonde_error *error) {
  SONDE_ASSERT(model != NULL && result != NULL);
  *result = (sonde_replay_result){0};
  sonde_recording recording;
  sonde_probe *probes = NULL;
  sonde_subject *subject = NULL;
  sonde_status status = sonde_recording_load(path, false, &recording, error);
  if (status) return status;
  uint32_t probe_count = recording.probe_count;
  status = sonde_recording_fits(&recording, path, model, error);
  if (!status && !(probes = SONDE_NEW(sonde_probe, probe_count))) status = sonde_fail_memory(error);
  if (!status) status = sonde_recording_probes(&recording, path, probes, error);
  sonde_session_controls first = sonde_session_def_default().controls; // the first record has them
  if (!status)
    status =
        sonde_subject_create(&recording.setup, model, &recording.world, &first, &subject, error);
  if (!status) status = play(&recording, probes, subject, progress, result, error);
  if (subject) {
    result->ticks = sonde_state_tick(subject->state);
    result->recorded_hash = recording.told.hash;
    result->hash = sonde_state_hash(subject->state);
    result->images = recording.told.images;
    result->recorded_image_hash = recording.told.image_hash;
    result->same = !status && result->hash == result->recorded_hash && !result->different_tick;
  }
  memcpy(result->model_path, recording.model_path, sizeof result->model_path);
  sonde_subject_destroy(subject);
  destroy_probes(probes, probe_count);
  sonde_recording_clear(&recording);
  return status;
}

sonde_status sonde_recording_inspect(const char *path, bool recover, sonde_recording_info *info,
                                     sonde_error *error) {
  SONDE_ASSERT(path != NULL && info != NULL);
  sonde_recording recording;
  *info = (sonde_recording_info){0};
  sonde_status status = sonde_recording_load(path, recover, &recording, error);
  if (status) return status;
  sonde_recording_describe(&recording, info);
  sonde_recording_clear(&recording);
  return SONDE_OK;
}

void sonde_recording_describe(const sonde_recording *r, sonde_recording_info *info) {
  uint64_t made = r->told.ticks / r->ticks_per_image;
  *info = (sonde_recording_info){.version = r->version,
                                 .model_checksum = r->model_checksum,
                                 .dt_s = r->world.dt_s,
                                 .duration_s = (double)r->told.ticks * r->world.dt_s,
                                 .ticks = r->told.ticks,
                                 .images = r->version < 4 ? made : r->told.images,
                                 .image_width = r->image_width,
                                 .image_height = r->image_height,
                                 .ended = r->ended};
  snprintf(info->model_path, sizeof info->model_path, "%s", r->model_path);
  snprintf(info->model_name, sizeof info->model_name, "%s", r->model_name);
}

sonde_status sonde_replay_inspect(const char *path, char *model_path, size_t size,
                                  uint64_t *model_checksum, sonde_error *error) {
  sonde_recording recording;
  sonde_status status = sonde_recording_load(path, false, &recording, error);
  if (status) return status;
  if (model_path && size) snprintf(model_path, size, "%s", recording.model_path);
  if (model_checksum) *model_checksum = recording.model_checksum;
  sonde_recording_clear(&recording);
  return SONDE_OK;
}
