// Surfaces of all that a drawing shows: skin, bones, muscles and tendons from a grid of labels,
// vessels and nerves as tubes along their lines.
#include "limb/view.h"

#include "geometry/isosurface.h"
#include "limb/vessels_graph.h"

#include <string.h>

#define GRID_STEP 0.0028
static const uint8_t COLOURS[VIEW_KINDS][3] = {{226, 178, 150}, {190, 92, 80}, {238, 232, 218},
                                               {238, 226, 192}, {214, 40, 34}, {52, 96, 190},
                                               {84, 140, 214},  {242, 208, 48}};

static view_solid *add_solid(view_scene *scene, view_kind kind, const char *name) {
  SONDE_ASSERT(scene->count < VIEW_SOLIDS);
  view_solid *solid = &scene->solid[scene->count++];
  *solid = (view_solid){.kind = kind, .name = name};
  memcpy(solid->colour, COLOURS[kind], 3);
  return solid;
}

// Moves every vertex towards the mean of its neighbours, which takes the steps of the grid away.
static sonde_status smooth_mesh(sonde_mesh *mesh, uint32_t passes, sonde_error *error) {
  sonde_vec3 *sum = SONDE_NEW(sonde_vec3, mesh->vertex_count);
  uint32_t *count = SONDE_NEW(uint32_t, mesh->vertex_count);
  sonde_status status = sum && count ? SONDE_OK : sonde_fail_memory(error);
  for (uint32_t pass = 0; pass < passes && !status; ++pass) {
    memset(sum, 0, mesh->vertex_count * sizeof *sum);
    memset(count, 0, mesh->vertex_count * sizeof *count);
    for (uint32_t f = 0; f < mesh->face_count; ++f)
      for (int k = 0; k < 3; ++k) {
        uint32_t a = mesh->faces[f][k], b = mesh->faces[f][(k + 1) % 3];
        sum[a] = v_add(sum[a], mesh->vertices[b]), ++count[a];
      }
    for (uint32_t i = 0; i < mesh->vertex_count; ++i)
      if (count[i])
        mesh->vertices[i] = v_lerp(mesh->vertices[i], v_scale(sum[i], 1.0 / count[i]), 0.6);
  }
  sonde_free(sum);
  sonde_free(count);
  return status;
}

// Takes the vertices to the position and gives them the mean normal of the faces around them,
// evened out `even` times.
static sonde_status finish(view_solid *solid, const sonde_limb_pose *pose, uint32_t even,
                           sonde_error *error) {
  sonde_mesh *mesh = &solid->mesh;
  solid->normal = SONDE_NEW(sonde_vec3, mesh->vertex_count);
  sonde_vec3 *sum = SONDE_NEW(sonde_vec3, mesh->vertex_count);
  if (!solid->normal || !sum) {
    sonde_free(sum);
    return sonde_fail_memory(error);
  }
  for (uint32_t i = 0; pose && i < mesh->vertex_count; ++i)
    mesh->vertices[i] = sonde_limb_pose_point(pose, mesh->vertices[i]);
  for (uint32_t pass = 0; pass <= even; ++pass) {
    memset(sum, 0, mesh->vertex_count * sizeof *sum);
    for (uint32_t f = 0; f < mesh->face_count; ++f) {
      const uint32_t *v = mesh->faces[f];
      sonde_vec3 a = mesh->vertices[v[0]];
      sonde_vec3 n = v_cross(v_sub(mesh->vertices[v[1]], a), v_sub(mesh->vertices[v[2]], a));
      if (pass > 0) n = v_add(solid->normal[v[0]], v_add(solid->normal[v[1]], solid->normal[v[2]]));
      for (int k = 0; k < 3; ++k) sum[v[k]] = v_add(sum[v[k]], n);
    }
    for (uint32_t i = 0; i < mesh->vertex_count; ++i)
      solid->normal[i] = v_unit(sum[i], vec3(0, 0, 1));
  }
  sonde_free(sum);
  return SONDE_OK;
}

