// Blood: scatterers of its own in the lumina, as dense as the tissue's, so that their number
// follows the area and a closed vein leaves none.
//
// Every streamline carries a train of scatterers one segment apart whose signs are drawn from the
// train's count: flow of any length needs no memory, and each scatterer moves on from segment to
// segment.
//
// sonde_echo_blood   all vessels in view, segment by segment
// beats_of           mean share of the pulse up to a time
// travelled          way of the mean flow in a vessel
// segment_map        one segment's lumen in image coordinates
// sonde_blood_lay, in_clot, outside_clot  scatterers on the streamlines of one segment
// form_of            its map
// flow               all segments of a vessel, which then wait for their tiers
#include "base/base.h"
#include "echo/tiers.h"
#include "interior/clot.h"
#include "interior/interior.h"

#include <string.h>

enum { PULSE_STEPS = 64, BATCH = 512 };

static const double segment_m = 2e-3; // along the leg's axis

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

// Way of the mean flow since t = 0, m.
static double travelled(const sonde_echo *echo, uint32_t which) {
  const sonde_echo_flow *flow = &echo->flow;
  if (echo->interior->kind[which] == SONDE_VESSEL_VEIN) {
    bool plug = sonde_echo_pathology(echo, which)->thrombus_fraction >= 1;
    return plug ? 0 : flow->vein_m_s * flow->t_s;
  }
  double rate = flow->circulation.heart_rate_hz;
  if (!(rate > 0)) return -flow->artery_m_s * flow->t_s;
  return -flow->artery_m_s / rate * beats_of(&flow->circulation, flow->t_s);
}

// Lumen between two sections; returns its volume, 0 when it is out of the picture.
static double segment_map(const sonde_echo *echo, const sonde_vessel_state *low,
                          const sonde_vessel_state *high, map *out) {
  sonde_vec3 middle = v_lerp(low->centre_m, high->centre_m, 0.5);
  sonde_vec3 along = v_sub(high->centre_m, low->centre_m);
  double half_short = 0.5 * (low->half_short_m + high->half_short_m);
  double half_long = 0.5 * (low->half_long_m + high->half_long_m), length = v_norm(along);
  sonde_vec3 edge[3] = {v_scale(low->flat_axis, 2 * half_short),
                        v_scale(v_cross(low->axis, low->flat_axis), 2 * half_long), along};
  out->origin = sonde_echo_from_world(echo, middle);
  double depth = out->origin.z * echo->depth_per_row, reach = half_long + length;
  double slab = sonde_echo_elevation(echo, depth);
  if (fabs(out->origin.y) > slab + reach || depth < -reach) return 0;
  if (depth > echo->frame.depth_m + reach) return 0;
  for (int k = 0; k < 3; ++k)
    out->axis[k] =
        v_scale(v_sub(sonde_echo_from_world(echo, v_madd(middle, 0.5, edge[k])), out->origin), 2);
  double beside = 0.5 * (fabs(out->axis[0].y) + fabs(out->axis[1].y) + fabs(out->axis[2].y));
  if (fabs(out->origin.y) > slab + beside) return 0;
  return SONDE_PI * half_short * half_long * length;
}

// Whether a place of a segment lies in clot: coordinates in the segment's unit lumen.
static bool in_clot(const blood_segment *s, float x, float y, float z) {
  SONDE_ASSERT(s != NULL && fabsf(z) <= 1);
  double along_m = (s->segment + 0.5 + (double)z) * segment_m;
  double surface = sonde_clot_surface(s->vessel, along_m, 2 * (double)y);
  return s->solid > 0 && -2 * (double)x > 1 - 2 * s->solid + surface;
}

// Drops the streamlines of a batch that clot fills.
static uint32_t outside_clot(const blood_segment *s, scatter_pool *some, uint32_t count) {
  uint32_t kept = 0;
  for (uint32_t i = 0; i < count; ++i) {
    if (in_clot(s, some->x[i], some->y[i], some->z[i])) continue;
    some->x[kept] = some->x[i], some->y[kept] = some->y[i];
    some->z[kept] = some->z[i], some->sign[kept++] = some->sign[i];
  }
  return kept;
}

