// Maps of the cubes of tissue: where they go, with the walls of the vessels beside them.
//
// Every point goes where sonde_interior_displacement takes it, walls included. Per cube one affine
// map takes its scatterers straight to lines and samples; close to a vessel eight maps per cube
// follow its wall, from the carried middles of its eight pieces. The lumen belongs to the blood;
// the tissue's scatterers are the clutter in it.
//
// sonde_cubes_begin  nodes, stations and units of a frame
// bound_vessel       what a vessel can reach
// sonde_cubes_add    one cube: place, walls beside it, points that they carry
// locate, place_of, step_on  image coordinates of its middle, and the derivative there
// move_points        where the field takes the points that the walls gathered
// find_walls, store_wall, add_points  vessels beside it
// sonde_cubes_end, place_some, place_cube, place_pieces  carried points, maps of some cubes
// make_map, add_map  one map, which then waits for its tier
// add_part, add_share  fewer scatterers where the resolution cell is large
// find_lumina, shift_form, add_lumina  the lumina that it leaves empty
#include "base/base.h"
#include "base/random.h"
#include "echo/cubes.h"
#include "echo/tiers.h"

#include <string.h>

static const double close_m = 10e-3; // rest distance within which a cube goes in pieces
static const double close_radii = 3; // of a branch
static const double reach_radii = 4; // of the vessel, over which a wall moves the tissue
static const double margin_m = 1e-6; // of boxes in single precision
enum { STEPS = 2 };                  // of Newton's, from a foot within a millimetre or two

// ---- a frame --------------------------------------------------------------------------------

static void store_nodes(const sonde_echo *echo, sonde_cubes *s) {
  for (uint32_t k = 0; k < echo->plane_rows * SONDE_PLANE_COLUMNS; ++k) {
    const plane_node *from = &echo->node[k];
    s->node[k].rest = point_of(v_sub(from->rest, s->corner));
    for (int c = 0; c < 3; ++c) s->node[k].in[c] = point_of(m_column(&from->in, c));
  }
}

// Image coordinates and lengths from the corner are affine to each other below a flat face.
static void store_frame(const sonde_echo *echo, sonde_cubes *s) {
  const frame *f = &echo->frame;
  const double step[3] = {echo->lines_per_column * f->pitch_m, 1, echo->depth_per_row};
  sonde_mat3 probe = q_matrix(f->probe.rotation);
  sonde_vec3 first = sonde_echo_to_world(echo, vec3(0, 0, 0));
  s->place = point_of(v_sub(first, s->corner));
  s->image = point_of(sonde_echo_from_world(echo, s->corner));
  for (int c = 0; c < 3; ++c) {
    sonde_vec3 world = vec3(c == 0, c == 1, c == 2), local = m_mul_v(f->from_world, world);
    s->to_place[c] = point_of(v_scale(m_column(&probe, c), step[c]));
    s->to_image[c] = point_of(vec3(local.x / step[0], local.y, local.z / step[2]));
  }
  s->unit = point_of(vec3(echo->lines_per_column * SONDE_FINE, 0, echo->depth_per_row / f->step_m));
  s->pad = point_of(vec3(0, 0, echo->pad_samples));
}

static cube_station station_of(const sonde_cubes *s, const sonde_vessel_state *v) {
  const float_x4 size = {(float)v->rest_radius_m, (float)v->lead, (float)v->half_short_m,
                         (float)v->half_long_m};
  const float_x4 tissue = {(float)v->tissue_turn, (float)v->tissue_short, (float)v->tissue_shear,
                           (float)v->tissue_long};
  return (cube_station){point_of(v_sub(v->rest_centre_m, s->corner)),
                        point_of(v_sub(v->centre_m, v->rest_centre_m)),
                        point_of(v->axis),
                        point_of(v->flat_axis),
                        size,
                        tissue,
                        (float)v->tissue_even};
}

