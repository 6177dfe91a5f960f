// bench_slice [REPEAT]: CPU time of a picture of 512 x 512 pixels, on one thread, as one JSON
// object: at oblique and along-sweep poses straight from 200 frames of 512 x 512 pixels 0.2 mm
// apart, from a volume of 256^3 at rest, and through a field of 33^3 offsets, as it lies in memory
// (`once_`) and from the copy laid out for many pictures; the time of that copy, and of the
// frames'; the mean and largest error against a field that is read at every pixel. All pictures are
// synthetic.
#include "sonde/sonde.h"

#include "bench.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = 512, FRAMES = 200, VOXELS = 256, NODES = 33, MOST_REPEATS = 1000 };

// Grain of about four pixels, the same everywhere.
static uint8_t grain(uint32_t x, uint32_t y, uint32_t z) {
  uint32_t h = (x / 4 * 73856093u) ^ (y / 4 * 19349663u) ^ (z / 4 * 83492791u);
  h = (h ^ h >> 13) * 1274126177u;
  return (uint8_t)(40 + (h >> 8) % 160);
}

// Pixel (u, v) at x, y from a corner, turned about the picture's row axis by `lean` (rad).
static sonde_affine plane(double x, double y, double z, double lean, double turn, double step) {
  double c = cos(lean), s = sin(lean), a = cos(turn), b = sin(turn);
  return (sonde_affine){
      {{step * c * a, -step * b, 0, x}, {step * c * b, step * a, 0, y}, {step * s, 0, 1, z}}};
}

static const double STEP_M = 0.08e-3, GAP_M = 0.2e-3;

static bool fill_sweep(sonde_sequence *s) {
  if (sonde_sequence_create(SIDE, SIDE, FRAMES, s, NULL)) return false;
  for (uint32_t i = 0; i < FRAMES; ++i) {
    double sway = 0.01 * sin(0.2 * i);
    s->frames[i].world_from_pixel =
        plane(1e-4 * sin(0.3 * i), 0, GAP_M * i, sway, 0.5 * sway, STEP_M);
    s->frames[i].used = true;
    for (uint32_t p = 0; p < SIDE * SIDE; ++p)
      s->pixels[(size_t)i * SIDE * SIDE + p] = grain(p % SIDE, p / SIDE, 2 * i);
  }
  return true;
}

typedef struct times {
  double median_ms, p99_ms, reached;
} times;

static times sort(double *ms, int repeat, uint64_t reached) {
  bench_sort(ms, (size_t)repeat);
  return (times){ms[repeat / 2], ms[(int)(0.99 * (repeat - 1))],
                 (double)reached / ((double)SIDE * SIDE)};
}

static times time_sweep(const sonde_sequence *s, const sonde_affine *pose,
                        sonde_slice_method method, int repeat, sonde_image *image,
                        double *create_ms) {
  double ms[MOST_REPEATS];
  uint64_t reached = 0;
  sonde_slicer_options o = sonde_slicer_options_default();
  sonde_slicer *slicer;
  o.threads = 1;
  o.method = method;
  double begin = 1e3 * bench_seconds();
  if (sonde_slicer_create(s, &o, &slicer, NULL)) exit(1);
  *create_ms = 1e3 * bench_seconds() - begin;
  for (int k = 0; k < repeat; ++k) {
    double start = 1e3 * bench_seconds();
    reached = sonde_slicer_render(slicer, pose, image, NULL);
    ms[k] = 1e3 * bench_seconds() - start;
  }
  sonde_slicer_destroy(slicer);
  return sort(ms, repeat, reached);
}

static const double WARP_M = 3e-3;

static void fill_warp(sonde_warp *w) {
  double step = VOXELS * 0.2e-3 / (NODES - 1);
  w->world_from_node = (sonde_affine){{{step, 0, 0, 0}, {0, step, 0, 0}, {0, 0, step, 0}}};
  for (int i = 0; i < NODES * NODES * NODES; ++i) {
    double x = i % NODES / 32.0, y = i / NODES % NODES / 32.0, z = i / NODES / NODES / 32.0;
    w->offsets_m[3 * i] = (float)(0.3 * WARP_M * sin(4 * y + 2 * z));
    w->offsets_m[3 * i + 1] = (float)(WARP_M * exp(-8 * (x - 0.5) * (x - 0.5)) * (1 - y));
    w->offsets_m[3 * i + 2] = (float)(0.3 * WARP_M * cos(3 * x + 2 * y));
  }
}

// From the slicer, or from the volume without one.
static times time_volume(const sonde_volume *v, const sonde_volume_slicer *slicer,
                         const sonde_warp *w, const sonde_affine *pose, int repeat,
                         sonde_image *image) {
  double ms[MOST_REPEATS];
  uint64_t reached = 0;
  for (int k = 0; k < repeat; ++k) {
    double start = 1e3 * bench_seconds();
    if (slicer)
      reached = sonde_volume_slicer_render(slicer, w, pose, image, NULL);
    else
      reached = w ? sonde_volume_slice_warped(v, w, pose, image, NULL)
                  : sonde_volume_slice(v, false, pose, image, NULL);
    ms[k] = 1e3 * bench_seconds() - start;
  }
  return sort(ms, repeat, reached);
}

