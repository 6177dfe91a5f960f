// sonde identify: damping and friction from records of a moving probe, or such records made by the
// virtual robot.
#include "options.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const char VERB[] = "identify";

typedef struct options {
  const char *model, *ramp_hold, *slide, *output, *probe, *preset;
  long site;          // -1: none
  int simulate, axis; // a kind of protocol, -1: none; u or v
  double depth_m, force_n, speed_m_s, slide_m, hold_s, rate_hz; // NaN: as the protocol has it
  double noise_n, noise_m;
  long seed;
  uint32_t threads;
  bool json;
} options;

static const options DEFAULTS = {.site = -1,
                                 .simulate = -1,
                                 .depth_m = NAN,
                                 .force_n = NAN,
                                 .speed_m_s = NAN,
                                 .slide_m = NAN,
                                 .hold_s = NAN,
                                 .rate_hz = NAN,
                                 .seed = 1};

static const char *const KINDS[] = {"ramp-hold", "slide", NULL}, *const AXES[] = {"u", "v", NULL};

static const app_option TABLE[] = {
    OPT_ARGUMENT(model, "MODEL", "the model file"),
    OPT_TEXT(ramp_hold, "ramp-hold", "CSV",
             "record of ramps and holds with the columns "
             "time_s,penetration_mm,slide_mm,normal_n,tangential_n"),
    OPT_TEXT(slide, "slide", "CSV", "record of slides, the same columns"),
    OPT_OUTPUT(output, "o,output", "FILE", "preset (JSON) or record (CSV) to write"),
    OPT_INTEGER(site, "site", "K", 0, 1000000,
                "site of records that do not name one; site of the robot"),
    OPT_TEXT(probe, "probe", "NAME|FILE", "the same for the probe; default linear"),
    OPT_TEXT(preset, "preset", "FILE",
             "damping, stiffness and friction to start from and to simulate with"),
    OPT_INTEGER(threads, "threads", "N", 1, 64,
                "threads; the result does not depend on them; default: one per core"),
    OPT_JSON(json),
    OPT_GROUP("With --simulate"),
    OPT_WORD(simulate, "simulate", "KIND", KINDS, "make such a record"),
    OPT_REAL(depth_m, "depth-mm", "D", 0.1, 60, 1e-3,
             "how deep; default 12 (ramp-hold), 5 (slide)"),
    OPT_REAL(force_n, "force-n", "F", 0.01, 200, 1, "press to this static force instead"),
    OPT_REAL(speed_m_s, "speed-mm-s", "V", 1, 1000, 1e-3,
             "one speed instead of 20, 40, 80 (ramp-hold) or 10, 20, 60 (slide)"),
    OPT_WORD(axis, "axis", "A", AXES, "u around the leg or v along it"),
    OPT_REAL(slide_m, "slide-mm", "L", 1, 100, 1e-3, "length of a slide; default 12"),
    OPT_REAL(hold_s, "hold-s", "T", 0.02, 60, 1,
             "hold and pause; default 0.2 (ramp-hold), 0.1 (slide)"),
    OPT_REAL(rate_hz, "rate-hz", "R", 50, 1000, 1, "samples per second; default 1000"),
    OPT_REAL(noise_n, "noise-n", "S", 0, 100, 1, "standard deviation of the force sensors"),
    OPT_REAL(noise_m, "noise-mm", "S", 0, 10, 1e-3, "standard deviation of the position sensors"),
    OPT_INTEGER(seed, "seed", "K", 0, 2147483647, "of the noise")};

static int check(void *from) {
  const options *a = from;
  if (a->simulate < 0)
    return a->ramp_hold || a->slide
               ? APP_OK
               : app_usage_error(VERB, "give --ramp-hold CSV, --slide CSV, or --simulate KIND");
  if (a->ramp_hold || a->slide)
    return app_usage_error(VERB, "--simulate makes a record and reads none");
  if (a->site < 0) return app_usage_error(VERB, "--site is missing");
  return a->output ? APP_OK : app_usage_error(VERB, "-o CSV is missing");
}

