// Pixels of a picture from the frames around them, and from a volume: kernels, compiled once for
// each instruction set with SLICE_KERNELS defined; every operation is one IEEE operation per vector
// element, so that all give the same bits. docs/frames_images_theory.md derives the weights.
//
// A picture is divided into blocks and those into tiles. Over a tile the distance d to a plane is
// linear, so its bounds are known from the tile's centre. A plane that covers the whole tile on one
// side hides every plane of that side that lies behind its far bound; two or three candidates
// remain. Where consecutive frames do not cross, slice_strips.h does most of the work.
#include "sweep/slice_strip_kernel.h"
#include "sweep/slice_voxel_kernel.h"

enum { PAIRS = 16 }; // pairs of frames remembered in a tile

// What a row of a tile found: distance and candidate on both sides, -1 for none.
typedef struct row_pick {
  float up_d[SLICE_TILE], down_d[SLICE_TILE];
  int32_t up[SLICE_TILE], down[SLICE_TILE];
} row_pick;

// Directions of the line that joins two planes, in the local coordinates of each: columns and rows
// per metre of distance, or the path linear in the pixel (1, u, v) of the upper frame.
typedef struct pair {
  int32_t up, down;
  bool along_sweep;
  float up_shift[2], down_shift[2];     // half way between the normals: constant
  float up_path[3][3], down_path[3][3]; // along the sweep
} pair;

static void start_at(const double form[3], const rectangle *r, float out[3]) {
  out[0] = (float)(form[0] + form[1] * r->column + form[2] * r->row);
  out[1] = (float)form[1];
  out[2] = (float)form[2];
}

static bool plane_covers(const sonde_slicer *s, const rectangle *r, const slice_plane *plane) {
  bounds u = span(plane->forms.u, r), v = span(plane->forms.v, r);
  return u.low >= s->low[0] && u.high <= s->high[0] && v.low >= s->low[1] && v.high <= s->high[1];
}

// Planes further away are joined with none and seen from nowhere.
static inline double reach_of(const sonde_slicer *s) {
  return s->options.gap_m > s->options.reach_m ? s->options.gap_m : s->options.reach_m;
}

// Planes that may be nearest somewhere in a rectangle, out of `count` candidates whose spans are
// known.
static uint32_t gather_planes(const sonde_slicer *s, const rectangle *r,
                              const slice_plane *const *from, uint32_t count,
                              const slice_spans *spans, const slice_plane **out) {
  // Far bounds of the nearest planes that cover a rectangle: all d >= 0, and all d < 0. The nearest
  // planes usually do.
  const double *low = spans->low, *high = spans->high, none = (double)INFINITY;
  bounds hiding = {-none, none};
  int64_t front = -1, back = -1;
  for (uint32_t i = 0; i < count; ++i) {
    if (low[i] >= 0 && high[i] < hiding.high) hiding.high = high[i], back = i;
    if (high[i] < 0 && low[i] > hiding.low) hiding.low = low[i], front = i;
  }
  bool hidden = back < 0 || plane_covers(s, r, from[back]);
  bool covered = front < 0 || plane_covers(s, r, from[front]);
  if (!hidden) hiding.high = none;
  if (!covered) hiding.low = -none;
  for (uint32_t i = 0; i < count && !(hidden && covered); ++i) {
    bool behind = !hidden && low[i] >= 0 && high[i] < hiding.high;
    bool before = !covered && high[i] < 0 && low[i] > hiding.low;
    if ((!behind && !before) || !plane_covers(s, r, from[i])) continue;
    if (behind)
      hiding.high = high[i];
    else
      hiding.low = low[i];
  }
  double reach = reach_of(s);
  uint32_t found = 0;
  for (uint32_t i = 0; i < count; ++i) {
    if (!((high[i] >= 0 && low[i] <= hiding.high) || (low[i] < 0 && high[i] >= hiding.low)))
      continue;
    if (low[i] > reach || high[i] < -reach) continue;
    const slice_forms *f = &from[i]->forms;
    bounds u = span(f->u, r), v = span(f->v, r);
    if (u.high >= s->low[0] - SLACK && u.low <= s->high[0] + SLACK && v.high >= s->low[1] - SLACK &&
        v.low <= s->high[1] + SLACK)
      out[found++] = from[i];
  }
  return found;
}

