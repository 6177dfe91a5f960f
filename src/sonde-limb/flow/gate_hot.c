// Pulses through a gate in a scene: scatterers that move along the vessels with the blood, their
// summed echo, columns of its spectrum (docs/flow_theory.md).
#include "flow/gate.h"

#include "base/base.h"
#include "base/random.h"
#include "echo/truth.h"
#include "flow/colour.h"

enum { BINS = SONDE_DOPPLER_BINS };
static const double beam_m = 0.45e-3; // standard deviation across; twice that beside the plane
static const double reach = 2.5;      // of them that scatterers fill
static const double edge_m = 0.3e-3;  // over which the gate's ends fade: the pulse's length
static const double tissue_db = 30, aside_db = 20, noise_db = -12; // over a gate full of blood
static const double least_hz = 250, most_hz = 2e4;

void sonde_gate_forget(sonde_gate *g) {
  SONDE_ASSERT(g != NULL);
  g->put = g->drawn = false, g->count = 0;
}

// Weights of a place in the gate, of its echo's amplitude: of the beam, and along it.
static double beam_weight(const double at_m[3]) {
  const double across = at_m[0] / beam_m, beside = at_m[1] / (2 * beam_m);
  return exp(-0.5 * (across * across + beside * beside));
}

static double gate_weight(const sonde_gate *g, double along_m) {
  return clamp((0.5 * g->settings.length_m + edge_m - fabs(along_m)) / (2 * edge_m), 0, 1);
}

// The same of its echo's power.
static double power_at(const sonde_gate *g, const double at_m[3]) {
  const double w = beam_weight(at_m) * gate_weight(g, at_m[2]);
  return w * w;
}

// Axes of the gate's frame in that of the probe.
static void axes_of(const sonde_gate *g, sonde_vec3 axis[3]) {
  const sight_lines sight = {g->radius_m, g->settings.steer_rad};
  axis[2] = sight_beam(sight, g->settings.x_m);
  axis[0] = vec3(axis[2].z, 0, -axis[2].x), axis[1] = vec3(0, 1, 0);
}

static sonde_vec3 world_of(const sonde_gate *g, sonde_pose probe, const double at_m[3]) {
  sonde_vec3 axis[3],
      at = sight_place((sight_lines){g->radius_m, 0}, g->settings.x_m, g->settings.z_m);
  axes_of(g, axis);
  for (int k = 0; k < 3; ++k) at = v_madd(at, at_m[k], axis[k]);
  return pose_apply(probe, at);
}

static void new_echo(sonde_gate *g, gate_scatterer *s) {
  for (int c = 0; c < 2; ++c) s->echo[c] = sonde_random_normal(g->seed, g->numbers++);
}

static void draw_scatterers(sonde_gate *g, double time_s) {
  g->seed = sonde_random_mix((uint64_t)llround(1e3 * time_s) + BINS), g->numbers = 0;
  g->half_m[0] = reach * beam_m, g->half_m[1] = 2 * reach * beam_m;
  g->half_m[2] = 0.5 * g->settings.length_m + edge_m;
  double power = 0;
  for (uint32_t i = 0; i < GATE_SCATTERERS; ++i) {
    gate_scatterer *s = &g->scatterer[i];
    for (int k = 0; k < 3; ++k)
      s->at_m[k] = g->half_m[k] * (2 * sonde_random_uniform(g->seed, g->numbers++) - 1);
    new_echo(g, s);
    power += 2 * power_at(g, s->at_m);
  }
  g->blood = 1 / sqrt(fmax(power, 1)), g->tissue_phase = 0, g->drawn = true;
}

