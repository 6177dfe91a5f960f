// Where the vessels' walls take the tissue around them: sonde_vessels_move for many points in
// single precision. Included by kernel.c only.
//
// pull   where one vessel wants the points, and how firmly
// carry  several vessels: each is exact on its own wall
#ifndef SONDE_SRC_ECHO_KERNEL_CARRY_H
#define SONDE_SRC_ECHO_KERNEL_CARRY_H

#include "echo/kernel.h"
#include "echo/kernel_vector.h"

typedef struct vf3 {
  vf x, y, z;
} vf3;

INLINE vf3 minus3(vf3 a, vf3 b) { return (vf3){a.x - b.x, a.y - b.y, a.z - b.z}; }
INLINE vf3 madd3(vf3 a, vf s, vf3 b) { return (vf3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z}; }
INLINE vf dot(vf3 a, vf3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

INLINE vf wall_at(const float (*wall)[WALL_ROOM], int field, uint32_t group) {
  return each4(wall[field] + group);
}
INLINE vf3 wall_vector(const float (*wall)[WALL_ROOM], int field, uint32_t group) {
  return (vf3){wall_at(wall, field, group), wall_at(wall, field + 1, group),
               wall_at(wall, field + 2, group)};
}

// 1 to 0 with level ends.
INLINE vf fade_out(vf t) {
  vf left = 1 - t;
  return left * left * (1 + 2 * t);
}

// Circles become ellipses: in the lumen those of the wall, outside it such as keep the tissue's
// area, up to four radii. The motion along the vessel stays the field's.
INLINE vf pull(const float (*wall)[WALL_ROOM], uint32_t group, vf3 rest, vf3 field, vf3 *move) {
  vf3 flat = wall_vector(wall, WALL_FLAT, group), across = wall_vector(wall, WALL_ACROSS, group);
  vf3 axis = wall_vector(wall, WALL_AXIS, group);
  vf3 d = minus3(rest, wall_vector(wall, WALL_REST, group));
  vf radius = wall_at(wall, WALL_RADIUS, group), half_short = wall_at(wall, WALL_SHORT, group);
  vf half_long = wall_at(wall, WALL_LONG, group), lost = wall_at(wall, WALL_LOST, group);
  vf a = dot(d, flat), b = dot(d, across), square = a * a + b * b, r = root(square);
  vf t = (r / radius - 1) * (1.0f / 3);
  vf fade = fade_out(larger(t, all(0))), c = 0.5f * (half_long - half_short) * fade;
  vf mean = root(larger(square - radius * radius * lost * fade + c * c, all(0)));
  vi inside = r <= radius;
  vf nearest = larger(r, 1e-3f * radius); // not used inside
  vf of_short = pick(inside, half_short / radius, (mean - c) / nearest);
  vf of_long = pick(inside, half_long / radius, (mean + c) / nearest);
  vf3 to = madd3(wall_vector(wall, WALL_SHIFT, group), a * (of_short - 1), flat);
  to = madd3(to, b * (of_long - 1), across);
  *move = madd3(to, dot(minus3(field, to), axis), axis);
  return only(t < 1, wall_at(wall, WALL_ENGAGED, group) * fade);
}

// Weights w_k prod (1 - w_j), j not k, over their sum with prod (1 - w_j). Added up one vessel
// after the other: `free` is the product so far, `share` what the vessels so far have together.
static void carry(const carry_job *job) {
  SONDE_ASSERT(job->groups <= CARRY_GROUPS && job->walls <= MOST_VESSELS);
  for (uint32_t group = 0; group < job->groups; group += W / 4) {
    const uint32_t i = 4 * group;
    vf3 rest = {load(job->rest[0] + i), load(job->rest[1] + i), load(job->rest[2] + i)};
    vf3 place = {load(job->place[0] + i), load(job->place[1] + i), load(job->place[2] + i)};
    vf3 field = minus3(place, rest), sum = {all(0), all(0), all(0)}, first = field;
    vf free = all(1), share = all(0);
    vi none = all_of(-1); // nothing pulls yet
    for (uint32_t k = 0; k < job->walls; ++k) {
      vf3 move;
      vf weight = pull(job->wall[k], group, rest, field, &move), left = 1 - weight;
      vf3 way = minus3(move, field);
      vi begins = none & (weight > 0);
      first = (vf3){pick(begins, move.x, first.x), pick(begins, move.y, first.y),
                    pick(begins, move.z, first.z)};
      none &= ~begins;
      vf own = weight * free;
      sum =
          (vf3){sum.x * left + own * way.x, sum.y * left + own * way.y, sum.z * left + own * way.z};
      share = share * left + own, free = free * left;
    }
    vf whole_share = free + share, scale = 1 / larger(whole_share, all(1e-9f));
    vi mixed = whole_share > 1e-9f;
    store(job->place[0] + i, rest.x + pick(mixed, field.x + scale * sum.x, first.x));
    store(job->place[1] + i, rest.y + pick(mixed, field.y + scale * sum.y, first.y));
    store(job->place[2] + i, rest.z + pick(mixed, field.z + scale * sum.z, first.z));
  }
}

#endif
