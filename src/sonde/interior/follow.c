// The window follows the probe: two solids, one in use, one that is factored bit by bit between and
// within updates; factored windows of other footprints wait in a cache.
#include "base/base.h"
#include "interior/interior.h"
#include "interior/window.h"

#include <string.h>

static const double slack_t_m = 9e-3, slack_s_m = 7e-3, slack_half_m = 6e-3;
// Of the slack: where the next window begins, by how much of the way so far it is placed ahead of
// the probe, and up to where a window holds the touched skin in its fine part.
static const double start_at = 0.35, lead = 0.6, most_off = 1.25;
static const double exact = 0.05; // of the slack, for a window that is made at once

static double distance(const sonde_interior *in, sonde_footprint a, sonde_footprint b) {
  sonde_column_point at;
  sonde_interior_column(in, a.theta, a.s, &at);
  double turn = fabs(remainder(a.theta - b.theta, 2 * SONDE_PI)) * at.radius_m / slack_t_m;
  double shift = fabs(a.s - b.s) / slack_s_m;
  double wider = fmax(fabs(a.half_theta_m - b.half_theta_m), fabs(a.half_s_m - b.half_s_m));
  return fmax(fmax(turn, shift), wider / slack_half_m);
}

static void swap(sonde_interior *in) {
  struct sonde_window *was = in->live;
  in->live = in->next, in->next = was;
  in->building = false;
}

// A little more than an update's share: all is done before the window is due.
void sonde_interior_build_ahead(sonde_interior *in) {
  SONDE_ASSERT(in != NULL);
  in->ahead = true;
  if (in->building && !in->next->ready)
    (void)sonde_window_step(in->next, SONDE_WINDOW_BUDGET / 8 * 9);
}

// A window takes the same number of updates everywhere; the work may be done earlier (from the
// cache, or between updates) or later (after a recall). At rest in time (dt < 0) it is made at
// once, and so it is where updates wait for their windows.
bool sonde_interior_follow(sonde_interior *in, const sonde_interior_input *input) {
  SONDE_ASSERT(in->live != NULL && in->next != NULL);
  const bool still = input->dt_s < 0, at_once = still || in->waits;
  sonde_footprint footprint;
  bool within;
  if (in->method != SONDE_INTERIOR_SOLID || !sonde_grid_footprint(in, input, &footprint, &within) ||
      !within)
    return false;
  double off = in->live->ready ? distance(in, in->live->grid.footprint, footprint) : INFINITY;
  if (in->building && distance(in, in->next->grid.footprint, footprint) > (still ? exact : 1))
    in->building = false;
  if (!in->building && off > (still ? exact : start_at)) {
    const sonde_footprint *was = &in->live->grid.footprint;
    const double on = !still && off < 2 * start_at ? lead : 0; // the probe goes on as it went
    const double at[4] = {
        footprint.theta + on * remainder(footprint.theta - was->theta, 2 * SONDE_PI),
        footprint.s + on * (footprint.s - was->s), footprint.half_theta_m, footprint.half_s_m};
    sonde_interior_next_window(in, at);
    in->building = true, in->built = 0;
  }
  if (in->building) {
    const bool due = ++in->built >= in->whole || at_once, ahead = in->ahead;
    in->ahead = false;
    if (!in->next->ready && (due || !ahead))
      (void)sonde_window_step(in->next, due ? UINT64_MAX : SONDE_WINDOW_BUDGET);
    if (due && in->next->ready) swap(in);
    if (due) in->building = false;
  }
  if (!in->live->ready || distance(in, in->live->grid.footprint, footprint) > most_off)
    return false;
  return sonde_window_update(in->live, in, input);
}

// ---- memory -------------------------------------------------------------------------------

static sonde_footprint footprint_of(const double p[4]) {
  return (sonde_footprint){p[0], p[1], p[2], p[3]};
}

static void store_footprint(const sonde_footprint *footprint, double p[4]) {
  p[0] = footprint->theta, p[1] = footprint->s, p[2] = footprint->half_theta_m,
  p[3] = footprint->half_s_m;
}

static bool is_at(const struct sonde_window *window, const sonde_footprint *footprint) {
  return window->ready && memcmp(&window->grid.footprint, footprint, sizeof *footprint) == 0;
}

