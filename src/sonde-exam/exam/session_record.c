// What a session keeps of itself: records, keyframes and notes to their files, and the end.
#include "exam/keyframes.h"

#include "base/base.h"

#include <string.h>

enum { RING_RECORDS = 8192, RING_CHECKS = 256 }; // 8 s of ticks while the recorder does not come

// On the way from the owner to the recorder.
struct sonde_queued_note {
  sonde_queued_note *next;
  sonde_note_kind kind;
  uint64_t tick;
  char text[];
};

// The first controls and the setup are on the disk before the first tick.
sonde_status sonde_session_create_recording(sonde_session *session, const sonde_session_def *def,
                                            const char *const *probe_names, sonde_error *error) {
  if (!def->record_path) return SONDE_OK;
  size_t world_bytes = sizeof(sonde_world_slot) + sonde_subject_size(session->subject);
  sonde_status status =
      sonde_ring_create(sizeof(sonde_record), RING_RECORDS, &session->records, error);
  if (!status)
    status =
        sonde_ring_create(sizeof(sonde_record_check), RING_CHECKS, &session->image_checks, error);
  if (!status) status = sonde_mailbox_create(world_bytes, &session->world_box, error);
  if (!status)
    status = sonde_mailbox_create(sizeof(sonde_inside_slot), &session->inside_box, error);
  if (status) return status;
  sonde_record_head head = {.model_path = def->model_path,
                            .model_name = def->model->name,
                            .model_checksum = def->model->checksum,
                            .world = *sonde_state_def(session->state),
                            .setup = session->subject->setup,
                            .image_width = session->image_width,
                            .image_height = session->image_height,
                            .ticks_per_image = session->ticks_per_image,
                            .probe_count = session->probe_count,
                            .probes = session->probes,
                            .probe_names = probe_names};
  status = sonde_recorder_create(def->record_path, &head, &session->recorder, error);
  if (status) return status;
  sonde_record first = {.tag = SONDE_RECORD_CONTROLS};
  first.controls = session->controls;
  sonde_recorder_write(session->recorder, &first);
  if (def->record_setup) {
    sonde_recorder_note(session->recorder, SONDE_NOTE_SETUP, 0, def->record_setup);
    status = sonde_recorder_sync(session->recorder, error);
    session->setup_stored = !status;
  }
  if (!status) {
    if (!(!sonde_recorder_is_file(session->recorder))) {
      char *path = sonde_keyframes_path(def->record_path);
      if (path)
        (void)sonde_keyframe_writer_create(path, session->subject, &session->keyframes, NULL);
      sonde_free(path);
    }
  }
  return status;
}

// ---- on the way to the files ------------------------------------------------------------------

static void write_records(sonde_session *session) {
  sonde_record record;
  while (sonde_ring_pop(session->records, &record))
    sonde_recorder_write(session->recorder, &record);
}

static void write_check(sonde_session *session, const sonde_record_check *check) {
  sonde_record record = {.tag = SONDE_RECORD_CHECK, .tick = check->tick};
  record.check = *check;
  sonde_recorder_write(session->recorder, &record);
}

static sonde_queued_note *take_notes(sonde_session *session) {
  pthread_mutex_lock(&session->note_lock);
  sonde_queued_note *first = session->notes;
  session->notes = NULL;
  pthread_mutex_unlock(&session->note_lock);
  return first;
}

// Hashes and notes come behind the records of their ticks: what is seen before the ring is emptied
// has its records in it.
void sonde_session_drain(sonde_session *session) {
  if (!session->recorder) return;
  sonde_queued_note *notes = take_notes(session);
  const void *world_part = sonde_mailbox_read(session->world_box);
  const void *inside_part = sonde_mailbox_read(session->inside_box);
  sonde_record_check check;
  bool checked = sonde_ring_pop(session->image_checks, &check);
  write_records(session);
  if (world_part) session->world_part = world_part;
  if (inside_part) session->inside_part = inside_part;
  // A keyframe is written when the world and the inside of the same image are there; a newer one
  // may overtake either.
  const sonde_world_slot *world = session->world_part;
  const sonde_inside_slot *inside = session->inside_part;
  if (world && inside && world->tick == inside->tick) {
    sonde_keyframe key = {.tick = world->tick,
                          .inputs = &world->memory,
                          .inside = &inside->memory,
                          .world = world + 1,
                          .world_bytes = world->bytes};
    if (session->keyframes) sonde_keyframe_writer_add(session->keyframes, &key);
    write_check(session,
                &(sonde_record_check){SONDE_CHECK_STATE, world->tick,
                                      sonde_subject_saved_hash(session->subject, world + 1)});
    session->world_part = NULL, session->inside_part = NULL;
  }
  for (; checked; checked = sonde_ring_pop(session->image_checks, &check)) {
    write_records(session);
    write_check(session, &check);
  }
  for (sonde_queued_note *note = notes, *next; note; note = next) {
    next = note->next;
    sonde_recorder_note(session->recorder, note->kind, note->tick, note->text);
    sonde_free(note);
  }
  // A disk that is full has no room for keyframes, which a player can make again.
  sonde_recorder_retry(session->recorder);
  if (!session->keyframes || !sonde_recorder_look(session->recorder).trouble) return;
  sonde_keyframe_writer_discard(session->keyframes);
  session->keyframes = NULL;
}

