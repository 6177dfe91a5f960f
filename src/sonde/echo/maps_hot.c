// Third stage of the scatterers: affine maps of the displaced cubes.
//
// One map takes a cube's scatterers straight to lines and samples; close to a vessel eight maps
// follow its wall. Cubes hold fewer scatterers where the resolution cell is large. The lumen
// belongs to the blood: the tissue's scatterers in it are clutter.
#include "base/base.h"
#include "echo/bands.h"
#include "echo/cubes.h"
#include "echo/sound.h"

// Image coordinates of four points that walls moved.
static void image_points(const sonde_echo *echo, uint32_t group, float_x4 at[4]) {
  const sonde_cubes *s = echo->cubes;
  float_x4 p[3], image[4] = {{0}};
  for (int k = 0; k < 3; ++k) p[k] = vload_float_x4(s->place_m[k] + 4 * group);
  if (!(echo->frame.radius_m > 0)) {
    for (int k = 0; k < 3; ++k)
      image[k] = s->image[k] + p[0] * s->to_image[0][k] + p[1] * s->to_image[1][k] +
                 p[2] * s->to_image[2][k];
    vtranspose_float_x4(image, at);
    return;
  }
  for (int i = 0; i < 4; ++i) {
    sonde_vec3 world = vec3((double)p[0][i], (double)p[1][i], (double)p[2][i]);
    at[i] = point_of(sonde_echo_from_world(echo, v_add(s->corner, world)));
  }
}

// From image coordinates to those of the grid; false when the map lies beside the slab.
static bool make_map(const sonde_echo *echo, float_x4 origin, const float_x4 axis[3], uint32_t from,
                     uint32_t count, splat_map *one) {
  const double half = sonde_echo_elevation(echo, (double)origin[2] * echo->depth_per_row);
  const float_x4 unit = {(float)(echo->lines_per_column * SONDE_FINE), (float)(1 / half),
                         (float)(echo->depth_per_row / echo->frame.step_m), 0};
  const float_x4 pad = {0, 0, (float)echo->pad_samples, 0}, first = origin * unit + pad;
  const float_x4 m[3] = {axis[0] * unit, axis[1] * unit, axis[2] * unit};
  float reach = 0.5f * (fabsf(m[0][1]) + fabsf(m[1][1]) + fabsf(m[2][1]));
  if (fabsf(first[1]) > 1 + reach) return false;
  vstore(one->m[0], first), one->m[0][3] = 1;
  for (int k = 0; k < 3; ++k) vstore(one->m[k + 1], m[k]);
  if (sonde_sound_on(echo)) sonde_sound_move(echo, one);
  one->from = from, one->count = count, one->lumen = echo->bands->lumens, one->lumens = 0;
  return true;
}

// Whether a form exceeds 1 for all coordinates of +-1/2.
static bool is_beyond(const float form[4]) {
  return fabsf(form[0]) > 1 + 0.5f * (fabsf(form[1]) + fabsf(form[2]) + fabsf(form[3]));
}

