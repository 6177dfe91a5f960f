// DICOM files (PS3.3: C.8.5.6 US image, C.8.5.5 region calibration, C.7.6.5 cine, C.8.6 secondary
// capture, A.35.3 and C.17 structured reports; PS3.10: file meta information), written element by
// element in ascending order.
#include "sonde/sweep_dicom.h"
#include "sweep/frames.h"

#include "base/bytes.h"

#include <math.h>
#include <stdlib.h>

#define SOP_MULTI_FRAME "1.2.840.10008.5.1.4.1.1.3.1"
#define SOP_CAPTURE "1.2.840.10008.5.1.4.1.1.7"
#define SOP_REPORT "1.2.840.10008.5.1.4.1.1.88.33"
#define EXPLICIT_LITTLE_ENDIAN "1.2.840.10008.1.2.1"
// The writer's own UID: 2.25 and a number drawn once as a UUID.
#define WRITER_UID "2.25.168467337209794526893075871351557681806"

enum {
  SHORT_MOST = 65534, // bytes of a value whose length has 16 bits
  META_BYTES = 512,   // room for the file meta information
  UID_TEXT = 65,      // 64 characters
  TEXT_MOST = 64,     // characters of a name or an identifier
  CENTIMETRES = 3,    // physical unit of a region
};

static const uint32_t UNDEFINED_LENGTH = 0xffffffff; // items end by a mark
// Marks of a sequence's items as they stand in the file: group first.
static const uint32_t ITEM = 0xe000fffe, ITEM_ENDS = 0xe00dfffe, SEQUENCE_ENDS = 0xe0ddfffe;

// Head of an element: its tag, its kind, its length in bytes.
static void put_head(bytes_cursor *out, uint32_t tag, const char vr[2], uint32_t length) {
  bytes_u16(out, (uint16_t)(tag >> 16));
  bytes_u16(out, (uint16_t)(tag & 0xffff));
  bytes_put(out, vr, 2);
  // Value representations whose length takes 32 bits.
  static const char long_ones[][3] = {"OB", "SQ", "UN", "UT"};
  bool is_long = false;
  for (size_t k = 0; k < SONDE_COUNT_OF(long_ones); ++k)
    is_long = is_long || memcmp(vr, long_ones[k], 2) == 0;
  if (is_long) {
    bytes_u16(out, 0);
    bytes_u32(out, length);
  } else {
    SONDE_ASSERT(length <= SHORT_MOST);
    bytes_u16(out, (uint16_t)length);
  }
}

// A text, filled up to an even length: a UID by a zero, others by a blank.
static void put_text(bytes_cursor *out, uint32_t tag, const char vr[2], const char *text) {
  const size_t length = strlen(text), odd = length % 2;
  put_head(out, tag, vr, (uint32_t)(length + odd));
  bytes_put(out, text, length);
  bytes_put(out, memcmp(vr, "UI", 2) == 0 ? "" : " ", odd);
}

static void put_short(bytes_cursor *out, uint32_t tag, uint32_t value) {
  put_head(out, tag, "US", 2);
  bytes_u16(out, (uint16_t)value);
}

static void put_long(bytes_cursor *out, uint32_t tag, uint32_t value) {
  put_head(out, tag, "UL", 4);
  bytes_u32(out, value);
}

static void put_real(bytes_cursor *out, uint32_t tag, double value) {
  put_head(out, tag, "FD", 8);
  bytes_f64(out, value);
}

static void put_number(bytes_cursor *out, uint32_t tag, uint64_t value) {
  char text[24];
  snprintf(text, sizeof text, "%llu", (unsigned long long)value);
  put_text(out, tag, "IS", text);
}

static void put_mark(bytes_cursor *out, uint32_t mark) {
  bytes_u32(out, mark);
  bytes_u32(out, mark == ITEM ? UNDEFINED_LENGTH : 0);
}

