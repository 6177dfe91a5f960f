// Pictures between tracked frames and volumes from them: laws, a phantom whose truth is known, a
// real sweep.
#include "fixture.h"
#include "sonde/sweep_volume.h"

#include <stdio.h>
#include <unistd.h>

enum { WIDE = 96, HIGH = 80 };

typedef double (*field)(sonde_vec3 p);

static const double pixel_m = 0.25e-3;

// 1 grey level per 0.2 mm and more: wrong weights show.
static double ramp(sonde_vec3 p) { return 120 + 3010 * p.x - 2490 * p.y + 1990 * p.z; }

// A smooth tissue with a vessel, a bright sheet and waves; the truth of the held-out pictures.
static double phantom(sonde_vec3 p) {
  double grey = 95 + 30 * sin(900 * p.x + 400 * p.z) * cos(700 * p.y - 500 * p.z) +
                20 * sin(1500 * p.z + 300 * p.x);
  double x = p.x - 0.1 * p.z, y = p.y - 0.01, sheet = (p.y - 0.016 - 0.3 * p.x) / 4e-4;
  grey *= 1 - 0.9 / (1 + exp((hypot(x, y) - 3e-3) / 2e-4));
  return grey + 90 * exp(-sheet * sheet);
}

static sonde_vec3 at(const sonde_affine *a, double u, double v) {
  return vec3(a->m[0][0] * u + a->m[0][1] * v + a->m[0][3],
              a->m[1][0] * u + a->m[1][1] * v + a->m[1][3],
              a->m[2][0] * u + a->m[2][1] * v + a->m[2][3]);
}

static uint8_t grey_of(double value) { return (uint8_t)(fmin(fmax(value, 0), 255) + 0.5); }

// Columns along x, rows along y, turned by the rotation vector about the frame's corner.
static sonde_affine plane(sonde_vec3 corner, sonde_vec3 turn, double step) {
  double angle = v_norm(turn);
  sonde_vec3 axis = v_scale(v_unit(turn, vec3(1, 0, 0)), sin(angle / 2));
  sonde_mat3 r = q_matrix((sonde_quat){cos(angle / 2), axis.x, axis.y, axis.z});
  sonde_affine a;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) a.m[i][k] = r.m[i][k] * step;
  a.m[0][3] = corner.x, a.m[1][3] = corner.y, a.m[2][3] = corner.z;
  return a;
}

static sonde_affine moved(sonde_pose p, const sonde_affine *a) {
  sonde_affine b = *a;
  for (int k = 0; k < 4; ++k) {
    sonde_vec3 c = q_rotate(p.rotation, vec3(a->m[0][k], a->m[1][k], a->m[2][k]));
    if (k == 3) c = v_add(c, p.position);
    b.m[0][k] = c.x, b.m[1][k] = c.y, b.m[2][k] = c.z;
  }
  return b;
}

// A sweep along z whose frames sway by `sway` rad and shift sideways.
static sonde_sequence sweep(uint32_t count, double gap_m, double sway, field f) {
  sonde_sequence s;
  uint64_t seed = 5;
  assert_int_equal(sonde_sequence_create(WIDE, HIGH, count, &s, NULL), SONDE_OK);
  for (uint32_t i = 0; i < count; ++i) {
    sonde_vec3 turn = fixture_vector(&seed, sway), shift = fixture_vector(&seed, 0.01 * sway);
    s.frames[i].world_from_pixel =
        plane(vec3(shift.x - 0.012, shift.y, gap_m * i + 0.3 * shift.z), turn, pixel_m);
    s.frames[i].used = true;
    for (int v = 0; v < HIGH; ++v)
      for (int u = 0; u < WIDE; ++u)
        s.pixels[((size_t)i * HIGH + (size_t)v) * WIDE + (size_t)u] =
            grey_of(f(at(&s.frames[i].world_from_pixel, u, v)));
  }
  return s;
}

typedef struct view {
  sonde_image image;
  uint8_t *known;
  uint64_t reached;
} view;

