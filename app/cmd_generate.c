// sonde generate: makes a thigh from named parameters and a seed, or from scanned surfaces.
//
// options:       the fixed ones and one for every parameter of a thigh
// read_scan:     surfaces of a leg from files
// make:          draws, shapes, builds and saves
// print          what was made
#include "fit_common.h"

#include <getopt.h>
#include <math.h>

static const char VERB[] = "generate";
static const char HELP[] =
    "usage: sonde generate [--seed N] [PARAMETERS] [--skin FILE --femur FILE] -o MODEL [options]\n"
    "\n"
    "Makes a thigh: skin, fat, muscle compartments, femur, vessels and the mechanics of a "
    "complete\n"
    "model. What is not given is drawn from documented distributions; equal seeds and parameters\n"
    "give equal files. Synthetic, not a person.\n"
    "\n"
    "  --seed N                   0 to 4294967295; default 1\n"
    "  --sex SEX                  female or male; default drawn\n"
    "  -o MODEL                   the model file\n"
    "  --section-svg FILE         three cross-sections as a drawing\n"
    "  --edge-mm E                edges of the skin away from the vein, 4 to 12; default 6\n"
    "  --fine-edge-mm E           edges along the vein's course, 2 to 6; default 3\n"
    "  --json                     print one JSON object\n"
    "  --help                     this text\n"
    "\n"
    "parameters:\n"
    "  --length-mm, --girth-mm, --girth-proximal-mm, --girth-distal-mm\n"
    "  --fat-mm                   mean of the four sides at mid-thigh, in usual proportions\n"
    "  --fat-front-mm, --fat-back-mm, --fat-inner-mm, --fat-outer-mm, --skin-mm, --oval\n"
    "  --femur-mm, --femur-lateral-mm, --femur-anterior-mm\n"
    "  --vein-mm, --artery-mm, --vein-angle-deg, --vein-cover-mm, --canal-cover-mm\n"
    "  --saphenous-mm, --deep-branch-mm, --second-vein\n"
    "  --stiffness, --damping-ms\n"
    "Ranges and meanings: sonde-generate(1).\n"
    "\n"
    "from a scanned leg (.ply, .obj, .stl in mm; length and girths are measured):\n"
    "  --skin FILE                skin of a leg, longer than the thigh\n"
    "  --femur FILE               whole femur in the same frame\n"
    "  --muscle FILE              envelope of the muscles; without it fat comes from parameters\n"
    "  --side SIDE                right or left; default right; a left leg is mirrored\n";

// Option numbers of getopt_long: a parameter's index is added to PARAMETER.
enum { PARAMETER = 1000, MOST_PARAMETERS = 40, FIXED = 13 };

typedef struct arguments {
  const char *output, *section, *skin, *femur, *muscle;
  bool left, json;
  long seed;
  double fat_mm, edge_mm, fine_edge_mm;
  sonde_thigh known;
} arguments;

typedef struct work {
  sonde_thigh thigh;
  sonde_thigh_shape *shape;
  sonde_model *model;
  sonde_leg_report leg;
  sonde_mesh skin, femur, muscle;
} work;

static double *member(sonde_thigh *thigh, const sonde_thigh_parameter *p) {
  return (double *)(void *)((char *)thigh + p->offset);
}

static bool read_choice(const char *option, const char *text, const char *a, const char *b,
                        bool *second) {
  *second = strcmp(text, b) == 0;
  if (*second || strcmp(text, a) == 0) return true;
  app_usage_error(VERB, "%s expects %s or %s, got '%s'", option, a, b, text);
  return false;
}

static bool read_parameter(arguments *a, uint32_t index, const char *text) {
  uint32_t count;
  const sonde_thigh_parameter *p = &sonde_thigh_parameters(&count)[index];
  char option[40];
  double value;
  snprintf(option, sizeof option, "--%s", p->name);
  if (!app_parse_real(VERB, option, text, p->low / p->unit, p->high / p->unit, &value))
    return false;
  *member(&a->known, p) = value * p->unit;
  return true;
}

