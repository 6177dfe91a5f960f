// First stage of a frame: the image plane in rest coordinates. Each point of a coarse grid is
// traced back to rest, a row at a time; its layers and its place in the vessels' cross-sections
// there are smooth fields, which later stages interpolate.
#include "base/base.h"
#include "echo/echo.h"
#include "interior/fields.h"
#include "interior/vessels.h"
#include "sonde/tissue_anatomy.h"

enum { FIRST_ITERATIONS = 24, ITERATIONS = 8, NEWTON_ITERATIONS = 4 };

static const double far_away = 50; // in semi-axes
static const double step_beside = 1e-3;
static const double tolerance_m = 1e-7;
static const double far_view_m = 60e-3;   // of a vessel from where it is at rest, and its reach
static const double view_margin_m = 8e-3; // slab, a cube and the step between two sections
// A wall so far from a node matters in no cell of the plane about it; a row brings it nearer by
// twice the rows' distance at most.
static const double wall_apart_m = 8e-3;
enum { MOST_IDLE = 8 };

const sonde_pathology *sonde_echo_pathology(const sonde_echo *echo, uint32_t which) {
  return which == 0 ? echo->frame.pathology : &echo->interior->pathology[which];
}

double sonde_echo_solid(const sonde_echo *echo, uint32_t which, double z_m) {
  const sonde_pathology *p = sonde_echo_pathology(echo, which);
  if (echo->interior->course[which].kind == SONDE_VESSEL_ARTERY) return 0;
  return sonde_pathology_clot(p, z_m) ? p->thrombus_fraction : 0;
}

static bool in_view(const sonde_echo *echo, sonde_vec3 point, double reach_m) {
  const frame *f = &echo->frame;
  SONDE_ASSERT(reach_m >= 0);
  sonde_vec3 at = sonde_echo_unplace(f, pose_apply_inverse(f->probe, point));
  double beside = fabs(at.x - f->first_line) * f->pitch_m - 0.5 * f->aperture_m;
  double above = fmax(-at.z, at.z - f->depth_m), reach = reach_m + view_margin_m;
  return fabs(at.y) < reach && beside < reach && above < reach;
}

// Fields of a node whose rest point is known; the tissue map's where it is asked. `idle`: per
// vessel rows from here on in which it cannot come near; fields of the row above stand for those.
static void store_node(sonde_echo *echo, uint32_t node, sonde_vec3 point, bool mapped,
                       uint8_t idle[MOST_VESSELS]) {
  const uint32_t count = SONDE_PLANE_NODES;
  const sonde_interior *in = echo->interior;
  const sonde_vec3 rest = echo->node[node].rest;
  // Layers.
  sonde_column_point at;
  bool within = sonde_interior_locate(in, rest, &at);
  double turn = at.theta - echo->theta_centre;
  at.theta -= 2 * SONDE_PI * floor(turn / (2 * SONDE_PI) + 0.5);
  float *p = echo->plane + node;
  p[PLANE_THETA * count] = (float)at.theta;
  p[PLANE_S * count] = (float)at.s;
  p[PLANE_DEPTH * count] = within ? (float)at.depth_m : -1;
  p[PLANE_FAT * count] = (float)at.fat_m;
  p[PLANE_MUSCLE * count] = (float)at.muscle_m;
  p[PLANE_ACROSS * count] = (float)(at.r * cos(at.theta));
  p[PLANE_UP * count] = (float)(at.r * sin(at.theta));
  const struct sonde_tissue_map *map = in->model->map;
  sonde_tissue_depths depths;
  if (mapped) map->depths(map->self, rest, &depths);
  p[PLANE_BONE * count] = mapped ? (float)(at.r - in->bone_radius_m - depths.bone_m) : 0;
  // Coordinates in the deformed sections of the vessels. Beyond its end a branch fades away from
  // the last section: neighbours inside and beyond then meet without passing its axis.
  for (uint32_t k = 0; k < echo->shown_count; ++k) {
    const uint32_t which = echo->shown[k], sections = in->course[which].count;
    float *field = p + vessel_field_at(k, VESSEL_SHORT) * count;
    if (idle[k] > 0) {
      --idle[k];
      const float *above = field - SONDE_PLANE_COLUMNS;
      for (uint32_t c = 0; c < VESSEL_FIELDS; ++c) field[c * count] = above[c * count];
      continue;
    }
    sonde_vessel_state v;
    double across = far_away, along = far_away, half_short = 1e-3, half_long = 1e-3, clot = 0;
    const double place = sonde_vessel_along(in, which, rest, at.s);
    bool there = sonde_vessel_at(in, which, place, &v);
    if (!there && which >= 2)
      v = in->state[which][place < in->section[which][0].along_m ? 0 : sections - 1];
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
    const double apart = (hypot(along, across) - 1) * fmin(half_short, half_long) - wall_apart_m;
    if (there && apart > 0) idle[k] = (uint8_t)fmin(apart / (2 * echo->depth_per_row), MOST_IDLE);
    field[VESSEL_SHORT * count] = (float)along;
    field[VESSEL_LONG * count] = (float)across;
    field[VESSEL_HALF_SHORT * count] = (float)half_short;
    field[VESSEL_HALF_LONG * count] = (float)half_long;
    field[VESSEL_CLOT * count] = (float)clot;
  }
  // Fasciae and muscles as the tissue map has them.
  if (mapped) {
    double power[MOST_CELLS];
    float *field = p + map_field_at(echo->shown_count, echo->lesion_count, 0) * count;
    map->powers(map->self, rest, echo->cell_count, echo->cell, power, NULL);
    p[PLANE_MUSCLE * count] = (float)(at.depth_m + depths.fascia_m);
    *field = (float)depths.superficial_m;
    for (uint32_t k = 0; k < echo->cell_count; ++k)
      field[(k + 1) * count] = (float)(1e6 * power[k]);
    field += (1 + echo->cell_count) * count;
    for (uint32_t k = 0; k < echo->body_count; ++k) {
      const sonde_vec3 q = map->body_place(map->self, echo->body[k], rest);
      for (int c = 0; c < BODY_FIELDS; ++c, field += count) *field = (float)v_coordinate(q, c);
    }
  }
  // Coordinates in the lesions.
  for (uint32_t k = 0; k < echo->lesion_count; ++k) {
    sonde_vec3 q = sonde_lesion_point(in, echo->lesion[k], rest);
    float *field = p + lesion_field_at(echo->shown_count, k, 0) * count;
    for (int c = 0; c < 3; ++c) field[c * (int)count] = (float)v_coordinate(q, c);
  }
}

