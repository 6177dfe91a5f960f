// Reading a recording: everything is checked before the first record is handed out.
#include "exam/record.h"

#include "base/bounds.h"
#include "base/maths.h"
#include "base/bytes.h"
#include "haptics/motion.h"
#include "solid/leg.h"

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

// What is being read. The first mistake stays: after it every read does nothing.
typedef struct source {
  const char *path;
  sonde_recording *recording;
  sonde_status status;
  sonde_error *error;
} source;

static void fail_header(source *s, const char *what) {
  if (s->status) return;
  s->status =
      sonde_fail(s->error, SONDE_FORMAT, "%s:2: the header has no usable \"%s\"", s->path, what);
}

static void read_text(source *s, const sonde_json *object, const char *key, char *text,
                      size_t size) {
  const char *found = sonde_json_as_text(sonde_json_member(object, key));
  if (found && strlen(found) < size)
    snprintf(text, size, "%s", found);
  else
    fail_header(s, key);
}

static double read_real(source *s, const sonde_json *object, const char *key) {
  double value = sonde_json_as_number(sonde_json_member(object, key));
  if (isnan(value)) fail_header(s, key);
  return value;
}

static uint32_t read_count(source *s, const sonde_json *object, const char *key, uint32_t most) {
  double real = read_real(s, object, key);
  if (real >= 0.0 && real < most + 1.0) return (uint32_t)real;
  fail_header(s, key);
  return 0;
}

static uint64_t read_hash(source *s, const sonde_json *object, const char *key) {
  char text[17] = "", *end = NULL;
  read_text(s, object, key, text, sizeof text);
  uint64_t value = strtoull(text, &end, 16);
  if (end == text || *end) fail_header(s, key);
  return value;
}

static sonde_status read_header(source *s) {
  sonde_recording *r = s->recording;
  const char *line = r->bytes + r->at;
  const char *end = memchr(line, '\n', r->end - r->at);
  if (!end) return sonde_fail(s->error, SONDE_FORMAT, "%s:2: the header does not end", s->path);
  const sonde_json_source from = {s->path, 2, sonde_limits_recording.most_depth,
                                  (uint32_t)sonde_limits_recording.most_items};
  sonde_json *root = NULL;
  s->status = sonde_json_parse(line, (size_t)(end - line), &from, &root, s->error);
  r->at = r->start = (size_t)(end + 1 - r->bytes);
  if (s->status) return s->status;
  const sonde_json *model = sonde_json_member(root, "model");
  read_text(s, model, "path", r->model_path, sizeof r->model_path);
  read_text(s, model, "name", r->model_name, sizeof r->model_name);
  r->model_checksum = read_hash(s, model, "checksum");
  // The probes, by name and shape.
  const sonde_json *probes = sonde_json_member(root, "probes"), *probe = sonde_json_first(probes);
  uint32_t count = sonde_json_count(probes);
  if (sonde_json_kind_of(probes) != SONDE_JSON_LIST || count == 0) fail_header(s, "probes");
  r->probe_names = sonde_calloc(count, sizeof *r->probe_names);
  r->probe_hashes = SONDE_NEW(uint64_t, count);
  if (!s->status && (!r->probe_names || !r->probe_hashes)) s->status = sonde_fail_memory(s->error);
  for (; probe && !s->status; probe = sonde_json_next(probe)) {
    uint32_t i = r->probe_count++;
    read_text(s, probe, "name", r->probe_names[i], sizeof r->probe_names[i]);
    r->probe_hashes[i] = read_hash(s, probe, "hash");
  }
  // The world.
  const sonde_json *world = sonde_json_member(root, "world");
  sonde_world_def *def = &r->world;
  *def = sonde_world_def_default();
  def->dt_s = read_real(s, world, "dt_s");
  def->implicitness = read_real(s, world, "implicitness");
  def->pcg.relative_residual = read_real(s, world, "pcg_relative");
  def->pcg.absolute_residual = read_real(s, world, "pcg_absolute");
  def->contact_stiffness_n_m3 = read_real(s, world, "contact_stiffness_n_m3");
  def->contact_damping_n_s_m3 = read_real(s, world, "contact_damping_n_s_m3");
  def->sleep_displacement_m = read_real(s, world, "sleep_displacement_m");
  def->newton_iterations = read_count(s, world, "newton_iterations", UINT32_MAX);
  def->pcg.max_iterations = read_count(s, world, "pcg_iterations", UINT32_MAX);
  def->contact_law = (sonde_contact_law)read_count(s, world, "contact_law", SONDE_CONTACT_NODES);
  def->engine = (sonde_engine)read_count(s, world, "engine", SONDE_ENGINE_FAST);
  if (!sonde_setup_read(root, &r->setup)) fail_header(s, "setup");
  def->friction = r->setup.friction;
  // The image; files before version 4 do not tell it.
  r->image_width = r->image_height = 512, r->ticks_per_image = 20;
  if (r->version >= 4) {
    const sonde_json *image = sonde_json_member(root, "image");
    r->image_width = read_count(s, image, "width", UINT32_MAX);
    r->image_height = read_count(s, image, "height", UINT32_MAX);
    r->ticks_per_image = read_count(s, image, "ticks_per_image", UINT32_MAX);
    if (r->ticks_per_image == 0) fail_header(s, "ticks_per_image");
  }
  sonde_json_free(root);
  return s->status;
}

