// Guidance in the picture: names, the way, what a press shows, drawn from the truth.
#include "sonde/trainer_picture.h"

#include "exam/vessels.h"
#include "trainer/judge.h"

#include <string.h>

// A vein farther aside is not under the face.
static const double ASIDE_M = 0.025;
static const double OFF_SKIN_M = -0.001;
static const double EMPTY = 0.6; // of its area: a vein that is pressed shows it by now

const char *sonde_mark_kind_name(sonde_mark_kind kind) {
  static const char *const NAME[] = {"vein", "artery", "lesion"};
  SONDE_ASSERT(kind < SONDE_MARK_KINDS);
  return NAME[kind];
}

// What is seen of a wanted vein under the force of now.
static void say_why(const sonde_judge *judge, const sonde_case_setup *setup,
                    const sonde_vessel_view *v, const sonde_force_target *target, double force_n,
                    sonde_picture_mark *mark) {
  // The clot that the case puts into this vein at this place; NULL: none.
  const sonde_vein_map *map = &setup->map;
  const sonde_pathology *clot = v->vessel == 0 ? &setup->pathology : NULL;
  const uint32_t branch = v->vessel - TRAINER_FIRST_BRANCH;
  for (uint32_t b = 0; v->vessel >= TRAINER_FIRST_BRANCH && b < setup->findings.branch_count; ++b)
    if (branch < map->branch_count &&
        strcmp(setup->findings.branch[b].branch, map->branch[branch]) == 0)
      clot = &setup->findings.branch[b].pathology;
  if (clot && clot->thrombus_from_m != clot->thrombus_to_m &&
      !(v->rest_z_m >= clot->thrombus_from_m && v->rest_z_m <= clot->thrombus_to_m))
    clot = NULL;
  if (clot && !(clot->thrombus_fraction > 0)) clot = NULL;
  const sonde_sheet_age of_age = sonde_clot_age(clot ? clot->thrombus_modulus_pa : 0);
  const char *age = of_age == SONDE_SHEET_ACUTE     ? "a fresh clot, dark as blood"
                    : of_age == SONDE_SHEET_CHRONIC ? "an old clot, firm and bright"
                                                    : "a clot, firmer and brighter than blood";
  if (mark->area_ratio <= judge->plan.criteria.closed_ratio)
    snprintf(mark->why, sizeof mark->why, "closed: the walls touch, there is no clot here");
  else if (force_n >= target->firm_n && mark->area_ratio >= judge->plan.criteria.open_ratio)
    snprintf(mark->why, sizeof mark->why, "stays open at %.0f N: %s", force_n,
             clot ? age : "another vein beside it may hold a clot");
  else if (force_n >= BEGIN_N && mark->area_ratio < EMPTY)
    snprintf(mark->why, sizeof mark->why, "closing: press on slowly");
  else if (force_n >= BEGIN_N)
    snprintf(mark->why, sizeof mark->why, "still open at %.0f N: press on slowly", force_n);
  else
    snprintf(mark->why, sizeof mark->why, "press here");
}

static sonde_picture_mark *add(sonde_picture *picture) {
  if (picture->count == SONDE_PICTURE_MARKS) return NULL;
  sonde_picture_mark *mark = &picture->mark[picture->count++];
  *mark = (sonde_picture_mark){.area_ratio = (double)NAN};
  return mark;
}

void sonde_picture_read(const sonde_judge *judge, const sonde_case_setup *setup,
                        const sonde_snapshot *s, sonde_guidance_level level,
                        sonde_picture *picture) {
  SONDE_ASSERT(judge && setup && s && picture);
  static const char *const LESION[] = {"Lymph node", "Cyst", "Haematoma"};
  static const char *const TELLS[] = {"no vein: it ends along the leg, its middle is bright",
                                      "no vein: fluid, bright behind it, ends along the leg",
                                      "no vein: it has no wall and ends along the leg"};
  const double none = (double)NAN;
  *picture = (sonde_picture){.aside_m = none, .along_m = none};
  if (level == SONDE_GUIDANCE_EXAM) return;
  const bool full = level == SONDE_GUIDANCE_FULL;
  const sonde_guidance g = sonde_judge_guidance(judge);
  const uint32_t place =
      judge->pressing && judge->now.place < judge->plan.count ? judge->now.place : g.point;
  const sonde_plan_point *point =
      place < judge->plan.count && !(g.turn && !judge->pressing) ? &judge->plan.point[place] : NULL;
  const bool off = s->penetration_m < OFF_SKIN_M; // nothing to name in the air
  for (uint32_t k = 0; k < s->view_count && !off; ++k) {
    const sonde_vessel_view *v = &s->view[k];
    sonde_picture_mark *mark = add(picture);
    if (!mark) break;
    mark->kind = v->artery ? SONDE_MARK_ARTERY : SONDE_MARK_VEIN;
    mark->aside_m = v->aside_m, mark->depth_m = v->depth_m, mark->half_m = v->half_m,
    mark->flat_m = v->flat_m;
    mark->area_ratio = v->area_ratio;
    sonde_vessel_title(&setup->map, v, mark->name, sizeof mark->name);
    if (!full) continue;
    if (point && !v->artery && fabs(v->aside_m) <= ASIDE_M) {
      // The main vein has doubles, other segments name their veins.
      const sonde_exam_segment *segment = &setup->map.segment[point->segment];
      const uint32_t branch = v->vessel - TRAINER_FIRST_BRANCH;
      const bool known = v->vessel >= TRAINER_FIRST_BRANCH && branch < setup->map.branch_count;
      const bool main = segment->vein_count == 0;
      mark->wanted =
          main && (v->vessel == 0 || (known && sonde_vein_is_double(setup->map.branch[branch])));
      for (uint32_t b = 0; b < segment->vein_count; ++b)
        mark->wanted |= segment->vein[b] == v->vessel;
    }
    if (mark->wanted)
      say_why(judge, setup, v, &point->target, s->force_normal_n, mark);
    else if (v->vessel == 1)
      snprintf(mark->why, sizeof mark->why, "round, thick wall, beats, keeps its shape");
  }
  // What only looks like a vein, where it lies at rest: under a press the tissue has carried it
  // away.
  const bool light = s->force_normal_n < BEGIN_N;
  for (uint32_t k = 0; k < setup->findings.lesion_count && full && !off && light; ++k) {
    const sonde_lesion *lesion = &setup->findings.lesion[k];
    const sonde_vec3 at = pose_apply_inverse(s->world_from_probe, lesion->centre_m);
    if (fabs(at.y) > lesion->half_m.z || fabs(at.x) > 0.035 || at.z < 0) continue;
    sonde_picture_mark *mark = add(picture);
    if (!mark) break;
    mark->kind = SONDE_MARK_LESION;
    mark->aside_m = at.x, mark->depth_m = at.z, mark->half_m = lesion->half_m.y,
    mark->flat_m = lesion->half_m.x;
    snprintf(mark->name, sizeof mark->name, "%s", LESION[lesion->kind]);
    snprintf(mark->why, sizeof mark->why, "%s", TELLS[lesion->kind]);
  }
  if (full && point && !judge->pressing && judge->started)
    sonde_guide_way(judge, point, s->world_from_probe, picture);
}
