// The colour estimate against exact flows: plugs, Poiseuille's parabola, Womersley's pulse, a
// stenosis; folding; nothing where nothing flows.
#include "sonde/flow_colour.h"

#include "fixture.h"

#include <math.h>

static const sonde_colour_box BOX = {-0.012, 0.012, 0.008, 0.032, 0, 0};

static sonde_colour_cell cells[SONDE_COLOUR_CELLS];
static double truth[SONDE_COLOUR_CELLS], found[SONDE_COLOUR_CELLS], power[SONDE_COLOUR_CELLS];

static sonde_colour *create(const sonde_colour_def *def) {
  sonde_colour *c = NULL;
  sonde_error error = {0};
  sonde_status status = sonde_colour_create(def, &c, &error);
  if (status) print_error("%s\n", error.message);
  assert_int_equal(status, SONDE_OK);
  return c;
}

// A vessel across the box, its axis at an angle to the beam: mean velocity and radius at each place
// along it give the profile, whose shape is [RINGS] over its mean.
typedef struct tube {
  double angle_rad;
  double (*radius_m)(double along_m);
  double mean_m_s, radius_there_m; // where the mean holds
  const double *shape;
} tube;

// Across the vessel along its axis through (0, 20 mm) of the image plane; in a box before a curved
// face the beam has another angle to it on every line.
static void lay_in(const tube *t, const sonde_colour_box *box) {
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) {
    double xz[2];
    sonde_colour_place(box, i % SONDE_COLOUR_LINES, i / SONDE_COLOUR_LINES, xz);
    const double z = xz[1] - 0.02, c = cos(t->angle_rad), s = sin(t->angle_rad);
    const double along = xz[0] * s - z * c, beside = xz[0] * c + z * s;
    const double radius = t->radius_m(along), at = fabs(beside) / radius * (SONDE_FLOW_RINGS - 1);
    cells[i] = (sonde_colour_cell){.vessel = SONDE_COLOUR_NO_VESSEL}, truth[i] = 0;
    if (!(at < SONDE_FLOW_RINGS - 1)) continue;
    const int k = (int)at;
    const double mean = t->mean_m_s * pow(t->radius_there_m / radius, 2);
    const double u = mean * (t->shape[k] + (at - k) * (t->shape[k + 1] - t->shape[k]));
    const double turned =
        t->angle_rad + (box->radius_m > 0 ? atan2(xz[0], xz[1] + box->radius_m) : 0);
    truth[i] = u * cos(turned);
    cells[i] = (sonde_colour_cell){(float)truth[i], (float)(u * fabs(sin(turned))), 0, 0};
  }
}

static void lay(const tube *t) { lay_in(t, &BOX); }

// Means of so many frames.
static void measure(sonde_colour *c, uint32_t frames) {
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) found[i] = power[i] = 0;
  for (uint32_t f = 0; f < frames; ++f) {
    const sonde_colour_value *value = sonde_colour_frame(c, cells);
    for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i)
      found[i] += (double)value[i].velocity_m_s / frames,
          power[i] += (double)value[i].power / frames;
  }
}

// Root mean square and mean error over the blood more than `rim_m` inside and faster than a tenth
// of the limit, over the greatest true velocity.
typedef struct misfit {
  double rms, mean, greatest;
  uint32_t count;
} misfit;

static misfit compare(const sonde_colour_def *def) {
  misfit m = {0, 0, 0, 0};
  double sum = 0, bias = 0, whole = 0;
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) {
    m.greatest = fmax(m.greatest, fabs(truth[i]));
    if (fabs(truth[i]) < 0.15 * sonde_colour_limit(def) || power[i] < (double)SONDE_COLOUR_POWER)
      continue;
    sum += pow(found[i] - truth[i], 2), bias += found[i] - truth[i], whole += truth[i], ++m.count;
  }
  if (m.count > 0) m.rms = sqrt(sum / m.count) / m.greatest, m.mean = bias / whole;
  return m;
}

static double even(double along_m) {
  (void)along_m;
  return 4e-3;
}
static double narrowed(double along_m) { return 4e-3 * (1 - 0.35 * exp(-pow(along_m / 4e-3, 2))); }

