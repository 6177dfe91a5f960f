// sonde fit: measurements, sites and surfaces in, thigh model out.
// parse:       options into texts, then into definitions.
// load_inputs: tables and surfaces.
// fit_model:   build, estimate, set the parameters, save, look at the result from other sides.
#include "fit_checks.h"
#include "fit_common.h"
#include "fit_doubts.h"
#include "fit_open.h"
#include "fit_report.h"
#include "fit_sample.h"
#include "fit_tables.h"

#include <stdlib.h>
#include <unistd.h>

static const char VERB[] = "fit";
static const char HELP[] =
    "usage: sonde fit MEASUREMENTS.csv --surface SKIN.ply --sites SITES.csv -o MODEL [options]\n"
    "       sonde fit --sample TABLE.csv [--exponent N] [--area-mm2 A --height-mm H] [--json]\n"
    "\n"
    "Estimates the normal springs f(x) = x/(a x + b) of every site (stage 1: every curve by "
    "itself;\n"
    "stage 2: one pair per site and one uniform edge stiffness, neighbours held still; stage 3: "
    "refit\n"
    "with shear between neighbours on the equilibrium of the whole skin), carries them over the\n"
    "refined skin and writes a thigh model. Files are in mm and N.\n"
    "\n"
    "  --surface FILE    skin, closed, outward: .ply, .obj or .stl\n"
    "  --sites FILE      site,x_mm,y_mm,z_mm,nx..nz,ux..uz,vx..vz[,fat_mm]\n"
    "  -o FILE           model file to write\n"
    "  --stages 1|2|3    last stage; default 2. With 1 the model has one pair per site, no edges\n"
    "                    in the estimation and the law's default edge stiffness. Only 3 gives a\n"
    "                    model whose forces follow the measurements when it moves freely\n"
    "  --femur FILE      default: femur.ply beside the skin; without one a limb gets a rod along\n"
    "                    the middles of its sections, another body no bone\n"
    "  --body KIND       limb (default) or other: no bone unless --femur is given, no vessels, "
    "and\n"
    "                    so no image\n"
    "  --fat FILE        skin/fat interface; default: fat_skin_interface.ply beside the skin\n"
    "  --muscle FILE     fat/muscle interface; default: muscle_surface.ply beside the skin\n"
    "  --name TEXT       name in the model file; default thigh\n"
    "  --provenance TEXT where the data come from, kept in the model file\n"
    "  --weights KIND    absolute (default) or relative to each probe's mean force\n"
    "  --loss KIND       squares (default), huber or student\n"
    "  --pretension      estimate an edge pre-tension too\n"
    "  --cold-start      start stage 2 from generic values instead of stage 1\n"
    "  --exponent N      of the normal springs k0 x/(1 - (x/xm)^N) in stage 3: 1, 2 (default),\n"
    "                    3, or auto: the one with the least error on sites left out\n"
    "  --inplane-n-m K   in-plane stiffness of the skin in stage 3, 0 to 1e4; default 35, chosen\n"
    "  --tangential-n-m3 G  stiffness per area against sliding along the skin, 0 to 1e8; default\n"
    "                    1e5, chosen\n"
    "  --uniform-shear   one shear stiffness and limit for the whole skin in stage 3; default: a\n"
    "                    field like k0 and xm\n"
    "  --smoothness SD   of ln k0 and ln xm per site spacing in stage 3; default: by leaving "
    "sites\n"
    "                    out one by one\n"
    "  --hold-out KIND   sites (eight parts in turn), probe (each in turn) or depth (the deepest\n"
    "                    quarter): refit without them and print the error on them\n"
    "  --also FILE       with --hold-out sites: measurements of other probes that the refits\n"
    "                    predict too, each at the sites that it has not seen; also by --layers\n"
    "  --layers          the same fit with other laws between neighbours, their errors beside\n"
    "                    ours: pre-tension (T), pre-tension and stiffening (J)\n"
    "  --profile         likelihood of the shear stiffness: all else refitted at nine values\n"
    "  --identifiability what each probe alone and all together would determine\n"
    "  --starts N        refit from N random points and count how many end in the same optimum\n"
    "  --seed S          of the random points; default 1\n"
    "  --report DIR      write DIR/index.html with figures, tables and intervals; after stage 3\n"
    "                    with --profile and --identifiability\n"
    "  --estimate-zero   estimate the contact zero of every curve in stage 3\n"
    "  --estimate-tare   estimate the force that the sensor reads in the air, of every curve\n"
    "  --zero-sd-mm SD   its standard deviation beforehand; default 5. Implies --estimate-zero\n"
    "  --tare-sd-n SD    likewise; default 2. Implies --estimate-tare\n"
    "  --fine-mm L       longest skin edge near footprints; default 3\n"
    "  --sample TABLE    force against compression of one specimen instead: the springs of n = 1,\n"
    "                    2, 3 and a free n, the chosen one by its error on what was left out\n"
    "  --area-mm2 A      the specimen's cross-section; default: from the table's first lines\n"
    "  --height-mm H     its height, likewise\n"
    "  --accept-implausible  fit measurements outside what is known of tissue, with a warning;\n"
    "                    a table in other units is refused all the same\n"
    "  --json            one JSON object instead of the table\n"
    "  --help            this text\n";

