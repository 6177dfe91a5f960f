// Files of tracked sequences and volumes: round trips, orientation, foreign dialects, damage with
// file and line, INVALID frames, joined transforms, real recordings.
#include "../sanitized.h"
#include "fixture.h"
#include "sweep/frames.h"

#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

static char folder[] = "/tmp/sonde_frames_XXXXXX";

static const char *path_of(const char *name) {
  static char path[4][256];
  static int next;
  char *out = path[next++ % 4];
  snprintf(out, sizeof path[0], "%s/%s", folder, name);
  return out;
}

static const char *real(const char *name) {
  static char path[512];
  snprintf(path, sizeof path, "%s/../shared/data/%s", SONDE_SOURCE_DIR, name);
  if (access(path, R_OK) == 0) return path;
  print_message("skipped: no %s\n", path);
  return NULL;
}

static void write_bytes(const char *name, const char *bytes, size_t count) {
  FILE *stream = fopen(path_of(name), "wb");
  assert_non_null(stream);
  assert_int_equal(fwrite(bytes, 1, count, stream), count);
  fclose(stream);
}

static void assert_same_file(const char *a, const char *b) {
  char *x, *y;
  size_t m, n;
  assert_int_equal(sonde_file_load(a, &x, &m, NULL), SONDE_OK);
  assert_int_equal(sonde_file_load(b, &y, &n, NULL), SONDE_OK);
  assert_int_equal(m, n);
  assert_memory_equal(x, y, m);
  sonde_free(x);
  sonde_free(y);
}

static sonde_sequence sample(const char *orientation) {
  sonde_sequence s;
  uint64_t seed = 7;
  assert_int_equal(sonde_sequence_create(7, 5, 3, &s, NULL), SONDE_OK);
  snprintf(s.orientation, sizeof s.orientation, "%s", orientation);
  for (size_t i = 0; i < 105; ++i) s.pixels[i] = (uint8_t)(127 + 127 * fixture_random(&seed));
  sonde_affine a = {{{0.1, 0, 0, 1.0 / 3}, {0, 0.2, 0, -2e-7}, {0, 0, 1, 12345.678}}};
  sonde_sequence_set(&s, SONDE_WHOLE_FILE, "UltrasoundImageType", "BRIGHTNESS", NULL);
  sonde_sequence_set(&s, SONDE_WHOLE_FILE, "Operator", "a = b: c; 50 %", NULL);
  for (uint32_t i = 0; i < 3; ++i) {
    assert_int_equal(sonde_sequence_set_transform(&s, i, "ImageToReference", &a, NULL), SONDE_OK);
    sonde_sequence_set(&s, i, "Timestamp", i == 1 ? "0.25" : "1e-3", NULL);
    sonde_sequence_set(&s, i, "ImageStatus", "OK", NULL);
  }
  sonde_sequence_set(&s, 2, "Empty", "", NULL);
  return s;
}

static void assert_same_fields(const sonde_tracked_frame *a, const sonde_tracked_frame *b) {
  assert_int_equal(a->field_count, b->field_count);
  for (uint32_t i = 0; i < a->field_count; ++i) {
    assert_string_equal(a->fields[i].key, b->fields[i].key);
    assert_string_equal(a->fields[i].value, b->fields[i].value);
  }
}

static void assert_same(const sonde_sequence *a, const sonde_sequence *b) {
  assert_int_equal(a->width, b->width);
  assert_int_equal(a->height, b->height);
  assert_int_equal(a->count, b->count);
  assert_string_equal(a->orientation, b->orientation);
  assert_memory_equal(a->pixels, b->pixels, (size_t)a->width * a->height * a->count);
  assert_same_fields(&a->file, &b->file);
  for (uint32_t i = 0; i < a->count; ++i) assert_same_fields(&a->frames[i], &b->frames[i]);
}

static const char *const NAMES[] = {"a.igs.mha", "a.igs.nrrd", "a.seq.nrrd"};