// Its stations from s = `first` to `last` along the leg.
static void bound_vessel(const sonde_echo *echo, sonde_cubes *s, uint32_t k, double first,
                         double last) {
  const sonde_interior *interior = echo->interior;
  const uint32_t which = echo->shown[k], count = interior->station_count[which];
  const sonde_station *station = interior->station[which];
  s->low[k] = vset_float_x4(INFINITY), s->high[k] = -s->low[k];
  for (uint32_t i = 0; i < count; ++i) {
    if (i + 1 < count && station[i + 1].s_m < first) continue;
    if (i > 0 && station[i - 1].s_m > last) break;
    const sonde_vessel_state *v = &interior->state[which][i];
    s->station[k][i] = station_of(s, v);
    float_x4 reach = vset_float_x4(
        (float)(fmax(close_m, reach_radii * v->rest_radius_m + echo->cell_m) + margin_m));
    s->low[k] = vmin(s->low[k], s->station[k][i].rest - reach);
    s->high[k] = vmax(s->high[k], s->station[k][i].rest + reach);
  }
}

void sonde_cubes_begin(sonde_echo *echo) {
  sonde_cubes *s = echo->cubes;
  double first = INFINITY, last = -INFINITY, h = echo->cell_m;
  s->count = s->groups = s->walls = 0;
  s->corner = vec3(h * echo->box_first[0], h * echo->box_first[1], h * echo->box_first[2]);
  store_nodes(echo, s);
  store_frame(echo, s);
  for (int k = 0; k < 8; ++k) {
    sonde_vec3 way = vec3(k & 1 ? h * echo->box_size[0] : 0, k & 2 ? h * echo->box_size[1] : 0,
                          k & 4 ? h * echo->box_size[2] : 0);
    sonde_vec3 from = v_sub(v_add(s->corner, way), echo->interior->origin);
    double along = v_dot(from, echo->interior->axis);
    first = fmin(first, along), last = fmax(last, along);
  }
  for (uint32_t k = 0; k < echo->shown_count; ++k) bound_vessel(echo, s, k, first, last);
}

// ---- one cube -------------------------------------------------------------------------------

// A place in the coarse plane: what its nodes give for a foot.
typedef struct foot {
  float_x4 at, miss; // image coordinates in the plane; from there to the point, at rest
  float_x4 in[3];    // the derivative there
} foot;

// The foot that is nearest to image coordinates `at`, and what is left to a rest point.
static foot step_on(const sonde_echo *echo, float_x4 rest, float_x4 at) {
  const float most = (float)(echo->plane_rows - 1);
  float a = fminf(fmaxf(at[0], 0), SONDE_PLANE_COLUMNS - 1), b = fminf(fmaxf(at[2], 0), most);
  uint32_t i = (uint32_t)a, j = (uint32_t)b;
  if (i > SONDE_PLANE_COLUMNS - 2) i = SONDE_PLANE_COLUMNS - 2;
  if (j > echo->plane_rows - 2) j = echo->plane_rows - 2;
  const cube_node *top = &echo->cubes->node[j * SONDE_PLANE_COLUMNS + i];
  const cube_node *low = top + SONDE_PLANE_COLUMNS;
  const float_x4 u = vset_float_x4(a - (float)i), v = vset_float_x4(b - (float)j), u0 = 1 - u,
                 v0 = 1 - v;
  const float_x4 share[4] = {u0 * v0, u * v0, u0 * v, u * v};
#define BLEND(field)                                                                               \
  (share[0] * top[0].field + share[1] * top[1].field + share[2] * low[0].field +                   \
   share[3] * low[1].field)
  return (foot){{a, 0, b, 0}, rest - BLEND(rest), {BLEND(in[0]), BLEND(in[1]), BLEND(in[2])}};
#undef BLEND
}

// Image coordinates of a rest point: Newton steps of its foot in the plane; beside the plane the
// tissue continues along the derivative.
static float_x4 place_of(const sonde_echo *echo, float_x4 rest, float_x4 at, foot *on) {
  for (int step = 0; step < STEPS; ++step) {
    *on = step_on(echo, rest, at);
    at = on->at + transform_point(on->in, on->miss);
  }
  return at;
}

static void locate(const sonde_echo *echo, cube *c, float_x4 at) {
  foot on;
  c->at = place_of(echo, c->rest, at, &on);
  for (int k = 0; k < 3; ++k) c->axis[k] = on.in[k] * (float)echo->cell_m;
}

