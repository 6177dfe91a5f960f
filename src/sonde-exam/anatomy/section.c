// Cross-sections of a model as a drawing, seen from the feet: front up, medial side right.
// cut_mesh:     points where a plane z meets a mesh's edges, in order around its middle.
// draw_loop:    a closed outline.
// fitting_scale: pixels per metre.
// draw_septa:   the sheets between the compartments, from femur to fascia.
// draw_line_at: a vessel's circle where it passes the plane.
// draw_panel:   one section with its captions.
#include "anatomy/shape.h"
#include "report/svg.h"

#include <stdlib.h>
#include <string.h>

static const double PANEL = 460, MARGIN = 14, CAPTION = 84; // pixels

typedef struct section_point {
  double angle, x, y;      // m
  double inner_x, inner_y; // on the fascia
} section_point;

typedef struct loop {
  uint32_t count, room;
  section_point *point;
  double x, y; // middle
} loop;

static int by_angle(const void *a, const void *b) {
  double p = ((const section_point *)a)->angle, q = ((const section_point *)b)->angle;
  return (p > q) - (p < q);
}

// `model` NULL: no fascia.
static sonde_status cut_mesh(const sonde_mesh *mesh, const sonde_model *model, double z_m,
                             loop *out, sonde_error *error) {
  *out = (loop){.room = mesh->face_count};
  out->point = SONDE_NEW(section_point, out->room);
  if (!out->point) return sonde_fail_memory(error);
  for (uint32_t f = 0; f < mesh->face_count; ++f)
    for (int k = 0; k < 3; ++k) { // every edge once: where it rises
      uint32_t i = mesh->faces[f][k], j = mesh->faces[f][(k + 1) % 3];
      sonde_vec3 a = mesh->vertices[i], b = mesh->vertices[j];
      if (!(a.z < z_m && b.z >= z_m) || out->count == out->room) continue;
      double t = (z_m - a.z) / (b.z - a.z);
      sonde_vec3 p = v_lerp(a, b, t), inner = p;
      if (model) {
        double depth = (1 - t) * model->muscle_depth_m[i] + t * model->muscle_depth_m[j];
        inner = v_madd(p, -depth, v_lerp(model->normal[i], model->normal[j], t));
      }
      out->point[out->count++] = (section_point){0, p.x, p.y, inner.x, inner.y};
      out->x += p.x;
      out->y += p.y;
    }
  if (out->count < 3) return sonde_fail(error, SONDE_MESH, "nothing to cut at z = %g m", z_m);
  out->x /= out->count;
  out->y /= out->count;
  for (uint32_t k = 0; k < out->count; ++k)
    out->point[k].angle = atan2(out->point[k].y - out->y, out->point[k].x - out->x);
  qsort(out->point, out->count, sizeof *out->point, by_angle);
  return SONDE_OK;
}

typedef struct panel {
  sonde_text *out;
  double x, y;  // pixels of the model's middle line
  double scale; // pixels per m
} panel;

static double px(const panel *p, double x_m) { return p->x + x_m * p->scale; }
static double py(const panel *p, double y_m) { return p->y - y_m * p->scale; }

static void draw_loop(const panel *p, const loop *l, bool inner, const char *look) {
  sonde_path path = sonde_path_begin(p->out, look);
  for (uint32_t k = 0; k < l->count; ++k) {
    double x = inner ? l->point[k].inner_x : l->point[k].x;
    double y = inner ? l->point[k].inner_y : l->point[k].y;
    if (k == 0)
      sonde_path_move(&path, px(p, x), py(p, y));
    else
      sonde_path_draw(&path, px(p, x), py(p, y));
  }
  sonde_path_close(&path);
  sonde_path_end(&path);
}

static const sonde_muscle_level *nearest_level(const sonde_thigh_anatomy *a, double z_m) {
  SONDE_ASSERT(a->level_count > 0);
  const sonde_muscle_level *best = &a->level[0];
  for (uint32_t k = 1; k < a->level_count; ++k)
    if (fabs(a->level[k].z_m - z_m) < fabs(best->z_m - z_m)) best = &a->level[k];
  return best;
}

