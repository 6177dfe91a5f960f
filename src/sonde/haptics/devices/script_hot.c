// The device that follows keys: one tick.
#include "haptics/devices/devices.h"

#include "haptics/motion.h"

void sonde_script_read(void *self, uint64_t tick, sonde_device_sample *sample) {
  sonde_script_device *script = self;
  SONDE_ASSERT(script->count > 0);
  double time_s = (double)tick * script->dt_s;
  const sonde_script_knot *first = script->knots, *last = first + script->count - 1;
  *sample = (sonde_device_sample){last->pose, 0, true};
  if (time_s <= first->time_s) {
    sample->world_from_probe = first->pose;
  } else if (time_s < last->time_s) {
    uint32_t span = script->span;
    while (span > 0 && time_s < script->knots[span].time_s) span--;
    while (span + 2 < script->count && time_s >= script->knots[span + 1].time_s) span++;
    script->span = span;
    // The position follows a cubic with given ends and slopes (Hermite), the rotation the short
    // arc.
    const sonde_script_knot *a = script->knots + span, *b = a + 1;
    double width = b->time_s - a->time_s, u = clamp((time_s - a->time_s) / width, 0.0, 1.0);
    double r = 1.0 - u, rise = u * u * (3.0 - 2.0 * u);
    sonde_vec3 p = v_madd(a->pose.position, rise, v_sub(b->pose.position, a->pose.position));
    p = v_madd(p, width * u * r * r, a->slope_m_s);
    p = v_madd(p, -width * u * u * r, b->slope_m_s);
    sample->world_from_probe =
        (sonde_pose){p, sonde_quat_slerp(a->pose.rotation, b->pose.rotation, u)};
  }
}
