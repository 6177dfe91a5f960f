// Interfaces as the beam sees them: a smooth sheet echoes as the exact beam says at every slope,
// and nothing of an interface lies beyond the beam's lateral band.
#include "../sanitized.h"

#include "echo/bench.h"
#include "echo/echo.h"
#include "echo/reference.h"

static const double sheet_radius = 0.24, skin_radius = 0.3; // fascia and skin of a great leg
static const double fascia_db = 21, fat_loss = 50;          // echo over muscle; dB/m/MHz one way
static const double deep_m = 0.02;                          // of the sheet under the middle line

enum { MOST_ROWS = 1024, MOST_COLUMNS = 192, BINS = 96 };

// The complex field of a frame as the axial kernels give it, without noise and compensation.
typedef struct field {
  const sonde_echo *echo;
  double value[MOST_ROWS][MOST_COLUMNS][2];
} field;
static field seen;

static void keep_field(const axial_job *job) {
  for (int s = 0; s < job->samples; ++s) {
    size_t n = (size_t)(job->envelope[s] - seen.echo->envelope) / seen.echo->padded;
    assert_true(n < MOST_ROWS && seen.echo->lines <= MOST_COLUMNS);
    for (uint32_t l = 0; l < seen.echo->lines; ++l) {
      double sum[2] = {0};
      for (int t = 0; t < job->count; ++t)
        for (uint32_t k = 0; k < SONDE_RANK; ++k)
          for (uint32_t part = 0; part < 2; ++part)
            sum[part] +=
                (double)(job->tap[t][k] * job->rows[t + s][(2 * k + part) * job->lines + l]);
      memcpy(seen.value[n][l], sum, sizeof sum);
    }
  }
}

typedef struct probe_kind {
  double mhz, aperture_m, radius_m;
} probe_kind;

// Lines as close as the beam's band asks for.
static const probe_kind probes[] = {{3, 0.04, 0},     {5, 0.025, 0},   {7.5, 0.018, 0},
                                    {3, 0.035, 0.06}, {5, 0.02, 0.06}, {7.5, 0.014, 0.06}};

typedef struct rig {
  bench b;
  echo_kernels kernels;
} rig;

static void spy(rig *r) {
  r->kernels = *r->b.echo->kernels;
  r->kernels.axial = keep_field;
  r->b.echo->kernels = &r->kernels;
  seen.echo = r->b.echo;
}

static void rig_create(rig *r, double skin_m, double fat_m, bool vessels) {
  *r = (rig){0};
  bench_create(&r->b, skin_m, 0.014, fat_m, true, vessels);
  spy(r);
}

// After a change of the leg.
static void rig_renew(rig *r) {
  bench *b = &r->b;
  sonde_echo_destroy(b->echo);
  sonde_interior_destroy(b->interior);
  assert_int_equal(sonde_interior_create(&b->leg.model, &b->interior, NULL), SONDE_OK);
  assert_int_equal(sonde_echo_create(b->interior,
                                     &(sonde_echo_def){.version = SONDE_DEF_VERSION, .plain = true},
                                     &b->echo, NULL),
                   SONDE_OK);
  spy(r);
}

static void rig_set(rig *r, const probe_kind *p) {
  r->b.settings.frequency_hz = p->mhz * 1e6;
  r->b.settings.depth_m = 0.04;
  r->b.settings.focus_m = deep_m;
  assert_int_equal(sonde_echo_set_radius(r->b.echo, p->radius_m, NULL), SONDE_OK);
}

// The interfaces alone, without the tissue's scatterers.
static void look_at_pose(rig *r, const probe_kind *p) {
  bench *b = &r->b;
  b->interior->model = &b->leg.model;
  sonde_interior_update(b->interior,
                        &(sonde_interior_input){b->leg.model.surface.vertices, b->forces, b->pose,
                                                &b->pathology, -1, 1, INFINITY, INFINITY, 0,
                                                SONDE_POSTURE_SUPINE, NULL});
  b->echo->frame.pathology = &b->pathology;
  sonde_echo_frame(b->echo, b->pose, p->aperture_m, &b->settings);
  sonde_echo_plane(b->echo);
  sonde_echo_medium(b->echo);
  for (uint32_t band = 0; band < b->echo->band_count; ++band) sonde_echo_beam(b->echo, band, true);
}