static void parabola(double shape[SONDE_FLOW_RINGS]) { sonde_flow_steady(1, shape); }

static void test_poiseuille(void **unused) {
  (void)unused;
  const sonde_colour_def def = sonde_colour_def_default();
  double shape[SONDE_FLOW_RINGS];
  parabola(shape);
  for (int k = 0; k < 4; ++k) {
    static const double CASE[4][2] = {{60, 0.1}, {120, 0.1}, {45, -0.08}, {30, 0.05}};
    const tube t = {CASE[k][0] * M_PI / 180, even, CASE[k][1], 4e-3, shape};
    sonde_colour *c = create(&def);
    lay(&t);
    measure(c, 20);
    const misfit m = compare(&def);
    print_message("parabola, %3.0f degrees, %5.2f m/s: %u cells, rms %.1f %%, mean %.1f %%\n",
                  CASE[k][0], CASE[k][1], m.count, 100 * m.rms, 100 * m.mean);
    assert_true(m.count > 1000 && m.rms < 0.05 && fabs(m.mean) < 0.05);
    sonde_colour_destroy(c);
  }
  // Before a curved face: what the estimate finds of the velocity along each line, and the flow
  // that follows from it by the angle between the vessel and that line.
  const sonde_colour_box fan = {-0.012, 0.012, 0.008, 0.032, 0, 0.06};
  const tube t = {M_PI / 3, even, 0.1, 4e-3, shape};
  sonde_colour *c = create(&def);
  lay_in(&t, &fan);
  measure(c, 20);
  const misfit m = compare(&def);
  print_message("parabola before a face of 60 mm: %u cells, rms %.1f %%, mean %.1f %%\n", m.count,
                100 * m.rms, 100 * m.mean);
  assert_true(m.count > 1000 && m.rms < 0.05 && fabs(m.mean) < 0.05);
  sonde_colour_destroy(c);
}

// The scale stays for the whole beat, as the examiner leaves it: errors count against the beat's
// greatest velocity.
static void test_womersley(void **unused) {
  (void)unused;
  sonde_colour_def def = sonde_colour_def_default();
  double wave[64], shape[SONDE_FLOW_RINGS], peak = 0;
  for (int k = 0; k < 64; ++k) wave[k] = sonde_flow_artery(k / 64.0);
  tube t = {M_PI / 3, even, 1, 4e-3, shape};
  for (int k = 0; k < 64; ++k) {
    sonde_flow_pulsed(wave, 64, 4e-3, 1.15, k / 64.0, shape);
    peak = fmax(peak, fabs(shape[0]) * cos(t.angle_rad));
  }
  def.pulse_hz *= 1.3 * peak / sonde_colour_limit(&def);
  for (double beat = 0.08; beat < 0.6; beat += 0.08) {
    sonde_flow_pulsed(wave, 64, 4e-3, 1.15, beat, shape);
    lay(&t);
    sonde_colour *c = create(&def);
    measure(c, 20);
    const misfit m = compare(&def);
    const double rms = m.rms * m.greatest / peak;
    print_message(
        "pulse at %.2f of the beat, %.2f of %.2f m/s: %u cells, rms %.1f %%, mean %.1f %%\n", beat,
        m.greatest, peak, m.count, 100 * rms, 100 * m.mean);
    if (m.count > 300) assert_true(rms < 0.05);
    if (m.greatest > 0.5 * peak) assert_true(m.count > 3000 && fabs(m.mean) < 0.05);
    sonde_colour_destroy(c);
  }
}

// Blood runs faster through a stenosis by the areas' ratio, 2.4 times.
static void test_stenosis(void **unused) {
  (void)unused;
  sonde_colour_def def = sonde_colour_def_default();
  def.pulse_hz = 4000;
  double shape[SONDE_FLOW_RINGS];
  parabola(shape);
  const tube t = {M_PI / 3, narrowed, 0.1, 4e-3, shape};
  sonde_colour *c = create(&def);
  lay(&t);
  measure(c, 20);
  const misfit m = compare(&def);
  print_message("stenosis, %.2f m/s: %u cells, rms %.1f %%, mean %.1f %%\n", m.greatest, m.count,
                100 * m.rms, 100 * m.mean);
  assert_true(m.count > 1000 && m.rms < 0.05 && fabs(m.mean) < 0.05);
  sonde_colour_destroy(c);
}

