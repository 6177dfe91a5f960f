// What to do next: one sentence for the learner.
#include "sonde/trainer_picture.h"
#include "trainer/judge.h"

#include <ctype.h>

// A vein nearer to the picture's middle than this needs no way; one farther aside than the face is
// not in it.
static const double MIDDLE_M = 0.006, FACE_M = 0.025;

// A segment of the plan whose places are done and that has no decision.
static bool is_due(const sonde_judge *judge, uint32_t segment) {
  sonde_segment_status s = sonde_judge_segment(judge, segment);
  return s.needed && s.done == s.points && s.decision == SONDE_DECISION_NONE;
}

// Towards which end of the leg a probe that is `flat` beside a place has to go, and how far it is
// from there along the course that points towards the knee, where the map's points come later.
static const char *find_towards(const sonde_judge *judge, const sonde_plan_point *point,
                                sonde_vec3 flat, double *along_m) {
  const sonde_vein_map *map = &judge->map;
  sonde_vec3 course = v_cross(point->at.normal, point->at.across);
  sonde_vec3 down = v_sub(map->point[map->point_count - 1].vein_m, map->point[0].vein_m);
  if (v_dot(down, course) < 0) course = v_neg(course);
  *along_m = v_dot(flat, course);
  bool calf = map->segment[point->segment].kind == SONDE_SEGMENT_CALF;
  return *along_m < 0 ? (calf ? "foot" : "knee") : calf ? "knee" : "groin";
}

void sonde_guide_way(const sonde_judge *judge, const sonde_plan_point *point, sonde_pose pose,
                     sonde_picture *picture) {
  sonde_vec3 away = v_sub(pose.position, point->at.skin_m), normal = point->at.normal;
  sonde_vec3 flat = v_madd(away, -v_dot(away, normal), normal);
  double along_m;
  const char *towards = find_towards(judge, point, flat, &along_m);
  if (-v_dot(q_rotate(pose.rotation, vec3(0, 0, 1)), normal) < 0.3) return; // behind the leg
  double aside_m = -v_dot(flat, q_rotate(pose.rotation, vec3(1, 0, 0))), nearest_m = FACE_M;
  const bool there = fabs(along_m) <= judge->plan.criteria.reach_m;
  for (uint32_t k = 0; k < picture->count && there; ++k) {
    const sonde_picture_mark *mark = &picture->mark[k];
    if (!mark->wanted || fabs(mark->aside_m) > nearest_m) continue;
    aside_m = mark->aside_m, nearest_m = fabs(aside_m);
  }
  if (there && fabs(aside_m) <= MIDDLE_M) return;
  picture->aside_m = aside_m;
  picture->along_m = there ? 0 : -v_dot(flat, q_rotate(pose.rotation, vec3(0, 1, 0)));
  if (there)
    snprintf(picture->way, sizeof picture->way, "%.0f mm to this side", 1e3 * fabs(aside_m));
  else
    snprintf(picture->way, sizeof picture->way, "%.0f mm towards the %s", 1e3 * fabs(along_m),
             towards);
}

