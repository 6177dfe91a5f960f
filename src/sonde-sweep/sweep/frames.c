// Sequences in memory and their files.
#include "sweep/frames.h"
#include "sonde/sweep_dicom.h"

#include <string.h>

static size_t pixel_count(const sonde_sequence *s) {
  return (size_t)s->width * s->height * s->count;
}

sonde_status sonde_sequence_create(uint32_t width, uint32_t height, uint32_t count,
                                   sonde_sequence *s, sonde_error *error) {
  SONDE_ASSERT(s != NULL);
  *s = (sonde_sequence){0};
  if (width > SONDE_SIDE_MAX || height > SONDE_SIDE_MAX || count < 1 || count > SONDE_FRAMES_MAX)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "%u frames of %u x %u pixels; expected 1 to %d frames of at most %d x %d",
                      count, width, height, SONDE_FRAMES_MAX, SONDE_SIDE_MAX, SONDE_SIDE_MAX);
  *s = (sonde_sequence){.width = width, .height = height, .count = count};
  snprintf(s->orientation, sizeof s->orientation, "MFA");
  s->clip[2] = width, s->clip[3] = height;
  s->frames = SONDE_NEW(sonde_tracked_frame, count);
  s->pixels = SONDE_NEW(uint8_t, pixel_count(s));
  if (s->frames && s->pixels) return SONDE_OK;
  sonde_sequence_clear(s);
  return sonde_fail_memory(error);
}

static void clear_fields(sonde_tracked_frame *frame) {
  for (uint32_t i = 0; i < frame->field_count; ++i) sonde_free(frame->fields[i].key);
  sonde_free(frame->fields);
}

void sonde_sequence_clear(sonde_sequence *s) {
  if (!s) return;
  clear_fields(&s->file);
  for (uint32_t i = 0; s->frames && i < s->count; ++i) clear_fields(&s->frames[i]);
  sonde_free(s->frames);
  sonde_free(s->pixels);
  *s = (sonde_sequence){0};
}

static sonde_tracked_frame *owner_of(const sonde_sequence *s, uint32_t frame) {
  SONDE_ASSERT(frame == SONDE_WHOLE_FILE || frame < s->count);
  return frame == SONDE_WHOLE_FILE ? (sonde_tracked_frame *)(uintptr_t)&s->file : &s->frames[frame];
}

static sonde_field *find_field(const sonde_tracked_frame *owner, const char *key) {
  for (uint32_t i = 0; i < owner->field_count; ++i)
    if (strcmp(owner->fields[i].key, key) == 0) return &owner->fields[i];
  return NULL;
}

const char *sonde_sequence_get(const sonde_sequence *s, uint32_t frame, const char *key) {
  SONDE_ASSERT(s != NULL && key != NULL);
  const sonde_field *field = find_field(owner_of(s, frame), key);
  return field ? field->value : NULL;
}

static sonde_status check_text(const char *text, const char *forbidden, sonde_error *error) {
  size_t length = strlen(text);
  bool good = length <= SONDE_VALUE_MAX / 2 && text[strcspn(text, forbidden)] == 0;
  for (size_t i = 0; i < length; ++i) good &= (unsigned char)text[i] >= 32 || text[i] == '\t';
  if (length) good &= !strchr(" \t", text[0]) && !strchr(" \t", text[length - 1]);
  if (good) return SONDE_OK;
  return sonde_fail(error, SONDE_ARGUMENT,
                    "field '%.60s': expected one line without blanks at its ends%s%s", text,
                    *forbidden ? " and without any of " : "", forbidden);
}

sonde_status sonde_sequence_set(sonde_sequence *s, uint32_t frame, const char *key,
                                const char *value, sonde_error *error) {
  SONDE_ASSERT(s != NULL && key != NULL && value != NULL);
  sonde_tracked_frame *owner = owner_of(s, frame);
  sonde_status status = check_text(key, "=:", error);
  if (!status) status = check_text(value, "", error);
  if (status) return status;
  if (!*key || sonde_metaimage_owns(key) || sonde_nrrd_owns(key))
    return sonde_fail(error, SONDE_ARGUMENT, "field '%.60s': that name describes the pixels", key);
  sonde_field *field = find_field(owner, key);
  if (!field && owner->field_count == SONDE_FIELDS_MAX)
    return sonde_fail(error, SONDE_ARGUMENT, "field '%.60s': expected at most %d fields", key,
                      SONDE_FIELDS_MAX);
  size_t key_bytes = strlen(key) + 1, value_bytes = strlen(value) + 1;
  if (!field && owner->field_count == owner->field_room) {
    uint32_t room = owner->field_room ? 2 * owner->field_room : 8;
    void *grown = sonde_realloc(owner->fields, owner->field_room * sizeof *owner->fields,
                                room * sizeof *owner->fields);
    if (!grown) return sonde_fail_memory(error);
    owner->fields = grown;
    owner->field_room = room;
  }
  char *text = SONDE_NEW(char, key_bytes + value_bytes);
  if (!text) return sonde_fail_memory(error);
  memcpy(text, key, key_bytes);
  memcpy(text + key_bytes, value, value_bytes);
  if (field) sonde_free(field->key);
  if (!field) field = &owner->fields[owner->field_count++];
  *field = (sonde_field){text, text + key_bytes};
  return SONDE_OK;
}

