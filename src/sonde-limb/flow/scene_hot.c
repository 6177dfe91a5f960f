// The velocity of every cell of a colour box: pieces of vessels between two sections, laid on the
// image plane where the picture draws them.
#include "flow/scene.h"

#include "base/base.h"
#include "echo/truth.h"
#include "flow/colour.h"

// A piece of a vessel between sections i and i + 1.
typedef struct piece {
  const sonde_flow_scene *scene;
  uint32_t vessel, i;
  const sonde_vessel_state *low, *high;
  sonde_vec3 along, other; // from centre to centre; beside the flat axis
  double length2;
  double gain[2]; // of the mean velocity at both ends, so that what a clot leaves carries the flow
  sonde_vec3 offset; // world: from where it is to where the picture draws it
} piece;

// Share of a parabola's flow that a clot leaves, over the share of the area that counts as open.
static double clot_scale(const piece *p, uint32_t i) {
  enum { SIDE = 24 };
  const double solid = scene_solid(p->scene, p->vessel, i);
  const double along_m = p->scene->interior->section[p->vessel][i].along_m;
  const sonde_clot_form form = p->scene->interior->pathology[p->vessel].form;
  double all = 0, free = 0;
  for (int n = 0; n < SIDE * SIDE && solid > 0; ++n) {
    const double a = (n % SIDE + 0.5) / SIDE * 2 - 1, b = (n / SIDE + 0.5) / SIDE * 2 - 1;
    const double speed = fmax(1 - a * a - b * b, 0);
    all += speed;
    free += sonde_clot_holds(form, solid, p->vessel, along_m, a, b) ? 0 : speed;
  }
  return free > 0 ? (1 - solid) * all / free : 1;
}

// What the blood at a place of the picture's plane is and how it moves; false, and nothing is
// written, beside the blood.
static bool blood_at(const piece *p, sonde_vec3 drawn, scene_blood *blood) {
  const sonde_flow_scene *s = p->scene;
  const sonde_vec3 d = v_sub(v_sub(drawn, p->offset), p->low->centre_m);
  const double share = v_dot(d, p->along) / p->length2;
  // Where a vessel bends, its pieces overlap a little rather than gape.
  const double overlap = 0.05;
  if (!(share >= -overlap && share <= 1 + overlap)) return false;
  const sonde_vec3 beside = v_madd(d, -share, p->along);
  const double half_short =
      p->low->half_short_m + share * (p->high->half_short_m - p->low->half_short_m);
  const double half_long =
      p->low->half_long_m + share * (p->high->half_long_m - p->low->half_long_m);
  const double a = v_dot(beside, p->low->flat_axis) / half_short;
  const double b = v_dot(beside, p->other) / half_long, radius = sqrt(a * a + b * b);
  if (!(radius < 1) || scene_open(s, p->vessel, p->i) <= 0) return false;
  const double solid = scene_solid(s, p->vessel, p->i);
  const sonde_vessel_section *low = &s->interior->section[p->vessel][p->i];
  const double along_m = low->along_m + share * (low[1].along_m - low->along_m);
  const sonde_clot_form form = s->interior->pathology[p->vessel].form;
  if (sonde_clot_holds(form, solid, p->vessel, along_m, a, b)) return false;
  const scene_section *section = &s->section[p->vessel][p->i];
  const bool artery = s->interior->course[p->vessel].kind == SONDE_VESSEL_ARTERY;
  // The profile of the segment's main vein or the arteries, scaled to the section's mean velocity;
  // else a parabola.
  const bool profiled = artery || (section->vein == 0 && s->main_per_m2[section->segment] > 0);
  const double heart = section->upwards * (artery ? -1 : 1);
  *blood = (scene_blood){.drive = artery     ? SCENE_ARTERY
                                  : profiled ? (int)section->segment
                                             : SONDE_FLOW_SEGMENTS + (int)section->segment,
                         .factor = (1 - share) * p->gain[0] + share * p->gain[1],
                         .ring = radius * (SONDE_FLOW_RINGS - 1),
                         .along = v_scale(p->along, heart / sqrt(p->length2))};
  if (profiled && !artery) blood->factor /= s->main_per_m2[section->segment];
  if (!profiled) blood->factor *= 2 * (1 - radius * radius);
  return true;
}