static view look(const sonde_sequence *s, const sonde_slicer_options *o, const sonde_affine *a,
                 uint32_t width, uint32_t height) {
  view w;
  sonde_slicer *slicer;
  assert_int_equal(sonde_image_create(width, height, &w.image, NULL), SONDE_OK);
  w.known = SONDE_NEW(uint8_t, (size_t)width * height);
  assert_int_equal(sonde_slicer_create(s, o, &slicer, NULL), SONDE_OK);
  w.reached = sonde_slicer_render(slicer, a, &w.image, w.known);
  sonde_slicer_destroy(slicer);
  return w;
}

static void clear(view *w) {
  sonde_image_clear(&w->image);
  sonde_free(w->known);
}

static double worst_error(const view *w, const sonde_affine *a, field f) {
  double worst = 0;
  for (uint32_t v = 0; v < w->image.height; ++v)
    for (uint32_t u = 0; u < w->image.width; ++u) {
      size_t i = (size_t)v * w->image.width + u;
      if (!w->known[i]) continue;
      worst = fmax(worst, fabs(w->image.pixels[i] - f(at(a, u, v))));
    }
  return worst;
}

static void a_frames_own_pose_gives_the_frame(void **state) {
  (void)state;
  sonde_sequence s = sweep(7, 1e-3, 0.05, phantom);
  sonde_slicer_options o = sonde_slicer_options_default();
  for (int method = 0; method < 3; ++method)
    for (uint32_t i = 0; i < 7; i += 3) {
      o.method = method == 2 ? SONDE_SLICE_NEAREST : SONDE_SLICE_BRACKET;
      o.along_sweep = method == 1;
      view w = look(&s, &o, &s.frames[i].world_from_pixel, WIDE, HIGH);
      assert_int_equal(w.reached, WIDE * HIGH);
      assert_memory_equal(w.image.pixels, s.pixels + (size_t)i * WIDE * HIGH, WIDE * HIGH);
      clear(&w);
    }
  sonde_sequence_clear(&s);
}

// Half a level from the frames' grey steps and half from the picture's.
static void a_linear_field_is_exact(void **state) {
  (void)state;
  sonde_sequence s = sweep(9, 2e-3, 0.08, ramp);
  sonde_slicer_options o = sonde_slicer_options_default();
  const sonde_affine poses[3] = {plane(vec3(-0.01, 0.002, 0.005), vec3(0, 0, 0), pixel_m),
                                 plane(vec3(-0.008, 0.003, 0.004), vec3(0.3, -0.4, 0.7), pixel_m),
                                 plane(vec3(0.001, 0.003, 0.001), vec3(0, -1.5, 0), pixel_m)};
  o.reach_m = 0; // a frame alone is no line
  for (int swept = 0; swept < 2; ++swept)
    for (int k = 0; k < 3; ++k) {
      o.along_sweep = swept;
      view w = look(&s, &o, &poses[k], 70, 60);
      assert_true(w.reached > 700);
      double worst = worst_error(&w, &poses[k], ramp);
      if (!(worst <= 1.02)) fail_msg("pose %d: %.3f grey levels off", k, worst);
      clear(&w);
    }
  sonde_sequence_clear(&s);
}

// Two planes leant towards each other by 30 degrees, up to 10 mm apart.
static void a_linear_field_is_exact_between_leaning_planes(void **state) {
  (void)state;
  sonde_sequence s = sweep(2, 6e-3, 0, ramp);
  const double lean[2] = {0.25, -0.27};
  for (int i = 0; i < 2; ++i) {
    sonde_affine *a = &s.frames[i].world_from_pixel;
    *a = plane(vec3(-0.012, 0, 6e-3 * i), vec3(-lean[i], 0.1 * i, 0.2 * i), pixel_m);
    for (int p = 0; p < WIDE * HIGH; ++p)
      s.pixels[i * WIDE * HIGH + p] = grey_of(ramp(at(a, p % WIDE, p / WIDE)));
  }
  sonde_slicer_options o = sonde_slicer_options_default();
  o.reach_m = 0, o.gap_m = 0.03;
  sonde_affine pose = plane(vec3(-0.01, 0.001, 2e-3), vec3(0.05, 0, 0), pixel_m);
  for (int swept = 0; swept < 2; ++swept) {
    o.along_sweep = swept;
    view w = look(&s, &o, &pose, 70, 60);
    assert_true(w.reached > 700);
    double worst = worst_error(&w, &pose, ramp);
    if (!(worst <= 1.02)) fail_msg("%s: %.3f grey levels off", swept ? "swept" : "across", worst);
    clear(&w);
  }
  sonde_sequence_clear(&s);
}