static void a_written_sequence_is_read_back_bit_for_bit(void **state) {
  (void)state;
  const char *const orientations[] = {"MFA", "UF", "MN", "UNA"};
  for (int o = 0; o < 4; ++o)
    for (int k = 0; k < 6; ++k) {
      sonde_sequence s = sample(orientations[o]), t;
      const char *path = path_of(NAMES[k / 2]);
      char again[300];
      snprintf(again, sizeof again, "%s/again%s", folder, NAMES[k / 2] + 1);
      assert_int_equal(sonde_sequence_save(path, &s, k % 2, NULL), SONDE_OK);
      assert_int_equal(sonde_sequence_load(path, &t, NULL), SONDE_OK);
      assert_same(&s, &t);
      assert_int_equal(sonde_sequence_save(again, &t, k % 2, NULL), SONDE_OK);
      assert_same_file(path, again);
      sonde_sequence_clear(&s);
      sonde_sequence_clear(&t);
    }
}

// Pixels 1..6 of a 3 x 2 frame as a file of that orientation stores them.
static void pixels_turn_to_marked_far(void **state) {
  (void)state;
  const struct {
    const char *word;
    char stored[7];
  } cases[] = {{"MF", "\1\2\3\4\5\6"},
               {"UF", "\3\2\1\6\5\4"},
               {"MNA", "\4\5\6\1\2\3"},
               {"UN", "\6\5\4\3\2\1"}};
  for (int i = 0; i < 4; ++i) {
    char bytes[400];
    int used = snprintf(bytes, sizeof bytes,
                        "ObjectType = Image\r\nNDims = 3\r\nDimSize = 3 2 1 \r\nElementType = "
                        "MET_UCHAR\r\nUltrasoundImageOrientation = %s\r\nElementDataFile = "
                        "LOCAL\r\n",
                        cases[i].word);
    memcpy(bytes + used, cases[i].stored, 6);
    write_bytes("o.mha", bytes, (size_t)used + 6);
    sonde_sequence s;
    assert_int_equal(sonde_sequence_load(path_of("o.mha"), &s, NULL), SONDE_OK);
    assert_memory_equal(s.pixels, "\1\2\3\4\5\6", 6);
    sonde_sequence_clear(&s);
  }
}

static void frames_may_run_fastest(void **state) {
  (void)state;
  static const char bytes[] = "NRRD0005\n# a remark\ntype: unsigned char\ndimension: 4\n"
                              "sizes: 2 3 2 1\nkinds: list domain domain domain\nencoding: raw\n"
                              "Seq_Frame0001_Timestamp:=4\n\nabcdefghijkl";
  write_bytes("l.seq.nrrd", bytes, sizeof bytes - 1);
  sonde_sequence s;
  assert_int_equal(sonde_sequence_load(path_of("l.seq.nrrd"), &s, NULL), SONDE_OK);
  assert_int_equal(s.count, 2);
  assert_memory_equal(s.pixels, "acegikbdfhjl", 12);
  assert_string_equal(sonde_sequence_get(&s, 1, "Timestamp"), "4");
  sonde_sequence_clear(&s);
}

#define MHA_START "ObjectType = Image\nNDims = 3\n"
#define MHA_END "ElementType = MET_UCHAR\nElementDataFile = LOCAL\n"