// Bounds of all candidates' columns and rows over a tile, linear in the pixel.
typedef struct outline {
  float most[2][3], least[2][3];
} outline;

// No candidate reaches any of `wide` x `high` pixels from (x, y).
static inline bool is_outside(const sonde_slicer *s, const outline *o, float x, float y, float wide,
                              float high) {
  for (int k = 0; k < 2; ++k) {
    const float *most = o->most[k], *least = o->least[k];
    float top = most[0] + x * most[1] + y * most[2], low = least[0] + x * least[1] + y * least[2];
    top += (most[1] > 0 ? wide * most[1] : 0) + (most[2] > 0 ? high * most[2] : 0);
    low += (least[1] < 0 ? wide * least[1] : 0) + (least[2] < 0 ? high * least[2] : 0);
    if (top < s->low[k] - 2 * SLACK || low > s->high[k] + 2 * SLACK) return true;
  }
  return false;
}

static inline bool is_inside(const sonde_slicer *s, const float at[2]) {
  return at[0] >= s->low[0] - SLACK && at[0] <= s->high[0] + SLACK && at[1] >= s->low[1] - SLACK &&
         at[1] <= s->high[1] + SLACK;
}

// Pixel of a frame at (x, y) of the tile.
static inline void foot(const slice_candidate *c, float x, float y, float at[2]) {
  at[0] = c->u[0] + y * c->u[2] + x * c->u[1];
  at[1] = c->v[0] + y * c->v[2] + x * c->v[1];
}

static inline bool has_foot(const sonde_slicer *s, const slice_candidate *c, float x, float y) {
  float at[2];
  foot(c, x, y, at);
  return is_inside(s, at);
}

static inline float distance_at(const slice_candidate *c, float x, float y) {
  return c->d[0] + y * c->d[2] + x * c->d[1];
}

// The same for one pixel among candidates sorted by distance: outwards from it.
static void nearest_of_sorted(const sonde_slicer *s, const slice_candidate *room, uint32_t count,
                              uint32_t x, float y, row_pick *pick) {
  uint32_t low = 0, high = count; // the first behind the pixel
  float at = (float)x;
  while (low < high) {
    uint32_t middle = (low + high) / 2;
    if (distance_at(&room[middle], at, y) < 0)
      low = middle + 1;
    else
      high = middle;
  }
  uint32_t up = low, down = low;
  while (up < count && !has_foot(s, &room[up], at, y)) ++up;
  while (down && !has_foot(s, &room[down - 1], at, y)) --down;
  pick->up[x] = up < count ? (int32_t)up : -1;
  pick->down[x] = (int32_t)down - 1;
  pick->up_d[x] = up < count ? distance_at(&room[up], at, y) : INFINITY;
  pick->down_d[x] = down ? distance_at(&room[down - 1], at, y) : -INFINITY;
}

// Way from a pixel of plane a to the same pixel of plane b, in local coordinates of a.
static void sweep_path(const slice_plane *a, const slice_plane *b, float path[3][3]) {
  sonde_affine to = affine_mul(&a->local_from_world, &b->world_from_pixel);
  for (int k = 0; k < 3; ++k) {
    path[k][0] = (float)to.m[k][3];
    path[k][1] = (float)(to.m[k][0] - (k == 0));
    path[k][2] = (float)(to.m[k][1] - (k == 1));
  }
}