static double share_changed(const view *a, const view *b) {
  uint32_t changed = 0, count = a->image.width * a->image.height;
  for (uint32_t i = 0; i < count; ++i) {
    int step = a->image.pixels[i] - b->image.pixels[i];
    changed += abs(step) > 1 || a->known[i] != b->known[i];
  }
  return (double)changed / count;
}

static void moving_everything_changes_nothing(void **state) {
  (void)state;
  sonde_sequence s = sweep(9, 1.5e-3, 0.06, phantom);
  sonde_affine pose = plane(vec3(-0.008, 0.003, 0.004), vec3(0.2, -0.3, 0.1), pixel_m);
  view before = look(&s, NULL, &pose, 80, 64);
  sonde_pose rigid = {vec3(0.3, -0.2, 0.5), q_unit((sonde_quat){0.3, -0.5, 0.7, 0.2})};
  for (uint32_t i = 0; i < 9; ++i)
    s.frames[i].world_from_pixel = moved(rigid, &s.frames[i].world_from_pixel);
  pose = moved(rigid, &pose);
  view after = look(&s, NULL, &pose, 80, 64);
  assert_true(before.reached > 3000);
  assert_true(share_changed(&before, &after) < 1e-3);
  clear(&before);
  clear(&after);
  sonde_sequence_clear(&s);
}

static void swap_frames(sonde_sequence *s, uint32_t a, uint32_t b) {
  sonde_tracked_frame kept = s->frames[a];
  s->frames[a] = s->frames[b];
  s->frames[b] = kept;
  for (size_t i = 0; i < (size_t)WIDE * HIGH; ++i) {
    uint8_t *p = s->pixels + a * (size_t)(WIDE * HIGH) + i;
    uint8_t *q = s->pixels + b * (size_t)(WIDE * HIGH) + i, grey = *p;
    *p = *q;
    *q = grey;
  }
}

static void neither_threads_nor_order_matter(void **state) {
  (void)state;
  sonde_sequence s = sweep(9, 1.5e-3, 0.06, phantom);
  sonde_affine pose = plane(vec3(-0.008, 0.003, 0.004), vec3(0.2, -0.3, 0.1), 0.1e-3);
  sonde_slicer_options o = sonde_slicer_options_default();
  o.threads = 1;
  view one = look(&s, &o, &pose, 200, 150);
  o.threads = 5;
  view five = look(&s, &o, &pose, 200, 150);
  assert_memory_equal(one.image.pixels, five.image.pixels, 200 * 150);
  assert_memory_equal(one.known, five.known, 200 * 150);
  assert_int_equal(one.reached, five.reached);
  clear(&five);
  for (uint32_t i = 0; i < 4; ++i) swap_frames(&s, i, 8 - i);
  five = look(&s, NULL, &pose, 200, 150);
  assert_true(share_changed(&one, &five) < 1e-3);
  clear(&one);
  clear(&five);
  sonde_sequence_clear(&s);
}

static void a_left_out_frame_leaves_no_trace(void **state) {
  (void)state;
  sonde_sequence s = sweep(5, 1e-3, 0.02, phantom);
  sonde_slicer_options o = sonde_slicer_options_default();
  o.left_out = 2;
  sonde_affine pose = s.frames[2].world_from_pixel;
  view before = look(&s, &o, &pose, WIDE, HIGH);
  memset(s.pixels + 2 * WIDE * HIGH, 255, WIDE * HIGH);
  view after = look(&s, &o, &pose, WIDE, HIGH);
  assert_memory_equal(before.image.pixels, after.image.pixels, WIDE * HIGH);
  s.frames[1].used = s.frames[3].used = false;
  s.frames[0].world_from_pixel.m[2][3] = -0.01; // now 14 mm between what is left
  view apart = look(&s, &o, &pose, WIDE, HIGH);
  assert_int_equal(apart.reached, 0);
  clear(&before);
  clear(&after);
  clear(&apart);
  sonde_sequence_clear(&s);
}

