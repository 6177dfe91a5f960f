// Mesh files by extension: reading into memory, and the writers. Texts are written in the C locale
// whatever locale the program has set, STL in binary with single precision.
#include "geometry/internal.h"

#include "base/bounds.h"
#include "base/bytes.h"

#include <locale.h>
#include <string.h>
#include <strings.h>

typedef enum kind { PLY, OBJ, STL, UNKNOWN } kind;

static kind file_kind(const char *path) {
  static const char *const endings[] = {".ply", ".obj", ".stl"};
  size_t length = strlen(path);
  for (int k = 0; k < UNKNOWN; ++k)
    if (length >= 4 && !strcasecmp(path + length - 4, endings[k])) return (kind)k;
  return UNKNOWN;
}

static sonde_status check_arguments(const char *path, double metres_per_unit, sonde_error *error) {
  if (!isfinite(metres_per_unit) || !(metres_per_unit > 0))
    return sonde_fail(error, SONDE_ARGUMENT,
                      "%s: metres per unit is %g, expected a positive number", path,
                      metres_per_unit);
  if (file_kind(path) == UNKNOWN)
    return sonde_fail(error, SONDE_ARGUMENT, "%s: expected a name ending in .ply, .obj or .stl",
                      path);
  return SONDE_OK;
}

typedef sonde_status (*read_fn)(const char *path, const char *bytes, size_t count,
                                sonde_mesh_builder *builder, sonde_error *error);
static const read_fn readers[] = {
    [PLY] = sonde_ply_read, [OBJ] = sonde_obj_read, [STL] = sonde_stl_read};

sonde_status sonde_mesh_load(const char *path, double metres_per_unit, sonde_mesh *mesh,
                             sonde_error *error) {
  SONDE_ASSERT(path != NULL && mesh != NULL);
  *mesh = (sonde_mesh){0};
  char *bytes = NULL;
  size_t count = 0;
  sonde_mesh_builder builder = {.scale = metres_per_unit};
  sonde_status status = check_arguments(path, metres_per_unit, error);
  if (!status) status = sonde_bounded_load(path, &sonde_limits_mesh, &bytes, &count, error);
  if (!status) status = readers[file_kind(path)](path, bytes, count, &builder, error);
  uint64_t most = sonde_limits_mesh.most_items;
  if (status == SONDE_MEMORY &&
      (builder.mesh.vertex_count >= most || builder.mesh.face_count >= most))
    status = sonde_fail(error, SONDE_FORMAT, "%s: expected at most %llu vertices and faces", path,
                        (unsigned long long)most);
  if (!status && !builder.mesh.face_count)
    status = sonde_fail(error, SONDE_FORMAT, "%s: expected at least one face, found none", path);
  for (uint32_t v = 0; v < builder.mesh.vertex_count && !status; ++v)
    if (!(v_norm(builder.mesh.vertices[v]) <= SONDE_FARTHEST_M))
      status = sonde_fail(error, SONDE_FORMAT,
                          "%s: vertex %u lies %.3g m from the origin, expected at most %g", path, v,
                          v_norm(builder.mesh.vertices[v]), SONDE_FARTHEST_M);
  if (!status)
    *mesh = builder.mesh;
  else
    sonde_mesh_clear(&builder.mesh);
  sonde_free(bytes);
  return status;
}

// ---- writers ------------------------------------------------------------------------------

static void put_point(bytes_cursor *record, sonde_vec3 point) {
  bytes_f32(record, point.x);
  bytes_f32(record, point.y);
  bytes_f32(record, point.z);
}

sonde_status sonde_mesh_save(const char *path, double metres_per_unit, const sonde_mesh *mesh,
                             sonde_error *error) {
  SONDE_ASSERT(path != NULL && mesh != NULL);
  sonde_status status = check_arguments(path, metres_per_unit, error);
  if (status) return status;
  sonde_file *file = NULL;
  locale_t c_locale = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  if (!c_locale) return sonde_fail_memory(error);
  locale_t previous = uselocale(c_locale);
  status = sonde_file_create(path, &file, error);
  if (!status) {
    kind format = file_kind(path);
    if (format == STL) {
      unsigned char head[84] = "binary STL", triangle[50] = {0};
      bytes_u32(&(bytes_cursor){head + 80, 4, 0}, mesh->face_count);
      sonde_file_write(file, head, sizeof head);
      for (uint32_t f = 0; f < mesh->face_count; ++f) {
        bytes_cursor record = {triangle, sizeof triangle, 0};
        put_point(&record, v_unit(sonde_face_cross(mesh, f), vec3(0, 0, 0)));
        for (int k = 0; k < 3; ++k)
          put_point(&record, v_scale(mesh->vertices[mesh->faces[f][k]], 1.0 / metres_per_unit));
        sonde_file_write(file, triangle, sizeof triangle);
      }
    } else {
      bool ply = format == PLY;
      if (ply)
        sonde_file_printf(file,
                          "ply\nformat ascii 1.0\nelement vertex %u\nproperty double x\n"
                          "property double y\nproperty double z\nelement face %u\n"
                          "property list uchar uint vertex_indices\nend_header\n",
                          mesh->vertex_count, mesh->face_count);
      for (uint32_t v = 0; v < mesh->vertex_count; ++v) {
        sonde_vec3 p = mesh->vertices[v];
        sonde_file_printf(file, "%s%.17g %.17g %.17g\n", ply ? "" : "v ", p.x / metres_per_unit,
                          p.y / metres_per_unit, p.z / metres_per_unit);
      }
      uint32_t base = ply ? 0 : 1;
      for (uint32_t f = 0; f < mesh->face_count; ++f) {
        const uint32_t *v = mesh->faces[f];
        sonde_file_printf(file, "%s %u %u %u\n", ply ? "3" : "f", v[0] + base, v[1] + base,
                          v[2] + base);
      }
    }
    status = sonde_file_commit(file, error);
  }
  uselocale(previous);
  freelocale(c_locale);
  return status;
}