// Fields between two rows in which the tissue map was asked: it is smooth over two rows, but bodies
// end.
static void fill_row(sonde_echo *echo, uint32_t j, uint32_t field, bool smooth) {
  const uint32_t wide = SONDE_PLANE_COLUMNS;
  float *row = echo->plane + field * SONDE_PLANE_NODES + j * wide;
  smooth = smooth && j >= 3 && j + 3 < echo->plane_rows;
  for (uint32_t i = 0; i < wide; ++i) {
    float *at = row + i;
    const float near = at[-(int)wide] + at[wide];
    *at = smooth ? 0.5625f * near - 0.0625f * (at[-3 * (int)wide] + at[3 * wide]) : 0.5f * near;
  }
}

// Node (i, j) in the probe frame.
static sonde_vec3 place_of(const sonde_echo *echo, uint32_t i, uint32_t j) {
  double line = i * echo->lines_per_column - echo->frame.edge_lines;
  return sonde_echo_place(&echo->frame, line, j * echo->depth_per_row);
}

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

// A node of a row whose rest point is sought.
typedef struct seeker {
  sonde_vec3 local, point, from; // probe frame, world, line and depth
  sonde_mat3 steps;              // that turn a miss in the image into a correction
  sonde_vec3 q, best;            // guess at rest, and the best so far
  double least, damping;         // residual of the best, m
} seeker;

// Image coordinates of a small offset in the world from a node: columns, metres beside the plane,
// rows.
static sonde_vec3 image_step(const sonde_echo *echo, const seeker *s, sonde_vec3 offset) {
  const frame *f = &echo->frame;
  sonde_vec3 at = sonde_echo_unplace(f, v_add(s->local, m_mul_v(f->from_world, offset)));
  return vec3((at.x - s->from.x) / echo->lines_per_column, at.y - s->from.y,
              (at.z - s->from.z) / echo->depth_per_row);
}

// Displacements of rest points by the field.
static void fields_at(sonde_echo *echo, uint32_t count, const sonde_vec3 *rest, sonde_vec3 *out) {
  float_x4 from[SONDE_PLANE_COLUMNS], field[SONDE_PLANE_COLUMNS];
  SONDE_ASSERT(count <= SONDE_PLANE_COLUMNS);
  for (uint32_t k = 0; k < count; ++k) from[k] = point_of(v_sub(rest[k], echo->motion->corner));
  sonde_fields_at(echo->motion, count, from, field);
  for (uint32_t k = 0; k < count; ++k)
    out[k] = vec3((double)field[k][0], (double)field[k][1], (double)field[k][2]);
}

