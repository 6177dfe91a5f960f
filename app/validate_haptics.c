// sonde validate haptics: every measure of the haptics room with its target, without hardware.
#include "app.h"
#include "haptics_rig.h"
#include "pose.h"
#include "validate.h"
#include "validate_list.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct options {
  const char *model, *pressing;
  long sites;
  bool json;
} options;

typedef struct work {
  const options *o;
  sonde_model *model;
  sonde_probe probe;
  sonde_state *state;
  const sonde_site *site;
  sonde_error *error;
  validate_list list;
} work;

static const sonde_vec3 ZERO = {0, 0, 0};

static sonde_vec3 minus(sonde_vec3 a, sonde_vec3 b) {
  return (sonde_vec3){a.x - b.x, a.y - b.y, a.z - b.z};
}
static double norm(sonde_vec3 a) { return sqrt(vec_dot(a, a)); }

// `most`: the target is an upper bound, else a lower one.
static void report(work *w, const char *name, double value, double target, bool most) {
  validate_note(&w->list, name, value, most ? -INFINITY : target, most ? target : INFINITY, NULL);
}

static haptics_rig_def rig_def(const work *w, const char *device) {
  return (haptics_rig_def){.model = w->model,
                           .probe = &w->probe,
                           .site = w->site,
                           .limits = sonde_device_limits_find(device),
                           .mass_kg = 0.5,
                           .damping_n_s_m = 2.0,
                           .depth_m = 0.03};
}

// Compute time of the loop with the full model. The same ticks are run some times over: what else a
// machine does lengthens one of them at random, and each tick's least time is its own.
static sonde_status full_model(work *w) {
  enum { TICKS = 3000, RUNS = 5 };
  static double spent_s[TICKS];
  uint64_t stale = 0;
  haptics_rig_def def = rig_def(w, "omega.3");
  for (int i = 0; i < TICKS; ++i) spent_s[i] = INFINITY;
  for (int run = 0; run < RUNS; ++run) {
    haptics_rig rig;
    sonde_state_reset(w->state);
    sonde_status status = haptics_rig_start(&rig, &def, w->state, w->error);
    if (status) return status;
    for (int i = 0; i < TICKS; ++i) {
      double start = app_seconds(CLOCK_THREAD_CPUTIME_ID);
      haptics_rig_tick(&rig);
      spent_s[i] = fmin(spent_s[i], app_seconds(CLOCK_THREAD_CPUTIME_ID) - start);
      stale += sonde_state_tick(w->state) != (uint64_t)i + 1;
    }
    haptics_rig_stop(&rig);
  }
  report(w, "full_model_stale_ticks", (double)stale, 0, true);
  report(w, "full_model_cpu_p999_ms", 1e3 * app_quantile(spent_s, TICKS, 0.999), 0.5, true);
  return SONDE_OK;
}

// Two Butterworth sections of second order; state in z.
static double high_pass(double z[2][2], double x, double hz) {
  assert(hz > 0 && hz < 500);
  double c = tan(3.14159265358979323846 * hz * 1e-3), n = 1.0 / (1.0 + 1.41421356 * c + c * c);
  for (int s = 0; s < 2; ++s) {
    double y = n * x + z[s][0];
    z[s][0] = -2.0 * n * x - 2.0 * (c * c - 1.0) * n * y + z[s][1];
    z[s][1] = n * x - (1.0 - 1.41421356 * c + c * c) * n * y;
    x = y;
  }
  return x;
}

