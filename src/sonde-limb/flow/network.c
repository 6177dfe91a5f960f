// Flow in the veins from the calf to the right atrium (docs/flow_theory.md): a segment holds a
// volume and lets blood out towards the heart through resistance, inertance and a valve.
#include "sonde/flow.h"
#include "sonde/limb_vessels.h"

#include "base/base.h"
#include "base/maths.h"
#include "flow/blood.h"
#include "interior/law.h"
#include "limb/pose.h"
#include "limb/vessels.h"

#include <string.h>

#define N SONDE_FLOW_SEGMENTS
enum { VEINS = SONDE_FLOW_VEINS };
static const double ml = 1e-6;
// Where each segment lets its blood out; N: into the vena cava.
static const sonde_flow_segment next[N] = {SONDE_FLOW_POPLITEAL,      SONDE_FLOW_FEMORAL,
                                           SONDE_FLOW_COMMON_FEMORAL, SONDE_FLOW_EXTERNAL_ILIAC,
                                           SONDE_FLOW_COMMON_ILIAC,   SONDE_FLOW_SEGMENTS,
                                           SONDE_FLOW_COMMON_FEMORAL, SONDE_FLOW_COMMON_FEMORAL};
static const bool has_valve[N] = {true, true, true, true, false, false, true, true};
// Where no blood enters from tissue on the way the whole length resists; where all of it does, a
// half.
static const double entering[N] = {0.5, 1, 1, 1, 1, 1, 0.5, 0.5};
// A vein's volume grows by this share per Pa from the empty volume on, and it holds at most this
// many times as much beyond it: at 10 mmHg it widens by 3.2 % per mmHg.
static const double stretch_per_pa = 0.055 / SONDE_PA_PER_MMHG, most_stretch = 6;
// Volume of a tissue's small veins at rest over its own: a calf then holds 1.1 % more per kPa.
static const double blood_of_tissue = 0.046;
static const double wall_s = 0.1; // a wall's viscosity over its stiffness
// Pressures: of the arterioles; up to which capillaries hold their flow; in the vena cava, which
// the belly keeps above the right atrium's.
static const double arterioles_pa = 85 * SONDE_PA_PER_MMHG, held_pa = 15 * SONDE_PA_PER_MMHG,
                    cava_pa = 9 * SONDE_PA_PER_MMHG;
// Shares of the belly's pressure that act on a segment from outside.
static const double belly[N] = {0, 0, 0, 0, 0.2, 1, 0, 0};
static const double squeeze_s = 1.5, strain_s = 0.5, deep_breath_s = 5, deep_breath_times = 5,
                    pulse_pa = 0.12 * SONDE_PA_PER_MMHG;
// A valve follows the flow in this time; open by w it has the resistance 1/(w^2 + least) of its
// segment.
static const double valve_s = 0.06, valve_least = 1e-5;
// Ways round a clot that is new: so many times the segment's own resistance.
static const double detour = 300;

const char *sonde_flow_segment_name(sonde_flow_segment segment) {
  static const char *const NAME[N] = {"calf",           "popliteal",      "femoral",
                                      "common-femoral", "external-iliac", "common-iliac",
                                      "deep-femoral",   "great-saphenous"};
  SONDE_ASSERT(segment < N);
  return NAME[segment];
}

// Places on a branch over which areas are taken.
enum { PLACES = 32 };

