// What a worksheet says against what the case has put on the leg: docs/worksheet.md.
#include "sonde/trainer_worksheet.h"

#include "exam/vessels.h"
#include "tissue/anatomy.h"
#include "trainer/judge.h"

#include <string.h>

// Veins farther than this from the beam's axis are not in the picture; deeper ones are not either.
static const double ASIDE_M = 0.025, DEEP_M = 0.12;
// Less of the lumen filled than this is a clot in a part of it.
static const double OCCLUSIVE = 0.9;
// A picture without compression shows at least this much of the vein's area at rest.
static const double OPEN_RATIO = 0.5;
static const double LEVEL_M = 0.001; // places nearer than this along the leg are one station
static const double CAP = 49;        // of a wrong conclusion, as of a wrong diagnosis
enum { FINDINGS = 45, PICTURES = 25, CLOT = 15, CONCLUSION = 15 }; // points

const char *sonde_sheet_outcome_name(sonde_sheet_outcome outcome) {
  static const char *const NAME[] = {"right", "missed", "over_called", "not_seen", "not_written"};
  SONDE_ASSERT(outcome < SONDE_COUNT_OF(NAME));
  return NAME[outcome];
}

// ---- the truth of a place

sonde_sheet_age sonde_clot_age(double modulus_pa) {
  const double acute_pa = 15e3, chronic_pa = 35e3; // docs/interior.md
  return modulus_pa < acute_pa     ? SONDE_SHEET_ACUTE
         : modulus_pa > chronic_pa ? SONDE_SHEET_CHRONIC
                                   : SONDE_SHEET_INDETERMINATE;
}

// What the plane of a place shows of one vein, given by its points from proximal to distal: each
// crossing in the picture that lies in the clot, or within reach of its end.
static void look_at_vein(const sonde_plan_point *place, double reach_m, const sonde_pathology *clot,
                         const sonde_vec3 *line, uint32_t count, sonde_sheet_place_verdict *v) {
  const sonde_vein_point *at = &place->at;
  const sonde_vec3 course = v_cross(at->normal, at->across);
  if (!(clot->thrombus_fraction > 0)) return;
  for (uint32_t i = 1; i < count; ++i) {
    const double before_m = v_dot(v_sub(line[i - 1], at->skin_m), course);
    const double after_m = v_dot(v_sub(line[i], at->skin_m), course);
    if (before_m * after_m > 0 || before_m == after_m) continue;
    const sonde_vec3 cut = v_lerp(line[i - 1], line[i], before_m / (before_m - after_m));
    const sonde_vec3 from_skin = v_sub(cut, at->skin_m);
    const double deep_m = -v_dot(from_skin, at->normal);
    if (!(fabs(v_dot(from_skin, at->across)) <= ASIDE_M && deep_m > 0 && deep_m <= DEEP_M))
      continue;
    const bool all = clot->thrombus_from_m == clot->thrombus_to_m;
    const double inside_m =
        fmin(cut.z - clot->thrombus_from_m, clot->thrombus_to_m - cut.z); // < 0: outside
    if (!all && inside_m < -reach_m) continue;
    const bool edge = !all && fabs(inside_m) < reach_m, here = all || inside_m >= 0;
    // What is surely there goes before what ends near by.
    v->edge = v->clot && !v->edge ? false : edge;
    if (!here) continue;
    v->clot = true;
    const bool whole = clot->thrombus_fraction >= OCCLUSIVE;
    v->truth = whole ? SONDE_SHEET_NOT_COMPRESSIBLE : SONDE_SHEET_PARTLY;
    v->truth_kind = whole                               ? SONDE_SHEET_OCCLUSIVE
                    : clot->form == SONDE_CLOT_FLOATING ? SONDE_SHEET_FREE_FLOATING
                                                        : SONDE_SHEET_PART_OF_LUMEN;
    v->truth_age = sonde_clot_age(clot->thrombus_modulus_pa);
  }
}

