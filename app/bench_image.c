// The image's benchmark: full frames of a thigh that deforms from frame to frame, at some settled
// depths of the probe.
#include "bench_image.h"

#include "pose.h"
#include "scanner_choice.h"
#include "settled.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { STAGES = 6, DEPTHS = 6 };

typedef struct options {
  const char *model, *scene;
  long lines, samples, scatterers, frames;
  double size[2];
  const char *kernels, *scanner;
  double radius_m;
  bool json;
} options;

typedef struct bench {
  settled scene;
  sonde_echo *echo;
  sonde_image image;
  sonde_pathology pathology;
  sonde_echo_settings settings;
  sonde_pose start;
  double *stage; // [STAGES + 1][frames] ms, the whole first
  double scatterers;
} bench;

static const options DEFAULTS = {.lines = 192,
                                 .samples = 1024,
                                 .scatterers = 1000000,
                                 .frames = 200,
                                 .size = {512, 512},
                                 .scanner = "plain"};

static const app_option TABLE[] = {
    OPT_MODEL(model),
    OPT_TEXT(scene, "scene", "image", "this form of sonde bench"),
    OPT_INTEGER(lines, "lines", "N", 8, 512, "scan lines"),
    OPT_INTEGER(samples, "samples", "N", 64, 4096, "per line"),
    OPT_INTEGER(scatterers, "scatterers", "N", 1000, 20000000,
                "moved with the tissue per frame, about"),
    OPT_WHOLES(size, "size", "WxH", 16, 4096, "picture"),
    OPT_INTEGER(frames, "frames", "N", 1, 100000, "frames"),
    OPT_TEXT(kernels, "kernels", "NAME",
             "avx512, avx2, sse4, base, plain; default the widest that runs here"),
    OPT_REAL(radius_m, "curved-mm", "R", 20, 1000, 1e-3, "radius of a curved face; default flat"),
    OPT_TEXT(scanner, "scanner", "NAME|FILE", "a live picture of this scanner; default plain"),
    OPT_JSON(json)};

static void draw(bench *b, uint64_t tick) {
  settled_update(&b->scene, &b->pathology, 0, tick);
  sonde_echo_render(b->echo, b->scene.pose, 2 * b->scene.probe.half_x_m, &b->pathology,
                    &b->settings, &b->image);
}

// A renderer of so many scatterers per volume.
static sonde_status make_echo(bench *b, const options *o, double density, sonde_error *error) {
  sonde_echo_destroy(b->echo);
  b->echo = NULL;
  sonde_echo_def def = sonde_echo_def_default();
  def.line_count = (uint32_t)o->lines;
  def.sample_count = (uint32_t)o->samples;
  def.scatterers_per_m3 = density;
  def.seed = 1;
  sonde_scanner scanner;
  sonde_status status = scanner_choose(o->scanner, &scanner, error);
  def.scanner = &scanner, def.rolling = true;
  if (!status) status = sonde_echo_create(b->scene.interior, &def, &b->echo, error);
  if (!status && o->kernels) status = sonde_echo_set_kernels(b->echo, o->kernels, error);
  if (!status) status = sonde_echo_check_view(2 * b->scene.probe.half_x_m, o->radius_m, error);
  return status ? status : sonde_echo_set_radius(b->echo, o->radius_m, error);
}

static void print(bench *b, const options *o) {
  static const char *const NAMES[STAGES] = {"settings", "plane", "medium",
                                            "scatter",  "beam",  "picture"};
  size_t n = (size_t)o->frames;
  double median = app_quantile(b->stage, n, 0.5), p99 = app_quantile(b->stage, n, 0.99);
  if (!o->json) {
    printf("%ld lines of %ld samples, %.0f scatterers, %.0fx%.0f pixels, %s, one core\n", o->lines,
           o->samples, b->scatterers, o->size[0], o->size[1], sonde_echo_kernels(b->echo));
    printf("  frame     median %8.3f ms   p99 %8.3f ms\n", median, p99);
    for (long i = 0; i < STAGES; ++i)
      printf("  %-9s median %8.3f ms\n", NAMES[i],
             app_quantile(b->stage + (size_t)(i + 1) * n, n, 0.5));
    return;
  }
  app_json_begin();
  app_json_text("scene", "image");
  app_json_integer("lines", o->lines);
  app_json_integer("samples", o->samples);
  app_json_text("kernels", sonde_echo_kernels(b->echo));
  app_json_object("frame_ms");
  app_json_real("median", median);
  app_json_real("p99", p99);
  app_json_close();
  app_json_object("stages_ms");
  for (long i = 0; i < STAGES; ++i)
    app_json_real(NAMES[i], app_quantile(b->stage + (size_t)(i + 1) * n, n, 0.5));
  app_json_close();
  app_json_integer("scatterers", (long long)b->scatterers);
  app_json_integer("frames", o->frames);
  app_json_end();
}

