// A case drawn by its seed.
#include "trainer/case.h"

#include "base/random.h"

#include <string.h>

static const char *const SEGMENTS[] = {"common_femoral", "femoral_proximal", "femoral_mid",
                                       "femoral_distal", "popliteal"};
enum { SEGMENT_COUNT = 5 };

typedef struct draw {
  uint64_t seed, count;
} draw;

static double uniform(draw *d, double low, double high) {
  return low + (high - low) * sonde_random_uniform(d->seed, d->count++);
}
static uint32_t below(draw *d, uint32_t count) {
  return (uint32_t)(count * sonde_random_uniform(d->seed, d->count++));
}
// Files have a tenth of a millimetre, a hundredth of a share.
static double rounded(double value, double parts) { return round(value * parts) / parts; }

// Something that is not a clot of the femoral vein.
static void draw_lookalike(draw *d, sonde_case *c) {
  uint32_t kind = below(d, 3);
  if (kind == 2) { // a clot in the superficial vein
    sonde_case_branch *branch = &c->branch[c->branch_count++];
    *branch = (sonde_case_branch){.branch = "great_saphenous", .extent.whole = true};
    sonde_status status = sonde_pathology_preset("acute_occlusive", &branch->pathology, NULL);
    SONDE_ASSERT(status == SONDE_OK);
    snprintf(c->look_alike[c->look_alike_count++], sizeof c->look_alike[0], "%s",
             "clot in the great saphenous vein");
    return;
  }
  sonde_case_lesion *lesion = &c->lesion[c->lesion_count++];
  bool cyst = kind == 1;
  *lesion = (sonde_case_lesion){.kind = cyst ? SONDE_LESION_CYST : SONDE_LESION_NODE,
                                .across_m = 1e-3 * rounded(uniform(d, 14, 18), 10),
                                .depth_m = 1e-3 * rounded(uniform(d, 10, 14), 10),
                                .half_m = {0.004, 0.006, 0.009},
                                .echogenicity = cyst ? 0 : 0.25};
  snprintf(lesion->station.segment, sizeof lesion->station.segment, "%s", SEGMENTS[cyst ? 4 : 0]);
  lesion->station.share = 0.5;
  snprintf(c->look_alike[c->look_alike_count++], sizeof c->look_alike[0], "%s",
           cyst ? "cyst beside the vein" : "lymph node");
}

void sonde_case_generate(uint64_t seed, sonde_case_level level, sonde_case *out) {
  SONDE_ASSERT(out && level <= SONDE_CASE_HARD);
  draw d = {.seed = seed};
  *out = sonde_case_default();
  out->level = level;
  snprintf(out->id, sizeof out->id, "seed-%s-%llu", sonde_case_levels[level],
           (unsigned long long)seed);
  snprintf(out->title, sizeof out->title, "Drawn case %llu", (unsigned long long)seed);
  snprintf(out->note, sizeof out->note, "Drawn by a seed; synthetic.");
  snprintf(out->diagnosis, sizeof out->diagnosis, "No deep vein thrombosis");
  out->truth_count = SEGMENT_COUNT;
  for (uint32_t i = 0; i < SEGMENT_COUNT; ++i) {
    snprintf(out->truth_segment[i], sizeof out->truth_segment[i], "%s", SEGMENTS[i]);
    out->truth[i] = SONDE_DECISION_COMPRESSIBLE;
  }

  // The person: sex, side, build, posture.
  bool hard = level == SONDE_CASE_HARD;
  out->thigh = SONDE_CASE_LEG;
  out->seed = seed & UINT32_MAX;
  out->leg.sex = below(&d, 2) ? SONDE_SEX_FEMALE : SONDE_SEX_MALE;
  out->leg.side = below(&d, 2) ? SONDE_LIMB_LEFT : SONDE_LIMB_RIGHT;
  out->leg.bmi = rounded(hard ? uniform(&d, 19, 32) : uniform(&d, 19, 26), 10);
  if (hard && below(&d, 4) == 0) out->circulation.posture = SONDE_POSTURE_SITTING;

  bool clot = below(&d, 2) == 0;
  if (clot) { // its stage and stretch, and the truth that follows
    static const char *const STAGE[] = {"acute_occlusive", "subacute_occlusive",
                                        "chronic_occlusive", "partial_mural", "free_floating"};
    uint32_t stage = below(&d, out->level == SONDE_CASE_FIRST  ? 1
                               : out->level == SONDE_CASE_EASY ? 3
                                                               : 4);
    if (stage == 3 && out->seed % 2 == 1)
      stage = 4; // of those that fill a part every second floats
    uint32_t length = out->level == SONDE_CASE_HARD ? 1 : 1 + below(&d, 3);
    uint32_t from = below(&d, SEGMENT_COUNT + 1 - length), to = from + length - 1;
    sonde_status status = sonde_pathology_preset(STAGE[stage], &out->pathology, NULL);
    SONDE_ASSERT(status == SONDE_OK && to < SEGMENT_COUNT);
    out->webs = stage == 2 ? rounded(uniform(&d, 0.3, 0.9), 100) : 0;
    out->extent.whole = false;
    snprintf(out->extent.from.segment, sizeof out->extent.from.segment, "%s", SEGMENTS[from]);
    snprintf(out->extent.to.segment, sizeof out->extent.to.segment, "%s", SEGMENTS[to]);
    out->extent.from.share = rounded(uniform(&d, 0, 0.15), 100);
    out->extent.to.share = rounded(uniform(&d, 0.85, 1), 100);
    for (uint32_t i = from; i <= to; ++i) out->truth[i] = SONDE_DECISION_CLOT;
    out->thrombosis = true;
    static const char *const WORD[] = {"Acute", "Subacute", "Chronic", "Partial (mural)",
                                       "Free-floating"};
    snprintf(out->diagnosis, sizeof out->diagnosis, "%s deep vein thrombosis: %s%s%s", WORD[stage],
             sonde_segment_title(SEGMENTS[from]), to > from ? " to " : "",
             to > from ? sonde_segment_title(SEGMENTS[to]) : "");
  }
  if (hard && !clot) draw_lookalike(&d, out);

  // What the patient says; it does not give the answer away.
  static const char *const COMPLAINT[] = {
      "swelling of the leg for %u days", "pain in the thigh for %u days",
      "a heavy leg since a journey %u days ago", "a tender calf and thigh %u days after surgery"};
  static const char *const MORE[] = {
      "Walks without help.", "Takes no tablets.", "Has had a thrombosis of the other leg.",
      "The leg is a little warmer than the other.", "Otherwise well."};
  char what[80];
  uint32_t age = 24 + below(&d, 60);
  out->leg.age_y = age;
  uint32_t days = 2 + below(&d, 9);
  const char *format = COMPLAINT[below(&d, SONDE_COUNT_OF(COMPLAINT))];
  const char *at = strstr(format, "%u");
  SONDE_ASSERT(at != NULL);
  snprintf(what, sizeof what, "%.*s%u%s", (int)(at - format), format, days, at + 2);
  snprintf(out->history, sizeof out->history, "%s, %u years, with %s. %s",
           out->leg.sex == SONDE_SEX_FEMALE ? "Woman" : "Man", age, what,
           MORE[below(&d, SONDE_COUNT_OF(MORE))]);
  // An old clot leaves valves that do not shut.
  if (out->webs > 0) out->circulation.valve_leak = rounded(uniform(&d, 0.3, 1), 100);
}
