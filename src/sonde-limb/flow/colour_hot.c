// A frame of colour: packets of echoes of every cell, the wall filter, the autocorrelation of
// neighbouring pulses (Kasai), averages (docs/flow_theory.md).
#include "flow/colour.h"

#include "base/base.h"
#include "base/maths.h"
#include "base/random.h"

enum { LINES = SONDE_COLOUR_LINES, ROWS = SONDE_COLOUR_ROWS };

// What a cell's loss leaves of its amplitude.
static float amplitude_of(const sonde_colour_cell *cell) {
  return cell->loss_db > 0 ? expf(-0.11512925f * cell->loss_db) : 1;
}

// Echoes of blood in its cells: patterns that turn with the motion along the beam and are renewed
// as blood crosses it.
void colour_begin_blood(sonde_colour *c, const sonde_colour_cell *cells, uint32_t *drawn) {
  const sonde_colour_def *def = &c->def;
  const double radians_per_m_s =
      4 * SONDE_PI * def->frequency_hz / (COLOUR_SOUND_M_S * def->pulse_hz);
  c->blood_count = 0;
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) {
    if (cells[i].vessel == SONDE_COLOUR_NO_VESSEL) continue;
    const uint32_t b = c->blood_count++;
    c->blood[b] = i;
    const double phase = radians_per_m_s * (double)cells[i].towards_m_s;
    c->turn[b][0] = (float)cos(phase), c->turn[b][1] = (float)sin(phase);
    // A Gaussian beam that blood crosses by d keeps exp(-d^2/4 sigma^2) of its pattern.
    const double crossed = (double)cells[i].across_m_s / def->pulse_hz / def->beam_m;
    c->keep[b] = (float)exp(-0.25 * crossed * crossed);
    c->loss[b] = amplitude_of(&cells[i]);
    for (int k = 0; k < 2; ++k) c->pattern[b][k] = c->normal[(*drawn)++ % COLOUR_NORMALS];
  }
}

// Adds the blood's echo of one pulse: the beam mixes each cell into its neighbours, keeping the
// power.
void colour_add_blood(sonde_colour *c, uint32_t pulse, uint32_t *drawn) {
  static const float WEIGHT[3] = {0.40825f, 0.81650f, 0.40825f}; // 1 2 1 of unit power
  for (uint32_t b = 0; b < c->blood_count; ++b) {
    float *p = c->pattern[b];
    if (pulse > 0) {
      const float keep = c->keep[b], fresh = sqrtf(fmaxf(1 - keep * keep, 0));
      const float re = c->turn[b][0] * p[0] - c->turn[b][1] * p[1];
      const float im = c->turn[b][0] * p[1] + c->turn[b][1] * p[0];
      p[0] = keep * re + fresh * c->normal[(*drawn)++ % COLOUR_NORMALS];
      p[1] = keep * im + fresh * c->normal[(*drawn)++ % COLOUR_NORMALS];
    }
    const int row = (int)(c->blood[b] / LINES), line = (int)(c->blood[b] % LINES);
    for (int j = row > 0 ? row - 1 : 0; j <= row + 1 && j < ROWS; ++j)
      for (int i = line > 0 ? line - 1 : 0; i <= line + 1 && i < LINES; ++i) {
        const float w = c->loss[b] * WEIGHT[j - row + 1] * WEIGHT[i - line + 1];
        for (int k = 0; k < 2; ++k) c->echo[pulse][k][j * LINES + i] += w * p[k];
      }
  }
}

// Random numbers for every cell: another part of the table each time.
static const float *draw(const sonde_colour *c, uint32_t *drawn) {
  *drawn = *drawn * 1664525u + 1013904223u;
  return c->normal + (*drawn >> 8) % COLOUR_NORMALS;
}

// Noise of the receiver, and tissue, whose echo turns as it moves; both over the blood's power
// of 2.
void colour_begin_echoes(sonde_colour *c, const sonde_colour_cell *cells, uint32_t *drawn) {
  const sonde_colour_def *def = &c->def;
  const float noise = (float)pow(10, def->noise_db / 20),
              clutter = (float)pow(10, def->clutter_db / 20);
  const float *still[2] = {draw(c, drawn), draw(c, drawn)};
  float *tissue[2] = {c->lag[0], c->lag[1]}; // of use before the correlation
  const float radians_per_m_s =
      (float)(4 * SONDE_PI * def->frequency_hz / (COLOUR_SOUND_M_S * def->pulse_hz));
  bool moves = false;
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) {
    const bool solid = cells[i].vessel == SONDE_COLOUR_NO_VESSEL;
    const float loss = amplitude_of(&cells[i]);
    for (int k = 0; k < 2; ++k) tissue[k][i] = solid ? loss * clutter * still[k][i] : 0;
    c->drift[0][i] = 1, c->drift[1][i] = 0;
    if (!solid || cells[i].towards_m_s == 0) continue;
    moves = true;
    c->drift[0][i] = cosf(radians_per_m_s * cells[i].towards_m_s);
    c->drift[1][i] = sinf(radians_per_m_s * cells[i].towards_m_s);
  }
  for (uint32_t n = 0; n < def->packet; ++n) {
    const float *random[2] = {draw(c, drawn), draw(c, drawn)};
    for (int k = 0; k < 2; ++k)
      for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i)
        c->echo[n][k][i] = tissue[k][i] + noise * random[k][i];
    for (uint32_t i = 0; i < SONDE_COLOUR_CELLS && moves; ++i) {
      const float re = tissue[0][i], im = tissue[1][i];
      tissue[0][i] = c->drift[0][i] * re - c->drift[1][i] * im;
      tissue[1][i] = c->drift[0][i] * im + c->drift[1][i] * re;
    }
  }
}