// Mean areas of a branch and of the veins that leave it and come back, each over the branch's
// length; how much more they resist together than even lumina of these areas. Only the proximal
// `part` of the branch counts.
static double take_branch(const sonde_limb *limb, uint32_t branch, double part, bool fed,
                          double area_m2[2]) {
  const sonde_limb_vessel main = sonde_limb_vessel_get(limb, branch);
  double falls = 0, flows = 0;
  area_m2[0] = area_m2[1] = 0;
  for (int i = 0; i < PLACES; ++i) {
    const double share = (i + 0.5) / PLACES, arc = part * main.length_m * share;
    double area = sonde_limb_vessel_place(limb, branch, arc).area_m2, squares = area * area;
    area_m2[0] += area / PLACES;
    for (uint32_t b = 0; b < sonde_limb_vessel_count(limb); ++b) {
      const sonde_limb_vessel beside = sonde_limb_vessel_get(limb, b);
      const double low = fmin(beside.parent_arc_m, beside.joins_arc_m),
                   high = fmax(beside.parent_arc_m, beside.joins_arc_m);
      if (beside.parent != branch || beside.joins != branch || !(arc > low && arc < high)) continue;
      area = sonde_limb_vessel_place(limb, b, beside.length_m * (arc - low) / (high - low)).area_m2;
      area_m2[1] += area / PLACES, squares += area * area;
    }
    // Where blood enters all along, less of it has still to come.
    const double flow = fed ? 1 - share : 1;
    falls += flow / squares, flows += flow;
  }
  return falls / flows * (area_m2[0] * area_m2[0] + area_m2[1] * area_m2[1]);
}

// The branch that stands for a segment.
static const struct segment_branch {
  sonde_flow_segment segment;
  const char *branch;
} BRANCH_OF[] = {{SONDE_FLOW_POPLITEAL, "popliteal vein"},
                 {SONDE_FLOW_FEMORAL, "femoral vein"},
                 {SONDE_FLOW_COMMON_FEMORAL, "common femoral vein"},
                 {SONDE_FLOW_EXTERNAL_ILIAC, "external iliac vein"},
                 {SONDE_FLOW_DEEP_FEMORAL, "deep femoral vein"},
                 {SONDE_FLOW_GREAT_SAPHENOUS, "great saphenous vein"},
                 {SONDE_FLOW_CALF, "posterior tibial vein"}};

// Volume of the thigh and the calf in which the typical veins lie.
static const double typical_m3[2] = {7.5e-3, 2.5e-3};

// The veins of a limb in place of the typical ones.
static void take_limb(const sonde_limb *limb, sonde_flow_def *def) {
  for (size_t i = 0; i < SONDE_COUNT_OF(BRANCH_OF); ++i) {
    const uint32_t branch = sonde_limb_vessel_find(limb, BRANCH_OF[i].branch);
    if (branch == SONDE_LIMB_NO_VESSEL || BRANCH_OF[i].segment == SONDE_FLOW_CALF) continue;
    const sonde_flow_segment k = BRANCH_OF[i].segment;
    const double part = k == SONDE_FLOW_GREAT_SAPHENOUS ? 0.5 : 1;
    def->narrow[k] = take_branch(limb, branch, part, entering[k] < 1, def->area_m2[k]);
    // Limbs begin within the external iliac vein.
    if (k != SONDE_FLOW_EXTERNAL_ILIAC)
      def->length_m[k] = part * sonde_limb_vessel_get(limb, branch).length_m;
  }
  const sonde_flow_def typical = sonde_flow_def_default(NULL);
  def->area_m2[SONDE_FLOW_COMMON_ILIAC][0] *=
      def->area_m2[SONDE_FLOW_EXTERNAL_ILIAC][0] / typical.area_m2[SONDE_FLOW_EXTERNAL_ILIAC][0];
  static const char *const CALF[VEINS] = {"posterior tibial vein",
                                          "second posterior tibial vein",
                                          "peroneal vein",
                                          "second peroneal vein",
                                          "anterior tibial vein",
                                          "second anterior tibial vein",
                                          "medial gastrocnemius vein",
                                          "second medial gastrocnemius vein",
                                          "lateral gastrocnemius vein",
                                          "second lateral gastrocnemius vein",
                                          "small saphenous vein"};
  double conducts = 0, squares = 0;
  for (int v = 0; v < VEINS; ++v) {
    const uint32_t branch = sonde_limb_vessel_find(limb, CALF[v]);
    double area[2] = {0, 0}, resists = 1;
    if (branch != SONDE_LIMB_NO_VESSEL) {
      const double length_m = sonde_limb_vessel_get(limb, branch).length_m;
      if (v == 0) def->length_m[SONDE_FLOW_CALF] = length_m;
      resists =
          take_branch(limb, branch, 1, true, area) * length_m / def->length_m[SONDE_FLOW_CALF];
    }
    def->area_m2[SONDE_FLOW_CALF][v] = area[0];
    conducts += area[0] * area[0] / resists, squares += area[0] * area[0];
  }
  if (conducts > 0) def->narrow[SONDE_FLOW_CALF] = squares / conducts;
  // Tissue beside each segment by level: calf and knee, then the thigh, whose shares stay.
  const double knee_z = sonde_limb_point(limb, 1, 0, 0).z;
  const double part_m[2] = {sonde_limb_point(limb, 0, 0, 0).z - knee_z,
                            knee_z - sonde_limb_point(limb, 2, 0, 0).z};
  double part_m3[2] = {0, 0};
  for (int part = 0; part < 2; ++part)
    for (int i = 0; i < PLACES; ++i)
      part_m3[part] += part_m[part] / PLACES *
                       pow(sonde_limb_girth(limb, part + (i + 0.5) / PLACES), 2) / (4 * SONDE_PI);
  for (int k = 0; k < N; ++k)
    def->tissue_m3[k] *=
        k == SONDE_FLOW_CALF ? part_m3[1] / typical_m3[1] : part_m3[0] / typical_m3[0];
  // What runs through the artery returns through the veins.
  const uint32_t artery = sonde_limb_vessel_find(limb, "common femoral artery");
  if (artery == SONDE_LIMB_NO_VESSEL) return;
  double mean = 0, area[2];
  take_branch(limb, artery, 1, false, area);
  for (int i = 0; i < PLACES; ++i) mean += sonde_flow_artery((double)i / PLACES) / PLACES;
  def->inflow_m3_s = mean * area[0];
}

