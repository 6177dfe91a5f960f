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
// Veins in a loose sheath by published figures (docs/interior_theory.md). Areas are relative to the
// area at 10 mmHg, slopes are transmural pressure over relative area.
static const double filled_area = 1.75; // no pressure fills a vein beyond this area
static const double closed_area = 0.05; // the walls begin to touch, outside closing_pa above inside
static const double closing_pa = 10 * SONDE_PA_PER_MMHG;
static const double deep_slope_pa = SONDE_PA_PER_MMHG / 0.031;        // femoral vein at 10 mmHg
static const double superficial_slope_pa = SONDE_PA_PER_MMHG / 0.012; // great saphenous vein there
static const double closing_slope_pa = 8 * SONDE_PA_PER_MMHG;         // where the walls touch
static const double least_slope = 1.5; // of a soft wall at 10 mmHg, over closing_slope_pa
// An artery in a loose sheath: transmural pressure over relative diameter; its wall buckles where
// the transmural pressure is buckling_pa below zero, within some buckling_width_pa.
static const double artery_modulus_pa = 150e3;
static const double buckling_pa = 7 * SONDE_PA_PER_MMHG, buckling_width_pa = 3 * SONDE_PA_PER_MMHG;

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

// Transmural pressure (Pa) of an open vein that is glued to muscle, with area a over the
// stress-free one: the study's cubic for a wall of 30 kPa, and the ring's difference for another
// wall. A wall that is squeezed flat keeps its length and bends: 3 EI/r^3 is 50 Pa, nothing beside
// the muscle.
double sonde_vein_tube_pressure(double a, double wall_pa) {
  double cubic = 1e3 * (((1.688 * a - 5.746) * a + 12.547) * a - 8.248);
  double wall = wall_pa > 0 ? clamp(wall_pa, least_wall_pa, most_wall_pa) : study_wall_pa;
  return cubic + (wall - study_wall_pa) * ring_pressure(a, ring_inner_share);
}

// Transmural pressure (Pa) of a vein in a loose sheath whose area is a times that at 10 mmHg. Above
// 10 mmHg the area approaches filled_area; below, it follows a power of a that leaves 10 mmHg with
// slope_pa and reaches closed_area at -closing_pa with closing_slope_pa.
static double loose_pressure(double a, double slope_pa) {
  SONDE_ASSERT(a > 0 && a < filled_area && slope_pa > closing_slope_pa);
  if (a >= 1)
    return reference_pa + slope_pa * (filled_area - 1) * log((filled_area - 1) / (filled_area - a));
  double power = (slope_pa - closing_slope_pa) /
                 (reference_pa + closing_pa - closing_slope_pa * (1 - closed_area));
  return reference_pa + (slope_pa - closing_slope_pa) * (pow(a, power) - 1) / power +
         closing_slope_pa * (a - 1);
}

// The wall of a vein and the tissue that it lies in. Areas are relative to the area at 10 mmHg.
typedef struct vein_wall {
  double wall_pa;    // shear modulus; 0: the study's
  double sheath;     // 0 loose .. 1 glued
  double hold;       // shear modulus of the tissue around over that of muscle
  double slope_pa;   // pressure over relative area at 10 mmHg, in a loose sheath
  double glued_area; // of the glued vein at 10 mmHg over its stress-free area
  double touch_area; // the walls begin to touch
} vein_wall;

// Transmural pressure (Pa) at a relative area, between loose and glued by the sheath. A glued vein
// that closes draws the tissue around it inwards: its negative pressures scale with that tissue's
// modulus.
static double wall_pressure(const vein_wall *w, double a) {
  double loose = w->sheath < 1 ? loose_pressure(a, w->slope_pa) : 0, glued = 0;
  if (w->sheath > 0) glued = sonde_vein_tube_pressure(a * w->glued_area, w->wall_pa);
  if (glued < 0) glued *= w->hold;
  return loose + w->sheath * (glued - loose);
}