// A sequence and its first item; what follows stands in it until end_sequence().
static void begin_sequence(bytes_cursor *out, uint32_t tag) {
  put_head(out, tag, "SQ", UNDEFINED_LENGTH);
  put_mark(out, ITEM);
}

static void end_sequence(bytes_cursor *out) {
  put_mark(out, ITEM_ENDS);
  put_mark(out, SEQUENCE_ENDS);
}

static void put_code(bytes_cursor *out, uint32_t tag, const sonde_dicom_code *code) {
  SONDE_ASSERT(code->value && code->scheme && code->meaning && strlen(code->value) <= 16);
  begin_sequence(out, tag);
  put_text(out, 0x00080100, "SH", code->value);
  put_text(out, 0x00080102, "SH", code->scheme);
  put_text(out, 0x00080104, "LO", code->meaning);
  end_sequence(out);
}

// 2.25 and a 128-bit number in decimal, with the bits of a UUID that say how it was made (8: of its
// maker's own).
static void make_uid(uint64_t seed, const char *what, char uid[UID_TEXT]) {
  const uint64_t high = sonde_hash(seed, what, strlen(what)), low = sonde_hash(high, what, 1);
  unsigned __int128 number = (unsigned __int128)((high & ~(uint64_t)0xf000) | 0x8000) << 64 |
                             ((low & ~((uint64_t)3 << 62)) | (uint64_t)1 << 63);
  char digits[40];
  int count = 0;
  for (; number > 0; number /= 10) digits[count++] = (char)('0' + (int)(number % 10));
  memcpy(uid, "2.25.", 5);
  for (int k = 0; k < count; ++k) uid[5 + k] = digits[count - 1 - k];
  uid[5 + count] = 0;
}

// A text of at most 64 characters, cut between characters, without what DICOM gives a meaning.
static void tidy(char kept[4 * TEXT_MOST + 1], const char *text) {
  size_t used = 0;
  int characters = 0;
  for (; *text; ++text) {
    const bool begins = ((unsigned char)*text & 0xc0) != 0x80;
    if (begins && characters++ == TEXT_MOST) break;
    if (used == 4 * TEXT_MOST) break;
    kept[used++] = (unsigned char)*text < 32 || strchr("\\^=", *text) ? ' ' : *text;
  }
  kept[used] = 0;
}

static const sonde_dicom_about NOTHING;

// What all kinds of files need.
typedef struct dicom_file {
  const sonde_dicom_about *about;
  const char *sop; // class
  uint32_t width, height, count;
  double width_m, height_m;   // of a pixel
  char times[SHORT_MOST + 1]; // of a multi-frame: ms since the frame before, between backslashes
  const char *table;          // of the fields of its frames
  const uint8_t *pixels;      // NULL: a report
} dicom_file;

// UIDs of instance, study and series.
typedef struct dicom_uids {
  char instance[UID_TEXT], study[UID_TEXT], series[UID_TEXT];
} dicom_uids;

// The UIDs of a file with a content.
static void make_uids(const dicom_file *f, uint64_t content, dicom_uids *uids) {
  const sonde_dicom_about *about = f->about;
  const uint64_t study = about->study ? sonde_hash(0, about->study, strlen(about->study)) : content;
  make_uid(sonde_hash(study, &content, sizeof content), "instance", uids->instance);
  make_uid(study, "study", uids->study);
  make_uid(sonde_hash(study, &about->series, sizeof about->series), f->sop, uids->series);
}

static size_t pixel_bytes(const dicom_file *f) {
  return (size_t)f->width * f->height * (f->count ? f->count : 1);
}

static void make_picture_uids(const dicom_file *f, dicom_uids *uids) {
  uint64_t content =
      sonde_hash(sonde_hash(0, f->pixels, pixel_bytes(f)), f->times, strlen(f->times));
  if (f->table) content = sonde_hash(content, f->table, strlen(f->table));
  make_uids(f, sonde_hash(content, &f->width_m, sizeof f->width_m), uids);
}

