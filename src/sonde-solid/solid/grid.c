// Structured meshes: graded lines, levels through the layers, the block.
#include "grid.h"

#include "base/base.h"
#include "elements/hexahedron.h"

sonde_hexes_def sonde_hexes_def_default(void) {
  return (sonde_hexes_def){.version = SONDE_DEF_VERSION,
                           .half_u_m = 30e-3,
                           .half_v_m = 6e-3,
                           .edge_m = 5e-3,
                           .growth = 1.7,
                           .reach_m = 0.15,
                           .muscle = 4,
                           .fat = 2,
                           .skin = 1};
}

sonde_status sonde_hexes_check(const sonde_hexes_def *def, sonde_error *error) {
  SONDE_ASSERT(def != NULL);
  sonde_status status = sonde_def_check("a mesh", def->version, error);
  if (status) return status;
  const sonde_bounded range[] = {{"half_u_m", def->half_u_m, 1e-4, 0.2},
                                 {"half_v_m", def->half_v_m, 1e-4, 0.2},
                                 {"edge_m", def->edge_m, 1e-4, 0.05},
                                 {"growth", def->growth, 1.05, 3},
                                 {"reach_m", def->reach_m, 0.01, 2},
                                 {"muscle", def->muscle, 1, 20},
                                 {"fat", def->fat, 0, 20},
                                 {"skin", def->skin, 0, 8}};
  return sonde_bounded_check(range, SONDE_COUNT_OF(range), error);
}

sonde_status sonde_lines_make(const sonde_hexes_def *def, double half, double down, double up,
                              sonde_lines *lines, sonde_error *error) {
  SONDE_ASSERT(half > 0 && def->edge_m > 0 && lines != NULL);
  const double rest[2] = {down - half, up - half};
  const uint32_t inside = 2 * (uint32_t)ceil(half / def->edge_m - 1e-6);
  const double edge = 2 * half / inside;
  uint32_t beyond[2];
  double all[2];
  for (int side = 0; side < 2; ++side) {
    if (!(rest[side] > 0))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "the footprint reaches %.3g m from its middle, the mesh %.3g m", half,
                        rest[side] + half);
    double step = edge;
    for (all[side] = 0, beyond[side] = 0; all[side] < rest[side] * (1 - 1e-9); ++beyond[side])
      all[side] += step, step *= def->growth;
  }
  lines->count = inside + 1 + beyond[0] + beyond[1];
  if (inside > SONDE_LINES_MOST || lines->count > SONDE_LINES_MOST)
    return sonde_fail(error, SONDE_ARGUMENT, "edges of %g m ask for %u lines, expected at most %d",
                      def->edge_m, lines->count, SONDE_LINES_MOST);
  double *middle = lines->at + beyond[0];
  for (uint32_t k = 0; k <= inside; ++k) middle[k] = -half + edge * k;
  for (int side = 0; side < 2; ++side) {
    double step = edge * rest[side] / all[side], way = half;
    for (uint32_t k = 1; k <= beyond[side]; ++k, step *= def->growth) {
      way += step;
      if (side)
        middle[inside + k] = way;
      else
        *(middle - k) = -way;
    }
  }
  return SONDE_OK;
}

void sonde_levels_make(uint32_t muscle, uint32_t fat, uint32_t skin, sonde_levels *levels) {
  const double shrink = 1 / 1.35;
  double step = 1, sum = 0;
  SONDE_ASSERT(muscle > 0 && muscle + fat + skin < SONDE_LEVELS_MOST);
  levels->count = 0;
  levels->at[levels->count++] = 0;
  for (uint32_t k = 0; k < muscle; ++k, step *= shrink) levels->at[levels->count++] = sum += step;
  for (uint32_t k = 0; k < levels->count; ++k) levels->at[k] /= sum;
  for (uint32_t k = 1; k <= fat; ++k) levels->at[levels->count++] = 1 + (double)k / fat;
  for (uint32_t k = 1; k <= skin; ++k) levels->at[levels->count++] = 2 + (double)k / skin;
}

