// sonde paper: the figures of the paper drawn from our data, and its claims tried one by one.
#include "options.h"
#include "paper.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char VERB[] = "paper";

typedef struct options {
  const char *model, *directory;
  bool quick, json;
} options;

static const app_option TABLE[] = {
    OPT_MODEL(model),
    OPT_TEXT(directory, "o,output", "DIR", "directory to write to; made when absent"),
    OPT_FLAG(quick, "quick",
             "smaller samples: some of the sites, small bodies and few steps; for tests"),
    OPT_JSON(json)};

// The parts of the work with the time that each takes, about, in seconds.
static const struct {
  const char *what;
  sonde_status (*work)(paper *, sonde_error *);
  double seconds;
} PARTS[] = {
    {"drawing the curves", paper_curves, 1},   {"fitting the thigh", paper_fit, 25},
    {"comparing models", paper_models, 70},    {"filling the thigh", paper_bulk, 300},
    {"refining the thigh", paper_equal, 60},   {"drawing probes and springs", paper_drawings, 1},
    {"pressing the thigh", paper_pressed, 40}, {"sweeping the thigh", paper_sweep, 15},
    {"dropping a ball", paper_collision, 25},  {"comparing time steps", paper_steps, 60},
    {"comparing solvers", paper_solvers, 25},  {"timing frames", paper_speed, 15}};
enum { PART_COUNT = sizeof PARTS / sizeof *PARTS };

// Measurements and sites as the model file keeps them; with `quick` those of every fourth site.
static sonde_status gather(paper *p, sonde_error *error) {
  const sonde_model *m = p->model;
  if (m->site_count < 11 || m->datum_count < 100)
    return app_error(error, SONDE_MISMATCH,
                     "%.300s: holds %u sites and %u measurements, expected a model that was fitted "
                     "to 11 sites or more",
                     p->model_path, m->site_count, m->datum_count);
  p->sites.sites = calloc(m->site_count, sizeof *p->sites.sites);
  p->sites.fat_depth_m = calloc(m->site_count, sizeof *p->sites.fat_depth_m);
  sonde_measurements *rows = &p->measurements;
  rows->data = calloc(m->datum_count, sizeof *rows->data);
  rows->position_m = calloc(m->datum_count, sizeof *rows->position_m);
  rows->normal = calloc(m->datum_count, sizeof *rows->normal);
  if (!p->sites.sites || !p->sites.fat_depth_m || !rows->data || !rows->position_m || !rows->normal)
    return error->status = SONDE_MEMORY;
  for (uint32_t s = 0; s < m->site_count; ++s) {
    if (p->quick && s % 4 != (s / 8) % 4)
      continue; // one of four in each row, shifted from row to row
    uint32_t nearest = 0;
    double least = INFINITY;
    for (uint32_t i = 0; i < m->surface.vertex_count; ++i) {
      sonde_vec3 a = m->surface.vertices[i], b = m->sites[s].position_m;
      double away = hypot(hypot(a.x - b.x, a.y - b.y), a.z - b.z);
      if (away < least) least = away, nearest = i;
    }
    p->sites.fat_depth_m[p->sites.count] = m->muscle_depth_m[nearest] - m->fat_depth_m[nearest];
    p->sites.sites[p->sites.count++] = m->sites[s];
  }
  for (uint32_t i = 0; i < m->datum_count; ++i)
    for (uint32_t s = 0; s < p->sites.count; ++s)
      if (m->data[i].site == p->sites.sites[s].id) {
        rows->position_m[rows->count] = p->sites.sites[s].position_m;
        rows->normal[rows->count] = p->sites.sites[s].normal;
        rows->data[rows->count++] = m->data[i];
      }
  p->central = sonde_model_site(m, 27);
  if (!p->central) p->central = &m->sites[m->site_count / 2];
  return SONDE_OK;
}

// The table of a third footprint that ships beside the thigh; with `quick` its first sites.
static sonde_status load_third(paper *p, sonde_error *error) {
  enum { QUICK_SITES = 2 };
  char path[4200];
  sonde_site_table all = {.count = p->model->site_count, .sites = p->model->sites};
  if (!app_data_directory("thigh/indentation_square.csv", path, sizeof path))
    return app_error(error, SONDE_NOT_FOUND,
                     "%.400s: not there; expected measurements of a third footprint", path);
  sonde_status status = sonde_measurements_load(path, &all, &p->third, error);
  if (status || !p->quick) return status;
  uint32_t sites = 0, kept = 0;
  for (; kept < p->third.count; ++kept) {
    sites += kept == 0 || p->third.data[kept].site != p->third.data[kept - 1].site;
    if (sites > QUICK_SITES) break;
  }
  p->third.count = kept;
  return SONDE_OK;
}

