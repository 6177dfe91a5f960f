// What a step of each model costs at equal error: the same press on the same meshes, finer and
// finer, each model against itself on the finest.
#include "paper.h"
#include "paper_plot.h"
#include "pose.h"

#include "sonde/fit_bulk.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { LEVELS = 4, MIDDLE = 1, STEPS = 150, MODELS = 6 };
static const double EDGE_M[LEVELS] = {16e-3, 8e-3, 4e-3, 2e-3};
// Cells are halved: only edges that are halves of each other leave the rest of the mesh as it is.
static const double COARSE_EDGE_M = 16e-3, REACH_M = 0.025, DEPTH_M = 6e-3;
static const double EQUAL_PERCENT[2] = {10, 12}; // with few coarse meshes, of --quick, the second

static const struct {
  const char *key, *name;
} MODEL[MODELS] = {[SONDE_TWO_LAYER] = {"two_layer_shear", "Two layers, shear and in-plane"},
                   [SONDE_LATTICE] = {"laffont", "Laffont: linear springs through the volume"},
                   [SONDE_THREE_LAYER] = {"lee", "Lee et al.: biphasic springs, volume force"},
                   [SONDE_LINEAR_SOLID] = {"linear", "Linear tetrahedra"},
                   [SONDE_NEO_HOOKEAN_SOLID] = {"neo_hookean", "Neo-Hookean tetrahedra"},
                   [SONDE_CONDENSED_SOLID] = {"condensed", "Linear tetrahedra, condensed"}};

// A model on a mesh: what the press cost and the forces that it gave.
typedef struct trial {
  bool done;
  double nodes, setup_ms, step_ms, error_percent;
  double force_n[STEPS];
} trial;

// The model of a kind with its fitted parameters on a mesh; a two-layer model stands on the skin of
// the linear solid, so that their surfaces have the same nodes. The flat probe goes DEPTH_M into
// the central site within two thirds of the steps and stays.
static sonde_status try_mesh(const paper *p, sonde_model_kind kind, double edge_m, trial *t,
                             sonde_error *error) {
  sonde_model_def def = sonde_model_def_default();
  def.skin = &p->model->surface, def.femur = &p->model->femur;
  def.sites = p->central, def.site_count = 1;
  sonde_fit_bulk_def options = sonde_fit_bulk_def_default();
  options.kind = kind == SONDE_TWO_LAYER ? SONDE_LINEAR_SOLID : kind;
  options.layers = p->model;
  options.edge_m = fmax(COARSE_EDGE_M, edge_m);
  options.fine_edge_m = edge_m, options.fine_reach_m = REACH_M;
  sonde_model *solid = NULL, *layers = NULL;
  sonde_status status = sonde_bulk_model(&def, &options, &solid, error);
  if (!status && kind == SONDE_TWO_LAYER) {
    def.skin = &solid->surface, def.fine_edge_m = 1; // as the skin is
    def.sites = p->model->sites, def.site_count = p->model->site_count;
    def.law = p->model->law;
    status = sonde_model_build(&def, &layers, error);
  } else if (!status) {
    solid->bulk->law = p->fitted[kind].law;
  }
  const sonde_model *model = layers ? layers : solid;

  double taken[STEPS];
  sonde_state *state = NULL;
  sonde_probe probe = {0};
  sonde_world_def world = sonde_session_def_default().world;
  if (!status) status = sonde_probe_create("linear", &probe, error);
  double start = app_seconds(CLOCK_PROCESS_CPUTIME_ID);
  if (!status) status = sonde_state_create(model, &world, &state, error);
  t->setup_ms = 1e3 * (app_seconds(CLOCK_PROCESS_CPUTIME_ID) - start);
  for (int k = 0; k < STEPS && !status; ++k) {
    sonde_pose pose = sonde_site_pose(p->central, DEPTH_M * fmin(1.5 * (k + 1) / STEPS, 1));
    start = app_seconds(CLOCK_THREAD_CPUTIME_ID);
    sonde_step(state, &probe, pose);
    taken[k] = 1e3 * (app_seconds(CLOCK_THREAD_CPUTIME_ID) - start);
    t->force_n[k] = -vec_dot(sonde_state_contact(state)->force_n, pose_axis(pose, 2));
  }
  if (!status) {
    bool inner = model->bulk && kind != SONDE_CONDENSED_SOLID;
    t->done = true;
    t->nodes = inner ? model->bulk->node_count : model->surface.vertex_count;
    t->step_ms = app_quantile(taken, STEPS, 0.5);
  }
  sonde_state_destroy(state);
  sonde_probe_clear(&probe);
  sonde_model_destroy(layers);
  sonde_model_destroy(solid);
  return status;
}

