// DICOM files as a small reader here takes them apart; where they are there, dciodvfy (dicom3tools)
// must find no error and dcm2pnm (dcmtk) the very pixels.
#include "base/test.h"

#include "sonde/sweep_dicom.h"
#include "sweep/frames.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

enum { WIDTH = 23, HEIGHT = 17, FRAMES = 3 }; // an odd number of pixels

static char path[256];
static unsigned char *bytes;
static size_t count;

static void load(void) {
  FILE *file = fopen(path, "rb");
  assert_non_null(file);
  free(bytes);
  bytes = malloc(1 << 20);
  count = fread(bytes, 1, 1 << 20, file);
  fclose(file);
  assert_true(count > 140 && count < 1 << 20);
  assert_memory_equal(bytes + 128, "DICM", 4);
}

static uint32_t number(size_t at, int size) {
  uint32_t value = 0;
  for (int k = size - 1; k >= 0; --k) value = value << 8 | bytes[at + (size_t)k];
  return value;
}

// Finds an element by walking through all; tags must ascend on the top level. @return its value,
// NULL: there is none
static const unsigned char *find(uint32_t wanted, uint32_t *length) {
  uint32_t before = 0;
  int level = 0;
  for (size_t at = 132; at < count;) {
    const uint32_t tag = number(at, 2) << 16 | number(at + 2, 2);
    if (tag >> 16 == 0xfffe) { // items and their ends
      level += tag == 0xfffee000 ? 1 : tag == 0xfffee00d ? -1 : 0;
      at += 8;
      continue;
    }
    const char *vr = (const char *)bytes + at + 4;
    const bool is_long = !memcmp(vr, "OB", 2) || !memcmp(vr, "SQ", 2) || !memcmp(vr, "UT", 2);
    const size_t head = is_long ? 12 : 8;
    *length = is_long ? number(at + 8, 4) : number(at + 6, 2);
    if (level == 0) {
      assert_true(tag > before);
      before = tag;
    }
    if (tag == wanted) return bytes + at + head;
    if (!memcmp(vr, "SQ", 2))
      at += head;
    else {
      assert_int_equal(*length % 2, 0);
      at += head + *length;
    }
  }
  return NULL;
}

static void has_text(uint32_t tag, const char *expected) {
  uint32_t length = 0;
  const char *value = (const char *)find(tag, &length);
  if (!value) fail_msg("no element %08x", tag);
  char text[4096];
  assert_true(length < sizeof text);
  memcpy(text, value, length);
  while (length > 0 && (text[length - 1] == ' ' || text[length - 1] == 0)) --length;
  text[length] = 0;
  assert_string_equal(text, expected);
}

static double real(uint32_t tag) {
  uint32_t length = 0;
  const unsigned char *value = find(tag, &length);
  assert_non_null(value);
  assert_int_equal(length, 8);
  double number;
  memcpy(&number, value, 8);
  return number;
}

static uint32_t whole(uint32_t tag) {
  uint32_t length = 0;
  const unsigned char *value = find(tag, &length);
  assert_non_null(value);
  return number((size_t)(value - bytes), (int)length);
}

static uint8_t shade(uint32_t frame, uint32_t pixel) {
  return (uint8_t)(7 * pixel + 31 * frame + pixel * pixel);
}

// Frames at 0, 40 and 75.5 ms of a picture 46 mm wide and 17 mm deep.
static void make(sonde_sequence *s, double depth_m) {
  static const char *const times[FRAMES] = {"12.000000", "12.040000", "12.075500"};
  assert_int_equal(sonde_sequence_create(WIDTH, HEIGHT, FRAMES, s, NULL), SONDE_OK);
  uint8_t pixels[WIDTH * HEIGHT];
  for (uint32_t k = 0; k < FRAMES; ++k) {
    for (uint32_t i = 0; i < WIDTH * HEIGHT; ++i) pixels[i] = shade(k, i);
    sonde_image image = {.width = WIDTH,
                         .height = HEIGHT,
                         .width_m = 0.046,
                         .height_m = k == 1 ? depth_m : 0.017,
                         .pixels = pixels};
    sonde_pose pose = {{0.1, 0, 0.02 * k}, {1, 0, 0, 0}};
    assert_int_equal(sonde_sequence_set_picture(s, k, pose, &image, NULL), SONDE_OK);
    assert_int_equal(sonde_sequence_set(s, k, "Timestamp", times[k], NULL), SONDE_OK);
    assert_int_equal(sonde_sequence_set(s, k, "force_normal_n", k ? "3.5" : "0", NULL), SONDE_OK);
  }
}

