// Writing a recording: a text header, records, blocks that close off what came before.
#include "exam/record.h"

#include "base/base.h"
#include "base/clock.h"
#include "base/disk.h"
#include "base/bytes.h"

#include <math.h>
#include <stdatomic.h>
#include <string.h>
#include <zlib.h>

struct sonde_recorder {
  sonde_journal *journal;
  uLong crc;
  uint64_t ticks, images, block_ticks;
  double synced_s;
  bool broken; // an input is missing
  uint32_t notes;
  char path[SONDE_RECORD_PATH_BYTES];
  atomic_int trouble;
  _Atomic uint64_t safe_ticks, lost;
  atomic_uint safe_notes;
};

static bool emit(sonde_recorder *recorder, const void *bytes, size_t count, bool important) {
  if (!sonde_journal_append(recorder->journal, bytes, count, important)) return false;
  recorder->crc = crc32_z(recorder->crc, bytes, count);
  return true;
}

void sonde_record_put_block(unsigned char *bytes, uint32_t crc, uint64_t ticks) {
  bytes_cursor w = {bytes, 16, 0};
  bytes_u32(&w, SONDE_RECORD_BLOCK);
  bytes_u32(&w, crc);
  bytes_u64(&w, ticks);
  SONDE_ASSERT(bytes_fit(&w));
}

size_t sonde_record_put_note(unsigned char *bytes, sonde_note_kind kind, uint64_t tick,
                             size_t text_bytes) {
  SONDE_ASSERT(text_bytes <= SONDE_NOTE_MOST_BYTES);
  bytes_cursor w = {bytes, 24, 0};
  bytes_u32(&w, SONDE_RECORD_NOTE);
  bytes_u32(&w, kind);
  bytes_u64(&w, tick);
  bytes_u32(&w, (uint32_t)text_bytes);
  bytes_u32(&w, 0);
  SONDE_ASSERT(bytes_fit(&w));
  return w.count;
}

static void publish(sonde_recorder *recorder, int trouble, bool synced) {
  if (!trouble && synced) atomic_store(&recorder->safe_notes, recorder->notes);
  atomic_store(&recorder->trouble, trouble);
  if (!trouble) atomic_store(&recorder->safe_ticks, recorder->ticks);
}

static void close_block(sonde_recorder *recorder, bool sync) {
  unsigned char bytes[16];
  double now_s = sonde_clock_now();
  sonde_record_put_block(bytes, (uint32_t)recorder->crc, recorder->ticks);
  if (!emit(recorder, bytes, sizeof bytes, true)) return;
  sync |= now_s - recorder->synced_s >= SONDE_RECORD_SYNC_S;
  int trouble = sonde_journal_flush(recorder->journal, sync, false);
  if (sync && !trouble) recorder->synced_s = now_s;
  publish(recorder, trouble, sync);
}

void sonde_recorder_write(sonde_recorder *recorder, const sonde_record *record) {
  unsigned char bytes[SONDE_RECORD_MOST_BYTES];
  bytes_cursor w = {bytes, sizeof bytes, 0};
  const bool is_tick = record->tag == SONDE_RECORD_TICK;
  const sonde_pose pose = record->sample.world_from_probe;
  const double place[7] = {pose.position.x, pose.position.y, pose.position.z, pose.rotation.w,
                           pose.rotation.x, pose.rotation.y, pose.rotation.z};
  const double *force_n = &record->image.rendered_force_n.x;
  // Tag and one number of 32 bits, the tick, then what belongs to the tag.
  bytes_u32(&w, record->tag);
  switch (record->tag) {
  case SONDE_RECORD_TICK:
    bytes_u32(&w, (record->sample.present ? 1 : 0) | record->did << 1);
    bytes_u64(&w, record->tick);
    bytes_u32(&w, record->sample.buttons);
    bytes_u32(&w, 0);
    for (int i = 0; i < 7; ++i) bytes_f64(&w, place[i]);
    break;
  case SONDE_RECORD_CONTROLS:
    bytes_u32(&w, record->controls.probe);
    bytes_u64(&w, record->tick);
    sonde_controls_put(&w, &record->controls);
    break;
  case SONDE_RECORD_IMAGE:
    bytes_u32(&w, record->image.fault);
    bytes_u64(&w, record->tick);
    for (int i = 0; i < 3; ++i) bytes_f64(&w, force_n[i]);
    break;
  default:
    bytes_u32(&w, record->check.kind);
    bytes_u64(&w, record->check.tick);
    bytes_u64(&w, record->check.hash);
    break;
  }
  SONDE_ASSERT(w.count == sonde_record_bytes(SONDE_RECORD_VERSION, record->tag) && bytes_fit(&w));
  bool is_check = record->tag == SONDE_RECORD_CHECK;
  bool follows = is_check ? record->tick <= recorder->ticks : record->tick == recorder->ticks;
  if (recorder->broken || !follows || !emit(recorder, bytes, w.count, false)) {
    // The first one that is missing is the last one that matters.
    recorder->broken = true;
    atomic_fetch_add(&recorder->lost, 1);
    return;
  }
  recorder->images += record->tag == SONDE_RECORD_IMAGE;
  if (is_tick && ++recorder->ticks % recorder->block_ticks == 0) close_block(recorder, false);
}