// The middle line meets the sheet `deep_m` below the face, `slope` off its normal.
static void look_at_sheet(rig *r, const probe_kind *p, double slope) {
  double c = cos(slope), s = sin(slope);
  sonde_mat3 axes = m_columns(vec3(-c, -s, 0), vec3(0, 0, -1), vec3(s, -c, 0));
  r->b.pose = (sonde_pose){vec3(-deep_m * s, sheet_radius + deep_m * c, 0.15), q_from_matrix(axes)};
  look_at_pose(r, p);
}

// Energy of the field over lateral frequencies, 0 to half a turn per line, of all rows.
static double spectrum(const sonde_echo *echo, double energy[BINS + 1]) {
  const int count = (int)echo->lines;
  double total = 0, cosine[2 * BINS], sine[2 * BINS], hann[MOST_COLUMNS];
  for (int i = 0; i < 2 * BINS; ++i)
    cosine[i] = cos(SONDE_PI * i / BINS), sine[i] = sin(SONDE_PI * i / BINS);
  for (int l = 0; l < count; ++l) hann[l] = pow(sin(SONDE_PI * (l + 0.5) / count), 2);
  for (int k = 0; k <= BINS; ++k) energy[k] = 0;
  for (uint32_t n = 0; n < echo->samples; n += SAMPLES(1, 3))
    for (int k = -BINS; k <= BINS; ++k) {
      double re = 0, im = 0;
      for (int l = 0; l < count; ++l) {
        const int turn = (k + 2 * BINS) * l % (2 * BINS);
        const double *v = seen.value[n][l];
        re += hann[l] * (v[0] * cosine[turn] - v[1] * sine[turn]);
        im += hann[l] * (v[0] * sine[turn] + v[1] * cosine[turn]);
      }
      energy[abs(k)] += re * re + im * im, total += re * re + im * im;
    }
  return total;
}

// First bin beyond the beam's band: all but 1e-4 of the energy of points at the sheet's depth lies
// below.
static int beam_band(rig *r, const probe_kind *p) {
  double energy[BINS + 1];
  const sonde_echo_point at[] = {{0.1e-3, 0, deep_m, 1}};
  sonde_echo_render_points(r->b.echo, p->aperture_m, &r->b.settings, at, 1);
  double total = spectrum(r->b.echo, energy), beyond = 0;
  int k = BINS;
  while (k > 0 && beyond + energy[k] < 1e-4 * total) beyond += energy[k--];
  return k + 1;
}

static double decibels_of(double power) { return 10 * log10(fmax(power, 1e-30)); }

static void nothing_lies_beyond_the_beams_band(void **state) {
  (void)state;
  static const double slopes[] = {10, 15, 20, 25, 30, 40};
  rig r;
  rig_create(&r, skin_radius, skin_radius - sheet_radius, false);
  for (size_t i = 0; i < SONDE_COUNT_OF(probes); ++i) {
    const probe_kind *p = &probes[i];
    double energy[BINS + 1];
    rig_set(&r, p);
    const int band = beam_band(&r, p);
    look_at_sheet(&r, p, 0);
    double flat = spectrum(r.b.echo, energy);
    print_message("%s, %.1f MHz, band to %d of %d bins; beyond it over the level sheet, dB:",
                  p->radius_m > 0 ? "curved" : "linear", p->mhz, band, BINS);
    assert_true(band <= BINS - 6);
    for (size_t k = SAMPLES(0, 1); k < SONDE_COUNT_OF(slopes); k += SAMPLES(1, 2)) {
      look_at_sheet(&r, p, slopes[k] * SONDE_PI / 180);
      double beyond = 0;
      (void)spectrum(r.b.echo, energy);
      for (int bin = band; bin <= BINS; ++bin) beyond += energy[bin];
      print_message(" %.0f deg %.1f", slopes[k], decibels_of(beyond / flat));
      assert_true(decibels_of(beyond / flat) < -40);
    }
    print_message("\n");
  }
  bench_clear(&r.b);
}

// Peak of the middle line's echo.
static double peak_of_field(const sonde_echo *echo) {
  double top = 0;
  for (uint32_t n = 0; n < echo->samples; ++n)
    top = fmax(top, hypot(seen.value[n][echo->lines / 2][0], seen.value[n][echo->lines / 2][1]));
  return top;
}

