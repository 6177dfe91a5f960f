// Probes: built-in boxes and the sphere, and convex hulls of mesh files.
//
//   make_box       flat probes; the contact face is z = 0
//   sonde_probe_rectangle  sides of the box that a name rect:AxB asks for
//   make_sphere    geodesic sphere with the volume of the true one; a vertex is the deepest point
//   make_from_file hull of a file's vertices, moved so that its contact end is the origin
#include "geometry/internal.h"

#include <string.h>
#include <strings.h>

enum { SPHERE_SUBDIVISION = 4 }; // 20 * 4^2 = 320 faces
#define SPHERE_RADIUS_M 15e-3
#define CONTACT_BAND_M 1e-3 // vertices this near the contact end belong to the contact face
#define RECT_LENGTH_M 60e-3
#define RECT_SIDE_MAX_MM 200.0
#define FILE_TOLERANCE_M 5e-5 // detail of a mesh file that the hull may leave out

typedef struct box_shape {
  const char *name;
  double half_x_m, half_y_m, length_m;
} box_shape;

static const box_shape boxes[] = {
    {"point", 3e-3, 3e-3, 60e-3}, {"linear", 30e-3, 6e-3, 80e-3}, {"square", 12e-3, 12e-3, 60e-3}};

const char *const *sonde_probe_names(void) {
  static const char *const names[] = {"point", "linear", "square", "sphere", NULL};
  return names;
}

static sonde_status make_box(const box_shape *shape, sonde_probe *probe, sonde_error *error) {
  SONDE_ASSERT(shape->half_x_m > 0 && shape->half_y_m > 0 && shape->length_m > 0);
  sonde_vec3 corners[8];
  for (int k = 0; k < 8; ++k)
    corners[k] = vec3(k & 1 ? shape->half_x_m : -shape->half_x_m,
                      k & 2 ? shape->half_y_m : -shape->half_y_m, k & 4 ? 0 : -shape->length_m);
  probe->half_x_m = shape->half_x_m;
  probe->half_y_m = shape->half_y_m;
  probe->rectangular = true;
  return sonde_convex_hull(corners, 8, &probe->body, error);
}

// Reads one side in mm from *text and moves behind it; false outside 0.1 to 200 mm.
static bool read_side(const char **text, double *half_m) {
  const char *end;
  double side_mm = sonde_parse_real(*text, &end);
  bool good = end != *text && side_mm >= 0.1 && side_mm <= RECT_SIDE_MAX_MM;
  *half_m = side_mm * 0.5e-3;
  *text = end;
  return good;
}

bool sonde_probe_rectangle(const char *name, double *half_x_m, double *half_y_m) {
  SONDE_ASSERT(name != NULL && half_x_m != NULL && half_y_m != NULL);
  if (strncmp(name, "rect:", 5) != 0) return false;
  const char *text = name + 5;
  return read_side(&text, half_x_m) && *text++ == 'x' && read_side(&text, half_y_m) && !*text;
}

static sonde_status make_rectangle(const char *name, sonde_probe *probe, sonde_error *error) {
  box_shape shape = {.name = name, .length_m = RECT_LENGTH_M};
  if (!sonde_probe_rectangle(name, &shape.half_x_m, &shape.half_y_m))
    return sonde_fail(error, SONDE_NOT_FOUND,
                      "probe \"%.40s\": expected rect:AxB with sides from 0.1 to %g mm, such as "
                      "rect:24x24",
                      name, RECT_SIDE_MAX_MM);
  return make_box(&shape, probe, error);
}

// ---- sphere -------------------------------------------------------------------------------

// Icosahedron with a vertex on +z: poles 0 and 11, rings 1..5 and 6..10.
static void icosahedron(sonde_vec3 v[12], int faces[20][3]) {
  double height = 1 / sqrt(5.0), ring = 2 / sqrt(5.0);
  v[0] = vec3(0, 0, 1);
  v[11] = vec3(0, 0, -1);
  for (int k = 0; k < 5; ++k) {
    double upper = 2 * SONDE_PI * k / 5, lower = upper + SONDE_PI / 5;
    v[1 + k] = vec3(ring * cos(upper), ring * sin(upper), height);
    v[6 + k] = vec3(ring * cos(lower), ring * sin(lower), -height);
    int a = 1 + k, b = 1 + (k + 1) % 5, c = 6 + k, d = 6 + (k + 1) % 5;
    int four[4][3] = {{0, a, b}, {a, c, b}, {b, c, d}, {11, d, c}};
    memcpy(faces[4 * k], four, sizeof four);
  }
}