static const char *const HOLD_OUTS[] = {"sites", "probe", "depth", NULL};

typedef struct fit_arguments {
  const char *measurements, *surface, *sites, *output, *femur, *fat, *muscle, *name, *provenance;
  const char *stages, *weights, *loss, *fine_mm, *exponent, *report, *hold_out, *smoothness;
  const char *sample, *area, *height, *body, *starts, *seed, *also, *inplane, *tangential, *zero_sd,
      *tare_sd;
  bool zero, tare;
  bool json, help, pretension, cold_start, profile, identify, layers, uniform_shear, accept;
  char command_line[1024]; // as typed
} fit_arguments;

// Of the model that is fitted.
typedef struct fit_skin {
  double fine_mm, inplane_n_m, tangential_n_m3;
  bool other; // no limb
} fit_skin;

static const char CHOOSE[] = "auto"; // of --exponent

// All that was found.
typedef struct fit_outcome {
  sonde_fit_result result;
  sonde_error_report hold_out, also;
  fit_checks checks;
  sonde_doubts doubts;
  sonde_fit_exponent tried[SONDE_FIT_EXPONENTS]; // with --exponent auto
} fit_outcome;

typedef struct fit_inputs {
  sonde_site_table sites;
  sonde_measurements measurements, also;
  sonde_mesh skin, femur, fat, muscle;
} fit_inputs;

static bool parse_arguments(int argc, char **argv, fit_arguments *a) {
  const app_option options[] = {{"--surface", &a->surface, NULL},
                                {"--sites", &a->sites, NULL},
                                {"-o", &a->output, NULL},
                                {"--output", &a->output, NULL},
                                {"--stages", &a->stages, NULL},
                                {"--femur", &a->femur, NULL},
                                {"--body", &a->body, NULL},
                                {"--sample", &a->sample, NULL},
                                {"--area-mm2", &a->area, NULL},
                                {"--height-mm", &a->height, NULL},
                                {"--fat", &a->fat, NULL},
                                {"--muscle", &a->muscle, NULL},
                                {"--name", &a->name, NULL},
                                {"--provenance", &a->provenance, NULL},
                                {"--weights", &a->weights, NULL},
                                {"--loss", &a->loss, NULL},
                                {"--fine-mm", &a->fine_mm, NULL},
                                {"--exponent", &a->exponent, NULL},
                                {"--smoothness", &a->smoothness, NULL},
                                {"--uniform-shear", NULL, &a->uniform_shear},
                                {"--inplane-n-m", &a->inplane, NULL},
                                {"--tangential-n-m3", &a->tangential, NULL},
                                {"--report", &a->report, NULL},
                                {"--hold-out", &a->hold_out, NULL},
                                {"--also", &a->also, NULL},
                                {"--starts", &a->starts, NULL},
                                {"--seed", &a->seed, NULL},
                                {"--profile", NULL, &a->profile},
                                {"--identifiability", NULL, &a->identify},
                                {"--layers", NULL, &a->layers},
                                {"--pretension", NULL, &a->pretension},
                                {"--cold-start", NULL, &a->cold_start},
                                {"--accept-implausible", NULL, &a->accept},
                                {"--estimate-zero", NULL, &a->zero},
                                {"--estimate-tare", NULL, &a->tare},
                                {"--zero-sd-mm", &a->zero_sd, NULL},
                                {"--tare-sd-n", &a->tare_sd, NULL},
                                {"--json", NULL, &a->json},
                                {"--help", NULL, &a->help}};
  if (!app_take_options(VERB, argc, argv, options, sizeof options / sizeof *options,
                        &a->measurements))
    return false;
  if (a->help || a->sample) return true;
  return app_require(VERB, "MEASUREMENTS.csv", a->measurements) &&
         app_require(VERB, "--surface", a->surface) && app_require(VERB, "--sites", a->sites) &&
         app_require(VERB, "-o MODEL", a->output);
}

