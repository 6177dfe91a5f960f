// What blood and clots look like: clutter in every lumen, fresh clot like blood, old clot brighter,
// the free surface of a mural clot, floating and recanalised ones.
#include "echo/bench.h"
#include "echo/truth.h"
#include "interior/clot.h"

#include <stdlib.h>

enum { ROUNDS_OF_VIEWS = 40 };

static int by_value(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

// Grey levels of the vein's inner part: median, mean and deviation.
static void lumen_grey(const bench *b, double *median, double *mean, double *deviation) {
  sonde_vessel_state v;
  assert_true(sonde_interior_vessel_at_plane(b->interior, 0, b->pose, &v));
  sonde_vec3 at = pose_apply_inverse(b->pose, v.centre_m);
  double pixel = b->image.width_m / b->image.width, sum = 0, square = 0;
  double half = 0.55 * fmin(v.half_short_m, v.half_long_m);
  static double list[512 * 512];
  int count = 0;
  for (double z = at.z - half; z <= at.z + half; z += pixel)
    for (double x = at.x - half; x <= at.x + half; x += pixel, ++count) {
      int column = (int)(x / pixel + 0.5 * b->image.width), row = (int)(z / pixel);
      assert_true(row >= 0 && row < (int)b->image.height && column >= 0);
      double g = b->image.pixels[row * (int)b->image.width + column];
      list[count] = g, sum += g, square += g * g;
    }
  assert_true(count > 100);
  qsort(list, (size_t)count, sizeof *list, by_value);
  *median = list[count / 2], *mean = sum / count;
  *deviation = sqrt(fmax(square / count - *mean * *mean, 0));
}

static void view(bench *b, int round, const char *state) {
  assert_int_equal(sonde_pathology_preset(state, &b->pathology, NULL), SONDE_OK);
  b->pathology.lumen_scale = 1; // the width of a fresh clot's vein is not its grey level
  sonde_echo_flow flow = sonde_echo_flow_default();
  flow.t_s = 0.37 * round;
  sonde_echo_set_flow(b->echo, &flow);
  b->pose = tube_pose(leg_radius - 1e-3 - 2e-4 * (round % 5), 0.08 + 3.3e-3 * round);
  look(b, NULL);
}

// Area below the receiver's curve of one feature: share of pairs in which the clot's is the larger.
static double separation(const double *blood, const double *clot, int count) {
  double wins = 0;
  for (int i = 0; i < count; ++i)
    for (int j = 0; j < count; ++j) wins += clot[j] > blood[i] ? 1 : clot[j] < blood[i] ? 0 : 0.5;
  double auc = wins / count / count;
  return fmax(auc, 1 - auc);
}

// Without pressing, neither brightness nor texture tells a fresh clot from blood. A lumen is dark
// but not black.
static void fresh_clot_looks_like_blood(void **state) {
  (void)state;
  static const char *const STATES[] = {"healthy", "acute_occlusive", "subacute_occlusive",
                                       "chronic_occlusive"};
  double mean[4][ROUNDS_OF_VIEWS], deviation[4][ROUNDS_OF_VIEWS], median[4] = {0};
  for (int leg = 0; leg < 2; ++leg) {
    bench b;
    bench_create(&b, leg_radius, 0.014, leg ? 0.006 : 0.012, false, true);
    b.settings.depth_m = 0.05;
    for (int k = 0; k < ROUNDS_OF_VIEWS / 2; ++k)
      for (int s = 0; s < 4; ++s) {
        double middle;
        const int at = leg * ROUNDS_OF_VIEWS / 2 + k;
        view(&b, at, STATES[s]);
        lumen_grey(&b, &middle, &mean[s][at], &deviation[s][at]);
        median[s] += middle / ROUNDS_OF_VIEWS;
      }
    bench_clear(&b);
  }
  double of_mean = separation(mean[0], mean[1], ROUNDS_OF_VIEWS);
  double of_deviation = separation(deviation[0], deviation[1], ROUNDS_OF_VIEWS);
  print_message("median grey: blood %.1f, acute %.1f, subacute %.1f, chronic %.1f; area below the "
                "curve %.2f (mean), %.2f (deviation)\n",
                median[0], median[1], median[2], median[3], of_mean, of_deviation);
  assert_true(median[0] > 5 && median[0] < 40);
  assert_true(fabs(median[1] - median[0]) < 3);
  assert_true(of_mean < 0.6 && of_deviation < 0.6);
}

// Each case draws the level of its clot: older ones are brighter in the mean over cases, but a
// subacute one may be as bright as a chronic one.
static void brightness_does_not_tell_the_age(void **state) {
  (void)state;
  enum { CASES = 10 };
  double grey[2][CASES], mean[2] = {0}, deviation;
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, false, true);
  b.settings.depth_m = 0.05;
  for (int k = 0; k < CASES; ++k) {
    sonde_echo_destroy(b.echo);
    sonde_echo_def def = {.version = SONDE_DEF_VERSION, .seed = 100 + (uint64_t)k};
    assert_int_equal(sonde_echo_create(b.interior, &def, &b.echo, NULL), SONDE_OK);
    for (int s = 0; s < 2; ++s) {
      double middle;
      view(&b, k, s ? "chronic_occlusive" : "subacute_occlusive");
      lumen_grey(&b, &middle, &grey[s][k], &deviation);
      mean[s] += grey[s][k] / CASES;
    }
  }
  const double apart = separation(grey[0], grey[1], CASES);
  print_message("mean grey: subacute %.1f, chronic %.1f; area below the curve %.2f\n", mean[0],
                mean[1], apart);
  assert_true(mean[1] > mean[0] + 5);
  assert_true(apart < 0.85);
  bench_clear(&b);
}

