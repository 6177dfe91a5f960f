// look_from:    the direction of view: along the mean normal of the sites, their v axis downwards.
// fit_in:       scale and place of the skin within the drawing.
// front_faces:  faces turned to the viewer with their colour, by depth.
// draw_faces:   in layers from back to front, one path per colour and layer.
// draw_sites:   dots and as many labels as have room.
// range_of:     of the values that are seen.
// site_correlation: of fat thickness with the sites' parameters.
// *_map:        the maps of the page.
#include "report/view.h"

#include "base/maths.h"

#include <string.h>

enum { LEVELS = 28, SHADES = 10, LAYERS = 12, GREY = LEVELS };
static const double WIDTH = 430, LEFT = 10, TOP = 16, INSIDE = 320, TALL = 560, BELOW = 34;

typedef struct camera {
  sonde_vec3 right, up, toward; // orthonormal
  double scale, x, y;           // pixels per metre, place of the origin
  double height;                // of the drawing
} camera;

typedef struct front_face {
  uint32_t face;
  double away_m; // along `toward`; larger is nearer
  uint16_t layer, level, shade;
} front_face;

static camera look_from(const sonde_report_view *view) {
  sonde_vec3 normal = {0, 0, 0}, along = {0, 0, 0};
  for (uint32_t i = 0; i < view->site_count; ++i) {
    if (v_finite(view->sites[i].normal)) normal = v_add(normal, view->sites[i].normal);
    if (v_finite(view->sites[i].along)) along = v_add(along, view->sites[i].along);
  }
  camera c = {.toward = v_unit(normal, vec3(0, 1, 0))};
  sonde_vec3 down = v_norm(along) > 0.1 ? along : vec3(0, 0, 1);
  down = v_madd(down, -v_dot(down, c.toward), c.toward);
  if (v_norm(down) < 1e-6) down = v_cross(c.toward, vec3(1, 0, 0));
  c.up = v_neg(v_unit(down, vec3(1, 0, 0)));
  c.right = v_cross(c.up, c.toward);
  SONDE_ASSERT(v_finite(c.right));
  return c;
}

static double project_x(const camera *c, sonde_vec3 p) {
  return c->x + c->scale * v_dot(p, c->right);
}
static double project_y(const camera *c, sonde_vec3 p) { return c->y - c->scale * v_dot(p, c->up); }

static bool fit_in(const sonde_mesh *skin, camera *c) {
  double least[2] = {INFINITY, INFINITY}, most[2] = {-INFINITY, -INFINITY};
  for (uint32_t i = 0; i < skin->vertex_count; ++i) {
    if (!v_finite(skin->vertices[i])) return false;
    const double at[2] = {v_dot(skin->vertices[i], c->right), v_dot(skin->vertices[i], c->up)};
    for (int k = 0; k < 2; ++k) least[k] = fmin(least[k], at[k]), most[k] = fmax(most[k], at[k]);
  }
  double across = most[0] - least[0], tall = most[1] - least[1];
  if (!(across > 0) || !(tall > 0) || !(across < 1e6) || !(tall < 1e6)) return false;
  c->scale = fmin(INSIDE / across, TALL / tall);
  c->x = LEFT + 0.5 * INSIDE - c->scale * 0.5 * (least[0] + most[0]);
  c->y = TOP + c->scale * most[1];
  c->height = TOP + fmax(c->scale * tall, 320) + BELOW;
  return true;
}

static sonde_vec3 face_normal(const sonde_mesh *skin, uint32_t f) {
  const uint32_t *v = skin->faces[f];
  sonde_vec3 a = skin->vertices[v[0]];
  sonde_vec3 n = v_cross(v_sub(skin->vertices[v[1]], a), v_sub(skin->vertices[v[2]], a));
  return v_unit(n, vec3(0, 0, 0));
}

static double face_value(const sonde_mesh *skin, const double *values, uint32_t f) {
  const uint32_t *v = skin->faces[f];
  return (values[v[0]] + values[v[1]] + values[v[2]]) / 3;
}

static int back_to_front(const void *a, const void *b) {
  const front_face *x = a, *y = b;
  if (x->layer != y->layer) return x->layer < y->layer ? -1 : 1;
  if (x->level != y->level) return x->level < y->level ? -1 : 1;
  if (x->shade != y->shade) return x->shade < y->shade ? -1 : 1;
  return (x->face > y->face) - (x->face < y->face);
}

