// The table of volumetric models: earlier systems' springs and finite elements through the thigh,
// estimated from some sites and judged on them, on sites left out and on the third footprint.
#include "paper.h"
#include "pose.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sonde/fit_bulk.h"

// Rows of some sites of a table.
typedef struct rows {
  sonde_measurements m;
  uint32_t *at; // [m.count] in the table
} rows;

// Rows of `wanted` sites at even distances in the order in which a table names them, the first one
// at that share of a distance.
static sonde_status take_rows(const sonde_measurements *from, uint32_t wanted, double share,
                              rows *to, sonde_error *error) {
  assert(wanted > 0 && share >= 0 && share < 1);
  uint32_t *id = malloc((from->count + 1) * sizeof *id), sites = 0;
  *to = (rows){.at = malloc(from->count * sizeof *to->at)};
  to->m.data = malloc(from->count * sizeof *to->m.data);
  to->m.position_m = malloc(from->count * sizeof *to->m.position_m);
  to->m.normal = malloc(from->count * sizeof *to->m.normal);
  if (!id || !to->at || !to->m.data || !to->m.position_m || !to->m.normal) {
    free(id);
    return error->status = SONDE_MEMORY;
  }
  for (uint32_t i = 0; i < from->count; ++i) {
    uint32_t s = 0;
    while (s < sites && id[s] != from->data[i].site) ++s;
    if (s == sites) id[sites++] = from->data[i].site;
  }
  for (uint32_t i = 0; i < from->count; ++i) {
    bool taken = false;
    for (uint32_t k = 0; k < wanted; ++k)
      taken |= id[(uint32_t)((k + share) * sites / wanted)] == from->data[i].site;
    if (!taken) continue;
    uint32_t k = to->m.count++;
    to->at[k] = i;
    to->m.data[k] = from->data[i];
    to->m.position_m[k] = from->position_m[i], to->m.normal[k] = from->normal[i];
  }
  free(id);
  return SONDE_OK;
}

static void clear_rows(rows *r) {
  free(r->at);
  free(r->m.data);
  free(r->m.position_m);
  free(r->m.normal);
}

// What a model is judged by.
typedef struct judged {
  rows sought, left_out, third;
} judged;

static double percent_at(const sonde_measurements *m, const double *model_n, const char *probe) {
  sonde_error_report report = {0};
  sonde_error error = {0};
  return sonde_error_report_of(m->data, model_n, m->count, &report, &error)
             ? NAN
             : paper_percent(&report, probe);
}

// Processor time of a state's creation and of a step of 1 ms while the flat probe goes in, ms.
sonde_status paper_time_steps(const paper *p, const sonde_model *model, double *setup_ms,
                              double *step_ms, sonde_error *error) {
  enum { MOST_STEPS = 200 };
  uint32_t steps = p->quick ? 20u : MOST_STEPS;
  double taken[MOST_STEPS];
  sonde_state *state = NULL;
  sonde_probe probe = {0};
  sonde_world_def world = sonde_session_def_default().world;
  sonde_status status = sonde_probe_create("linear", &probe, error);
  double start = app_seconds(CLOCK_PROCESS_CPUTIME_ID);
  if (!status) status = sonde_state_create(model, &world, &state, error);
  *setup_ms = 1e3 * (app_seconds(CLOCK_PROCESS_CPUTIME_ID) - start);
  for (uint32_t k = 0; k < steps && !status; ++k) {
    double depth_m = 0.012 * (k + 1) / steps;
    start = app_seconds(CLOCK_THREAD_CPUTIME_ID);
    sonde_step(state, &probe, sonde_site_pose(p->central, depth_m));
    taken[k] = 1e3 * (app_seconds(CLOCK_THREAD_CPUTIME_ID) - start);
  }
  if (!status) *step_ms = app_quantile(taken, steps, 0.5);
  sonde_state_destroy(state);
  sonde_probe_clear(&probe);
  return status;
}

static sonde_status predict(const paper *p, const sonde_model *model, const rows *r,
                            double *model_n, sonde_error *error) {
  sonde_predict_def def = sonde_predict_def_default();
  def.interaction = SONDE_INTERACTION_FULL;
  def.relative_residual = 1e-4;
  def.max_iterations = 60;
  return sonde_predict(model, &p->sites, &r->m, &def, NULL, model_n, error);
}