sonde_status sonde_hexes_bend(const sonde_grid_shape *s, sonde_hexes *mesh, sonde_error *error) {
  SONDE_ASSERT(s != NULL && mesh != NULL && s->u_count > 1 && s->v_count > 1);
  const uint32_t levels = s->levels->count, hexes_u = s->u_count - !s->around;
  const uint32_t hexes_v = s->v_count - 1, sheet = hexes_u * hexes_v;
  *mesh = (sonde_hexes){.node_count = levels * s->u_count * s->v_count,
                        .count = (levels - 1) * sheet,
                        .face_count = sheet,
                        .lines = {levels, s->u_count, s->v_count}};
  mesh->node = SONDE_NEW(sonde_vec3, mesh->node_count);
  mesh->corner = (uint32_t(*)[8])sonde_calloc(mesh->count, sizeof *mesh->corner);
  mesh->face = (uint32_t(*)[4])sonde_calloc(mesh->face_count, sizeof *mesh->face);
  mesh->layer = SONDE_NEW(uint8_t, mesh->count);
  mesh->held = SONDE_NEW(uint8_t, mesh->node_count);
  if (!mesh->node || !mesh->corner || !mesh->face || !mesh->layer || !mesh->held) {
    sonde_hexes_clear(mesh);
    return sonde_fail_memory(error);
  }
  for (uint32_t n = 0; n < mesh->node_count; ++n) {
    uint32_t v = n % s->v_count, u = n / s->v_count % s->u_count, l = n / s->v_count / s->u_count;
    mesh->node[n] = s->place(s->user, s->levels->at[l], u, v);
    mesh->held[n] = l == 0 ? 7 : 0;
  }
  for (uint32_t h = 0; h < mesh->count; ++h) {
    const uint32_t v = h % hexes_v, u = h / hexes_v % hexes_u, l = h / sheet;
    for (uint32_t c = 0; c < 8; ++c)
      mesh->corner[h][c] =
          sonde_grid_shape_node(s, l + (c % 4 == 1 || c % 4 == 2), u + (c % 4 > 1), v + c / 4);
    const double top = s->levels->at[l + 1] - 1e-9;
    mesh->layer[h] = top < 1 ? SONDE_SOLID_MUSCLE : top < 2 ? SONDE_SOLID_FAT : SONDE_SOLID_SKIN;
    sonde_vec3 corner[8], g[8];
    for (int c = 0; c < 8; ++c) corner[c] = mesh->node[mesh->corner[h][c]];
    for (int p = 0; p < 8; ++p) {
      const double *sign = sonde_hexahedron_sign[p];
      if (sonde_hexahedron_gradients(corner, sign[0], sign[1], sign[2], g) > 0) continue;
      sonde_hexes_clear(mesh);
      return sonde_fail(error, SONDE_MESH, "a hexahedron at (%.4f, %.4f, %.4f) m is folded",
                        corner[p].x, corner[p].y, corner[p].z);
    }
  }
  for (uint32_t f = 0; f < sheet; ++f)
    for (uint32_t c = 0; c < 4; ++c)
      mesh->face[f][c] = sonde_grid_shape_node(s, levels - 1, f / hexes_v + (c == 1 || c == 2),
                                               f % hexes_v + (c > 1));
  return SONDE_OK;
}

void sonde_hexes_clear(sonde_hexes *mesh) {
  if (!mesh) return;
  void *parts[] = {mesh->node, mesh->corner, mesh->face, mesh->layer, mesh->held};
  for (size_t k = 0; k < SONDE_COUNT_OF(parts); ++k) sonde_free(parts[k]);
  *mesh = (sonde_hexes){0};
}

// ---- block --------------------------------------------------------------------------------

typedef struct block {
  sonde_lines u, v;
  double z[4]; // of the levels 0 to 3
} block;

static sonde_vec3 place_in_block(const void *user, double level, uint32_t u, uint32_t v) {
  const block *b = user;
  const uint32_t below = level < 2 ? (uint32_t)level : 2;
  const double t = level - below;
  return vec3(b->u.at[u], b->v.at[v], (1 - t) * b->z[below] + t * b->z[below + 1]);
}

sonde_status sonde_hexes_block(double depth_m, double skin_m, double fat_m,
                               const sonde_hexes_def *def, sonde_hexes *mesh, sonde_error *error) {
  SONDE_ASSERT(mesh != NULL);
  block b = {.z = {-depth_m, -skin_m - fat_m, -skin_m, 0}};
  sonde_status status = sonde_hexes_check(def, error);
  if (!status && !(skin_m >= 0 && fat_m >= 0 && depth_m > skin_m + fat_m && depth_m <= 2))
    status = sonde_fail(error, SONDE_ARGUMENT,
                        "block of %g m with %g m of skin and %g m of fat: expected layers that are "
                        "not negative above some muscle, at most 2 m",
                        depth_m, skin_m, fat_m);
  const double reach = status ? 0 : def->reach_m;
  if (!status) status = sonde_lines_make(def, def->half_u_m, reach, reach, &b.u, error);
  if (!status) status = sonde_lines_make(def, def->half_v_m, reach, reach, &b.v, error);
  if (status) return status;
  sonde_levels levels;
  sonde_levels_make(def->muscle, fat_m > 0 ? def->fat : 0, skin_m > 0 ? def->skin : 0, &levels);
  const sonde_grid_shape shape = {.levels = &levels,
                                  .u_count = b.u.count,
                                  .v_count = b.v.count,
                                  .place = place_in_block,
                                  .user = &b};
  status = sonde_hexes_bend(&shape, mesh, error);
  for (uint32_t n = 0; n < mesh->node_count && !status; ++n) {
    if (fabs(fabs(mesh->node[n].x) - reach) < 1e-9) mesh->held[n] |= 1;
    if (fabs(fabs(mesh->node[n].y) - reach) < 1e-9) mesh->held[n] |= 2;
  }
  return status;
}