// The path leaves to that side of the plane, at most 60 degrees off its normal.
static bool is_steep(const slice_plane *plane, float path[3][3], float u, float v, float side) {
  float e[3];
  for (int k = 0; k < 3; ++k) e[k] = path[k][0] + u * path[k][1] + v * path[k][2];
  double across = hypot(e[0] * plane->pixel_m[0], e[1] * plane->pixel_m[1]);
  return across < 1.7 * (double)(side * e[2]);
}

static void blend(const sonde_slicer *s, const slice_candidate *room, int32_t up, int32_t down,
                  pair *p) {
  const slice_plane *a = room[up].plane, *b = room[down].plane;
  p->up = up, p->down = down;
  p->along_sweep = s->options.along_sweep;
  slice_shift(a, b, p->up_shift);
  slice_shift(b, a, p->down_shift);
  if (!p->along_sweep) return;
  sweep_path(a, b, p->up_path);
  sweep_path(b, a, p->down_path);
  for (int corner = 0; corner < 4 && p->along_sweep; ++corner) {
    float u = corner & 1 ? s->high[0] : s->low[0], v = corner & 2 ? s->high[1] : s->low[1];
    p->along_sweep = is_steep(a, p->up_path, u, v, 1) && is_steep(b, p->down_path, u, v, -1);
  }
}

static inline float sample(const sonde_slicer *s, const slice_plane *plane, float u, float v) {
  u = bound(u, s->low[0], s->high[0]);
  v = bound(v, s->low[1], s->high[1]);
  uint32_t iu = (uint32_t)bound(u, s->low[0], s->high[0] - 1);
  uint32_t iv = (uint32_t)bound(v, s->low[1], s->high[1] - 1);
  float a = u - (float)iu, b = v - (float)iv;
  const slice_layout *l = &s->layout;
  const uint8_t *p = plane->pixels + (size_t)iv * s->width + iu;
  if (l->lines) { // where the strips have read already
    int32_t x = (int32_t)iu - (int32_t)s->low[0], y = (int32_t)iv - (int32_t)s->low[1];
    p = l->lines + plane->offset + x + y * l->row + x / (SLICE_LINE_WIDE - 1) * l->column_line +
        y / (SLICE_LINE_HIGH - 1) * l->row_line;
  }
  const uint8_t *q = p + s->layout.row;
  float top = (float)p[0] + a * (float)(p[1] - p[0]), low = (float)q[0] + a * (float)(q[1] - q[0]);
  return top + b * (low - top);
}

// A frame at pixel (x, y) of the tile, straight below it.
static inline float sample_foot(const sonde_slicer *s, const slice_candidate *c, float x, float y) {
  float at[2];
  foot(c, x, y, at);
  return sample(s, c->plane, at[0], at[1]);
}

// Moves a foot to where the path of pixel (u, v) meets the frame.
static inline void follow(float path[3][3], float u, float v, float d, float at[2]) {
  float t = d / (path[2][0] + u * path[2][1] + v * path[2][2]);
  at[0] -= t * (path[0][0] + u * path[0][1] + v * path[0][2]);
  at[1] -= t * (path[1][0] + u * path[1][1] + v * path[1][2]);
}

// All levels of a frame, weighted.
static inline float sample_levels(const sonde_slicer *s, const slice_plane *plane,
                                  const float at[2], const float *w0, const float *w1, float t) {
  float u = bound(at[0], s->low[0], s->high[0]) - s->low[0];
  float v = bound(at[1], s->low[1], s->high[1]) - s->low[1], sum = 0, scale = 1;
  for (int k = 0; k < SLICE_LEVELS; ++k, scale *= 0.5f) {
    float w = w0[k] + t * (w1[k] - w0[k]);
    sum += w * slice_level_at(s->bank, plane->pyramid, k, u * scale, v * scale);
  }
  return sum;
}