void sonde_recorder_note(sonde_recorder *recorder, sonde_note_kind kind, uint64_t tick,
                         const char *text) {
  size_t length = strlen(text), padded = SONDE_RECORD_NOTE_BYTES + ((length + 7) & ~(size_t)7);
  unsigned char *bytes = SONDE_NEW(unsigned char, padded);
  if (bytes) {
    size_t head = sonde_record_put_note(bytes, kind, tick, length);
    memcpy(bytes + head, text, length);
  }
  if (bytes && emit(recorder, bytes, padded, true))
    recorder->notes++;
  else
    atomic_fetch_add(&recorder->lost, 1);
  sonde_free(bytes);
  close_block(recorder, true);
}

void sonde_recorder_retry(sonde_recorder *recorder) {
  if (!atomic_load(&recorder->trouble)) return;
  publish(recorder, sonde_journal_flush(recorder->journal, true, false), true);
}

sonde_recorder_state sonde_recorder_look(const sonde_recorder *recorder) {
  return (sonde_recorder_state){atomic_load(&recorder->trouble), atomic_load(&recorder->safe_ticks),
                                atomic_load(&recorder->lost), atomic_load(&recorder->safe_notes)};
}

// 64-bit numbers do not fit a JSON number.
static void put_hex(sonde_json_out *out, const char *key, uint64_t value) {
  char text[17];
  snprintf(text, sizeof text, "%016llx", (unsigned long long)value);
  sonde_json_put_text(out, key, text);
}

// The header line with its end.
static sonde_status write_header(const sonde_record_head *head, char **text, size_t *count,
                                 sonde_error *error) {
  sonde_json_out out = {.layout = SONDE_JSON_COMPACT};
  sonde_status status = sonde_file_in_memory(&out.file, error);
  if (status) return status;
  bool fits = head->model_path && strlen(head->model_path) < SONDE_RECORD_PATH_BYTES;
  sonde_json_begin_object(&out, NULL);
  sonde_json_begin_object(&out, "model");
  sonde_json_put_text(&out, "path", fits ? head->model_path : "");
  sonde_json_put_text(&out, "name", head->model_name);
  put_hex(&out, "checksum", head->model_checksum);
  sonde_json_end(&out);
  sonde_json_begin_list(&out, "probes");
  for (uint32_t i = 0; i < head->probe_count; ++i) {
    sonde_json_begin_object(&out, NULL);
    sonde_json_put_text(&out, "name", head->probe_names[i]);
    put_hex(&out, "hash", sonde_probe_hash(&head->probes[i]));
    sonde_json_end(&out);
  }
  sonde_json_end(&out);
  sonde_json_begin_object(&out, "world");
  sonde_json_put_real(&out, "dt_s", head->world.dt_s, 0);
  sonde_json_put_real(&out, "implicitness", head->world.implicitness, 0);
  sonde_json_put_integer(&out, "newton_iterations", head->world.newton_iterations);
  sonde_json_put_real(&out, "pcg_relative", head->world.pcg.relative_residual, 0);
  sonde_json_put_real(&out, "pcg_absolute", head->world.pcg.absolute_residual, 0);
  sonde_json_put_integer(&out, "pcg_iterations", head->world.pcg.max_iterations);
  sonde_json_put_integer(&out, "contact_law", head->world.contact_law);
  sonde_json_put_real(&out, "contact_stiffness_n_m3", head->world.contact_stiffness_n_m3, 0);
  sonde_json_put_real(&out, "contact_damping_n_s_m3", head->world.contact_damping_n_s_m3, 0);
  sonde_json_put_integer(&out, "engine", head->world.engine);
  sonde_json_put_real(&out, "sleep_displacement_m", head->world.sleep_displacement_m, 0);
  sonde_json_end(&out);
  sonde_setup_write(&out, &head->setup);
  sonde_json_begin_object(&out, "image");
  sonde_json_put_integer(&out, "width", head->image_width);
  sonde_json_put_integer(&out, "height", head->image_height);
  sonde_json_put_integer(&out, "ticks_per_image", head->ticks_per_image);
  sonde_json_end(&out);
  sonde_json_end(&out);
  sonde_file_printf(out.file, "\n");
  return sonde_file_take(out.file, text, count, error);
}