// Arguments with blanks are put in quotes.
static void keep_command_line(int argc, char **argv, fit_arguments *a) {
  size_t used = (size_t)snprintf(a->command_line, sizeof a->command_line, "sonde fit");
  for (int k = 1; k < argc && used < sizeof a->command_line; ++k) {
    const char *quote = strpbrk(argv[k], " \t'") || !argv[k][0] ? "\"" : "";
    used += (size_t)snprintf(a->command_line + used, sizeof a->command_line - used, " %s%s%s",
                             quote, argv[k], quote);
  }
}

// Standard deviations of contact zero and tare; 0: not estimated.
static bool parse_offsets(const fit_arguments *a, long stages, sonde_fit_def *def) {
  double zero_mm = a->zero ? 5 : 0, tare_n = a->tare ? 2 : 0;
  if (a->zero_sd && !app_parse_real(VERB, "--zero-sd-mm", a->zero_sd, 0.01, 20, &zero_mm))
    return false;
  if (a->tare_sd && !app_parse_real(VERB, "--tare-sd-n", a->tare_sd, 1e-3, 20, &tare_n))
    return false;
  def->zero_sd_m = 1e-3 * zero_mm;
  def->tare_sd_n = tare_n;
  if (stages == 3 || !(zero_mm > 0 || tare_n > 0)) return true;
  app_usage_error(VERB, "--estimate-zero and --estimate-tare need --stages 3");
  return false;
}

static bool parse_checks(const fit_arguments *a, long stages, fit_checks *checks) {
  long starts = 0, seed = 1;
  if (a->starts && !app_parse_integer(VERB, "--starts", a->starts, 1, 10000, &starts)) return false;
  if (a->seed && !app_parse_integer(VERB, "--seed", a->seed, 0, 2147483647, &seed)) return false;
  const char *late = a->hold_out   ? "--hold-out"
                     : a->profile  ? "--profile"
                     : a->identify ? "--identifiability"
                     : a->layers   ? "--layers"
                     : a->starts   ? "--starts"
                                   : NULL;
  if (late && stages < 3) {
    app_usage_error(VERB, "%s needs --stages 3", late);
    return false;
  }
  bool reported = a->report && stages == 3;
  *checks = (fit_checks){.profile = a->profile || reported,
                         .identify = a->identify || reported,
                         .layers = a->layers,
                         .starts = (uint32_t)starts,
                         .seed = (uint64_t)seed};
  return true;
}

static bool chooses_exponent(const fit_arguments *a) {
  return a->exponent && strcmp(a->exponent, CHOOSE) == 0;
}