static sonde_status measure_kind(const paper *p, sonde_model_kind kind, const char *key,
                                 const char *name, const judged *j, paper_table *table,
                                 sonde_model **model, sonde_error *error) {
  sonde_model_def def = sonde_model_def_default();
  def.name = "thigh", def.provenance = p->model->provenance;
  def.skin = &p->model->surface, def.femur = &p->model->femur;
  def.sites = p->sites.sites, def.site_count = p->sites.count;
  def.law = p->model->law;
  sonde_fit_bulk_def options = sonde_fit_bulk_def_default();
  options.kind = kind, options.layers = p->model;
  options.sites = p->quick ? 1 : 3, options.depths = 2;
  options.max_steps = p->quick ? 1 : 4;
  if (p->quick) options.fine_edge_m = 15e-3;
  double *n[3] = {malloc(j->sought.m.count * sizeof(double)),
                  malloc(j->left_out.m.count * sizeof(double)),
                  malloc(j->third.m.count * sizeof(double))};
  sonde_fit_bulk_result r = {0};
  double setup_ms = NAN, step_ms = NAN;
  sonde_status status = n[0] && n[1] && n[2] ? SONDE_OK : (error->status = SONDE_MEMORY);
  if (!status)
    status = sonde_fit_bulk(&def, &p->sites, &j->sought.m, &options, NULL, model, &r, n[0], error);
  if (!status) status = predict(p, *model, &j->left_out, n[1], error);
  if (!status) status = predict(p, *model, &j->third, n[2], error);
  if (!status) status = paper_time_steps(p, *model, &setup_ms, &step_ms, error);
  if (!status) {
    double none = 0;
    uint32_t judged_rows = j->sought.m.count + j->left_out.m.count;
    for (uint32_t i = 0; i < judged_rows; ++i) {
      bool sought = i < j->sought.m.count;
      none += isfinite(sought ? n[0][i] : n[1][i - j->sought.m.count]) ? 0 : 100.0 / judged_rows;
    }
    // Of all rows: no force where a model has no equilibrium, which counts against it.
    double *all = calloc(j->sought.m.count, sizeof *all);
    for (uint32_t i = 0; all && i < j->sought.m.count; ++i)
      all[i] = isfinite(n[0][i]) ? n[0][i] : 0;
    const double of_all = all ? percent_at(&j->sought.m, all, NULL) : NAN;
    free(all);
    const double cells[] = {r.parameter_count,
                            percent_at(&j->sought.m, n[0], "linear"),
                            percent_at(&j->sought.m, n[0], "point"),
                            percent_at(&j->sought.m, n[0], NULL),
                            percent_at(&j->left_out.m, n[1], NULL),
                            percent_at(&j->third.m, n[2], NULL),
                            none,
                            of_all,
                            r.fit_s,
                            r.node_count,
                            setup_ms,
                            step_ms};
    paper_row(table, key, name, cells);
  }
  for (int k = 0; k < 3; ++k) free(n[k]);
  return status;
}

// The two-layer model on the same rows: its forces are known for all of them.
static sonde_status add_two_layer(const paper *p, const judged *j, int stage, const char *key,
                                  const char *name, uint32_t parameters, paper_table *table,
                                  sonde_error *error) {
  const double *all = p->fit.stage_n[stage], *out = p->fit.confidence.one_out_n;
  double *n[2] = {malloc(j->sought.m.count * sizeof(double)),
                  malloc(j->left_out.m.count * sizeof(double))};
  double setup_ms = NAN, step_ms = NAN;
  sonde_status status = n[0] && n[1] ? SONDE_OK : (error->status = SONDE_MEMORY);
  assert(all != NULL);
  if (!status && stage == 2) status = paper_time_steps(p, p->model, &setup_ms, &step_ms, error);
  if (!status) {
    for (uint32_t i = 0; i < j->sought.m.count; ++i) n[0][i] = all[j->sought.at[i]];
    for (uint32_t i = 0; i < j->left_out.m.count; ++i)
      n[1][i] = stage == 2 && out ? out[j->left_out.at[i]] : NAN;
    const double cells[] = {parameters,
                            percent_at(&j->sought.m, n[0], "linear"),
                            percent_at(&j->sought.m, n[0], "point"),
                            percent_at(&j->sought.m, n[0], NULL),
                            percent_at(&j->left_out.m, n[1], NULL),
                            NAN,
                            0,
                            percent_at(&j->sought.m, n[0], NULL),
                            p->fit.seconds[stage],
                            p->model->surface.vertex_count,
                            setup_ms,
                            step_ms};
    paper_row(table, key, name, cells);
  }
  free(n[0]);
  free(n[1]);
  return status;
}

