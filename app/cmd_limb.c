// sonde limb: a lower limb from a body and a seed: its table, labelled sections, a view, a walk
// along the vein, stations; at rest or in a position.
#include "leg_scan.h"
#include "limb_film.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static const char VERB[] = "limb";

typedef struct options {
  const char *atlas, *skin, *levels, *model, *film, *measured;
  double measured_from_m;
  leg_scan_files scan;
  bool json, stations;
  long seed;
  int sex, side, position; // -1: drawn, right, at rest
  sonde_limb_body known;
} options;

static void prepare(void *to) {
  *(options *)to = (options){.seed = 1,
                             .sex = -1,
                             .side = -1,
                             .position = -1,
                             .measured_from_m = NAN,
                             .scan = {.axes = -1},
                             .known = sonde_limb_unknown()};
}

static const char *const SEXES[] = {"female", "male", NULL};
static const char *const SIDES[] = {"right", "left", NULL};
// In the order of sonde_limb_position.
static const char *const POSITIONS[] = {"supine-turned", "prone-bent", "sitting", "supine",
                                        "prone",         "standing",   NULL};

static const app_option TABLE[] = {
    OPT_INTEGER(seed, "seed", "N", 0, 4294967295, "of what is drawn"),
    OPT_WORD(sex, "sex", "SEX", SEXES, "sex; default drawn"),
    OPT_WORD(side, "side", "SIDE", SIDES, "side; a left limb is the mirror of a right one"),
    OPT_WORD(
        position, "position", "NAME", POSITIONS,
        "position of the view, the skin, the film, the stations and the model; default straight, "
        "lying"),
    OPT_FLAG(stations, "stations", "list the stations of an examination too"),
    OPT_TEXT(atlas, "atlas", "DIR",
             "write labelled sections and a view as SVG, and a table, into a directory"),
    OPT_TEXT(levels, "levels", "L,L...",
             "levels of the sections: 0 hip, 1 knee joint line, 2 ankle; default -0.05 to 1.9"),
    OPT_OUTPUT(film, "film", "FILE", "write a walk along the main vein as an animated PNG"),
    OPT_OUTPUT(skin, "skin", "FILE",
               "write the skin as .ply, .obj or .stl, mm; x y z to the patient's left, back and "
               "head (LPS)"),
    OPT_OUTPUT(model, "model", "FILE",
               "write the limb as a model (.sonde) that can be pressed and imaged"),
    OPT_TEXT(measured, "measured", "FILE",
             "a fitted thigh (.sonde, from sonde fit) that takes its part of the limb: the body "
             "is as thick, the springs are those of the measurements"),
    OPT_REAL(measured_from_m, "measured-from-mm", "X", -50, 400, 1e-3,
             "where that thigh's z = 0 lies below the hip joint; default its middle at that of the "
             "thigh"),
    OPT_JSON(json),
    OPT_GROUP("From a scanned leg: surfaces (.ply, .obj, .stl in mm) or labels; lengths, girths, "
              "fat and bones that it shows are measured, all else is drawn"),
    LEG_SCAN_OPTIONS("scan-", "from the groin to below the ankle, with a femur to the knee"),
    OPT_GROUP("Parameters of the body; what is not given is drawn")};

// The parameters of a body, as the library lists them.
static uint32_t list_parameters(app_option *list, uint32_t room) {
  uint32_t count;
  const sonde_parameter *p = sonde_limb_parameters(&count);
  return app_list_parameters(list, room, p, count, offsetof(options, known));
}

enum { MOST_LEVELS = 40 };

// Levels of --levels; 0 after saying what is wrong.
static uint32_t read_levels(const char *text, double *level) {
  static const double USUAL[] = {-0.05, 0.05, 0.15, 0.25, 0.5,  0.62, 0.75,
                                 0.9,   1.06, 1.25, 1.5,  1.75, 1.9};
  if (!text) {
    memcpy(level, USUAL, sizeof USUAL);
    return sizeof USUAL / sizeof *USUAL;
  }
  const uint32_t count = app_read_numbers(text, -0.2, 2, level, MOST_LEVELS);
  if (count == 0)
    app_usage_error(VERB,
                    "--levels: expected up to %d numbers from -0.2 to 2 with commas between "
                    "them, but got '%s'",
                    MOST_LEVELS, text);
  return count;
}