// Each message names the line and what was expected.
static void damage_is_named_with_its_line(void **state) {
  (void)state;
  const struct {
    const char *bytes, *line, *word;
  } cases[] = {
      {"P6\n2 2 255\n", ":1:", "Key = Value"},
      {"Hello = you\n", ":1:", "ObjectType"},
      {"NRRD0009\n\n", ":1:", "NRRD0005"},
      {"NRRD0004\ntype: float\ndimension: 3\nencoding: raw\nsizes: 1 1 1\n\nabcd", ":2:", "uint8"},
      {"NRRD0004\ntype: uint8\ndimension: 3\nencoding: hex\nsizes: 1 1 1\n\nab", ":4:", "gzip"},
      {"NRRD0004\ntype: uint8\ndimension: 3\nencoding: raw\nsizes: 1 1\n\nab", ":5:", "3 whole"},
      {"NRRD0004\ntype: uint8\ndimension: 3\nkinds: a b c d list\nencoding: raw\nsizes: 1 1 1\n\na",
       ":4:", "one per axis"},
      {"NRRD0004\ntype: uint8\nnothing here\n\n", ":3:", "key:=value"},
      {"NRRD0004\ntype: uint8\ndimension: 3\nencoding: raw\nsizes: 1 1 1\ndata file: x\n\n",
       ":6:", "same file"},
      {MHA_START "DimSize = 1 1 1\nElementType = MET_SHORT\nElementDataFile = LOCAL\nab",
       ":4:", "MET_UCHAR"},
      {MHA_START "DimSize = 1 1 one\n" MHA_END "a", ":3:", "3 whole numbers"},
      {MHA_START "DimSize = 1 -1 1\n" MHA_END "a", ":3:", "3 whole numbers"},
      {MHA_START "DimSize = 1 1 1\nDimSize = 1 1 2\n" MHA_END "a", ":4:", "repeats line 3"},
      {MHA_START "DimSize = 2 2 1\nElementType = MET_UCHAR\nElementDataFile = x.raw\n",
       ":5:", "LOCAL"},
      {MHA_START "DimSize = 2 2 1\n", ":3:", "ElementDataFile"},
      {MHA_START "DimSize = 2 \2 1\n" MHA_END "abcd", ":3:", "0x02"},
      {MHA_START "DimSize = 2 2 1\n" MHA_END "abc", "line 5", "expected 4"},
      {MHA_START "DimSize = 2 2 1\n" MHA_END "abcde", "line 5", "expected 4"},
      {MHA_START "DimSize = 2 2 1\nCompressedData = True\n" MHA_END "\x78\x9c"
                 "abcdefgh",
       "line 6", "damaged"},
      {MHA_START "DimSize = 2 2 1\nCompressedData = True\nCompressedDataSize = 90\n" MHA_END "ab",
       ":5:", "expected 90 bytes"},
      {MHA_START "DimSize = 16000 16000 100000\nCompressedData = True\n" MHA_END "abcdefgh",
       "line 6", "expected what unpacks"},
      {MHA_START "DimSize = 1 1 1\nSeq_Frame0001_Timestamp = 1\n" MHA_END "a",
       ":4:", "frames 0 to 0"},
      {MHA_START "DimSize = 1 1 1\nSeq_Frame0000_A = 1\nSeq_Frame0000_A = 2\n" MHA_END "a",
       ":5:", "once"},
      {MHA_START "DimSize = 1 1 1\nSeq_Frame0000_ImageToReferenceTransform = 1 0 0 0 0 1 0 0 0 0 1 "
                 "0 0 0 1 1\n" MHA_END "a",
       ":4:", "16 finite numbers"},
      {MHA_START "DimSize = 1 1 1\nUltrasoundImageOrientation = FM\n" MHA_END "a", ":4:", "MFA"},
  };
  for (size_t i = 0; i < SONDE_COUNT_OF(cases); ++i) {
    write_bytes("bad.mha", cases[i].bytes, strlen(cases[i].bytes));
    sonde_sequence s;
    sonde_error error = {0};
    sonde_status status = sonde_sequence_load(path_of("bad.mha"), &s, &error);
    if (status != SONDE_FORMAT && status != SONDE_VERSION) fail_msg("case %zu: %d", i, status);
    if (!strstr(error.message, "bad.mha") || !strstr(error.message, cases[i].line) ||
        !strstr(error.message, cases[i].word))
      fail_msg("case %zu: %s", i, error.message);
    assert_null(s.frames);
  }
}