void sonde_gate_put(sonde_gate *g, const sonde_flow_scene *scene,
                    const sonde_gate_settings *settings, const sonde_gate_place *place) {
  SONDE_ASSERT(g && scene && settings && place && place->frequency_hz > 0);
  const sonde_gate_settings before = g->settings;
  const double radius_m = sonde_truth_view_of(place->echo).radius_m,
               steer_rad = radius_m > 0 ? 0 : settings->steer_rad;
  const double way_m = (settings->z_m + 0.5 * settings->length_m) / cos(steer_rad);
  const double pulse_hz = clamp(4 * place->frequency_hz * settings->scale_m_s / COLOUR_SOUND_M_S,
                                least_hz, fmin(most_hz, COLOUR_SOUND_M_S / (2 * way_m)));
  const bool same = g->put && pulse_hz == g->pulse_hz && place->frequency_hz == g->frequency_hz &&
                    settings->baseline == before.baseline;
  g->settings = *settings, g->settings.steer_rad = steer_rad, g->radius_m = radius_m;
  g->frequency_hz = place->frequency_hz, g->pulse_hz = pulse_hz;
  g->tissue_m_s = place->tissue_m_s, g->loss_db = place->loss_db;
  const double time_s = scene->flow.time_s;
  if (!same) {
    g->count = 0, g->pulses = 0, g->next = (uint64_t)ceil(fmax(time_s, 0) * pulse_hz);
    g->number = (uint64_t)floor(fmax(time_s, 0) / SONDE_GATE_COLUMN_S + 1e-6);
  }
  if (!g->drawn || settings->length_m != before.length_m) draw_scatterers(g, time_s);
  // Which blood each of them is in.
  sonde_vec3 drawn[GATE_SCATTERERS], axis[3];
  scene_blood blood[GATE_SCATTERERS];
  const sonde_pose probe = sonde_truth_pose(place->echo);
  axes_of(g, axis);
  for (uint32_t i = 0; i < GATE_SCATTERERS; ++i)
    drawn[i] = world_of(g, probe, g->scatterer[i].at_m);
  scene_find_blood(scene, place->echo, drawn, GATE_SCATTERERS, blood);
  double solid = 0, all = 0;
  for (uint32_t i = 0; i < GATE_SCATTERERS; ++i) {
    gate_scatterer *s = &g->scatterer[i];
    s->blood = blood[i];
    const double part = power_at(g, s->at_m);
    all += part, solid += blood[i].drive < 0 ? part : 0;
    if (blood[i].drive < 0) continue;
    const sonde_vec3 way = q_rotate(q_conj(probe.rotation), blood[i].along);
    for (int k = 0; k < 3; ++k) s->way[k] = v_dot(way, axis[k]);
  }
  // Beside the beam there is always some tissue.
  g->tissue = pow(10, tissue_db / 20) * sqrt(solid / fmax(all, 1e-9) + pow(10, -aside_db / 10));
  if (!same || settings->x_m != before.x_m || settings->z_m != before.z_m) g->heard = g->tissue;
  g->put = true;
}

// Adds a scatterer's echoes of the step's pulses, the first after `wait_s`: place and phase go on
// evenly, so that its Gaussian weight and its turn follow by products.
static void add_echoes(const sonde_gate *g, const gate_scatterer *s, double speed, double wait_s,
                       uint32_t pulses, double sum[GATE_PULSES][2]) {
  const double each_s = 1 / g->pulse_hz, step_m = speed * each_s;
  const double wave = 4 * SONDE_PI * g->frequency_hz / COLOUR_SOUND_M_S;
  double at[3], step = 0, curve = 0, turn[2], by[2];
  for (int k = 0; k < 3; ++k) at[k] = s->at_m[k] + speed * wait_s * s->way[k];
  const double deeper_m = step_m * s->way[2], ends = at[2] + (pulses - 1) * deeper_m;
  double along = gate_weight(g, at[2]), gauss = g->blood * beam_weight(at);
  const double along_step = pulses > 1 ? (gate_weight(g, ends) - along) / (pulses - 1) : 0;
  if (along == 0 && along_step == 0) return;
  for (int k = 0; k < 2; ++k) {
    const double width = (k + 1) * beam_m, moved = step_m * s->way[k];
    step += moved * (at[k] + 0.5 * moved) / (width * width);
    curve += moved * moved / (width * width);
  }
  double ratio = exp(-step);
  const double bend = exp(-curve), phase = -wave * at[2], turns = -wave * deeper_m;
  turn[0] = cos(phase), turn[1] = sin(phase), by[0] = cos(turns), by[1] = sin(turns);
  for (uint32_t p = 0; p < pulses; ++p) {
    const double w = gauss * along, c = w * turn[0], q = w * turn[1];
    sum[p][0] += c * s->echo[0] - q * s->echo[1];
    sum[p][1] += c * s->echo[1] + q * s->echo[0];
    const double re = turn[0] * by[0] - turn[1] * by[1];
    turn[1] = turn[0] * by[1] + turn[1] * by[0], turn[0] = re;
    gauss *= ratio, ratio *= bend, along += along_step;
  }
}

