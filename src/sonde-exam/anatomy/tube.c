// Tubes: tables over angle and height, and their meshes.
#include "anatomy/shape.h"

#include <stdlib.h>

enum { LEAST_RING = 5 };
static const double HEIGHT = 0.8660254037844386; // of an equilateral triangle

static double entry(const double *row, double column) {
  uint32_t i = (uint32_t)column;
  double t = column - i;
  return (1 - t) * row[i % SONDE_TUBE_COLUMNS] + t * row[(i + 1) % SONDE_TUBE_COLUMNS];
}

typedef struct row_place {
  uint32_t row;
  double t;
} row_place;

static row_place find_row(const sonde_tube *tube, double z_m) {
  SONDE_ASSERT(tube->length_m > 0);
  double at = clamp(z_m / tube->length_m, 0, 1) * (SONDE_TUBE_ROWS - 1);
  uint32_t row = (uint32_t)fmin(floor(at), SONDE_TUBE_ROWS - 2);
  return (row_place){row, at - row};
}

double sonde_tube_lookup(const sonde_tube *tube, double (*table)[SONDE_TUBE_COLUMNS], double angle,
                         double z_m) {
  double turn = angle / (2 * SONDE_PI), column = (turn - floor(turn)) * SONDE_TUBE_COLUMNS;
  row_place p = find_row(tube, z_m);
  return (1 - p.t) * entry(table[p.row], column) + p.t * entry(table[p.row + 1], column);
}

double sonde_tube_radius(const sonde_tube *tube, double angle, double z_m) {
  sonde_tube *t = (sonde_tube *)(uintptr_t)tube;
  return sonde_tube_lookup(tube, t->radius_m, angle, z_m);
}

static sonde_vec3 middle(const sonde_tube *tube, double z_m) {
  row_place p = find_row(tube, z_m);
  return vec3((1 - p.t) * tube->x_m[p.row] + p.t * tube->x_m[p.row + 1],
              (1 - p.t) * tube->y_m[p.row] + p.t * tube->y_m[p.row + 1], z_m);
}

sonde_vec3 sonde_tube_point(const sonde_tube *tube, double angle, double z_m) {
  double r = sonde_tube_radius(tube, angle, z_m);
  return v_add(middle(tube, z_m), vec3(r * cos(angle), r * sin(angle), 0));
}

sonde_vec3 sonde_tube_normal(const sonde_tube *tube, double angle, double z_m) {
  const double turn = 2 * 2 * SONDE_PI / SONDE_TUBE_COLUMNS;
  double step = 3 * tube->length_m / (SONDE_TUBE_ROWS - 1);
  double low = fmax(0, z_m - step), high = fmin(tube->length_m, z_m + step);
  sonde_vec3 around =
      v_sub(sonde_tube_point(tube, angle + turn, z_m), sonde_tube_point(tube, angle - turn, z_m));
  sonde_vec3 along = v_sub(sonde_tube_point(tube, angle, high), sonde_tube_point(tube, angle, low));
  return v_unit(v_cross(around, along), vec3(cos(angle), sin(angle), 0));
}

double sonde_tube_angle_of(const sonde_tube *tube, sonde_vec3 point_m) {
  sonde_vec3 d = v_sub(point_m, middle(tube, point_m.z));
  return atan2(d.y, d.x);
}

double sonde_tube_outside(const sonde_tube *tube, sonde_vec3 point_m) {
  sonde_vec3 d = v_sub(point_m, middle(tube, point_m.z));
  return v_norm(vec3(d.x, d.y, 0)) - sonde_tube_radius(tube, atan2(d.y, d.x), point_m.z);
}

double sonde_tube_girth(const sonde_tube *tube, double z_m) {
  double sum = 0;
  sonde_vec3 last = sonde_tube_point(tube, 0, z_m);
  for (uint32_t i = 1; i <= SONDE_TUBE_COLUMNS; ++i) {
    sonde_vec3 next = sonde_tube_point(tube, tube_angle(i), z_m);
    sum += v_distance(last, next);
    last = next;
  }
  return sum;
}

/* ---- mesh --------------------------------------------------------------------------------- */

typedef struct ring {
  uint32_t first, count; // vertices
  double z_m, scale;     // 1 on the outline, less on an end face
  double offset;         // of the first vertex, share of a step
} ring;

typedef struct plan {
  uint32_t rings, vertices, faces;
  ring *ring;
} plan;

static void add_ring(plan *p, uint32_t count, double z_m, double scale) {
  double offset = p->rings % 2 ? 0.5 : 0;
  p->ring[p->rings++] = (ring){p->vertices, count, z_m, scale, offset};
  p->vertices += count;
}

