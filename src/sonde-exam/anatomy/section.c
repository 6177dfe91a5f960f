// Cross-sections of a model as a drawing, seen from the feet: front up, medial side right.
#include "anatomy/shape.h"
#include "sonde/files.h"

#include <stdlib.h>
#include <string.h>

static const double PANEL = 460, MARGIN = 14, CAPTION = 84; // pixels

typedef struct section_point {
  double angle, outer[2], inner[2]; // around the middle; m: on the skin, on the fascia
} section_point;

// Points where a plane meets a mesh, in order around their middle.
typedef struct loop {
  uint32_t count, room;
  section_point *point;
  double x, y; // middle, m
} loop;

typedef struct panel {
  sonde_file *file;
  double x, y, scale; // pixels of the model's middle line, pixels per m
} panel;

static int compare_angles(const void *a, const void *b) {
  double p = ((const section_point *)a)->angle, q = ((const section_point *)b)->angle;
  return (p > q) - (p < q);
}

// Intersects the plane z with the mesh; the fascia lies below the skin by the depth of the muscle
// (`model` NULL: none).
static sonde_status intersect_plane(const sonde_mesh *mesh, const sonde_model *model, double z_m,
                                    loop *out, sonde_error *error) {
  *out = (loop){.room = mesh->face_count, .point = SONDE_NEW(section_point, mesh->face_count)};
  if (!out->point) return sonde_fail_memory(error);
  for (uint32_t f = 0; f < mesh->face_count; ++f)
    for (int k = 0; k < 3; ++k) { // every edge once: where it rises
      uint32_t i = mesh->faces[f][k], j = mesh->faces[f][(k + 1) % 3];
      sonde_vec3 a = mesh->vertices[i], b = mesh->vertices[j];
      if (!(a.z < z_m && b.z >= z_m) || out->count == out->room) continue;
      double t = (z_m - a.z) / (b.z - a.z);
      sonde_vec3 p = v_lerp(a, b, t), inner = p;
      if (model) {
        double depth_m = (1 - t) * model->muscle_depth_m[i] + t * model->muscle_depth_m[j];
        inner = v_madd(p, -depth_m, v_lerp(model->normal[i], model->normal[j], t));
      }
      out->point[out->count++] = (section_point){0, {p.x, p.y}, {inner.x, inner.y}};
      out->x += p.x, out->y += p.y;
    }
  if (out->count < 3) return sonde_fail(error, SONDE_MESH, "nothing to cut at z = %g m", z_m);
  out->x /= out->count, out->y /= out->count;
  for (uint32_t k = 0; k < out->count; ++k)
    out->point[k].angle = atan2(out->point[k].outer[1] - out->y, out->point[k].outer[0] - out->x);
  qsort(out->point, out->count, sizeof *out->point, compare_angles);
  return SONDE_OK;
}

static double px(const panel *p, double x_m) { return p->x + x_m * p->scale; }
static double py(const panel *p, double y_m) { return p->y - y_m * p->scale; }

static sonde_status draw_loop(const panel *p, const loop *l, bool inner, const char *look,
                              sonde_error *error) {
  double(*xy)[2] = sonde_calloc(l->count, sizeof *xy);
  if (!xy) return sonde_fail_memory(error);
  for (uint32_t k = 0; k < l->count; ++k) {
    const double *at = inner ? l->point[k].inner : l->point[k].outer;
    xy[k][0] = px(p, at[0]), xy[k][1] = py(p, at[1]);
  }
  sonde_svg_put_outlines(p->file, (const double(*)[2])xy, l->count, l->count, look);
  sonde_free(xy);
  return SONDE_OK;
}

