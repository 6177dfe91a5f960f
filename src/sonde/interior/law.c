// Area and shape of the vessels at an effective outside pressure: tube law of a vein, compression
// law of a clot, exponential law of an artery, ellipse of a section. Laws and constants:
// docs/interior_theory.md; calibrated on shared/data/vein_compression.
#include "base/base.h"
#include "interior/interior.h"

static const double contact_area = 0.06; // of the stress-free area: walls begin to touch
static const double study_wall_pa = 30e3, least_wall_pa = 10e3, most_wall_pa = 300e3;
static const double ring_inner_share = 0.797; // (4.16/4.66)^2
static const double artery_wall_pa = 150e3, artery_inner_share = 0.633;
static const double least_area = 1e-6;             // of the artery under any pressure
static const double artery_reference_pa = 12665.6; // 95 mmHg
static const double reference_pa = 1333.22387415; // 10 mmHg: the pressure the model's radii hold at

// Superposed stresses below the corners of four rectangles a x b (signed sides) at depth z.
sonde_vec3 sonde_rectangle_stress(double pressure_pa, double half_x_m, double half_y_m, double x_m,
                                  double y_m, double z_m) {
  SONDE_ASSERT(half_x_m > 0 && half_y_m > 0 && z_m > 0);
  sonde_vec3 sum = vec3(0, 0, 0);
  for (int corner = 0; corner < 4; ++corner) {
    const double a = half_x_m + (corner < 2 ? -1 : 1) * x_m, z = z_m;
    const double b = half_y_m + (corner % 2 == 0 ? -1 : 1) * y_m;
    const double ra = a * a + z * z, rb = b * b + z * z, r = sqrt(a * a + b * b + z * z);
    const double angle = atan2(a * b, z * r), turn = a * b * z / r;
    const sonde_vec3 stress =
        vec3(angle - turn / ra, angle - turn / rb, angle + turn * (1 / ra + 1 / rb));
    sum = v_add(sum, v_scale(stress, 1 / (2 * SONDE_PI)));
  }
  return v_scale(sum, pressure_pa);
}

// Hoop pressure over the shear modulus of the wall (Ogden, exponent 8, 0.5 mm on 4.16 mm) at a > 1:
// thick ring in plane strain, P = int (2/n)(l^n - l^-n)/(l (l^2 - 1)) dl from outside to inside.
static double ring_pressure(double a, double inner_share) {
  if (a <= 1 + 1e-6) return 0;
  double inner = sqrt(a), outer = sqrt(1 + (a - 1) * inner_share), sum = 0;
  enum { STEPS = 8 };
  for (int i = 0; i <= STEPS; ++i) {
    double l = outer + (inner - outer) * i / STEPS, l8 = l * l * l * l;
    l8 *= l8;
    double weight = i == 0 || i == STEPS ? 1 : i % 2 ? 4 : 2;
    sum += weight * 0.25 * (l8 - 1 / l8) / (l * (l * l - 1));
  }
  return sum * (inner - outer) / (3 * STEPS);
}

// Transmural pressure (Pa) of an open vein with area a over the stress-free one: the study's cubic
// for a wall of 30 kPa, and the ring's difference for another wall. A wall that is squeezed flat
// keeps its length and bends: 3 EI/r^3 is 50 Pa, nothing beside the muscle.
double sonde_vein_tube_pressure(double a, double wall_pa) {
  double cubic = 1e3 * (((1.688 * a - 5.746) * a + 12.547) * a - 8.248);
  double wall = wall_pa > 0 ? clamp(wall_pa, least_wall_pa, most_wall_pa) : study_wall_pa;
  return cubic + (wall - study_wall_pa) * ring_pressure(a, ring_inner_share);
}

// Area over the stress-free one: the pressure rises with the area; bracketed Newton. What resists
// closing is the tissue around, which has to follow inwards: the negative pressures scale with its
// modulus.
static double open_area(double transmural_pa, double wall_pa, double hold) {
  SONDE_ASSERT(isfinite(transmural_pa) && hold > 0);
  const double d = 1e-5;
  if (transmural_pa < 0) transmural_pa /= hold;
  double touch = sonde_vein_tube_pressure(contact_area, wall_pa);
  double touch_slope = (sonde_vein_tube_pressure(contact_area + d, wall_pa) - touch) / d;
  if (transmural_pa < touch)
    return contact_area * exp((transmural_pa - touch) / (touch_slope * contact_area));
  double low = contact_area, high = 8, a = 1;
  for (int i = 0; i < 60; ++i) {
    double p = sonde_vein_tube_pressure(a, wall_pa), excess = p - transmural_pa;
    if (fabs(excess) < 1e-6) break;
    if (excess > 0)
      high = a;
    else
      low = a;
    double next = a - excess * d / (sonde_vein_tube_pressure(a + d, wall_pa) - p);
    a = next > low && next < high ? next : 0.5 * (low + high);
  }
  return a;
}