size_t sonde_record_bytes(int version, uint32_t tag) {
  switch (tag) {
  case SONDE_RECORD_TICK: return SONDE_RECORD_TICK_BYTES;
  case SONDE_RECORD_CONTROLS: return 16 + sonde_controls_bytes(version);
  case SONDE_RECORD_END: return version < 4 ? 40 : version < SONDE_RECORD_JOURNAL ? 56 : 48;
  case SONDE_RECORD_IMAGE: return version < 4 ? 0 : 40;
  case SONDE_RECORD_CHECK: return version < 4 ? 0 : 24;
  case SONDE_RECORD_BLOCK: return version < 4 ? 0 : 16;
  case SONDE_RECORD_NOTE: return version < SONDE_RECORD_JOURNAL ? 0 : SONDE_RECORD_NOTE_BYTES;
  default: return 0;
  }
}

static void take_end(sonde_recording *r, bytes_reader *reader) {
  sonde_record_end *told = &r->told;
  told->ticks = bytes_take_u64(reader);
  told->hash = bytes_take_u64(reader);
  told->lost = bytes_take_u64(reader);
  if (r->version >= 4)
    told->images = bytes_take_u64(reader), told->image_hash = bytes_take_u64(reader);
}

// The last bytes of a file before version 8; afterwards recording->end is the end of the records.
static sonde_status read_end(const source *s) {
  sonde_recording *r = s->recording;
  size_t bytes = sonde_record_bytes(r->version, SONDE_RECORD_END);
  size_t start = r->end < bytes ? 0 : r->end - bytes;
  bytes_reader reader = {(const unsigned char *)r->bytes + start};
  if (start < r->at || bytes_take_u32(&reader) != SONDE_RECORD_END || bytes_take_u32(&reader) != 0)
    return sonde_fail(s->error, SONDE_FORMAT,
                      "%s: the recording has no end: it was cut off or not finished", s->path);
  take_end(r, &reader);
  r->told.crc = bytes_take_u32(&reader);
  uint32_t crc = (uint32_t)crc32_z(0, (const unsigned char *)r->bytes, r->end - 8);
  if (!sonde_checksum_fits(r->told.crc, crc))
    return sonde_fail(s->error, SONDE_CHECKSUM,
                      "%s: the recording is damaged: its CRC-32 is %08x, expected %08x", s->path,
                      crc, r->told.crc);
  r->end = start;
  r->ended = true;
  return SONDE_OK;
}

