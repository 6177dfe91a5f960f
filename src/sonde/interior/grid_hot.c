// Placing a grid on a leg and finding points in it. Rows and columns are even under the probe's
// face; beyond it the distances grow towards the ends of the leg and the far side.
#include "base/base.h"
#include "interior/grid.h"

enum { NT = SONDE_WINDOW_THETA, NS = SONDE_WINDOW_S, NL = SONDE_WINDOW_LEVELS };

static const double default_half_x_m = 30e-3, default_half_y_m = 6e-3;
static const double far_m = 60e-3; // a probe this far above the skin needs no grid yet
static const double margin_t_m = 12e-3, margin_s_m = 10e-3; // fine part beyond the face
static const double reach_m = 75e-3;                        // grid beyond the fine part
static const double muscle_level[NL] = {0, 0, 0, 0.12, 0.27, 0.46, 0.70, 1};
static const double grow_s[5] = {1.4, 2, 3, 4.5, 6.5};
static const double grow_t[12] = {1.5, 2.3, 3.6, 5.5, 7.5, 9, 9, 7.5, 5.5, 3.6, 2.3, 1.5};

bool sonde_grid_footprint(const sonde_interior *in, const sonde_interior_input *input,
                          sonde_footprint *footprint, bool *within) {
  SONDE_ASSERT(in != NULL && input != NULL && footprint != NULL && within != NULL);
  sonde_mat3 r = q_matrix(input->world_from_probe.rotation);
  sonde_vec3 x = m_column(&r, 0), y = m_column(&r, 1);
  double hx = isfinite(input->face_half_x_m) ? input->face_half_x_m : default_half_x_m;
  double hy = isfinite(input->face_half_y_m) ? input->face_half_y_m : default_half_y_m;
  sonde_column_point at;
  bool on_leg = sonde_interior_locate(in, input->world_from_probe.position, &at);
  *footprint = (sonde_footprint){.theta = at.theta, .s = at.s};
  footprint->half_s_m = fabs(v_dot(x, in->axis)) * hx + fabs(v_dot(y, in->axis)) * hy;
  double across_x = sqrt(fmax(0, 1 - v_dot(x, in->axis) * v_dot(x, in->axis)));
  double across_y = sqrt(fmax(0, 1 - v_dot(y, in->axis) * v_dot(y, in->axis)));
  footprint->half_theta_m = across_x * hx + across_y * hy;
  *within = on_leg;
  return at.depth_m > -far_m;
}

// ---- a footprint --------------------------------------------------------------------------

static double sum_of(const double *d, uint32_t count) {
  double sum = 0;
  for (uint32_t i = 0; i < count; ++i) sum += d[i];
  return sum;
}

