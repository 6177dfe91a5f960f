// Flow in the veins from the calf to the right atrium (docs/flow_theory.md): a segment holds a
// volume and lets blood out towards the heart through resistance, inertance and a valve.
#include "sonde/flow.h"
#include "sonde/limb_vessels.h"

#include "base/base.h"
#include "base/maths.h"

#define N SONDE_FLOW_SEGMENTS
static const double blood_pa_s = 3.5e-3, blood_kg_m3 = 1060;
static const double mmhg_pa = 133.322, ml = 1e-6;
// Share of the capillaries' blood that enters at each segment: the deep femoral and great saphenous
// veins join the common femoral one, the internal iliac the common iliac.
static const double share[N] = {0.371, 0.05, 0.05, 0.314, 0, 0.215};
static const bool has_valve[N] = {true, true, true, true, false, false};
// Volume of the calf's veins without pressure across their walls, and how it grows: 2.5 l of calf
// hold 1.1 % more per kPa. The others hold their length times their area. None holds more than this
// many times as much beyond its volume without pressure.
static const double calf_volume_m3 = 12e-6, calf_per_pa = 0.31 / 133.322;
static const double wall_s = 0.1; // a wall's viscosity over its stiffness
static const double stretch_per_pa = 0.12 / 133.322, most_stretch = 6;
static const double arterioles_pa = 85 * 133.322, atrium_pa = 5 * 133.322;
// Veins side by side in a segment: the calf's tibial and peroneal pairs.
static const double tubes[N] = {6, 1, 1, 1, 1, 1};
// Shares of the belly's pressure that act on a segment from outside.
static const double belly[N] = {0, 0, 0, 0, 0.2, 1};
static const double squeeze_s = 1.2, strain_s = 0.5, pulse_pa = 0.12 * 133.322;
// A valve follows the flow in this time; open by w it has the resistance 1/(w^2 + least) of its
// segment.
static const double valve_s = 0.06, valve_least = 1e-5;
// Ways round a clot that is new: so many times the segment's own resistance.
static const double detour = 300;

const char *sonde_flow_segment_name(sonde_flow_segment segment) {
  static const char *const NAME[N] = {"calf",           "popliteal",      "femoral",
                                      "common-femoral", "external-iliac", "common-iliac"};
  SONDE_ASSERT(segment < N);
  return NAME[segment];
}

sonde_flow_def sonde_flow_def_default(const sonde_limb *limb) {
  sonde_flow_def def = {.length_m = {0.25, 0.16, 0.26, 0.07, 0.1, 0.06},
                        .area_m2 = {40e-6, 45e-6, 50e-6, 85e-6, 95e-6, 130e-6},
                        .inflow_m3_s = 7 * ml,
                        .heart_rate_hz = 1.15,
                        .breath_rate_hz = 0.25,
                        .breath_pa = 0.35 * mmhg_pa,
                        .squeeze_from_s = INFINITY,
                        .squeeze_pa = 20 * mmhg_pa,
                        .valsalva_from_s = INFINITY,
                        .valsalva_to_s = INFINITY,
                        .valsalva_pa = 30 * mmhg_pa};
  static const struct {
    sonde_flow_segment segment;
    const char *branch;
  } OF[] = {{SONDE_FLOW_POPLITEAL, "popliteal vein"},
            {SONDE_FLOW_FEMORAL, "femoral vein"},
            {SONDE_FLOW_COMMON_FEMORAL, "common femoral vein"}};
  for (size_t k = 0; limb && k < SONDE_COUNT_OF(OF); ++k) {
    uint32_t branch = sonde_limb_vessel_find(limb, OF[k].branch);
    if (branch == SONDE_LIMB_NO_VESSEL) continue;
    sonde_limb_vessel vessel = sonde_limb_vessel_get(limb, branch);
    // The harmonic mean of the squares is what resists like the whole length.
    enum { PLACES = 16 };
    double sum = 0;
    for (int i = 0; i < PLACES; ++i) {
      double arc = vessel.length_m * (i + 0.5) / PLACES;
      sum += 1 / pow(sonde_limb_vessel_place(limb, branch, arc).area_m2, 2);
    }
    def.length_m[OF[k].segment] = vessel.length_m;
    def.area_m2[OF[k].segment] = sqrt(PLACES / sum);
  }
  return def;
}

static double smooth_rise(double t, double from, double length) {
  return isfinite(from) ? smooth_step((t - from) / length) : 0;
}

