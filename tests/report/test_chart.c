// Charts: ticks, colours, what happens to values that cannot be drawn.
#include "base/random.h"
#include "fixture.h"
#include "report/chart.h"

static bool is_round(double step) {
  double leading = step / pow(10, floor(log10(step * (1 + 1e-9))));
  return fabs(leading - 1) < 1e-6 || fabs(leading - 2) < 1e-6 || fabs(leading - 5) < 1e-6;
}

// For ranges over 24 decades: round steps, all of the range covered, neither few nor many ticks.
static void ticks_are_round_and_cover(void **state) {
  (void)state;
  for (uint64_t i = 0; i < 4000; ++i) {
    double size = pow(10, 24 * sonde_random_uniform(1, i) - 12);
    double low = size * (2 * sonde_random_uniform(2, i) - 1);
    double high = low + size * (0.01 + sonde_random_uniform(3, i));
    int ticks = 3 + (int)(i % 12);
    sonde_axis axis = sonde_axis_make(low, high, ticks);
    assert_true(is_round(axis.step));
    assert_true(axis.low <= low + 1e-5 * axis.step && axis.high >= high - 1e-5 * axis.step);
    assert_true(low - axis.low < axis.step && axis.high - high < axis.step);
    long steps = axis.last - axis.first;
    assert_true(steps <= ticks + 2 && 2.5 * (double)steps >= ticks - 1);
    sonde_axis tight = sonde_axis_tight(low, high, ticks);
    assert_near(tight.low, low, 0);
    assert_near(tight.high, high, 0);
    assert_true((double)tight.first * tight.step >= low - 1e-5 * tight.step);
    assert_true((double)tight.last * tight.step <= high + 1e-5 * tight.step);
  }
}

static void hopeless_ranges_give_an_axis(void **state) {
  (void)state;
  const double pairs[][2] = {{0, 0},        {3, 3},  {-2, -2},       {NAN, 1},
                             {0, INFINITY}, {5, -5}, {-1e308, 1e308}};
  for (size_t i = 0; i < SONDE_COUNT_OF(pairs); ++i) {
    sonde_axis axis = sonde_axis_make(pairs[i][0], pairs[i][1], 6);
    assert_true(isfinite(axis.low) && isfinite(axis.high) && axis.high > axis.low);
    assert_true(axis.step > 0);
  }
}

// Labels of neighbouring ticks differ, and read back as the value.
static void labels_tell_ticks_apart(void **state) {
  (void)state;
  for (int decade = -4; decade < 5; ++decade) {
    sonde_axis axis = sonde_axis_make(0, 7 * pow(10, decade), 8);
    for (long i = axis.first; i < axis.last; ++i) {
      double value = (double)i * axis.step;
      sonde_number label = sonde_axis_label(&axis, value);
      assert_near(sonde_parse_real(label.s, NULL), value, 1e-6 * axis.step);
    }
  }
}

// sRGB back to Oklab, by the inverse of the published matrices (solved here, not copied).
static double linear_of(unsigned byte) {
  double c = byte / 255.0;
  return c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4);
}

static void oklab_of(const char *colour, double lab[3]) {
  unsigned rgb[3];
  assert_int_equal(sscanf(colour, "#%2x%2x%2x", &rgb[0], &rgb[1], &rgb[2]), 3);
  double r = linear_of(rgb[0]), g = linear_of(rgb[1]), b = linear_of(rgb[2]);
  double l = cbrt(0.4122214708 * r + 0.5363325363 * g + 0.0514459929 * b);
  double m = cbrt(0.2119034982 * r + 0.6806995451 * g + 0.1073969566 * b);
  double s = cbrt(0.0883024619 * r + 0.2817188376 * g + 0.6299787005 * b);
  lab[0] = 0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s;
  lab[1] = 1.9779984951 * l - 2.4285922050 * m + 0.4505937099 * s;
  lab[2] = 0.0259040371 * l + 0.7827717662 * m - 0.8086757660 * s;
}