void sonde_grid_begin(sonde_grid *g, const sonde_interior *in, sonde_footprint footprint) {
  SONDE_ASSERT(g != NULL && in != NULL && isfinite(footprint.theta) && isfinite(footprint.s));
  sonde_column_point at;
  g->footprint = footprint;
  sonde_interior_column(in, footprint.theta, footprint.s, &at);

  // Rows along the leg: even under the face, then growing to the reach or the leg's ends. A grid
  // that ends with the leg still has rows of some height.
  const double low = in->s_low_m, high = in->s_high_m;
  const double half_s = fmin(footprint.half_s_m + margin_s_m, 0.4 * (high - low));
  const double middle = clamp(footprint.s, low + half_s, high - half_s);
  const double down = fmax(fmin(reach_m, middle - half_s - low), 5e-3);
  const double up = fmax(fmin(reach_m, high - middle - half_s), 5e-3);
  const double step_s = 2 * half_s / (SONDE_WINDOW_NEAR_S - 1), all_s = sum_of(grow_s, 5);
  const uint32_t first = SONDE_WINDOW_NEAR_FIRST, last = first + SONDE_WINDOW_NEAR_S - 1;
  for (uint32_t k = 0; k < SONDE_WINDOW_NEAR_S; ++k) g->s[first + k] = middle - half_s + step_s * k;
  for (uint32_t k = 0; k < 5; ++k) {
    g->s[last + k + 1] = g->s[last + k] + up * grow_s[k] / all_s;
    g->s[first - k - 1] = g->s[first - k] - down * grow_s[k] / all_s;
  }

  // Angles of the columns: even under the face; the rest of the circle has thirteen gaps, the
  // middle one counted twice.
  const double half = fmin((footprint.half_theta_m + margin_t_m) / at.radius_m, 1.2);
  const double step = 2 * half / (SONDE_WINDOW_NEAR_T - 1), rest = 2 * SONDE_PI - 2 * half;
  const double all = sum_of(grow_t, 12) + grow_t[5];
  for (uint32_t k = 0; k < SONDE_WINDOW_NEAR_T; ++k) g->theta[k] = -half + step * k;
  for (uint32_t k = SONDE_WINDOW_NEAR_T; k <= NT; ++k) {
    uint32_t n = k - SONDE_WINDOW_NEAR_T;
    g->theta[k] = g->theta[k - 1] + rest * grow_t[n < 6 ? n : n - 1] / all;
  }

  // Radii and positions of the nodes: the levels of fat and of muscle share the depth of their
  // layer.
  for (uint32_t c = 0; c < NS * NT; ++c) {
    const double theta = footprint.theta + g->theta[c % NT], s = g->s[c / NT];
    sonde_interior_column(in, theta, s, &at);
    const sonde_bend bend = sonde_bend_at(in, s);
    const double height = at.radius_m - at.bone_m, most = 0.6 * height;
    const double fat = clamp(at.muscle_m / at.cosine, fmin(2.5e-3, most), most);
    g->centre[c / NT][0] = bend.x, g->centre[c / NT][1] = bend.y;
    for (uint32_t l = 0; l < NL; ++l) {
      double depth = l <= SONDE_WINDOW_FAT ? fat * l / SONDE_WINDOW_FAT
                                           : fat + (height - fat) * muscle_level[l];
      double r = at.radius_m - depth;
      g->radius[c][l] = (float)r;
      g->node[c * NL + l] = vec3(bend.x + r * cos(theta), bend.y + r * sin(theta), s);
    }
  }

  // Volumes at the corners of the elements. Around, along and inwards is a left-handed order.
  for (uint32_t h = 0; h < SONDE_GRID_HEXES; ++h) {
    uint32_t node[8];
    sonde_grid_edges e;
    sonde_grid_nodes(h, node);
    sonde_grid_read_edges(g->node, node, &e);
    for (uint32_t k = 0; k < 8; ++k) {
      uint32_t i = k & 1, j = k >> 1 & 1, l = k >> 2;
      g->per_volume[h][k] = -1 / v_dot(e.x[j][l], v_cross(e.y[i][l], e.z[i][j]));
    }
  }
}

// ---- cells --------------------------------------------------------------------------------

bool sonde_grid_columns(const sonde_grid *g, double theta, double s, sonde_grid_cell *c) {
  SONDE_ASSERT(g != NULL && c != NULL);
  if (s < g->s[0] || s > g->s[NS - 1]) return false;
  double turn = fmod(theta - g->footprint.theta - g->theta[0], 2 * SONDE_PI);
  if (turn < 0) turn += 2 * SONDE_PI;
  turn += g->theta[0];
  c->i = 0, c->j = 0;
  while (c->i + 1 < NT && g->theta[c->i + 1] <= turn) ++c->i;
  while (c->j + 2 < NS && g->s[c->j + 1] <= s) ++c->j;
  c->a = clamp((turn - g->theta[c->i]) / (g->theta[c->i + 1] - g->theta[c->i]), 0, 1);
  c->b = (s - g->s[c->j]) / (g->s[c->j + 1] - g->s[c->j]);
  uint32_t next = (c->i + 1) % NT;
  c->column[0] = c->j * NT + c->i, c->column[1] = c->j * NT + next;
  c->column[2] = c->column[1] + NT, c->column[3] = c->column[0] + NT;
  c->weight[0] = (1 - c->a) * (1 - c->b), c->weight[1] = c->a * (1 - c->b);
  c->weight[2] = c->a * c->b, c->weight[3] = (1 - c->a) * c->b;
  return true;
}

bool sonde_grid_find(const sonde_grid *g, double theta, double s, double r, sonde_grid_cell *c) {
  SONDE_ASSERT(g != NULL && isfinite(r));
  double radius[NL];
  if (!sonde_grid_columns(g, theta, s, c)) return false;
  for (uint32_t l = 0; l < NL; ++l) {
    radius[l] = 0;
    for (int k = 0; k < 4; ++k) radius[l] += c->weight[k] * (double)g->radius[c->column[k]][l];
  }
  c->level = 0;
  while (c->level + 2 < NL && radius[c->level + 1] >= r) ++c->level;
  c->t = (radius[c->level] - r) / (radius[c->level] - radius[c->level + 1]);
  c->t = clamp(c->t, c->level > 0 ? 0 : sonde_grid_beyond, 1);
  return true;
}
