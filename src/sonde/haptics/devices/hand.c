// The simulated operator: creation.
#include "haptics/devices/hand.h"

#include "base/base.h"
#include "base/maths.h"
#include "base/random.h"
#include "haptics/ranges.h"

#include <stddef.h>
#include <string.h>

static const sonde_hand_preset presets[] = {
    {"bare", 0.1, 0.0},  {"loose", 0.5, 0.5}, {"child", 0.2, 1.0},
    {"light", 0.5, 2.0}, {"firm", 1.0, 5.0},  {"heavy", 2.0, 3.0},
};

const sonde_hand_preset *sonde_hand_presets(uint32_t *count) {
  SONDE_ASSERT(count != NULL);
  *count = SONDE_COUNT_OF(presets);
  return presets;
}

sonde_hand_def sonde_hand_def_default(void) {
  return (sonde_hand_def){.version = SONDE_DEF_VERSION,
                          .mass_kg = 0.5,
                          .damping_n_s_m = 2.0,
                          .stiffness_n_m = 400.0,
                          .delay_s = 0.15,
                          .tremor_m = 50e-6,
                          .tremor_hz = 9.0};
}

#define RANGE(member, low, high)                                                                   \
  { #member, offsetof(sonde_hand_def, member), low, high }
static const sonde_range RANGES[] = {RANGE(mass_kg, 1e-3, 100),    RANGE(damping_n_s_m, 0, 1e4),
                                     RANGE(stiffness_n_m, 0, 1e5), RANGE(delay_s, 0, 1),
                                     RANGE(tremor_m, 0, 0.1),      RANGE(tremor_hz, 0, 100),
                                     RANGE(resolution_m, 0, 0.01), RANGE(force_limit_n, 0, 1e4)};

typedef struct square {
  double m[3][3];
} square;

static square multiply(square a, square b) {
  square c = {{{0}}};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      for (int k = 0; k < 3; ++k) c.m[i][j] += a.m[i][k] * b.m[k][j];
  return c;
}

// exp(a) = exp(a / 2^s)^(2^s); twelve terms of the sum suffice for |a| / 2^s <= 1/4.
static square exponential(square a) {
  double size = 0.0;
  for (int i = 0; i < 9; ++i) size = fmax(size, fabs((&a.m[0][0])[i]));
  int halvings = 0;
  for (; size > 0.08; size *= 0.5) halvings++;
  for (int i = 0; i < 9; ++i) (&a.m[0][0])[i] = ldexp((&a.m[0][0])[i], -halvings);
  square sum = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, term = sum;
  for (int n = 1; n <= 12; ++n) {
    term = multiply(term, a);
    for (int i = 0; i < 9; ++i) {
      (&term.m[0][0])[i] /= n;
      (&sum.m[0][0])[i] += (&term.m[0][0])[i];
    }
  }
  for (int i = 0; i < halvings; ++i) sum = multiply(sum, sum);
  return sum;
}

static void destroy(void *self) {
  sonde_hand *hand = self;
  if (!hand) return;
  if (hand->goal.destroy) hand->goal.destroy(hand->goal.self);
  sonde_free(hand);
}

sonde_status sonde_device_hand(const sonde_hand_def *def, const sonde_script_key *keys,
                               uint32_t count, double dt_s, sonde_device *device,
                               sonde_error *error) {
  SONDE_ASSERT(def != NULL && device != NULL);
  *device = (sonde_device){0};
  sonde_status status = sonde_def_check("hand", def->version, error);
  if (!status) status = sonde_ranges_check("hand", def, RANGES, SONDE_COUNT_OF(RANGES), error);
  if (status) return status;
  if (def->latency_ticks > SONDE_HAND_LATENCY)
    return sonde_fail(error, SONDE_ARGUMENT, "hand: latency_ticks is %u, expected 0 to %d",
                      def->latency_ticks, SONDE_HAND_LATENCY);
  if (!(dt_s >= 1e-5 && dt_s <= 0.1))
    return sonde_fail(error, SONDE_ARGUMENT, "hand: a tick, s, is %g, expected 1e-5 to 0.1", dt_s);
  sonde_hand *hand = SONDE_NEW(sonde_hand, 1);
  if (!hand) return sonde_fail_memory(error);
  status = sonde_device_script(keys, count, dt_s, &hand->goal, error);
  if (status) {
    destroy(hand);
    return status;
  }
  hand->def = *def;
  hand->dt_s = dt_s;
  hand->delay_ticks = (uint64_t)(def->delay_s / dt_s + 0.5);
  hand->x_m = hand->load_m = keys[0].world_from_probe.position;
  hand->rotation = q_unit(keys[0].world_from_probe.rotation);
  for (uint64_t i = 0; i < 3; ++i)
    hand->phase_rad[i] = 2.0 * SONDE_PI * sonde_random_uniform(def->seed, i);
  // (x, v h, load)' h = ((0 1 0) (-k h^2/m -b h/m h^2/m) (0 0 0)) (x, v h, load) is integrated
  // exactly; with v h the entries are balanced, so that little is lost in the squarings.
  double m = def->mass_kg, h = dt_s;
  square rate = {
      {{0, 1, 0}, {-def->stiffness_n_m * h * h / m, -def->damping_n_s_m * h / m, h * h / m}}};
  square step = exponential(rate);
  hand->a[0][0] = step.m[0][0];
  hand->a[0][1] = step.m[0][1] * h;
  hand->a[1][0] = step.m[1][0] / h;
  hand->a[1][1] = step.m[1][1];
  hand->b[0] = step.m[0][2];
  hand->b[1] = step.m[1][2] / h;
  *device = (sonde_device){"hand", hand, sonde_hand_read, sonde_hand_write, destroy};
  return SONDE_OK;
}