// No error by dciodvfy, and the pixels of dcm2pnm.
static void others_read_it(uint32_t frames) {
  char command[700], line[400];
  if (system("command -v dciodvfy >/dev/null && command -v dcm2pnm >/dev/null") != 0) {
    print_message("not read by others: dicom3tools and dcmtk are not there\n");
    return;
  }
  snprintf(command, sizeof command, "dciodvfy %s 2>&1", path);
  FILE *said = popen(command, "r");
  bool any = false;
  while (fgets(line, sizeof line, said)) {
    if (strncmp(line, "Error", 5) == 0) fail_msg("dciodvfy: %s", line);
    any |= strstr(line, "Image") || strstr(line, "ComprehensiveSR");
  }
  pclose(said);
  assert_true(any); // it said what kind of file it is
  for (uint32_t k = 0; k < frames; ++k) {
    uint8_t read[WIDTH * HEIGHT];
    snprintf(command, sizeof command, "dcm2pnm --frame %u %s 2>/dev/null", k + 1, path);
    said = popen(command, "r");
    unsigned wide = 0, high = 0, most = 0;
    assert_int_equal(fscanf(said, "P5 %u %u %u%*1c", &wide, &high, &most), 3);
    assert_int_equal(fread(read, 1, sizeof read, said), sizeof read);
    pclose(said);
    assert_int_equal(most, 255);
    for (uint32_t i = 0; i < WIDTH * HEIGHT; ++i) assert_int_equal(read[i], shade(k, i));
  }
}

static void a_sequence_is_multi_frame(void **state) {
  (void)state;
  sonde_sequence s;
  make(&s, 0.017);
  const sonde_dicom_about about = {.study = "exam-7",
                                   .patient_id = "A\\B^C",
                                   .date = "2026-11-27T22:05:09",
                                   .title = "Kompression, Übung",
                                   .side = 'L'};
  assert_int_equal(sonde_sequence_save_dicom(path, &s, &about, NULL), SONDE_OK);
  load();
  has_text(0x00020002, "1.2.840.10008.5.1.4.1.1.3.1");
  has_text(0x00080016, "1.2.840.10008.5.1.4.1.1.3.1");
  has_text(0x00080020, "20261127");
  has_text(0x00080030, "220509");
  has_text(0x00080060, "US");
  has_text(0x0008103e, "Kompression, Übung");
  has_text(0x00100020, "A B C"); // what has a meaning in DICOM is a blank
  has_text(0x00181065, "0\\40\\35.5");
  has_text(0x00200060, "L");
  has_text(0x00280008, "3");
  assert_int_equal(whole(0x00186012), 1);
  assert_int_equal(whole(0x00186014), 1);
  assert_int_equal(whole(0x0018601c), WIDTH - 1);
  assert_int_equal(whole(0x0018601e), HEIGHT - 1);
  assert_int_equal(whole(0x00186024), 3);
  assert_float_equal(real(0x0018602c), 0.2, 1e-9);
  assert_float_equal(real(0x0018602e), 0.1, 1e-9);
  assert_int_equal(whole(0x00280010), HEIGHT);
  assert_int_equal(whole(0x00280011), WIDTH);
  uint32_t length = 0;
  const unsigned char *pixels = find(0x7fe00010, &length);
  assert_int_equal(length, FRAMES * WIDTH * HEIGHT + 1);
  assert_memory_equal(pixels, s.pixels, FRAMES * WIDTH * HEIGHT);
  assert_ptr_equal(pixels + length, bytes + count);
  const char *table = (const char *)find(0x00991001, &length);
  assert_non_null(table);
  assert_non_null(strstr(table, "force_normal_n\n"));
  others_read_it(FRAMES);

  // The same again gives the same bytes; another exam other studies, other pixels another instance.
  char study[80], instance[80];
  snprintf(study, sizeof study, "%.64s", (const char *)find(0x0020000d, &length));
  study[length] = 0;
  snprintf(instance, sizeof instance, "%.64s", (const char *)find(0x00080018, &length));
  instance[length] = 0;
  assert_int_equal(strncmp(study, "2.25.", 5), 0);
  const size_t before = count;
  unsigned char *kept = malloc(count);
  memcpy(kept, bytes, count);
  assert_int_equal(sonde_sequence_save_dicom(path, &s, &about, NULL), SONDE_OK);
  load();
  assert_int_equal(count, before);
  assert_memory_equal(bytes, kept, count);
  free(kept);
  s.pixels[5] ^= 1;
  assert_int_equal(sonde_sequence_save_dicom(path, &s, &about, NULL), SONDE_OK);
  load();
  has_text(0x0020000d, study);
  assert_int_not_equal(strncmp((const char *)find(0x00080018, &length), instance, 64), 0);
  // By the general writer too.
  assert_int_equal(sonde_sequence_save(path, &s, true, NULL), SONDE_OK);
  load();
  has_text(0x00100020, "SIMULATED");
  assert_memory_not_equal(find(0x0020000d, &length), study, 20);
  sonde_sequence_clear(&s);
}