// Where to go and what to do there.
static void say_next(const sonde_judge *judge, sonde_guidance *g) {
  const sonde_criteria *c = &judge->plan.criteria;
  if (g->point == SONDE_PLAN_POINTS) {
    snprintf(g->text, sizeof g->text, "All places are examined: finish the exam.");
    return;
  }
  const sonde_plan_point *point = &judge->plan.point[g->point];
  snprintf(g->detail, sizeof g->detail, "%s", point->text);
  if (!judge->started) {
    snprintf(g->text, sizeof g->text, "Put the probe across the leg: %s.", point->title);
    return;
  }

  // Where the probe is from the place, along the skin: what lies along the normal is the press
  // itself.
  sonde_pose pose = judge->last.world_from_probe;
  sonde_vec3 normal = point->at.normal, away = v_sub(pose.position, point->at.skin_m);
  sonde_vec3 flat = v_madd(away, -v_dot(away, normal), normal);
  double along_m;
  const char *towards = find_towards(judge, point, flat, &along_m);
  // On the other side of the leg the way along the skin says nothing.
  sonde_vec3 beam = q_rotate(pose.rotation, vec3(0, 0, 1));
  const double facing = 0.3;
  bool turned = -v_dot(beam, normal) < facing;
  double transverse =
      fabs(v_dot(q_rotate(pose.rotation, vec3(0, 1, 0)), v_cross(normal, point->at.across)));
  g->angle_rad = acos(fmin(transverse, 1));
  g->offset_m = v_norm(turned ? away : flat);
  g->angle_ok = g->angle_rad <= c->tilt_rad;
  // a press at a place is finished before the next one is named
  bool elsewhere =
      judge->pressing ? sonde_press_is_astray(judge) : turned || g->offset_m > c->reach_m;
  if (!elsewhere) {
    if (!g->angle_ok) {
      snprintf(g->text, sizeof g->text,
               "Turn the probe by %.0f degrees, so that it lies straight across the vein.",
               g->angle_rad * 180 / SONDE_PI);
      return;
    }
    static const char *const OTHER[] = {
        [SONDE_PRESS_STATE_COMPLETE] = "The vein is closed: let go.",
        [SONDE_PRESS_STATE_OPEN] = "Pressed firmly, and the vein stays open: let go.",
        [SONDE_PRESS_STATE_TOO_HARD] = "Too hard: let go and press again with less force.",
        [SONDE_PRESS_STATE_OFF_AXIS] =
            "The vein is not cut straight across: let go and tilt back."};
    sonde_press_state state = sonde_judge_state(judge).state;
    if (state > SONDE_PRESS_STATE_PRESSING)
      snprintf(g->text, sizeof g->text, "%s", OTHER[state]);
    else if (state == SONDE_PRESS_STATE_PRESSING)
      snprintf(g->text, sizeof g->text,
               "Press on slowly until the walls of the vein touch, at most %.0f N. If it is still "
               "open at %.0f N, it stays open.",
               g->force.limit_n, g->force.firm_n);
    else
      snprintf(g->text, sizeof g->text, "Here: press until the walls of the vein touch.");
    return;
  }
  const char *move = judge->pressing ? "Not here: let go and move" : "Move";
  double across_mm = 1e3 * sqrt(fmax(0, g->offset_m * g->offset_m - along_m * along_m));
  double along_mm = fabs(1e3 * along_m);
  const double steep = 0.6; // of a normal that looks to the front or the back
  if (turned)
    snprintf(g->text, sizeof g->text, "%s to the %s of the leg: %s.",
             judge->pressing ? "Not here: let go and go" : "Go",
             normal.y > steep    ? "front"
             : normal.y < -steep ? "back"
                                 : "inner side",
             point->title);
  else if (along_mm >= across_mm)
    snprintf(g->text, sizeof g->text, "%s the probe %.0f mm towards the %s: %s.", move, along_mm,
             towards, point->title);
  else
    snprintf(g->text, sizeof g->text, "%s the probe %.0f mm sideways: %s.", move, across_mm,
             point->title);
}

sonde_guidance sonde_judge_guidance(const sonde_judge *judge) {
  SONDE_ASSERT(judge && judge->plan.count <= SONDE_PLAN_POINTS);
  const double none = (double)NAN;
  sonde_guidance g = {.point = SONDE_PLAN_POINTS,
                      .offset_m = none,
                      .angle_rad = none,
                      .force = {none, none, none},
                      .undecided = SONDE_SEGMENTS};
  for (uint32_t i = judge->plan.count; i-- > 0;)
    if (!judge->done[i]) g.point = i;
  if (g.point < judge->plan.count) {
    g.force = judge->plan.point[g.point].target;
    g.turn = judge->plan.point[g.point].held != judge->held;
  }
  if (judge->pressing) g.force = sonde_press_target(judge);
  if (g.turn)
    snprintf(g.text, sizeof g.text, "%s the patient in another position: %s.",
             judge->pressing ? "Let go and put" : "Put",
             sonde_position_title(judge->plan.point[g.point].position));
  else
    say_next(judge, &g);

  // The finding is asked for before what comes next: first of the segment that was just seen, while
  // it is still in the learner's mind and in the picture.
  for (uint32_t i = judge->map.segment_count; i-- > 0;)
    if (is_due(judge, i)) g.undecided = i;
  if (judge->seen < SONDE_SEGMENTS && is_due(judge, judge->seen)) g.undecided = judge->seen;
  if (g.undecided == SONDE_SEGMENTS || judge->pressing) return g;
  g.text[0] = (char)tolower((unsigned char)g.text[0]);
  if (g.point < SONDE_PLAN_POINTS) snprintf(g.detail, sizeof g.detail, "Then %s", g.text);
  snprintf(g.text, sizeof g.text, "Say what you saw: %s.",
           sonde_segment_title(judge->map.segment[g.undecided].name));
  return g;
}

sonde_guidance sonde_judge_hint(sonde_judge *judge) {
  judge->hints++;
  judge->hint_s = judge->started ? judge->last.time_s : 0;
  return sonde_judge_guidance(judge);
}

uint32_t sonde_judge_hints(const sonde_judge *judge, bool *showing) {
  double now_s = judge->started ? judge->last.time_s : 0;
  if (showing) *showing = judge->hints > 0 && now_s - judge->hint_s <= SONDE_HINT_S;
  return judge->hints;
}