static sonde_status work(paper *p, sonde_error *error) {
  double all = 0, done = 0;
  for (int k = 0; k < PART_COUNT; ++k) all += PARTS[k].seconds;
  p->progress = app_progress();
  sonde_status status = sonde_limb_model_load(p->model_path, &p->model, error);
  if (!status) status = gather(p, error);
  if (!status) status = load_third(p, error);
  for (int k = 0; k < PART_COUNT && !status; ++k) {
    app_progress_part(done / all, (done + PARTS[k].seconds) / all);
    if (!p->progress.report(0, PARTS[k].what, p->progress.user))
      status = app_error(error, SONDE_CANCELLED, "cancelled; the figures drawn so far are kept");
    if (!status) status = PARTS[k].work(p, error);
    done += PARTS[k].seconds;
  }
  app_progress_end();
  paper_sort(p);
  return status;
}

static sonde_status write_results(const paper *p, bool print, sonde_error *error) {
  char path[1200], *json = NULL;
  size_t length = 0;
  sonde_file *file = NULL;
  sonde_status status = paper_put_json(p, false, SONDE_JSON_LINES, &json, &length, error);
  paper_path(p, "paper.json", path, sizeof path);
  if (!status) status = sonde_file_create(path, &file, error);
  if (!status) {
    sonde_file_write(file, json, length);
    sonde_file_write(file, "\n", 1);
    status = sonde_file_commit(file, error);
  }
  if (!status && print) {
    fwrite(json, 1, length, stdout);
    putchar('\n');
  }
  sonde_free(json);
  json = NULL;
  if (!status) status = paper_put_json(p, true, SONDE_JSON_COMPACT, &json, &length, error);
  paper_path(p, "paper.html", path, sizeof path);
  if (!status)
    status = sonde_report_write(path, "Towards a realistic echographic simulator, reproduced", json,
                                length, error);
  sonde_free(json);
  return status;
}

static int run(void *from) {
  const options *o = from;
  assert(o->model && o->directory);
  double start = app_seconds(CLOCK_MONOTONIC);
  sonde_error error = {0};
  paper *p = calloc(1, sizeof *p);
  sonde_status status = p ? SONDE_OK : (error.status = SONDE_MEMORY);
  if (!status) status = sonde_directory_make(o->directory, 0777, false, &error);
  if (!status) {
    p->directory = o->directory, p->model_path = o->model, p->quick = o->quick;
    status = work(p, &error);
  }
  if (!status) status = write_results(p, o->json, &error);
  if (!status && !o->json) {
    const double seconds = app_seconds(CLOCK_MONOTONIC) - start;
    uint32_t verdicts[PAPER_VERDICTS] = {0};
    for (const paper_claim *c = p->claim; c < p->claim + p->claim_count; ++c) {
      verdicts[c->verdict]++;
      printf("%-13s  %s: %s\n", paper_verdict_text(c->verdict), c->id, c->found);
    }
    printf("%u claims: %u hold, %u in part, %u do not, %u not tried%s; wrote %s in %.0f s\n",
           p->claim_count, verdicts[PAPER_HOLDS], verdicts[PAPER_IN_PART], verdicts[PAPER_FAILS],
           verdicts[PAPER_OPEN], p->quick ? " (quick: small samples)" : "", p->directory, seconds);
  }
  if (p) {
    sonde_fit_result_clear(&p->fit);
    sonde_site_table_clear(&p->sites);
    sonde_measurements_clear(&p->measurements);
    sonde_measurements_clear(&p->third);
    sonde_model_destroy(p->model);
  }
  free(p);
  return status ? app_fail(VERB, &error) : APP_OK;
}

const app_command cmd_paper = {
    .verb = "paper",
    .summary = "draw the figures of the 1999 paper and try its claims",
    .usage = "[MODEL] -o DIR [--quick] [--json]",
    .text = "Regenerates figures 1 to 8 of \"Towards a realistic echographic simulator with force "
            "feedback\" (IROS 1999) from the bundled data, which are synthetic, and tries its "
            "claims one by one: the sentence, what was done, the figure, and whether it holds. "
            "DIR gets paper.json, paper.html and fig1.svg to fig9.svg. Takes some minutes.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .required = "o",
    .run = run};