sonde_status sonde_interior_cache_windows(sonde_interior *in, uint32_t count, sonde_error *error) {
  SONDE_ASSERT(in != NULL && in->cache == NULL);
  in->cache = SONDE_NEW(struct sonde_window *, count);
  if (in->cache == NULL) return sonde_fail_memory(error);
  in->cache_count = count;
  return SONDE_OK;
}

// The window at `from` of the cache is exchanged with next and becomes its first.
static void exchange(sonde_interior *in, uint32_t from) {
  struct sonde_window *taken = in->cache[from];
  memmove(in->cache + 1, in->cache, from * sizeof *in->cache);
  in->cache[0] = in->next;
  in->next = taken;
}

void sonde_interior_next_window(sonde_interior *in, const double at[4]) {
  sonde_footprint footprint = footprint_of(at);
  if (is_at(in->next, &footprint)) return;
  for (uint32_t k = 0; k < in->cache_count; ++k)
    if (in->cache[k] && is_at(in->cache[k], &footprint)) {
      exchange(in, k);
      return;
    }
  if (in->cache_count > 0 && in->next->ready) {
    // The oldest of the cache makes room for next; without memory next is written over.
    uint32_t last = in->cache_count - 1;
    if (!in->cache[last]) (void)sonde_window_create(&in->cache[last], NULL);
    if (in->cache[last]) exchange(in, last);
  }
  sonde_window_begin(in->next, in, footprint);
}

void sonde_interior_remember(const sonde_interior *in, sonde_interior_memory *memory) {
  SONDE_ASSERT(in != NULL && memory != NULL);
  memset(memory, 0, sizeof *memory);
  memory->tick = in->tick;
  memory->ready = in->ready, memory->live_ready = in->live->ready;
  memory->building = in->building, memory->built = in->built;
  if (in->live->ready) store_footprint(&in->live->grid.footprint, memory->live);
  if (in->building) store_footprint(&in->next->grid.footprint, memory->next);
  for (uint32_t which = 0, at = 0; which < in->vessel_count; ++which)
    for (uint32_t i = 0; i < in->course[which].count; ++i, ++at) {
      memory->area_ratio[at] = in->state[which][i].area_ratio;
      memory->flat_axis[at] = in->state[which][i].flat_axis;
    }
}

sonde_status sonde_interior_recall(sonde_interior *in, const sonde_interior_memory *memory,
                                   sonde_error *error) {
  SONDE_ASSERT(in != NULL && memory != NULL);
  const sonde_interior_memory *m = memory;
  bool usable = m->ready <= 1 && m->live_ready <= 1 && m->building <= 1;
  for (int k = 0; k < 4; ++k) {
    bool extent = k < 2 || (m->live[k] >= 0 && m->live[k] < 1 && m->next[k] >= 0 && m->next[k] < 1);
    usable = usable && extent && fabs(m->live[k]) < 1e3 && fabs(m->next[k]) < 1e3;
  }
  for (uint32_t i = 0; i < SONDE_MEMORY_SECTIONS; ++i)
    usable = usable && fabs(m->area_ratio[i]) < 1e6 && v_finite(m->flat_axis[i]);
  if (!usable) return sonde_fail(error, SONDE_FORMAT, "not a state of the inside that was saved");
  in->building = false;
  const sonde_footprint footprint = footprint_of(m->live);
  if (!m->live_ready) {
    in->live->ready = false;
  } else if (!is_at(in->live, &footprint)) {
    sonde_interior_next_window(in, m->live);
    if (!in->next->ready) (void)sonde_window_step(in->next, UINT64_MAX);
    if (in->next->ready) swap(in);
    if (!in->live->ready)
      return sonde_fail(error, SONDE_FORMAT, "the saved inside has no solid at its place");
  }
  if (m->building) sonde_interior_next_window(in, m->next);
  in->building = m->building, in->built = m->built;
  in->ready = m->ready, in->tick = m->tick, in->solid = false, in->tissue = NULL;
  for (uint32_t which = 0, at = 0; which < in->vessel_count; ++which)
    for (uint32_t i = 0; i < in->course[which].count; ++i, ++at) {
      in->state[which][i].area_ratio = m->area_ratio[at];
      in->state[which][i].flat_axis = m->flat_axis[at];
    }
  return SONDE_OK;
}
