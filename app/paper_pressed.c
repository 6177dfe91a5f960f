// Figure 8: the thigh pressed by the probe, with the image of that state; and what the paper says
// of the simulated force, of incompressibility and of the vein.
#include "painter.h"
#include "paper.h"
#include "pose.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = 360, SHADES = 32 };
static const double SHOWN_N = 8;

// A slow press along the beam from the skin at rest, to a force or a depth.
static sonde_status press(const paper *p, settled *s, sonde_pose start, double depth_m,
                          double force_n, sonde_error *error) {
  sonde_path_def def = sonde_path_def_default();
  def.force_n = force_n;
  def.relative_residual = 1e-6;
  if (p->quick) def.tolerance = 0.05, def.relative_residual = 1e-4;
  sonde_status status =
      sonde_settle_path(s->state, &s->probe, start, pose_shift(start, depth_m, pose_axis(start, 2)),
                        &def, &p->progress, &s->path, error);
  s->pose = s->path.pose, s->force_n = s->path.force_n, s->depth_m = s->path.way_m;
  return status;
}

// ---- figure 8

// The skin's own colour for none, then dark violet to yellow for the most.
static uint32_t colour_of(double share) {
  static const double STOP[][3] = {
      {68, 1, 84}, {59, 82, 139}, {33, 145, 140}, {94, 201, 98}, {253, 231, 37}};
  static const double SKIN[] = {217, 195, 172}, BLEND = 0.16;
  double at = 4 * fmin(fmax(share, 0), 0.9999), mixed = fmin(share / BLEND, 1);
  int k = (int)at;
  uint32_t rgb = 0;
  for (int c = 0; c < 3; ++c) {
    double tint = STOP[k][c] + (at - k) * (STOP[k + 1][c] - STOP[k][c]);
    rgb = rgb << 8 | (uint32_t)lround(SKIN[c] + mixed * (tint - SKIN[c]));
  }
  return rgb;
}

// Indentation of a node along its rest normal, m.
static double indentation(const sonde_model *m, const sonde_vec3 *x, uint32_t i) {
  sonde_vec3 n = m->normal[i], r = m->surface.vertices[i];
  return n.x * (r.x - x[i].x) + n.y * (r.y - x[i].y) + n.z * (r.z - x[i].z);
}

// The skin around the probe coloured by its indentation, the probe as glass with its edges.
static sonde_status draw_thigh(const settled *s, const sonde_site *site, sonde_file *file,
                               double deepest_m, sonde_error *error) {
  const double FACE_M = 1e-6;
  const sonde_model *m = s->model;
  const sonde_vec3 *x = sonde_state_positions(s->state);
  sonde_vec3 n = site->normal;
  sonde_vec3 toward = {0.75 * n.x + 0.9 * site->v.x - 0.35 * site->u.x,
                       0.75 * n.y + 0.9 * site->v.y - 0.35 * site->u.y,
                       0.75 * n.z + 0.9 * site->v.z - 0.35 * site->u.z};
  painter_camera camera = painter_look(toward, n, site->position_m, 0.8);
  painter_fit(&camera, x, m->surface.vertex_count, (painter_box){14, 60, 420, 380});
  painter *brush = NULL;
  sonde_status status = painter_create(&camera, &brush, error);
  for (uint32_t f = 0; f < m->surface.face_count && !status; ++f) {
    const uint32_t *v = m->surface.faces[f];
    const sonde_vec3 corner[3] = {x[v[0]], x[v[1]], x[v[2]]};
    double share = 0;
    for (int k = 0; k < 3; ++k) share += indentation(m, x, v[k]) / (3 * deepest_m);
    uint32_t level = (uint32_t)fmin(fmax(share, 0) * SHADES, SHADES - 1);
    painter_lit_face(brush, corner, colour_of(level / (SHADES - 1.0)), 1);
  }
  const sonde_mesh *hull = &s->probe.body.hull;
  for (uint32_t f = 0; f < hull->face_count && !status; ++f) {
    sonde_vec3 corner[3];
    for (int k = 0; k < 3; ++k) {
      sonde_vec3 q = hull->vertices[hull->faces[f][k]];
      corner[k] = s->pose.position;
      const double part[3] = {q.x, q.y, q.z};
      for (int a = 0; a < 3; ++a) {
        sonde_vec3 axis = pose_axis(s->pose, a);
        corner[k].x += part[a] * axis.x, corner[k].y += part[a] * axis.y;
        corner[k].z += part[a] * axis.z;
      }
    }
    painter_lit_face(brush, corner, 0x8fa8c0, 0.35);
    for (int k = 0; k < 3; ++k) {
      sonde_vec3 a = hull->vertices[hull->faces[f][k]],
                 b = hull->vertices[hull->faces[f][(k + 1) % 3]];
      int across =
          (fabs(a.x - b.x) > FACE_M) + (fabs(a.y - b.y) > FACE_M) + (fabs(a.z - b.z) > FACE_M);
      if (across == 1) painter_line(brush, corner[k], corner[(k + 1) % 3], 0x223344, 1, 2e-3);
    }
  }
  if (!status) status = painter_paint(brush, file, error);
  painter_destroy(brush);
  return status;
}

