// sonde image: one echographic picture of a model, at any pose.
// read_pose:     seven numbers.
// place:         the probe above a site or at a pose, pressed when asked.
// other_vessels: branches that the plane cuts.
// draw:          interior, picture, file.
#include "app.h"
#include "image_findings.h"
#include "settled.h"

#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static const char HELP[] =
    "usage: sonde image [MODEL] (--pose X,Y,Z,QW,QX,QY,QZ | --site K) -o PNG [options]\n"
    "\n"
    "Writes the echographic picture that a probe sees, and tells what it shows.\n"
    "\n"
    "  --pose LIST        world from probe: mm, each -2000 to 2000, and unit quaternion; z is\n"
    "                     the beam\n"
    "  --site K           above this site of the model instead\n"
    "  --turn-deg A       about the beam, -180 to 180; 90 looks along the leg; default 0\n"
    "  --force-n F        press along the beam until the settled force is F (0.01 to 200)\n"
    "  --press-mm D       or press so deep below the rest skin (-10 to 60)\n"
    "  --probe NAME       point, linear, square, sphere, or a mesh file (mm); default linear\n"
    "  --aperture-mm W    width of the array, 5 to 200; default that of the probe; of a curved\n"
    "                     face along the arc, at most half a circle\n"
    "  --curved-mm R      radius of a curved face, 20 to 1000; default flat\n"
    "  --case NAME        healthy, partial_mural, acute_occlusive, subacute_occlusive,\n"
    "                     chronic_occlusive; default healthy\n"
    "  --clot BRANCH:CASE the same for a branch of the model, e.g. great_saphenous\n"
    "  --lesion KIND:X:DEPTH:WIDTH:HEIGHT  node, cyst or haematoma (mm) in the image plane\n"
    "                     before the probe presses; up to 8\n"
    "  --webs W           bands in an old clot of the femoral vein, 0 to 1; default 0\n"
    "  --oedema W         fluid in the fat, 0 to 1; default 0\n"
    "  --depth-mm D       imaged depth, 20 to 150; default 70\n"
    "  --frequency-mhz F  1 to 12; default 7.5\n"
    "  --focus-mm D       5 to 150; default 25\n"
    "  --gain-db G        -30 to 30; default 0\n"
    "  --tgc-db-cm G      on top of the default compensation, -50 to 50; default 0\n"
    "  --range-db R       dynamic range, 30 to 90; default 60\n"
    "  --size WxH         pixels, 16 to 4096; default 512x512\n"
    "  --seed N           of the tissue's scatterers, default 0\n"
    "  -o PNG             the picture\n"
    "  --json             print one JSON object\n"
    "  --help             this text\n"
    "MODEL defaults to the bundled thigh. Without --force-n and --press-mm the skin stays at "
    "rest.\n";

typedef struct options {
  char model[1024];
  const char *probe, *pathology, *out;
  sonde_pose pose;
  bool posed, json;
  long site, width, height, seed;
  double force_n, press_m, turn, aperture_m, radius_m; // NaN when not asked for
  sonde_echo_settings settings;
  image_findings findings;
} options;

enum {
  POSE = 1,
  SITE,
  TURN,
  FORCE,
  PRESS,
  PROBE,
  APERTURE,
  CURVED,
  CASE,
  CLOT,
  LESION,
  WEBS,
  OEDEMA,
  DEPTH,
  FREQUENCY,
  FOCUS,
  GAIN,
  TGC,
  RANGE,
  SIZE,
  SEED,
  JSON
};

