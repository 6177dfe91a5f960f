// sonde generate: makes a thigh from named parameters and a seed, or from scanned surfaces.
#include "leg_scan.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static const char VERB[] = "generate";
enum { MOST_DRAWS = 32 }; // of what finds room in a scanned leg

typedef struct options {
  const char *output, *section;
  leg_scan_files scan;
  int left;
  bool json;
  long seed;
  double fat_m, edge_m, fine_edge_m; // fat NaN: not given
  int sex;                           // -1: drawn
  sonde_thigh known;
} options;

static void prepare(void *to) {
  *(options *)to = (options){.seed = 1,
                             .fat_m = NAN,
                             .edge_m = 6 * 1e-3,
                             .fine_edge_m = 3 * 1e-3,
                             .sex = -1,
                             .scan = {.axes = -1},
                             .known = sonde_thigh_unknown()};
}

typedef struct work {
  sonde_thigh thigh;
  sonde_thigh_shape *shape;
  sonde_model *model;
  sonde_leg_report leg;
  sonde_leg_labels part;
  char drawn[64]; // what the scan does not show
} work;

static const char *const SEXES[] = {"female", "male", NULL};
static const char *const SIDES[] = {"right", "left", NULL};

static const app_option TABLE[] = {
    OPT_INTEGER(seed, "seed", "N", 0, 4294967295, "of what is drawn"),
    OPT_WORD(sex, "sex", "SEX", SEXES, "sex; default drawn"),
    OPT_OUTPUT(output, "o", "MODEL", "the model file"),
    OPT_OUTPUT(section, "section-svg", "FILE",
               "three cross-sections as a drawing, seen from the feet"),
    OPT_REAL(edge_m, "edge-mm", "E", 4, 12, 1e-3, "edges of the skin away from the vein"),
    OPT_REAL(fine_edge_m, "fine-edge-mm", "E", 2, 6, 1e-3, "edges along the vein's course"),
    OPT_JSON(json),
    OPT_GROUP("From a scanned leg: surfaces (.ply, .obj, .stl in mm) or labels; length and girths "
              "are measured, what the scan does not show is drawn"),
    LEG_SCAN_OPTIONS("", "longer than the thigh"),
    OPT_WORD(left, "side", "SIDE", SIDES, "a left leg is mirrored"),
    OPT_GROUP("Parameters; what is not given is drawn"),
    OPT_REAL(fat_m, "fat-mm", "F", 4, 35, 1e-3,
             "mean fat of the four sides at mid-thigh, in usual proportions")};

// The parameters of a thigh, as the library lists them.
static uint32_t list_parameters(app_option *list, uint32_t room) {
  uint32_t count;
  const sonde_parameter *p = sonde_thigh_parameters(&count);
  return app_list_parameters(list, room, p, count, offsetof(options, known));
}

static int check(void *from) {
  options *a = from;
  const int found = leg_scan_check(VERB, "", &a->scan);
  if (found) return found;
  if (a->sex >= 0) a->known.sex = a->sex ? SONDE_SEX_MALE : SONDE_SEX_FEMALE;

  // Fat of the four sides with the proportions of the distributions' means; a side that is given by
  // itself stays.
  double *side[] = {&a->known.fat_front_m, &a->known.fat_inner_m, &a->known.fat_outer_m,
                    &a->known.fat_back_m};
  const double share[] = {1, 1.5, 0.7, 1.1};
  for (int k = 0; k < 4 && !isnan(a->fat_m); ++k)
    if (isnan(*side[k])) *side[k] = a->fat_m / 1.075 * share[k];
  return APP_OK;
}

static void print(const options *a, work *w) {
  sonde_mesh_report mesh = {0};
  (void)sonde_mesh_inspect(&w->model->surface, &mesh, NULL);
  uint32_t count;
  const sonde_parameter *p = sonde_thigh_parameters(&count);
  if (a->json) {
    app_json_begin();
    app_json("seed:%ld sex:%s", a->seed, w->thigh.sex == SONDE_SEX_FEMALE ? "female" : "male");
    app_json_object("parameters");
    for (uint32_t k = 0; k < count; ++k)
      app_json_real(p[k].name, *sonde_parameter_of(&w->thigh, &p[k]) / p[k].unit);
    app_json_close();
    app_json("nodes:%u closed:%hhd smallest_angle_deg:%g volume_l:%g",
             w->model->surface.vertex_count, mesh.closed,
             mesh.smallest_angle_rad * 57.29577951308232, mesh.volume_m3 * 1e3);
    app_json_object("landmarks");
    const sonde_thigh_anatomy *anatomy = w->model->anatomy;
    for (uint32_t k = 0; k < anatomy->landmark_count; ++k) {
      const sonde_landmark *m = &anatomy->landmark[k];
      sonde_vec3 d = {m->skin_m.x - m->vein_m.x, m->skin_m.y - m->vein_m.y,
                      m->skin_m.z - m->vein_m.z};
      app_json_object(m->name);
      app_json("site:%u z_mm:%g vein_depth_mm:%g", m->site, m->skin_m.z * 1e3,
               1e3 * sqrt(d.x * d.x + d.y * d.y + d.z * d.z));
      app_json_close();
    }
    app_json_close();
    if (leg_scan_given(&a->scan)) {
      app_json_integer("rays_missed", w->leg.missed);
      app_json_text("drawn", w->drawn);
    }
    if (a->scan.labels)
      app_json("voxel_mm:%g filled_share:%g", w->part.voxel_m * 1e3, w->part.filled_share);
    app_json_text("model", a->output);
    app_json_end();
    return;
  }
  printf("seed %ld, %s\n", a->seed, w->thigh.sex == SONDE_SEX_FEMALE ? "female" : "male");
  for (uint32_t k = 0; k < count; ++k)
    printf("%-18s %8.2f  %s\n", p[k].name, *sonde_parameter_of(&w->thigh, &p[k]) / p[k].unit,
           p[k].text);
  printf("%u nodes, %.2f l, smallest angle %.1f degrees\n", w->model->surface.vertex_count,
         mesh.volume_m3 * 1e3, mesh.smallest_angle_rad * 57.29577951308232);
  if (w->leg.missed)
    printf("%u of %u rays missed the skin and were filled\n", w->leg.missed, w->leg.rays);
  if (w->part.filled_share > 0)
    printf("%.2g %% of the leg were holes without a label and were filled\n",
           100 * w->part.filled_share);
  if (*w->drawn) printf("not in the scan, drawn by the rules: %s\n", w->drawn);
  printf("%s\n", a->output);
}

