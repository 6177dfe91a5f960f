// sonde doppler: the spectrum of pulsed Doppler in a main vein of a limb, at rest, while the calf
// is squeezed, during a Valsalva manoeuvre, with a clot somewhere or with valves that leak.
#include "options.h"
#include "paper_plot.h"

#include "sonde/limb_model.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char VERB[] = "doppler";

typedef struct options {
  const char *model, *csv, *output;
  int vessel; // in the order of sonde_flow_segment; after them the artery
  int clot;   // segment, -1: none
  double clot_share, leak, squeeze_s, valsalva_s, angle_rad, gate_m, pulse_hz, frequency_hz,
      seconds;
  long seed;
  bool json;
} options;

static void prepare(void *to) {
  sonde_doppler_def def = sonde_doppler_def_default();
  *(options *)to = (options){.vessel = SONDE_FLOW_COMMON_FEMORAL,
                             .clot = -1,
                             .clot_share = 1,
                             .squeeze_s = NAN,
                             .valsalva_s = NAN,
                             .angle_rad = def.angle_rad,
                             .gate_m = def.gate_m,
                             .pulse_hz = NAN,
                             .frequency_hz = def.frequency_hz,
                             .seconds = 12,
                             .seed = 1};
}

// In the order of sonde_flow_segment.
#define SEGMENT_NAMES                                                                              \
  "calf", "popliteal", "femoral", "common-femoral", "external-iliac", "common-iliac",              \
      "deep-femoral", "great-saphenous"
static const char *const VESSELS[] = {SEGMENT_NAMES, "artery", NULL};
static const char *const SEGMENTS[] = {SEGMENT_NAMES, NULL};
static const double RAD_PER_DEG = 0.017453292519943295, STRAIN_S = 5;

static const app_option TABLE[] = {
    OPT_MODEL(model),
    OPT_WORD(vessel, "vessel", "NAME", VESSELS,
             "vein under the gate, or the common femoral artery; default common-femoral"),
    OPT_REAL(squeeze_s, "squeeze-s", "T", 0, 600, 1, "a hand squeezes the calf at T"),
    OPT_REAL(valsalva_s, "valsalva-s", "T", 0, 600, 1, "the patient strains for 5 s from T on"),
    OPT_WORD(clot, "clot", "NAME", SEGMENTS, "segment with a clot; default none"),
    OPT_REAL(clot_share, "clot-share", "S", 0, 1, 1,
             "share of the area that the clot takes; default 1"),
    OPT_REAL(leak, "leak", "S", 0, 1, 1,
             "what the valves leave open to blood that falls back: 0 competent, 1 none; default 0"),
    OPT_REAL(seconds, "seconds", "S", 2, 120, 1, "length of the recording; default 12"),
    OPT_OUTPUT(output, "o,output", "SVG", "draw the spectrum over time"),
    OPT_OUTPUT(csv, "csv", "FILE",
               "write time, mean and peak of the spectrum, and the true means in the gate and over "
               "the lumen"),
    OPT_JSON(json),
    OPT_GROUP("The scanner"),
    OPT_REAL(angle_rad, "angle-deg", "A", 0, 180, 0.017453292519943295,
             "between beam and flow; 90 and about it measure nothing; default 60"),
    OPT_REAL(gate_m, "gate-mm", "G", 0.5, 20, 1e-3, "length of the gate; default 3"),
    OPT_REAL(frequency_hz, "frequency-mhz", "F", 1, 15, 1e6, "of the beam; default 5"),
    OPT_REAL(
        pulse_hz, "prf-hz", "F", 500, 20000, 1,
        "pulse repetition frequency; default: one that the fastest blood of the recording needs"),
    OPT_INTEGER(seed, "seed", "N", 0, 1000000000, "of scatterers and noise; default 1")};

static int check(void *from) {
  const options *a = from;
  if (a->clot < 0 && a->clot_share < 1) return app_usage_error(VERB, "--clot-share needs --clot");
  if (fabs(cos(a->angle_rad)) < 0.05)
    return app_usage_error(VERB,
                           "--angle-deg is %g: across the flow, within 3 degrees of 90, nothing "
                           "is measured",
                           a->angle_rad / RAD_PER_DEG);
  return APP_OK;
}

// What the examiner reads off the spectrum, m/s and s; NaN where the recording has none of it.
typedef struct readings {
  double mean, least, most, peak; // of the mean velocity at rest; of the envelope, all the time
  double augmentation;            // greatest mean after the squeeze over the mean at rest
  double reflux;                  // time of blood that falls back after squeeze or strain
  double truth_mean, truth_reflux, truth_phasicity; // the same of the network
} readings;