static void a_picture_is_a_capture(void **state) {
  (void)state;
  uint8_t pixels[WIDTH * HEIGHT];
  for (uint32_t i = 0; i < WIDTH * HEIGHT; ++i) pixels[i] = shade(0, i);
  const sonde_image image = {
      .width = WIDTH, .height = HEIGHT, .width_m = 0.046, .height_m = 0.017, .pixels = pixels};
  const sonde_dicom_about about = {.study = "exam-7", .series = 2, .number = 9};
  assert_int_equal(sonde_image_save_dicom(path, &image, &about, NULL), SONDE_OK);
  load();
  has_text(0x00080016, "1.2.840.10008.5.1.4.1.1.7");
  has_text(0x00080064, "WSD");
  has_text(0x00200011, "2");
  has_text(0x00200013, "9");
  has_text(0x00280030, "1\\2"); // rows, then columns, mm
  assert_float_equal(real(0x0018602c), 0.2, 1e-9);
  others_read_it(1);
}

static void findings_are_a_report(void **state) {
  (void)state;
  uint8_t pixels[WIDTH * HEIGHT] = {7};
  const sonde_image image = {
      .width = WIDTH, .height = HEIGHT, .width_m = 0.046, .height_m = 0.017, .pixels = pixels};
  const sonde_dicom_about about = {.study = "exam-7", .date = "2026-11-27T22:05:09", .series = 3};
  const sonde_dicom_about picture = {.study = "exam-7", .series = 2};
  sonde_dicom_item items[] = {
      {.kind = SONDE_DICOM_CONTAINER, .name = {"125100", "DCM", "Report"}},
      {.level = 1, .kind = SONDE_DICOM_CONTAINER, .name = {"121070", "DCM", "Findings"}},
      {.level = 2,
       .kind = SONDE_DICOM_PICTURE,
       .name = {"with", SONDE_DICOM_SCHEME, "With"},
       .image = &image,
       .image_about = &picture},
      {.level = 3,
       .relation = SONDE_DICOM_ACQUIRED,
       .kind = SONDE_DICOM_NUMBER,
       .name = {"force", SONDE_DICOM_SCHEME, "Force"},
       .number = 2.5,
       .code = {"N", "UCUM", "newton"}},
      {.level = 1,
       .kind = SONDE_DICOM_TEXT,
       .name = {"121073", "DCM", "Impression"},
       .text = "One\ttwo."}};
  const uint32_t all = sizeof items / sizeof *items;
  sonde_error error = {0};
  char instance[64], study[64];
  uint32_t length = 0;
  assert_int_equal(sonde_image_save_dicom(path, &image, &picture, NULL), SONDE_OK);
  load();
  memcpy(instance, find(0x00080018, &length), 30);
  memcpy(study, find(0x0020000d, &length), 30);
  assert_int_equal(sonde_report_save_dicom(path, items, all, &about, NULL), SONDE_OK);
  load();
  has_text(0x00080016, "1.2.840.10008.5.1.4.1.1.88.33");
  has_text(0x00080060, "SR");
  has_text(0x00080023, "20261127");
  has_text(0x0040a491, "COMPLETE");
  assert_memory_equal(find(0x0020000d, &length), study, 30);
  assert_memory_equal(find(0x00081155, &length), instance, 30); // the picture's own file
  has_text(0x0040a30a, "2.5");
  has_text(0x0040a160, "One two."); // no control characters
  assert_null(find(0x7fe00010, &length));
  memcpy(instance, find(0x00080018, &length), 30);
  // What stands elsewhere is another report.
  items[4].level = 2;
  assert_int_equal(sonde_report_save_dicom(path, items, all, &about, NULL), SONDE_OK);
  load();
  assert_memory_not_equal(find(0x00080018, &length), instance, 30);
  others_read_it(0);
  const sonde_dicom_about bare = {.study = "exam-7"};
  assert_int_equal(sonde_report_save_dicom(path, items, all, &bare, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "needs a date"));
}

static void what_does_not_fit_is_refused(void **state) {
  (void)state;
  sonde_sequence s;
  sonde_error error = {0};
  make(&s, 0.02);
  (void)remove(path);
  assert_int_equal(sonde_sequence_save_dicom(path, &s, NULL, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "depth of the picture changes at frame 1, 12.040 s"));
  sonde_sequence_clear(&s);
  assert_int_equal(sonde_sequence_create(WIDTH, HEIGHT, 1, &s, NULL), SONDE_OK);
  assert_int_equal(sonde_sequence_save_dicom(path, &s, NULL, &error), SONDE_ARGUMENT);
  assert_non_null(strstr(error.message, "frame 0 has no ImageToProbeTransform"));
  sonde_sequence_clear(&s);
  assert_int_equal(access(path, F_OK), -1);
}

int main(void) {
  snprintf(path, sizeof path, "%s/test_dicom_%d.dcm", SONDE_BINARY_DIR, (int)getpid());
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_sequence_is_multi_frame),
      cmocka_unit_test(a_picture_is_a_capture),
      cmocka_unit_test(findings_are_a_report),
      cmocka_unit_test(what_does_not_fit_is_refused),
  };
  int failed = cmocka_run_group_tests(tests, NULL, NULL);
  (void)remove(path);
  free(bytes);
  return failed;
}
