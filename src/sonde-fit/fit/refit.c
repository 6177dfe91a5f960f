// Stage 3's model: fields of the nodes from parameters of the sites, forces and derivatives of all
// rows.
#include "fit/refit.h"
#include "sparse/dense.h"
#include "base/parallel.h"
#include "fit/refit_inside.h"
#include "fit/refit_offset.h"
#include "fit/site_field.h"

#include "base/maths.h"

#include <string.h>

enum { NEWTON_LIMIT = 60 };
// While the minimisation is under way, and otherwise. A force with derivatives errs with the square
// of the residual only (shear.h).
static const double ROUGH_RESIDUAL = 3e-4, FINE_RESIDUAL = 1e-7;
static const double ROUGH_ADJOINT = 1e-3, FINE_ADJOINT = 1e-6;
static const double DATA_SD = 0.02, MEAN_SHARE = 0.4;
static const double PULL_ALONG_M = 0.010; // width of the rim that a footprint pulls along
static const double LEAST_ROOM = 1.3;     // start of xm over the deepest datum

uint32_t sonde_refit_parameters(const sonde_refit *r) { return r->fields * r->sites->count + 2; }

bool sonde_refit_uses(const sonde_refit *r, uint32_t row) {
  uint32_t curve = r->plan->row_curve[row];
  if (r->left_out && r->left_out[row]) return false;
  return (r->plan->curve_start[curve + 1] - 1 - row) % r->stride == 0;
}

double sonde_refit_sd_n(const sonde_refit *r, uint32_t row) {
  double mean_n = r->plan->mean_force_n[r->plan->row_probe[row]];
  double force_n = r->m->data[r->plan->row[row]].force_n;
  SONDE_ASSERT(mean_n > 0);
  double sd_n = DATA_SD * (MEAN_SHARE * mean_n + (1 - MEAN_SHARE) * fmax(force_n, 0));
  return r->m->scatter_n ? hypot(sd_n, r->m->scatter_n[r->plan->row[row]]) : sd_n;
}

// The depth before on the same curve.
typedef struct depth_before {
  const double *s_m; // NULL at the first
  double depth_m;
  bool has_motion; // the solver knows how free places move with depth
} depth_before;

// Starts from the row's own last equilibrium; else, and again when that fails, from the depth
// before. s_m keeps the outcome.
static sonde_status settle_datum(const sonde_refit *r, sonde_patch_solver *solver, uint32_t row,
                                 bool rough, double depth_m, const depth_before *before,
                                 double *s_m, sonde_error *error) {
  double accuracy = rough ? ROUGH_RESIDUAL : FINE_RESIDUAL;
  SONDE_ASSERT(row < r->plan->row_count && depth_m >= before->depth_m);
  if (r->settled[row] && !sonde_patch_settle(solver, depth_m, accuracy, NEWTON_LIMIT, s_m, error))
    return SONDE_OK;
  double growth = before->depth_m > 0 ? depth_m / before->depth_m : 0;
  for (uint32_t i = 0; i < solver->patch->place_count; ++i)
    if (before->s_m && before->has_motion)
      s_m[i] = before->s_m[i] + (depth_m - before->depth_m) * solver->multiplier[i];
    else
      s_m[i] = before->s_m ? growth * before->s_m[i] : 0;
  sonde_status status = sonde_patch_settle(solver, depth_m, accuracy, NEWTON_LIMIT, s_m, error);
  r->settled[row] = !status;
  return status;
}

typedef struct evaluation {
  sonde_refit *refit;
  sonde_patch_law law;
  double *force_n, *jacobian;
} evaluation;

