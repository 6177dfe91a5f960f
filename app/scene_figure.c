// The bodies of a scene as they stand: an SVG drawing, or a report as HTML with measures and
// surfaces that turn.
//
// In the drawing faces turned to the viewer are cut into small pieces and painted from back to
// front in thin layers of depth; pieces of one body, shade and layer are one path.
#include "scene_figure.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
  WIDTH = 520,
  TALLEST = 460,
  MARGIN = 12,
  LEGEND = 26,
  ROW = 18,
  LAYERS = 240,
  SHADES = 48,
  DEEPEST = 12
};
enum { PIECES_MOST = 400000, DIGITS = 9, PLACES = 6 };
static const double PIECE_PX = 22; // longest edge of a piece
static const double LETTER_PX = 7.5;
static const double FAR = 2; // widths of a group beyond which a body is out of its view

// A parallel projection: axes of the view, pixels per metre, pixels of the origin, range of depth.
typedef struct camera {
  sonde_vec3 right, up, toward;
  double scale, left, top, least_m, most_m;
} camera;

typedef struct piece {
  double xy[3][2];
  uint32_t layer, body, shade;
} piece;

typedef struct figure {
  const sonde_scene *scene;
  camera camera;
  sonde_vec3 **vertex; // [bodies] of the surface, m
  bool *seen;          // [bodies] in the view
  piece *pieces;
  uint32_t count;
} figure;

