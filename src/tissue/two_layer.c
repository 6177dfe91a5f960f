// Hot evaluation of the two-layer tissue (docs/tissue.md), one pass over edges and one over nodes.
// begin_node: clears a node's sums, its indentation and rate.
// add_edge:   surface spring-damper: force, projected stiffness, damping block.
// add_shear:  spring between the normal indentations of two neighbours.
// add_anchor: normal spring of eq. (1), tangential spring and their dampers at one node.
// linearise:  assembles force, K v and the matrix of the implicit step.
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

typedef struct evaluation {
  const sonde_model *model;
  const sonde_vec3 *x, *v;
  sonde_tissue_scales scale;
  sonde_vec3 *force, *stiffness_velocity;
  sonde_block_matrix *matrix;
  sonde_tissue_node *node;
} evaluation;

static void begin_node(const evaluation *at, uint32_t i) {
  sonde_vec3 n = at->model->normal[i];
  at->force[i] = at->stiffness_velocity[i] = vec3(0, 0, 0);
  at->matrix->diagonal[i] = m_zero();
  at->node[i] = (sonde_tissue_node){v_dot(n, v_sub(at->model->surface.vertices[i], at->x[i])),
                                    -v_dot(n, at->v[i]), 0};
}

static inline void add_block(sonde_mat3 *m, const sonde_mat3 *block) {
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) m->m[r][c] += block->m[r][c];
}

// Force T n plus damper; H = k nn^T + max(0, T/l) (I - nn^T), K = [H, -H; -H, H]. The geometric
// part is dropped in compression, which keeps H positive semidefinite while the force stays exact;
// the unsymmetric part of the damping is dropped.
static void add_edge(const evaluation *at, uint32_t e, uint32_t i, uint32_t j) {
  const sonde_surface_law *law = &at->model->law;
  double rest = at->model->edge_rest_m[e];
  sonde_vec3 d = v_sub(at->x[j], at->x[i]), w = v_sub(at->v[j], at->v[i]);
  double length = v_norm(d), shortest = 0.05 * rest;
  if (length < shortest) length = shortest;
  double inverse = 1.0 / length;
  sonde_vec3 n = v_scale(d, inverse);
  tension t = edge_tension(law, length, rest);
  double damper = law->edge_damping_s * law->edge_stiffness_n_m;
  double lateral = t.force > 0 ? t.force * inverse : 0, along = t.slope - lateral;
  double closing = v_dot(n, w), pull = t.force + damper * closing;
  at->force[i] = v_madd(at->force[i], pull, n);
  at->force[j] = v_madd(at->force[j], -pull, n);
  sonde_vec3 kv = v_madd(v_scale(w, lateral), along * closing, n);
  at->stiffness_velocity[i] = v_sub(at->stiffness_velocity[i], kv);
  at->stiffness_velocity[j] = v_add(at->stiffness_velocity[j], kv);
  sonde_mat3 block = m_rank1(n, at->scale.stiffness * along + at->scale.damping * damper,
                             at->scale.stiffness * lateral);
  add_block(&at->matrix->diagonal[i], &block);
  add_block(&at->matrix->diagonal[j], &block);
  at->matrix->upper[e] = m_scale(block, -1.0);
}

// Energy L w W(|s_i - s_j|/L) gives forces w q on +N_i and -N_j; the diagonal parts s N N^T are
// summed as numbers and added with the anchors.
static void add_shear(const evaluation *at, uint32_t e, uint32_t i, uint32_t j) {
  const sonde_model *model = at->model;
  double rest = model->edge_rest_m[e], dual = model->edge_dual_m[e], slope;
  sonde_tissue_node *a = &at->node[i], *b = &at->node[j];
  double g = (a->indentation_m - b->indentation_m) / rest;
  double q =
      dual * sonde_shear_force(model->law.shear_stiffness_n_m, model->law.shear_limit, g, &slope);
  double stiffness = dual * slope / rest, kv = stiffness * (a->rate_m_s - b->rate_m_s);
  sonde_vec3 ni = model->normal[i], nj = model->normal[j];
  at->force[i] = v_madd(at->force[i], q, ni);
  at->force[j] = v_madd(at->force[j], -q, nj);
  at->stiffness_velocity[i] = v_madd(at->stiffness_velocity[i], -kv, ni);
  at->stiffness_velocity[j] = v_madd(at->stiffness_velocity[j], kv, nj);
  double scaled = at->scale.stiffness * stiffness;
  a->shear_n_m += scaled;
  b->shear_n_m += scaled;
  const double row[3] = {-scaled * ni.x, -scaled * ni.y, -scaled * ni.z};
  for (int r = 0; r < 3; ++r) {
    at->matrix->upper[e].m[r][0] += row[r] * nj.x;
    at->matrix->upper[e].m[r][1] += row[r] * nj.y;
    at->matrix->upper[e].m[r][2] += row[r] * nj.z;
  }
}