sonde_flow_def sonde_flow_def_default(const sonde_limb *limb) {
  // The calf's tissue includes the foot's, the common iliac vein's what drains into the internal
  // iliac one. What the great saphenous vein has of the calf's blood leaves it by perforators, so
  // that its part in the thigh counts.
  sonde_flow_def def = {.length_m = {0.3, 0.16, 0.26, 0.07, 0.1, 0.06, 0.2, 0.38},
                        .narrow = {1, 1, 1, 1, 1, 1, 1, 1},
                        .area_m2 = {{6e-6, 6e-6, 8e-6, 8e-6, 3e-6, 3e-6, 9e-6, 9e-6, 9e-6, 0, 7e-6},
                                    {45e-6},
                                    {35e-6},
                                    {85e-6},
                                    {95e-6},
                                    {130e-6},
                                    {30e-6},
                                    {11e-6}},
                        .tissue_m3 = {3.6e-3, 0.5e-3, 0.9e-3, 0.3e-3, 0, 2.5e-3, 3.5e-3, 0.5e-3},
                        .inflow_m3_s = 350 * ml / 60,
                        .heart_rate_hz = 1.15,
                        .breath_rate_hz = 0.25,
                        .breath_pa = 0.35 * SONDE_PA_PER_MMHG,
                        .deep_breath_from_s = INFINITY,
                        .squeeze_from_s = INFINITY,
                        .squeeze_pa = 13 * SONDE_PA_PER_MMHG,
                        .valsalva_from_s = INFINITY,
                        .valsalva_to_s = INFINITY,
                        .valsalva_pa = 30 * SONDE_PA_PER_MMHG};
  if (limb) take_limb(limb, &def);
  return def;
}

