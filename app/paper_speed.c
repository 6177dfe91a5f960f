// Frames per second, the share of collision detection in them, and the cost of the distance between
// convex bodies.
#include "bench_ellipsoid.h"
#include "paper.h"
#include "pose.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { MOST_STEPS = 1000, MOST_FRAMES = 40 };

// Processor times of a press to 20 mm in 0.4 s and a hold.
typedef struct times {
  uint32_t steps, frames;
  double step_s[MOST_STEPS], frame_s[MOST_FRAMES];
  double contact_s, all_s; // sums over the steps that touch
  double over_ms;          // share of the steps beyond a millisecond
} times;

static sonde_status time_press(const paper *p, times *t, sonde_error *error) {
  const double DOWN_S = 0.4, DEPTH_M = 0.02;
  settled s = {0};
  sonde_state *state = NULL;
  sonde_echo *echo = NULL;
  sonde_image image = {0};
  sonde_pathology vein;
  sonde_echo_settings settings = sonde_echo_settings_default();
  sonde_world_def world = sonde_session_def_default().world;
  sonde_status status = settled_open(&s, p->model_path, "linear", NULL, true, error);
  if (!status) status = sonde_pathology_preset("healthy", &vein, error);
  if (!status) status = sonde_echo_create(s.interior, NULL, &echo, error);
  if (!status) status = sonde_image_create(512, 512, &image, error);
  if (!status) status = sonde_state_create(s.model, &world, &state, error);
  uint32_t every = t->steps / t->frames;
  for (uint32_t k = 0; k < t->steps && !status; ++k) {
    double down = fmin((k + 1) * world.dt_s / DOWN_S, 1);
    sonde_pose pose = sonde_site_pose(p->central, down * DEPTH_M);
    double start = app_seconds(CLOCK_THREAD_CPUTIME_ID);
    sonde_step(state, &s.probe, pose);
    t->step_s[k] = app_seconds(CLOCK_THREAD_CPUTIME_ID) - start;
    t->over_ms += (t->step_s[k] > 1e-3) / (double)t->steps;
    sonde_stage_times stage = sonde_state_times(state);
    if (sonde_state_contact(state)->region_count) {
      t->contact_s += stage.contact_s;
      t->all_s += stage.contact_s + stage.assembly_s + stage.solve_s + stage.update_s;
    }
    if (k % every || k / every >= t->frames) continue;
    const sonde_interior_input skin = {sonde_state_positions(state),
                                       sonde_state_contact_forces(state),
                                       pose,
                                       &vein,
                                       0.01,
                                       k,
                                       s.probe.half_x_m,
                                       s.probe.half_y_m,
                                       0,
                                       SONDE_POSTURE_SUPINE,
                                       NULL};
    double *best_s = &t->frame_s[k / every];
    *best_s = INFINITY; // of three: other work on the machine slows single ones
    for (int repeat = 0; repeat < 3; ++repeat) {
      start = app_seconds(CLOCK_THREAD_CPUTIME_ID);
      sonde_interior_update(s.interior, &skin);
      sonde_echo_render(echo, pose, 2 * s.probe.half_x_m, &vein, &settings, &image);
      *best_s = fmin(*best_s, app_seconds(CLOCK_THREAD_CPUTIME_ID) - start);
    }
  }
  sonde_state_destroy(state);
  sonde_echo_destroy(echo);
  sonde_image_clear(&image);
  settled_close(&s);
  return status;
}

static void judge_press(paper *p, times *t) {
  const double FRAME_S = 0.01; // the paper's 100 frames per second
  double step_s = app_quantile(t->step_s, t->steps, 0.5);
  double slow_s = app_quantile(t->step_s, t->steps, 0.99);
  double image_s = app_quantile(t->frame_s, t->frames, 0.5);
  double animation_s = FRAME_S / sonde_session_def_default().world.dt_s * step_s;
  double share = 100 * t->contact_s / t->all_s;
  uint32_t nodes = p->model->surface.vertex_count;
  paper_claim *c = paper_begin(
      p, "frames_per_second", "5",
      "The speed is in the order of 100 frames per second of animation (on an R10000).",
      "Processor time of one core: a frame of ten steps of 1 ms of the whole thigh while the flat "
      "probe is pressed to 20 mm; and the same with the echographic image of each frame.");
  paper_samples(c, t->steps, "steps");
  paper_value(c, "nodes", nodes);
  paper_value(c, "steps_per_s", 1 / step_s);
  paper_value(c, "image_ms", 1e3 * image_s);
  paper_value(c, "animation_per_s", 1 / animation_s);
  paper_value(c, "with_image_per_s", 1 / (animation_s + image_s));
  paper_say(c, 1 / animation_s >= 100 ? PAPER_HOLDS : PAPER_FAILS,
            "%u nodes: %.0f frames per second of animation. The paper's frames hold no echographic "
            "image; with one, which takes %.1f ms, %.0f.",
            nodes, 1 / animation_s, 1e3 * image_s, 1 / (animation_s + image_s));

  c = paper_begin(p, "real_time", "5",
                  "The speed lets us envisage a working simulator that operates in real time.",
                  "Time of every step of 1 ms in the same press, against the millisecond that it "
                  "simulates.");
  paper_samples(c, t->steps, "steps");
  paper_value(c, "median_ms", 1e3 * step_s);
  paper_value(c, "p99_ms", 1e3 * slow_s);
  paper_value(c, "max_ms", 1e3 * app_quantile(t->step_s, t->steps, 1));
  paper_value(c, "over_percent", 100 * t->over_ms);
  paper_say(c, slow_s < 1e-3 ? PAPER_HOLDS : PAPER_IN_PART,
            "At the 1 kHz of a haptic hand a step takes %.3f ms in the median and %.3f ms in 99 of "
            "100; %.1f %% of the steps take more than the millisecond that they have.",
            1e3 * step_s, 1e3 * slow_s, 100 * t->over_ms);

  c = paper_begin(p, "collision_expensive", "4.1",
                  "Collision detection is expensive and a potential bottleneck of every "
                  "application that aims at real time.",
                  "Share of contact detection in the steps that touch, in the same press.");
  paper_samples(c, t->steps, "steps");
  paper_value(c, "share_percent", share);
  paper_say(c,
            share >= 50   ? PAPER_HOLDS
            : share >= 20 ? PAPER_IN_PART
                          : PAPER_FAILS,
            "Contact takes %.0f %% of the step while the probe touches: candidates come from the "
            "convex probe and its last contact, and assembly and solution cost more.",
            share);
}

