// Writing a recording: a text header, fixed-size records, an end with hash and CRC-32.
// emit:             bytes to the file and into the CRC.
// put_*:            one record as bytes.
// close_block:      a block record; what came before survives the program.
// json_*, header_json: the header line.
// sonde_recorder_*: the interface.
#include "exam/record.h"

#include "base/base.h"
#include "exam/bytes.h"

#include <cjson/cJSON.h>
#include <math.h>
#include <zlib.h>

struct sonde_recorder {
  sonde_file *file;
  uLong crc;
  uint64_t ticks, images, block_ticks;
};

static void emit(sonde_recorder *recorder, const void *bytes, size_t count) {
  sonde_file_write(recorder->file, bytes, count);
  recorder->crc = crc32_z(recorder->crc, bytes, count);
}

static void put_tick(byte_writer *w, const sonde_record *record) {
  sonde_pose pose = record->sample.world_from_probe;
  const double numbers[7] = {pose.position.x, pose.position.y, pose.position.z, pose.rotation.w,
                             pose.rotation.x, pose.rotation.y, pose.rotation.z};
  put_u32(w, SONDE_RECORD_TICK);
  put_u32(w, record->sample.present ? 1 : 0);
  put_u64(w, record->tick);
  put_u32(w, record->sample.buttons);
  put_u32(w, 0);
  for (int i = 0; i < 7; ++i) put_real(w, numbers[i]);
}

static void put_controls(byte_writer *w, const sonde_record *record) {
  put_u32(w, SONDE_RECORD_CONTROLS);
  put_u32(w, record->controls.probe);
  put_u64(w, record->tick);
  sonde_controls_put(w, &record->controls);
}

static void put_image(byte_writer *w, const sonde_record *record) {
  const sonde_record_image *image = &record->image;
  put_u32(w, SONDE_RECORD_IMAGE);
  put_u32(w, image->fault);
  put_u64(w, record->tick);
  put_real(w, image->rendered_force_n.x);
  put_real(w, image->rendered_force_n.y);
  put_real(w, image->rendered_force_n.z);
}

static void put_check(byte_writer *w, const sonde_record *record) {
  put_u32(w, SONDE_RECORD_CHECK);
  put_u32(w, record->check.kind);
  put_u64(w, record->check.tick);
  put_u64(w, record->check.hash);
}

static void close_block(sonde_recorder *recorder) {
  unsigned char bytes[16];
  byte_writer w = {bytes};
  put_u32(&w, SONDE_RECORD_BLOCK);
  put_u32(&w, (uint32_t)recorder->crc);
  put_u64(&w, recorder->ticks);
  SONDE_ASSERT(w.at == bytes + sizeof bytes);
  emit(recorder, bytes, sizeof bytes);
  (void)sonde_file_flush(recorder->file, NULL);
}

void sonde_recorder_write(sonde_recorder *recorder, const sonde_record *record) {
  unsigned char bytes[SONDE_RECORD_MOST_BYTES];
  byte_writer w = {bytes};
  switch (record->tag) {
  case SONDE_RECORD_TICK: put_tick(&w, record); break;
  case SONDE_RECORD_CONTROLS: put_controls(&w, record); break;
  case SONDE_RECORD_IMAGE: put_image(&w, record); break;
  default: put_check(&w, record); break;
  }
  SONDE_ASSERT(w.at - bytes == (ptrdiff_t)sonde_record_bytes(SONDE_RECORD_VERSION, record->tag));
  emit(recorder, bytes, (size_t)(w.at - bytes));
  recorder->images += record->tag == SONDE_RECORD_IMAGE;
  if (record->tag != SONDE_RECORD_TICK) return;
  if (++recorder->ticks % recorder->block_ticks == 0) close_block(recorder);
}

// 64-bit numbers do not fit a JSON number.
static void json_hex(cJSON *object, const char *key, uint64_t value) {
  char text[17];
  snprintf(text, sizeof text, "%016llx", (unsigned long long)value);
  cJSON_AddStringToObject(object, key, text);
}