// Equal steps of the value look equally large, and lightness alone already orders the colours.
static void sequential_steps_look_equal(void **state) {
  (void)state;
  enum { STEPS = 16 };
  double last[3], least = INFINITY, most = 0;
  oklab_of(sonde_colour_sequential(0, 1).s, last);
  for (int i = 1; i <= STEPS; ++i) {
    double lab[3];
    oklab_of(sonde_colour_sequential((double)i / STEPS, 1).s, lab);
    double step =
        sqrt(pow(lab[0] - last[0], 2) + pow(lab[1] - last[1], 2) + pow(lab[2] - last[2], 2));
    assert_true(lab[0] > last[0] + 0.02);
    least = fmin(least, step);
    most = fmax(most, step);
    memcpy(last, lab, sizeof last);
  }
  assert_true(most < 1.25 * least);
}

static void diverging_is_light_in_the_middle(void **state) {
  (void)state;
  double middle[3], low[3], high[3];
  oklab_of(sonde_colour_diverging(0).s, middle);
  for (int i = 1; i <= 10; ++i) {
    oklab_of(sonde_colour_diverging(-0.1 * i).s, low);
    oklab_of(sonde_colour_diverging(0.1 * i).s, high);
    assert_near(low[0], high[0], 0.03);
    assert_true(low[0] < middle[0] && low[2] < middle[2] && high[2] > middle[2]);
  }
}

// A gap for every value that is not finite, and nothing but numbers in the drawing.
static void lines_break_at_missing_values(void **state) {
  (void)state;
  sonde_text text = {0};
  sonde_chart chart = {&text, 0, 0, 100, 100, sonde_axis_make(0, 10, 5), sonde_axis_make(0, 10, 5)};
  const double x[] = {0, 1, NAN, 3, 4, 5, 6}, y[] = {0, 1, 2, 3, INFINITY, 1e300, -1e300};
  sonde_chart_line(&chart, x, y, 7, "#000", NULL);
  sonde_chart_band(&chart, x, y, y, 7, "#000");
  sonde_chart_dots(&chart, x, y, 7, "#000", 3, true);
  for (int i = 0; i < 7; ++i) sonde_chart_mark(&chart, x[i], y[i], 0, "#000");
  sonde_chart_box(&chart, 0, NAN, 0, 1, "");
  sonde_chart_across(&chart, NAN, "");
  const char *path = strstr(text.bytes, " d='") + 4;
  int moves = 0;
  for (; *path != '\''; ++path) moves += *path == 'm';
  assert_int_equal(moves, 3);
  assert_null(strstr(text.bytes, "nan"));
  assert_null(strstr(text.bytes, "inf"));
  sonde_text_clear(&text);
}

static void names_are_escaped(void **state) {
  (void)state;
  sonde_text text = {0};
  sonde_chart chart = {&text, 0, 0, 100, 100, sonde_axis_make(0, 1, 5), sonde_axis_make(0, 1, 5)};
  sonde_chart_frame(&chart, "<t&", "<x>", "\"y\"");
  sonde_legend(&text, 0, 0, SONDE_SAMPLE_BOTH, "#000", "a<b");
  assert_non_null(strstr(text.bytes, "&lt;t&amp;"));
  assert_non_null(strstr(text.bytes, "&lt;x&gt;"));
  assert_non_null(strstr(text.bytes, "&quot;y&quot;"));
  assert_non_null(strstr(text.bytes, "a&lt;b"));
  assert_null(strstr(text.bytes, "<x>"));
  sonde_text_clear(&text);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(ticks_are_round_and_cover),
      cmocka_unit_test(hopeless_ranges_give_an_axis),
      cmocka_unit_test(labels_tell_ticks_apart),
      cmocka_unit_test(sequential_steps_look_equal),
      cmocka_unit_test(diverging_is_light_in_the_middle),
      cmocka_unit_test(lines_break_at_missing_values),
      cmocka_unit_test(names_are_escaped),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
