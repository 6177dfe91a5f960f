// bench_accuracy [NODES [STIFFNESS | FIGURE.svg]]: what the explicit and the implicit step cost for
// the same error, from soft to stiff surface springs (docs/performance.md). The ellipsoid is
// pressed for 50 ms; the displacements then are compared with a fine run (implicitness 1/2) of the
// same scene (rms of the difference over rms). Per stiffness and method the step is halved until
// the error is 1 % or less; the cost is the best of three runs.
#include "bench_ellipsoid.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const double STIFFNESS[] = {200, 630, 2000, 6300, 20000};
static const double END_S = 0.05, WANTED = 0.01;
enum { STIFFNESSES = 5, METHODS = 4, HALVINGS = 13, COARSEST = 5, FINE = 4096 };

typedef struct method {
  const char *name, *colour;
  double implicitness;
  uint32_t newton;
  sonde_engine engine;
} method;

static const method METHOD[METHODS] = {
    {"explicit, eq. (3)", "#b2182b", 0, 0, SONDE_ENGINE_DOUBLE},
    {"eq. (4), lambda = 1", "#2166ac", 1, 0, SONDE_ENGINE_DOUBLE},
    {"lambda = 1/2, 2 Newton", "#1b7837", 0.5, 2, SONDE_ENGINE_DOUBLE},
    {"lambda = 1, fast engine", "#762a83", 1, 2, SONDE_ENGINE_FAST}};

typedef struct cost {
  double dt_s, error, seconds;
  long steps, products; // of matrix and vector
} cost;

// Time of this process: others on the same machine count less than on the clock of the wall.
static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

typedef struct study {
  bench_ellipsoid scene;
  sonde_model *model;
  sonde_probe probe;
  sonde_vec3 *exact;
} study;

// Runs to END_S in `steps` steps; *state stays for a look at the positions.
static sonde_status run(const study *s, const method *m, long steps, double residual,
                        sonde_state **state, cost *out, sonde_error *error) {
  sonde_world_def def = bench_ellipsoid_world(END_S / (double)steps);
  def.implicitness = m->implicitness;
  def.newton_iterations = m->newton;
  def.engine = m->engine;
  def.pcg = (sonde_pcg_options){residual, 1e-14, 2000};
  def.sleep_displacement_m = 0;
  sonde_status status = sonde_state_create(s->model, &def, state, error);
  *out = (cost){.dt_s = def.dt_s, .steps = steps};
  double start = now();
  for (long k = 1; !status && k <= steps; ++k) {
    sonde_step(*state, &s->probe, bench_ellipsoid_pose(&s->scene, (double)k * def.dt_s));
    out->products += sonde_state_solver(*state).iterations;
    if (sonde_state_flags(*state) & SONDE_FLAG_NON_FINITE) break;
  }
  out->seconds = now() - start;
  return status;
}

static double error_of(const study *s, sonde_state *state) {
  const sonde_vec3 *x = sonde_state_positions(state), *y = s->exact,
                   *r = s->model->surface.vertices;
  double difference = 0, size = 0;
  if (sonde_state_flag_count(state) > 0) return INFINITY;
  for (uint32_t i = 0; i < s->model->surface.vertex_count; ++i) {
    difference += pow(x[i].x - y[i].x, 2) + pow(x[i].y - y[i].y, 2) + pow(x[i].z - y[i].z, 2);
    size += pow(y[i].x - r[i].x, 2) + pow(y[i].y - r[i].y, 2) + pow(y[i].z - r[i].z, 2);
  }
  return sqrt(difference / size);
}

static sonde_status find_exact(study *s, sonde_error *error) {
  sonde_state *state = NULL;
  cost ignored;
  const method fine = {"", "", 0.5, 2, SONDE_ENGINE_DOUBLE};
  sonde_status status = run(s, &fine, FINE, 1e-8, &state, &ignored, error);
  size_t bytes = s->model->surface.vertex_count * sizeof *s->exact;
  s->exact = malloc(bytes);
  if (!status && s->exact) memcpy(s->exact, sonde_state_positions(state), bytes);
  sonde_state_destroy(state);
  return s->exact || status ? status : SONDE_MEMORY;
}

