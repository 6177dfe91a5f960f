// The solid of a leg at every update.
//
// sonde_window_update   touched points, forces, recovery
// touch                 one vertex of the skin that carries contact force
// apply, comply         displacement of the touched points under forces on them
// sample_patch          an even press of the touched rectangle
// respond               the response to the touched points' motion
// solve_forces          conjugate gradients on the forces
// sonde_window_field    trilinear in angle, row and level
// sonde_window_stress, list_elements  nodal means within a tissue, interpolated
// feel_vessels          stress of the elements around the vessels
#include "base/base.h"
#include "interior/window.h"

#include <string.h>

enum { NT = SONDE_WINDOW_THETA, NS = SONDE_WINDOW_S, NL = SONDE_WINDOW_LEVELS };
enum { SAMPLES_X = 21, SAMPLES_Y = 7 };
enum { SIDE = 3 * SONDE_WINDOW_NEAR, MOST_ITERATIONS = 80 };

static const double give = 0.02; // of the points' mean compliance: dense points do not fight
static const double sample_start_m = 0.08; // above the face
static const double held_share =
    0.25; // of a touched point's weight: the skin node goes with the face
static const double face_edge_m = 0.3e-3;
static const double tolerance = 2e-3; // of the prescribed motion

// ---- contact ------------------------------------------------------------------------------

static void touch(sonde_window *w, const sonde_interior *in, sonde_vec3 rest, sonde_vec3 move) {
  sonde_vec3 d = v_sub(rest, in->origin);
  const uint32_t first = SONDE_WINDOW_NEAR_FIRST;
  sonde_grid_cell c;
  double theta = atan2(v_dot(d, in->e2), v_dot(d, in->e1));
  if (!sonde_grid_columns(&w->grid, theta, v_dot(d, in->axis), &c)) return;
  if (c.i + 1 >= SONDE_WINDOW_NEAR_T || c.j < first || c.j + 1 >= first + SONDE_WINDOW_NEAR_S)
    return;
  if (w->touched_count == SONDE_WINDOW_TOUCHED) return;
  sonde_touched *t = &w->touched[w->touched_count++];
  for (int k = 0; k < 4; ++k) {
    t->weight[k] = c.weight[k];
    t->near[k] = (c.column[k] / NT - first) * SONDE_WINDOW_NEAR_T + c.column[k] % NT;
  }
  t->move[0] = v_dot(move, in->e1), t->move[1] = v_dot(move, in->e2);
  t->move[2] = v_dot(move, in->axis);
}

typedef struct contact {
  uint32_t count, active; // touched points; near nodes they use
  uint32_t *node, *place; // [active] those, [NEAR] where in that list
  double *force;          // [3*active]
  double *moved;          // [3*active]
  double *compliance;     // [3*active][3*active] of those nodes; row k: what a force on k moves
  double give;
} contact;

static void gather(const sonde_window *w, const double *f, const contact *c) {
  memset(c->force, 0, 3 * c->active * sizeof *c->force);
  for (uint32_t p = 0; p < c->count; ++p)
    for (int k = 0; k < 4; ++k) {
      double *at = c->force + 3 * c->place[w->touched[p].near[k]];
      for (int axis = 0; axis < 3; ++axis)
        at[axis] += w->touched[p].weight[k] * f[3 * p + (uint32_t)axis];
    }
}

// sum += of `rows` rows, each times its scale.
static inline void add_rows(double *restrict sum, const double *restrict row, size_t stride,
                            const double *restrict scale, int rows, uint32_t count) {
  for (uint32_t i = 0; i < count; ++i) {
    double s = sum[i];
    for (int k = 0; k < rows; ++k) s += scale[k] * row[(size_t)k * stride + i];
    sum[i] = s;
  }
}

// moved = compliance * force, two nodes at a time.
static void comply(const contact *c) {
  uint32_t n = 3 * c->active, k = 0;
  memset(c->moved, 0, n * sizeof *c->moved);
  for (; k + 6 <= n; k += 6)
    add_rows(c->moved, c->compliance + (size_t)k * n, n, c->force + k, 6, n);
  if (k < n) add_rows(c->moved, c->compliance + (size_t)k * n, n, c->force + k, 3, n);
}

