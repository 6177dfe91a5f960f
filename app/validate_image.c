// sonde validate image: the echographic image measured against its targets, on round synthetic
// legs. Each measure is a function that opens a stage (leg, interior, renderer), looks, and notes.
#include "app.h"
#include "validate.h"
#include "validate_leg.h"
#include "validate_list.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

typedef struct report {
  validate_list list;
  bool quick;
  sonde_error error;
} report;

// One measure with its target; nothing after a failure.
static void note(report *r, const char *name, double value, double least, double most,
                 const char *target) {
  if (!r->error.status) validate_note(&r->list, name, value, least, most, target);
}

typedef struct stage {
  sonde_model leg;
  sonde_interior *interior;
  sonde_echo_view view;
  sonde_pathology pathology;
  sonde_image image;
  sonde_vec3 *forces;
  sonde_pose pose;
} stage;

static sonde_status stage_open(stage *s, double radius, double bone, double muscle, double depth,
                               bool vessels, sonde_error *error) {
  assert(radius > bone && depth >= 0);
  *s = (stage){.view = {.aperture_m = 0.04, .settings = sonde_echo_settings_default()}};
  sonde_echo_def def = sonde_echo_def_default();
  def.plain = true;
  def.seed = 11;
  sonde_status status = validate_leg_build(radius, bone, muscle, depth, vessels, &s->leg, error);
  if (!status) status = sonde_interior_create(&s->leg, &s->interior, error);
  if (!status) status = sonde_echo_create(s->interior, &def, &s->view.echo, error);
  if (!status) status = sonde_image_create(512, 512, &s->image, error);
  if (!status) status = sonde_pathology_preset("healthy", &s->pathology, error);
  if (!status) s->forces = calloc(s->leg.surface.vertex_count, sizeof *s->forces);
  s->pose = validate_leg_pose(radius - 1e-3, 0.15);
  return status;
}

static void stage_close(stage *s) {
  sonde_image_clear(&s->image);
  sonde_echo_destroy(s->view.echo);
  sonde_interior_destroy(s->interior);
  validate_leg_clear(&s->leg);
  free(s->forces);
}

// The interior follows the skin, a frame is drawn; its envelope.
static const float *look(stage *s, uint64_t tick) {
  uint32_t lines, samples;
  sonde_interior_update(s->interior, &(sonde_interior_input){s->leg.surface.vertices, s->forces,
                                                             s->pose, &s->pathology, -1, tick, 0.02,
                                                             0.005, 0, SONDE_POSTURE_SUPINE, NULL});
  sonde_echo_render(s->view.echo, s->pose, s->view.aperture_m, &s->pathology, &s->view.settings,
                    &s->image);
  return sonde_echo_envelope(s->view.echo, &lines, &samples);
}

// Takes the default compensation off.
static void plain_gain(stage *s) {
  s->view.settings.tgc_db_per_m = -sonde_echo_default_tgc_db_per_m(s->view.settings.frequency_hz);
}

// Lateral extent about the middle line and depth, m.
typedef struct region {
  double x0, x1, z0, z1;
} region;

// Mean intensity over a region, and the envelope's mean over its deviation.
static double intensity(const stage *s, const float *e, region r, double *contrast) {
  assert(r.x0 < r.x1 && r.z0 < r.z1);
  uint32_t lines, samples;
  (void)sonde_echo_envelope(s->view.echo, &lines, &samples);
  double pitch = s->view.aperture_m / (lines - 1), step = s->view.settings.depth_m / (samples - 1);
  double n = 0, sum = 0, square = 0;
  for (uint32_t k = (uint32_t)(r.z0 / step); k < r.z1 / step && k < samples; ++k)
    for (uint32_t l = 0; l < lines; ++l) {
      double x = (l - 0.5 * (lines - 1)) * pitch, v = (double)e[(size_t)k * lines + l];
      if (x < r.x0 || x > r.x1) continue;
      n += 1, sum += v, square += v * v;
    }
  if (contrast) *contrast = sum / n / sqrt(fmax(square / n - sum / n * sum / n, 1e-30));
  return square / n;
}

