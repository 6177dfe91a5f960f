// Closed surfaces of a limb: the skin as a tube with two lids, bones as level sets of their
// distances.
#include "limb/bones.h"
#include "limb/frame.h"

#include "geometry/isosurface.h"

// Mirrors a mesh by the signs of x and y and turns its faces, so that they stay counter-clockwise
// from outside.
static void mirror(sonde_mesh *mesh, double x, double y) {
  for (uint32_t i = 0; i < mesh->vertex_count; ++i)
    mesh->vertices[i].x *= x, mesh->vertices[i].y *= y;
  for (uint32_t i = 0; i < mesh->face_count; ++i) {
    uint32_t keep = mesh->faces[i][1];
    mesh->faces[i][1] = mesh->faces[i][2], mesh->faces[i][2] = keep;
  }
}

void sonde_limb_to_patient(sonde_mesh *mesh) {
  SONDE_ASSERT(mesh);
  mirror(mesh, 1, -1);
}

sonde_status sonde_limb_skin(const sonde_limb *limb, double edge_m, sonde_mesh *mesh,
                             sonde_error *error) {
  SONDE_ASSERT(limb && mesh);
  if (!(edge_m >= 0.0015 && edge_m <= 0.05))
    return sonde_fail(error, SONDE_ARGUMENT, "the skin's edges are %g mm, expected 1.5 to 50",
                      edge_m * 1e3);
  double top = limb_z(limb, LIMB_TOP), foot = limb_z(limb, 2);
  uint32_t around = (uint32_t)ceil(sonde_limb_girth(limb, 0.3) / edge_m);
  uint32_t rows = (uint32_t)ceil((top - foot) / edge_m) + 1;
  uint32_t rings = (uint32_t)ceil(0.08 / edge_m); // of each lid, beside its middle
  uint32_t total = rows + 2 * (rings - 1);
  sonde_status status = sonde_mesh_create(mesh, total * around + 2, 2 * total * around, error);
  if (status) return status;
  // Rings from the middle of the upper lid over the skin to the middle of the lower lid.
  for (uint32_t r = 0; r < total; ++r) {
    uint32_t row = r < rings - 1 ? 0 : (r - (rings - 1) < rows ? r - (rings - 1) : rows - 1);
    double z = top + (foot - top) * row / (rows - 1), level = limb_level(limb, z), part = 1;
    if (r < rings - 1) part = (r + 1.0) / rings;
    if (r >= rings - 1 + rows) part = (double)(total - r) / rings;
    sonde_vec3 c = limb_centre(limb, level);
    for (uint32_t k = 0; k < around; ++k) {
      double a = 2 * SONDE_PI * k / around, radius = part * limb_skin_radius(limb, level, a);
      mesh->vertices[r * around + k] = vec3(c.x + radius * sin(a), c.y + radius * cos(a), z);
    }
  }
  uint32_t upper = total * around, lower = upper + 1, face = 0;
  mesh->vertices[upper] = limb_centre(limb, LIMB_TOP);
  mesh->vertices[lower] = limb_centre(limb, 2);
  for (uint32_t k = 0; k < around; ++k) {
    uint32_t next = (k + 1) % around, last = (total - 1) * around;
    const uint32_t lids[2][3] = {{upper, next, k}, {lower, last + k, last + next}};
    for (uint32_t i = 0; i < 3; ++i)
      mesh->faces[face][i] = lids[0][i], mesh->faces[face + 1][i] = lids[1][i];
    face += 2;
    for (uint32_t r = 0; r + 1 < total; ++r) {
      uint32_t a = r * around + k, b = r * around + next, c = a + around, d = b + around;
      const uint32_t sides[2][3] = {{a, b, c}, {b, d, c}};
      for (uint32_t i = 0; i < 3; ++i)
        mesh->faces[face][i] = sides[0][i], mesh->faces[face + 1][i] = sides[1][i];
      face += 2;
    }
  }
  SONDE_ASSERT(face == mesh->face_count);
  if (limb->body.side == SONDE_LIMB_LEFT) mirror(mesh, -1, 1);
  return SONDE_OK;
}

sonde_status sonde_limb_bone_mesh(const sonde_limb *limb, sonde_limb_bone bone, double edge_m,
                                  sonde_mesh *mesh, sonde_error *error) {
  SONDE_ASSERT(limb && limb->bones && mesh && (unsigned)bone < SONDE_LIMB_BONES);
  if (!(edge_m >= 0.001 && edge_m <= 0.01))
    return sonde_fail(error, SONDE_ARGUMENT, "a bone's edges are %g mm, expected 1 to 10",
                      edge_m * 1e3);
  const struct limb_bones *b = limb->bones;
  // Box of the bone: its z range, and x and y of its parts.
  sonde_vec3 low = {-0.075, -0.085, b->low[bone]}, high = {0.085, 0.085, b->high[bone]};
  if (bone == SONDE_LIMB_PELVIS) high.z = fmin(high.z, b->top + 2 * edge_m);
  if (bone >= SONDE_LIMB_TIBIA) low.z = fmax(low.z, b->foot - 2 * edge_m);
  const uint32_t size[3] = {(uint32_t)ceil((high.x - low.x) / edge_m) + 1,
                            (uint32_t)ceil((high.y - low.y) / edge_m) + 1,
                            (uint32_t)ceil((high.z - low.z) / edge_m) + 1};
  float *value = SONDE_NEW(float, (size_t)size[0] * size[1] * size[2]);
  if (!value) return sonde_fail_memory(error);
  const double deep = 0.02; // the values are 1 at the surface and 0 this far outside
  size_t i = 0;
  for (uint32_t z = 0; z < size[2]; ++z)
    for (uint32_t y = 0; y < size[1]; ++y)
      for (uint32_t x = 0; x < size[0]; ++x, ++i) {
        sonde_vec3 p = vec3(low.x + x * edge_m, low.y + y * edge_m, low.z + z * edge_m);
        value[i] = (float)fmax(0, 1 - limb_one_bone(b, bone, p) / deep);
      }
  sonde_status status = sonde_isosurface_create(value, size, 1, mesh, error);
  sonde_free(value);
  if (status) return status;
  for (uint32_t k = 0; k < mesh->vertex_count; ++k)
    mesh->vertices[k] = v_madd(low, edge_m, mesh->vertices[k]);
  if (limb->body.side == SONDE_LIMB_LEFT) mirror(mesh, -1, 1);
  return SONDE_OK;
}
