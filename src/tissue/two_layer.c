// Hot evaluation of the two-layer tissue (physics.md 2a), one pass over edges and one over nodes.
// edge_spring:  surface spring-damper: force, projected stiffness, damping block.
// shear_spring: spring between the normal indentations of two neighbours.
// anchor:       normal spring of eq. (1), tangential spring and their dampers at one node.
// linearise:    assembles force, K v and the matrix of the implicit step.
#include "tissue/two_layer.h"

#include "base/base.h"
#include "base/maths.h"

// Elastic tension and tangent of a surface spring at length l.
typedef struct tension {
  double force; // along the spring, > 0 pulls the ends together
  double slope; // d force / d length
} tension;

static inline tension edge_tension(const sonde_surface_law *law, double length, double rest) {
  double stretch = length - rest;
  double stiffness = law->edge_stiffness_n_m;
  if (stretch < 0) stiffness *= law->edge_compression;
  return (tension){law->edge_pretension_n + stiffness * stretch, stiffness};
}

typedef struct pair_terms {
  sonde_vec3 force;     // on the first node
  sonde_mat3 stiffness; // H: K = [H, -H; -H, H]
  sonde_mat3 damping;   // Z, same pattern
} pair_terms;

// H = k nn^T + max(0, T/l) (I - nn^T): the geometric part is dropped in compression, which keeps H
// positive semidefinite while the force stays exact. The unsymmetric part of the damping is
// dropped.
static inline pair_terms edge_spring(const sonde_surface_law *law, double rest, sonde_vec3 d,
                                     sonde_vec3 w) {
  double length = v_norm(d), shortest = 0.05 * rest;
  if (length < shortest) length = shortest;
  sonde_vec3 n = v_scale(d, 1.0 / length);
  tension t = edge_tension(law, length, rest);
  double damper = law->edge_damping_s * law->edge_stiffness_n_m;
  double lateral = t.force > 0 ? t.force / length : 0;
  return (pair_terms){v_scale(n, t.force + damper * v_dot(n, w)),
                      m_rank1(n, t.slope - lateral, lateral), m_rank1(n, damper, 0)};
}

typedef struct shear_terms {
  double force; // on the first node along its normal
  double stiffness;
} shear_terms;

// Indentation s = N.(X - x); energy L w W(|s_i - s_j|/L) gives forces w q on +N_i and -N_j.
static inline shear_terms shear_spring(const sonde_surface_law *law, double rest, double dual,
                                       double difference) {
  double slope;
  double q =
      sonde_shear_force(law->shear_stiffness_n_m, law->shear_limit, difference / rest, &slope);
  return (shear_terms){dual * q, dual * slope / rest};
}

static inline double indentation(const sonde_model *model, const sonde_vec3 *x, uint32_t i) {
  return v_dot(model->normal[i], v_sub(model->surface.vertices[i], x[i]));
}

typedef struct evaluation {
  const sonde_model *model;
  const sonde_vec3 *x, *v;
  sonde_tissue_scales scale;
  sonde_vec3 *force, *stiffness_velocity;
  sonde_block_matrix *matrix;
} evaluation;

static void add_edge(const evaluation *at, uint32_t e, uint32_t i, uint32_t j) {
  const sonde_surface_law *law = &at->model->law;
  sonde_vec3 w = v_sub(at->v[j], at->v[i]);
  pair_terms t = edge_spring(law, at->model->edge_rest_m[e], v_sub(at->x[j], at->x[i]), w);
  at->force[i] = v_add(at->force[i], t.force);
  at->force[j] = v_sub(at->force[j], t.force);
  sonde_vec3 kv = m_mul_v(t.stiffness, w);
  at->stiffness_velocity[i] = v_sub(at->stiffness_velocity[i], kv);
  at->stiffness_velocity[j] = v_add(at->stiffness_velocity[j], kv);
  sonde_mat3 block =
      m_add(m_scale(t.stiffness, at->scale.stiffness), m_scale(t.damping, at->scale.damping));
  at->matrix->diagonal[i] = m_add(at->matrix->diagonal[i], block);
  at->matrix->diagonal[j] = m_add(at->matrix->diagonal[j], block);
  at->matrix->upper[e] = m_scale(block, -1.0);
}

// b a^T scaled by s, added to m
static inline void add_outer(sonde_mat3 *m, double s, sonde_vec3 b, sonde_vec3 a) {
  double row[3] = {s * b.x, s * b.y, s * b.z}, column[3] = {a.x, a.y, a.z};
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) m->m[r][c] += row[r] * column[c];
}

static void add_shear(const evaluation *at, uint32_t e, uint32_t i, uint32_t j) {
  const sonde_model *model = at->model;
  sonde_vec3 ni = model->normal[i], nj = model->normal[j];
  double difference = indentation(model, at->x, i) - indentation(model, at->x, j);
  shear_terms t =
      shear_spring(&model->law, model->edge_rest_m[e], model->edge_dual_m[e], difference);
  at->force[i] = v_madd(at->force[i], t.force, ni);
  at->force[j] = v_madd(at->force[j], -t.force, nj);
  double rate = v_dot(nj, at->v[j]) - v_dot(ni, at->v[i]);
  at->stiffness_velocity[i] = v_madd(at->stiffness_velocity[i], -t.stiffness * rate, ni);
  at->stiffness_velocity[j] = v_madd(at->stiffness_velocity[j], t.stiffness * rate, nj);
  double s = at->scale.stiffness * t.stiffness;
  add_outer(&at->matrix->diagonal[i], s, ni, ni);
  add_outer(&at->matrix->diagonal[j], s, nj, nj);
  add_outer(&at->matrix->upper[e], -s, ni, nj);
}