static void apply(const sonde_window *w, const contact *c, const double *f, double *out) {
  gather(w, f, c);
  comply(c);
  for (uint32_t p = 0; p < c->count; ++p)
    for (uint32_t axis = 0; axis < 3; ++axis) {
      double sum = c->give * f[3 * p + axis];
      for (int k = 0; k < 4; ++k)
        sum += w->touched[p].weight[k] * c->moved[3 * c->place[w->touched[p].near[k]] + axis];
      out[3 * p + axis] = sum;
    }
}

static double dot(const double *a, const double *b, uint32_t n) {
  double sum = 0;
  for (uint32_t i = 0; i < n; ++i) sum += a[i] * b[i];
  return sum;
}

static void solve_forces(sonde_window *w, const contact *c, double *f, double *r) {
  uint32_t n = 3 * c->count;
  double *p = r + n, *q = p + n, reference = 0;
  for (uint32_t i = 0; i < n; ++i) {
    r[i] = w->touched[i / 3].move[i % 3];
    reference += r[i] * r[i];
    f[i] = 0;
    p[i] = r[i];
  }
  double old = reference;
  for (w->iterations = 0; w->iterations < MOST_ITERATIONS; ++w->iterations) {
    if (old <= tolerance * tolerance * reference) break;
    apply(w, c, p, q);
    double step = old / dot(p, q, n);
    for (uint32_t i = 0; i < n; ++i) f[i] += step * p[i], r[i] -= step * q[i];
    double now = dot(r, r, n), share = now / old;
    for (uint32_t i = 0; i < n; ++i) p[i] = r[i] + share * p[i];
    old = now;
  }
}

static void list_active(const sonde_window *w, contact *c) {
  bool seen[SONDE_WINDOW_NEAR] = {false};
  double sum = 0;
  c->active = 0;
  for (uint32_t p = 0; p < c->count; ++p)
    for (int k = 0; k < 4; ++k) seen[w->touched[p].near[k]] = true;
  for (uint32_t n = 0; n < SONDE_WINDOW_NEAR; ++n) {
    if (!seen[n]) continue;
    c->place[n] = c->active;
    c->node[c->active++] = n;
    for (size_t k = 3 * (size_t)n; k < 3 * (size_t)n + 3; ++k) sum += w->compliance[k * SIDE + k];
  }
  SONDE_ASSERT(c->active > 0);
  c->give = give * sum / (3 * c->active);
  for (uint32_t k = 0; k < 3 * c->active; ++k) {
    const double *of = w->compliance + (size_t)(3 * c->node[k / 3] + k % 3) * SIDE;
    double *out = c->compliance + (size_t)k * 3 * c->active;
    for (uint32_t m = 0; m < 3 * c->active; ++m) out[m] = of[3 * c->node[m / 3] + m % 3];
  }
}

// Displacements of all near nodes under the forces.
static void move_near(const sonde_window *w, const contact *c, float *x) {
  const sonde_solid *s = &w->solid;
  float *last = x + 3 * (size_t)(s->unknown_count - s->last_count);
  double sum[SIDE] = {0};
  for (uint32_t k = 0; k < 3 * c->active; ++k) {
    const double *restrict of = w->compliance + (size_t)(3 * c->node[k / 3] + k % 3) * SIDE;
    for (uint32_t row = 0; row < SIDE; ++row) sum[row] += c->force[k] * of[row];
  }
  for (uint32_t row = 0; row < SIDE; ++row) last[row] = (float)sum[row];
}

// Nodes beside the face carry a share of the contact but do not lie under it.
static bool under_face(const sonde_interior_input *input, sonde_vec3 now) {
  sonde_vec3 q = pose_apply_inverse(input->world_from_probe, now);
  double x = input->face_half_x_m, y = input->face_half_y_m;
  return fabs(q.x) <= x + face_edge_m && fabs(q.y) <= y + face_edge_m;
}