void sonde_blood_lay(sonde_echo *echo, const blood_segment *s, splat_limits rows) {
  float x[BATCH], y[BATCH], z[BATCH], sign[BATCH];
  const scatter_pool *blood = &echo->blood;
  SONDE_ASSERT(s->count <= SONDE_BLOOD && s->solid < 1);
  splat_map form = s->map;
  for (uint32_t i = 0; i < s->count; i += BATCH) {
    uint32_t kept = s->count - i < BATCH ? s->count - i : BATCH;
    scatter_pool some = {x, y, z, sign};
    stream_job job = {blood->z + i, blood->sign + i, kept, i, s->way, s->segment, s->salt, z, sign};
    echo->kernels->stream(&job);
    memcpy(x, blood->x + i, kept * sizeof *x);
    memcpy(y, blood->y + i, kept * sizeof *y);
    if (s->solid > 0) kept = outside_clot(s, &some, kept);
    for (; kept % ECHO_ALIGN; ++kept) x[kept] = y[kept] = z[kept] = sign[kept] = 0;
    form.count = kept;
    if (kept > 0) sonde_echo_splat(echo, &some, &form, 1, NULL, rows);
  }
}

// Streamlines of so many that clot leaves: as outside_clot() counts them.
static uint32_t flowing(const sonde_echo *echo, const blood_segment *s) {
  SONDE_ASSERT(s->count <= SONDE_BLOOD);
  const scatter_pool *blood = &echo->blood;
  uint32_t kept = 0;
  for (uint32_t i = 0; i < s->count; ++i)
    kept += !in_clot(s, blood->x[i], blood->y[i], blood->z[i] - 0.5f);
  return kept;
}

// False beside the slab.
static bool form_of(const sonde_echo *echo, const map *m, splat_map *out) {
  double half = sonde_echo_elevation(echo, m->origin.z * echo->depth_per_row);
  const double unit[3] = {echo->lines_per_column * SONDE_FINE, 1 / half,
                          echo->depth_per_row / echo->frame.step_m};
  *out = (splat_map){0};
  for (int k = 0; k < 4; ++k) {
    sonde_vec3 v = k == 0 ? m->origin : m->axis[k - 1];
    for (int c = 0; c < 3; ++c) out->m[k][c] = (float)(v_coordinate(v, c) * unit[c]);
  }
  out->m[0][2] += (float)echo->pad_samples;
  out->m[0][3] = sqrtf(1 - sonde_clutter(echo) * sonde_clutter(echo));
  float reach = 0.5f * (fabsf(out->m[1][1]) + fabsf(out->m[2][1]) + fabsf(out->m[3][1]));
  return fabsf(out->m[0][1]) <= 1 + reach;
}

static void flow(sonde_echo *echo, uint32_t which) {
  const sonde_interior *interior = echo->interior;
  uint32_t stations = interior->station_count[which];
  if (stations < 2) return;
  double density = echo->per_cell / (echo->cell_m * echo->cell_m * echo->cell_m);
  double way = travelled(echo, which) / segment_m;
  const sonde_station *station = interior->station[which];
  int32_t first = (int32_t)ceil(station[0].s_m / segment_m);
  int32_t last = (int32_t)floor(station[stations - 1].s_m / segment_m);
  uint32_t salt = (uint32_t)echo->seed + which;
  sonde_vessel_state low, high;
  bool known = sonde_vessel_at(interior, which, first * segment_m, &low);
  for (int32_t k = first; k < last && known; ++k, low = high) {
    known = sonde_vessel_at(interior, which, (k + 1) * segment_m, &high);
    double solid = sonde_echo_solid(echo, which, low.rest_centre_m.z), volume = 0;
    map m = {0};
    if (known && solid < 1) volume = segment_map(echo, &low, &high, &m);
    uint32_t count = (uint32_t)fmin(density * volume, SONDE_BLOOD);
    blood_segment one = {
        .way = way, .solid = solid, .count = count, .salt = salt, .segment = k, .vessel = which};
    if (count == 0 || !form_of(echo, &m, &one.map)) continue;
    uint32_t kept = solid > 0 ? flowing(echo, &one) : count;
    echo->bled += kept, echo->moved += kept;
    sonde_tiers_add_segment(echo, &one);
  }
}

void sonde_echo_blood(sonde_echo *echo) {
  SONDE_ASSERT(echo->frame.pathology != NULL);
  echo->bled = 0;
  for (uint32_t k = 0; k < echo->shown_count; ++k) flow(echo, echo->shown[k]);
}