static void draw_scale(sonde_file *file, double left, double top, double deepest_m) {
  char words[48], look[40];
  for (int k = 0; k < SHADES; ++k) {
    double x = left + 6 * k;
    const double box[4][2] = {{x, top}, {x + 6, top}, {x + 6, top + 10}, {x, top + 10}};
    snprintf(look, sizeof look, "fill='#%06x'", colour_of(k / (SHADES - 1.0)));
    sonde_svg_put_outlines(file, box, 4, 4, look);
  }
  for (int k = 0; k <= 2; ++k) {
    snprintf(words, sizeof words, "%.0f%s", 0.5e3 * k * deepest_m, k == 2 ? " mm" : "");
    sonde_svg_put_text(file, left + 96 * k, top + 24, "class='tick middle'", words);
  }
  sonde_svg_put_text(file, left, top - 6, "class='tick'", "indentation along the rest normal");
}

static sonde_status draw_pressed(paper *p, settled *s, const sonde_pathology *vein,
                                 sonde_error *error) {
  const char *TITLE = "Figure 8. The thigh under the probe, and its image";
  double deepest_m = 0;
  char words[96];
  const sonde_vec3 *x = sonde_state_positions(s->state);
  for (uint32_t i = 0; i < s->model->surface.vertex_count; ++i)
    deepest_m = fmax(deepest_m, indentation(s->model, x, i));
  deepest_m = 2e-3 * ceil(500 * deepest_m); // whole even millimetres
  sonde_image image = {0};
  sonde_echo *echo = NULL;
  sonde_file *file = NULL;
  sonde_echo_settings settings = sonde_echo_settings_default();
  settled_update(s, vein, 0, sonde_state_tick(s->state));
  sonde_status status = sonde_echo_create(s->interior, NULL, &echo, error);
  if (!status) status = sonde_image_create(SIDE, SIDE, &image, error);
  if (!status) sonde_echo_render(echo, s->pose, 2 * s->probe.half_x_m, vein, &settings, &image);
  if (!status) status = paper_figure_begin(p, 8, TITLE, 840, 500, &file, error);
  if (!status) status = draw_thigh(s, p->central, file, deepest_m, error);
  if (!status) {
    sonde_svg_put_text(file, 24, 26, "class='head'", TITLE);
    snprintf(words, sizeof words, "site %u, flat probe, %.1f N at %.1f mm", p->central->id,
             s->force_n, 1e3 * s->depth_m);
    sonde_svg_put_text(file, 24, 46, "", words);
    draw_scale(file, 40, 462, deepest_m);
    sonde_svg_put_text(file, 456, 46, "", "the same state through the probe, healthy vein");
    status = sonde_svg_put_image(file, 456, 58, SIDE, SIDE, &image, error);
  }
  if (!status) {
    double bar = 0.01 / image.width_m * SIDE;
    const double line[2][2] = {{466, 434}, {466 + bar, 434}};
    sonde_svg_put_line(file, line, 2, "stroke='#222' stroke-width='2'");
    sonde_svg_put_text(file, 472 + bar, 438, "class='tick'", "10 mm");
  }
  paper_caption(
      p->figure[7].caption, sizeof p->figure[7].caption,
      "Left: the skin of the synthetic thigh, coloured by its indentation, under the flat "
      "probe pressed slowly to %.1f N without friction; its body is drawn as glass. Right: "
      "the echographic image that the simulator makes of the same state, %.0f x %.0f mm.",
      s->force_n, 1e3 * image.width_m, 1e3 * image.height_m);
  sonde_echo_destroy(echo);
  sonde_image_clear(&image);
  return paper_figure_end(file, status, error);
}