// The local model fed at 100 Hz beside the full model: an answer comes every 10 ticks and is 10
// ticks old, which is what a scene of 100 Hz delivers.
static sonde_status local_model(work *w) {
  enum { TICKS = 2400, LATE = 10 };
  static const double keys_mm[][2] = {{0, -2},    {600, 15},  {900, 15}, {1200, 22},
                                      {1500, 10}, {1800, 12}, {2400, -2}};
  sonde_script_key keys[7];
  for (int i = 0; i < 7; ++i)
    keys[i] =
        (sonde_script_key){1e-3 * keys_mm[i][0], sonde_site_pose(w->site, 1e-3 * keys_mm[i][1])};
  sonde_device device;
  sonde_status status = sonde_device_script(keys, 7, 1e-3, &device, w->error);
  if (status) return status;

  sonde_local local;
  sonde_vec3 ats[LATE] = {0}, speeds[LATE] = {0}, forces[LATE] = {0}; // of the last ticks
  sonde_vec3 force_before = ZERO, model_before = ZERO, held = ZERO, at_before = ZERO;
  double worst_n = 0, largest_n = 0, jump_n = 0, square = 0, model_energy = 0, held_energy = 0;
  double model_z[2][2] = {{0}}, held_z[2][2] = {{0}};
  sonde_local_init(&local, NULL);
  sonde_state_reset(w->state);
  for (int tick = 0; tick < TICKS; ++tick) {
    // The full model's force at the pose of the script.
    sonde_device_sample sample;
    device.read(device.self, (uint64_t)tick, &sample);
    sonde_step(w->state, &w->probe, sample.world_from_probe);
    sonde_vec3 at = sample.world_from_probe.position,
               force = sonde_state_contact(w->state)->force_n;

    // The local model's, after the answer to where the probe was ten ticks ago.
    int slot = tick % LATE;
    bool answered = slot == 0 && tick >= LATE;
    if (answered) {
      held = forces[slot];
      sonde_local_feed(&local, ats[slot], speeds[slot], held);
    }
    sonde_vec3 v = minus(at, at_before);
    ats[slot] = at;
    speeds[slot] = tick ? (sonde_vec3){1e3 * v.x, 1e3 * v.y, 1e3 * v.z} : ZERO;
    forces[slot] = force;
    sonde_vec3 model = sonde_local_force(&local, at);

    // Errors, the jump at an answer beyond that of the full model, vibration above 80 Hz.
    double error = norm(minus(model, force));
    worst_n = fmax(worst_n, error);
    largest_n = fmax(largest_n, norm(force));
    square += error * error;
    double jump = norm(minus(model, model_before)) - norm(minus(force, force_before));
    if (answered) jump_n = fmax(jump_n, jump);
    double a = high_pass(model_z, norm(model), 80), b = high_pass(held_z, norm(held), 80);
    model_energy += a * a;
    held_energy += b * b;
    force_before = force;
    model_before = model;
    at_before = at;
  }
  device.destroy(device.self);
  report(w, "local_worst_error_percent", 100 * worst_n / largest_n, 5, true);
  report(w, "local_rms_error_percent", 100 * sqrt(square / TICKS) / largest_n, 5, true);
  report(w, "local_jump_n", jump_n, 0.1, true);
  report(w, "local_vibration_below_hold_db", 10 * log10(held_energy / model_energy), 20, false);
  return SONDE_OK;
}

// Swing of the hand in two windows of a press and hold.
typedef struct swing {
  double early_m, late_m, deepest_m, energy_min_j, surplus_min_j;
} swing;

static sonde_status press(work *w, const haptics_rig_def *def, swing *s) {
  haptics_rig rig;
  double low[2] = {1, 1}, high[2] = {-1, -1};
  *s = (swing){0};
  sonde_status status = haptics_rig_start(&rig, def, w->state, w->error);
  if (status) return status;
  for (int tick = 0; tick < 2500; ++tick) {
    haptics_rig_tick(&rig);
    double depth = haptics_rig_depth(&rig);
    s->deepest_m = fmax(s->deepest_m, depth);
    int window = tick >= 2100 ? 1 : tick >= 1300 && tick < 1700 ? 0 : -1;
    if (window < 0) continue;
    low[window] = fmin(low[window], depth);
    high[window] = fmax(high[window], depth);
  }
  haptics_rig_stop(&rig);
  s->early_m = high[0] - low[0];
  s->late_m = high[1] - low[1];
  s->energy_min_j = rig.render.energy_min_j;
  return SONDE_OK;
}

// A limit cycle does not decay.
static bool cycles(const swing *s) { return s->late_m > 1e-4 && s->late_m > 0.9 * s->early_m; }