static sonde_status work_on_curve(void *user, uint32_t worker, uint32_t curve,
                                  const atomic_bool *stop, sonde_error *error) {
  const evaluation *at = user;
  sonde_refit *r = at->refit;
  SONDE_ASSERT(curve < r->plan->curve_count && worker < r->workers);
  const sonde_patch *patch = &r->patch[curve];
  sonde_patch_solver *solver = &r->pool[worker].solver;
  sonde_refit_worker *me = &r->pool[worker];
  uint32_t parameters = sonde_refit_parameters(r);
  depth_before before = {0};
  bool rough = r->rough && at->jacobian;
  sonde_status status = SONDE_OK;
  solver->adjoint_accuracy = rough ? ROUGH_ADJOINT : FINE_ADJOINT;
  sonde_patch_solver_use(solver, patch, &at->law);
  // The patch's part of the basis, in the order of its nodes.
  uint32_t count = r->sites->count;
  for (uint32_t i = 0; at->jacobian && i < patch->node_count; ++i)
    memcpy(me->basis + (size_t)i * count, &r->basis[(size_t)patch->node[i] * count],
           count * sizeof *me->basis);
  for (uint32_t k = r->plan->curve_start[curve]; k < r->plan->curve_start[curve + 1]; ++k) {
    if (!sonde_refit_uses(r, k)) continue;
    if (atomic_load(stop)) return sonde_fail(error, SONDE_CANCELLED, "cancelled");
    double depth = sonde_offsets_depth(r, k);
    double *s = r->indentation_m + r->first_place[k];
    sonde_error inner;
    status = settle_datum(r, solver, k, rough, depth, &before, s, &inner);
    if (!status)
      status = sonde_patch_force(solver, depth, s, &at->force_n[k],
                                 at->jacobian ? &me->gradient : NULL, &inner);
    if (status)
      return sonde_fail(error, status, "site %u, probe %s: %s",
                        r->sites->sites[r->plan->curve_site[curve]].id,
                        r->plan->probe[r->plan->curve_probe[curve]], inner.message);
    if (at->jacobian && r->offsets)
      r->offsets->slope_n_m[k] = sonde_patch_stiffness(solver, solver->multiplier);
    if (at->jacobian) {
      // Derivatives by the parameters of places become those of nodes, then by the kriging basis
      // those of all sites.
      double *row = at->jacobian + (size_t)k * parameters;
      uint32_t places = r->sites->count, fields = r->fields;
      const sonde_patch_gradient *gradient = &me->gradient;
      memset(me->by_node, 0, (size_t)patch->node_count * fields * sizeof *me->by_node);
      for (uint32_t i = 0; i < patch->place_count; ++i)
        for (int j = 0; j < 3 && patch->share[i][j] > 0; ++j) {
          double *to = &me->by_node[(size_t)patch->among[i][j] * fields];
          for (uint32_t f = 0; f < fields; ++f)
            to[f] += patch->share[i][j] * gradient->by_place[f][i];
        }
      memset(row, 0, sonde_refit_parameters(r) * sizeof *row);
      const sonde_product product = {.c = row,
                                     .c_row = places,
                                     .a = me->by_node,
                                     .a_row = 1,
                                     .a_step = fields,
                                     .b = me->basis,
                                     .b_row = places,
                                     .rows = fields,
                                     .columns = places,
                                     .depth = patch->node_count};
      sonde_multiply(&product);
      row[fields * places] = gradient->by_ln_shear;
      row[fields * places + 1] = gradient->by_ln_limit;
    }
    before = (depth_before){s, depth, at->jacobian != NULL};
  }
  return SONDE_OK;
}

sonde_status sonde_refit_forces(sonde_refit *r, const double *theta, double *force_n,
                                double *jacobian, const sonde_progress *progress,
                                sonde_error *error) {
  uint32_t count = r->sites->count;
  const double *shear = theta + r->fields * count;
  SONDE_ASSERT(count > 0);
  // The fields of the nodes from the parameters of the sites.
  for (uint32_t i = 0; i < r->model->surface.vertex_count; ++i) {
    const double *basis = &r->basis[(size_t)i * count];
    for (uint32_t f = 0; f < r->fields; ++f) {
      double ln = 0;
      for (uint32_t k = 0; k < count; ++k) ln += basis[k] * theta[f * count + k];
      r->field[f][i] = ln;
    }
  }
  const sonde_surface_law *law = &r->model->law;
  evaluation at = {r,
                   {.ln_k0 = r->field[0],
                    .ln_xm = r->field[1],
                    .ln_shear = r->field[2],
                    .ln_limit = r->field[3],
                    .exponent = r->def->normal_exponent,
                    .shear_n_m = exp(shear[0]),
                    .limit = exp(shear[1]),
                    .guard = law->guard,
                    .membrane = r->membrane,
                    .stiffening = r->stiffening},
                   force_n,
                   jacobian};
  return sonde_parallel_run(r->plan->curve_count, r->workers, work_on_curve, &at, progress,
                            "stage 3", error);
}