// A mesh coarser than the elements would leave the skin free between its vertices: the columns of
// the table whose whole triangle is touched count as points of contact too.
static void touch_columns(sonde_window *w, const sonde_interior *in,
                          const sonde_interior_input *input, sonde_vec3 beam) {
  uint32_t first = SONDE_WINDOW_NEAR_FIRST, last = first + SONDE_WINDOW_NEAR_S - 1;
  double low = (w->grid.s[first] - in->s_first_m) / in->s_step_m,
         high = (w->grid.s[last] - in->s_first_m) / in->s_step_m;
  uint32_t from = (uint32_t)fmax(ceil(low), 0), to = (uint32_t)fmin(high, in->s_count - 1);
  for (uint32_t k = from * in->theta_count; k < (to + 1) * in->theta_count; ++k) {
    const sonde_column *c = &in->column[k];
    sonde_vec3 now = vec3(0, 0, 0);
    bool all = true;
    for (int n = 0; n < 3; ++n) {
      all = all && v_dot(input->contact_forces_n[c->node[n]], beam) > 0;
      now = v_madd(now, c->weight[n], input->positions_m[c->node[n]]);
    }
    if (!all || !under_face(input, now)) continue;
    touch(w, in, c->rest_m, v_scale(beam, v_dot(v_sub(now, c->rest_m), beam)));
  }
}

// Rectangle of the contact on the face, probe frame.
typedef struct patch {
  double low_x, high_x, low_y, high_y;
} patch;

static void widen(patch *r, sonde_vec3 q) {
  r->low_x = fmin(r->low_x, q.x), r->high_x = fmax(r->high_x, q.x);
  r->low_y = fmin(r->low_y, q.y), r->high_y = fmax(r->high_y, q.y);
}

static double read_contact(sonde_window *w, const sonde_interior *in,
                           const sonde_interior_input *input, sonde_vec3 beam, patch *r) {
  double force = 0;
  const sonde_mesh *skin = &in->model->surface;
  w->touched_count = 0;
  *r = (patch){INFINITY, -INFINITY, INFINITY, -INFINITY};
  for (uint32_t v = 0; v < skin->vertex_count; ++v) {
    double f = v_dot(input->contact_forces_n[v], beam);
    if (!(f > 0)) continue;
    force += f;
    widen(r, pose_apply_inverse(input->world_from_probe, input->positions_m[v]));
    if (!under_face(input, input->positions_m[v])) continue;
    sonde_vec3 move = v_sub(input->positions_m[v], skin->vertices[v]);
    touch(w, in, skin->vertices[v], v_scale(beam, v_dot(move, beam)));
  }
  touch_columns(w, in, input, beam);
  double x = input->face_half_x_m, y = input->face_half_y_m;
  r->low_x = fmax(r->low_x, -x), r->high_x = fmin(r->high_x, x);
  r->low_y = fmax(r->low_y, -y), r->high_y = fmin(r->high_y, y);
  return force;
}

// Even samples of the patch on the rest skin, all moved by one length along the beam.
static void sample_patch(sonde_window *w, const sonde_interior *in, sonde_pose probe,
                         const patch *r, sonde_vec3 beam) {
  w->touched_count = 0;
  for (int j = 0; j < SAMPLES_Y; ++j)
    for (int i = 0; i < SAMPLES_X; ++i) {
      double x = r->low_x + (r->high_x - r->low_x) * i / (SAMPLES_X - 1),
             y = r->low_y + (r->high_y - r->low_y) * j / (SAMPLES_Y - 1);
      sonde_surface_point hit;
      sonde_vec3 from = pose_apply(probe, vec3(x, y, -sample_start_m));
      if (sonde_surface_raycast(in->skin, from, beam, 2 * sample_start_m, &hit))
        touch(w, in, hit.point_m, beam);
    }
}

static bool is_answered(const sonde_window *w, const sonde_answer *answer, const double along[3]) {
  return answer->count == w->touched_count &&
         memcmp(answer->along, along, sizeof answer->along) == 0 &&
         memcmp(answer->touched, w->touched, answer->count * sizeof *w->touched) == 0;
}