// Points of the subdivided faces on the unit sphere; shared ones come once per face. The hull
// drops repeated points. Returns their number.
static uint32_t sphere_points(sonde_vec3 *points) {
  sonde_vec3 v[12];
  int faces[20][3];
  uint32_t count = 0, n = SPHERE_SUBDIVISION;
  icosahedron(v, faces);
  for (int f = 0; f < 20; ++f)
    for (uint32_t i = 0; i <= n; ++i)
      for (uint32_t j = 0; i + j <= n; ++j) {
        sonde_vec3 p = v_scale(v[faces[f][0]], (double)(n - i - j));
        p = v_madd(p, (double)i, v[faces[f][1]]);
        p = v_madd(p, (double)j, v[faces[f][2]]);
        points[count++] = v_unit(p, vec3(0, 0, 1));
      }
  return count;
}

static sonde_status make_sphere(double radius_m, sonde_probe *probe, sonde_error *error) {
  enum { PER_FACE = (SPHERE_SUBDIVISION + 1) * (SPHERE_SUBDIVISION + 2) / 2 };
  sonde_vec3 points[20 * PER_FACE];
  sonde_convex unit = {0};
  sonde_mesh_report report = {0};
  uint32_t count = sphere_points(points);
  SONDE_ASSERT(count == SONDE_COUNT_OF(points));
  // Points of neighbouring faces agree up to rounding only: a tolerance keeps one of them.
  sonde_status status = sonde_convex_hull_within(points, count, 1e-9, &unit, error);
  if (!status) status = sonde_mesh_inspect(&unit.hull, &report, error);
  if (!status) {
    double radius = radius_m * cbrt(4 * SONDE_PI / 3 / report.volume_m3);
    for (uint32_t k = 0; k < unit.hull.vertex_count; ++k) {
      sonde_vec3 p = unit.hull.vertices[k];
      points[k] = v_scale(vec3(p.x, p.y, p.z - 1), radius);
    }
    status = sonde_convex_hull(points, unit.hull.vertex_count, &probe->body, error);
  }
  sonde_convex_clear(&unit);
  double band = fmin(CONTACT_BAND_M, radius_m);
  probe->half_x_m = probe->half_y_m = sqrt(2 * radius_m * band - band * band);
  probe->rectangular = false;
  return status;
}

// The radius in mm behind "ball:"; its polyhedron has the ball's volume.
static sonde_status make_ball(const char *name, sonde_probe *probe, sonde_error *error) {
  const char *end;
  double radius_mm = sonde_parse_real(name + 5, &end);
  if (end == name + 5 || *end || !(radius_mm >= 1 && radius_mm <= 200))
    return sonde_fail(error, SONDE_NOT_FOUND,
                      "probe \"%.40s\": expected ball:R with a radius from 1 to 200 mm, such as "
                      "ball:30",
                      name);
  probe->ball_radius_m = radius_mm * 1e-3;
  return make_sphere(probe->ball_radius_m, probe, error);
}

// ---- files --------------------------------------------------------------------------------

// Moves the points so that their highest z is 0 and the middle of the contact end is the origin.
static void seat(sonde_mesh *mesh) {
  SONDE_ASSERT(mesh->vertex_count > 0);
  double top = -INFINITY;
  for (uint32_t k = 0; k < mesh->vertex_count; ++k) top = fmax(top, mesh->vertices[k].z);
  sonde_vec3 low = vec3(INFINITY, INFINITY, top), high = vec3(-INFINITY, -INFINITY, top);
  for (uint32_t k = 0; k < mesh->vertex_count; ++k) {
    sonde_vec3 p = mesh->vertices[k];
    if (p.z < top - CONTACT_BAND_M) continue;
    low = vec3(fmin(low.x, p.x), fmin(low.y, p.y), top);
    high = vec3(fmax(high.x, p.x), fmax(high.y, p.y), top);
  }
  sonde_vec3 middle = v_lerp(low, high, 0.5);
  for (uint32_t k = 0; k < mesh->vertex_count; ++k)
    mesh->vertices[k] = v_sub(mesh->vertices[k], middle);
}

// Half extents of the part of the body within CONTACT_BAND_M of its contact end: corners there, and
// where the plane at that height cuts an edge. So a tip or an edge has a face too.
static void measure_face(sonde_probe *probe) {
  const sonde_convex *body = &probe->body;
  sonde_vec3 low = vec3(INFINITY, INFINITY, 0), high = vec3(-INFINITY, -INFINITY, 0);
  for (uint32_t e = 0; e < body->topology.edge_count; ++e) {
    sonde_vec3 a = body->hull.vertices[body->topology.edges[e][0]];
    sonde_vec3 b = body->hull.vertices[body->topology.edges[e][1]];
    if (fmax(a.z, b.z) < -CONTACT_BAND_M) continue;
    if (a.z < -CONTACT_BAND_M) a = v_lerp(b, a, (b.z + CONTACT_BAND_M) / (b.z - a.z));
    if (b.z < -CONTACT_BAND_M) b = v_lerp(a, b, (a.z + CONTACT_BAND_M) / (a.z - b.z));
    low = vec3(fmin(low.x, fmin(a.x, b.x)), fmin(low.y, fmin(a.y, b.y)), 0);
    high = vec3(fmax(high.x, fmax(a.x, b.x)), fmax(high.y, fmax(a.y, b.y)), 0);
  }
  probe->half_x_m = (high.x - low.x) / 2;
  probe->half_y_m = (high.y - low.y) / 2;
  SONDE_ASSERT(probe->half_x_m > 0 && probe->half_y_m > 0);
}

