// Kriging between frames, pictures from volumes at rest and deformed, and the kernels' twins.
#include "sweep/slice.h"
#include "fixture.h"

#include <stdlib.h>

enum { WIDE = 90, HIGH = 70, FRAMES = 12 };

static const double pixel_m = 0.25e-3, gap_m = 1e-3;

// Tissue that changes slowly along the sweep.
static double tissue(double x, double y, double z) {
  return 110 + 50 * sin(300 * x + 100 * z) * cos(250 * y - 80 * z);
}

// Every frame with grain of its own, of which a share stays in the next frame.
static sonde_sequence sweep(double grain, double share) {
  sonde_sequence s;
  uint64_t seed = 9;
  static double noise[WIDE * HIGH];
  for (int p = 0; p < WIDE * HIGH; ++p) noise[p] = 0;
  assert_int_equal(sonde_sequence_create(WIDE, HIGH, FRAMES, &s, NULL), SONDE_OK);
  for (int i = 0; i < FRAMES; ++i) {
    s.frames[i].used = true;
    s.frames[i].world_from_pixel =
        (sonde_affine){{{pixel_m, 0, 0, 0}, {0, pixel_m, 0, 0}, {0, 0, 1, gap_m * i}}};
    for (int p = 0; p < WIDE * HIGH; ++p) {
      noise[p] = share * noise[p] + sqrt(1 - share * share) * grain * fixture_random(&seed);
      double grey = tissue(p % WIDE * pixel_m, p / WIDE * pixel_m, gap_m * i) + noise[p];
      s.pixels[i * WIDE * HIGH + p] = (uint8_t)(fmin(fmax(grey, 0), 255) + 0.5);
    }
  }
  return s;
}

static sonde_slicer *slicer_of(const sonde_sequence *s, uint32_t left_out) {
  sonde_slicer *slicer;
  sonde_slicer_options o = sonde_slicer_options_default();
  o.method = SONDE_SLICE_KRIGE;
  o.left_out = left_out;
  assert_int_equal(sonde_slicer_create(s, &o, &slicer, NULL), SONDE_OK);
  return slicer;
}

static sonde_image image_of(uint32_t width, uint32_t height) {
  sonde_image image;
  assert_int_equal(sonde_image_create(width, height, &image, NULL), SONDE_OK);
  return image;
}

static int worst(const uint8_t *a, const uint8_t *b, int count) {
  int most = 0;
  for (int i = 0; i < count; ++i) most = abs(a[i] - b[i]) > most ? abs(a[i] - b[i]) : most;
  return most;
}

// Kriging without a nugget passes through the frames.
static void a_frames_place_gives_the_frame(void **state) {
  (void)state;
  sonde_sequence s = sweep(25, 0.3);
  sonde_slicer *slicer = slicer_of(&s, SONDE_WHOLE_FILE);
  sonde_image image = image_of(WIDE, HIGH);
  for (uint32_t i = 0; i < FRAMES; ++i) {
    const uint8_t *frame = s.pixels + i * WIDE * HIGH;
    uint64_t reached = sonde_slicer_render_place(slicer, i, &s.frames[i].world_from_pixel,
                                                 (const uint32_t[2]){0, 0}, &image, NULL);
    assert_int_equal(reached, WIDE * HIGH);
    assert_true(worst(image.pixels, frame, WIDE * HIGH) <= 2); // levels are whole numbers
    sonde_slicer_render(slicer, &s.frames[i].world_from_pixel, &image, NULL);
    assert_true(worst(image.pixels, frame, WIDE * HIGH) <= 2);
  }
  sonde_slicer_destroy(slicer);
  sonde_image_clear(&image);
  sonde_sequence_clear(&s);
}

static void a_left_out_frame_leaves_no_trace(void **state) {
  (void)state;
  sonde_sequence s = sweep(25, 0.3);
  sonde_image image[2] = {image_of(WIDE, HIGH), image_of(WIDE, HIGH)};
  for (int pass = 0; pass < 2; ++pass) {
    if (pass) memset(s.pixels + 5 * WIDE * HIGH, 201, WIDE * HIGH);
    sonde_slicer *slicer = slicer_of(&s, 5);
    sonde_slicer_render_place(slicer, 5, &s.frames[5].world_from_pixel, (const uint32_t[2]){0, 0},
                              &image[pass], NULL);
    sonde_slicer_destroy(slicer);
  }
  assert_memory_equal(image[0].pixels, image[1].pixels, WIDE * HIGH);
  sonde_image_clear(&image[0]);
  sonde_image_clear(&image[1]);
  sonde_sequence_clear(&s);
}