// Layers are thin slices of depth: within one nothing hides anything else by more than the slice.
static void layer_faces(front_face *faces, uint32_t count) {
  double least = INFINITY, most = -INFINITY;
  for (uint32_t i = 0; i < count; ++i) {
    least = fmin(least, faces[i].away_m);
    most = fmax(most, faces[i].away_m);
  }
  for (uint32_t i = 0; i < count; ++i) {
    double t = most > least ? (faces[i].away_m - least) / (most - least) : 0;
    faces[i].layer = (uint16_t)fmin(t * LAYERS, LAYERS - 1);
  }
  qsort(faces, count, sizeof *faces, back_to_front);
}

static uint32_t front_faces(const sonde_mesh *skin, const camera *c, const double *values,
                            const sonde_axis *range, front_face *out) {
  uint32_t count = 0;
  for (uint32_t f = 0; f < skin->face_count; ++f) {
    double facing = v_dot(face_normal(skin, f), c->toward);
    double value = values ? face_value(skin, values, f) : 0;
    if (!(facing > 0) || !isfinite(value)) continue;
    const uint32_t *v = skin->faces[f];
    sonde_vec3 middle =
        v_add(v_add(skin->vertices[v[0]], skin->vertices[v[1]]), skin->vertices[v[2]]);
    double t = values ? clamp((value - range->low) / (range->high - range->low), 0, 1) : 0;
    out[count++] = (front_face){.face = f,
                                .away_m = v_dot(middle, c->toward) / 3,
                                .level = (uint16_t)(values ? fmin(t * LEVELS, LEVELS - 1) : GREY),
                                .shade = (uint16_t)fmin(facing * SHADES, SHADES - 1)};
  }
  SONDE_ASSERT(count <= skin->face_count);
  layer_faces(out, count);
  return count;
}

// Light from the viewer: at most an eighth darker where the skin turns away.
static sonde_colour face_colour(const front_face *face) {
  SONDE_ASSERT(face->shade < SHADES && face->level <= GREY);
  double shade = 0.875 + 0.125 * face->shade / (SHADES - 1);
  if (face->level != GREY) return sonde_colour_sequential((face->level + 0.5) / LEVELS, shade);
  sonde_colour grey;
  unsigned value = (unsigned)(232 * shade);
  snprintf(grey.s, sizeof grey.s, "#%02x%02x%02x", value & 0xffu, value & 0xffu, value & 0xffu);
  return grey;
}

static void draw_faces(sonde_text *out, const sonde_mesh *skin, const camera *c,
                       const front_face *faces, uint32_t count) {
  for (uint32_t i = 0; i < count;) {
    const front_face *first = &faces[i];
    char look[80];
    sonde_colour colour = face_colour(first);
    snprintf(look, sizeof look, "fill='%s' stroke='%s'", colour.s, colour.s);
    sonde_path path = sonde_path_begin(out, look);
    for (; i < count && faces[i].layer == first->layer && faces[i].level == first->level &&
           faces[i].shade == first->shade;
         ++i) {
      for (int k = 0; k < 3; ++k) {
        sonde_vec3 p = skin->vertices[skin->faces[faces[i].face][k]];
        if (k == 0)
          sonde_path_move(&path, project_x(c, p), project_y(c, p));
        else
          sonde_path_draw(&path, project_x(c, p), project_y(c, p));
      }
      sonde_path_close(&path);
    }
    sonde_path_end(&path);
  }
}

// ---- sites --------------------------------------------------------------------------------------

static bool is_seen(const sonde_report_place *site, const camera *c) {
  return v_finite(site->position_m) && v_dot(site->normal, c->toward) > 0.15;
}

static void draw_labels(sonde_text *out, const sonde_report_view *view, const camera *c,
                        double *taken) {
  uint32_t used = 0;
  for (uint32_t i = 0; i < view->site_count; ++i) {
    const sonde_report_place *s = &view->sites[i];
    if (!is_seen(s, c)) continue;
    double x = project_x(c, s->position_m), y = project_y(c, s->position_m) - 7;
    bool free_place = true;
    for (uint32_t k = 0; k < used; ++k)
      if (fabs(taken[2 * k] - x) < 14 && fabs(taken[2 * k + 1] - y) < 10) free_place = false;
    if (!free_place) continue;
    char name[16];
    snprintf(name, sizeof name, "%u", s->id);
    sonde_svg_text(out, x, y, "class='small middle halo'", name);
    taken[2 * used] = x;
    taken[2 * used++ + 1] = y;
  }
}