// Normal spring p(s) A along N plus tangential spring g_t A (I - NN^T), each with its damper.
static void set_anchor(const evaluation *at, uint32_t i) {
  const sonde_model *model = at->model;
  const sonde_surface_law *law = &model->law;
  sonde_vec3 n = model->normal[i], v = at->v[i];
  sonde_vec3 u = v_sub(at->x[i], model->surface.vertices[i]);
  double area = model->area_m2[i], slope;
  double s = -v_dot(n, u), rate = v_dot(n, v);
  double pressure = sonde_normal_pressure(model->k0_n_m3[i], model->xm_m[i], law->guard, s, &slope);
  double normal_damper = law->normal_damping_s * model->k0_n_m3[i] * area;
  double tangent = law->tangential_stiffness_n_m3 * area;
  double tangent_damper = law->normal_damping_s * tangent;
  sonde_vec3 u_t = v_madd(u, s, n), v_t = v_madd(v, -rate, n);
  double along = pressure * area - normal_damper * rate;
  sonde_vec3 f = v_scale(n, along);
  f = v_madd(f, -tangent, u_t);
  at->force[i] = v_madd(f, -tangent_damper, v_t);
  double normal_stiffness = slope * area;
  at->stiffness_velocity[i] = v_madd(v_scale(v_t, tangent), normal_stiffness * rate, n);
  double flat = at->scale.stiffness * tangent + at->scale.damping * tangent_damper;
  double steep = at->scale.stiffness * normal_stiffness + at->scale.damping * normal_damper;
  at->matrix->diagonal[i] = m_rank1(n, steep - flat, flat + at->scale.mass * model->mass_kg[i]);
}

// Ends of active edges that are held collect forces that nobody reads: start them at zero.
static void clear_ends(const sonde_model *model, const uint32_t *edges, uint32_t count,
                       sonde_vec3 *force, sonde_vec3 *stiffness_velocity) {
  for (uint32_t k = 0; k < count; ++k) {
    const uint32_t *pair = model->topology.edges[edges[k]];
    for (int end = 0; end < 2; ++end) force[pair[end]] = vec3(0, 0, 0);
    for (int end = 0; end < 2; ++end) stiffness_velocity[pair[end]] = vec3(0, 0, 0);
  }
}

void sonde_tissue_linearise(const sonde_model *model, const sonde_tissue_part *part,
                            const sonde_vec3 *position, const sonde_vec3 *velocity,
                            const sonde_tissue_scales *scales, sonde_vec3 *force,
                            sonde_vec3 *stiffness_velocity, sonde_block_matrix *matrix) {
  SONDE_ASSERT(matrix->row_count == model->surface.vertex_count);
  SONDE_ASSERT(matrix->pair_count == model->topology.edge_count);
  evaluation at = {model, position, velocity, *scales, force, stiffness_velocity, matrix};
  const uint32_t *rows = part ? part->rows : NULL, *edges = part ? part->edges : NULL;
  uint32_t row_count = rows ? part->row_count : matrix->row_count;
  uint32_t edge_count = edges ? part->edge_count : matrix->pair_count;
  if (edges) clear_ends(model, edges, edge_count, force, stiffness_velocity);
  for (uint32_t r = 0; r < row_count; ++r) set_anchor(&at, rows ? rows[r] : r);
  bool shear = model->law.shear_stiffness_n_m > 0;
  for (uint32_t k = 0; k < edge_count; ++k) {
    uint32_t e = edges ? edges[k] : k;
    uint32_t i = model->topology.edges[e][0], j = model->topology.edges[e][1];
    add_edge(&at, e, i, j);
    if (shear) add_shear(&at, e, i, j);
  }
}

static double edge_energy(const sonde_surface_law *law, double length, double rest) {
  tension t = edge_tension(law, length, rest);
  double stretch = length - rest;
  return law->edge_pretension_n * stretch + 0.5 * t.slope * stretch * stretch;
}

double sonde_tissue_energy(const sonde_model *model, const sonde_vec3 *position) {
  const sonde_surface_law *law = &model->law;
  double energy = 0;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    sonde_vec3 u = v_sub(position[i], model->surface.vertices[i]);
    double s = -v_dot(model->normal[i], u);
    double area = model->area_m2[i];
    energy += area * sonde_normal_energy(model->k0_n_m3[i], model->xm_m[i], law->guard, s);
    energy += 0.5 * law->tangential_stiffness_n_m3 * area * (v_norm2(u) - s * s);
  }
  for (uint32_t e = 0; e < model->topology.edge_count; ++e) {
    uint32_t i = model->topology.edges[e][0], j = model->topology.edges[e][1];
    double rest = model->edge_rest_m[e];
    energy += edge_energy(law, v_distance(position[i], position[j]), rest);
    if (law->shear_stiffness_n_m <= 0) continue;
    double g = (indentation(model, position, i) - indentation(model, position, j)) / rest;
    energy += rest * model->edge_dual_m[e] *
              sonde_normal_energy(law->shear_stiffness_n_m, law->shear_limit, 0.95, fabs(g));
  }
  return energy;
}
