// The solid of a leg at every update: touched points of the skin, the forces under which they move
// as prescribed (conjugate gradients on the skin's compliance), all other nodes by one backward
// pass, stress as nodal means within a tissue.
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

static void add_touched(sonde_window *w, const sonde_interior *in, sonde_vec3 rest,
                        sonde_vec3 move) {
  sonde_vec3 d = v_sub(rest, in->origin);
  const uint32_t first = SONDE_WINDOW_NEAR_FIRST;
  sonde_grid_cell c;
  const double s = v_dot(d, in->axis);
  const sonde_bend bend = sonde_bend_at(in, s);
  double theta = atan2(v_dot(d, in->e2) - bend.y, v_dot(d, in->e1) - bend.x);
  if (!sonde_grid_columns(&w->grid, theta, s, &c)) return;
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
  uint32_t *node, *slot;  // [active] those, [NEAR] where in that list
  double *force;          // [3*active]
  double *moved;          // [3*active]
  double *compliance;     // [3*active][3*active] of those nodes; row k: what a force on k moves
  double give;
} contact;

static void sum_forces(const sonde_window *w, const double *f, const contact *c) {
  memset(c->force, 0, 3 * c->active * sizeof *c->force);
  for (uint32_t p = 0; p < c->count; ++p)
    for (int k = 0; k < 4; ++k) {
      double *at = c->force + 3 * c->slot[w->touched[p].near[k]];
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

static double dot(const double *a, const double *b, uint32_t n) {
  double sum = 0;
  for (uint32_t i = 0; i < n; ++i) sum += a[i] * b[i];
  return sum;
}

// Nodes beside the face carry a share of the contact but do not lie under it.
static bool under_face(const sonde_interior_input *input, sonde_vec3 now) {
  sonde_vec3 q = pose_apply_inverse(input->world_from_probe, now);
  double x = input->face_half_x_m, y = input->face_half_y_m;
  return fabs(q.x) <= x + face_edge_m && fabs(q.y) <= y + face_edge_m;
}

// Rectangle of the contact on the face, probe frame.
typedef struct patch {
  double low_x, high_x, low_y, high_y;
} patch;

// Touched points and the rectangle of the contact on the face; returns the force along the beam.
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
    sonde_vec3 q = pose_apply_inverse(input->world_from_probe, input->positions_m[v]);
    r->low_x = fmin(r->low_x, q.x), r->high_x = fmax(r->high_x, q.x);
    r->low_y = fmin(r->low_y, q.y), r->high_y = fmax(r->high_y, q.y);
    if (!under_face(input, input->positions_m[v])) continue;
    sonde_vec3 move = v_sub(input->positions_m[v], skin->vertices[v]);
    add_touched(w, in, skin->vertices[v], v_scale(beam, v_dot(move, beam)));
  }
  // A mesh coarser than the elements would leave the skin free between its vertices: the columns of
  // the table whose whole triangle is touched count as points of contact too.
  const uint32_t first = SONDE_WINDOW_NEAR_FIRST, last = first + SONDE_WINDOW_NEAR_S - 1;
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
    add_touched(w, in, c->rest_m, v_scale(beam, v_dot(v_sub(now, c->rest_m), beam)));
  }
  double x = input->face_half_x_m, y = input->face_half_y_m;
  r->low_x = fmax(r->low_x, -x), r->high_x = fmin(r->high_x, x);
  r->low_y = fmax(r->low_y, -y), r->high_y = fmin(r->high_y, y);
  return force;
}