// The same by the exact beam: points on the sheet, evenly spread over the lines, behind the loss of
// fat.
static double peak_of_reference(rig *r, const probe_kind *p, double slope) {
  enum { POINTS = 600 };
  sonde_echo *echo = r->b.echo;
  sonde_echo_point *at = SONDE_NEW(sonde_echo_point, POINTS);
  const double from[2] = {sheet_radius * sin(slope), deep_m + sheet_radius * cos(slope)};
  uint32_t count = 0;
  for (int i = 0; i < POINTS; ++i) {
    double line = echo->frame.first_line + 1.4 * echo->lines * ((i + 0.5) / POINTS - 0.5);
    double low = 0, high = 0.06;
    for (int step = 0; step < 50; ++step) {
      double z = 0.5 * (low + high);
      sonde_vec3 place = sonde_echo_place(&echo->frame, line, z);
      if (hypot(place.x - from[0], place.z - from[1]) < sheet_radius)
        high = z;
      else
        low = z;
    }
    sonde_vec3 place = sonde_echo_place(&echo->frame, line, high);
    if (high > 0.055 || low < 1e-3) continue;
    double loss_db = 2 * fat_loss * p->mhz * high;
    at[count++] = (sonde_echo_point){place.x, 0, place.z, pow(10, -loss_db / 20)};
  }
  float *envelope = SONDE_NEW(float, (size_t)echo->lines * echo->samples);
  const uint32_t lines[2] = {echo->lines / 2, echo->lines / 2}, samples[2] = {100, 1000};
  assert_int_equal(sonde_echo_reference_points(echo, p->aperture_m, &r->b.settings, at, count,
                                               lines, samples, envelope, NULL),
                   SONDE_OK);
  double top = 0;
  for (uint32_t n = samples[0]; n <= samples[1]; ++n)
    top = fmax(top, (double)envelope[(size_t)n * echo->lines + lines[0]]);
  sonde_free(envelope);
  sonde_free(at);
  return top;
}

static void a_smooth_sheet_echoes_as_the_exact_beam_says(void **state) {
  (void)state;
  static const double slopes[] = {4, 8, 12, 16, 20, 25};
  rig r;
  rig_create(&r, skin_radius, skin_radius - sheet_radius, false);
  for (size_t i = 0; i < SONDE_COUNT_OF(probes); ++i) {
    const probe_kind *p = &probes[i];
    rig_set(&r, p);
    look_at_sheet(&r, p, 0);
    double flat = peak_of_field(r.b.echo), flat_exact = peak_of_reference(&r, p, 0);
    double level_db = fascia_db - 2 * fat_loss * p->mhz * deep_m;
    assert_true(fabs(20 * log10(flat) - level_db) < 0.5);
    print_message("%s, %.1f MHz: level sheet %.2f dB; slope: echo (exact), dB:",
                  p->radius_m > 0 ? "curved" : "linear", p->mhz, 20 * log10(flat));
    for (size_t k = SAMPLES(0, 1); k < SONDE_COUNT_OF(slopes); k += SAMPLES(1, 2)) {
      double slope = slopes[k] * SONDE_PI / 180;
      look_at_sheet(&r, p, slope);
      double ours = 20 * log10(peak_of_field(r.b.echo) / flat);
      double exact = 20 * log10(peak_of_reference(&r, p, slope) / flat_exact);
      print_message(" %.0f: %.1f (%.1f)", slopes[k], ours, exact);
      if (exact > -10) assert_true(fabs(ours - exact) < 1.5);
      assert_true(exact > -30 ? fabs(ours - exact) < 6 : ours < -24);
    }
    print_message("\n");
  }
  bench_clear(&r.b);
}

// Mean energy within the lumen over the peak of the wall, dB, of an envelope or of the field seen.
static double filling(const sonde_echo *echo, const float *envelope, double centre_m,
                      double radius_m) {
  const frame *f = &echo->frame;
  double sum = 0, top = 0;
  uint32_t count = 0;
  for (uint32_t n = 0; n < echo->samples; ++n)
    for (uint32_t l = 0; l < echo->lines; ++l) {
      double away = hypot((l - f->first_line) * f->pitch_m, n * f->step_m - centre_m);
      const double *v = seen.value[n][l];
      double size = envelope ? (double)envelope[(size_t)n * echo->lines + l] : hypot(v[0], v[1]);
      if (away < 0.4 * radius_m) sum += size * size, ++count;
      if (away < 1.3 * radius_m) top = fmax(top, size);
    }
  assert_true(count > 100);
  return decibels_of(sum / count / (top * top));
}