// Rest points of a row. Two rows above give a first guess and the derivative that turns a miss into
// a correction: Newton's steps. The first row starts from the points themselves, the second a step
// below the first; both relax without a derivative, as sonde_interior_invert does it. Where a point
// is not reached, the plain iteration goes on from the best so far.
static void find_row(sonde_echo *echo, uint32_t j, seeker row[SONDE_PLANE_COLUMNS]) {
  const frame *f = &echo->frame;
  const int steps = j > 1 ? NEWTON_ITERATIONS : j > 0 ? ITERATIONS : FIRST_ITERATIONS;
  plane_node *node = &echo->node[j * SONDE_PLANE_COLUMNS];
  uint32_t seeking[SONDE_PLANE_COLUMNS], count = SONDE_PLANE_COLUMNS;
  sonde_vec3 rest[SONDE_PLANE_COLUMNS], field[SONDE_PLANE_COLUMNS];
  for (uint32_t i = 0; i < count; ++i) {
    seeker *s = &row[i];
    *s = (seeker){.local = place_of(echo, i, j), .least = INFINITY, .damping = 1};
    s->point = pose_apply(f->probe, s->local), s->from = sonde_echo_unplace(f, s->local);
    s->q = s->point, seeking[i] = i;
    if (j == 1) {
      sonde_vec3 down = v_sub(s->local, place_of(echo, i, 0));
      s->q = v_add(echo->node[i].rest, q_rotate(f->probe.rotation, down));
    } else if (j > 1) {
      const plane_node *above = node + i - SONDE_PLANE_COLUMNS;
      s->steps = steps_at(echo, i, j - 1, j - 1);
      s->q = v_add(above->rest, v_sub(above->rest, (above - SONDE_PLANE_COLUMNS)->rest));
    }
    s->best = s->q;
  }
  for (int step = 0; step < steps && count > 0; ++step) {
    uint32_t still = 0;
    for (uint32_t k = 0; k < count; ++k) rest[k] = row[seeking[k]].q;
    fields_at(echo, count, rest, field);
    for (uint32_t k = 0; k < count; ++k) {
      seeker *s = &row[seeking[k]];
      const sonde_vec3 miss = v_sub(v_add(s->q, field[k]), s->point);
      const double size = v_norm(miss);
      const bool better = size < s->least;
      if (better)
        s->least = size, s->best = s->q;
      else if (j > 1)
        continue; // Newton's steps do not lead on
      else
        s->damping *= 0.5;
      if (j > 1 && size < tolerance_m) continue;
      s->q = j > 1 ? v_sub(s->q, m_mul_v(s->steps, image_step(echo, s, miss)))
                   : v_madd(s->q, -s->damping, miss);
      if (!(size < tolerance_m)) seeking[still++] = seeking[k];
    }
    count = still;
  }
  for (uint32_t i = 0; i < SONDE_PLANE_COLUMNS; ++i) {
    seeker *s = &row[i];
    if (j > 1 && !(s->least < tolerance_m)) // the first rows may lie in the air
      s->best = sonde_interior_invert(echo->interior, s->point, s->best, ITERATIONS, NULL);
    node[i].rest = s->best;
  }
}

// Vessels, lesions and muscles in view, and so the fields and levels of this frame.
static void find_in_view(sonde_echo *echo) {
  const frame *f = &echo->frame;
  // The femoral vessels always, so that a leg without branches takes the same way through the
  // stages.
  const sonde_interior *in = echo->interior;
  echo->shown[0] = 0, echo->shown[1] = 1, echo->shown_count = 2;
  echo->vessels = in->course[0].count > 0 || in->course[1].count > 0;
  // Of more branches than there is room for those that come nearest to the picture's middle; they
  // stay in their order: branches after their parents.
  double nearest[MOST_VESSELS] = {0};
  const sonde_vec3 middle = pose_apply(f->probe, vec3(0, 0, 0.5 * f->depth_m));
  const double picture_m = hypot(f->aperture_m, f->depth_m);
  for (uint32_t which = 2; which < in->vessel_count; ++which) {
    const sonde_vessel_state *v = in->state[which];
    const sonde_vessel_course *course = &in->course[which];
    double near = INFINITY;
    if (v_distance(course->middle, middle) > course->ball_m + picture_m + far_view_m) continue;
    for (uint32_t i = 0; i < course->count; ++i)
      if (in_view(echo, v[i].centre_m, 4 * v[i].rest_radius_m))
        near = fmin(near, v_distance(v[i].centre_m, middle));
    if (!isfinite(near)) continue;
    uint32_t place = echo->shown_count;
    if (place == MOST_VESSELS) {
      for (uint32_t k = place = 2; k < MOST_VESSELS; ++k)
        if (nearest[k] > nearest[place]) place = k;
      if (nearest[place] <= near) continue;
      for (; place + 1 < MOST_VESSELS; ++place)
        echo->shown[place] = echo->shown[place + 1], nearest[place] = nearest[place + 1];
    }
    echo->shown[place] = which, nearest[place] = near, echo->shown_count = place + 1;
    echo->vessels = true;
  }
  echo->lesion_count = 0;
  for (uint32_t k = 0; k < in->findings.lesion_count; ++k) {
    const sonde_lesion *l = &in->findings.lesion[k];
    sonde_vec3 now = v_add(l->centre_m, sonde_interior_field(in, l->centre_m));
    double reach = fmax(fmax(l->half_m.x, l->half_m.y), l->half_m.z);
    if (in_view(echo, now, 1.5 * reach)) echo->lesion[echo->lesion_count++] = k;
  }
  // Muscles around the picture's middle.
  const struct sonde_tissue_map *map = in->model->map;
  echo->cell_count = echo->body_count = 0;
  if (map != NULL) {
    if (!echo->plain)
      echo->body_count = map->bodies(map->self, middle, 0.5 * picture_m, MOST_BODIES, echo->body);
    echo->cell_count =
        map->seeds(map->self, sonde_echo_middle(f), INFINITY, MOST_CELLS, echo->cell);
  }
  echo->fields = lesion_field_at(echo->shown_count, echo->lesion_count, 0) +
                 (map != NULL ? 1 + echo->cell_count + BODY_FIELDS * echo->body_count : 0);
  echo->levels = LAYER_LEVELS + echo->shown_count + echo->lesion_count;
  SONDE_ASSERT(echo->fields <= MOST_FIELDS && echo->levels <= MOST_LEVELS);
}

