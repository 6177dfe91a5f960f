// Contact by penalty (eq. (2)) against contact by impulse: a ball that meets the thigh, and the
// impulse of two bodies in an instant as a reference; and the common volume of two meshes.
#include "paper.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Velocities after an instantaneous collision along one line, with restitution e: momentum is kept,
// the relative speed is turned and multiplied by e.
static void impulse_collide(const double mass_kg[2], const double before_m_s[2], double e,
                            double after_m_s[2]) {
  assert(mass_kg[0] > 0 && mass_kg[1] > 0 && e >= 0);
  double reduced = mass_kg[0] * mass_kg[1] / (mass_kg[0] + mass_kg[1]);
  double impulse = reduced * (1 + e) * (before_m_s[1] - before_m_s[0]);
  after_m_s[0] = before_m_s[0] + impulse / mass_kg[0];
  after_m_s[1] = before_m_s[1] - impulse / mass_kg[1];
}

// What a drop showed.
typedef struct drop {
  double dt_s, mass_kg, contact_s, peak_n, deepest_m;
  double before_m_s, after_m_s; // of the ball along the fall
  double most_gain_j;           // largest gain of the energy of all in a step
  double fall_j, rebound_j;     // kinetic energy of the ball before and after
  uint32_t contact_steps;
  bool ended; // the ball left the skin
  uint64_t flags;
} drop;

static const char SCENE[] =
    "# A ball meets the front of the thigh, without gravity; written by sonde paper, for sonde "
    "simulate.\n"
    "sonde_scene: 1\ntitle: A ball meets the thigh\nduration_s: 0.12\n"
    "step: {dt_s: %g, newton: 4}\nmaterials:\n"
    "- {name: skin, contact_stiffness_n_m3: 5e7, contact_damping_s: 2e-3}\nbodies:\n"
    "- {name: thigh, kind: two_layer, model: thigh, material: skin}\n"
    "- {name: ball, shape: {sphere_mm: 20, edge_mm: 5}, density_kg_m3: 1800, material: skin,\n"
    "   position_mm: [105, 0, 150], velocity_m_s: [-1, 0, 0]}\n";

static sonde_status run_drop(const paper *p, double dt_s, double end_s, drop *d,
                             sonde_error *error) {
  char path[1200];
  sonde_scene *scene = NULL;
  sonde_scene_state *state = NULL;
  sonde_file *file = NULL;
  paper_path(p, "drop.yaml", path, sizeof path);
  sonde_status status = sonde_file_create(path, &file, error);
  if (!status) {
    sonde_file_printf(file, SCENE, dt_s);
    status = sonde_file_commit(file, error);
  }
  if (!status) status = sonde_scene_load(path, p->model_path, &scene, error);
  if (!status) status = sonde_scene_state_create(scene, &state, error);
  *d = (drop){.dt_s = dt_s};
  double energy = NAN, last_m_s = -1, start_m = NAN;
  bool touched = false;
  while (!status && sonde_scene_time(state) < end_s && !d->ended) {
    sonde_scene_advance(state);
    sonde_body_measure thigh = sonde_scene_measure(state, 0), ball = sonde_scene_measure(state, 1);
    sonde_pair_measure pair = sonde_scene_pair_measure(state, 0);
    double force_n = pair.normal_n, speed = ball.velocity_m_s.x;
    double all = thigh.kinetic_j + thigh.elastic_j + ball.kinetic_j + pair.energy_j;
    d->mass_kg = sonde_scene_body(scene, 1).mass.mass_kg;
    if (isfinite(energy)) d->most_gain_j = fmax(d->most_gain_j, all - energy);
    energy = all;
    if (force_n > 0 && !touched) d->before_m_s = last_m_s, touched = true;
    if (force_n > 0) d->contact_steps++, d->contact_s += dt_s;
    d->peak_n = fmax(d->peak_n, force_n);
    d->ended = touched && force_n <= 0;
    if (touched) d->after_m_s = speed;
    if (!touched) start_m = ball.centre_m.x;
    d->deepest_m = fmax(d->deepest_m, start_m - ball.centre_m.x);
    last_m_s = speed;
  }
  if (!status) d->flags = sonde_scene_flag_count(state);
  d->fall_j = 0.5 * d->mass_kg * d->before_m_s * d->before_m_s;
  d->rebound_j = 0.5 * d->mass_kg * d->after_m_s * d->after_m_s;
  sonde_scene_state_destroy(state);
  sonde_scene_destroy(scene);
  return status;
}

