// A fake libHD for the program as a whole: the one of the haptics tests with a hand of its own. It
// lowers the handle until it feels 0.3 N (or for 8 s: a slow machine gives its forces up), is
// unplugged there for a second, and comes back. At the end FAKE_TOUCH_LOG, a file, receives the
// largest force, N, and the largest after the device came back. Linked so that it stays: its thread
// outlives dlclose().
#include "../haptics/fake_hd.c"

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double largest_n, after_n;

static double now_s(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

__attribute__((destructor)) static void write_log(void) {
  const char *path = getenv("FAKE_TOUCH_LOG");
  FILE *file = path ? fopen(path, "w") : NULL;
  if (!file) return;
  fprintf(file, "%.4f %.4f\n", largest_n, after_n);
  fclose(file);
}

static double felt_n(void) {
  double x = fake.force_n[0], y = fake.force_n[1], z = fake.force_n[2];
  return sqrt(x * x + y * y + z * z);
}

static void *live(void *unused) {
  (void)unused;
  const double step_s = 2e-3, speed_m_s = 0.02, start_s = now_s();
  double lost_s = 0;
  for (;;) {
    double force_n = felt_n();
    largest_n = fmax(largest_n, force_n);
    if (lost_s > 0 && fake.plugged) after_n = fmax(after_n, force_n);
    if (lost_s <= 0 && force_n < 0.3 && now_s() < start_s + 8.0)
      fake.position_m[1] = fake.position_m[1] - speed_m_s * step_s; // y is up there
    else if (lost_s <= 0)
      lost_s = now_s();
    fake.plugged = lost_s <= 0 || now_s() > lost_s + 1.0;
    nanosleep(&(struct timespec){0, (long)(1e9 * step_s)}, NULL);
  }
  return NULL;
}

__attribute__((constructor)) static void begin(void) {
  static pthread_t thread;
  fake.plugged = true;
  pthread_create(&thread, NULL, live, NULL);
}
