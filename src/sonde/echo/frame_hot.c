// A frame: the stages in their order, and the constants that they share.
#include "base/base.h"
#include "base/clock.h"
#include "echo/bands.h"
#include "echo/blood.h"
#include "echo/cubes.h"
#include "echo/lines.h"

_Static_assert((int)SONDE_PSF_STEPS == SONDE_ECHO_PREPARE_STEPS, "steps of a beam");

// Rows a little closer than the columns of a linear probe (1.7 mm), which set the error between,
// and not so few that a shallow picture, all of it near the face, is off by more.
static const double row_m = 1.6e-3, fewest_rows = 37;
static const double fewest_per_cell = 10;        // scatterers that make developed speckle
static const double mean_loss_db_per_m_mhz = 95; // one way, skin to femur

double sonde_echo_default_tgc_db_per_m(double frequency_hz) {
  return 2 * mean_loss_db_per_m_mhz * frequency_hz * 1e-6;
}

// ---- image coordinates ----------------------------------------------------------------------

sonde_vec3 sonde_echo_place(const frame *f, double line, double depth_m) {
  double v = (line - f->first_line) * f->pitch_m;
  if (!(f->radius_m > 0)) return vec3(v, 0, depth_m);
  return sight_place((sight_lines){f->radius_m, 0}, v, depth_m);
}

sonde_vec3 sonde_echo_unplace(const frame *f, sonde_vec3 p) {
  if (!(f->radius_m > 0)) return vec3(p.x / f->pitch_m + f->first_line, p.y, p.z);
  const sonde_vec3 at = sight_find((sight_lines){f->radius_m, 0}, p);
  return vec3(at.x / f->pitch_m + f->first_line, at.y, at.z);
}

sonde_vec3 sonde_echo_to_world(const sonde_echo *echo, sonde_vec3 at) {
  const frame *f = &echo->frame;
  double line = at.x * echo->lines_per_column - f->edge_lines;
  sonde_vec3 local = sonde_echo_place(f, line, at.z * echo->depth_per_row);
  local.y = at.y;
  return pose_apply(f->probe, local);
}

sonde_vec3 sonde_echo_from_world(const sonde_echo *echo, sonde_vec3 p) {
  const frame *f = &echo->frame;
  sonde_vec3 at = sonde_echo_unplace(f, m_mul_v(f->from_world, v_sub(p, f->probe.position)));
  return vec3((at.x + f->edge_lines) / echo->lines_per_column, at.y, at.z / echo->depth_per_row);
}

double sonde_echo_elevation(const sonde_echo *echo, double depth_m) {
  double at = clamp(depth_m / echo->frame.depth_m, 0, 1) * SONDE_SLAB_ROWS;
  uint32_t k = at < SONDE_SLAB_ROWS ? (uint32_t)at : SONDE_SLAB_ROWS - 1;
  return echo->slab_m[k] + (at - k) * (echo->slab_m[k + 1] - echo->slab_m[k]);
}

// ---- settings and the beam ------------------------------------------------------------------

void sonde_echo_geometry(sonde_echo *echo, double aperture_m, const sonde_echo_settings *settings) {
  SONDE_ASSERT(echo != NULL && settings != NULL && aperture_m > 0);
  sonde_echo_settings s = sonde_echo_settings_clamp(*settings);
  frame *f = &echo->frame;
  f->aperture_m = aperture_m;
  f->depth_m = s.depth_m;
  f->reach_m = s.depth_m * (1 + 0.03 * echo->scanner.sound_speeds);
  f->pitch_m = aperture_m / (echo->lines - 1);
  f->step_m = s.depth_m / (echo->samples - 1);
  f->frequency_hz = s.frequency_hz;
  f->wavelength_m = sonde_sound_m_s / s.frequency_hz;
  f->focus_m = s.focus_m;
  f->settings = s;
  f->scanner = &echo->scanner;
  f->tgc_db_per_m = sonde_echo_default_tgc_db_per_m(s.frequency_hz) + s.tgc_db_per_m;
  f->first_line = 0.5 * (echo->lines - 1);
}

