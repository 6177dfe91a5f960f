// Life of a renderer, the operator's settings.
#include "base/base.h"
#include "base/vector.h"
#include "echo/live.h"
#include "echo/cubes.h"
#include "echo/echo.h"
#include "echo/bands.h"
#include "echo/gates.h"
#include "echo/sound.h"
#include "interior/fields.h"

#include <stddef.h>
#include <stdlib.h>
#include <string.h>

enum {
  LINES = 192,
  SAMPLES = 1024,
  MOST_SAMPLES = 4096,
  MOST_PER_CELL = 4096,
  STEP = 64, // scatterers of a cube come in layers of 8 x 8
};

static const double default_density_m3 = 32e9;
#define LEAST_DEPTH_M 0.02
static const double cell_size_m = 2e-3;

sonde_echo_settings sonde_echo_settings_default(void) {
  return (sonde_echo_settings){.frequency_hz = 7.5e6,
                               .depth_m = 0.07,
                               .gain_db = 0,
                               .dynamic_range_db = 60,
                               .focus_m = 0.025,
                               .tgc_db_per_m = 0};
}

#define RANGE(key, low, high, si, member)                                                          \
  { key, low, high, si, offsetof(sonde_echo_settings, member) }
static const sonde_echo_range ranges[] = {
    RANGE("gain_db", -30, 30, 1, gain_db),
    RANGE("depth_mm", 1e3 * LEAST_DEPTH_M, 150, 1e-3, depth_m),
    RANGE("frequency_mhz", 1, 12, 1e6, frequency_hz),
    RANGE("dynamic_range_db", 30, 90, 1, dynamic_range_db),
    RANGE("focus_mm", 5, 150, 1e-3, focus_m),
    RANGE("tgc_db_per_cm", -50, 50, 1e2, tgc_db_per_m),
};
#undef RANGE
_Static_assert(SONDE_COUNT_OF(ranges) == SONDE_ECHO_SETTINGS, "a range per setting");
_Static_assert(SONDE_ECHO_SETTINGS * sizeof(double) == sizeof(sonde_echo_settings), "all of them");

const sonde_echo_range *sonde_echo_ranges(void) { return ranges; }

sonde_echo_settings sonde_echo_settings_clamp(sonde_echo_settings s) {
  const sonde_echo_settings d = sonde_echo_settings_default();
  for (size_t k = 0; k < SONDE_ECHO_SETTINGS; ++k) {
    const sonde_echo_range *r = &ranges[k];
    double *value = (double *)(void *)((char *)&s + r->offset);
    double otherwise = *(const double *)(const void *)((const char *)&d + r->offset);
    *value = isnan(*value) ? otherwise : clamp(*value, r->low * r->si, r->high * r->si);
  }
  return s;
}

#define CARVE(pointer, count) ((pointer) = sonde_carve(block, &used, (count), sizeof *(pointer)))

static size_t carve_pool(scatter_pool *pool, char *block, size_t used, size_t count) {
  CARVE(pool->x, count);
  CARVE(pool->y, count);
  CARVE(pool->z, count);
  CARVE(pool->sign, count);
  return used;
}

