// A cut between two steps: the skin's new model and a state that goes on from the old one.
#include "base/base.h"
#include "base/maths.h"
#include "world/engine.h"

#include <string.h>

typedef struct carrier {
  sonde_state *from;
  sonde_state *to;
  const sonde_cut_map *map;
} carrier;

static void copy_vectors(const sonde_cut_map *map, const sonde_vec3 *from, sonde_vec3 *to) {
  memcpy(to, from, map->node_count * sizeof *to);
  for (uint32_t k = 0; k < map->added; ++k) to[map->node_count + k] = from[map->origin[k]];
}

// The part of a node's area before the cut that node i has now.
static double part_of(const carrier *c, uint32_t i, uint32_t origin) {
  SONDE_ASSERT(origin < c->map->node_count);
  return c->to->model->area_m2[i] / c->from->model->area_m2[origin];
}

static void share_vectors(const carrier *c, const sonde_vec3 *from, sonde_vec3 *to) {
  const sonde_cut_map *map = c->map;
  memcpy(to, from, map->node_count * sizeof *to);
  for (uint32_t k = 0; k < map->added; ++k) {
    uint32_t i = map->origin[k], copy = map->node_count + k;
    to[i] = v_scale(from[i], part_of(c, i, i));
    to[copy] = v_scale(from[i], part_of(c, copy, i));
  }
}

// What belongs to the contact: pushes, volumes and bonds. Copies of touched nodes are touched and
// have the highest numbers: the list stays ascending.
static void copy_contact(const carrier *c) {
  const sonde_state *from = c->from;
  sonde_state *to = c->to;
  const sonde_cut_map *map = c->map;
  share_vectors(c, from->contact_force, to->contact_force);
  share_vectors(c, from->gradient, to->gradient);
  share_vectors(c, from->grip_n, to->grip_n);
  copy_vectors(map, from->bond_m, to->bond_m);
  memcpy(to->grip_tick, from->grip_tick, map->node_count * sizeof *to->grip_tick);
  memcpy(to->share_m3, from->share_m3, map->node_count * sizeof *to->share_m3);
  memcpy(to->touched, from->touched, from->touched_count * sizeof *to->touched);
  to->touched_count = from->touched_count;
  for (uint32_t k = 0; k < map->added; ++k) {
    uint32_t i = map->origin[k], copy = map->node_count + k;
    to->grip_tick[copy] = from->grip_tick[i];
    to->share_m3[i] = from->share_m3[i] * part_of(c, i, i);
    to->share_m3[copy] = from->share_m3[i] * part_of(c, copy, i);
    if (to->share_m3[copy] != 0 || v_norm2(to->gradient[copy]) > 0 ||
        v_norm2(to->contact_force[copy]) > 0)
      to->touched[to->touched_count++] = copy;
  }
  SONDE_ASSERT(to->touched_count <= to->nodes.count);
  to->contact = from->contact;
  to->mu = from->mu;
}

sonde_status sonde_state_cut(sonde_state *before, const sonde_vec3 *path_m, uint32_t count,
                             sonde_model **model, sonde_state **after, sonde_cut_map *map,
                             sonde_error *error) {
  *model = NULL;
  *after = NULL;
  sonde_cut_map own = {0};
  sonde_vec3 *moved = NULL;
  sonde_status status = sonde_model_cut(before->model, sonde_state_positions(before), path_m, count,
                                        model, &own, error);
  if (!status)
    status = sonde_state_create_ordered(*model, &before->def, before->face_order, after, error);
  if (!status) {
    moved = SONDE_NEW(sonde_vec3, 2 * (size_t)(own.node_count + own.added));
    if (!moved) status = sonde_fail_memory(error);
  }
  if (!status) {
    sonde_state *to = *after;
    uint32_t nodes = own.node_count + own.added;
    SONDE_ASSERT(nodes == to->nodes.count);
    SONDE_ASSERT(to->model->surface.face_count == before->model->surface.face_count);
    sonde_state_retune(to, &before->tuning);
    copy_vectors(&own, sonde_state_positions(before), moved);
    copy_vectors(&own, sonde_state_velocities(before), moved + nodes);
    sonde_state_set(to, moved, moved + nodes);
    sonde_contact_clear(to);
    copy_contact(&(carrier){before, to, &own});
    to->tick = before->tick, to->times = before->times, to->solver = before->solver;
    to->flags = before->flags, to->flag_count = before->flag_count;
    to->probe_pose = before->probe_pose, to->has_probe_pose = before->has_probe_pose;
  }
  sonde_free(moved);
  if (map) *map = status ? (sonde_cut_map){0} : own;
  if (status || !map) sonde_cut_map_clear(&own);
  if (!status) return SONDE_OK;
  sonde_state_destroy(*after);
  sonde_model_destroy(*model);
  *after = NULL;
  *model = NULL;
  return status;
}
