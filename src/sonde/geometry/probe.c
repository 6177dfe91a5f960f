// Probes: built-in boxes and the sphere, and convex hulls of mesh files.
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

// Flat probe; the contact face is z = 0.
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

// ---- sphere -------------------------------------------------------------------------------

// Geodesic sphere with the volume of the true one; a vertex is the deepest point.
static sonde_status make_sphere(double radius_m, sonde_probe *probe, sonde_error *error) {
  // Icosahedron with a vertex on +z: poles 0 and 11, rings 1..5 and 6..10.
  SONDE_ASSERT(radius_m > 0);
  sonde_vec3 v[12];
  int faces[20][3];
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

  // Points of the subdivided faces on the unit sphere; shared ones come once per face and agree up
  // to rounding only: the hull's tolerance keeps one of them.
  enum { N = SPHERE_SUBDIVISION, PER_FACE = (N + 1) * (N + 2) / 2 };
  sonde_vec3 points[20 * PER_FACE];
  uint32_t count = 0;
  for (int f = 0; f < 20; ++f)
    for (uint32_t i = 0; i <= N; ++i)
      for (uint32_t j = 0; i + j <= N; ++j) {
        sonde_vec3 p = v_scale(v[faces[f][0]], (double)(N - i - j));
        p = v_madd(p, (double)i, v[faces[f][1]]);
        p = v_madd(p, (double)j, v[faces[f][2]]);
        points[count++] = v_unit(p, vec3(0, 0, 1));
      }
  SONDE_ASSERT(count == SONDE_COUNT_OF(points));

  sonde_convex unit = {0};
  sonde_mesh_report report = {0};
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

// ---- files --------------------------------------------------------------------------------

// The largest extent of a probe in a file, and the smallest of the largest.
static const double WIDEST_M = 0.5, NARROWEST_M = 1e-3;

// Hull of a mesh file in mm, moved so that the middle of its contact end is the origin.
static sonde_status make_from_file(const char *path, sonde_probe *probe, sonde_error *error) {
  sonde_mesh mesh = {0};
  sonde_status status = sonde_mesh_load(path, 1e-3, &mesh, error);
  if (status) return status;
  sonde_vec3 low = mesh.vertices[0], high = low;
  for (uint32_t k = 1; k < mesh.vertex_count; ++k) {
    low = v_min(low, mesh.vertices[k]);
    high = v_max(high, mesh.vertices[k]);
  }
  double top = high.z, size_m = fmax(high.x - low.x, fmax(high.y - low.y, high.z - low.z));
  if (!(size_m >= NARROWEST_M && size_m <= WIDEST_M))
    status = sonde_fail(error, SONDE_ARGUMENT,
                        "%s: the probe is %.6g mm wide, expected at %s %g; is it in millimetres?",
                        path, 1e3 * size_m, size_m > WIDEST_M ? "most" : "least",
                        1e3 * (size_m > WIDEST_M ? WIDEST_M : NARROWEST_M));

  low = vec3(INFINITY, INFINITY, top), high = vec3(-INFINITY, -INFINITY, top);
  for (uint32_t k = 0; k < mesh.vertex_count; ++k) {
    sonde_vec3 p = mesh.vertices[k];
    if (p.z < top - CONTACT_BAND_M) continue;
    low = v_min(low, vec3(p.x, p.y, top));
    high = v_max(high, vec3(p.x, p.y, top));
  }
  sonde_vec3 middle = v_lerp(low, high, 0.5);
  for (uint32_t k = 0; k < mesh.vertex_count; ++k)
    mesh.vertices[k] = v_sub(mesh.vertices[k], middle);

  const sonde_convex *body = &probe->body;
  sonde_error cause = {0};
  if (!status) {
    status = sonde_convex_hull_within(mesh.vertices, mesh.vertex_count, FILE_TOLERANCE_M,
                                      &probe->body, &cause);
    if (status)
      sonde_fail(error, status, "%s: no probe can be made of it: %s", path, cause.message);
  }
  sonde_mesh_clear(&mesh);
  if (!status && body->plane_count > SONDE_MAX_PROBE_PLANES)
    status = sonde_fail(error, SONDE_MESH, "%s: its hull has %u planes, expected at most %d", path,
                        body->plane_count, SONDE_MAX_PROBE_PLANES);
  if (status) return status;

  // Half extents of the part of the body within CONTACT_BAND_M of its contact end: corners there,
  // and where the plane at that height crosses an edge. So a tip or an edge has a face too.
  low = vec3(INFINITY, INFINITY, 0), high = vec3(-INFINITY, -INFINITY, 0);
  for (uint32_t e = 0; e < body->topology.edge_count; ++e) {
    sonde_vec3 a = body->hull.vertices[body->topology.edges[e][0]];
    sonde_vec3 b = body->hull.vertices[body->topology.edges[e][1]];
    if (fmax(a.z, b.z) < -CONTACT_BAND_M) continue;
    if (a.z < -CONTACT_BAND_M) a = v_lerp(b, a, (b.z + CONTACT_BAND_M) / (b.z - a.z));
    if (b.z < -CONTACT_BAND_M) b = v_lerp(a, b, (a.z + CONTACT_BAND_M) / (a.z - b.z));
    low = v_min(low, v_min(a, b));
    high = v_max(high, v_max(a, b));
  }
  probe->half_x_m = (high.x - low.x) / 2;
  probe->half_y_m = (high.y - low.y) / 2;
  SONDE_ASSERT(probe->half_x_m > 0 && probe->half_y_m > 0);
  return SONDE_OK;
}

sonde_status sonde_probe_create(const char *name_or_path, sonde_probe *probe, sonde_error *error) {
  SONDE_ASSERT(name_or_path != NULL && probe != NULL);
  const char *name = name_or_path;
  *probe = (sonde_probe){0};
  size_t length = strlen(name);
  const char *ending = length >= 4 ? name + length - 4 : "", *end = NULL;
  bool rectangle = !strncmp(name, "rect:", 5), ball = !strncmp(name, "ball:", 5);
  bool path = !rectangle && (strchr(name, '/') || !strcasecmp(ending, ".ply") ||
                             !strcasecmp(ending, ".obj") || !strcasecmp(ending, ".stl"));
  const box_shape *box = NULL;
  for (size_t k = 0; k < SONDE_COUNT_OF(boxes); ++k)
    if (!strcmp(name, boxes[k].name)) box = &boxes[k];
  box_shape asked = {.name = name, .length_m = RECT_LENGTH_M};
  double radius_mm = ball ? sonde_parse_real(name + 5, &end) : 0;

  sonde_status status;
  if (box)
    status = make_box(box, probe, error);
  else if (!strcmp(name, "sphere"))
    status = make_sphere(SPHERE_RADIUS_M, probe, error);
  else if (ball && (end == name + 5 || *end || !(radius_mm >= 1 && radius_mm <= 200)))
    status = sonde_fail(error, SONDE_NOT_FOUND,
                        "probe \"%.40s\": expected ball:R with a radius from 1 to 200 mm, such as "
                        "ball:30",
                        name);
  else if (ball)
    status = make_sphere(probe->ball_radius_m = radius_mm * 1e-3, probe, error);
  else if (rectangle && !sonde_probe_rectangle(name, &asked.half_x_m, &asked.half_y_m))
    status = sonde_fail(error, SONDE_NOT_FOUND,
                        "probe \"%.40s\": expected rect:AxB with sides from 0.1 to %g mm, such as "
                        "rect:24x24",
                        name, RECT_SIDE_MAX_MM);
  else if (rectangle)
    status = make_box(&asked, probe, error);
  else if (path)
    status = make_from_file(name, probe, error);
  else
    status = sonde_fail(error, SONDE_NOT_FOUND,
                        "no probe is called \"%.40s\"; known are point, linear, square, sphere, "
                        "rect:AxB, ball:R (mm) and mesh files (.ply, .obj, .stl)",
                        name);
  if (status) {
    sonde_probe_clear(probe);
    return status;
  }

  // The name: for a path the file's name without folder and ending.
  const char *slash = strrchr(name, '/');
  snprintf(probe->name, sizeof probe->name, "%s", slash ? slash + 1 : name);
  char *dot = strrchr(probe->name, '.');
  if (path && dot && dot != probe->name) *dot = 0;
  return SONDE_OK;
}

void sonde_probe_clear(sonde_probe *probe) {
  if (!probe) return;
  sonde_convex_clear(&probe->body);
  *probe = (sonde_probe){0};
}