// Takes the slow polynomials out of each packet and correlates what is left.
void colour_correlate(sonde_colour *c) {
  enum { AT_ONCE = LINES };
  const uint32_t packet = c->def.packet;
  for (uint32_t first = 0; first < SONDE_COLOUR_CELLS; first += AT_ONCE) {
    for (uint32_t order = 0; order <= c->def.filter_order; ++order)
      for (int k = 0; k < 2; ++k) {
        float sum[AT_ONCE] = {0};
        for (uint32_t n = 0; n < packet; ++n)
          for (uint32_t i = 0; i < AT_ONCE; ++i)
            sum[i] += c->poly[order][n] * c->echo[n][k][first + i];
        for (uint32_t n = 0; n < packet; ++n)
          for (uint32_t i = 0; i < AT_ONCE; ++i)
            c->echo[n][k][first + i] -= c->poly[order][n] * sum[i];
      }
    float lag[3][AT_ONCE] = {{0}};
    for (uint32_t n = 0; n < packet; ++n) {
      const float *re = c->echo[n][0] + first, *im = c->echo[n][1] + first;
      for (uint32_t i = 0; i < AT_ONCE; ++i) lag[2][i] += re[i] * re[i] + im[i] * im[i];
      if (n == 0) continue;
      const float *before = c->echo[n - 1][0] + first, *turned = c->echo[n - 1][1] + first;
      for (uint32_t i = 0; i < AT_ONCE; ++i) {
        lag[0][i] += before[i] * re[i] + turned[i] * im[i];
        lag[1][i] += before[i] * im[i] - turned[i] * re[i];
      }
    }
    for (int k = 0; k < 3; ++k)
      for (uint32_t i = 0; i < AT_ONCE; ++i)
        c->lag[k][first + i] = lag[k][i] / (float)(k < 2 ? packet - 1 : packet);
  }
}

// Averages over 3 x 3 cells, the rim repeated, and with the frame before; velocity and power
// follow.
void colour_average(sonde_colour *c) {
  const sonde_colour_def *def = &c->def;
  const float held = c->holds ? (float)def->persistence : 0;
  const float radians = (float)(sonde_colour_limit(def) / SONDE_PI);
  const float left = 1 - (float)(def->filter_order + 1) / (float)def->packet;
  const float noise = 2 * left * (float)pow(10, def->noise_db / 10);
  for (int k = 0; k < 3; ++k)
    for (int row = 0; row < ROWS; ++row) {
      const float *at = c->lag[k] + row * LINES;
      const float *up = row > 0 ? at - LINES : at, *down = row + 1 < ROWS ? at + LINES : at;
      float sum[LINES + 2];
      for (int i = 0; i < LINES; ++i) sum[i + 1] = up[i] + at[i] + down[i];
      sum[0] = sum[1], sum[LINES + 1] = sum[LINES];
      float *mean = c->held[k] + row * LINES;
      for (int i = 0; i < LINES; ++i)
        mean[i] = held * mean[i] + (1 - held) / 9 * (sum[i] + sum[i + 1] + sum[i + 2]);
    }
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i)
    c->value[i] =
        (sonde_colour_value){radians * atan2f(c->held[1][i], c->held[0][i]), c->held[2][i] / noise};
}

const sonde_colour_value *sonde_colour_frame(sonde_colour *c, const sonde_colour_cell *cells) {
  SONDE_ASSERT(c && cells);
  // Where the table of random numbers is entered.
  uint32_t drawn = (uint32_t)sonde_random_bits(c->def.seed, c->frame + COLOUR_NORMALS);
  colour_begin_echoes(c, cells, &drawn);
  drawn = (uint32_t)sonde_random_mix(drawn);
  colour_begin_blood(c, cells, &drawn);
  for (uint32_t pulse = 0; pulse < c->def.packet; ++pulse) colour_add_blood(c, pulse, &drawn);
  colour_correlate(c);
  colour_average(c);
  ++c->frame, c->holds = true;
  return c->value;
}