sonde_status sonde_sequence_set_transform(sonde_sequence *s, uint32_t frame, const char *name,
                                          const sonde_affine *a, sonde_error *error) {
  SONDE_ASSERT(s != NULL && name != NULL && a != NULL);
  char key[96], value[512];
  int used = 0;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 4; ++k)
      used += snprintf(value + used, sizeof value - (size_t)used, "%.12g ", a->m[i][k]);
  snprintf(value + used, sizeof value - (size_t)used, "0 0 0 1");
  snprintf(key, sizeof key, "%.70sTransform", name);
  sonde_status status = sonde_sequence_set(s, frame, key, value, error);
  snprintf(key, sizeof key, "%.70sTransformStatus", name);
  return status ? status : sonde_sequence_set(s, frame, key, "OK", error);
}

static sonde_status read_field(const sonde_header *h, const sonde_header_entry *e,
                               sonde_sequence *s, sonde_error *error) {
  // Seq_Frame0012_Name belongs to frame 12, any other key to the file.
  static const char prefix[] = "Seq_Frame";
  const char *key = e->key, *digits = key + sizeof prefix - 1;
  bool framed = strncmp(key, prefix, sizeof prefix - 1) == 0;
  size_t length = framed ? strspn(digits, "0123456789") : 0;
  framed = length >= 1 && length <= 9 && digits[length] == '_' && digits[length + 1];
  uint64_t number = 0;
  for (size_t i = 0; framed && i < length; ++i) number = 10 * number + (uint64_t)(digits[i] - '0');
  if (framed) key = digits + length + 1;
  if (framed && number >= s->count)
    return sonde_fail(error, SONDE_FORMAT, "%.200s:%u: %.60s: expected frames 0 to %u", h->path,
                      e->line, e->key, s->count - 1);
  if (!framed && (h->nrrd ? sonde_nrrd_owns(key) : sonde_metaimage_owns(key))) return SONDE_OK;
  if (!framed && strcmp(key, "ultrasound image type") == 0) key = "UltrasoundImageType";
  uint32_t frame = framed ? (uint32_t)number : SONDE_WHOLE_FILE;
  if (find_field(owner_of(s, frame), key))
    return sonde_fail(error, SONDE_FORMAT, "%.200s:%u: %.60s: stands twice, expected once", h->path,
                      e->line, e->key);
  sonde_error cause = {0};
  sonde_status status = sonde_sequence_set(s, frame, key, e->value, &cause);
  if (status == SONDE_ARGUMENT)
    status = sonde_fail(error, SONDE_FORMAT, "%.200s:%u: %.200s", h->path, e->line, cause.message);
  else if (status)
    status = sonde_fail_memory(error);
  // A transform has its numbers, unless its status is INVALID.
  sonde_affine affine;
  bool sound =
      status || !sonde_text_ends(e->key, "Transform") || sonde_text_affine(e->value, &affine);
  const size_t end = strlen(e->key);
  for (uint32_t i = 0; i < h->entry_count && !sound; ++i) {
    const sonde_header_entry *other = &h->entries[i];
    sound = strncmp(other->key, e->key, end) == 0 && strcmp(other->key + end, "Status") == 0 &&
            strcmp(other->value, "OK") != 0;
  }
  if (sound) return status;
  return sonde_fail(error, SONDE_FORMAT,
                    "%.200s:%u: %.60s: expected 16 finite numbers, the last four 0 0 0 1, found "
                    "'%.80s'",
                    h->path, e->line, e->key, e->value);
}