// Displacements of the near nodes for the touched points' `move`; false when they stay as they are.
static bool respond(sonde_window *w, contact *c, const double along[3], sonde_answer *answer) {
  c->count = w->touched_count;
  if (is_answered(w, answer, along)) return false;
  answer->count = c->count, answer->reaction_n = 0;
  memcpy(answer->along, along, sizeof answer->along);
  memcpy(answer->touched, w->touched, c->count * sizeof *w->touched);
  if (c->count == 0) return true;
  double *f = w->scratch + 2 * SIDE;
  list_active(w, c);
  solve_forces(w, c, f, f + 3 * c->count);
  gather(w, f, c);
  move_near(w, c, answer->x);
  for (uint32_t i = 0; i < 3 * c->count; ++i) answer->reaction_n += f[i] * along[i % 3];
  return true;
}

// ---- reading ------------------------------------------------------------------------------

bool sonde_window_field(const sonde_window *w, double theta, double s, double r, double u[3]) {
  sonde_grid_cell c;
  u[0] = u[1] = u[2] = 0;
  if (!sonde_grid_find(&w->grid, theta, s, r, &c)) return false;
  for (int k = 0; k < 4; ++k)
    for (uint32_t l = 0; l < 2; ++l) {
      uint32_t at = w->solid.unknown[c.column[k] * NL + c.level + l];
      if (at == SONDE_FRONT_NONE) continue;
      const float *x = w->solid.x + 3 * (size_t)at;
      double share = c.weight[k] * (l ? c.t : 1 - c.t);
      for (int axis = 0; axis < 3; ++axis) u[axis] += share * (double)x[axis];
    }
  return true;
}

// Weights of the elements before, at and after a cell for a point at fraction a of it: the means at
// the two nodes, interpolated. Nodal means remove the chequered pressure that elements of constant
// pressure carry.
static void element_weights(double a, double w[3]) {
  w[0] = 0.5 * (1 - a);
  w[1] = 0.5;
  w[2] = 0.5 * a;
}

// Layer `level + d - 1`, kept within the tissue of `level`: stress jumps between tissues.
static uint32_t layer_within(uint32_t level, uint32_t d) {
  uint32_t low = level < SONDE_WINDOW_FAT ? 0 : SONDE_WINDOW_FAT,
           high = level < SONDE_WINDOW_FAT ? SONDE_WINDOW_FAT - 1 : NL - 2, l = level + d;
  return l <= low ? low : l - 1 > high ? high : l - 1;
}

// The 27 elements around a point that share in its stress; false beyond the ends.
static bool list_elements(const sonde_window *w, double theta, double s, double r,
                          uint32_t element[27], double share[27]) {
  double f[3][3];
  sonde_grid_cell c;
  if (!sonde_grid_find(&w->grid, theta, s, r, &c)) return false;
  element_weights(c.a, f[0]);
  element_weights(c.b, f[1]);
  element_weights(c.t, f[2]);
  for (uint32_t k = 0; k < 27; ++k) {
    uint32_t di = k % 3, dj = k / 3 % 3, dl = k / 9;
    uint32_t i = (c.i + di + NT - 1) % NT, j = c.j + dj, l = layer_within(c.level, dl);
    j = j < 1 ? 0 : j - 1 > NS - 2 ? NS - 2 : j - 1;
    element[k] = (j * NT + i) * (NL - 1) + l;
    share[k] = f[0][di] * f[1][dj] * f[2][dl];
  }
  return true;
}

// Stations of a vessel are closer than elements: each of these is evaluated once per update.
static void feel_vessels(sonde_window *w, const sonde_interior *in) {
  memset(w->felt, 0, w->solid.hex_count * sizeof *w->felt);
  for (uint32_t which = 0; which < in->vessel_count; ++which)
    for (uint32_t n = 0; n < in->station_count[which]; ++n) {
      uint32_t element[27];
      double share[27];
      sonde_column_point at;
      (void)sonde_interior_locate(in, in->station[which][n].rest_m, &at);
      if (!list_elements(w, at.theta, at.s, at.r, element, share)) continue;
      for (uint32_t k = 0; k < 27; ++k) {
        if (w->felt[element[k]]) continue;
        w->felt[element[k]] = true;
        w->stress[element[k]] = sonde_solid_stress(&w->solid, w->pressed.x, element[k]);
      }
    }
}