static void draw_septa(const panel *p, const sonde_thigh_anatomy *a, const loop *skin, double z_m) {
  const sonde_muscle_level *l = nearest_level(a, z_m);
  for (int s = 0; s < SONDE_COMPARTMENTS; ++s) {
    double c = cos(l->septum_rad[s]), d = sin(l->septum_rad[s]), reach = 0, side = INFINITY;
    for (uint32_t k = 0; k < skin->count; ++k) { // where the fascia lies in that direction
      double x = skin->point[k].inner_x - l->bone_x_m, y = skin->point[k].inner_y - l->bone_y_m;
      double along = x * c + y * d, beside = fabs(y * c - x * d);
      if (along > 0 && beside < side) side = beside, reach = along;
    }
    sonde_svg_line(p->out, px(p, l->bone_x_m), py(p, l->bone_y_m), px(p, l->bone_x_m + reach * c),
                   py(p, l->bone_y_m + reach * d), "stroke='#f2dcd6' stroke-width='2.5'");
  }
}

static bool line_at(const sonde_vessel *line, double z_m, sonde_vessel_point *at) {
  for (uint32_t k = 0; k + 1 < line->count; ++k) {
    const sonde_vessel_point *a = &line->point[k], *b = a + 1;
    if ((a->centre_m.z > z_m) == (b->centre_m.z > z_m)) continue;
    double t = (z_m - a->centre_m.z) / (b->centre_m.z - a->centre_m.z);
    *at = (sonde_vessel_point){v_lerp(a->centre_m, b->centre_m, t),
                               a->radius_m + t * (b->radius_m - a->radius_m),
                               a->depth_m + t * (b->depth_m - a->depth_m)};
    return true;
  }
  return false;
}

static void draw_line_at(const panel *p, const sonde_vessel *line, sonde_vessel_kind kind,
                         const char *letters, double z_m) {
  sonde_vessel_point v;
  if (!line_at(line, z_m, &v)) return;
  const char *look = kind == SONDE_VESSEL_VEIN ? "fill='#3f6fb5' stroke='#d9e4f5'"
                                               : "fill='#c8383a' stroke='#f7dada'";
  double x = px(p, v.centre_m.x), y = py(p, v.centre_m.y);
  sonde_svg_circle(p->out, x, y, v.radius_m * p->scale, look);
  sonde_svg_words(p->out, x, y + 3, "class='small light middle'", letters);
}

static void caption(const panel *p, const sonde_model *model, const sonde_landmark *mark,
                    double left) {
  sonde_vessel_point v, a;
  bool both = line_at(&model->vein, mark->vein_m.z, &v);
  both = line_at(&model->artery, mark->vein_m.z, &a) && both;
  double top = PANEL + 12;
  sonde_svg_text(p->out, left + 16, top, "class='head'", mark->name);
  if (!both) return;
  char text[240];
  snprintf(text, sizeof text, "z %s mm; vein %s mm wide, centre %s mm deep",
           sonde_fixed(mark->vein_m.z * 1e3, 0).s, sonde_fixed(2e3 * v.radius_m, 1).s,
           sonde_fixed(v.depth_m * 1e3, 1).s);
  sonde_svg_words(p->out, left + 16, top + 17, "class='tick'", text);
  snprintf(text, sizeof text, "artery %s mm wide, centre %s mm deep",
           sonde_fixed(2e3 * a.radius_m, 1).s, sonde_fixed(a.depth_m * 1e3, 1).s);
  sonde_svg_words(p->out, left + 16, top + 33, "class='tick'", text);
}

static void centre_panel(panel *p, const loop *skin) {
  double low_x = INFINITY, high_x = -INFINITY, low_y = INFINITY, high_y = -INFINITY;
  for (uint32_t k = 0; k < skin->count; ++k) {
    low_x = fmin(low_x, skin->point[k].x), high_x = fmax(high_x, skin->point[k].x);
    low_y = fmin(low_y, skin->point[k].y), high_y = fmax(high_y, skin->point[k].y);
  }
  p->x -= 0.5 * (low_x + high_x) * p->scale;
  p->y += 0.5 * (low_y + high_y) * p->scale;
}