// The tag at a place before `end` and the record's bytes; 0 when no whole record is there.
static size_t record_at(const sonde_recording *r, size_t at, size_t end, uint32_t *tag) {
  if (end - at < 4) return 0;
  bytes_reader reader = {(const unsigned char *)r->bytes + at};
  *tag = bytes_take_u32(&reader);
  size_t bytes = sonde_record_bytes(r->version, *tag);
  if (bytes > end - at || (*tag == SONDE_RECORD_END && r->version < SONDE_RECORD_JOURNAL)) return 0;
  if (*tag != SONDE_RECORD_NOTE) return bytes;
  reader.at += 12;
  size_t text = bytes_take_u32(&reader);
  if (text > SONDE_NOTE_MOST_BYTES) return 0;
  bytes += (text + 7) & ~(size_t)7;
  return bytes > end - at ? 0 : bytes;
}

bool sonde_recording_next(sonde_recording *r, sonde_record *record) {
  SONDE_ASSERT(r->at <= r->end);
  memset(record, 0, sizeof *record);
  uint32_t tag;
  size_t bytes;
  while ((bytes = record_at(r, r->at, r->end, &tag)) > 0 &&
         !(tag != SONDE_RECORD_BLOCK && tag != SONDE_RECORD_NOTE && tag != SONDE_RECORD_END))
    r->at += bytes;
  if (bytes == 0) return false;
  record->tag = tag;
  bytes_reader reader = {(const unsigned char *)r->bytes + r->at + 4};
  switch (tag) {
  case SONDE_RECORD_TICK: {
    const uint32_t bits = bytes_take_u32(&reader);
    record->sample.present = bits & 1;
    record->did = bits >> 1 & (SONDE_LEG_PASS | SONDE_LEG_PLACE);
    record->tick = bytes_take_u64(&reader);
    record->sample.buttons = bytes_take_u32(&reader);
    (void)bytes_take_u32(&reader);
    double n[7];
    for (int i = 0; i < 7; ++i) n[i] = bytes_take_f64(&reader);
    record->sample.world_from_probe = (sonde_pose){{n[0], n[1], n[2]}, {n[3], n[4], n[5], n[6]}};
  } break;
  case SONDE_RECORD_CONTROLS: {
    uint32_t probe = bytes_take_u32(&reader);
    record->tick = bytes_take_u64(&reader);
    sonde_controls_get(&reader, r->version, &record->controls);
    record->controls.probe = probe;
  } break;
  case SONDE_RECORD_IMAGE: {
    uint32_t fault = bytes_take_u32(&reader);
    record->tick = bytes_take_u64(&reader);
    record->image.fault = fault < SONDE_FAULT_COUNT ? (sonde_fault)fault : SONDE_FAULT_COUNT;
    double *force_n = &record->image.rendered_force_n.x;
    for (int i = 0; i < 3; ++i) force_n[i] = bytes_take_f64(&reader);
  } break;
  default: {
    uint32_t kind = bytes_take_u32(&reader);
    record->check.kind = kind == SONDE_CHECK_STATE ? SONDE_CHECK_STATE : SONDE_CHECK_IMAGES;
    record->check.tick = record->tick = bytes_take_u64(&reader);
    record->check.hash = bytes_take_u64(&reader);
  } break;
  }
  r->at += bytes;
  return true;
}

bool sonde_recording_next_note(const sonde_recording *r, size_t *at, sonde_record_note *note) {
  uint32_t tag;
  for (size_t bytes; (bytes = record_at(r, *at, r->notes_end, &tag)) > 0; *at += bytes) {
    if (tag != SONDE_RECORD_NOTE) continue;
    bytes_reader reader = {(const unsigned char *)r->bytes + *at + 4};
    note->kind = (sonde_note_kind)bytes_take_u32(&reader);
    note->tick = bytes_take_u64(&reader);
    note->bytes = bytes_take_u32(&reader);
    note->text = r->bytes + *at + SONDE_RECORD_NOTE_BYTES;
    *at += bytes;
    return true;
  }
  return false;
}