static int run(void *from) {
  const options *o = from;
  assert(o->model && o->frames > 0);
  bench b = {0};
  sonde_error error = {0};
  b.stage = calloc((size_t)(STAGES + 1) * (size_t)o->frames, sizeof *b.stage);
  sonde_status status = b.stage ? SONDE_OK : SONDE_MEMORY;
  if (!status) {
    // A first frame at a known density tells the density that is asked for.
    const double known_m3 = 16e9;
    b.settings = sonde_echo_settings_default();
    status = sonde_pathology_preset("healthy", &b.pathology, &error);
    if (!status) status = settled_open(&b.scene, o->model, "linear", NULL, true, &error);
    if (!status && settled_site(&b.scene, o->model, 27, &b.start, &error))
      b.start = sonde_site_pose(&b.scene.model->sites[b.scene.model->site_count / 2], 0);
    if (!status)
      status = sonde_image_create((uint32_t)o->size[0], (uint32_t)o->size[1], &b.image, &error);
    if (!status) status = make_echo(&b, o, known_m3, &error);
    if (!status) {
      settled_at(&b.scene, b.start, 0.008, 1e-5);
      draw(&b, 1);
      double moved = sonde_echo_last_times(b.echo).scatterers;
      status = make_echo(&b, o, known_m3 * (double)o->scatterers / fmax(moved, 1), &error);
    }
  }
  if (!status) {
    // Times of some frames at each depth, after one that fills the caches.
    uint64_t tick = 2;
    for (long first = 0; first < o->frames; first += o->frames / DEPTHS + 1) {
      settled_at(&b.scene, b.start, 0.004 + 0.010 * (double)first / (double)o->frames, 1e-5);
      draw(&b, tick++); // warm
      for (long k = first; k < first + o->frames / DEPTHS + 1 && k < o->frames; ++k) {
        settled_at(&b.scene, pose_shift(b.start, 1e-5 * (double)(k % 8), pose_axis(b.start, 2)),
                   0.004 + 0.010 * (double)first / (double)o->frames, 1e-3);
        draw(&b, tick++);
        sonde_echo_times t = sonde_echo_last_times(b.echo);
        const double s[STAGES] = {t.settings_s, t.plane_s, t.medium_s,
                                  t.scatter_s,  t.beam_s,  t.picture_s};
        b.stage[k] = 0;
        for (long i = 0; i < STAGES; ++i) {
          b.stage[(i + 1) * o->frames + k] = s[i] * 1e3;
          b.stage[k] += s[i] * 1e3;
        }
        b.scatterers += t.scatterers / (double)o->frames;
      }
    }
    print(&b, o);
  }
  free(b.stage);
  sonde_image_clear(&b.image);
  sonde_echo_destroy(b.echo);
  settled_close(&b.scene);
  return status ? app_fail("bench", &error) : APP_OK;
}

const app_command bench_image = {
    .verb = "bench",
    .summary = "time full echographic frames",
    .usage = "[MODEL] --scene image [options]",
    .text = "With --scene image: times full echographic frames on one core while a probe presses: "
            "the tissue's scatterers move with it, rank-three beam, attenuation, interfaces, "
            "logarithm, scan conversion. CPU time of the rendering thread; the interior's own "
            "update is not part of it.",
    OPT_TABLE(TABLE),
    .size = sizeof(options),
    .defaults = &DEFAULTS,
    .run = run};