static void judge(paper *p, const paper_table *t, const sonde_condensed_cost *cost,
                  uint32_t samples) {
  double linear = paper_cell(t, "linear", "both_percent"),
         bent = paper_cell(t, "neo_hookean", "both_percent"),
         paper_error = paper_cell(t, "two_layer_paper", "both_percent"),
         own = paper_cell(t, "two_layer_shear", "both_percent");
  paper_claim *c = paper_begin(p, "linear_solid_inconvenient", "2",
                               "Linear elasticity is inconvenient where deformations are large and "
                               "tissue is incompressible.",
                               "Linear and neo-Hookean tetrahedra with one modulus for fat and one "
                               "for muscle, fitted to the "
                               "same sites.");
  paper_samples(c, samples, "forces");
  paper_value(c, "linear_percent", linear);
  paper_value(c, "neo_hookean_percent", bent);
  paper_value(c, "two_layer_percent", paper_error);
  char also[96] = "";
  if (isfinite(bent)) snprintf(also, sizeof also, ", the neo-Hookean one by %.1f %%, both", bent);
  paper_say(c, linear > 2 * own ? PAPER_HOLDS : PAPER_FAILS,
            "The best linear solid is off by %.1f %% of the mean force on the fitted sites%s with "
            "two numbers for the whole thigh; the paper's model by %.1f %%, ours with shear by "
            "%.1f %%, with numbers for every site.",
            linear, also, paper_error, own);

  double step = paper_cell(t, "two_layer_shear", "step_ms"),
         solid = paper_cell(t, "linear", "step_ms"),
         nodes = paper_cell(t, "two_layer_shear", "nodes"),
         solid_nodes = paper_cell(t, "linear", "nodes");
  c = paper_begin(
      p, "elements_slower", "2",
      "Finite elements are slower than masses and springs; condensed to the surface they "
      "become fast, for linear materials.",
      "A step of 1 ms of each model in the same engine, and a contact of the condensed "
      "linear solid (K* and its inverse computed beforehand).");
  paper_samples(c, 200, "steps");
  paper_value(c, "two_layer_step_ms", step);
  paper_value(c, "linear_solid_step_ms", solid);
  paper_value(c, "neo_hookean_step_ms", paper_cell(t, "neo_hookean", "step_ms"));
  paper_value(c, "condensed_skin_nodes", cost->skin_nodes);
  paper_value(c, "condensed_setup_s", cost->setup_s);
  paper_value(c, "condensed_megabytes", cost->bytes / 1e6);
  paper_value(c, "condensed_contact_ms", 1e3 * (cost->contact_s + cost->update_s));
  paper_value(c, "condensed_from_whole", cost->solve_difference);
  paper_value(c, "condensed_from_engine", cost->engine_difference);
  paper_say(
      c, solid > step ? PAPER_HOLDS : PAPER_FAILS,
      "A step takes %.2f ms with %.0f nodes of two layers and %.2f ms with %.0f nodes of linear "
      "tetrahedra, %.1f times as much per node. Condensed to %u nodes of the skin a contact of "
      "%u nodes takes %.2g ms after %.1f s of preparation and %.0f MB; its forces equal those of "
      "the whole solid to %.1g.",
      step, nodes, solid, solid_nodes, solid / solid_nodes / (step / nodes), cost->skin_nodes,
      cost->contact_nodes, 1e3 * (cost->contact_s + cost->update_s), cost->setup_s,
      cost->bytes / 1e6, cost->solve_difference);
}

// The linear solid on a mesh that is coarse enough for a dense matrix of its skin.
static sonde_status measure_condensed(const paper *p, paper_table *table,
                                      sonde_condensed_cost *cost, sonde_error *error) {
  sonde_model_def def = sonde_model_def_default();
  def.skin = &p->model->surface, def.femur = &p->model->femur;
  def.sites = p->sites.sites, def.site_count = p->sites.count;
  sonde_fit_bulk_def options = sonde_fit_bulk_def_default();
  options.layers = p->model;
  options.edge_m = 20e-3, options.fine_edge_m = p->quick ? 20e-3 : 10e-3;
  sonde_model *model = NULL;
  sonde_status status = sonde_bulk_model(&def, &options, &model, error);
  if (!status)
    status = sonde_condensed_measure(model, p->central, 0.03, 0.006, 5e-3, 0, cost, error);
  sonde_model_destroy(model);
  model = NULL;
  // The same in the engine. Its misfit is that of the linear solid, which it is.
  options.kind = SONDE_CONDENSED_SOLID;
  double setup_ms = NAN, step_ms = NAN;
  if (!status) status = sonde_bulk_model(&def, &options, &model, error);
  if (!status) {
    model->bulk->law = p->fitted[SONDE_CONDENSED_SOLID].law;
    status = paper_time_steps(p, model, &setup_ms, &step_ms, error);
  }
  if (!status) {
    static const char *const LIKE_LINEAR[] = {"parameters",   "linear_percent",   "point_percent",
                                              "both_percent", "left_out_percent", "third_percent",
                                              "none_percent", "all_percent"};
    enum { LIKE = sizeof LIKE_LINEAR / sizeof *LIKE_LINEAR };
    double cells[LIKE + 4] = {0};
    for (int k = 0; k < LIKE; ++k) cells[k] = paper_cell(table, "linear", LIKE_LINEAR[k]);
    cells[LIKE] = NAN, cells[LIKE + 1] = model->surface.vertex_count;
    cells[LIKE + 2] = setup_ms, cells[LIKE + 3] = step_ms;
    paper_row(table, "condensed", "Linear tetrahedra, condensed", cells);
  }
  sonde_model_destroy(model);
  return status;
}