// What is wrong with a record, NULL when nothing is. `tick`: ticks before it.
static const char *fault_of(const sonde_recording *r, const sonde_record *record, uint64_t tick) {
  bool first = r->at == r->start + sonde_record_bytes(r->version, record->tag);
  if (first && record->tag != SONDE_RECORD_CONTROLS) return "comes before the first controls";
  if (record->tag == SONDE_RECORD_CHECK)
    return record->tick <= tick ? NULL : "is a hash of what did not happen yet";
  if (record->tick != tick) return "is out of order";
  if (record->tag == SONDE_RECORD_CONTROLS)
    return record->controls.probe < r->probe_count ? NULL : "names a missing probe";
  if (record->tag == SONDE_RECORD_IMAGE)
    return record->image.fault < SONDE_FAULT_COUNT && v_finite(record->image.rendered_force_n)
               ? NULL
               : "has a force or a fault that is not one";
  return sonde_pose_usable(record->sample.world_from_probe) ? NULL : "has a pose that is not one";
}

// What a walk over the blocks of a journal found.
typedef struct journal_walk {
  size_t at, whole; // where it stands; end of the last whole block
  uint64_t ticks, whole_ticks;
  bool ended, damaged; // the inputs have an end; a block does not fit what it closes off
  size_t end_at;       // of the end record
  uint32_t end_crc;
} journal_walk;

// A journal is whole up to its last whole block; what follows was torn off while it was written.
static sonde_status read_journal(const source *s, bool recover) {
  sonde_recording *r = s->recording;
  journal_walk w = {.at = r->start, .whole = r->start};
  size_t summed = 0, end_at = 0, bytes;
  uLong crc = 0;
  uint32_t tag, end_crc = 0;
  for (; (bytes = record_at(r, w.at, r->end, &tag)) > 0; w.at += bytes) {
    bool is_end = tag == SONDE_RECORD_END;
    if (is_end && end_at) break; // there is one end
    w.ticks += tag == SONDE_RECORD_TICK;
    if (!is_end && tag != SONDE_RECORD_BLOCK) continue;
    crc = crc32_z(crc, (const unsigned char *)r->bytes + summed, w.at - summed);
    summed = w.at;
    if (is_end) {
      end_at = w.at;
      end_crc = (uint32_t)crc;
      continue;
    }
    bytes_reader reader = {(const unsigned char *)r->bytes + w.at + 4};
    w.damaged = !sonde_checksum_fits(bytes_take_u32(&reader), (uint32_t)crc) ||
                bytes_take_u64(&reader) != w.ticks;
    if (w.damaged) break;
    w.whole = w.at + bytes;
    w.whole_ticks = w.ticks;
    if (end_at) w.ended = true, w.end_at = end_at, w.end_crc = end_crc;
  }

  if (w.damaged && !recover)
    return sonde_fail(
        s->error, SONDE_CHECKSUM,
        "%s: the recording is damaged: the CRC-32 of the block at byte %zu does not fit", s->path,
        w.at);
  if (!w.ended && !recover)
    return sonde_fail(s->error, SONDE_FORMAT,
                      "%s: the recording has no end: it was cut off or not finished", s->path);
  if (w.whole == r->start)
    return sonde_fail(s->error, SONDE_FORMAT,
                      "%s: the recording was cut off before its first block", s->path);
  r->notes_end = w.whole;
  r->block_ticks = w.whole_ticks;
  r->crc = (uint32_t)crc32_z(0, (const unsigned char *)r->bytes, w.whole);
  r->end = w.ended ? w.end_at : w.whole;
  if (w.ended) {
    bytes_reader reader = {(const unsigned char *)r->bytes + w.end_at + 8};
    take_end(r, &reader);
  }
  r->told.crc = w.ended ? w.end_crc : r->crc;
  r->ended = w.ended;
  return SONDE_OK;
}