// Displacements of the near nodes for the touched points' `move`; false when they stay as they are.
static bool solve_response(sonde_window *w, contact *c, const double along[3],
                           sonde_answer *answer) {
  c->count = w->touched_count;
  if (answer->count == c->count && memcmp(answer->along, along, sizeof answer->along) == 0 &&
      memcmp(answer->touched, w->touched, c->count * sizeof *w->touched) == 0)
    return false;
  answer->count = c->count, answer->reaction_n = 0;
  memcpy(answer->along, along, sizeof answer->along);
  memcpy(answer->touched, w->touched, c->count * sizeof *w->touched);
  if (c->count == 0) return true;
  // Compliance of the near nodes that the touched points use.
  bool seen[SONDE_WINDOW_NEAR] = {false};
  double sum = 0;
  c->active = 0;
  for (uint32_t p = 0; p < c->count; ++p)
    for (int k = 0; k < 4; ++k) seen[w->touched[p].near[k]] = true;
  for (uint32_t n = 0; n < SONDE_WINDOW_NEAR; ++n) {
    if (!seen[n]) continue;
    c->slot[n] = c->active;
    c->node[c->active++] = n;
    for (size_t k = 3 * (size_t)n; k < 3 * (size_t)n + 3; ++k) sum += w->compliance[k * SIDE + k];
  }
  SONDE_ASSERT(c->active > 0);
  c->give = give * sum / (3 * c->active);
  for (uint32_t k = 0; k < 3 * c->active; ++k) {
    const double *row = w->compliance + (size_t)(3 * c->node[k / 3] + k % 3) * SIDE;
    double *out = c->compliance + (size_t)k * 3 * c->active;
    for (uint32_t m = 0; m < 3 * c->active; ++m) out[m] = row[3 * c->node[m / 3] + m % 3];
  }
  double *f = w->scratch + 2 * SIDE, moved[SIDE] = {0};
  // Conjugate gradients: forces under which the touched points move as prescribed.
  double *r = f + 3 * c->count;
  const uint32_t n = 3 * c->count, active = 3 * c->active;
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
    // Displacements q under forces p: moved = compliance * force, two nodes at a time.
    sum_forces(w, p, c);
    memset(c->moved, 0, active * sizeof *c->moved);
    uint32_t k = 0;
    for (; k + 6 <= active; k += 6)
      add_rows(c->moved, c->compliance + (size_t)k * active, active, c->force + k, 6, active);
    if (k < active)
      add_rows(c->moved, c->compliance + (size_t)k * active, active, c->force + k, 3, active);
    for (uint32_t i = 0; i < n; ++i) {
      const sonde_touched *t = &w->touched[i / 3];
      double total = c->give * p[i];
      for (int m = 0; m < 4; ++m) total += t->weight[m] * c->moved[3 * c->slot[t->near[m]] + i % 3];
      q[i] = total;
    }
    double step = old / dot(p, q, n);
    for (uint32_t i = 0; i < n; ++i) f[i] += step * p[i], r[i] -= step * q[i];
    double now = dot(r, r, n), share = now / old;
    for (uint32_t i = 0; i < n; ++i) p[i] = r[i] + share * p[i];
    old = now;
  }
  sum_forces(w, f, c);
  // Displacements of all near nodes under the forces.
  for (uint32_t k = 0; k < 3 * c->active; ++k) {
    const double *restrict row = w->compliance + (size_t)(3 * c->node[k / 3] + k % 3) * SIDE;
    for (uint32_t m = 0; m < SIDE; ++m) moved[m] += c->force[k] * row[m];
  }
  float *near = answer->x + 3 * (size_t)(w->solid.unknown_count - w->solid.last_count);
  for (uint32_t m = 0; m < SIDE; ++m) near[m] = (float)moved[m];
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
      if (at == SONDE_HELD_CORNER) continue;
      const float *x = w->solid.x + 3 * (size_t)at;
      double share = c.weight[k] * (l ? c.t : 1 - c.t);
      for (int axis = 0; axis < 3; ++axis) u[axis] += share * (double)x[axis];
    }
  return true;
}