// Grain that no other frame shares is not repeated: the error falls from sqrt(3/2) of the grain for
// the neighbours' mean towards the grain itself.
static void own_grain_is_not_repeated(void **state) {
  (void)state;
  for (double share = 0; share < 0.5; share += 0.4) {
    sonde_sequence s = sweep(40, share);
    sonde_left_out r;
    assert_int_equal(sonde_sequence_leave_one_out(&s, NULL, false, &r, NULL, NULL), SONDE_OK);
    print_message(
        "share %.1f: place %.2f, any pose %.2f, both sides %.2f, nearest %.2f, mean %.2f\n", share,
        r.place.rms_grey, r.krige.rms_grey, r.bracket.rms_grey, r.nearest.rms_grey,
        r.neighbours.rms_grey);
    assert_int_equal(r.frames, FRAMES - 2);
    assert_true(r.place.rms_grey < (share > 0 ? 0.97 : 0.88) * r.neighbours.rms_grey);
    assert_true(r.krige.rms_grey < 0.97 * r.bracket.rms_grey);
    assert_true(r.neighbours.rms_grey < r.nearest.rms_grey);
    sonde_sequence_clear(&s);
  }
}

static void more_may_be_left_out_beside(void **state) {
  (void)state;
  sonde_sequence s = sweep(10, 0);
  sonde_left_out r;
  sonde_slicer_options o = sonde_slicer_options_default();
  s.frames[3].used = false;
  o.left_out = 5, o.left_out_beside = 2;
  for (uint32_t i = 0; i < FRAMES; ++i) {
    bool out = i == 2 || (i > 3 && i < 8); // two used frames on either side; 3 is none
    if (i != 3) assert_int_equal(sonde_slice_is_left_out(&s, &o, i), out);
  }
  assert_int_equal(sonde_sequence_leave_one_out(&s, &o, false, &r, NULL, NULL), SONDE_OK);
  assert_int_equal(r.frames, FRAMES - 1 - 6);
  o.left_out_beside = 5;
  assert_int_equal(sonde_sequence_leave_one_out(&s, &o, false, &r, NULL, NULL), SONDE_MISMATCH);
  sonde_sequence_clear(&s);
}

// ---- kernels ---------------------------------------------------------------------------------

static const char *const NAMES[] = {"base", "avx2", "avx512"};

static sonde_volume noise_volume(void) {
  sonde_volume v;
  const uint32_t size[3] = {47, 39, 43};
  uint64_t seed = 3;
  assert_int_equal(sonde_volume_create(size, &v, NULL), SONDE_OK);
  for (int i = 0; i < 47 * 39 * 43; ++i) v.voxels[i] = (uint8_t)(127 + 127 * fixture_random(&seed));
  for (int k = 0; k < 3; ++k) v.world_from_voxel.m[k][k] = 0.5e-3;
  return v;
}

static sonde_warp bend(void) {
  sonde_warp w;
  const uint32_t size[3] = {33, 33, 33};
  assert_int_equal(sonde_warp_create(size, &w, NULL), SONDE_OK);
  for (int k = 0; k < 3; ++k) w.world_from_node.m[k][k] = 25e-3 / 32;
  for (int i = 0; i < 33 * 33 * 33; ++i) {
    double x = i % 33 / 32.0, y = i / 33 % 33 / 32.0, z = i / 1089 / 32.0;
    w.offsets_m[3 * i] = (float)(1e-3 * sin(3 * y + z));
    w.offsets_m[3 * i + 1] = (float)(2e-3 * (1 - y) * exp(-4 * (x - 0.5) * (x - 0.5)));
    w.offsets_m[3 * i + 2] = (float)(1e-3 * cos(2 * x + y));
  }
  return w;
}

static const sonde_affine OBLIQUE = {
    {{60e-6, 10e-6, 0, 1e-3}, {-8e-6, 70e-6, 0, 2e-3}, {30e-6, 5e-6, 1, 0.5e-3}}};