static bool parse_fit(const fit_arguments *a, sonde_fit_def *def, fit_skin *skin,
                      fit_checks *checks) {
  static const char *const WEIGHTS[] = {"absolute", "relative", NULL};
  static const char *const LOSSES[] = {"squares", "huber", "student", NULL};
  int weights = 0, loss = 0;
  long stages = 2;
  if (a->stages && !app_parse_integer(VERB, "--stages", a->stages, 1, 3, &stages)) return false;
  if (a->weights && !app_parse_word(VERB, "--weights", a->weights, WEIGHTS, &weights)) return false;
  if (a->loss && !app_parse_word(VERB, "--loss", a->loss, LOSSES, &loss)) return false;
  if (a->fine_mm && !app_parse_real(VERB, "--fine-mm", a->fine_mm, 0.5, 50, &skin->fine_mm))
    return false;
  if (a->inplane && !app_parse_real(VERB, "--inplane-n-m", a->inplane, 0, 1e4, &skin->inplane_n_m))
    return false;
  if (a->tangential &&
      !app_parse_real(VERB, "--tangential-n-m3", a->tangential, 0, 1e8, &skin->tangential_n_m3))
    return false;
  static const char *const BODIES[] = {"limb", "other", NULL};
  int body = 0;
  if (a->body && !app_parse_word(VERB, "--body", a->body, BODIES, &body)) return false;
  skin->other = body == 1;
  *def = sonde_fit_def_default();
  long exponent = (long)def->normal_exponent;
  if (chooses_exponent(a) && stages < 3) {
    app_usage_error(VERB, "--exponent auto needs --stages 3");
    return false;
  }
  if (a->exponent && !chooses_exponent(a) &&
      !app_parse_integer(VERB, "--exponent", a->exponent, 1, 3, &exponent))
    return false;
  if (a->smoothness &&
      !app_parse_real(VERB, "--smoothness", a->smoothness, 1e-4, 10, &def->smoothness_sd))
    return false;
  if (a->hold_out) {
    int kind;
    if (!app_parse_word(VERB, "--hold-out", a->hold_out, HOLD_OUTS, &kind)) return false;
  }
  bool by_sites = a->hold_out && strcmp(a->hold_out, HOLD_OUTS[0]) == 0;
  if (a->also && !a->layers && !by_sites) {
    app_usage_error(VERB, "--also needs --hold-out sites or --layers");
    return false;
  }
  if (!parse_offsets(a, stages, def)) return false;
  def->normal_exponent = (double)exponent;
  def->uniform_shear = a->uniform_shear;
  def->stages = (uint32_t)stages;
  def->weights = (sonde_fit_weights)weights;
  def->loss = (sonde_fit_loss)loss;
  def->fit_pretension = a->pretension;
  def->cold_start = a->cold_start;
  return parse_checks(a, stages, checks);
}

// Loads an optional surface: the named one, else the usual name beside the skin when it exists.
static sonde_status load_layer(const char *named, const char *skin, const char *usual,
                               sonde_mesh *mesh, sonde_error *error) {
  char path[4096];
  if (!named) {
    const char *slash = strrchr(skin, '/');
    int folder = slash ? (int)(slash - skin) + 1 : 0;
    snprintf(path, sizeof path, "%.*s%s", folder, skin, usual);
    bool present = access(path, R_OK) == 0;
    fprintf(stderr, "sonde fit: %s %s\n", present ? "using" : "no", path);
    if (!present) return SONDE_OK;
  }
  return sonde_mesh_load(named ? named : path, 1e-3, mesh, error);
}

static sonde_status load_inputs(const fit_arguments *a, fit_inputs *in, sonde_error *error) {
  sonde_status status = sonde_site_table_load(a->sites, &in->sites, error);
  if (!status)
    status = sonde_measurements_load(a->measurements, &in->sites, &in->measurements, error);
  if (!status && a->also) status = sonde_measurements_load(a->also, &in->sites, &in->also, error);
  if (!status) status = sonde_mesh_load(a->surface, 1e-3, &in->skin, error);
  bool other = a->body && strcmp(a->body, "other") == 0; // of which only what is named counts
  if (!status && (a->femur || !other))
    status = load_layer(a->femur, a->surface, "femur.ply", &in->femur, error);
  if (!status) status = load_layer(a->fat, a->surface, "fat_skin_interface.ply", &in->fat, error);
  if (!status) status = load_layer(a->muscle, a->surface, "muscle_surface.ply", &in->muscle, error);
  return status;
}