// What vectors read and write; without a block it only measures. Whole vectors begin at whole cache
// lines: one that straddles two is read twice. Rows end with room for whole vectors that run over.
static size_t carve(sonde_echo *echo, char *block) {
  size_t lines = echo->padded, image = lines * echo->samples, used = 0,
         most_lines = SONDE_FINE * lines + 2 * SONDE_MOST_TAPS + 4 * ECHO_ALIGN;
  for (int k = 0; k < 2; ++k) CARVE(echo->wide[k], lines * MOST_FIELDS);
  CARVE(echo->level[0], lines * MOST_LEVELS);
  CARVE(echo->level[1], lines * MOST_LEVELS);
  for (int k = 0; k < 3; ++k) CARVE(echo->septum[k], lines);
  CARVE(echo->knots, lines * TEXTURES * KNOT_FLOATS);
  CARVE(echo->scatter, lines);
  CARVE(echo->loss, lines);
  CARVE(echo->rough, lines);
  CARVE(echo->gain, (most_lines / SONDE_FINE + ECHO_ALIGN) * SONDE_MEDIUM_ROWS);
  CARVE(echo->loss_db, lines);
  CARVE(echo->tail, lines);
  CARVE(echo->coupling, lines);
  const double finest_m = LEAST_DEPTH_M / (double)(echo->samples - 1);
  CARVE(echo->grid,
        (2 * most_lines + 16) * (sonde_bands_window(cell_size_m, finest_m) + (size_t)2));
  // Side lobes read zeros beside a row.
  for (int k = 0; k < SONDE_FINE; ++k) {
    CARVE(echo->line_re[k], most_lines / SONDE_FINE + 2 * HAZE_REACH);
    CARVE(echo->line_im[k], most_lines / SONDE_FINE + 2 * HAZE_REACH);
    if (block) echo->line_re[k] += HAZE_REACH, echo->line_im[k] += HAZE_REACH;
  }
  CARVE(echo->ring, lines * RING_PLANES * (2 * SONDE_MOST_TAPS + AXIAL_MOST) * echo->looks);
  for (uint32_t look = 0; look < echo->looks && !echo->bare; ++look) {
    CARVE(echo->look[look], image);
    for (int k = 0; k < SONDE_FINE; ++k) {
      CARVE(echo->ramp_re[look][k], most_lines / SONDE_FINE);
      CARVE(echo->ramp_im[look][k], most_lines / SONDE_FINE);
    }
  }
  if (!echo->bare) {
    for (int k = 0; k < SONDE_FINE; ++k) {
      CARVE(echo->look_re[k], most_lines / SONDE_FINE);
      CARVE(echo->look_im[k], most_lines / SONDE_FINE);
    }
    CARVE(echo->log, (lines + 2 * DISPLAY_MARGIN) * echo->samples);
    CARVE(echo->coarse, (lines + 2 * DISPLAY_MARGIN) * echo->samples);
    CARVE(echo->blurred, (lines + 2 * DISPLAY_MARGIN) * echo->samples);
    CARVE(echo->tensor, image / 4);
    CARVE(echo->held, image);
  }
  CARVE(echo->envelope, image);
  CARVE(echo->flat_envelope, image);
  CARVE(echo->grey, image);
  CARVE(echo->noise, SONDE_NOISE);
  CARVE(echo->bundle, SONDE_BLOOD);
  const size_t side = SONDE_TILE_SIDE;
  for (int k = 0; k < SONDE_TILES; ++k) CARVE(echo->tile[k], side * side * side);
  CARVE(echo->cubes, 1);
  CARVE(echo->bands, 1);
  CARVE(echo->motion, 1);
  CARVE(echo->sound, 1);
  CARVE(echo->gates, 1);
  used = carve_pool(&echo->pool, block, used, 2 * SONDE_POOL + SONDE_LOOSE);
  return carve_pool(&echo->blood, block, used, SONDE_BLOOD);
}

// Each set of kernels has its own order.
static void forget_textures(sonde_echo *echo) {
  memset(echo->knots, 0xff, sizeof *echo->knots * echo->padded * TEXTURES * KNOT_FLOATS);
}

sonde_echo_def sonde_echo_def_default(void) {
  return (sonde_echo_def){.version = SONDE_DEF_VERSION};
}

