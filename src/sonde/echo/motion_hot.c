// Second stage of the scatterers: where the tissue's motion takes the cubes of the slab.
//
// Every point goes where sonde_interior_displacement takes it, walls of vessels included. The field
// takes a cube's middle to the image by Newton steps in the coarse plane. Beside a vessel the walls
// warp some points of the cube, the field takes these, and the walls smooth them: the middles
// of the eight pieces of a cube that is close, else the middle and those of three faces.
#include "base/base.h"
#include "base/random.h"
#include "echo/cubes.h"
#include "interior/vessels.h"

static const double close_m = 10e-3; // rest distance within which a cube goes in pieces
static const double close_radii = 3; // of a branch
static const double reach_radii = 4; // of the vessel, over which a wall moves the tissue
static const double margin_m = 1e-6; // of boxes in single precision
enum { STEPS = 2 };                  // of Newton's, from a foot within a millimetre or two

void sonde_motion_begin(sonde_echo *echo) {
  sonde_cubes *s = echo->cubes;
  const sonde_interior *in = echo->interior;
  const frame *f = &echo->frame;
  const double h = echo->cell_m;
  s->count = s->groups = s->walls = 0;
  // Below a flat face image coordinates and lengths from the corner are affine to each other.
  const double step[3] = {echo->lines_per_column * f->pitch_m, 1, echo->depth_per_row};
  const sonde_mat3 probe = q_matrix(f->probe.rotation);
  s->place = point_of(v_sub(sonde_echo_to_world(echo, vec3(0, 0, 0)), s->corner));
  s->image = point_of(sonde_echo_from_world(echo, s->corner));
  for (int c = 0; c < 3; ++c) {
    sonde_vec3 world = vec3(c == 0, c == 1, c == 2), local = m_mul_v(f->from_world, world);
    s->to_place[c] = point_of(v_scale(m_column(&probe, c), step[c]));
    s->to_image[c] = point_of(vec3(local.x / step[0], local.y, local.z / step[2]));
  }
  // Stations of the vessels in view that lie there, and the box of what they reach.
  for (uint32_t k = 0; k < echo->shown_count; ++k) {
    const uint32_t which = echo->shown[k], count = in->course[which].count;
    const sonde_vessel_section *section = in->section[which];
    // Extent of the box along the vessel's line.
    double first = INFINITY, last = -INFINITY;
    for (int c = 0; c < 8; ++c) {
      sonde_vec3 offset = vec3(c & 1 ? h * echo->box_size[0] : 0, c & 2 ? h * echo->box_size[1] : 0,
                               c & 4 ? h * echo->box_size[2] : 0);
      double along = v_dot(v_sub(v_add(s->corner, offset), in->origin), in->course[which].line);
      first = fmin(first, along), last = fmax(last, along);
    }
    s->low[k] = vset_float_x4(INFINITY), s->high[k] = -s->low[k];
    for (uint32_t i = 0; i < count; ++i) {
      if (i + 1 < count && section[i + 1].along_m < first) continue;
      if (i > 0 && section[i - 1].along_m > last) break;
      const sonde_vessel_state *v = &in->state[which][i];
      s->section[k][i] = (cube_section){point_of(v_sub(v->rest_centre_m, s->corner)),
                                        point_of(v_sub(v->centre_m, v->rest_centre_m)),
                                        point_of(v->axis),
                                        point_of(v->flat_axis),
                                        {(float)v->rest_radius_m, (float)v->coupling,
                                         (float)v->half_short_m, (float)v->half_long_m},
                                        {(float)v->tissue_rotation, (float)v->tissue_short,
                                         (float)v->tissue_shear, (float)v->tissue_long},
                                        (float)v->tissue_smoothing};
      float_x4 reach =
          vset_float_x4((float)(fmax(close_m, reach_radii * v->rest_radius_m + h) + margin_m));
      s->low[k] = vmin(s->low[k], s->section[k][i].rest - reach);
      s->high[k] = vmax(s->high[k], s->section[k][i].rest + reach);
    }
  }
}