void sonde_echo_plane(sonde_echo *echo) {
  SONDE_ASSERT(echo->frame.pathology != NULL && echo->frame.depth_m > 0);
  const frame *f = &echo->frame;
  const sonde_vec3 beside = v_scale(q_rotate(f->probe.rotation, vec3(0, 1, 0)), step_beside);
  sonde_column_point centre;
  (void)sonde_interior_locate(echo->interior, f->probe.position, &centre);
  echo->theta_centre = centre.theta;
  find_in_view(echo);
  const bool map = echo->interior->model->map != NULL;
  uint8_t idle[SONDE_PLANE_COLUMNS][MOST_VESSELS] = {{0}};
  sonde_fields_begin(echo->motion, echo->interior, f->probe.position);
  for (uint32_t j = 0; j < echo->plane_rows; ++j) {
    seeker row[SONDE_PLANE_COLUMNS];
    sonde_vec3 rest[SONDE_PLANE_COLUMNS], there[SONDE_PLANE_COLUMNS];
    plane_node *node = &echo->node[j * SONDE_PLANE_COLUMNS];
    find_row(echo, j, row);
    // Where a step beside the plane leads from each node.
    for (uint32_t i = 0; i < SONDE_PLANE_COLUMNS; ++i) rest[i] = v_add(node[i].rest, beside);
    fields_at(echo, SONDE_PLANE_COLUMNS, rest, there);
    for (uint32_t i = 0; i < SONDE_PLANE_COLUMNS; ++i) {
      sonde_vec3 here = v_sub(row[i].point, node[i].rest); // what the inversion converged to
      sonde_vec3 at = image_step(echo, &row[i], v_add(beside, v_sub(there[i], here)));
      node[i].side = vec3(at.x / step_beside, at.y / step_beside, at.z / step_beside);
      store_node(echo, j * SONDE_PLANE_COLUMNS + i, row[i].point,
                 map && (j % 2 == 0 || j + 1 == echo->plane_rows), idle[i]);
    }
  }
  const uint32_t first = map_field_at(echo->shown_count, echo->lesion_count, 0);
  for (uint32_t j = 1; map && j + 1 < echo->plane_rows; j += 2) {
    fill_row(echo, j, PLANE_MUSCLE, true), fill_row(echo, j, PLANE_BONE, true);
    for (uint32_t field = first; field < echo->fields; ++field)
      fill_row(echo, j, field, field <= first + echo->cell_count);
  }
  // The derivatives of image coordinates: rows of the inverse are the crossed columns over the
  // volume.
  for (uint32_t j = 0; j < echo->plane_rows; ++j)
    for (uint32_t i = 0; i < SONDE_PLANE_COLUMNS; ++i) {
      plane_node *node = &echo->node[j * SONDE_PLANE_COLUMNS + i];
      sonde_mat3 steps = steps_at(echo, i, j, echo->plane_rows - 1);
      sonde_vec3 a = m_column(&steps, 0), c = m_column(&steps, 1), b = m_column(&steps, 2);
      node->beside = c;
      sonde_vec3 bc = v_cross(c, b), ca = v_cross(b, a), ab = v_cross(a, c);
      double volume = v_dot(a, bc), least = 1e-3 * v_norm(a) * v_norm(b) * v_norm(c);
      if (fabs(volume) < least) volume = volume < 0 ? -least : least;
      double k = volume != 0 ? 1 / volume : 0;
      node->in = (sonde_mat3){{{bc.x * k, bc.y * k, bc.z * k},
                               {ca.x * k, ca.y * k, ca.z * k},
                               {ab.x * k, ab.y * k, ab.z * k}}};
    }
}