// Cost where the error falls to equal_percent for good, between two meshes along the logarithms; a
// coarsest mesh with less error costs what it costs. NaN: on no mesh.
static void find_equal(const trial *t, int levels, double equal_percent, double cells[3]) {
  int last = levels - 2; // the finest mesh but the reference
  cells[0] = cells[1] = cells[2] = NAN;
  if (!t[last].done || !(t[last].error_percent <= equal_percent)) return;
  while (last > 0 && t[last - 1].error_percent <= equal_percent) --last;
  const trial *fine = &t[last], *coarse = last > 0 ? fine - 1 : fine;
  double share = last > 0 ? log(equal_percent / fine->error_percent) /
                                log(coarse->error_percent / fine->error_percent)
                          : 0;
  const double ends[3][2] = {{fine->nodes, coarse->nodes},
                             {fine->setup_ms, coarse->setup_ms},
                             {fine->step_ms, coarse->step_ms}};
  for (int k = 0; k < 3; ++k) cells[k] = ends[k][0] * pow(ends[k][1] / ends[k][0], share);
}

static sonde_status draw(paper *p, const trial (*trials)[LEVELS], int levels, sonde_error *error) {
  const char *title = "Figure 9. Error against the cost of a step";
  sonde_file *file = NULL;
  sonde_status status = paper_figure_begin(p, 9, title, 900, 440, &file, error);
  if (status) return status;
  paper_plot plot = {.file = file, .left = 66, .top = 40, .width = 480, .height = 340};
  plot.x_low = plot.y_low = INFINITY, plot.x_high = plot.y_high = -INFINITY;
  double points[MODELS][LEVELS][2];
  uint32_t count[MODELS] = {0};
  for (int m = 0; m < MODELS; ++m)
    for (int k = 0; k + 1 < levels; ++k) {
      if (!trials[m][k].done || !(trials[m][k].error_percent > 0)) continue; // 0: the finest
      double x = log10(trials[m][k].step_ms), y = log10(trials[m][k].error_percent);
      points[m][count[m]][0] = x, points[m][count[m]++][1] = y;
      plot.x_low = fmin(plot.x_low, x - 0.05), plot.x_high = fmax(plot.x_high, x + 0.05);
      plot.y_low = fmin(plot.y_low, y - 0.05), plot.y_high = fmax(plot.y_high, y + 0.05);
    }
  plot_begin(&plot, title, "step, log10 of ms", "error of the force, log10 of per cent");
  for (int m = 0; m < MODELS; ++m) {
    const double(*at)[2] = (const double(*)[2])points[m];
    if (!count[m]) continue;
    plot_line(&plot, at, count[m], PLOT_COLOUR[m], NULL);
    plot_marks(&plot, at, count[m], PLOT_COLOUR[m], (uint32_t)m);
    plot_legend(&plot, 570, 56 + 20 * (double)m, PLOT_COLOUR[m], NULL, m, MODEL[m].name);
  }
  paper_figure *f = &p->figure[8];
  paper_caption(f->caption, sizeof f->caption,
                "The same press with each model on meshes of %.0f to %.1f mm edges at the probe: "
                "mean difference of the force from that on %.1f mm, in per cent of the mean "
                "force, against the median processor time of a step of 1 ms. Not in the paper.",
                1e3 * EDGE_M[0], 1e3 * EDGE_M[levels - 2], 1e3 * EDGE_M[levels - 1]);
  return paper_figure_end(file, SONDE_OK, error);
}

