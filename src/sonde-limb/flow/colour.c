// Colour Doppler's constants: cells, tables, the wall filter (docs/flow_theory.md).
#include "flow/colour.h"

#include "base/base.h"
#include "base/maths.h"
#include "base/random.h"

#include <string.h>

void sonde_colour_place(const sonde_colour_box *box, uint32_t line, uint32_t row, double xz_m[2]) {
  SONDE_ASSERT(box && line < SONDE_COLOUR_LINES && row < SONDE_COLOUR_ROWS);
  const double depth_m =
      box->top_m + (box->bottom_m - box->top_m) * (row + 0.5) / SONDE_COLOUR_ROWS;
  const sonde_vec3 place = sight_place(colour_sight(box), colour_line(box, line), depth_m);
  xz_m[0] = place.x, xz_m[1] = place.z;
}

bool sonde_colour_find(const sonde_colour_box *box, double x_m, double z_m, double line_row[2]) {
  SONDE_ASSERT(box && line_row);
  const sonde_vec3 at = sight_find(colour_sight(box), vec3(x_m, 0, z_m));
  line_row[0] = (at.x - box->left_m) / (box->right_m - box->left_m) * SONDE_COLOUR_LINES - 0.5;
  line_row[1] = (at.z - box->top_m) / (box->bottom_m - box->top_m) * SONDE_COLOUR_ROWS - 0.5;
  const double rounding = 1e-9;
  return line_row[0] >= -rounding && line_row[0] <= SONDE_COLOUR_LINES - 1 + rounding &&
         line_row[1] >= -rounding && line_row[1] <= SONDE_COLOUR_ROWS - 1 + rounding;
}

sonde_colour_def sonde_colour_def_default(void) {
  return (sonde_colour_def){.frequency_hz = 5e6,
                            .pulse_hz = 2000,
                            .packet = 10,
                            .filter_order = 1,
                            .beam_m = 0.45e-3,
                            .noise_db = -15,
                            .clutter_db = 35};
}

double sonde_colour_limit(const sonde_colour_def *def) {
  SONDE_ASSERT(def && def->frequency_hz > 0);
  return doppler_limit(def->frequency_hz, def->pulse_hz);
}

enum { LIMITS = 8 };
static void list_limits(const sonde_colour_def *def, sonde_bounded limit[LIMITS]) {
  const sonde_bounded LIMIT[LIMITS] = {{"frequency", def->frequency_hz, 1e6, 2e7},
                                       {"pulse repetition", def->pulse_hz, 100, 2e4},
                                       {"packet", def->packet, 4, COLOUR_PACKET},
                                       {"filter order", def->filter_order, 0, COLOUR_ORDER},
                                       {"beam", def->beam_m, 0.1e-3, 5e-3},
                                       {"noise", def->noise_db, -100, 40},
                                       {"clutter", def->clutter_db, -100, 80},
                                       {"persistence", def->persistence, 0, 0.95}};
  memcpy(limit, LIMIT, sizeof LIMIT);
}

bool sonde_colour_tune(sonde_colour *c, const sonde_colour_def *def) {
  SONDE_ASSERT(c && def);
  sonde_bounded limit[LIMITS];
  list_limits(def, limit);
  for (int k = 0; k < LIMITS; ++k)
    if (!sonde_bounded_holds(limit[k])) return false;
  const uint64_t seed = c->def.seed;
  c->def = *def, c->def.seed = seed;
  // Orthonormal polynomials over the packet, by Gram and Schmidt.
  for (uint32_t order = 0; order <= def->filter_order; ++order) {
    double values[COLOUR_PACKET], norm = 0;
    for (uint32_t n = 0; n < def->packet; ++n)
      values[n] = pow(2 * (n + 0.5) / def->packet - 1, order);
    for (uint32_t lower = 0; lower < order; ++lower) {
      double shared = 0;
      for (uint32_t n = 0; n < def->packet; ++n) shared += values[n] * (double)c->poly[lower][n];
      for (uint32_t n = 0; n < def->packet; ++n) values[n] -= shared * (double)c->poly[lower][n];
    }
    for (uint32_t n = 0; n < def->packet; ++n) norm += values[n] * values[n];
    for (uint32_t n = 0; n < def->packet; ++n) c->poly[order][n] = (float)(values[n] / sqrt(norm));
  }
  return true;
}

sonde_status sonde_colour_create(const sonde_colour_def *def, sonde_colour **out,
                                 sonde_error *error) {
  SONDE_ASSERT(def && out);
  *out = NULL;
  sonde_bounded limit[LIMITS];
  list_limits(def, limit);
  sonde_status status = sonde_bounded_check(limit, LIMITS, error);
  if (status) return status;
  sonde_colour *c = SONDE_NEW(sonde_colour, 1);
  if (!c) return sonde_fail_memory(error);
  c->def.seed = def->seed;
  (void)sonde_colour_tune(c, def);
  for (uint32_t k = 0; k < COLOUR_NORMALS + SONDE_COLOUR_CELLS; ++k)
    c->normal[k] = (float)sonde_random_normal(def->seed, k);
  *out = c;
  return SONDE_OK;
}

void sonde_colour_next(sonde_colour *c, uint64_t number, bool holds) {
  SONDE_ASSERT(c != NULL);
  c->frame = number, c->holds = holds;
}

void sonde_colour_destroy(sonde_colour *colour) { sonde_free(colour); }
