// bench_accuracy [NODES [STIFFNESS | FIGURE.svg]]: what the explicit and the implicit step cost for
// the same error, from soft to stiff surface springs (docs/performance.md). The ellipsoid is
// pressed for 50 ms; the displacements then are compared with a fine run (implicitness 1/2) of the
// same scene (rms of the difference over rms). Per stiffness and method the step is halved until
// the error is 1 % or less; the cost is the best of three runs.
#include "step_cost.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double STIFFNESS[] = {200, 630, 2000, 6300, 20000};
enum { STIFFNESSES = 5, FINE = 4096 };

static sonde_status study_stiffness(long nodes, double stiffness, step_cost *costs,
                                    sonde_error *error) {
  const bench_ellipsoid scene = {nodes, stiffness, 1};
  sonde_status status = step_cost_study(&scene, FINE, costs, error);
  for (int m = 0; !status && m < STEP_METHODS; ++m) {
    const step_cost *c = &costs[m];
    printf("%7.0f  %-24s %9.4f %8.4f %6ld %8ld %9.4f\n", stiffness, STEP_METHOD[m].name,
           c->dt_s * 1e3, c->error * 100, c->steps, c->products, c->seconds);
    fflush(stdout);
  }
  return status;
}

// ---- figure: cost over stiffness, both logarithmic ----------------------------------------

enum { LEFT = 70, TOP = 40, WIDTH = 420, HEIGHT = 300 };
typedef struct axes {
  double low, high; // powers of ten of the cost
} axes;

static double x_of(double stiffness) {
  return LEFT + 20 + (WIDTH - 40) * log10(stiffness / 200) / 2;
}
static double y_of(const axes *a, double seconds) {
  return TOP + HEIGHT * (a->high - log10(seconds)) / (a->high - a->low);
}

static axes axes_of(step_cost (*costs)[STEP_METHODS]) {
  axes a = {INFINITY, -INFINITY};
  for (int k = 0; k < STIFFNESSES; ++k)
    for (int m = 0; m < STEP_METHODS; ++m)
      if (costs[k][m].seconds > 0) {
        a.low = fmin(a.low, floor(log10(costs[k][m].seconds)));
        a.high = fmax(a.high, ceil(log10(costs[k][m].seconds)));
      }
  return a;
}

static void draw_line(sonde_file *f, double x0, double y0, double x1, double y1, const char *look) {
  const double ends[2][2] = {{x0, y0}, {x1, y1}};
  sonde_svg_put_line(f, ends, 2, look);
}

static void draw_frame(sonde_file *f, const axes *a) {
  const double corner[3][2] = {{LEFT, TOP}, {LEFT, TOP + HEIGHT}, {LEFT + WIDTH, TOP + HEIGHT}};
  char words[100];
  sonde_svg_put_text(f, LEFT, 24, "class='head'", "Cost of 50 ms at an error of at most 1 %");
  for (int p = (int)a->low; p <= (int)a->high; ++p) {
    double y = y_of(a, pow(10, p));
    draw_line(f, LEFT, y, LEFT + WIDTH, y, "stroke='#ddd'");
    snprintf(words, sizeof words, "%g", pow(10, p));
    sonde_svg_put_text(f, LEFT - 8, y + 4, "class='tick end'", words);
  }
  for (int k = 0; k < STIFFNESSES; ++k) {
    double x = x_of(STIFFNESS[k]);
    draw_line(f, x, TOP + HEIGHT, x, TOP + HEIGHT + 5, "stroke='#333'");
    snprintf(words, sizeof words, "%g", STIFFNESS[k]);
    sonde_svg_put_text(f, x, TOP + HEIGHT + 20, "class='tick middle'", words);
  }
  sonde_svg_put_line(f, corner, 3, "stroke='#333' fill='none'");
  sonde_svg_put_text(f, LEFT + WIDTH / 2.0, TOP + HEIGHT + 42, "class='middle'",
                     "stiffness of a surface spring, N/m");
  snprintf(words, sizeof words, "transform='translate(20 %d) rotate(-90)' class='middle'",
           TOP + HEIGHT / 2);
  sonde_svg_put_text(f, 0, 0, words, "time on one core, s");
}

static void draw_method(sonde_file *f, const axes *a, step_cost (*costs)[STEP_METHODS], int m) {
  double xy[STIFFNESSES][2];
  char look[80], dot[40];
  uint32_t count = 0;
  for (int k = 0; k < STIFFNESSES; ++k)
    if (costs[k][m].seconds > 0) {
      xy[count][0] = x_of(STIFFNESS[k]);
      xy[count++][1] = y_of(a, costs[k][m].seconds);
    }
  snprintf(look, sizeof look, "fill='none' stroke-width='2' stroke='%s'", STEP_METHOD[m].colour);
  snprintf(dot, sizeof dot, "fill='%s'", STEP_METHOD[m].colour);
  sonde_svg_put_line(f, (const double(*)[2])xy, count, look);
  for (uint32_t k = 0; k < count; ++k) sonde_svg_put_circle(f, xy[k][0], xy[k][1], 4, dot);
  sonde_svg_put_circle(f, LEFT + WIDTH + 20, TOP + 20 + 24 * m, 4, dot);
  sonde_svg_put_text(f, LEFT + WIDTH + 32, TOP + 24 + 24 * m, "", STEP_METHOD[m].name);
}

static sonde_status draw(const char *path, step_cost (*costs)[STEP_METHODS], sonde_error *error) {
  sonde_file *f = NULL;
  sonde_status status = sonde_file_create(path, &f, error);
  if (status) return status;
  axes a = axes_of(costs);
  sonde_svg_begin(f, "Cost over stiffness", 720, 400);
  draw_frame(f, &a);
  for (int m = 0; m < STEP_METHODS; ++m) draw_method(f, &a, costs, m);
  return sonde_svg_end(f, error);
}

int main(int argc, char **argv) {
  long nodes = argc > 1 ? atol(argv[1]) : 1962;
  double only = argc > 2 ? atof(argv[2]) : 0; // 0: all, with the figure
  if (argc > 3 || nodes < 42 || nodes > 100000) {
    fprintf(stderr, "usage: bench_accuracy [NODES [STIFFNESS | FIGURE.svg]], 42 to 100000 nodes\n");
    return 2;
  }
  step_cost costs[STIFFNESSES][STEP_METHODS] = {0};
  sonde_error error = {0};
  sonde_status status = SONDE_OK;
  printf("k_N_m    method                       dt_ms  error_%%  steps products   seconds\n");
  if (only > 0) status = study_stiffness(nodes, only, costs[0], &error);
  for (int k = 0; !status && !(only > 0) && k < STIFFNESSES; ++k)
    status = study_stiffness(nodes, STIFFNESS[k], costs[k], &error);
  if (!status && argc > 2 && !(only > 0)) status = draw(argv[2], costs, &error);
  if (status) fprintf(stderr, "bench_accuracy: %s\n", error.message);
  return status ? 1 : 0;
}
