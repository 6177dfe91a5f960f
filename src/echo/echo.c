// Life of a renderer, the operator's settings.
//
// sonde_echo_settings_default, sonde_echo_settings_clamp
// sonde_echo_create   buffers and random tables
// sonde_echo_destroy
// fill_tables         scatterers, noise, carrier phases
#include "base/base.h"
#include "base/random.h"
#include "echo/echo.h"

enum {
  LINES = 192,
  SAMPLES = 1024,
  MOST_LINES = 512,
  MOST_SAMPLES = 4096,
  MOST_PER_CELL = 4096,
  POOL_ROOM = SONDE_POOL + MOST_PER_CELL
};

static const double default_density_m3 = 32e9;
static const double cell_size_m = 2e-3;

sonde_echo_settings sonde_echo_settings_default(void) {
  return (sonde_echo_settings){.frequency_hz = 7.5e6,
                               .depth_m = 0.07,
                               .gain_db = 0,
                               .dynamic_range_db = 60,
                               .focus_m = 0.025,
                               .tgc_db_per_m = 0};
}

static double bounded(double value, double low, double high, double otherwise) {
  return isnan(value) ? otherwise : clamp(value, low, high);
}

sonde_echo_settings sonde_echo_settings_clamp(sonde_echo_settings s) {
  sonde_echo_settings d = sonde_echo_settings_default();
  return (sonde_echo_settings){
      .frequency_hz = bounded(s.frequency_hz, 1e6, 12e6, d.frequency_hz),
      .depth_m = bounded(s.depth_m, 0.02, 0.15, d.depth_m),
      .gain_db = bounded(s.gain_db, -30, 30, d.gain_db),
      .dynamic_range_db = bounded(s.dynamic_range_db, 30, 90, d.dynamic_range_db),
      .focus_m = bounded(s.focus_m, 5e-3, 0.15, d.focus_m),
      .tgc_db_per_m = bounded(s.tgc_db_per_m, -5000, 5000, d.tgc_db_per_m)};
}

static void fill_tables(sonde_echo *echo) {
  for (uint64_t i = 0; i < POOL_ROOM; ++i) {
    uint64_t j = i % SONDE_POOL; // a cube's piece may run over the end
    echo->pool_x[i] = (float)(sonde_random_uniform(echo->seed, 4 * j + 1) - 0.5);
    echo->pool_y[i] = (float)(sonde_random_uniform(echo->seed, 4 * j + 2) - 0.5);
    echo->pool_z[i] = (float)(sonde_random_uniform(echo->seed, 4 * j + 3) - 0.5);
    echo->pool_sign[i] = sonde_random_bits(echo->seed, 4 * j) & (1u << 20) ? 1.0f : -1.0f;
  }
  for (uint64_t i = 0; i < SONDE_NOISE; ++i)
    echo->noise[i] = (float)(sonde_random_normal(echo->seed + 1, i) * sqrt(0.5));
  for (int i = 0; i < SONDE_PHASES; ++i) {
    echo->phase[2 * i] = (float)cos(2 * SONDE_PI * i / SONDE_PHASES);
    echo->phase[2 * i + 1] = (float)-sin(2 * SONDE_PI * i / SONDE_PHASES);
  }
}

static bool allocate(sonde_echo *echo) {
  size_t nodes = SONDE_PLANE_COLUMNS * SONDE_PLANE_ROWS, lines = echo->lines;
  size_t image = lines * echo->samples;
  echo->rest = SONDE_NEW(sonde_vec3, nodes);
  echo->plane = SONDE_NEW(float, nodes *PLANE_FIELDS);
  echo->row = SONDE_NEW(float, lines *PLANE_FIELDS);
  echo->last_row = SONDE_NEW(float, lines *PLANE_FIELDS);
  echo->gain = SONDE_NEW(float, lines *SONDE_MEDIUM_ROWS);
  echo->loss_db = SONDE_NEW(float, lines);
  echo->air = SONDE_NEW(uint8_t, lines);
  echo->echo_count = SONDE_NEW(uint8_t, lines);
  echo->echoes = SONDE_NEW(specular, lines * SONDE_MAX_ECHOES);
  echo->grid = SONDE_NEW(float, 2 * (size_t)echo->grid_lines * echo->grid_samples);
  echo->beam = SONDE_NEW(float, 2 * lines * echo->grid_samples);
  echo->sum = SONDE_NEW(float, 2 * lines);
  echo->envelope = SONDE_NEW(float, image);
  echo->grey = SONDE_NEW(float, image);
  echo->pool_x = SONDE_NEW(float, POOL_ROOM);
  echo->pool_y = SONDE_NEW(float, POOL_ROOM);
  echo->pool_z = SONDE_NEW(float, POOL_ROOM);
  echo->pool_sign = SONDE_NEW(float, POOL_ROOM);
  echo->noise = SONDE_NEW(float, SONDE_NOISE);
  echo->phase = SONDE_NEW(float, 2 * SONDE_PHASES);
  echo->cell_set = SONDE_NEW(uint64_t, SONDE_CELL_SET);
  echo->cells = sonde_calloc(SONDE_MAX_CELLS, sizeof *echo->cells);
  return echo->rest && echo->plane && echo->row && echo->last_row && echo->gain && echo->loss_db &&
         echo->air && echo->echo_count && echo->echoes && echo->grid && echo->beam && echo->sum &&
         echo->envelope && echo->grey && echo->pool_x && echo->pool_y && echo->pool_z &&
         echo->pool_sign && echo->noise && echo->phase && echo->cell_set && echo->cells;
}