void sonde_refit_offsets(const sonde_refit *r, sonde_curve_fit *curves) {
  for (uint32_t c = 0; r->offsets && c < r->plan->curve_count; ++c) {
    curves[c].zero_m = r->offsets->kept[c][OFFSET_ZERO];
    curves[c].tare_n = r->offsets->kept[c][OFFSET_TARE];
  }
}

void sonde_refit_forget(sonde_refit *r) { memset(r->settled, 0, r->plan->row_count); }

void sonde_refit_want_confidence(sonde_refit *r, sonde_fit_confidence *confidence) {
  r->confidence = confidence;
}

// A footprint of area A and perimeter P works like one of area A + P l + pi l^2 (docs/fit.md).
void sonde_refit_start(const sonde_refit *r, const sonde_curve_fit *curves, double *theta) {
  const sonde_fit_plan *plan = r->plan;
  double ln_k0 = 0, ln_xm = 0, deepest = 0, l = PULL_ALONG_M;
  for (uint32_t c = 0; c < plan->curve_count; ++c) {
    double hu = plan->half_u_m[plan->curve_probe[c]], hv = plan->half_v_m[plan->curve_probe[c]];
    double area = 4 * hu * hv, wide = area + 4 * (hu + hv) * l + SONDE_PI * l * l;
    ln_k0 += log(curves[c].k0_n_m3 * area / wide) / plan->curve_count;
    ln_xm += log(curves[c].xm_m) / plan->curve_count;
  }
  for (uint32_t s = 0; s < plan->site_count; ++s) deepest = fmax(deepest, plan->site_deepest_m[s]);
  ln_xm = fmax(ln_xm, log(LEAST_ROOM * deepest));
  SONDE_ASSERT(isfinite(ln_k0) && isfinite(ln_xm));
  uint32_t count = r->sites->count, n = sonde_refit_parameters(r);
  for (uint32_t k = 0; k < n - 2; ++k) theta[k] = k < count ? ln_k0 : k < 2 * count ? ln_xm : 0;
  theta[n - 2] = ln_k0 + 2 * log(l);
  theta[n - 1] = 0;
}

// ---- creation -----------------------------------------------------------------------------

static sonde_status create_pool(sonde_refit *r, uint32_t threads, sonde_error *error) {
  uint32_t curves = r->plan->curve_count, places = 0, nodes = 0;
  r->workers = sonde_parallel_workers(threads, curves);
  r->pool = SONDE_NEW(sonde_refit_worker, r->workers);
  if (!r->pool) return sonde_fail_memory(error);
  for (uint32_t c = 0; c < curves; ++c) {
    if (r->patch[c].place_count > places) places = r->patch[c].place_count;
    if (r->patch[c].node_count > nodes) nodes = r->patch[c].node_count;
  }
  for (uint32_t w = 0; w < r->workers; ++w) {
    sonde_status status = sonde_patch_solver_create(r->patch, curves, &r->pool[w].solver, error);
    if (status) return status;
    r->pool[w].by_node = SONDE_NEW(double, (size_t)nodes * r->fields);
    r->pool[w].basis = SONDE_NEW(double, (size_t)nodes * r->sites->count);
    if (!r->pool[w].by_node || !r->pool[w].basis) return sonde_fail_memory(error);
    for (int f = 0; f < 4; ++f)
      if (!(r->pool[w].gradient.by_place[f] = SONDE_NEW(double, places)))
        return sonde_fail_memory(error);
  }
  return SONDE_OK;
}

