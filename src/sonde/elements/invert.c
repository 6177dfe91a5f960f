// Cholesky factor and inverse in tiles: every product reads a tile that stays in the cache.
#include "elements/invert.h"
#include "base/base.h"
#include "base/parallel.h"
#include "sparse/dense.h"

#include <string.h>

enum { TILE = 128 };

typedef struct inversion {
  uint32_t n, tiles;
  double *factor;   // [n * n] lower triangle; its diagonal tiles are not used
  double *diagonal; // [tiles][TILE * TILE] inverse of the factor's tile on the diagonal
  double *turned;   // [tiles][TILE * TILE] transposes of the tiles of the column at work
  double *inverse;  // [n * n]
  double **scratch; // [workers] [n + TILE][TILE]
  uint32_t now;     // column of tiles at work
} inversion;

static uint32_t size_of(const inversion *v, uint32_t tile) {
  uint32_t rest = v->n - tile * TILE;
  return rest < TILE ? rest : TILE;
}

static double *tile_at(const inversion *v, uint32_t row, uint32_t column) {
  return v->factor + (size_t)row * TILE * v->n + (size_t)column * TILE;
}

// Factor of the tile on the diagonal, inverted.
static bool factor_diagonal(inversion *v) {
  const uint32_t size = size_of(v, v->now);
  double *whole = v->scratch[0], *inverse = v->diagonal + (size_t)v->now * TILE * TILE;
  const double *from = tile_at(v, v->now, v->now);
  for (uint32_t i = 0; i < size; ++i)
    memcpy(whole + (size_t)i * size, from + (size_t)i * v->n, size * sizeof *whole);
  if (!sonde_cholesky(whole, size)) return false;
  memset(inverse, 0, (size_t)size * size * sizeof *inverse);
  for (uint32_t i = 0; i < size; ++i) inverse[(size_t)i * size + i] = 1;
  sonde_cholesky_forward_many(whole, size, inverse, size);
  return true;
}

// Tile below the diagonal: A_ik L_kk^-T, kept with its transpose.
static sonde_status solve_tile(void *user, uint32_t worker, uint32_t item, const atomic_bool *stop,
                               sonde_error *error) {
  const inversion *v = user;
  (void)stop, (void)error;
  const uint32_t row = v->now + 1 + item, rows = size_of(v, row), size = size_of(v, v->now);
  double *turned = v->turned + (size_t)row * TILE * TILE, *from = tile_at(v, row, v->now);
  // Transposed: L_kk^-1 A_ik^T.
  double *copy = v->scratch[worker];
  for (uint32_t i = 0; i < rows; ++i)
    for (uint32_t k = 0; k < size; ++k) copy[(size_t)k * rows + i] = from[(size_t)i * v->n + k];
  memset(turned, 0, (size_t)size * rows * sizeof *turned);
  const sonde_product product = {.c = turned,
                                 .c_row = rows,
                                 .a = v->diagonal + (size_t)v->now * TILE * TILE,
                                 .a_row = size,
                                 .a_step = 1,
                                 .b = copy,
                                 .b_row = rows,
                                 .rows = size,
                                 .columns = rows,
                                 .depth = size};
  sonde_multiply(&product);
  for (uint32_t i = 0; i < rows; ++i)
    for (uint32_t k = 0; k < size; ++k) from[(size_t)i * v->n + k] = turned[(size_t)k * rows + i];
  return SONDE_OK;
}