// Turns and shifts the frames a little, so that a picture has edges everywhere.
static void sway(sonde_sequence *s) {
  for (uint32_t i = 0; i < s->count; ++i) {
    double lean = 0.02 * sin(0.7 * i), turn = 0.03 * cos(0.9 * i);
    sonde_affine a = {{{pixel_m, -turn * pixel_m, 0, 1e-4 * sin(i)},
                       {turn * pixel_m, pixel_m, 0, 1e-4 * cos(i)},
                       {lean * pixel_m, 0, 1, gap_m * i}}};
    s->frames[i].world_from_pixel = a;
  }
}

static void kernels_give_the_same_bits(void **state) {
  (void)state;
  sonde_volume v = noise_volume();
  sonde_warp w = bend();
  sonde_sequence s = sweep(40, 0);
  sonde_image image[3];
  uint8_t *known[3];
  sway(&s);
  for (int job = 0; job < 6; ++job) {
    for (int k = 0; k < 3; ++k) {
      const slice_kernels *kernels = sonde_slice_kernels_find(NAMES[k]);
      image[k] = image_of(301, 203), known[k] = SONDE_NEW(uint8_t, 301 * 203);
      if (!kernels) print_message("skipped: this processor has no %s\n", NAMES[k]);
      if (!kernels) kernels = sonde_slice_kernels_find("base");
      if (job < 2) {
        sonde_volume_slice_with(kernels, &v, false, job ? &w : NULL, &OBLIQUE, &image[k], known[k]);
        continue;
      }
      if (job == 5) {
        sonde_volume_slicer *bricks;
        assert_int_equal(sonde_volume_slicer_create(&v, &bricks, NULL), SONDE_OK);
        sonde_volume_slicer_render_with(kernels, bricks, &w, &OBLIQUE, &image[k], known[k]);
        sonde_volume_slicer_destroy(bricks);
        continue;
      }
      sonde_slicer *slicer;
      sonde_slicer_options o = sonde_slicer_options_default();
      o.method = job == 3 ? SONDE_SLICE_KRIGE : SONDE_SLICE_BRACKET;
      o.once = job == 4;
      assert_int_equal(sonde_slicer_create(&s, &o, &slicer, NULL), SONDE_OK);
      slicer->kernels = kernels;
      assert_true(sonde_slicer_render(slicer, &OBLIQUE, &image[k], known[k]) > 10000);
      sonde_slicer_destroy(slicer);
    }
    for (int k = 1; k < 3; ++k) {
      assert_memory_equal(image[0].pixels, image[k].pixels, 301 * 203);
      assert_memory_equal(known[0], known[k], 301 * 203);
    }
    for (int k = 0; k < 3; ++k) sonde_image_clear(&image[k]), sonde_free(known[k]);
  }
  sonde_volume_clear(&v);
  sonde_warp_clear(&w);
  sonde_sequence_clear(&s);
}

// Poses across and along the sweep, and one of its frames.
static const sonde_affine POSES[] = {
    {{{60e-6, 10e-6, 0, 1e-3}, {-8e-6, 70e-6, 0, 2e-3}, {30e-6, 5e-6, 1, 0.5e-3}}},
    {{{1e-6, 0, 0, 9e-3}, {0, 90e-6, 0, -1e-3}, {90e-6, 3e-6, 1, -2e-3}}},
    {{{pixel_m / 3, 0, 0, -1e-3}, {0, pixel_m / 3, 0, -1e-3}, {1e-5, 1e-6, 1, 5.2e-3}}}};

typedef struct take {
  sonde_image image;
  uint8_t *known;
  uint64_t reached;
} take;

static take take_of(const sonde_sequence *s, bool once, bool strips, const sonde_affine *pose) {
  take t = {image_of(301, 203), SONDE_NEW(uint8_t, 301 * 203), 0};
  sonde_slicer *slicer;
  sonde_slicer_options o = sonde_slicer_options_default();
  o.once = once;
  assert_int_equal(sonde_slicer_create(s, &o, &slicer, NULL), SONDE_OK);
  assert_true(slicer->has_strips);
  slicer->has_strips = strips;
  t.reached = sonde_slicer_render(slicer, pose, &t.image, t.known);
  sonde_slicer_destroy(slicer);
  return t;
}

static void clear_take(take *t) {
  sonde_image_clear(&t->image);
  sonde_free(t->known);
}