beam_key sonde_echo_key(const frame *f) {
  return (beam_key){f->frequency_hz,
                    f->focus_m,
                    f->depth_m,
                    f->pitch_m / SONDE_FINE,
                    f->step_m,
                    f->radius_m,
                    f->scanner->transmit_f,
                    f->scanner->receive_f,
                    f->scanner->pulse_wavelengths};
}

// Builds the beam of a key beside the one in use, by so many steps; true when it is ready.
static bool build_spare(sonde_echo *echo, const beam_key *key, uint32_t steps) {
  if (!sonde_psf_is_for(echo->spare, key)) sonde_psf_begin(echo->spare, key);
  bool ready = echo->spare->step == SONDE_PSF_STEPS;
  for (uint32_t k = 0; k < steps && !ready; ++k) ready = sonde_psf_step(echo->spare);
  return ready;
}

bool sonde_echo_prepare(sonde_echo *echo, double aperture_m, const sonde_echo_settings *settings,
                        uint32_t steps) {
  SONDE_ASSERT(echo != NULL && settings != NULL && aperture_m > 0);
  frame kept = echo->frame;
  sonde_echo_geometry(echo, aperture_m, settings);
  beam_key key = sonde_echo_key(&echo->frame);
  echo->frame = kept;
  return sonde_psf_is_for(echo->psf, &key) || build_spare(echo, &key, steps);
}

void sonde_echo_frame(sonde_echo *echo, sonde_pose world_from_probe, double aperture_m,
                      const sonde_echo_settings *settings) {
  sonde_echo_geometry(echo, aperture_m, settings);
  frame *f = &echo->frame;
  echo->lost = echo->moved = echo->bled = 0;
  f->probe = world_from_probe;
  f->from_world = m_transpose(q_matrix(world_from_probe.rotation));
  // The beam; what preparation has left to do is done here.
  const beam_key key = sonde_echo_key(f);
  if (!sonde_psf_is_for(echo->psf, &key)) {
    build_spare(echo, &key, SONDE_PSF_STEPS);
    beam_psf *old = echo->psf;
    echo->psf = echo->spare, echo->spare = old;
    echo->drawn_looks = 0;
  }
  const beam_psf *psf = echo->psf;
  SONDE_ASSERT(psf->step == SONDE_PSF_STEPS && echo->cell_m > 0);
  // The grid: columns and rows beyond the image as far as the beam's kernels reach. An odd count of
  // cache lines per row spreads the rows over the cache.
  echo->pad_lines = ((uint32_t)psf->half_lines + 1) / 2 * 2;
  echo->pad_samples = (uint32_t)psf->half_rows;
  uint32_t whole = SONDE_FINE * ECHO_ALIGN, needed = SONDE_FINE * echo->lines + 2 * echo->pad_lines;
  echo->grid_lines = (needed + whole - 1) / whole * whole;
  echo->grid_stride = 2 * echo->grid_lines + 16;
  echo->gain_stride = echo->grid_lines / SONDE_FINE + ECHO_ALIGN;
  echo->grid_samples = echo->samples + 2 * echo->pad_samples;
  // The coarse plane.
  f->edge_lines = (double)echo->pad_lines / SONDE_FINE;
  echo->lines_per_column = (echo->lines - 1 + 2 * f->edge_lines) / (SONDE_PLANE_COLUMNS - 1);
  echo->plane_rows = (uint32_t)clamp(ceil(f->reach_m / row_m) + 1, fewest_rows, SONDE_PLANE_ROWS);
  echo->depth_per_row = f->reach_m / (echo->plane_rows - 1);
  // The slab's height, and how many times more scatterers a resolution cell holds than it needs, as
  // a logarithm of base two. A cell's extent along each axis is (sum p)^2 / sum p^2 of the
  // intensity: 1.0645 half widths of a Gaussian pulse, 1.4 half heights of the elevation's
  // (1 - u^2)^2.
  const double density = echo->per_cell / (echo->cell_m * echo->cell_m * echo->cell_m);
  const sonde_array array = sonde_beam_array(&psf->key);
  const double along = 1.0645 * array.pulse_wavelengths * f->wavelength_m;
  for (int k = 0; k <= SONDE_SLAB_ROWS; ++k) {
    int above;
    double depth = f->depth_m * k / SONDE_SLAB_ROWS, t = sonde_psf_depth(psf, depth, &above);
    const double *half = psf->elevation_m + above, *wide = psf->cell_columns + above;
    double column = f->pitch_m / SONDE_FINE * (f->radius_m > 0 ? 1 + depth / f->radius_m : 1);
    echo->slab_m[k] = half[0] + t * (half[1] - half[0]);
    double cell = along * 1.4 * echo->slab_m[k] * (wide[0] + t * (wide[1] - wide[0])) * column;
    echo->spare_octaves[k] = log2(density * cell / fewest_per_cell);
  }
  sonde_bands_measure(echo);
  sonde_bands_begin(echo);
  sonde_looks_begin(echo);
}