// Pressures outside a segment and in the right atrium at a time.
static double outside(const sonde_flow_def *def, double t, sonde_flow_segment segment) {
  double strain = smooth_rise(t, def->valsalva_from_s, strain_s) *
                  (1 - smooth_rise(t, def->valsalva_to_s, strain_s));
  double breath = (1 - strain) * def->breath_pa * sin(2 * SONDE_PI * def->breath_rate_hz * t);
  double inside = breath + strain * def->valsalva_pa;
  if (segment == N) // the chest takes part in a strain, and the heart's beat is felt
    return atrium_pa + inside + pulse_pa * sin(2 * SONDE_PI * def->heart_rate_hz * t);
  double since = t - def->squeeze_from_s;
  bool squeezed = segment == SONDE_FLOW_CALF && since > 0 && since < squeeze_s;
  return belly[segment] * inside +
         (squeezed ? def->squeeze_pa * pow(sin(SONDE_PI * since / squeeze_s), 2) : 0);
}

static double rest_volume(const sonde_flow_def *def, uint32_t k) {
  return k == SONDE_FLOW_CALF ? calf_volume_m3 : def->length_m[k] * def->area_m2[k];
}

static double stretch(uint32_t k) { return k == SONDE_FLOW_CALF ? calf_per_pa : stretch_per_pa; }

// Pressure across the wall: stiffer the fuller the vein, steeply falling when it is empty.
static double across(const sonde_flow_def *def, uint32_t k, double volume_m3, double *slope) {
  double full = rest_volume(def, k), beyond = volume_m3 / full - 1;
  double soft = beyond < 0 ? 1 : 1 - fmin(beyond / most_stretch, 0.99);
  *slope = 1 / (stretch(k) * full * (beyond < 0 ? 1 + beyond : soft * soft));
  return (beyond < 0 ? log(1 + beyond) : beyond / soft) / stretch(k);
}

// Of the segment alone, without its valve.
static double resistance(const sonde_flow_def *def, uint32_t k) {
  double open = 1 - def->closed[k], area = def->area_m2[k];
  double plain = 8 * SONDE_PI * blood_pa_s * def->length_m[k] * tubes[k] / (area * area);
  return plain / (open * open + 1 / detour);
}

sonde_status sonde_flow_start(const sonde_flow_def *def, sonde_flow *flow, sonde_error *error) {
  SONDE_ASSERT(def && flow);
  for (int k = 0; k < N; ++k)
    if (!(def->length_m[k] >= 0.005 && def->length_m[k] <= 2) ||
        !(def->area_m2[k] >= 1e-6 && def->area_m2[k] <= 1e-3) ||
        !(def->closed[k] >= 0 && def->closed[k] <= 1))
      return sonde_fail(
          error, SONDE_ARGUMENT,
          "%s: expected a length of 5 mm to 2 m, an area of 1 to 1000 mm2 and a closed "
          "share of 0 to 1",
          sonde_flow_segment_name((sonde_flow_segment)k));
  if (!(def->leak >= 0 && def->leak <= 1))
    return sonde_fail(error, SONDE_ARGUMENT, "leak: expected 0 to 1");
  if (!(def->inflow_m3_s > 0 && def->inflow_m3_s <= 1e-4))
    return sonde_fail(error, SONDE_ARGUMENT, "inflow: expected more than 0, at most 100 ml/s");
  if (!(def->heart_rate_hz > 0 && def->heart_rate_hz <= 5 && def->breath_rate_hz >= 0 &&
        def->breath_rate_hz <= 2))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "rates: expected 0 to 5 Hz (heart), 0 to 2 Hz (breath)");
  *flow = (sonde_flow){.def = *def};
  // Flow and pressures that stay: inflow sums up, pressures fall towards the atrium.
  double sum = 0, pressure = atrium_pa;
  for (int k = 0; k < N; ++k) {
    sum += share[k] * def->inflow_m3_s;
    flow->flow_m3_s[k] = sum, flow->open[k] = 1;
  }
  for (int k = N; k-- > 0;) {
    pressure += flow->flow_m3_s[k] * resistance(def, (uint32_t)k);
    double beyond = stretch((uint32_t)k) * pressure;
    flow->volume_m3[k] = rest_volume(def, (uint32_t)k) * (1 + beyond / (1 + beyond / most_stretch));
  }
  return SONDE_OK;
}

