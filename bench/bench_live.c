// bench_live MODEL DEPTH_MM [SITE [EDGE_MM [GROWTH]]]: the live solid beside the equilibrium, on
// one mesh. A rounded linear probe presses to a depth, slides 6 mm along each of its axes and back,
// and is withdrawn to 1 mm, at 10, 20 and 40 mm/s with 0.3 s of rest after each part. Prints a JSON
// object: errors of the force along the way, what is left at rest, the largest jump where a pass is
// taken over, and processor times.
#include <sonde/sonde.h>

#include "pose.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { PARTS = 6, HOLD_TICKS = 300, KNOTS_MOST = 256, TIMES_MOST = 100000 };
static const double SLIDE_M = 6e-3, OUT_M = 1e-3;
static const double KNOT_M = 0.2e-3; // between two equilibria: sliding skin snaps within less
static const double LEAST_N = 0.3;   // forces below it have no relative error
static const char *const NAMES[PARTS] = {"press",       "slide_across", "back_across",
                                         "slide_along", "back_along",   "withdraw"};

typedef struct place {
  double down, across, along;
} place;

typedef struct rig {
  sonde_model *model;
  sonde_probe probe;
  sonde_hexes mesh;
  sonde_pose start;
  sonde_solid_live_def def;
  double truth[PARTS][KNOTS_MOST + 1]; // force along the way at even places of a part
  int knots[PARTS];                    // intervals
} rig;

typedef struct times {
  double s[TIMES_MOST];
  int count;
} times;
static times ticks, rests, moves; // of a tick, of passes at rest, of passes that move

static double seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int ascending(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static double at_share(times *t, double share) {
  qsort(t->s, (size_t)t->count, sizeof *t->s, ascending);
  return t->count ? t->s[(int)(share * (t->count - 1))] : 0;
}

static void note(times *t, double s) {
  if (t->count < TIMES_MOST) t->s[t->count++] = s;
}

static void ends_of(int part, double depth_m, place end[2]) {
  const place top = {depth_m, 0, 0},
              all[PARTS + 1] = {
                  {0, 0, 0}, top,          {depth_m, SLIDE_M, 0}, top, {depth_m, 0, SLIDE_M},
                  top,       {OUT_M, 0, 0}};
  end[0] = all[part], end[1] = all[part + 1];
}

static sonde_pose pose_at(const rig *r, int part, double depth_m, double share) {
  place e[2];
  ends_of(part, depth_m, e);
  sonde_pose pose =
      pose_shift(r->start, e[0].down + share * (e[1].down - e[0].down), pose_axis(r->start, 2));
  pose =
      pose_shift(pose, e[0].across + share * (e[1].across - e[0].across), pose_axis(r->start, 0));
  return pose_shift(pose, e[0].along + share * (e[1].along - e[0].along), pose_axis(r->start, 1));
}

static double length_of(int part, double depth_m) {
  return part == 0 ? depth_m : part == PARTS - 1 ? depth_m - OUT_M : SLIDE_M;
}

static double along_way(const rig *r, sonde_vec3 force) {
  return -vec_dot(force, pose_axis(r->start, 2));
}

static sonde_status find_truth(rig *r, double depth_m, sonde_error *error) {
  sonde_equilibrium *e = NULL;
  sonde_equilibrium_result result;
  sonde_status status =
      sonde_equilibrium_create(&r->mesh, &r->probe, r->start, &r->def.solid, &e, error);
  for (int part = 0; part < PARTS && !status; ++part) {
    r->knots[part] = (int)fmin(ceil(length_of(part, depth_m) / KNOT_M - 1e-9), KNOTS_MOST);
    r->truth[part][0] = part ? r->truth[part - 1][r->knots[part - 1]] : 0;
    for (int k = 1; k <= r->knots[part] && !status; ++k) {
      const double share = (double)k / r->knots[part];
      status = sonde_equilibrium_find(e, pose_at(r, part, depth_m, share), &result, error);
      r->truth[part][k] = along_way(r, result.force_n);
    }
  }
  sonde_equilibrium_destroy(e);
  return status;
}

// Cubic between the knots.
static double truth_at(const rig *r, int part, double share) {
  const int last = r->knots[part];
  const double *f = r->truth[part], x = share * last;
  const int k = x < last - 1 ? (int)x : last - 1;
  const double t = x - k, a = f[k > 0 ? k - 1 : 0], b = f[k], c = f[k + 1],
               d = f[k + 2 <= last ? k + 2 : last];
  return b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)));
}

