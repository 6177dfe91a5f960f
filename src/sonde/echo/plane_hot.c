// The image plane in rest coordinates: where each point of a coarse grid came from, its layers and
// its place in the vessels' cross-sections. These fields are smooth; later stages interpolate them.
//
// sonde_echo_frame, sonde_echo_geometry, sonde_echo_key  constants of a frame, its beam
// sonde_echo_prepare, begin_spare, take_beam  the beam of new settings, built beside the one in use
// sonde_echo_place, sonde_echo_unplace  image coordinates of a flat or curved face
// sonde_echo_plane   all nodes
// find_row           rest points of a row
// seek, refine, relax  one of them
// place_beside       where a step beside the plane leads
// steps_at           derivative at a node
// choose_view, in_view  branches and lesions near the plane
// store_node, store_vessel, store_lesions  fields of one node
// sonde_echo_pathology, sonde_echo_solid  what a vessel holds
// turn_node          inverse derivative at a node
#include "base/base.h"
#include "echo/echo.h"
#include "echo/tiers.h"
#include "interior/fields.h"

#include <string.h>

enum { FIRST_ITERATIONS = 24, ITERATIONS = 8, NEWTON_ITERATIONS = 4 };

_Static_assert((int)SONDE_PSF_STEPS == SONDE_ECHO_PREPARE_STEPS, "steps of a beam");

static const double far_away = 50; // in semi-axes
// Rows a little closer than the columns of a linear probe (1.7 mm), which set the error between,
// and not so few that a shallow picture, all of it near the face, is off by more.
static const double row_m = 1.6e-3, fewest_rows = 37;
static const double step_beside = 1e-3;
static const double tolerance_m = 1e-7;
static const double fewest_per_cell = 10; // scatterers that make developed speckle
static const double view_margin_m = 8e-3; // slab, a cube and the step between two stations

sonde_vec3 sonde_echo_place(const frame *f, double line, double depth_m) {
  double v = (line - f->first_line) * f->pitch_m;
  if (!(f->radius_m > 0)) return vec3(v, 0, depth_m);
  double r = f->radius_m + depth_m, angle = v / f->radius_m;
  return vec3(r * sin(angle), 0, r * cos(angle) - f->radius_m);
}

sonde_vec3 sonde_echo_unplace(const frame *f, sonde_vec3 p) {
  if (!(f->radius_m > 0)) return vec3(p.x / f->pitch_m + f->first_line, p.y, p.z);
  double z = p.z + f->radius_m, angle = atan2(p.x, z);
  return vec3(angle * f->radius_m / f->pitch_m + f->first_line, p.y,
              sqrt(p.x * p.x + z * z) - f->radius_m);
}

void sonde_echo_geometry(sonde_echo *echo, double aperture_m, const sonde_echo_settings *settings) {
  SONDE_ASSERT(echo != NULL && settings != NULL && aperture_m > 0);
  sonde_echo_settings s = sonde_echo_settings_clamp(*settings);
  frame *f = &echo->frame;
  f->aperture_m = aperture_m;
  f->depth_m = s.depth_m;
  f->pitch_m = aperture_m / (echo->lines - 1);
  f->step_m = s.depth_m / (echo->samples - 1);
  f->frequency_hz = s.frequency_hz;
  f->wavelength_m = sonde_sound_m_s / s.frequency_hz;
  f->focus_m = s.focus_m;
  f->settings = s;
  f->tgc_db_per_m = sonde_echo_default_tgc_db_per_m(s.frequency_hz) + s.tgc_db_per_m;
  f->first_line = 0.5 * (echo->lines - 1);
}

beam_key sonde_echo_key(const frame *f) {
  return (beam_key){f->frequency_hz,         f->focus_m, f->depth_m,
                    f->pitch_m / SONDE_FINE, f->step_m,  f->radius_m};
}

// The beam of a key into the spare slot, if it is not there yet.
static void begin_spare(sonde_echo *echo, const beam_key *key) {
  if (!sonde_psf_is_for(echo->spare, key)) sonde_psf_begin(echo->spare, key);
}

