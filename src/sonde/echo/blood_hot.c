// Blood: scatterers of its own in the lumina, as dense as the tissue's, so that their number
// follows the area and a closed vein leaves none. Segments of the vessels wait for their bands.
//
// Every streamline carries a train of scatterers one segment apart whose signs are drawn from the
// train's count: flow of any length needs no memory, and each scatterer moves on from segment to
// segment.
#include "base/base.h"
#include "echo/bands.h"
#include "echo/blood.h"
#include "echo/sound.h"
#include "interior/vessels.h"

enum { PULSE_STEPS = 64 };
// Blood whose red cells stick together: its echo's power, and the share by which the amplitude of
// its streaks differs.
static const double most_rouleaux_db = 12, most_streaks = 1;

// Pulses since t = 0, weighted by the pressure above the diastolic one: grows by 1 per beat.
static double beats_of(const sonde_circulation *c, double t) {
  if (!(c->heart_rate_hz > 0)) return 0;
  double beats = c->heart_rate_hz * t, whole = floor(beats), sum = 0, part = 0;
  for (int k = 0; k < PULSE_STEPS; ++k) {
    double at = (k + 0.5) / PULSE_STEPS / c->heart_rate_hz;
    double push = fmax(sonde_arterial_pressure(c, at) - c->diastolic_pa, 0);
    sum += push;
    part += push * clamp((beats - whole) * PULSE_STEPS - k, 0, 1);
  }
  return whole + (sum > 0 ? part / sum : beats - whole);
}

// Map of the lumen between two sections, unit lumen to the grid; returns its volume, 0 when it is
// out of the picture or beside the slab.
static double map_segment(const sonde_echo *echo, const sonde_vessel_state *low,
                          const sonde_vessel_state *high, splat_map *out) {
  const sonde_vec3 middle = v_lerp(low->centre_m, high->centre_m, 0.5);
  const sonde_vec3 along = v_sub(high->centre_m, low->centre_m);
  const double half_short = 0.5 * (low->half_short_m + high->half_short_m);
  const double half_long = 0.5 * (low->half_long_m + high->half_long_m), length = v_norm(along);
  const sonde_vec3 edge[3] = {v_scale(low->flat_axis, 2 * half_short),
                              v_scale(v_cross(low->axis, low->flat_axis), 2 * half_long), along};
  // Image coordinates: columns, metres beside the plane, rows.
  sonde_vec3 at[4] = {sonde_echo_from_world(echo, middle)};
  const double depth = at[0].z * echo->depth_per_row, reach = half_long + length;
  const double slab = sonde_echo_elevation(echo, depth);
  if (fabs(at[0].y) > slab + reach || depth < -reach || depth > echo->frame.depth_m + reach)
    return 0;
  for (int k = 0; k < 3; ++k)
    at[k + 1] = v_scale(v_sub(sonde_echo_from_world(echo, v_madd(middle, 0.5, edge[k])), at[0]), 2);
  if (fabs(at[0].y) > slab + 0.5 * (fabs(at[1].y) + fabs(at[2].y) + fabs(at[3].y))) return 0;
  // Those of the grid.
  const double unit[3] = {echo->lines_per_column * SONDE_FINE, 1 / slab,
                          echo->depth_per_row / echo->frame.step_m};
  *out = (splat_map){0};
  for (int k = 0; k < 4; ++k)
    for (int c = 0; c < 3; ++c) out->m[k][c] = (float)(v_coordinate(at[k], c) * unit[c]);
  out->m[0][2] += (float)echo->pad_samples;
  out->m[0][3] = sqrtf(1 - sonde_clutter(echo) * sonde_clutter(echo));
  if (sonde_sound_on(echo)) sonde_sound_move(echo, out);
  const float beside = 0.5f * (fabsf(out->m[1][1]) + fabsf(out->m[2][1]) + fabsf(out->m[3][1]));
  return fabsf(out->m[0][1]) <= 1 + beside ? SONDE_PI * half_short * half_long * length : 0;
}