// A tube of given radii along a line.
static sonde_status make_tube(const sonde_vec3 *point, const double *radius, uint32_t count,
                              sonde_mesh *mesh, sonde_error *error) {
  enum { AROUND = 10 };
  SONDE_ASSERT(count >= 2);
  sonde_status status = sonde_mesh_create(mesh, count * AROUND, 2 * (count - 1) * AROUND, error);
  if (status) return status;
  sonde_vec3 side = vec3(1, 0, 0);
  for (uint32_t k = 0; k < count; ++k) {
    sonde_vec3 along = v_sub(point[k + 1 < count ? k + 1 : k], point[k ? k - 1 : 0]);
    along = v_unit(along, vec3(0, 0, -1));
    // The side is carried along the line, so that the tube does not twist.
    side = v_unit(v_madd(side, -v_dot(side, along), along), vec3(0, 1, 0));
    sonde_vec3 third = v_cross(along, side);
    for (uint32_t i = 0; i < AROUND; ++i) {
      double a = 2 * SONDE_PI * i / AROUND;
      sonde_vec3 out = v_add(v_scale(side, cos(a)), v_scale(third, sin(a)));
      mesh->vertices[k * AROUND + i] = v_madd(point[k], radius[k], out);
    }
  }
  uint32_t face = 0;
  for (uint32_t k = 0; k + 1 < count; ++k)
    for (uint32_t i = 0; i < AROUND; ++i) {
      uint32_t a = k * AROUND + i, b = k * AROUND + (i + 1) % AROUND;
      const uint32_t two[2][3] = {{a, b, a + AROUND}, {b, b + AROUND, a + AROUND}};
      memcpy(mesh->faces[face++], two[0], sizeof two[0]);
      memcpy(mesh->faces[face++], two[1], sizeof two[1]);
    }
  return SONDE_OK;
}

static sonde_status add_lines(view_scene *scene, const sonde_limb *limb,
                              const sonde_limb_pose *pose, sonde_error *error) {
  enum { MOST = 700 };
  const struct limb_vessels *v = limb->vessels;
  const double thinnest = 0.0009;
  sonde_vec3 point[MOST];
  double radius[MOST];
  sonde_status status = SONDE_OK;
  for (uint32_t b = 0; b < v->branches && !status; ++b) {
    const vessel_branch *branch = &v->branch[b];
    uint32_t count = branch->count < MOST ? branch->count : MOST;
    for (uint32_t k = 0; k < count; ++k) {
      const vessel_place *place = limb_branch_places(v, b) + k;
      point[k] = limb_side_point(limb, limb_branch_point(v, b, k));
      double lumen = pose ? sonde_limb_pose_place(pose, b, place->arc).radius_m : place->radius;
      radius[k] = fmax(lumen + place->wall, thinnest);
    }
    view_kind kind = VIEW_DEEP_VEIN;
    if (branch->kind == SONDE_LIMB_ARTERY) kind = VIEW_ARTERY;
    if (branch->kind == SONDE_LIMB_SUPERFICIAL_VEIN || branch->kind == SONDE_LIMB_PERFORATOR)
      kind = VIEW_SUPERFICIAL;
    view_solid *solid = add_solid(scene, kind, branch->name);
    status = make_tube(point, radius, count, &solid->mesh, error);
    if (!status) status = finish(solid, pose, 0, error);
  }
  for (uint32_t n = 0; n < LIMB_NERVES && !status; ++n) {
    const limb_nerve *nerve = &v->nerve[n];
    if (nerve->count < 2) continue;
    for (uint32_t k = 0; k < nerve->count; ++k)
      point[k] = limb_side_point(limb, nerve->point[k]),
      radius[k] = nerve->radius + 0.6 * nerve->half;
    view_solid *solid = add_solid(scene, VIEW_NERVE, nerve->name);
    status = make_tube(point, radius, nerve->count, &solid->mesh, error);
    if (!status) status = finish(solid, pose, 0, error);
  }
  return status;
}

typedef struct label_grid {
  uint32_t size[3];
  sonde_vec3 low;
  uint8_t *cell; // muscle + 1, or TENDON
} label_grid;
enum { TENDON = 255 };