bool sonde_echo_prepare(sonde_echo *echo, double aperture_m, const sonde_echo_settings *settings,
                        uint32_t steps) {
  SONDE_ASSERT(echo != NULL && settings != NULL && aperture_m > 0);
  frame kept = echo->frame;
  sonde_echo_geometry(echo, aperture_m, settings);
  beam_key key = sonde_echo_key(&echo->frame);
  echo->frame = kept;
  if (sonde_psf_is_for(echo->psf, &key)) return true;
  begin_spare(echo, &key);
  bool ready = echo->spare->step == SONDE_PSF_STEPS;
  for (uint32_t k = 0; k < steps && !ready; ++k) ready = sonde_psf_step(echo->spare);
  return ready;
}

// What preparation has left to do is done here.
static void take_beam(sonde_echo *echo, const beam_key *key) {
  if (sonde_psf_is_for(echo->psf, key)) return;
  begin_spare(echo, key);
  while (!sonde_psf_step(echo->spare)) {
  }
  beam_psf *old = echo->psf;
  echo->psf = echo->spare;
  echo->spare = old;
}

// Height of the slab, and how many times more scatterers a resolution cell holds than it needs, as
// a logarithm of base two. A cell's extent along each axis is (sum p)^2 / sum p^2 of the intensity:
// 1.0645 half widths of a Gaussian pulse, 1.4 half heights of the elevation's (1 - u^2)^2.
static void measure_slab(sonde_echo *echo) {
  const frame *f = &echo->frame;
  const beam_psf *psf = echo->psf;
  SONDE_ASSERT(psf->step == SONDE_PSF_STEPS && echo->cell_m > 0);
  const double density = echo->per_cell / (echo->cell_m * echo->cell_m * echo->cell_m);
  const sonde_array array = sonde_beam_array(&psf->key);
  const double along = 1.0645 * array.pulse_wavelengths * f->wavelength_m;
  for (int k = 0; k <= SONDE_SLAB_ROWS; ++k) {
    int band;
    double depth = f->depth_m * k / SONDE_SLAB_ROWS, t = sonde_psf_band(psf, depth, &band);
    const double *half = psf->elevation_m + band, *wide = psf->cell_columns + band;
    double column = f->pitch_m / SONDE_FINE * (f->radius_m > 0 ? 1 + depth / f->radius_m : 1);
    echo->slab_m[k] = half[0] + t * (half[1] - half[0]);
    double cell = along * 1.4 * echo->slab_m[k] * (wide[0] + t * (wide[1] - wide[0])) * column;
    echo->spare_octaves[k] = log2(density * cell / fewest_per_cell);
  }
}

void sonde_echo_frame(sonde_echo *echo, sonde_pose world_from_probe, double aperture_m,
                      const sonde_echo_settings *settings) {
  sonde_echo_geometry(echo, aperture_m, settings);
  frame *f = &echo->frame;
  echo->lost = 0;
  f->probe = world_from_probe;
  f->from_world = m_transpose(q_matrix(world_from_probe.rotation));
  beam_key key = sonde_echo_key(f);
  take_beam(echo, &key);
  echo->pad_lines = ((uint32_t)echo->psf->half_lines + 1) / 2 * 2;
  echo->pad_samples = (uint32_t)echo->psf->half_rows;
  uint32_t whole = SONDE_FINE * ECHO_ALIGN, needed = SONDE_FINE * echo->lines + 2 * echo->pad_lines;
  echo->grid_lines = (needed + whole - 1) / whole * whole;
  // An odd count of cache lines per row spreads the rows over the cache.
  echo->grid_stride = 2 * echo->grid_lines + 16;
  echo->gain_stride = echo->grid_lines / SONDE_FINE + ECHO_ALIGN;
  echo->grid_samples = echo->samples + 2 * echo->pad_samples;
  f->edge_lines = (double)echo->pad_lines / SONDE_FINE;
  measure_slab(echo);
  echo->lines_per_column = (echo->lines - 1 + 2 * f->edge_lines) / (SONDE_PLANE_COLUMNS - 1);
  echo->plane_rows = (uint32_t)clamp(ceil(f->depth_m / row_m) + 1, fewest_rows, SONDE_PLANE_ROWS);
  echo->depth_per_row = f->depth_m / (echo->plane_rows - 1);
  sonde_tiers_measure(echo);
  sonde_tiers_begin(echo);
}