// Strips find what the search among all frames finds, at edges and ends of the sweep too; where the
// frames are read from changes nothing.
static void strips_agree_with_the_search(void **state) {
  (void)state;
  sonde_sequence s = sweep(40, 0);
  sway(&s);
  memcpy(s.clip, (const uint32_t[4]){3, 2, 83, 64}, sizeof s.clip);
  for (size_t k = 0; k < SONDE_COUNT_OF(POSES); ++k) {
    take lines = take_of(&s, false, true, &POSES[k]), rows = take_of(&s, true, true, &POSES[k]);
    take search = take_of(&s, true, false, &POSES[k]);
    assert_memory_equal(lines.image.pixels, rows.image.pixels, 301 * 203);
    assert_memory_equal(lines.known, rows.known, 301 * 203);
    assert_int_equal(lines.reached, rows.reached);
    uint32_t apart = 0, found = 0;
    for (int i = 0; i < 301 * 203; ++i) {
      apart += abs(lines.image.pixels[i] - search.image.pixels[i]) > 1;
      apart += lines.known[i] != search.known[i];
      found += search.known[i];
    }
    print_message("pose %zu: %u of %u pixels differ\n", k, apart, found);
    assert_int_equal(lines.reached, search.reached);
    assert_true(found > 10000 && found < 301 * 203);
    assert_int_equal(apart, 0);
    clear_take(&lines), clear_take(&rows), clear_take(&search);
  }
  sonde_sequence_clear(&s);
}

// Frames that cross have no strips.
static void crossing_frames_are_searched(void **state) {
  (void)state;
  sonde_sequence s = sweep(40, 0);
  for (uint32_t i = 0; i < FRAMES; ++i) s.frames[i].world_from_pixel.m[2][0] = 2e-5 * (i % 3);
  take strips = take_of(&s, false, true, &OBLIQUE), search = take_of(&s, false, false, &OBLIQUE);
  assert_true(strips.reached > 10000);
  assert_int_equal(strips.reached, search.reached);
  assert_true(worst(strips.image.pixels, search.image.pixels, 301 * 203) <= 1);
  clear_take(&strips), clear_take(&search);
  sonde_sequence_clear(&s);
}

// Bricks hold the volume, up to its last voxel whatever its size.
static void bricks_give_the_volumes_picture(void **state) {
  (void)state;
  sonde_warp w = bend();
  sonde_image a = image_of(301, 203), b = image_of(301, 203);
  uint8_t known[2][301 * 203];
  uint64_t seed = 5;
  for (uint32_t n = 2; n < 40; n += n < 9 ? 1 : 13) {
    sonde_volume v;
    sonde_volume_slicer *bricks;
    assert_int_equal(sonde_volume_create((uint32_t[3]){n, n + 1, 2 * n}, &v, NULL), SONDE_OK);
    for (uint32_t i = 0; i < 2 * n * n * (n + 1); ++i)
      v.voxels[i] = (uint8_t)(127 + 127 * fixture_random(&seed));
    v.world_from_voxel = affine_identity();
    for (int k = 0; k < 3; ++k) v.world_from_voxel.m[k][k] = 25e-3 / n;
    assert_int_equal(sonde_volume_slicer_create(&v, &bricks, NULL), SONDE_OK);
    for (int bent = 0; bent < 2; ++bent) {
      uint64_t whole = bent ? sonde_volume_slice_warped(&v, &w, &OBLIQUE, &a, known[0])
                            : sonde_volume_slice(&v, false, &OBLIQUE, &a, known[0]);
      const sonde_warp *warp = bent ? &w : NULL;
      assert_int_equal(sonde_volume_slicer_render(bricks, warp, &OBLIQUE, &b, known[1]), whole);
      assert_memory_equal(a.pixels, b.pixels, 301 * 203);
      assert_memory_equal(known[0], known[1], 301 * 203);
      assert_true(whole > 10000);
    }
    sonde_volume_slicer_destroy(bricks);
    sonde_volume_clear(&v);
  }
  sonde_volume flat;
  sonde_volume_slicer *none;
  sonde_error error;
  assert_int_equal(sonde_volume_create((uint32_t[3]){9, 1, 9}, &flat, NULL), SONDE_OK);
  assert_int_equal(sonde_volume_slicer_create(&flat, &none, &error), SONDE_ARGUMENT);
  assert_null(none);
  sonde_volume_clear(&flat);
  sonde_image_clear(&a), sonde_image_clear(&b);
  sonde_warp_clear(&w);
}