// Maps of the eight pieces of a cube. The middles of two neighbours are as far apart as a piece is
// long: one point per piece, moved by the walls, gives them all.
static void map_pieces(sonde_echo *echo, const moved_cube *c) {
  const uint32_t each = echo->per_piece, shares = SONDE_LOOSE / each;
  float_x4 at[8];
  splat_lumen lumen[MOST_VESSELS];
  image_points(echo, c->group, at), image_points(echo, c->group + 1, at + 4);
  // The lumina that a cube touches, over its coordinates; solid clot belongs to the tissue. The
  // fewer the area, the denser the tissue's scatterers are in it: clutter keeps its power.
  uint32_t lumens = 0;
  for (uint32_t k = 0; k < c->walls; ++k) {
    const float(*w)[WALL_ROOM] = echo->cubes->wall[k];
    const uint32_t g = c->group, which = echo->shown[c->wall[k].vessel];
    const float_x4 along = point_of(echo->interior->course[which].line);
    const float_x4 centre = {w[WALL_REST][g], w[WALL_REST + 1][g], w[WALL_REST + 2][g], 0},
                   flat = {w[WALL_FLAT][g], w[WALL_FLAT + 1][g], w[WALL_FLAT + 2][g], 0},
                   across = {w[WALL_ACROSS][g], w[WALL_ACROSS + 1][g], w[WALL_ACROSS + 2][g], 0};
    const float scale = 1 / w[WALL_RADIUS][g], edge = (float)echo->cell_m * scale;
    const float_x4 d = (c->rest - centre) * scale;
    splat_lumen *l = &lumen[lumens];
    *l =
        (splat_lumen){{dot_points(d, flat), edge * flat[0], edge * flat[1], edge * flat[2]},
                      {dot_points(d, across), edge * across[0], edge * across[1], edge * across[2]},
                      {(float)c->wall[k].along_m, (float)echo->cell_m * along[0],
                       (float)echo->cell_m * along[1], (float)echo->cell_m * along[2]},
                      c->wall[k].solid,
                      sonde_clutter(echo) * sqrtf(w[WALL_SHORT][g] * w[WALL_LONG][g]) * scale,
                      which,
                      sonde_echo_pathology(echo, which)->form};
    if (c->wall[k].solid < 1 && !is_beyond(l->along) && !is_beyond(l->across)) ++lumens;
  }
  for (uint32_t piece = 0; piece < 8; ++piece) {
    const uint32_t share = (uint32_t)(c->bits >> 32) + piece;
    const float_x4 axis[3] = {at[piece | 1] - at[piece & ~1u], at[piece | 2] - at[piece & ~2u],
                              at[piece | 4] - at[piece & ~4u]};
    splat_map one;
    if (!make_map(echo, at[piece], axis, SONDE_POOL + share % shares * each, each, &one)) continue;
    // The forms of the lumina over the piece, whose middle lies a quarter of an edge off.
    const float offset[3] = {piece & 1 ? 0.25f : -0.25f, piece & 2 ? 0.25f : -0.25f,
                             piece & 4 ? 0.25f : -0.25f};
    for (uint32_t k = 0; k < lumens; ++k) {
      splat_lumen l = lumen[k];
      float *form[] = {l.along, l.across, l.axial};
      for (size_t f = 0; f < SONDE_COUNT_OF(form); ++f) {
        form[f][0] =
            form[f][0] + form[f][1] * offset[0] + form[f][2] * offset[1] + form[f][3] * offset[2];
        for (int i = 1; i < 4; ++i) form[f][i] *= 0.5f;
      }
      if (is_beyond(l.along) || is_beyond(l.across)) continue;
      if (echo->bands->lumens == MOST_LUMENS) {
        ++echo->lost;
        break;
      }
      echo->bands->lumen[echo->bands->lumens++] = l;
      ++one.lumens;
    }
    sonde_bands_add_map(echo, &one);
  }
}

void sonde_maps_make(sonde_echo *echo) {
  const sonde_cubes *s = echo->cubes;
  SONDE_ASSERT(s->count <= CUBES_AT_ONCE && s->groups <= WALL_GROUPS);
  for (const moved_cube *c = s->moved; c < s->moved + s->count; ++c) {
    if (c->close) {
      map_pieces(echo, c);
      continue;
    }
    // Maps of a whole cube. Where resolution cells hold more scatterers than speckle needs, half of
    // a share, or three fourths of it, fade out with depth, while the others take over their
    // energy: tissue that moves through these depths does not change its speckle at once.
    const uint32_t all = echo->per_cell, half = all / 2, fourth = all / 4,
                   patterns = SONDE_POOL / all;
    float_x4 origin = c->at, axis[3] = {c->axis[0], c->axis[1], c->axis[2]}, at[4];
    SONDE_ASSERT(fourth % ECHO_ALIGN == 0 && half == 2 * fourth);
    if (c->by_walls) {
      image_points(echo, c->group, at);
      origin = at[0];
      for (int k = 0; k < 3; ++k) axis[k] = 2 * (at[k + 1] - at[0]);
    }
    for (int k = 0; k < 3; ++k) // mirrored patterns look new
      if (c->bits >> (61 + k) & 1) axis[k] = -axis[k];
    splat_map one;
    const uint32_t from = (uint32_t)(c->bits % patterns) * all;
    if (!make_map(echo, origin, axis, from, all, &one)) continue;
    double row = clamp((double)origin[2] / (echo->plane_rows - 1), 0, 1) * SONDE_SLAB_ROWS;
    double spare = echo->spare_octaves[(uint32_t)row];
    double fading = clamp(2 * (1 - (spare - floor(spare))), 0, 1),
           other = sqrt(2 - fading * fading);
    if (!(spare > 0) || (spare < 1 && fading >= 1)) {
      sonde_bands_add_map(echo, &one);
      continue;
    }
    // Parts of the share: which, and the amplitude of their scatterers.
    struct {
      uint32_t first, count;
      double amplitude;
    } part[2] = {{0, half, other}, {half, half, fading}};
    if (spare >= 2)
      part[0].count = fourth, part[0].amplitude = 2, part[1].count = 0;
    else if (spare >= 1 && fading >= 1)
      part[0].amplitude = sqrt(2), part[1].count = 0;
    else if (spare >= 1) {
      part[0].count = part[1].first = part[1].count = fourth;
      part[0].amplitude = sqrt(2) * other, part[1].amplitude = sqrt(2) * fading;
    }
    for (int k = 0; k < 2 && part[k].count > 0; ++k) {
      one.from = SONDE_POOL + SONDE_LOOSE + from + part[k].first;
      one.count = part[k].count, one.m[0][3] = (float)part[k].amplitude;
      sonde_bands_add_map(echo, &one);
    }
  }
}