// ---- claims

static double vessel_ratio(const settled *s, int which) {
  sonde_vessel_state v;
  return sonde_interior_vessel_at_plane(s->interior, which, s->pose, &v) ? v.area_ratio : NAN;
}

// The vein by its state at the force of the figure; the artery beside it.
static sonde_status judge_vein(paper *p, settled *s, sonde_error *error) {
  static const char *const STATE[] = {"healthy", "partial_mural", "acute_occlusive",
                                      "chronic_occlusive"};
  static const char *const KEY[] = {"healthy_area", "partial_area", "acute_area", "chronic_area"};
  double area[4], artery = NAN;
  sonde_status status = SONDE_OK;
  for (int k = 0; k < 4 && !status; ++k) {
    sonde_pathology state;
    status = sonde_pathology_preset(STATE[k], &state, error);
    if (status) break;
    settled_update(s, &state, 0, sonde_state_tick(s->state));
    area[k] = vessel_ratio(s, 0);
    if (k == 0) artery = vessel_ratio(s, 1);
  }
  if (status) return status;
  paper_claim *c = paper_begin(
      p, "vein_compresses", "1",
      "A healthy vein compresses under an external force, a thrombosed one only partially or not "
      "at "
      "all; arterial and venous pressure decide.",
      "Area of the femoral vein over its area at rest in four states, and of the artery, under the "
      "flat probe at the force of figure 8.");
  paper_samples(c, 4, "states of the vein");
  paper_value(c, "force_n", s->force_n);
  for (int k = 0; k < 4; ++k) paper_value(c, KEY[k], area[k]);
  paper_value(c, "artery_area", artery);
  bool ordered = area[0] < area[1] && area[1] < area[3] && area[0] < 0.1 && area[3] > 0.7;
  paper_say(c, ordered && artery > 0.9 ? PAPER_HOLDS : PAPER_IN_PART,
            "At %.1f N the healthy vein keeps %.0f %% of its area, with a mural clot %.0f %%, an "
            "acute one %.0f %%, a chronic one %.0f %%; the artery keeps %.0f %%.",
            s->force_n, 100 * area[0], 100 * area[1], 100 * area[2], 100 * area[3], 100 * artery);
  return SONDE_OK;
}

