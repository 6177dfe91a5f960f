// sonde fit: measurements, sites and surfaces in, thigh model out.
#include "fit_checks.h"
#include "fit_common.h"
#include "fit_doubts.h"
#include "fit_report.h"
#include "fit_sample.h"
#include "fit_solid.h"
#include "fit_bulk.h"
#include "options.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

static const char VERB[] = "fit";

typedef struct options {
  const char *measurements, *surface, *sites, *output, *femur, *fat, *muscle, *name, *provenance;
  const char *report, *sample, *also;
  sonde_fit_def def;
  int body, exponent, hold_out, kind; // of the lists of words; hold_out -1: none
  sonde_fit_bulk_def bulk;            // of a volumetric model
  double area_m2, height_m;           // of a specimen; 0: those of its table
  double fine_m, inplane_n_m, tangential_n_m3, zero_sd_m, tare_sd_n;
  long starts, seed;
  bool zero, tare, json, profile, identify, layers, accept;
  sonde_fit_solid_def hyperelastic; // of --solid
  const char *at, *check;
  double prior[SONDE_SOLID_LAYERS][2]; // shear modulus, kPa, and exponent
  int contact;
  long depths;
  bool solid, beside;
} options;

enum { BODY_LIMB, BODY_OTHER };
enum { EXPONENT_2 = 1, EXPONENT_AUTO = 3 };

static void prepare(void *to) {
  options *o = to;
  o->def = sonde_fit_def_default();
  o->bulk = sonde_fit_bulk_def_default();
  o->exponent = EXPONENT_2;
  o->hold_out = -1;
  o->fine_m = 1e-3 * 3;
  o->inplane_n_m = SONDE_SKIN_INPLANE_N_M;
  o->tangential_n_m3 = SONDE_SKIN_TANGENTIAL_N_M3;
  o->zero_sd_m = 1e-3 * 5;
  o->tare_sd_n = 2;
  o->seed = 1;
  o->hyperelastic = sonde_fit_solid_def_default();
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) {
    o->prior[k][0] = 1e-3 * o->hyperelastic.contact.layer[k].shear_pa;
    o->prior[k][1] = o->hyperelastic.contact.layer[k].exponent;
  }
  o->depths = 7;
}

static const char *const HOLD_OUTS[] = {"sites", "probe", "depth", NULL};
static const char *const WEIGHTS[] = {"absolute", "relative", NULL};
static const char *const LOSSES[] = {"squares", "huber", "student", NULL};
static const char *const BODIES[] = {"limb", "other", NULL};
static const char *const CONTACTS[] = {"bonded", "slip", NULL};
static const char *const EXPONENTS[] = {"1", "2", "3", "auto", NULL};