static int check(void *from) {
  options *a = from;
  double level[MOST_LEVELS];
  if (a->levels && !a->atlas) return app_usage_error(VERB, "--levels needs --atlas");
  if (!read_levels(a->levels, level)) return APP_BAD_INPUT;
  if (!isnan(a->measured_from_m) && !a->measured)
    return app_usage_error(VERB, "--measured-from-mm needs --measured");
  if (leg_scan_given(&a->scan) && a->measured)
    return app_usage_error(VERB, "--measured goes without a scan");
  const int found = leg_scan_check(VERB, "scan-", &a->scan);
  if (found) return found;
  if (a->sex >= 0) a->known.sex = a->sex ? SONDE_SEX_MALE : SONDE_SEX_FEMALE;
  a->known.side = a->side == 1 ? SONDE_LIMB_LEFT : SONDE_LIMB_RIGHT;
  return APP_OK;
}

static void put_point(const char *key, sonde_vec3 p, double unit) {
  app_json_array(key);
  app_json_real(NULL, p.x * unit);
  app_json_real(NULL, p.y * unit);
  app_json_real(NULL, p.z * unit);
  app_json_close();
}

// Stations in the position asked for, or at rest.
static void find_stations(const sonde_limb *limb, const sonde_limb_pose *pose,
                          sonde_limb_station station[SONDE_LIMB_STATIONS]) {
  if (pose)
    sonde_limb_pose_stations(pose, station);
  else
    sonde_limb_stations(limb, station);
}

// What the limb was made from, besides parameters.
typedef struct origin {
  sonde_limb_part_fit part;  // of a measured subject
  sonde_limb_body scanned;   // NaN: not in the scan
  double girth_rms, voxel_m; // limb over scan; of the volume
  bool long_thigh;           // of a skin alone, for its calf
} origin;

static const double GIRTHS[] = {0.12, 0.25, 0.5, 0.75, 0.88, 1, 1.15, 1.28, 1.5, 1.75, 1.86};

static void print_json(const options *a, const sonde_limb *limb, const sonde_limb_pose *pose,
                       origin *from) {
  sonde_limb_body body = *sonde_limb_body_of(limb);
  uint32_t count;
  const sonde_parameter *p = sonde_limb_parameters(&count);
  app_json_begin();
  app_json("seed:%ld sex:%s side:%s", a->seed, body.sex == SONDE_SEX_FEMALE ? "female" : "male",
           body.side == SONDE_LIMB_LEFT ? "left" : "right");
  app_json_object("parameters");
  for (uint32_t k = 0; k < count; ++k) {
    app_json_real(p[k].name, *sonde_parameter_of(&body, &p[k]) / p[k].unit);
  }
  app_json_close();
  app_json_array("girths");
  for (size_t k = 0; k < sizeof GIRTHS / sizeof *GIRTHS; ++k) {
    app_json_object(NULL);
    app_json("level:%g girth_mm:%g", GIRTHS[k], 1e3 * sonde_limb_girth(limb, GIRTHS[k]));
    app_json_close();
  }
  app_json_close();
  app_json_array("muscles");
  for (uint32_t k = 0; k < sonde_limb_muscle_count(); ++k) {
    sonde_limb_muscle m = sonde_limb_muscle_at(limb, k);
    app_json_object(NULL);
    app_json_text("name", m.name);
    app_json("volume_cm3:%g rule_cm3:%g largest_cm2:%g largest_level:%g pennation_deg:%g "
             "fibre_mm:%g",
             m.volume_m3 * 1e6, m.rule_m3 * 1e6, m.largest_m2 * 1e4, m.largest_level,
             m.pennation_rad * 57.29577951308232, m.fibre_m * 1e3);
    app_json_close();
  }
  app_json_close();
  if (a->measured) {
    app_json_object("measured");
    app_json_text("file", a->measured);
    app_json("from_level:%g to_level:%g girth_rms_percent:%g", from->part.from_level,
             from->part.to_level, 100 * from->part.girth_rms);
    app_json_close();
  }
  if (leg_scan_given(&a->scan)) {
    app_json_object("scan");
    app_json_array("measured");
    for (uint32_t k = 0; k < count; ++k)
      if (!isnan(*sonde_parameter_of(&from->scanned, &p[k]))) app_json_text(NULL, p[k].name);
    app_json_close();
    app_json("girth_rms_percent:%g thigh_doubtful:%hhd", 100 * from->girth_rms, from->long_thigh);
    if (a->scan.labels) app_json_real("voxel_mm", 1e3 * from->voxel_m);
    app_json_close();
  }
  if (pose) app_json_text("position", POSITIONS[a->position]);
  if (a->stations) {
    sonde_limb_station station[SONDE_LIMB_STATIONS];
    find_stations(limb, pose, station);
    app_json_array("stations");
    for (uint32_t k = 0; k < SONDE_LIMB_STATIONS; ++k) {
      const sonde_limb_station *s = &station[k];
      app_json_object(NULL);
      app_json_text("name", s->name);
      app_json_text("view", s->view);
      app_json_text("text", s->text);
      app_json_text("position", POSITIONS[s->position]);
      app_json_array("veins");
      for (uint32_t i = 0; i < s->veins; ++i)
        app_json_text(NULL, sonde_limb_vessel_get(limb, s->vein[i]).name);
      app_json_close();
      app_json("level:%g depth_mm:%g force_low_n:%g force_high_n:%g", s->level, s->depth_m * 1e3,
               s->force_n[0], s->force_n[1]);
      put_point("skin_mm", s->skin_m, 1e3);
      put_point("normal", s->normal, 1);
      put_point("target_mm", s->target_m, 1e3);
      app_json_close();
    }
    app_json_close();
  }
  if (a->film) app_json_text("film", a->film);
  if (a->atlas) app_json_text("atlas", a->atlas);
  if (a->skin) app_json_text("skin", a->skin);
  if (a->model) app_json_text("model", a->model);
  app_json_end();
}