// Whether a cube goes in pieces depends on the tissue at rest alone: its scatterers stay the same
// while the walls move.
static void find_wall(const sonde_echo *echo, cube *c, sonde_vec3 centre, uint32_t k) {
  const sonde_interior *in = echo->interior;
  const uint32_t which = echo->shown[k];
  uint32_t i;
  double t;
  const double along_m = v_dot(v_sub(centre, in->origin), in->axis);
  if (!sonde_vessel_stations(in, which, along_m, &i, &t)) return;
  const sonde_vessel_state *a = &in->state[which][i], *b = a + 1;
  sonde_vec3 middle = v_lerp(a->rest_centre_m, b->rest_centre_m, t);
  double radius = a->rest_radius_m + t * (b->rest_radius_m - a->rest_radius_m);
  double distance = v_distance(centre, middle);
  c->close = c->close || distance < (which < 2 ? close_m : fmin(close_m, close_radii * radius));
  if (!(distance < reach_radii * radius + echo->cell_m)) return;
  double solid = sonde_echo_solid(echo, which, middle.z);
  bool closed = fmin(a->area_ratio, b->area_ratio) < sonde_least_lumen;
  if (closed && fmin(a->lead, b->lead) < 1) solid = 1; // its walls touch and lead no gap
  c->wall[c->walls++] = (cube_wall){k, i, (float)t, (float)solid, along_m};
  c->carried = c->carried || a->lead > 0 || b->lead > 0;
}

static void find_walls(const sonde_echo *echo, cube *c, const int32_t cell[3]) {
  const sonde_cubes *s = echo->cubes;
  const double h = echo->cell_m;
  for (uint32_t k = 0; k < echo->shown_count; ++k)
    if (vall((c->rest >= s->low[k]) & (c->rest <= s->high[k])))
      find_wall(echo, c, vec3((cell[0] + 0.5) * h, (cell[1] + 0.5) * h, (cell[2] + 0.5) * h), k);
}

// State of a vessel beside the points of some groups.
static void store_wall(sonde_cubes *s, const cube_wall *w, uint32_t k, uint32_t group,
                       uint32_t groups) {
  const cube_station *a = &s->station[w->vessel][w->station], *b = a + 1;
  const float_x4 t = vset_float_x4(w->share), u = 1 - t, size = u * a->size + t * b->size;
  const float_x4 tissue = u * a->tissue + t * b->tissue;
  const float even = a->even + w->share * (b->even - a->even);
  const float_x4 axis = direction_of(u * a->axis + t * b->axis, a->axis),
                 mean = u * a->flat + t * b->flat;
  const float_x4 flat = direction_of(mean - vset_float_x4(dot_points(mean, axis)) * axis, a->flat);
  const float_x4 vector[] = {u * a->rest + t * b->rest, u * a->shift + t * b->shift, axis, flat,
                             cross_points(axis, flat)};
  for (uint32_t g = group; g < group + groups; ++g) {
    for (int f = 0; f < WALL_RADIUS; ++f) s->wall[k][f][g] = vector[f / 3][f % 3];
    for (int f = 0; f < 4; ++f) s->wall[k][WALL_RADIUS + f][g] = size[f];
    for (int f = 0; f < 4; ++f) s->wall[k][WALL_TURN + f][g] = tissue[f];
    s->wall[k][WALL_EVEN][g] = even;
  }
}

static void store_none(sonde_cubes *s, uint32_t k, uint32_t group, uint32_t groups) {
  for (uint32_t g = group; g < group + groups; ++g) {
    for (int f = WALL_RADIUS; f < WALL_FIELDS; ++f) s->wall[k][f][g] = 1;
    s->wall[k][WALL_LEAD][g] = 0;
  }
}

// Four points at offsets from the middle, in edges.
static void add_points(const sonde_echo *echo, const cube *c, uint32_t group,
                       const float_x4 offset[3]) {
  sonde_cubes *s = echo->cubes;
  for (int k = 0; k < 3; ++k)
    vstore(s->rest[k] + 4 * group, c->rest[k] + offset[k] * (float)echo->cell_m);
}