sonde_status sonde_echo_create(const sonde_interior *interior, const sonde_echo_def *def,
                               sonde_echo **echo, sonde_error *error) {
  SONDE_ASSERT(interior != NULL && echo != NULL);
  const sonde_echo_def otherwise = sonde_echo_def_default();
  if (def == NULL) def = &otherwise;
  *echo = NULL;
  sonde_status status = sonde_def_check("echo", def->version, error);
  if (status) return status;
  bool lines =
      def->line_count == 0 || (def->line_count >= 8 && def->line_count <= SONDE_MOST_LINES);
  bool samples =
      def->sample_count == 0 || (def->sample_count >= 64 && def->sample_count <= MOST_SAMPLES);
  if (!lines || !samples)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "%u lines of %u samples; expected 8 to %d lines of 64 to %d samples",
                      def->line_count, def->sample_count, SONDE_MOST_LINES, MOST_SAMPLES);
  if (!(def->scatterers_per_m3 >= 0) || def->scatterers_per_m3 > 400e9)
    return sonde_fail(error, SONDE_ARGUMENT, "%g scatterers per m^3; expected 0 to 4e11",
                      def->scatterers_per_m3);
  sonde_echo *made = SONDE_NEW(sonde_echo, 1);
  if (made == NULL) return sonde_fail_memory(error);
  made->interior = interior;
  made->lines = def->line_count ? def->line_count : LINES;
  made->samples = def->sample_count ? def->sample_count : SAMPLES;
  made->padded = (made->lines + ECHO_ALIGN - 1) / ECHO_ALIGN * ECHO_ALIGN;
  made->kernels = sonde_echo_kernels_find(NULL);
  made->density_m3 = def->scatterers_per_m3 > 0 ? def->scatterers_per_m3 : default_density_m3;
  made->seed = def->seed;
  made->plain = def->plain;
  made->flow = sonde_echo_flow_default();
  made->cell_m = cell_size_m;
  double per_cell = made->density_m3 * cell_size_m * cell_size_m * cell_size_m;
  made->per_cell = (uint32_t)clamp(STEP * floor(per_cell / STEP + 0.5), 2 * STEP, MOST_PER_CELL);
  made->per_piece = (made->per_cell / 8 + ECHO_ALIGN - 1) / ECHO_ALIGN * ECHO_ALIGN;
  made->rolling = def->rolling;
  status = sonde_scanner_take(made, def->scanner, error);
  if (!status) status = sonde_echo_set_radius(made, made->scanner.radius_m, error);
  if (status) {
    sonde_free(made);
    return status;
  }
  made->block = SONDE_NEW(char, carve(made, NULL) + 63);
  if (made->block) carve(made, sonde_whole_lines(made->block));
  made->psf = SONDE_NEW(beam_psf, 1);
  made->spare = SONDE_NEW(beam_psf, 1);
  made->node = SONDE_NEW(plane_node, SONDE_PLANE_NODES);
  made->plane = SONDE_NEW(float, SONDE_PLANE_NODES *MOST_FIELDS + 2 * ECHO_ALIGN);
  made->air = SONDE_NEW(uint8_t, made->padded);
  made->sheet = SONDE_NEW(sheet_point, SONDE_SHEET_POINTS);
  made->first_sheet = SONDE_NEW(int32_t, made->samples + 2 * SONDE_MOST_TAPS);
  made->seen = SONDE_NEW(uint64_t, SONDE_BOX_CUBES / 64);
  if (!made->block || !made->psf || !made->spare || !made->node || !made->plane || !made->air ||
      !made->sheet || !made->first_sheet || !made->seen) {
    sonde_echo_destroy(made);
    return sonde_fail_memory(error);
  }
  if (!sonde_tiles_draw(made->tile[0], made->tile[1])) {
    sonde_echo_destroy(made);
    return sonde_fail_memory(error);
  }
  sonde_scatterers_draw(made);
  forget_textures(made);
  sonde_echo_set_coupling(made, NULL);
  *echo = made;
  return SONDE_OK;
}

void sonde_echo_destroy(sonde_echo *echo) {
  if (echo == NULL) return;
  void *parts[] = {echo->block, echo->psf,         echo->spare, echo->node, echo->plane,
                   echo->air,   echo->first_sheet, echo->sheet, echo->seen};
  for (size_t i = 0; i < SONDE_COUNT_OF(parts); ++i) sonde_free(parts[i]);
  sonde_free(echo);
}

const float *sonde_echo_envelope(const sonde_echo *echo, uint32_t *lines, uint32_t *samples) {
  SONDE_ASSERT(echo != NULL && lines != NULL && samples != NULL);
  *lines = echo->lines;
  *samples = echo->samples;
  return echo->padded == echo->lines ? echo->envelope : echo->flat_envelope;
}

