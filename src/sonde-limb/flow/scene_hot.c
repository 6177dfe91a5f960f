// The velocity of every cell of a colour box: pieces of vessels between two sections, laid on the
// image plane where the picture draws them.
#include "flow/scene.h"

#include "base/base.h"
#include "echo/truth.h"

// A piece of a vessel between sections i and i + 1.
typedef struct piece {
  const sonde_flow_scene *scene;
  uint32_t vessel, i;
  const sonde_vessel_state *low, *high;
  sonde_vec3 along, other; // from centre to centre; beside the flat axis
  double length2;
  double scale[2]; // of the profile at both ends, so that what a clot leaves of it carries the flow
  sonde_vec3 offset; // world: from where it is to where the picture draws it
} piece;

// Share of a parabola's flow that a clot leaves, over the share of the area that counts as open.
static double clot_scale(const piece *p, uint32_t i) {
  enum { SIDE = 24 };
  const double solid = scene_solid(p->scene, p->vessel, i);
  const double along_m = p->scene->interior->section[p->vessel][i].along_m;
  double all = 0, free = 0;
  for (int n = 0; n < SIDE * SIDE && solid > 0; ++n) {
    const double a = (n % SIDE + 0.5) / SIDE * 2 - 1, b = (n / SIDE + 0.5) / SIDE * 2 - 1;
    const double speed = fmax(1 - a * a - b * b, 0);
    all += speed;
    free += -a > 1 - 2 * solid + sonde_clot_surface(p->vessel, along_m, b) ? 0 : speed;
  }
  return free > 0 ? (1 - solid) * all / free : 1;
}

// Velocity of the blood at a place of the picture's plane, world; false beside the blood.
static bool blood_at(const piece *p, sonde_vec3 drawn, sonde_vec3 *velocity) {
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
  if (solid > 0 && -a > 1 - 2 * solid + sonde_clot_surface(p->vessel, along_m, b)) return false;
  const scene_section *section = &s->section[p->vessel][p->i];
  const double mean =
      (1 - share) * scene_mean(s, p->vessel, p->i) + share * scene_mean(s, p->vessel, p->i + 1);
  // The profile of the segment's main vein or the arteries, scaled to this mean; else a parabola.
  const bool artery = s->interior->course[p->vessel].kind == SONDE_VESSEL_ARTERY;
  const double *profile = artery ? s->artery_profile : s->profile[section->segment];
  const double whole = artery ? s->artery_m_s : sonde_flow_velocity(&s->flow, section->segment);
  const double at = radius * (SONDE_FLOW_RINGS - 1), least_m_s = 1e-3;
  const int k = (int)at;
  double speed = 2 * mean * (1 - radius * radius);
  if (artery || (section->vein == 0 && fabs(whole) > least_m_s))
    speed = (profile[k] + (at - k) * (profile[k + 1] - profile[k])) *
            (fabs(whole) > least_m_s ? mean / whole : 1);
  const double scale = (1 - share) * p->scale[0] + share * p->scale[1];
  const double heart = section->upwards * (artery ? -1 : 1);
  *velocity = v_scale(p->along, heart * scale * speed / sqrt(p->length2));
  return true;
}

// Lays a piece on the cells whose middles it holds.
static void lay(const piece *p, sonde_pose probe, const sonde_colour_box *box,
                sonde_colour_cell *cells) {
  const sonde_vec3 middle = v_lerp(p->low->centre_m, p->high->centre_m, 0.5);
  const sonde_vec3 at = pose_apply_inverse(probe, v_add(middle, p->offset));
  const double reach = fmax(p->low->half_long_m, p->high->half_long_m) + 0.5 * sqrt(p->length2);
  if (fabs(at.y) > reach) return;
  const double lean = fabs(tan(box->steer_rad)) * reach + reach;
  double low[2], high[2];
  sonde_colour_find(box, at.x - lean, at.z - reach, low);
  sonde_colour_find(box, at.x + lean, at.z + reach, high);
  if (high[0] < low[0]) high[0] = low[0];
  const sonde_vec3 beam =
      q_rotate(probe.rotation, vec3(sin(box->steer_rad), 0, cos(box->steer_rad)));
  const int first[2] = {(int)clamp(low[0] - 1, 0, SONDE_COLOUR_LINES),
                        (int)clamp(low[1] - 1, 0, SONDE_COLOUR_ROWS)};
  const int last[2] = {(int)clamp(high[0] + 2, 0, SONDE_COLOUR_LINES),
                       (int)clamp(high[1] + 2, 0, SONDE_COLOUR_ROWS)};
  for (int row = first[1]; row < last[1]; ++row)
    for (int line = first[0]; line < last[0]; ++line) {
      sonde_colour_cell *cell = &cells[row * SONDE_COLOUR_LINES + line];
      double xz[2];
      sonde_vec3 velocity;
      if (cell->vessel != SONDE_COLOUR_NO_VESSEL) continue;
      sonde_colour_place(box, (uint32_t)line, (uint32_t)row, xz);
      if (!blood_at(p, pose_apply(probe, vec3(xz[0], 0, xz[1])), &velocity)) continue;
      const double towards = -v_dot(velocity, beam);
      *cell = (sonde_colour_cell){.towards_m_s = (float)towards,
                                  .across_m_s =
                                      (float)sqrt(fmax(v_norm2(velocity) - towards * towards, 0)),
                                  .vessel = p->vessel};
    }
}

void sonde_flow_scene_cells(const sonde_flow_scene *s, const sonde_echo *echo,
                            const sonde_colour_box *box, sonde_colour_cell *cells) {
  SONDE_ASSERT(s && echo && box && cells);
  const sonde_interior *in = s->interior;
  const sonde_pose probe = sonde_truth_pose(echo);
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i)
    cells[i] = (sonde_colour_cell){.vessel = SONDE_COLOUR_NO_VESSEL};
  for (uint32_t v = 0; v < in->vessel_count; ++v)
    for (uint32_t i = 0; i + 1 < in->course[v].count; ++i) {
      piece p = {
          .scene = s, .vessel = v, .i = i, .low = &in->state[v][i], .high = &in->state[v][i + 1]};
      const sonde_vec3 at = pose_apply_inverse(probe, p.low->centre_m);
      const double near_m = 0.03; // longer than a piece and a lumen together
      if (fabs(at.y) > near_m || at.z < -near_m || at.z > box->bottom_m + near_m) continue;
      p.along = v_sub(p.high->centre_m, p.low->centre_m), p.length2 = v_norm2(p.along);
      if (!(p.length2 > 0)) continue;
      p.scale[0] = clot_scale(&p, i), p.scale[1] = clot_scale(&p, i + 1);
      p.other = v_cross(p.low->axis, p.low->flat_axis);
      const sonde_vec3 drawn = sonde_truth_drawn_at(echo, p.low->centre_m);
      p.offset = q_rotate(probe.rotation, v_sub(drawn, at));
      lay(&p, probe, box, cells);
    }
}