const sonde_pathology *sonde_echo_pathology(const sonde_echo *echo, uint32_t which) {
  return which == 0 ? echo->frame.pathology : &echo->interior->pathology[which];
}

double sonde_echo_solid(const sonde_echo *echo, uint32_t which, double z_m) {
  const sonde_pathology *p = sonde_echo_pathology(echo, which);
  if (echo->interior->kind[which] == SONDE_VESSEL_ARTERY) return 0;
  return sonde_pathology_clot(p, z_m) ? p->thrombus_fraction : 0;
}

static bool in_view(const sonde_echo *echo, sonde_vec3 point, double reach_m) {
  const frame *f = &echo->frame;
  sonde_vec3 at = sonde_echo_unplace(f, pose_apply_inverse(f->probe, point));
  double beside = fabs(at.x - f->first_line) * f->pitch_m - 0.5 * f->aperture_m;
  double above = fmax(-at.z, at.z - f->depth_m), reach = reach_m + view_margin_m;
  return fabs(at.y) < reach && beside < reach && above < reach;
}

// The femoral vessels always, so that a leg without branches takes the same way through the stages.
static void choose_view(sonde_echo *echo) {
  const sonde_interior *in = echo->interior;
  echo->shown[0] = 0, echo->shown[1] = 1, echo->shown_count = 2;
  echo->vessels = in->station_count[0] > 0 || in->station_count[1] > 0;
  for (uint32_t which = 2; which < in->vessel_count; ++which) {
    const sonde_vessel_state *v = in->state[which];
    bool seen = false;
    for (uint32_t i = 0; i < in->station_count[which] && !seen; ++i)
      seen = in_view(echo, v[i].centre_m, 4 * v[i].rest_radius_m);
    if (seen) echo->shown[echo->shown_count++] = which, echo->vessels = true;
  }
  echo->lesion_count = 0;
  for (uint32_t k = 0; k < in->findings.lesion_count; ++k) {
    const sonde_lesion *l = &in->findings.lesion[k];
    sonde_vec3 now = v_add(l->centre_m, sonde_interior_field(in, l->centre_m));
    double reach = fmax(fmax(l->half_m.x, l->half_m.y), l->half_m.z);
    if (in_view(echo, now, 1.5 * reach)) echo->lesion[echo->lesion_count++] = k;
  }
  echo->fields = lesion_field_at(echo->shown_count, echo->lesion_count, 0);
  echo->levels = LAYER_LEVELS + echo->shown_count + echo->lesion_count;
  SONDE_ASSERT(echo->fields <= MOST_FIELDS && echo->levels <= MOST_LEVELS);
}

// Beyond its end a branch fades away from the last section: neighbours inside and beyond then meet
// without passing its axis.
static void store_vessel(const sonde_echo *echo, uint32_t k, double s, sonde_vec3 point, float *at,
                         uint32_t node) {
  const sonde_interior *in = echo->interior;
  const uint32_t which = echo->shown[k], count = in->station_count[which];
  sonde_vessel_state v;
  double across = far_away, along = far_away, half_short = 1e-3, half_long = 1e-3, clot = 0;
  bool there = sonde_vessel_at(in, which, s, &v);
  if (!there && which >= 2) v = in->state[which][s < in->station[which][0].s_m ? 0 : count - 1];
  if (there || which >= 2) {
    sonde_vec3 d = v_sub(point, v.centre_m);
    along = v_dot(d, v.flat_axis) / v.half_short_m;
    across = v_dot(d, v_cross(v.axis, v.flat_axis)) / v.half_long_m;
    half_short = v.half_short_m, half_long = v.half_long_m;
    clot = sonde_echo_solid(echo, which, v.rest_centre_m.z) > 0;
  }
  if (!there && which >= 2) {
    double size = fmax(hypot(along, across), 1e-3);
    along *= far_away / size, across *= far_away / size;
  }
  float *field = at + vessel_field_at(k, VESSEL_SHORT) * SONDE_PLANE_NODES + node;
  field[VESSEL_SHORT * SONDE_PLANE_NODES] = (float)along;
  field[VESSEL_LONG * SONDE_PLANE_NODES] = (float)across;
  field[VESSEL_HALF_SHORT * SONDE_PLANE_NODES] = (float)half_short;
  field[VESSEL_HALF_LONG * SONDE_PLANE_NODES] = (float)half_long;
  field[VESSEL_CLOT * SONDE_PLANE_NODES] = (float)clot;
}