// Image coordinates of a rest point by Newton steps of its foot in the plane, beginning at `at`;
// beside the plane the tissue continues along the derivative there, which `in` receives.
static float_x4 locate_point(const sonde_echo *echo, float_x4 rest, float_x4 at, float_x4 in[3]) {
  const float last_row = (float)(echo->plane_rows - 1);
  for (int step = 0; step < STEPS; ++step) {
    float a = fminf(fmaxf(at[0], 0), SONDE_PLANE_COLUMNS - 1), b = fminf(fmaxf(at[2], 0), last_row);
    uint32_t i = (uint32_t)a, j = (uint32_t)b;
    if (i > SONDE_PLANE_COLUMNS - 2) i = SONDE_PLANE_COLUMNS - 2;
    if (j > echo->plane_rows - 2) j = echo->plane_rows - 2;
    const cube_node *top = &echo->cubes->node[j * SONDE_PLANE_COLUMNS + i];
    const cube_node *low = top + SONDE_PLANE_COLUMNS;
    const float_x4 u = vset_float_x4(a - (float)i), v = vset_float_x4(b - (float)j);
    const float_x4 u0 = 1 - u, v0 = 1 - v, share[4] = {u0 * v0, u * v0, u0 * v, u * v};
#define BLEND(field)                                                                               \
  (share[0] * top[0].field + share[1] * top[1].field + share[2] * low[0].field +                   \
   share[3] * low[1].field)
    const float_x4 miss = rest - BLEND(rest); // from the foot to the point, at rest
    in[0] = BLEND(in[0]), in[1] = BLEND(in[1]), in[2] = BLEND(in[2]);
#undef BLEND
    at = (float_x4){a, 0, b, 0} + transform_point(in, miss);
  }
  return at;
}

// Vessels beside a cube. Whether it goes in pieces depends on the tissue at rest alone: its
// scatterers stay the same while the walls move.
static void find_walls(const sonde_echo *echo, const slab_cube *from, moved_cube *c) {
  sonde_cubes *s = echo->cubes;
  const sonde_interior *in = echo->interior;
  const double h = echo->cell_m;
  const sonde_vec3 centre =
      vec3((from->number[0] + 0.5) * h, (from->number[1] + 0.5) * h, (from->number[2] + 0.5) * h);
  const double s_m = v_dot(v_sub(centre, in->origin), in->axis);
  for (uint32_t k = 0; k < echo->shown_count; ++k) {
    if (!vall((c->rest >= s->low[k]) & (c->rest <= s->high[k]))) continue;
    const uint32_t which = echo->shown[k];
    uint32_t i;
    double t;
    const double along_m = sonde_vessel_along(in, which, centre, s_m);
    if (!sonde_vessel_sections(in, which, along_m, &i, &t)) continue;
    const sonde_vessel_state *a = &in->state[which][i], *b = a + 1;
    sonde_vec3 middle = v_lerp(a->rest_centre_m, b->rest_centre_m, t);
    double radius = a->rest_radius_m + t * (b->rest_radius_m - a->rest_radius_m);
    double distance = v_distance(centre, middle);
    c->close = c->close || distance < (which < 2 ? close_m : fmin(close_m, close_radii * radius));
    if (!(distance < reach_radii * radius + h)) continue;
    double solid = sonde_echo_solid(echo, which, middle.z);
    bool closed = fmin(a->area_ratio, b->area_ratio) < sonde_least_lumen;
    if (closed && fmin(a->coupling, b->coupling) < 1) solid = 1; // its walls touch and lead no gap
    c->wall[c->walls++] = (cube_wall){k, i, (float)t, (float)solid, along_m};
    c->by_walls = c->by_walls || a->coupling > 0 || b->coupling > 0;
  }
  c->by_walls = c->by_walls || c->close; // pieces take one path whether a wall moves or not
  if (!c->by_walls) return;
  // Points of a cube that walls move, four to a group, and the vessels beside them.
  const float edge = (float)echo->cell_m, quarter = 0.25f;
  const float_x4 low = vset_float_x4(-quarter), even = {-quarter, quarter, -quarter, quarter},
                 halves = {-quarter, -quarter, quarter, quarter};
  const float_x4 piece[2][3] = {{even, halves, low}, {even, halves, -low}};
  const float_x4 whole[3] = {{0, 0.5f, 0, 0}, {0, 0, 0.5f, 0}, {0, 0, 0, 0.5f}};
  const uint32_t first = s->groups, end = first + (c->close ? 2 : 1);
  c->group = first, s->groups = end;
  for (uint32_t g = first; g < end; ++g)
    for (int k = 0; k < 3; ++k)
      vstore(s->rest[k] + 4 * g, c->rest[k] + (c->close ? piece[g - first][k] : whole[k]) * edge);
  for (uint32_t k = 0; k < c->walls; ++k) {
    // State of the vessel between its two sections.
    const cube_wall *w = &c->wall[k];
    const cube_section *a = &s->section[w->vessel][w->section], *b = a + 1;
    const float_x4 t = vset_float_x4(w->share), u = 1 - t, size = u * a->size + t * b->size;
    const float_x4 tissue = u * a->tissue + t * b->tissue, mean = u * a->flat + t * b->flat;
    const float_x4 axis = direction_of(u * a->axis + t * b->axis, a->axis);
    const float_x4 flat =
        direction_of(mean - vset_float_x4(dot_points(mean, axis)) * axis, a->flat);
    const float_x4 vector[] = {u * a->rest + t * b->rest, u * a->shift + t * b->shift, axis, flat,
                               cross_points(axis, flat)};
    for (uint32_t g = first; g < end; ++g) {
      for (int f = 0; f < WALL_RADIUS; ++f) s->wall[k][f][g] = vector[f / 3][f % 3];
      for (int f = 0; f < 4; ++f) s->wall[k][WALL_RADIUS + f][g] = size[f];
      for (int f = 0; f < 4; ++f) s->wall[k][WALL_ROTATION + f][g] = tissue[f];
      s->wall[k][WALL_SMOOTHING][g] = a->smoothing + w->share * (b->smoothing - a->smoothing);
    }
  }
  for (uint32_t k = c->walls; k < echo->shown_count; ++k) // no vessel
    for (uint32_t g = first; g < end; ++g) {
      for (int f = WALL_RADIUS; f < WALL_FIELDS; ++f) s->wall[k][f][g] = 1;
      s->wall[k][WALL_COUPLING][g] = 0;
    }
  if (c->walls > s->walls) s->walls = c->walls;
}

