// The bodies of a scene as they stand: an SVG drawing, or a report as HTML with measures and
// surfaces that turn.
#include "scene_figure.h"

#include "painter.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = 520, TALLEST = 460, MARGIN = 12, LEGEND = 26, ROW = 18, DIGITS = 9, PLACES = 6 };
static const double LETTER_PX = 7.5;
static const double FAR = 2; // widths of a group beyond which a body is out of its view

typedef struct figure {
  const sonde_scene *scene;
  sonde_vec3 **vertex; // [bodies] of the surface, m
  bool *seen;          // [bodies] in the view
} figure;

static double dot(sonde_vec3 a, sonde_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static double norm(sonde_vec3 v) { return sqrt(dot(v, v)); }

typedef struct group {
  double low[3], high[3]; // box, m
  uint32_t bodies;
  bool fixed; // holds a body that does not move
} group;

static double width_of(const group *g) {
  double sum = 0;
  for (int k = 0; k < 3; ++k) sum += (g->high[k] - g->low[k]) * (g->high[k] - g->low[k]);
  return sqrt(sum);
}

// Bodies near each other make a group, and the group of most bodies is what the view shows: one
// body that fell off does not shrink the others to a dot. Of equal groups the one with a body that
// does not move is shown, else the wider one. Each group is found at its first body.
static bool choose_seen(figure *f) {
  uint32_t count = sonde_scene_body_count(f->scene);
  group *groups = calloc(count, sizeof *groups);
  uint32_t *of = calloc(count, sizeof *of); // [bodies] first body of its group
  bool good = groups && of;
  for (uint32_t b = 0; b < count && good; ++b) {
    sonde_body_info body = sonde_scene_body(f->scene, b);
    group *g = &groups[b];
    *g = (group){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}, 1, false};
    g->fixed = body.motion == SONDE_BODY_FIXED;
    for (uint32_t i = 0; i < body.surface->vertex_count; ++i) {
      const double at[3] = {f->vertex[b][i].x, f->vertex[b][i].y, f->vertex[b][i].z};
      for (int k = 0; k < 3; ++k)
        g->low[k] = fmin(g->low[k], at[k]), g->high[k] = fmax(g->high[k], at[k]);
    }
    of[b] = b;
  }
  for (bool joined = good; joined;) {
    joined = false;
    for (uint32_t a = 0; a < count; ++a)
      for (uint32_t b = a + 1; b < count; ++b) {
        if (of[a] != a || of[b] != b) continue;
        double sum = 0;
        for (int k = 0; k < 3; ++k) {
          const double gap = fmax(
              0, fmax(groups[a].low[k] - groups[b].high[k], groups[b].low[k] - groups[a].high[k]));
          sum += gap * gap;
        }
        if (!(sqrt(sum) <= FAR * fmax(width_of(&groups[a]), width_of(&groups[b])))) continue;
        for (int k = 0; k < 3; ++k) {
          groups[a].low[k] = fmin(groups[a].low[k], groups[b].low[k]);
          groups[a].high[k] = fmax(groups[a].high[k], groups[b].high[k]);
        }
        groups[a].bodies += groups[b].bodies;
        groups[a].fixed |= groups[b].fixed;
        for (uint32_t k = 0; k < count; ++k) of[k] = of[k] == b ? a : of[k];
        joined = true;
      }
  }
  uint32_t best = 0;
  for (uint32_t b = 1; b < count && good; ++b) {
    const group *g = &groups[b], *top = &groups[best];
    if (of[b] != b || g->bodies < top->bodies) continue;
    bool wider = g->fixed == top->fixed ? width_of(g) > width_of(top) : g->fixed;
    if (g->bodies > top->bodies || wider) best = b;
  }
  for (uint32_t b = 0; b < count && good; ++b) f->seen[b] = of[b] == best;
  free(groups);
  free(of);
  return good;
}