static void replace(double *value, double asked) {
  if (!isnan(asked)) *value = asked;
}

static int simulate(const options *a, const sonde_model *model, const sonde_world_def *world) {
  assert(a->simulate >= 0 && a->site >= 0);
  sonde_protocol p = sonde_protocol_default((sonde_protocol_kind)a->simulate);
  p.site = (uint32_t)a->site;
  if (a->probe) p.probe = a->probe;
  p.axis = AXES[a->axis][0];
  replace(&p.depth_m, a->depth_m);
  replace(&p.force_n, a->force_n);
  replace(&p.slide_m, a->slide_m);
  replace(&p.hold_s, a->hold_s);
  replace(&p.rate_hz, a->rate_hz);
  p.noise_force_n = a->noise_n;
  p.noise_position_m = a->noise_m;
  p.seed = (uint64_t)a->seed;
  replace(&p.speed_m_s[0], a->speed_m_s);
  if (!isnan(a->speed_m_s)) p.speed_count = 1;

  sonde_motion_record record;
  sonde_error error = {0};
  double start = app_seconds(CLOCK_MONOTONIC), most_n = 0, across_n = 0;
  sonde_progress progress = app_progress();
  if (sonde_protocol_run(model, world, &p, &progress, &record, &error))
    return app_fail(VERB, &error);
  app_progress_end();
  for (uint32_t k = 0; k < record.count; ++k) {
    most_n = fmax(most_n, record.samples[k].normal_n);
    across_n = fmax(across_n, fabs(record.samples[k].tangential_n));
  }
  uint32_t samples = record.count;
  double length_s = samples ? record.samples[samples - 1].time_s : 0;
  sonde_status status = sonde_motion_record_save(a->output, &record, &error);
  sonde_motion_record_clear(&record);
  if (status) return app_fail(VERB, &error);
  if (!a->json) {
    printf("wrote %s: %u samples of %.2f s, at most %.2f N normal, %.2f N tangential (synthetic)\n",
           a->output, samples, length_s, most_n, across_n);
    return APP_OK;
  }
  app_json_begin();
  app_json("file:%s samples:%u length_s:%g normal_max_n:%g tangential_max_n:%g seconds:%g",
           a->output, samples, length_s, most_n, across_n, app_seconds(CLOCK_MONOTONIC) - start);
  app_json_end();
  return APP_OK;
}

// What was found; `has` tells which records were given.
typedef struct findings {
  bool has_damping, has_friction;
  sonde_damping_result damping;
  sonde_friction_result friction;
  sonde_relaxation hold[SONDE_HOLDS];
  sonde_slide slide[SONDE_HOLDS];
  uint32_t holds, slides;
  sonde_preset preset;
  double seconds;
} findings;

static sonde_status read_record(const options *a, const char *path, sonde_protocol_kind kind,
                                sonde_motion_record *record, sonde_error *error) {
  sonde_status status = sonde_motion_record_load(path, record, error);
  if (status) return status;
  if (record->site == UINT32_MAX && a->site >= 0) record->site = (uint32_t)a->site;
  if (!record->probe[0])
    snprintf(record->probe, sizeof record->probe, "%s", a->probe ? a->probe : "linear");
  record->protocol = kind;
  if (record->site != UINT32_MAX) return SONDE_OK;
  sonde_motion_record_clear(record);
  return app_error(error, SONDE_FORMAT,
                   "%.400s: does not name its site ('# site: K'), expected it there or as --site K",
                   path);
}