// ---- distance of convex bodies

static sonde_status judge_distance(paper *p, sonde_error *error) {
  static const long NODES[] = {162, 642, 2562, 10242};
  enum { SIZES = sizeof NODES / sizeof *NODES, POSES = 200 };
  double n[SIZES], work[SIZES], seconds[SIZES], mean_n = 0, mean_t = 0, mean_w = 0, nn = 0, nt = 0,
                                                nw = 0;
  paper_table *t =
      paper_table_begin(p, "distance", "Distance of two convex bodies (GJK)",
                        "vertices|vertices\nevaluations|evaluations\ntime_us|time, us");
  for (int k = 0; k < SIZES; ++k) {
    const bench_ellipsoid scene = {NODES[k], 200, 1};
    sonde_model *model = NULL;
    sonde_status status = bench_ellipsoid_build(&scene, &model, error);
    if (status) return status;
    // Without a cache a call needs no planes.
    sonde_convex body = {.hull = model->surface, .topology = model->topology};
    uint64_t evaluations = 0;
    double start = app_seconds(CLOCK_THREAD_CPUTIME_ID);
    for (int i = 0; i < POSES; ++i) {
      double angle = 0.37 * i;
      sonde_pose pose = {{0.25 * cos(angle), 0.25 * sin(angle), 0.1 * sin(2.3 * angle)},
                         {cos(0.5 * angle), sin(0.5 * angle), 0, 0}};
      evaluations +=
          sonde_gjk_distance(&body, (sonde_pose){{0, 0, 0}, {1, 0, 0, 0}}, &body, pose, NULL)
              .support_calls;
    }
    n[k] = 2.0 * body.hull.vertex_count;
    seconds[k] = (app_seconds(CLOCK_THREAD_CPUTIME_ID) - start) / POSES;
    work[k] = (double)evaluations / POSES;
    const double cells[] = {n[k], work[k], 1e6 * seconds[k]};
    char key[24];
    snprintf(key, sizeof key, "vertices_%.0f", n[k]);
    paper_row(t, key, "two ellipsoids", cells);
    sonde_model_destroy(model);
  }
  paper_caption(t->caption, sizeof t->caption,
                "Two ellipsoids apart from each other in %d poses, without a cache: support "
                "functions evaluated per call and processor time, means.",
                POSES);
  for (int k = 0; k < SIZES; ++k)
    mean_n += log(n[k]) / SIZES, mean_t += log(seconds[k]) / SIZES, mean_w += log(work[k]) / SIZES;
  for (int k = 0; k < SIZES; ++k) {
    nn += (log(n[k]) - mean_n) * (log(n[k]) - mean_n);
    nt += (log(n[k]) - mean_n) * (log(seconds[k]) - mean_t);
    nw += (log(n[k]) - mean_n) * (log(work[k]) - mean_w);
  }
  paper_claim *c = paper_begin(
      p, "distance_linear", "4.1",
      "The algorithm of Gilbert et al. finds the distance of two convex bodies in linear time "
      "O(n).",
      "Evaluations and time of our implementation, without a cache, by the number of vertices.");
  paper_samples(c, SIZES * POSES, "distances");
  paper_value(c, "work_slope", nw / nn);
  paper_value(c, "time_slope", nt / nn);
  paper_say(c, fabs(nw / nn - 1) <= 0.1 ? PAPER_HOLDS : PAPER_IN_PART,
            "Evaluations grow as n^%.2f, time as n^%.2f, from %.0f to %.0f vertices. With the last "
            "call's simplex as a start the cost no longer depends on n.",
            nw / nn, nt / nn, n[0], n[SIZES - 1]);
  return SONDE_OK;
}

sonde_status paper_speed(paper *p, sonde_error *error) {
  times *t = calloc(1, sizeof *t);
  if (!t) return error->status = SONDE_MEMORY;
  t->steps = p->quick ? 100 : MOST_STEPS, t->frames = p->quick ? 4 : MOST_FRAMES;
  sonde_status status = time_press(p, t, error);
  if (!status) judge_press(p, t);
  free(t);
  return status ? status : judge_distance(p, error);
}