// Patient, study and series, up to the group of acquisition.
static void put_identity(bytes_cursor *out, const dicom_file *f, const dicom_uids *uids) {
  const sonde_dicom_about *about = f->about;
  const bool moves = f->count > 0, report = !f->pixels;
  char day[9] = "", time[7] = "", text[4 * TEXT_MOST + 1];
  unsigned n[6];
  if (about->date && sscanf(about->date, "%4u-%2u-%2u%*c%2u:%2u:%2u", &n[0], &n[1], &n[2], &n[3],
                            &n[4], &n[5]) == 6) {
    snprintf(day, sizeof day, "%04u%02u%02u", n[0] % 10000, n[1] % 100, n[2] % 100);
    snprintf(time, sizeof time, "%02u%02u%02u", n[3] % 100, n[4] % 100, n[5] % 100);
  }
  put_text(out, 0x00080005, "CS", "ISO_IR 192"); // UTF-8
  if (!report)
    put_text(out, 0x00080008, "CS",
             moves ? "ORIGINAL\\PRIMARY\\VASCULAR\\0001" : "DERIVED\\SECONDARY");
  put_text(out, 0x00080016, "UI", f->sop);
  put_text(out, 0x00080018, "UI", uids->instance);
  put_text(out, 0x00080020, "DA", day);
  put_text(out, 0x00080023, "DA", day);
  put_text(out, 0x00080030, "TM", time);
  put_text(out, 0x00080033, "TM", time);
  put_text(out, 0x00080050, "SH", "");
  put_text(out, 0x00080060, "CS", report ? "SR" : "US");
  if (!moves && !report) put_text(out, 0x00080064, "CS", "WSD"); // made on a workstation
  put_text(out, 0x00080070, "LO", "Sonde");
  put_text(out, 0x00080090, "PN", "");
  if (report) { // whose codes the house's own are
    begin_sequence(out, 0x00080110);
    put_text(out, 0x00080102, "SH", SONDE_DICOM_SCHEME);
    put_text(out, 0x00080115, "ST", "Words of Sonde");
    put_text(out, 0x00080116, "ST", "Sonde");
    end_sequence(out);
  }
  tidy(text, about->title ? about->title : "");
  put_text(out, 0x0008103e, "LO", text);
  put_text(out, 0x00081090, "LO", "Simulated scanner");
  if (report) put_head(out, 0x00081111, "SQ", 0);
  tidy(text, about->patient_id && about->patient_id[0] ? about->patient_id : "SIMULATED");
  put_text(out, 0x00100010, "PN", "Simulated^Patient");
  put_text(out, 0x00100020, "LO", text);
  put_text(out, 0x00100030, "DA", "");
  put_text(out, 0x00100040, "CS", "");
}

// Where the file belongs: study, series and its number there.
static void put_place(bytes_cursor *out, const dicom_file *f, const dicom_uids *uids) {
  put_text(out, 0x0020000d, "UI", uids->study);
  put_text(out, 0x0020000e, "UI", uids->series);
  put_text(out, 0x00200010, "SH", "");
  put_number(out, 0x00200011, f->about->series ? f->about->series : 1);
  put_number(out, 0x00200013, f->about->number ? f->about->number : 1);
}