static sonde_status find_damping(const options *a, const sonde_model *model,
                                 const sonde_identify_options *solver, findings *found,
                                 sonde_error *error) {
  sonde_motion_record record;
  sonde_progress progress = app_progress();
  sonde_status status = read_record(a, a->ramp_hold, SONDE_PROTOCOL_RAMP_HOLD, &record, error);
  if (status) return status;
  sonde_relaxation_read(&record, found->hold, &found->holds, NULL); // none: ramps alone do as well
  status = sonde_identify_damping(model, &record, 1, solver, &progress, &found->damping, error);
  sonde_motion_record_clear(&record);
  app_progress_end();
  if (status) return status;
  found->has_damping = true;
  found->preset.normal_damping_s = found->damping.normal_damping_s.value;
  found->preset.edge_damping_s = found->damping.edge_damping_s.value;
  found->preset.damping_multiplier = 1;
  found->preset.stiffness_scale *= found->damping.stiffness_scale.value;
  return SONDE_OK;
}

static sonde_status find_friction(const options *a, const sonde_model *model,
                                  const sonde_identify_options *solver, findings *found,
                                  sonde_error *error) {
  sonde_motion_record record;
  sonde_progress progress = app_progress();
  sonde_status status = read_record(a, a->slide, SONDE_PROTOCOL_SLIDE, &record, error);
  if (status) return status;
  status = sonde_slide_read(&record, found->slide, &found->slides, error);
  if (!status)
    status = sonde_identify_friction(model, &record, 1, solver, &progress, &found->friction, error);
  sonde_motion_record_clear(&record);
  app_progress_end();
  if (status) return status;
  found->has_friction = true;

  // Dry coefficients that give the measured ones under the record's film.
  const sonde_friction_result *r = &found->friction;
  sonde_friction *f = &found->preset.friction;
  double clear = exp(r->gel_film);
  f->gel_film = r->gel_film;
  f->mu_kinetic = fmax(0, f->mu_gel + (r->mu_kinetic.value - f->mu_gel) * clear);
  f->mu_static = f->mu_gel + (r->mu_static.value - f->mu_gel) * clear;
  f->mu_static = fmax(f->mu_kinetic, f->mu_static);
  f->stribeck_speed_m_s = r->stribeck_speed_m_s.value;
  return SONDE_OK;
}

static void print_estimate(const char *name, const char *unit, double scale,
                           const sonde_estimate *e) {
  assert(scale > 0);
  printf("  %-18s %9.4g %-5s 95 %%: %.4g to %.4g%s\n", name, scale * e->value, unit, scale * e->low,
         scale * e->high, e->identified ? "" : "  (not determined)");
}

static void json_estimate(const char *key, double scale, const sonde_estimate *e) {
  assert(scale > 0);
  app_json_object(key);
  app_json("value:%g low:%g high:%g identified:%hhd", scale * e->value, scale * e->low,
           scale * e->high, e->identified);
  app_json_close();
}