// Distance and pixel of a point in a frame, by solving with the frame's own columns.
static bool foot(const sonde_affine *a, sonde_vec3 p, double out[3]) {
  sonde_vec3 u = vec3(a->m[0][0], a->m[1][0], a->m[2][0]);
  sonde_vec3 v = vec3(a->m[0][1], a->m[1][1], a->m[2][1]);
  sonde_vec3 n = v_unit(v_cross(u, v), u), d = v_sub(p, at(a, 0, 0));
  out[0] = v_dot(d, u) / v_norm2(u); // columns and rows are square here
  out[1] = v_dot(d, v) / v_norm2(v);
  out[2] = fabs(v_dot(d, n));
  return out[0] > 0.01 && out[0] < WIDE - 1.01 && out[1] > 0.01 && out[1] < HIGH - 1.01;
}

// The tiles' search against looking at every frame, frames lying anyhow.
static void no_nearer_frame_is_overlooked(void **state) {
  (void)state;
  sonde_sequence s = sweep(40, 0.4e-3, 0.5, ramp);
  for (uint32_t i = 0; i < 40; ++i) memset(s.pixels + i * WIDE * HIGH, (int)i + 1, WIDE * HIGH);
  sonde_slicer_options o = sonde_slicer_options_default();
  o.method = SONDE_SLICE_NEAREST;
  o.gap_m = o.reach_m = 1;
  sonde_affine pose = plane(vec3(-0.012, 0.0, 0.004), vec3(0.2, -0.9, 0.1), 0.2e-3);
  view w = look(&s, &o, &pose, 130, 100);
  uint32_t wrong = 0, asked = 0;
  for (int v = 0; v < 100; ++v)
    for (int u = 0; u < 130; ++u) {
      double best = 1, second = 1, f[3];
      int frame = -1;
      for (int i = 0; i < 40; ++i) {
        if (!foot(&s.frames[i].world_from_pixel, at(&pose, u, v), f)) continue;
        if (f[2] < best)
          second = best, best = f[2], frame = i;
        else
          second = fmin(second, f[2]);
      }
      if (frame < 0 || second - best < 1e-8) continue;
      ++asked;
      wrong += w.image.pixels[v * 130 + u] != frame + 1;
    }
  print_message("%u of %u pixels differ from the full search\n", wrong, asked);
  assert_true(asked > 5000);
  assert_true(wrong * 200 < asked); // frames whose edge lies within 0.01 pixel of the point
  clear(&w);
  sonde_sequence_clear(&s);
}

static sonde_likeness against_truth(const view *w, const sonde_affine *a) {
  uint32_t width = w->image.width, height = w->image.height;
  uint8_t *truth = SONDE_NEW(uint8_t, (size_t)width * height);
  sonde_likeness l;
  for (uint32_t v = 0; v < height; ++v)
    for (uint32_t u = 0; u < width; ++u) truth[v * width + u] = grey_of(phantom(at(a, u, v)));
  assert_int_equal(sonde_image_likeness(truth, w->image.pixels, w->known, width, height, &l, NULL),
                   SONDE_OK);
  sonde_free(truth);
  return l;
}

static void bracketing_beats_the_nearest_slice_on_a_phantom(void **state) {
  (void)state;
  for (double gap_mm = 0.5; gap_mm < 2.1; gap_mm += 0.5) {
    sonde_sequence s = sweep((uint32_t)(12 / gap_mm), gap_mm * 1e-3, 0.03, phantom);
    sonde_affine pose = plane(vec3(-0.01, 0.001, 0.003), vec3(0.05, -0.3, 0.1), 0.2e-3);
    sonde_likeness l[2];
    for (int k = 0; k < 2; ++k) {
      sonde_slicer_options o = sonde_slicer_options_default();
      o.method = k ? SONDE_SLICE_NEAREST : SONDE_SLICE_BRACKET;
      o.reach_m = 0;
      view w = look(&s, &o, &pose, 90, 80);
      assert_true(w.reached > 90 * 80 * 8 / 10);
      l[k] = against_truth(&w, &pose);
      clear(&w);
    }
    print_message("frames %.1f mm apart: RMS %.2f PSNR %.2f NCC %.4f SSIM %.4f; nearest RMS %.2f "
                  "PSNR %.2f NCC %.4f SSIM %.4f\n",
                  gap_mm, l[0].rms_grey, l[0].psnr_db, l[0].ncc, l[0].ssim, l[1].rms_grey,
                  l[1].psnr_db, l[1].ncc, l[1].ssim);
    // The waves are 4.2 mm long along the sweep: 2 mm are hardly enough for any way.
    assert_true(l[0].rms_grey < (gap_mm < 1.2 ? 0.65 : 0.9) * l[1].rms_grey);
    assert_true(l[0].ncc > l[1].ncc && l[0].ssim > l[1].ssim);
    sonde_sequence_clear(&s);
  }
}

