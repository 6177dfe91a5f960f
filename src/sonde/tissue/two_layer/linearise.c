// Evaluation of the two-layer tissue into a block matrix (docs/tissue.md): passes over edges, faces
// and nodes by the laws of tissue/laws.h. For scenes of several bodies, and for tests of the
// engines.
#define SONDE_REAL_SCALAR
#include "tissue/laws.h"
#include "tissue/two_layer/linearise.h"

#include "base/base.h"
#include "base/maths.h"

// What a cut left of the edge's spring.
static inline double share_of(const sonde_model *model, uint32_t e) {
  return model->edge_share ? model->edge_share[e] : 1;
}

static edge_law edge_law_of(const sonde_surface_law *law) {
  return (edge_law){law->edge_stiffness_n_m, law->edge_damping_s * law->edge_stiffness_n_m,
                    law->edge_compression, law->edge_pretension_n};
}

typedef struct evaluation {
  const sonde_model *model;
  const sonde_vec3 *x, *v;
  sonde_tissue_scales scale;
  edge_law edge;
  anchor_law anchor;
  sonde_vec3 *force, *stiffness_velocity;
  sonde_block_matrix *matrix;
  sonde_tissue_node *node;
} evaluation;

static void begin_node(const evaluation *at, uint32_t i, bool is_row) {
  sonde_vec3 n = at->model->normal[i], u = v_sub(at->x[i], at->model->surface.vertices[i]);
  double s = -v_dot(n, u), rate = -v_dot(n, at->v[i]);
  at->force[i] = at->stiffness_velocity[i] = vec3(0, 0, 0);
  at->matrix->diagonal[i] = m_zero();
  at->node[i] = (sonde_tissue_node){.indentation_m = s,
                                    .rate_m_s = rate,
                                    .slide_m = v_madd(u, s, n),
                                    .slide_m_s = v_madd(at->v[i], rate, n),
                                    .is_row = is_row};
}

static inline void add_block(sonde_mat3 *m, const sonde_mat3 *block) {
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) m->m[r][c] += block->m[r][c];
}

// Force of the spring-damper; K = [H, -H; -H, H].
static void add_edge(const evaluation *at, uint32_t e, uint32_t i, uint32_t j) {
  sonde_vec3 d = v_sub(at->x[j], at->x[i]), w = v_sub(at->v[j], at->v[i]);
  edge_pull edge = pull_edge(&at->edge, share_of(at->model, e), at->model->edge_rest_m[e],
                             (const double[3]){d.x, d.y, d.z}, (const double[3]){w.x, w.y, w.z});
  sonde_vec3 n = vec3(edge.n[0], edge.n[1], edge.n[2]);
  at->force[i] = v_madd(at->force[i], edge.pull, n);
  at->force[j] = v_madd(at->force[j], -edge.pull, n);
  sonde_vec3 kv = v_madd(v_scale(w, edge.lateral), edge.along * edge.closing, n);
  at->stiffness_velocity[i] = v_sub(at->stiffness_velocity[i], kv);
  at->stiffness_velocity[j] = v_add(at->stiffness_velocity[j], kv);
  sonde_mat3 block = m_rank1(n, at->scale.stiffness * edge.along + at->scale.damping * edge.damper,
                             at->scale.stiffness * edge.lateral);
  add_block(&at->matrix->diagonal[i], &block);
  add_block(&at->matrix->diagonal[j], &block);
  at->matrix->upper[e] = m_scale(block, -1.0);
}

void sonde_tissue_face_law(const sonde_model *model, uint32_t f, double *shear_n_m, double *limit) {
  const uint32_t *v = model->surface.faces[f];
  const double *shear = model->shear_share, *steep = model->limit_share;
  *shear_n_m = model->law.shear_stiffness_n_m * (shear[v[0]] + shear[v[1]] + shear[v[2]]) / 3;
  *limit = model->law.shear_limit * (steep[v[0]] + steep[v[1]] + steep[v[2]]) / 3;
}