static void clear_inputs(fit_inputs *in) {
  sonde_site_table_clear(&in->sites);
  sonde_measurements_clear(&in->measurements);
  sonde_measurements_clear(&in->also);
  sonde_mesh_clear(&in->skin);
  sonde_mesh_clear(&in->femur);
  sonde_mesh_clear(&in->fat);
  sonde_mesh_clear(&in->muscle);
}

static const sonde_mesh *given(const sonde_mesh *mesh) { return mesh->vertex_count ? mesh : NULL; }

static sonde_status build_model(const fit_arguments *a, const fit_inputs *in, const fit_skin *skin,
                                sonde_model **model, sonde_error *error) {
  sonde_model_def def = sonde_model_def_default();
  char provenance[256];
  const char *slash = strrchr(a->measurements, '/');
  snprintf(provenance, sizeof provenance, "fitted by sonde %s to %.100s", sonde_version(),
           slash ? slash + 1 : a->measurements);
  def.provenance = a->provenance ? a->provenance : provenance;
  if (a->name) def.name = a->name;
  def.skin = &in->skin;
  def.femur = skin->other ? &in->femur : given(&in->femur);
  def.fat_interface = given(&in->fat);
  def.muscle_interface = given(&in->muscle);
  def.sites = in->sites.sites;
  def.site_count = in->sites.count;
  def.data = in->measurements.data;
  def.datum_count = in->measurements.count;
  def.fine_edge_m = 1e-3 * skin->fine_mm;
  def.law.inplane_stiffness_n_m = skin->inplane_n_m;
  def.law.tangential_stiffness_n_m3 = skin->tangential_n_m3;
  sonde_status status = sonde_model_build(&def, model, error);
  if (!status && skin->other) (*model)->vein.count = (*model)->artery.count = 0;
  return status;
}

static sonde_status leave_out(const fit_arguments *a, const fit_inputs *in,
                              const sonde_model *model, const sonde_fit_def *def, fit_outcome *out,
                              sonde_error *error) {
  int kind;
  sonde_progress progress = app_progress();
  const sonde_measurements *m = &in->measurements, *also = &in->also;
  if (!app_parse_word(VERB, "--hold-out", a->hold_out, HOLD_OUTS, &kind)) return SONDE_ARGUMENT;
  double *predicted_n = calloc(m->count + also->count, sizeof *predicted_n);
  if (!predicted_n) return SONDE_MEMORY;
  bool with_also = a->also && kind == SONDE_HOLD_OUT_SITES;
  sonde_status status =
      with_also ? sonde_fit_hold_out_also(model, &in->sites, m, also, def, &out->result, &progress,
                                          predicted_n, error)
                : sonde_fit_hold_out(model, &in->sites, m, def, &out->result, (sonde_hold_out)kind,
                                     &progress, predicted_n, error);
  if (!status)
    status = sonde_error_report_of(m->data, predicted_n, m->count, &out->hold_out, error);
  if (!status && with_also)
    status =
        sonde_error_report_of(also->data, predicted_n + m->count, also->count, &out->also, error);
  app_progress_end();
  free(predicted_n);
  return status;
}

// Who says the exponent of stage 3.
static const char *exponent_from(const fit_arguments *a) {
  if (chooses_exponent(a)) return "chosen by the held-out error";
  return a->exponent ? "given" : "given (default)";
}

static sonde_status write_report(const fit_arguments *a, const fit_inputs *in,
                                 const sonde_model *model, const fit_outcome *out,
                                 sonde_error *error) {
  char name[64];
  snprintf(name, sizeof name, "%s, refitted", a->hold_out ? a->hold_out : "");
  const fit_findings findings = {.model = model,
                                 .sites = &in->sites,
                                 .data = &in->measurements,
                                 .result = &out->result,
                                 .command_line = a->command_line,
                                 .exponent_from = exponent_from(a),
                                 .hold_out_name = name,
                                 .hold_out = a->hold_out ? &out->hold_out : NULL,
                                 .also = out->also.all.count ? &out->also : NULL,
                                 .checks = &out->checks,
                                 .doubts = &out->doubts,
                                 .path = a->measurements};
  sonde_progress progress = app_progress();
  sonde_status status = fit_report_write(&findings, a->report, &progress, error);
  app_progress_end();
  return status;
}

