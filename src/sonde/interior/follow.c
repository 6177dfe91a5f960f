// The window follows the probe: two solids, one in use, one that is factored bit by bit.
//
// sonde_interior_follow  keeps a window under the probe and solves it
// sonde_interior_build_ahead  continues between two updates
// sonde_interior_remember, _recall  the state between two updates
// sonde_interior_keep_windows, _next_window  factored windows of other places
#include "base/base.h"
#include "interior/interior.h"
#include "interior/window.h"

#include <string.h>

static const double slack_t_m = 9e-3, slack_s_m = 7e-3, slack_half_m = 6e-3;
static const double start_at = 0.5, exact = 0.05; // of the slack

static double distance(const sonde_interior *in, sonde_window_place a, sonde_window_place b) {
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
// shelf, or between updates) or later (after a recall). At rest in time (dt < 0) it is made at
// once.
bool sonde_interior_follow(sonde_interior *in, const sonde_interior_input *input) {
  SONDE_ASSERT(in->live != NULL && in->next != NULL);
  const bool at_once = input->dt_s < 0;
  sonde_window_place place;
  bool within;
  if (in->method != SONDE_INTERIOR_SOLID || !sonde_grid_place(in, input, &place, &within) ||
      !within)
    return false;
  double off = in->live->ready ? distance(in, in->live->grid.place, place) : INFINITY;
  if (in->building && distance(in, in->next->grid.place, place) > 1) in->building = false;
  if (!in->building && off > (at_once ? exact : start_at)) {
    const double at[4] = {place.theta, place.s, place.half_theta_m, place.half_s_m};
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
  if (!in->live->ready || distance(in, in->live->grid.place, place) > 1) return false;
  return sonde_window_update(in->live, in, input);
}

// ---- memory -------------------------------------------------------------------------------

static sonde_window_place place_at(const double p[4]) {
  return (sonde_window_place){p[0], p[1], p[2], p[3]};
}

static void place_to(const sonde_window_place *place, double p[4]) {
  p[0] = place->theta, p[1] = place->s, p[2] = place->half_theta_m, p[3] = place->half_s_m;
}

static bool is_at(const struct sonde_window *window, const sonde_window_place *place) {
  return window->ready && memcmp(&window->grid.place, place, sizeof *place) == 0;
}

sonde_status sonde_interior_keep_windows(sonde_interior *in, uint32_t count, sonde_error *error) {
  SONDE_ASSERT(in != NULL && in->shelf == NULL);
  in->shelf = SONDE_NEW(struct sonde_window *, count);
  if (in->shelf == NULL) return sonde_fail_memory(error);
  in->shelf_count = count;
  return SONDE_OK;
}

// The window at `from` of the shelf changes places with next and becomes its first.
static void exchange(sonde_interior *in, uint32_t from) {
  struct sonde_window *taken = in->shelf[from];
  memmove(in->shelf + 1, in->shelf, from * sizeof *in->shelf);
  in->shelf[0] = in->next;
  in->next = taken;
}

void sonde_interior_next_window(sonde_interior *in, const double at[4]) {
  sonde_window_place place = place_at(at);
  if (is_at(in->next, &place)) return;
  for (uint32_t k = 0; k < in->shelf_count; ++k)
    if (in->shelf[k] && is_at(in->shelf[k], &place)) {
      exchange(in, k);
      return;
    }
  if (in->shelf_count > 0 && in->next->ready) {
    // The oldest of the shelf makes room for next; without memory next is written over.
    uint32_t last = in->shelf_count - 1;
    if (!in->shelf[last]) (void)sonde_window_create(&in->shelf[last], NULL);
    if (in->shelf[last]) exchange(in, last);
  }
  sonde_window_begin(in->next, in, place);
}

void sonde_interior_remember(const sonde_interior *in, sonde_interior_memory *memory) {
  SONDE_ASSERT(in != NULL && memory != NULL);
  memset(memory, 0, sizeof *memory);
  memory->tick = in->tick;
  memory->ready = in->ready, memory->live_ready = in->live->ready;
  memory->building = in->building, memory->built = in->built;
  if (in->live->ready) place_to(&in->live->grid.place, memory->live);
  if (in->building) place_to(&in->next->grid.place, memory->next);
  for (int which = 0; which < 2; ++which)
    for (uint32_t i = 0; i < in->station_count[which]; ++i) {
      memory->area_ratio[which][i] = in->state[which][i].area_ratio;
      memory->flat_axis[which][i] = in->state[which][i].flat_axis;
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
  for (int which = 0; which < 2; ++which)
    for (uint32_t i = 0; i < SONDE_STATIONS; ++i)
      usable = usable && fabs(m->area_ratio[which][i]) < 1e6 && v_finite(m->flat_axis[which][i]);
  if (!usable) return sonde_fail(error, SONDE_FORMAT, "not a state of the inside that was saved");
  in->building = false;
  const sonde_window_place place = place_at(m->live);
  if (!m->live_ready) {
    in->live->ready = false;
  } else if (!is_at(in->live, &place)) {
    sonde_interior_next_window(in, m->live);
    if (!in->next->ready) (void)sonde_window_step(in->next, UINT64_MAX);
    if (in->next->ready) swap(in);
    if (!in->live->ready)
      return sonde_fail(error, SONDE_FORMAT, "the saved inside has no solid at its place");
  }
  if (m->building) sonde_interior_next_window(in, m->next);
  in->building = m->building, in->built = m->built;
  in->ready = m->ready, in->tick = m->tick, in->solid = false;
  for (int which = 0; which < 2; ++which)
    for (uint32_t i = 0; i < in->station_count[which]; ++i) {
      in->state[which][i].area_ratio = m->area_ratio[which][i];
      in->state[which][i].flat_axis = m->flat_axis[which][i];
    }
  return SONDE_OK;
}