static void print_text(const options *a, const sonde_limb *limb, const sonde_limb_pose *pose,
                       origin *from) {
  sonde_limb_body body = *sonde_limb_body_of(limb);
  uint32_t count;
  const sonde_parameter *p = sonde_limb_parameters(&count);
  printf("seed %ld, %s, %s\n", a->seed, body.sex == SONDE_SEX_FEMALE ? "female" : "male",
         body.side == SONDE_LIMB_LEFT ? "left" : "right");
  for (uint32_t k = 0; k < count; ++k) {
    printf("%-20s %8.2f  %s\n", p[k].name, *sonde_parameter_of(&body, &p[k]) / p[k].unit,
           p[k].text);
  }
  if (leg_scan_given(&a->scan)) {
    printf("\nmeasured on the scan:");
    const char *comma = " ";
    for (uint32_t k = 0; k < count; ++k)
      if (!isnan(*sonde_parameter_of(&from->scanned, &p[k])))
        printf("%s%s", comma, p[k].name), comma = ", ";
    printf("; all else is drawn by the rules, vessels too\ngirths within %.1f %% (rms) of the "
           "scan's\n",
           100 * from->girth_rms);
  }
  if (a->measured)
    printf("\n%s from level %.2f to %.2f: girths within %.1f %% (rms), springs of the "
           "measurements\n",
           a->measured, from->part.from_level, from->part.to_level, 100 * from->part.girth_rms);
  printf("\nlevel   girth mm\n");
  for (size_t k = 0; k < sizeof GIRTHS / sizeof *GIRTHS; ++k)
    printf("%5.2f   %8.0f\n", GIRTHS[k], 1e3 * sonde_limb_girth(limb, GIRTHS[k]));
  printf("\n%-30s %10s %9s %12s %6s\n", "muscle", "volume cm3", "rule cm3", "largest cm2", "level");
  double volume = 0, rule = 0;
  for (uint32_t k = 0; k < sonde_limb_muscle_count(); ++k) {
    sonde_limb_muscle m = sonde_limb_muscle_at(limb, k);
    printf("%-30s %10.0f %9.0f %12.1f %6.2f\n", m.name, m.volume_m3 * 1e6, m.rule_m3 * 1e6,
           m.largest_m2 * 1e4, m.largest_level);
    volume += m.volume_m3, rule += m.rule_m3;
  }
  printf("%-30s %10.0f %9.0f\n", "all", volume * 1e6, rule * 1e6);
  if (!a->stations) return;
  sonde_limb_station station[SONDE_LIMB_STATIONS];
  find_stations(limb, pose, station);
  printf("\n%-26s %-4s %-14s %5s %8s %11s  %s\n", "station", "view", "position", "level",
         "depth mm", "force N", "veins");
  for (uint32_t k = 0; k < SONDE_LIMB_STATIONS; ++k) {
    const sonde_limb_station *s = &station[k];
    printf("%-26s %-4s %-14s %5.2f %8.0f %5.1f-%5.1f  ", s->name, s->view, POSITIONS[s->position],
           s->level, s->depth_m * 1e3, s->force_n[0], s->force_n[1]);
    for (uint32_t i = 0; i < s->veins; ++i)
      printf("%s%s", i ? ", " : "", sonde_limb_vessel_get(limb, s->vein[i]).name);
    printf("\n");
  }
}

