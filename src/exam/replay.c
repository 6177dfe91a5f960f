// Playing a recording again: the recorded inputs drive the world in lockstep.
// create_probes: the recorded probes, checked to have the recorded shape.
// play:          all records.
#include "exam/record.h"
#include "exam/subject.h"

#include "base/base.h"

#include <string.h>

static void destroy_probes(sonde_probe *probes, uint32_t count) {
  for (uint32_t i = 0; probes && i < count; ++i) sonde_probe_clear(&probes[i]);
  sonde_free(probes);
}

static sonde_status create_probes(const char *path, const sonde_recording *recording,
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

static sonde_status check_model(const char *path, const sonde_recording *recording,
                                const sonde_model *model, sonde_error *error) {
  if (recording->model_checksum == model->checksum) return SONDE_OK;
  return sonde_fail(error, SONDE_MISMATCH,
                    "%s: recorded on the model %s (checksum %016llx), this one is %s (%016llx)",
                    path, recording->model_name, (unsigned long long)recording->model_checksum,
                    model->name, (unsigned long long)model->checksum);
}

static sonde_status play(sonde_recording *recording, const sonde_probe *probes,
                         sonde_subject *subject, const sonde_progress *progress,
                         sonde_error *error) {
  uint32_t probe = 0;
  sonde_record record;
  while (sonde_recording_next(recording, &record)) {
    if (record.tag == SONDE_RECORD_CONTROLS) {
      probe = record.controls.probe;
      sonde_subject_control(subject, &record.controls);
      continue;
    }
    SONDE_ASSERT(probe < recording->probe_count && sonde_state_tick(subject->state) == record.tick);
    sonde_subject_step(subject, &probes[probe], record.sample.world_from_probe);
    double fraction = (double)(record.tick + 1) / (double)recording->ticks;
    if (record.tick % 256 == 255 && !sonde_progress_report(progress, fraction, "replay"))
      return sonde_fail(error, SONDE_CANCELLED, "the replay was cancelled after %llu of %llu ticks",
                        (unsigned long long)record.tick + 1, (unsigned long long)recording->ticks);
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
  sonde_status status = sonde_recording_load(path, &recording, error);
  if (status) return status;
  uint32_t probe_count = recording.probe_count;
  status = check_model(path, &recording, model, error);
  if (!status && !(probes = SONDE_NEW(sonde_probe, probe_count))) status = sonde_fail_memory(error);
  if (!status) status = create_probes(path, &recording, probes, error);
  sonde_session_controls first = sonde_session_def_default().controls; // the first record has them
  if (!status)
    status =
        sonde_subject_create(&recording.setup, model, &recording.world, &first, &subject, error);
  if (!status) status = play(&recording, probes, subject, progress, error);
  if (subject) {
    *result = (sonde_replay_result){.ticks = sonde_state_tick(subject->state),
                                    .recorded_hash = recording.hash,
                                    .hash = sonde_state_hash(subject->state)};
    result->same = !status && result->hash == result->recorded_hash;
  }
  memcpy(result->model_path, recording.model_path, sizeof result->model_path);
  sonde_subject_destroy(subject);
  destroy_probes(probes, probe_count);
  sonde_recording_clear(&recording);
  return status;
}

sonde_status sonde_replay_inspect(const char *path, char *model_path, size_t size,
                                  uint64_t *model_checksum, sonde_error *error) {
  sonde_recording recording;
  sonde_status status = sonde_recording_load(path, &recording, error);
  if (status) return status;
  if (model_path && size) snprintf(model_path, size, "%s", recording.model_path);
  if (model_checksum) *model_checksum = recording.model_checksum;
  sonde_recording_clear(&recording);
  return SONDE_OK;
}