// ---- the interface ----------------------------------------------------------------------------

sonde_status sonde_session_note(sonde_session *session, sonde_note_kind kind, uint64_t tick,
                                const char *text, sonde_error *error) {
  SONDE_ASSERT(session && text && kind >= SONDE_NOTE_SETUP && kind <= SONDE_NOTE_WORKSHEET);
  if (!session->recorder) return SONDE_OK;
  size_t bytes = strlen(text) + 1;
  if (bytes > SONDE_NOTE_MOST_BYTES)
    return sonde_fail(error, SONDE_ARGUMENT, "a note of %zu bytes, expected at most %d", bytes,
                      SONDE_NOTE_MOST_BYTES);
  sonde_queued_note *note = sonde_calloc(1, sizeof *note + bytes);
  if (!note) return sonde_fail_memory(error);
  note->kind = kind, note->tick = tick;
  memcpy(note->text, text, bytes);
  pthread_mutex_lock(&session->note_lock);
  sonde_queued_note **last = &session->notes;
  while (*last) last = &(*last)->next;
  *last = note;
  pthread_mutex_unlock(&session->note_lock);
  return SONDE_OK;
}

sonde_status sonde_session_finish(sonde_session *session, sonde_error *error) {
  sonde_session_stop(session);
  if (!session->recorder) return SONDE_OK;
  if (!session->ended) {
    session->end = (sonde_record_end){.hash = sonde_subject_hash(session->subject),
                                      .lost = atomic_load(&session->lost_records),
                                      .image_hash = session->images_hash};
    sonde_recorder_end(session->recorder, &session->end);
    session->ended = true;
  }
  sonde_session_drain(session); // notes that came after a first attempt
  sonde_status status = sonde_recorder_sync(session->recorder, error);
  if (status) return status;
  if (session->keyframes && !session->end.lost)
    (void)sonde_keyframe_writer_commit(session->keyframes, session->end.crc, NULL);
  else
    sonde_keyframe_writer_discard(session->keyframes);
  session->keyframes = NULL;
  sonde_recorder_close(session->recorder);
  session->recorder = NULL;
  if (!session->end.lost) return SONDE_OK;
  return sonde_fail(error, SONDE_DISK,
                    "the disk was full or too slow: the recording lacks %llu records and can be "
                    "played up to there only",
                    (unsigned long long)session->end.lost);
}

sonde_recording_state sonde_session_recording(const sonde_session *session) {
  sonde_recording_state state = {.finished = session->ended && !session->recorder,
                                 .lossy = session->end.lost > 0};
  if (!session->recorder) return state;
  sonde_recorder_state writing = sonde_recorder_look(session->recorder);
  uint64_t ticks = sonde_session_ticks(session);
  state.recording = true;
  state.notes = writing.safe_notes;
  state.in_trouble = writing.trouble != 0;
  state.lossy = writing.lost > 0 || atomic_load(&session->lost_records) > 0;
  if (!state.in_trouble) return state;
  char words[sizeof state.reason];
  snprintf(state.reason, sizeof state.reason, "%s",
           strerror_r(writing.trouble, words, sizeof words));
  state.unwritten_s = session->dt_s * (double)(ticks - writing.safe_ticks);
  return state;
}

void sonde_session_release_recording(sonde_session *session) {
  if (sonde_session_ticks(session) == 0 && !session->setup_stored)
    sonde_recorder_discard(session->recorder);
  else
    sonde_recorder_close(session->recorder);
  sonde_keyframe_writer_discard(session->keyframes);
  for (sonde_queued_note *note = take_notes(session), *next; note; note = next) {
    next = note->next;
    sonde_free(note);
  }
  sonde_ring_destroy(session->records);
  sonde_ring_destroy(session->image_checks);
  sonde_mailbox_destroy(session->world_box);
  sonde_mailbox_destroy(session->inside_box);
  pthread_mutex_destroy(&session->note_lock);
}