static void json_world(cJSON *root, const sonde_world_def *def) {
  cJSON *world = cJSON_AddObjectToObject(root, "world");
  cJSON_AddNumberToObject(world, "dt_s", def->dt_s);
  cJSON_AddNumberToObject(world, "implicitness", def->implicitness);
  cJSON_AddNumberToObject(world, "newton_iterations", def->newton_iterations);
  cJSON_AddNumberToObject(world, "pcg_relative", def->pcg.relative_residual);
  cJSON_AddNumberToObject(world, "pcg_absolute", def->pcg.absolute_residual);
  cJSON_AddNumberToObject(world, "pcg_iterations", def->pcg.max_iterations);
  cJSON_AddNumberToObject(world, "contact_law", (double)def->contact_law);
  cJSON_AddNumberToObject(world, "contact_stiffness_n_m3", def->contact_stiffness_n_m3);
  cJSON_AddNumberToObject(world, "contact_damping_n_s_m3", def->contact_damping_n_s_m3);
  cJSON_AddNumberToObject(world, "engine", (double)def->engine);
  cJSON_AddNumberToObject(world, "sleep_displacement_m", def->sleep_displacement_m);
}

static char *header_json(const sonde_record_head *head) {
  cJSON *root = cJSON_CreateObject();
  cJSON *model = cJSON_AddObjectToObject(root, "model");
  bool fits = head->model_path && strlen(head->model_path) < SONDE_RECORD_PATH_BYTES;
  cJSON_AddStringToObject(model, "path", fits ? head->model_path : "");
  cJSON_AddStringToObject(model, "name", head->model_name);
  json_hex(model, "checksum", head->model_checksum);
  cJSON *probes = cJSON_AddArrayToObject(root, "probes");
  for (uint32_t i = 0; i < head->probe_count; ++i) {
    cJSON *probe = cJSON_CreateObject();
    cJSON_AddStringToObject(probe, "name", head->probe_names[i]);
    json_hex(probe, "hash", sonde_probe_hash(&head->probes[i]));
    cJSON_AddItemToArray(probes, probe);
  }
  json_world(root, &head->world);
  sonde_setup_write(root, &head->setup);
  cJSON *image = cJSON_AddObjectToObject(root, "image");
  cJSON_AddNumberToObject(image, "width", head->image_width);
  cJSON_AddNumberToObject(image, "height", head->image_height);
  cJSON_AddNumberToObject(image, "ticks_per_image", head->ticks_per_image);
  char *text = cJSON_PrintUnformatted(root);
  cJSON_Delete(root);
  return text;
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
  sonde_status status = SONDE_OK;
  char *json = header_json(head);
  sonde_recorder *recorder = SONDE_NEW(sonde_recorder, 1);
  if (!json || !recorder) {
    status = sonde_fail_memory(error);
    goto done;
  }
  status = sonde_file_create(path, &recorder->file, error);
  if (status) goto done;
  recorder->block_ticks = (uint64_t)ceil(SONDE_RECORD_BLOCK_S / head->world.dt_s);
  char magic[40];
  snprintf(magic, sizeof magic, "%s %d\n", SONDE_RECORD_MAGIC, SONDE_RECORD_VERSION);
  emit(recorder, magic, strlen(magic));
  emit(recorder, json, strlen(json));
  emit(recorder, "\n", 1);
  (void)sonde_file_flush(recorder->file, NULL);
  *out = recorder;
  recorder = NULL;
done:
  cJSON_free(json);
  sonde_free(recorder);
  return status;
}

sonde_status sonde_recorder_close(sonde_recorder *recorder, sonde_record_end *end,
                                  sonde_error *error) {
  unsigned char bytes[SONDE_RECORD_MOST_BYTES];
  byte_writer w = {bytes};
  end->ticks = recorder->ticks, end->images = recorder->images;
  put_u32(&w, SONDE_RECORD_END);
  put_u32(&w, 0);
  put_u64(&w, end->ticks);
  put_u64(&w, end->hash);
  put_u64(&w, end->lost);
  put_u64(&w, end->images);
  put_u64(&w, end->image_hash);
  emit(recorder, bytes, (size_t)(w.at - bytes));
  end->crc = (uint32_t)recorder->crc;
  put_u32(&w, end->crc);
  put_u32(&w, 0);
  SONDE_ASSERT(w.at - bytes ==
               (ptrdiff_t)sonde_record_bytes(SONDE_RECORD_VERSION, SONDE_RECORD_END));
  sonde_file_write(recorder->file, w.at - 8, 8);
  sonde_status status = sonde_file_commit(recorder->file, error);
  sonde_free(recorder);
  return status;
}

void sonde_recorder_discard(sonde_recorder *recorder) {
  if (!recorder) return;
  sonde_file_discard(recorder->file);
  sonde_free(recorder);
}