// The largest step that is accurate enough, then its best time.
static sonde_status find_cost(const study *s, const method *m, cost *best, sonde_error *error) {
  long steps = COARSEST;
  sonde_status status = SONDE_OK;
  best->error = INFINITY;
  for (int k = 0, again = 0; !status && k < HALVINGS && again < 3;) {
    sonde_state *state = NULL;
    cost c;
    status = run(s, m, steps, 1e-3, &state, &c, error);
    if (!status) c.error = error_of(s, state);
    sonde_state_destroy(state);
    if (!status && c.error <= WANTED) {
      if (again++ == 0 || c.seconds < best->seconds) *best = c;
    } else {
      k++, steps *= 2;
    }
  }
  return status;
}

static sonde_status study_stiffness(long nodes, double stiffness, cost *costs, sonde_error *error) {
  study s = {.scene = {nodes, stiffness, 1}};
  sonde_status status = bench_ellipsoid_build(&s.scene, &s.model, error);
  if (!status) status = sonde_probe_create("ball:30", &s.probe, error);
  if (!status) status = find_exact(&s, error);
  for (int m = 0; !status && m < METHODS; ++m) {
    status = find_cost(&s, &METHOD[m], &costs[m], error);
    const cost *c = &costs[m];
    printf("%7.0f  %-24s %9.4f %8.4f %6ld %8ld %9.4f\n", stiffness, METHOD[m].name, c->dt_s * 1e3,
           c->error * 100, c->steps, c->products, c->seconds);
    fflush(stdout);
  }
  free(s.exact);
  sonde_probe_clear(&s.probe);
  sonde_model_destroy(s.model);
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

static axes axes_of(cost (*costs)[METHODS]) {
  axes a = {INFINITY, -INFINITY};
  for (int k = 0; k < STIFFNESSES; ++k)
    for (int m = 0; m < METHODS; ++m)
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

static void draw_method(sonde_file *f, const axes *a, cost (*costs)[METHODS], int m) {
  double xy[STIFFNESSES][2];
  char look[80], dot[40];
  uint32_t count = 0;
  for (int k = 0; k < STIFFNESSES; ++k)
    if (costs[k][m].seconds > 0) {
      xy[count][0] = x_of(STIFFNESS[k]);
      xy[count++][1] = y_of(a, costs[k][m].seconds);
    }
  snprintf(look, sizeof look, "fill='none' stroke-width='2' stroke='%s'", METHOD[m].colour);
  snprintf(dot, sizeof dot, "fill='%s'", METHOD[m].colour);
  sonde_svg_put_line(f, (const double(*)[2])xy, count, look);
  for (uint32_t k = 0; k < count; ++k) sonde_svg_put_circle(f, xy[k][0], xy[k][1], 4, dot);
  sonde_svg_put_circle(f, LEFT + WIDTH + 20, TOP + 20 + 24 * m, 4, dot);
  sonde_svg_put_text(f, LEFT + WIDTH + 32, TOP + 24 + 24 * m, "", METHOD[m].name);
}

static sonde_status draw(const char *path, cost (*costs)[METHODS], sonde_error *error) {
  sonde_file *f = NULL;
  sonde_status status = sonde_file_create(path, &f, error);
  if (status) return status;
  axes a = axes_of(costs);
  sonde_svg_begin(f, "Cost over stiffness", 720, 400);
  draw_frame(f, &a);
  for (int m = 0; m < METHODS; ++m) draw_method(f, &a, costs, m);
  return sonde_svg_end(f, error);
}

int main(int argc, char **argv) {
  long nodes = argc > 1 ? atol(argv[1]) : 1962;
  double only = argc > 2 ? atof(argv[2]) : 0; // 0: all, with the figure
  if (argc > 3 || nodes < 42 || nodes > 100000) {
    fprintf(stderr, "usage: bench_accuracy [NODES [STIFFNESS | FIGURE.svg]], 42 to 100000 nodes\n");
    return 2;
  }
  cost costs[STIFFNESSES][METHODS] = {0};
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