// Every byte of a packed file cut off or changed is noticed or leaves a sound sequence.
static void no_cut_goes_unnoticed(void **state) {
  (void)state;
  sonde_sequence s = sample("MFA"), t;
  for (int k = 0; k < 6; ++k) {
    char *bytes;
    size_t count;
    assert_int_equal(sonde_sequence_save(path_of(NAMES[k / 2]), &s, k % 2, NULL), SONDE_OK);
    assert_int_equal(sonde_file_load(path_of(NAMES[k / 2]), &bytes, &count, NULL), SONDE_OK);
    for (size_t cut = 0; cut < count; cut += ROUNDS(1, 7)) {
      write_bytes("cut", bytes, cut);
      assert_int_not_equal(sonde_sequence_load(path_of("cut"), &t, NULL), SONDE_OK);
    }
    sonde_free(bytes);
  }
  sonde_sequence_clear(&s);
}

static sonde_affine of_pose(sonde_pose p) {
  sonde_mat3 r = q_matrix(p.rotation);
  sonde_affine a;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) a.m[i][k] = r.m[i][k];
  a.m[0][3] = p.position.x, a.m[1][3] = p.position.y, a.m[2][3] = p.position.z;
  return a;
}

static sonde_pose random_pose(uint64_t *seed) {
  sonde_quat q = {fixture_random(seed), fixture_random(seed), fixture_random(seed),
                  fixture_random(seed)};
  return (sonde_pose){fixture_vector(seed, 100), q_unit(q)};
}

// The chain of PLUS: Image -> Probe -> Tracker <- Reference, and the same told the other way round.
static void transforms_join_either_way_round(void **state) {
  (void)state;
  uint64_t seed = 11;
  sonde_pose probe_from_image = random_pose(&seed), tracker_from_probe = random_pose(&seed);
  sonde_pose tracker_from_reference = random_pose(&seed);
  sonde_pose expected = pose_mul(pose_inverse(tracker_from_reference),
                                 pose_mul(tracker_from_probe, probe_from_image));
  for (int way = 0; way < 2; ++way) {
    sonde_sequence s;
    sonde_located located;
    sonde_calibration c = {.count = 1};
    snprintf(c.transforms[0].from, 32, way ? "Probe" : "Image");
    snprintf(c.transforms[0].to, 32, way ? "Image" : "Probe");
    c.transforms[0].to_from_from = of_pose(way ? pose_inverse(probe_from_image) : probe_from_image);
    sonde_affine a = of_pose(way ? pose_inverse(tracker_from_probe) : tracker_from_probe);
    sonde_affine b = of_pose(way ? pose_inverse(tracker_from_reference) : tracker_from_reference);
    assert_int_equal(sonde_sequence_create(4, 4, 1, &s, NULL), SONDE_OK);
    sonde_sequence_set_transform(&s, 0, way ? "TrackerToProbe" : "ProbeToTracker", &a, NULL);
    sonde_sequence_set_transform(&s, 0, way ? "TrackerToReference" : "ReferenceToTracker", &b,
                                 NULL);
    assert_int_equal(sonde_sequence_locate(&s, &c, NULL, &located, NULL), SONDE_OK);
    assert_string_equal(located.world, "Reference");
    sonde_affine want = of_pose(expected);
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 4; ++k)
        assert_near(s.frames[0].world_from_pixel.m[i][k], 1e-3 * want.m[i][k], 1e-9);
    sonde_sequence_clear(&s);
  }
}