// Dots: white, or coloured by a value per site where there is one.
static void draw_sites(sonde_report_view *view, sonde_text *out, const camera *c,
                       const double *site_values, const sonde_axis *range) {
  double *taken = SONDE_NEW(double, 2 * (size_t)view->site_count);
  view->memory = view->memory || !taken;
  if (!taken) return;
  for (uint32_t i = 0; i < view->site_count; ++i) {
    const sonde_report_place *s = &view->sites[i];
    if (!is_seen(s, c) || (site_values && !isfinite(site_values[i]))) continue;
    char look[80];
    double t = site_values ? (site_values[i] - range->low) / (range->high - range->low) : 0;
    snprintf(look, sizeof look, "fill='%s' stroke='#333' stroke-width='.8'",
             site_values ? sonde_colour_sequential(t, 1).s : "#fff");
    sonde_svg_circle(out, project_x(c, s->position_m), project_y(c, s->position_m),
                     site_values ? 6.5 : 2.4, look);
  }
  draw_labels(out, view, c, taken);
  sonde_free(taken);
}

static void draw_scale(sonde_text *out, const camera *c) {
  SONDE_ASSERT(c->scale > 0);
  double length_m = sonde_nice_step(40 / c->scale), x = LEFT, y = c->height - 12;
  double end = x + length_m * c->scale;
  char label[64];
  snprintf(label, sizeof label, "%s mm", sonde_short(1e3 * length_m).s);
  sonde_svg_line(out, x, y, end, y, "class='axis'");
  sonde_svg_line(out, x, y - 4, x, y + 4, "class='axis'");
  sonde_svg_line(out, end, y - 4, end, y + 4, "class='axis'");
  sonde_svg_text(out, end + 8, y + 4, "class='tick'", label);
}

// ---- maps ---------------------------------------------------------------------------------------

// Of the nodes that face the viewer: the cut ends of the leg, seen on edge, must not set the
// colours.
static sonde_axis range_of(const sonde_model *model, const camera *c, const double *values,
                           double *scratch) {
  uint32_t used = 0;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i)
    if (isfinite(values[i]) && v_dot(model->normal[i], c->toward) > 0.5)
      scratch[used++] = values[i];
  if (!used) return sonde_axis_tight(0, 1, 6);
  qsort(scratch, used, sizeof *scratch, sonde_compare_reals);
  return sonde_axis_tight(sonde_percentile(scratch, used, 0.01),
                          sonde_percentile(scratch, used, 0.99), 6);
}

// What one map shows: values per node or per site, in the unit of the key.
typedef struct map {
  const char *name, *title, *key, *caption;
  const double *node_values, *site_values;
  sonde_axis range;
} map;

static void draw_map(sonde_report_view *view, const map *m) {
  const sonde_mesh *skin = &view->in->model->surface;
  camera c = look_from(view);
  front_face *faces = SONDE_NEW(front_face, skin->face_count);
  view->memory = view->memory || !faces;
  if (!faces || !fit_in(skin, &c)) {
    sonde_free(faces);
    return;
  }
  sonde_figure *figure = sonde_figure_begin(view, m->name, m->title, WIDTH, c.height);
  uint32_t count = front_faces(skin, &c, m->node_values, &m->range, faces);
  // Strokes of the faces' own colour close the seams between them.
  sonde_text_put(&figure->body, "<g stroke-width='.5' stroke-linejoin='round'>\n");
  draw_faces(&figure->body, skin, &c, faces, count);
  sonde_text_put(&figure->body, "</g>\n");
  draw_sites(view, &figure->body, &c, m->site_values, &m->range);
  draw_scale(&figure->body, &c);
  sonde_colour_key(&figure->body, LEFT + INSIDE + 34, TOP + 30, 240, &m->range, m->key);
  sonde_figure_place(view, figure, m->caption);
  sonde_free(faces);
}

static void field_map(sonde_report_view *view, const double *field, double factor, map m) {
  uint32_t nodes = view->in->model->surface.vertex_count;
  double *values = SONDE_NEW(double, nodes), *scratch = SONDE_NEW(double, nodes);
  if (values && scratch) {
    for (uint32_t i = 0; i < nodes; ++i) values[i] = factor * field[i];
    m.node_values = values;
    camera c = look_from(view);
    m.range = range_of(view->in->model, &c, values, scratch);
    draw_map(view, &m);
  } else {
    view->memory = true;
  }
  sonde_free(values);
  sonde_free(scratch);
}

