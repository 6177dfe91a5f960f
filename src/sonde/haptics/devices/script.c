// The device that follows keys: creation. Between keys a monotone cubic, over the rotations short
// arcs.
#include "haptics/devices/devices.h"

#include "haptics/motion.h"

static void destroy(void *self) {
  sonde_script_device *script = self;
  if (!script) return;
  sonde_free(script->knots);
  sonde_free(script);
}

// Weighted harmonic mean of the secants left and right, zero where they change sign: the cubic
// then stays between its knots (Fritsch and Butland).
static double slope(double secant_l, double secant_r, double width_l, double width_r) {
  if (secant_l * secant_r <= 0.0) return 0.0;
  double weight_l = 2.0 * width_r + width_l, weight_r = width_r + 2.0 * width_l;
  return (weight_l + weight_r) / (weight_l / secant_l + weight_r / secant_r);
}

sonde_status sonde_device_script(const sonde_script_key *keys, uint32_t count, double dt_s,
                                 sonde_device *device, sonde_error *error) {
  SONDE_ASSERT(device != NULL);
  *device = (sonde_device){0};
  if (!keys || count == 0)
    return sonde_fail(error, SONDE_ARGUMENT, "script: no keys, expected 1 or more");
  if (!(dt_s > 0.0) || !isfinite(dt_s))
    return sonde_fail(error, SONDE_ARGUMENT, "script: a tick lasts %g s, expected more than 0",
                      dt_s);
  for (uint32_t i = 0; i < count; ++i) {
    if (!isfinite(keys[i].time_s) || !sonde_pose_usable(keys[i].world_from_probe))
      return sonde_fail(error, SONDE_ARGUMENT, "script: key %u is not finite", i);
    if (i > 0 && !(keys[i].time_s > keys[i - 1].time_s))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "script: key %u at %g s does not follow key %u at %g s, expected ascending "
                        "times",
                        i, keys[i].time_s, i - 1, keys[i - 1].time_s);
  }
  sonde_script_device *script = SONDE_NEW(sonde_script_device, 1);
  if (script) script->knots = SONDE_NEW(sonde_script_knot, count);
  if (!script || !script->knots) {
    destroy(script);
    return sonde_fail_memory(error);
  }
  script->dt_s = dt_s;
  script->count = count;
  for (uint32_t i = 0; i < count; ++i) {
    sonde_pose pose = keys[i].world_from_probe;
    script->knots[i].time_s = keys[i].time_s;
    script->knots[i].pose = (sonde_pose){pose.position, q_unit(pose.rotation)};
  }
  for (uint32_t i = 1; i + 1 < count; ++i) {
    sonde_script_knot *knot = &script->knots[i];
    double l = knot->time_s - knot[-1].time_s, r = knot[1].time_s - knot->time_s;
    SONDE_ASSERT(l > 0.0 && r > 0.0);
    sonde_vec3 a = v_scale(v_sub(knot->pose.position, knot[-1].pose.position), 1.0 / l);
    sonde_vec3 b = v_scale(v_sub(knot[1].pose.position, knot->pose.position), 1.0 / r);
    knot->slope_m_s = vec3(slope(a.x, b.x, l, r), slope(a.y, b.y, l, r), slope(a.z, b.z, l, r));
  }
  *device =
      (sonde_device){"script", script, sonde_script_read, sonde_device_write_nothing, destroy};
  return SONDE_OK;
}