// The drops at halved steps of time, a row each.
static sonde_status measure(paper *p, paper_table *t, drop *drops, uint32_t count, double dt_s,
                            sonde_error *error) {
  const double END_S = 0.12;
  for (uint32_t k = 0; k < count; ++k, dt_s /= 2) {
    drop *d = &drops[k];
    p->progress.report((double)k / count, "dropping a ball", p->progress.user);
    sonde_status status = run_drop(p, dt_s, END_S, d, error);
    if (status) return status;
    double e = fmax(-d->after_m_s / d->before_m_s, 0);
    // By impulse the whole change of velocity falls into one step.
    const double mass[2] = {d->mass_kg, 1e12}, before[2] = {d->before_m_s, 0};
    double after[2];
    impulse_collide(mass, before, e, after);
    const double cells[] = {1e3 * dt_s,
                            1e3 * d->contact_s,
                            d->contact_steps,
                            d->peak_n,
                            d->mass_kg * (after[0] - before[0]) / dt_s,
                            e,
                            1e3 * d->deepest_m};
    char key[24], name[40];
    snprintf(key, sizeof key, "step_%u", k + 1);
    snprintf(name, sizeof name, "ball of %.0f g at %.2f m/s", 1e3 * d->mass_kg, -d->before_m_s);
    paper_row(t, key, name, cells);
  }
  return SONDE_OK;
}

// ---- common volume of two meshes

static const char BALLS[] =
    "# Two balls that overlap; written by sonde paper, for sonde simulate.\n"
    "sonde_scene: 1\ntitle: Two balls\nstep: {dt_s: 1e-7, cast: false}\nmaterials:\n"
    "- {name: skin, contact_stiffness_n_m3: 1e6, contact_damping_s: 0}\nbodies:\n"
    "- {name: low, shape: {sphere_mm: 30, edge_mm: %g}, density_kg_m3: 1000, material: skin}\n"
    "- {name: high, shape: {sphere_mm: 30, edge_mm: %g}, density_kg_m3: 1000, material: skin,\n"
    "   position_mm: [0, 0, %g]}\n";

// Two balls of a size of mesh.
typedef struct lens {
  double faces, volume_m3;
  double tests;  // of boxes and faces, in a step
  double time_s; // least of some steps
} lens;

static sonde_status overlap(const paper *p, double edge_mm, double apart_mm, lens *l,
                            sonde_error *error) {
  enum { STEPS = 12 };
  char path[1200];
  sonde_file *file = NULL;
  sonde_scene *scene = NULL;
  sonde_scene_state *state = NULL;
  paper_path(p, "balls.yaml", path, sizeof path);
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  sonde_file_printf(file, BALLS, edge_mm, edge_mm, apart_mm);
  status = sonde_file_commit(file, error);
  if (!status) status = sonde_scene_load(path, NULL, &scene, error);
  if (!status) status = sonde_scene_state_create(scene, &state, error);
  l->time_s = INFINITY;
  for (int k = 0; k < STEPS && !status; ++k) {
    sonde_scene_advance(state);
    l->time_s = fmin(l->time_s, sonde_scene_last(state).contact_s);
    l->tests = (double)sonde_scene_last(state).contact_tests;
  }
  if (!status) {
    l->faces = 2.0 * sonde_scene_body(scene, 0).surface->face_count;
    l->volume_m3 = sonde_scene_pair_measure(state, 0).volume_m3;
  }
  sonde_scene_state_destroy(state);
  sonde_scene_destroy(scene);
  return status;
}

static sonde_status judge_volume(paper *p, sonde_error *error) {
  static const double EDGE_MM[] = {6, 3, 1.5, 0.75};
  enum { SIZES = sizeof EDGE_MM / sizeof *EDGE_MM };
  const double PI = 3.14159265358979, RADIUS_M = 0.03, APART_M = 0.054;
  // The lens that two balls of one radius have in common.
  double depth_m = 2 * RADIUS_M - APART_M;
  double exact_m3 = PI * depth_m * depth_m * (APART_M + 4 * RADIUS_M) / 12;
  uint32_t count = p->quick ? SIZES - 1 : SIZES;
  lens size[SIZES];
  paper_table *t =
      paper_table_begin(p, "volume", "Common volume of two meshes",
                        "faces|faces\nvolume_mm3|volume, mm\u00b3\nerror_percent|error, "
                        "%\ntests|comparisons\ntime_us|time, us");
  for (uint32_t k = 0; k < count; ++k) {
    lens *l = &size[k];
    sonde_status status = overlap(p, EDGE_MM[k], 1e3 * APART_M, l, error);
    if (status) return status;
    double off = 100 * (l->volume_m3 / exact_m3 - 1);
    const double cells[] = {l->faces, 1e9 * l->volume_m3, off, l->tests, 1e6 * l->time_s};
    char key[24];
    snprintf(key, sizeof key, "size_%u", k + 1);
    paper_row(t, key, "two balls", cells);
  }
  paper_caption(
      t->caption, sizeof t->caption,
      "Two balls of 30 mm radius, 54 mm apart, by any-mesh contact (balls.yaml). Error "
      "against the lens of two true balls, %.0f mm\u00b3, which the meshes approach as they "
      "grow finer. Comparisons are pairs of boxes and of faces in a step; time is the "
      "least of contact detection.",
      1e9 * exact_m3);
  const lens *coarse = &size[0], *fine = &size[count - 1];
  double decades = log(fine->faces / coarse->faces);
  double work_slope = log(fine->tests / coarse->tests) / decades;
  double time_slope = log(fine->time_s / coarse->time_s) / decades;
  double off = 100 * fabs(fine->volume_m3 / exact_m3 - 1);
  paper_claim *c = paper_begin(
      p, "contact_linear", "4.1",
      "Of two deformable, concave objects the points of contact, its direction and the volume of "
      "interpenetration are found in linear time.",
      "Common volume of two meshes by the contact of scenes, which asks for no convexity, against "
      "the exact volume; comparisons and time by the number of faces.");
  paper_samples(c, count, "sizes");
  paper_value(c, "volume_error_percent", off);
  paper_value(c, "work_slope", work_slope);
  paper_value(c, "time_slope", time_slope);
  paper_value(c, "faces", fine->faces);
  paper_say(
      c, off < 1 && work_slope <= 1.15 ? PAPER_HOLDS : PAPER_IN_PART,
      "The volume is off by %.2f %% with %.0f faces; comparisons grow as n^%.2f, time as n^%.2f, "
      "from %.0f faces on, since trees of boxes leave out what does not touch.",
      off, fine->faces, work_slope, time_slope, coarse->faces);
  return SONDE_OK;
}