static void invalid_frames_are_kept_and_not_used(void **state) {
  (void)state;
  sonde_sequence s = sample("MFA"), t;
  sonde_located located;
  sonde_sequence_set(&s, 0, "ImageToReferenceTransformStatus", "INVALID", NULL);
  sonde_sequence_set(&s, 0, "ImageToReferenceTransform", "nan", NULL);
  sonde_sequence_set(&s, 1, "ImageStatus", "INVALID", NULL);
  assert_int_equal(sonde_sequence_save(path_of("i.mha"), &s, true, NULL), SONDE_OK);
  assert_int_equal(sonde_sequence_load(path_of("i.mha"), &t, NULL), SONDE_OK);
  assert_same(&s, &t);
  assert_int_equal(sonde_sequence_locate(&t, NULL, NULL, &located, NULL), SONDE_OK);
  assert_int_equal(located.used, 1);
  assert_int_equal(located.invalid, 2);
  assert_true(!t.frames[0].used && !t.frames[1].used && t.frames[2].used);
  sonde_sequence_set(&t, 0, "ImageToReferenceTransform", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", NULL);
  assert_int_equal(sonde_sequence_locate(&t, NULL, NULL, &located, NULL), SONDE_OK);
  assert_int_equal(located.used, 1); // good numbers, but INVALID
  sonde_error error;
  assert_int_equal(sonde_sequence_locate(&t, NULL, "Moon", NULL, &error), SONDE_MISMATCH);
  assert_non_null(strstr(error.message, "3 without transforms"));
  sonde_affine flat = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 1, 0, 0}}};
  sonde_sequence_set_transform(&t, 2, "ImageToReference", &flat, NULL);
  assert_int_equal(sonde_sequence_locate(&t, NULL, NULL, NULL, &error), SONDE_FORMAT);
  assert_non_null(strstr(error.message, "frame 2"));
  sonde_sequence_clear(&s);
  sonde_sequence_clear(&t);
}

// A picture that is written with its probe's pose comes back in the plane that it was made in.
static void a_picture_keeps_its_plane(void **state) {
  (void)state;
  enum { WIDE = 12, HIGH = 9 };
  uint8_t pixel[WIDE * HIGH];
  const sonde_pose probe = {{0.03, -0.02, 0.15}, {0.5, -0.1, 0.7, 0.5}};
  const sonde_image image = {
      .width = WIDE, .height = HIGH, .width_m = 0.048, .height_m = 0.036, .pixels = pixel};
  sonde_sequence s, t;
  sonde_located located;
  for (int k = 0; k < WIDE * HIGH; ++k) pixel[k] = (uint8_t)(2 * k);
  assert_int_equal(sonde_sequence_create(WIDE, HIGH, 2, &s, NULL), SONDE_OK);
  for (uint32_t k = 0; k < 2; ++k)
    assert_int_equal(sonde_sequence_set_picture(&s, k, probe, &image, NULL), SONDE_OK);
  const sonde_image other = {.width = WIDE + 1, .height = HIGH, .pixels = pixel};
  assert_int_equal(sonde_sequence_set_picture(&s, 0, probe, &other, NULL), SONDE_ARGUMENT);
  assert_int_equal(sonde_sequence_save(path_of("p.seq.nrrd"), &s, true, NULL), SONDE_OK);
  assert_int_equal(sonde_sequence_load(path_of("p.seq.nrrd"), &t, NULL), SONDE_OK);
  assert_int_equal(sonde_sequence_locate(&t, NULL, NULL, &located, NULL), SONDE_OK);
  assert_int_equal(located.used, 2);
  assert_string_equal(located.world, "Reference");
  const sonde_affine plane = sonde_slice_plane(probe, &image);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 4; ++k)
      if (k != 2) assert_near(t.frames[1].world_from_pixel.m[i][k], plane.m[i][k], 1e-12);
  assert_memory_equal(t.pixels + sizeof pixel, pixel, sizeof pixel);
  sonde_sequence_clear(&s);
  sonde_sequence_clear(&t);
}