// The vessel where it passes the plane.
static bool find_vessel(const sonde_vessel *line, double z_m, sonde_vessel_point *at) {
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

static void draw_vessel(const panel *p, const sonde_vessel *line, sonde_vessel_kind kind,
                        const char *letter, double z_m) {
  sonde_vessel_point v;
  if (!find_vessel(line, z_m, &v)) return;
  double x = px(p, v.centre_m.x), y = py(p, v.centre_m.y);
  sonde_svg_put_circle(p->file, x, y, v.radius_m * p->scale,
                       kind == SONDE_VESSEL_VEIN ? "fill='#3f6fb5' stroke='#d9e4f5'"
                                                 : "fill='#c8383a' stroke='#f7dada'");
  sonde_svg_put_text(p->file, x, y + 3, "class='light middle'", letter);
}

// One section, drawn about the middle of its own skin.
static sonde_status draw_panel(panel *p, const sonde_model *model, const sonde_landmark *mark,
                               sonde_error *error) {
  const sonde_thigh_anatomy *a = model->anatomy;
  double z_m = mark->vein_m.z, left = p->x - 0.5 * PANEL + 16;
  double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
  loop skin = {0}, bone = {0};
  sonde_status status = intersect_plane(&model->surface, model, z_m, &skin, error);
  if (!status) status = intersect_plane(&model->femur, NULL, z_m, &bone, error);
  for (uint32_t k = 0; k < skin.count && !status; ++k)
    for (int i = 0; i < 2; ++i) {
      low[i] = fmin(low[i], skin.point[k].outer[i]);
      high[i] = fmax(high[i], skin.point[k].outer[i]);
    }
  if (!status) {
    p->x -= 0.5 * (low[0] + high[0]) * p->scale;
    p->y += 0.5 * (low[1] + high[1]) * p->scale;
    status = draw_loop(p, &skin, false, "fill='#f3dfa2' stroke='#a9744f' stroke-width='3'", error);
  }
  if (!status)
    status = draw_loop(p, &skin, true, "fill='#a8443c' stroke='#f5efe6' stroke-width='1.5'", error);
  if (!status) { // the sheets between the compartments of the nearest level, from femur to fascia
    SONDE_ASSERT(a->level_count > 0);
    const sonde_muscle_level *l = &a->level[0];
    for (uint32_t k = 1; k < a->level_count; ++k)
      if (fabs(a->level[k].z_m - z_m) < fabs(l->z_m - z_m)) l = &a->level[k];
    for (int s = 0; s < SONDE_COMPARTMENTS; ++s) {
      double c = cos(l->septum_rad[s]), d = sin(l->septum_rad[s]), reach = 0, side = INFINITY;
      for (uint32_t k = 0; k < skin.count; ++k) { // where the fascia lies in that direction
        double x = skin.point[k].inner[0] - l->bone_x_m, y = skin.point[k].inner[1] - l->bone_y_m;
        double along = x * c + y * d, beside = fabs(y * c - x * d);
        if (along > 0 && beside < side) side = beside, reach = along;
      }
      const double ends[2][2] = {{px(p, l->bone_x_m), py(p, l->bone_y_m)},
                                 {px(p, l->bone_x_m + reach * c), py(p, l->bone_y_m + reach * d)}};
      sonde_svg_put_line(p->file, ends, 2, "stroke='#f2dcd6' stroke-width='2.5'");
    }
  }
  if (!status)
    status =
        draw_loop(p, &bone, false, "fill='#efe9da' stroke='#b9ad8f' stroke-width='1.5'", error);
  if (!status) {
    for (uint32_t k = 0; k < a->branch_count; ++k)
      draw_vessel(p, &a->branch[k].line, a->branch[k].kind, "", z_m);
    draw_vessel(p, &model->artery, SONDE_VESSEL_ARTERY, "A", z_m);
    draw_vessel(p, &model->vein, SONDE_VESSEL_VEIN, "V", z_m);

    // The caption: place, widths and depths.
    sonde_vessel_point vein, artery;
    double top = PANEL + 12;
    sonde_svg_put_text(p->file, left, top, "class='head'", mark->name);
    if (find_vessel(&model->vein, z_m, &vein) && find_vessel(&model->artery, z_m, &artery)) {
      char text[160];
      snprintf(text, sizeof text, "z %.0f mm; vein %.1f mm wide, centre %.1f mm deep", z_m * 1e3,
               2e3 * vein.radius_m, vein.depth_m * 1e3);
      sonde_svg_put_text(p->file, left, top + 17, "class='tick'", text);
      snprintf(text, sizeof text, "artery %.1f mm wide, centre %.1f mm deep", 2e3 * artery.radius_m,
               artery.depth_m * 1e3);
      sonde_svg_put_text(p->file, left, top + 33, "class='tick'", text);
    }
  }
  sonde_free(skin.point);
  sonde_free(bone.point);
  return status;
}

sonde_status sonde_thigh_sections(const sonde_model *model, const char *path, sonde_error *error) {
  static const char *const MARK[] = {"common_femoral", "femoral_mid", "popliteal"};
  enum { PANELS = SONDE_COUNT_OF(MARK) };
  SONDE_ASSERT(model && path);
  if (!model->anatomy) return sonde_fail(error, SONDE_ARGUMENT, "the model has no named anatomy");

  // One scale for all panels, so that the widest section fits.
  sonde_vec3 low = vec3(INFINITY, INFINITY, 0), high = vec3(-INFINITY, -INFINITY, 0);
  for (uint32_t k = 0; k < model->surface.vertex_count; ++k) {
    sonde_vec3 p = model->surface.vertices[k];
    low = vec3(fmin(low.x, p.x), fmin(low.y, p.y), 0);
    high = vec3(fmax(high.x, p.x), fmax(high.y, p.y), 0);
  }
  double scale = (PANEL - 2 * MARGIN) / fmax(fmax(high.x - low.x, high.y - low.y), 0.02);
  SONDE_ASSERT(scale > 0);

  sonde_file *file = NULL;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  char title[160];
  snprintf(title, sizeof title, "Cross-sections of %s", model->name);
  sonde_svg_begin(file, title, PANELS * PANEL, PANEL + CAPTION);
  for (int k = 0; k < PANELS && !status; ++k) {
    const sonde_landmark *mark = sonde_anatomy_landmark(model->anatomy, MARK[k]);
    panel p = {file, (k + 0.5) * PANEL, PANEL / 2, scale};
    status = mark ? draw_panel(&p, model, mark, error)
                  : sonde_fail(error, SONDE_NOT_FOUND, "the model has no landmark '%s'", MARK[k]);
  }
  double y = PANEL + CAPTION - 14, x = 16;
  const double bar[2][2] = {{x, y}, {x + 0.05 * scale, y}};
  sonde_svg_put_line(file, bar, 2, "stroke='#222' stroke-width='3'");
  sonde_svg_put_text(file, bar[1][0] + 8, y + 4, "class='tick'", "50 mm");
  sonde_svg_put_text(file, PANELS * PANEL - 16, y + 4, "class='tick end'",
                     "seen from the feet: front up, lateral left, medial right");
  if (!status) return sonde_svg_end(file, error);
  sonde_file_discard(file);
  return status;
}