// Before the fit.
static sonde_status examine_measurements(const fit_arguments *a, const fit_inputs *in,
                                         fit_outcome *out, sonde_error *error) {
  sonde_status status = sonde_measurements_examine(&in->measurements, &out->doubts, error);
  if (!status) status = fit_doubts_decide(&out->doubts, a->measurements, a->accept, error);
  if (!status) fit_doubts_print(&out->doubts, 0, a->measurements);
  return status;
}

static sonde_status examine_result(const fit_arguments *a, const fit_inputs *in,
                                   const sonde_model *model, fit_outcome *out, sonde_error *error) {
  uint32_t before = out->doubts.count;
  sonde_status status =
      sonde_fit_examine(model, &in->measurements, &out->result, &out->doubts, error);
  if (!status) status = fit_doubts_decide(&out->doubts, a->measurements, a->accept, error);
  if (!status) fit_doubts_print(&out->doubts, before, a->measurements);
  return status;
}

// def's exponent becomes the chosen one, which the checks after the fit need.
static sonde_status fit_model(const fit_arguments *a, const fit_inputs *in, sonde_fit_def *def,
                              const fit_skin *skin, fit_outcome *out, sonde_error *error) {
  sonde_model *model = NULL;
  sonde_fit_result *result = &out->result;
  sonde_progress progress = app_progress();
  sonde_status status = build_model(a, in, skin, &model, error);
  if (!status && chooses_exponent(a)) {
    status = sonde_fit_exponents(model, &in->sites, &in->measurements, def, &progress, out->tried,
                                 result, error);
    if (!status) def->normal_exponent = result->law.normal_exponent;
  } else if (!status) {
    status = sonde_fit(model, &in->sites, &in->measurements, def, &progress, result, error);
  }
  app_progress_end();
  if (!status) status = examine_result(a, in, model, out, error);
  if (!status)
    status =
        sonde_model_set_parameters(model, &result->law, result->sites, result->site_count, error);
  if (!status) fit_tables_correct(result, model);
  if (!status) status = fit_open_check(model, in->measurements.data[0].probe, error);
  if (!status) status = sonde_model_save(model, a->output, error);
  if (!status) status = fit_open_written(model, a->output, error);
  if (!status && a->hold_out) status = leave_out(a, in, model, def, out, error);
  out->checks.also = a->also ? &in->also : NULL;
  if (!status)
    status = fit_checks_run(&out->checks, model, &in->sites, &in->measurements, def, result,
                            &progress, error);
  app_progress_end();
  if (!status && a->report) status = write_report(a, in, model, out, error);
  sonde_model_destroy(model);
  return status;
}

static void print_json_confidence(const sonde_fit_confidence *c) {
  app_json_real("smoothness_sd", c->smoothness_sd);
  app_json_real("shear_smoothness_sd", c->shear_smoothness_sd);
  app_json_real("ln_shear_sd", c->ln_shear_sd);
  app_json_real("ln_limit_sd", c->ln_limit_sd);
  app_json_real("shear_bootstrap_low_n_m", c->shear_95[0]);
  app_json_real("shear_bootstrap_high_n_m", c->shear_95[1]);
  app_json_real("limit_bootstrap_low", c->limit_95[0]);
  app_json_real("limit_bootstrap_high", c->limit_95[1]);
  app_json_object("one_site_out");
  app_json_report("full", &c->one_out);
  app_json_close();
}