// Kriging between lower and upper plane, a share of the path t from the lower one.
static float krige(const sonde_slicer *s, const slice_plane *lower, const float l[2],
                   const slice_plane *upper, const float u[2], float t, float gap) {
  int32_t i = (int32_t)(lower - s->planes);
  const slice_join *join = upper == lower + 1 ? &s->joins[i] : NULL;
  uint32_t far = (uint32_t)bound(gap / (float)s->options.gap_m * SLICE_FAR, 0, SLICE_FAR - 1);
  const slice_weights *steps = join ? join->steps : s->far + far * (SLICE_STEPS + 1);
  uint32_t step = (uint32_t)bound(t * SLICE_STEPS, 0, SLICE_STEPS - 1);
  const slice_weights *w = &steps[step], *x = w + 1;
  float r = t * SLICE_STEPS - (float)step;
  float value = sample_levels(s, lower, l, w->of[1], x->of[1], r) +
                sample_levels(s, upper, u, w->of[2], x->of[2], r);
  for (int side = 0; join && side < 2; ++side) {
    int32_t outer = side ? join->behind : join->before;
    const float(*map)[3] = side ? join->to_behind : join->to_before, *from = side ? u : l;
    if (outer < 0) continue;
    float at[2];
    for (int k = 0; k < 2; ++k) at[k] = map[k][0] * from[0] + map[k][1] * from[1] + map[k][2];
    value += sample_levels(s, &s->planes[outer], at, w->of[3 * side], x->of[3 * side], r);
  }
  return bound(value, 0, 255);
}

// Mean of both frames where a line through the pixel meets them, each weighted by the distance a or
// b of the other, or their kriging; negative when the line passes a frame by.
static inline float between(const sonde_slicer *s, const slice_candidate *room, pair *p, float x,
                            float y, float a, float b) {
  const slice_plane *up = room[p->up].plane, *down = room[p->down].plane;
  float foot_up[2], foot_down[2], m[2], n[2];
  foot(&room[p->up], x, y, foot_up);
  foot(&room[p->down], x, y, foot_down);
  memcpy(m, foot_up, sizeof m);
  memcpy(n, foot_down, sizeof n);
  if (p->along_sweep) { // one line for both
    follow(p->up_path, foot_up[0], foot_up[1], a, m);
    follow(p->down_path, foot_up[0], foot_up[1], -b, n);
  }
  if (!p->along_sweep || !is_inside(s, m) || !is_inside(s, n)) {
    for (int k = 0; k < 2; ++k) {
      m[k] = foot_up[k] - a * p->up_shift[k];
      n[k] = foot_down[k] + b * p->down_shift[k];
    }
    if (!is_inside(s, m) || !is_inside(s, n)) return -1;
  }
  float t = a / (a + b);
  if (s->options.method == SONDE_SLICE_KRIGE)
    return up < down ? krige(s, up, m, down, n, t, a + b) : krige(s, down, n, up, m, 1 - t, a + b);
  float near = sample(s, up, m[0], m[1]), far = sample(s, down, n[0], n[1]);
  return near + (far - near) * t;
}

// Negative when no frame reaches the pixel.
static inline float value_at(const sonde_slicer *s, const slice_candidate *room,
                             const row_pick *pick, int x, float y, pair *p) {
  int32_t up = pick->up[x], down = pick->down[x];
  float a = pick->up_d[x], b = -pick->down_d[x];
  if (up >= 0 && down >= 0 && a + b <= (float)s->options.gap_m) {
    if (s->options.method == SONDE_SLICE_NEAREST)
      return a <= b ? sample_foot(s, &room[up], (float)x, y)
                    : sample_foot(s, &room[down], (float)x, y);
    if (p->up != up || p->down != down) blend(s, room, up, down, p);
    float value = between(s, room, p, (float)x, y, a, b);
    if (value >= 0) return value;
  }
  bool first = up >= 0 && (down < 0 || a <= b);
  if ((first ? a : b) <= (float)s->options.reach_m && (first || down >= 0))
    return sample_foot(s, &room[first ? up : down], (float)x, y);
  return -1;
}