// A small vein near the face, whose wall is within the beam's side lobes from everywhere in it.
static void a_wall_fills_its_lumen_as_the_exact_beam_says(void **state) {
  (void)state;
  enum { POINTS = 500 };
  const double radius = 2e-3, centre = 6e-3, below_skin = centre + 3e-3, length = 0.3;
  const probe_kind near_face[] = {{3, 0.02, 0}, {7.5, 0.02, 0}};
  rig r;
  rig_create(&r, leg_radius, 0.03, true);
  bench *b = &r.b;
  tube_vessel(&b->leg.model.vein, leg_radius, leg_radius - below_skin, SONDE_PI / 2, length,
              radius);
  b->leg.model.artery.count = 0;
  rig_renew(&r);
  sonde_echo_point *at = SONDE_NEW(sonde_echo_point, POINTS);
  for (int i = 0; i < POINTS; ++i) { // as much of the wall as there is across the lines
    double turn = 2 * SONDE_PI * (i + 0.5) / POINTS;
    at[i] = (sonde_echo_point){radius * cos(turn), 0, centre + radius * sin(turn), fabs(sin(turn))};
  }
  for (size_t k = 0; k < SONDE_COUNT_OF(near_face); ++k) {
    const probe_kind *p = &near_face[k];
    rig_set(&r, p);
    b->settings.depth_m = 0.02, b->settings.focus_m = 0.025;
    b->pose = tube_pose(leg_radius - 3e-3, 0.15);
    look_at_pose(&r, p);
    sonde_echo *echo = b->echo;
    const uint32_t middle = echo->lines / 2;
    const uint32_t lines[2] = {middle - 16, middle + 16}, samples[2] = {180, 440};
    double ours = filling(echo, NULL, centre, radius);
    float *envelope = SONDE_NEW(float, (size_t)echo->lines * echo->samples);
    assert_int_equal(sonde_echo_reference_points(echo, p->aperture_m, &b->settings, at, POINTS,
                                                 lines, samples, envelope, NULL),
                     SONDE_OK);
    double exact = filling(echo, envelope, centre, radius);
    print_message("%.1f MHz: lumen below the wall's peak %.1f dB (exact %.1f)\n", p->mhz, ours,
                  exact);
    assert_true(ours < exact + 3 && (exact < -70 || ours > exact - 8));
    sonde_free(envelope);
  }
  sonde_free(at);
  bench_clear(b);
}

// Energy of the gain on the middle line about the cortex, over linear steps between the rows.
static double cortex_energy(const sonde_echo *echo) {
  const uint32_t line = echo->pad_lines / SONDE_FINE + echo->lines / 2;
  double sum = 0;
  for (uint32_t row = SONDE_MEDIUM_ROWS / 2; row + 1 < SONDE_MEDIUM_ROWS; ++row) {
    const float *at = echo->gain + (size_t)row * echo->gain_stride + line;
    double a = at[0], b = at[echo->gain_stride];
    sum += (a * a + a * b + b * b) / 3;
  }
  return sum;
}

// The cortex's facets stay as bright while the bone moves from one row of the march to the next.
static void facets_do_not_flicker(void **state) {
  (void)state;
  enum { STEPS = 12 };
  const probe_kind p = {3, 0.04, 0};
  rig r;
  rig_create(&r, leg_radius, 0.012, false);
  bench *b = &r.b;
  b->echo->plain = false;
  rig_set(&r, &p);
  b->settings.depth_m = 0.07;
  const double row_m = b->settings.depth_m / (SONDE_MEDIUM_ROWS - 1);
  double low = INFINITY, high = 0;
  for (int k = 0; k < STEPS; ++k) {
    b->pose = tube_pose(leg_radius - 3e-3 - k * row_m / STEPS, 0.15);
    look_at_pose(&r, &p);
    double energy = cortex_energy(b->echo);
    low = fmin(low, energy), high = fmax(high, energy);
  }
  print_message("facets within %.1f dB of each other\n", decibels_of(high / low));
  assert_true(decibels_of(high / low) < 1.5);
  bench_clear(b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(nothing_lies_beyond_the_beams_band),
      cmocka_unit_test(a_smooth_sheet_echoes_as_the_exact_beam_says),
      cmocka_unit_test(facets_do_not_flicker),
      cmocka_unit_test(a_wall_fills_its_lumen_as_the_exact_beam_says),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