// Lays a piece on the cells whose middles it holds.
static void lay(const piece *p, sonde_pose probe, const sonde_colour_box *box,
                sonde_colour_cell *cells) {
  const sonde_vec3 middle = v_lerp(p->low->centre_m, p->high->centre_m, 0.5);
  const sonde_vec3 at = pose_apply_inverse(probe, v_add(middle, p->offset));
  const double reach = fmax(p->low->half_long_m, p->high->half_long_m) + 0.5 * sqrt(p->length2);
  if (fabs(at.y) > reach) return;
  // Lines and depths that a ball of this reach touches.
  const sight_lines sight = colour_sight(box);
  const sonde_vec3 ball = sight_find(sight, at);
  const double radius_m = sight.radius_m,
               wide = radius_m > 0
                          ? radius_m * asin(fmin(reach / fmax(radius_m + ball.z, reach), 1))
                          : reach / cos(sight.steer_rad);
  const sonde_vec3 corner[2] = {sight_place(sight, ball.x - wide, ball.z - reach),
                                sight_place(sight, ball.x + wide, ball.z + reach)};
  double low[2], high[2];
  sonde_colour_find(box, corner[0].x, corner[0].z, low);
  sonde_colour_find(box, corner[1].x, corner[1].z, high);
  const int first[2] = {(int)clamp(low[0] - 1, 0, SONDE_COLOUR_LINES),
                        (int)clamp(low[1] - 1, 0, SONDE_COLOUR_ROWS)};
  const int last[2] = {(int)clamp(high[0] + 2, 0, SONDE_COLOUR_LINES),
                       (int)clamp(high[1] + 2, 0, SONDE_COLOUR_ROWS)};
  for (int line = first[0]; line < last[0]; ++line) {
    const sonde_vec3 beam = q_rotate(probe.rotation, sight_beam(sight, colour_line(box, line)));
    for (int row = first[1]; row < last[1]; ++row) {
      sonde_colour_cell *cell = &cells[row * SONDE_COLOUR_LINES + line];
      double xz[2];
      scene_blood blood;
      if (cell->vessel != SONDE_COLOUR_NO_VESSEL) continue;
      sonde_colour_place(box, (uint32_t)line, (uint32_t)row, xz);
      if (!blood_at(p, pose_apply(probe, vec3(xz[0], 0, xz[1])), &blood)) continue;
      const double speed = scene_speed(p->scene, &blood),
                   towards = -speed * v_dot(blood.along, beam);
      *cell =
          (sonde_colour_cell){.towards_m_s = (float)towards,
                              .across_m_s = (float)sqrt(fmax(speed * speed - towards * towards, 0)),
                              .vessel = p->vessel};
    }
  }
}

// The piece of a vessel behind its section i, laid where the picture draws it; false when it is far
// from the picture's plane or deeper than `bottom_m`.
static bool find_piece(const sonde_flow_scene *s, const sonde_echo *echo, double bottom_m,
                       uint32_t v, uint32_t i, piece *p) {
  const sonde_interior *in = s->interior;
  const sonde_pose probe = sonde_truth_pose(echo);
  *p = (piece){
      .scene = s, .vessel = v, .i = i, .low = &in->state[v][i], .high = &in->state[v][i + 1]};
  const sonde_vec3 at = pose_apply_inverse(probe, p->low->centre_m);
  const double near_m = 0.03; // longer than a piece and a lumen together
  if (fabs(at.y) > near_m || at.z < -near_m || at.z > bottom_m + near_m) return false;
  p->along = v_sub(p->high->centre_m, p->low->centre_m), p->length2 = v_norm2(p->along);
  if (!(p->length2 > 0)) return false;
  // Where another segment begins, the lower one's flow goes on to the piece's end.
  const bool same = s->section[v][i].segment == s->section[v][i + 1].segment;
  for (uint32_t end = 0; end < 2; ++end)
    p->gain[end] = clot_scale(p, i + end) * scene_gain(s, v, i + (same ? end : 0));
  p->other = v_cross(p->low->axis, p->low->flat_axis);
  p->offset = q_rotate(probe.rotation, v_sub(sonde_truth_drawn_at(echo, p->low->centre_m), at));
  return true;
}

void sonde_flow_scene_cells(const sonde_flow_scene *s, const sonde_echo *echo,
                            const sonde_colour_box *box, sonde_colour_cell *cells) {
  SONDE_ASSERT(s && echo && box && cells);
  SONDE_ASSERT(box->radius_m == sonde_truth_view_of(echo).radius_m);
  const sonde_interior *in = s->interior;
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i)
    cells[i] = (sonde_colour_cell){.vessel = SONDE_COLOUR_NO_VESSEL};
  for (uint32_t v = 0; v < in->vessel_count; ++v)
    for (uint32_t i = 0; i + 1 < in->course[v].count; ++i) {
      piece p;
      if (find_piece(s, echo, box->bottom_m, v, i, &p)) lay(&p, sonde_truth_pose(echo), box, cells);
    }
}

void scene_find_blood(const sonde_flow_scene *s, const sonde_echo *echo, const sonde_vec3 *drawn,
                      uint32_t count, scene_blood *blood) {
  SONDE_ASSERT(s && echo && drawn && blood && count > 0);
  const sonde_interior *in = s->interior;
  // A ball that holds the places, and what may reach into it.
  double far_m = 0;
  for (uint32_t n = 0; n < count; ++n) {
    blood[n].drive = -1;
    far_m = fmax(far_m, v_distance(drawn[n], drawn[0]));
  }
  const double depth_m = pose_apply_inverse(sonde_truth_pose(echo), drawn[0]).z + far_m;
  for (uint32_t v = 0; v < in->vessel_count; ++v)
    for (uint32_t i = 0; i + 1 < in->course[v].count; ++i) {
      piece p;
      const double reach_m = 0.03 + far_m;
      if (v_distance(in->state[v][i].centre_m, drawn[0]) > reach_m ||
          !find_piece(s, echo, depth_m, v, i, &p))
        continue;
      for (uint32_t n = 0; n < count; ++n)
        if (blood[n].drive < 0) (void)blood_at(&p, drawn[n], &blood[n]);
    }
}