// Seen from above and the side; up is against gravity, or z without any.
static painter_camera look(const figure *f) {
  assert(f->vertex && sonde_scene_body_count(f->scene) > 0);
  const double AROUND = 0.55, ABOVE = 0.42; // rad
  sonde_vec3 up = sonde_scene_gravity(f->scene);
  double size = norm(up);
  up = size > 0 ? (sonde_vec3){-up.x / size, -up.y / size, -up.z / size} : (sonde_vec3){0, 0, 1};
  sonde_vec3 aside = fabs(up.x) < 0.9 ? (sonde_vec3){1, 0, 0} : (sonde_vec3){0, 0, 1};
  // A camera against the direction that has no part along `up` has its axes level and upright.
  painter_camera level = painter_look(aside, up, (sonde_vec3){0, 0, 0}, INFINITY);
  double part[3] = {cos(ABOVE) * sin(AROUND), cos(ABOVE) * cos(AROUND), sin(ABOVE)};
  double along = dot(aside, up), across = sqrt(1 - along * along);
  sonde_vec3 side = {(aside.x - along * up.x) / across, (aside.y - along * up.y) / across,
                     (aside.z - along * up.z) / across};
  sonde_vec3 front = {-level.right.x, -level.right.y, -level.right.z};
  sonde_vec3 toward = {part[0] * side.x + part[1] * front.x + part[2] * up.x,
                       part[0] * side.y + part[1] * front.y + part[2] * up.y,
                       part[0] * side.z + part[1] * front.z + part[2] * up.z};
  return painter_look(toward, up, (sonde_vec3){0, 0, 0}, INFINITY);
}

static uint32_t colour_of(uint32_t body) {
  static const uint32_t BASE[] = {0xd6c4a8, 0xd66a54, 0x5c8abe, 0x808086, 0x70a86e, 0xba8cbe};
  return BASE[body % (sizeof BASE / sizeof *BASE)];
}

// ---- report -------------------------------------------------------------------------------------

static void put(sonde_json_out *out, const char *key, double value) {
  sonde_json_put_real(out, key, value, DIGITS);
}

