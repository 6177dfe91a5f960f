// sonde identify: damping and friction from records of a moving probe, or such records made by the
// virtual robot.
//
// parse_arguments   the command line
// make_protocol     what the robot shall do
// simulate          a record of the virtual robot
// read_records      records of one kind, completed by --site and --probe
// identify          damping, then friction, then the preset
// print_result      as text or JSON
#include "fit_common.h"

#include <math.h>
#include <stdlib.h>

static const char VERB[] = "identify";
static const char HELP[] =
    "usage: sonde identify MODEL [--ramp-hold CSV] [--slide CSV] [-o PRESET] [options]\n"
    "       sonde identify MODEL --simulate KIND --site K -o CSV [options]\n"
    "\n"
    "Finds damping and stiffness from ramp-and-hold records and friction from slides, by forward\n"
    "simulations of the model along the recorded motion, and writes them as a preset for\n"
    "`sonde run` and `sonde press`. With --simulate the virtual robot makes a record (synthetic).\n"
    "\n"
    "  --ramp-hold CSV    record of ramps and holds: time_s,penetration_mm,slide_mm,normal_n,\n"
    "                     tangential_n\n"
    "  --slide CSV        record of slides, the same columns\n"
    "  -o FILE            preset (JSON) or record (CSV) to write\n"
    "  --site K           site of records that do not name one; site of the robot\n"
    "  --probe NAME|FILE  the same for the probe; default linear\n"
    "  --preset FILE      damping, stiffness and friction to start from and to simulate with\n"
    "  --threads N        default: one per core\n"
    "  --json             one JSON object\n"
    "  --help             this text\n"
    "\n"
    "With --simulate:\n"
    "  --simulate KIND    ramp-hold or slide\n"
    "  --depth-mm D       default 12 (ramp-hold), 5 (slide)\n"
    "  --force-n F        press to this static force instead\n"
    "  --speed-mm-s V     one speed instead of 20, 40, 80 (ramp-hold) or 10, 20, 60 (slide)\n"
    "  --axis A           u around the leg (default) or v along it\n"
    "  --slide-mm L       length of a slide; default 12\n"
    "  --hold-s T         hold and pause; default 0.2 (ramp-hold), 0.1 (slide)\n"
    "  --rate-hz R        samples per second; default 1000\n"
    "  --noise-n S        standard deviation of the force sensors; default 0\n"
    "  --noise-mm S       standard deviation of the position sensors; default 0\n"
    "  --seed K           of the noise; default 1\n";

typedef struct arguments {
  const char *model, *ramp_hold, *slide, *output, *site, *probe, *preset, *threads, *simulate;
  const char *depth, *force, *speed, *axis, *length, *hold, *rate, *noise_n, *noise_mm, *seed;
  bool json, help;
} arguments;

static bool parse_arguments(int argc, char **argv, arguments *a) {
  const app_option options[] = {{"--ramp-hold", &a->ramp_hold, NULL},
                                {"--slide", &a->slide, NULL},
                                {"-o", &a->output, NULL},
                                {"--output", &a->output, NULL},
                                {"--site", &a->site, NULL},
                                {"--probe", &a->probe, NULL},
                                {"--preset", &a->preset, NULL},
                                {"--threads", &a->threads, NULL},
                                {"--simulate", &a->simulate, NULL},
                                {"--depth-mm", &a->depth, NULL},
                                {"--force-n", &a->force, NULL},
                                {"--speed-mm-s", &a->speed, NULL},
                                {"--axis", &a->axis, NULL},
                                {"--slide-mm", &a->length, NULL},
                                {"--hold-s", &a->hold, NULL},
                                {"--rate-hz", &a->rate, NULL},
                                {"--noise-n", &a->noise_n, NULL},
                                {"--noise-mm", &a->noise_mm, NULL},
                                {"--seed", &a->seed, NULL},
                                {"--json", NULL, &a->json},
                                {"--help", NULL, &a->help}};
  if (!app_take_options(VERB, argc, argv, options, sizeof options / sizeof *options, &a->model))
    return false;
  if (a->help) return true;
  if (!app_require(VERB, "MODEL", a->model)) return false;
  if (a->simulate) {
    if (!a->ramp_hold && !a->slide)
      return app_require(VERB, "--site", a->site) && app_require(VERB, "-o CSV", a->output);
    app_usage_error(VERB, "--simulate makes a record and reads none");
    return false;
  }
  if (a->ramp_hold || a->slide) return true;
  app_usage_error(VERB, "give --ramp-hold CSV, --slide CSV, or --simulate KIND");
  return false;
}