void sonde_flow_def_hold(const sonde_limb_pose *pose, sonde_flow_def *def) {
  SONDE_ASSERT(def);
  if (!pose) return;
  const sonde_limb *limb = pose->limb;
  const double lying_pa = sonde_posture_pressure(SONDE_POSTURE_SUPINE, SONDE_VESSEL_VEIN, 0);
  for (size_t i = 0; i < SONDE_COUNT_OF(BRANCH_OF); ++i) {
    const uint32_t branch = sonde_limb_vessel_find(limb, BRANCH_OF[i].branch);
    const sonde_flow_segment k = BRANCH_OF[i].segment;
    if (branch == SONDE_LIMB_NO_VESSEL) continue;
    const double length_m = sonde_limb_vessel_get(limb, branch).length_m;
    double pressure_pa = 0, knee = 0;
    for (int n = 0; n < PLACES; ++n) {
      const sonde_vec3 rest =
          sonde_limb_vessel_place(limb, branch, length_m * (n + 0.5) / PLACES).centre_m;
      pressure_pa += sonde_limb_pose_pressure(pose, sonde_limb_pose_point(pose, rest)) / PLACES;
      knee += pow(limb_pose_knee(pose, branch, limb_side_point(limb, rest)), 2) / PLACES;
    }
    def->column_pa[k] = pressure_pa - lying_pa;
    def->length_m[k] *= sonde_limb_pose_length(pose, branch) / length_m;
    for (int v = 0; v < VEINS; ++v) def->area_m2[k][v] *= knee;
  }
  // Beyond the leg the column is that of the groin.
  def->column_pa[SONDE_FLOW_COMMON_ILIAC] =
      sonde_posture_pressure(limb_pose_posture(pose->setting.position), SONDE_VESSEL_VEIN, 0) -
      lying_pa;
}

static double smooth_rise(double t, double from, double length) {
  return isfinite(from) ? smooth_step((t - from) / length) : from < 0;
}

// Pressures outside a segment and in the vena cava at a time.
static double outside(const sonde_flow_def *def, double t, sonde_flow_segment segment) {
  double strain = smooth_rise(t, def->valsalva_from_s, strain_s) *
                  (1 - smooth_rise(t, def->valsalva_to_s, strain_s));
  double deep = (t - def->deep_breath_from_s) / deep_breath_s;
  double swing = sin(2 * SONDE_PI * def->breath_rate_hz * t) +
                 (deep > 0 && deep < 1 ? deep_breath_times * sin(2 * SONDE_PI * deep) : 0);
  double breath = (1 - strain) * def->breath_pa * swing;
  double inside = breath + strain * def->valsalva_pa;
  if (segment == N) // the chest takes part in a strain, and the heart's beat is felt
    return cava_pa + inside + pulse_pa * sin(2 * SONDE_PI * def->heart_rate_hz * t);
  double since = t - def->squeeze_from_s;
  bool squeezed = segment == SONDE_FLOW_CALF && since > 0 && since < squeeze_s;
  return belly[segment] * inside +
         (squeezed ? def->squeeze_pa * pow(sin(SONDE_PI * since / squeeze_s), 2) : 0);
}

// Volume over the empty one at a pressure across the wall.
static double filling(double pressure_pa) {
  const double beyond = stretch_per_pa * pressure_pa;
  return beyond < 0 ? exp(beyond) : 1 + beyond / (1 + beyond / most_stretch);
}

// Pressure across the wall: stiffer the fuller the vein, steeply falling when it is empty.
static double across(double empty_m3, double volume_m3, double *slope) {
  double beyond = volume_m3 / empty_m3 - 1;
  double soft = beyond < 0 ? 1 : 1 - fmin(beyond / most_stretch, 0.99);
  *slope = 1 / (stretch_per_pa * empty_m3 * (beyond < 0 ? 1 + beyond : soft * soft));
  return (beyond < 0 ? log(1 + beyond) : beyond / soft) / stretch_per_pa;
}

// Sums over the veins side by side: of their areas at rest, and of the squares of what is open of
// them, to which their conductances add up.
static double whole_area(const sonde_flow_def *def, uint32_t k) {
  double sum = 0;
  for (int v = 0; v < VEINS; ++v) sum += def->area_m2[k][v];
  return sum;
}

static double open_squares(const sonde_flow_def *def, uint32_t k) {
  double open = 0, all = 0;
  for (int v = 0; v < VEINS; ++v) {
    const double area = def->area_m2[k][v];
    open += pow(area * (1 - def->closed[k][v]), 2), all += area * area;
  }
  return open + all / detour;
}