// The force of the pressed body and of the bonded footprint against the measured one.
static sonde_status judge_force(paper *p, settled *s, sonde_error *error) {
  enum { MOST = 4 };
  static const uint32_t SITE[MOST] = {27, 3, 19, 51};
  const double DEPTH_M = 0.01;
  double sliding = 0, bonded = 0;
  uint32_t count = 0;
  sonde_status status = SONDE_OK;
  for (int k = 0; k < (p->quick ? 1 : MOST) && !status; ++k) {
    const sonde_site *site = sonde_model_site(s->model, SITE[k]);
    for (uint32_t i = 0; site && i < p->measurements.count && !status; ++i) {
      const sonde_datum *d = &p->measurements.data[i];
      if (d->site != site->id || strcmp(d->probe, "linear") != 0 ||
          fabs(d->penetration_m - DEPTH_M) > 1e-6)
        continue;
      sonde_state_reset(s->state);
      status = press(p, s, sonde_site_pose(site, 0), DEPTH_M, INFINITY, error);
      sliding += s->force_n / d->force_n - 1;
      bonded += fabs(p->fit.stage_n[2][i] / d->force_n - 1);
      count++;
    }
  }
  if (status) return status;
  sliding *= 100.0 / (count ? count : 1), bonded *= 100.0 / (count ? count : 1);
  paper_claim *c = paper_begin(
      p, "force_in_accordance", "5, Fig. 8",
      "A force applied with a probe provokes a deformation in accordance with the measurements.",
      "Force at 10 mm under the flat probe: of the footprint bonded to the skin, as in the "
      "measurements, and of the rigid body that slides on it, as in the simulation.");
  paper_samples(c, count, "sites");
  paper_value(c, "bonded_error_percent", count ? bonded : NAN);
  paper_value(c, "sliding_difference_percent", count ? sliding : NAN);
  paper_say(c,
            !count               ? PAPER_OPEN
            : fabs(sliding) <= 5 ? PAPER_HOLDS
                                 : PAPER_IN_PART,
            "Bonded as in the measurement the model is %.1f %% off; the rigid body pressed in "
            "without friction feels %+.0f %%: a flat face meets the round leg with its middle "
            "first, which the measurement's footprint does not.",
            bonded, sliding);
  return SONDE_OK;
}

// How near a node comes to its asymptote under a force that no exam reaches.
static sonde_status judge_limit(paper *p, settled *s, sonde_error *error) {
  const double FORCE_N = p->quick ? 25 : 100;
  sonde_state_reset(s->state);
  sonde_error ignored = {0};
  sonde_status status = press(p, s, sonde_site_pose(p->central, 0), 0.06, FORCE_N, &ignored);
  if (status && status != SONDE_CONVERGENCE) {
    *error = ignored;
    return status;
  }
  double nearest = 0, deepest_m = 0;
  const sonde_vec3 *x = sonde_state_positions(s->state);
  for (uint32_t i = 0; i < s->model->surface.vertex_count; ++i) {
    double depth_m = indentation(s->model, x, i);
    nearest = fmax(nearest, depth_m / s->model->xm_m[i]);
    deepest_m = fmax(deepest_m, depth_m);
  }
  paper_claim *c = paper_begin(
      p, "limit_kept", "3.2, eq. (1)",
      "After a certain deformation the thigh behaves as incompressible.",
      "The flat probe pressed at the central site far beyond an exam's force; indentation over x_m "
      "of every node.");
  paper_samples(c, s->model->surface.vertex_count, "nodes");
  paper_value(c, "force_n", s->force_n);
  paper_value(c, "deepest_mm", 1e3 * deepest_m);
  paper_value(c, "nearest_to_limit", nearest);
  paper_say(c, nearest < 1 ? (status ? PAPER_IN_PART : PAPER_HOLDS) : PAPER_FAILS,
            "At %.0f N the skin is %.1f mm deep and no node is nearer to its asymptote than %.3f "
            "x_m.%s",
            s->force_n, 1e3 * deepest_m, nearest,
            status ? " Beyond that force no equilibrium was found." : "");
  return SONDE_OK;
}

sonde_status paper_pressed(paper *p, sonde_error *error) {
  settled s = {0};
  sonde_pathology vein;
  sonde_status status = settled_open(&s, p->model_path, "linear", NULL, true, error);
  if (!status) status = sonde_pathology_preset("healthy", &vein, error);
  if (!status) status = press(p, &s, sonde_site_pose(p->central, 0), 0.06, SHOWN_N, error);
  if (!status) status = draw_pressed(p, &s, &vein, error);
  if (!status) status = judge_vein(p, &s, error);
  if (!status) status = judge_force(p, &s, error);
  if (!status) status = judge_limit(p, &s, error);
  settled_close(&s);
  return status;
}