// -1: go on.
static int read_option(arguments *a, int c, const char *text) {
  bool good = true, second = false;
  switch (c) {
  case 'n': good = app_parse_integer(VERB, "--seed", text, 0, 4294967295, &a->seed); break;
  case 'x':
    good = read_choice("--sex", text, "female", "male", &second);
    a->known.sex = second ? SONDE_SEX_MALE : SONDE_SEX_FEMALE;
    break;
  case 'd': good = read_choice("--side", text, "right", "left", &a->left); break;
  case 'o': a->output = text; break;
  case 'v': a->section = text; break;
  case 'e': good = app_parse_real(VERB, "--edge-mm", text, 4, 12, &a->edge_mm); break;
  case 'f': good = app_parse_real(VERB, "--fine-edge-mm", text, 2, 6, &a->fine_edge_mm); break;
  case 't': good = app_parse_real(VERB, "--fat-mm", text, 4, 35, &a->fat_mm); break;
  case 's': a->skin = text; break;
  case 'm': a->femur = text; break;
  case 'u': a->muscle = text; break;
  case 'j': a->json = true; break;
  case 'h': fputs(HELP, stdout); return APP_OK;
  default: good = c >= PARAMETER && read_parameter(a, (uint32_t)(c - PARAMETER), text);
  }
  return good ? -1 : APP_BAD_INPUT;
}

static void list_options(struct option *list) {
  static const struct option HEAD[] = {{"seed", required_argument, NULL, 'n'},
                                       {"sex", required_argument, NULL, 'x'},
                                       {"section-svg", required_argument, NULL, 'v'},
                                       {"edge-mm", required_argument, NULL, 'e'},
                                       {"fine-edge-mm", required_argument, NULL, 'f'},
                                       {"fat-mm", required_argument, NULL, 't'},
                                       {"skin", required_argument, NULL, 's'},
                                       {"femur", required_argument, NULL, 'm'},
                                       {"muscle", required_argument, NULL, 'u'},
                                       {"side", required_argument, NULL, 'd'},
                                       {"json", no_argument, NULL, 'j'},
                                       {"help", no_argument, NULL, 'h'}};
  uint32_t count, used = 0;
  const sonde_thigh_parameter *p = sonde_thigh_parameters(&count);
  for (; used < sizeof HEAD / sizeof HEAD[0]; ++used) list[used] = HEAD[used];
  for (uint32_t k = 0; k < count && k < MOST_PARAMETERS; ++k)
    list[used++] = (struct option){p[k].name, required_argument, NULL, PARAMETER + (int)k};
  list[used] = (struct option){NULL, 0, NULL, 0};
}

// Fat of the four sides with the proportions of the distributions' means; a side that is given by
// itself stays.
static void spread_fat(arguments *a) {
  if (isnan(a->fat_mm)) return;
  double front = a->fat_mm * 1e-3 / 1.075;
  double *side[] = {&a->known.fat_front_m, &a->known.fat_inner_m, &a->known.fat_outer_m,
                    &a->known.fat_back_m};
  const double share[] = {1, 1.5, 0.7, 1.1};
  for (int k = 0; k < 4; ++k)
    if (isnan(*side[k])) *side[k] = front * share[k];
}

static int read_arguments(int argc, char **argv, arguments *a) {
  struct option list[FIXED + MOST_PARAMETERS];
  list_options(list);
  for (int c; (c = getopt_long(argc, argv, "o:", list, NULL)) != -1;) {
    int code = read_option(a, c, optarg);
    if (code >= 0) return code;
  }
  if (optind < argc) return app_usage_error(VERB, "'%s' is too much", argv[optind]);
  if (!a->output) return app_usage_error(VERB, "-o MODEL is missing");
  if (!a->skin != !a->femur)
    return app_usage_error(VERB, "--skin and --femur go together, one is missing");
  if (a->muscle && !a->skin) return app_usage_error(VERB, "--muscle needs --skin and --femur");
  spread_fat(a);
  return -1;
}

static sonde_status read_scan(const arguments *a, work *w, sonde_error *error) {
  sonde_status status = sonde_mesh_load(a->skin, 1e-3, &w->skin, error);
  if (!status) status = sonde_mesh_load(a->femur, 1e-3, &w->femur, error);
  if (!status && a->muscle) status = sonde_mesh_load(a->muscle, 1e-3, &w->muscle, error);
  sonde_leg_scan scan = {&w->skin, &w->femur, a->muscle ? &w->muscle : NULL, a->left};
  return status ? status : sonde_thigh_shape_scan(&scan, &w->thigh, &w->shape, &w->leg, error);
}