// How much wider the lumina are than at rest.
static double widening(const sonde_flow *flow, uint32_t k) {
  return fmax(flow->volume_m3[k] / flow->rest_m3[k], 0.01);
}

// Poiseuille's resistance of the veins side by side, without their valve, and what the blood's
// motion loses at the given flow where it enters wider veins (Borda and Carnot).
static double resistance(const sonde_flow *flow, uint32_t k, double flow_m3_s) {
  double jet = 0;
  if (next[k] < N) {
    const double area = whole_area(&flow->def, k) * widening(flow, k);
    const double wider = whole_area(&flow->def, next[k]) * widening(flow, next[k]);
    jet = 0.5 * BLOOD_KG_M3 * fabs(flow_m3_s) / (area * area) * pow(fmax(1 - area / wider, 0), 2);
  }
  return jet + 8 * SONDE_PI * BLOOD_PA_S * entering[k] * flow->def.narrow[k] *
                   flow->def.length_m[k] /
                   (open_squares(&flow->def, k) * pow(widening(flow, k), 2));
}

// What the capillaries of a segment's tissue let into it at a pressure without its column. Where
// the veins are filled the arterioles narrow (Henriksen's veno-arteriolar reflex).
static double capillaries(const sonde_flow_def *def, uint32_t k, double pressure_pa) {
  const double reflex = 0.4, from_pa = 10 * SONDE_PA_PER_MMHG, over_pa = 25 * SONDE_PA_PER_MMHG;
  const double narrowed = reflex * smooth_step((def->column_pa[k] - from_pa) / over_pa);
  double leg = -def->tissue_m3[SONDE_FLOW_COMMON_ILIAC];
  for (int i = 0; i < N; ++i) leg += def->tissue_m3[i];
  return (1 - narrowed) * def->tissue_m3[k] / leg * def->inflow_m3_s *
         fmax(arterioles_pa - fmax(pressure_pa, held_pa), 0) / (arterioles_pa - held_pa);
}

// Pressures without columns, volumes and flows that stay without breath and beat. With `sound`, of
// open veins at the areas of rest, lying, from which the empty volumes follow.
static void settle(sonde_flow *flow, bool sound) {
  enum { PASSES = 200 };
  // Blood comes from the first to the last, pressure back.
  static const int ORDER[N] = {0, 1, 2, 6, 7, 3, 4, 5};
  const double near = 0.2; // of the way to the next estimate
  double pressure[N + 1];
  for (int k = 0; k <= N; ++k) pressure[k] = cava_pa;
  for (int pass = 0; pass < PASSES; ++pass) {
    for (uint32_t k = 0; k < N; ++k) flow->flow_m3_s[k] = capillaries(&flow->def, k, pressure[k]);
    for (int i = 0; i < N; ++i)
      if (next[ORDER[i]] < N) flow->flow_m3_s[next[ORDER[i]]] += flow->flow_m3_s[ORDER[i]];
    for (int i = N; i-- > 0;) {
      const uint32_t k = (uint32_t)ORDER[i];
      pressure[k] +=
          near * (pressure[next[k]] + flow->flow_m3_s[k] * resistance(flow, k, flow->flow_m3_s[k]) -
                  pressure[k]);
      if (!sound)
        flow->volume_m3[k] = flow->empty_m3[k] * filling(pressure[k] + flow->def.column_pa[k]);
    }
  }
  for (uint32_t k = 0; k < N && sound; ++k)
    flow->empty_m3[k] = flow->rest_m3[k] / filling(pressure[k]);
}