// Between two frames across, a row of a tile at a time.
typedef struct row_work {
  const uint8_t *near[SLICE_TILE], *far[SLICE_TILE];
  float m[2][SLICE_TILE], n[2][SLICE_TILE], t[SLICE_TILE];
  int32_t at[2][SLICE_TILE];
  float share[2][2][SLICE_TILE];
  uint64_t greys[SLICE_TILE];
} row_work;

static inline pair *find_pair(const sonde_slicer *s, const slice_candidate *room, int32_t up,
                              int32_t down, pair pairs[PAIRS]) {
  pair *p = &pairs[(up * 5 + down) % PAIRS];
  if (p->up != up || p->down != down) blend(s, room, up, down, p);
  return p;
}

// All pixels of the row between these two frames; -1 in `met` for those whose line meets both.
INLINE void meet_row(const sonde_slicer *s, const slice_candidate *room, const row_pick *pick,
                     const pair *p, float y, row_work *w, int32_t met[SLICE_TILE]) {
  const slice_candidate *a = &room[p->up], *b = &room[p->down];
  float gap = (float)s->options.gap_m, u0 = s->low[0] - SLACK, u1 = s->high[0] + SLACK;
  float v0 = s->low[1] - SLACK, v1 = s->high[1] + SLACK;
  float start[4] = {a->u[0] + y * a->u[2], a->v[0] + y * a->v[2], b->u[0] + y * b->u[2],
                    b->v[0] + y * b->v[2]};
  const float step[4] = {a->u[1], a->v[1], b->u[1], b->v[1]};
  const float shift[4] = {-p->up_shift[0], -p->up_shift[1], p->down_shift[0], p->down_shift[1]};
  for (int x = 0; x < SLICE_TILE; ++x) {
    float near = pick->up_d[x], far = -pick->down_d[x], fx = (float)x;
    float m0 = start[0] + fx * step[0] + near * shift[0];
    float m1 = start[1] + fx * step[1] + near * shift[1];
    float n0 = start[2] + fx * step[2] + far * shift[2];
    float n1 = start[3] + fx * step[3] + far * shift[3];
    int hit = (pick->up[x] == p->up) & (pick->down[x] == p->down) & (near + far <= gap);
    hit = hit & (m0 >= u0) & (m0 <= u1) & (m1 >= v0) & (m1 <= v1);
    hit = hit & (n0 >= u0) & (n0 <= u1) & (n1 >= v0) & (n1 <= v1);
    w->m[0][x] = hit ? m0 : w->m[0][x], w->m[1][x] = hit ? m1 : w->m[1][x];
    w->n[0][x] = hit ? n0 : w->n[0][x], w->n[1][x] = hit ? n1 : w->n[1][x];
    w->t[x] = hit ? near / (near + far) : w->t[x];
    met[x] = hit ? -1 : met[x];
  }
}

// Where in the frame, and how far between its pixels.
INLINE void find_pixels(const sonde_slicer *s, float at[2][SLICE_TILE], float share[2][SLICE_TILE],
                        int32_t offset[SLICE_TILE]) {
  int32_t width = (int32_t)s->width, iu_high = (int32_t)s->high[0], iv_high = (int32_t)s->high[1];
  for (int x = 0; x < SLICE_TILE; ++x) {
    float u = bound(at[0][x], s->low[0], s->high[0]), v = bound(at[1][x], s->low[1], s->high[1]);
    int32_t i = (int32_t)u, j = (int32_t)v;
    i = i < iu_high ? i : iu_high - 1, j = j < iv_high ? j : iv_high - 1;
    share[0][x] = u - (float)i, share[1][x] = v - (float)j;
    offset[x] = j * width + i;
  }
}