static void copy_lumen(const bench *b, float *out, uint32_t size) {
  uint32_t lines, samples, count = 0;
  const float *e = sonde_echo_envelope(b->echo, &lines, &samples);
  double step = b->settings.depth_m / (samples - 1);
  for (uint32_t n = (uint32_t)(0.0140 / step); count < size; ++n)
    for (uint32_t l = 90; l < 102 && count < size; ++l) out[count++] = e[(size_t)n * lines + l];
}

static double likeness(const float *a, const float *b, uint32_t size) {
  double sa = 0, sb = 0, aa = 0, bb = 0, ab = 0;
  for (uint32_t i = 0; i < size; ++i) {
    double x = (double)a[i], y = (double)b[i];
    sa += x, sb += y, aa += x * x, bb += y * y, ab += x * y;
  }
  return (ab - sa * sb / size) / sqrt((aa - sa * sa / size) * (bb - sb * sb / size));
}

// Clutter stays where the tissue stays while blood flows through it; clot stands.
static void clutter_stays_blood_flows(void **state) {
  (void)state;
  enum { SIZE = 12 * 40, FRAMES = 8 };
  float before[SIZE], now[SIZE];
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, false, true);
  b.settings.depth_m = 0.05;
  double alike[2] = {0};
  for (int s = 0; s < 2; ++s)
    for (int k = 0; k <= FRAMES; ++k) {
      sonde_echo_flow flow = sonde_echo_flow_default();
      assert_int_equal(
          sonde_pathology_preset(s ? "acute_occlusive" : "healthy", &b.pathology, NULL), SONDE_OK);
      flow.t_s = 1 + k / 30.0;
      sonde_echo_set_flow(b.echo, &flow);
      look(&b, NULL);
      copy_lumen(&b, k ? now : before, SIZE);
      if (k) alike[s] += likeness(before, now, SIZE) / FRAMES;
    }
  print_message("after a frame and more: blood %.3f, clot %.6f alike\n", alike[0], alike[1]);
  assert_true(alike[0] > 0.2 && alike[0] < 0.9);
  assert_true(alike[1] > 0.999999);
  bench_clear(&b);
}

// The free surface is no plane, changes smoothly along the vessel, and encloses the clot's share.
static void a_mural_clot_is_no_chord(void **state) {
  (void)state;
  for (uint32_t vessel = 0; vessel < 3; ++vessel) {
    double square = 0, steepest = 0, share = 0, count = 0, inside = 0;
    const double fraction = 0.45;
    for (double s = 0; s < 0.05; s += 2.5e-4)
      for (double across = -0.95; across <= 0.95; across += 0.05, ++count) {
        double here = sonde_clot_surface(vessel, s, across);
        double next = sonde_clot_surface(vessel, s + 1e-4, across);
        square += here * here;
        steepest = fmax(steepest, fabs(next - here) / 1e-4 * 4e-3); // of a lumen of 4 mm
        for (double a = -1; a < 1; a += 0.1) {
          if (a * a + across * across >= 1) continue;
          inside += 1, share += -a > 1 - 2 * fraction + here;
        }
      }
    print_message("vessel %u: surface %.2f radii rms, slope at most %.2f, share %.3f of %.2f\n",
                  vessel, sqrt(square / count), steepest, share / inside, fraction);
    assert_true(sqrt(square / count) > 0.08);
    assert_true(steepest < 2);
    assert_true(fabs(share / inside - 0.44) < 0.08);
  }
}

