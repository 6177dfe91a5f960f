// What is drawn of a limb's vessels: calibres, places, variants (docs/limb_vessels.md).
#include "limb/vessels_graph.h"

#include "base/random.h"

enum {
  DRAW_SALT = 0x76657373, // apart from the body's own draws
  DRAW_COMMON = 1,
  DRAW_ARTERIES,
  DRAW_PLACES = 16,
  DRAW_WANDER = 40,
  DRAW_VARIANTS = 64,
  DRAW_CALIBRES = 1024,
  DRAW_TRIES = 64
};

double limb_draw_uniform(uint64_t seed, uint32_t what) {
  return sonde_random_uniform(seed ^ DRAW_SALT, what);
}

double limb_draw_normal(uint64_t seed, uint32_t what) {
  for (uint64_t k = 0; k < DRAW_TRIES; ++k) {
    double value = sonde_random_normal(seed ^ DRAW_SALT, ((uint64_t)(k + 1) << 32) + what);
    if (fabs(value) <= 2.4) return value;
  }
  return 0;
}

static const struct {
  double male, female, deviation;
} DIAMETER[DIA_COUNT] = {
#define ROW(name, male, female, deviation) {male, female, deviation},
    VESSEL_DIAMETERS(ROW)
#undef ROW
};

// Diameter in mm of a standard normal number, not below a third of the mean.
static double diameter(bool female, vessel_diameter which, double z) {
  double mean = female ? DIAMETER[which].female : DIAMETER[which].male;
  return fmax(mean + DIAMETER[which].deviation * z, mean / 3);
}

double limb_murray_rest(double whole, double branch) {
  const double exponent = 2.6;
  return pow(fmax(pow(whole, exponent) - pow(branch, exponent), 0), 1 / exponent);
}

// Calibres: arteries and veins have a common share each; segments of one line share their number,
// so that a line does not widen downwards but where its table does.
static void draw_calibres(bool female, uint64_t seed, double *radius) {
  double common = limb_draw_normal(seed, DRAW_COMMON);
  double arterial = 0.5 * common + sqrt(0.75) * limb_draw_normal(seed, DRAW_ARTERIES);
  double mm[DIA_COUNT];
  for (uint32_t k = 0; k < DIA_COUNT; ++k) {
    double shared = k >= DIA_EIA ? arterial : common;
    mm[k] = diameter(female, k, 0.6 * shared + 0.8 * limb_draw_normal(seed, DRAW_CALIBRES + k));
  }
  double femoral = 0.6 * arterial + 0.8 * limb_draw_normal(seed, DRAW_CALIBRES + DIA_SFA);
  mm[DIA_SFA] = diameter(female, DIA_SFA, femoral);
  mm[DIA_SFA_END] = diameter(female, DIA_SFA_END, femoral);
  double iliac = 0.6 * arterial + 0.8 * limb_draw_normal(seed, DRAW_CALIBRES + DIA_CFA);
  mm[DIA_EIA] = diameter(female, DIA_EIA, iliac);
  // The common femoral vein is 1.0 to 1.6 times as wide as its artery (view V1).
  double z = 0;
  for (uint32_t k = 0; k < DRAW_TRIES; ++k) {
    z = 0.5 * arterial + sqrt(0.75) * limb_draw_normal(seed, DRAW_CALIBRES + DIA_COUNT + k);
    mm[DIA_CFV] = diameter(female, DIA_CFV, (female ? 1.2 * z - 0.1 : 1.5 * z - 0.8));
    if (mm[DIA_CFV] > 1.0 * mm[DIA_CFA] && mm[DIA_CFV] < 1.6 * mm[DIA_CFA]) break;
    mm[DIA_CFV] = 1.2 * mm[DIA_CFA];
  }
  mm[DIA_EIV] =
      fmax(diameter(female, DIA_EIV, (female ? 1.2 * z - 0.1 : 1.5 * z - 0.8)), mm[DIA_CFV]);
  // The veins that join to it go with it.
  const vessel_diameter joined[] = {DIA_FV, DIA_DFV};
  const double wide = (mm[DIA_CFV] - diameter(female, DIA_CFV, 0)) / DIAMETER[DIA_CFV].deviation;
  for (size_t k = 0; k < SONDE_COUNT_OF(joined); ++k)
    mm[joined[k]] = diameter(female, joined[k],
                             0.6 * wide + 0.8 * limb_draw_normal(seed, DRAW_CALIBRES + joined[k]));
  // Tributaries are narrower than what they join.
  const struct {
    vessel_diameter narrow, wide;
    double most;
  } order[] = {{DIA_FV, DIA_CFV, 0.93},
               {DIA_DFV, DIA_CFV, 0.88},
               {DIA_GSV_ARCH, DIA_CFV, 0.8},
               {DIA_GSV, DIA_GSV_ARCH, 0.9},
               {DIA_GSV_CALF, DIA_GSV, 0.9},
               {DIA_SFA, DIA_CFA, 0.92},
               {DIA_DFA, DIA_CFA, 0.85},
               {DIA_TPV, DIA_POPV, 0.95},
               {DIA_PTV, DIA_TPV, 0.7},
               {DIA_PERV, DIA_TPV, 0.8},
               {DIA_ATV, DIA_POPV, 0.5},
               {DIA_SSV, DIA_POPV, 0.8},
               {DIA_GASTROCNEMIUS, DIA_POPV, 0.8},
               {DIA_TPA, DIA_POPA, 0.85},
               {DIA_ATA, DIA_POPA, 0.6},
               {DIA_PTA, DIA_TPA, 0.9},
               {DIA_PERA, DIA_TPA, 0.9}};
  for (size_t k = 0; k < SONDE_COUNT_OF(order); ++k)
    mm[order[k].narrow] = fmin(mm[order[k].narrow], order[k].most * mm[order[k].wide]);
  // Both together are no wider than Murray's law with an exponent of 2.8 allows below the junction.
  const double room = limb_murray_rest(mm[DIA_CFV], mm[DIA_GSV_ARCH]), most = 2.8;
  const double share = room / pow(pow(mm[DIA_FV], most) + pow(mm[DIA_DFV], most), 1 / most);
  for (size_t k = 0; k < SONDE_COUNT_OF(joined); ++k) mm[joined[k]] *= fmin(share, 1);
  for (uint32_t k = 0; k < DIA_COUNT; ++k) radius[k] = 0.5e-3 * mm[k];
}