static void calibration_is_read_or_named(void **state) {
  (void)state;
  static const char good[] = "<A>\n<!-- <Transform From=\"x\"/> -->\n<Transform From='Image' "
                             "To=\"Probe\"\n Matrix=\"1 0 0 "
                             "4\n 0 2 0 5 0 0 3 6 0 0 0 1\" Error='1'/>\n<VolumeReconstruction "
                             "ClipRectangleOrigin=\"1 2\" "
                             "ClipRectangleSize=\"3 3\"/></A>";
  sonde_calibration c;
  sonde_error error;
  write_bytes("c.xml", good, sizeof good - 1);
  assert_int_equal(sonde_calibration_load(path_of("c.xml"), &c, NULL), SONDE_OK);
  assert_int_equal(c.count, 1);
  assert_string_equal(c.transforms[0].from, "Image");
  assert_near(c.transforms[0].to_from_from.m[1][3], 5, 0);
  assert_true(c.has_clip && c.clip[0] == 1 && c.clip[1] == 2 && c.clip[3] == 3);
  sonde_sequence s = sample("MF");
  assert_int_equal(sonde_sequence_locate(&s, &c, NULL, NULL, NULL), SONDE_OK);
  c.clip[2] = 7;
  assert_int_equal(sonde_sequence_locate(&s, &c, NULL, NULL, &error), SONDE_MISMATCH);
  sonde_sequence_clear(&s);
  static const char bad[] = "<A>\n\n<Transform From=\"Image\" To=\"Probe\" Matrix=\"1 2\"/>";
  write_bytes("c.xml", bad, sizeof bad - 1);
  assert_int_equal(sonde_calibration_load(path_of("c.xml"), &c, &error), SONDE_FORMAT);
  assert_non_null(strstr(error.message, "c.xml:3:"));
}

// TUS-REC's two blocks: pixels count from 1 there, so that its pixel (1, 1) is ours (0, 0).
static void blocks_of_numbers_calibrate(void **state) {
  (void)state;
  static const char good[] =
      "scaling_from_pixel_to_mm,,,\r\n0.2,0,0,0\r\n0,0.5,0,0\r\n0,0,1,0\r\n0,0,0,1\r\n"
      "spatial_calibration_from_image_coordinate_system_to_tracking_tool_coordinate_system,,,\r\n"
      "0,-1,0,10\r\n1,0,0,20\r\n0,0,1,30\r\n0,0,0,1";
  sonde_calibration c;
  sonde_error error;
  write_bytes("calib_matrix.csv", good, sizeof good - 1);
  assert_int_equal(sonde_calibration_load(path_of("calib_matrix.csv"), &c, NULL), SONDE_OK);
  assert_int_equal(c.count, 1);
  assert_false(c.has_clip);
  assert_string_equal(c.transforms[0].from, "Image");
  assert_string_equal(c.transforms[0].to, "Probe");
  const double expected[3][4] = {{0, -0.5, 0, 9.5}, {0.2, 0, 0, 20.2}, {0, 0, 1, 30}};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 4; ++j)
      assert_near(c.transforms[0].to_from_from.m[i][j], expected[i][j], 1e-15);
  static const char *const bad[] = {
      "scaling_from_pixel_to_mm\n1,0,0,0\n0,1,0\n0,0,1,0\n0,0,0,1\n",
      "scaling_from_pixel_to_mm\n1,0,0,0\n0,1,0,0\n0,0,1,0\n0,0,0,2\n",
      "scaling_from_pixel_to_mm\n1,0,0,0\n0,1,0,0\n0,0,1,0\n0,0,0,1\n", // the other is missing
      "scaling_from_pixel_to_mm", "1,0,0,0\n"};
  for (size_t k = 0; k < SONDE_COUNT_OF(bad); ++k) {
    write_bytes("bad.csv", bad[k], strlen(bad[k]));
    assert_int_equal(sonde_calibration_load(path_of("bad.csv"), &c, &error), SONDE_FORMAT);
    assert_non_null(strstr(error.message, k < 4 ? "bad.csv:" : "calib_matrix.csv"));
  }
}

