// The neighbours of a node in the order in which its faces follow one another; cold.
// ahead, behind: corners of a face after and before a node, counter-clockwise.
// is_taken, find: faces that no chain has yet.
// emit, chain:    one run of faces, each beginning where the one before ends.
#include "tissue/two_layer/fan.h"

#include "base/base.h"

static uint32_t corner_after(const sonde_model *model, uint32_t face, uint32_t i, uint32_t by) {
  const uint32_t *v = model->surface.faces[face];
  uint32_t k = v[0] == i ? 0 : v[1] == i ? 1 : 2;
  SONDE_ASSERT(v[k] == i);
  return v[(k + by) % 3];
}
static uint32_t ahead(const sonde_model *model, uint32_t face, uint32_t i) {
  return corner_after(model, face, i, 1);
}
static uint32_t behind(const sonde_model *model, uint32_t face, uint32_t i) {
  return corner_after(model, face, i, 2);
}

static bool is_taken(const sonde_fan *fan, uint32_t face) {
  for (uint32_t k = 0; k < fan->count; ++k)
    if (fan->face[k] == face) return true;
  return false;
}

// A face around i that no chain has, whose corner after or before i is `corner`.
static uint32_t find(const sonde_model *model, uint32_t i, const sonde_fan *fan, bool after,
                     uint32_t corner) {
  const sonde_topology *t = &model->topology;
  for (uint32_t k = t->face_start[i]; k < t->face_start[i + 1]; ++k) {
    uint32_t face = t->face_list[k];
    if ((after ? ahead : behind)(model, face, i) == corner && !is_taken(fan, face)) return face;
  }
  return SONDE_NO_FACE;
}

// A face that begins a chain: one that no other leads to, else any; closed where one does.
static uint32_t find_start(const sonde_model *model, uint32_t i, const sonde_fan *fan,
                           bool *closed) {
  const sonde_topology *t = &model->topology;
  uint32_t any = SONDE_NO_FACE;
  for (uint32_t k = t->face_start[i]; k < t->face_start[i + 1]; ++k) {
    uint32_t face = t->face_list[k];
    if (is_taken(fan, face)) continue;
    *closed = find(model, i, fan, false, ahead(model, face, i)) != SONDE_NO_FACE;
    if (!*closed) return face;
    if (any == SONDE_NO_FACE) any = face;
  }
  return any;
}

static void emit(sonde_fan *fan, uint32_t node, uint32_t face) {
  fan->node[fan->count] = node;
  fan->face[fan->count++] = face;
}

// Only the first chain, when it is closed, has its last node before its first.
static void chain(const sonde_model *model, uint32_t i, sonde_fan *fan, uint32_t face,
                  bool closed) {
  if (closed && fan->count == 0)
    fan->last = ahead(model, face, i);
  else
    emit(fan, ahead(model, face, i), SONDE_NO_FACE);
  for (; face != SONDE_NO_FACE; face = find(model, i, fan, true, fan->node[fan->count - 1]))
    emit(fan, behind(model, face, i), face);
}

void sonde_fan_find(const sonde_model *model, uint32_t i, sonde_fan *fan) {
  bool closed;
  SONDE_ASSERT(i < model->surface.vertex_count);
  fan->count = fan->turn = 0;
  fan->last = i;
  for (uint32_t face; (face = find_start(model, i, fan, &closed)) != SONDE_NO_FACE;) {
    chain(model, i, fan, face, closed);
    if (fan->turn == 0) fan->turn = fan->count;
  }
}