// A floating and a recanalised clot hold their share of every section, and blood reaches the wall
// all around the one and none of it in the other.
static void clots_hold_their_share(void **state) {
  (void)state;
  for (int form = SONDE_CLOT_FLOATING; form <= SONDE_CLOT_RECANALISED; ++form)
    for (double solid = 0.55; solid < 0.9; solid += 0.15) {
      double worst = 0, wandered = 0;
      for (double s = 0; s < 0.1; s += 5e-3) {
        const int side = 160;
        double inside = 0, clot = 0;
        for (int k = 0; k < side * side; ++k) {
          const double a = (k % side + 0.5) / side * 2 - 1, b = (k / side + 0.5) / side * 2 - 1;
          if (a * a + b * b >= 1) continue;
          const bool here = sonde_clot_depth((sonde_clot_form)form, solid, 1, s, a, b) > 0;
          inside += 1, clot += here;
          wandered += here != (sonde_clot_depth((sonde_clot_form)form, solid, 1, 0, a, b) > 0);
          if (a * a + b * b > 0.995) assert_int_equal(here, form == SONDE_CLOT_RECANALISED);
        }
        worst = fmax(worst, fabs(clot / inside - solid));
      }
      print_message("form %d, share %.2f: off by %.3f\n", form, solid, worst);
      assert_true(worst < 0.01 && wandered > 1000);
    }
}

// The label of a pixel in the vein's lumen, thrombus or blood, else none.
static sonde_label lumen_label(const bench *b, uint32_t column, uint32_t row) {
  sonde_truth_pixel p;
  if (!sonde_truth_at(b->echo, &b->image, column, row, &p) || p.vessel != 1)
    return SONDE_LABEL_COUNT;
  return p.label == SONDE_LABEL_THROMBUS || p.label == SONDE_LABEL_VEIN ? p.label
                                                                        : SONDE_LABEL_COUNT;
}

// In the picture the blood of the channels and around the floating clot is darker than the clot,
// where the labels have them. Pixels beside the wall are left out.
static void pictures_show_their_forms(void **state) {
  (void)state;
  static const char *const STATES[] = {"free_floating", "recanalised"};
  bench b;
  bench_create(&b, leg_radius, 0.014, 0.012, false, true);
  b.settings.depth_m = 0.05;
  for (int s = 0; s < 2; ++s) {
    double sum[2] = {0}, count[2] = {0}, all[2] = {0};
    for (int round = 0; round < 6; ++round) {
      view(&b, 5 * round, STATES[s]);
      b.pathology.echogenicity = 0.9; // brighter than blood, whatever this case draws
      look(&b, NULL);
      const uint32_t beside = 9;
      for (uint32_t row = beside; row + beside < b.image.height; row += 2)
        for (uint32_t column = beside; column + beside < b.image.width; column += 2) {
          const sonde_label label = lumen_label(&b, column, row);
          if (label == SONDE_LABEL_COUNT) continue;
          const bool clot = label == SONDE_LABEL_THROMBUS;
          ++all[clot];
          if (lumen_label(&b, column - beside, row) == SONDE_LABEL_COUNT ||
              lumen_label(&b, column + beside, row) == SONDE_LABEL_COUNT ||
              lumen_label(&b, column, row - beside) == SONDE_LABEL_COUNT ||
              lumen_label(&b, column, row + beside) == SONDE_LABEL_COUNT)
            continue;
          sum[clot] += b.image.pixels[row * b.image.width + column], ++count[clot];
        }
    }
    const double share = all[1] / (all[0] + all[1]);
    print_message("%s: clot %.1f, blood %.1f; %.2f of the lumen\n", STATES[s], sum[1] / count[1],
                  sum[0] / count[0], share);
    assert_true(sum[1] / count[1] > sum[0] / count[0] + 10);
    assert_true(fabs(share - b.pathology.thrombus_fraction) < 0.03);
  }
  bench_clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(fresh_clot_looks_like_blood),
                                     cmocka_unit_test(brightness_does_not_tell_the_age),
                                     cmocka_unit_test(clutter_stays_blood_flows),
                                     cmocka_unit_test(a_mural_clot_is_no_chord),
                                     cmocka_unit_test(clots_hold_their_share),
                                     cmocka_unit_test(pictures_show_their_forms)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