// The spectrum of the last pulses as a column.
static void add_column(sonde_gate *g) {
  double echo[SPECTRUM_MOST][2], power[SPECTRUM_MOST], turned[SPECTRUM_MOST],
      velocity[SPECTRUM_MOST], mean, peak;
  const uint32_t count = spectrum_window(g->pulse_hz);
  for (uint32_t n = 0; n < count; ++n)
    for (int c = 0; c < 2; ++c) echo[n][c] = g->echo[(g->pulses - count + n) % SPECTRUM_MOST][c];
  spectrum_take(echo, count, power);
  const sonde_gate_spectrum axes = sonde_gate_axes(g);
  const int bins = (int)spectrum_bins(count), each = bins / BINS,
            shift = each * (int)lround(g->settings.baseline * (BINS / 2));
  const double filter_hz = fmin(g->settings.filter_hz, g->pulse_hz / 4);
  for (int row = 0; row < bins; ++row) {
    const int bin = (row + shift + bins) % bins;
    const bool kept = abs(bin - bins / 2) * g->pulse_hz / bins >= filter_hz;
    turned[row] = kept ? power[bin] : 0;
    velocity[row] = axes.low_m_s + ((double)row / each + 0.5) * 2 * axes.limit_m_s / BINS;
  }
  spectrum_read(count, turned, velocity, (uint32_t)bins, &mean, &peak);
  double row[BINS];
  spectrum_rows(turned, (uint32_t)bins, row);
  sonde_gate_column *column = &g->column[g->number % SONDE_GATE_COLUMNS];
  for (int r = 0; r < BINS; ++r) {
    // Noise alone has its power here, whatever the window.
    const double db = 10 * log10(fmax(row[r] / (0.375 * count), 1e-12));
    const double darkest_db = -12, range_db = 36;
    column->power[r] =
        (uint8_t)lrint(255 * clamp((db + g->settings.gain_db - darkest_db) / range_db, 0, 1));
  }
  column->number = g->number, column->mean_m_s = (float)mean, column->peak_m_s = (float)peak;
  if (g->count < SONDE_GATE_COLUMNS) ++g->count;
}

void gate_step(sonde_gate *g, const sonde_flow_scene *scene, double step_s) {
  SONDE_ASSERT(g && scene && step_s > 0);
  if (!g->put) return;
  const double time_s = scene->flow.time_s;
  const uint64_t end = (uint64_t)ceil(fmax(time_s, 0) * g->pulse_hz);
  const uint32_t pulses = (uint32_t)(end > g->next ? end - g->next : 0);
  SONDE_ASSERT(pulses <= GATE_PULSES);
  const double wait_s = (double)g->next / g->pulse_hz - (time_s - step_s);
  double sum[GATE_PULSES][2] = {{0}};
  for (uint32_t i = 0; i < GATE_SCATTERERS; ++i) {
    gate_scatterer *s = &g->scatterer[i];
    if (s->blood.drive < 0) continue;
    const double speed = scene_speed(scene, &s->blood);
    if (pulses > 0) add_echoes(g, s, speed, wait_s, pulses, sum);
    for (int k = 0; k < 3; ++k) s->at_m[k] += speed * step_s * s->way[k];
    // What has left the box comes back where its line enters it, as other blood.
    bool inside = true;
    for (int k = 0; k < 3; ++k) inside = inside && fabs(s->at_m[k]) <= g->half_m[k];
    if (inside) continue;
    double in = -INFINITY, out = INFINITY; // along its way, from where it is
    for (int k = 0; k < 3; ++k) {
      if (fabs(s->way[k]) < 1e-9) continue;
      const double low = (-g->half_m[k] - s->at_m[k]) / s->way[k],
                   high = (g->half_m[k] - s->at_m[k]) / s->way[k];
      in = fmax(in, fmin(low, high)), out = fmin(out, fmax(low, high));
    }
    const double chord = fmax(out - in, 1e-5);
    const double by = out < 0 ? -ceil(-out / chord) * chord : ceil(fmax(in, 0) / chord) * chord;
    for (int k = 0; k < 3; ++k)
      s->at_m[k] = clamp(s->at_m[k] + by * s->way[k], -g->half_m[k], g->half_m[k]);
    new_echo(g, s);
  }
  const double left = pow(10, -g->loss_db / 20), noise = pow(10, noise_db / 20) / sqrt(2);
  const double turns =
      4 * SONDE_PI * g->frequency_hz / COLOUR_SOUND_M_S * g->tissue_m_s / g->pulse_hz;
  // What a new picture makes of the tissue comes gently: a step would be heard at all frequencies.
  const double gentle_s = 0.1, follows = 1 - exp(-1 / (gentle_s * g->pulse_hz));
  for (uint32_t p = 0; p < pulses; ++p) {
    double *echo = g->echo[g->pulses++ % SPECTRUM_MOST];
    g->heard += follows * (g->tissue - g->heard);
    g->tissue_phase = fmod(g->tissue_phase + turns, 2 * SONDE_PI);
    echo[0] = left * (sum[p][0] + g->heard * cos(g->tissue_phase));
    echo[1] = left * (sum[p][1] + g->heard * sin(g->tissue_phase));
    for (int c = 0; c < 2; ++c) echo[c] += noise * sonde_random_normal(g->seed, g->numbers++);
  }
  g->next = end;
  const uint64_t number = (uint64_t)floor(fmax(time_s, 0) / SONDE_GATE_COLUMN_S + 1e-6);
  if (number == g->number) return;
  g->number = number;
  if (g->pulses >= spectrum_window(g->pulse_hz)) add_column(g);
}

