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

static void share_numbers(const carrier *c, const double *from, double *to) {
  const sonde_cut_map *map = c->map;
  memcpy(to, from, map->node_count * sizeof *to);
  for (uint32_t k = 0; k < map->added; ++k) {
    uint32_t i = map->origin[k], copy = map->node_count + k;
    to[i] = from[i] * part_of(c, i, i);
    to[copy] = from[i] * part_of(c, copy, i);
  }
}

static void copy_ticks(const sonde_cut_map *map, const uint64_t *from, uint64_t *to) {
  memcpy(to, from, map->node_count * sizeof *to);
  for (uint32_t k = 0; k < map->added; ++k) to[map->node_count + k] = from[map->origin[k]];
}

// Copies of touched nodes are touched and have the highest numbers: the list stays ascending.
static void carry_touched(const carrier *c) {
  sonde_state *to = c->to;
  to->touched_count = c->from->touched_count;
  memcpy(to->touched, c->from->touched, to->touched_count * sizeof *to->touched);
  for (uint32_t k = 0; k < c->map->added; ++k) {
    uint32_t copy = c->map->node_count + k;
    sonde_vec3 g = to->gradient[copy], f = to->contact_force[copy];
    if (to->share_m3[copy] != 0 || v_norm2(g) > 0 || v_norm2(f) > 0)
      to->touched[to->touched_count++] = copy;
  }
  SONDE_ASSERT(to->touched_count <= to->model->surface.vertex_count);
}

static void carry_contact(const carrier *c) {
  const sonde_state *from = c->from;
  sonde_state *to = c->to;
  share_vectors(c, from->contact_force, to->contact_force);
  share_vectors(c, from->gradient, to->gradient);
  share_vectors(c, from->grip_n, to->grip_n);
  share_numbers(c, from->share_m3, to->share_m3);
  copy_vectors(c->map, from->bond_m, to->bond_m);
  copy_ticks(c->map, from->grip_tick, to->grip_tick);
  carry_touched(c);
  to->contact = from->contact;
  to->mu = from->mu;
}

static void carry_counters(const carrier *c) {
  const sonde_state *from = c->from;
  sonde_state *to = c->to;
  to->tick = from->tick;
  to->probe_pose = from->probe_pose;
  to->has_probe_pose = from->has_probe_pose;
  to->solver = from->solver;
  to->flags = from->flags;
  to->flag_count = from->flag_count;
  to->times = from->times;
}

// `moved` is room for positions and velocities of the new nodes.
static void carry(const carrier *c, sonde_vec3 *moved) {
  uint32_t nodes = c->map->node_count + c->map->added;
  SONDE_ASSERT(nodes == c->to->model->surface.vertex_count);
  SONDE_ASSERT(c->to->model->surface.face_count == c->from->model->surface.face_count);
  copy_vectors(c->map, sonde_state_positions(c->from), moved);
  copy_vectors(c->map, sonde_state_velocities(c->from), moved + nodes);
  sonde_state_set(c->to, moved, moved + nodes);
  sonde_contact_clear(c->to);
  carry_contact(c);
  carry_counters(c);
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
    sonde_state_retune(*after, &before->tuning);
    carry(&(carrier){before, *after, &own}, moved);
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
