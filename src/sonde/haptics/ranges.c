// Ranges of the numbers of a hand's limits and of the rendering: one list for the replacement of a
// number that is outside of its range and for its refusal.
#include "haptics/ranges.h"

#include "base/base.h"

#include <math.h>
#include <stddef.h>

#define LIMIT(member)                                                                              \
  { "limits." #member, offsetof(sonde_safety_limits, member), 0, 1e300 }
static const sonde_range LIMITS[] = {
    LIMIT(force_n), LIMIT(torque_n_m),   LIMIT(slew_n_s),  LIMIT(fade_s),       LIMIT(soft_start_s),
    LIMIT(stale_s), LIMIT(continuous_n), LIMIT(thermal_s), LIMIT(velocity_m_s), LIMIT(impulse_n_s)};
_Static_assert(sizeof(sonde_safety_limits) == SONDE_COUNT_OF(LIMITS) * sizeof(double), "all");
#define RENDERING(member, low, high)                                                               \
  { "rendering." #member, offsetof(sonde_render_def, member), low, high }
static const sonde_range RENDERING[] = {
    RENDERING(force_scale, 1e-3, 100), RENDERING(stiffness_n_m, 0, 1e5),
    RENDERING(damping_n_s_m, 0, 1e3),  RENDERING(probe_mass_kg, 1e-3, 10),
    RENDERING(filter_rad_s, 1, 1e5),   RENDERING(controller_max_n_s_m, 0, 1e3),
    RENDERING(reserve_j, 0, 1),
};

static double member(const void *def, const sonde_range *r) {
  return *(const double *)(const void *)((const char *)def + r->offset);
}

static bool is_within(const void *def, const sonde_range *r) {
  return member(def, r) >= r->low && member(def, r) <= r->high;
}

static void clean(void *def, const void *otherwise, const sonde_range *list, size_t count) {
  for (size_t k = 0; k < count; ++k)
    if (!is_within(def, &list[k]))
      *(double *)(void *)((char *)def + list[k].offset) = member(otherwise, &list[k]);
}

sonde_status sonde_ranges_check(const char *what, const void *def, const sonde_range *list,
                                size_t count, sonde_error *error) {
  SONDE_ASSERT(def != NULL);
  for (size_t k = 0; k < count; ++k)
    if (!is_within(def, &list[k]))
      return sonde_fail(error, SONDE_ARGUMENT, "%s: %s is %g, expected %g to %g", what,
                        list[k].name, member(def, &list[k]), list[k].low, list[k].high);
  return SONDE_OK;
}

void sonde_limits_clean(sonde_safety_limits *limits) {
  const sonde_safety_limits otherwise = sonde_safety_limits_default();
  clean(limits, &otherwise, LIMITS, SONDE_COUNT_OF(LIMITS));
  if (!(limits->thermal_s > 0)) limits->thermal_s = otherwise.thermal_s;
  SONDE_ASSERT(limits->force_n >= 0 && limits->slew_n_s >= 0);
}

void sonde_render_def_clean(sonde_render_def *def) {
  const sonde_render_def otherwise = sonde_render_def_default();
  clean(def, &otherwise, RENDERING, SONDE_COUNT_OF(RENDERING));
  if (!(def->dt_s >= 1e-5 && def->dt_s <= 0.1)) def->dt_s = otherwise.dt_s;
  SONDE_ASSERT(def->probe_mass_kg > 0 && def->force_scale > 0);
}

sonde_status sonde_hand_check(const sonde_safety_limits *limits, const sonde_render_def *def,
                              sonde_error *error) {
  SONDE_ASSERT(limits && def);
  sonde_status status =
      sonde_ranges_check("session", limits, LIMITS, SONDE_COUNT_OF(LIMITS), error);
  return status ? status
                : sonde_ranges_check("session", def, RENDERING, SONDE_COUNT_OF(RENDERING), error);
}