static void run_part(const rig *r, sonde_solid_live *live, int part, double depth_m, double speed,
                     double last[2]) {
  const int way = (int)(length_of(part, depth_m) / speed * 1e3 + 0.5);
  double square = 0, most = 0, most_n = 0, jump = 0, held = 0, spent = 0;
  int counted = 0;
  for (int t = 1; t <= way + HOLD_TICKS; ++t) {
    const double share = t < way ? (double)t / way : 1, truth = truth_at(r, part, share);
    const bool due = sonde_solid_live_count(live).ticks % r->def.pass_ticks == 0;
    sonde_solid_contact contact;
    const double before = seconds();
    sonde_solid_live_tick(live, pose_at(r, part, depth_m, share), &contact);
    const double between = seconds();
    const bool worked = sonde_solid_live_work(live);
    const double after = seconds(), force = along_way(r, contact.force_n);
    const double error = fabs(force - truth);
    note(&ticks, between - before);
    if (worked && t > way + HOLD_TICKS / 2) note(&rests, after - between);
    if (worked && t <= way) note(&moves, after - between);
    if (t <= way) spent += after - before, most_n = fmax(most_n, error);
    if (t <= way && truth > LEAST_N) {
      square += error * error / truth / truth, most = fmax(most, error / truth), ++counted;
    }
    if (due) jump = fmax(jump, fabs(force - last[0] - (truth - last[1])));
    held = force / truth - 1;
    last[0] = force, last[1] = truth;
  }
  printf("\"%s\": {\"rms_percent\": %.4g, \"most_percent\": %.4g, \"most_n\": %.4g, \"jump_n\": "
         "%.4g, \"held_percent\": %.4g, \"core_percent\": %.4g}",
         NAMES[part], 100 * sqrt(square / fmax(counted, 1)), 100 * most, most_n, jump, 100 * held,
         100 * spent / (1e-3 * way));
}

static sonde_status run_depth(rig *r, double depth_m, sonde_error *error) {
  static const double SPEEDS[] = {10, 20, 40};
  sonde_status status = find_truth(r, depth_m, error);
  printf(", \"force_n\": %.5g", r->truth[0][r->knots[0]]);
  for (int k = 0; k < 3 && !status; ++k) {
    sonde_solid_live *live = NULL;
    double last[2] = {0, 0};
    status = sonde_solid_live_create(&r->mesh, &r->probe, r->start, &r->def, &live, error);
    if (status) break;
    printf(", \"at_%.0f\": {", SPEEDS[k]);
    for (int part = 0; part < PARTS; ++part) {
      if (part) printf(", ");
      run_part(r, live, part, depth_m, 1e-3 * SPEEDS[k], last);
    }
    const sonde_solid_live_counts counts = sonde_solid_live_count(live);
    printf(", \"passes\": %u, \"factors\": %u, \"skin_steps\": %u, \"kept\": %u, \"held\": %u, "
           "\"returns\": %u}",
           counts.passes, counts.factors, counts.skin_steps, counts.kept, counts.held,
           counts.returns);
    fflush(stdout);
    sonde_solid_live_destroy(live);
  }
  return status;
}

int main(int count, char **word) {
  if (count < 3) {
    fprintf(stderr, "usage: bench_live MODEL DEPTH_MM [SITE [EDGE_MM [GROWTH]]]\n");
    return 2;
  }
  static rig r;
  sonde_error error = {0};
  sonde_hexes_def mesh = sonde_hexes_def_default();
  mesh.edge_m = count > 4 ? 1e-3 * atof(word[4]) : 10e-3;
  if (count > 5) mesh.growth = atof(word[5]);
  r.def = sonde_solid_live_def_default();
  r.def.solid.rounding_m = 3e-3;
  sonde_status status = sonde_model_load(word[1], &r.model, &error);
  if (!status) status = sonde_probe_create("linear", &r.probe, &error);
  const sonde_site *site =
      status ? NULL : sonde_model_site(r.model, count > 3 ? (uint32_t)atoi(word[3]) : 27);
  if (!status && !site) {
    fprintf(stderr, "bench_live: there is no such site\n");
    return 2;
  }
  mesh.half_u_m = r.probe.half_x_m, mesh.half_v_m = r.probe.half_y_m;
  if (!status) status = sonde_hexes_ring(r.model, site, &mesh, &r.mesh, &error);
  if (!status) {
    r.start = sonde_site_pose(site, 0);
    sonde_equilibrium *e;
    uint32_t unknowns = 0, zone = 0;
    status = sonde_equilibrium_create(&r.mesh, &r.probe, r.start, &r.def.solid, &e, &error);
    if (!status) sonde_equilibrium_size(e, &unknowns, &zone);
    if (!status) sonde_equilibrium_destroy(e);
    printf("{\"hexahedra\": %u, \"unknowns\": %u, \"zone_unknowns\": %u", r.mesh.count, unknowns,
           zone);
  }
  if (!status) status = run_depth(&r, 1e-3 * atof(word[2]), &error);
  printf(", \"tick_us\": {\"median\": %.4g, \"p99\": %.4g, \"p99_9\": %.4g}, \"pass_ms\": "
         "{\"at_rest\": %.4g, \"moving\": %.4g, \"moving_p90\": %.4g, \"most\": %.4g}}\n",
         1e6 * at_share(&ticks, 0.5), 1e6 * at_share(&ticks, 0.99), 1e6 * at_share(&ticks, 0.999),
         1e3 * at_share(&rests, 0.5), 1e3 * at_share(&moves, 0.5), 1e3 * at_share(&moves, 0.9),
         1e3 * at_share(&moves, 1));
  if (status) fprintf(stderr, "bench_live: %s\n", error.message);
  sonde_hexes_clear(&r.mesh);
  sonde_probe_clear(&r.probe);
  sonde_model_destroy(r.model);
  return status ? 1 : 0;
}