typedef struct record {
  uint32_t count;
  double hop_s;
  double *mean, *peak;   // [count] read off the spectrum
  double *truth, *lumen; // [count] true mean velocity in the gate and over the lumen
  uint8_t *grey;         // [count * SONDE_DOPPLER_BINS] by column
  double pressure_pa;    // in the vein at the start
  double limit, slowest; // velocities that are not folded, that pass the wall filter
} record;

static const double HOP_S = 0.01, DARKEST_DB = 36, SPARE = 1.25;
enum { HOP_STEPS = 10 }; // HOP_S over STEP_S

static void clear(record *r) {
  free(r->mean), free(r->peak), free(r->truth), free(r->lumen), free(r->grey);
}

// Puts the median of five columns in the place of each, as scanners smooth their readings.
static void smooth(double *value, double *scratch, uint32_t count) {
  for (uint32_t k = 0; k < count; ++k) {
    double near[5];
    for (int i = 0; i < 5; ++i) {
      double now = value[(uint32_t)fmin(fmax((double)k + i - 2, 0), count - 1.0)];
      int j = i;
      for (; j > 0 && near[j - 1] > now; --j) near[j] = near[j - 1];
      near[j] = now;
    }
    scratch[k] = near[2];
  }
  memcpy(value, scratch, count * sizeof *value);
}

// Blood under the gate: mean velocity over the lumen every STEP_S, and what gives it its profile.
typedef struct blood {
  uint32_t count;
  double *mean_m_s;                          // [count]
  double radius_m, fastest_m_s, pressure_pa; // the last at the start
  sonde_flow_def flow;
} blood;

static const double STEP_S = 1e-3, LONGEST_WINDOW_S = SONDE_DOPPLER_PULSES / 500.0;

// Mean velocity and profile a step after `n - 1`, or at the start.
static void follow(const blood *b, uint32_t n, double profile[SONDE_FLOW_RINGS]) {
  n = n < b->count ? n : b->count - 1;
  if (n == 0) sonde_flow_steady(b->mean_m_s[0], profile);
  if (n > 0) sonde_flow_follow(profile, b->radius_m, b->mean_m_s[n], STEP_S);
}

// Runs the network, with half a window beyond the recording.
static sonde_status run_blood(const options *a, const sonde_model *model, blood *b,
                              sonde_error *error) {
  const sonde_limb *limb = sonde_limb_of(model);
  bool artery = a->vessel == SONDE_FLOW_SEGMENTS;
  sonde_flow_segment segment = (sonde_flow_segment)(artery ? SONDE_FLOW_COMMON_FEMORAL : a->vessel);
  sonde_flow_def *flow = &b->flow;
  *flow = sonde_flow_def_default(limb);
  sonde_flow_def_hold(sonde_limb_pose_of(model), flow);
  for (int v = 0; v < SONDE_FLOW_VEINS && a->clot >= 0; ++v)
    flow->closed[a->clot][v] = a->clot_share;
  flow->leak = a->leak;
  if (!isnan(a->squeeze_s)) flow->squeeze_from_s = a->squeeze_s;
  if (!isnan(a->valsalva_s))
    flow->valsalva_from_s = a->valsalva_s, flow->valsalva_to_s = a->valsalva_s + STRAIN_S;
  sonde_flow net;
  sonde_status status = sonde_flow_start(flow, &net, error);
  if (status) return status;
  const uint32_t branch =
      artery && limb ? sonde_limb_vessel_find(limb, "common femoral artery") : SONDE_LIMB_NO_VESSEL;
  b->pressure_pa = sonde_flow_pressure(&net, segment);
  b->radius_m = sqrt(fmax(sonde_flow_area(&net, segment, 0), 1e-6) / acos(-1));
  if (artery) b->radius_m = 4.4e-3;
  if (branch != SONDE_LIMB_NO_VESSEL)
    b->radius_m = sonde_limb_vessel_place(limb, branch, 0.02).radius_m;
  b->count = (uint32_t)((a->seconds + LONGEST_WINDOW_S) / STEP_S);
  b->mean_m_s = calloc(b->count, sizeof *b->mean_m_s);
  if (!b->mean_m_s) return app_error(error, SONDE_MEMORY, "out of memory");
  double profile[SONDE_FLOW_RINGS];
  for (uint32_t n = 0; n < b->count; ++n) {
    if (n > 0 && !artery) sonde_flow_step(&net, STEP_S);
    b->mean_m_s[n] = artery ? sonde_flow_artery(flow->heart_rate_hz * n * STEP_S)
                            : sonde_flow_velocity(&net, segment);
    follow(b, n, profile);
    for (int k = 0; k < SONDE_FLOW_RINGS; ++k)
      b->fastest_m_s = fmax(b->fastest_m_s, fabs(profile[k]));
  }
  return SONDE_OK;
}

