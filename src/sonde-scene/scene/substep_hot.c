// A step of the scene, whole or in substeps chosen by step doubling (docs/scene_theory.md).
#include "scene/touch.h"

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

size_t sonde_scene_motion_bytes(const sonde_scene_motion *motion) {
  return motion->fixed + motion->head->bond_count * sizeof *motion->bond;
}

// Bonds that are not in use are zero.
void sonde_scene_motion_copy(sonde_scene_motion *to, const sonde_scene_motion *from) {
  SONDE_ASSERT(to->fixed == from->fixed);
  uint32_t count = from->head->bond_count, before = to->head->bond_count;
  memcpy(to->block, from->block, sonde_scene_motion_bytes(from));
  if (before > count) memset(to->bond + count, 0, (before - count) * sizeof *to->bond);
}

void sonde_scene_motion_unbond(sonde_scene_motion *motion) {
  memset(motion->bond, 0, motion->head->bond_count * sizeof *motion->bond);
  motion->head->bond_count = 0;
}

// Steps of dt/2^level, finer where the error asks for it, coarser where it allows it.
static void adaptive(sonde_scene_state *state) {
  const sonde_scene_step *step = &state->scene->step;
  double tolerance = step->substep_tolerance_m, worst = 0;
  uint32_t finest = 1u << step->substep_halvings, done = 0;
  uint32_t level = state->now.head->level;
  if (level > step->substep_halvings) level = step->substep_halvings;
  while (done < finest) {
    uint32_t size = finest >> level;
    // The error of two steps of h/2 is their distance from one of h, over 2^p - 1.
    double h = step->dt_s * size / finest, order_factor = step->lambda == 0.5 ? 3 : 1;
    uint32_t flags = state->report.flags;
    SONDE_ASSERT(h > 0);
    sonde_scene_motion_copy(&state->saved, &state->now);
    sonde_step_guarded(state, h);
    sonde_scene_motion_copy(&state->whole, &state->now);
    sonde_scene_motion_copy(&state->now, &state->saved);
    state->listed = false;
    sonde_step_guarded(state, 0.5 * h);
    sonde_step_guarded(state, 0.5 * h);
    // Vertices of rigid bodies move with centre and rotation: their reach times the angle.
    const sonde_scene_motion *a = &state->now, *b = &state->whole;
    double most = 0;
    for (uint32_t i = 0; i < state->scene->slot_count; ++i)
      most = fmax(most, v_distance(a->position[i], b->position[i]));
    for (uint32_t k = 0; k < state->scene->body_count; ++k) {
      const sonde_body *body = &state->scene->bodies[k];
      if (!sonde_body_is_rigid(body)) continue;
      sonde_quat change = q_mul(a->rotation[k], q_conj(b->rotation[k]));
      most = fmax(most, 2 * v_norm(vec3(change.x, change.y, change.z)) * state->reach_m[k]);
    }
    double error = most / order_factor;
    if (error > tolerance && level < step->substep_halvings) {
      sonde_scene_motion_copy(&state->now, &state->saved);
      state->listed = false;
      state->report.flags = flags;
      state->report.rejected++;
      ++level;
      continue;
    }
    if (error > tolerance) state->report.flags |= SONDE_SCENE_SUBSTEP_LIMIT;
    worst = fmax(worst, error);
    state->report.substeps += 2;
    done += size;
    bool aligned = level > 0 && done % (2 * size) == 0;
    if (error < 0.2 * tolerance && aligned) --level;
  }
  state->now.head->level = level;
  state->report.error_m = worst;
}

void sonde_scene_advance(sonde_scene_state *state) {
  const sonde_scene_step *step = &state->scene->step;
  state->report = (sonde_scene_report){0};
  memset(state->noted, 0, sizeof state->noted);
  double start = state->now.head->time_s;
  if (step->substep_tolerance_m > 0)
    adaptive(state);
  else
    sonde_step_guarded(state, step->dt_s);
  sonde_trouble_inspect(state);
  sonde_scene_motion_head *head = state->now.head;
  for (uint32_t k = 0; k < SONDE_SCENE_FLAGS; ++k) {
    sonde_scene_event *first = &head->event[k], *now = &state->noted[k];
    if (first->count || !(state->report.flags & 1u << k)) continue;
    *first = now->count ? *now : (sonde_scene_event){0, 1, UINT32_MAX, UINT32_MAX, 0};
    first->time_s = start;
  }
  head->time_s = start + step->dt_s;
  head->tick++;
  head->all_flags |= state->report.flags;
  head->flag_count += state->report.flags != 0;
}