INLINE void mix_row(const sonde_slicer *s, row_work *w, uint8_t grey[SLICE_TILE]) {
  find_pixels(s, w->m, w->share[0], w->at[0]);
  find_pixels(s, w->n, w->share[1], w->at[1]);
  for (int x = 0; x < SLICE_TILE; ++x) {
    const uint8_t *p = w->near[x] + w->at[0][x], *q = w->far[x] + w->at[1][x];
    w->greys[x] = two_greys(p) | two_greys(p + s->width) << 16 | two_greys(q) << 32 |
                  two_greys(q + s->width) << 48;
  }
  int32_t value[SLICE_TILE];
  for (int x = 0; x < SLICE_TILE; ++x) {
    float near = mix_sheet((uint32_t)w->greys[x], w->share[0][0][x], w->share[0][1][x]);
    float far = mix_sheet((uint32_t)(w->greys[x] >> 32), w->share[1][0][x], w->share[1][1][x]);
    value[x] = (int32_t)(near + (far - near) * w->t[x] + 0.5f);
  }
  for (int x = 0; x < SLICE_TILE; ++x) grey[x] = (uint8_t)value[x];
}

static inline void put_pixel(const sonde_slicer *s, size_t at, float value) {
  s->image->pixels[at] = value > 0 ? (uint8_t)(value + 0.5f) : 0;
  if (s->known) s->known[at] = value >= 0;
}

static uint64_t fill_tile(const sonde_slicer *s, const rectangle *r, const slice_candidate *room,
                          uint32_t count) {
  uint64_t reached = 0;
  pair p = {.up = -1}, pairs[PAIRS];
  for (int k = 0; k < PAIRS; ++k) pairs[k].up = -1;
  row_pick pick;
  bool fast = s->options.method == SONDE_SLICE_BRACKET && !s->options.along_sweep;
  int32_t met[SLICE_TILE] = {0};
  uint8_t grey[SLICE_TILE];
  for (uint32_t y = 0; y < r->high; ++y) {
    // Without branches, so that the compiler takes four pixels at a time.
    for (int x = 0; x < SLICE_TILE; ++x) {
      pick.up_d[x] = INFINITY, pick.down_d[x] = -INFINITY;
      pick.up[x] = pick.down[x] = -1;
    }
    float u0 = s->low[0] - SLACK, u1 = s->high[0] + SLACK;
    float v0 = s->low[1] - SLACK, v1 = s->high[1] + SLACK;
    for (uint32_t k = 0; k < count; ++k) {
      const slice_candidate *c = &room[k];
      float u = c->u[0] + (float)y * c->u[2], v = c->v[0] + (float)y * c->v[2];
      float d = c->d[0] + (float)y * c->d[2], us = c->u[1], vs = c->v[1], ds = c->d[1];
      for (int x = 0; x < SLICE_TILE; ++x) {
        float fx = (float)x, ux = u + fx * us, vx = v + fx * vs, dx = d + fx * ds;
        int inside = (ux >= u0) & (ux <= u1) & (vx >= v0) & (vx <= v1);
        int up = inside & (dx >= 0) & (dx < pick.up_d[x]);
        int down = inside & (dx < 0) & (dx > pick.down_d[x]);
        pick.up_d[x] = up ? dx : pick.up_d[x];
        pick.up[x] = up ? (int32_t)k : pick.up[x];
        pick.down_d[x] = down ? dx : pick.down_d[x];
        pick.down[x] = down ? (int32_t)k : pick.down[x];
      }
    }
    if (fast) {
      // What lies between two frames; the rest is left with `met` zero.
      row_work w;
      uint32_t done = 0;
      for (int x = 0; x < SLICE_TILE; ++x) {
        met[x] = 0, w.near[x] = w.far[x] = room[0].plane->pixels;
        w.m[0][x] = w.n[0][x] = s->low[0], w.m[1][x] = w.n[1][x] = s->low[1], w.t[x] = 0;
      }
      for (uint32_t x = 0; x < r->wide; ++x) {
        int32_t up = pick.up[x], down = pick.down[x];
        if (done >> x & 1 || up < 0 || down < 0) continue;
        meet_row(s, room, &pick, find_pair(s, room, up, down, pairs), ((float)y), &w, met);
        const uint8_t *near = room[up].plane->pixels, *far = room[down].plane->pixels;
        for (uint32_t k = x; k < r->wide; ++k) {
          bool same = pick.up[k] == up && pick.down[k] == down;
          done |= (uint32_t)same << k;
          w.near[k] = same ? near : w.near[k], w.far[k] = same ? far : w.far[k];
        }
      }
      mix_row(s, &w, grey);
    }
    size_t at = (size_t)(r->row + y) * s->image->width + r->column;
    for (uint32_t x = 0; x < r->wide; ++x) {
      float value = met[x] ? (float)grey[x] : value_at(s, room, &pick, (int)x, (float)y, &p);
      put_pixel(s, at + x, value);
      reached += value >= 0;
    }
  }
  return reached;
}