static void volumes_are_read_back(void **state) {
  (void)state;
  const char *const names[] = {"v.mha", "v.nrrd"};
  const uint32_t size[3] = {5, 4, 3};
  uint64_t seed = 3;
  for (int k = 0; k < 4; ++k) {
    sonde_volume v, w;
    assert_int_equal(sonde_volume_create(size, &v, NULL), SONDE_OK);
    for (int i = 0; i < 60; ++i) v.voxels[i] = (uint8_t)(127 + 127 * fixture_random(&seed));
    v.world_from_voxel = of_pose(random_pose(&seed));
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) v.world_from_voxel.m[i][j] *= 1e-4 * (1 + j);
      v.world_from_voxel.m[i][3] *= 1e-3;
    }
    assert_int_equal(sonde_volume_save(path_of(names[k / 2]), &v, k % 2, NULL), SONDE_OK);
    assert_int_equal(sonde_volume_load(path_of(names[k / 2]), &w, NULL), SONDE_OK);
    assert_memory_equal(v.size, w.size, sizeof v.size);
    assert_memory_equal(v.voxels, w.voxels, 60);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 4; ++j)
        assert_near(w.world_from_voxel.m[i][j], v.world_from_voxel.m[i][j], 1e-12);
    sonde_volume_clear(&v);
    sonde_volume_clear(&w);
  }
}

// ---- memory --------------------------------------------------------------------------------

static struct { long left, live; } heap;

static void *take(size_t bytes, void *user) {
  (void)user;
  if (heap.left-- <= 0) return NULL;
  ++heap.live;
  return malloc(bytes);
}

static void give(void *pointer, void *user) {
  (void)user;
  heap.live -= pointer != NULL;
  free(pointer);
}

static void every_failed_allocation_is_reported(void **state) {
  (void)state;
  sonde_sequence s = sample("UN"), t;
  assert_int_equal(sonde_sequence_save(path_of("m.nrrd"), &s, true, NULL), SONDE_OK);
  sonde_sequence_clear(&s);
  sonde_set_allocator(&(sonde_allocator){take, give, NULL});
  sonde_status status = SONDE_MEMORY;
  long n = 0;
  for (; status == SONDE_MEMORY && n < 1000; ++n) {
    heap.left = n, heap.live = 0;
    status = sonde_sequence_load(path_of("m.nrrd"), &t, NULL);
    if (!status) status = sonde_sequence_locate(&t, NULL, NULL, NULL, NULL);
    if (!status) status = sonde_sequence_save(path_of("m2.mha"), &t, true, NULL);
    sonde_sequence_clear(&t);
    assert_int_equal(heap.live, 0);
  }
  sonde_set_allocator(NULL);
  assert_int_equal(status, SONDE_OK);
  assert_true(n > 10);
}

// ---- recordings and readers of others ---------------------------------------------------------

static void both_formats_of_a_recording_agree(void **state) {
  (void)state;
  char mha[512];
  const char *path = real("tracked_nwire/NwirePhantomFreehand.igs.mha");
  if (!path) return;
  snprintf(mha, sizeof mha, "%s", path);
  sonde_sequence a, b;
  sonde_calibration c;
  assert_int_equal(sonde_sequence_load(mha, &a, NULL), SONDE_OK);
  assert_int_equal(
      sonde_sequence_load(real("tracked_nwire/NwirePhantomFreehand.igs.nrrd"), &b, NULL), SONDE_OK);
  assert_int_equal(a.count, 97);
  assert_memory_equal(a.pixels, b.pixels, (size_t)a.width * a.height * a.count);
  const char *config = real("tracked_nwire/PlusDeviceSet_NwirePhantomFreehand_"
                            "vtkVolumeReconstructorTest2.xml");
  assert_int_equal(sonde_calibration_load(config, &c, NULL), SONDE_OK);
  sonde_located p, q;
  assert_int_equal(sonde_sequence_locate(&a, &c, NULL, &p, NULL), SONDE_OK);
  assert_int_equal(sonde_sequence_locate(&b, &c, NULL, &q, NULL), SONDE_OK);
  assert_int_equal(p.used, 97);
  assert_int_equal(q.used, 97);
  for (uint32_t i = 0; i < 97; ++i)
    assert_memory_equal(&a.frames[i].world_from_pixel, &b.frames[i].world_from_pixel,
                        sizeof(sonde_affine));
  // The stylus was never seen.
  assert_int_equal(sonde_sequence_locate(&a, &c, "Stylus", &p, NULL), SONDE_MISMATCH);
  assert_int_equal(p.invalid, 97);
  sonde_sequence_clear(&a);
  sonde_sequence_clear(&b);
}