// The table of the leg: bones' and muscles' measures, every vessel, the stations.
static sonde_status write_table(const sonde_limb *limb, const sonde_limb_pose *pose,
                                const char *path, sonde_error *error) {
  sonde_file *file = NULL;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  sonde_file_printf(file, "part,name,from_level,to_level,length_mm,diameter_mm,volume_cm3,"
                          "depth_mm\n");
  for (uint32_t k = 0; k < sonde_limb_muscle_count(); ++k) {
    sonde_limb_muscle m = sonde_limb_muscle_at(limb, k);
    sonde_file_printf(file, "muscle,\"%s\",,,,,%.1f,\n", m.name, m.volume_m3 * 1e6);
  }
  static const char *const KINDS[] = {"artery", "deep vein", "superficial vein", "perforator",
                                      "muscle vein"};
  for (uint32_t k = 0; k < sonde_limb_vessel_count(limb); ++k) {
    sonde_limb_vessel v = sonde_limb_vessel_get(limb, k);
    double level[2], angle, f, radius = 0;
    for (int end = 0; end < 2; ++end) {
      sonde_vec3 p = sonde_limb_vessel_place(limb, k, end * v.length_m).centre_m;
      sonde_limb_polar(limb, p, &level[end], &angle, &f);
    }
    for (int n = 0; n < 9; ++n) { // mean over the branch
      double arc = (n + 0.5) / 9 * v.length_m;
      radius += (pose ? sonde_limb_pose_place(pose, k, arc) : sonde_limb_vessel_place(limb, k, arc))
                    .radius_m /
                9;
    }
    double length = pose ? sonde_limb_pose_length(pose, k) : v.length_m;
    sonde_file_printf(file, "%s,\"%s\",%.3f,%.3f,%.1f,%.2f,,\n", KINDS[v.kind], v.name, level[0],
                      level[1], length * 1e3, 2e3 * radius);
  }
  sonde_limb_station station[SONDE_LIMB_STATIONS];
  find_stations(limb, pose, station);
  for (uint32_t k = 0; k < SONDE_LIMB_STATIONS; ++k)
    sonde_file_printf(file, "station,\"%s\",%.3f,%.3f,,,,%.1f\n", station[k].name, station[k].level,
                      station[k].level, station[k].depth_m * 1e3);
  return sonde_file_commit(file, error);
}

enum { MOST_DRAWS = 32 }; // of what finds room in a scanned leg
// Thighs of the rules are 1.0 to 1.2 times as long as their calves. A skin that begins above the
// groin crease makes its thigh longer.
static const double LONG_THIGH = 1.25;

// The limb of a scan. What is drawn may find no room in it: then it is drawn again, from numbers
// that no other seed takes. The first complaint is the one to tell.
static sonde_status make_scanned(const options *a, sonde_limb **limb, origin *from,
                                 sonde_error *error) {
  assert(!*limb);
  sonde_leg_labels part = {0};
  sonde_leg_girths girths;
  sonde_error later;
  sonde_limb_body known = a->known, body;
  sonde_status status = leg_scan_load(&a->scan, &part, error);
  const sonde_leg_scan scan = leg_scan_of(&a->scan, &part, a->side == 1);
  if (!status) status = sonde_leg_scan_body(&scan, (uint64_t)a->seed, &known, &girths, error);
  const bool measured = !status;
  for (int k = 0; measured && (k == 0 || status == SONDE_ARGUMENT) && k < MOST_DRAWS; ++k) {
    sonde_error *to = k ? &later : error;
    status = sonde_limb_draw(&known, (uint64_t)a->seed + ((uint64_t)k << 32), &body, to);
    if (!status) status = sonde_limb_create(&body, limb, to);
  }
  if (!status) from->girth_rms = sonde_leg_compare(&girths, *limb);
  const double thigh = known.thigh_length_m / known.calf_length_m;
  from->long_thigh = !status && !scan.femur && isnan(a->known.thigh_length_m) && thigh > LONG_THIGH;
  if (from->long_thigh)
    fprintf(stderr,
            "sonde limb: the thigh is %.2f times as long as the calf, which is much: the skin may "
            "begin above the groin crease. Give --thigh-length-mm or --scan-femur\n",
            thigh);
  // What was given as a parameter was not measured.
  uint32_t count;
  const sonde_parameter *p = sonde_limb_parameters(&count);
  from->scanned = known, from->voxel_m = part.voxel_m;
  from->scanned.stature_m = from->scanned.bmi = NAN; // follow from length and girth
  for (uint32_t k = 0; k < count; ++k)
    if (!isnan(*sonde_parameter_of(&known, &p[k])) &&
        *sonde_parameter_of(&known, &p[k]) == *sonde_parameter_of((void *)&a->known, &p[k]))
      *sonde_parameter_of(&from->scanned, &p[k]) = NAN;
  sonde_leg_labels_clear(&part);
  return status;
}