sonde_status paper_bulk(paper *p, sonde_error *error) {
  static const struct {
    sonde_model_kind kind;
    const char *key, *name;
    bool is_long;
  } KINDS[] = {{SONDE_LATTICE, "laffont", "Laffont: linear springs through the volume", true},
               {SONDE_THREE_LAYER, "lee", "Lee et al.: biphasic springs, volume force", true},
               {SONDE_LINEAR_SOLID, "linear", "Linear tetrahedra", false},
               {SONDE_NEO_HOOKEAN_SOLID, "neo_hookean", "Neo-Hookean tetrahedra", true}};
  assert(p->fit.stage_n[2]);
  paper_table *t = paper_table_begin(
      p, "volumetric", "Models through the volume on the same measurements",
      "parameters|parameters\nlinear_percent|linear, %\npoint_percent|point, %\n"
      "both_percent|both, %\nleft_out_percent|sites left out, %\nthird_percent|third footprint, %\n"
      "none_percent|no equilibrium, %\nall_percent|both, these as no force, "
      "%\nestimate_s|estimation, s\nnodes|nodes\nsetup_ms|set-up, ms\n"
      "step_ms|step, ms");
  judged j = {0};
  uint32_t sites = p->quick ? 1 : 4;
  sonde_status status = take_rows(&p->measurements, sites, 0.25, &j.sought, error);
  if (!status) status = take_rows(&p->measurements, sites, 0.75, &j.left_out, error);
  if (!status) status = take_rows(&p->third, sites, 0.5, &j.third, error);
  paper_caption(
      t->caption, sizeof t->caption,
      "Errors are mean absolute errors, in %% of the mean force, on the same rows for all: "
      "%u of fitted sites (linear, point, both), %u of sites left out, %u of the third "
      "footprint. Volumetric models have one set of moduli for the whole thigh, sought on three of "
      "these sites; the two-layer models have numbers for every site, fitted to all of "
      "them. No equilibrium: rows of fitted sites and of sites left out that have no force and "
      "count in the last "
      "error only. Step: median "
      "processor time with the flat probe going in.",
      j.sought.m.count, j.left_out.m.count, j.third.m.count);
  if (!status)
    status = add_two_layer(p, &j, 1, "two_layer_paper", "Two layers, as in the paper (stage 2)",
                           p->fit.stage2_parameters, t, error);
  if (!status)
    status = add_two_layer(p, &j, 2, "two_layer_shear", "Two layers, shear and in-plane",
                           p->fit.parameters, t, error);
  for (size_t k = 0; k < sizeof KINDS / sizeof *KINDS && !status; ++k) {
    sonde_model *model = NULL;
    if (p->quick && KINDS[k].is_long) continue;
    status = measure_kind(p, KINDS[k].kind, KINDS[k].key, KINDS[k].name, &j, t, &model, error);
    if (!status) {
      p->fitted[KINDS[k].kind].known = true;
      p->fitted[KINDS[k].kind].law = model->bulk->law;
    }
    sonde_model_destroy(model);
  }
  sonde_condensed_cost cost = {0};
  p->fitted[SONDE_CONDENSED_SOLID] = p->fitted[SONDE_LINEAR_SOLID];
  if (!status) status = measure_condensed(p, t, &cost, error);
  if (!status) judge(p, t, &cost, j.sought.m.count);
  clear_rows(&j.sought);
  clear_rows(&j.left_out);
  clear_rows(&j.third);
  return status;
}