static void store_lesions(const sonde_echo *echo, sonde_vec3 rest, float *at, uint32_t node) {
  for (uint32_t k = 0; k < echo->lesion_count; ++k) {
    sonde_vec3 q = sonde_lesion_point(echo->interior, echo->lesion[k], rest);
    float *field = at + lesion_field_at(echo->shown_count, k, 0) * SONDE_PLANE_NODES + node;
    field[0] = (float)q.x;
    field[SONDE_PLANE_NODES] = (float)q.y;
    field[2 * SONDE_PLANE_NODES] = (float)q.z;
  }
}

static void store_node(sonde_echo *echo, uint32_t node, sonde_vec3 point, double theta_centre) {
  const uint32_t count = SONDE_PLANE_NODES;
  sonde_column_point at;
  bool within = sonde_interior_locate(echo->interior, echo->node[node].rest, &at);
  double turn = at.theta - theta_centre;
  at.theta -= 2 * SONDE_PI * floor(turn / (2 * SONDE_PI) + 0.5);
  float *p = echo->plane;
  p[PLANE_THETA * count + node] = (float)at.theta;
  p[PLANE_S * count + node] = (float)at.s;
  p[PLANE_DEPTH * count + node] = within ? (float)at.depth_m : -1;
  p[PLANE_FAT * count + node] = (float)at.fat_m;
  p[PLANE_MUSCLE * count + node] = (float)at.muscle_m;
  p[PLANE_ACROSS * count + node] = (float)(at.r * cos(at.theta));
  p[PLANE_UP * count + node] = (float)(at.r * sin(at.theta));
  for (uint32_t k = 0; k < echo->shown_count; ++k) store_vessel(echo, k, at.s, point, p, node);
  store_lesions(echo, echo->node[node].rest, p, node);
}

// Lines and depth of node (i, j).
static double line_of(const sonde_echo *echo, double i) {
  return i * echo->lines_per_column - echo->frame.edge_lines;
}
static double depth_of(const sonde_echo *echo, double j) { return j * echo->depth_per_row; }

// Rest steps per column, per metre beside the plane and per row: from the neighbours, of the rows
// up to `last`, and the step beside.
static sonde_mat3 steps_at(const sonde_echo *echo, uint32_t i, uint32_t j, uint32_t last) {
  const uint32_t wide = SONDE_PLANE_COLUMNS;
  const plane_node *node = &echo->node[j * wide + i];
  uint32_t left = i > 0 ? 1 : 0, right = i + 1 < wide ? 1 : 0;
  uint32_t up = j > 0 ? 1 : 0, down = j < last ? 1 : 0;
  sonde_vec3 a = v_scale(v_sub(node[right].rest, (node - left)->rest), 1.0 / (left + right));
  sonde_vec3 b =
      v_scale(v_sub(node[down * wide].rest, (node - up * wide)->rest), 1.0 / (up + down));
  sonde_vec3 beside = q_rotate(echo->frame.probe.rotation, vec3(0, 1, 0));
  double y = fabs(node->side.y) > 0.2 ? node->side.y : 0.2;
  sonde_vec3 c = v_scale(v_madd(v_madd(beside, -node->side.x, a), -node->side.z, b), 1 / y);
  return m_columns(a, c, b);
}

// A node of a row on the way to its rest point.
typedef struct seeker {
  sonde_vec3 local, point, from; // probe frame, world, image
  sonde_mat3 steps;              // that turn a miss in the image into a correction
  sonde_vec3 q, best;
  double least, damping;
} seeker;