uint64_t sonde_probe_hash(const sonde_probe *probe) {
  const sonde_mesh *hull = &probe->body.hull;
  SONDE_ASSERT(hull->vertex_count > 0);
  uint64_t hash = sonde_hash(0, hull->vertices, hull->vertex_count * sizeof *hull->vertices);
  return sonde_hash(hash, hull->faces, hull->face_count * sizeof *hull->faces);
}

sonde_status sonde_recorder_create(const char *path, const sonde_record_head *head,
                                   sonde_recorder **out, sonde_error *error) {
  *out = NULL;
  char *header = NULL;
  size_t count = 0;
  sonde_recorder *recorder = SONDE_NEW(sonde_recorder, 1);
  sonde_status status = recorder ? SONDE_OK : sonde_fail_memory(error);
  if (!status) status = write_header(head, &header, &count, error);
  if (status) goto done;
  snprintf(recorder->path, sizeof recorder->path, "%s", path);
  status = sonde_journal_create(path, &recorder->journal, error);
  if (status) goto done;
  recorder->block_ticks = (uint64_t)ceil(SONDE_RECORD_BLOCK_S / head->world.dt_s);
  char magic[40];
  snprintf(magic, sizeof magic, "%s %d\n", SONDE_RECORD_MAGIC, SONDE_RECORD_VERSION);
  if (emit(recorder, magic, strlen(magic), true) && emit(recorder, header, count, true)) {
    *out = recorder;
    recorder = NULL;
  } else {
    sonde_journal_undo(recorder->journal);
    status = sonde_fail_memory(error);
  }
done:
  sonde_free(header);
  sonde_free(recorder);
  return status;
}

bool sonde_recorder_is_file(const sonde_recorder *recorder) {
  return sonde_journal_is_file(recorder->journal);
}

void sonde_recorder_end(sonde_recorder *recorder, sonde_record_end *end) {
  unsigned char bytes[SONDE_RECORD_MOST_BYTES];
  bytes_cursor w = {bytes, sizeof bytes, 0};
  end->ticks = recorder->ticks, end->images = recorder->images;
  end->lost += atomic_load(&recorder->lost);
  end->crc = (uint32_t)recorder->crc;
  bytes_u32(&w, SONDE_RECORD_END);
  bytes_u32(&w, 0);
  bytes_u64(&w, end->ticks);
  bytes_u64(&w, end->hash);
  bytes_u64(&w, end->lost);
  bytes_u64(&w, end->images);
  bytes_u64(&w, end->image_hash);
  SONDE_ASSERT(w.count == sonde_record_bytes(SONDE_RECORD_VERSION, SONDE_RECORD_END));
  (void)emit(recorder, bytes, w.count, true);
  close_block(recorder, true);
}

sonde_status sonde_recorder_sync(sonde_recorder *recorder, sonde_error *error) {
  int trouble = sonde_journal_flush(recorder->journal, true, true);
  publish(recorder, trouble, true);
  if (!trouble) return SONDE_OK;
  return sonde_fail(error, sonde_disk_status(trouble), "%s: cannot be written: %s", recorder->path,
                    strerror(trouble));
}

void sonde_recorder_close(sonde_recorder *recorder) {
  if (!recorder) return;
  sonde_journal_close(recorder->journal);
  sonde_free(recorder);
}

void sonde_recorder_discard(sonde_recorder *recorder) {
  if (!recorder) return;
  sonde_journal_undo(recorder->journal);
  sonde_free(recorder);
}
