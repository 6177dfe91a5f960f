// sonde cut: cuts the skin of a model along a path and writes the cut model.
#include "options.h"
#include "pose.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static const char VERB[] = "cut";

enum { MOST_POINTS = 1024 };

typedef struct options {
  const char *model, *line, *path, *probe, *output;
  bool json;
  long site;
  double length_m, offset_m, turn_rad, depth_m; // depth NaN: no press
} options;

static const options DEFAULTS = {
    .probe = "linear", .length_m = NAN, .offset_m = 0.015, .depth_m = NAN};

static const app_option TABLE[] = {
    OPT_MODEL(model),
    OPT_TEXT(line, "line", "A:B", "from A to B on the skin at rest, each x,y,z in mm"),
    OPT_TEXT(path, "path", "FILE", "CSV with x_mm,y_mm,z_mm, 2 to 1024 points on the skin at rest"),
    OPT_INTEGER(site, "site", "K", 0, 1000000, "a straight cut beside site K"),
    OPT_REAL(length_m, "length-mm", "L", 5, 200, 1e-3, "with --site: its length"),
    OPT_REAL(offset_m, "offset-mm", "O", -60, 60, 1e-3, "with --site: how far away from the site"),
    OPT_REAL(turn_rad, "turn-deg", "T", -360, 360, 3.14159265358979323846 / 180,
             "with --site: its angle, 0 around the leg, 90 along it"),
    OPT_REAL(depth_m, "depth-mm", "D", 0.1, 30, 1e-3,
             "with --site: press at the site before and after, D below the skin"),
    OPT_TEXT(probe, "probe", "NAME", "with --depth-mm: the probe"),
    OPT_OUTPUT(output, "o", "FILE", "the cut model"),
    OPT_JSON(json)};

typedef struct work {
  sonde_model *model, *cut;
  sonde_cut_map map;
  const sonde_site *site;
  sonde_vec3 path[MOST_POINTS];
  uint32_t count;
  double before_n, after_n, seconds;
} work;

static int check(void *from) {
  const options *o = from;
  if (app_option_given("site") && isnan(o->length_m))
    return app_usage_error(VERB, "--length-mm is missing");
  return APP_OK;
}

// "x,y,z" in mm up to a character of `last` or the end; NULL when it is not that.
static const char *read_triple(const char *text, const char *last, sonde_vec3 *point) {
  double mm[3];
  for (int k = 0; k < 3; ++k) {
    const char *end;
    mm[k] = sonde_parse_real(text, &end);
    if (end == text || !isfinite(mm[k])) return NULL;
    if (k < 2 ? *end != ',' : !strchr(last, *end)) return NULL;
    text = k < 2 ? end + 1 : end;
  }
  *point = (sonde_vec3){mm[0] * 1e-3, mm[1] * 1e-3, mm[2] * 1e-3};
  return text;
}

static sonde_status press(const options *a, const work *w, const sonde_model *model,
                          double *force_n, sonde_error *error) {
  sonde_probe probe = {0};
  sonde_state *state = NULL;
  sonde_status status = sonde_probe_create(a->probe, &probe, error);
  if (!status) status = sonde_state_create(model, NULL, &state, error);
  if (!status) {
    sonde_path_result r;
    status = sonde_settle_path(state, &probe, sonde_site_pose(w->site, 0),
                               sonde_site_pose(w->site, a->depth_m), NULL, NULL, &r, error);
    *force_n = r.settled.contact_n;
    if (r.jump_count)
      fprintf(stderr, "sonde cut: the skin jumped at %.2f mm: another equilibrium may be met\n",
              r.jump[0].from_m * 1e3);
  }
  sonde_state_destroy(state);
  sonde_probe_clear(&probe);
  return status;
}

static double sum(const double *values, uint32_t count) {
  double total = 0;
  for (uint32_t i = 0; i < count; ++i) total += values[i];
  return total;
}

