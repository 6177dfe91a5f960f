// The matrix of eq. (4): dense against sparse storage, inversion against conjugate gradients.
#include "paper.h"
#include "solver_cost.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>

enum { SIZES = 8 };

// Slope of ln y over ln x by least squares.
static double log_slope(const double *x, const double *y, uint32_t count) {
  double mx = 0, my = 0, xx = 0, xy = 0;
  assert(count > 1);
  for (uint32_t k = 0; k < count; ++k) mx += log(x[k]) / count, my += log(y[k]) / count;
  for (uint32_t k = 0; k < count; ++k) {
    xx += (log(x[k]) - mx) * (log(x[k]) - mx);
    xy += (log(x[k]) - mx) * (log(y[k]) - my);
  }
  return xy / xx;
}

static sonde_status measure(paper *p, const long *nodes, uint32_t count, uint32_t dense_count,
                            solver_cost *cost, sonde_error *error) {
  const double STIFFNESS_N_M = 200;
  enum { REPEATS = 5 };
  for (uint32_t k = 0; k < count; ++k) {
    p->progress.report((double)k / count, "comparing solvers", p->progress.user);
    const bench_ellipsoid scene = {nodes[k], STIFFNESS_N_M, 1};
    sonde_model *model = NULL;
    solver_system s = {0};
    sonde_status status = bench_ellipsoid_build(&scene, &model, error);
    if (!status) status = solver_system_create(model, STIFFNESS_N_M, &s, error);
    if (!status) cost[k] = solver_cost_measure(&s, REPEATS, k < dense_count);
    solver_system_clear(&s);
    sonde_model_destroy(model);
    if (status) return status;
  }
  return SONDE_OK;
}

static void judge_storage(paper *p, const solver_cost *cost, uint32_t count) {
  const solver_cost *c = &cost[count - 1];
  double ratio = c->dense_bytes / c->sparse_bytes;
  paper_claim *claim = paper_begin(
      p, "sparse_storage", "4.2",
      "The matrix has n^2 elements, most of them zero: large objects need a sparse format.",
      "Bytes of the numbers of the 3n x 3n matrix of eq. (4), dense and as symmetric 3x3 blocks.");
  paper_samples(claim, count, "sizes");
  paper_value(claim, "nodes", c->nodes);
  paper_value(claim, "sparse_mb", c->sparse_bytes / 1e6);
  paper_value(claim, "dense_mb", c->dense_bytes / 1e6);
  paper_value(claim, "ratio", ratio);
  paper_say(claim, ratio > 10 ? PAPER_HOLDS : PAPER_FAILS,
            "At %u nodes %.2f MB instead of %.0f MB, %.0f times less; the ratio grows with n.",
            c->nodes, c->sparse_bytes / 1e6, c->dense_bytes / 1e6, ratio);
}

// The number of nodes from which conjugate gradients are faster, from the two slopes.
static void judge_inversion(paper *p, const solver_cost *cost, uint32_t count,
                            uint32_t dense_count) {
  double n[SIZES], dense_s[SIZES], pcg_s[SIZES], crossover = NAN, difference = 0;
  uint32_t first = dense_count > 3 ? dense_count - 3 : 0;
  for (uint32_t k = 0; k < count; ++k) n[k] = cost[k].nodes, pcg_s[k] = cost[k].pcg_s;
  for (uint32_t k = 0; k < dense_count; ++k) {
    dense_s[k] = cost[k].dense_s, difference = fmax(difference, cost[k].difference);
    if (!isfinite(crossover) && pcg_s[k] < dense_s[k]) {
      crossover = n[k];
      if (k > 0) { // between the two sizes, straight in the logarithms
        double a = log(dense_s[k - 1] / pcg_s[k - 1]), b = log(dense_s[k] / pcg_s[k]);
        crossover = n[k - 1] * pow(n[k] / n[k - 1], a / (a - b));
      }
    }
  }
  double slope = log_slope(n + first, dense_s + first, dense_count - first);
  double pcg_slope = log_slope(n + 2, pcg_s + 2, count - 2);
  paper_claim *c = paper_begin(
      p, "inversion_cubic", "4.2",
      "Inverting the matrix costs O(n^3); for many particles the conjugate gradient method is used "
      "instead.",
      "Time of a dense Cholesky solution and of conjugate gradients to 1e-8 on the same systems, "
      "by "
      "the number of nodes.");
  paper_samples(c, count, "sizes");
  paper_value(c, "dense_slope", slope);
  paper_value(c, "pcg_slope", pcg_slope);
  paper_value(c, "crossover_nodes", crossover);
  paper_value(c, "largest_dense_nodes", n[dense_count - 1]);
  paper_value(c, "largest_ratio", dense_s[dense_count - 1] / pcg_s[dense_count - 1]);
  paper_value(c, "difference", difference);
  paper_say(c, slope > 2.5 && isfinite(crossover) ? PAPER_HOLDS : PAPER_IN_PART,
            "Dense time grows as n^%.2f, conjugate gradients as n^%.2f; they are faster from %s "
            "%.0f nodes on and %.0f times faster at %.0f.",
            slope, pcg_slope, crossover > n[0] ? "about" : "at most", crossover,
            dense_s[dense_count - 1] / pcg_s[dense_count - 1], n[dense_count - 1]);
}

sonde_status paper_solvers(paper *p, sonde_error *error) {
  static const long NODES[SIZES] = {42, 92, 162, 252, 492, 1002, 1962, 7842};
  uint32_t count = p->quick ? 6 : SIZES, dense_count = p->quick ? 4 : 6;
  solver_cost cost[SIZES];
  sonde_status status = measure(p, NODES, count, dense_count, cost, error);
  if (status) return status;
  paper_table *t = paper_table_begin(
      p, "solvers", "The linear system of eq. (4): dense and sparse",
      "nodes|nodes\nsparse_mb|sparse, MB\ndense_mb|dense, MB\niterations|iterations\n"
      "pcg_ms|conjugate gradients, ms\ndense_ms|dense, ms\ndifference|difference");
  for (uint32_t k = 0; k < count; ++k) {
    const solver_cost *c = &cost[k];
    const double cells[] = {c->nodes,      c->sparse_bytes / 1e6, c->dense_bytes / 1e6,
                            c->iterations, 1e3 * c->pcg_s,        1e3 * c->dense_s,
                            c->difference};
    char key[24], name[24];
    snprintf(key, sizeof key, "nodes_%u", c->nodes);
    snprintf(name, sizeof name, "ellipsoid");
    paper_row(t, key, name, cells);
  }
  paper_caption(t->caption, sizeof t->caption,
                "M + h C + h^2 K of an ellipsoid with springs of 200 N/m and a push on 20 nodes. "
                "Conjugate gradients to a relative residual of 1e-8, best of five; dense: Cholesky "
                "factorisation and solution, up to %ld nodes. Difference of the two solutions.",
                NODES[dense_count - 1]);
  judge_storage(p, cost, count);
  judge_inversion(p, cost, count, dense_count);
  return SONDE_OK;
}
