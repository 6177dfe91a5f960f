// bench_igtl FRAMES HZ CLIENTS: posts frames of 512 x 512 pixels to an OpenIGTLink server at an
// even pace, once so many clients are there, and prints what went out and how long a post took.
// bench/igtl.py starts it with its clients.
#include "sonde/sonde.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { SIDE = 512 };

static double now_s(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void wait_until(double until_s) {
  double left_s = until_s - now_s();
  if (left_s <= 0) return;
  struct timespec pause = {(time_t)left_s, (long)(1e9 * fmod(left_s, 1.0))};
  nanosleep(&pause, NULL);
}

static int ascending(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

int main(int argc, char **argv) {
  const long frames = argc > 1 ? strtol(argv[1], NULL, 10) : 0;
  const double hz = argc > 2 ? strtod(argv[2], NULL) : 0;
  const long clients = argc > 3 ? strtol(argv[3], NULL, 10) : 0;
  if (frames < 1 || frames > 1000000 || !(hz > 0) || clients < 1) {
    fprintf(stderr, "usage: bench_igtl FRAMES HZ CLIENTS\n");
    return 2;
  }
  sonde_error error = {0};
  sonde_igtl_server *server = NULL;
  const sonde_igtl_def def = {.listen = true};
  uint8_t *pixels = malloc((size_t)SIDE * SIDE);
  double *took_s = calloc((size_t)frames, sizeof *took_s);
  if (!pixels || !took_s || sonde_igtl_start(&def, &server, &error)) {
    fprintf(stderr, "bench_igtl: %s\n", error.message);
    return 1;
  }
  printf("%u\n", (unsigned)sonde_igtl_port(server));
  fflush(stdout);
  while (sonde_igtl_counted(server).clients < clients) wait_until(now_s() + 0.01);
  const double begin_s = now_s();
  for (long k = 0; k < frames; ++k) {
    wait_until(begin_s + (double)k / hz);
    for (size_t i = 0; i < (size_t)SIDE * SIDE; ++i)
      pixels[i] = (uint8_t)((i ^ (i >> 9) ^ (size_t)k) & 0xff);
    sonde_frame frame = {
        .pixels = pixels, .width = SIDE, .height = SIDE, .width_m = 0.05, .height_m = 0.05};
    frame.snapshot.world_from_probe.rotation.w = 1;
    frame.snapshot.time_s = (double)k / hz;
    const double posted_s = now_s();
    if (!sonde_igtl_post(server, &frame)) return 1;
    took_s[k] = now_s() - posted_s;
  }
  const double passed_s = now_s() - begin_s;
  wait_until(now_s() + 2); // what is in the sockets
  const sonde_igtl_counts counts = sonde_igtl_counted(server);
  qsort(took_s, (size_t)frames, sizeof *took_s, ascending);
  printf("{\"frames\":%ld,\"hz\":%g,\"sent\":%llu,\"replaced\":%llu,\"post_median_ms\":%.4f,"
         "\"post_p99_ms\":%.4f,\"post_most_ms\":%.4f}\n",
         frames, (double)(frames - 1) / passed_s, (unsigned long long)counts.sent,
         (unsigned long long)counts.replaced, 1e3 * took_s[frames / 2],
         1e3 * took_s[frames * 99 / 100], 1e3 * took_s[frames - 1]);
  sonde_igtl_stop(server);
  free(pixels);
  free(took_s);
  return 0;
}