void sonde_flow_step(sonde_flow *flow, double dt_s) {
  const sonde_flow_def *def = &flow->def;
  SONDE_ASSERT(dt_s >= 1e-5 && dt_s <= 1e-2);
  enum { PASSES = 4 };
  double t = flow->time_s + dt_s, inflow[N], guess[N], flow_now[N];
  for (uint32_t k = 0; k < N; ++k) {
    // Capillaries hold their flow up against any pressure below some 10 mmHg.
    double slope, pressure = across(def, k, flow->volume_m3[k], &slope) +
                             outside(def, t, (sonde_flow_segment)k);
    inflow[k] = share[k] * def->inflow_m3_s *
                fmax(arterioles_pa - fmax(pressure, 2 * atrium_pa), 0) /
                (arterioles_pa - 2 * atrium_pa);
    guess[k] = flow->volume_m3[k];
    double before = flow->flow_m3_s[k], wanted = before > 0 ? 1 : def->leak;
    if (has_valve[k]) flow->open[k] += (wanted - flow->open[k]) * (1 - exp(-dt_s / valve_s));
  }
  // Newton: with pressures p + s (V - guess) + s tau dV/dt, tau the walls' time, the flows of the
  // end of the step satisfy (L/dt + R + (s_k + s_k+1)(dt + tau)) Q_k - s_k (dt + tau) Q_k-1
  // - s_k+1 (dt + tau) Q_k+1 = L/dt Q_before + p_k - p_k+1.
  for (int pass = 0; pass < PASSES; ++pass) {
    double pressure[N + 1], slope[N], diagonal[N], upper[N], right[N];
    for (uint32_t k = 0; k < N; ++k) {
      pressure[k] = across(def, k, guess[k], &slope[k]);
      pressure[k] += slope[k] * (flow->volume_m3[k] + (dt_s + wall_s) * inflow[k] - guess[k]) +
                     outside(def, t, (sonde_flow_segment)k);
    }
    pressure[N] = outside(def, t, SONDE_FLOW_SEGMENTS);
    for (uint32_t k = 0; k < N; ++k) {
      double w = flow->open[k], factor = has_valve[k] ? 1 / (w * w + valve_least) : 1;
      double inertance = blood_kg_m3 * def->length_m[k] / def->area_m2[k];
      double own = slope[k] * (dt_s + wall_s);
      double next = k + 1 == N ? 0 : slope[k + 1] * (dt_s + wall_s);
      diagonal[k] = inertance / dt_s + factor * resistance(def, k) + own + next;
      upper[k] = -next;
      right[k] = inertance / dt_s * flow->flow_m3_s[k] + pressure[k] - pressure[k + 1];
    }
    // Thomas: the matrix is tridiagonal with the lower part -s_k (dt + tau).
    for (uint32_t k = 1; k < N; ++k) {
      double factor = -slope[k] * (dt_s + wall_s) / diagonal[k - 1];
      diagonal[k] -= factor * upper[k - 1];
      right[k] -= factor * right[k - 1];
    }
    for (uint32_t k = N; k-- > 0;)
      flow_now[k] = (right[k] - (k + 1 < N ? upper[k] * flow_now[k + 1] : 0)) / diagonal[k];
    for (uint32_t k = 0; k < N; ++k) {
      double in = inflow[k] + (k ? flow_now[k - 1] : 0);
      guess[k] = fmax(flow->volume_m3[k] + dt_s * (in - flow_now[k]), 0.3 * guess[k]);
    }
  }
  for (uint32_t k = 0; k < N; ++k) {
    double in = inflow[k] + (k ? flow_now[k - 1] : 0), least = 1e-4 * rest_volume(def, k);
    flow->volume_m3[k] = fmax(flow->volume_m3[k] + dt_s * (in - flow_now[k]), least);
    flow->flow_m3_s[k] = flow_now[k];
  }
  flow->time_s = t;
}

double sonde_flow_velocity(const sonde_flow *flow, sonde_flow_segment segment) {
  SONDE_ASSERT(segment < N);
  double open = fmax(1 - flow->def.closed[segment], 0.02);
  return flow->flow_m3_s[segment] / (flow->def.area_m2[segment] * open);
}

double sonde_flow_pressure(const sonde_flow *flow, sonde_flow_segment segment) {
  double slope;
  SONDE_ASSERT(segment < N);
  return across(&flow->def, segment, flow->volume_m3[segment], &slope) +
         outside(&flow->def, flow->time_s, segment);
}

double sonde_flow_artery(double beat) {
  // Systole, reverse flow, a small forward wave: peak 0.5, reverse -0.14 m/s.
  static const double WAVE[3][3] = {{0.48, 0.13, 0.05}, {-0.14, 0.30, 0.05}, {0.06, 0.45, 0.07}};
  double sum = 0.02, at = beat - floor(beat);
  for (int k = 0; k < 3; ++k)
    sum += WAVE[k][0] * exp(-0.5 * pow((at - WAVE[k][1]) / WAVE[k][2], 2));
  return sum;
}