// Surface of the cells of one value: of the mean of a cell and its neighbours, which rounds steps.
static sonde_status add_cells(view_scene *scene, const label_grid *g, uint8_t value,
                              const char *name, const sonde_limb_pose *pose, sonde_error *error) {
  uint32_t low[3] = {UINT32_MAX, UINT32_MAX, UINT32_MAX}, high[3] = {0, 0, 0}, size[3];
  const uint8_t *cell = g->cell;
  for (uint32_t z = 0; z < g->size[2]; ++z)
    for (uint32_t y = 0; y < g->size[1]; ++y)
      for (uint32_t x = 0; x < g->size[0]; ++x, ++cell)
        if (*cell == value) {
          const uint32_t at[3] = {x, y, z};
          for (int k = 0; k < 3; ++k) {
            if (at[k] < low[k]) low[k] = at[k];
            if (at[k] > high[k]) high[k] = at[k];
          }
        }
  if (high[2] == 0) return SONDE_OK;
  for (int k = 0; k < 3; ++k) low[k] = low[k] > 2 ? low[k] - 2 : 0, size[k] = high[k] - low[k] + 3;
  float *mean = SONDE_NEW(float, (size_t)size[0] * size[1] * size[2]), *to = mean;
  if (!mean) return sonde_fail_memory(error);
  static const float WEIGHT[3] = {0.25f, 0.5f, 0.25f};
  for (uint32_t z = 0; z < size[2]; ++z)
    for (uint32_t y = 0; y < size[1]; ++y)
      for (uint32_t x = 0; x < size[0]; ++x, ++to)
        for (int n = 0; n < 27; ++n) {
          uint32_t i = low[0] + x + (uint32_t)(n % 3) - 1,
                   j = low[1] + y + (uint32_t)(n / 3 % 3) - 1,
                   k = low[2] + z + (uint32_t)(n / 9) - 1;
          if (i >= g->size[0] || j >= g->size[1] || k >= g->size[2]) continue;
          if (g->cell[((size_t)k * g->size[1] + j) * g->size[0] + i] == value)
            *to += WEIGHT[n % 3] * WEIGHT[n / 3 % 3] * WEIGHT[n / 9];
        }
  view_solid *solid = add_solid(scene, value == TENDON ? VIEW_TENDON : VIEW_MUSCLE, name);
  sonde_status status =
      sonde_isosurface_create(mean, size, value == TENDON ? 0.2f : 0.45f, &solid->mesh, error);
  sonde_free(mean);
  if (status == SONDE_MESH) { // too small a muscle to be seen
    --scene->count;
    return SONDE_OK;
  }
  if (status) return status;
  sonde_vec3 corner = vec3(g->low.x + low[0] * GRID_STEP, g->low.y + low[1] * GRID_STEP,
                           g->low.z + low[2] * GRID_STEP);
  for (uint32_t i = 0; i < solid->mesh.vertex_count; ++i)
    solid->mesh.vertices[i] = v_madd(corner, GRID_STEP, solid->mesh.vertices[i]);
  // Reds whose tone tells neighbours apart.
  uint32_t h = value * 2654435761U;
  status = smooth_mesh(&solid->mesh, value == TENDON ? 2 : 6, error);
  if (value != TENDON)
    solid->colour[0] = (uint8_t)(178 + (h >> 28)),
    solid->colour[1] = (uint8_t)(70 + (h >> 24 & 15) * 2),
    solid->colour[2] = (uint8_t)(64 + (h >> 20 & 15) * 2);
  return status ? status : finish(solid, pose, 4, error);
}

sonde_status view_scene_make(const sonde_limb *limb, const sonde_limb_pose *pose, view_scene *scene,
                             sonde_error *error) {
  SONDE_ASSERT(limb && limb->vessels && limb->muscles && scene);
  scene->count = 0;
  view_solid *skin = add_solid(scene, VIEW_SKIN, NULL);
  sonde_status status = sonde_limb_skin(limb, 0.006, &skin->mesh, error);
  if (!status) status = finish(skin, pose, 0, error);
  for (uint32_t k = 0; k < SONDE_LIMB_BONES && !status; ++k) {
    sonde_limb_label label = {SONDE_LIMB_BONE, k, limb->body.side};
    view_solid *bone = add_solid(scene, VIEW_BONE, sonde_limb_name(limb, label));
    status = sonde_limb_bone_mesh(limb, (sonde_limb_bone)k, 0.0035, &bone->mesh, error);
    if (!status) status = smooth_mesh(&bone->mesh, 1, error);
    if (!status) status = finish(bone, pose, 1, error);
  }
  if (!status) status = add_lines(scene, limb, pose, error);
  // Muscles and tendons: a grid of labels first.
  const double half = 0.17;
  double foot = limb_z(limb, 2), top = limb_z(limb, LIMB_TOP);
  uint32_t side = (uint32_t)(2 * half / GRID_STEP), high = (uint32_t)((top - foot) / GRID_STEP) + 5;
  label_grid g = {{side, side, high},
                  vec3(-half, -half, foot - 2 * GRID_STEP),
                  SONDE_NEW(uint8_t, (size_t)side * side * high)};
  if (!g.cell && !status) status = sonde_fail_memory(error);
  for (size_t n = 0; n < (size_t)side * side * high && !status; ++n) {
    size_t x = n % side, y = n / side % side, z = n / side / side;
    sonde_limb_label at =
        sonde_limb_at(limb, v_madd(g.low, GRID_STEP, vec3((double)x, (double)y, (double)z)));
    if (at.tissue == SONDE_LIMB_MUSCLE) g.cell[n] = (uint8_t)(at.index + 1);
    if (at.tissue == SONDE_LIMB_TENDON) g.cell[n] = TENDON;
  }
  for (uint32_t m = 0; m < SONDE_LIMB_MUSCLES && !status; ++m) {
    sonde_limb_label label = {SONDE_LIMB_MUSCLE, m, limb->body.side};
    status = add_cells(scene, &g, (uint8_t)(m + 1), sonde_limb_name(limb, label), pose, error);
  }
  if (!status) status = add_cells(scene, &g, TENDON, "tendons", pose, error);
  sonde_free(g.cell);
  if (status) view_scene_clear(scene);
  return status;
}

void view_scene_clear(view_scene *scene) {
  for (uint32_t k = 0; k < scene->count; ++k) {
    sonde_mesh_clear(&scene->solid[k].mesh);
    sonde_free(scene->solid[k].normal);
  }
  scene->count = 0;
}
