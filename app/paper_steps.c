// Eq. (3) against eq. (4): the explicit step's limit, and the cost of both at equal error.
#include "paper.h"
#include "step_cost.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>

static sonde_status judge_limit(paper *p, sonde_error *error) {
  static const double SCALE[] = {1, 10, 100};
  enum { SCALES = sizeof SCALE / sizeof *SCALE };
  double farthest = 0;
  paper_table *t = paper_table_begin(
      p, "stability", "Largest step of the explicit method, eq. (3)",
      "frequency_hz|frequency, Hz\ndamping_ratio|damping ratio\ntheory_ms|theory, ms\n"
      "measured_ms|measured, ms\ndifference_percent|difference, %");
  step_limit limit[SCALES];
  for (int k = 0; k < SCALES; ++k) {
    sonde_status status = step_limit_find(SCALE[k], 162, &limit[k], error);
    if (status) return status;
    double off = 100 * (limit[k].measured_s / limit[k].theory_s - 1);
    const double cells[] = {limit[k].frequency_hz, limit[k].damping_ratio, 1e3 * limit[k].theory_s,
                            1e3 * limit[k].measured_s, off};
    char key[24], name[40];
    snprintf(key, sizeof key, "scale_%g", SCALE[k]);
    snprintf(name, sizeof name, "springs %g times as stiff", SCALE[k]);
    paper_row(t, key, name, cells);
    farthest = fmax(farthest, fabs(off));
  }
  paper_caption(t->caption, sizeof t->caption,
                "162 nodes on normal springs alone, disturbed by 1 um and stepped %ld times by eq. "
                "(3). Theory: of m x'' + tau k x' + k x = 0 the step is bounded by tau when "
                "underdamped, else by tau - sqrt(tau^2 - 4 m/k).",
                limit[0].steps);
  paper_claim *c = paper_begin(
      p, "explicit_diverges", "4.2, eq. (3)",
      "The explicit step takes no notice of wildly changing derivatives; only a smaller time step "
      "stops it from diverging.",
      "Bisection of the largest step that leaves a disturbed body bounded, for three stiffnesses, "
      "against the limit of theory.");
  paper_samples(c, SCALES, "stiffnesses");
  paper_value(c, "farthest_percent", farthest);
  paper_value(c, "soft_limit_ms", 1e3 * limit[0].measured_s);
  paper_value(c, "stiff_limit_ms", 1e3 * limit[SCALES - 1].measured_s);
  paper_say(c, farthest <= 2 ? PAPER_HOLDS : PAPER_IN_PART,
            "The limit falls from %.2f to %.3f ms as the springs become %g times stiffer, within "
            "%.2f %% of theory; a step above it diverges.",
            1e3 * limit[0].measured_s, 1e3 * limit[SCALES - 1].measured_s, SCALE[SCALES - 1],
            farthest);
  return SONDE_OK;
}

static sonde_status judge_cost(paper *p, sonde_error *error) {
  static const double STIFFNESS[] = {200, 2000, 20000};
  static const char *const KEY[] = {"soft", "middle", "stiff"};
  enum { SOFT, MIDDLE, STIFF, STIFFNESSES };
  long nodes = p->quick ? 162 : 1962, fine = p->quick ? 512 : 4096;
  step_cost costs[STIFFNESSES][STEP_METHODS] = {0};
  double best[STIFFNESSES], fast[STIFFNESSES];
  paper_table *t = paper_table_begin(
      p, "integration", "Cost of 50 ms at an error of at most 1 %",
      "stiffness_n_m|spring, N/m\ndt_ms|step, ms\nerror_percent|error, %\nsteps|steps\n"
      "products|products\nseconds|time, s");
  for (int k = 0; k < STIFFNESSES; ++k) {
    if (k == MIDDLE && p->quick) continue;
    p->progress.report((k + 0.2) / STIFFNESSES, "comparing time steps", p->progress.user);
    const bench_ellipsoid scene = {nodes, STIFFNESS[k], 1};
    sonde_status status = step_cost_study(&scene, fine, costs[k], error);
    if (status) return status;
    for (int m = 0; m < STEP_METHODS; ++m) {
      const step_cost *c = &costs[k][m];
      const double cells[] = {STIFFNESS[k],     1e3 * c->dt_s,       100 * c->error,
                              (double)c->steps, (double)c->products, c->seconds};
      char key[40];
      snprintf(key, sizeof key, "%s_%d", KEY[k], m);
      paper_row(t, key, STEP_METHOD[m].name, cells);
    }
    double implicit = fmin(costs[k][1].seconds, costs[k][2].seconds);
    best[k] = costs[k][0].seconds / implicit;
    fast[k] = costs[k][0].seconds / costs[k][3].seconds;
  }
  paper_caption(t->caption, sizeof t->caption,
                "An ellipsoid of %ld nodes is pressed for 50 ms. Per method the largest step of 10 "
                "ms/2^k whose displacements differ by 1 %% (rms) or less from a run of %ld steps. "
                "Products: of matrix and vector. Time of the process, best of three.",
                nodes, fine);
  paper_claim *c = paper_begin(
      p, "larger_steps_outweigh", "4.2, eq. (4)",
      "Each implicit step costs more, but much larger steps outweigh this where springs are stiff.",
      "Cost of the explicit and the implicit method at the same error, from soft to stiff surface "
      "springs, on the same engine.");
  paper_samples(c, p->quick ? 2 : STIFFNESSES, "stiffnesses");
  paper_value(c, "soft_ratio", best[SOFT]);
  paper_value(c, "stiff_ratio", best[STIFF]);
  paper_value(c, "soft_fast_ratio", fast[SOFT]);
  paper_value(c, "stiff_fast_ratio", fast[STIFF]);
  paper_value(c, "explicit_step_ms", 1e3 * costs[STIFF][0].dt_s);
  paper_value(c, "implicit_step_ms", 1e3 * costs[STIFF][2].dt_s);
  paper_value(c, "step_ratio", costs[STIFF][2].dt_s / costs[STIFF][0].dt_s);
  paper_say(c, best[STIFF] > 1 ? PAPER_HOLDS : PAPER_FAILS,
            "At %.0f N/m the explicit step is %.1f times dearer than the best implicit one in "
            "double precision (%.0f times than the fast engine), which takes steps %.0f times as "
            "long; at %.0f N/m %.1f times (%.0f).",
            STIFFNESS[STIFF], best[STIFF], fast[STIFF], costs[STIFF][2].dt_s / costs[STIFF][0].dt_s,
            STIFFNESS[SOFT], best[SOFT], fast[SOFT]);
  return SONDE_OK;
}

sonde_status paper_steps(paper *p, sonde_error *error) {
  assert(p->directory);
  sonde_status status = judge_limit(p, error);
  return status ? status : judge_cost(p, error);
}