// A plug's velocity is folded by twice the limit from the limit on.
static void test_folds(void **unused) {
  (void)unused;
  sonde_colour_def def = sonde_colour_def_default();
  const double limit = sonde_colour_limit(&def);
  assert_near(limit, 1540 * def.pulse_hz / (4 * def.frequency_hz), 1e-12);
  static const double OVER[] = {0.3, 0.6, 0.9, 1.1, 1.4, -0.9, -1.1};
  for (size_t k = 0; k < sizeof OVER / sizeof *OVER; ++k) {
    for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i)
      cells[i] = (sonde_colour_cell){(float)(OVER[k] * limit), 0, 0, 0};
    sonde_colour *c = create(&def);
    measure(c, 4);
    double mean = 0;
    for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) mean += found[i] / SONDE_COLOUR_CELLS / limit;
    const double wanted = OVER[k] - 2 * round(OVER[k] / 2);
    print_message("%.1f of the limit: found %.3f of %.3f\n", OVER[k], mean, wanted);
    assert_near(mean, wanted, 0.02);
    sonde_colour_destroy(c);
  }
}

// Tissue and noise alone are not shown; blood that stands is not either; tissue that is moved is;
// blood in a shadow is not.
static void test_shows(void **unused) {
  (void)unused;
  const sonde_colour_def def = sonde_colour_def_default();
  for (int k = 0; k < 4; ++k) {
    sonde_colour *c = create(&def);
    for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i)
      cells[i] = (sonde_colour_cell){.towards_m_s = k >= 2 ? 0.02f : 0,
                                     .vessel = k == 1 || k == 3 ? 0 : SONDE_COLOUR_NO_VESSEL,
                                     .loss_db = k == 3 ? 60 : 0};
    const sonde_colour_value *value = sonde_colour_frame(c, cells);
    uint32_t shown = 0;
    for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) shown += value[i].power > SONDE_COLOUR_POWER;
    print_message("%s: %u cells shown\n",
                  k == 0   ? "tissue"
                  : k == 1 ? "standing blood"
                  : k == 2 ? "flash"
                           : "shadow",
                  shown);
    if (k != 2) assert_true(shown < SONDE_COLOUR_CELLS / 1000);
    if (k == 2) assert_true(shown > SONDE_COLOUR_CELLS / 2);
    sonde_colour_destroy(c);
  }
}

// Other numbers and the number of a frame say all: a colour that was tuned there shows what one
// shows that was made so.
static void test_tunes(void **unused) {
  (void)unused;
  sonde_colour_def def = sonde_colour_def_default();
  double shape[SONDE_FLOW_RINGS];
  parabola(shape);
  lay(&(tube){M_PI / 3, even, 0.1, 4e-3, shape});
  sonde_colour *tuned = create(&def);
  for (int k = 0; k < 3; ++k) sonde_colour_frame(tuned, cells);
  def.pulse_hz = 3000, def.filter_order = 2, def.persistence = 0.5;
  sonde_colour *made = create(&def);
  assert_true(sonde_colour_tune(tuned, &def));
  sonde_colour_next(tuned, 7, false), sonde_colour_next(made, 7, false);
  for (int k = 0; k < 2; ++k) {
    const sonde_colour_value *a = sonde_colour_frame(made, cells);
    assert_memory_equal(a, sonde_colour_frame(tuned, cells), SONDE_COLOUR_CELLS * sizeof *a);
  }
  def.packet = 99;
  assert_false(sonde_colour_tune(tuned, &def));
  sonde_colour_destroy(tuned), sonde_colour_destroy(made);
}