static void bracketing_beats_the_nearest_slice_on_a_real_sweep(void **state) {
  (void)state;
  char path[512], config[512];
  const char *base = SONDE_SOURCE_DIR "/../shared/data/tracked_spine_phantom";
  snprintf(path, sizeof path, "%s/SpinePhantomFreehand.igs.mha", base);
  snprintf(config, sizeof config, "%s/PlusDeviceSet_SpinePhantomFreehandReconstructionOnly.xml",
           base);
  if (access(path, R_OK) != 0) {
    print_message("skipped: no %s\n", path);
    skip();
  }
  sonde_sequence s;
  sonde_calibration c;
  sonde_left_out r;
  assert_int_equal(sonde_sequence_load(path, &s, NULL), SONDE_OK);
  assert_int_equal(sonde_calibration_load(config, &c, NULL), SONDE_OK);
  c.has_clip = true;
  memcpy(c.clip, (uint32_t[4]){190, 14, 438, 580}, sizeof c.clip); // without the black border
  assert_int_equal(sonde_sequence_locate(&s, &c, NULL, NULL, NULL), SONDE_OK);
  for (uint32_t i = 0; i < s.count; ++i) s.frames[i].used = i >= 6 && i < 14;
  assert_int_equal(sonde_sequence_leave_one_out(&s, NULL, false, &r, NULL, NULL), SONDE_OK);
  print_message("%u frames: RMS %.2f NCC %.4f, nearest RMS %.2f NCC %.4f, neighbours' mean RMS "
                "%.2f NCC %.4f\n",
                r.frames, r.bracket.rms_grey, r.bracket.ncc, r.nearest.rms_grey, r.nearest.ncc,
                r.neighbours.rms_grey, r.neighbours.ncc);
  assert_int_equal(r.frames, 6);
  assert_true(r.bracket.rms_grey < 0.85 * r.nearest.rms_grey);
  assert_true(r.bracket.ncc > r.nearest.ncc && r.bracket.ssim > r.nearest.ssim);
  sonde_sequence_clear(&s);
}

// ---- volumes -------------------------------------------------------------------------------

static sonde_volume build(const sonde_sequence *s, sonde_reconstruct_method method, double fill_m,
                          sonde_reconstruct_report *report) {
  sonde_volume v;
  sonde_reconstruct_options o = sonde_reconstruct_options_default();
  o.method = method, o.hole_fill_m = fill_m;
  assert_int_equal(sonde_reconstruct(s, &o, &v, report, NULL, NULL), SONDE_OK);
  return v;
}

// Frames 2 mm apart, voxels of 0.5 mm: every voxel between frames is a bridged hole, and a bridge
// between two points of a linear field is the field. A pixel stands for the voxels around it, so
// that touched voxels may be off by a part of a level.
static void a_volume_of_a_linear_field_is_linear(void **state) {
  (void)state;
  sonde_sequence s = sweep(6, 2e-3, 0, ramp);
  for (int method = 0; method < 2; ++method) {
    sonde_reconstruct_report bare, filled;
    sonde_volume v = build(&s, (sonde_reconstruct_method)method, 0, &bare);
    sonde_volume_clear(&v);
    v = build(&s, (sonde_reconstruct_method)method, 3e-3, &filled);
    assert_int_equal(bare.touched, filled.touched);
    assert_int_equal(bare.bridged, 0);
    assert_true(filled.bridged > filled.touched);
    double worst = 0, mean = 0;
    uint32_t count = 0;
    for (uint32_t k = 1; k + 2 < v.size[2]; ++k)
      for (uint32_t j = 2; j + 3 < v.size[1]; ++j)
        for (uint32_t i = 2; i + 3 < v.size[0]; ++i, ++count) {
          double x = v.world_from_voxel.m[0][3] + i * 0.5e-3;
          double y = v.world_from_voxel.m[1][3] + j * 0.5e-3;
          double z = v.world_from_voxel.m[2][3] + k * 0.5e-3;
          double error = v.voxels[(k * v.size[1] + j) * v.size[0] + i] - ramp(vec3(x, y, z));
          worst = fmax(worst, fabs(error)), mean += error;
        }
    print_message("%s: worst %.2f, mean %.3f grey levels\n", method ? "nearest" : "linear", worst,
                  mean / count);
    assert_true(worst < 1.2);
    assert_true(fabs(mean / count) < (method ? 0.5 : 0.1));
    sonde_volume_clear(&v);
  }
  sonde_sequence_clear(&s);
}

