// The device that follows keys: one tick.
// find_span: the interval of knots that holds a time, near the last one used.
// hermite:   cubic with given ends and slopes.
#include "haptics/devices/devices.h"

#include "haptics/motion.h"

static uint32_t find_span(const sonde_script_device *script, double time_s) {
  uint32_t span = script->span;
  while (span > 0 && time_s < script->knots[span].time_s) span--;
  while (span + 2 < script->count && time_s >= script->knots[span + 1].time_s) span++;
  return span;
}

static sonde_vec3 hermite(const sonde_script_knot *a, const sonde_script_knot *b, double u) {
  double width = b->time_s - a->time_s, r = 1.0 - u;
  double rise = u * u * (3.0 - 2.0 * u);
  sonde_vec3 p = v_madd(a->pose.position, rise, v_sub(b->pose.position, a->pose.position));
  p = v_madd(p, width * u * r * r, a->slope_m_s);
  return v_madd(p, -width * u * u * r, b->slope_m_s);
}

void sonde_script_read(void *self, uint64_t tick, sonde_device_sample *sample) {
  sonde_script_device *script = self;
  SONDE_ASSERT(script->count > 0);
  double time_s = (double)tick * script->dt_s;
  const sonde_script_knot *first = script->knots, *last = first + script->count - 1;
  *sample = (sonde_device_sample){last->pose, 0, true};
  if (time_s <= first->time_s) {
    sample->world_from_probe = first->pose;
  } else if (time_s < last->time_s) {
    script->span = find_span(script, time_s);
    const sonde_script_knot *a = script->knots + script->span, *b = a + 1;
    double u = clamp((time_s - a->time_s) / (b->time_s - a->time_s), 0.0, 1.0);
    sample->world_from_probe =
        (sonde_pose){hermite(a, b, u), sonde_quat_slerp(a->pose.rotation, b->pose.rotation, u)};
  }
}