// Of the pixels that both pictures reach, most of them.
static double mean_error(const sonde_image *a, const sonde_image *b, uint8_t (*known)[301 * 203]) {
  double sum = 0, count = 0;
  for (int i = 0; i < 301 * 203; ++i)
    if (known[0][i] && known[1][i]) sum += abs(a->pixels[i] - b->pixels[i]), count += 1;
  print_message("mean error %.4f grey levels over %.0f pixels\n", sum / count, count);
  assert_true(count > 40000);
  return sum / count;
}

// Grain of four voxels, as wide as speckle, against double precision with the field at every pixel.
static void a_deformed_picture_is_off_by_less_than_a_tenth(void **state) {
  (void)state;
  enum { N = 120 };
  sonde_volume v;
  sonde_warp w = bend();
  sonde_volume_slicer *bricks;
  uint64_t seed = 7;
  static uint8_t known[2][301 * 203], grain[N / 4 * N / 4 * N / 4];
  for (size_t i = 0; i < sizeof grain; ++i) grain[i] = (uint8_t)(120 + 80 * fixture_random(&seed));
  assert_int_equal(sonde_volume_create((uint32_t[3]){N, N, N}, &v, NULL), SONDE_OK);
  for (int i = 0; i < N * N * N; ++i)
    v.voxels[i] = grain[i % N / 4 + N / 4 * (i / N % N / 4 + N / 4 * (i / N / N / 4))];
  for (int k = 0; k < 3; ++k) v.world_from_voxel.m[k][k] = 0.2e-3;
  sonde_image fast = image_of(301, 203), exact = image_of(301, 203);
  assert_int_equal(sonde_volume_slicer_create(&v, &bricks, NULL), SONDE_OK);
  sonde_volume_slicer_render(bricks, &w, &OBLIQUE, &fast, known[0]);
  sonde_volume_slice_with(NULL, &v, false, &w, &OBLIQUE, &exact, known[1]);
  assert_true(mean_error(&fast, &exact, known) <= 0.1);
  sonde_volume_slicer_destroy(bricks);
  sonde_image_clear(&fast), sonde_image_clear(&exact);
  sonde_volume_clear(&v);
  sonde_warp_clear(&w);
}

// Against the field at every pixel. White noise is the hardest picture to place.
static void a_deformed_picture_is_where_the_field_says(void **state) {
  (void)state;
  sonde_volume v = noise_volume();
  sonde_warp w = bend();
  sonde_image fast = image_of(301, 203), exact = image_of(301, 203);
  uint8_t known[2][301 * 203];
  sonde_volume_slice_warped(&v, &w, &OBLIQUE, &fast, known[0]);
  sonde_volume_slice_with(NULL, &v, false, &w, &OBLIQUE, &exact, known[1]);
  assert_true(mean_error(&fast, &exact, known) < 0.2);
  sonde_image_clear(&fast);
  sonde_image_clear(&exact);
  sonde_volume_clear(&v);
  sonde_warp_clear(&w);
}

// An even offset is a shift of the plane; volumes of any size are read to their last voxel.
static void an_even_offset_is_a_shift(void **state) {
  (void)state;
  sonde_warp w;
  const uint32_t two[3] = {2, 2, 2};
  assert_int_equal(sonde_warp_create(two, &w, NULL), SONDE_OK);
  for (int i = 0; i < 8; ++i) w.offsets_m[3 * i] = 1e-3f, w.offsets_m[3 * i + 2] = -2e-3f;
  sonde_volume v = noise_volume();
  sonde_image a = image_of(100, 60), b = image_of(100, 60);
  sonde_affine moved = OBLIQUE;
  moved.m[0][3] += 1e-3, moved.m[2][3] -= 2e-3;
  sonde_volume_slice_warped(&v, &w, &OBLIQUE, &a, NULL);
  sonde_volume_slice(&v, false, &moved, &b, NULL);
  assert_true(worst(a.pixels, b.pixels, 6000) <= 1);
  sonde_volume_clear(&v);
  for (uint32_t n = 1; n < 6; ++n) {
    assert_int_equal(sonde_volume_create((uint32_t[3]){n, n, n}, &v, NULL), SONDE_OK);
    memset(v.voxels, 77, n * n * n);
    v.world_from_voxel = affine_identity();
    sonde_affine plane = {{{0.01 * n, 0, 0, 0}, {0, 0.02 * n, 0, 0}, {0, 0, 1, n - 1.0}}};
    uint64_t reached = sonde_volume_slice(&v, false, &plane, &a, NULL);
    for (int i = 0; i < 6000; ++i) assert_true(a.pixels[i] == 0 || a.pixels[i] == 77);
    assert_int_equal(a.pixels[0], 77);
    assert_true(reached > 0);
    sonde_volume_clear(&v);
  }
  sonde_image_clear(&a);
  sonde_image_clear(&b);
  sonde_warp_clear(&w);
}