uint32_t sonde_gate_columns(const sonde_gate *g, sonde_gate_column *column) {
  SONDE_ASSERT(g && column);
  for (uint32_t n = 0; n < g->count; ++n)
    column[n] = g->column[(g->number + 1 - g->count + n) % SONDE_GATE_COLUMNS];
  return g->count;
}

sonde_gate_spectrum sonde_gate_axes(const sonde_gate *g) {
  SONDE_ASSERT(g != NULL);
  if (!g->put) return (sonde_gate_spectrum){.on = false};
  const double limit_m_s = doppler_limit(g->frequency_hz, g->pulse_hz);
  const double shift = round(g->settings.baseline * (BINS / 2)) - BINS / 2 - 0.5;
  const double window_s = spectrum_window(g->pulse_hz) / g->pulse_hz;
  return (sonde_gate_spectrum){.on = true,
                               .settings = g->settings,
                               .pulse_hz = g->pulse_hz,
                               .window_s = window_s,
                               .limit_m_s = limit_m_s,
                               .low_m_s = limit_m_s * shift / (BINS / 2),
                               .slowest_m_s = sonde_doppler_slowest(
                                   limit_m_s, g->settings.filter_hz, window_s, g->pulse_hz)};
}

double sonde_gate_truth(const sonde_gate *g, const sonde_flow_scene *scene,
                        const sonde_echo *echo) {
  SONDE_ASSERT(g && scene && echo && g->put);
  enum { SIDE = 8, PLACES = SIDE * SIDE * SIDE };
  sonde_vec3 drawn[PLACES], axis[3];
  scene_blood blood[PLACES];
  double power[PLACES], sum = 0, moved = 0;
  const sonde_pose probe = sonde_truth_pose(echo);
  axes_of(g, axis);
  const sonde_vec3 beam = q_rotate(probe.rotation, axis[2]);
  for (int n = 0; n < PLACES; ++n) {
    const int step[3] = {n % SIDE, n / SIDE % SIDE, n / (SIDE * SIDE)};
    double at_m[3];
    for (int k = 0; k < 3; ++k) at_m[k] = g->half_m[k] * ((step[k] + 0.5) / SIDE * 2 - 1);
    drawn[n] = world_of(g, probe, at_m), power[n] = power_at(g, at_m);
  }
  scene_find_blood(scene, echo, drawn, PLACES, blood);
  for (int n = 0; n < PLACES; ++n) {
    if (blood[n].drive < 0) continue;
    sum += power[n];
    moved -= power[n] * scene_speed(scene, &blood[n]) * v_dot(blood[n].along, beam);
  }
  return sum > 0 ? moved / sum : 0;
}
