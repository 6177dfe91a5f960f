// Geometry of a source as messages, encoded once and shared by all clients.
#include "stream/page_server.h"

#include "sonde/tissue_anatomy.h"

static page_buffer *append(page_scene *scene, size_t size) {
  page_buffer *buffer = &scene->messages[scene->message_count++];
  if (!page_buffer_reserve(buffer, size)) return NULL;
  buffer->size = size;
  return buffer;
}

static bool append_mesh(page_scene *scene, const sonde_mesh *mesh, uint32_t part) {
  page_buffer *buffer = append(scene, page_encode_mesh(mesh, part, NULL, 0));
  if (buffer) page_encode_mesh(mesh, part, buffer->bytes, buffer->capacity);
  return buffer != NULL;
}

static bool append_line(page_scene *scene, const sonde_vessel *vessel, uint32_t part) {
  page_buffer *buffer = append(scene, page_encode_line(vessel, part, NULL, 0));
  if (buffer) page_encode_line(vessel, part, buffer->bytes, buffer->capacity);
  return buffer != NULL;
}

page_scene *page_scene_create(const page_source *source) {
  SONDE_ASSERT(source->model && (source->probes || source->probe_count == 0));
  page_scene *scene = SONDE_NEW(page_scene, 1);
  if (!scene) return NULL;
  scene->references = 1;
  const sonde_model *model = source->model;
  const sonde_thigh_anatomy *anatomy = model->anatomy;
  const uint32_t branches = anatomy ? anatomy->branch_count : 0;
  scene->messages = SONDE_NEW(page_buffer, 4 + source->probe_count + branches);
  bool good = append_mesh(scene, &model->surface, PAGE_SKIN) &&
              append_mesh(scene, &model->femur, PAGE_FEMUR) &&
              append_line(scene, &model->vein, PAGE_VEIN) &&
              append_line(scene, &model->artery, PAGE_ARTERY);
  for (uint32_t i = 0; good && i < source->probe_count; ++i)
    good = append_mesh(scene, &source->probes[i]->body.hull, PAGE_PROBE + i);
  for (uint32_t i = 0; good && i < branches; ++i) {
    const bool artery = anatomy->branch[i].kind == SONDE_VESSEL_ARTERY;
    good = append_line(scene, &anatomy->branch[i].line, PAGE_BRANCH + 2 * i + artery);
  }
  if (scene->messages && good) return scene;
  page_scene_unref(scene);
  return NULL;
}

void page_scene_unref(page_scene *scene) {
  if (!scene) return;
  SONDE_ASSERT(scene->references > 0);
  if (--scene->references > 0) return;
  for (uint32_t i = 0; i < scene->message_count; ++i) sonde_free(scene->messages[i].bytes);
  sonde_free(scene->messages);
  sonde_free(scene);
}