// The gate on the blood; a column of the spectrum every HOP_S, its time the middle of its window.
static sonde_status take(const options *a, const sonde_model *model, record *r,
                         sonde_error *error) {
  blood b = {0};
  sonde_status status = run_blood(a, model, &b, error);
  r->pressure_pa = b.pressure_pa;
  sonde_doppler_def def = sonde_doppler_def_default();
  def.half_short_m = def.half_long_m = b.radius_m;
  def.angle_rad = a->angle_rad, def.gate_m = fmin(a->gate_m, 2 * b.radius_m);
  def.frequency_hz = a->frequency_hz, def.seed = (uint64_t)a->seed;
  // The beam's width spreads the spectrum by a fifth beyond the fastest blood.
  def.pulse_hz = 1000;
  double needed = 1000 * SPARE * b.fastest_m_s / sonde_doppler_limit(&def);
  def.pulse_hz =
      isnan(a->pulse_hz) ? fmin(fmax(500 * ceil(needed / 500), 1500), 20000) : a->pulse_hz;
  sonde_doppler *doppler = NULL;
  if (!status) status = sonde_doppler_create(&def, &doppler, error);
  r->count = (uint32_t)(a->seconds / HOP_S), r->limit = sonde_doppler_limit(&def);
  const double window_s = fmax(SONDE_DOPPLER_WINDOW_S, SONDE_DOPPLER_PULSES / def.pulse_hz);
  r->slowest = sonde_doppler_slowest(r->limit, def.filter_hz, window_s, def.pulse_hz);
  r->mean = calloc(r->count, sizeof *r->mean), r->peak = calloc(r->count, sizeof *r->peak);
  r->truth = calloc(r->count, sizeof *r->truth), r->lumen = calloc(r->count, sizeof *r->lumen);
  r->grey = calloc(r->count, SONDE_DOPPLER_BINS);
  double *power = calloc(r->count, SONDE_DOPPLER_BINS * sizeof *power), most = 0;
  if (!status && !(r->mean && r->peak && r->truth && r->lumen && r->grey && power))
    status = app_error(error, SONDE_MEMORY, "out of memory");
  double time = -0.5 * window_s, profile[SONDE_FLOW_RINGS];
  uint64_t pulses = 0;
  uint32_t step = 0;
  if (!status) follow(&b, 0, profile), r->truth[0] = sonde_doppler_truth(doppler, profile);
  for (uint32_t column = 0; column < r->count && !status; ++column) {
    const double now = column * HOP_S;
    r->lumen[column] = b.mean_m_s[(uint32_t)lround(now / STEP_S)];
    for (; time < now + 0.5 * window_s; time = (double)++pulses / def.pulse_hz - 0.5 * window_s) {
      while (step < fmax(time, 0) / STEP_S) {
        follow(&b, ++step, profile);
        if (step % HOP_STEPS == 0 && step / HOP_STEPS < r->count)
          r->truth[step / HOP_STEPS] = sonde_doppler_truth(doppler, profile);
      }
      sonde_doppler_pulse(doppler, profile);
    }
    sonde_doppler_spectrum s;
    sonde_doppler_read(doppler, &s);
    r->mean[column] = s.mean_m_s, r->peak[column] = s.peak_m_s;
    memcpy(power + (size_t)column * SONDE_DOPPLER_BINS, s.power, sizeof s.power);
    for (int k = 0; k < SONDE_DOPPLER_BINS; ++k) most = fmax(most, s.power[k]);
  }
  for (size_t i = 0; i < (size_t)r->count * SONDE_DOPPLER_BINS && !status; ++i) {
    double db = power[i] > 0 ? 10 * log10(power[i] / most) + 6 : -INFINITY;
    r->grey[i] = (uint8_t)lround(255 * pow(fmin(fmax(1 + db / DARKEST_DB, 0), 1), 1.2));
  }
  if (!status) smooth(r->mean, power, r->count), smooth(r->peak, power, r->count);
  free(power), free(b.mean_m_s);
  sonde_doppler_destroy(doppler);
  return status;
}