static const app_option TABLE[] = {
    OPT_ARGUMENT(measurements, "MEASUREMENTS.csv",
                 "forces against penetrations; a column phase (loading, unloading) keeps the rows "
                 "of loading, a column repeat (a number) makes the repeats of a curve their mean"),
    OPT_TEXT(surface, "surface", "FILE", "skin, closed, outward: .ply, .obj or .stl"),
    OPT_TEXT(sites, "sites", "FILE",
             "the measured places: site,x_mm,y_mm,z_mm,nx..nz,ux..uz,vx..vz[,fat_mm]"),
    OPT_OUTPUT(output, "o,output", "FILE", "model file to write; it appears when it is complete"),
    OPT_WORD(
        kind, "model", "KIND", fit_bulk_kinds,
        "deformable model: two-layer, the paper's; laffont, linear springs through the volume; "
        "lee, biphasic springs and a volume force in three layers over the bone; linear or "
        "neo-hookean, tetrahedra; condensed, linear tetrahedra seen from the skin, whose stiffness "
        "is computed when a model is put to use. The last five have a few moduli for the whole "
        "thigh"),
    OPT_REAL(
        bulk.edge_m, "mesh-mm", "L", 2, 50, 1e-3,
        "edge of the tetrahedra at the skin of a volumetric model; default 15, of condensed 20"),
    OPT_REAL(bulk.fine_edge_m, "mesh-fine-mm", "L", 1, 50, 1e-3,
             "the same near the sites; default 5, of condensed 10"),
    OPT_REAL(bulk.poisson, "poisson", "NU", 0, 0.499, 1,
             "Poisson ratio of linear, condensed and neo-hookean"),
    OPT_INTEGER(
        def.stages, "stages", "N", 1, 3,
        "last stage. With 1 the model has one pair per site, no edges in the estimation and "
        "the law's default edge stiffness. Only 3 gives a model whose forces follow the "
        "measurements when it moves freely"),
    OPT_TEXT(femur, "femur", "FILE",
             "femur; without one a limb gets a rod along the middles of its sections, another body "
             "no bone; default: femur.ply beside the skin"),
    OPT_WORD(body, "body", "KIND", BODIES,
             "other: no vessels, and no bone unless --femur is given; such a model can be pressed "
             "and run, but has no image"),
    OPT_TEXT(fat, "fat", "FILE",
             "skin/fat interface; default: fat_skin_interface.ply beside the skin"),
    OPT_TEXT(muscle, "muscle", "FILE",
             "fat/muscle interface; default: muscle_surface.ply beside the skin"),
    OPT_TEXT(name, "name", "TEXT", "name in the model file; default thigh"),
    OPT_TEXT(provenance, "provenance", "TEXT", "where the data come from, kept in the model file"),
    OPT_WORD(def.weights, "weights", "KIND", WEIGHTS, "relative: to each probe's mean force"),
    OPT_WORD(def.loss, "loss", "KIND", LOSSES, "loss of the residuals"),
    OPT_FLAG(def.fit_pretension, "pretension", "estimate a pre-tension of the edges too"),
    OPT_FLAG(def.cold_start, "cold-start", "start stage 2 from generic values instead of stage 1"),
    OPT_WORD(
        exponent, "exponent", "N", EXPONENTS,
        "of the normal springs k0 x/(1 - (x/xm)^N) in stage 3; auto: all three are fitted, and "
        "the one with the least error on sites that were left out is kept, which takes three "
        "times as long"),
    OPT_REAL(inplane_n_m, "inplane-n-m", "K", 0, 1e4, 1,
             "in-plane stiffness of the skin in stage 3; chosen, not fitted"),
    OPT_REAL(tangential_n_m3, "tangential-n-m3", "G", 0, 1e8, 1,
             "stiffness per area against sliding along the skin in stage 3; chosen"),
    OPT_FLAG(
        def.uniform_shear, "uniform-shear",
        "one shear stiffness and limit for the whole skin in stage 3; default: a field like k0 "
        "and xm"),
    OPT_REAL(def.smoothness_sd, "smoothness", "SD", 1e-4, 10, 1,
             "of ln k0 and ln xm per site spacing in stage 3; default: the one that predicts sites "
             "left out one by one best"),
    OPT_WORD(hold_out, "hold-out", "KIND", HOLD_OUTS,
             "sites (eight parts in turn), probe (each in turn) or depth (the deepest quarter): "
             "refit without them and print the error on them"),
    OPT_TEXT(also, "also", "FILE",
             "with --hold-out sites: measurements of other probes, which were not fitted, that the "
             "refits predict too, each at the sites that it has not seen; with --layers: every law "
             "predicts them"),
    OPT_FLAG(layers, "layers",
             "fit stage 3 again with other laws between neighbours and print their errors beside "
             "ours: pre-tension (T), pre-tension and stiffening (J). The model keeps our law: the "
             "others are laws of the fit only"),
    OPT_FLAG(profile, "profile",
             "profile likelihood of the shear stiffness: all else refitted at nine values, and the "
             "interval where the likelihood has dropped by what 95 % allow"),
    OPT_FLAG(identify, "identifiability",
             "how certain the parameters would be from each probe alone and from all together"),
    OPT_INTEGER(starts, "starts", "N", 1, 10000,
                "refit from N random points and count how many end in the same optimum"),
    OPT_INTEGER(seed, "seed", "S", 0, 2147483647, "of the random points"),
    OPT_TEXT(
        report, "report", "DIR",
        "write DIR/index.html with figures, tables and intervals; after stage 3 with --profile "
        "and --identifiability"),
    OPT_FLAG(zero, "estimate-zero",
             "estimate the penetration at which every curve begins, its contact zero, in stage 3"),
    OPT_FLAG(tare, "estimate-tare",
             "estimate the force that the sensor reads in the air, of every curve, in stage 3"),
    OPT_REAL(zero_sd_m, "zero-sd-mm", "SD", 0.01, 20, 1e-3,
             "standard deviation of the contact zero beforehand; implies --estimate-zero"),
    OPT_REAL(tare_sd_n, "tare-sd-n", "SD", 1e-3, 20, 1,
             "standard deviation of the tare beforehand; implies --estimate-tare"),
    OPT_REAL(fine_m, "fine-mm", "L", 0.5, 50, 1e-3, "longest skin edge near footprints"),
    OPT_TEXT(sample, "sample", "TABLE",
             "fit force against compression of one specimen between two plates instead, and write "
             "no model: the springs of n = 1, 2, 3 and of a free n, the chosen one by its error on "
             "stretches of compression that were left out. The table has a column compression, "
             "penetration or displacement and a column load or force with their units, as in "
             "Compression (mm)"),
    OPT_REAL(area_m2, "area-mm2", "A", 1, 1e6, 1e-6,
             "cross-section of the specimen; default: from a line such as Diameter: 50mm before "
             "the table's header"),
    OPT_REAL(height_m, "height-mm", "H", 0.1, 1e3, 1e-3,
             "height of the specimen; default: from such a line too"),
    OPT_FLAG(accept, "accept-implausible",
             "fit measurements outside what is known of tissue, with a warning; a table in other "
             "units, or one whose forces do not rise, is refused all the same"),
    OPT_JSON(json),
    OPT_GROUP("Hyperelastic solid"),
    OPT_FLAG(solid, "solid",
             "fit shear modulus and exponent of muscle, fat and skin in the solid of sonde solve "
             "instead, and write the table of moduli that sonde solve --moduli takes"),
    OPT_TEXT(at, "at", "LIST", "sites to fit, with commas between; default all"),
    OPT_TEXT(check, "check", "LIST",
             "sites to predict with what was found, or all: every other one; default none"),
    OPT_INTEGER(depths, "depths", "N", 0, 1000,
                "rows of each curve that count, spread over it; 0: all"),
    OPT_WORD(contact, "contact", "KIND", CONTACTS,
             "how the probes touched: the skin under them held to them, or sliding without "
             "friction"),
    OPT_REAL(hyperelastic.contact.rounding_m, "rounding-mm", "R", 0, 50, 1e-3,
             "rounding around the flat part of the probes"),
    OPT_NUMBERS(prior[SONDE_SOLID_MUSCLE], "muscle-prior", "MU:A", 1e-3, 1e4,
                "believed beforehand: shear modulus in kPa and exponent of the muscle"),
    OPT_NUMBERS(prior[SONDE_SOLID_FAT], "fat-prior", "MU:A", 1e-3, 1e4, "the same of the fat"),
    OPT_NUMBERS(prior[SONDE_SOLID_SKIN], "skin-prior", "MU:A", 1e-3, 1e4, "the same of the skin"),
    OPT_REAL(hyperelastic.ln_shear_sd, "shear-sd", "SD", 1e-3, 10, 1,
             "how loosely: standard deviation of ln MU"),
    OPT_REAL(hyperelastic.ln_exponent_sd, "exponent-sd", "SD", 1e-3, 2, 1, "and of ln A"),
    OPT_REAL(hyperelastic.relative_sd, "unexplained", "SD", 1e-4, 1, 1,
             "share of the forces that no solid of such layers explains"),
    OPT_REAL(hyperelastic.force_sd_n, "noise-n", "SD", 1e-6, 100, 1, "of the sensor"),
    OPT_REAL(hyperelastic.mesh.edge_m, "edge-mm", "E", 0.1, 50, 1e-3,
             "of the solid's faces under the probe"),
    OPT_REAL(hyperelastic.mesh.growth, "growth", "G", 1.05, 3, 1,
             "from face to face away from the probe"),
    OPT_FLAG(beside, "beside",
             "also fit the springs to all sites and print what they say of the same rows with "
             "the site left out")};

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