static double db(double power) { return 10 * log10(fmax(power, 1e-30)); }

// Likeness, widths of a point and flicker against the exact reference.
static sonde_status reference(report *r) {
  static const double DEPTHS[] = {0.012, 0.018, 0.025, 0.032, 0.045};
  stage s;
  sonde_status status = stage_open(&s, 0.08, 0.014, 2.5e-3, 0, false, &r->error);
  for (int k = 0; k < 5 && !status; ++k) {
    char name[48];
    double likeness = 0;
    status =
        sonde_echo_likeness(&s.view, DEPTHS[k], r->quick ? 600 : 2500, 7, &likeness, &r->error);
    snprintf(name, sizeof name, "likeness_%.0f_mm", DEPTHS[k] * 1e3);
    note(r, name, likeness, 0.98, 1, ">= 0.98");
  }
  double axial = 0, lateral = 0, flicker = 1;
  for (double z = 0.012; z < 0.06 && !status; z += 0.004) {
    sonde_echo_widths fast, exact;
    status = sonde_echo_point_widths(&s.view, z, &fast, &exact, &r->error);
    axial = fmax(axial, fabs(fast.axial_m / exact.axial_m - 1));
    lateral = fmax(lateral, fabs(fast.lateral_m / exact.lateral_m - 1));
  }
  if (!status) status = sonde_echo_flicker(&s.view, 0.025, 3000, 3, &flicker, &r->error);
  note(r, "axial_width_error", axial, 0, 0.03, "<= 0.03 of the reference");
  note(r, "lateral_width_error", lateral, 0, 0.05, "<= 0.05 of the reference");
  note(r, "flicker", flicker, 0, 0.013, "<= 0.013 rms");
  stage_close(&s);
  return status;
}

// Mean over deviation of fully developed speckle in homogeneous muscle.
static sonde_status speckle(report *r) {
  stage s;
  sonde_status status = stage_open(&s, 0.2, 0.014, 2.5e-3, 0, false, &r->error);
  double sum = 0, count = 0;
  s.view.settings.tgc_db_per_m = 2 * 100 * 7.5 - sonde_echo_default_tgc_db_per_m(7.5e6);
  for (int k = 0; k < (r->quick ? 3 : 10) && !status; ++k) {
    s.pose.position.z = 0.11 + 0.008 * k;
    const float *e = look(&s, 1);
    for (double z = 0.012; z < 0.045; z += 0.004)
      for (double x = -0.016; x < 0.015; x += 0.008, count += 1) {
        double contrast;
        intensity(&s, e, (region){x, x + 0.008, z, z + 0.004}, &contrast);
        sum += contrast;
      }
  }
  note(r, "speckle_mean_over_deviation", sum / count, 1.88, 1.94, "1.91 +- 0.03");
  stage_close(&s);
  return status;
}

// Slope of the log intensity against depth in muscle of 1 dB/cm/MHz.
static sonde_status attenuation(report *r) {
  stage s;
  sonde_status status = stage_open(&s, 0.4, 0.014, 2.5e-3, 0, false, &r->error);
  for (int k = 0; k < 2 && !status; ++k) {
    double mhz = k ? 7.5 : 3, sum[16] = {0}, sx = 0, sy = 0, sxx = 0, sxy = 0;
    double step = fmin(0.065, 0.24 / mhz) / 16;
    char name[48];
    s.view.settings.frequency_hz = mhz * 1e6;
    s.view.settings.depth_m = 0.08;
    plain_gain(&s);
    for (int frame = 0; frame < (r->quick ? 6 : 16); ++frame) {
      s.pose.position.z = 0.10 + 0.006 * frame;
      const float *e = look(&s, 1);
      for (int n = 0; n < 16; ++n)
        sum[n] += intensity(
            &s, e, (region){-0.018, 0.018, 0.008 + n * step, 0.008 + (n + 1) * step}, NULL);
    }
    for (int n = 0; n < 16; ++n) {
      double x = n * step, y = db(sum[n]);
      sx += x, sy += y, sxx += x * x, sxy += x * y;
    }
    double slope = (16 * sxy - sx * sy) / (16 * sxx - sx * sx); // dB/m, both ways
    snprintf(name, sizeof name, "attenuation_%.2g_mhz_db_cm_mhz", mhz);
    note(r, name, -slope / 2 / mhz / 100, 0.98, 1.02, "1.00 +- 0.02 dB/cm/MHz");
  }
  stage_close(&s);
  return status;
}