// Operators of all masses and dampings with three devices: site by site with the 75 combinations in
// turn (37 is coprime to 75). Every eighth also with a scene of 100 Hz: through the local model,
// and held and rendered as it is, which has to be found unstable.
static sonde_status stability(work *w) {
  static const char *const devices[] = {"touch", "premium_1.5", "omega.3"};
  static const double masses[] = {0.1, 0.2, 0.5, 1.0, 2.0}, dampings[] = {0.0, 0.5, 1.0, 2.0, 5.0};
  uint32_t sites = w->model->site_count, wanted = (uint32_t)w->o->sites;
  if (wanted > 0 && wanted < sites) sites = wanted;
  double energy = 0.0, deepest = 1.0;
  uint32_t cases = 0, unstable = 0, slow_unstable = 0;
  uint32_t direct_cases = 0, direct_unstable = 0;
  for (uint32_t i = 0; i < sites && !app_interrupted(); ++i) {
    uint32_t k = i * 37 % 75;
    haptics_rig_def def = rig_def(w, devices[k % 3]);
    def.mass_kg = masses[k / 3 % 5];
    def.damping_n_s_m = dampings[k / 15 % 5];
    def.faultless = true;
    def.site = &w->model->sites[(uint64_t)i * w->model->site_count / sites];
    swing s;
    sonde_status status = press(w, &def, &s);
    if (status) return status;
    cases++;
    unstable += cycles(&s);
    energy = fmin(energy, s.energy_min_j);
    deepest = fmin(deepest, s.deepest_m);
    if (i % 8) continue;
    def.slow_ticks = 10;
    status = press(w, &def, &s);
    slow_unstable += cycles(&s);
    def.direct = true;
    if (!status) status = press(w, &def, &s);
    if (status) return status;
    direct_cases++;
    direct_unstable += cycles(&s);
  }
  report(w, "stability_presses", cases, 1, false);
  report(w, "stability_limit_cycles", unstable, 0, true);
  report(w, "stability_energy_min_j", energy, -1e-9, false);
  report(w, "stability_handle_depth_mm", 1e3 * deepest, 28, false);
  report(w, "at_100_hz_presses", direct_cases, 1, false);
  report(w, "at_100_hz_local_limit_cycles", slow_unstable, 0, true);
  report(w, "at_100_hz_uncontrolled_unstable", direct_unstable, 1, false);
  return SONDE_OK;
}

typedef struct chain {
  sonde_safety safety;
  sonde_render render;
  sonde_gate gate;
  sonde_safety_limits bounds;
  uint64_t random;
  int silent;
  double over_n, over_slew_n, late_n;
} chain;

static double draw(chain *c) {
  c->random = c->random * 6364136223846793005u + 1442695040888963407u;
  return (double)(c->random >> 11) * 0x1p-53;
}

static void exchange(chain *c, bool fresh, bool torn) {
  sonde_vec3 before = c->gate.force_n, sent = c->safety.force_n;
  if (torn) sent.y = NAN;
  sonde_gate_apply(&c->gate, fresh, sent, ZERO, 1e-3);
  c->silent = fresh && !torn ? 0 : c->silent + 1;
  c->over_n = fmax(c->over_n, norm(c->gate.force_n) / c->bounds.force_n);
  c->over_slew_n =
      fmax(c->over_slew_n, norm(minus(c->gate.force_n, before)) / (c->bounds.slew_n_s * 1e-3));
  if (c->silent > 50) c->late_n = fmax(c->late_n, norm(c->gate.force_n));
}

// kind: 1 stall, 2 no pose, 3 jump, 4 unplugged, 5 force that is huge or no number, 6 torn command
static void faulty_tick(chain *c, int kind, int tick) {
  sonde_vec3 at = {0, 0, -0.01 + 0.005 * sin(0.01 * tick)};
  if (kind == 3) at.x = 0.02 + 0.1 * draw(c);
  if (kind == 2 || kind == 4) sonde_safety_trip(&c->safety, SONDE_FAULT_DEVICE_LOST);
  if (kind == 2) at = c->render.device_m;
  for (int gap = kind == 1 ? 1 + (int)(200 * draw(c)) : 0; gap > 0; --gap) {
    exchange(c, false, false);
    if (c->silent * 1e-3 > c->bounds.stale_s) sonde_safety_trip(&c->safety, SONDE_FAULT_STALE);
  }
  sonde_safety_motion(&c->safety, at, 1e-3);
  sonde_vec3 tissue = {0, 0, fmax(0.0, -1000 * c->render.probe_m.z)};
  sonde_render_probe(&c->render, (sonde_pose){at, {1, 0, 0, 0}}, tissue, c->safety.force_n);
  sonde_vec3 wanted = c->render.force_n;
  if (kind == 5) wanted.y = draw(c) < 0.5 ? 1e9 : (double)NAN;
  sonde_safety_apply(&c->safety, wanted, ZERO, 1e-3);
  exchange(c, true, kind == 6);
}

typedef struct slide {
  double mean, swing; // tangential over normal force
} slide;