// An end of `inner` rings, 1/inner of the radius apart; ring `inner` is the outline itself.
static uint32_t inner_count(uint32_t around, uint32_t k, uint32_t inner) {
  SONDE_ASSERT(inner > 0 && k < inner);
  uint32_t count = (uint32_t)lround((double)around * k / inner);
  return k == 0 ? 1 : count < LEAST_RING ? (uint32_t)LEAST_RING : count;
}

static double share(const ring *r, uint32_t k) { return (k + r->offset) / r->count; }

sonde_status sonde_tube_mesh(const sonde_tube *tube, double edge_m, sonde_mesh *mesh,
                             sonde_error *error) {
  double girth = 0;
  for (int k = 0; k <= 4; ++k) girth += sonde_tube_girth(tube, tube->length_m * k / 4) / 5;
  uint32_t around = (uint32_t)lround(fmax(girth / edge_m, 12));
  uint32_t rows = (uint32_t)lround(fmax(tube->length_m / (edge_m * HEIGHT), 2));
  uint32_t inner = (uint32_t)lround(fmax(around / (2 * SONDE_PI * HEIGHT), 2));
  plan p = (plan){.ring = SONDE_NEW(ring, rows + 1 + 2 * inner)};
  if (!p.ring) return sonde_fail_memory(error);
  for (uint32_t k = 0; k < inner; ++k)
    add_ring(&p, inner_count(around, k, inner), 0, (double)k / inner);
  for (uint32_t j = 0; j <= rows; ++j)
    add_ring(&p, around, j == rows ? tube->length_m : tube->length_m * j / rows, 1);
  for (uint32_t k = inner; k-- > 0;)
    add_ring(&p, inner_count(around, k, inner), tube->length_m, (double)k / inner);
  for (uint32_t k = 0; k + 1 < p.rings; ++k) {
    uint32_t a = p.ring[k].count, b = p.ring[k + 1].count;
    p.faces += (a > 1 ? a : 0) + (b > 1 ? b : 0);
  }

  sonde_status status = sonde_mesh_create(mesh, p.vertices, p.faces, error);
  uint32_t used = 0;
  for (uint32_t k = 0; !status && k < p.rings; ++k) {
    SONDE_ASSERT(p.ring[k].count >= 1 && p.ring[k].scale >= 0);
    sonde_vec3 centre = middle(tube, p.ring[k].z_m), outline[SONDE_TUBE_COLUMNS + 1];
    double arc[SONDE_TUBE_COLUMNS + 1] = {0};
    for (uint32_t i = 0; i <= SONDE_TUBE_COLUMNS; ++i) {
      outline[i] = sonde_tube_point(tube, tube_angle(i), p.ring[k].z_m);
      if (i > 0) arc[i] = arc[i - 1] + v_distance(outline[i - 1], outline[i]);
    }
    uint32_t at = 0;
    for (uint32_t n = 0; n < p.ring[k].count; ++n) {
      double wanted = arc[SONDE_TUBE_COLUMNS] * (n + p.ring[k].offset) / p.ring[k].count;
      while (at + 1 < SONDE_TUBE_COLUMNS && arc[at + 1] < wanted) ++at;
      double t = (wanted - arc[at]) / (arc[at + 1] - arc[at]);
      sonde_vec3 corner = v_lerp(outline[at], outline[at + 1], t);
      mesh->vertices[p.ring[k].first + n] = v_whole_nm(v_lerp(centre, corner, p.ring[k].scale));
    }
    if (k > 0) {
      // The band of faces between two rings: always the shorter diagonal.
      const ring *a = &p.ring[k - 1], *b = &p.ring[k];
      const uint32_t ends_a = a->count > 1 ? a->count : 0, ends_b = b->count > 1 ? b->count : 0;
      for (uint32_t i = 0, j = 0; i < ends_a || j < ends_b;) {
        double on_a = fabs(share(a, i + 1) - share(b, j));
        double on_b = fabs(share(a, i) - share(b, j + 1));
        uint32_t *f = mesh->faces[used++];
        f[0] = a->first + i % a->count;
        f[2] = b->first + j % b->count;
        if (j == ends_b || (i < ends_a && on_a <= on_b))
          f[1] = a->first + ++i % a->count;
        else
          f[1] = b->first + ++j % b->count;
      }
    }
  }
  SONDE_ASSERT(status || used == mesh->face_count);
  sonde_free(p.ring);
  return status;
}