// A row of tiles behind the column at work: A_ij -= L_ik L_jk^T.
static sonde_status update_row(void *user, uint32_t worker, uint32_t item, const atomic_bool *stop,
                               sonde_error *error) {
  const inversion *v = user;
  (void)worker, (void)stop, (void)error;
  const uint32_t row = v->tiles - 1 - item; // the longest first
  for (uint32_t column = v->now + 1; column <= row; ++column) {
    const sonde_product product = {.c = tile_at(v, row, column),
                                   .c_row = v->n,
                                   .a = tile_at(v, row, v->now),
                                   .a_row = v->n,
                                   .a_step = 1,
                                   .b = v->turned + (size_t)column * TILE * TILE,
                                   .b_row = size_of(v, column),
                                   .rows = size_of(v, row),
                                   .columns = size_of(v, column),
                                   .depth = size_of(v, v->now),
                                   .subtract = true};
    sonde_multiply(&product);
  }
  return SONDE_OK;
}
// One column of tiles of the inverse from the diagonal down, and the row that mirrors it.
static sonde_status invert_column(void *user, uint32_t worker, uint32_t item,
                                  const atomic_bool *stop, sonde_error *error) {
  const inversion *v = user;
  (void)stop, (void)error;
  const uint32_t columns = size_of(v, item), first = item * TILE;
  double *copy = v->scratch[worker], *x = copy + TILE * TILE; // x: rows from `first` on
  memset(x, 0, (size_t)(v->n - first) * columns * sizeof *x);
  for (uint32_t i = 0; i < columns; ++i) x[(size_t)i * columns + i] = 1;
  // L y = columns of the identity, then L^T x = y.
  for (uint32_t pass = 0; pass < 2; ++pass)
    for (uint32_t step = item; step < v->tiles; ++step) {
      const uint32_t k = pass ? v->tiles - 1 - (step - item) : step, size = size_of(v, k);
      double *now = x + (size_t)(k - item) * TILE * columns;
      // x_k = L_kk^-1 x_k, on the way back L_kk^-T x_k.
      memcpy(copy, now, (size_t)size * columns * sizeof *copy);
      memset(now, 0, (size_t)size * columns * sizeof *now);
      const sonde_product diagonal = {.c = now,
                                      .c_row = columns,
                                      .a = v->diagonal + (size_t)k * TILE * TILE,
                                      .a_row = pass ? 1 : size,
                                      .a_step = pass ? size : 1,
                                      .b = copy,
                                      .b_row = columns,
                                      .rows = size,
                                      .columns = columns,
                                      .depth = size};
      sonde_multiply(&diagonal);
      const uint32_t behind = k * TILE + size;
      const sonde_product product = {
          .c = pass ? x : now + (size_t)size * columns,
          .c_row = columns,
          .a = pass ? tile_at(v, k, item) : v->factor + (size_t)behind * v->n + (size_t)k * TILE,
          .a_row = pass ? 1 : v->n,
          .a_step = pass ? v->n : 1,
          .b = now,
          .b_row = columns,
          .rows = pass ? (k - item) * TILE : v->n - behind,
          .columns = columns,
          .depth = size,
          .subtract = true};
      if (product.rows) sonde_multiply(&product);
    }
  for (uint32_t i = 0; i < v->n - first; ++i)
    for (uint32_t j = 0; j < columns && j <= i; ++j)
      v->inverse[(size_t)(first + i) * v->n + first + j] =
          v->inverse[(size_t)(first + j) * v->n + first + i] = x[(size_t)i * columns + j];
  return SONDE_OK;
}

sonde_status sonde_invert(const double *a, uint32_t n, uint32_t workers, double *inverse,
                          sonde_error *error) {
  SONDE_ASSERT(a != NULL && inverse != NULL && a != inverse && n > 0);
  inversion v = {.n = n, .tiles = (n + TILE - 1) / TILE, .inverse = inverse};
  const size_t tile = TILE * TILE;
  workers = sonde_parallel_workers(workers, v.tiles);
  v.factor = SONDE_NEW(double, (size_t)n *n);
  v.diagonal = SONDE_NEW(double, v.tiles *tile);
  v.turned = SONDE_NEW(double, v.tiles *tile);
  v.scratch = SONDE_NEW(double *, workers);
  sonde_status status =
      v.factor && v.diagonal && v.turned && v.scratch ? SONDE_OK : sonde_fail_memory(error);
  for (uint32_t w = 0; w < workers && !status; ++w)
    if (!(v.scratch[w] = SONDE_NEW(double, tile + (size_t)n * TILE)))
      status = sonde_fail_memory(error);
  if (!status) memcpy(v.factor, a, (size_t)n * n * sizeof *a);
  for (v.now = 0; v.now < v.tiles && !status; ++v.now) {
    const uint32_t below = v.tiles - 1 - v.now;
    if (!factor_diagonal(&v))
      status = sonde_fail(error, SONDE_CONVERGENCE, "the matrix is not positive definite");
    if (below && !status)
      status = sonde_parallel_run(below, workers, solve_tile, &v, NULL, "factor", error);
    if (below && !status)
      status = sonde_parallel_run(below, workers, update_row, &v, NULL, "factor", error);
  }
  if (!status)
    status = sonde_parallel_run(v.tiles, workers, invert_column, &v, NULL, "inverse", error);
  for (uint32_t w = 0; w < workers && v.scratch; ++w) sonde_free(v.scratch[w]);
  sonde_free(v.scratch);
  sonde_free(v.factor);
  sonde_free(v.diagonal);
  sonde_free(v.turned);
  return status;
}