static void print_json_stages(const sonde_fit_result *r) {
  app_json_object("stage1");
  app_json_report("independent", &r->stage1);
  app_json_integer("parameters", r->stage1_parameters);
  app_json_close();
  if (r->stage2.all.count > 0) {
    app_json_object("stage2");
    app_json_report("simplified", &r->stage2);
    app_json_integer("parameters", r->stage2_parameters);
    app_json_integer("iterations", r->stage2_iterations);
    app_json_bool("converged", r->stage2_converged);
    app_json_real("edge_stiffness_n_m", r->stage2_edge_n_m);
    app_json_close();
  }
  if (r->stage3.all.count > 0) {
    app_json_object("stage3");
    app_json_report("full", &r->stage3);
    app_json_integer("parameters", r->parameters);
    app_json_integer("iterations", r->iterations);
    app_json_bool("converged", r->converged);
    print_json_confidence(&r->confidence);
    app_json_close();
  }
}

static void print_json(const fit_arguments *a, const sonde_measurements *data,
                       const sonde_fit_def *def, const fit_outcome *out, double seconds) {
  const sonde_fit_result *r = &out->result;
  app_json_begin();
  if (r->stage3.all.count > 0)
    app_json_report("full", &r->stage3);
  else if (r->stage2.all.count > 0)
    app_json_report("simplified", &r->stage2);
  else
    app_json_report("independent", &r->stage1);
  print_json_stages(r);
  if (a->hold_out) {
    app_json_object("hold_out");
    app_json_text("kind", a->hold_out);
    app_json_report("full", &out->hold_out);
    if (out->also.all.count) {
      app_json_object("also");
      app_json_report("full", &out->also);
      app_json_close();
    }
    app_json_close();
  }
  if (out->tried[0].exponent > 0) {
    static const char *const KEY[SONDE_FIT_EXPONENTS] = {"n1", "n2", "n3"};
    app_json_object("exponents");
    for (int k = 0; k < SONDE_FIT_EXPONENTS; ++k) {
      app_json_object(KEY[k]);
      app_json_real("mae_percent", out->tried[k].mae_percent);
      app_json_real("held_out_percent", out->tried[k].held_out_percent);
      app_json_bool("converged", out->tried[k].converged);
      app_json_close();
    }
    app_json_close();
  }
  app_json_real("normal_exponent", r->law.normal_exponent);
  if (def->stages >= 3) app_json_text("normal_exponent_from", exponent_from(a));
  fit_checks_print_json(&out->checks);
  fit_tables_print_json(data, def, r);
  fit_doubts_print_json(&out->doubts, a->measurements);
  app_json_integer("parameters", r->parameters);
  app_json_text("model", a->output);
  app_json_real("edge_stiffness_n_m", r->law.edge_stiffness_n_m);
  app_json_real("edge_pretension_n", r->law.edge_pretension_n);
  app_json_real("shear_stiffness_n_m", r->law.shear_stiffness_n_m);
  app_json_real("shear_limit", r->law.shear_limit);
  app_json_real("inplane_stiffness_n_m", r->law.inplane_stiffness_n_m);
  app_json_real("seconds", seconds);
  app_json_end();
}

static void print_table(const fit_arguments *a, const sonde_measurements *data,
                        const sonde_fit_def *def, const fit_outcome *out, double seconds) {
  const sonde_fit_result *r = &out->result;
  char title[128];
  snprintf(title, sizeof title, "stage 1, every curve by itself: %u parameters",
           r->stage1_parameters);
  app_print_report(title, &r->stage1);
  if (r->stage2.all.count > 0) {
    snprintf(title, sizeof title,
             "stage 2, the paper's model (simplified interaction): %u parameters",
             r->stage2_parameters);
    app_print_report(title, &r->stage2);
    printf("edge stiffness %.3f N/m (ln sd %.3f), %u iterations\n", r->stage2_edge_n_m,
           r->edge_sd_log, r->stage2_iterations);
  }
  if (r->stage3.all.count > 0) {
    snprintf(title, sizeof title, "stage 3, full equilibrium: %u parameters", r->parameters);
    app_print_report(title, &r->stage3);
    const sonde_fit_confidence *c = &r->confidence;
    for (uint32_t k = 0; k < c->tried_count; ++k)
      printf("%s%g: %.2f %%", k ? ", " : "sites left out, by smoothness: ", c->tried_sd[k],
             c->tried_percent[k]);
    if (c->tried_count) printf("\n");
    app_print_report("one site left out (linearised)", &c->one_out);
    for (int k = 0; k < SONDE_FIT_EXPONENTS && out->tried[0].exponent > 0; ++k)
      printf("exponent %g: %.2f %%, one site left out %.2f %%%s\n", out->tried[k].exponent,
             out->tried[k].mae_percent, out->tried[k].held_out_percent,
             out->tried[k].exponent == r->law.normal_exponent ? " (chosen)" : "");
    printf("shear stiffness %.3f N/m, limit %.3f, in-plane stiffness %.3g N/m, %u iterations\n",
           r->law.shear_stiffness_n_m, r->law.shear_limit, r->law.inplane_stiffness_n_m,
           r->iterations);
  } else if (r->law.edge_pretension_n > 0) {
    printf("pre-tension %.3g N\n", r->law.edge_pretension_n);
  }
  if (a->hold_out) {
    snprintf(title, sizeof title, "left out and predicted by a refit: %s", a->hold_out);
    app_print_report(title, &out->hold_out);
    if (out->also.all.count)
      app_print_report("never fitted, predicted at the sites left out", &out->also);
  }
  fit_checks_print(&out->checks);
  fit_tables_print(data, def, r);
  printf("wrote %s in %.2f s\n", a->output, seconds);
}

