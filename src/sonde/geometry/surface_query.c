// Queries of the surface index; they allocate nothing.
#include "geometry/surface.h"
#include "geometry/triangle.h"

// By the Voronoi regions of corners, sides and face.
void sonde_triangle_closest(sonde_vec3 p, sonde_vec3 a, sonde_vec3 b, sonde_vec3 c, double w[3]) {
  sonde_vec3 ab = v_sub(b, a), ac = v_sub(c, a), ap = v_sub(p, a);
  double d1 = v_dot(ab, ap), d2 = v_dot(ac, ap);
  w[0] = w[1] = w[2] = 0;
  if (d1 <= 0 && d2 <= 0) {
    w[0] = 1;
    return;
  }
  sonde_vec3 bp = v_sub(p, b), cp = v_sub(p, c);
  double d3 = v_dot(ab, bp), d4 = v_dot(ac, bp), d5 = v_dot(ab, cp), d6 = v_dot(ac, cp);
  if (d3 >= 0 && d4 <= d3) {
    w[1] = 1;
    return;
  }
  if (d6 >= 0 && d5 <= d6) {
    w[2] = 1;
    return;
  }
  double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) {
    w[1] = d1 / (d1 - d3);
    w[0] = 1 - w[1];
  } else if (vb <= 0 && d2 >= 0 && d6 <= 0) {
    w[2] = d2 / (d2 - d6);
    w[0] = 1 - w[2];
  } else if (va <= 0 && d4 >= d3 && d5 >= d6) {
    w[2] = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    w[1] = 1 - w[2];
  } else {
    w[1] = vb / (va + vb + vc);
    w[2] = vc / (va + vb + vc);
    w[0] = 1 - w[1] - w[2];
  }
}

static double box_distance2(const surface_node *node, sonde_vec3 p) {
  double x = fmax(fmax(node->low.x - p.x, p.x - node->high.x), 0);
  double y = fmax(fmax(node->low.y - p.y, p.y - node->high.y), 0);
  double z = fmax(fmax(node->low.z - p.z, p.z - node->high.z), 0);
  return x * x + y * y + z * z;
}

// Branch and bound over the tree, the nearer box first.
sonde_surface_point sonde_surface_closest(const sonde_surface_index *index, sonde_vec3 query) {
  SONDE_ASSERT(index != NULL && index->node_count > 0);
  const sonde_vec3 *x = index->mesh.vertices;
  uint32_t stack[SURFACE_STACK], depth = 0;
  double bound[SURFACE_STACK], best2 = INFINITY;
  sonde_surface_point best = {0};
  stack[depth] = 0;
  bound[depth++] = box_distance2(&index->nodes[0], query);
  while (depth) {
    uint32_t at = stack[--depth];
    if (bound[depth] >= best2) continue;
    const surface_node *node = &index->nodes[at];
    for (uint32_t i = node->first; i < node->first + node->count; ++i) {
      sonde_surface_point trial = {.face = index->order[i]};
      const uint32_t *v = index->mesh.faces[trial.face];
      double *w = trial.weight;
      sonde_triangle_closest(query, x[v[0]], x[v[1]], x[v[2]], w);
      trial.point_m = v_madd(v_madd(v_scale(x[v[0]], w[0]), w[1], x[v[1]]), w[2], x[v[2]]);
      double d2 = v_norm2(v_sub(query, trial.point_m));
      if (d2 < best2) {
        best2 = d2;
        best = trial;
      }
    }
    if (node->count) continue;
    SONDE_ASSERT(depth + 2 <= SURFACE_STACK);
    uint32_t near = at + 1, far = node->first;
    double d_near = box_distance2(&index->nodes[near], query);
    double d_far = box_distance2(&index->nodes[far], query);
    bool swap = d_far < d_near;
    stack[depth] = swap ? near : far;
    bound[depth++] = swap ? d_near : d_far;
    stack[depth] = swap ? far : near;
    bound[depth++] = swap ? d_far : d_near;
  }
  best.distance_m = sqrt(best2);
  return best;
}

// ---- rays ---------------------------------------------------------------------------------

// The shear takes the direction to the axis z, its largest component, and leaves the cross-section
// in x and y.
typedef struct ray {
  sonde_vec3 origin, direction, inverse;
  int x, y, z; // axes in turned order
  double shear_x, shear_y, scale;
} ray;

static sonde_vec3 sheared(const ray *r, sonde_vec3 p) {
  sonde_vec3 from = v_sub(p, r->origin);
  double z = v_coordinate(from, r->z);
  return vec3(v_coordinate(from, r->x) - r->shear_x * z, v_coordinate(from, r->y) - r->shear_y * z,
              z * r->scale);
}

// The stretch of the ray between two planes; a ray along them is between them or it is not.
static void narrow(double origin, double inverse, double low, double high, double *enter,
                   double *leave) {
  if (isinf(inverse)) {
    if (origin < low || origin > high) *leave = -INFINITY;
    return;
  }
  double a = (low - origin) * inverse, b = (high - origin) * inverse;
  *enter = fmax(*enter, fmin(a, b));
  *leave = fmin(*leave, fmax(a, b));
}