// The veins of the place's segment: the main one with those that are double beside it, or branches.
static void find_truth(const sonde_exam_setups *setups, const sonde_plan *plan, uint32_t i,
                       sonde_sheet_place_verdict *v) {
  const sonde_plan_point *place = &plan->point[i];
  const sonde_case_setup *setup = &setups->held[place->held];
  const sonde_exam_segment *segment = &setup->map.segment[place->segment];
  const bool main = segment->vein_count == 0;
  const double reach_m = plan->criteria.reach_m;
  sonde_vec3 line[SONDE_VESSEL_POINTS];
  *v = (sonde_sheet_place_verdict){.truth = SONDE_SHEET_COMPRESSIBLE, .system = segment->kind};
  if (main) {
    for (uint32_t k = 0; k < setup->map.point_count; ++k) line[k] = setup->map.point[k].vein_m;
    look_at_vein(place, reach_m, &setup->pathology, line, setup->map.point_count, v);
  }
  for (uint32_t b = 0; b < setup->findings.branch_count; ++b) {
    const sonde_branch_finding *finding = &setup->findings.branch[b];
    const char *of = sonde_segment_of_branch(finding->branch);
    const bool twin = sonde_vein_is_double(finding->branch);
    if (main ? !twin : !of || strcmp(of, segment->name) != 0) continue;
    const sonde_vessel *vein = &sonde_anatomy_branch(setup->model->anatomy, finding->branch)->line;
    for (uint32_t k = 0; k < vein->count; ++k) line[k] = vein->point[k].centre_m;
    look_at_vein(place, reach_m, &finding->pathology, line, vein->count, v);
  }
}

// ---- findings and pictures

// Both pictures of the place, or of another place that is seen from the same stand; what is wrong
// with the last one that was tried, where none is right.
static void judge_pictures(const sonde_worksheet *sheet, const sonde_plan *plan, uint32_t i,
                           sonde_sheet_place_verdict *v) {
  const sonde_plan_point *place = &plan->point[i];
  const sonde_vein_point *at = &place->at;
  const double reach_m = plan->criteria.reach_m;
  v->documented = true;
  v->pictures[0] = 0;
  for (int with = 0; with < 2; ++with) {
    const char *fault = "none";
    for (uint32_t k = 0; fault && k < sheet->picture_count; ++k) {
      const sonde_sheet_picture *picture = &sheet->picture[k];
      const bool of = picture->place == i || sonde_same_stand(&plan->point[picture->place], place);
      if (!of || picture->compressed != (with == 1)) continue;
      const sonde_vec3 away = v_sub(picture->probe.position, at->skin_m);
      const double along_m = fabs(v_dot(away, v_cross(at->normal, at->across)));
      const double ratio = picture->ratio[place->segment];
      const bool here = picture->held == place->held && along_m <= reach_m &&
                        fabs(v_dot(away, at->across)) <= ASIDE_M;
      const bool shut =
          ratio <= plan->criteria.closed_ratio || picture->force_n >= place->target.firm_n;
      fault = !here                          ? "taken elsewhere"
              : picture->force_n < CONTACT_N ? "hardly touches the skin"
              : !isfinite(ratio)             ? "shows no vein"
              : with && !shut                ? "not pressed far enough"
              : !with && ratio < OPEN_RATIO  ? "pressed already"
                                             : NULL;
    }
    if (!fault) continue;
    const size_t used = strlen(v->pictures);
    snprintf(v->pictures + used, sizeof v->pictures - used, "%s%s compression: %s",
             used ? "; " : "", with ? "with" : "without", fault);
    v->documented = false;
  }
}

// ---- extent

// How far each place is from the groin along the leg, as it lies at first.
typedef struct levels {
  uint32_t count;
  double m[SONDE_PLAN_POINTS];
  bool counts[SONDE_PLAN_POINTS]; // of the system that is asked about
} levels;