// Rest is what lies before the first manoeuvre, without the first second.
static readings read_off(const options *a, const record *r) {
  readings out = {NAN, NAN, NAN, 0, NAN, NAN, NAN, NAN, NAN};
  double low = INFINITY, high = -INFINITY;
  out.peak = 0;
  double squeeze = isnan(a->squeeze_s) ? INFINITY : a->squeeze_s;
  double strain = isnan(a->valsalva_s) ? INFINITY : a->valsalva_s;
  double from = 1, to = fmin(fmin(squeeze, strain), a->seconds), sum = 0, truth = 0, lumen = 0;
  uint32_t count = 0;
  for (uint32_t k = 0; k < r->count; ++k) {
    double t = k * HOP_S;
    if (fabs(r->peak[k]) > fabs(out.peak)) out.peak = r->peak[k];
    if (t < from || t >= to) continue;
    sum += r->mean[k], truth += r->truth[k], lumen += r->lumen[k], ++count;
    // Extremes of means over a fifth of a second, which average the scatterers' chance.
    enum { BESIDE = 10 };
    double now = 0, true_now = 0;
    if (k < BESIDE || k + BESIDE >= r->count || t + BESIDE * HOP_S >= to) continue;
    for (uint32_t n = k - BESIDE; n <= k + BESIDE; ++n)
      now += r->mean[n] / (2 * BESIDE + 1), true_now += r->truth[n] / (2 * BESIDE + 1);
    out.least = fmin(out.least, now), out.most = fmax(out.most, now);
    low = fmin(low, true_now), high = fmax(high, true_now);
  }
  if (count)
    out.mean = sum / count, out.truth_mean = lumen / count,
    out.truth_phasicity = (high - low) * count / truth;
  double greatest = -INFINITY, back = 0, truth_back = 0;
  for (uint32_t k = 0; k < r->count; ++k) {
    double t = k * HOP_S;
    if (t > squeeze && t < squeeze + 3) greatest = fmax(greatest, r->mean[k]);
    if (t < fmin(squeeze, strain)) continue;
    if (r->mean[k] < -r->slowest) back += HOP_S;
    if (r->truth[k] < -r->slowest) truth_back += HOP_S;
  }
  if (squeeze < a->seconds && count) out.augmentation = greatest / out.mean;
  if (fmin(squeeze, strain) < a->seconds) out.reflux = back, out.truth_reflux = truth_back;
  return out;
}

static sonde_status draw(const options *a, const record *r, sonde_error *error) {
  enum { WIDTH = 900, HEIGHT = 360 };
  sonde_file *file = NULL;
  sonde_status status = sonde_file_create(a->output, &file, error);
  if (status) return status;
  char title[96];
  snprintf(title, sizeof title, "Pulsed Doppler, %s%s (synthetic)", VESSELS[a->vessel],
           a->vessel == SONDE_FLOW_SEGMENTS ? "" : " vein");
  sonde_svg_begin(file, title, WIDTH, HEIGHT);
  paper_plot plot = {.file = file,
                     .left = 60,
                     .top = 40,
                     .width = WIDTH - 80,
                     .height = HEIGHT - 100,
                     .x_low = 0,
                     .x_high = r->count * HOP_S,
                     .y_low = -100 * r->limit,
                     .y_high = 100 * r->limit};
  plot_begin(&plot, title, "time, s", "velocity towards the heart, cm/s");
  const double right = plot.left + plot.width, bottom = plot.top + plot.height;
  const double area[4][2] = {
      {plot.left, plot.top}, {right, plot.top}, {right, bottom}, {plot.left, bottom}};
  sonde_svg_put_line(file, area, 4, "fill='#000'");
  // The picture's rows run from the highest velocity down; the axes may have been widened.
  sonde_image image = {.width = r->count, .height = SONDE_DOPPLER_BINS};
  image.pixels = malloc((size_t)image.width * image.height);
  if (!image.pixels) status = app_error(error, SONDE_MEMORY, "out of memory");
  for (uint32_t y = 0; y < image.height && !status; ++y)
    for (uint32_t x = 0; x < image.width; ++x)
      image.pixels[(size_t)y * image.width + x] =
          r->grey[(size_t)x * SONDE_DOPPLER_BINS + (SONDE_DOPPLER_BINS - 1 - y)];
  double scale = plot.height / (plot.y_high - plot.y_low);
  if (!status)
    status = sonde_svg_put_image(file, plot.left, plot.top + (plot.y_high - 100 * r->limit) * scale,
                                 plot.width, 200 * r->limit * scale, &image, error);
  free(image.pixels);
  double(*line)[2] = malloc(r->count * sizeof *line);
  for (uint32_t k = 0; k < r->count && line; ++k)
    line[k][0] = k * HOP_S, line[k][1] = 100 * r->peak[k];
  const double zero[2][2] = {{0, 0}, {r->count * HOP_S, 0}};
  plot_line(&plot, zero, 2, "#56b4e9", NULL);
  if (line) plot_line(&plot, (const double(*)[2])line, r->count, "#d9a400", NULL);
  free(line);
  sonde_status ended = sonde_svg_end(file, status ? NULL : error);
  return status ? status : ended;
}