static uint64_t slice_sum_all(const slice_sum *sum) {
  const sonde_slicer *s = sum->slicer;
  uint64_t reached = 0;
  for (uint32_t y = 0; y < sum->image->height; ++y)
    for (uint32_t x = 0; x < sum->image->width; ++x) {
      float value = 0;
      int met = 0;
      for (int k = 0; k < sum->n; ++k) {
        float at[2];
        for (int i = 0; i < 2; ++i)
          at[i] =
              sum->maps[k][i][0] * (float)x + sum->maps[k][i][1] * (float)y + sum->maps[k][i][2];
        met += is_inside(s, at);
        // Of a pixel that is the same in all frames the first frame that is there speaks for all.
        uint32_t i = (uint32_t)(bound(at[0], s->low[0], s->high[0]) - s->low[0] + 0.5f);
        uint32_t j = (uint32_t)(bound(at[1], s->low[1], s->high[1]) - s->low[1] + 0.5f);
        if (met && s->model.along_sweep && !s->bank->shares[0][(size_t)j * s->bank->wide[0] + i]) {
          value = sample(s, sum->planes[k], at[0], at[1]);
          met = sum->n;
          break;
        }
        value += sample_levels(s, sum->planes[k], at, sum->weights[k], sum->weights[k], 0);
      }
      bool inside = 2 * met >= sum->n;
      size_t i = (size_t)y * sum->image->width + x;
      sum->image->pixels[i] = inside ? (uint8_t)(bound(value, 0, 255) + 0.5f) : 0;
      if (sum->known) sum->known[i] = inside;
      reached += inside;
    }
  return reached;
}

static void start_candidate(const slice_plane *plane, const rectangle *tile, slice_candidate *c) {
  c->plane = plane;
  start_at(plane->forms.u, tile, c->u);
  start_at(plane->forms.v, tile, c->v);
  start_at(plane->forms.d, tile, c->d);
}