static void real_files_survive_a_copy(void **state) {
  (void)state;
  const char *const names[] = {"tracked_nwire/TimestampFilteringTest.igs.mha",
                               "tracked_spine_phantom/SpinePhantomFreehand.igs.mha"};
  for (int i = 0; i < 2; ++i) {
    const char *path = real(names[i]);
    if (!path) continue;
    sonde_sequence a, b;
    assert_int_equal(sonde_sequence_load(path, &a, NULL), SONDE_OK);
    assert_int_equal(sonde_sequence_save(path_of("copy.seq.nrrd"), &a, i == 0, NULL), SONDE_OK);
    assert_int_equal(sonde_sequence_load(path_of("copy.seq.nrrd"), &b, NULL), SONDE_OK);
    assert_same(&a, &b);
    sonde_sequence_clear(&a);
    sonde_sequence_clear(&b);
  }
}

// teem's own program unpacks what we write to the same bytes.
static void unu_reads_what_we_write(void **state) {
  (void)state;
  const char *unu = getenv("SONDE_UNU");
  if (!unu) unu = system("command -v unu >/dev/null") == 0 ? "unu" : NULL;
  if (!unu) unu = system("command -v teem-unu >/dev/null") == 0 ? "teem-unu" : NULL;
  if (!unu) {
    print_message("skipped: no unu (Debian: teem-apps)\n");
    skip();
  }
  const char *const names[] = {"u.igs.nrrd", "u.seq.nrrd"};
  sonde_sequence s = sample("MFA"), t;
  for (int k = 0; k < 4; ++k) {
    char command[900];
    snprintf(command, sizeof command, "%s save -f nrrd -e raw -i %s -o %s", unu,
             path_of(names[k / 2]), path_of("unu.nrrd"));
    assert_int_equal(sonde_sequence_save(path_of(names[k / 2]), &s, k % 2, NULL), SONDE_OK);
    assert_int_equal(system(command), 0);
    assert_int_equal(sonde_sequence_load(path_of("unu.nrrd"), &t, NULL), SONDE_OK);
    assert_memory_equal(s.pixels, t.pixels, 105);
    assert_string_equal(sonde_sequence_get(&t, 1, "Timestamp"), "0.25");
    assert_string_equal(sonde_sequence_get(&t, SONDE_WHOLE_FILE, "Operator"), "a = b: c; 50 %");
    sonde_sequence_clear(&t);
  }
  sonde_sequence_clear(&s);
}

int main(void) {
  if (!mkdtemp(folder)) return 1;
  const struct CMUnitTest tests[] = {cmocka_unit_test(a_written_sequence_is_read_back_bit_for_bit),
                                     cmocka_unit_test(pixels_turn_to_marked_far),
                                     cmocka_unit_test(frames_may_run_fastest),
                                     cmocka_unit_test(damage_is_named_with_its_line),
                                     cmocka_unit_test(no_cut_goes_unnoticed),
                                     cmocka_unit_test(transforms_join_either_way_round),
                                     cmocka_unit_test(invalid_frames_are_kept_and_not_used),
                                     cmocka_unit_test(a_picture_keeps_its_plane),
                                     cmocka_unit_test(calibration_is_read_or_named),
                                     cmocka_unit_test(blocks_of_numbers_calibrate),
                                     cmocka_unit_test(volumes_are_read_back),
                                     cmocka_unit_test(every_failed_allocation_is_reported),
                                     cmocka_unit_test(both_formats_of_a_recording_agree),
                                     cmocka_unit_test(real_files_survive_a_copy),
                                     cmocka_unit_test(unu_reads_what_we_write)};
  int failed = cmocka_run_group_tests(tests, NULL, NULL);
  char command[64];
  snprintf(command, sizeof command, "rm -r %s", folder);
  return failed || system(command) != 0;
}