// The first class whose cumulated share exceeds a uniform number.
static uint32_t class_of(double uniform, const double *share, uint32_t count) {
  SONDE_ASSERT(count > 0 && uniform >= 0 && uniform < 1);
  double sum = 0, all = 0;
  for (uint32_t k = 0; k < count; ++k) all += share[k];
  for (uint32_t k = 0; k + 1 < count; ++k)
    if (uniform * all < (sum += share[k])) return k;
  return count - 1;
}

vessel_draws limb_vessel_draws(const sonde_limb *limb) {
  const sonde_limb_body *b = &limb->body;
  const double mm = 1e-3 * limb->scale;
  vessel_draws d = {0};
  static const double great[] = {60, 8, 8, 7, 17}, small[] = {55, 17, 24},
                      artery[] = {93.1, 2.4, 4.5};
  static const double femoral[] = {75, 11.6, 12.3, 1.1}, popliteal[] = {58, 37, 5};
  enum {
    GREAT,
    SMALL,
    ARTERY,
    FEMORAL,
    POPLITEAL,
    LINK,
    TIBIAL,
    PERONEAL,
    SURAL,
    MEDIAL,
    LATERAL,
    ALL
  };
  double u[ALL];
  for (uint32_t k = 0; k < ALL; ++k) u[k] = limb_draw_uniform(b->seed, DRAW_VARIANTS + k);
  double wanted = 14 + 3 * limb_draw_normal(b->seed, DRAW_VARIANTS + ALL);
  d.variants = (sonde_limb_variants){
      .great_saphenous = (sonde_limb_saphenous)class_of(u[GREAT], great, 5),
      .small_saphenous = (sonde_limb_small_saphenous)class_of(u[SMALL], small, 3),
      .popliteal_artery = (sonde_limb_popliteal_artery)class_of(u[ARTERY], artery, 3),
      .second_femoral = class_of(u[FEMORAL], femoral, 4),
      .second_popliteal = class_of(u[POPLITEAL], popliteal, 3),
      .deep_popliteal_link = u[LINK] < 0.08,
      .single_tibial = u[TIBIAL] < 0.1,
      .single_peroneal = u[PERONEAL] < 0.1,
      .common_sural_trunk = u[SURAL] < 0.15,
      .gastrocnemius = {1 + (u[MEDIAL] < 0.4), 1 + (u[LATERAL] < 0.3)},
      .perforators = (uint32_t)lround(clamp(wanted, 8, 21))};
  draw_calibres(b->sex == SONDE_SEX_FEMALE, b->seed, d.radius);
  double z[8];
  for (uint32_t k = 0; k < SONDE_COUNT_OF(z); ++k)
    z[k] = limb_draw_normal(b->seed, DRAW_PLACES + k);
  for (uint32_t k = 0; k < SONDE_COUNT_OF(d.wander); ++k)
    d.wander[k] = limb_draw_normal(b->seed, DRAW_WANDER + k);
  d.ligament_z = 22 * mm;
  d.junction_z = (-11 + 3 * z[0]) * mm;
  d.bifurcation_z = d.junction_z - (10 + 2 * z[1]) * mm;
  d.confluence_z = d.bifurcation_z - clamp(21 + 4 * z[2], 15, 34) * mm;
  d.hiatus = 0.72 + 0.025 * z[3];
  const sonde_limb_popliteal_artery kind = d.variants.popliteal_artery;
  d.trifurcation = kind == SONDE_LIMB_POPLITEAL_HIGH ? 0.97 + 0.01 * z[4] : 1.13 + 0.012 * z[4];
  d.trunk_end = kind == SONDE_LIMB_POPLITEAL_HIGH           ? 1.2 + 0.01 * z[5]
                : kind == SONDE_LIMB_POPLITEAL_TRIFURCATION ? d.trifurcation + 0.004
                                                            : d.trifurcation + 0.085 + 0.012 * z[5];
  // Depth by body mass; of its deviation of 4.5 mm the fat over it has the greater part.
  double fat = limb_groin_fat(b), spread = 0.25 * fat;
  double own = fmin(sqrt(fmax(0.0045 * 0.0045 - spread * spread, 1e-6)), 0.0015);
  d.artery_cover = limb_groin_cover(b) + own * z[6];
  return d;
}