// Where strips do not speak for every pixel: all planes of the block within reach.
static uint64_t search_edge(const sonde_slicer *s, const rectangle *tile, uint32_t all,
                            slice_room *room, const strip_table *table) {
  double reach = reach_of(s);
  uint32_t count = 0;
  for (uint32_t i = 0; i < all; ++i)
    if (room->spans.low[i] <= reach && room->spans.high[i] >= -reach)
      start_candidate(room->block[i], tile, &room->candidates[count++]);
  SONDE_ASSERT(count > 0);
  outline o;
  strip_work work;
  for (int i = 0; i < 3; ++i) {
    o.most[0][i] = o.least[0][i] = room->candidates[0].u[i];
    o.most[1][i] = o.least[1][i] = room->candidates[0].v[i];
  }
  for (uint32_t k = 1; k < count; ++k)
    for (int i = 0; i < 3; ++i) {
      float u = room->candidates[k].u[i], v = room->candidates[k].v[i];
      o.most[0][i] = u > o.most[0][i] ? u : o.most[0][i];
      o.least[0][i] = u < o.least[0][i] ? u : o.least[0][i];
      o.most[1][i] = v > o.most[1][i] ? v : o.most[1][i];
      o.least[1][i] = v < o.least[1][i] ? v : o.least[1][i];
    }
  if (is_outside(s, &o, 0, 0, (float)tile->wide, (float)tile->high))
    return fill_evenly(s, tile, NULL);
  locate_tile(s, table, tile->high, &work);
  uint64_t reached = 0;
  pair pairs[PAIRS];
  for (int k = 0; k < PAIRS; ++k) pairs[k].up = -1;
  for (uint32_t y = 0; y < tile->high; ++y) {
    uint8_t grey[SLICE_TILE];
    const int32_t *met = work.met + y * SLICE_TILE;
    int32_t every = -1;
    mix_row_of(&work, y * SLICE_TILE, grey);
    for (int x = 0; x < SLICE_TILE; ++x) every &= met[x];
    size_t at = (size_t)(tile->row + y) * s->image->width + tile->column;
    if (every) reached += put_row(s, at, tile->wide, grey, true);
    for (uint32_t x = 0; x < tile->wide && !every; ++x) {
      float value = met[x] ? (float)grey[x] : -1;
      if (!met[x] && !is_outside(s, &o, (float)x, (float)y, 0, 0)) {
        // No strip speaks for this pixel: search among the candidates, which are sorted.
        row_pick pick;
        nearest_of_sorted(s, room->candidates, count, x, (float)y, &pick);
        bool both = pick.up[x] >= 0 && pick.down[x] >= 0;
        pair *p = both ? find_pair(s, room->candidates, pick.up[x], pick.down[x], pairs) : pairs;
        value = value_at(s, room->candidates, &pick, (int)x, (float)y, p);
      }
      put_pixel(s, at + x, value);
      reached += value >= 0;
    }
  }
  return reached;
}

// Planes of the block first, then of each tile in it.
static uint64_t slice_block(const sonde_slicer *s, uint32_t column, uint32_t row,
                            slice_room *room) {
  SONDE_ASSERT(s->image != NULL && column < s->image->width && row < s->image->height);
  rectangle block = {column, row, at_most(SLICE_BLOCK, s->image->width - column),
                     at_most(SLICE_BLOCK, s->image->height - row)};
  // Planes of a block, sorted where they make strips.
  slice_spans spans = room->spans;
  for (uint32_t k = 0; k < 3; ++k) spans.form[k] = s->forms + k * s->count;
  span_all(&spans, s->count, &block);
  uint32_t all = gather_planes(s, &block, s->every, s->count, &spans, room->block);
  find_strips(s, &block, all, room);
  for (uint32_t i = 0; i < all; ++i)
    for (int k = 0; k < 3; ++k) room->spans.form[k][i] = room->block[i]->forms.d[k];
  uint64_t reached = 0;
  strip_table table = {.count = 0};
  for (uint32_t y = 0; y < block.high; y += SLICE_TILE)
    for (uint32_t x = 0; x < block.wide; x += SLICE_TILE) {
      rectangle tile = {column + x, row + y, at_most(SLICE_TILE, block.wide - x),
                        at_most(SLICE_TILE, block.high - y)};
      span_all(&room->spans, all, &tile);
      if (!fill_table(s, room, &tile, &table)) {
        uint32_t count = gather_planes(s, &tile, room->block, all, &room->spans, room->tile);
        for (uint32_t i = 0; i < count; ++i)
          start_candidate(room->tile[i], &tile, &room->candidates[i]);
        reached +=
            count ? fill_tile(s, &tile, room->candidates, count) : fill_evenly(s, &tile, NULL);
      } else if (!table.whole) {
        reached += search_edge(s, &tile, all, room, &table);
      } else {
        strip_work work;
        locate_tile(s, &table, tile.high, &work);
        reached += fill_evenly(s, &tile, &work);
      }
    }
  return reached;
}

const slice_kernels SLICE_KERNELS = {SLICE_KERNELS_NAME, slice_block, slice_sum_all, voxel_cell};