static double one_grey(sonde_vec3 p) { return p.x < 1 ? 77 : 0; }

static void a_constant_stays_constant(void **state) {
  (void)state;
  sonde_sequence s = sweep(9, 1e-3, 0.1, one_grey);
  sonde_reconstruct_report report;
  sonde_volume v = build(&s, SONDE_RECONSTRUCT_LINEAR, 2e-3, &report);
  uint64_t grey = 0;
  for (uint64_t i = 0; i < report.voxels; ++i) {
    assert_true(v.voxels[i] == 0 || v.voxels[i] == 77);
    grey += v.voxels[i] == 77;
  }
  assert_int_equal(grey, report.touched + report.bridged);
  sonde_volume_clear(&v);
  sonde_sequence_clear(&s);
}

static void a_grid_that_is_too_large_names_a_spacing_that_fits(void **state) {
  (void)state;
  sonde_sequence s = sweep(5, 1e-3, 0.1, one_grey);
  sonde_reconstruct_options o = sonde_reconstruct_options_default();
  sonde_volume v;
  sonde_error error;
  o.most_voxels = 100000;
  o.spacing_m = 0.1e-3;
  assert_int_equal(sonde_reconstruct(&s, &o, &v, NULL, NULL, &error), SONDE_ARGUMENT);
  assert_null(v.voxels);
  const char *advice = strstr(error.message, "spacing of ");
  assert_non_null(advice);
  o.spacing_m = 1e-3 * strtod(advice + 11, NULL);
  o.hole_fill_m = 0;
  assert_true(o.spacing_m > 0.1e-3 && o.spacing_m < 1e-3);
  assert_int_equal(sonde_reconstruct(&s, &o, &v, NULL, NULL, NULL), SONDE_OK);
  sonde_volume_clear(&v);
  for (uint32_t i = 0; i < 5; ++i) s.frames[i].used = false;
  assert_int_equal(sonde_reconstruct(&s, NULL, &v, NULL, NULL, &error), SONDE_MISMATCH);
  sonde_sequence_clear(&s);
}

static void a_slice_along_the_grid_is_the_voxels(void **state) {
  (void)state;
  const uint32_t size[3] = {20, 16, 12};
  sonde_volume v;
  view w = {.known = SONDE_NEW(uint8_t, 20 * 16)};
  uint64_t seed = 9;
  assert_int_equal(sonde_volume_create(size, &v, NULL), SONDE_OK);
  assert_int_equal(sonde_image_create(20, 16, &w.image, NULL), SONDE_OK);
  for (int i = 0; i < 20 * 16 * 12; ++i) v.voxels[i] = (uint8_t)(127 + 127 * fixture_random(&seed));
  sonde_affine pose = v.world_from_voxel;
  for (int nearest = 0; nearest < 2; ++nearest)
    for (int k = 0; k < 12; ++k) {
      pose.m[2][3] = 1e-3 * k;
      assert_int_equal(sonde_volume_slice(&v, nearest, &pose, &w.image, w.known), 320);
      assert_memory_equal(w.image.pixels, v.voxels + k * 320, 320);
    }
  for (int i = 0; i < 20 * 16 * 12; ++i) v.voxels[i] = (uint8_t)(20 + 3 * (i % 20) + 2 * (i / 320));
  pose.m[0][3] = 0.5e-3, pose.m[2][3] = 4.5e-3; // half way: 3/2 and 9 more
  assert_int_equal(sonde_volume_slice(&v, false, &pose, &w.image, w.known), 19 * 16);
  for (int u = 0; u < 19; ++u) assert_near(w.image.pixels[u], 20 + 3 * (u + 0.5) + 9, 0.5);
  pose.m[2][3] = 11.2e-3; // beyond the last layer
  assert_int_equal(sonde_volume_slice(&v, false, &pose, &w.image, w.known), 0);
  clear(&w);
  sonde_volume_clear(&v);
}