static sonde_status write_report(const figure *f, const sonde_scene_state *state, const char *path,
                                 sonde_error *error) {
  sonde_json_out out = {0};
  sonde_status status = sonde_file_in_memory(&out.file, error);
  if (status) return status;
  sonde_json_begin_object(&out, NULL);
  sonde_json_put_text(&out, "kind", "scene");
  sonde_json_put_text(&out, "title", sonde_scene_title(f->scene));
  sonde_json_put_text(&out, "version", sonde_version());
  put(&out, "time_s", sonde_scene_time(state));
  sonde_json_put_integer(&out, "steps", (int64_t)sonde_scene_tick(state));
  sonde_json_put_integer(&out, "flagged_steps", (int64_t)sonde_scene_flag_count(state));
  sonde_vec3 gravity = sonde_scene_gravity(f->scene);
  sonde_json_begin_list(&out, "gravity_m_s2");
  put(&out, NULL, gravity.x), put(&out, NULL, gravity.y), put(&out, NULL, gravity.z);
  sonde_json_end(&out);
  static const char *const KIND[] = {"rigid", "surface", "lattice", "thigh"};
  sonde_json_begin_list(&out, "bodies");
  for (uint32_t b = 0; b < sonde_scene_body_count(f->scene); ++b) {
    sonde_body_info body = sonde_scene_body(f->scene, b);
    sonde_body_measure m = sonde_scene_measure(state, b);
    sonde_json_begin_object(&out, NULL);
    sonde_json_put_text(&out, "name", body.name);
    sonde_json_put_text(&out, "kind", KIND[body.kind]);
    sonde_json_put_integer(&out, "nodes", body.node_count);
    sonde_json_put_bool(&out, "seen", f->seen[b]);
    put(&out, "mass_kg", body.mass.mass_kg);
    sonde_json_begin_list(&out, "centre_mm");
    put(&out, NULL, 1e3 * m.centre_m.x), put(&out, NULL, 1e3 * m.centre_m.y);
    put(&out, NULL, 1e3 * m.centre_m.z);
    sonde_json_end(&out);
    put(&out, "speed_mm_s", 1e3 * norm(m.velocity_m_s));
    put(&out, "kinetic_mj", 1e3 * m.kinetic_j);
    put(&out, "elastic_mj", 1e3 * m.elastic_j);
    sonde_json_begin_list(&out, "position_mm");
    for (uint32_t i = 0; i < body.surface->vertex_count; ++i) {
      const sonde_vec3 p = f->vertex[b][i];
      sonde_json_put_real(&out, NULL, 1e3 * p.x, PLACES);
      sonde_json_put_real(&out, NULL, 1e3 * p.y, PLACES);
      sonde_json_put_real(&out, NULL, 1e3 * p.z, PLACES);
    }
    sonde_json_end(&out);
    sonde_json_begin_list(&out, "face");
    for (uint32_t i = 0; i < body.surface->face_count; ++i)
      for (int k = 0; k < 3; ++k) sonde_json_put_integer(&out, NULL, body.surface->faces[i][k]);
    sonde_json_end(&out);
    sonde_json_end(&out);
  }
  sonde_json_end(&out);
  sonde_json_begin_list(&out, "contacts");
  for (uint32_t k = 0; k < sonde_scene_pair_count(f->scene); ++k) {
    sonde_scene_pair pair = sonde_scene_pair_at(f->scene, k);
    sonde_pair_measure m = sonde_scene_pair_measure(state, k);
    sonde_json_begin_object(&out, NULL);
    sonde_json_put_text(&out, "a", sonde_scene_body(f->scene, pair.a).name);
    sonde_json_put_text(&out, "b", sonde_scene_body(f->scene, pair.b).name);
    put(&out, "normal_n", m.normal_n);
    put(&out, "friction_n", norm(m.friction_n));
    put(&out, "depth_mm", 1e3 * m.depth_m);
    put(&out, "area_mm2", 1e6 * m.area_m2);
    put(&out, "volume_mm3", 1e9 * m.volume_m3);
    put(&out, "energy_mj", 1e3 * m.energy_j);
    sonde_json_end(&out);
  }
  sonde_json_end(&out);
  sonde_json_end(&out);
  char *json = NULL;
  size_t length = 0;
  status = sonde_file_take(out.file, &json, &length, error);
  if (!status) status = sonde_report_write(path, sonde_scene_title(f->scene), json, length, error);
  sonde_free(json);
  return status;
}

// Names in the colours of the bodies, in as many rows as they need below the top, and the time at
// the end of the first row; returns where the rows end. Without a file it only measures.
static double write_legend(const figure *f, double time_s, double top, sonde_file *file) {
  char words[96];
  double x = MARGIN, y = top, most = WIDTH - MARGIN - 80;
  for (uint32_t b = 0; b < sonde_scene_body_count(f->scene); ++b) {
    snprintf(words, sizeof words, "%s%s", sonde_scene_body(f->scene, b).name,
             f->seen[b] ? "" : " (out of view)");
    double width = 34 + LETTER_PX * (double)strlen(words);
    if (x > MARGIN && x + width > most) x = MARGIN, y += ROW, most = WIDTH - MARGIN;
    if (file) {
      char fill[64];
      const double box[4][2] = {{x, y - 10}, {x + 11, y - 10}, {x + 11, y + 1}, {x, y + 1}};
      snprintf(fill, sizeof fill, "fill='#%06x'", colour_of(b));
      sonde_svg_put_outlines(file, box, 4, 4, fill);
      sonde_svg_put_text(file, x + 16, y, "", words);
    }
    x += width;
  }
  snprintf(words, sizeof words, "t = %.3f s", time_s);
  if (file) sonde_svg_put_text(file, WIDTH - MARGIN, top, "class='end'", words);
  return y;
}

