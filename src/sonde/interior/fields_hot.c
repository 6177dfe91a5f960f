// The displacement field for many points: window coordinates of four points at once, then for each
// the nodes of its cell, four numbers at a time.
#include "base/base.h"
#include "interior/fields.h"

enum { NT = SONDE_WINDOW_THETA, NS = SONDE_WINDOW_S, NL = SONDE_WINDOW_LEVELS };

_Static_assert(NL == 8 && NS <= 32, "two vectors of radii, a bit per row");

void sonde_fields_begin(sonde_fields *f, const sonde_interior *in, sonde_vec3 corner) {
  SONDE_ASSERT(f != NULL && in != NULL);
  f->interior = in, f->corner = corner, f->rows = 0;
  if (!in->solid) return;
  const sonde_window *w = in->live;
  const double cosine = cos(w->grid.footprint.theta), sine = sin(w->grid.footprint.theta);
  f->cosine = cosine, f->sine = sine;
  sonde_vec3 x = v_madd(v_scale(in->e1, cosine), sine, in->e2);
  sonde_vec3 y = v_madd(v_scale(in->e2, cosine), -sine, in->e1), from = v_sub(corner, in->origin);
  f->first =
      point_of(vec3(v_dot(from, x), v_dot(from, y), v_dot(from, in->axis) - w->grid.footprint.s));
  for (int c = 0; c < 3; ++c)
    f->turned[c] =
        point_of(vec3(v_coordinate(x, c), v_coordinate(y, c), v_coordinate(in->axis, c)));
  for (int i = 0; i <= NT; ++i) f->theta[i] = (float)w->grid.theta[i];
  for (int i = 0; i < NT; ++i)
    f->per_theta[i] = (float)(1 / (w->grid.theta[i + 1] - w->grid.theta[i]));
  for (int j = 0; j < NS; ++j) f->s[j] = (float)(w->grid.s[j] - w->grid.footprint.s);
  for (int j = 0; j + 1 < NS; ++j) f->per_s[j] = (float)(1 / (w->grid.s[j + 1] - w->grid.s[j]));
}

static void store_row(sonde_fields *f, uint32_t j) {
  const sonde_interior *in = f->interior;
  const sonde_window *w = in->live;
  const float_x4 leg[3] = {point_of(in->e1), point_of(in->e2), point_of(in->axis)};
  if (f->rows >> j & 1) return;
  f->rows |= 1u << j;
  for (uint32_t k = j * NT; k < (j + 1) * NT; ++k) {
    sonde_field_column *c = &f->column[k];
    c->radius[0] = vload_float_x4(w->grid.radius[k]),
    c->radius[1] = vload_float_x4(w->grid.radius[k] + 4);
    for (uint32_t l = 0; l < NL; ++l) {
      uint32_t at = w->solid.unknown[k * NL + l];
      const float *u = w->solid.x + 3 * (size_t)at;
      c->move[l] = at == SONDE_HELD_CORNER ? vset_float_x4(0)
                                           : transform_point(leg, (float_x4){u[0], u[1], u[2], 0});
    }
  }
}

// Neighbours in the list are near each other.
static uint32_t find_cell(const float *edge, uint32_t cells, float at, uint32_t from) {
  while (from > 0 && at < edge[from]) --from;
  while (from + 1 < cells && at >= edge[from + 1]) ++from;
  return from;
}

static float within(float a) { return a < 0 ? 0 : a > 1 ? 1 : a; }

// Beyond the ends of the window the solid is at rest.
static float_x4 field_of(sonde_fields *f, float turn, float s, float r, uint32_t cell[2]) {
  if (!(s >= f->s[0] && s <= f->s[NS - 1])) return vset_float_x4(0);
  if (turn < f->theta[0]) turn += (float)(2 * SONDE_PI);
  const uint32_t i = cell[0] = find_cell(f->theta, NT, turn, cell[0]);
  const uint32_t j = cell[1] = find_cell(f->s, NS - 1, s, cell[1]), next = i + 1 < NT ? i + 1 : 0;
  store_row(f, j), store_row(f, j + 1);
  const sonde_field_column *c[4] = {&f->column[j * NT + i], &f->column[j * NT + next]};
  c[2] = c[0] + NT, c[3] = c[1] + NT;
  const float a = within((turn - f->theta[i]) * f->per_theta[i]), b = (s - f->s[j]) * f->per_s[j];
  const float_x4 w[4] = {vset_float_x4((1 - a) * (1 - b)), vset_float_x4(a * (1 - b)),
                         vset_float_x4((1 - a) * b), vset_float_x4(a * b)};
  float radius[NL];
  float_x4 part[2];
  for (int k = 0; k < 2; ++k) {
    part[k] = w[0] * c[0]->radius[k] + w[1] * c[1]->radius[k] + w[2] * c[2]->radius[k] +
              w[3] * c[3]->radius[k];
    vstore(radius + 4 * k, part[k]);
  }
  // Radii fall from the skin inwards: levels 1 to 6 that are not below the point.
  uint32_t above = (vbits(part[0] >= r) | vbits(part[1] >= r) << 4) >> 1 & 63;
  const uint32_t l = (uint32_t)__builtin_ctz(~above);
  const float share = (radius[l] - r) / (radius[l] - radius[l + 1]),
              low_t = (float)sonde_grid_beyond;
  const float t = l == 0 && share < 0 ? (share < low_t ? low_t : share) : within(share);
  float_x4 low = vset_float_x4(0), high = vset_float_x4(0);
  for (int k = 0; k < 4; ++k) low += w[k] * c[k]->move[l], high += w[k] * c[k]->move[l + 1];
  return low + t * (high - low);
}

void sonde_fields_at(sonde_fields *f, uint32_t count, const float_x4 *rest, float_x4 *field) {
  SONDE_ASSERT(f->interior != NULL && (count == 0 || (rest != NULL && field != NULL)));
  uint32_t cell[2] = {0, 0};
  for (uint32_t k = 0; k < count && !f->interior->solid; ++k) {
    sonde_vec3 offset = vec3((double)rest[k][0], (double)rest[k][1], (double)rest[k][2]);
    field[k] = point_of(sonde_interior_field(f->interior, v_add(f->corner, offset)));
  }
  for (uint32_t k = 0; k < count && f->interior->solid; k += 4) {
    const uint32_t some = count - k < 4 ? count - k : 4;
    float_x4 at[4], leg[4];
    for (uint32_t i = 0; i < 4; ++i)
      at[i] = f->first + transform_point(f->turned, rest[k + (i < some ? i : 0)]);
    vtranspose_float_x4(at, leg);
    for (uint32_t i = 0; i < 4 && f->interior->bend != NULL; ++i) {
      const double s = f->interior->live->grid.footprint.s + (double)leg[2][i];
      const sonde_bend bend = sonde_bend_at(f->interior, s);
      leg[0][i] -= (float)(f->cosine * bend.x + f->sine * bend.y);
      leg[1][i] -= (float)(f->cosine * bend.y - f->sine * bend.x);
    }
    const float_x4 turn = vangle(leg[0], leg[1]), r = vsqrt(leg[0] * leg[0] + leg[1] * leg[1]);
    for (uint32_t i = 0; i < some; ++i) field[k + i] = field_of(f, turn[i], leg[2][i], r[i], cell);
  }
}