static const struct option LONG[] = {{"pose", required_argument, NULL, POSE},
                                     {"site", required_argument, NULL, SITE},
                                     {"turn-deg", required_argument, NULL, TURN},
                                     {"force-n", required_argument, NULL, FORCE},
                                     {"press-mm", required_argument, NULL, PRESS},
                                     {"probe", required_argument, NULL, PROBE},
                                     {"aperture-mm", required_argument, NULL, APERTURE},
                                     {"curved-mm", required_argument, NULL, CURVED},
                                     {"case", required_argument, NULL, CASE},
                                     {"clot", required_argument, NULL, CLOT},
                                     {"lesion", required_argument, NULL, LESION},
                                     {"webs", required_argument, NULL, WEBS},
                                     {"oedema", required_argument, NULL, OEDEMA},
                                     {"depth-mm", required_argument, NULL, DEPTH},
                                     {"frequency-mhz", required_argument, NULL, FREQUENCY},
                                     {"focus-mm", required_argument, NULL, FOCUS},
                                     {"gain-db", required_argument, NULL, GAIN},
                                     {"tgc-db-cm", required_argument, NULL, TGC},
                                     {"range-db", required_argument, NULL, RANGE},
                                     {"size", required_argument, NULL, SIZE},
                                     {"seed", required_argument, NULL, SEED},
                                     {"json", no_argument, NULL, JSON},
                                     {"help", no_argument, NULL, 'h'},
                                     {NULL, 0, NULL, 0}};

// The farthest that a probe may be from the model's origin, as for the page's goals.
static const double FAR_MM = 2000;

static bool read_pose(options *o, const char *text) {
  double v[7];
  char end;
  int read = sscanf(text, "%lf,%lf,%lf,%lf,%lf,%lf,%lf%c", &v[0], &v[1], &v[2], &v[3], &v[4], &v[5],
                    &v[6], &end);
  double norm = 0;
  for (int k = 3; k < 7; ++k) norm += read == 7 ? v[k] * v[k] : 0;
  if (read != 7 || !(fabs(norm - 1) < 1e-2) || !isfinite(v[0] + v[1] + v[2])) {
    app_usage_error("image",
                    "--pose expects X,Y,Z in mm and a unit quaternion QW,QX,QY,QZ, got '%s'", text);
    return false;
  }
  if (!(fabs(v[0]) <= FAR_MM && fabs(v[1]) <= FAR_MM && fabs(v[2]) <= FAR_MM)) {
    app_usage_error("image", "--pose expects X, Y and Z from %g to %g mm, got '%s'", -FAR_MM,
                    FAR_MM, text);
    return false;
  }
  norm = sqrt(norm);
  o->pose.position = (sonde_vec3){v[0] * 1e-3, v[1] * 1e-3, v[2] * 1e-3};
  o->pose.rotation.w = v[3] / norm, o->pose.rotation.x = v[4] / norm;
  o->pose.rotation.y = v[5] / norm, o->pose.rotation.z = v[6] / norm;
  return o->posed = true;
}

static bool read_size(options *o, const char *text) {
  char end;
  if (sscanf(text, "%ldx%ld%c", &o->width, &o->height, &end) == 2 && o->width >= 16 &&
      o->height >= 16 && o->width <= 4096 && o->height <= 4096)
    return true;
  app_usage_error("image", "--size expects WxH from 16x16 to 4096x4096, got '%s'", text);
  return false;
}

// A number in the option's unit, times that unit.
static bool read_real(int option, double low, double high, double unit, double *value) {
  const char *name = "";
  for (const struct option *l = LONG; l->name; ++l)
    if (l->val == option) name = l->name;
  char dashed[32];
  snprintf(dashed, sizeof dashed, "--%s", name);
  double number;
  if (!app_parse_real("image", dashed, optarg, low, high, &number)) return false;
  *value = number * unit;
  return true;
}

// A setting of the scanner, which the page has under the same key.
static bool read_scanner(int option, const char *key, sonde_echo_settings *settings) {
  const sonde_echo_range *range = sonde_echo_ranges(), *end = range + SONDE_ECHO_SETTINGS;
  while (range < end && strcmp(range->key, key) != 0) ++range;
  double *value = range < end ? (double *)(void *)((char *)settings + range->offset) : NULL;
  return value && read_real(option, range->low, range->high, range->si, value);
}

static bool read_setting(options *o, int option) {
  sonde_echo_settings *s = &o->settings;
  switch (option) {
  case TURN: return read_real(option, -180, 180, atan(1) / 45, &o->turn);
  case FORCE: return read_real(option, 0.01, 200, 1, &o->force_n);
  case PRESS: return read_real(option, -10, 60, 1e-3, &o->press_m);
  case APERTURE: return read_real(option, 5, 200, 1e-3, &o->aperture_m);
  case WEBS: return read_real(option, 0, 1, 1, &o->findings.rest.webs);
  case OEDEMA: return read_real(option, 0, 1, 1, &o->findings.rest.oedema);
  case CURVED: return read_real(option, 20, 1000, 1e-3, &o->radius_m);
  case DEPTH: return read_scanner(option, "depth_mm", s);
  case FREQUENCY: return read_scanner(option, "frequency_mhz", s);
  case FOCUS: return read_scanner(option, "focus_mm", s);
  case GAIN: return read_scanner(option, "gain_db", s);
  case TGC: return read_scanner(option, "tgc_db_per_cm", s);
  case RANGE: return read_scanner(option, "dynamic_range_db", s);
  default: return false;
  }
}