static bool parse_site(const arguments *a, uint32_t *site) {
  long number = -1;
  if (!a->site) return true;
  if (!app_parse_integer(VERB, "--site", a->site, 0, 1000000, &number)) return false;
  *site = (uint32_t)number;
  return true;
}

static bool make_protocol(const arguments *a, sonde_protocol *p) {
  static const char *const KINDS[] = {"ramp-hold", "slide", NULL}, *const AXES[] = {"u", "v", NULL};
  int kind = 0, axis = 0;
  long seed = 1;
  if (!app_parse_word(VERB, "--simulate", a->simulate, KINDS, &kind)) return false;
  *p = sonde_protocol_default((sonde_protocol_kind)kind);
  double depth_mm = 1e3 * p->depth_m, slide_mm = 1e3 * p->slide_m, noise_mm = 0, speed_mm_s = 0;
  const struct {
    const char *option, *text;
    double low, high, *value;
  } reals[] = {{"--depth-mm", a->depth, 0.1, 60, &depth_mm},
               {"--force-n", a->force, 0.01, 200, &p->force_n},
               {"--speed-mm-s", a->speed, 1, 1000, &speed_mm_s},
               {"--slide-mm", a->length, 1, 100, &slide_mm},
               {"--hold-s", a->hold, 0.02, 60, &p->hold_s},
               {"--rate-hz", a->rate, 50, 1000, &p->rate_hz},
               {"--noise-n", a->noise_n, 0, 100, &p->noise_force_n},
               {"--noise-mm", a->noise_mm, 0, 10, &noise_mm}};
  for (size_t i = 0; i < sizeof reals / sizeof *reals; ++i)
    if (reals[i].text && !app_parse_real(VERB, reals[i].option, reals[i].text, reals[i].low,
                                         reals[i].high, reals[i].value))
      return false;
  if (a->axis && !app_parse_word(VERB, "--axis", a->axis, AXES, &axis)) return false;
  if (a->seed && !app_parse_integer(VERB, "--seed", a->seed, 0, 2147483647, &seed)) return false;
  if (!parse_site(a, &p->site)) return false;
  p->axis = AXES[axis][0];
  if (a->probe) p->probe = a->probe;
  p->depth_m = 1e-3 * depth_mm;
  p->slide_m = 1e-3 * slide_mm;
  p->noise_position_m = 1e-3 * noise_mm;
  p->seed = (uint64_t)seed;
  if (speed_mm_s > 0) {
    p->speed_m_s[0] = 1e-3 * speed_mm_s;
    p->speed_count = 1;
  }
  return true;
}