static sonde_status draw_panel(panel *p, const sonde_model *model, const sonde_landmark *mark,
                               double left, sonde_error *error) {
  const sonde_thigh_anatomy *a = model->anatomy;
  double z = mark->vein_m.z;
  loop skin = {0}, bone = {0};
  sonde_status status = cut_mesh(&model->surface, model, z, &skin, error);
  if (!status) status = cut_mesh(&model->femur, NULL, z, &bone, error);
  if (!status) {
    centre_panel(p, &skin);
    draw_loop(p, &skin, false, "fill='#f3dfa2' stroke='#a9744f' stroke-width='3'");
    draw_loop(p, &skin, true, "fill='#a8443c' stroke='#f5efe6' stroke-width='1.5'");
    draw_septa(p, a, &skin, z);
    draw_loop(p, &bone, false, "fill='#efe9da' stroke='#b9ad8f' stroke-width='1.5'");
    for (uint32_t k = 0; k < a->branch_count; ++k)
      draw_line_at(p, &a->branch[k].line, a->branch[k].kind, "", z);
    draw_line_at(p, &model->artery, SONDE_VESSEL_ARTERY, "A", z);
    draw_line_at(p, &model->vein, SONDE_VESSEL_VEIN, "V", z);
    caption(p, model, mark, left);
  }
  sonde_free(skin.point);
  sonde_free(bone.point);
  return status;
}

// One scale for all panels, so that the widest section fits; each is drawn about its middle.
static double fitting_scale(const sonde_mesh *surface) {
  sonde_vec3 low = vec3(INFINITY, INFINITY, 0), high = vec3(-INFINITY, -INFINITY, 0);
  for (uint32_t k = 0; k < surface->vertex_count; ++k) {
    sonde_vec3 p = surface->vertices[k];
    low = vec3(fmin(low.x, p.x), fmin(low.y, p.y), 0);
    high = vec3(fmax(high.x, p.x), fmax(high.y, p.y), 0);
  }
  double widest = fmax(fmax(high.x - low.x, high.y - low.y), 0.02);
  return (PANEL - 2 * MARGIN) / widest;
}

static void draw_frame(sonde_text *out, uint32_t panels, double scale) {
  double y = PANEL + CAPTION - 14, x = 16;
  sonde_svg_line(out, x, y, x + 0.05 * scale, y, "stroke='#222' stroke-width='3'");
  sonde_svg_words(out, x + 0.05 * scale + 8, y + 4, "class='tick'", "50 mm");
  sonde_svg_words(out, panels * PANEL - 16, y + 4, "class='tick end'",
                  "seen from the feet: front up, lateral left, medial right");
}

sonde_status sonde_thigh_sections(const sonde_model *model, const char *path, sonde_error *error) {
  static const char *const MARK[] = {"common_femoral", "femoral_mid", "popliteal_near"};
  enum { PANELS = sizeof MARK / sizeof MARK[0] };
  if (!model->anatomy) return sonde_fail(error, SONDE_ARGUMENT, "the model has no named anatomy");
  sonde_figure figure = {.name = "sections", .width = PANELS * PANEL, .height = PANEL + CAPTION};
  snprintf(figure.title, sizeof figure.title, "Cross-sections of %s", model->name);
  sonde_status status = SONDE_OK;
  double scale = fitting_scale(&model->surface);
  for (int k = 0; k < PANELS && !status; ++k) {
    const sonde_landmark *mark = sonde_anatomy_landmark(model->anatomy, MARK[k]);
    panel p = {&figure.body, (k + 0.5) * PANEL, PANEL / 2, scale};
    if (!mark)
      status = sonde_fail(error, SONDE_NOT_FOUND, "the model has no landmark '%s'", MARK[k]);
    else
      status = draw_panel(&p, model, mark, k * PANEL, error);
  }
  draw_frame(&figure.body, PANELS, scale);
  sonde_text text = {0};
  sonde_file *file = NULL;
  if (!status) sonde_svg_write(&text, &figure, true);
  if (!status && (text.failed || figure.body.failed)) status = sonde_fail_memory(error);
  if (!status) status = sonde_file_create(path, &file, error);
  if (!status) {
    sonde_file_write(file, text.bytes, text.used);
    status = sonde_file_commit(file, error);
  }
  sonde_text_clear(&text);
  sonde_text_clear(&figure.body);
  return status;
}