// Pressed to 8 mm, slid at 10 mm/s along u; what is seen over 7 mm in the middle.
static slide slide_with(work *w, const sonde_friction *friction) {
  sonde_error error;
  if (sonde_state_set_friction(w->state, friction, &error)) return (slide){NAN, NAN};
  sonde_state_reset(w->state);
  double along = 0, pressed = 0, low = INFINITY, high = -INFINITY;
  for (int tick = 0; tick < 1600; ++tick) {
    double t = 1e-3 * tick, slid_m = 0.01 * fmax(t - 0.5, 0);
    sonde_pose pose = sonde_site_pose(w->site, 0.008 * fmin(t / 0.4, 1.0));
    sonde_step(w->state, &w->probe, pose_shift(pose, slid_m, w->site->u));
    if (tick < 900) continue;
    sonde_vec3 force = sonde_state_contact(w->state)->force_n;
    double f = -vec_dot(force, w->site->u), n = vec_dot(force, w->site->normal);
    along += f;
    pressed += n;
    low = fmin(low, f / n);
    high = fmax(high, f / n);
  }
  return (slide){along / pressed, high - low};
}

static void friction(work *w) {
  sonde_friction even = {
      .mu_static = 0.4, .mu_kinetic = 0.4, .stribeck_speed_m_s = 0.01, .mu_gel = 0.05};
  sonde_friction dry = even, wet = even, slick = even;
  wet.gel_film = slick.gel_film = 4.0;
  dry.mu_static = slick.mu_static = 0.6;
  dry.mu_kinetic = slick.mu_kinetic = 0.3;
  const sonde_friction *const kinds[] = {&even, &wet};
  static const char *const names[] = {"friction_dry_error_percent", "friction_gel_error_percent"};
  for (int i = 0; i < 2; ++i) {
    double mu = sonde_friction_coefficient(kinds[i], 0.01);
    report(w, names[i], 100 * fabs(slide_with(w, kinds[i]).mean / mu - 1), 3, true);
  }
  report(w, "stick_slip_dry_swing", slide_with(w, &dry).swing, 0.1, false);
  report(w, "stick_slip_gel_swing", slide_with(w, &slick).swing, 0.02, true);
  sonde_state_set_friction(w->state, &(sonde_friction){0}, NULL);
}

// Pressed with 1 ml; wiped off while held. Both effects have to change in the tick of the wipe.
static sonde_status gel_film(work *w) {
  const sonde_friction dry = {
      .mu_static = 0.5, .mu_kinetic = 0.36, .stribeck_speed_m_s = 0.01, .mu_gel = 0.05};
  sonde_gel *gel = NULL;
  sonde_gel_def def = sonde_gel_def_default();
  sonde_status status = sonde_gel_create(w->model, &def, &gel, w->error);
  if (status) return status;
  sonde_state_reset(w->state);
  sonde_gel_put(gel, w->site->position_m, 0.03, 1e-6);
  double mu[3] = {0}, image[3] = {0}; // before the wipe, in its tick, in the next
  for (int tick = 0; tick < 1002; ++tick) {
    sonde_pose pose = sonde_site_pose(w->site, 0.006 * fmin(1e-3 * tick / 0.4, 1.0));
    sonde_step(w->state, &w->probe, pose);
    if (tick == 1000) sonde_gel_wipe(gel);
    int k = tick >= 1000 ? tick - 999 : 0;
    if (k == 0) sonde_gel_step(gel, sonde_state_contact_forces(w->state), ZERO, 1e-3);
    // Friction and coupling of the image under the film of this tick.
    const sonde_vec3 *contact = sonde_state_contact_forces(w->state);
    sonde_friction film = sonde_gel_friction(gel, contact, &dry);
    sonde_error error;
    float share;
    mu[k] = sonde_state_set_friction(w->state, &film, &error)
                ? NAN
                : sonde_friction_coefficient(&film, 0.1);
    sonde_gel_coupling(gel, sonde_state_positions(w->state), contact, &pose.position, 1, &share);
    image[k] = (double)share;
  }
  sonde_gel_destroy(gel);
  report(w, "gel_friction_with", mu[0], 0.1, true);
  report(w, "gel_friction_without_same_tick", mu[1], 0.35, false);
  report(w, "gel_image_share_with", image[0], 0.9, false);
  report(w, "gel_image_share_without_same_tick", image[1], 0.01, true);
  sonde_state_set_friction(w->state, &(sonde_friction){0}, NULL);
  return SONDE_OK;
}