// What goes with what, and the definition of the fit that follows from it.
static int check(void *from) {
  options *o = from;
  if (o->sample)
    return o->measurements || o->surface || o->sites || o->output
               ? app_usage_error(VERB,
                                 "--sample goes without measurements, surface, sites and model")
               : APP_OK;
  if (o->solid) {
    sonde_fit_solid_def *def = &o->hyperelastic;
    for (int k = 0; k < SONDE_SOLID_LAYERS; ++k) {
      sonde_hyperelastic *m = &def->contact.layer[k];
      m->shear_pa = 1e3 * o->prior[k][0], m->exponent = o->prior[k][1];
      m->bulk_pa = 24 * m->shear_pa;
    }
    def->contact.bonded = o->contact == 0;
    if (o->zero || app_option_given("zero-sd-mm")) def->zero_sd_m = o->zero_sd_m;
    if (o->tare || app_option_given("tare-sd-n")) def->tare_sd_n = o->tare_sd_n;
    return o->kind != SONDE_TWO_LAYER || o->report || o->hold_out >= 0 || o->body == BODY_OTHER
               ? app_usage_error(VERB, "--solid goes without --model, --report, --hold-out and "
                                       "--body other")
               : APP_OK;
  }
  if (o->kind != SONDE_TWO_LAYER) {
    o->bulk.kind = (sonde_model_kind)o->kind;
    return o->report || o->hold_out >= 0
               ? app_usage_error(VERB, "--report and --hold-out need --model two-layer")
               : APP_OK;
  }
  const char *late = o->hold_out >= 0               ? "--hold-out"
                     : o->profile                   ? "--profile"
                     : o->identify                  ? "--identifiability"
                     : o->layers                    ? "--layers"
                     : o->starts                    ? "--starts"
                     : o->exponent == EXPONENT_AUTO ? "--exponent auto"
                                                    : NULL;
  if (late && o->def.stages < 3) return app_usage_error(VERB, "%s needs --stages 3", late);
  if (o->also && !o->layers && o->hold_out != SONDE_HOLD_OUT_SITES)
    return app_usage_error(VERB, "--also needs --hold-out sites or --layers");
  if (o->zero || app_option_given("zero-sd-mm")) o->def.zero_sd_m = o->zero_sd_m;
  if (o->tare || app_option_given("tare-sd-n")) o->def.tare_sd_n = o->tare_sd_n;
  if (o->def.stages < 3 && (o->def.zero_sd_m > 0 || o->def.tare_sd_n > 0))
    return app_usage_error(VERB, "--estimate-zero and --estimate-tare need --stages 3");
  if (o->exponent != EXPONENT_AUTO) o->def.normal_exponent = o->exponent + 1;
  return APP_OK;
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

static const sonde_mesh *given(const sonde_mesh *mesh) { return mesh->vertex_count ? mesh : NULL; }

// provenance: room for the text, which the definition borrows.
static sonde_model_def define_model(const options *a, const fit_inputs *in, char provenance[256]) {
  sonde_model_def def = sonde_model_def_default();
  const char *slash = strrchr(a->measurements, '/');
  snprintf(provenance, 256, "fitted by sonde %s to %.100s", sonde_version(),
           slash ? slash + 1 : a->measurements);
  def.provenance = a->provenance ? a->provenance : provenance;
  if (a->name) def.name = a->name;
  def.skin = &in->skin;
  def.femur = a->body == BODY_OTHER ? &in->femur : given(&in->femur);
  def.fat_interface = given(&in->fat);
  def.muscle_interface = given(&in->muscle);
  def.sites = in->sites.sites;
  def.site_count = in->sites.count;
  def.data = in->measurements.data;
  def.datum_count = in->measurements.count;
  def.fine_edge_m = a->fine_m;
  def.law.inplane_stiffness_n_m = a->inplane_n_m;
  def.law.tangential_stiffness_n_m3 = a->tangential_n_m3;
  return def;
}

static sonde_status leave_out(const options *a, const fit_inputs *in, const sonde_model *model,
                              const sonde_fit_def *def, fit_outcome *out, sonde_error *error) {
  sonde_progress progress = app_progress();
  const sonde_measurements *m = &in->measurements, *also = &in->also;
  double *predicted_n = calloc(m->count + also->count, sizeof *predicted_n);
  if (!predicted_n) return SONDE_MEMORY;
  bool with_also = a->also && a->hold_out == SONDE_HOLD_OUT_SITES;
  sonde_status status =
      with_also ? sonde_fit_hold_out_also(model, &in->sites, m, also, def, &out->result, &progress,
                                          predicted_n, error)
                : sonde_fit_hold_out(model, &in->sites, m, def, &out->result,
                                     (sonde_hold_out)a->hold_out, &progress, predicted_n, error);
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
static const char *exponent_from(const options *a) {
  if (a->exponent == EXPONENT_AUTO) return "chosen by the held-out error";
  return app_option_given("exponent") ? "given" : "given (default)";
}

static sonde_status write_report(const options *a, const fit_inputs *in, const sonde_model *model,
                                 const fit_outcome *out, sonde_error *error) {
  char name[64], command_line[1024];
  app_command_line(command_line, sizeof command_line);
  snprintf(name, sizeof name, "%s, refitted", a->hold_out >= 0 ? HOLD_OUTS[a->hold_out] : "");
  const fit_findings findings = {.model = model,
                                 .sites = &in->sites,
                                 .data = &in->measurements,
                                 .result = &out->result,
                                 .command_line = command_line,
                                 .exponent_from = exponent_from(a),
                                 .hold_out_name = name,
                                 .hold_out = a->hold_out >= 0 ? &out->hold_out : NULL,
                                 .also = out->also.all.count ? &out->also : NULL,
                                 .checks = &out->checks,
                                 .doubts = &out->doubts,
                                 .path = a->measurements};
  sonde_progress progress = app_progress();
  sonde_status status = fit_report_write(&findings, a->report, &progress, error);
  app_progress_end();
  return status;
}

// Refuses what no tissue gives, warns of what is doubtful: from the doubt number `first` on.
static sonde_status decide(const options *a, const fit_outcome *out, uint32_t first,
                           sonde_error *error) {
  sonde_status status = fit_doubts_decide(&out->doubts, a->measurements, a->accept, error);
  if (!status) fit_doubts_print(&out->doubts, first, a->measurements);
  return status;
}

// Settles a probe a little below the site in the middle, as the first look at the model will, and
// reads the bone, where it has one.
static sonde_status settle_once(const sonde_model *model, const char *name, sonde_error *error) {
  enum { MOST_ITERATIONS = 400 };
  static const double DEPTH_M = 2e-3, RESIDUAL = 1e-6;
  assert(model->site_count > 0);
  sonde_status status = SONDE_OK;
  if (model->femur.face_count) {
    sonde_interior *interior = NULL;
    status = sonde_interior_create(model, &interior, error);
    sonde_interior_destroy(interior);
  }

  // The site nearest to the middle of all.
  sonde_vec3 middle = {0, 0, 0};
  const sonde_site *site = model->sites;
  double nearest = INFINITY;
  for (uint32_t k = 0; k < model->site_count; ++k) {
    middle.x += model->sites[k].position_m.x / model->site_count;
    middle.y += model->sites[k].position_m.y / model->site_count;
    middle.z += model->sites[k].position_m.z / model->site_count;
  }
  for (uint32_t k = 0; k < model->site_count; ++k) {
    sonde_vec3 p = model->sites[k].position_m;
    double away = hypot(hypot(p.x - middle.x, p.y - middle.y), p.z - middle.z);
    if (away < nearest) nearest = away, site = &model->sites[k];
  }

  sonde_world_def world = sonde_world_def_default();
  world.engine = SONDE_ENGINE_DOUBLE; // nothing but equilibria
  sonde_state *state = NULL;
  sonde_probe probe = {0};
  if (!status) status = sonde_probe_create(name, &probe, error);
  if (!status) status = sonde_state_create(model, &world, &state, error);
  if (!status) {
    sonde_settle_result r =
        sonde_settle(state, &probe, sonde_site_pose(site, DEPTH_M), RESIDUAL, MOST_ITERATIONS);
    if (!r.converged || !isfinite(r.reaction_n))
      status = app_error(error, SONDE_CONVERGENCE,
                         "the fitted model does not come to rest under the probe %s at site %u, "
                         "%g mm deep: residual %.2g; nothing was written",
                         name, site->id, 1e3 * DEPTH_M, r.residual);
  }
  sonde_state_destroy(state);
  sonde_probe_clear(&probe);
  return status;
}

static sonde_status fit_model(const options *a, const fit_inputs *in, fit_outcome *out,
                              sonde_error *error) {
  sonde_model *model = NULL;
  sonde_fit_result *result = &out->result;
  sonde_fit_def def = a->def;
  sonde_progress progress = app_progress();
  char provenance[256];
  const sonde_model_def model_def = define_model(a, in, provenance);
  sonde_status status = sonde_model_build(&model_def, &model, error);
  if (!status && a->body == BODY_OTHER) model->vein.count = model->artery.count = 0;

  // The estimate; the checks behind it need the exponent that it chose.
  if (!status && a->exponent == EXPONENT_AUTO) {
    status = sonde_fit_exponents(model, &in->sites, &in->measurements, &def, &progress, out->tried,
                                 result, error);
    if (!status) def.normal_exponent = result->law.normal_exponent;
  } else if (!status) {
    status = sonde_fit(model, &in->sites, &in->measurements, &def, &progress, result, error);
  }
  app_progress_end();

  // Parameters that no tissue has are refused as measurements are.
  uint32_t before = out->doubts.count;
  if (!status) status = sonde_fit_examine(model, &in->measurements, result, &out->doubts, error);
  if (!status) status = decide(a, out, before, error);

  // The model: a probe is settled on it before it is written, and the file is read back.
  if (!status)
    status =
        sonde_model_set_parameters(model, &result->law, result->sites, result->site_count, error);
  for (uint32_t i = 0; !status && i < model->datum_count; ++i) {
    sonde_datum *d = &model->data[i]; // kept without the contact zero and the tare of its curve
    for (uint32_t c = 0; c < result->curve_count; ++c) {
      const sonde_curve_fit *curve = &result->curves[c];
      if (curve->site != d->site || strcmp(curve->probe, d->probe) != 0) continue;
      d->penetration_m = fmax(d->penetration_m - curve->zero_m, 0);
      d->force_n -= curve->tare_n;
    }
  }
  if (!status) status = settle_once(model, in->measurements.data[0].probe, error);
  if (!status) status = sonde_model_save(model, a->output, error);
  struct stat facts;
  if (!status && stat(a->output, &facts) == 0 && S_ISREG(facts.st_mode)) {
    sonde_model *read = NULL;
    status = sonde_limb_model_load(a->output, &read, error);
    if (!status && read->checksum != model->checksum)
      status =
          app_error(error, SONDE_IO, "%.300s: holds another model than was written", a->output);
    sonde_model_destroy(read);
  }

  // What else can be said of the result.
  if (!status && a->hold_out >= 0) status = leave_out(a, in, model, &def, out, error);
  bool reported = a->report && def.stages == 3;
  out->checks = (fit_checks){.profile = a->profile || reported,
                             .identify = a->identify || reported,
                             .layers = a->layers,
                             .also = a->also ? &in->also : NULL,
                             .starts = (uint32_t)a->starts,
                             .seed = (uint64_t)a->seed};
  if (!status)
    status = fit_checks_run(&out->checks, model, &in->sites, &in->measurements, &def, result,
                            &progress, error);
  app_progress_end();
  if (!status && a->report) status = write_report(a, in, model, out, error);
  sonde_model_destroy(model);
  return status;
}

// Mean and standard deviation of an offset over the curves.
typedef struct spread {
  double mean, sd;
} spread;

static spread spread_of(const sonde_fit_result *r, bool tare) {
  assert(r->curve_count > 0);
  spread s = {0, 0};
  for (uint32_t c = 0; c < r->curve_count; ++c)
    s.mean += (tare ? r->curves[c].tare_n : 1e3 * r->curves[c].zero_m) / r->curve_count;
  for (uint32_t c = 0; c < r->curve_count; ++c) {
    double off = (tare ? r->curves[c].tare_n : 1e3 * r->curves[c].zero_m) - s.mean;
    s.sd += off * off / r->curve_count;
  }
  s.sd = sqrt(s.sd);
  return s;
}

// Root mean square over the rows of one curve's repeats about their mean.
static double scatter_of(const sonde_measurements *m) {
  assert(m->count > 0 && m->scatter_n);
  double sum = 0;
  for (uint32_t i = 0; i < m->count; ++i) sum += m->scatter_n[i] * m->scatter_n[i] / m->count;
  return sqrt(sum);
}

static void print_json(const options *a, const sonde_measurements *data, const fit_outcome *out,
                       double seconds) {
  const sonde_fit_result *r = &out->result;
  app_json_begin();
  if (r->stage3.all.count > 0)
    app_json_report("full", &r->stage3);
  else if (r->stage2.all.count > 0)
    app_json_report("simplified", &r->stage2);
  else
    app_json_report("independent", &r->stage1);
  app_json_object("stage1");
  app_json_report("independent", &r->stage1);
  app_json_integer("parameters", r->stage1_parameters);
  app_json_close();
  if (r->stage2.all.count > 0) {
    app_json_object("stage2");
    app_json_report("simplified", &r->stage2);
    app_json("parameters:%u iterations:%u converged:%hhd edge_stiffness_n_m:%g",
             r->stage2_parameters, r->stage2_iterations, r->stage2_converged, r->stage2_edge_n_m);
    app_json_close();
  }
  if (r->stage3.all.count > 0) {
    app_json_object("stage3");
    app_json_report("full", &r->stage3);
    app_json("parameters:%u iterations:%u converged:%hhd", r->parameters, r->iterations,
             r->converged);
    const sonde_fit_confidence *c = &r->confidence;
    app_json("smoothness_sd:%g shear_smoothness_sd:%g ln_shear_sd:%g ln_limit_sd:%g "
             "shear_bootstrap_low_n_m:%g shear_bootstrap_high_n_m:%g limit_bootstrap_low:%g "
             "limit_bootstrap_high:%g",
             c->smoothness_sd, c->shear_smoothness_sd, c->ln_shear_sd, c->ln_limit_sd,
             c->shear_95[0], c->shear_95[1], c->limit_95[0], c->limit_95[1]);
    app_json_object("one_site_out");
    app_json_report("full", &c->one_out);
    app_json_close();
    app_json_close();
  }
  if (a->hold_out >= 0) {
    app_json_object("hold_out");
    app_json_text("kind", HOLD_OUTS[a->hold_out]);
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
      app_json("mae_percent:%g held_out_percent:%g converged:%hhd", out->tried[k].mae_percent,
               out->tried[k].held_out_percent, out->tried[k].converged);
      app_json_close();
    }
    app_json_close();
  }
  app_json_real("normal_exponent", r->law.normal_exponent);
  if (a->def.stages >= 3) app_json_text("normal_exponent_from", exponent_from(a));
  fit_checks_print_json(&out->checks);
  spread zero = spread_of(r, false), tare = spread_of(r, true);
  app_json("unloading_rows:%u repeats:%u", data->unloading, data->repeats);
  if (data->scatter_n) app_json_real("repeat_mean_sd_n", scatter_of(data));
  if (a->def.zero_sd_m > 0) {
    app_json("zero_mean_mm:%g zero_sd_mm:%g", zero.mean, zero.sd);
  }
  if (a->def.tare_sd_n > 0) {
    app_json("tare_mean_n:%g tare_sd_n:%g", tare.mean, tare.sd);
  }
  fit_doubts_print_json(&out->doubts, a->measurements);
  app_json("parameters:%u model:%s edge_stiffness_n_m:%g edge_pretension_n:%g "
           "shear_stiffness_n_m:%g shear_limit:%g inplane_stiffness_n_m:%g seconds:%g",
           r->parameters, a->output, r->law.edge_stiffness_n_m, r->law.edge_pretension_n,
           r->law.shear_stiffness_n_m, r->law.shear_limit, r->law.inplane_stiffness_n_m, seconds);
  app_json_end();
}

static void print_table(const options *a, const sonde_measurements *data, const fit_outcome *out,
                        double seconds) {
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
  if (a->hold_out >= 0) {
    snprintf(title, sizeof title, "left out and predicted by a refit: %s", HOLD_OUTS[a->hold_out]);
    app_print_report(title, &out->hold_out);
    if (out->also.all.count)
      app_print_report("never fitted, predicted at the sites left out", &out->also);
  }
  fit_checks_print(&out->checks);
  if (data->unloading) printf("%u rows of unloading are left out\n", data->unloading);
  if (data->scatter_n)
    printf("up to %u repeats of a curve; standard deviation of their mean %.3g N\n", data->repeats,
           scatter_of(data));
  spread zero = spread_of(r, false), tare = spread_of(r, true);
  if (a->def.zero_sd_m > 0)
    printf("contact zero of the curves: %+.3f mm, standard deviation %.3f mm\n", zero.mean,
           zero.sd);
  if (a->def.tare_sd_n > 0)
    printf("tare of the curves: %+.3f N, standard deviation %.3f N\n", tare.mean, tare.sd);
  printf("wrote %s in %.2f s\n", a->output, seconds);
}

static int run(void *from) {
  const options *a = from;
  double start = app_seconds(CLOCK_MONOTONIC);
  if (a->sample) {
    bool chosen = !app_option_given("exponent") || a->exponent == EXPONENT_AUTO;
    return fit_sample_run(&(fit_sample_options){.path = a->sample,
                                                .exponent = chosen ? 0 : a->exponent + 1,
                                                .area_m2 = a->area_m2,
                                                .height_m = a->height_m,
                                                .accept_implausible = a->accept,
                                                .json = a->json});
  }
  assert(a->measurements && a->surface && a->sites && a->output);

  fit_outcome out = {0};
  fit_inputs inputs = {0};
  sonde_error error = {0};
  sonde_status status = sonde_site_table_load(a->sites, &inputs.sites, &error);
  if (!status)
    status = sonde_measurements_load(a->measurements, &inputs.sites, &inputs.measurements, &error);
  if (!status && a->also)
    status = sonde_measurements_load(a->also, &inputs.sites, &inputs.also, &error);
  if (!status) status = sonde_mesh_load(a->surface, 1e-3, &inputs.skin, &error);
  // Of another body only the bone that is named counts.
  if (!status && (a->femur || a->body == BODY_LIMB))
    status = load_layer(a->femur, a->surface, "femur.ply", &inputs.femur, &error);
  if (!status)
    status = load_layer(a->fat, a->surface, "fat_skin_interface.ply", &inputs.fat, &error);
  if (!status)
    status = load_layer(a->muscle, a->surface, "muscle_surface.ply", &inputs.muscle, &error);
  if (!status) status = sonde_measurements_examine(&inputs.measurements, &out.doubts, &error);
  if (!status) status = decide(a, &out, 0, &error);
  if (!status && (a->solid || a->kind != SONDE_TWO_LAYER)) {
    char provenance[256];
    const sonde_model_def def = define_model(a, &inputs, provenance);
    const fit_bulk_job bulk = {&def,     &inputs.sites, &inputs.measurements,
                               &a->bulk, a->output,     a->json};
    const fit_solid_job solid = {.def = &def,
                                 .sites = &inputs.sites,
                                 .measurements = &inputs.measurements,
                                 .also = &inputs.also,
                                 .options = &a->hyperelastic,
                                 .at = a->at,
                                 .check = a->check,
                                 .depths = (uint32_t)a->depths,
                                 .beside = a->beside,
                                 .output = a->output,
                                 .json = a->json};
    status = a->solid ? fit_solid_run(&solid, &error) : fit_bulk_run(&bulk, &error);
    out.result.converged = true;
  } else if (!status) {
    status = fit_model(a, &inputs, &out, &error);
  }
  double seconds = app_seconds(CLOCK_MONOTONIC) - start;
  if (!status && a->kind == SONDE_TWO_LAYER && !a->solid)
    (a->json ? print_json : print_table)(a, &inputs.measurements, &out, seconds);
  int code = status ? app_fail(VERB, &error) : APP_OK;
  if (!status && !out.result.converged)
    fprintf(stderr, "sonde fit: the last stage reached its iteration limit before it converged\n");
  sonde_fit_result_clear(&out.result);
  sonde_site_table_clear(&inputs.sites);
  sonde_measurements_clear(&inputs.measurements);
  sonde_measurements_clear(&inputs.also);
  sonde_mesh_clear(&inputs.skin);
  sonde_mesh_clear(&inputs.femur);
  sonde_mesh_clear(&inputs.fat);
  sonde_mesh_clear(&inputs.muscle);
  return code;
}

// Many subjects have a form of their own.
static const app_command *pick(int argc, char **argv) {
  for (int i = 1; i < argc && strcmp(argv[i], "--") != 0; ++i)
    if (strncmp(argv[i], "--cohort", 8) == 0 && (!argv[i][8] || argv[i][8] == '='))
      return &fit_cohort;
  return NULL;
}

const app_command cmd_fit = {
    .verb = "fit",
    .summary = "fit a thigh to measurements and write a model file",
    .usage =
        "MEASUREMENTS.csv --surface SKIN.ply --sites SITES.csv -o MODEL [options]\n"
        "MEASUREMENTS.csv --surface SKIN.ply --sites SITES.csv -o MODULI.csv --solid [options]\n"
        "--sample TABLE.csv [--exponent N] [--area-mm2 A --height-mm H] [--json]\n"
        "--cohort LIST -o DIR [--shard I/N] [--json] [-- OPTIONS]",
    .text = "Estimates the normal springs f(x) = x/(a x + b) of every site, carries them over the "
            "refined skin and writes a thigh model. Stage 1 fits every curve by itself; stage 2 "
            "one pair of parameters per site and one uniform edge stiffness, with the neighbours "
            "of a footprint held still; stage 3 refits with shear between neighbours on the "
            "equilibrium of the whole skin, and says how sure its parameters are. Files are in mm "
            "and N.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .prepare = prepare,
    .required = "MEASUREMENTS.csv surface sites o",
    .form = "sample",
    .check = check,
    .pick = pick,
    .run = run};