// Everything before the pixels.
static void put_dataset(bytes_cursor *out, const dicom_file *f, const dicom_uids *uids) {
  const bool moves = f->count > 0;
  put_identity(out, f, uids);
  put_text(out, 0x00181020, "LO", sonde_version());
  if (moves) put_text(out, 0x00181065, "DS", f->times);
  // The whole picture is a region of tissue with a length for each pixel.
  begin_sequence(out, 0x00186011);
  put_short(out, 0x00186012, 1); // 2D
  put_short(out, 0x00186014, 1); // tissue
  put_long(out, 0x00186016, 0);
  put_long(out, 0x00186018, 0);
  put_long(out, 0x0018601a, 0);
  put_long(out, 0x0018601c, f->width - 1);
  put_long(out, 0x0018601e, f->height - 1);
  put_short(out, 0x00186024, CENTIMETRES);
  put_short(out, 0x00186026, CENTIMETRES);
  put_real(out, 0x0018602c, 100 * f->width_m);
  put_real(out, 0x0018602e, 100 * f->height_m);
  end_sequence(out);
  put_place(out, f, uids);
  put_text(out, 0x00200020, "CS", "");
  put_text(out, 0x00200060, "CS", (const char[2]){f->about->side, 0});
  put_short(out, 0x00280002, 1);
  put_text(out, 0x00280004, "CS", "MONOCHROME2");
  if (moves) {
    put_number(out, 0x00280008, f->count);
    put_head(out, 0x00280009, "AT", 4); // frames follow each other by the vector of their times
    bytes_u32(out, 0x10650018);
  }
  put_short(out, 0x00280010, f->height);
  put_short(out, 0x00280011, f->width);
  if (!moves) {
    char text[64];
    snprintf(text, sizeof text, "%.9g\\%.9g", 1e3 * f->height_m, 1e3 * f->width_m);
    put_text(out, 0x00280030, "DS", text);
  }
  put_short(out, 0x00280100, 8);
  put_short(out, 0x00280101, 8);
  put_short(out, 0x00280102, 7);
  put_short(out, 0x00280103, 0);
  put_text(out, 0x00280301, "CS", "NO");
  put_text(out, 0x00282110, "CS", "00");
  if (f->table) {
    put_text(out, 0x00990010, "LO", "SONDE FRAMES");
    put_text(out, 0x00991001, "UT", f->table);
  }
}

// The meta information, whose length stands at its beginning.
static size_t put_meta(unsigned char meta[META_BYTES], const dicom_file *f,
                       const dicom_uids *uids) {
  bytes_cursor head = {meta, META_BYTES, 0};
  for (int k = 0; k < 128; ++k) bytes_put(&head, "", 1);
  bytes_put(&head, "DICM", 4);
  const size_t length_at = head.count;
  put_long(&head, 0x00020000, 0);
  const size_t begin = head.count;
  put_head(&head, 0x00020001, "OB", 2);
  bytes_u16(&head, 0x0100);
  put_text(&head, 0x00020002, "UI", f->sop);
  put_text(&head, 0x00020003, "UI", uids->instance);
  put_text(&head, 0x00020010, "UI", EXPLICIT_LITTLE_ENDIAN);
  put_text(&head, 0x00020012, "UI", WRITER_UID);
  SONDE_ASSERT(bytes_fit(&head));
  bytes_cursor length = {meta + length_at, 12, 0};
  put_long(&length, 0x00020000, (uint32_t)(head.count - begin));
  return head.count;
}

static sonde_status write_file(const char *path, const dicom_file *f, sonde_error *error) {
  const size_t pixels = pixel_bytes(f);
  if (f->width > UINT16_MAX || f->height > UINT16_MAX || pixels > 0xfffffffe)
    return sonde_fail(
        error, SONDE_ARGUMENT,
        "%u frames of %u x %u pixels: a DICOM file takes 4 GiB, expected a shorter part", f->count,
        f->width, f->height);
  dicom_uids uids;
  unsigned char meta[META_BYTES];
  make_picture_uids(f, &uids);
  const size_t meta_count = put_meta(meta, f, &uids);
  bytes_cursor measure = {NULL, 0, 0};
  put_dataset(&measure, f, &uids);
  put_head(&measure, 0x7fe00010, "OB", 0);
  bytes_cursor set = {SONDE_NEW(unsigned char, measure.count), measure.count, 0};
  if (!set.bytes) return sonde_fail_memory(error);
  put_dataset(&set, f, &uids);
  put_head(&set, 0x7fe00010, "OB", (uint32_t)(pixels + pixels % 2));
  sonde_file *file = NULL;
  sonde_status status = sonde_file_create(path, &file, error);
  if (!status) {
    sonde_file_write(file, meta, meta_count);
    sonde_file_write(file, set.bytes, set.count);
    sonde_file_write(file, f->pixels, pixels);
    sonde_file_write(file, "", pixels % 2);
    status = sonde_file_commit(file, error);
  }
  sonde_free(set.bytes);
  return status;
}