// One end: the place where clot is surely there, or any beyond it up to where it may be.
static void judge_end(const levels *level, const sonde_sheet_verdict *v, uint32_t said, bool lower,
                      uint32_t *truth, int *off, double *off_m) {
  uint32_t sure = SONDE_PLAN_POINTS, may = SONDE_PLAN_POINTS;
  for (uint32_t i = 0; i < level->count; ++i) {
    const double sign = lower ? 1 : -1;
    if (!level->counts[i] || !(v->place[i].clot || v->place[i].edge)) continue;
    if (may == SONDE_PLAN_POINTS || sign * level->m[i] > sign * level->m[may]) may = i;
    if (!v->place[i].clot || v->place[i].edge) continue;
    if (sure == SONDE_PLAN_POINTS || sign * level->m[i] > sign * level->m[sure]) sure = i;
  }
  if (sure == SONDE_PLAN_POINTS) sure = may;
  *truth = sure;
  *off = 0, *off_m = 0;
  if (sure == SONDE_PLAN_POINTS || said == SONDE_PLAN_POINTS) return;
  const double low_m = fmin(level->m[sure], level->m[may]) - LEVEL_M;
  const double high_m = fmax(level->m[sure], level->m[may]) + LEVEL_M;
  if (level->m[said] >= low_m && level->m[said] <= high_m) return;
  const uint32_t nearest =
      fabs(level->m[said] - level->m[sure]) < fabs(level->m[said] - level->m[may]) ? sure : may;
  *off_m = level->m[said] - level->m[nearest];
  // Stations of the system from one to the other, each level once.
  const double first_m = fmin(level->m[nearest], level->m[said]);
  const double last_m = fmax(level->m[nearest], level->m[said]);
  for (double at_m = first_m, next_m = 0; next_m < INFINITY; at_m = next_m) {
    next_m = INFINITY;
    for (uint32_t i = 0; i < level->count; ++i)
      if ((level->counts[i] || i == said) && level->m[i] > at_m + LEVEL_M &&
          level->m[i] <= last_m + LEVEL_M)
        next_m = fmin(next_m, level->m[i]);
    *off += next_m < INFINITY ? (*off_m < 0 ? -1 : 1) : 0;
  }
}

static void judge_extent(const sonde_exam_setups *setups, const sonde_plan *plan,
                         const sonde_sheet_extent *said, bool superficial, sonde_sheet_verdict *v) {
  sonde_sheet_extent_verdict *to = superficial ? &v->superficial : &v->deep;
  levels level = {.count = plan->count};
  *to = (sonde_sheet_extent_verdict){.said = said->from < plan->count && said->to < plan->count};
  for (uint32_t i = 0; i < plan->count; ++i) {
    const sonde_plan_point *place = &plan->point[i];
    const sonde_vein_map *first = &setups->held[0].map, *map = &setups->held[place->held].map;
    const double start_m = first->point[0].z_m, end_m = first->point[first->point_count - 1].z_m;
    double z_m = place->at.vein_m.z, least_m = INFINITY;
    if (isfinite(place->course_m)) z_m = sonde_vein_at(first, place->course_m).z_m;
    // Of another vein: that of its station.
    for (uint32_t k = 0; k < map->station_count && !isfinite(place->course_m); ++k) {
      const double away_m = v_distance(map->station[k].probe.position, place->at.skin_m);
      if (!(away_m < least_m)) continue;
      least_m = away_m;
      for (uint32_t n = 0; n < first->station_count; ++n)
        if (strcmp(first->station[n].name, map->station[k].name) == 0)
          z_m = first->station[n].probe.position.z;
    }
    level.m[i] = end_m < start_m ? start_m - z_m : z_m - start_m;
    level.counts[i] = (v->place[i].system == SONDE_SEGMENT_SUPERFICIAL) == superficial;
    to->clot |= level.counts[i] && v->place[i].clot;
  }
  // Which of the two ends is the upper one is no mistake to be made.
  sonde_sheet_extent ends = *said;
  if (to->said && level.m[ends.from] > level.m[ends.to])
    ends = (sonde_sheet_extent){said->to, said->from};
  if (!to->said) ends = (sonde_sheet_extent){SONDE_PLAN_POINTS, SONDE_PLAN_POINTS};
  judge_end(&level, v, ends.from, false, &to->truth.from, &to->off[0], &to->off_m[0]);
  judge_end(&level, v, ends.to, true, &to->truth.to, &to->off[1], &to->off_m[1]);
}

// ---- the whole

