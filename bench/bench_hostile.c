// bench_hostile CASES [PICTURES [SEED [OUT.csv [LEG]]]]: random presses of all cases of a
// directory, each on the legs of ten seeds, or of one, whole limbs where the case has one and
// thighs elsewhere; looks in every picture for tissue that is
// folded, that is where the map from rest to the picture does not keep orientation. PICTURES per
// leg and case (default 3) differ in site, way off it, tilt (to 20 degrees), turn, probe, speed and
// force (0 to 40 N). Half of them are taken while the probe moves, half at equilibrium of the
// vessels.
//
// The tissue that lies in the image plane is looked at in steps of 0.3 mm at rest, the scanner's
// resolution cell: two folded points side by side make a folded picture, a single one is counted.
// Blood is left out: a closed vein squeezes it flat. Exit code 1 when a picture is folded.
#include "poke.h"
#include "sonde/sonde.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double STEP_M = 0.3e-3, PROBING_M = 5e-6, AROUND_M = 6e-3, ABOVE_M = 40e-3;
static const double DEPTH_M = 50e-3, SLAB_M = 0.3e-3;
static const double MOST_N = 40, DEEPEST_M = 45e-3, TILT_RAD = 0.349, DT_S = 1e-3;
static const double CLOSE_M = 0.2e-6, LEAN_BMI = 19, LEAN_M = 5e-3;
static const sonde_vec3 unit[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
static const uint32_t FRAME_TICKS = 16, LEGS = 10;
static const char *const PROBES[] = {"linear", "square", "point"};
enum { MOST_ROWS = 320, MOST_COLUMNS = 320, INVERTED_EVERY = 97 };

typedef struct scene {
  sonde_case_setup setup;
  sonde_state *state;
  sonde_interior *interior;
  sonde_probe probe;
  sonde_pose pose;
  double force_n;
} scene;

// What one picture, or all of them, have shown.
typedef struct sight {
  uint64_t points, folded, cells; // cells: folded points with a folded neighbour
  uint64_t inverted, lost;        // inverses tried, off by more than 0.05 mm
  double least, worst_m;          // volume over that at rest; miss of an inverse
  double x_m, z_m;                // place in the picture of the least
} sight;

static sonde_vec3 add(sonde_vec3 a, double s, sonde_vec3 b) {
  return (sonde_vec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}

static double dot(sonde_vec3 a, sonde_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

static sonde_vec3 cross(sonde_vec3 a, sonde_vec3 b) {
  return (sonde_vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// Axes of the probe in the world.
static void axes_of(sonde_quat q, sonde_vec3 axis[3]) {
  const double w = q.w, x = q.x, y = q.y, z = q.z;
  axis[0] = (sonde_vec3){1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)};
  axis[1] = (sonde_vec3){2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)};
  axis[2] = (sonde_vec3){2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)};
}

static sonde_vec3 moved(const scene *s, sonde_vec3 rest) {
  return add(rest, 1, sonde_interior_displacement(s->interior, rest));
}

static bool is_solid(const scene *s, sonde_vec3 rest) {
  sonde_label label = sonde_interior_label(s->interior, rest, NULL);
  return label != SONDE_LABEL_OUTSIDE && label != SONDE_LABEL_BONE;
}

static bool is_blood(const scene *s, sonde_vec3 rest) {
  sonde_label label = sonde_interior_label(s->interior, rest, NULL);
  return label == SONDE_LABEL_VEIN || label == SONDE_LABEL_ARTERY;
}

// What three steps from a rest point span in the picture, over what they span at rest.
static double spanned(const scene *s, sonde_vec3 rest, double step_m) {
  sonde_vec3 here = moved(s, rest), slope[3];
  for (int k = 0; k < 3; ++k) slope[k] = add(moved(s, add(rest, step_m, unit[k])), -1, here);
  return dot(slope[0], cross(slope[1], slope[2])) / (step_m * step_m * step_m);
}

// Volume of the tissue at a rest point over its volume at rest; NAN beside skin and bone, where the
// map has no derivative, and in blood. Across a face between two elements differences would mix the
// derivatives of both sides: what looks folded is looked at again closer.
static double volume_at(const scene *s, sonde_vec3 rest) {
  double volume = spanned(s, rest, PROBING_M);
  if (!(volume > 0)) volume = spanned(s, rest, CLOSE_M);
  if (volume > 0) return volume;
  for (int k = 0; k < 3; ++k)
    if (!is_solid(s, add(rest, 20 * PROBING_M, unit[k])) ||
        !is_solid(s, add(rest, -20 * PROBING_M, unit[k])))
      return (double)NAN;
  return is_blood(s, rest) ? (double)NAN : volume;
}

// The rest point at x, z of the probe's frame whose tissue lies in the image plane; false when it
// is not seen. *shift: its y, first that of a neighbour.
static bool find_seen(const scene *s, const sonde_vec3 axis[3], double x, double z, double *shift,
                      sonde_vec3 *rest, double seen[3]) {
  *rest = add(add(s->pose.position, x, axis[0]), z, axis[2]);
  *rest = add(*rest, *shift, axis[1]);
  for (int pass = 0; pass < 4; ++pass) {
    sonde_vec3 way = add(moved(s, *rest), -1, s->pose.position);
    for (int k = 0; k < 3; ++k) seen[k] = dot(way, axis[k]);
    if (fabs(seen[1]) < SLAB_M) break;
    *rest = add(*rest, -seen[1], axis[1]);
    *shift -= seen[1];
  }
  if (!(fabs(seen[1]) < SLAB_M)) *shift = 0;
  bool within = fabs(seen[0]) < s->probe.half_x_m && seen[2] > 0 && seen[2] < DEPTH_M;
  return within && fabs(seen[1]) < SLAB_M && is_solid(s, *rest);
}

static void look_back(const scene *s, sonde_vec3 rest, sight *g) {
  sonde_vec3 back = add(sonde_interior_rest_point(s->interior, moved(s, rest)), -1, rest);
  double off = sqrt(dot(back, back));
  if (is_blood(s, rest)) return;
  g->inverted++, g->lost += off > 50e-6;
  g->worst_m = fmax(g->worst_m, off);
}

static sight look(const scene *s) {
  static unsigned char folded[MOST_ROWS + 1][MOST_COLUMNS + 1];
  sonde_vec3 axis[3], rest;
  sight g = {.least = INFINITY};
  const double left = s->probe.half_x_m + AROUND_M;
  memset(folded, 0, sizeof folded);
  axes_of(s->pose.rotation, axis);
  for (int j = 1; j <= MOST_ROWS && (j - 1) * STEP_M < ABOVE_M + DEPTH_M; ++j) {
    double shift = 0;
    for (int i = 1; i <= MOST_COLUMNS && (i - 1) * STEP_M < 2 * left; ++i) {
      double seen[3];
      if (!find_seen(s, axis, (i - 1) * STEP_M - left, (j - 1) * STEP_M - ABOVE_M, &shift, &rest,
                     seen))
        continue;
      double volume = volume_at(s, rest);
      if (isnan(volume)) continue;
      if (volume < g.least) g.least = volume, g.x_m = seen[0], g.z_m = seen[2];
      if (++g.points % INVERTED_EVERY == 0) look_back(s, rest, &g);
      if (volume > 0) continue;
      folded[j][i] = 1, g.folded++;
      g.cells += folded[j - 1][i] || folded[j][i - 1];
    }
  }
  return g;
}

static void update(scene *s, uint64_t tick, double dt_s) {
  sonde_interior_update(s->interior,
                        &(sonde_interior_input){sonde_state_positions(s->state),
                                                sonde_state_contact_forces(s->state), s->pose,
                                                &s->setup.pathology, dt_s, tick, s->probe.half_x_m,
                                                s->probe.half_y_m, 0, SONDE_POSTURE_SUPINE, NULL});
}

// Presses until the force is reached, at most DEEPEST_M from the site.
static void press(scene *s, poke *path, double goal_n, double speed_m_s, bool moving) {
  path->at[0] = -2e-3, path->goal[0] = DEEPEST_M;
  for (int k = 3; k < 5; ++k) path->at[k] = poke_uniform(path, -TILT_RAD, TILT_RAD) * sqrt(0.5);
  path->at[5] = poke_uniform(path, -3.1416, 3.1416);
  for (int k = 1; k < 6; ++k) path->goal[k] = path->at[k];
  path->left = (uint32_t)ceil((DEEPEST_M + 2e-3) / (speed_m_s * DT_S));
  sonde_state_reset(s->state);
  s->force_n = 0;
  const uint32_t ticks = path->left;
  for (uint32_t k = 0; k < ticks && s->force_n < goal_n; ++k) {
    s->pose = poke_next(path, 0);
    sonde_step(s->state, &s->probe, s->pose);
    sonde_vec3 f = sonde_state_contact(s->state)->force_n;
    s->force_n = sqrt(dot(f, f));
    if (moving && k % FRAME_TICKS == 0) update(s, k, k > 0 ? FRAME_TICKS * DT_S : -1);
  }
  update(s, ticks, moving ? FRAME_TICKS * DT_S : -1);
}

static void add_sight(sight *all, const sight *one) {
  all->points += one->points, all->folded += one->folded, all->cells += one->cells;
  all->inverted += one->inverted, all->lost += one->lost;
  all->least = fmin(all->least, one->least), all->worst_m = fmax(all->worst_m, one->worst_m);
}

typedef struct totals {
  sight all;
  uint64_t pictures, folded, spotted, skipped; // spotted: with a single folded point
  double most_n;
} totals;

// Neighbouring numbers give paths that have nothing in common (splitmix64).
static uint64_t mixed(uint64_t seed) {
  seed = (seed ^ seed >> 30) * 0xbf58476d1ce4e5b9u;
  seed = (seed ^ seed >> 27) * 0x94d049bb133111ebu;
  return seed ^ seed >> 31;
}

static sonde_status take(scene *s, const char *id, uint64_t leg, uint64_t seed, totals *t,
                         FILE *csv, sonde_error *error) {
  poke_def def = poke_def_default();
  poke path = poke_begin(s->setup.model, &def, mixed(seed));
  const char *probe = PROBES[(int)poke_uniform(&path, 0, 3)];
  double goal_n = poke_uniform(&path, 0, MOST_N), speed = pow(10, poke_uniform(&path, -1, 0));
  bool moving = poke_uniform(&path, 0, 1) < 0.5;
  sonde_status status = sonde_probe_create(probe, &s->probe, error);
  if (status) return status;
  press(s, &path, goal_n, speed, moving);
  bool solid = sonde_interior_used_method(s->interior) == SONDE_INTERIOR_SOLID;
  sight g = look(s);
  fprintf(csv,
          "%llu,%s,%s,%u,%.1f,%.1f,%.1f,%.3f,%d,%s,%.2f,%llu,%llu,%llu,%.4f,%.2f,%.2f,%llu,%llu,"
          "%.4f\n",
          (unsigned long long)leg, id, probe, path.site->id, path.at[3] * 57.2958,
          path.at[4] * 57.2958, path.at[5] * 57.2958, speed, moving, solid ? "solid" : "columns",
          s->force_n, (unsigned long long)g.points, (unsigned long long)g.folded,
          (unsigned long long)g.cells, g.least, g.x_m * 1e3, g.z_m * 1e3,
          (unsigned long long)g.inverted, (unsigned long long)g.lost, g.worst_m * 1e3);
  fflush(csv);
  sonde_probe_clear(&s->probe);
  add_sight(&t->all, &g);
  t->pictures++, t->folded += g.cells > 0, t->spotted += g.cells == 0 && g.folded > 0;
  t->most_n = fmax(t->most_n, s->force_n);
  return SONDE_OK;
}

// A case on the limb or the thigh of a seed, a lean one, so that the veins are pressed hard.
static sonde_status play(const sonde_case *from, uint64_t leg, long pictures, uint64_t seed,
                         totals *t, FILE *csv, sonde_error *error) {
  const sonde_world_def def = sonde_world_def_default();
  scene s = {0};
  sonde_case c = *from;
  c.seed = leg;
  if (c.thigh == SONDE_CASE_LEG)
    c.leg.bmi = LEAN_BMI;
  else
    c.thigh = SONDE_CASE_GENERATED, c.known.fat_front_m = LEAN_M;
  sonde_status status = sonde_case_build(&c, NULL, NULL, &s.setup, error);
  if (!status) status = sonde_state_create(s.setup.model, &def, &s.state, error);
  if (!status) status = sonde_interior_create(s.setup.model, &s.interior, error);
  if (!status) status = sonde_interior_set_findings(s.interior, &s.setup.findings, error);
  for (long k = 0; k < pictures && !status; ++k)
    status = take(&s, c.id, leg, seed + (uint64_t)k, t, csv, error);
  sonde_interior_destroy(s.interior);
  sonde_state_destroy(s.state);
  sonde_case_setup_clear(&s.setup);
  return status;
}

static int tell(const totals *t) {
  const sight *a = &t->all;
  printf("%llu pictures, force to %.1f N: %llu folded, %llu with single folded points\n",
         (unsigned long long)t->pictures, t->most_n, (unsigned long long)t->folded,
         (unsigned long long)t->spotted);
  printf("%llu of %llu points folded, least volume %.4f of that at rest\n",
         (unsigned long long)a->folded, (unsigned long long)a->points, a->least);
  printf("%llu of %llu inverses off by more than 0.05 mm, worst %.3g mm\n",
         (unsigned long long)a->lost, (unsigned long long)a->inverted, a->worst_m * 1e3);
  printf("%llu cases did not fit their leg\n", (unsigned long long)t->skipped);
  return t->folded > 0 || t->pictures == 0;
}

int main(int argc, char **argv) {
  long pictures = argc > 2 ? atol(argv[2]) : 3;
  uint64_t only = argc > 5 ? strtoull(argv[5], NULL, 10) : 0;
  if (argc < 2 || argc > 6 || pictures < 1 || only > LEGS) {
    fprintf(stderr, "usage: bench_hostile CASES [PICTURES [SEED [OUT.csv [LEG]]]], LEG 1 to 10\n");
    return 2;
  }
  uint64_t seed = argc > 3 ? strtoull(argv[3], NULL, 10) : 1;
  FILE *csv = fopen(argc > 4 ? argv[4] : "/dev/null", "w");
  sonde_error error = {0};
  sonde_case *cases = NULL;
  uint32_t count = 0;
  totals t = {.all.least = INFINITY};
  if (csv == NULL || sonde_case_list(argv[1], &cases, &count, &error)) {
    fprintf(stderr, "%s\n", csv ? error.message : "cannot write the table");
    return 2;
  }
  fprintf(csv, "leg,case,probe,site,tilt_u_deg,tilt_v_deg,turn_deg,speed_m_s,moving,method,force_n,"
               "points,folded,adjacent,least_volume,x_mm,z_mm,inverses,lost,worst_mm\n");
  for (uint64_t leg = 1; leg <= LEGS; ++leg)
    for (uint32_t k = 0; k < count && (only == 0 || leg == only); ++k) {
      uint64_t first = ((seed * LEGS + leg) * count + k) * (uint64_t)pictures;
      if (!play(&cases[k], leg, pictures, first, &t, csv, &error)) continue;
      t.skipped++,
          printf("%s on leg %llu: %s\n", cases[k].id, (unsigned long long)leg, error.message);
    }
  sonde_free(cases);
  return fclose(csv) == 0 ? tell(&t) : 2;
}
