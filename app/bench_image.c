// The image's benchmark: full frames of a thigh that deforms from frame to frame.
// read_options, prepare:  the renderer, its density chosen for the number of scatterers.
// record:                 one frame at each of some settled depths, over and over.
#include "bench_image.h"

#include "app.h"
#include "settled.h"

#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char HELP[] =
    "usage: sonde bench [MODEL] --scene image [options]\n"
    "\n"
    "Times full echographic frames on one core while a probe presses: the tissue's scatterers\n"
    "move with it, rank-three beam, attenuation, interfaces, logarithm, scan conversion. CPU time\n"
    "of the rendering thread; the interior's own update is not part of it.\n"
    "\n"
    "  --lines N        8 to 512; default 192\n"
    "  --samples N      per line, 64 to 4096; default 1024\n"
    "  --scatterers N   moved with the tissue per frame, about; default 1000000\n"
    "  --size WxH       picture; default 512x512\n"
    "  --frames N       1 to 100000; default 200\n"
    "  --kernels NAME   avx512, avx2, sse4, base, plain; default the widest\n"
    "                   that runs here\n"
    "  --curved-mm R    radius of a curved face; default flat\n"
    "  --json           print one JSON object\n"
    "  --help           this text\n"
    "MODEL defaults to the bundled thigh.\n";

enum { STAGES = 6, DEPTHS = 6 };