// Echo of a nearly flat cortex under the middle line, and what is left behind it.
static sonde_status bone(report *r) {
  const double radius = 0.2, inner = 0.179, muscle = 6e-3, mhz = 4;
  stage s;
  sonde_status status = stage_open(&s, radius, inner, muscle, 0, false, &r->error);
  double echo = 0, behind = 0, before = 0, expected_behind = 0, frames = r->quick ? 120 : 200;
  s.view.settings.frequency_hz = mhz * 1e6;
  s.view.settings.depth_m = 0.035;
  plain_gain(&s);
  double face = 1e-3, cortex = radius - inner - face; // the face lies 1 mm below the skin
  for (int k = 0; k < frames && !status; ++k) {
    s.pose.position.z = 0.06 + 0.18 * k / frames;
    const float *e = look(&s, (uint64_t)k);
    uint32_t lines, samples;
    (void)sonde_echo_envelope(s.view.echo, &lines, &samples);
    double top = 0, step = s.view.settings.depth_m / (samples - 1);
    for (uint32_t n = (uint32_t)((cortex - 1e-3) / step); n * step < cortex + 1e-3; ++n)
      top = fmax(top, (double)e[(size_t)n * lines + lines / 2]);
    echo += 20 * log10(top) / frames;
    before += intensity(&s, e, (region){-1e-3, 1e-3, cortex - 5e-3, cortex - 3e-3}, NULL) / frames;
    behind += intensity(&s, e, (region){-1e-3, 1e-3, cortex + 3e-3, cortex + 5e-3}, NULL) / frames;
  }
  // The march begins at the face: the first millimetre of skin is behind it.
  // Skin, fat and muscle above it, dB both ways.
  const double skin = 1.8e-3, in_muscle = cortex + face - muscle;
  double loss = 2 * mhz * (100 * skin + 50 * (muscle - skin) + 100 * in_muscle);
  loss -= 2 * mhz * 100 * face;
  note(r, "specular_level_error_db", echo - (36 - loss), -0.5, 0.5,
       "+- 0.5 dB of the path integral");
  double noise = -118, expected_before = 4e-3 * 2 * mhz * 100 - loss; // of the muscle above
  for (int n = 0; n < 20; ++n) { // bone behind the cortex, 200 dB/m/MHz, backscatter 0.02
    double in = 3e-3 + 2e-3 * (n + 0.5) / 20;
    double level = 20 * log10(0.02) - loss - 55 - 2 * mhz * 200 * in;
    expected_behind += (pow(10, level / 10) + pow(10, noise / 10)) / 20;
  }
  note(r, "shadow_level_error_db", db(behind / before) - db(expected_behind) + expected_before,
       -0.5, 0.5, "+- 0.5 dB of the path integral");
  stage_close(&s);
  return status;
}

// Behind a vein against beside it.
static sonde_status enhancement(report *r) {
  const double depth = 0.02, lumen = 4.5e-3, wall = 0.6e-3, mhz = 7.5;
  stage s;
  sonde_status status = stage_open(&s, 0.2, 0.014, 2.5e-3, depth, true, &r->error);
  double behind = 0, beside = 0;
  int frames = r->quick ? 12 : 40;
  for (int k = 0; k < frames && !status; ++k) {
    s.pose.position.z = 0.09 + 0.003 * k;
    const float *e = look(&s, 1);
    behind += intensity(&s, e, (region){-0.8e-3, 0.8e-3, 0.0265, 0.0325}, NULL);
    beside += intensity(&s, e, (region){-12e-3, -9e-3, 0.0265, 0.0325}, NULL);
  }
  double expected = 2 * mhz * ((100 - 18) * 2 * lumen - (110 - 100) * 2 * wall);
  note(r, "enhancement_error_db", db(behind / beside) - expected, -0.5, 0.5,
       "+- 0.5 dB of the path integral");
  stage_close(&s);
  return status;
}