// Expected errors are those that frames made again have, in the half of the picture with much grain
// and in that with little, whatever the weights; a frame is sure of itself.
static void expected_errors_are_true(void **state) {
  (void)state;
  static const sonde_slice_method METHOD[] = {SONDE_SLICE_BRACKET, SONDE_SLICE_NEAREST,
                                              SONDE_SLICE_KRIGE};
  sonde_sequence s = sweep(30, 0.6);
  for (int p = 0; p < FRAMES * WIDE * HIGH; ++p) // a third of the contrast on the left
    if (p % WIDE < WIDE / 2) s.pixels[p] = (uint8_t)(110 + (s.pixels[p] - 110) / 3);
  sonde_image made = image_of(WIDE, HIGH), sure = image_of(WIDE, HIGH);
  for (int m = 0; m < 3; ++m) {
    double square[2] = {0}, expected[2] = {0};
    for (uint32_t out = 2; out + 2 < FRAMES; ++out) {
      sonde_slicer *slicer[2];
      sonde_slicer_options o = sonde_slicer_options_default();
      o.method = METHOD[m], o.left_out = out;
      for (int k = 0; k < 2; ++k, o.deviation = true)
        assert_int_equal(sonde_slicer_create(&s, &o, &slicer[k], NULL), SONDE_OK);
      const sonde_affine *plane = &s.frames[out].world_from_pixel;
      uint64_t reached = sonde_slicer_render(slicer[0], plane, &made, NULL);
      assert_int_equal(sonde_slicer_render(slicer[1], plane, &sure, NULL), reached);
      for (int p = 0; p < WIDE * HIGH; ++p) {
        const int half = p % WIDE >= WIDE / 2;
        if (abs(p % WIDE - WIDE / 2) < 6) continue; // windows there see both
        const double off = made.pixels[p] - s.pixels[(int)out * WIDE * HIGH + p];
        square[half] += off * off;
        expected[half] += sure.pixels[p] * sure.pixels[p] / 16.0;
      }
      sonde_slicer_render(slicer[1], &s.frames[out - 1].world_from_pixel, &sure, NULL);
      for (int p = 0; p < WIDE * HIGH; ++p) assert_true(sure.pixels[p] <= 1);
      sonde_slicer_destroy(slicer[0]);
      sonde_slicer_destroy(slicer[1]);
    }
    for (int half = 0; half < 2; ++half) {
      const double ratio = sqrt(square[half] / expected[half]);
      print_message("method %d, half %d: error %.2f grey levels, over the expected one %.3f\n", m,
                    half, sqrt(square[half] / ((FRAMES - 4) * WIDE * HIGH / 2)), ratio);
      assert_true(ratio > 0.94 && ratio < 1.02);
    }
  }
  sonde_image_clear(&made);
  sonde_image_clear(&sure);
  sonde_sequence_clear(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_frames_place_gives_the_frame),
      cmocka_unit_test(a_left_out_frame_leaves_no_trace),
      cmocka_unit_test(own_grain_is_not_repeated),
      cmocka_unit_test(more_may_be_left_out_beside),
      cmocka_unit_test(kernels_give_the_same_bits),
      cmocka_unit_test(strips_agree_with_the_search),
      cmocka_unit_test(crossing_frames_are_searched),
      cmocka_unit_test(bricks_give_the_volumes_picture),
      cmocka_unit_test(a_deformed_picture_is_off_by_less_than_a_tenth),
      cmocka_unit_test(a_deformed_picture_is_where_the_field_says),
      cmocka_unit_test(an_even_offset_is_a_shift),
      cmocka_unit_test(expected_errors_are_true),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
