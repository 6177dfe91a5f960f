// Placing the solid of a leg: elements and their order once, corners, materials and a share of the
// factorisation per call for each footprint.
#include "interior/window.h"

#include "base/base.h"

#include <string.h>

enum { NT = SONDE_WINDOW_THETA, NS = SONDE_WINDOW_S, NL = SONDE_WINDOW_LEVELS };

// Shear moduli of the layers (docs/interior_theory.md); only their ratio moves the inside. Muscle
// and skin as at rest, fat (1.1 kPa at rest, Ogden exponent 8) as at 16 % compression: it is
// squeezed most.
static const double skin_pa = 40e3;
static const double bulk_over_shear = 100;

sonde_status sonde_window_create(sonde_window **window, sonde_error *error) {
  SONDE_ASSERT(window != NULL);
  *window = NULL;
  sonde_window *w = SONDE_NEW(sonde_window, 1);
  if (w == NULL) return sonde_fail_memory(error);
  size_t side = 3 * (size_t)SONDE_WINDOW_NEAR;
  sonde_status status =
      sonde_solid_allocate(&w->solid, SONDE_WINDOW_NODES, SONDE_GRID_HEXES, error);
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
    // Elements and their order, which is found on a regular stand-in of the ring: it depends on the
    // topology only.
    static const uint32_t round[8] = {0, 1, 3, 2, 4, 5, 7, 6};
    sonde_solid *s = &w->solid;
    for (uint32_t h = 0; h < s->hex_count; ++h) {
      uint32_t node[8];
      sonde_grid_nodes(h, node);
      for (uint32_t c = 0; c < 8; ++c) s->hex[h].node[c] = node[round[c]];
    }
    sonde_vec3 *points = SONDE_NEW(sonde_vec3, SONDE_WINDOW_NODES);
    unsigned char *last = SONDE_NEW(unsigned char, SONDE_WINDOW_NODES);
    status = points && last ? SONDE_OK : sonde_fail_memory(error);
    for (uint32_t n = 0; n < SONDE_WINDOW_NODES && !status; ++n) {
      uint32_t l = n % NL, i = n / NL % NT, j = n / NL / NT, row = j - SONDE_WINDOW_NEAR_FIRST;
      double a = 2 * SONDE_PI * i / NT, r = 3 + 1.0 * (NL - l);
      points[n] = vec3(r * cos(a), r * sin(a), 1.3 * j);
      last[n] = l == 0 && i < SONDE_WINDOW_NEAR_T && row < SONDE_WINDOW_NEAR_S;
      s->held[n] = l == NL - 1 ? 7 : j == 0 || j == NS - 1 ? 4 : 0;
    }
    if (!status) status = sonde_solid_connect(s, last, points, error);
    sonde_free(points);
    sonde_free(last);
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

// ---- a footprint --------------------------------------------------------------------------

void sonde_window_begin(sonde_window *w, const sonde_interior *in, sonde_footprint footprint) {
  SONDE_ASSERT(w != NULL && in != NULL && isfinite(footprint.theta) && isfinite(footprint.s));
  sonde_column_point at;
  w->ready = w->loaded = false;
  w->moved.count = w->pressed.count = 0;
  memset(w->felt, 0, w->solid.hex_count * sizeof *w->felt);
  sonde_grid_begin(&w->grid, in, footprint);
  memcpy(w->solid.node, w->grid.node, sizeof w->grid.node);
  sonde_interior_column(in, footprint.theta, footprint.s, &at);
  for (uint32_t h = 0; h < w->solid.hex_count; ++h) {
    uint32_t l = h % (NL - 1);
    double shear = l < SONDE_WINDOW_FAT ? sonde_fat_pa : sonde_muscle_pa;
    w->solid.hex[h].shear_pa = shear;
    w->solid.hex[h].bulk_pa = bulk_over_shear * shear;
    w->solid.hex[h].skin_n_m = l == 0 ? (skin_pa - sonde_fat_pa) * at.fat_m : 0;
  }
  sonde_solid_begin(&w->solid);
}

uint32_t sonde_window_steps(const sonde_window *w, uint64_t budget) {
  SONDE_ASSERT(w != NULL && budget > 0);
  return sonde_symbolic_steps(w->solid.symbolic, budget);
}

bool sonde_window_step(sonde_window *w, uint64_t budget) {
  SONDE_ASSERT(w != NULL && !w->ready);
  const size_t side = 3 * (size_t)SONDE_WINDOW_NEAR;
  double *c = w->compliance;
  if (!sonde_numeric_step(&w->solid.numeric, budget)) return false;
  w->ready = !w->solid.numeric.failed;
  if (w->ready) {
    double *factor = c + side * side;
    sonde_transpose(sonde_numeric_condensed(&w->solid.numeric), (uint32_t)side, (uint32_t)side,
                    factor);
    w->ready = sonde_cholesky(factor, (uint32_t)side);
    if (w->ready) sonde_cholesky_invert(factor, (uint32_t)side, c);
  }
  // Row k of the compliance is the answer to a force on unknown k.
  for (size_t i = 0; i < side && w->ready; ++i)
    for (size_t j = 0; j < i; ++j) {
      double lower = c[i * side + j];
      c[i * side + j] = c[j * side + i];
      c[j * side + i] = lower;
    }
  return true;
}