// Pressure at which a falling diameter passes a fifth of its rest value.
static double closure(const double *diameter, const double *pressure, int count) {
  assert(count > 1 && diameter[0] > 0);
  for (int k = 1; k < count; ++k)
    if (diameter[k] < 0.2 * diameter[0]) {
      double t = (diameter[k - 1] - 0.2 * diameter[0]) / (diameter[k - 1] - diameter[k]);
      return pressure[k - 1] + t * (pressure[k] - pressure[k - 1]);
    }
  return NAN;
}

// Diameter and closure of a pressed vein: the picture against the mechanics.
static sonde_status vein(report *r) {
  enum { LOADS = 40 };
  stage s;
  sonde_status status = stage_open(&s, 0.08, 0.014, 6e-3, 0.018, true, &r->error);
  double seen[LOADS], true_m[LOADS], pressure[LOADS], worst = 0;
  int used = 0;
  for (int k = 0; k < LOADS && !status; ++k) {
    // A force on a patch of the skin over the vessels, evenly on its nodes.
    uint32_t count = 0;
    for (int pass = 0; pass < 2; ++pass)
      for (uint32_t i = 0; i < s.leg.surface.vertex_count; ++i) {
        sonde_vec3 p = s.leg.surface.vertices[i];
        bool under = p.y > 0 && fabs(p.x) < 0.02 && fabs(p.z - 0.15) < 0.006;
        if (pass == 0) s.forces[i] = (sonde_vec3){0, 0, 0}, count += under;
        if (pass == 1 && under) s.forces[i].y = -(1.0 * k) / count;
      }
    sonde_vessel_state v;
    const float *e = look(&s, (uint64_t)k + 1);
    if (!sonde_interior_vessel_at_plane(s.interior, 0, s.pose, &v)) break;
    double centre = s.pose.position.y - v.centre_m.y;
    true_m[used] = 2 * v.half_short_m, pressure[used] = v.outside_pa / SONDE_PA_PER_MMHG;
    // Front-to-back diameter that the picture shows: between the two walls' echoes on the middle
    // lines.
    uint32_t lines, samples;
    (void)sonde_echo_envelope(s.view.echo, &lines, &samples);
    double step = s.view.settings.depth_m / (samples - 1), sum[4096] = {0};
    uint32_t middle = (uint32_t)(centre / step), reach = (uint32_t)(7e-3 / step);
    for (uint32_t n = middle - reach; n <= middle + reach; ++n)
      for (uint32_t l = lines / 2 - 3; l < lines / 2 + 3; ++l)
        sum[n] += (double)e[(size_t)n * lines + l];
    double place[2] = {0};
    for (int side = 0; side < 2; ++side) {
      uint32_t best = middle;
      for (uint32_t away = 0; away <= reach; ++away) {
        uint32_t n = side ? middle + away : middle - away;
        if (sum[n] > sum[best]) best = n;
      }
      double a = log(sum[best - 1]), b = log(sum[best]),
             c = log(sum[best + 1]); // peak by a parabola
      place[side] = best + (a - 2 * b + c < 0 ? 0.5 * (a - c) / (a - 2 * b + c) : 0);
    }
    seen[used] = (place[1] - place[0]) * step;
    if (true_m[used] > 0.6e-3) worst = fmax(worst, fabs(seen[used] - true_m[used]));
    if (true_m[used++] < 0.5e-3) break;
  }
  note(r, "vein_diameter_error_mm", worst * 1e3, 0, 0.2, "<= 0.2 mm of the mechanics");
  note(r, "closure_pressure_error_mmhg",
       closure(seen, pressure, used) - closure(true_m, pressure, used), -3, 3,
       "+- 3 mmHg of the mechanics");
  stage_close(&s);
  return status;
}