// Size of a frame's pixels from its transform, m. False: it has none that can be read.
static bool pixel_size(const sonde_sequence *s, uint32_t frame, double size_m[2]) {
  const char *text = sonde_sequence_get(s, frame, "ImageToProbeTransform");
  double m[12];
  for (int k = 0; k < 12; ++k) {
    const char *end = text;
    if (text) m[k] = sonde_parse_real(text, &end);
    if (!text || end == text) return false;
    text = end + strspn(end, " ");
  }
  for (int k = 0; k < 2; ++k)
    size_m[k] = 1e-3 * sqrt(m[k] * m[k] + m[4 + k] * m[4 + k] + m[8 + k] * m[8 + k]);
  return size_m[0] > 0 && size_m[1] > 0;
}

sonde_status sonde_sequence_save_dicom(const char *path, const sonde_sequence *s,
                                       const sonde_dicom_about *about, sonde_error *error) {
  SONDE_ASSERT(path && s && s->count > 0 && s->pixels);
  dicom_file *f = SONDE_NEW(dicom_file, 1);
  if (!f) return sonde_fail_memory(error);
  *f = (dicom_file){.about = about ? about : &NOTHING,
                    .sop = SOP_MULTI_FRAME,
                    .width = s->width,
                    .height = s->height,
                    .count = s->count,
                    .pixels = s->pixels};
  sonde_status status = SONDE_OK;
  double before_s = 0, size_m[2] = {0};
  size_t used = 0;
  for (uint32_t i = 0; i < s->count && !status; ++i) {
    const char *stamp = sonde_sequence_get(s, i, "Timestamp"), *end;
    const double time_s = stamp ? sonde_parse_real(stamp, &end) : i / 25.0;
    if (!pixel_size(s, i, size_m))
      status =
          sonde_fail(error, SONDE_ARGUMENT,
                     "%.200s: frame %u has no ImageToProbeTransform, which gives the size of a "
                     "pixel",
                     path, i);
    if (!status && i == 0) f->width_m = size_m[0], f->height_m = size_m[1];
    if (!status && (fabs(size_m[0] - f->width_m) > 1e-6 * f->width_m ||
                    fabs(size_m[1] - f->height_m) > 1e-6 * f->height_m))
      status = sonde_fail(error, SONDE_ARGUMENT,
                          "%.200s: the depth of the picture changes at frame %u, %.3f s; a DICOM "
                          "file has one size of pixels, expected a part with one depth",
                          path, i, time_s);
    const double step_ms = i ? fmax(1e3 * (time_s - before_s), 0) : 0;
    before_s = time_s;
    if (used + 16 > SHORT_MOST && !status)
      status = sonde_fail(error, SONDE_ARGUMENT,
                          "%.200s: %u frames, more than the times of one DICOM file; expected a "
                          "shorter part",
                          path, s->count);
    if (!status)
      used += (size_t)snprintf(f->times + used, sizeof f->times - used, "%s%.6g", i ? "\\" : "",
                               round(1e3 * step_ms) / 1e3);
  }
  // The fields of all frames as a table: CSV, the names are those of the first frame.
  char *table = NULL;
  sonde_file *file = NULL;
  const sonde_tracked_frame *first = &s->frames[0];
  if (!status) status = sonde_file_in_memory(&file, error);
  for (uint32_t k = 0; !status && k < first->field_count; ++k)
    sonde_file_printf(file, "%s%s", k ? "," : "", first->fields[k].key);
  for (uint32_t i = 0; i < s->count && !status; ++i)
    for (uint32_t k = 0; k < first->field_count; ++k) {
      const char *value = sonde_sequence_get(s, i, first->fields[k].key);
      sonde_file_printf(file, "%s%s", k ? "," : "\n", value ? value : "");
    }
  if (!status) status = sonde_file_take(file, &table, &used, error);
  f->table = table;
  if (!status) status = write_file(path, f, error);
  sonde_free(table);
  sonde_free(f);
  return status;
}