// Normal spring p(s) A along N plus tangential spring g_t A (I - NN^T), each with its damper.
static void add_anchor(const evaluation *at, uint32_t i) {
  const sonde_model *model = at->model;
  const sonde_surface_law *law = &model->law;
  sonde_vec3 n = model->normal[i], v = at->v[i];
  sonde_vec3 u = v_sub(at->x[i], model->surface.vertices[i]);
  double s = at->node[i].indentation_m, rate = -at->node[i].rate_m_s;
  double area = model->area_m2[i], slope;
  double pressure = sonde_normal_pressure(model->k0_n_m3[i], model->xm_m[i], law->guard, s, &slope);
  double normal_damper = law->normal_damping_s * model->k0_n_m3[i] * area;
  double tangent = law->tangential_stiffness_n_m3 * area;
  double tangent_damper = law->normal_damping_s * tangent;
  sonde_vec3 u_t = v_madd(u, s, n), v_t = v_madd(v, -rate, n);
  sonde_vec3 f = v_madd(at->force[i], pressure * area - normal_damper * rate, n);
  at->force[i] = v_madd(v_madd(f, -tangent, u_t), -tangent_damper, v_t);
  double normal_stiffness = slope * area;
  at->stiffness_velocity[i] =
      v_madd(v_madd(at->stiffness_velocity[i], tangent, v_t), normal_stiffness * rate, n);
  double flat = at->scale.stiffness * tangent + at->scale.damping * tangent_damper;
  double steep = at->scale.stiffness * normal_stiffness + at->scale.damping * normal_damper +
                 at->node[i].shear_n_m;
  sonde_mat3 block = m_rank1(n, steep - flat, flat + at->scale.mass * model->mass_kg[i]);
  add_block(&at->matrix->diagonal[i], &block);
}

void sonde_tissue_linearise(const sonde_model *model, const sonde_tissue_part *part,
                            const sonde_vec3 *position, const sonde_vec3 *velocity,
                            const sonde_tissue_scales *scales, sonde_vec3 *force,
                            sonde_vec3 *stiffness_velocity, sonde_block_matrix *matrix,
                            sonde_tissue_node *scratch) {
  SONDE_ASSERT(matrix->row_count == model->surface.vertex_count);
  SONDE_ASSERT(matrix->pair_count == model->topology.edge_count);
  evaluation at = {model, position, velocity, *scales, force, stiffness_velocity, matrix, scratch};
  const uint32_t *rows = part ? part->rows : NULL, *edges = part ? part->edges : NULL;
  uint32_t row_count = part ? part->row_count : matrix->row_count;
  uint32_t edge_count = part ? part->edge_count : matrix->pair_count;
  for (uint32_t r = 0; r < row_count; ++r) begin_node(&at, rows ? rows[r] : r);
  for (uint32_t r = 0; part && r < part->rim_count; ++r) begin_node(&at, part->rim[r]);
  bool shear = model->law.shear_stiffness_n_m > 0;
  for (uint32_t k = 0; k < edge_count; ++k) {
    uint32_t e = edges ? edges[k] : k;
    uint32_t i = model->topology.edges[e][0], j = model->topology.edges[e][1];
    add_edge(&at, e, i, j);
    if (shear) add_shear(&at, e, i, j);
  }
  for (uint32_t r = 0; r < row_count; ++r) add_anchor(&at, rows ? rows[r] : r);
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
    double si = v_dot(model->normal[i], v_sub(model->surface.vertices[i], position[i]));
    double sj = v_dot(model->normal[j], v_sub(model->surface.vertices[j], position[j]));
    double g = (si - sj) / rest;
    energy += rest * model->edge_dual_m[e] *
              sonde_normal_energy(law->shear_stiffness_n_m, law->shear_limit, 0.95, fabs(g));
  }
  return energy;
}