// A phantom: wires and cysts in muscle below fat, tissues with their own sound speeds. Where a wire
// or cyst begins: brightest echo near where it is due, in the frames' mean intensity.
typedef struct target {
  double x_m, top_m;     // across, and the depth of its upper face below the probe's
  double seen_x, seen_m; // in the picture
} target;

static void find_target(const stage *s, const double *sum, double due_m, target *t) {
  uint32_t lines, samples;
  (void)sonde_echo_envelope(s->view.echo, &lines, &samples);
  const double pitch = s->view.aperture_m / (lines - 1);
  const double step = s->view.settings.depth_m / (samples - 1), middle = 0.5 * (lines - 1);
  const uint32_t line = (uint32_t)(middle + t->x_m / pitch + 0.5);
  // Depth: the peak of the mean over the middle lines; across: the centre of what is bright there.
  double row[4096] = {0}, weight = 0, moment = 0;
  uint32_t best = (uint32_t)((due_m - 1.2e-3) / step);
  for (uint32_t n = best; n < (due_m + 0.8e-3) / step; ++n) {
    for (uint32_t l = line - 2; l <= line + 2; ++l) row[n] += sum[(size_t)n * lines + l];
    if (row[n] > row[best]) best = n;
  }
  const double a = log(row[best - 1]), b = log(row[best]), c = log(row[best + 1]);
  t->seen_m = (best + 0.5 * (a - c) / (a - 2 * b + c)) * step;
  const int reach = (int)(1.2e-3 / pitch);
  for (int k = -reach; k <= reach; ++k) {
    double value = 0;
    for (uint32_t n = best - 3; n <= best + 3; ++n)
      value += sum[(size_t)n * lines + (uint32_t)((int)line + k)];
    weight += value * value, moment += value * value * k;
  }
  t->seen_x = (line + moment / weight - middle) * pitch;
}

static sonde_status phantom(report *r) {
  const double radius = 0.2, face = 1e-3, skin = 1.8e-3, muscle = 0.012, c0 = 1540;
  const double speed[3] = {1624, 1440, 1580};
  // None behind another, whose fluid would delay it.
  target list[] = {{-0.016, 0.018, 0, 0}, {-0.011, 0.033, 0, 0}, {-0.007, 0.018, 0, 0},
                   {-0.002, 0.033, 0, 0}, {0.005, 0.017, 0, 0},  {0.013, 0.031, 0, 0}};
  enum { TARGETS = sizeof list / sizeof *list };
  stage s;
  sonde_status status = stage_open(&s, radius, 0.014, muscle, 0, false, &r->error);
  if (!status) {
    sonde_echo_def def = sonde_echo_def_default();
    sonde_scanner scanner = sonde_scanner_plain();
    scanner.sound_speeds = 1;
    def.plain = true, def.seed = 11, def.scanner = &scanner;
    sonde_echo_destroy(s.view.echo), s.view.echo = NULL;
    status = sonde_echo_create(s.interior, &def, &s.view.echo, &r->error);
  }
  sonde_findings findings = {.lesion_count = TARGETS};
  for (int k = 0; k < TARGETS; ++k) {
    const double half = k < 4 ? 1e-3 : 3e-3; // wires, cysts
    findings.lesion[k] = (sonde_lesion){SONDE_LESION_CYST,
                                        {-list[k].x_m, radius - face - list[k].top_m - half, 0.15},
                                        {0, 0, 1},
                                        {half, half, 0.05},
                                        0};
  }
  if (!status) status = sonde_interior_set_findings(s.interior, &findings, &r->error);
  double *sum = status ? NULL : calloc((size_t)512 * 4096, sizeof *sum);
  s.view.settings.depth_m = 0.05;
  for (int frame = 0; frame < 12 && sum; ++frame) {
    s.pose.position.z = 0.13 + 0.0035 * frame;
    const float *e = look(&s, 1);
    uint32_t lines, samples;
    (void)sonde_echo_envelope(s.view.echo, &lines, &samples);
    for (size_t i = 0; i < (size_t)lines * samples; ++i) sum[i] += (double)(e[i] * e[i]);
  }
  // What the known layers above tell of the drawn depth: down to skin, fat and muscle at that x.
  double plain = 0, calibrated = 0;
  for (int k = 0; k < TARGETS && sum; ++k) {
    const double x = list[k].x_m;
    const double end[2] = {radius - face - sqrt(pow(radius - skin, 2) - x * x),
                           radius - face - sqrt(pow(radius - muscle, 2) - x * x)};
    const double above = c0 * (end[0] / speed[0] + (end[1] - end[0]) / speed[1]);
    find_target(&s, sum, above + (list[k].top_m - end[1]) * c0 / speed[2], &list[k]);
  }
  for (int a = 0; a < TARGETS && sum; ++a)
    for (int b = 0; b < a; ++b) {
      const double dx = list[a].seen_x - list[b].seen_x, dz = list[a].seen_m - list[b].seen_m;
      const double due = hypot(list[a].x_m - list[b].x_m, list[a].top_m - list[b].top_m);
      plain = fmax(plain, fabs(hypot(dx, dz) / due - 1));
      // Both lie in muscle: their depths differ by its speed alone.
      calibrated = fmax(calibrated, fabs(hypot(dx, dz * speed[2] / c0) / due - 1));
    }
  note(r, "phantom_distance_error_at_1540", plain, -INFINITY, INFINITY, "told");
  note(r, "phantom_distance_error", calibrated, 0, 0.01, "<= 0.01 with the speeds known");
  free(sum);
  stage_close(&s);
  return status;
}