static void fill_capture(dicom_file *f, const sonde_image *image, const sonde_dicom_about *about) {
  SONDE_ASSERT(image && image->pixels && image->width > 0 && image->height > 0 &&
               image->width_m > 0 && image->height_m > 0);
  *f = (dicom_file){.about = about ? about : &NOTHING,
                    .sop = SOP_CAPTURE,
                    .width = image->width,
                    .height = image->height,
                    .width_m = image->width_m / image->width,
                    .height_m = image->height_m / image->height,
                    .pixels = image->pixels};
}

sonde_status sonde_image_save_dicom(const char *path, const sonde_image *image,
                                    const sonde_dicom_about *about, sonde_error *error) {
  SONDE_ASSERT(path);
  dicom_file *f = SONDE_NEW(dicom_file, 1);
  if (!f) return sonde_fail_memory(error);
  fill_capture(f, image, about);
  sonde_status status = write_file(path, f, error);
  sonde_free(f);
  return status;
}

// ---- structured reports

// What an item says, without what stands below it.
static void put_item(bytes_cursor *out, const sonde_dicom_item *item, const dicom_uids *picture) {
  static const char *const KINDS[] = {"CONTAINER", "TEXT", "CODE", "NUM", "IMAGE"};
  static const char *const RELATIONS[] = {"CONTAINS", "HAS OBS CONTEXT", "HAS CONCEPT MOD",
                                          "HAS PROPERTIES", "HAS ACQ CONTEXT"};
  if (item->kind == SONDE_DICOM_PICTURE) {
    begin_sequence(out, 0x00081199);
    put_text(out, 0x00081150, "UI", SOP_CAPTURE);
    put_text(out, 0x00081155, "UI", picture->instance);
    end_sequence(out);
  }
  if (item->level > 0) put_text(out, 0x0040a010, "CS", RELATIONS[item->relation]);
  put_text(out, 0x0040a040, "CS", KINDS[item->kind]);
  put_code(out, 0x0040a043, &item->name);
  if (item->kind == SONDE_DICOM_CONTAINER) put_text(out, 0x0040a050, "CS", "SEPARATE");
  if (item->kind == SONDE_DICOM_TEXT) {
    const size_t length = strlen(item->text);
    put_head(out, 0x0040a160, "UT", (uint32_t)(length + length % 2));
    for (size_t k = 0; k < length; ++k) {
      const unsigned char c = (unsigned char)item->text[k];
      bytes_put(out, c < 32 && c != '\n' ? " " : &item->text[k], 1);
    }
    bytes_put(out, " ", length % 2);
  }
  if (item->kind == SONDE_DICOM_CODE) put_code(out, 0x0040a168, &item->code);
  if (item->kind == SONDE_DICOM_NUMBER) {
    char number[24];
    snprintf(number, sizeof number, "%.9g", item->number);
    begin_sequence(out, 0x0040a300);
    put_code(out, 0x004008ea, &item->code);
    put_text(out, 0x0040a30a, "DS", number);
    end_sequence(out);
  }
}

// All items below the first; one stands in the nearest before it of a lower level.
static void put_content(bytes_cursor *out, const sonde_dicom_item *items, uint32_t count,
                        const dicom_uids *pictures) {
  uint32_t level = 0;
  for (uint32_t i = 1; i <= count; ++i) {
    const uint32_t next = i < count ? items[i].level : 0;
    SONDE_ASSERT(i == count || (next > 0 && next <= level + 1));
    if (next > level) put_head(out, 0x0040a730, "SQ", UNDEFINED_LENGTH);
    for (; level >= next && level > 0; --level) {
      put_mark(out, ITEM_ENDS);
      if (level > next) put_mark(out, SEQUENCE_ENDS);
    }
    if (i == count) break;
    level = next;
    put_mark(out, ITEM);
    put_item(out, &items[i], &pictures[i]);
  }
}

