// Assembly-free elastic solid: batches, averaged pressures, Newton's method.
#include "elements/volume.h"
#include "base/base.h"
#include "base/maths.h"
#include "base/vector.h"
#include "sparse/dense.h"

#include <string.h>

enum { VECTORS = 7, NEWTON = 60, CG = 3000, HALVINGS = 20 };
static const double BALANCED = 1e-8; // residual over the force of what is imposed
static const double FORCING = 1e-2;  // of a linear solve's residual

static sonde_status check(const sonde_elastic_volume_def *def, sonde_error *error) {
  if (!(def->poisson >= 0 && def->poisson < 0.5))
    return sonde_fail(error, SONDE_ARGUMENT, "Poisson ratio %g: expected 0 to below 0.5",
                      def->poisson);
  for (uint32_t t = 0; t < def->mesh->count; ++t)
    if (!(def->young_pa[t] > 0) || !isfinite(def->young_pa[t]))
      return sonde_fail(error, SONDE_ARGUMENT,
                        "Young's modulus %g Pa of tetrahedron %u: expected a positive number",
                        def->young_pa[t], t);
  return SONDE_OK;
}

static sonde_status allocate(sonde_elastic_volume *v, sonde_error *error) {
  const sonde_tetrahedra *m = v->mesh;
  const size_t lanes = SONDE_VOLUME_BATCH * (size_t)v->batch_count, nodes = m->node_count;
  for (int pass = 0; pass < 2; ++pass) {
    size_t used = 0;
    char *base = pass ? sonde_whole_lines(v->memory) : NULL;
    v->batch = sonde_carve(base, &used, v->batch_count, sizeof *v->batch);
    v->growth = sonde_carve(base, &used, lanes, sizeof *v->growth);
    v->pressure = sonde_carve(base, &used, lanes, sizeof *v->pressure);
    v->pressure_change = sonde_carve(base, &used, lanes, sizeof *v->pressure_change);
    v->volume = sonde_carve(base, &used, m->count, sizeof *v->volume);
    v->diagonal = (double(*)[6])sonde_carve(base, &used, nodes, sizeof *v->diagonal);
    v->vectors = sonde_carve(base, &used, VECTORS * 3 * nodes, sizeof *v->vectors);
    v->rows = sonde_carve(base, &used, nodes, sizeof *v->rows);
    v->held = sonde_carve(base, &used, nodes, 1);
    if (pass == 0 && !(v->memory = sonde_calloc(used + 63, 1))) return sonde_fail_memory(error);
  }
  return SONDE_OK;
}

sonde_status sonde_elastic_volume_create(const sonde_elastic_volume_def *def,
                                         sonde_elastic_volume **volume, sonde_error *error) {
  SONDE_ASSERT(def != NULL && def->mesh != NULL && def->young_pa != NULL && volume != NULL);
  *volume = NULL;
  const sonde_tetrahedra *m = def->mesh;
  sonde_status status = check(def, error);
  if (status) return status;
  sonde_elastic_volume *v = SONDE_NEW(sonde_elastic_volume, 1);
  if (!v) return sonde_fail_memory(error);
  v->mesh = m, v->material = def->material;
  v->batch_count = (m->count + SONDE_VOLUME_BATCH - 1) / SONDE_VOLUME_BATCH;
  const sonde_elastic_volume_kernels *known[] = {
#ifdef __x86_64__
      &sonde_elastic_volume_kernels_avx512, &sonde_elastic_volume_kernels_avx2,
#endif
      &sonde_elastic_volume_kernels_base};
  for (size_t k = SONDE_COUNT_OF(known); k-- > 0;)
    if (sonde_vectors_serve(known[k]->name, NULL)) v->kernels = known[k];
  status = allocate(v, error);
  for (uint32_t t = 0; t < m->count && !status; ++t) {
    sonde_elastic_volume_batch *b = &v->batch[t / SONDE_VOLUME_BATCH];
    const uint32_t lane = t % SONDE_VOLUME_BATCH;
    double g[4][3];
    v->volume[t] = sonde_tetrahedron_gradients(m, t, g);
    b->volume[lane] = v->volume[t];
    b->mu[lane] = sonde_shear_modulus(def->young_pa[t], def->poisson);
    for (int c = 0; c < 4; ++c) b->corner[c][lane] = m->corner[t][c];
    for (int k = 0; k < 12; ++k) b->gradient[k][lane] = g[k / 3][k % 3];
  }
  if (!status) status = sonde_patches_find(m, def->dilatation, v->volume, &v->patches, error);
  if (!status) {
    v->patch_lambda = SONDE_NEW(double, v->patches.count);
    v->patch_pressure = SONDE_NEW(double, v->patches.count);
    if (!v->patch_lambda || !v->patch_pressure) status = sonde_fail_memory(error);
  }
  if (!status)
    sonde_patches_lambda(&v->patches, v->volume, def->young_pa, def->poisson, v->patch_lambda);
  for (uint32_t i = 0; i < m->node_count && !status; ++i) {
    bool bone = i >= m->surface_count && i < m->surface_count + m->held_count;
    v->held[i] = def->held ? def->held[i] & 7 : bone ? 7 : 0;
  }
  if (status)
    sonde_elastic_volume_destroy(v);
  else
    *volume = v;
  return status;
}