typedef struct face {
  const char *name;
  double aperture_m, radius_m, depth_m;
} face;

// Deepest depth above which each eighth of the face shows speckle within 3 dB of the mean.
static double speckle_depth(const stage *s, const float *e) {
  enum { PARTS = 8 };
  const double first = 0.01, band = 5e-3, part = s->view.aperture_m / PARTS;
  const double depth = s->view.settings.depth_m, half = 0.5 * s->view.aperture_m;
  const double mean = db(intensity(s, e, (region){-half, half, first, depth}, NULL));
  double z = first;
  for (; z + band < depth + 1e-6; z += band)
    for (int k = 0; k < PARTS; ++k) {
      region at = {k * part - half, (k + 1) * part - half, z, z + band};
      if (!(fabs(db(intensity(s, e, at, NULL)) - mean) < 3)) return z;
    }
  return z;
}

// Tissue down to the set depth below each face; 3 MHz, compensation by the tissue's own loss.
static sonde_status deep(report *r) {
  static const face FACES[] = {
      {"linear_50", 0.04, 0, 0.05},       {"linear_100", 0.04, 0, 0.1},
      {"linear_150", 0.04, 0, 0.15},      {"wide_150", 0.2, 0, 0.15},
      {"curved_60_100", 0.06, 0.06, 0.1}, {"curved_60_150", 0.06, 0.06, 0.15},
      {"curved_40_150", 0.06, 0.04, 0.15}};
  const double radius = 0.4, mhz = 3;
  stage s;
  sonde_status status = stage_open(&s, radius, 0.014, 2.5e-3, 0, false, &r->error);
  s.view.settings.frequency_hz = mhz * 1e6;
  s.view.settings.tgc_db_per_m = 2 * 100 * mhz - sonde_echo_default_tgc_db_per_m(mhz * 1e6);
  uint32_t lost = 0;
  for (size_t k = 0; k < sizeof FACES / sizeof *FACES && !status; ++k) {
    const face *f = &FACES[k];
    // All of the face below the skin.
    double half = 0.5 * f->aperture_m, sink = radius - sqrt(radius * radius - half * half);
    if (f->radius_m > 0) sink = f->radius_m * (1 - cos(half / f->radius_m));
    char name[48];
    s.view.aperture_m = f->aperture_m, s.view.settings.depth_m = f->depth_m;
    s.pose = validate_leg_pose(radius - 6e-3 - sink, 0.15);
    status = sonde_echo_check_view(f->aperture_m, f->radius_m, &r->error);
    if (!status) status = sonde_echo_set_radius(s.view.echo, f->radius_m, &r->error);
    if (status) break;
    const float *e = look(&s, 1);
    lost += sonde_echo_last_times(s.view.echo).lost;
    snprintf(name, sizeof name, "speckle_to_depth_mm_%s", f->name);
    note(r, name, 1e3 * speckle_depth(&s, e), 1e3 * f->depth_m - 1e-3, 1e3 * f->depth_m + 1e-3,
         "the set depth");
  }
  note(r, "pieces_not_drawn", lost, 0, 0, "none");
  stage_close(&s);
  return status;
}