static sonde_status check_def(const sonde_echo_def *def, sonde_error *error) {
  bool lines = def->line_count == 0 || (def->line_count >= 8 && def->line_count <= MOST_LINES);
  bool samples =
      def->sample_count == 0 || (def->sample_count >= 64 && def->sample_count <= MOST_SAMPLES);
  if (!lines || !samples)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "%u lines of %u samples; expected 8 to %d lines of 64 to %d samples",
                      def->line_count, def->sample_count, MOST_LINES, MOST_SAMPLES);
  if (!(def->scatterers_per_m3 >= 0) || def->scatterers_per_m3 > 400e9)
    return sonde_fail(error, SONDE_ARGUMENT, "%g scatterers per m^3; expected 0 to 4e11",
                      def->scatterers_per_m3);
  return SONDE_OK;
}

sonde_status sonde_echo_create(const sonde_interior *interior, const sonde_echo_def *def,
                               sonde_echo **echo, sonde_error *error) {
  SONDE_ASSERT(interior != NULL && echo != NULL);
  sonde_echo_def none = {0};
  if (def == NULL) def = &none;
  *echo = NULL;
  sonde_status status = check_def(def, error);
  if (status != SONDE_OK) return status;
  sonde_echo *made = SONDE_NEW(sonde_echo, 1);
  if (made == NULL) return sonde_fail_memory(error);
  made->interior = interior;
  made->lines = def->line_count ? def->line_count : LINES;
  made->samples = def->sample_count ? def->sample_count : SAMPLES;
  made->grid_lines = made->lines + 2 * SONDE_LINE_PAD;
  made->grid_samples = made->samples + 2 * SONDE_SAMPLE_PAD;
  made->density_m3 = def->scatterers_per_m3 > 0 ? def->scatterers_per_m3 : default_density_m3;
  made->seed = def->seed;
  made->plain = def->plain;
  made->cell_m = cell_size_m;
  double per_cell = made->density_m3 * cell_size_m * cell_size_m * cell_size_m;
  made->per_cell = (uint32_t)clamp(8 * ceil(per_cell / 8), 8, MOST_PER_CELL);
  if (!allocate(made)) {
    sonde_echo_destroy(made);
    return sonde_fail_memory(error);
  }
  fill_tables(made);
  *echo = made;
  return SONDE_OK;
}

void sonde_echo_destroy(sonde_echo *echo) {
  if (echo == NULL) return;
  void *parts[] = {echo->rest,     echo->plane,  echo->row,        echo->last_row, echo->gain,
                   echo->loss_db,  echo->air,    echo->echo_count, echo->echoes,   echo->grid,
                   echo->beam,     echo->sum,    echo->envelope,   echo->grey,     echo->pool_x,
                   echo->pool_y,   echo->pool_z, echo->pool_sign,  echo->noise,    echo->phase,
                   echo->cell_set, echo->cells};
  for (size_t i = 0; i < SONDE_COUNT_OF(parts); ++i) sonde_free(parts[i]);
  sonde_free(echo);
}

const float *sonde_echo_envelope(const sonde_echo *echo, uint32_t *lines, uint32_t *samples) {
  SONDE_ASSERT(echo != NULL && lines != NULL && samples != NULL);
  *lines = echo->lines;
  *samples = echo->samples;
  return echo->envelope;
}