sonde_status sonde_flow_start(const sonde_flow_def *def, sonde_flow *flow, sonde_error *error) {
  SONDE_ASSERT(def && flow);
  for (uint32_t k = 0; k < N; ++k) {
    bool fits = def->length_m[k] >= 0.005 && def->length_m[k] <= 2;
    for (int v = 0; v < VEINS; ++v)
      fits = fits && def->area_m2[k][v] >= (v ? 0 : 2e-7) && def->area_m2[k][v] <= 1e-3 &&
             def->closed[k][v] >= 0 && def->closed[k][v] <= 1;
    fits = fits && def->narrow[k] > 0 && def->narrow[k] <= 1e3 && def->tissue_m3[k] >= 0 &&
           def->tissue_m3[k] <= 0.1;
    if (!fits)
      return sonde_fail(error, SONDE_ARGUMENT,
                        "%s: expected a length of 5 mm to 2 m, a main vein of 0.2 to 1000 mm2, "
                        "others of at most 1000 mm2, closed shares of 0 to 1, narrow of 0 to 1000, "
                        "tissue of 0 to 100 l and a column of -1 to 30 kPa",
                        sonde_flow_segment_name((sonde_flow_segment)k));
  }
  if (!(def->leak >= 0 && def->leak <= 1))
    return sonde_fail(error, SONDE_ARGUMENT, "leak: expected 0 to 1");
  if (!(def->inflow_m3_s > 0 && def->inflow_m3_s <= 1e-4))
    return sonde_fail(error, SONDE_ARGUMENT, "inflow: expected more than 0, at most 100 ml/s");
  if (!(def->heart_rate_hz > 0 && def->heart_rate_hz <= 5 && def->breath_rate_hz >= 0 &&
        def->breath_rate_hz <= 2))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "rates: expected 0 to 5 Hz (heart), 0 to 2 Hz (breath)");
  *flow = (sonde_flow){.def = *def};
  for (uint32_t k = 0; k < N; ++k) {
    flow->volume_m3[k] = flow->rest_m3[k] =
        def->length_m[k] * whole_area(def, k) + blood_of_tissue * def->tissue_m3[k];
  }
  sonde_flow_def sound = *def;
  memset(sound.closed, 0, sizeof sound.closed);
  memset(sound.column_pa, 0, sizeof sound.column_pa);
  flow->def = sound;
  settle(flow, true);
  flow->def = *def;
  sonde_flow_settle(flow);
  return SONDE_OK;
}

void sonde_flow_settle(sonde_flow *flow) {
  SONDE_ASSERT(flow != NULL);
  settle(flow, false);
  for (uint32_t k = 0; k < N; ++k) flow->open[k] = 1;
}

// Gauss without exchange of rows; the solution takes the place of the right side.
static void solve(double matrix[N][N], double side[N]) {
  for (int k = 0; k < N; ++k)
    for (int i = k + 1; i < N; ++i) {
      const double factor = matrix[i][k] / matrix[k][k];
      if (factor == 0) continue;
      for (int j = k; j < N; ++j) matrix[i][j] -= factor * matrix[k][j];
      side[i] -= factor * side[k];
    }
  for (int k = N; k-- > 0;) {
    for (int j = k + 1; j < N; ++j) side[k] -= matrix[k][j] * side[j];
    side[k] /= matrix[k][k];
  }
}

