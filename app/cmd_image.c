// sonde image: one echographic picture of a model, at any pose.
#include "image_colour.h"
#include "image_findings.h"
#include "image_strain.h"
#include "image_truth.h"
#include "options.h"
#include "pose.h"
#include "scanner_choice.h"
#include "settled.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct options {
  const char *model, *probe, *pathology, *out, *scanner, *truth, *strain, *station;
  double numbers[7], size[2]; // of the pose as typed; pixels
  sonde_pose pose;
  bool posed, json;
  long site, seed;
  double force_n, press_m, turn_rad, aperture_m, radius_m; // NaN when not asked for
  sonde_echo_settings settings;
  image_findings findings;
  image_colour colour;
  image_colour_result flow;
} options;

static void prepare(void *to) {
  *(options *)to = (options){
      .site = -1,
      .probe = "linear",
      .pathology = "healthy",
      .scanner = "venous",
      .size = {512, 512},
      .numbers = {NAN},
      .force_n = NAN,
      .press_m = NAN,
      .aperture_m = NAN,
      .radius_m = NAN,
      .settings = sonde_echo_settings_default(),
      .colour = {.scale_m_s = NAN, .steer_rad = NAN, .box_m = {NAN}, .at_s = 3, .squeeze_s = NAN}};
}

// The farthest that a probe may be from the model's origin, as for the page's goals.
static const double FAR_MM = 2000;

static bool read_clot(void *to, const char *text) {
  return image_findings_clot(&((options *)to)->findings, text);
}

static bool read_lesion(void *to, const char *text) {
  return image_findings_lesion(&((options *)to)->findings, text);
}

static const app_option TABLE[] = {
    OPT_MODEL(model),
    OPT_NUMBERS(numbers, "pose", "X,Y,Z,QW,QX,QY,QZ", -INFINITY, INFINITY,
                "world from probe: mm, each -2000 to 2000, and unit quaternion; z is the beam"),
    OPT_TEXT(station, "station", "NAME",
             "at a station of the model, such as popliteal; default its first one"),
    OPT_INTEGER(site, "site", "K", 0, 1000000, "at the site of this number instead"),
    OPT_REAL(turn_rad, "turn-deg", "A", -180, 180, 3.14159265358979323846 / 180,
             "about the beam; 90 looks along the leg"),
    OPT_REAL(force_n, "force-n", "F", 0.01, 200, 1,
             "press along the beam until the settled force is F newtons"),
    OPT_REAL(press_m, "press-mm", "D", -10, 60, 1e-3, "or press so deep below the rest skin"),
    OPT_TEXT(probe, "probe", "NAME|FILE", "point, linear, square, sphere, or a mesh file in mm"),
    OPT_REAL(aperture_m, "aperture-mm", "W", 5, 200, 1e-3,
             "width of the array, of a curved face along the arc, at most half a circle; default "
             "that of the probe"),
    OPT_REAL(
        radius_m, "curved-mm", "R", 20, 1000, 1e-3,
        "radius of a curved face, whose arc, the array's width over this radius, spans at most "
        "100 degrees; default flat"),
    OPT_TEXT(pathology, "case", "NAME", "state of the vein: " APP_CASES),
    OPT_CALL(read_clot, "clot", "BRANCH:CASE",
             "the same for a branch of the model, such as great_saphenous"),
    OPT_CALL(read_lesion, "lesion", "KIND:X:DEPTH:WIDTH:HEIGHT",
             "a node, cyst or haematoma (mm) in the image plane before the probe presses; up to 8"),
    OPT_REAL(findings.rest.webs, "webs", "W", 0, 1, 1, "bands in an old clot of the femoral vein"),
    OPT_REAL(findings.rest.oedema, "oedema", "W", 0, 1, 1, "fluid in the fat"),
    OPT_WHOLES(size, "size", "WxH", 16, 4096, "pixels"),
    OPT_INTEGER(seed, "seed", "N", 0, 1000000000, "of the tissue's scatterers"),
    OPT_OUTPUT(out, "o", "PNG", "the picture"),
    OPT_TEXT(truth, "truth", "DIR",
             "write what each pixel shows: tissue.png, vessel.png, labels.csv, place.nrrd, "
             "displacement.nrrd, velocity.nrrd"),
    OPT_TEXT(strain, "strain", "DIR",
             "press half a millimetre further and write the strain that tracked echoes show "
             "(strain.png), the true one (strain_true.png) and both as strain.csv; flat faces"),
    OPT_JSON(json),
    OPT_GROUP("Colour Doppler"),
    OPT_FLAG(colour.on, "colour", "lay the blood's velocity along the beam over the picture"),
    OPT_FLAG(colour.power, "power", "show how much blood moves instead of how fast"),
    OPT_REAL(colour.scale_m_s, "scale-cm-s", "V", 1, 300, 1e-2,
             "velocity along the beam from which colour folds; default above the fastest blood"),
    OPT_REAL(colour.steer_rad, "steer-deg", "A", -25, 25, 3.14159265358979323846 / 180,
             "of the colour's beam to the right, of a flat face; default 0 or 20, as the vessels "
             "need it"),
    OPT_NUMBERS(
        colour.box_m, "box", "LEFT:RIGHT,TOP:BOTTOM", -300, 300,
        "where the colour is, mm, of a curved face along its arc and its lines; default the "
        "whole picture"),
    OPT_REAL(colour.at_s, "at-s", "T", 0, 60, 1, "time since the heart's first beat; default 3"),
    OPT_REAL(colour.squeeze_s, "squeeze-s", "T", 0, 60, 1, "a hand squeezes the calf at T"),
    OPT_OUTPUT(colour.cells, "cells", "CSV", "write true and shown velocity of each cell"),
    OPT_GROUP("The scanner"),
    OPT_TEXT(
        scanner, "scanner", "NAME|FILE",
        "a scanner that ships (sonde scanner list) or a file; its settings are the defaults of "
        "those below; default venous")};