sonde_echo_flow sonde_echo_flow_default(void) {
  return (sonde_echo_flow){
      .vein_m_s = 0.08, .artery_m_s = 0.13, .circulation = sonde_circulation_default()};
}

void sonde_echo_set_flow(sonde_echo *echo, const sonde_echo_flow *flow) {
  SONDE_ASSERT(echo != NULL && flow != NULL);
  SONDE_ASSERT(isfinite(flow->t_s) && isfinite(flow->vein_m_s) && isfinite(flow->artery_m_s));
  for (uint32_t v = 0; flow->blood && v < echo->interior->vessel_count; ++v) {
    const sonde_vessel_blood *b = &flow->blood[v];
    SONDE_ASSERT(isfinite(b->path_m) && isfinite(b->speed_m_s));
    SONDE_ASSERT(b->rouleaux >= 0 && b->rouleaux <= 1 && b->shut >= 0 && b->shut <= 1);
  }
  echo->flow = *flow;
}

void sonde_echo_set_coupling(sonde_echo *echo, const float *coupling) {
  SONDE_ASSERT(echo != NULL);
  for (uint32_t l = 0; l < echo->padded; ++l) {
    float value = coupling ? coupling[l < echo->lines ? l : echo->lines - 1] : 1;
    echo->coupling[l] = value > 0 ? fminf(value, 1) : 0;
  }
}

sonde_status sonde_echo_set_radius(sonde_echo *echo, double radius_m, sonde_error *error) {
  SONDE_ASSERT(echo != NULL);
  if (!(radius_m == 0 || (radius_m >= 0.02 && radius_m <= 1)))
    return sonde_fail(error, SONDE_ARGUMENT, "face of radius %g m; expected 0 or 0.02 to 1",
                      radius_m);
  echo->frame.radius_m = radius_m;
  return SONDE_OK;
}

sonde_status sonde_echo_check_view(double aperture_m, double radius_m, sonde_error *error) {
  const double widest = 100;
  if (!(aperture_m >= 5e-3 && aperture_m <= 0.2))
    return sonde_fail(error, SONDE_ARGUMENT, "array of %g mm; expected 5 to 200 mm",
                      1e3 * aperture_m);
  double arc = radius_m > 0 ? aperture_m / radius_m * 180 / SONDE_PI : 0;
  if (!(radius_m == 0 || radius_m > 0) || arc > widest)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "an array of %g mm on a radius of %g mm spans %.0f degrees; expected at most "
                      "%.0f: choose a narrower array or a larger radius",
                      1e3 * aperture_m, 1e3 * radius_m, arc, widest);
  return SONDE_OK;
}

const echo_kernels *sonde_echo_kernels_find(const char *name) {
  const echo_kernels *known[] = {
#ifdef __x86_64__
      &sonde_echo_kernels_avx512, &sonde_echo_kernels_avx2, &sonde_echo_kernels_sse4,
#endif
      &sonde_echo_kernels_base, &sonde_echo_kernels_plain};
  for (size_t k = 0; k < SONDE_COUNT_OF(known); ++k)
    if (sonde_vectors_serve(known[k]->name, name)) return known[k];
  return NULL;
}

sonde_status sonde_echo_set_kernels(sonde_echo *echo, const char *name, sonde_error *error) {
  SONDE_ASSERT(echo != NULL);
  const echo_kernels *found = sonde_echo_kernels_find(name);
  if (found == NULL)
    return sonde_fail(error, SONDE_NOT_FOUND,
                      "no kernels '%s' here; expected avx512, avx2, sse4, base or plain", name);
  echo->kernels = found;
  forget_textures(echo);
  return SONDE_OK;
}

void sonde_echo_begin_looks(sonde_echo *echo) {
  SONDE_ASSERT(echo != NULL);
  echo->drawn_looks = 0;
  echo->is_held = false;
}

const char *sonde_echo_kernels(const sonde_echo *echo) {
  SONDE_ASSERT(echo != NULL && echo->kernels != NULL);
  return echo->kernels->name;
}