bool sonde_window_stress(const sonde_window *w, double theta, double s, double r,
                         sonde_mat3 *stress) {
  uint32_t element[27];
  double share[27];
  *stress = m_zero();
  if (!list_elements(w, theta, s, r, element, share)) return false;
  for (uint32_t k = 0; k < 27; ++k) {
    sonde_mat3 of = w->felt[element[k]] ? w->stress[element[k]]
                                        : sonde_solid_stress(&w->solid, w->pressed.x, element[k]);
    *stress = m_add(*stress, m_scale(of, share[k] * w->stress_scale));
  }
  return true;
}

// ---- update -------------------------------------------------------------------------------

// The linear solid's displacements, kept from folding.
static void keep_apart(sonde_window *w) {
  sonde_solid *s = &w->solid;
  for (uint32_t n = 0; n < SONDE_WINDOW_NODES; ++n)
    w->unfold.now[n] = v_add(w->grid.node[n], sonde_solid_moved(s, n));
  memset(w->unfold.held, 0, sizeof w->unfold.held);
  for (uint32_t p = 0; p < w->moved.count; ++p)
    for (int k = 0; k < 4; ++k) {
      const sonde_touched *t = &w->moved.touched[p];
      uint32_t row = t->near[k] / SONDE_WINDOW_NEAR_T + SONDE_WINDOW_NEAR_FIRST;
      if (t->weight[k] > held_share)
        w->unfold.held[row * NT + t->near[k] % SONDE_WINDOW_NEAR_T] = true;
    }
  if (!sonde_unfold_nodes(&w->unfold, &w->grid)) return;
  for (uint32_t n = 0; n < SONDE_WINDOW_NODES; ++n) {
    if (s->unknown[n] == SONDE_FRONT_NONE) continue;
    sonde_vec3 u = v_sub(w->unfold.now[n], w->grid.node[n]);
    float *x = s->x + 3 * (size_t)s->unknown[n];
    x[0] = (float)u.x, x[1] = (float)u.y, x[2] = (float)u.z;
  }
}

bool sonde_window_update(sonde_window *w, const sonde_interior *in,
                         const sonde_interior_input *input) {
  SONDE_ASSERT(w != NULL && w->ready && input != NULL);
  uint32_t nodes[SONDE_WINDOW_NEAR], places[SONDE_WINDOW_NEAR];
  sonde_vec3 beam = q_rotate(input->world_from_probe.rotation, vec3(0, 0, 1));
  double along[3] = {v_dot(beam, in->e1), v_dot(beam, in->e2), v_dot(beam, in->axis)};
  contact c = {.node = nodes, .place = places, .force = w->scratch};
  c.moved = w->scratch + SIDE;
  c.compliance = w->compliance + (size_t)SIDE * SIDE; // free once it is inverted
  patch r;
  double force = read_contact(w, in, input, beam, &r);
  w->loaded = w->touched_count > 0;
  if (!w->loaded) return false;
  float *fresh[2];
  uint32_t count = 0;
  bool moved = respond(w, &c, along, &w->moved);
  if (moved) fresh[count++] = w->moved.x;
  sample_patch(w, in, input->world_from_probe, &r, beam); // stress per newton: it moves as one
  bool pressed = respond(w, &c, along, &w->pressed);
  if (pressed && w->pressed.count > 0) fresh[count++] = w->pressed.x;
  sonde_fronts_recover(w->solid.fronts, fresh, count); // all other nodes
  if (moved) keep_apart(w);
  if (pressed) feel_vessels(w, in);
  w->stress_scale = w->pressed.reaction_n > 0 ? force / w->pressed.reaction_n : 0;
  return true;
}