typedef struct options {
  char model[1024];
  long lines, samples, scatterers, frames, width, height;
  const char *kernels;
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

static bool read_size(options *o, const char *text) {
  char end;
  if (sscanf(text, "%ldx%ld%c", &o->width, &o->height, &end) == 2 && o->width >= 16 &&
      o->height >= 16 && o->width <= 4096 && o->height <= 4096)
    return true;
  app_usage_error("bench", "--size expects WxH from 16x16 to 4096x4096, got '%s'", text);
  return false;
}

static bool read_value(options *o, int option) {
  double mm;
  switch (option) {
  case 'l': return app_parse_integer("bench", "--lines", optarg, 8, 512, &o->lines);
  case 's': return app_parse_integer("bench", "--samples", optarg, 64, 4096, &o->samples);
  case 'n':
    return app_parse_integer("bench", "--scatterers", optarg, 1000, 20000000, &o->scatterers);
  case 'f': return app_parse_integer("bench", "--frames", optarg, 1, 100000, &o->frames);
  case 'z': return read_size(o, optarg);
  case 'r':
    if (!app_parse_real("bench", "--curved-mm", optarg, 20, 1000, &mm)) return false;
    o->radius_m = mm * 1e-3;
    return true;
  case 'k': o->kernels = optarg; return true;
  case 'j': o->json = true; return true;
  case 'S': return true; // the scene, known already
  default: return false;
  }
}

static int read_options(int argc, char **argv, options *o) {
  static const struct option LONG[] = {{"scene", required_argument, NULL, 'S'},
                                       {"lines", required_argument, NULL, 'l'},
                                       {"samples", required_argument, NULL, 's'},
                                       {"scatterers", required_argument, NULL, 'n'},
                                       {"frames", required_argument, NULL, 'f'},
                                       {"size", required_argument, NULL, 'z'},
                                       {"curved-mm", required_argument, NULL, 'r'},
                                       {"kernels", required_argument, NULL, 'k'},
                                       {"json", no_argument, NULL, 'j'},
                                       {"help", no_argument, NULL, 'h'},
                                       {NULL, 0, NULL, 0}};
  for (int c; (c = getopt_long(argc, argv, "", LONG, NULL)) != -1;) {
    if (c == 'h') {
      fputs(HELP, stdout);
      return APP_OK;
    }
    if (!read_value(o, c)) return APP_BAD_INPUT;
  }
  if (!app_model_argument("bench", argc, argv, o->model, sizeof o->model)) return APP_BAD_INPUT;
  return -1;
}

static void draw(bench *b, uint64_t tick) {
  settled_update(&b->scene, &b->pathology, tick);
  sonde_echo_render(b->echo, b->scene.pose, 2 * b->scene.probe.half_x_m, &b->pathology,
                    &b->settings, &b->image);
}

static sonde_status make_echo(bench *b, const options *o, double density, sonde_error *error) {
  sonde_echo_destroy(b->echo);
  b->echo = NULL;
  sonde_echo_def def = {(uint32_t)o->lines, (uint32_t)o->samples, density, 1, false};
  sonde_status status = sonde_echo_create(b->scene.interior, &def, &b->echo, error);
  if (!status && o->kernels) status = sonde_echo_set_kernels(b->echo, o->kernels, error);
  if (!status) status = sonde_echo_check_view(2 * b->scene.probe.half_x_m, o->radius_m, error);
  return status ? status : sonde_echo_set_radius(b->echo, o->radius_m, error);
}

// A first frame at a known density tells the density that is asked for.
static sonde_status prepare(bench *b, const options *o, sonde_error *error) {
  const double known_m3 = 16e9;
  b->settings = sonde_echo_settings_default();
  sonde_status status = sonde_pathology_preset("healthy", &b->pathology, error);
  if (!status) status = settled_open(&b->scene, o->model, "linear", NULL, true, error);
  if (!status && settled_site(&b->scene, o->model, 27, &b->start, error))
    b->start = sonde_site_pose(&b->scene.model->sites[b->scene.model->site_count / 2], 0);
  if (!status)
    status = sonde_image_create((uint32_t)o->width, (uint32_t)o->height, &b->image, error);
  if (!status) status = make_echo(b, o, known_m3, error);
  if (status) return status;
  settled_at(&b->scene, b->start, 0.008, 1e-5);
  draw(b, 1);
  double moved = sonde_echo_last_times(b->echo).scatterers;
  return make_echo(b, o, known_m3 * (double)o->scatterers / fmax(moved, 1), error);
}

static void record(bench *b, const options *o) {
  uint64_t tick = 2;
  for (long first = 0; first < o->frames; first += o->frames / DEPTHS + 1) {
    settled_at(&b->scene, b->start, 0.004 + 0.010 * (double)first / (double)o->frames, 1e-5);
    draw(b, tick++); // warm
    for (long k = first; k < first + o->frames / DEPTHS + 1 && k < o->frames; ++k) {
      settled_at(&b->scene, settled_advance(b->start, 1e-5 * (double)(k % 8)),
                 0.004 + 0.010 * (double)first / (double)o->frames, 1e-3);
      draw(b, tick++);
      sonde_echo_times t = sonde_echo_last_times(b->echo);
      const double s[STAGES] = {t.settings_s, t.plane_s, t.medium_s,
                                t.scatter_s,  t.beam_s,  t.picture_s};
      b->stage[k] = 0;
      for (long i = 0; i < STAGES; ++i) {
        b->stage[(i + 1) * o->frames + k] = s[i] * 1e3;
        b->stage[k] += s[i] * 1e3;
      }
      b->scatterers += t.scatterers / (double)o->frames;
    }
  }
}

static void print(bench *b, const options *o) {
  static const char *const NAMES[STAGES] = {"settings", "plane", "medium",
                                            "scatter",  "beam",  "picture"};
  size_t n = (size_t)o->frames;
  double median = app_quantile(b->stage, n, 0.5), p99 = app_quantile(b->stage, n, 0.99);
  if (!o->json) {
    printf("%ld lines of %ld samples, %.0f scatterers, %ldx%ld pixels, %s, one core\n", o->lines,
           o->samples, b->scatterers, o->width, o->height, sonde_echo_kernels(b->echo));
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

int bench_image(int argc, char **argv) {
  options o = {.lines = 192,
               .samples = 1024,
               .scatterers = 1000000,
               .frames = 200,
               .width = 512,
               .height = 512};
  int code = read_options(argc, argv, &o);
  if (code >= 0) return code;
  bench b = {0};
  sonde_error error = {0};
  b.stage = calloc((size_t)(STAGES + 1) * (size_t)o.frames, sizeof *b.stage);
  sonde_status status = b.stage ? prepare(&b, &o, &error) : SONDE_MEMORY;
  if (!status) {
    record(&b, &o);
    print(&b, &o);
  }
  free(b.stage);
  sonde_image_clear(&b.image);
  sonde_echo_destroy(b.echo);
  settled_close(&b.scene);
  return status ? app_fail("bench", &error) : APP_OK;
}

bool bench_image_asked(int argc, char **argv) {
  for (int i = 1; i < argc; ++i) {
    if (strcmp(argv[i], "--scene=image") == 0) return true;
    if (i + 1 < argc && strcmp(argv[i], "--scene") == 0 && strcmp(argv[i + 1], "image") == 0)
      return true;
  }
  return false;
}