// A recorded hand, lines of time and position: a third of the motion, 83 mm into a spring there, 28
// mm into a thigh here.
static sonde_status pressing(work *w) {
  enum { CAPACITY = 100000 };
  const char *path = w->o->pressing;
  sonde_script_key *keys = calloc(CAPACITY, sizeof *keys);
  FILE *file = fopen(path, "r");
  char line[1024];
  uint32_t count = 0;
  sonde_device device = {0};
  while (keys && file && count < CAPACITY && fgets(line, sizeof line, file)) {
    double t, x, y, z;
    if (sscanf(line, "%lf %lf %lf %lf", &t, &x, &y, &z) != 4) continue;
    if (count && !(t > keys[count - 1].time_s)) continue;
    keys[count++] = (sonde_script_key){t, sonde_site_pose(w->site, fmax(-y / 3, -0.03))};
  }
  sonde_status status =
      !keys       ? (w->error->status = SONDE_MEMORY)
      : !file     ? app_error(w->error, SONDE_IO, "%s cannot be read", path)
      : count < 2 ? app_error(w->error, SONDE_FORMAT,
                              "%s holds no motion, expected lines of time and position", path)
                  : sonde_device_script(keys, count, 1e-3, &device, w->error);
  if (file) fclose(file);
  if (!status) {
    haptics_rig rig;
    haptics_rig_def def = rig_def(w, "premium_1.5");
    haptics_rig_follow(&rig, &def, w->state, device);
    uint64_t ticks = (uint64_t)(keys[count - 1].time_s * 1e3);
    for (uint64_t i = 0; i < ticks && !app_interrupted(); ++i) haptics_rig_tick(&rig);
    double slew = rig.safety.limits.slew_n_s * 1e-3;
    report(w, "pressing_seconds", 1e-3 * (double)rig.tick, 10, false);
    report(w, "pressing_fault", rig.safety.fault, SONDE_FAULT_NONE, true);
    report(w, "pressing_largest_force_n", rig.max_force_n, 0.5, false);
    report(w, "pressing_step_over_slew", rig.max_step_n / slew, 0.5, true);
    report(w, "pressing_energy_min_j", rig.render.energy_min_j, -1e-6, false);
    haptics_rig_stop(&rig);
  }
  free(keys);
  return status;
}

int validate_haptics(const char *model, const char *pressing_path, long sites, bool json) {
  const options o = {model, pressing_path, sites, json};
  sonde_error error = {0};
  work w = {.o = &o, .error = &error, .list = {.json = json, .working = "haptics"}};
  sonde_world_def world = haptics_world();
  sonde_status status = sonde_limb_model_load(model, &w.model, &error);
  if (!status) status = sonde_probe_create("linear", &w.probe, &error);
  if (!status) status = sonde_state_create(w.model, &world, &w.state, &error);
  if (!status) {
    w.site = sonde_model_site(w.model, 27);
    if (!w.site) w.site = &w.model->sites[w.model->site_count / 2];
    app_catch_interrupt();
    app_progress_begin(w.list.working);
    status = full_model(&w);
    if (!status) status = local_model(&w);
    if (!status) status = stability(&w);
    if (!status) {
      int injected = 0, tick = 0, resumed = 0;
      chain c = {.random = 12345};
      const sonde_device_limits *limits = sonde_device_limits_find("touch");
      c.bounds = sonde_safety_limits_of(limits);
      sonde_render_def def = sonde_render_def_for(limits, 1e-3, 0.0);
      sonde_safety_init(&c.safety, &c.bounds);
      sonde_gate_init(&c.gate, &c.bounds);
      sonde_render_init(&c.render, &def);
      for (; injected < 5000; ++tick) {
        int kind = draw(&c) < 0.02 ? 1 + (int)(6 * draw(&c)) : 0;
        injected += kind != 0;
        faulty_tick(&c, kind, tick);
        if (c.safety.fault == SONDE_FAULT_NONE || draw(&c) > 0.05) continue;
        sonde_safety_resume(&c.safety);
        resumed++;
      }
      report(&w, "faults_injected", injected, 1000, false);
      report(&w, "faults_force_share_of_limit", c.over_n, 1 + 1e-12, true);
      report(&w, "faults_slew_share_of_limit", c.over_slew_n, 1 + 1e-9, true);
      report(&w, "faults_force_after_50_ms_n", c.late_n, 0, true);
      sonde_safety_resume(&c.safety);
      for (int i = 0; i < 300; ++i) faulty_tick(&c, 0, 0);
      report(&w, "faults_resumes", resumed, 100, false);
      report(&w, "faults_force_after_resume_n", norm(c.gate.force_n), 0.2, false);
    }
    if (!status) friction(&w);
    if (!status) status = gel_film(&w);
    if (!status && pressing_path) status = pressing(&w);
  }
  sonde_state_destroy(w.state);
  sonde_probe_clear(&w.probe);
  sonde_model_destroy(w.model);
  if (status) return app_fail("validate", &error);
  return validate_end(&w.list) ? APP_OK : APP_FAILED;
}
