// Pressures of the femoral vessels in time: closed functions of t, so that a tick says all.
#include "base/base.h"
#include "interior/interior.h"

// Venous pressure at the groin, mmHg: supine about 10, sitting and standing by the column of blood
// up to the heart, part of it carried by the valves (docs/interior_theory.md).
static const double posture_mmhg[SONDE_POSTURE_COUNT] = {10, 25, 32};
static const double rise_s = 0.6; // of a strain, and of its release
// Specific weight of blood, and the share of its column below the groin that veins carry: none
// lying, where 7 to 10 mmHg are found from groin to ankle; all of it sitting still, about 56 mmHg
// at the ankle of a hanging calf; standing what gives 76 to 79 mmHg at the ankle, valves bear the
// rest. Groin and knee by their shares of a limb's axis, which begins a fifth of the thigh above
// the hip and ends at the ankle.
static const double blood_pa_m = 1055 * 9.81, vein_share[SONDE_POSTURE_COUNT] = {0, 1, 0.7};
static const double groin_share = 0.09, knee_share = 0.56;

sonde_circulation sonde_circulation_default(void) {
  return (sonde_circulation){.posture = SONDE_POSTURE_SUPINE,
                             .heart_rate_hz = 1.1,
                             .systolic_pa = 120 * SONDE_PA_PER_MMHG,
                             .diastolic_pa = 80 * SONDE_PA_PER_MMHG,
                             .breath_rate_hz = 0.25,
                             .breath_pa = 1.5 * SONDE_PA_PER_MMHG,
                             .valsalva_pa = 20 * SONDE_PA_PER_MMHG};
}

static double strain_share(const sonde_circulation *c, double t) {
  if (!(c->valsalva_to_s > c->valsalva_from_s)) return 0;
  return smooth_step((t - c->valsalva_from_s) / rise_s) *
         (1 - smooth_step((t - c->valsalva_to_s) / rise_s));
}

// Time since a smooth rise began that has reached `share`: the root of 3 x^2 - 2 x^3 = share.
static double rising_for(double share) {
  return rise_s * (0.5 - sin(asin(clamp(1 - 2 * share, -1, 1)) / 3));
}

void sonde_circulation_strain(sonde_circulation *c, double t, bool on) {
  SONDE_ASSERT(c != NULL && isfinite(t));
  double share = strain_share(c, t);
  c->valsalva_from_s = on ? t - rising_for(share) : (double)-INFINITY;
  c->valsalva_to_s = on ? (double)INFINITY : t - rising_for(1 - share);
}

// Inspiration raises the pressure in the belly and with it that of the leg's veins. A strain holds
// the breath.
double sonde_venous_pressure(const sonde_circulation *c, double t) {
  SONDE_ASSERT(c != NULL && c->posture < SONDE_POSTURE_COUNT && isfinite(t));
  double strain = strain_share(c, t);
  double breath = c->breath_pa * sin(2 * SONDE_PI * fmod(c->breath_rate_hz * t, 1));
  return sonde_posture_pressure(c->posture, SONDE_VESSEL_VEIN, 0) + (1 - strain) * breath +
         strain * c->valsalva_pa;
}

double sonde_posture_pressure(sonde_posture posture, sonde_vessel_kind kind, double below_m) {
  SONDE_ASSERT(posture < SONDE_POSTURE_COUNT && isfinite(below_m));
  if (kind == SONDE_VESSEL_ARTERY)
    return posture == SONDE_POSTURE_SUPINE ? 0 : blood_pa_m * below_m;
  return fmax(
      posture_mmhg[posture] * SONDE_PA_PER_MMHG + vein_share[posture] * blood_pa_m * below_m, 0);
}

double sonde_hydrostatic_pressure(const sonde_interior *in, sonde_posture posture,
                                  sonde_vessel_kind kind, sonde_vec3 rest) {
  SONDE_ASSERT(in != NULL && posture < SONDE_POSTURE_COUNT);
  const sonde_model *m = in->model;
  const sonde_gravity *g = &m->gravity;
  if (m->bone_axis_m == NULL) return 0;
  if (v_norm2(g->up) > 0)
    return sonde_posture_pressure(g->posture, kind, v_dot(v_sub(g->groin_m, rest), g->up)) -
           sonde_posture_pressure(SONDE_POSTURE_SUPINE, kind, 0);
  double top = m->bone_axis_m[0].z, length = m->bone_axis_m[m->bone_axis_count - 1].z - top;
  double below = rest.z - top - groin_share * length;
  if (posture == SONDE_POSTURE_SITTING) // a straight model's thigh is level and its calf hangs
    below = fmax(0, rest.z - top - knee_share * length);
  return sonde_posture_pressure(posture, kind, below) - sonde_posture_pressure(posture, kind, 0);
}

// The systolic and the dicrotic wave add up to a pulse that spans exactly 0..1 over a beat.
double sonde_arterial_pressure(const sonde_circulation *c, double t) {
  SONDE_ASSERT(c != NULL && isfinite(t));
  double beats = c->heart_rate_hz * t, phase = beats - floor(beats);
  double rise = smooth_step(phase / 0.14), fall = 1 - smooth_step((phase - 0.14) / 0.42);
  double echo = 0.18 * smooth_step((phase - 0.40) / 0.10) * (1 - smooth_step((phase - 0.50) / 0.5));
  return c->diastolic_pa + (c->systolic_pa - c->diastolic_pa) * fmin(rise * fall + echo, 1);
}

void sonde_circulation_apply(const sonde_circulation *c, uint64_t tick, double dt_s,
                             sonde_pathology *pathology) {
  SONDE_ASSERT(pathology != NULL && dt_s > 0);
  double t = (double)tick * dt_s;
  pathology->venous_pressure_pa = sonde_venous_pressure(c, t);
  pathology->arterial_pressure_pa = sonde_arterial_pressure(c, t);
}