static int simulate(const arguments *a, const sonde_protocol *protocol, const sonde_model *model,
                    const sonde_world_def *world) {
  sonde_motion_record record;
  sonde_error error = {0};
  double start = app_seconds(CLOCK_MONOTONIC), most_n = 0, across_n = 0;
  sonde_progress progress = app_progress();
  if (sonde_protocol_run(model, world, protocol, &progress, &record, &error))
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
  app_json_text("file", a->output);
  app_json_integer("samples", samples);
  app_json_real("length_s", length_s);
  app_json_real("normal_max_n", most_n);
  app_json_real("tangential_max_n", across_n);
  app_json_real("seconds", app_seconds(CLOCK_MONOTONIC) - start);
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

static sonde_status read_record(const arguments *a, const char *path, sonde_protocol_kind kind,
                                uint32_t site, sonde_motion_record *record, sonde_error *error) {
  sonde_status status = sonde_motion_record_load(path, record, error);
  if (status) return status;
  if (record->site == UINT32_MAX) record->site = site;
  if (!record->probe[0])
    snprintf(record->probe, sizeof record->probe, "%s", a->probe ? a->probe : "linear");
  record->protocol = kind;
  if (record->site != UINT32_MAX) return SONDE_OK;
  sonde_motion_record_clear(record);
  error->status = SONDE_FORMAT;
  snprintf(error->message, sizeof error->message,
           "%.400s: does not name its site ('# site: K'), expected it there or as --site K", path);
  return SONDE_FORMAT;
}

static sonde_status find_damping(const arguments *a, const sonde_model *model, uint32_t site,
                                 const sonde_identify_options *options, findings *found,
                                 sonde_error *error) {
  sonde_motion_record record;
  sonde_progress progress = app_progress();
  sonde_status status =
      read_record(a, a->ramp_hold, SONDE_PROTOCOL_RAMP_HOLD, site, &record, error);
  if (status) return status;
  sonde_relaxation_read(&record, found->hold, &found->holds, NULL); // none: ramps alone do as well
  status = sonde_identify_damping(model, &record, 1, options, &progress, &found->damping, error);
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

// Dry coefficients that give the measured ones under the record's film.
static void put_friction(const sonde_friction_result *r, sonde_friction *f) {
  double clear = exp(r->gel_film);
  f->gel_film = r->gel_film;
  f->mu_kinetic = fmax(0, f->mu_gel + (r->mu_kinetic.value - f->mu_gel) * clear);
  f->mu_static = f->mu_gel + (r->mu_static.value - f->mu_gel) * clear;
  f->mu_static = fmax(f->mu_kinetic, f->mu_static);
  f->stribeck_speed_m_s = r->stribeck_speed_m_s.value;
}

static sonde_status find_friction(const arguments *a, const sonde_model *model, uint32_t site,
                                  const sonde_identify_options *options, findings *found,
                                  sonde_error *error) {
  sonde_motion_record record;
  sonde_progress progress = app_progress();
  sonde_status status = read_record(a, a->slide, SONDE_PROTOCOL_SLIDE, site, &record, error);
  if (status) return status;
  status = sonde_slide_read(&record, found->slide, &found->slides, error);
  if (!status)
    status =
        sonde_identify_friction(model, &record, 1, options, &progress, &found->friction, error);
  sonde_motion_record_clear(&record);
  app_progress_end();
  if (status) return status;
  found->has_friction = true;
  put_friction(&found->friction, &found->preset.friction);
  return SONDE_OK;
}

static void print_estimate(const char *name, const char *unit, double scale,
                           const sonde_estimate *e) {
  printf("  %-18s %9.4g %-5s 95 %%: %.4g to %.4g%s\n", name, scale * e->value, unit, scale * e->low,
         scale * e->high, e->identified ? "" : "  (not determined)");
}

static void print_text(const findings *f, const char *output) {
  for (uint32_t k = 0; k < f->holds; ++k)
    printf("hold at %.2f mm after %.1f mm/s: %.3f N to %.3f N (ratio %.3f), relaxation %.3g s\n",
           1e3 * f->hold[k].depth_m, 1e3 * f->hold[k].speed_m_s, f->hold[k].peak_n,
           f->hold[k].static_n, f->hold[k].ratio, f->hold[k].relaxation_s);
  if (f->has_damping) {
    printf("damping: %u samples, residual %.4f N\n", f->damping.samples, f->damping.residual_n);
    print_estimate("normal damping", "ms", 1e3, &f->damping.normal_damping_s);
    print_estimate("stiffness scale", "", 1, &f->damping.stiffness_scale);
    print_estimate("edge damping", "ms", 1e3, &f->damping.edge_damping_s);
  }
  for (uint32_t k = 0; k < f->slides; ++k)
    printf("slide at %.1f mm/s: ratio %.4f, breakaway %.4f (%u moves)\n",
           1e3 * f->slide[k].speed_m_s, f->slide[k].ratio, f->slide[k].breakaway,
           f->slide[k].moves);
  if (f->has_friction) {
    printf("friction: %u samples, residual %.4f N\n", f->friction.samples, f->friction.residual_n);
    print_estimate("static", "", 1, &f->friction.mu_static);
    print_estimate("kinetic", "", 1, &f->friction.mu_kinetic);
    print_estimate("Stribeck speed", "mm/s", 1e3, &f->friction.stribeck_speed_m_s);
  }
  if (output) printf("wrote %s\n", output);
}

static void json_estimate(const char *key, double scale, const sonde_estimate *e) {
  app_json_object(key);
  app_json_real("value", scale * e->value);
  app_json_real("low", scale * e->low);
  app_json_real("high", scale * e->high);
  app_json_bool("identified", e->identified);
  app_json_close();
}

static void print_json(const findings *f, const char *output) {
  app_json_begin();
  if (f->has_damping) {
    app_json_object("damping");
    json_estimate("normal_damping_ms", 1e3, &f->damping.normal_damping_s);
    json_estimate("stiffness_scale", 1, &f->damping.stiffness_scale);
    json_estimate("edge_damping_ms", 1e3, &f->damping.edge_damping_s);
    app_json_real("edge_sensitivity_n", f->damping.edge_sensitivity_n);
    app_json_real("residual_n", f->damping.residual_n);
    app_json_real("peak_n", f->hold[0].peak_n);
    app_json_real("static_n", f->hold[0].static_n);
    app_json_real("relaxation_s", f->hold[0].relaxation_s);
    app_json_integer("samples", f->damping.samples);
    app_json_integer("simulations", f->damping.simulations);
    app_json_close();
  }
  if (f->has_friction) {
    app_json_object("friction");
    json_estimate("mu_static", 1, &f->friction.mu_static);
    json_estimate("mu_kinetic", 1, &f->friction.mu_kinetic);
    json_estimate("stribeck_speed_mm_s", 1e3, &f->friction.stribeck_speed_m_s);
    app_json_real("gel_film", f->friction.gel_film);
    app_json_real("residual_n", f->friction.residual_n);
    app_json_integer("samples", f->friction.samples);
    app_json_integer("simulations", f->friction.simulations);
    app_json_close();
  }
  if (output) app_json_text("preset", output);
  app_json_real("seconds", f->seconds);
  app_json_end();
}

static int identify(const arguments *a, const sonde_model *model, const sonde_preset *preset,
                    uint32_t site, uint32_t threads) {
  sonde_identify_options options = sonde_identify_options_default();
  options.threads = threads;
  findings found = {.preset = *preset};
  sonde_error error = {0};
  sonde_status status = SONDE_OK;
  double start = app_seconds(CLOCK_MONOTONIC);
  snprintf(found.preset.name, sizeof found.preset.name, "identified");
  if (a->ramp_hold) status = find_damping(a, model, site, &options, &found, &error);
  if (!status && a->slide) status = find_friction(a, model, site, &options, &found, &error);
  if (!status && a->output) status = sonde_preset_save(a->output, &found.preset, &error);
  if (status) return app_fail(VERB, &error);
  found.seconds = app_seconds(CLOCK_MONOTONIC) - start;
  if (a->json)
    print_json(&found, a->output);
  else
    print_text(&found, a->output);
  return APP_OK;
}

int old_identify(int argc, char **argv);
int old_identify(int argc, char **argv) {
  arguments a = {0};
  sonde_protocol protocol;
  sonde_preset preset = sonde_preset_default();
  sonde_world_def world = sonde_identify_world();
  sonde_error error = {0};
  sonde_model *model = NULL;
  uint32_t site = UINT32_MAX;
  long threads = 0;
  if (!parse_arguments(argc, argv, &a)) return APP_BAD_INPUT;
  if (a.help) {
    fputs(HELP, stdout);
    return APP_OK;
  }
  if (!parse_site(&a, &site) || (a.simulate && !make_protocol(&a, &protocol))) return APP_BAD_INPUT;
  if (a.threads && !app_parse_integer(VERB, "--threads", a.threads, 1, 64, &threads))
    return APP_BAD_INPUT;
  int unwritable = app_check_output(VERB, a.output);
  if (unwritable) return unwritable;
  sonde_status status = a.preset ? sonde_preset_load(a.preset, &preset, &error) : SONDE_OK;
  if (!status) status = sonde_model_load(a.model, &model, &error);
  if (!status) status = sonde_preset_apply(&preset, model, &world, &error);
  int code = status       ? app_fail(VERB, &error)
             : a.simulate ? simulate(&a, &protocol, model, &world)
                          : identify(&a, model, &preset, site, (uint32_t)threads);
  sonde_model_destroy(model);
  return code;
}