// Homogeneous muscle down to where it is 6 dB above the receiver's noise, and the share of white
// pixels at the default compensation.
static sonde_status compensation(report *r) {
  static const double MHZ[] = {5, 7.5, 12};
  const double noise_db = -118, radius = 0.4, band = 5e-3, first = 0.01;
  stage s;
  sonde_status status = stage_open(&s, radius, 0.014, 2.5e-3, 0, false, &r->error);
  double off = 0, white = 0;
  for (size_t k = 0; k < sizeof MHZ / sizeof *MHZ && !status; ++k) {
    const double end = (-noise_db - 6) / (2 * 100 * MHZ[k]);
    s.view.settings.frequency_hz = MHZ[k] * 1e6, s.view.settings.depth_m = 0.15;
    s.view.settings.tgc_db_per_m = 0;
    (void)look(&s, 1);
    size_t saturated = 0, pixels = (size_t)s.image.width * s.image.height;
    for (size_t i = 0; i < pixels; ++i) saturated += s.image.pixels[i] == 255;
    white = fmax(white, (double)saturated / (double)pixels);
    s.view.settings.tgc_db_per_m =
        2 * 100 * MHZ[k] - sonde_echo_default_tgc_db_per_m(s.view.settings.frequency_hz);
    const float *e = look(&s, 1);
    double mean = db(intensity(&s, e, (region){-0.018, 0.018, first, end}, NULL));
    for (double z = first; z + band < end; z += band)
      off =
          fmax(off, fabs(db(intensity(&s, e, (region){-0.018, 0.018, z, z + band}, NULL)) - mean));
  }
  note(r, "evenness_to_noise_plus_6_db", off, 0, 1, "<= 1 dB");
  note(r, "white_share", white, 0, 0.01, "<= 0.01 of the pixels");
  stage_close(&s);
  return status;
}

// Time of a new beam and of a frame.
static sonde_status times(report *r) {
  enum { FRAMES = 30 };
  stage s;
  double list[FRAMES];
  sonde_status status = stage_open(&s, 0.08, 0.014, 6e-3, 0.018, true, &r->error);
  for (int k = 0; k < FRAMES && !status; ++k) {
    (void)look(&s, 1);
    sonde_echo_times t = sonde_echo_last_times(s.view.echo);
    list[k] = t.plane_s + t.medium_s + t.scatter_s + t.beam_s + t.picture_s;
    if (k == 0) note(r, "beam_change_ms", t.settings_s * 1e3, -INFINITY, INFINITY, "told");
  }
  if (!status)
    note(r, "frame_ms", app_quantile(list, FRAMES, 0.5) * 1e3, -INFINITY, INFINITY,
         "told; see sonde bench --scene image");
  stage_close(&s);
  return status;
}

int validate_image(bool quick, bool json) {
  static sonde_status (*const PARTS[])(report *) = {
      reference, speckle, attenuation, bone, enhancement, vein, phantom, deep, compensation, times};
  report r = {.quick = quick, .list.json = json};
  sonde_progress progress = app_progress();
  sonde_status status = SONDE_OK;
  const int count = sizeof PARTS / sizeof *PARTS;
  for (int k = 0; k < count && !status; ++k) {
    if (!progress.report((double)k / count, "measuring", progress.user)) status = SONDE_CANCELLED;
    if (!status) status = PARTS[k](&r);
  }
  app_progress_end();
  if (status) {
    r.error.status = status;
    return app_fail("validate", &r.error);
  }
  return validate_end(&r.list) ? APP_OK : APP_FAILED;
}