// Where the field takes the four gathered points of a group.
static void move_points(const sonde_echo *echo, const cube *c, uint32_t group) {
  sonde_cubes *s = echo->cubes;
  const float per_cell = (float)(1 / echo->cell_m);
  float_x4 at[4], image[4];
  for (uint32_t i = 0; i < 4; ++i) {
    foot on;
    const uint32_t n = 4 * group + i;
    const float_x4 rest = {s->gathered[0][n], s->gathered[1][n], s->gathered[2][n], 0};
    at[i] =
        place_of(echo, rest, c->at + transform_point(c->axis, (rest - c->rest) * per_cell), &on);
  }
  if (!(echo->frame.radius_m > 0)) {
    vtranspose_float_x4(at, image);
    for (int k = 0; k < 3; ++k)
      vstore(s->moved[k] + 4 * group, s->place[k] + image[0] * s->to_place[0][k] +
                                          image[1] * s->to_place[1][k] +
                                          image[2] * s->to_place[2][k]);
    return;
  }
  for (int i = 0; i < 4; ++i) {
    sonde_vec3 p = vec3((double)at[i][0], (double)at[i][1], (double)at[i][2]);
    p = v_sub(sonde_echo_to_world(echo, p), s->corner);
    for (int k = 0; k < 3; ++k) s->moved[k][4 * group + (uint32_t)i] = (float)v_coordinate(p, k);
  }
}

static const float quarter = 0.25f;

// The middles of the pieces; of a whole cube the middle and those of three faces.
static void carry_cube(const sonde_echo *echo, cube *c) {
  sonde_cubes *s = echo->cubes;
  const float_x4 low = vset_float_x4(-quarter), high = -low,
                 even = {-quarter, quarter, -quarter, quarter},
                 halves = {-quarter, -quarter, quarter, quarter};
  const float_x4 piece[2][3] = {{even, halves, low}, {even, halves, high}};
  const float_x4 whole[3] = {{0, 0.5f, 0, 0}, {0, 0, 0.5f, 0}, {0, 0, 0, 0.5f}};
  const uint32_t groups = c->close ? 2 : 1;
  c->group = s->groups, s->groups += groups;
  for (uint32_t g = 0; g < groups; ++g)
    add_points(echo, c, c->group + g, c->close ? piece[g] : whole);
  for (uint32_t k = 0; k < echo->shown_count; ++k) {
    if (k < c->walls)
      store_wall(s, &c->wall[k], k, c->group, groups);
    else
      store_none(s, k, c->group, groups);
  }
  if (c->walls > s->walls) s->walls = c->walls;
}

static uint64_t cell_key(const int32_t cell[3]) {
  return (uint64_t)(uint16_t)cell[0] << 32 | (uint64_t)(uint16_t)cell[1] << 16 | (uint16_t)cell[2];
}

static void place_some(sonde_echo *echo);

void sonde_cubes_add(sonde_echo *echo, const int32_t cell[3], float_x4 rest, float_x4 at) {
  sonde_cubes *s = echo->cubes;
  if (s->count == CUBES_AT_ONCE || s->groups + 2 > CARRY_GROUPS) place_some(echo);
  cube *c = &s->cube[s->count++];
  c->rest = rest;
  c->bits = sonde_random_bits(echo->seed + 2, cell_key(cell));
  c->close = c->carried = false, c->walls = 0;
  locate(echo, c, at);
  if (echo->vessels) find_walls(echo, c, cell);
  c->carried = c->carried || c->close; // the pieces' way is the same whether a wall moves or not
  if (c->carried) carry_cube(echo, c);
}

// ---- maps -----------------------------------------------------------------------------------

// False when it lies beside the slab.
static bool make_map(const sonde_echo *echo, float_x4 origin, const float_x4 axis[3], uint32_t from,
                     uint32_t count, splat_map *one) {
  const sonde_cubes *s = echo->cubes;
  float_x4 unit = s->unit;
  unit[1] = (float)(1 / sonde_echo_elevation(echo, (double)origin[2] * echo->depth_per_row));
  const float_x4 first = origin * unit + s->pad,
                 m[3] = {axis[0] * unit, axis[1] * unit, axis[2] * unit};
  float reach = 0.5f * (fabsf(m[0][1]) + fabsf(m[1][1]) + fabsf(m[2][1]));
  if (fabsf(first[1]) > 1 + reach) return false;
  vstore(one->m[0], first), one->m[0][3] = 1;
  for (int k = 0; k < 3; ++k) vstore(one->m[k + 1], m[k]);
  one->from = from, one->count = count, one->lumen = echo->tiers->lumens, one->lumens = 0;
  return true;
}