// The picture's frame of docs/frames.md: row 0 at the probe, column 0 at negative x, depth along z.
static void the_picture_lies_in_the_probes_plane(void **state) {
  (void)state;
  sonde_pose probe = {vec3(0.1, 0.2, 0.3), q_unit((sonde_quat){0.9, 0.1, -0.3, 0.2})};
  sonde_image image = {.width = 4, .height = 2, .width_m = 0.04, .height_m = 0.03};
  sonde_affine a = sonde_slice_plane(probe, &image);
  sonde_vec3 corner = pose_apply_inverse(probe, at(&a, -0.5, -0.5));
  sonde_vec3 far = pose_apply_inverse(probe, at(&a, 3.5, 1.5));
  assert_near(v_distance(corner, vec3(-0.02, 0, 0)), 0, 1e-12);
  assert_near(v_distance(far, vec3(0.02, 0, 0.03)), 0, 1e-12);
}

static void likeness_knows_its_limits(void **state) {
  (void)state;
  enum { N = 40 };
  uint8_t a[N * N], b[N * N], known[N * N];
  uint64_t seed = 2;
  sonde_likeness l;
  for (int i = 0; i < N * N; ++i) a[i] = (uint8_t)(100 + 50 * fixture_random(&seed));
  assert_int_equal(sonde_image_likeness(a, a, NULL, N, N, &l, NULL), SONDE_OK);
  assert_near(l.rms_grey, 0, 0);
  assert_near(l.ncc, 1, 1e-12);
  assert_near(l.ssim, 1, 1e-12);
  for (int i = 0; i < N * N; ++i) b[i] = (uint8_t)(a[i] + 10); // brighter: the same to NCC
  assert_int_equal(sonde_image_likeness(a, b, NULL, N, N, &l, NULL), SONDE_OK);
  assert_near(l.rms_grey, 10, 1e-9);
  assert_near(l.mae_grey, 10, 1e-9);
  assert_near(l.psnr_db, 28.1308, 1e-4);
  assert_near(l.ncc, 1, 1e-12);
  assert_true(l.ssim < 1 && l.ssim > 0.9);
  for (int i = 0; i < N * N; ++i) b[i] = (uint8_t)(200 - a[i]);
  assert_int_equal(sonde_image_likeness(a, b, NULL, N, N, &l, NULL), SONDE_OK);
  assert_near(l.ncc, -1, 1e-12);
  assert_true(l.ssim < -0.9);
  for (int i = 0; i < N * N; ++i) known[i] = i % N < 20, b[i] = i % N < 20 ? a[i] : 0;
  assert_int_equal(sonde_image_likeness(a, b, known, N, N, &l, NULL), SONDE_OK);
  assert_int_equal(l.count, 20 * N);
  assert_near(l.ssim, 1, 1e-12);
  memset(known, 0, sizeof known);
  assert_int_equal(sonde_image_likeness(a, b, known, N, N, &l, NULL), SONDE_MISMATCH);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_frames_own_pose_gives_the_frame),
      cmocka_unit_test(a_linear_field_is_exact),
      cmocka_unit_test(a_linear_field_is_exact_between_leaning_planes),
      cmocka_unit_test(moving_everything_changes_nothing),
      cmocka_unit_test(neither_threads_nor_order_matter),
      cmocka_unit_test(a_left_out_frame_leaves_no_trace),
      cmocka_unit_test(no_nearer_frame_is_overlooked),
      cmocka_unit_test(bracketing_beats_the_nearest_slice_on_a_phantom),
      cmocka_unit_test(bracketing_beats_the_nearest_slice_on_a_real_sweep),
      cmocka_unit_test(a_volume_of_a_linear_field_is_linear),
      cmocka_unit_test(a_constant_stays_constant),
      cmocka_unit_test(a_grid_that_is_too_large_names_a_spacing_that_fits),
      cmocka_unit_test(a_slice_along_the_grid_is_the_voxels),
      cmocka_unit_test(the_picture_lies_in_the_probes_plane),
      cmocka_unit_test(likeness_knows_its_limits)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
