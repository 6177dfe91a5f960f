// One tick of the rendering: virtual coupling, passivity observer and controller.
//
// The device pulls a virtual probe through a spring and a damper; the probe meets the tissue. What
// the hand feels is the coupling, times the force scale: it is never stiffer than the coupling,
// however stiff the tissue is. The probe's own step is backward Euler in the coupling and takes the
// tissue force of the last tick.
#include "base/base.h"
#include "base/maths.h"
#include "sonde/haptics_render.h"

sonde_pose sonde_render_probe(sonde_render *render, sonde_pose world_from_device,
                              sonde_vec3 tissue_force_n, sonde_vec3 rendered_force_n) {
  const sonde_render_def *def = &render->def;
  SONDE_ASSERT(def->dt_s > 0.0 && def->force_scale > 0.0);
  if (!render->started) {
    render->device_m = render->probe_m = world_from_device.position;
    render->started = true;
  }
  sonde_vec3 moved = v_sub(world_from_device.position, render->device_m);
  render->device_m = world_from_device.position;
  double share = def->filter_rad_s * def->dt_s / (1.0 + def->filter_rad_s * def->dt_s);
  render->velocity_m_s = v_lerp(render->velocity_m_s, v_scale(moved, 1.0 / def->dt_s), share);
  // A force held over a tick does the work f.dx on the hand exactly, whatever the hand does:
  // energy_j is what the rendering has absorbed. surplus_j counts only what the rendering itself,
  // from the hand's side of the coupling to the tissue, has dissipated: absorbed - delivered to the
  // tissue - stored in spring and probe. It turns negative as soon as holding, delay or limits
  // generate energy, long before the tissue's own losses would hide that from energy_j.
  double absorbed = -v_dot(rendered_force_n, moved);
  double delivered = -render->def.force_scale * v_dot(tissue_force_n, render->probe_moved_m);
  const double spring_j =
                   0.5 * def->stiffness_n_m * v_norm2(v_sub(render->probe_m, render->device_m)),
               motion_j = 0.5 * def->force_scale * def->probe_mass_kg * v_norm2(render->probe_m_s),
               now_stored = def->stiffness_n_m > 0.0 ? spring_j + motion_j : 0.0;
  render->energy_j += absorbed;
  render->energy_min_j = fmin(render->energy_min_j, render->energy_j);
  render->surplus_j += absorbed - delivered - (now_stored - render->stored_j);
  render->surplus_min_j = fmin(render->surplus_min_j, render->surplus_j);
  render->surplus_j = fmin(render->surplus_j, render->def.reserve_j);
  render->stored_j = now_stored;
  SONDE_ASSERT(isfinite(render->energy_j) && isfinite(render->surplus_j));
  if (!(def->stiffness_n_m > 0.0)) {
    render->probe_m = render->device_m;
    render->probe_moved_m = moved;
    return world_from_device;
  }
  // The probe's velocity follows (m + h B + h^2 K) v' = m v + h (K (x_d - x) + B v_d + f), with K
  // and B of the probe's side.
  double h = def->dt_s, k = def->stiffness_n_m / def->force_scale;
  double b = def->damping_n_s_m / def->force_scale, m = def->probe_mass_kg;
  sonde_vec3 push = v_madd(tissue_force_n, k, v_sub(render->device_m, render->probe_m));
  push = v_madd(push, b, render->velocity_m_s);
  sonde_vec3 momentum = v_madd(v_scale(render->probe_m_s, m), h, push);
  render->probe_m_s = v_scale(momentum, 1.0 / (m + h * b + h * h * k));
  render->probe_moved_m = v_scale(render->probe_m_s, h);
  render->probe_m = v_add(render->probe_m, render->probe_moved_m);
  sonde_vec3 stretch = v_sub(render->probe_m, render->device_m);
  sonde_vec3 slip = v_sub(render->probe_m_s, render->velocity_m_s);
  // A spring K held over a tick of length T generates K |v T|^2 / 2 at a steady velocity. A damper
  // `a` dissipates a |v|^2 T. The controller adds just what the surplus does not cover:
  //   a = (K T^2 |v|^2 / 2 - surplus) / (T |v|^2), 0 <= a <= controller_max.
  // With an empty reserve and a steady hand that is Colgate's K T / 2.
  const double v2 = v_norm2(render->velocity_m_s), most = def->controller_max_n_s_m;
  const double need = 0.5 * def->stiffness_n_m * h * h * v2 - render->surplus_j;
  render->damping_n_s_m = !def->controller || need <= 0.0 ? 0.0
                          : need < most * h * v2          ? need / (h * v2)
                                                          : most;
  if (render->damping_n_s_m > 0.0) render->controlled_ticks++;
  render->controlled_j += render->damping_n_s_m * v_norm2(render->velocity_m_s) * def->dt_s;
  render->force_n = v_madd(v_scale(stretch, def->stiffness_n_m), def->damping_n_s_m, slip);
  render->force_n = v_madd(render->force_n, -render->damping_n_s_m, render->velocity_m_s);
  return (sonde_pose){render->probe_m, world_from_device.rotation};
}

void sonde_render_force(sonde_render *render, sonde_vec3 tissue_force_n) {
  SONDE_ASSERT(render->started);
  if (render->def.stiffness_n_m > 0.0) return;
  render->force_n = v_scale(tissue_force_n, render->def.force_scale);
}