static void add_map(sonde_echo *echo, const splat_map *one) {
  echo->moved += one->count;
  sonde_tiers_add_map(echo, one);
}

// Whether a form exceeds 1 for all coordinates of +-1/2.
static bool is_beyond(const float form[4]) {
  return fabsf(form[0]) > 1 + 0.5f * (fabsf(form[1]) + fabsf(form[2]) + fabsf(form[3]));
}

// The lumina that a cube touches, over its coordinates; solid clot belongs to the tissue. The fewer
// the area, the denser the tissue's scatterers are in it: clutter keeps its power.
static uint32_t find_lumina(const sonde_echo *echo, const cube *c, splat_lumen out[MOST_VESSELS]) {
  uint32_t found = 0;
  const float_x4 along = point_of(echo->interior->axis);
  for (uint32_t k = 0; k < c->walls; ++k) {
    const float(*w)[WALL_ROOM] = echo->cubes->wall[k];
    const uint32_t g = c->group;
    const float_x4 centre = {w[WALL_REST][g], w[WALL_REST + 1][g], w[WALL_REST + 2][g], 0},
                   flat = {w[WALL_FLAT][g], w[WALL_FLAT + 1][g], w[WALL_FLAT + 2][g], 0},
                   across = {w[WALL_ACROSS][g], w[WALL_ACROSS + 1][g], w[WALL_ACROSS + 2][g], 0};
    const float scale = 1 / w[WALL_RADIUS][g], edge = (float)echo->cell_m * scale;
    const float_x4 d = (c->rest - centre) * scale;
    splat_lumen *l = &out[found];
    *l =
        (splat_lumen){{dot_points(d, flat), edge * flat[0], edge * flat[1], edge * flat[2]},
                      {dot_points(d, across), edge * across[0], edge * across[1], edge * across[2]},
                      {(float)c->wall[k].along_m, (float)echo->cell_m * along[0],
                       (float)echo->cell_m * along[1], (float)echo->cell_m * along[2]},
                      c->wall[k].solid > 0 ? 1 - 2 * c->wall[k].solid : 1,
                      sonde_clutter(echo) * sqrtf(w[WALL_SHORT][g] * w[WALL_LONG][g]) * scale,
                      echo->shown[c->wall[k].vessel]};
    if (c->wall[k].solid < 1 && !is_beyond(l->along) && !is_beyond(l->across)) ++found;
  }
  return found;
}

// The same form over a piece whose middle is at `offset`, in edges of the cube.
static void shift_form(const float form[4], float_x4 offset, float out[4]) {
  out[0] = form[0] + form[1] * offset[0] + form[2] * offset[1] + form[3] * offset[2];
  for (int i = 1; i < 4; ++i) out[i] = 0.5f * form[i];
}

static void add_lumina(sonde_echo *echo, splat_map *one, const splat_lumen *lumen, uint32_t count,
                       float_x4 offset) {
  sonde_tiers *tiers = echo->tiers;
  for (uint32_t k = 0; k < count; ++k) {
    splat_lumen l = lumen[k];
    shift_form(lumen[k].along, offset, l.along);
    shift_form(lumen[k].across, offset, l.across);
    shift_form(lumen[k].way, offset, l.way);
    if (is_beyond(l.along) || is_beyond(l.across)) continue;
    if (tiers->lumens == MOST_LUMENS) {
      ++echo->lost;
      return;
    }
    sonde_tiers_add_lumen(tiers, &l);
    ++one->lumens;
  }
}