// A picture shows each cell's velocity at its place, nothing on bright pixels and beside the box.
static void test_paints(void **unused) {
  (void)unused;
  sonde_colour_def def = sonde_colour_def_default();
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) cells[i] = (sonde_colour_cell){0.05f, 0, 0, 0};
  enum { SIDE = 128 };
  static uint8_t grey[SIDE * SIDE], over[SIDE * SIDE];
  for (int k = 0; k < SIDE * SIDE; ++k) grey[k] = k % SIDE > SIDE / 2 ? 200 : 20;
  for (int fan = 0; fan < 2; ++fan) {
    sonde_colour_box box = BOX;
    box.steer_rad = fan ? 0 : 0.2, box.radius_m = fan ? 0.05 : 0;
    sonde_colour *c = create(&def);
    measure(c, 4);
    const sonde_image image = {.width = SIDE,
                               .height = SIDE,
                               .width_m = 0.04,
                               .height_m = 0.04,
                               .top_m = fan ? -0.004 : 0,
                               .pixels = grey};
    sonde_colour_overlay overlay = {.pixels = over};
    sonde_colour_paint(c, &box, 0, false, &image, &overlay);
    uint32_t inside = 0, right = 0, held = 0;
    for (uint32_t y = 0; y < SIDE; ++y)
      for (uint32_t x = 0; x < SIDE; ++x) {
        double at[2];
        const bool in = sonde_colour_find(&box, (x + 0.5 - SIDE / 2) * 0.04 / SIDE,
                                          image.top_m + (y + 0.5) * 0.04 / SIDE, at);
        held += in;
        const uint32_t column = x - overlay.left, row = y - overlay.top;
        if (!(column < overlay.width && row < overlay.height)) continue;
        held -= in; // the rectangle leaves out none of the box
        const uint8_t shown = over[row * overlay.width + column];
        if (!in || x > SIDE / 2) assert_int_equal(shown, 0);
        if (!in || x > SIDE / 2) continue;
        ++inside, right += fabs(shown - (128 + 127 * 0.05 / sonde_colour_limit(&def))) < 6;
      }
    print_message("%u of %u pixels within 5 %% of the limit, in %u x %u\n", right, inside,
                  overlay.width, overlay.height);
    assert_true(inside > 1000 && right > 0.95 * inside && held == 0);
    // Less gain than the blood is above the noise shows nothing.
    sonde_colour_paint(c, &box, -40, true, &image, &overlay);
    for (uint32_t k = 0; k < overlay.width * overlay.height; ++k) assert_int_equal(over[k], 0);
    sonde_colour_destroy(c);
  }
}

static void test_refuses(void **unused) {
  (void)unused;
  sonde_colour *c = NULL;
  sonde_error error = {0};
  sonde_colour_def def = sonde_colour_def_default();
  def.packet = 3;
  assert_int_equal(sonde_colour_create(&def, &c, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "packet"));
  sonde_colour_destroy(NULL);
}

// A place and its cell are each other's inverse, steered and before a curved face as well.
static void test_box(void **unused) {
  (void)unused;
  for (int fan = 0; fan < 2; ++fan) {
    sonde_colour_box box = BOX;
    box.steer_rad = fan ? 0 : 0.3, box.radius_m = fan ? 0.04 : 0;
    for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; i += 97) {
      const double line = i % SONDE_COLOUR_LINES, row = floor(i / (double)SONDE_COLOUR_LINES);
      double xz[2], at[2];
      sonde_colour_place(&box, i % SONDE_COLOUR_LINES, i / SONDE_COLOUR_LINES, xz);
      assert_true(sonde_colour_find(&box, xz[0], xz[1], at));
      assert_near(at[0], line, 1e-9);
      assert_near(at[1], row, 1e-9);
      // Cells of a sector are even in angle and in the way from the face.
      const double angle = (-0.012 + 0.024 * (line + 0.5) / SONDE_COLOUR_LINES) / 0.04;
      const double depth = 0.008 + 0.024 * (row + 0.5) / SONDE_COLOUR_ROWS;
      if (fan) assert_near(atan2(xz[0], xz[1] + 0.04), angle, 1e-12);
      if (fan) assert_near(hypot(xz[0], xz[1] + 0.04) - 0.04, depth, 1e-12);
    }
  }
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_poiseuille), cmocka_unit_test(test_womersley),
      cmocka_unit_test(test_stenosis),   cmocka_unit_test(test_folds),
      cmocka_unit_test(test_shows),      cmocka_unit_test(test_tunes),
      cmocka_unit_test(test_paints),     cmocka_unit_test(test_refuses),
      cmocka_unit_test(test_box)};
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