sonde_status sonde_refit_create(const sonde_model *model, const sonde_site_table *sites,
                                const sonde_measurements *m, const sonde_fit_plan *plan,
                                const sonde_fit_def *def, double reach_m, sonde_refit **refit,
                                sonde_error *error) {
  sonde_refit *r = *refit = SONDE_NEW(sonde_refit, 1);
  if (!r) return sonde_fail_memory(error);
  *r = (sonde_refit){.model = model,
                     .sites = sites,
                     .m = m,
                     .plan = plan,
                     .def = def,
                     .stride = 1,
                     .fields = def->uniform_shear ? 2 : 4,
                     .smoothness = {1, 1}};
  size_t nodes = model->surface.vertex_count, count = sites->count, places = 0;
  r->patch = SONDE_NEW(sonde_patch, plan->curve_count);
  r->basis = SONDE_NEW(double, nodes *count);
  r->roughness = SONDE_NEW(double, count *count);
  bool ok = true;
  for (uint32_t f = 0; f < r->fields; ++f) ok &= (r->field[f] = SONDE_NEW(double, nodes)) != NULL;
  r->first_place = SONDE_NEW(size_t, plan->row_count);
  r->settled = SONDE_NEW(uint8_t, plan->row_count);
  ok = ok && r->patch && r->basis && r->roughness && r->first_place && r->settled;
  sonde_status status = ok ? SONDE_OK : sonde_fail_memory(error);
  for (uint32_t k = 0; k < plan->probe_count && !status; ++k)
    if (!(plan->mean_force_n[k] > 0))
      status = sonde_fail(error, SONDE_ARGUMENT,
                          "probe %s has a mean force of %g N, expected > 0 for stage 3",
                          plan->probe[k], plan->mean_force_n[k]);
  if (!status) status = sonde_site_basis(model, sites, r->basis, error);
  if (!status) status = sonde_site_roughness(sites, r->roughness, error);
  // One patch of skin per curve.
  uint32_t coarse = 0;
  for (uint32_t c = 0; c < plan->curve_count && !status; ++c) {
    uint32_t probe = plan->curve_probe[c];
    status = sonde_patch_create(model, &sites->sites[plan->curve_site[c]], plan->half_u_m[probe],
                                plan->half_v_m[probe], reach_m, &r->patch[c], error);
    coarse += !status && r->patch[c].coarse;
  }
  if (coarse && !status)
    sonde_log(SONDE_LOG_WARNING,
              "the mesh is too coarse for %u of %u footprints, expected edges of at most three "
              "quarters of their narrow side",
              coarse, plan->curve_count);
  if (!status) status = sonde_offsets_create(r, &r->offsets, error);
  // The indentations of a row's places stay from one evaluation to the next.
  for (uint32_t k = 0; k < plan->row_count && !status; ++k) {
    r->first_place[k] = places;
    places += r->patch[plan->row_curve[k]].place_count;
  }
  if (!status && !(r->indentation_m = SONDE_NEW(double, places))) status = sonde_fail_memory(error);
  if (!status) status = create_pool(r, def->threads, error);
  if (!status) return SONDE_OK;
  sonde_refit_destroy(r);
  *refit = NULL;
  return status;
}

void sonde_refit_destroy(sonde_refit *r) {
  if (!r) return;
  for (uint32_t c = 0; r->patch && c < r->plan->curve_count; ++c) sonde_patch_clear(&r->patch[c]);
  for (uint32_t w = 0; r->pool && w < r->workers; ++w) {
    sonde_patch_solver_clear(&r->pool[w].solver);
    sonde_free(r->pool[w].by_node);
    sonde_free(r->pool[w].basis);
    for (int f = 0; f < 4; ++f) sonde_free(r->pool[w].gradient.by_place[f]);
  }
  sonde_free(r->pool);
  sonde_offsets_destroy(r->offsets);
  sonde_free(r->patch);
  sonde_free(r->basis);
  sonde_free(r->roughness);
  for (int f = 0; f < 4; ++f) sonde_free(r->field[f]);
  sonde_free(r->first_place);
  sonde_free(r->settled);
  sonde_free(r->indentation_m);
  sonde_free(r);
}