static sonde_status make(const arguments *a, work *w, sonde_error *error) {
  sonde_status status = sonde_thigh_draw(&a->known, (uint64_t)a->seed, &w->thigh, error);
  if (!status)
    status =
        a->skin ? read_scan(a, w, error) : sonde_thigh_shape_create(&w->thigh, &w->shape, error);
  if (status) return status;
  char provenance[200];
  snprintf(provenance, sizeof provenance, "Synthetic: %s, seed %ld",
           a->skin ? "scanned surfaces with generated vessels and mechanics"
                   : "generated thigh, not measured on a person",
           a->seed);
  sonde_thigh_def def = sonde_thigh_def_default();
  def.name = a->skin ? "scanned thigh" : "generated thigh";
  def.provenance = provenance;
  def.edge_m = a->edge_mm * 1e-3;
  def.fine_edge_m = a->fine_edge_mm * 1e-3;
  status = sonde_thigh_build(&w->thigh, w->shape, &def, &w->model, error);
  if (!status) status = sonde_model_save(w->model, a->output, error);
  if (!status && a->section) status = sonde_thigh_sections(w->model, a->section, error);
  return status;
}

static double distance(sonde_vec3 a, sonde_vec3 b) {
  return sqrt((a.x - b.x) * (a.x - b.x) + (a.y - b.y) * (a.y - b.y) + (a.z - b.z) * (a.z - b.z));
}

static void print_json(const arguments *a, work *w, const sonde_mesh_report *mesh) {
  uint32_t count;
  const sonde_thigh_parameter *p = sonde_thigh_parameters(&count);
  app_json_begin();
  app_json_integer("seed", a->seed);
  app_json_text("sex", w->thigh.sex == SONDE_SEX_FEMALE ? "female" : "male");
  app_json_object("parameters");
  for (uint32_t k = 0; k < count; ++k)
    app_json_real(p[k].name, *member(&w->thigh, &p[k]) / p[k].unit);
  app_json_close();
  app_json_integer("nodes", w->model->surface.vertex_count);
  app_json_bool("closed", mesh->closed);
  app_json_real("smallest_angle_deg", mesh->smallest_angle_rad * 57.29577951308232);
  app_json_real("volume_l", mesh->volume_m3 * 1e3);
  app_json_object("landmarks");
  const sonde_thigh_anatomy *anatomy = w->model->anatomy;
  for (uint32_t k = 0; k < anatomy->landmark_count; ++k) {
    const sonde_landmark *m = &anatomy->landmark[k];
    app_json_object(m->name);
    app_json_integer("site", m->site);
    app_json_real("z_mm", m->skin_m.z * 1e3);
    app_json_real("vein_depth_mm", distance(m->skin_m, m->vein_m) * 1e3);
    app_json_close();
  }
  app_json_close();
  if (a->skin) app_json_integer("rays_missed", w->leg.missed);
  app_json_text("model", a->output);
  app_json_end();
}

static void print(const arguments *a, work *w) {
  sonde_mesh_report mesh = {0};
  (void)sonde_mesh_inspect(&w->model->surface, &mesh, NULL);
  if (a->json) {
    print_json(a, w, &mesh);
    return;
  }
  uint32_t count;
  const sonde_thigh_parameter *p = sonde_thigh_parameters(&count);
  printf("seed %ld, %s\n", a->seed, w->thigh.sex == SONDE_SEX_FEMALE ? "female" : "male");
  for (uint32_t k = 0; k < count; ++k)
    printf("%-18s %8.2f  %s\n", p[k].name, *member(&w->thigh, &p[k]) / p[k].unit, p[k].text);
  printf("%u nodes, %.2f l, smallest angle %.1f degrees\n", w->model->surface.vertex_count,
         mesh.volume_m3 * 1e3, mesh.smallest_angle_rad * 57.29577951308232);
  if (a->skin && w->leg.missed)
    printf("%u of %u rays missed the skin and were filled\n", w->leg.missed, w->leg.rays);
  printf("%s\n", a->output);
}

int old_generate(int argc, char **argv);
int old_generate(int argc, char **argv) {
  arguments a = {.seed = 1, .fat_mm = NAN, .edge_mm = 6, .fine_edge_mm = 3};
  a.known = sonde_thigh_unknown();
  int code = read_arguments(argc, argv, &a);
  if (code >= 0) return code;
  work w = {0};
  sonde_error error = {0};
  app_progress_begin("making the thigh");
  sonde_status status = make(&a, &w, &error);
  app_progress_end();
  if (!status) print(&a, &w);
  sonde_model_destroy(w.model);
  sonde_thigh_shape_destroy(w.shape);
  sonde_mesh_clear(&w.skin);
  sonde_mesh_clear(&w.femur);
  sonde_mesh_clear(&w.muscle);
  return status ? app_fail(VERB, &error) : APP_OK;
}