static sonde_status check_records(const source *s, bool recover) {
  sonde_recording *r = s->recording;
  uint64_t tick = 0, images = 0;
  sonde_record record;
  if (r->told.lost && recover) r->ended = false, r->told = (sonde_record_end){.crc = r->told.crc};
  if (r->told.lost)
    return sonde_fail(
        s->error, SONDE_FORMAT,
        "%s: %llu records were lost while it was written (the disk was full or too slow): it "
        "can be played with --recover, up to the loss",
        s->path, (unsigned long long)r->told.lost);
  while (sonde_recording_next(r, &record)) {
    const char *fault = fault_of(r, &record, tick);
    if (fault)
      return sonde_fail(s->error, SONDE_FORMAT, "%s: the record of tick %llu %s", s->path,
                        (unsigned long long)tick, fault);
    tick += record.tag == SONDE_RECORD_TICK;
    images += record.tag == SONDE_RECORD_IMAGE;
  }
  if (!r->ended) r->told.ticks = tick, r->told.images = images;
  if (r->at != r->end || tick != r->told.ticks || images != r->told.images)
    return sonde_fail(s->error, SONDE_FORMAT,
                      "%s: %llu whole ticks and %zu bytes more, expected %llu ticks", s->path,
                      (unsigned long long)tick, r->end - r->at, (unsigned long long)r->told.ticks);
  r->at = r->start;
  return SONDE_OK;
}

sonde_status sonde_recording_load(const char *path, bool recover, sonde_recording *recording,
                                  sonde_error *error) {
  SONDE_ASSERT(path != NULL && recording != NULL);
  *recording = (sonde_recording){0};
  source s = {.path = path, .recording = recording, .error = error};
  sonde_status status =
      sonde_bounded_load(path, &sonde_limits_recording, &recording->bytes, &recording->end, error);
  if (!status) {
    // The first line. Leaves recording->at at the second one.
    sonde_recording *r = s.recording;
    size_t length = strlen(SONDE_RECORD_MAGIC);
    bool named = r->end > length && memcmp(r->bytes, SONDE_RECORD_MAGIC " ", length + 1) == 0;
    char *end = r->bytes;
    long version = named ? strtol(r->bytes + length + 1, &end, 10) : 0;
    if (!named || *end != '\n')
      status = sonde_fail(s.error, SONDE_FORMAT, "%s:1: not a recording, expected \"%s %d\"",
                          s.path, SONDE_RECORD_MAGIC, SONDE_RECORD_VERSION);
    else if (version < SONDE_RECORD_OLDEST || version > SONDE_RECORD_VERSION)
      status =
          sonde_fail(s.error, SONDE_VERSION, "%s:1: version %ld of a recording, expected %d to %d",
                     s.path, version, SONDE_RECORD_OLDEST, SONDE_RECORD_VERSION);
    else
      r->version = (int)version, r->at = (size_t)(end + 1 - r->bytes);
  }
  bool journal = recording->version >= SONDE_RECORD_JOURNAL;
  sonde_status ended = status || journal ? status : read_end(&s);
  if (!status && !recover) status = ended;
  if (!status) status = read_header(&s);
  if (!status && journal) status = read_journal(&s, recover);
  if (!status && !journal && ended) {
    // Of a file without an end: blocks whose CRC fits, or all whole records of one without blocks.
    sonde_recording *r = s.recording;
    size_t at = r->start, summed = 0, whole = r->start, bytes;
    uLong crc = 0;
    uint32_t tag;
    r->told = (sonde_record_end){0};
    for (; (bytes = record_at(r, at, r->end, &tag)) > 0; at += bytes) {
      if (r->version < 4) whole = at + bytes;
      if (tag != SONDE_RECORD_BLOCK) continue;
      crc = crc32_z(crc, (const unsigned char *)r->bytes + summed, at - summed);
      summed = at;
      bytes_reader reader = {(const unsigned char *)r->bytes + at + 4};
      if (!sonde_checksum_fits(bytes_take_u32(&reader), (uint32_t)crc)) break;
      whole = at + bytes;
      r->told.crc = (uint32_t)crc;
    }
    r->end = r->notes_end = whole;
    if (whole == r->start)
      status = sonde_fail(s.error, SONDE_FORMAT,
                          "%s: the recording was cut off before its first whole block (%g s)",
                          s.path, SONDE_RECORD_BLOCK_S);
  }
  if (!status && !journal && !ended) recording->notes_end = recording->end;
  if (!status) status = check_records(&s, recover);
  if (status) sonde_recording_clear(recording);
  return status;
}

void sonde_recording_clear(sonde_recording *recording) {
  sonde_free(recording->bytes);
  sonde_free(recording->probe_names);
  sonde_free(recording->probe_hashes);
  *recording = (sonde_recording){0};
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