// Energy A W(|grad s|): forces m flux_k along N_k with the secant modulus m = q/g, and the
// stiffness m L + (q' - m)/(g^2 A) flux flux^T between the indentations, L half the cotangent
// Laplacian. The diagonal parts are summed as numbers and added with the anchors.
static void add_shear(const evaluation *at, uint32_t f) {
  const sonde_model *model = at->model;
  const uint32_t *v = model->surface.faces[f];
  const double *half = model->face_half_cotangent[f];
  double shear_n_m, limit, across[3], flux[3], s[3], rate[3], along = 0, modulus, beyond;
  for (int k = 0; k < 3; ++k)
    s[k] = at->node[v[k]].indentation_m, rate[k] = at->node[v[k]].rate_m_s;
  sonde_tissue_face_law(model, f, &shear_n_m, &limit);
  double square = square_slope(half, s, across);
  double bend = 1 / (limit * limit * model->face_area_m2[f]);
  shear_modulus(shear_n_m, bend, square * bend, &modulus, &beyond);
  for (int k = 0; k < 3; ++k) flux[k] = across[(k + 2) % 3] - across[(k + 1) % 3];
  for (int k = 0; k < 3; ++k) along += flux[k] * rate[k];
  for (int k = 0; k < 3; ++k) {
    int a = (k + 1) % 3, b = (k + 2) % 3;
    sonde_vec3 n = model->normal[v[k]];
    at->force[v[k]] = v_madd(at->force[v[k]], modulus * flux[k], n);
    double spread = half[b] * (rate[k] - rate[a]) + half[a] * (rate[k] - rate[b]);
    double kv = modulus * spread + beyond * along * flux[k];
    at->stiffness_velocity[v[k]] = v_madd(at->stiffness_velocity[v[k]], -kv, n);
    at->node[v[k]].shear_n_m +=
        at->scale.stiffness * (modulus * (half[a] + half[b]) + beyond * flux[k] * flux[k]);
    if (!at->node[v[a]].is_row && !at->node[v[b]].is_row) continue;
    double pair = at->scale.stiffness * (beyond * flux[a] * flux[b] - modulus * half[k]);
    bool forward = v[a] < v[b];
    sonde_vec3 first = v_scale(model->normal[forward ? v[a] : v[b]], pair);
    sonde_vec3 second = model->normal[forward ? v[b] : v[a]];
    const double row[3] = {first.x, first.y, first.z};
    sonde_mat3 *block = &at->matrix->upper[model->face_edge[f][k]];
    for (int r = 0; r < 3; ++r) {
      block->m[r][0] += row[r] * second.x;
      block->m[r][1] += row[r] * second.y;
      block->m[r][2] += row[r] * second.z;
    }
  }
}

// m += a P Q with the projections P and Q across the unit vectors p and q.
static void add_across(sonde_mat3 *m, double a, sonde_vec3 p, sonde_vec3 q) {
  const double x[3] = {p.x, p.y, p.z}, y[3] = {q.x, q.y, q.z};
  double both = v_dot(p, q);
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c)
      m->m[r][c] += a * ((r == c) - x[r] * x[c] - y[r] * y[c] + both * x[r] * y[c]);
}

// Energy K A |grad t|^2/2 of the tangential displacements t = (I - NN^T) u, linear over the face:
// half the cotangent at a corner pulls the two others together.
static void add_inplane(const evaluation *at, uint32_t f) {
  const sonde_model *model = at->model;
  const uint32_t *v = model->surface.faces[f];
  for (int k = 0; k < 3; ++k) {
    uint32_t i = v[(k + 1) % 3], j = v[(k + 2) % 3];
    sonde_tissue_node *a = &at->node[i], *b = &at->node[j];
    double stiffness = model->law.inplane_stiffness_n_m * model->face_half_cotangent[f][k];
    sonde_vec3 apart = v_sub(b->slide_m, a->slide_m), leaving = v_sub(b->slide_m_s, a->slide_m_s);
    a->pull_n = v_madd(a->pull_n, stiffness, apart);
    b->pull_n = v_madd(b->pull_n, -stiffness, apart);
    a->drag_n_s = v_madd(a->drag_n_s, -stiffness, leaving);
    b->drag_n_s = v_madd(b->drag_n_s, stiffness, leaving);
    stiffness *= at->scale.stiffness;
    a->inplane_n_m += stiffness;
    b->inplane_n_m += stiffness;
    if (a->is_row || b->is_row)
      add_across(&at->matrix->upper[model->face_edge[f][k]], -stiffness,
                 model->normal[i < j ? i : j], model->normal[i < j ? j : i]);
  }
}