// The field at every pixel: pictures of one pixel each, whose only cell begins there.
static void error_of(const sonde_volume *v, const sonde_warp *w, const sonde_affine *pose,
                     const sonde_image *image, double *mean, double *most) {
  sonde_image dot;
  if (sonde_image_create(1, 1, &dot, NULL)) exit(1);
  *mean = *most = 0;
  for (uint32_t p = 0; p < SIDE * SIDE; ++p) {
    sonde_affine at = *pose;
    for (int k = 0; k < 3; ++k) at.m[k][3] += at.m[k][0] * (p % SIDE) + at.m[k][1] * (p / SIDE);
    sonde_volume_slice_warped(v, w, &at, &dot, NULL);
    double error = fabs((double)dot.pixels[0] - image->pixels[p]);
    *mean += error / (SIDE * SIDE);
    *most = fmax(*most, error);
  }
  sonde_image_clear(&dot);
}

static void print(const char *name, times t) {
  printf("  \"%s_ms\": %.3f, \"%s_p99_ms\": %.3f, \"%s_reached\": %.3f,\n", name, t.median_ms, name,
         t.p99_ms, name, t.reached);
}

int main(int argc, char **argv) {
  int repeat = argc > 1 ? atoi(argv[1]) : 101;
  repeat = repeat < 1 ? 1 : repeat > MOST_REPEATS ? MOST_REPEATS : repeat;
  sonde_sequence s;
  sonde_volume v;
  sonde_warp w;
  sonde_image image;
  if (!fill_sweep(&s) || sonde_image_create(SIDE, SIDE, &image, NULL) ||
      sonde_volume_create((uint32_t[3]){VOXELS, VOXELS, VOXELS}, &v, NULL) ||
      sonde_warp_create((uint32_t[3]){NODES, NODES, NODES}, &w, NULL)) {
    fputs("bench_slice: out of memory\n", stderr);
    return 1;
  }
  for (uint32_t p = 0; p < VOXELS * VOXELS * VOXELS; ++p)
    v.voxels[p] = grain(p % VOXELS, p / VOXELS % VOXELS, p / VOXELS / VOXELS);
  v.world_from_voxel = (sonde_affine){{{2e-4, 0, 0, 0}, {0, 2e-4, 0, 0}, {0, 0, 2e-4, 0}}};
  fill_warp(&w);
  sonde_affine oblique = plane(2e-3, 1e-3, 4e-3, 0.7, 0.1, STEP_M);
  sonde_affine along = plane(0.02, 0, 0, 1.5, 0, STEP_M),
               still = plane(0, 0, 0.0201, 0.01, 0, STEP_M);
  sonde_affine pose = plane(3e-3, 4e-3, 9e-3, 0.5, 0.1, 0.09e-3);
  sonde_volume_slicer *bricks;
  double frames_ms, volume_ms = 1e3 * bench_seconds(), unused;
  if (sonde_volume_slicer_create(&v, &bricks, NULL)) return 1;
  volume_ms = 1e3 * bench_seconds() - volume_ms;
  puts("{");
  print("oblique", time_sweep(&s, &oblique, SONDE_SLICE_BRACKET, repeat, &image, &frames_ms));
  print("along", time_sweep(&s, &along, SONDE_SLICE_BRACKET, repeat, &image, &unused));
  print("parallel", time_sweep(&s, &still, SONDE_SLICE_BRACKET, repeat, &image, &unused));
  print("nearest", time_sweep(&s, &oblique, SONDE_SLICE_NEAREST, repeat, &image, &unused));
  print("once_volume", time_volume(&v, NULL, NULL, &pose, repeat, &image));
  print("once_deformed", time_volume(&v, NULL, &w, &pose, repeat, &image));
  print("volume", time_volume(&v, bricks, NULL, &pose, repeat, &image));
  print("deformed", time_volume(&v, bricks, &w, &pose, repeat, &image));
  printf("  \"copy_frames_ms\": %.1f, \"copy_volume_ms\": %.1f,\n", frames_ms, volume_ms);
  double mean, most;
  error_of(&v, &w, &pose, &image, &mean, &most);
  printf("  \"deformed_mean_error_grey\": %.4f, \"deformed_most_error_grey\": %.0f\n}\n", mean,
         most);
  sonde_sequence_clear(&s);
  sonde_volume_slicer_destroy(bricks);
  sonde_volume_clear(&v);
  sonde_warp_clear(&w);
  sonde_image_clear(&image);
  return 0;
}