// Relative area at a transmural pressure, by Newton's method between bounds: the pressure rises
// with the area. Once the walls touch, the area falls off exponentially from the slope there.
static double open_area(const vein_wall *w, double transmural_pa) {
  SONDE_ASSERT(isfinite(transmural_pa) && w->hold > 0);
  const double d = 1e-5;
  double touch = wall_pressure(w, w->touch_area);
  double touch_slope = (wall_pressure(w, w->touch_area + d) - touch) / d;
  if (transmural_pa < touch)
    return w->touch_area * exp((transmural_pa - touch) / (touch_slope * w->touch_area));
  double low = w->touch_area, high = w->sheath < 1 ? filled_area - 2 * d : 8, a = 1;
  for (int i = 0; i < 60; ++i) {
    double p = wall_pressure(w, a), excess = p - transmural_pa;
    if (fabs(excess) < 1e-6) break;
    if (excess > 0)
      high = a;
    else
      low = a;
    double next = a - excess * d / (wall_pressure(w, a + d) - p);
    a = next > low && next < high ? next : 0.5 * (low + high);
  }
  return a;
}

// The wall as a pathology describes it, between muscles or in the fat.
static vein_wall wall_of(const sonde_pathology *pathology, bool in_fat) {
  double wall = pathology->wall_shear_pa;
  vein_wall w = {.wall_pa = wall,
                 .sheath = clamp(pathology->sheath, 0, 1),
                 .hold = in_fat ? sonde_fat_pa / sonde_muscle_pa : 1,
                 .glued_area = 1,
                 .touch_area = closed_area};
  w.slope_pa = in_fat ? superficial_slope_pa : deep_slope_pa;
  if (wall > 0) w.slope_pa *= clamp(wall, least_wall_pa, most_wall_pa) / study_wall_pa;
  w.slope_pa = fmax(w.slope_pa, least_slope * closing_slope_pa);
  if (w.sheath > 0) {
    vein_wall glued = w;
    glued.sheath = 1, glued.hold = 1, glued.touch_area = contact_area;
    w.glued_area = open_area(&glued, reference_pa);
    w.touch_area = contact_area / w.glued_area;
  }
  return w;
}

double sonde_vein_area_ratio(const sonde_pathology *pathology, double outside_pa) {
  return sonde_vein_area_in(pathology, outside_pa, false);
}

double sonde_vein_area_in(const sonde_pathology *pathology, double outside_pa, bool in_fat) {
  SONDE_ASSERT(pathology != NULL && isfinite(outside_pa));
  double solid = clamp(pathology->thrombus_fraction, 0, 1), ratio = 0;
  if (solid < 1) {
    vein_wall w = wall_of(pathology, in_fat);
    double rest = open_area(&w, pathology->venous_pressure_pa);
    ratio += (1 - solid) * open_area(&w, pathology->venous_pressure_pa - outside_pa) / rest;
  }
  if (!(solid > 0)) return ratio;
  // A clot keeps its volume; the tissue that is squeezed out along the vessel stretches it.
  double e = outside_pa > 0 ? outside_pa * 1e-3 : 0;
  double k = 0.0431 * pow(fmax(pathology->thrombus_modulus_pa, 1e3) / 24e3, -0.13);
  return ratio + solid * (1 / (1 + k * e / (1 + 0.0558 * e)));
}

// In a loose sheath: the elastic modulus of pressure and strain while blood fills the artery, and
// buckling of the wall where the transmural pressure falls through zero. Glued: the study's law.
double sonde_artery_area_ratio(const sonde_pathology *pathology, double outside_pa) {
  SONDE_ASSERT(pathology != NULL && isfinite(outside_pa));
  double inside = fmax(pathology->arterial_pressure_pa, 1e3), pressed = fmax(outside_pa, 0);
  double e = pressed * 1e-3 * artery_reference_pa / inside;
  double glued = exp(-(0.0185 + 0.0030 * e) * e), loose = fmax(1 - pressed / artery_modulus_pa, 0);
  loose *= loose * (1 + exp(-(inside + buckling_pa) / buckling_width_pa)) /
           (1 + exp(-(inside - pressed + buckling_pa) / buckling_width_pa));
  return fmax(loose + clamp(pathology->sheath, 0, 1) * (glued - loose), least_area);
}

double sonde_vein_rest_scale(const sonde_pathology *pathology, bool clot, bool in_fat) {
  double scale = clot ? pathology->lumen_scale : 1.0;
  if (clot && pathology->thrombus_fraction >= 1) return scale;
  vein_wall w = wall_of(pathology, in_fat);
  return scale * sqrt(open_area(&w, pathology->venous_pressure_pa));
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
