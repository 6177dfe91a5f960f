// The limb from the front and from the medial side: shaded bones, and the skin as a veil.
#include "base/order.h"
#include "limb/bones.h"
#include "limb/frame.h"
#include "sonde/files.h"

enum { VIEW_WIDTH = 900, VIEW_HEIGHT = 1180 };
static const double TOP = 70, LEFT[2] = {250, 660};

typedef struct view {
  const sonde_limb *limb;
  double pixels; // per metre
  int side;      // 0: from the front, 1: from the medial side
  double mirror; // -1 on a left limb
} view;

// To the right, upwards, towards the viewer. From the medial side the front is on the left of a
// right limb.
static sonde_vec3 project(const view *v, sonde_vec3 p) {
  double top = limb_z(v->limb, LIMB_TOP);
  sonde_vec3 q =
      v->side == 0 ? vec3(p.x, top - p.z, p.y) : vec3(-v->mirror * p.y, top - p.z, v->mirror * p.x);
  return vec3(LEFT[v->side] + v->pixels * q.x, TOP + v->pixels * q.y, q.z);
}

// Triangles of all bones, far ones first, brighter towards the light.
static sonde_status put_bones(const view *v, sonde_file *file, sonde_error *error) {
  static const double LIGHT[3] = {-0.35, -0.5, 0.79};
  sonde_mesh mesh[SONDE_LIMB_BONES] = {{0}};
  sonde_status status = SONDE_OK;
  uint32_t first[SONDE_LIMB_BONES + 1] = {0};
  for (uint32_t k = 0; k < SONDE_LIMB_BONES && !status; ++k) {
    status = sonde_limb_bone_mesh(v->limb, (sonde_limb_bone)k, 0.005, &mesh[k], error);
    first[k + 1] = first[k] + mesh[k].face_count;
  }
  uint32_t count = first[SONDE_LIMB_BONES];
  sonde_ranked *order = status ? NULL : SONDE_NEW(sonde_ranked, count);
  if (!status && !order) status = sonde_fail_memory(error);
  for (uint32_t k = 0; k < SONDE_LIMB_BONES && !status; ++k)
    for (uint32_t f = 0; f < mesh[k].face_count; ++f) {
      double depth = 0;
      for (uint32_t i = 0; i < 3; ++i) depth += project(v, mesh[k].vertices[mesh[k].faces[f][i]]).z;
      order[first[k] + f] = (sonde_ranked){depth, first[k] + f};
    }
  if (!status) qsort(order, count, sizeof *order, sonde_compare_ranked);
  for (uint32_t f = 0; f < count && !status; ++f) {
    uint32_t k = 0;
    while (order[f].index >= first[k + 1]) ++k;
    const uint32_t *face = mesh[k].faces[order[f].index - first[k]];
    sonde_vec3 p[3];
    double xy[3][2];
    for (uint32_t i = 0; i < 3; ++i) {
      p[i] = project(v, mesh[k].vertices[face[i]]);
      xy[i][0] = p[i].x, xy[i][1] = p[i].y, p[i].z *= v->pixels;
    }
    // Normal on the page: x right, y down, z to the viewer.
    sonde_vec3 n = v_unit(v_cross(v_sub(p[2], p[0]), v_sub(p[1], p[0])), vec3(0, 0, 1));
    if (n.z <= 0) continue;
    double light = 0.35 + 0.65 * fmax(0, n.x * LIGHT[0] + n.y * LIGHT[1] + n.z * LIGHT[2]);
    char look[80];
    int red = (int)(244 * light), green = (int)(232 * light), blue = (int)(202 * light);
    snprintf(look, sizeof look, "fill='#%02x%02x%02x' stroke='#%02x%02x%02x' stroke-width='.4'",
             red, green, blue, red, green, blue);
    sonde_svg_put_outlines(file, (const double(*)[2])xy, 3, 3, look);
  }
  sonde_free(order);
  for (uint32_t k = 0; k < SONDE_LIMB_BONES; ++k) sonde_mesh_clear(&mesh[k]);
  return status;
}

sonde_status sonde_limb_view_svg(const sonde_limb *limb, const char *path, sonde_error *error) {
  SONDE_ASSERT(limb && path);
  sonde_file *file = NULL;
  sonde_status status = sonde_file_create(path, &file, error);
  if (status) return status;
  bool left = limb->body.side == SONDE_LIMB_LEFT;
  double height = limb_z(limb, LIMB_TOP) - limb_z(limb, 2);
  view v = {limb, (VIEW_HEIGHT - 2 * TOP) / height, 0, left ? -1 : 1};
  sonde_svg_begin(file, "Lower limb", VIEW_WIDTH, VIEW_HEIGHT);
  for (v.side = 0; v.side < 2 && !status; ++v.side) {
    status = put_bones(&v, file, error);
    // The skin: its silhouette as a veil, and rings every tenth of a segment on the near side.
    enum { STEPS = 160, AROUND = 90 };
    double edge[2 * STEPS][2];
    for (uint32_t k = 0; k < STEPS; ++k) {
      double level = LIMB_TOP + (2 - LIMB_TOP) * k / (STEPS - 1), low = INFINITY, high = -INFINITY,
             y = 0;
      sonde_vec3 c = limb_centre(v.limb, level);
      double ring[AROUND][2];
      uint32_t count = 0;
      for (uint32_t i = 0; i < AROUND; ++i) {
        double angle = 2 * SONDE_PI * i / AROUND + (v.side ? 0 : -SONDE_PI),
               r = limb_skin_radius(v.limb, level, angle);
        sonde_vec3 p =
            project(&v, vec3(v.mirror * (c.x + r * sin(angle)), c.y + r * cos(angle), c.z));
        low = fmin(low, p.x), high = fmax(high, p.x), y = p.y;
        bool near = v.side == 0 ? cos(angle) > 0 : sin(angle) > 0;
        if (near) ring[count][0] = p.x, ring[count++][1] = p.y;
      }
      edge[k][0] = low, edge[k][1] = y;
      edge[2 * STEPS - 1 - k][0] = high, edge[2 * STEPS - 1 - k][1] = y;
      if (k % 8 == 0 && count > 1)
        sonde_svg_put_line(file, (const double(*)[2])ring, count,
                           "fill='none' stroke='#a8674a' stroke-opacity='.35' stroke-width='.6'");
    }
    sonde_svg_put_outlines(file, (const double(*)[2])edge, 2 * STEPS, 2 * STEPS,
                           "fill='#d99b78' fill-opacity='.28' stroke='#7d5138' stroke-width='1'");
    sonde_svg_put_text(file, LEFT[v.side], 34, "class='head middle'",
                       v.side == 0
                           ? (left ? "Left limb from the front" : "Right limb from the front")
                           : "from the medial side");
  }
  if (status) {
    sonde_file_discard(file);
    return status;
  }
  return sonde_svg_end(file, error);
}