// Two rows above give a first guess and the derivative that turns a miss into a correction. The
// first row starts from the point itself, the second a step below the first.
static seeker seek(const sonde_echo *echo, uint32_t i, uint32_t j) {
  const frame *f = &echo->frame;
  const uint32_t above = (j - 1) * SONDE_PLANE_COLUMNS + i;
  seeker s = {.local = sonde_echo_place(f, line_of(echo, i), depth_of(echo, j)),
              .least = INFINITY,
              .damping = 1};
  s.point = pose_apply(f->probe, s.local), s.from = sonde_echo_unplace(f, s.local);
  s.q = s.point;
  if (j == 1) {
    sonde_vec3 up = sonde_echo_place(f, line_of(echo, i), depth_of(echo, 0));
    s.q = v_add(echo->node[above].rest, q_rotate(f->probe.rotation, v_sub(s.local, up)));
  } else if (j > 1) {
    sonde_vec3 rest = echo->node[above].rest;
    s.steps = steps_at(echo, i, j - 1, j - 1);
    s.q = v_add(rest, v_sub(rest, echo->node[above - SONDE_PLANE_COLUMNS].rest));
  }
  s.best = s.q;
  return s;
}

// A step of Newton's from where the field takes the guess; false when that is near enough or does
// not lead on.
static bool refine(const sonde_echo *echo, seeker *s, sonde_vec3 field) {
  const frame *f = &echo->frame;
  sonde_vec3 miss = v_sub(v_add(s->q, field), s->point);
  double size = v_norm(miss);
  if (!(size < s->least)) return false;
  s->least = size, s->best = s->q;
  if (size < tolerance_m) return false;
  sonde_vec3 at = sonde_echo_unplace(f, v_add(s->local, m_mul_v(f->from_world, miss)));
  sonde_vec3 image = vec3((at.x - s->from.x) / echo->lines_per_column, at.y - s->from.y,
                          (at.z - s->from.z) / echo->depth_per_row);
  s->q = v_sub(s->q, m_mul_v(s->steps, image));
  return true;
}

// The same without a derivative, as sonde_interior_invert does it.
static bool relax(const sonde_echo *echo, seeker *s, sonde_vec3 field) {
  sonde_vec3 miss = v_sub(v_add(s->q, field), s->point);
  double size = v_norm(miss);
  (void)echo;
  if (size < s->least)
    s->least = size, s->best = s->q;
  else
    s->damping *= 0.5;
  s->q = v_madd(s->q, -s->damping, miss);
  return !(size < tolerance_m);
}

static void fields_at(sonde_echo *echo, uint32_t count, const float_x4 *rest, sonde_vec3 *out) {
  float_x4 field[SONDE_PLANE_COLUMNS];
  SONDE_ASSERT(count <= SONDE_PLANE_COLUMNS);
  sonde_fields_at(echo->motion, count, rest, field);
  for (uint32_t k = 0; k < count; ++k)
    out[k] = vec3((double)field[k][0], (double)field[k][1], (double)field[k][2]);
}

// Rest points of a row. Where Newton's steps do not lead to the point, the plain iteration goes on
// from the best so far.
static void find_row(sonde_echo *echo, uint32_t j, seeker row[SONDE_PLANE_COLUMNS]) {
  const int steps = j > 1 ? NEWTON_ITERATIONS : j > 0 ? ITERATIONS : FIRST_ITERATIONS;
  bool (*advance)(const sonde_echo *, seeker *, sonde_vec3) = j > 1 ? refine : relax;
  uint32_t on_way[SONDE_PLANE_COLUMNS], count = SONDE_PLANE_COLUMNS;
  float_x4 rest[SONDE_PLANE_COLUMNS];
  sonde_vec3 field[SONDE_PLANE_COLUMNS];
  for (uint32_t i = 0; i < count; ++i) row[i] = seek(echo, i, j), on_way[i] = i;
  for (int step = 0; step < steps && count > 0; ++step) {
    uint32_t left = 0;
    for (uint32_t k = 0; k < count; ++k)
      rest[k] = point_of(v_sub(row[on_way[k]].q, echo->motion->corner));
    fields_at(echo, count, rest, field);
    for (uint32_t k = 0; k < count; ++k)
      if (advance(echo, &row[on_way[k]], field[k])) on_way[left++] = on_way[k];
    count = left;
  }
  for (uint32_t i = 0; i < SONDE_PLANE_COLUMNS; ++i) {
    seeker *s = &row[i];
    if (j > 1 && !(s->least < tolerance_m)) // the first rows may lie in the air
      s->best = sonde_interior_invert(echo->interior, s->point, s->best, ITERATIONS, NULL);
    echo->node[j * SONDE_PLANE_COLUMNS + i].rest = s->best;
  }
}

