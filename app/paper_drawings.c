// Figures 3 and 6: the probes as they are in the simulation, and the two-layer model on a patch of
// the real mesh with its masses, surface spring-dampers and normal springs.
#include "painter.h"
#include "paper.h"
#include "pose.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static sonde_vec3 add(sonde_vec3 a, double s, sonde_vec3 b) {
  return (sonde_vec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}
static sonde_vec3 cross(sonde_vec3 a, sonde_vec3 b) {
  return (sonde_vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static sonde_vec3 unit(sonde_vec3 a) {
  return add((sonde_vec3){0, 0, 0}, 1 / sqrt(vec_dot(a, a)), a);
}

// ---- figure 3

// A probe in perspective, seen from below so that its contact face (z = 0) shows, with its sides.
static sonde_status draw_probe(sonde_file *file, const sonde_probe *probe, painter_box box,
                               double scale, sonde_error *error) {
  const double FACE_M = 1e-6;
  const sonde_mesh *hull = &probe->body.hull;
  painter *brush = NULL;
  painter_camera camera = painter_look((sonde_vec3){-0.35, -0.75, 0.55}, (sonde_vec3){0, 0, -1},
                                       (sonde_vec3){0, 0, 0}, 0.5);
  camera.scale = scale, camera.left = box.left + box.width / 2;
  camera.top = box.top + box.height - 40;
  sonde_status status = painter_create(&camera, &brush, error);
  for (uint32_t f = 0; f < hull->face_count && !status; ++f) {
    const uint32_t *v = hull->faces[f];
    const sonde_vec3 corner[3] = {hull->vertices[v[0]], hull->vertices[v[1]], hull->vertices[v[2]]};
    if (!painter_sees(brush, corner)) continue;
    bool contact = corner[0].z > -FACE_M && corner[1].z > -FACE_M && corner[2].z > -FACE_M;
    if (contact) // in its own colour, whatever the light
      painter_face(brush, corner, 0xe58a4c, 1);
    else
      painter_lit_face(brush, corner, 0xb8c4ce, 1);
    // Edges between faces of different planes.
    for (int k = 0; k < 3; ++k) {
      sonde_vec3 a = corner[k], b = corner[(k + 1) % 3], d = add(b, -1, a);
      int across = (fabs(d.x) > FACE_M) + (fabs(d.y) > FACE_M) + (fabs(d.z) > FACE_M);
      if (across == 1) painter_line(brush, a, b, 0x334455, 1.1, 5e-3);
    }
  }
  if (!status) status = painter_paint(brush, file, error);

  // The sides of the contact face, measured beside it.
  double hx = probe->half_x_m, hy = probe->half_y_m, out = 2.5e-3, a[2], b[2];
  const struct {
    sonde_vec3 from, to;
    double size_mm;
  } side[2] = {{{-hx, hy + out, 0}, {hx, hy + out, 0}, 2e3 * hx},
               {{hx + out, -hy, 0}, {hx + out, hy, 0}, 2e3 * hy}};
  for (int k = 0; k < 2 && !status; ++k) {
    char words[32];
    painter_project(&camera, side[k].from, a);
    painter_project(&camera, side[k].to, b);
    const double ends[2][2] = {{a[0], a[1]}, {b[0], b[1]}};
    sonde_svg_put_line(file, ends, 2, "stroke='#222' stroke-width='1'");
    sonde_svg_put_circle(file, a[0], a[1], 1.6, "fill='#222'");
    sonde_svg_put_circle(file, b[0], b[1], 1.6, "fill='#222'");
    snprintf(words, sizeof words, "%g mm", side[k].size_mm);
    sonde_svg_put_text(file, 0.5 * (a[0] + b[0]) + (k ? -8 : 6), 0.5 * (a[1] + b[1]) + (k ? 6 : 15),
                       k ? "class='tick end'" : "class='tick'", words);
  }
  painter_destroy(brush);
  return status;
}

static sonde_status draw_probes(paper *p, sonde_error *error) {
  static const char *const NAME[] = {"point", "linear"};
  static const char *const WORDS[] = {"Punctual contact: tip", "Flat probe: face of an array"};
  const char *TITLE = "Figure 3. The two probes";
  double area_mm2[2] = {NAN, NAN};
  sonde_file *file = NULL;
  sonde_status status = paper_figure_begin(p, 3, TITLE, 760, 430, &file, error);
  if (!status) sonde_svg_put_text(file, 24, 26, "class='head'", TITLE);
  for (int k = 0; k < 2 && !status; ++k) {
    sonde_probe probe = {0};
    char words[96];
    painter_box box = {k ? 250 : 20, 56, k ? 490 : 230, 320};
    status = sonde_probe_create(NAME[k], &probe, error);
    if (!status) status = draw_probe(file, &probe, box, 4000, error);
    area_mm2[k] = 4e6 * probe.half_x_m * probe.half_y_m;
    snprintf(words, sizeof words, "%s, \"%s\", %.0f mm\u00b2", WORDS[k], NAME[k], area_mm2[k]);
    if (!status) sonde_svg_put_text(file, box.left + box.width / 2, 414, "class='middle'", words);
    sonde_probe_clear(&probe);
  }
  paper_caption(
      p->figure[2].caption, sizeof p->figure[2].caption,
      "The two probes from their meshes, at one scale, seen from below; the contact face "
      "is orange: %.0f and %.0f mm\u00b2. The paper's tip is a pyramid; ours is the small "
      "square that it touches with.",
      area_mm2[0], area_mm2[1]);
  return paper_figure_end(file, status, error);
}

// ---- figure 6

// A zigzag between two points in the plane of `aside`; the first and last fifths are straight.
static void draw_spring(painter *brush, sonde_vec3 a, sonde_vec3 b, sonde_vec3 aside, double wide_m,
                        uint32_t turns, uint32_t rgb, double width_px) {
  sonde_vec3 way = add(b, -1, a), last = add(a, 0.2, way);
  painter_line(brush, a, last, rgb, width_px, 0);
  for (uint32_t k = 0; k <= turns; ++k) {
    double side = k == turns ? 0 : k % 2 ? -wide_m : wide_m;
    sonde_vec3 next =
        add(add(a, 0.2 + 0.6 * (k + (k < turns ? 0.5 : 0)) / turns, way), side, aside);
    painter_line(brush, last, next, rgb, width_px, 0);
    last = next;
  }
  painter_line(brush, last, b, rgb, width_px, 0);
}

// A dashpot beside the line between two points: a piston in a cylinder.
static void draw_damper(painter *brush, sonde_vec3 a, sonde_vec3 b, sonde_vec3 aside, double off_m,
                        double wide_m, uint32_t rgb) {
  sonde_vec3 way = add(b, -1, a), from = add(a, off_m, aside);
  const double AT[][4] = {{0.2, 0, 0.45, 0},      {0.45, -1, 0.45, 1},     {0.38, -1.3, 0.62, -1.3},
                          {0.38, 1.3, 0.62, 1.3}, {0.62, -1.3, 0.62, 1.3}, {0.62, 0, 0.8, 0}};
  for (size_t k = 0; k < sizeof AT / sizeof *AT; ++k)
    painter_line(brush, add(add(from, AT[k][0], way), AT[k][1] * wide_m, aside),
                 add(add(from, AT[k][2], way), AT[k][3] * wide_m, aside), rgb, 1, 0);
  painter_line(brush, add(a, 0.2, way), add(from, 0.2, way), rgb, 1, 0);
  painter_line(brush, add(a, 0.8, way), add(from, 0.8, way), rgb, 1, 0);
}

// Nodes of the mesh at most two edges away from the regular one nearest to a point. @return their
// number
static uint32_t patch_around(const sonde_model *m, sonde_vec3 middle, uint32_t *node,
                             uint32_t room) {
  enum { REGULAR = 6 }; // neighbours of a node within a regular part of the mesh
  uint32_t count = 1, ring = 0;
  node[0] = 0;
  double least = INFINITY;
  for (uint32_t i = 0; i < m->surface.vertex_count; ++i) {
    sonde_vec3 d = add(m->surface.vertices[i], -1, middle);
    if (m->topology.start[i + 1] - m->topology.start[i] != REGULAR) continue;
    if (vec_dot(d, d) < least) least = vec_dot(d, d), node[0] = i;
  }
  for (int rings = 0; rings < 2; ++rings) {
    uint32_t end = count;
    for (; ring < end; ++ring)
      for (uint32_t k = m->topology.start[node[ring]]; k < m->topology.start[node[ring] + 1]; ++k) {
        uint32_t other = m->topology.neighbour[k], known = 0;
        while (known < count && node[known] != other) ++known;
        if (known == count && count < room) node[count++] = other;
      }
  }
  return count;
}

static void label(sonde_file *file, const painter_camera *camera, sonde_vec3 at, double x, double y,
                  const char *words) {
  double xy[2];
  painter_project(camera, at, xy);
  const double line[2][2] = {{xy[0], xy[1]}, {x, y - 4}};
  sonde_svg_put_line(file, line, 2, "stroke='#555' stroke-width='.8'");
  sonde_svg_put_text(file, x + 5, y, "", words);
}

static sonde_status draw_layers(paper *p, sonde_error *error) {
  enum { ROOM = 64 };
  const char *TITLE = "Figure 6. The two-layer model on a patch of the mesh";
  const sonde_model *m = p->model;
  uint32_t node[ROOM], count = patch_around(m, p->central->position_m, node, ROOM), springs = 0;
  sonde_vec3 normal = m->normal[node[0]], points[2 * ROOM];
  double edge_m = m->edge_rest_m[m->topology.neighbour_edge[m->topology.start[node[0]]]];
  double deep_m = 2.6 * edge_m;
  assert(count > 6);
  for (uint32_t k = 0; k < count; ++k) {
    points[k] = m->surface.vertices[node[k]];
    points[count + k] = add(points[k], -deep_m, m->normal[node[k]]);
  }
  sonde_vec3 toward =
      add(add(normal, 1.25, unit(cross(p->central->v, normal))), 0.55, p->central->v);
  painter_camera camera = painter_look(toward, normal, points[0], 16 * edge_m);
  painter_fit(&camera, points, 2 * count, (painter_box){40, 56, 530, 420});
  painter *brush = NULL;
  sonde_file *file = NULL;
  sonde_status status = paper_figure_begin(p, 6, TITLE, 800, 500, &file, error);
  if (!status) status = painter_create(&camera, &brush, error);

  // Surface: a spring and a damper along every edge; below: a normal spring at every node.
  sonde_vec3 middle = points[0];
  double farthest = -INFINITY;
  for (uint32_t i = 0; i < count && !status; ++i)
    for (uint32_t k = m->topology.start[node[i]]; k < m->topology.start[node[i] + 1]; ++k) {
      uint32_t j = 0;
      while (j < count && node[j] != m->topology.neighbour[k]) ++j;
      if (j == count || node[j] < node[i]) continue;
      sonde_vec3 aside = unit(cross(m->normal[node[i]], add(points[j], -1, points[i])));
      draw_spring(brush, points[i], points[j], aside, 0.055 * edge_m, 9, 0x0072b2, 1.4);
      draw_damper(brush, points[i], points[j], aside, 0.16 * edge_m, 0.04 * edge_m, 0x009e73);
      springs++;
      double at[2];
      sonde_vec3 half = add(points[i], 0.5, add(points[j], -1, points[i]));
      painter_project(&camera, half, at);
      if (at[0] > farthest) farthest = at[0], middle = half;
    }
  for (uint32_t i = 0; i < count && !status; ++i) {
    sonde_vec3 foot = points[count + i];
    draw_spring(brush, points[i], foot, camera.right, 0.1 * edge_m, 8, 0xd55e00, 1.5);
    // An arrow across: its stiffness depends on the deformation.
    sonde_vec3 centre = add(points[i], 0.5, add(foot, -1, points[i]));
    sonde_vec3 low = add(add(centre, -0.3 * edge_m, camera.right), -0.32 * edge_m, camera.up);
    sonde_vec3 high = add(add(centre, 0.3 * edge_m, camera.right), 0.32 * edge_m, camera.up);
    painter_line(brush, low, high, 0xa04000, 1, 1e-4);
    painter_line(brush, high, add(high, -0.16 * edge_m, camera.right), 0xa04000, 1, 1e-4);
    painter_line(brush, high, add(high, -0.16 * edge_m, camera.up), 0xa04000, 1, 1e-4);
    painter_line(brush, add(foot, -0.2 * edge_m, camera.right),
                 add(foot, 0.2 * edge_m, camera.right), 0x333333, 2.2, 0);
    painter_ball(brush, points[i], 6.5, 0x404854, 0.02 * edge_m);
  }
  if (!status) status = painter_paint(brush, file, error);
  if (!status) {
    uint32_t right = 0, low = 0;
    double xy[2], most = -INFINITY;
    for (uint32_t i = 0; i < count; ++i) {
      painter_project(&camera, points[i], xy);
      if (xy[0] > most) most = xy[0], right = i;
    }
    low = right;
    sonde_svg_put_text(file, 24, 26, "class='head'", TITLE);
    label(file, &camera, points[right], 612, 120, "mass of a node");
    label(file, &camera, middle, 612, 160, "linear spring and damper");
    sonde_svg_put_text(file, 617, 176, "class='tick'", "along each edge, uniform");
    label(file, &camera, add(points[low], 0.35, add(points[count + low], -1, points[low])), 612,
          260, "normal spring, eq. (1)");
    sonde_svg_put_text(file, 617, 276, "class='tick'", "f = x/(a x + b) per node,");
    sonde_svg_put_text(file, 617, 291, "class='tick'", "a and b vary over the skin");
    label(file, &camera, points[count + low], 612, 400, "anchor, fixed");
  }
  painter_destroy(brush);
  paper_caption(p->figure[5].caption, sizeof p->figure[5].caption,
                "%u nodes of the skin around site %u in perspective, as the simulation has them: "
                "%u surface spring-dampers and a normal spring below each node. Edges are about "
                "%.1f mm; the normal springs are drawn %.0f mm long, their anchors do not move.",
                count, p->central->id, springs, 1e3 * edge_m, 1e3 * deep_m);
  return paper_figure_end(file, status, error);
}

sonde_status paper_drawings(paper *p, sonde_error *error) {
  sonde_status status = draw_probes(p, error);
  return status ? status : draw_layers(p, error);
}