static const struct {
  const char *key, *name, *value, *help;
} SETTINGS[] = {{"depth_mm", "depth-mm", "D", "imaged depth"},
                {"frequency_mhz", "frequency-mhz", "F", "of the beam"},
                {"focus_mm", "focus-mm", "D", "of the beam"},
                {"gain_db", "gain-db", "G", "gain"},
                {"tgc_db_per_cm", "tgc-db-cm", "G", "on top of the default time-gain compensation"},
                {"dynamic_range_db", "range-db", "R", "dynamic range"}};

// Settings of the scanner with the ranges of the library, which the page has too.
static uint32_t list_settings(app_option *list, uint32_t room) {
  const sonde_echo_range *ranges = sonde_echo_ranges();
  uint32_t count = 0;
  for (size_t k = 0; k < sizeof SETTINGS / sizeof *SETTINGS; ++k)
    for (const sonde_echo_range *r = ranges; r < ranges + SONDE_ECHO_SETTINGS; ++r) {
      if (strcmp(r->key, SETTINGS[k].key) != 0) continue;
      if (count == room) break;
      list[count++] = (app_option){.name = SETTINGS[k].name,
                                   .value = SETTINGS[k].value,
                                   .kind = OPTION_REAL,
                                   .at = offsetof(options, settings) + r->offset,
                                   .bytes = sizeof(double),
                                   .low = r->low,
                                   .high = r->high,
                                   .scale = r->si,
                                   .help = SETTINGS[k].help};
    }
  return count;
}

static int check(void *from) {
  options *o = from;
  double *v = o->numbers;
  double norm = sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
  o->posed = app_option_given("pose");
  if (o->posed + app_option_given("site") + app_option_given("station") > 1)
    return app_usage_error("image", "give one of --pose, --site and --station");
  if (o->posed && !(fabs(norm * norm - 1) < 1e-2))
    return app_usage_error("image", "--pose expects a unit quaternion QW,QX,QY,QZ, got one of %g",
                           norm);
  if (o->posed && !(fabs(v[0]) <= FAR_MM && fabs(v[1]) <= FAR_MM && fabs(v[2]) <= FAR_MM))
    return app_usage_error("image", "--pose expects X, Y and Z from %g to %g mm, got %g,%g,%g",
                           -FAR_MM, FAR_MM, v[0], v[1], v[2]);
  o->pose.position = (sonde_vec3){v[0] * 1e-3, v[1] * 1e-3, v[2] * 1e-3};
  o->pose.rotation = (sonde_quat){v[3] / norm, v[4] / norm, v[5] / norm, v[6] / norm};
  double arc_rad = o->aperture_m / o->radius_m; // NaN unless both are given
  if (arc_rad > acos(-1))
    return app_usage_error("image",
                           "--aperture-mm %g is an arc of %.0f degrees of --curved-mm %g, expected "
                           "at most 180",
                           1e3 * o->aperture_m, 45 * arc_rad / atan(1), 1e3 * o->radius_m);
  double *box = o->colour.box_m;
  for (int k = 0; k < 4 && !isnan(box[0]); ++k) box[k] *= 1e-3;
  if (!isnan(box[0]) && !(box[0] < box[1] && box[2] >= 0 && box[2] < box[3]))
    return app_usage_error("image", "--box expects LEFT < RIGHT and 0 <= TOP < BOTTOM");
  return APP_OK;
}