static bool read_option(options *o, int option) {
  switch (option) {
  case POSE: return read_pose(o, optarg);
  case SITE: return app_parse_integer("image", "--site", optarg, 0, 1000000, &o->site);
  case SEED: return app_parse_integer("image", "--seed", optarg, 0, 1000000000, &o->seed);
  case SIZE: return read_size(o, optarg);
  case PROBE: o->probe = optarg; return true;
  case CASE: o->pathology = optarg; return true;
  case CLOT: return image_findings_clot(&o->findings, optarg);
  case LESION: return image_findings_lesion(&o->findings, optarg);
  case 'o': o->out = optarg; return true;
  case JSON: o->json = true; return true;
  default: return read_setting(o, option);
  }
}

static int read_options(int argc, char **argv, options *o) {
  for (int c; (c = getopt_long(argc, argv, "o:", LONG, NULL)) != -1;) {
    if (c == 'h') {
      fputs(HELP, stdout);
      return APP_OK;
    }
    if (!read_option(o, c)) return APP_BAD_INPUT;
  }
  if (o->posed == (o->site >= 0)) return app_usage_error("image", "give either --pose or --site");
  if (!isnan(o->force_n) && !isnan(o->press_m))
    return app_usage_error("image", "give --force-n or --press-mm, not both");
  double arc_rad = o->aperture_m / o->radius_m; // NaN unless both are given
  if (arc_rad > acos(-1))
    return app_usage_error("image",
                           "--aperture-mm %g is an arc of %.0f degrees of --curved-mm %g, expected "
                           "at most 180",
                           1e3 * o->aperture_m, 45 * arc_rad / atan(1), 1e3 * o->radius_m);
  if (!o->out) return app_usage_error("image", "-o PNG is missing");
  if (!app_model_argument("image", argc, argv, o->model, sizeof o->model)) return APP_BAD_INPUT;
  return -1;
}

// About the own beam.
static sonde_pose turned(sonde_pose p, double angle) {
  double c = cos(0.5 * angle), s = sin(0.5 * angle);
  sonde_quat q = p.rotation;
  p.rotation.w = q.w * c - q.z * s, p.rotation.x = q.x * c + q.y * s;
  p.rotation.y = q.y * c - q.x * s, p.rotation.z = q.z * c + q.w * s;
  return p;
}

static sonde_status place(settled *s, const options *o, sonde_error *error) {
  sonde_pose start = o->pose;
  sonde_status status = o->posed ? SONDE_OK : settled_site(s, o->model, o->site, &start, error);
  if (status) return status;
  start = turned(start, o->turn);
  bool pressed = !isnan(o->force_n) || !isnan(o->press_m);
  if (pressed && o->posed && !settled_on_skin(s, &start)) {
    error->status = SONDE_ARGUMENT;
    snprintf(error->message, sizeof error->message, "the beam of this pose does not meet the skin");
    return error->status;
  }
  s->pose = start;
  status = image_findings_apply(&o->findings, start, s->interior, error);
  if (status) return status;
  if (!pressed) return SONDE_OK;
  status = !isnan(o->force_n) ? settled_force(s, start, o->force_n, error)
                              : settled_press(s, start, o->press_m, INFINITY, error);
  settled_warn(s, "image");
  return status;
}