static void judge(paper *p, const paper_table *t, double equal_percent) {
  double own = paper_cell(t, "two_layer_shear", "equal_step_ms"),
         solid = paper_cell(t, "linear", "equal_step_ms"),
         condensed = paper_cell(t, "condensed", "equal_step_ms");
  paper_claim *c = paper_begin(p, "elements_slower_at_equal_error", "2",
                               "Finite elements are slower than masses and springs; condensed to "
                               "the surface they become fast: at equal error.",
                               "Each model on finer and finer meshes against itself on the finest, "
                               "one press for all.");
  paper_samples(c, t->row_count, "models");
  paper_value(c, "two_layer_step_ms", own);
  paper_value(c, "linear_solid_step_ms", solid);
  paper_value(c, "condensed_step_ms", condensed);
  paper_value(c, "condensed_setup_ms", paper_cell(t, "condensed", "equal_setup_ms"));
  bool known = isfinite(own) && isfinite(solid) && isfinite(condensed);
  paper_verdict verdict = !known                             ? PAPER_OPEN
                          : solid > own && condensed < solid ? PAPER_HOLDS
                                                             : PAPER_FAILS;
  paper_say(c, verdict,
            "At an error of %.0f %% of the force a step takes %.3f ms with two layers, %.2f ms "
            "with linear tetrahedra (%.0f times) and %.3f ms with the same condensed, whose "
            "preparation takes %.1f s.",
            equal_percent, own, solid, solid / own, condensed,
            1e-3 * paper_cell(t, "condensed", "equal_setup_ms"));
}

sonde_status paper_equal(paper *p, sonde_error *error) {
  // A body of the quick run is judged on coarse meshes; what was not fitted is left out.
  int levels = p->quick ? 3 : LEVELS;
  const double equal_percent = EQUAL_PERCENT[p->quick];
  trial(*trials)[LEVELS] = calloc(MODELS, sizeof *trials);
  if (!trials) return error->status = SONDE_MEMORY;
  assert(p->central);
  paper_table *t = paper_table_begin(
      p, "equal_error", "Cost of a step and of set-up at equal error",
      "coarse_percent|coarsest, %\nmiddle_percent|8 mm, %\nequal_nodes|nodes\n"
      "equal_setup_ms|set-up, ms\nequal_step_ms|step, ms\ntimes|of two layers'\n"
      "same_nodes|nodes at 8 mm\nsame_setup_ms|set-up at 8 mm, ms\nsame_step_ms|step at 8 mm, ms");
  sonde_status status = SONDE_OK;
  for (int m = 0; m < MODELS && !status; ++m) {
    trial *own = trials[m];
    if (m != SONDE_TWO_LAYER && !p->fitted[m].known) continue;
    int reached = 0;
    for (int k = 0; k < levels && !status; ++k) {
      p->progress.report((m + (double)k / levels) / MODELS, "refining the thigh", p->progress.user);
      status = try_mesh(p, (sonde_model_kind)m, EDGE_M[k], &own[k], error);
      // A skin with too many nodes for K*: the finest mesh is the one before.
      if (m == SONDE_CONDENSED_SOLID && status == SONDE_ARGUMENT && k > MIDDLE + 1) {
        status = SONDE_OK, *error = (sonde_error){0};
        break;
      }
      if (!status) ++reached;
    }
    if (status) break;
    double mean = 0, cells[9];
    for (int i = 0; i < STEPS; ++i) mean += fabs(own[reached - 1].force_n[i]) / STEPS;
    for (int k = 0; k < reached; ++k) {
      double off = 0;
      for (int i = 0; i < STEPS; ++i)
        off += fabs(own[k].force_n[i] - own[reached - 1].force_n[i]) / STEPS;
      own[k].error_percent = 100 * off / mean;
    }
    find_equal(own, reached, equal_percent, &cells[2]);
    cells[0] = own[0].error_percent, cells[1] = own[MIDDLE].error_percent;
    double two[3];
    find_equal(trials[SONDE_TWO_LAYER], levels, equal_percent, two);
    cells[5] = cells[4] / two[2];
    cells[6] = own[MIDDLE].nodes, cells[7] = own[MIDDLE].setup_ms, cells[8] = own[MIDDLE].step_ms;
    paper_row(t, MODEL[m].key, MODEL[m].name, cells);
  }
  paper_caption(
      t->caption, sizeof t->caption,
      "One press for all: the flat probe goes %.0f mm into the central site within 0.1 s and stays "
      "0.05 s, steps of 1 ms. Meshes of %.0f to %.1f mm edges within %.0f mm of the site, the same "
      "for all models; two layers stand on their skin. Error: mean difference of the force from "
      "that of the same model on the finest mesh, in %% of its mean force. Nodes, set-up and "
      "step (processor time, median) are those of an error of %.0f %%, between two meshes along "
      "logarithms.",
      1e3 * DEPTH_M, 1e3 * EDGE_M[0], 1e3 * EDGE_M[levels - 1], 1e3 * REACH_M, equal_percent);
  if (!status) judge(p, t, equal_percent);
  if (!status) status = draw(p, (const trial(*)[LEVELS])trials, levels, error);
  free(trials);
  return status;
}
