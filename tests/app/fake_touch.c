// A fake libHD for the program as a whole: the one of the haptics tests with a hand of its own. It
// presses the handle down 35 mm and is unplugged from 1.2 s to 2.2 s after the library was opened
// first. At the end FAKE_TOUCH_LOG, a file, receives the largest force, the largest after the
// device came back, and the first then, N. Linked so that it stays: its thread outlives dlclose().
#include "../haptics/fake_hd.c"

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double largest_n, after_n, first_after_n = -1;

static double now_s(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

__attribute__((destructor)) static void write_log(void) {
  const char *path = getenv("FAKE_TOUCH_LOG");
  FILE *file = path ? fopen(path, "w") : NULL;
  if (!file) return;
  fprintf(file, "%.4f %.4f %.4f\n", largest_n, after_n, first_after_n);
  fclose(file);
}

static void *live(void *unused) {
  (void)unused;
  double start_s = now_s();
  bool back = false;
  for (;;) {
    double t = now_s() - start_s;
    fake.position_m[1] = -0.035 * fmin(t / 1.0, 1.0); // y is up there
    fake.plugged = t < 1.2 || t > 2.2;
    double force_n = sqrt(fake.force_n[0] * fake.force_n[0] + fake.force_n[1] * fake.force_n[1] +
                          fake.force_n[2] * fake.force_n[2]);
    largest_n = fmax(largest_n, force_n);
    if (t > 2.2 && fake.opened > 1) {
      if (!back) first_after_n = force_n;
      back = true;
      after_n = fmax(after_n, force_n);
    }
    nanosleep(&(struct timespec){0, 5000000}, NULL);
  }
  return NULL;
}

__attribute__((constructor)) static void begin(void) {
  static pthread_t thread;
  if (fake.plugged) return;
  fake.plugged = true;
  pthread_create(&thread, NULL, live, NULL);
}