// Normal spring p(s) A along N plus tangential spring g_t A (I - NN^T), each with its damper.
static void add_anchor(const evaluation *at, uint32_t i) {
  const sonde_model *model = at->model;
  const sonde_tissue_node *node = &at->node[i];
  sonde_vec3 n = model->normal[i];
  double rate = -node->rate_m_s, xm = model->xm_m[i], area = model->area_m2[i];
  anchor_push anchor = push_anchor(&at->anchor, model->k0_n_m3[i], xm, model->law.guard * xm, area,
                                   node->indentation_m, rate);
  double push = anchor.push - v_dot(n, node->pull_n);
  sonde_vec3 f = v_madd(v_add(at->force[i], node->pull_n), push, n);
  at->force[i] =
      v_madd(v_madd(f, -anchor.tangent, node->slide_m), -anchor.tangent_damper, node->slide_m_s);
  double normal_stiffness = anchor.slope * area;
  double hold = normal_stiffness * rate - v_dot(n, node->drag_n_s);
  sonde_vec3 kv = v_madd(v_add(at->stiffness_velocity[i], node->drag_n_s), hold, n);
  at->stiffness_velocity[i] = v_madd(kv, anchor.tangent, node->slide_m_s);
  double flat = at->scale.stiffness * anchor.tangent + at->scale.damping * anchor.tangent_damper +
                node->inplane_n_m;
  double steep =
      at->scale.stiffness * normal_stiffness + at->scale.damping * anchor.damper + node->shear_n_m;
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
  const sonde_surface_law *law = &model->law;
  evaluation at = {
      .model = model,
      .x = position,
      .v = velocity,
      .scale = *scales,
      .edge = edge_law_of(law),
      .anchor = {(int)law->normal_exponent, law->tangential_stiffness_n_m3, law->normal_damping_s},
      .force = force,
      .stiffness_velocity = stiffness_velocity,
      .matrix = matrix,
      .node = scratch};
  const uint32_t *rows = part ? part->rows : NULL, *edges = part ? part->edges : NULL;
  uint32_t row_count = part ? part->row_count : matrix->row_count;
  uint32_t edge_count = part ? part->edge_count : matrix->pair_count;
  for (uint32_t r = 0; r < row_count; ++r) begin_node(&at, rows ? rows[r] : r, true);
  for (uint32_t r = 0; part && r < part->rim_count; ++r) begin_node(&at, part->rim[r], false);
  for (uint32_t k = 0; k < edge_count; ++k) {
    uint32_t e = edges ? edges[k] : k;
    add_edge(&at, e, model->topology.edges[e][0], model->topology.edges[e][1]);
  }
  uint32_t face_count = part ? part->face_count : model->surface.face_count;
  for (uint32_t k = 0; k < face_count && model->law.shear_stiffness_n_m > 0; ++k)
    add_shear(&at, part ? part->faces[k] : k);
  for (uint32_t k = 0; k < face_count && model->law.inplane_stiffness_n_m > 0; ++k)
    add_inplane(&at, part ? part->faces[k] : k);
  for (uint32_t r = 0; r < row_count; ++r) add_anchor(&at, rows ? rows[r] : r);
}

static double shear_energy(const sonde_model *model, const sonde_vec3 *position, uint32_t f) {
  double s[3], across[3];
  for (int k = 0; k < 3; ++k) {
    uint32_t i = model->surface.faces[f][k];
    s[k] = v_dot(model->normal[i], v_sub(model->surface.vertices[i], position[i]));
  }
  double area = model->face_area_m2[f];
  double square = square_slope(model->face_half_cotangent[f], s, across);
  double g = sqrt(fmax(square, 0) / area);
  double shear_n_m, limit;
  sonde_tissue_face_law(model, f, &shear_n_m, &limit);
  return area * sonde_shear_energy(shear_n_m, limit, g);
}

static double inplane_energy(const sonde_model *model, const sonde_vec3 *position, uint32_t f) {
  sonde_vec3 slide[3];
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    uint32_t i = model->surface.faces[f][k];
    sonde_vec3 u = v_sub(position[i], model->surface.vertices[i]);
    slide[k] = v_madd(u, -v_dot(model->normal[i], u), model->normal[i]);
  }
  for (int k = 0; k < 3; ++k)
    sum +=
        model->face_half_cotangent[f][k] * v_norm2(v_sub(slide[(k + 2) % 3], slide[(k + 1) % 3]));
  return 0.5 * model->law.inplane_stiffness_n_m * sum;
}

double sonde_tissue_energy(const sonde_model *model, const sonde_vec3 *position) {
  const sonde_surface_law *law = &model->law;
  const edge_law edge = edge_law_of(law);
  double energy = 0;
  for (uint32_t i = 0; i < model->surface.vertex_count; ++i) {
    sonde_vec3 u = v_sub(position[i], model->surface.vertices[i]);
    double s = -v_dot(model->normal[i], u);
    double area = model->area_m2[i];
    energy += area * sonde_normal_energy(law->normal_exponent, model->k0_n_m3[i], model->xm_m[i],
                                         law->guard, s);
    energy += 0.5 * law->tangential_stiffness_n_m3 * area * (v_norm2(u) - s * s);
  }
  for (uint32_t e = 0; e < model->topology.edge_count; ++e) {
    const uint32_t *pair = model->topology.edges[e];
    double stretch = v_distance(position[pair[0]], position[pair[1]]) - model->edge_rest_m[e];
    double share = share_of(model, e), stiffness = edge_stiffness(&edge, share, stretch);
    energy += (share * edge.pretension + 0.5 * stiffness * stretch) * stretch;
  }
  for (uint32_t f = 0; f < model->surface.face_count && law->shear_stiffness_n_m > 0; ++f)
    energy += shear_energy(model, position, f);
  for (uint32_t f = 0; f < model->surface.face_count && law->inplane_stiffness_n_m > 0; ++f)
    energy += inplane_energy(model, position, f);
  return energy;
}