static int run_sample(const fit_arguments *a) {
  long exponent = 0;
  double area_mm2 = 0, height_mm = 0;
  if (a->measurements || a->surface || a->sites || a->output)
    return app_usage_error(VERB, "--sample goes without measurements, surface, sites and model");
  if ((a->exponent && !chooses_exponent(a) &&
       !app_parse_integer(VERB, "--exponent", a->exponent, 1, 3, &exponent)) ||
      (a->area && !app_parse_real(VERB, "--area-mm2", a->area, 1, 1e6, &area_mm2)) ||
      (a->height && !app_parse_real(VERB, "--height-mm", a->height, 0.1, 1e3, &height_mm)))
    return APP_BAD_INPUT;
  const fit_sample_options options = {.path = a->sample,
                                      .exponent = (double)exponent,
                                      .area_m2 = 1e-6 * area_mm2,
                                      .height_m = 1e-3 * height_mm,
                                      .accept_implausible = a->accept,
                                      .json = a->json};
  return fit_sample_run(&options);
}

int old_fit(int argc, char **argv);
int old_fit(int argc, char **argv) {
  fit_arguments arguments = {0};
  sonde_fit_def def;
  fit_skin skin = {3, SONDE_SKIN_INPLANE_N_M, SONDE_SKIN_TANGENTIAL_N_M3, false};
  double start = app_seconds(CLOCK_MONOTONIC);
  if (!parse_arguments(argc, argv, &arguments)) return APP_BAD_INPUT;
  if (arguments.help) {
    fputs(HELP, stdout);
    return APP_OK;
  }
  if (arguments.sample) return run_sample(&arguments);
  fit_outcome out = {0};
  if (!parse_fit(&arguments, &def, &skin, &out.checks)) return APP_BAD_INPUT;
  int unwritable = app_check_output(VERB, arguments.output);
  if (unwritable) return unwritable;
  keep_command_line(argc, argv, &arguments);
  fit_inputs inputs = {0};
  sonde_error error = {0};
  sonde_status status = load_inputs(&arguments, &inputs, &error);
  if (!status) status = examine_measurements(&arguments, &inputs, &out, &error);
  if (!status) status = fit_model(&arguments, &inputs, &def, &skin, &out, &error);
  int code = APP_OK;
  if (status)
    code = app_fail(VERB, &error);
  else if (arguments.json)
    print_json(&arguments, &inputs.measurements, &def, &out, app_seconds(CLOCK_MONOTONIC) - start);
  else
    print_table(&arguments, &inputs.measurements, &def, &out, app_seconds(CLOCK_MONOTONIC) - start);
  if (!status && !out.result.converged)
    fprintf(stderr, "sonde fit: the last stage reached its iteration limit before it converged\n");
  sonde_fit_result_clear(&out.result);
  clear_inputs(&inputs);
  return code;
}