void sonde_elastic_volume_destroy(sonde_elastic_volume *v) {
  if (!v) return;
  sonde_patches_clear(&v->patches);
  sonde_free(v->patch_lambda);
  sonde_free(v->patch_pressure);
  sonde_free(v->memory);
  sonde_free(v);
}

// ---- forces -------------------------------------------------------------------------------

// Pressure of each tetrahedron from the growth of all: lambda times the mean of its patches.
// Returns the energy of these means.
static double average(sonde_elastic_volume *v, const double *growth, double *pressure) {
  const sonde_patches *p = &v->patches;
  double energy = 0;
  for (uint32_t i = 0; i < p->count; ++i) {
    double mean = 0;
    for (uint32_t k = p->start[i]; k < p->start[i + 1]; ++k)
      mean += p->share * v->volume[p->list[k]] * growth[p->list[k]] / p->volume[i];
    v->patch_pressure[i] = v->patch_lambda[i] * mean;
    energy += v->patch_lambda[i] / 2 * mean * mean * p->volume[i];
  }
  for (uint32_t t = 0; t < v->mesh->count; ++t) {
    double sum = 0;
    for (uint32_t k = p->of_start[t]; k < p->of_start[t + 1]; ++k)
      sum += p->share * v->patch_pressure[p->of[k]];
    pressure[t] = sum;
  }
  return energy;
}

double sonde_elastic_volume_forces(sonde_elastic_volume *v, const double *u, double *f) {
  SONDE_ASSERT(v != NULL && u != f);
  v->at = u;
  memset(f, 0, 3 * (size_t)v->mesh->node_count * sizeof *f);
  v->kernels->growth(v->batch, v->batch_count, v->material, u, v->growth);
  double energy = average(v, v->growth, v->pressure);
  return energy + v->kernels->forces(v->batch, v->batch_count, v->material, u, v->pressure, f);
}

void sonde_elastic_volume_tangent(sonde_elastic_volume *v, const double *d, double *df) {
  SONDE_ASSERT(v != NULL && v->at != NULL && d != df);
  memset(df, 0, 3 * (size_t)v->mesh->node_count * sizeof *df);
  v->kernels->growth_change(v->batch, v->batch_count, v->material, v->at, d, v->growth);
  (void)average(v, v->growth, v->pressure_change);
  v->kernels->tangent(v->batch, v->batch_count, v->material, v->at, d, v->pressure,
                      v->pressure_change, df);
}

// ---- equilibrium --------------------------------------------------------------------------

static bool is_fixed(const sonde_elastic_volume *v, size_t k) {
  return v->held[k / 3] >> k % 3 & 1;
}

// Inverse diagonal blocks of the matrix at rest, with the means' part as if each tetrahedron stood
// by itself but for the share of it in its patch.
static void find_diagonal(sonde_elastic_volume *v) {
  const sonde_patches *p = &v->patches;
  memset(v->diagonal, 0, v->mesh->node_count * sizeof *v->diagonal);
  for (uint32_t t = 0; t < v->mesh->count; ++t) {
    const sonde_elastic_volume_batch *b = &v->batch[t / SONDE_VOLUME_BATCH];
    const uint32_t lane = t % SONDE_VOLUME_BATCH;
    double lambda = 0;
    for (uint32_t k = p->of_start[t]; k < p->of_start[t + 1]; ++k)
      lambda +=
          p->share * p->share * v->patch_lambda[p->of[k]] * v->volume[t] / p->volume[p->of[k]];
    for (int c = 0; c < 4; ++c) {
      double g[3], square = 0, *d = v->diagonal[b->corner[c][lane]];
      for (int i = 0; i < 3; ++i) g[i] = b->gradient[3 * c + i][lane], square += g[i] * g[i];
      for (int i = 0, at = 0; i < 3; ++i)
        for (int j = i; j < 3; ++j, ++at)
          d[at] += b->volume[lane] *
                   ((b->mu[lane] + lambda) * g[i] * g[j] + (i == j ? b->mu[lane] * square : 0));
    }
  }
  for (uint32_t i = 0; i < v->mesh->node_count; ++i) {
    double *d = v->diagonal[i];
    const double c00 = d[3] * d[5] - d[4] * d[4], c01 = d[2] * d[4] - d[1] * d[5];
    const double c02 = d[1] * d[4] - d[2] * d[3], det = d[0] * c00 + d[1] * c01 + d[2] * c02;
    const double inverse[6] = {c00 / det,
                               c01 / det,
                               c02 / det,
                               (d[0] * d[5] - d[2] * d[2]) / det,
                               (d[1] * d[2] - d[0] * d[4]) / det,
                               (d[0] * d[3] - d[1] * d[1]) / det};
    memcpy(d, inverse, sizeof inverse);
  }
}