uint32_t sonde_motion_displace(sonde_echo *echo, uint32_t first) {
  sonde_cubes *s = echo->cubes;
  uint32_t next = first;
  SONDE_ASSERT(first < s->slab_count && s->slab_count <= SONDE_MAX_CELLS);
  s->count = s->groups = s->walls = 0;
  // The field takes the middles and edges of the cubes.
  for (; next < s->slab_count && s->count < CUBES_AT_ONCE && s->groups + 2 <= WALL_GROUPS; ++next) {
    const slab_cube *from = &s->slab[next];
    moved_cube *c = &s->moved[s->count++];
    const uint64_t key = (uint64_t)(uint16_t)from->number[0] << 32 |
                         (uint64_t)(uint16_t)from->number[1] << 16 | (uint16_t)from->number[2];
    c->rest = from->rest, c->bits = sonde_random_bits(echo->seed + 2, key);
    c->close = c->by_walls = false, c->walls = 0;
    c->at = locate_point(echo, c->rest, from->at, c->axis);
    for (int k = 0; k < 3; ++k) c->axis[k] *= (float)echo->cell_m;
    if (echo->vessels) find_walls(echo, from, c);
  }
  // Walls warp the points beside them, the field takes these, and the walls smooth them.
  const wall_job job = {s->groups,
                        s->walls,
                        (const float(*)[WALL_FIELDS][WALL_ROOM])s->wall,
                        (const float(*)[WALL_POINTS])s->rest,
                        s->warped,
                        s->place_m};
  echo->kernels->warp(&job);
  const float per_cube = (float)(1 / echo->cell_m);
  for (const moved_cube *c = s->moved; c < s->moved + s->count; ++c)
    for (uint32_t g = 0; c->by_walls && g < (c->close ? 2 : 1); ++g) {
      // Where the field takes the four warped points of a group, m from the corner.
      const uint32_t group = c->group + g;
      float_x4 at[4], image[4], in[3];
      for (uint32_t i = 0; i < 4; ++i) {
        const uint32_t n = 4 * group + i;
        const float_x4 rest = {s->warped[0][n], s->warped[1][n], s->warped[2][n], 0};
        const float_x4 guess = c->at + transform_point(c->axis, (rest - c->rest) * per_cube);
        at[i] = locate_point(echo, rest, guess, in);
      }
      if (!(echo->frame.radius_m > 0)) {
        vtranspose_float_x4(at, image);
        for (int k = 0; k < 3; ++k)
          vstore(s->place_m[k] + 4 * group, s->place[k] + image[0] * s->to_place[0][k] +
                                                image[1] * s->to_place[1][k] +
                                                image[2] * s->to_place[2][k]);
        continue;
      }
      for (uint32_t i = 0; i < 4; ++i) {
        sonde_vec3 p = vec3((double)at[i][0], (double)at[i][1], (double)at[i][2]);
        p = v_sub(sonde_echo_to_world(echo, p), s->corner);
        for (int k = 0; k < 3; ++k) s->place_m[k][4 * group + i] = (float)v_coordinate(p, k);
      }
    }
  echo->kernels->smooth(&job);
  return next;
}