// Path of the mean flow in a vessel since t = 0 by the time alone, m along its axis.
static double path_of(const sonde_echo *echo, uint32_t which, double t_s) {
  const sonde_echo_flow *flow = &echo->flow;
  const double rate = flow->circulation.heart_rate_hz;
  const sonde_vessel_course *course = &echo->interior->course[which];
  // The z of models of legs points to the foot.
  const double distal = echo->interior->section[which][course->count / 2].axis.z > 0 ? 1 : -1;
  if (course->kind != SONDE_VESSEL_VEIN)
    return distal * flow->artery_m_s * (rate > 0 ? beats_of(&flow->circulation, t_s) / rate : t_s);
  if (sonde_echo_pathology(echo, which)->thrombus_fraction >= 1) return 0;
  return -distal * flow->vein_m_s * t_s;
}

void sonde_blood_find(sonde_echo *echo) {
  const double half_s = 5e-3, t = echo->flow.t_s;
  for (uint32_t shown = 0; shown < echo->shown_count; ++shown) {
    const uint32_t which = echo->shown[shown];
    SONDE_ASSERT(which < echo->interior->vessel_count);
    if (echo->flow.blood) {
      echo->moves[shown] = echo->flow.blood[which];
      continue;
    }
    const double before_m = path_of(echo, which, t - half_s),
                 after_m = path_of(echo, which, t + half_s);
    echo->moves[shown] = (sonde_vessel_blood){.path_m = path_of(echo, which, t),
                                              .speed_m_s = (after_m - before_m) / (2 * half_s),
                                              .shut = 0.5};
  }
}

void sonde_echo_blood(sonde_echo *echo) {
  const sonde_interior *in = echo->interior;
  const double density = echo->per_cell / (echo->cell_m * echo->cell_m * echo->cell_m);
  SONDE_ASSERT(echo->frame.pathology != NULL);
  echo->bled = 0;
  for (uint32_t shown = 0; shown < echo->shown_count; ++shown) {
    const uint32_t which = echo->shown[shown], sections = in->course[which].count;
    if (sections < 2) continue;
    const sonde_vessel_blood moves = echo->moves[shown];
    const float brighter = amplitude_of_db((float)(most_rouleaux_db * moves.rouleaux));
    const int32_t first = (int32_t)ceil(in->section[which][0].along_m / sonde_segment_m);
    const int32_t last = (int32_t)floor(in->section[which][sections - 1].along_m / sonde_segment_m);
    sonde_vessel_state low, high;
    bool known = sonde_vessel_at(in, which, first * sonde_segment_m, &low);
    for (int32_t k = first; k < last && known; ++k, low = high) {
      known = sonde_vessel_at(in, which, (k + 1) * sonde_segment_m, &high);
      blood_segment one = {.flowed = moves.path_m / sonde_segment_m,
                           .streaks = most_streaks * moves.rouleaux,
                           .solid = sonde_echo_solid(echo, which, low.rest_centre_m.z),
                           .form = sonde_echo_pathology(echo, which)->form,
                           .salt = (uint32_t)echo->seed + which,
                           .segment = k,
                           .vessel = which};
      if (!known || !(one.solid < 1)) continue;
      one.count = (uint32_t)fmin(density * map_segment(echo, &low, &high, &one.map), SONDE_BLOOD);
      if (one.count == 0) continue;
      one.map.m[0][3] *= brighter;
      // Streamlines that clot leaves.
      uint32_t flowing = 0;
      for (uint32_t i = 0; i < one.count && one.solid > 0; ++i)
        flowing +=
            !sonde_blood_in_clot(&one, echo->blood.x[i], echo->blood.y[i], echo->blood.z[i] - 0.5f);
      if (!(one.solid > 0)) flowing = one.count;
      echo->bled += flowing, echo->moved += flowing;
      sonde_bands_add_segment(echo, &one);
    }
  }
}