sonde_status paper_collision(paper *p, sonde_error *error) {
  enum { MOST = 3 };
  uint32_t count = p->quick ? 2 : MOST;
  drop d[MOST];
  paper_table *t = paper_table_begin(
      p, "contact", "A ball meets the thigh: penalty against impulse",
      "dt_ms|step, ms\nduration_ms|contact, ms\nsteps|contact, steps\npeak_n|largest force, N\n"
      "impulse_peak_n|by impulse, N\nrestitution|speed out / in\ndepth_mm|depth, mm");
  sonde_status status = measure(p, t, d, count, p->quick ? 2e-3 : 1e-3, error);
  if (status) return status;

  // The reference with two bodies: the ball meets the masses of skin that it touches first.
  const drop *fine = &d[count - 1];
  double skin_kg = 0;
  for (uint32_t i = 0; i < p->model->surface.vertex_count; ++i) {
    sonde_vec3 x = p->model->surface.vertices[i];
    if (hypot(x.y, x.z - 0.150) < 5e-3 && x.x > 0) skin_kg += p->model->mass_kg[i];
  }
  const double mass[2] = {fine->mass_kg, fmax(skin_kg, 1e-6)}, before[2] = {fine->before_m_s, 0};
  double after[2];
  impulse_collide(mass, before, 1, after);
  double momentum = mass[0] * (after[0] - before[0]) + mass[1] * (after[1] - before[1]);
  double energy =
      0.5 * (mass[0] * after[0] * after[0] + mass[1] * after[1] * after[1]) - fine->fall_j;
  paper_caption(t->caption, sizeof t->caption,
                "A rigid ball meets the front of the synthetic thigh (drop.yaml), by the contact "
                "law of foundation, at three steps of time. The force by impulse is the one that "
                "turns the same speed within one step: it has no limit as the step shrinks.");
  paper_claim *c =
      paper_begin(p, "penalty_suits", "4.1, eq. (2)",
                  "For deformable objects the penalty method suits best: impulses assume that a "
                  "collision takes "
                  "no time.",
                  "A rigid ball thrown at the thigh with the penalty, at halved time steps; the "
                  "impulse law as "
                  "a reference, with the ball's own restitution and with the skin's masses.");
  paper_samples(c, count, "time steps");
  paper_value(c, "contact_ms", 1e3 * fine->contact_s);
  paper_value(c, "contact_steps", fine->contact_steps);
  paper_value(c, "contact_change_percent",
              100 * fabs(fine->contact_s / d[count - 2].contact_s - 1));
  paper_value(c, "peak_change_percent", 100 * fabs(fine->peak_n / d[count - 2].peak_n - 1));
  paper_value(c, "restitution", -fine->after_m_s / fine->before_m_s);
  paper_value(c, "energy_kept", fine->rebound_j / fine->fall_j);
  paper_value(c, "energy_gain_j", fine->most_gain_j);
  paper_value(c, "impulse_momentum_error", momentum / (mass[0] * fabs(before[0])));
  paper_value(c, "impulse_energy_error", energy / fine->fall_j);
  paper_value(c, "impulse_first_speed", after[0] / before[0]);
  paper_value(c, "skin_mass_g", 1e3 * skin_kg);
  bool finite = fine->contact_steps > 1 && fine->contact_s > 5e-3;
  paper_say(
      c, finite ? PAPER_HOLDS : PAPER_FAILS,
      "The ball stays in contact for %.0f ms (%u steps%s), goes %.0f mm deep and leaves with %.0f "
      "%% of its energy; the largest force tends to %.1f N as the step shrinks. One impulse "
      "against the %.1f g of skin that it meets takes %.0f %% of its speed: contact would have "
      "to be many impulses, and the force of one in a step has no limit.",
      1e3 * fine->contact_s, fine->contact_steps, fine->ended ? "" : ", still touching at the end",
      1e3 * fine->deepest_m, 100 * fine->rebound_j / fine->fall_j, fine->peak_n, 1e3 * skin_kg,
      100 * (1 - after[0] / before[0]));
  return judge_volume(p, error);
}