// Image coordinates of four carried points.
static void carried_points(const sonde_echo *echo, uint32_t group, float_x4 at[4]) {
  const sonde_cubes *s = echo->cubes;
  const float_x4 p[3] = {vload_float_x4(s->moved[0] + 4 * group),
                         vload_float_x4(s->moved[1] + 4 * group),
                         vload_float_x4(s->moved[2] + 4 * group)};
  float_x4 image[4] = {{0}};
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

// The middles of two neighbours are as far apart as a piece is long: one carried point per piece
// gives all the maps.
static void place_pieces(sonde_echo *echo, const cube *c) {
  const uint32_t each = echo->per_piece, shares = SONDE_LOOSE / each;
  float_x4 at[8];
  splat_lumen lumen[MOST_VESSELS];
  carried_points(echo, c->group, at), carried_points(echo, c->group + 1, at + 4);
  const uint32_t lumens = find_lumina(echo, c, lumen);
  for (uint32_t part = 0; part < 8; ++part) {
    const uint32_t share = (uint32_t)(c->bits >> 32) + part;
    const float_x4 axis[3] = {at[part | 1] - at[part & ~1u], at[part | 2] - at[part & ~2u],
                              at[part | 4] - at[part & ~4u]};
    const float_x4 offset = {part & 1 ? quarter : -quarter, part & 2 ? quarter : -quarter,
                             part & 4 ? quarter : -quarter, 0};
    splat_map one;
    if (!make_map(echo, at[part], axis, SONDE_POOL + share % shares * each, each, &one)) continue;
    add_lumina(echo, &one, lumen, lumens, offset);
    add_map(echo, &one);
  }
}

static void add_part(sonde_echo *echo, const splat_map *whole, uint32_t first, uint32_t count,
                     double amplitude) {
  splat_map one = *whole;
  one.from = SONDE_POOL + SONDE_LOOSE + whole->from + first;
  one.count = count, one.m[0][3] = (float)amplitude;
  add_map(echo, &one);
}

// Where resolution cells hold more scatterers than speckle needs, half of a share, or three fourths
// of it, fade out with depth, while the others take over their energy: tissue that moves through
// these depths does not change its speckle at once.
static void add_share(sonde_echo *echo, const splat_map *whole, float row) {
  const uint32_t half = whole->count / 2, fourth = whole->count / 4;
  SONDE_ASSERT(fourth % ECHO_ALIGN == 0 && half == 2 * fourth);
  double at = clamp((double)row / (echo->plane_rows - 1), 0, 1) * SONDE_SLAB_ROWS;
  double spare = echo->spare_octaves[(uint32_t)at];
  if (spare >= 2) {
    add_part(echo, whole, 0, fourth, 2);
    return;
  }
  double left = clamp(2 * (1 - (spare - floor(spare))), 0, 1), more = sqrt(2 - left * left);
  if (spare >= 1 && left >= 1) {
    add_part(echo, whole, 0, half, sqrt(2));
  } else if (spare >= 1) {
    add_part(echo, whole, 0, fourth, sqrt(2) * more);
    add_part(echo, whole, fourth, fourth, sqrt(2) * left);
  } else if (spare > 0 && left < 1) {
    add_part(echo, whole, 0, half, more);
    add_part(echo, whole, half, half, left);
  } else {
    add_map(echo, whole);
  }
}

static void place_cube(sonde_echo *echo, const cube *c) {
  const uint32_t patterns = SONDE_POOL / echo->per_cell;
  float_x4 origin = c->at, axis[3] = {c->axis[0], c->axis[1], c->axis[2]}, at[4];
  if (c->carried) {
    carried_points(echo, c->group, at);
    origin = at[0];
    for (int k = 0; k < 3; ++k) axis[k] = 2 * (at[k + 1] - at[0]);
  }
  for (int k = 0; k < 3; ++k) // mirrored patterns look new
    if (c->bits >> (61 + k) & 1) axis[k] = -axis[k];
  const uint32_t from = (uint32_t)(c->bits % patterns) * echo->per_cell;
  splat_map one;
  if (make_map(echo, origin, axis, from, echo->per_cell, &one)) add_share(echo, &one, origin[2]);
}

static void place_some(sonde_echo *echo) {
  sonde_cubes *s = echo->cubes;
  const carry_job job = {s->groups,
                         s->walls,
                         (const float(*)[WALL_FIELDS][WALL_ROOM])s->wall,
                         (const float(*)[CARRY_POINTS])s->rest,
                         s->gathered,
                         s->moved};
  echo->kernels->gather(&job);
  for (const cube *c = s->cube; c < s->cube + s->count; ++c)
    for (uint32_t g = 0; c->carried && g < (c->close ? 2 : 1); ++g)
      move_points(echo, c, c->group + g);
  echo->kernels->even(&job);
  for (const cube *c = s->cube; c < s->cube + s->count; ++c) {
    if (c->close)
      place_pieces(echo, c);
    else
      place_cube(echo, c);
  }
  s->count = s->groups = s->walls = 0;
}

void sonde_cubes_end(sonde_echo *echo) { place_some(echo); }