// Draws what is not known, takes the shape from that or from the scan, and makes the model of it.
static sonde_status make(const options *a, work *w, uint64_t seed, sonde_error *error) {
  const bool scanned = leg_scan_given(&a->scan);
  sonde_leg_scan scan = leg_scan_of(&a->scan, &w->part, a->left == 1);
  if (!isnan(a->known.length_m)) scan.length_m = a->known.length_m;
  sonde_thigh known = a->known;
  sonde_status status = SONDE_OK;
  // A bone that is drawn follows the girths: it is drawn once more with those of the scan.
  for (int pass = 0; !status && pass < (scanned && !scan.femur ? 2 : 1); ++pass) {
    sonde_thigh_shape_destroy(w->shape);
    w->shape = NULL;
    status = sonde_thigh_draw(&known, seed, &w->thigh, error);
    if (!status)
      status = scanned ? sonde_thigh_shape_scan(&scan, &w->thigh, &w->shape, &w->leg, error)
                       : sonde_thigh_shape_create(&w->thigh, &w->shape, error);
    known.girth_m = w->thigh.girth_m;
    known.girth_proximal_m = w->thigh.girth_proximal_m;
    known.girth_distal_m = w->thigh.girth_distal_m;
  }
  if (scanned)
    snprintf(w->drawn, sizeof w->drawn, "%s%s%s%sbranches, mechanics", scan.femur ? "" : "femur, ",
             scan.muscle ? "" : "fat, ", w->leg.vein_found ? "" : "vein, ",
             w->leg.artery_found ? "" : "artery, ");

  char provenance[200];
  snprintf(provenance, sizeof provenance, "Synthetic: %s%s, seed %ld",
           scanned ? "scanned leg with generated " : "generated thigh, not measured on a person",
           w->drawn, a->seed);
  sonde_thigh_def def = sonde_thigh_def_default();
  def.name = scanned ? "scanned thigh" : "generated thigh";
  def.provenance = provenance;
  def.edge_m = a->edge_m;
  def.fine_edge_m = a->fine_edge_m;
  return status ? status : sonde_thigh_build(&w->thigh, w->shape, &def, &w->model, error);
}

static int run(void *from) {
  const options *a = from;
  assert(a->output);
  work w = {0};
  sonde_error error = {0}, later;
  app_progress_begin("making the thigh");
  sonde_status status = leg_scan_load(&a->scan, &w.part, &error);

  // What is drawn may find no room in a leg that is given; then it is drawn again, from numbers
  // that no other seed takes. The first complaint is the one to tell.
  const int tries = leg_scan_given(&a->scan) ? MOST_DRAWS : 1;
  bool loaded = !status;
  for (int k = 0; loaded && (k == 0 || status == SONDE_ARGUMENT) && k < tries; ++k)
    status = make(a, &w, (uint64_t)a->seed + ((uint64_t)k << 32), k ? &later : &error);
  if (!status) status = sonde_model_save(w.model, a->output, &error);
  if (!status && a->section) status = sonde_thigh_sections(w.model, a->section, &error);

  app_progress_end();
  if (!status) print(a, &w);
  sonde_model_destroy(w.model);
  sonde_thigh_shape_destroy(w.shape);
  sonde_leg_labels_clear(&w.part);
  return status ? app_fail(VERB, &error) : APP_OK;
}

const app_command cmd_generate = {
    .verb = "generate",
    .summary = "make a thigh from parameters and a seed",
    .usage =
        "[--seed N] [PARAMETERS] [--skin FILE --femur FILE | --labels FILE] -o MODEL [options]",
    .text = "Makes a thigh: skin, fat, muscle compartments, femur, vessels and the mechanics of a "
            "complete model, which every command that takes a model reads. What is not given is "
            "drawn from documented distributions; equal seeds and parameters give equal files. "
            "Synthetic, not a person.",
    OPT_TABLE(TABLE),
    .extend = list_parameters,
    .size = sizeof(options),
    .prepare = prepare,
    .required = "o",
    .check = check,
    .run = run};