static void multiply(const void *user, const double *x, double *y) {
  sonde_elastic_volume *v = (sonde_elastic_volume *)user;
  sonde_elastic_volume_tangent(v, x, y);
  for (size_t k = 0; k < 3 * (size_t)v->mesh->node_count; ++k)
    if (is_fixed(v, k)) y[k] = 0;
}

static double precondition(const void *user, const double *r, double *z) {
  const sonde_elastic_volume *v = user;
  double sum = 0;
  for (uint32_t q = 0; q < v->row_count; ++q) {
    const size_t k = 3 * (size_t)v->rows[q];
    const double *d = v->diagonal[v->rows[q]];
    z[k] = d[0] * r[k] + d[1] * r[k + 1] + d[2] * r[k + 2];
    z[k + 1] = d[1] * r[k] + d[3] * r[k + 1] + d[4] * r[k + 2];
    z[k + 2] = d[2] * r[k] + d[4] * r[k + 1] + d[5] * r[k + 2];
    for (size_t i = 0; i < 3; ++i) {
      if (is_fixed(v, k + i)) z[k + i] = 0;
      sum += r[k + i] * z[k + i];
    }
  }
  return sum;
}

// right = -f on what is solved for; returns the largest. Outside is the largest force elsewhere.
static double residual(const sonde_elastic_volume *v, const uint8_t *solved, const double *f,
                       double *right, double *outside) {
  double most = 0;
  *outside = 0;
  for (size_t k = 0; k < 3 * (size_t)v->mesh->node_count; ++k) {
    bool free = solved[k / 3] && !is_fixed(v, k);
    right[k] = free ? -f[k] : 0;
    if (free)
      most = fmax(most, fabs(f[k]));
    else
      *outside = fmax(*outside, fabs(f[k]));
  }
  return most;
}

sonde_status sonde_elastic_volume_settle(sonde_elastic_volume *v, const uint32_t *imposed,
                                         uint32_t imposed_count, double *u, double *f,
                                         sonde_elastic_volume_result *result, sonde_error *error) {
  SONDE_ASSERT(v != NULL && u != NULL && f != NULL && u != f && result != NULL);
  const size_t n = 3 * (size_t)v->mesh->node_count;
  double *r = v->vectors, *right = r + 4 * n, *step = r + 5 * n, *trial = r + 6 * n;
  uint8_t *solved = SONDE_NEW(uint8_t, v->mesh->node_count);
  if (!solved) return sonde_fail_memory(error);
  for (uint32_t i = 0; i < v->mesh->node_count; ++i) solved[i] = v->held[i] != 7;
  for (uint32_t k = 0; k < imposed_count; ++k) solved[imposed[k]] = 0;
  v->row_count = 0;
  for (uint32_t i = 0; i < v->mesh->node_count; ++i)
    if (solved[i]) v->rows[v->row_count++] = i;
  find_diagonal(v);
  memset(v->vectors, 0, VECTORS * n * sizeof *v->vectors);
  const sonde_operator a = {.count = v->row_count,
                            .width = 3,
                            .rows = v->rows,
                            .multiply = multiply,
                            .precondition = precondition,
                            .user = v};
  const sonde_pcg_vectors vectors = {r, r + n, r + 2 * n, r + 3 * n};
  const sonde_pcg_goal goal = {.relative = FORCING, .max_iterations = CG, .from_zero = true};
  double outside, energy = sonde_elastic_volume_forces(v, u, f);
  *result = (sonde_elastic_volume_result){.residual_n = residual(v, solved, f, right, &outside)};
  while (result->residual_n > BALANCED * outside && result->newton < NEWTON) {
    memset(step, 0, n * sizeof *step);
    v->at = u;
    result->cg += sonde_pcg(&a, right, step, &vectors, &goal).iterations;
    ++result->newton;
    // The step is halved until the energy falls, or the residual where rounding hides the energy.
    double share = 1, before = result->residual_n, now = INFINITY;
    for (int halving = 0; halving < HALVINGS; ++halving, share /= 2) {
      for (size_t k = 0; k < n; ++k) trial[k] = u[k] + share * step[k];
      double next = sonde_elastic_volume_forces(v, trial, f);
      now = residual(v, solved, f, right, &outside);
      if (next < energy || now < before) {
        energy = next;
        break;
      }
    }
    memcpy(u, trial, n * sizeof *u);
    result->residual_n = now;
    (void)sonde_elastic_volume_forces(v, u, f);
    if (!(now < INFINITY)) break;
  }
  sonde_free(solved);
  if (result->residual_n <= BALANCED * outside) return SONDE_OK;
  return sonde_fail(error, SONDE_CONVERGENCE, "%.2g N stay unbalanced after %u Newton steps",
                    result->residual_n, result->newton);
}