double sonde_vein_area_ratio(const sonde_pathology *pathology, double outside_pa) {
  return sonde_vein_area_in(pathology, outside_pa, 1);
}

double sonde_vein_area_in(const sonde_pathology *pathology, double outside_pa, double hold) {
  SONDE_ASSERT(pathology != NULL && isfinite(outside_pa));
  double solid = clamp(pathology->thrombus_fraction, 0, 1), ratio = 0;
  if (solid < 1) {
    double wall = pathology->wall_shear_pa;
    double rest = open_area(pathology->venous_pressure_pa, wall, hold);
    ratio += (1 - solid) * open_area(pathology->venous_pressure_pa - outside_pa, wall, hold) / rest;
  }
  if (!(solid > 0)) return ratio;
  // A clot keeps its volume; the tissue that is squeezed out along the vessel stretches it.
  double e = outside_pa > 0 ? outside_pa * 1e-3 : 0;
  double k = 0.0431 * pow(fmax(pathology->thrombus_modulus_pa, 1e3) / 24e3, -0.13);
  return ratio + solid * (1 / (1 + k * e / (1 + 0.0558 * e)));
}

double sonde_artery_area_ratio(const sonde_pathology *pathology, double outside_pa) {
  SONDE_ASSERT(pathology != NULL && isfinite(outside_pa));
  double relative = artery_reference_pa / fmax(pathology->arterial_pressure_pa, 1e3);
  double e = outside_pa > 0 ? outside_pa * 1e-3 * relative : 0;
  return fmax(exp(-(0.0185 + 0.0030 * e) * e), least_area);
}

double sonde_vein_rest_scale(const sonde_pathology *pathology, bool clot) {
  double scale = clot ? pathology->lumen_scale : 1.0;
  if (clot && pathology->thrombus_fraction >= 1) return scale;
  double wall = pathology->wall_shear_pa;
  return scale *
         sqrt(open_area(pathology->venous_pressure_pa, wall, 1) / open_area(reference_pa, wall, 1));
}

// Wall 150 kPa, 0.8 mm on 3.11 mm, in neo-Hookean muscle: bisection on the area.
static double artery_open_area(double pressure_pa) {
  double low = 1, high = 3;
  for (int i = 0; i < 40; ++i) {
    double a = 0.5 * (low + high);
    double p = artery_wall_pa * ring_pressure(a, artery_inner_share) +
               sonde_muscle_pa * 0.5 * (log(a) + 1 - 1 / a);
    if (p < pressure_pa)
      low = a;
    else
      high = a;
  }
  return 0.5 * (low + high);
}

double sonde_artery_rest_scale(const sonde_pathology *pathology) {
  double p = clamp(pathology->arterial_pressure_pa, 0, 40e3);
  return sqrt(artery_open_area(p) / artery_open_area(artery_reference_pa));
}

void sonde_vessel_shape(sonde_vessel_kind kind, const sonde_pathology *pathology, bool clot,
                        double ratio, double *half_short, double *half_long) {
  SONDE_ASSERT(ratio > 0 && half_short != NULL && half_long != NULL);
  double lost = clamp(1 - ratio, -1, 1), widening = (0.294 + 0.153 * lost) * lost;
  if (kind == SONDE_VESSEL_ARTERY) {
    widening = 0.33 * lost;
  } else if (clot) {
    double solid = clamp(pathology->thrombus_fraction, 0, 1);
    double c = 0.83 * pow(fmax(pathology->thrombus_modulus_pa, 1e3) / 24e3, -0.47);
    widening = (1 - solid) * widening + solid * c * lost;
  }
  *half_long = 1 + widening;
  *half_short = fmax(ratio, 1e-4) / *half_long;
}

bool sonde_pathology_clot(const sonde_pathology *pathology, double z_m) {
  if (!(pathology->thrombus_fraction > 0)) return false;
  if (!(pathology->thrombus_to_m > pathology->thrombus_from_m)) return true;
  return z_m >= pathology->thrombus_from_m && z_m <= pathology->thrombus_to_m;
}