// The largest extent of a probe in a file, and the smallest of the largest.
static const double WIDEST_M = 0.5, NARROWEST_M = 1e-3;

static sonde_status check_size(const char *path, const sonde_mesh *mesh, sonde_error *error) {
  sonde_vec3 low = mesh->vertices[0], high = low;
  for (uint32_t k = 1; k < mesh->vertex_count; ++k) {
    sonde_vec3 p = mesh->vertices[k];
    low = vec3(fmin(low.x, p.x), fmin(low.y, p.y), fmin(low.z, p.z));
    high = vec3(fmax(high.x, p.x), fmax(high.y, p.y), fmax(high.z, p.z));
  }
  double size_m = fmax(high.x - low.x, fmax(high.y - low.y, high.z - low.z));
  if (size_m >= NARROWEST_M && size_m <= WIDEST_M) return SONDE_OK;
  return sonde_fail(error, SONDE_ARGUMENT,
                    "%s: the probe is %.6g mm wide, expected at %s %g; is it in millimetres?", path,
                    1e3 * size_m, size_m > WIDEST_M ? "most" : "least",
                    1e3 * (size_m > WIDEST_M ? WIDEST_M : NARROWEST_M));
}

static sonde_status make_from_file(const char *path, sonde_probe *probe, sonde_error *error) {
  sonde_mesh mesh = {0};
  sonde_error cause = {0};
  sonde_status status = sonde_mesh_load(path, 1e-3, &mesh, error);
  if (!status) status = check_size(path, &mesh, error);
  if (!status) {
    seat(&mesh);
    status = sonde_convex_hull_within(mesh.vertices, mesh.vertex_count, FILE_TOLERANCE_M,
                                      &probe->body, &cause);
    if (status)
      sonde_fail(error, status, "%s: no probe can be made of it: %s", path, cause.message);
  }
  if (!status && probe->body.plane_count > SONDE_MAX_PROBE_PLANES)
    status = sonde_fail(error, SONDE_MESH, "%s: its hull has %u planes, expected at most %d", path,
                        probe->body.plane_count, SONDE_MAX_PROBE_PLANES);
  if (!status) measure_face(probe);
  sonde_mesh_clear(&mesh);
  return status;
}

static bool is_path(const char *name) {
  size_t length = strlen(name);
  const char *ending = length >= 4 ? name + length - 4 : "";
  return strchr(name, '/') || !strcasecmp(ending, ".ply") || !strcasecmp(ending, ".obj") ||
         !strcasecmp(ending, ".stl");
}

// The name of the probe: for a path the file's name without folder and ending.
static void set_name(sonde_probe *probe, const char *name, bool path) {
  SONDE_ASSERT(name[0] != 0);
  const char *slash = strrchr(name, '/');
  snprintf(probe->name, sizeof probe->name, "%s", slash ? slash + 1 : name);
  char *dot = strrchr(probe->name, '.');
  if (path && dot && dot != probe->name) *dot = 0;
}

sonde_status sonde_probe_create(const char *name_or_path, sonde_probe *probe, sonde_error *error) {
  SONDE_ASSERT(name_or_path != NULL && probe != NULL);
  *probe = (sonde_probe){0};
  bool rectangle = !strncmp(name_or_path, "rect:", 5);
  bool path = !rectangle && is_path(name_or_path);
  const box_shape *box = NULL;
  for (size_t k = 0; k < SONDE_COUNT_OF(boxes); ++k)
    if (!strcmp(name_or_path, boxes[k].name)) box = &boxes[k];
  sonde_status status;
  if (box)
    status = make_box(box, probe, error);
  else if (!strcmp(name_or_path, "sphere"))
    status = make_sphere(SPHERE_RADIUS_M, probe, error);
  else if (!strncmp(name_or_path, "ball:", 5))
    status = make_ball(name_or_path, probe, error);
  else if (rectangle)
    status = make_rectangle(name_or_path, probe, error);
  else if (path)
    status = make_from_file(name_or_path, probe, error);
  else
    status = sonde_fail(error, SONDE_NOT_FOUND,
                        "no probe is called \"%.40s\"; known are point, linear, square, sphere, "
                        "rect:AxB, ball:R (mm) and mesh files (.ply, .obj, .stl)",
                        name_or_path);
  if (status)
    sonde_probe_clear(probe);
  else
    set_name(probe, name_or_path, path);
  return status;
}

void sonde_probe_clear(sonde_probe *probe) {
  if (!probe) return;
  sonde_convex_clear(&probe->body);
  *probe = (sonde_probe){0};
}