static sonde_status place(settled *s, const options *o, sonde_error *error) {
  sonde_pose start = o->pose;
  char at[64];
  sonde_status status =
      o->posed ? SONDE_OK : settled_place(s, o->model, o->site, o->station, &start, at, error);
  if (status) return status;
  start = pose_turn(start, 2, o->turn_rad); // about its own beam
  bool pressed = !isnan(o->force_n) || !isnan(o->press_m);
  if (pressed && o->posed && !settled_on_skin(s, &start))
    return app_error(error, SONDE_ARGUMENT, "the beam of this pose does not meet the skin");
  s->pose = start;
  status = image_findings_apply(&o->findings, start, s->interior, error);
  if (status) return status;
  if (!pressed) return SONDE_OK;
  status = !isnan(o->force_n) ? settled_force(s, start, o->force_n, error)
                              : settled_press(s, start, o->press_m, INFINITY, error);
  settled_warn(s, "image");
  return status;
}

// What a run makes, and what it is made of.
typedef struct drawing {
  settled s;
  sonde_echo *echo;
  sonde_image image;
  sonde_pathology pathology;
  double aperture_m;
} drawing;

// What the picture shows; the strain last, for which the probe goes on.
static sonde_status report(options *o, drawing *d, sonde_error *error) {
  sonde_vessel_state vessel[2];
  bool there[2];
  // Diameters, and as the picture draws them: tissue of another sound speed is thicker or thinner.
  double across_m[2] = {NAN, NAN}, drawn_m[2] = {NAN, NAN}, area[2] = {NAN, NAN};
  for (int which = 0; which < 2; ++which) {
    const sonde_vessel_state *v = &vessel[which];
    there[which] = sonde_interior_vessel_at_plane(d->s.interior, which, d->s.pose, &vessel[which]);
    if (!there[which]) continue;
    const double h = v->half_short_m;
    const sonde_vec3 c = v->centre_m, n = v->flat_axis;
    const sonde_vec3 p = sonde_truth_drawn(
                         d->echo, (sonde_vec3){c.x + h * n.x, c.y + h * n.y, c.z + h * n.z}),
                     q = sonde_truth_drawn(
                         d->echo, (sonde_vec3){c.x - h * n.x, c.y - h * n.y, c.z - h * n.z});
    drawn_m[which] =
        sqrt((p.x - q.x) * (p.x - q.x) + (p.y - q.y) * (p.y - q.y) + (p.z - q.z) * (p.z - q.z));
    across_m[which] = 2 * h, area[which] = v->area_ratio;
  }
  if (!o->json) {
    printf("%s: %.0f x %.0f pixels, %.1f x %.1f mm, %.2f N\n", o->out, o->size[0], o->size[1],
           d->image.width_m * 1e3, d->image.height_m * 1e3, d->s.force_n);
    for (int which = 0; which < 2; ++which)
      if (there[which])
        printf("%-6s %.1f mm front to back, %.0f %% of its rest area\n", which ? "artery" : "vein",
               1e3 * across_m[which], 100 * area[which]);
    settled_branches(&d->s, false);
  } else {
    app_json_begin();
    app_json("image:%s width_mm:%g height_mm:%g force_n:%g", o->out, d->image.width_m * 1e3,
             d->image.height_m * 1e3, d->s.force_n);
    settled_json_jumps(&d->s);
    app_json("case:%s vein_short_mm:%g vein_area_ratio:%g artery_short_mm:%g artery_area_ratio:%g",
             o->pathology, 1e3 * across_m[0], area[0], 1e3 * across_m[1], area[1]);
    app_json("vein_drawn_mm:%g artery_drawn_mm:%g", 1e3 * drawn_m[0], 1e3 * drawn_m[1]);
    settled_branches(&d->s, true);
  }
  if (o->colour.on) image_colour_tell(&o->flow, &d->s, o->json);
  image_strain strain = {.echo = d->echo,
                         .pathology = &d->pathology,
                         .settings = &o->settings,
                         .aperture_m = d->aperture_m,
                         .image = &d->image};
  sonde_status status = SONDE_OK;
  if (o->strain) status = image_strain_write(o->strain, &d->s, &strain, error);
  if (o->strain && !status && o->json)
    app_json("strain_mean:%g strain_error_rms:%g strain_tracked_share:%g", strain.mean,
             strain.error, strain.tracked);
  else if (o->strain && !status)
    printf("strain %.2f %% in the mean, tracked within %.2f %% rms at %.0f %% of the places\n",
           100 * strain.mean, 100 * strain.error, 100 * strain.tracked);
  if (o->json) app_json_end();
  return status;
}