// Everything before the items below the first one.
static void put_report(bytes_cursor *out, const dicom_file *f, const dicom_uids *uids,
                       const sonde_dicom_item *items, uint32_t count, const dicom_uids *pictures) {
  put_identity(out, f, uids);
  put_text(out, 0x00181020, "LO", sonde_version());
  put_place(out, f, uids);
  put_item(out, &items[0], NULL);
  put_head(out, 0x0040a372, "SQ", 0);
  const dicom_uids *first = NULL;
  for (uint32_t i = 0; i < count; ++i) {
    if (items[i].kind != SONDE_DICOM_PICTURE) continue;
    if (!first) {
      first = &pictures[i];
      begin_sequence(out, 0x0040a375);
      begin_sequence(out, 0x00081115);
      put_head(out, 0x00081199, "SQ", UNDEFINED_LENGTH);
    }
    put_mark(out, ITEM);
    put_text(out, 0x00081150, "UI", SOP_CAPTURE);
    put_text(out, 0x00081155, "UI", pictures[i].instance);
    put_mark(out, ITEM_ENDS);
  }
  if (first) {
    put_mark(out, SEQUENCE_ENDS);
    put_text(out, 0x0020000e, "UI", first->series);
    end_sequence(out);
    put_text(out, 0x0020000d, "UI", first->study);
    end_sequence(out);
  }
  put_text(out, 0x0040a491, "CS", "COMPLETE");
  put_text(out, 0x0040a493, "CS", "UNVERIFIED");
}

sonde_status sonde_report_save_dicom(const char *path, const sonde_dicom_item *items,
                                     uint32_t count, const sonde_dicom_about *about,
                                     sonde_error *error) {
  SONDE_ASSERT(path && items && count > 1 && items[0].kind == SONDE_DICOM_CONTAINER && about);
  if (!about->date || strlen(about->date) < 19)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "%.200s: a structured report needs a date and a time, found none", path);
  dicom_file *f = SONDE_NEW(dicom_file, 1);
  dicom_uids uids, *pictures = SONDE_NEW(dicom_uids, count);
  unsigned char *bytes = NULL, meta[META_BYTES];
  sonde_file *file = NULL;
  sonde_status status = f && pictures ? SONDE_OK : sonde_fail_memory(error);
  for (uint32_t i = 0; i < count && !status; ++i)
    if (items[i].kind == SONDE_DICOM_PICTURE) {
      fill_capture(f, items[i].image, items[i].image_about);
      make_picture_uids(f, &pictures[i]);
    }
  if (!status) {
    *f = (dicom_file){.about = about, .sop = SOP_REPORT};
    bytes_cursor measure = {NULL, 0, 0};
    make_uids(f, 0, &uids); // as long as at last, or longer
    put_content(&measure, items, count, pictures);
    bytes = SONDE_NEW(unsigned char, measure.count);
    if (!bytes) status = sonde_fail_memory(error);
    bytes_cursor content = {bytes, measure.count, 0};
    if (!status) {
      put_content(&content, items, count, pictures);
      make_uids(f, sonde_hash(0, bytes, content.count), &uids);
      status = sonde_file_create(path, &file, error);
    }
    if (!status) {
      bytes_cursor size = {NULL, 0, 0};
      put_report(&size, f, &uids, items, count, pictures);
      bytes_cursor set = {SONDE_NEW(unsigned char, size.count), size.count, 0};
      if (!set.bytes) status = sonde_fail_memory(error);
      if (!status) {
        put_report(&set, f, &uids, items, count, pictures);
        sonde_file_write(file, meta, put_meta(meta, f, &uids));
        sonde_file_write(file, set.bytes, set.count);
        sonde_file_write(file, bytes, content.count);
        status = sonde_file_commit(file, error);
      } else {
        sonde_file_discard(file);
      }
      sonde_free(set.bytes);
    }
  }
  sonde_free(bytes);
  sonde_free(pictures);
  sonde_free(f);
  return status;
}
