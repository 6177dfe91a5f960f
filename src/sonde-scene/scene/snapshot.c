// Snapshots of a scene's motion: a header, the block that a step hands to the next, a checksum.
// The numbers are written as this machine holds them (little-endian IEEE 754).
#include "scene/touch.h"

#include "base/bounds.h"
#include "base/maths.h"

#include <string.h>

static const char MAGIC[8] = "SONDESNP";
enum { SNAPSHOT_VERSION = 4 };

typedef struct header {
  char magic[8];
  uint64_t version, scene, bytes, hash;
} header;
_Static_assert(sizeof(header) == 40, "the header of a snapshot has no padding");

sonde_status sonde_scene_state_save(const sonde_scene_state *state, const char *path,
                                    sonde_error *error) {
  SONDE_ASSERT(state && path);
  sonde_file *file = NULL;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  header h = {.version = SNAPSHOT_VERSION,
              .scene = state->scene->checksum,
              .bytes = sonde_scene_motion_bytes(&state->now),
              .hash = sonde_scene_hash(state)};
  memcpy(h.magic, MAGIC, sizeof h.magic);
  sonde_file_write(file, &h, sizeof h);
  sonde_file_write(file, state->now.block, sonde_scene_motion_bytes(&state->now));
  return sonde_file_commit(file, error);
}

static bool within(const sonde_vec3 *list, uint32_t count, double most) {
  for (uint32_t i = 0; i < count; ++i)
    if (!(v_norm(list[i]) <= most)) return false;
  return true;
}

sonde_status sonde_scene_state_load(sonde_scene_state *state, const char *path,
                                    sonde_error *error) {
  char *bytes = NULL;
  size_t count;
  header h = {.version = 0};
  sonde_status status = sonde_bounded_load(path, &sonde_limits_snapshot, &bytes, &count, error);
  if (status) return status;
  if (count >= sizeof h) memcpy(&h, bytes, sizeof h);
  const char *block = bytes + sizeof h;
  if (memcmp(h.magic, MAGIC, sizeof MAGIC) != 0)
    status = sonde_fail(error, SONDE_FORMAT, "%s: not a snapshot of a scene", path);
  else if (h.version != SNAPSHOT_VERSION)
    status = sonde_fail(error, SONDE_VERSION, "%s: version %llu, expected %d", path,
                        (unsigned long long)h.version, SNAPSHOT_VERSION);
  else if (h.scene != state->scene->checksum || h.bytes < state->now.fixed)
    status = sonde_fail(error, SONDE_MISMATCH, "%s: a snapshot of another scene", path);
  else if (count != sizeof h + h.bytes || sonde_hash(0, block, h.bytes) != h.hash)
    status = sonde_fail(error, SONDE_CHECKSUM, "%s: the snapshot is damaged", path);
  else {
    // Numbers that no scene reaches would break what the steps rely on.
    const sonde_scene *scene = state->scene;
    const sonde_scene_motion *motion = &state->undo;
    sonde_scene_motion_unbond(&state->undo);
    memcpy(state->undo.block, block, state->undo.fixed);
    bool room = motion->head->bond_count <= state->bond_capacity &&
                h.bytes == sonde_scene_motion_bytes(motion);
    if (room)
      memcpy(state->undo.bond, block + motion->fixed, h.bytes - motion->fixed);
    else
      state->undo.head->bond_count = 0;
    bool good = room && within(motion->position, scene->slot_count, SONDE_SCENE_REACH_M) &&
                within(motion->velocity, scene->slot_count, SONDE_SCENE_FASTEST) &&
                within(motion->increment, scene->slot_count, SONDE_SCENE_FASTEST) &&
                within(motion->hint, scene->touch_count, 1 + 1e-6) &&
                motion->head->level <= SONDE_SCENE_MOST_HALVINGS && motion->head->time_s >= 0 &&
                motion->head->time_s <= SONDE_SCENE_LATEST_S;
    for (uint32_t k = 0; k < scene->body_count && good; ++k) {
      sonde_quat q = motion->rotation[k];
      good = fabs(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z - 1) <= 1e-6;
    }
    for (uint32_t k = 0; k < motion->head->bond_count && good; ++k)
      good = v_norm(motion->bond[k].displacement) <= SONDE_SCENE_REACH_M &&
             motion->bond[k].slip_m_s >= 0 && motion->bond[k].slip_m_s <= SONDE_SCENE_FASTEST;
    for (uint32_t k = 0; k < scene->touch_count && good; ++k) {
      const sonde_touch *touch = &scene->touches[k];
      uint32_t bonds = scene->bodies[touch->bond_side ? touch->b : touch->a].surface.vertex_count;
      uint64_t first = motion->bond_first[k];
      good = (!first || first - 1 + bonds <= motion->head->bond_count) && motion->release[k] <= 2 &&
             v_norm(motion->entry[k]) <= 1 + 1e-6;
    }
    if (!good)
      status = sonde_fail(error, SONDE_FORMAT,
                          "%s: expected positions within %g m, velocities within %g m/s and unit "
                          "quaternions",
                          path, SONDE_SCENE_REACH_M, SONDE_SCENE_FASTEST);
  }
  if (!status) {
    sonde_scene_motion_copy(&state->now, &state->undo);
    sonde_touch_forget(state);
  }
  sonde_free(bytes);
  return status;
}
