// Where the vessels' walls take the tissue around them: sonde_vessels_warp and sonde_vessels_smooth
// for many points in single precision. Included by kernel.c only.
#ifndef SONDE_SRC_ECHO_KERNEL_WALLS_H
#define SONDE_SRC_ECHO_KERNEL_WALLS_H

#include "base/base.h"
#include "base/vector_records.h"
#include "echo/kernel.h"
#include "interior/interior.h"

typedef struct floats3 {
  floats x, y, z;
} floats3;

INLINE floats3 minus3(floats3 a, floats3 b) { return (floats3){a.x - b.x, a.y - b.y, a.z - b.z}; }
INLINE floats3 madd3(floats3 a, floats s, floats3 b) {
  return (floats3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}
INLINE floats dot(floats3 a, floats3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

INLINE floats wall_at(const float (*wall)[WALL_ROOM], int field, uint32_t group) {
  return vrepeat4(wall[field] + group);
}
INLINE floats3 wall_vector(const float (*wall)[WALL_ROOM], int field, uint32_t group) {
  return (floats3){wall_at(wall, field, group), wall_at(wall, field + 1, group),
                   wall_at(wall, field + 2, group)};
}

// 1 to 0 with level ends.
INLINE floats fade_out(floats t) {
  floats rest = 1 - t;
  return rest * rest * (1 + 2 * t);
}

// A point of a cross-section.
typedef struct floats2 {
  floats x, y;
} floats2;

// Where a point lies beside a vessel at rest, and the vessel's hold on it: 1 at the wall, 0 beyond
// four radii, times the coupling.
typedef struct reach {
  floats2 at; // from the vessel's centre: short and long axis, m
  floats r, fade, weight;
} reach;

INLINE reach find_reach(const float (*wall)[WALL_ROOM], uint32_t group, floats3 rest) {
  floats3 d = minus3(rest, wall_vector(wall, WALL_REST, group));
  reach p = {.at = {dot(d, wall_vector(wall, WALL_FLAT, group)),
                    dot(d, wall_vector(wall, WALL_ACROSS, group))}};
  p.r = vsqrt(p.at.x * p.at.x + p.at.y * p.at.y);
  floats t = (p.r / wall_at(wall, WALL_RADIUS, group) - 1) * (1.0f / 3);
  t = vmin(vmax(t, vset(0)), vset(1));
  p.fade = fade_out(t);
  p.weight = vonly(t < 1, wall_at(wall, WALL_COUPLING, group) * p.fade);
  return p;
}

// Rotates a point by an angle whose half has the tangent `half`.
INLINE floats2 rotated(floats2 p, floats half) {
  floats whole = 2 / (1 + half * half), cosine = whole - 1, sine = half * whole;
  return (floats2){cosine * p.x - sine * p.y, sine * p.x + cosine * p.y};
}

// A point of the section where one vessel warps it: the wall goes to its ellipse, inside it the
// point is scaled with the lumen, and outside the area between is kept, fading with the distance.
INLINE floats2 warped_by(const float (*wall)[WALL_ROOM], uint32_t group, reach p) {
  floats radius = wall_at(wall, WALL_RADIUS, group), angle = wall_at(wall, WALL_ROTATION, group);
  floats tissue_long = wall_at(wall, WALL_TISSUE_LONG, group);
  floats half_short = wall_at(wall, WALL_SHORT, group) / wall_at(wall, WALL_TISSUE_SHORT, group);
  floats half_long = wall_at(wall, WALL_LONG, group) / tissue_long;
  half_short = vmax(half_short, (float)sonde_least_lumen * radius);
  floats c = 0.5f * (half_long - half_short) * p.fade;
  floats square = p.r * p.r - (radius * radius - half_short * half_long) * p.fade + c * c;
  floats mean = vsqrt(vmax(square, vset(0))), per = 1 / vmax(p.r, 1e-3f * radius);
  ints inside = p.r <= radius;
  floats2 q = rotated(p.at, angle * (1 - p.fade));
  q = (floats2){vselect(inside, p.at.x * (half_short / radius), q.x * ((mean - c) * per)),
                vselect(inside, p.at.y * (half_long / radius), q.y * ((mean + c) * per))};
  q.y -= p.fade * wall_at(wall, WALL_SHEAR, group) / tissue_long * q.x;
  return rotated(q, -angle);
}

// Share of one wall beside others: 1 on the wall, 0 on another, o beyond its reach, with o the
// product of 1 - w of the others.
INLINE floats share_of(const floats *weight, uint32_t walls, uint32_t k) {
  floats others = vset(1);
  for (uint32_t j = 0; j < walls; ++j)
    if (j != k) others *= 1 - weight[j];
  return others / vmax(others + (1 - weight[k]) * (1 - others), vset(1e-9f));
}

INLINE floats3 load3(const float (*from)[WALL_POINTS], uint32_t i) {
  return (floats3){vload(from[0] + i), vload(from[1] + i), vload(from[2] + i)};
}
INLINE void store3(float (*to)[WALL_POINTS], uint32_t i, floats3 a) {
  vstore(to[0] + i, a.x), vstore(to[1] + i, a.y), vstore(to[2] + i, a.z);
}

// Rest points where the vessels beside them warp them.
static void warp_tissue(const wall_job *job) {
  SONDE_ASSERT(job->groups <= WALL_GROUPS && job->walls <= MOST_VESSELS);
  for (uint32_t group = 0; group < job->groups; group += FLOATS / 4) {
    floats3 rest = load3(job->rest, 4 * group), at = rest;
    floats weight[MOST_VESSELS];
    floats2 move[MOST_VESSELS];
    for (uint32_t k = 0; k < job->walls; ++k) {
      reach p = find_reach(job->wall[k], group, rest);
      floats2 to = warped_by(job->wall[k], group, p);
      floats lead = vonly(p.weight > 0, wall_at(job->wall[k], WALL_COUPLING, group));
      weight[k] = p.weight, move[k] = (floats2){lead * (to.x - p.at.x), lead * (to.y - p.at.y)};
    }
    for (uint32_t k = 0; k < job->walls; ++k) {
      floats share = share_of(weight, job->walls, k);
      at = madd3(at, share * move[k].x, wall_vector(job->wall[k], WALL_FLAT, group));
      at = madd3(at, share * move[k].y, wall_vector(job->wall[k], WALL_ACROSS, group));
    }
    store3(job->warped, 4 * group, at);
  }
}

// Points of the image where the walls smooth them: what the field adds to the wall's ellipse beyond
// its gradient ends there. The motion along a vessel stays the field's.
static void smooth_tissue(const wall_job *job) {
  SONDE_ASSERT(job->groups <= WALL_GROUPS && job->walls <= MOST_VESSELS);
  for (uint32_t group = 0; group < job->groups; group += FLOATS / 4) {
    const uint32_t i = 4 * group;
    floats3 rest = load3(job->rest, i), place = load3((const float(*)[WALL_POINTS])job->place, i);
    floats3 warped = load3((const float(*)[WALL_POINTS])job->warped, i), at = place;
    floats weight[MOST_VESSELS];
    for (uint32_t k = 0; k < job->walls; ++k)
      weight[k] = find_reach(job->wall[k], group, rest).weight;
    for (uint32_t k = 0; k < job->walls; ++k) {
      const float(*wall)[WALL_ROOM] = job->wall[k];
      floats3 flat = wall_vector(wall, WALL_FLAT, group),
              across = wall_vector(wall, WALL_ACROSS, group);
      floats3 centre = wall_vector(wall, WALL_REST, group), d = minus3(warped, centre);
      floats3 off = minus3(minus3(place, centre), wall_vector(wall, WALL_SHIFT, group));
      floats2 q =
          rotated((floats2){dot(d, flat), dot(d, across)}, wall_at(wall, WALL_ROTATION, group));
      floats on_short = wall_at(wall, WALL_TISSUE_SHORT, group) * q.x - dot(off, flat);
      floats on_long = wall_at(wall, WALL_TISSUE_LONG, group) * q.y +
                       wall_at(wall, WALL_SHEAR, group) * q.x - dot(off, across);
      floats firm =
          weight[k] * share_of(weight, job->walls, k) * wall_at(wall, WALL_SMOOTHING, group);
      at = madd3(madd3(at, firm * on_short, flat), firm * on_long, across);
    }
    store3(job->place, i, at);
  }
}

#endif