// The points of the cut: two that are given, those of a file, or 33 beside a site.
static sonde_status find_path(const options *a, work *w, sonde_error *error) {
  enum { POINTS = 33 };
  if (a->path) {
    char *bytes = NULL;
    size_t size;
    sonde_status status = sonde_file_load(a->path, &bytes, &size, error);
    bool header = false;
    int number = 0;
    for (char *line = bytes, *next; !status && line && *line; line = next) {
      char *end = line + strcspn(line, "\r\n");
      next = end + strspn(end, "\r") + (end[strspn(end, "\r")] == '\n');
      *end = *end ? '\n' : *end;
      number++;
      if (line == end || *line == '#') continue;
      if (!header) {
        header = strncmp(line, "x_mm,y_mm,z_mm", 14) == 0 && line + 14 == end;
        if (!header)
          status = app_error(error, SONDE_FORMAT, "%.300s:%d: expected the header x_mm,y_mm,z_mm",
                             a->path, number);
        continue;
      }
      if (w->count == MOST_POINTS)
        status = app_error(error, SONDE_FORMAT, "%.300s:%d: expected at most %d points", a->path,
                           number, MOST_POINTS);
      else if (!read_triple(line, "\n", &w->path[w->count++]))
        status =
            app_error(error, SONDE_FORMAT, "%.300s:%d: expected three numbers", a->path, number);
    }
    sonde_free(bytes);
    return status;
  }
  if (a->line) {
    const char *next = read_triple(a->line, ":", &w->path[0]);
    if (next) next = *next == ':' ? read_triple(next + 1, "", &w->path[1]) : NULL;
    w->count = 2;
    return next ? SONDE_OK
                : app_error(error, SONDE_ARGUMENT, "--line expects x,y,z:x,y,z in mm, got '%.80s'",
                            a->line);
  }
  const sonde_site *s = w->site = sonde_model_site(w->model, (uint32_t)a->site);
  if (!s)
    return app_error(error, SONDE_NOT_FOUND, "%.400s: no site %ld, the model has %u sites",
                     a->model, a->site, w->model->site_count);

  // A straight line in the tangent plane of the site, each point moved to the skin below it.
  sonde_surface_index *skin;
  sonde_status status = sonde_surface_index_create(&w->model->surface, &skin, error);
  if (status) return status;
  double c = cos(a->turn_rad), d = sin(a->turn_rad), o = a->offset_m;
  sonde_vec3 inward = {-s->normal.x, -s->normal.y, -s->normal.z};
  for (w->count = 0; !status && w->count < POINTS; ++w->count) {
    double t = a->length_m * (w->count / (POINTS - 1.0) - 0.5);
    sonde_pose above = {.position = s->position_m};
    above = pose_shift(pose_shift(above, t * c - o * d, s->u), t * d + o * c, s->v);
    above = pose_shift(above, 0.02, s->normal);
    sonde_surface_point hit;
    if (sonde_surface_raycast(skin, above.position, inward, 0.1, &hit))
      w->path[w->count] = hit.point_m;
    else
      status = app_error(error, SONDE_ARGUMENT, "the cut leaves the skin %.1f mm beside site %ld",
                         sqrt(t * t + o * o) * 1e3, a->site);
  }
  sonde_surface_index_destroy(skin);
  return status;
}

static sonde_status cut(const options *a, work *w, sonde_error *error) {
  sonde_status status = sonde_limb_model_load(a->model, &w->model, error);
  if (!status) status = find_path(a, w, error);
  if (status) return status;
  double start = app_seconds(CLOCK_MONOTONIC);
  status = sonde_model_cut(w->model, NULL, w->path, w->count, &w->cut, &w->map, error);
  w->seconds = app_seconds(CLOCK_MONOTONIC) - start;
  w->before_n = w->after_n = NAN;
  if (!status && !isnan(a->depth_m)) status = press(a, w, w->model, &w->before_n, error);
  if (!status && !isnan(a->depth_m)) status = press(a, w, w->cut, &w->after_n, error);
  if (status) return status;
  size_t used = strlen(w->cut->provenance);
  snprintf(w->cut->provenance + used, sizeof w->cut->provenance - used, "%scut along %.1f mm",
           used ? "; " : "", w->map.length_m * 1e3);
  return sonde_model_save(w->cut, a->output, error);
}

static int run(void *from) {
  const options *a = from;
  assert(a->output);
  static work w;
  w = (work){0};
  sonde_error error = {0};
  sonde_status status = cut(a, &w, &error);
  if (!status) {
    uint32_t nodes = w.model->surface.vertex_count, after = w.cut->surface.vertex_count;
    double mass = sum(w.model->mass_kg, nodes), mass_after = sum(w.cut->mass_kg, after);
    if (a->json) {
      app_json_begin();
      app_json("nodes_before:%u nodes:%u split_edges:%u length_mm:%g closed:%hhd mass_kg:%g "
               "mass_change:%g cut_ms:%g force_before_n:%g force_after_n:%g model:%s",
               nodes, after, w.map.split_edges, w.map.length_m * 1e3, w.map.closed, mass_after,
               mass_after / mass - 1, w.seconds * 1e3, w.before_n, w.after_n, a->output);
      app_json_end();
    } else {
      printf("cut           %8.1f mm along %u edges%s, in %.1f ms\n", w.map.length_m * 1e3,
             w.map.split_edges, w.map.closed ? ", closed" : "", w.seconds * 1e3);
      printf("nodes         %8u, were %u\n", after, nodes);
      printf("mass          %8.4f kg, changed by %.1g of it\n", mass_after, mass_after / mass - 1);
      if (!isnan(a->depth_m))
        printf("force         %8.3f N at %g mm, was %.3f N\n", w.after_n, a->depth_m * 1e3,
               w.before_n);
      printf("model         %s\n", a->output);
    }
  }
  sonde_cut_map_clear(&w.map);
  sonde_model_destroy(w.cut);
  sonde_model_destroy(w.model);
  return status ? app_fail(VERB, &error) : APP_OK;
}

const app_command cmd_cut = {
    .verb = "cut",
    .summary = "cut the skin along a path and write the cut model",
    .usage = "[MODEL] (--line A:B | --path FILE | --site K --length-mm L) -o FILE [options]",
    .text = "Cuts the skin along a path and writes the model with the cut. The skin opens along "
            "edges of the mesh near the path; mass, area and stiffness stay.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .defaults = &DEFAULTS,
    .required = "o",
    .one_of = "line path site",
    .needs = "length-mm>site offset-mm>site turn-deg>site depth-mm>site probe>site",
    .check = check,
    .run = run};