static int identify(const options *a, const sonde_model *model, const sonde_preset *preset) {
  sonde_identify_options solver = sonde_identify_options_default();
  solver.threads = a->threads;
  findings found = {.preset = *preset};
  sonde_error error = {0};
  sonde_status status = SONDE_OK;
  double start = app_seconds(CLOCK_MONOTONIC);
  snprintf(found.preset.name, sizeof found.preset.name, "identified");
  if (a->ramp_hold) status = find_damping(a, model, &solver, &found, &error);
  if (!status && a->slide) status = find_friction(a, model, &solver, &found, &error);
  if (!status && a->output) status = sonde_preset_save(a->output, &found.preset, &error);
  if (status) return app_fail(VERB, &error);
  found.seconds = app_seconds(CLOCK_MONOTONIC) - start;
  if (a->json) {
    app_json_begin();
    if (found.has_damping) {
      app_json_object("damping");
      json_estimate("normal_damping_ms", 1e3, &found.damping.normal_damping_s);
      json_estimate("stiffness_scale", 1, &found.damping.stiffness_scale);
      json_estimate("edge_damping_ms", 1e3, &found.damping.edge_damping_s);
      app_json(
          "edge_sensitivity_n:%g residual_n:%g peak_n:%g static_n:%g relaxation_s:%g samples:%u "
          "simulations:%u",
          found.damping.edge_sensitivity_n, found.damping.residual_n, found.hold[0].peak_n,
          found.hold[0].static_n, found.hold[0].relaxation_s, found.damping.samples,
          found.damping.simulations);
      app_json_close();
    }
    if (found.has_friction) {
      app_json_object("friction");
      json_estimate("mu_static", 1, &found.friction.mu_static);
      json_estimate("mu_kinetic", 1, &found.friction.mu_kinetic);
      json_estimate("stribeck_speed_mm_s", 1e3, &found.friction.stribeck_speed_m_s);
      app_json("gel_film:%g residual_n:%g samples:%u simulations:%u", found.friction.gel_film,
               found.friction.residual_n, found.friction.samples, found.friction.simulations);
      app_json_close();
    }
    if (a->output) app_json_text("preset", a->output);
    app_json_real("seconds", found.seconds);
    app_json_end();
  } else {
    for (uint32_t k = 0; k < found.holds; ++k)
      printf("hold at %.2f mm after %.1f mm/s: %.3f N to %.3f N (ratio %.3f), relaxation %.3g s\n",
             1e3 * found.hold[k].depth_m, 1e3 * found.hold[k].speed_m_s, found.hold[k].peak_n,
             found.hold[k].static_n, found.hold[k].ratio, found.hold[k].relaxation_s);
    if (found.has_damping) {
      printf("damping: %u samples, residual %.4f N\n", found.damping.samples,
             found.damping.residual_n);
      print_estimate("normal damping", "ms", 1e3, &found.damping.normal_damping_s);
      print_estimate("stiffness scale", "", 1, &found.damping.stiffness_scale);
      print_estimate("edge damping", "ms", 1e3, &found.damping.edge_damping_s);
    }
    for (uint32_t k = 0; k < found.slides; ++k)
      printf("slide at %.1f mm/s: ratio %.4f, breakaway %.4f (%u moves)\n",
             1e3 * found.slide[k].speed_m_s, found.slide[k].ratio, found.slide[k].breakaway,
             found.slide[k].moves);
    if (found.has_friction) {
      printf("friction: %u samples, residual %.4f N\n", found.friction.samples,
             found.friction.residual_n);
      print_estimate("static", "", 1, &found.friction.mu_static);
      print_estimate("kinetic", "", 1, &found.friction.mu_kinetic);
      print_estimate("Stribeck speed", "mm/s", 1e3, &found.friction.stribeck_speed_m_s);
    }
    if (a->output) printf("wrote %s\n", a->output);
  }
  return APP_OK;
}

static int run(void *from) {
  const options *a = from;
  assert(a->model);
  sonde_preset preset = sonde_preset_default();
  sonde_world_def world = sonde_identify_world();
  sonde_error error = {0};
  sonde_model *model = NULL;
  sonde_status status = a->preset ? sonde_preset_load(a->preset, &preset, &error) : SONDE_OK;
  if (!status) status = sonde_limb_model_load(a->model, &model, &error);
  if (!status) status = sonde_preset_apply(&preset, model, &world, &error);
  int code = status             ? app_fail(VERB, &error)
             : a->simulate >= 0 ? simulate(a, model, &world)
                                : identify(a, model, &preset);
  sonde_model_destroy(model);
  return code;
}

const app_command cmd_identify = {
    .verb = "identify",
    .summary = "find damping and friction from records of a moving probe",
    .usage = "MODEL [--ramp-hold CSV] [--slide CSV] [-o PRESET] [options]\n"
             "MODEL --simulate KIND --site K -o CSV [options]",
    .text = "Finds damping and stiffness from ramp-and-hold records and friction from slides, by "
            "forward simulations of the model along the recorded motion, and writes them as a "
            "preset for sonde-run(1) and sonde-press(1). With --simulate the virtual robot makes a "
            "record; it is marked as synthetic.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .defaults = &DEFAULTS,
    .required = "MODEL",
    .check = check,
    .run = run};