// ---- the stages -----------------------------------------------------------------------------

void sonde_echo_scatter(sonde_echo *echo) {
  SONDE_ASSERT(echo->per_cell % ECHO_ALIGN == 0 && echo->per_cell <= SONDE_POOL);
  SONDE_ASSERT(echo->per_piece % ECHO_ALIGN == 0 && echo->per_piece <= SONDE_LOOSE);
  sonde_cubes_find(echo);
  sonde_motion_begin(echo);
  for (uint32_t next = 0; next < echo->cubes->slab_count;) {
    next = sonde_motion_displace(echo, next);
    sonde_maps_make(echo);
  }
}

// Processor time since *from, which moves on.
static double lap(double *from) {
  const double now = sonde_clock_cpu(), since = now - *from;
  *from = now;
  return since;
}

void sonde_echo_render(sonde_echo *echo, sonde_pose world_from_probe, double aperture_m,
                       const sonde_pathology *pathology, const sonde_echo_settings *settings,
                       sonde_image *image) {
  SONDE_ASSERT(echo != NULL && pathology != NULL && settings != NULL);
  SONDE_ASSERT(image != NULL && image->pixels != NULL && aperture_m > 0);
  double now = 0;
  sonde_echo_times *t = &echo->times;
  lap(&now);
  echo->frame.pathology = pathology;
  sonde_echo_frame(echo, world_from_probe, aperture_m, settings);
  t->settings_s = lap(&now);
  sonde_echo_plane(echo);
  sonde_blood_find(echo);
  t->plane_s = lap(&now);
  sonde_echo_medium(echo);
  sonde_echo_ghosts(echo);
  t->medium_s = lap(&now);
  sonde_echo_scatter(echo);
  sonde_echo_blood(echo);
  t->scatter_s = lap(&now);
  t->beam_s = 0;
  for (uint32_t band = 0; band < echo->band_count; ++band) {
    sonde_bands_lay(echo, band);
    t->scatter_s += lap(&now);
    sonde_echo_beam(echo, band, true);
    t->beam_s += lap(&now);
  }
  sonde_echo_beam_end(echo);
  if (!echo->bare) sonde_echo_display(echo);
  sonde_echo_picture(echo, image);
  t->picture_s = lap(&now);
  t->scatterers = echo->moved;
  t->blood = echo->bled;
  t->lost = echo->lost;
}

sonde_echo_times sonde_echo_last_times(const sonde_echo *echo) {
  SONDE_ASSERT(echo != NULL);
  return echo->times;
}

void sonde_echo_render_points(sonde_echo *echo, double aperture_m,
                              const sonde_echo_settings *settings, const sonde_echo_point *points,
                              uint32_t count) {
  SONDE_ASSERT(echo != NULL && (points != NULL || count == 0));
  sonde_echo_frame(echo, (sonde_pose){.rotation = {.w = 1}}, aperture_m, settings);
  for (uint32_t band = 0; band < echo->band_count; ++band) {
    sonde_bands_lay_points(echo, points, count, band);
    sonde_echo_beam(echo, band, false);
  }
  sonde_echo_beam_end(echo);
}
