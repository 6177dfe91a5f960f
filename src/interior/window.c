// Placing the solid of a leg.
//
// sonde_window_create  memory, topology, order
// sonde_window_begin   rows, columns, corners and materials of a place
// spread               distances that grow from the fine part to an end
// place_column         corners of one column
// sonde_window_steps   how many of them
// sonde_window_step    a share of the factorisation, then the skin's compliance
#include "interior/window.h"

#include "base/base.h"

#include <string.h>

enum { NT = SONDE_WINDOW_THETA, NS = SONDE_WINDOW_S, NL = SONDE_WINDOW_LEVELS };

// Shear moduli of the layers (docs/interior.md); only their ratio moves the inside. Muscle and skin
// as at rest, fat (1.1 kPa at rest, Ogden exponent 8) as at 16 % compression: it is squeezed most.
static const double skin_pa = 40e3;
static const double bulk_over_shear = 100;
static const double margin_t_m = 12e-3, margin_s_m = 10e-3; // fine part beyond the face
static const double reach_m = 75e-3;                        // window beyond the fine part
static const double muscle_level[NL] = {0, 0, 0, 0.12, 0.27, 0.46, 0.70, 1};
static const double grow_s[5] = {1.4, 2, 3, 4.5, 6.5};
static const double grow_t[12] = {1.5, 2.3, 3.6, 5.5, 7.5, 9, 9, 7.5, 5.5, 3.6, 2.3, 1.5};

static uint32_t node_of(uint32_t i, uint32_t j, uint32_t l) { return (j * NT + i) * NL + l; }

static uint32_t near_first_row(void) { return (NS - SONDE_WINDOW_NEAR_S) / 2; }

static void list_hexes(sonde_solid *s) {
  uint32_t h = 0;
  for (uint32_t j = 0; j + 1 < NS; ++j)
    for (uint32_t i = 0; i < NT; ++i)
      for (uint32_t l = 0; l + 1 < NL; ++l, ++h)
        for (uint32_t c = 0; c < 4; ++c) {
          uint32_t a = (i + (c == 1 || c == 2)) % NT, b = j + (c >= 2);
          s->hex[h].node[c] = node_of(a, b, l);
          s->hex[h].node[c + 4] = node_of(a, b, l + 1);
        }
}

// The order is found on a regular stand-in of the ring; it depends on the topology only.
static sonde_status connect(sonde_window *w, sonde_error *error) {
  sonde_solid *s = &w->solid;
  sonde_vec3 *points = SONDE_NEW(sonde_vec3, SONDE_WINDOW_NODES);
  unsigned char *last = SONDE_NEW(unsigned char, SONDE_WINDOW_NODES);
  sonde_status status = points && last ? SONDE_OK : sonde_fail_memory(error);
  for (uint32_t n = 0; n < SONDE_WINDOW_NODES && !status; ++n) {
    uint32_t l = n % NL, i = n / NL % NT, j = n / NL / NT, row = j - near_first_row();
    double a = 2 * SONDE_PI * i / NT, r = 3 + 1.0 * (NL - l);
    points[n] = vec3(r * cos(a), r * sin(a), 1.3 * j);
    last[n] = l == 0 && i < SONDE_WINDOW_NEAR_T && row < SONDE_WINDOW_NEAR_S;
    s->held[n] = l == NL - 1 ? 7 : j == 0 || j == NS - 1 ? 4 : 0;
  }
  if (!status) status = sonde_solid_connect(s, last, points, error);
  sonde_free(points);
  sonde_free(last);
  return status;
}

sonde_status sonde_window_create(sonde_window **window, sonde_error *error) {
  SONDE_ASSERT(window != NULL);
  *window = NULL;
  sonde_window *w = SONDE_NEW(sonde_window, 1);
  if (w == NULL) return sonde_fail_memory(error);
  size_t side = 3 * (size_t)SONDE_WINDOW_NEAR;
  sonde_status status =
      sonde_solid_allocate(&w->solid, SONDE_WINDOW_NODES, (NS - 1) * NT * (NL - 1), error);
  w->compliance = SONDE_NEW(double, 2 * side * side);
  w->touched = SONDE_NEW(sonde_touched, SONDE_WINDOW_TOUCHED);
  w->scratch = SONDE_NEW(double, 12 * SONDE_WINDOW_TOUCHED + 2 * side);
  w->moved.x = w->solid.x;
  w->moved.touched = SONDE_NEW(sonde_touched, SONDE_WINDOW_TOUCHED);
  w->pressed.x = SONDE_NEW(float, 3 * (size_t)SONDE_WINDOW_NODES);
  w->pressed.touched = SONDE_NEW(sonde_touched, SONDE_WINDOW_TOUCHED);
  w->stress = SONDE_NEW(sonde_mat3, w->solid.hex_count);
  w->felt = SONDE_NEW(bool, w->solid.hex_count);
  if (!status && (!w->stress || !w->felt || !w->pressed.x || !w->pressed.touched ||
                  !w->moved.touched || !w->compliance || !w->touched || !w->scratch))
    status = sonde_fail_memory(error);
  if (!status) {
    list_hexes(&w->solid);
    status = connect(w, error);
  }
  if (status)
    sonde_window_destroy(w);
  else
    *window = w;
  return status;
}

void sonde_window_destroy(sonde_window *w) {
  if (w == NULL) return;
  sonde_solid_clear(&w->solid);
  sonde_free(w->compliance);
  sonde_free(w->touched);
  sonde_free(w->moved.touched);
  sonde_free(w->pressed.x);
  sonde_free(w->pressed.touched);
  sonde_free(w->stress);
  sonde_free(w->felt);
  sonde_free(w->scratch);
  sonde_free(w);
}

