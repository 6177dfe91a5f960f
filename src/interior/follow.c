// The window follows the probe: two solids, one in use, one that is factored bit by bit.
//
// sonde_interior_follow  keeps a window under the probe and solves it
// place_of               where a window for this probe would be
// distance               between two places, in units of what a window tolerates
// prepare                starts, continues and swaps
#include "base/base.h"
#include "interior/interior.h"
#include "interior/window.h"

static const double default_half_x_m = 30e-3, default_half_y_m = 6e-3;
static const double far_m = 60e-3; // a probe this far above the skin needs no window yet
static const double slack_t_m = 9e-3, slack_s_m = 7e-3, slack_half_m = 6e-3;
static const double start_at = 0.5, exact = 0.05; // of the slack
static const uint64_t work_per_update = 4000000;

static bool place_of(const sonde_interior *in, const sonde_interior_input *input,
                     sonde_window_place *place) {
  sonde_mat3 r = q_matrix(input->world_from_probe.rotation);
  sonde_vec3 x = vec3(r.m[0][0], r.m[1][0], r.m[2][0]), y = vec3(r.m[0][1], r.m[1][1], r.m[2][1]);
  double hx = input->face_half_x_m > 0 ? input->face_half_x_m : default_half_x_m;
  double hy = input->face_half_y_m > 0 ? input->face_half_y_m : default_half_y_m;
  sonde_column_point at;
  bool within = sonde_interior_locate(in, input->world_from_probe.position, &at);
  *place = (sonde_window_place){.theta = at.theta, .s = at.s};
  place->half_s_m = fabs(v_dot(x, in->axis)) * hx + fabs(v_dot(y, in->axis)) * hy;
  double across_x = sqrt(fmax(0, 1 - v_dot(x, in->axis) * v_dot(x, in->axis)));
  double across_y = sqrt(fmax(0, 1 - v_dot(y, in->axis) * v_dot(y, in->axis)));
  place->half_theta_m = across_x * hx + across_y * hy;
  return within && at.depth_m > -far_m;
}

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

// At rest in time (dt < 0) the window is made at once, in a running session bit by bit.
static void prepare(sonde_interior *in, sonde_window_place place, bool at_once) {
  SONDE_ASSERT(in->live != NULL && in->next != NULL);
  double off = in->live->ready ? distance(in, in->live->place, place) : INFINITY;
  if (in->building && distance(in, in->next->place, place) > 1) in->building = false;
  if (!in->building && off > (at_once ? exact : start_at)) {
    sonde_window_begin(in->next, in, place);
    in->building = true;
  }
  if (!in->building) return;
  if (!sonde_window_step(in->next, at_once ? UINT64_MAX : work_per_update)) return;
  if (in->next->ready)
    swap(in);
  else
    in->building = false;
}

bool sonde_interior_follow(sonde_interior *in, const sonde_interior_input *input) {
  sonde_window_place place;
  if (in->method != SONDE_INTERIOR_SOLID || !place_of(in, input, &place)) return false;
  prepare(in, place, input->dt_s < 0);
  if (!in->live->ready || distance(in, in->live->place, place) > 1) return false;
  return sonde_window_update(in->live, in, input);
}