// Its own inverse: U mirrors columns, N mirrors rows.
static void mirror(const sonde_sequence *s, uint8_t *pixels) {
  bool columns = s->orientation[0] == 'U', rows = s->orientation[1] == 'N';
  uint32_t width = s->width, height = s->height;
  for (uint32_t i = 0; i < s->count && (columns || rows); ++i, pixels += (size_t)width * height)
    for (uint32_t v = 0; v < (rows ? (height + 1) / 2 : height); ++v) {
      uint8_t *a = pixels + (size_t)v * width;
      uint8_t *b = rows ? pixels + (size_t)(height - 1 - v) * width : a;
      for (uint32_t u = 0; u < (columns && a == b ? width / 2 : width); ++u) {
        uint32_t other = columns ? width - 1 - u : u;
        uint8_t kept = a[u];
        a[u] = b[other];
        b[other] = kept;
      }
    }
}

static sonde_status read_sequence(const sonde_header *h, sonde_sequence *s, sonde_error *error) {
  static const char *const known[] = {"MF", "MFA", "UF", "UFA", "MN", "MNA",
                                      "UN", "UNA", "XX", "XXX", NULL};
  uint32_t size[3];
  // The file tells width, height and frames; the frames run fastest, or last.
  int last = (int)h->dimension - 1, list = h->list_axis < 0 ? last : h->list_axis;
  SONDE_ASSERT(last >= 2 && last < 4 && list <= last);
  bool first = list == 0;
  const uint32_t *spatial = h->size + (first ? 1 : 0);
  size[0] = spatial[0], size[1] = spatial[1], size[2] = h->size[list];
  if ((list != 0 && list != last) || (h->dimension == 4 && spatial[2] != 1))
    return sonde_fail(error, SONDE_FORMAT,
                      "%.200s: expected the frames on the first or the last axis and single slices "
                      "(domain domain [domain of size 1] list)",
                      h->path);
  size_t expected = (size_t)size[0] * size[1] * size[2];
  if (size[0] > SONDE_SIDE_MAX || size[1] > SONDE_SIDE_MAX || size[2] < 1)
    return sonde_fail(error, SONDE_FORMAT,
                      "%.200s: %u frames of %u x %u pixels, expected at least one frame of at most "
                      "%d x %d",
                      h->path, size[2], size[0], size[1], SONDE_SIDE_MAX, SONDE_SIDE_MAX);
  uint8_t *pixels; // read before the rest, so that a lying header costs no memory
  sonde_status status = sonde_pixels_read(h, expected, &pixels, error);
  if (status) return status;
  *s = (sonde_sequence){.width = size[0],
                        .height = size[1],
                        .count = size[2],
                        .pixels = pixels,
                        .clip = {0, 0, size[0], size[1]}};
  s->frames = SONDE_NEW(sonde_tracked_frame, s->count);
  if (!s->frames) return sonde_fail_memory(error);
  const char *key = h->nrrd ? "ultrasound image orientation" : "UltrasoundImageOrientation";
  const sonde_header_entry *orientation = sonde_header_find(h, key);
  status = sonde_header_only(h, key, false, known, error);
  if (status) return status;
  snprintf(s->orientation, sizeof s->orientation, "%s", orientation ? orientation->value : "");
  if (first) { // frames that run fastest are put one after the other
    uint8_t *sorted = SONDE_NEW(uint8_t, expected);
    if (!sorted) return sonde_fail_memory(error);
    size_t area = (size_t)s->width * s->height;
    for (size_t p = 0; p < area; ++p)
      for (uint32_t i = 0; i < s->count; ++i) sorted[i * area + p] = pixels[p * s->count + i];
    sonde_free(pixels);
    s->pixels = sorted;
  }
  mirror(s, s->pixels);
  for (uint32_t i = 0; i < h->entry_count && !status; ++i)
    status = read_field(h, &h->entries[i], s, error);
  return status;
}

sonde_status sonde_sequence_load(const char *path, sonde_sequence *s, sonde_error *error) {
  SONDE_ASSERT(path != NULL && s != NULL);
  *s = (sonde_sequence){0};
  sonde_header header;
  sonde_status status = sonde_header_load(path, &header, error);
  if (status) return status;
  status = read_sequence(&header, s, error);
  sonde_header_clear(&header);
  if (status) sonde_sequence_clear(s);
  return status;
}

sonde_status sonde_sequence_save(const char *path, const sonde_sequence *s, bool compressed,
                                 sonde_error *error) {
  SONDE_ASSERT(path != NULL && s != NULL && s->frames != NULL);
  if (sonde_text_ends(path, ".dcm")) return sonde_sequence_save_dicom(path, s, NULL, error);
  size_t count = pixel_count(s);
  uint8_t *turned = SONDE_NEW(uint8_t, count);
  if (!turned) return sonde_fail_memory(error);
  if (count) memcpy(turned, s->pixels, count);
  mirror(s, turned);
  sonde_status status = sonde_pixels_save(path, s, NULL, turned, count, compressed, error);
  sonde_free(turned);
  return status;
}