static int run(void *given) {
  const options *a = given;
  assert(a->seed >= 0);
  sonde_limb *limb = NULL;
  sonde_limb_pose *pose = NULL;
  sonde_mesh skin = {0};
  sonde_error error = {0};
  app_progress_begin("making the limb");
  sonde_model *model = NULL, *subject = NULL;
  sonde_limb_body known = a->known, body;
  sonde_limb_part part = {NULL, a->measured_from_m};
  origin from = {0};
  sonde_status status = a->measured ? sonde_model_load(a->measured, &subject, &error) : SONDE_OK;
  part.model = subject;
  if (!status && subject) status = sonde_limb_part_body(&part, (uint64_t)a->seed, &known, &error);
  if (!status && leg_scan_given(&a->scan))
    status = make_scanned(a, &limb, &from, &error);
  else if (!status) {
    status = sonde_limb_draw(&known, (uint64_t)a->seed, &body, &error);
    if (!status) status = sonde_limb_create(&body, &limb, &error);
  }
  if (!status) body = *sonde_limb_body_of(limb);
  if (!status && subject) status = sonde_limb_part_compare(&part, limb, &from.part, &error);
  if (!status && a->position >= 0) {
    sonde_limb_setting setting = sonde_limb_setting_usual((sonde_limb_position)a->position);
    status = sonde_limb_pose_create(limb, &setting, &pose, &error);
  }
  // The atlas: sections at the levels, then the view.
  double level[MOST_LEVELS];
  uint32_t count = read_levels(a->levels, level);
  char path[1024];
  if (!status && a->atlas) status = sonde_directory_make(a->atlas, 0777, true, &error);
  for (uint32_t k = 0; a->atlas && k < count && !status; ++k) {
    snprintf(path, sizeof path, "%s/section_%+.2f.svg", a->atlas, level[k]);
    status = sonde_limb_section_svg(limb, level[k], path, &error);
  }
  if (!status && a->atlas) {
    snprintf(path, sizeof path, "%s/view.svg", a->atlas);
    status = sonde_limb_view_svg(limb, pose, path, &error);
  }
  if (!status && a->atlas) {
    snprintf(path, sizeof path, "%s/table.csv", a->atlas);
    status = write_table(limb, pose, path, &error);
  }
  if (!status && a->film) status = limb_film_write(limb, pose, a->film, &error);
  sonde_limb_model_def def = sonde_limb_model_def_default();
  char provenance[256];
  if (subject) {
    snprintf(provenance, sizeof provenance, "Synthetic limb; springs of %.60s (%.150s)",
             subject->name, subject->provenance);
    def.part = &part, def.provenance = provenance;
  }
  if (leg_scan_given(&a->scan))
    def.provenance = "Synthetic limb with the measures of a scanned leg";
  sonde_limb_setting setting;
  if (pose) setting = sonde_limb_pose_setting(pose), def.setting = &setting;
  if (!status && a->model) status = sonde_limb_model(&body, &def, &model, &error);
  if (!status && a->model) status = sonde_model_save(model, a->model, &error);
  sonde_model_destroy(model);
  sonde_model_destroy(subject);
  if (!status && a->skin)
    status = pose ? sonde_limb_pose_skin(pose, 0.004, &skin, &error)
                  : sonde_limb_skin(limb, 0.004, &skin, &error);
  if (!status && a->skin) sonde_limb_to_patient(&skin);
  if (!status && a->skin) status = sonde_mesh_save(a->skin, 1e-3, &skin, &error);
  app_progress_end();
  if (!status) (a->json ? print_json : print_text)(a, limb, pose, &from);
  sonde_mesh_clear(&skin);
  sonde_limb_pose_destroy(pose);
  sonde_limb_destroy(limb);
  return status ? app_fail(VERB, &error) : APP_OK;
}

const app_command cmd_limb = {
    .verb = "limb",
    .summary = "make a lower limb from a body and a seed, and draw it",
    .usage = "[--seed N] [PARAMETERS] [--atlas DIR] [options]",
    .text =
        "Makes a lower limb from the groin to the ankle: bones, muscles, fasciae, fat, skin and "
        "vessels, and prints its table. What is not given is drawn by the population's rules; "
        "equal seeds and parameters give equal limbs. Synthetic, not a person.",
    OPT_TABLE(TABLE),
    .extend = list_parameters,
    .size = sizeof(options),
    .prepare = prepare,
    .check = check,
    .run = run};