// The 27 elements around a point that share in its stress: the means at the nodes of its cell,
// interpolated. Nodal means remove the chequered pressure that elements of constant pressure carry.
// Layers stay within the point's tissue: stress jumps between tissues. False beyond the ends.
static bool list_elements(const sonde_window *w, double theta, double s, double r,
                          uint32_t element[27], double share[27]) {
  sonde_grid_cell c;
  if (!sonde_grid_find(&w->grid, theta, s, r, &c)) return false;
  const double f[3][3] = {{0.5 * (1 - c.a), 0.5, 0.5 * c.a},
                          {0.5 * (1 - c.b), 0.5, 0.5 * c.b},
                          {0.5 * (1 - c.t), 0.5, 0.5 * c.t}};
  const uint32_t low = c.level < SONDE_WINDOW_FAT ? 0 : SONDE_WINDOW_FAT,
                 high = c.level < SONDE_WINDOW_FAT ? SONDE_WINDOW_FAT - 1 : NL - 2;
  for (uint32_t k = 0; k < 27; ++k) {
    uint32_t di = k % 3, dj = k / 3 % 3, dl = k / 9;
    uint32_t i = (c.i + di + NT - 1) % NT, j = c.j + dj, l = c.level + dl;
    j = j < 1 ? 0 : j - 1 > NS - 2 ? NS - 2 : j - 1;
    l = l <= low ? low : l - 1 > high ? high : l - 1;
    element[k] = (j * NT + i) * (NL - 1) + l;
    share[k] = f[0][di] * f[1][dj] * f[2][dl];
  }
  return true;
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

bool sonde_window_update(sonde_window *w, const sonde_interior *in,
                         const sonde_interior_input *input) {
  SONDE_ASSERT(w != NULL && w->ready && input != NULL);
  uint32_t nodes[SONDE_WINDOW_NEAR], slots[SONDE_WINDOW_NEAR], count = 0;
  sonde_vec3 beam = q_rotate(input->world_from_probe.rotation, vec3(0, 0, 1));
  double along[3] = {v_dot(beam, in->e1), v_dot(beam, in->e2), v_dot(beam, in->axis)};
  contact c = {.node = nodes, .slot = slots, .force = w->scratch};
  c.moved = w->scratch + SIDE;
  c.compliance = w->compliance + (size_t)SIDE * SIDE; // free once it is inverted
  patch r;
  double force = read_contact(w, in, input, beam, &r);
  w->loaded = w->touched_count > 0;
  if (!w->loaded) return false;
  float *fresh[2];
  const bool moved = solve_response(w, &c, along, &w->moved);
  if (moved) fresh[count++] = w->moved.x;
  // Stress per newton: even samples of the patch on the rest skin all move by one length.
  w->touched_count = 0;
  for (int k = 0; k < SAMPLES_X * SAMPLES_Y; ++k) {
    double x = r.low_x + (r.high_x - r.low_x) * (k % SAMPLES_X) / (SAMPLES_X - 1),
           y = r.low_y + (r.high_y - r.low_y) * (k / SAMPLES_X) / (SAMPLES_Y - 1);
    sonde_surface_point hit;
    sonde_vec3 from = pose_apply(input->world_from_probe, vec3(x, y, -sample_start_m));
    if (sonde_surface_raycast(in->skin, from, beam, 2 * sample_start_m, &hit))
      add_touched(w, in, hit.point_m, beam);
  }
  const bool pressed = solve_response(w, &c, along, &w->pressed);
  if (pressed && w->pressed.count > 0) fresh[count++] = w->pressed.x;
  sonde_numeric_recover(&w->solid.numeric, fresh, count); // all other nodes
  if (moved && !in->vessels_only) {
    // The linear solid's displacements, kept from folding.
    sonde_solid *s = &w->solid;
    for (uint32_t n = 0; n < SONDE_WINDOW_NODES; ++n)
      w->repair.now[n] = v_add(w->grid.node[n], sonde_solid_moved(s, n));
    memset(w->repair.held, 0, sizeof w->repair.held);
    for (uint32_t p = 0; p < w->moved.count; ++p)
      for (int k = 0; k < 4; ++k) {
        const sonde_touched *t = &w->moved.touched[p];
        uint32_t row = t->near[k] / SONDE_WINDOW_NEAR_T + SONDE_WINDOW_NEAR_FIRST;
        if (t->weight[k] > held_share)
          w->repair.held[row * NT + t->near[k] % SONDE_WINDOW_NEAR_T] = true;
      }
    if (sonde_fold_repair_nodes(&w->repair, &w->grid)) {
      for (uint32_t n = 0; n < SONDE_WINDOW_NODES; ++n) {
        if (s->unknown[n] == SONDE_HELD_CORNER) continue;
        sonde_vec3 u = v_sub(w->repair.now[n], w->grid.node[n]);
        float *x = s->x + 3 * (size_t)s->unknown[n];
        x[0] = (float)u.x, x[1] = (float)u.y, x[2] = (float)u.z;
      }
    }
  }
  // Sections of a vessel are closer than elements: each of these is evaluated once per update.
  if (pressed) memset(w->felt, 0, w->solid.hex_count * sizeof *w->felt);
  for (uint32_t which = 0; which < in->vessel_count && pressed; ++which)
    for (uint32_t n = 0; n < in->course[which].count; ++n) {
      uint32_t element[27];
      double share[27];
      sonde_column_point at;
      const double s = in->section[which][n].s_m;
      if (s < w->grid.s[0] || s > w->grid.s[NS - 1]) continue;
      (void)sonde_interior_locate(in, in->section[which][n].rest_m, &at);
      if (!list_elements(w, at.theta, at.s, at.r, element, share)) continue;
      for (uint32_t k = 0; k < 27; ++k) {
        if (w->felt[element[k]]) continue;
        w->felt[element[k]] = true;
        w->stress[element[k]] = sonde_solid_stress(&w->solid, w->pressed.x, element[k]);
      }
    }
  w->stress_scale = w->pressed.reaction_n > 0 ? force / w->pressed.reaction_n : 0;
  return true;
}