static int run(void *from) {
  options *o = from;
  assert(o->out && o->size[0] > 0 && o->size[1] > 0);
  drawing d = {0};
  sonde_error error = {0};
  app_progress_begin("pressing and drawing");
  // A scanner and the settings that the words change in it.
  sonde_scanner scanner;
  sonde_status status = scanner_choose(o->scanner, &scanner, &error);
  const sonde_echo_range *ranges = sonde_echo_ranges();
  for (size_t k = 0; k < sizeof SETTINGS / sizeof *SETTINGS && !status; ++k)
    for (const sonde_echo_range *r = ranges; r < ranges + SONDE_ECHO_SETTINGS; ++r)
      if (strcmp(r->key, SETTINGS[k].key) == 0 && !app_option_given(SETTINGS[k].name))
        memcpy((char *)&o->settings + r->offset, (const char *)&scanner.settings + r->offset,
               sizeof(double));
  if (isnan(o->radius_m) && scanner.radius_m > 0) o->radius_m = scanner.radius_m;
  if (isnan(o->aperture_m) && scanner.aperture_m > 0) o->aperture_m = scanner.aperture_m;
  if (!status) status = sonde_pathology_preset(o->pathology, &d.pathology, &error);
  if (!status) status = settled_open(&d.s, o->model, o->probe, NULL, true, &error);
  if (!status) status = place(&d.s, o, &error);
  sonde_echo_def def = sonde_echo_def_default();
  def.seed = (uint64_t)o->seed;
  def.scanner = &scanner;
  const double radius = isnan(o->radius_m) ? 0 : o->radius_m;
  d.aperture_m = isnan(o->aperture_m) ? 2 * d.s.probe.half_x_m : o->aperture_m;
  if (!status) settled_update(&d.s, &d.pathology, 0, sonde_state_tick(d.s.state));
  if (!status) status = sonde_echo_check_view(d.aperture_m, radius, &error);
  if (!status && o->strain && radius > 0)
    status =
        app_error(&error, SONDE_ARGUMENT,
                  "--strain expects a flat face, this one has a radius of %g mm", 1e3 * radius);
  if (!status && !isnan(o->colour.steer_rad) && radius > 0)
    status = app_error(&error, SONDE_ARGUMENT,
                       "--steer-deg expects a flat face, the lines of this one with a radius of %g "
                       "mm are a fan",
                       1e3 * radius);
  if (!status) status = sonde_echo_create(d.s.interior, &def, &d.echo, &error);
  if (!status) status = sonde_echo_set_radius(d.echo, radius, &error);
  if (!status)
    status = sonde_image_create((uint32_t)o->size[0], (uint32_t)o->size[1], &d.image, &error);
  if (!status) {
    sonde_echo_render(d.echo, d.s.pose, d.aperture_m, &d.pathology, &o->settings, &d.image);
    const uint32_t lost = sonde_echo_last_times(d.echo).lost;
    if (lost)
      fprintf(stderr, "sonde image: %u pieces of tissue are missing in the picture\n", lost);
    status = !o->colour.on ? sonde_image_save_png(&d.image, o->out, &error)
                           : image_colour_draw(&o->colour, &d.s, d.echo, &d.image, d.aperture_m,
                                               radius, o->settings.frequency_hz, (uint64_t)o->seed,
                                               o->out, &o->flow, &error);
  }
  if (!status && o->truth)
    status = image_truth_write(o->truth, d.echo, d.s.interior, &d.image, &error);
  app_progress_end();
  if (!status) status = report(o, &d, &error);
  sonde_echo_destroy(d.echo);
  sonde_image_clear(&d.image);
  settled_close(&d.s);
  return status ? app_fail("image", &error) : APP_OK;
}

const app_command cmd_image = {
    .verb = "image",
    .summary = "write the echographic picture of a model at a pose",
    .usage = "[MODEL] [--station NAME | --site K | --pose X,Y,Z,QW,QX,QY,QZ] -o PNG [options]",
    .text = "Writes the echographic picture that a probe sees on a model at rest or pressed, and "
            "tells what it shows. Without --force-n and --press-mm the skin stays at rest.",
    OPT_TABLE(TABLE),
    .extend = list_settings,
    .size = sizeof(options),
    .prepare = prepare,
    .required = "o",
    .not_both = "force-n press-mm",
    .needs = "power>colour scale-cm-s>colour steer-deg>colour box>colour at-s>colour "
             "squeeze-s>colour cells>colour",
    .check = check,
    .run = run};