// ---- a place ------------------------------------------------------------------------------

static double sum_of(const double *d, uint32_t count) {
  double sum = 0;
  for (uint32_t i = 0; i < count; ++i) sum += d[i];
  return sum;
}

static void spread_rows(sonde_window *w, double low, double high) {
  double half = w->place.half_s_m + margin_s_m;
  half = fmin(half, 0.4 * (high - low));
  double s = clamp(w->place.s, low + half, high - half),
         step = 2 * half / (SONDE_WINDOW_NEAR_S - 1);
  double down = fmin(reach_m, s - half - low), up = fmin(reach_m, high - s - half);
  uint32_t first = near_first_row(), last = first + SONDE_WINDOW_NEAR_S - 1;
  for (uint32_t k = 0; k < SONDE_WINDOW_NEAR_S; ++k) w->s[first + k] = s - half + step * k;
  double all = sum_of(grow_s, 5);
  for (uint32_t k = 0; k < 5; ++k) {
    // A window that ends with the leg still has rows of some height.
    w->s[last + k + 1] = w->s[last + k] + fmax(up, 5e-3) * grow_s[k] / all;
    w->s[first - k - 1] = w->s[first - k] - fmax(down, 5e-3) * grow_s[k] / all;
  }
}

static void spread_columns(sonde_window *w, double radius) {
  double half = fmin((w->place.half_theta_m + margin_t_m) / radius, 1.2);
  double step = 2 * half / (SONDE_WINDOW_NEAR_T - 1), rest = 2 * SONDE_PI - 2 * half;
  double all = sum_of(grow_t, 12) + grow_t[5];
  for (uint32_t k = 0; k < SONDE_WINDOW_NEAR_T; ++k) w->theta[k] = -half + step * k;
  for (uint32_t k = SONDE_WINDOW_NEAR_T; k <= NT; ++k) {
    uint32_t g = k - SONDE_WINDOW_NEAR_T; // thirteen gaps, the middle one counted twice
    double share = grow_t[g < 6 ? g : g - 1];
    w->theta[k] = w->theta[k - 1] + rest * share / all;
  }
}

static void place_column(sonde_window *w, const sonde_interior *in, uint32_t i, uint32_t j) {
  double theta = w->place.theta + w->theta[i], s = w->s[j];
  sonde_column_point at;
  sonde_interior_column(in, theta, s, &at);
  double height = at.radius_m - in->bone_radius_m;
  double fat = clamp(at.muscle_m / at.cosine, 2.5e-3, 0.6 * height);
  for (uint32_t l = 0; l < NL; ++l) {
    double depth =
        l <= SONDE_WINDOW_FAT ? fat * l / SONDE_WINDOW_FAT : fat + (height - fat) * muscle_level[l];
    double r = at.radius_m - depth;
    w->radius[j * NT + i][l] = (float)r;
    w->solid.node[node_of(i, j, l)] = vec3(r * cos(theta), r * sin(theta), s);
  }
}

void sonde_window_begin(sonde_window *w, const sonde_interior *in, sonde_window_place place) {
  SONDE_ASSERT(w != NULL && in != NULL && isfinite(place.theta) && isfinite(place.s));
  sonde_column_point at;
  w->place = place;
  w->ready = w->loaded = false;
  w->moved.count = w->pressed.count = 0;
  memset(w->felt, 0, w->solid.hex_count * sizeof *w->felt);
  sonde_interior_column(in, place.theta, place.s, &at);
  spread_rows(w, in->s_low_m, in->s_high_m);
  spread_columns(w, at.radius_m);
  for (uint32_t j = 0; j < NS; ++j)
    for (uint32_t i = 0; i < NT; ++i) place_column(w, in, i, j);
  for (uint32_t h = 0; h < w->solid.hex_count; ++h) {
    uint32_t l = h % (NL - 1);
    double shear = l < SONDE_WINDOW_FAT ? sonde_fat_pa : sonde_muscle_pa;
    w->solid.hex[h].shear_pa = shear;
    w->solid.hex[h].bulk_pa = bulk_over_shear * shear;
    w->solid.hex[h].skin_n_m = l == 0 ? (skin_pa - sonde_fat_pa) * at.fat_m : 0;
  }
  sonde_fronts_begin(w->solid.fronts);
}

// Row k of the compliance is the answer to a force on unknown k.
static bool comply(sonde_window *w) {
  const size_t side = 3 * (size_t)SONDE_WINDOW_NEAR;
  double *c = w->compliance;
  if (!sonde_fronts_compliance(w->solid.fronts, c, c + side * side)) return false;
  for (size_t i = 0; i < side; ++i)
    for (size_t j = 0; j < i; ++j) {
      double kept = c[i * side + j];
      c[i * side + j] = c[j * side + i];
      c[j * side + i] = kept;
    }
  return true;
}

uint32_t sonde_window_steps(const sonde_window *w, uint64_t budget) {
  SONDE_ASSERT(w != NULL && budget > 0);
  return sonde_fronts_steps(w->solid.fronts, budget);
}

bool sonde_window_step(sonde_window *w, uint64_t budget) {
  SONDE_ASSERT(w != NULL && !w->ready);
  if (!sonde_fronts_step(w->solid.fronts, sonde_solid_matrix, &w->solid, budget)) return false;
  w->ready = !sonde_fronts_failed(w->solid.fronts) && comply(w);
  return true;
}