void sonde_flow_step(sonde_flow *flow, double dt_s) {
  const sonde_flow_def *def = &flow->def;
  SONDE_ASSERT(dt_s >= 1e-5 && dt_s <= 1e-2);
  enum { PASSES = 4 };
  double t = flow->time_s + dt_s, inflow[N], guess[N], flow_now[N], resists[N], inertance[N];
  for (uint32_t k = 0; k < N; ++k) {
    double slope;
    inflow[k] = capillaries(def, k,
                            across(flow->empty_m3[k], flow->volume_m3[k], &slope) -
                                def->column_pa[k] + outside(def, t, (sonde_flow_segment)k));
    resists[k] = resistance(flow, k, flow->flow_m3_s[k]);
    inertance[k] =
        BLOOD_KG_M3 * entering[k] * def->length_m[k] / (whole_area(def, k) * widening(flow, k));
    guess[k] = flow->volume_m3[k];
    double before = flow->flow_m3_s[k], wanted = before > 0 ? 1 : def->leak;
    if (has_valve[k]) flow->open[k] += (wanted - flow->open[k]) * (1 - exp(-dt_s / valve_s));
  }
  // Newton: with s the slope of the wall's law and tau its time, the pressures at the end of the
  // step are p + s (dt + tau) (what comes in less Q), and the flows satisfy (L/dt + R) Q = L/dt
  // Q_before + the pressure's fall to the next segment. The matrix is symmetric and positive.
  double in[N];
  for (int pass = 0; pass < PASSES; ++pass) {
    double pressure[N + 1], push[N + 1], matrix[N][N] = {{0}};
    for (uint32_t k = 0; k < N; ++k) {
      double slope, at = across(flow->empty_m3[k], guess[k], &slope);
      push[k] = slope * (dt_s + wall_s);
      pressure[k] = at - def->column_pa[k] + slope * (flow->volume_m3[k] - guess[k]) +
                    push[k] * inflow[k] + outside(def, t, (sonde_flow_segment)k);
    }
    pressure[N] = outside(def, t, SONDE_FLOW_SEGMENTS), push[N] = 0;
    for (uint32_t k = 0; k < N; ++k) {
      double w = flow->open[k], factor = has_valve[k] ? 1 / (w * w + valve_least) : 1;
      flow_now[k] = inertance[k] / dt_s * flow->flow_m3_s[k] + pressure[k] - pressure[next[k]];
      matrix[k][k] += inertance[k] / dt_s + factor * resists[k] + push[k];
      if (next[k] < N) matrix[k][next[k]] -= push[next[k]], matrix[next[k]][k] -= push[next[k]];
      for (uint32_t j = 0; j < N; ++j)
        if (next[j] == next[k]) matrix[k][j] += push[next[k]];
    }
    solve(matrix, flow_now);
    for (uint32_t k = 0; k < N; ++k) in[k] = inflow[k];
    for (uint32_t k = 0; k < N; ++k)
      if (next[k] < N) in[next[k]] += flow_now[k];
    for (uint32_t k = 0; k < N; ++k)
      guess[k] = fmax(flow->volume_m3[k] + dt_s * (in[k] - flow_now[k]), 0.3 * guess[k]);
  }
  for (uint32_t k = 0; k < N; ++k) {
    flow->volume_m3[k] =
        fmax(flow->volume_m3[k] + dt_s * (in[k] - flow_now[k]), 1e-4 * flow->rest_m3[k]);
    flow->flow_m3_s[k] = flow_now[k];
  }
  flow->time_s = t;
}

double sonde_flow_through(const sonde_flow *flow, sonde_flow_segment segment, uint32_t vein) {
  SONDE_ASSERT(segment < N && vein < VEINS);
  const double open = flow->def.area_m2[segment][vein] * (1 - flow->def.closed[segment][vein]);
  return flow->flow_m3_s[segment] * open * open / open_squares(&flow->def, segment);
}

double sonde_flow_area(const sonde_flow *flow, sonde_flow_segment segment, uint32_t vein) {
  SONDE_ASSERT(segment < N && vein < VEINS);
  return flow->def.area_m2[segment][vein] * (1 - flow->def.closed[segment][vein]) *
         widening(flow, segment);
}

double sonde_flow_velocity(const sonde_flow *flow, sonde_flow_segment segment) {
  const double area = sonde_flow_area(flow, segment, 0);
  return area > 0 ? sonde_flow_through(flow, segment, 0) / area : 0;
}

double sonde_flow_pressure(const sonde_flow *flow, sonde_flow_segment segment) {
  double slope;
  SONDE_ASSERT(segment < N);
  return across(flow->empty_m3[segment], flow->volume_m3[segment], &slope) +
         outside(&flow->def, flow->time_s, segment);
}

double sonde_flow_artery(double beat) {
  // Systole, reverse flow, a small forward wave.
  static const double WAVE[3][3] = {{0.78, 0.13, 0.05}, {-0.28, 0.31, 0.055}, {0.09, 0.48, 0.07}};
  double sum = 0.02, at = beat - floor(beat);
  for (int k = 0; k < 3; ++k)
    sum += WAVE[k][0] * exp(-0.5 * pow((at - WAVE[k][1]) / WAVE[k][2], 2));
  return sum;
}