void sonde_worksheet_judge(const sonde_worksheet *sheet, const sonde_case *patient,
                           const sonde_exam_setups *setups, const sonde_plan *plan,
                           sonde_sheet_verdict *v) {
  SONDE_ASSERT(sheet && patient && setups && plan && v && sheet->place_count == plan->count);
  *v = (sonde_sheet_verdict){.place_count = plan->count};
  uint32_t described = 0, parts = 0; // of clots: age, lumen, ends
  for (uint32_t i = 0; i < plan->count; ++i) {
    sonde_sheet_place_verdict *place = &v->place[i];
    const sonde_sheet_row *row = &sheet->row[i];
    const bool called =
        row->finding == SONDE_SHEET_PARTLY || row->finding == SONDE_SHEET_NOT_COMPRESSIBLE;
    find_truth(setups, plan, i, place);
    judge_pictures(sheet, plan, i, place);
    const bool agree = place->edge || called == place->clot;
    place->outcome = row->finding == SONDE_SHEET_NO_FINDING ? SONDE_SHEET_UNWRITTEN
                     : row->finding == SONDE_SHEET_NOT_SEEN ? SONDE_SHEET_UNSEEN
                     : agree                                ? SONDE_SHEET_RIGHT
                     : called                               ? SONDE_SHEET_OVER_CALLED
                                                            : SONDE_SHEET_MISSED;
    place->age_right =
        place->clot && called && row->age != SONDE_SHEET_NO_AGE &&
        (row->age == place->truth_age || place->truth_age == SONDE_SHEET_INDETERMINATE);
    place->kind_right = place->clot && called && row->kind == place->truth_kind;
    if (place->clot && !place->edge) described += place->age_right + place->kind_right, parts += 2;
    v->right += place->outcome == SONDE_SHEET_RIGHT;
    v->missed += place->outcome == SONDE_SHEET_MISSED;
    v->over_called += place->outcome == SONDE_SHEET_OVER_CALLED;
    v->documented += place->documented;
  }
  judge_extent(setups, plan, &sheet->deep, false, v);
  judge_extent(setups, plan, &sheet->superficial, true, v);
  const sonde_sheet_extent_verdict *const extent[] = {&v->deep, &v->superficial};
  for (int k = 0; k < 4; ++k) {
    const sonde_sheet_extent_verdict *x = extent[k / 2];
    if (x->clot) described += x->said && x->off[k % 2] == 0, parts++;
  }

  // The conclusion that the case asks for: of the deep veins above the knee anyway; of calf and
  // superficial veins where the protocol asks for them.
  const sonde_vein_map *map = &setups->held[0].map;
  bool clot[SONDE_SEGMENT_SUPERFICIAL + 1] = {0};
  for (uint32_t i = 0; i < map->segment_count; ++i) {
    const sonde_segment_kind kind = map->segment[i].kind;
    bool asked = kind == SONDE_SEGMENT_MAIN || kind == SONDE_SEGMENT_DEEP;
    for (uint32_t k = 0; k < plan->count; ++k)
      asked |= map->segment[plan->point[k].segment].kind == kind;
    const bool there = sonde_case_truth(patient, map->segment[i].name) == SONDE_DECISION_CLOT;
    clot[kind] |= asked && there;
  }
  v->conclusion = clot[SONDE_SEGMENT_MAIN] || clot[SONDE_SEGMENT_DEEP] ? SONDE_SHEET_PROXIMAL
                  : clot[SONDE_SEGMENT_CALF]                           ? SONDE_SHEET_DISTAL
                  : clot[SONDE_SEGMENT_SUPERFICIAL]                    ? SONDE_SHEET_SUPERFICIAL
                                                                       : SONDE_SHEET_NO_DVT;
  v->conclusion_right = sheet->conclusion == v->conclusion;

  v->findings = (double)v->right / fmax(1, v->place_count);
  v->pictures = (double)v->documented / fmax(1, v->place_count);
  v->clot = parts ? (double)described / parts : (double)NAN;
  double points = FINDINGS * v->findings + PICTURES * v->pictures +
                  (v->conclusion_right ? CONCLUSION : 0),
         of = FINDINGS + PICTURES + CONCLUSION;
  if (isfinite(v->clot)) points += CLOT * v->clot, of += CLOT;
  v->score = 100 * points / of;
  if (!v->conclusion_right) v->score = fmin(v->score, CAP);
  snprintf(v->summary, sizeof v->summary,
           "%u of %u places right, %u missed, %u over-called; %u of %u with both pictures; the "
           "conclusion is %s.",
           v->right, v->place_count, v->missed, v->over_called, v->documented, v->place_count,
           v->conclusion_right                              ? "right"
           : sheet->conclusion == SONDE_SHEET_NO_CONCLUSION ? "missing"
                                                            : "wrong");
}