static void error_map(sonde_report_view *view) {
  double *values = SONDE_NEW(double, view->site_count);
  view->memory = view->memory || !values;
  double most = 0;
  for (uint32_t s = 0; values && s < view->site_count; ++s) {
    sonde_report_group g;
    sonde_report_pick pick = {SONDE_ALL, s, SONDE_ALL};
    bool any = sonde_view_group(view, view->main->model_n, pick, &g);
    values[s] = any ? g.errors.mae_percent : NAN;
    if (isfinite(values[s])) most = fmax(most, values[s]);
  }
  map m = {"map-error",
           "Error by site",
           "MAE, %",
           "MAE of each site over its mean measured force, all probes and depths. Where light "
           "sites lie side by side, the model falls short of that part of the thigh.",
           NULL,
           values,
           sonde_axis_make(0, most, 5)};
  if (values && most > 0) draw_map(view, &m);
  sonde_free(values);
}

// Pearson's correlation over the sites where both are known; NaN for fewer than 8.
static double site_correlation(const sonde_report_view *view, bool xm) {
  double n = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0;
  for (uint32_t i = 0; i < view->site_count; ++i) {
    const sonde_site *site = sonde_model_site(view->in->model, view->sites[i].id);
    if (!site || !isfinite(view->sites[i].fat_m)) continue;
    double a = view->sites[i].fat_m, b = xm ? site->xm_m : site->k0_n_m3;
    ++n, x += a, y += b, xx += a * a, yy += b * b, xy += a * b;
  }
  double spread = (n * xx - x * x) * (n * yy - y * y);
  return n >= 8 && spread > 0 ? (n * xy - x * y) / sqrt(spread) : NAN;
}

static void depth_map(sonde_report_view *view) {
  sonde_text caption = {0};
  double k0 = site_correlation(view, false), xm = site_correlation(view, true);
  sonde_text_put(&caption, "Distance from the skin to the muscle: skin and fat together.");
  if (isfinite(k0) && isfinite(xm))
    sonde_text_format(&caption,
                      " Over the sites the thickness of the fat correlates with k\u2080 by %s and "
                      "with x\u2098 by %s.",
                      sonde_fixed_signed(k0, 2).s, sonde_fixed_signed(xm, 2).s);
  field_map(view, view->in->model->muscle_depth_m, 1e3,
            (map){.name = "map-depth",
                  .title = "Depth of the muscle",
                  .key = "depth, mm",
                  .caption = caption.bytes ? caption.bytes : ""});
  view->memory = view->memory || caption.failed;
  sonde_text_clear(&caption);
}

// Whether the shear layer differs from place to place.
static bool varies(const sonde_model *model) {
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i)
    if (fabs(model->shear_share[i] - 1) > 1e-6) return true;
  return false;
}

void sonde_report_maps(sonde_report_view *view) {
  const sonde_model *model = view->in->model;
  if (!model || !model->surface.face_count || !model->normal || !model->k0_n_m3 || !model->xm_m)
    return;
  sonde_page_section(view, "maps", "Maps of the thigh");
  sonde_page_paragraph(view,
                       "The skin seen along the mean normal of the sites, without perspective; "
                       "the footprint axis v points down. Numbers are sites. Between them "
                       "values are interpolated, beyond them extrapolated: there the colours "
                       "are an assumption. Colours span the middle 98\u00a0% of what faces the "
                       "viewer.");
  sonde_figures_side_by_side(view, true);
  field_map(view, model->k0_n_m3, 1e-6,
            (map){.name = "map-k0",
                  .title = "Initial stiffness k\u2080 of the normal springs",
                  .key = "k\u2080, kPa/mm",
                  .caption = "Pressure per depth at the first touch: light is stiff."});
  field_map(view, model->xm_m, 1e3,
            (map){.name = "map-xm",
                  .title = "Greatest compression x\u2098 of the normal springs",
                  .key = "x\u2098, mm",
                  .caption = "The depth at which the springs would become rigid: dark is where "
                             "little can be compressed."});
  if (model->shear_share && varies(model)) {
    field_map(view, model->shear_share, model->law.shear_stiffness_n_m,
              (map){.name = "map-shear",
                    .title = "Stiffness G of the shear layer",
                    .key = "G, N/m",
                    .caption = "How strongly the skin pulls its surroundings along: light is "
                               "strongly."});
    field_map(view, model->limit_share, model->law.shear_limit,
              (map){.name = "map-limit",
                    .title = "Limit g\u2098 of the shear layer",
                    .key = "g\u2098",
                    .caption = "The slope of the skin at which the layer would become rigid."});
  }
  if (model->muscle_depth_m) depth_map(view);
  if (view->main && view->rows) error_map(view);
  sonde_figures_side_by_side(view, false);
}