static sonde_status draw(const settled *s, const options *o, const sonde_pathology *pathology,
                         sonde_image *image, sonde_error *error) {
  sonde_echo *echo = NULL;
  sonde_echo_def def = {.seed = (uint64_t)o->seed};
  double aperture = isnan(o->aperture_m) ? 2 * s->probe.half_x_m : o->aperture_m;
  settled_update(s, pathology, sonde_state_tick(s->state));
  sonde_status status =
      sonde_echo_check_view(aperture, isnan(o->radius_m) ? 0 : o->radius_m, error);
  if (!status) status = sonde_echo_create(s->interior, &def, &echo, error);
  if (!status) status = sonde_echo_set_radius(echo, isnan(o->radius_m) ? 0 : o->radius_m, error);
  if (!status) status = sonde_image_create((uint32_t)o->width, (uint32_t)o->height, image, error);
  if (!status) {
    sonde_echo_render(echo, s->pose, aperture, pathology, &o->settings, image);
    uint32_t lost = sonde_echo_last_times(echo).lost;
    if (lost)
      fprintf(stderr, "sonde image: %u pieces of tissue are missing in the picture\n", lost);
    status = sonde_image_save_png(image, o->out, error);
  }
  sonde_echo_destroy(echo);
  return status;
}

static void other_vessels(const settled *s, bool json) {
  if (json) app_json_object("branches");
  for (int k = 2; k < (int)sonde_interior_vessel_count(s->interior); ++k) {
    sonde_vessel_state v;
    const char *name = sonde_interior_vessel_name(s->interior, k);
    if (!sonde_interior_vessel_at_plane(s->interior, k, s->pose, &v)) continue;
    if (json)
      app_json_real(name, v.area_ratio);
    else
      printf("%s %.1f mm front to back, %.0f %% of its rest area\n", name, 2e3 * v.half_short_m,
             100 * v.area_ratio);
  }
  if (json) app_json_close();
}

static void print(const settled *s, const options *o, const sonde_image *image) {
  sonde_vessel_state vein, artery;
  bool v = sonde_interior_vessel_at_plane(s->interior, 0, s->pose, &vein);
  bool a = sonde_interior_vessel_at_plane(s->interior, 1, s->pose, &artery);
  if (!o->json) {
    printf("%s: %ld x %ld pixels, %.1f x %.1f mm, %.2f N\n", o->out, o->width, o->height,
           image->width_m * 1e3, image->height_m * 1e3, s->force_n);
    if (v)
      printf("vein   %.1f mm front to back, %.0f %% of its rest area\n", 2e3 * vein.half_short_m,
             100 * vein.area_ratio);
    if (a)
      printf("artery %.1f mm front to back, %.0f %% of its rest area\n", 2e3 * artery.half_short_m,
             100 * artery.area_ratio);
    other_vessels(s, false);
    return;
  }
  app_json_begin();
  app_json_text("image", o->out);
  app_json_real("width_mm", image->width_m * 1e3);
  app_json_real("height_mm", image->height_m * 1e3);
  app_json_real("force_n", s->force_n);
  settled_json_jumps(s);
  app_json_text("case", o->pathology);
  app_json_real("vein_short_mm", v ? 2e3 * vein.half_short_m : NAN);
  app_json_real("vein_area_ratio", v ? vein.area_ratio : NAN);
  app_json_real("artery_short_mm", a ? 2e3 * artery.half_short_m : NAN);
  app_json_real("artery_area_ratio", a ? artery.area_ratio : NAN);
  other_vessels(s, true);
  app_json_end();
}

int old_image(int argc, char **argv);
int old_image(int argc, char **argv) {
  options o = {.probe = "linear",
               .pathology = "healthy",
               .site = -1,
               .width = 512,
               .height = 512,
               .force_n = NAN,
               .press_m = NAN,
               .aperture_m = NAN,
               .radius_m = NAN,
               .settings = sonde_echo_settings_default()};
  int code = read_options(argc, argv, &o);
  if (code >= 0) return code;
  settled s = {0};
  sonde_image image = {0};
  sonde_pathology pathology;
  sonde_error error = {0};
  app_progress_begin("pressing and drawing");
  sonde_status status = sonde_pathology_preset(o.pathology, &pathology, &error);
  if (!status) status = settled_open(&s, o.model, o.probe, NULL, true, &error);
  if (!status) status = place(&s, &o, &error);
  if (!status) status = draw(&s, &o, &pathology, &image, &error);
  app_progress_end();
  if (!status) print(&s, &o, &image);
  sonde_image_clear(&image);
  settled_close(&s);
  return status ? app_fail("image", &error) : APP_OK;
}