// Sheared so, the ray is the axis x = y = 0 and a side's sign is that of one cross product, which
// two faces that share the side compute alike but for the sign: no ray slips between them. A ray on
// a side or corner hits (Woop, Benthin and Wald 2013).
static bool hit_triangle(const ray *r, sonde_vec3 a, sonde_vec3 b, sonde_vec3 c, double *t,
                         double w[3]) {
  sonde_vec3 p = sheared(r, a), q = sheared(r, b), s = sheared(r, c);
  double on_a = s.x * q.y - s.y * q.x, on_b = p.x * s.y - p.y * s.x, on_c = q.x * p.y - q.y * p.x;
  bool negative = on_a < 0 || on_b < 0 || on_c<0, positive = on_a> 0 || on_b > 0 || on_c > 0;
  double sum = on_a + on_b + on_c;
  if (negative == positive || sum == 0) return false;
  w[0] = on_a / sum;
  w[1] = on_b / sum;
  w[2] = on_c / sum;
  *t = w[0] * p.z + w[1] * q.z + w[2] * s.z;
  return true;
}

bool sonde_surface_raycast(const sonde_surface_index *index, sonde_vec3 origin,
                           sonde_vec3 direction, double max_distance_m, sonde_surface_point *hit) {
  SONDE_ASSERT(index != NULL && index->node_count > 0);
  *hit = (sonde_surface_point){0};
  double length = v_norm(direction);
  if (!(length > 0)) return false;
  direction = v_scale(direction, 1.0 / length);
  double along_x = fabs(direction.x), along_y = fabs(direction.y), along_z = fabs(direction.z);
  ray r = {.origin = origin, .direction = direction};
  r.inverse = vec3(1 / direction.x, 1 / direction.y, 1 / direction.z);
  r.z = along_x >= along_y && along_x >= along_z ? 0 : along_y >= along_z ? 1 : 2;
  r.x = (r.z + 1) % 3;
  r.y = (r.z + 2) % 3;
  r.scale = 1 / v_coordinate(direction, r.z);
  r.shear_x = v_coordinate(direction, r.x) * r.scale;
  r.shear_y = v_coordinate(direction, r.y) * r.scale;

  const sonde_vec3 *x = index->mesh.vertices;
  sonde_surface_point best = {.distance_m = max_distance_m};
  uint32_t stack[SURFACE_STACK], depth = 0;
  bool found = false;
  stack[depth++] = 0;
  while (depth) {
    uint32_t at = stack[--depth];
    const surface_node *node = &index->nodes[at];
    double enter = 0, leave = best.distance_m;
    narrow(origin.x, r.inverse.x, node->low.x, node->high.x, &enter, &leave);
    narrow(origin.y, r.inverse.y, node->low.y, node->high.y, &enter, &leave);
    narrow(origin.z, r.inverse.z, node->low.z, node->high.z, &enter, &leave);
    if (!(enter <= leave * (1 + 1e-12) + 1e-12)) continue;
    for (uint32_t i = node->first; i < node->first + node->count; ++i) {
      sonde_surface_point trial = {.face = index->order[i]};
      const uint32_t *v = index->mesh.faces[trial.face];
      if (!hit_triangle(&r, x[v[0]], x[v[1]], x[v[2]], &trial.distance_m, trial.weight)) continue;
      if (trial.distance_m < 0 || trial.distance_m > best.distance_m) continue;
      if (found && trial.distance_m == best.distance_m && trial.face > best.face) continue;
      best = trial;
      found = true;
    }
    if (node->count) continue;
    SONDE_ASSERT(depth + 2 <= SURFACE_STACK);
    stack[depth++] = node->first;
    stack[depth++] = at + 1;
  }
  if (!found) return false;
  best.point_m = v_madd(origin, best.distance_m, direction);
  *hit = best;
  return true;
}

// ---- inside -------------------------------------------------------------------------------

double sonde_surface_signed_distance(const sonde_surface_index *index, sonde_vec3 query) {
  SONDE_ASSERT(index != NULL);
  sonde_surface_point closest = sonde_surface_closest(index, query);
  // Normal of the corner, side or face that the closest point lies on. With angle weights at
  // corners the sign of (query - closest) . normal is right for every closed surface (Baerentzen
  // and Aanaes 2005).
  const double *w = closest.weight;
  sonde_vec3 normal = index->face_normal[closest.face];
  for (int k = 2; k >= 0; --k)
    if (w[k] == 0 && w[(k + 1) % 3] > 0 && w[(k + 2) % 3] > 0)
      normal = index->side_normal[closest.face][(k + 1) % 3];
  for (int k = 2; k >= 0; --k)
    if (w[k] == 1) normal = index->vertex_normal[index->mesh.faces[closest.face][k]];
  bool inside = v_dot(v_sub(query, closest.point_m), normal) < 0;
  return inside ? -closest.distance_m : closest.distance_m;
}

bool sonde_surface_inside(const sonde_surface_index *index, sonde_vec3 query) {
  return sonde_surface_signed_distance(index, query) < 0;
}