static sonde_status draw(const figure *f, const sonde_scene_state *state, const char *path,
                         sonde_error *error) {
  // The vertices of the bodies in view lie in the drawing's width and height.
  uint32_t bodies = sonde_scene_body_count(f->scene), total = 0, used = 0;
  for (uint32_t b = 0; b < bodies; ++b)
    total += sonde_scene_body(f->scene, b).surface->vertex_count;
  sonde_vec3 *all = malloc(total * sizeof *all);
  painter *brush = NULL;
  sonde_file *file = NULL;
  sonde_status status = all ? SONDE_OK : (error->status = SONDE_MEMORY);
  painter_camera camera = look(f);
  for (uint32_t b = 0; b < bodies && !status; ++b) {
    if (!f->seen[b]) continue;
    uint32_t count = sonde_scene_body(f->scene, b).surface->vertex_count;
    memcpy(all + used, f->vertex[b], count * sizeof *all);
    used += count;
  }
  double lowest = 0;
  if (!status) {
    painter_fit(&camera, all, used, (painter_box){MARGIN, MARGIN, WIDTH - 2 * MARGIN, TALLEST});
    double highest = INFINITY, xy[2];
    for (uint32_t i = 0; i < used; ++i) {
      painter_project(&camera, all[i], xy);
      highest = fmin(highest, xy[1]), lowest = fmax(lowest, xy[1]);
    }
    camera.top += MARGIN - highest, lowest += MARGIN - highest; // nothing above the bodies
    status = painter_create(&camera, &brush, error);
  }
  for (uint32_t b = 0; b < bodies && !status; ++b) {
    const sonde_mesh *mesh = sonde_scene_body(f->scene, b).surface;
    for (uint32_t i = 0; f->seen[b] && i < mesh->face_count; ++i) {
      const uint32_t *v = mesh->faces[i];
      const sonde_vec3 corner[3] = {f->vertex[b][v[0]], f->vertex[b][v[1]], f->vertex[b][v[2]]};
      painter_lit_face(brush, corner, colour_of(b), 1);
    }
  }

  if (!status) status = sonde_file_create(path, &file, error);
  if (!status) {
    double time_s = sonde_scene_time(state), top = lowest + MARGIN + LEGEND - 12;
    double end = write_legend(f, time_s, top, NULL);
    sonde_svg_begin(file, sonde_scene_title(f->scene), WIDTH, end + MARGIN);
    status = painter_paint(brush, file, error);
    write_legend(f, time_s, top, file);
    if (status)
      sonde_file_discard(file);
    else
      status = sonde_svg_end(file, error);
  }
  painter_destroy(brush);
  free(all);
  return status;
}

sonde_status scene_figure(const sonde_scene *scene, const sonde_scene_state *state,
                          const char *path, sonde_error *error) {
  uint32_t bodies = sonde_scene_body_count(scene);
  const char *ending = strrchr(path, '.');
  figure f = {.scene = scene,
              .vertex = calloc(bodies, sizeof *f.vertex),
              .seen = calloc(bodies, sizeof *f.seen)};
  bool good = f.vertex != NULL && f.seen != NULL;
  for (uint32_t b = 0; b < bodies && good; ++b) {
    f.vertex[b] = calloc(sonde_scene_body(scene, b).surface->vertex_count, sizeof **f.vertex);
    good = f.vertex[b] != NULL;
    if (good) sonde_scene_surface(state, b, f.vertex[b]);
  }
  good = good && choose_seen(&f);
  sonde_status status = SONDE_MEMORY;
  if (good)
    status = ending && strcmp(ending, ".html") == 0 ? write_report(&f, state, path, error)
                                                    : draw(&f, state, path, error);
  for (uint32_t b = 0; f.vertex && b < bodies; ++b) free(f.vertex[b]);
  free(f.vertex);
  free(f.seen);
  return status;
}