static int run(void *from) {
  const options *a = from;
  sonde_error error = {0};
  sonde_model *model = NULL;
  record r = {0};
  sonde_status status = sonde_limb_model_load(a->model, &model, &error);
  const sonde_limb *limb = status ? NULL : sonde_limb_of(model);
  app_progress_begin("taking the spectrum");
  if (!status) status = take(a, model, &r, &error);
  if (!status && a->output) status = draw(a, &r, &error);
  sonde_file *file = NULL;
  if (!status && a->csv) status = sonde_file_create(a->csv, &file, &error);
  if (!status && file) {
    sonde_file_printf(file, "time_s,mean_cm_s,peak_cm_s,true_mean_cm_s,true_lumen_cm_s\n");
    for (uint32_t k = 0; k < r.count; ++k)
      sonde_file_printf(file, "%.2f,%.4f,%.4f,%.4f,%.4f\n", k * HOP_S, 100 * r.mean[k],
                        100 * r.peak[k], 100 * r.truth[k], 100 * r.lumen[k]);
    status = sonde_file_commit(file, &error);
  }
  app_progress_end();
  if (status) {
    clear(&r);
    sonde_model_destroy(model);
    return app_fail(VERB, &error);
  }
  readings x = read_off(a, &r);
  const bool is_limb = limb != NULL;
  const sonde_limb_position position = sonde_limb_position_of(model);
  const bool posed = position != SONDE_LIMB_POSITIONS;
  double phasicity = (x.most - x.least) / x.mean;
  if (a->json) {
    app_json_begin();
    app_json("vessel:%s limb:%hhd seconds:%g limit_cm_s:%g", VESSELS[a->vessel], is_limb,
             a->seconds, 100 * r.limit);
    app_json("mean_cm_s:%g least_cm_s:%g most_cm_s:%g phasicity:%g peak_cm_s:%g", 100 * x.mean,
             100 * x.least, 100 * x.most, phasicity, 100 * x.peak);
    if (a->vessel != SONDE_FLOW_SEGMENTS)
      app_json("venous_mmhg:%g", r.pressure_pa / SONDE_PA_PER_MMHG);
    if (posed) app_json_text("position", sonde_limb_position_name(position));
    app_json("augmentation:%g reflux_s:%g true_mean_cm_s:%g true_phasicity:%g true_reflux_s:%g",
             x.augmentation, x.reflux, 100 * x.truth_mean, x.truth_phasicity, x.truth_reflux);
    app_json_end();
  } else {
    printf("%s: at rest %.1f cm/s in the gate (%.1f to %.1f with breath and beat, phasicity %.2f), "
           "peak %.1f cm/s\n",
           VESSELS[a->vessel], 100 * x.mean, 100 * x.least, 100 * x.most, phasicity, 100 * x.peak);
    if (posed)
      printf("%s: %.0f mmHg in the vein\n", sonde_limb_position_name(position),
             r.pressure_pa / SONDE_PA_PER_MMHG);
    printf("mean over the lumen in truth %.1f cm/s; velocities beyond %.0f cm/s are folded\n",
           100 * x.truth_mean, 100 * r.limit);
    if (!isnan(x.augmentation))
      printf("squeeze of the calf: %.1f times the flow at rest\n", x.augmentation);
    if (!isnan(x.reflux)) printf("reflux: %.2f s\n", x.reflux);
    if (fabs(a->angle_rad / RAD_PER_DEG - 90) < 30)
      printf("the angle is beyond 60 degrees: small errors of the cursor are large ones of "
             "velocity\n");
    if (!is_limb) printf("the model is no limb: its veins are typical ones\n");
  }
  clear(&r);
  sonde_model_destroy(model);
  return APP_OK;
}

const app_command cmd_doppler = {
    .verb = "doppler",
    .summary = "take the Doppler spectrum of a vein or the artery",
    .usage = "[MODEL] [--vessel NAME] [--squeeze-s T] [-o SVG] [options]",
    .text =
        "Puts a pulsed Doppler gate into a main vein of a limb, or the common femoral artery, and "
        "reads velocity, phasicity, augmentation and reflux off the spectrum. The veins' flow "
        "follows from heart, breath, valves, clots and what hand and patient do. Synthetic.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .prepare = prepare,
    .check = check,
    .run = run};