// Where a step beside the plane leads from each node of a row, and the fields there.
static void place_beside(sonde_echo *echo, uint32_t j, const seeker row[SONDE_PLANE_COLUMNS]) {
  const frame *f = &echo->frame;
  plane_node *node = &echo->node[j * SONDE_PLANE_COLUMNS];
  const sonde_vec3 beside = v_scale(q_rotate(f->probe.rotation, vec3(0, 1, 0)), step_beside);
  float_x4 rest[SONDE_PLANE_COLUMNS];
  sonde_vec3 there[SONDE_PLANE_COLUMNS];
  for (uint32_t i = 0; i < SONDE_PLANE_COLUMNS; ++i)
    rest[i] = point_of(v_sub(v_add(node[i].rest, beside), echo->motion->corner));
  fields_at(echo, SONDE_PLANE_COLUMNS, rest, there);
  for (uint32_t i = 0; i < SONDE_PLANE_COLUMNS; ++i) {
    const seeker *s = &row[i];
    sonde_vec3 here = v_sub(s->point, node[i].rest); // what the inversion converged to
    sonde_vec3 moved = v_add(beside, v_sub(there[i], here));
    sonde_vec3 at = sonde_echo_unplace(f, v_add(s->local, m_mul_v(f->from_world, moved)));
    node[i].side = vec3((at.x - s->from.x) / echo->lines_per_column / step_beside,
                        (at.y - s->from.y) / step_beside,
                        (at.z - s->from.z) / echo->depth_per_row / step_beside);
    store_node(echo, j * SONDE_PLANE_COLUMNS + i, s->point, echo->theta_centre);
  }
}

// The inverse of the steps.
static void turn_node(sonde_echo *echo, uint32_t i, uint32_t j) {
  plane_node *node = &echo->node[j * SONDE_PLANE_COLUMNS + i];
  sonde_mat3 steps = steps_at(echo, i, j, echo->plane_rows - 1);
  sonde_vec3 a = m_column(&steps, 0), c = m_column(&steps, 1), b = m_column(&steps, 2);
  node->beside = c;
  // Rows of the inverse are the crossed columns over the volume.
  sonde_vec3 bc = v_cross(c, b), ca = v_cross(b, a), ab = v_cross(a, c);
  double volume = v_dot(a, bc), least = 1e-3 * v_norm(a) * v_norm(b) * v_norm(c);
  if (fabs(volume) < least) volume = volume < 0 ? -least : least;
  double k = volume != 0 ? 1 / volume : 0;
  node->in = (sonde_mat3){{{bc.x * k, bc.y * k, bc.z * k},
                           {ca.x * k, ca.y * k, ca.z * k},
                           {ab.x * k, ab.y * k, ab.z * k}}};
}

void sonde_echo_plane(sonde_echo *echo) {
  SONDE_ASSERT(echo->frame.pathology != NULL && echo->frame.depth_m > 0);
  const frame *f = &echo->frame;
  sonde_column_point centre;
  (void)sonde_interior_locate(echo->interior, f->probe.position, &centre);
  echo->theta_centre = centre.theta;
  choose_view(echo);
  sonde_fields_begin(echo->motion, echo->interior, f->probe.position);
  seeker row[SONDE_PLANE_COLUMNS];
  for (uint32_t j = 0; j < echo->plane_rows; ++j) {
    find_row(echo, j, row);
    place_beside(echo, j, row);
  }
  for (uint32_t j = 0; j < echo->plane_rows; ++j)
    for (uint32_t i = 0; i < SONDE_PLANE_COLUMNS; ++i) turn_node(echo, i, j);
}