static sonde_vec3 madd(sonde_vec3 a, double s, sonde_vec3 b) {
  return (sonde_vec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}
static double dot(sonde_vec3 a, sonde_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static sonde_vec3 cross(sonde_vec3 a, sonde_vec3 b) {
  return (sonde_vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static sonde_vec3 unit(sonde_vec3 a) {
  double size = sqrt(dot(a, a));
  return madd((sonde_vec3){0, 0, 0}, size > 0 ? 1 / size : 0, a);
}

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

static bool are_near(const group *a, const group *b) {
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    double gap = fmax(0, fmax(a->low[k] - b->high[k], b->low[k] - a->high[k]));
    sum += gap * gap;
  }
  return sqrt(sum) <= FAR * fmax(width_of(a), width_of(b));
}

static group join(const group *a, const group *b) {
  group g = {.bodies = a->bodies + b->bodies, .fixed = a->fixed || b->fixed};
  for (int k = 0; k < 3; ++k)
    g.low[k] = fmin(a->low[k], b->low[k]), g.high[k] = fmax(a->high[k], b->high[k]);
  return g;
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
        if (of[a] != a || of[b] != b || !are_near(&groups[a], &groups[b])) continue;
        groups[a] = join(&groups[a], &groups[b]);
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
static camera look(const figure *f) {
  assert(f->vertex && sonde_scene_body_count(f->scene) > 0);
  const double AROUND = 0.55, ABOVE = 0.42; // rad
  const sonde_vec3 none = {0, 0, 0};
  sonde_vec3 up = madd(none, -1, sonde_scene_gravity(f->scene));
  if (!(dot(up, up) > 0)) up = (sonde_vec3){0, 0, 1};
  up = unit(up);
  sonde_vec3 side = fabs(up.x) < 0.9 ? (sonde_vec3){1, 0, 0} : (sonde_vec3){0, 0, 1};
  side = unit(madd(side, -dot(side, up), up));
  sonde_vec3 level = madd(madd(none, cos(AROUND), cross(side, up)), sin(AROUND), side);
  camera c = {.toward = madd(madd(none, cos(ABOVE), level), sin(ABOVE), up)};
  c.right = unit(cross(up, c.toward));
  c.up = cross(c.toward, c.right);

  // Scale and origin such that the chosen bodies are seen.
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (uint32_t b = 0; b < sonde_scene_body_count(f->scene); ++b)
    for (uint32_t i = 0; f->seen[b] && i < sonde_scene_body(f->scene, b).surface->vertex_count;
         ++i) {
      sonde_vec3 p = f->vertex[b][i];
      const double at[3] = {dot(p, c.right), dot(p, c.up), dot(p, c.toward)};
      for (int k = 0; k < 3; ++k) low[k] = fmin(low[k], at[k]), high[k] = fmax(high[k], at[k]);
    }
  double across = fmax(high[0] - low[0], 1e-9), tall = fmax(high[1] - low[1], 1e-9);
  c.scale = fmin((WIDTH - 2 * MARGIN) / across, TALLEST / tall);
  c.left = 0.5 * (WIDTH - c.scale * (low[0] + high[0]));
  c.top = MARGIN + c.scale * high[1];
  c.least_m = low[2], c.most_m = fmax(high[2], low[2] + 1e-9);
  return c;
}

// Pieces of a face, by halving its longest edge.
static void cut_face(figure *f, const sonde_vec3 p[3], uint32_t body, uint32_t shade, int depth) {
  assert(f->pieces && shade < SHADES && depth <= DEEPEST);
  const camera *c = &f->camera;
  int longest = 0;
  double most = 0;
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 edge = madd(p[(k + 1) % 3], -1, p[k]);
    if (dot(edge, edge) > most) most = dot(edge, edge), longest = k;
  }
  if (sqrt(most) * c->scale >= PIECE_PX && depth < DEEPEST) {
    sonde_vec3 a = p[longest], b = p[(longest + 1) % 3], other = p[(longest + 2) % 3];
    sonde_vec3 middle = madd(a, 0.5, madd(b, -1, a));
    cut_face(f, (const sonde_vec3[3]){a, middle, other}, body, shade, depth + 1);
    cut_face(f, (const sonde_vec3[3]){middle, b, other}, body, shade, depth + 1);
    return;
  }
  if (f->count == PIECES_MOST) return;
  piece *out = &f->pieces[f->count++];
  double depth_m = 0;
  for (int k = 0; k < 3; ++k) {
    out->xy[k][0] = c->left + c->scale * dot(p[k], c->right);
    out->xy[k][1] = c->top - c->scale * dot(p[k], c->up);
    depth_m += dot(p[k], c->toward) / 3;
  }
  double share = (depth_m - c->least_m) / (c->most_m - c->least_m);
  out->layer = (uint32_t)fmin(share * LAYERS, LAYERS - 1);
  out->body = body, out->shade = shade;
}

static int compare_pieces(const void *a, const void *b) {
  const piece *x = a, *y = b;
  if (x->layer != y->layer) return x->layer < y->layer ? -1 : 1;
  if (x->body != y->body) return x->body < y->body ? -1 : 1;
  return (x->shade > y->shade) - (x->shade < y->shade);
}

static void format_look(char look[64], const char *format, uint32_t body, uint32_t shade) {
  static const uint8_t BASE[][3] = {{214, 196, 168}, {214, 106, 84},  {92, 138, 190},
                                    {128, 128, 134}, {112, 168, 110}, {186, 140, 190}};
  assert(shade < SHADES);
  const uint8_t *base = BASE[body % (sizeof BASE / sizeof *BASE)];
  double light = 0.5 + 0.58 * shade / (SHADES - 1);
  unsigned rgb = 0;
  for (int k = 0; k < 3; ++k) rgb = rgb << 8 | (unsigned)fmin(base[k] * light, 255);
  snprintf(look, 64, format, rgb, rgb);
}

// ---- report -------------------------------------------------------------------------------------

static void put(sonde_json_out *out, const char *key, double value) {
  sonde_json_put_real(out, key, value, DIGITS);
}

static double norm(sonde_vec3 v) { return sqrt(dot(v, v)); }

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
      format_look(fill, "fill='#%06x'", b, SHADES - 2);
      sonde_svg_put_outlines(file, box, 4, 4, fill);
      sonde_svg_put_text(file, x + 16, y, "", words);
    }
    x += width;
  }
  snprintf(words, sizeof words, "t = %.3f s", time_s);
  if (file) sonde_svg_put_text(file, WIDTH - MARGIN, top, "class='end'", words);
  return y;
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
  if (good && ending && strcmp(ending, ".html") == 0) {
    status = write_report(&f, state, path, error);
  } else if (good && (f.pieces = malloc(PIECES_MOST * sizeof *f.pieces))) {
    f.camera = look(&f);
    // Light from above the viewer's left shoulder.
    const camera *c = &f.camera;
    sonde_vec3 light = unit(madd(madd(c->toward, 1.1, c->up), -0.5, c->right));
    double lowest = 0;
    for (uint32_t b = 0; b < sonde_scene_body_count(f.scene); ++b) {
      const sonde_mesh *mesh = sonde_scene_body(f.scene, b).surface;
      if (!f.seen[b]) continue;
      for (uint32_t i = 0; i < mesh->vertex_count; ++i)
        lowest = fmax(lowest, c->top - c->scale * dot(f.vertex[b][i], c->up));
      for (uint32_t i = 0; i < mesh->face_count; ++i) {
        const uint32_t *v = mesh->faces[i];
        const sonde_vec3 p[3] = {f.vertex[b][v[0]], f.vertex[b][v[1]], f.vertex[b][v[2]]};
        sonde_vec3 normal = unit(cross(madd(p[1], -1, p[0]), madd(p[2], -1, p[0])));
        if (!(dot(normal, c->toward) > 0)) continue;
        double lit = fmax(dot(normal, light), 0);
        cut_face(&f, p, b, (uint32_t)fmin(lit * SHADES, SHADES - 1), 0);
      }
    }
    qsort(f.pieces, f.count, sizeof *f.pieces, compare_pieces);

    sonde_file *file = NULL;
    double(*xy)[2] = malloc(3 * ((size_t)f.count + 1) * sizeof *xy);
    status = xy ? sonde_file_create(path, &file, error) : SONDE_MEMORY;
    if (!status) {
      char words[64];
      double time_s = sonde_scene_time(state), top = lowest + MARGIN + LEGEND - 12;
      double end = write_legend(&f, time_s, top, NULL);
      sonde_svg_begin(file, sonde_scene_title(f.scene), WIDTH, end + MARGIN);
      for (uint32_t i = 0; i < f.count;) {
        const piece *first = &f.pieces[i];
        uint32_t corners = 0;
        for (; i < f.count && compare_pieces(first, &f.pieces[i]) == 0; ++i, corners += 3)
          memcpy(xy[corners], f.pieces[i].xy, sizeof f.pieces[i].xy);
        format_look(words, "fill='#%06x' stroke='#%06x' stroke-width='.6'", first->body,
                    first->shade);
        sonde_svg_put_outlines(file, (const double(*)[2])xy, corners, 3, words);
      }
      write_legend(&f, time_s, top, file);
      status = sonde_svg_end(file, error);
    }
    free(xy);
  }
  for (uint32_t b = 0; f.vertex && b < bodies; ++b) free(f.vertex[b]);
  free(f.vertex);
  free(f.seen);
  free(f.pieces);
  return status;
}
