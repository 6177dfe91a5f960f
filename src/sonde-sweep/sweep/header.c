// What the headers of MetaImage and NRRD share, and the pixels behind them.
#include "sweep/frames.h"

#include "base/bounds.h"

#include <limits.h>
#include <string.h>
#include <zlib.h>

enum { DEFLATE_MOST = 1100, GZIP_BITS = 31, ZLIB_BITS = 15 }; // deflate packs at most 1032 : 1

char *sonde_text_trim(char *text) {
  SONDE_ASSERT(text != NULL);
  while (*text == ' ' || *text == '\t') ++text;
  size_t length = strlen(text);
  while (length && (text[length - 1] == ' ' || text[length - 1] == '\t')) text[--length] = 0;
  return text;
}

bool sonde_text_ends(const char *text, const char *end) {
  size_t a = strlen(text), b = strlen(end);
  return a >= b && strcmp(text + a - b, end) == 0;
}

bool sonde_text_reals(const char *text, uint32_t count, double *values) {
  SONDE_ASSERT(text != NULL && values != NULL);
  for (uint32_t k = 0; k < count; ++k) {
    const char *end;
    values[k] = sonde_parse_real(text, &end);
    if (end == text || !isfinite(values[k]) || fabs(values[k]) > 1e12) return false;
    if (*end && !strchr(" \t\r\n", *end)) return false;
    text = end;
  }
  return text[strspn(text, " \t\r\n")] == 0;
}

bool sonde_text_affine(const char *text, sonde_affine *affine) {
  double v[16];
  if (!sonde_text_reals(text, 16, v)) return false;
  for (int k = 0; k < 4; ++k)
    if (fabs(v[12 + k] - (k == 3)) > 1e-9) return false;
  memcpy(affine->m, v, sizeof affine->m);
  return true;
}

sonde_status sonde_header_line(sonde_header *h, char **line, sonde_error *error) {
  SONDE_ASSERT(h->data <= h->count);
  *line = NULL;
  if (h->data == h->count) return SONDE_OK;
  char *start = h->bytes + h->data, *end = memchr(start, '\n', h->count - h->data);
  if (!end) end = h->bytes + h->count;
  h->data = (size_t)(end - h->bytes) + (end < h->bytes + h->count);
  ++h->lines;
  if (end > start && end[-1] == '\r') --end;
  for (const char *c = start; c < end; ++c)
    if ((unsigned char)*c < 32 && *c != '\t')
      return sonde_fail(error, SONDE_FORMAT,
                        "%.200s:%u: byte 0x%02x at column %d of the header, expected text", h->path,
                        h->lines, (unsigned)(unsigned char)*c, (int)(c - start + 1));
  if (end - start > SONDE_VALUE_MAX)
    return sonde_fail(error, SONDE_FORMAT, "%.200s:%u: line of %zu bytes, expected at most %d",
                      h->path, h->lines, (size_t)(end - start), SONDE_VALUE_MAX);
  *end = 0;
  *line = start;
  return SONDE_OK;
}

sonde_status sonde_header_add(sonde_header *h, char *key, char *value, sonde_error *error) {
  if (h->entry_count == sonde_limits_image.most_items)
    return sonde_fail(error, SONDE_FORMAT, "%.200s:%u: expected at most %llu fields", h->path,
                      h->lines, (unsigned long long)sonde_limits_image.most_items);
  if (h->entry_count == h->entry_room) {
    uint32_t room = h->entry_room ? 2 * h->entry_room : 256;
    void *grown =
        sonde_realloc(h->entries, h->entry_room * sizeof *h->entries, room * sizeof *h->entries);
    if (!grown) return sonde_fail_memory(error);
    h->entries = grown;
    h->entry_room = room;
  }
  h->entries[h->entry_count++] =
      (sonde_header_entry){sonde_text_trim(key), sonde_text_trim(value), h->lines};
  if (h->entries[h->entry_count - 1].key[0]) return SONDE_OK;
  return sonde_fail(error, SONDE_FORMAT, "%.200s:%u: expected a name before the separator", h->path,
                    h->lines);
}

const sonde_header_entry *sonde_header_find(const sonde_header *h, const char *key) {
  for (uint32_t i = 0; i < h->entry_count; ++i)
    if (strcmp(h->entries[i].key, key) == 0) return &h->entries[i];
  return NULL;
}

static sonde_status fail_value(const sonde_header *h, const sonde_header_entry *e,
                               const char *expected, sonde_error *error) {
  return sonde_fail(error, SONDE_FORMAT, "%.200s:%u: %.40s: expected %.100s, found '%.60s'",
                    h->path, e->line, e->key, expected, e->value);
}

sonde_status sonde_header_only(const sonde_header *h, const char *key, bool required,
                               const char *const *words, sonde_error *error) {
  const sonde_header_entry *e = sonde_header_find(h, key);
  if (!e && required)
    return sonde_fail(error, SONDE_FORMAT, "%.200s:%u: the header ends without '%s'", h->path,
                      h->lines, key);
  if (!e) return SONDE_OK;
  char known[128] = "";
  for (; *words; ++words) {
    if (strcmp(e->value, *words) == 0) return SONDE_OK;
    size_t used = strlen(known);
    snprintf(known + used, sizeof known - used, "%s%s", used ? " or " : "", *words);
  }
  return fail_value(h, e, known, error);
}

sonde_status sonde_header_rules(const sonde_header *h, const sonde_header_rule *rules, size_t count,
                                sonde_error *error) {
  sonde_status status = SONDE_OK;
  for (size_t i = 0; i < count && !status; ++i)
    if (rules[i].words[0] || !sonde_header_find(h, rules[i].key))
      status = sonde_header_only(h, rules[i].key, rules[i].required, rules[i].words, error);
  return status;
}

bool sonde_header_among(const char *key, const char *names) {
  SONDE_ASSERT(names[0] == '|');
  size_t length = strlen(key);
  for (const char *at = names; at[1]; at += 1 + strcspn(at + 1, "|"))
    if (strncmp(at + 1, key, length) == 0 && at[1 + length] == '|') return true;
  return false;
}

sonde_status sonde_header_whole(const sonde_header *h, const sonde_header_entry *e, uint32_t count,
                                uint32_t low, uint32_t high, uint32_t *values, sonde_error *error) {
  const char *text = e->value;
  bool good = true;
  for (uint32_t k = 0; k < count && good; ++k) {
    uint64_t value = 0;
    text += strspn(text, " \t");
    size_t digits = strspn(text, "0123456789");
    good = digits > 0 && digits < 12;
    for (size_t d = 0; good && d < digits; ++d) value = 10 * value + (uint64_t)(text[d] - '0');
    good = good && value >= low && value <= high;
    values[k] = good ? (uint32_t)value : 0;
    text += digits;
  }
  if (good && text[strspn(text, " \t")] == 0) return SONDE_OK;
  char expected[80];
  snprintf(expected, sizeof expected, "%u whole number%s from %u to %u", count,
           count == 1 ? "" : "s", low, high);
  return fail_value(h, e, expected, error);
}

sonde_status sonde_header_reals(const sonde_header *h, const char *key, uint32_t count,
                                double *values, sonde_error *error) {
  const sonde_header_entry *e = sonde_header_find(h, key);
  if (!e || sonde_text_reals(e->value, count, values)) return SONDE_OK;
  char expected[40];
  snprintf(expected, sizeof expected, "%u finite numbers", count);
  return fail_value(h, e, expected, error);
}

sonde_status sonde_header_load(const char *path, sonde_header *h, sonde_error *error) {
  SONDE_ASSERT(path != NULL && h != NULL);
  *h = (sonde_header){.path = path, .list_axis = -1, .mm_from_voxel = affine_identity()};
  sonde_status status = sonde_bounded_load(path, &sonde_limits_image, &h->bytes, &h->count, error);
  if (status) return status;
  h->nrrd = h->count >= 4 && memcmp(h->bytes, "NRRD", 4) == 0;
  status = h->nrrd ? sonde_nrrd_parse(h, error) : sonde_metaimage_parse(h, error);
  if (status) sonde_header_clear(h);
  return status;
}

void sonde_header_clear(sonde_header *h) {
  if (!h) return;
  sonde_free(h->bytes);
  sonde_free(h->entries);
  *h = (sonde_header){0};
}

sonde_status sonde_pixels_read(const sonde_header *h, size_t expected, uint8_t **pixels,
                               sonde_error *error) {
  SONDE_ASSERT(h->packed <= h->count - h->data);
  *pixels = NULL;
  bool raw = h->packing == SONDE_PACKING_RAW;
  if (raw ? h->packed != expected : expected / DEFLATE_MOST > h->packed + 1)
    return sonde_fail(
        error, SONDE_FORMAT,
        "%.200s: %zu bytes of %s follow line %u, expected %s%zu; is the file cut off?", h->path,
        h->packed, raw ? "pixels" : "packed pixels", h->lines, raw ? "" : "what unpacks to ",
        expected);
  if (expected > SONDE_MOST_UNPACKED_BYTES)
    return sonde_fail(error, SONDE_FORMAT, "%.200s:%u: %zu bytes of pixels, expected at most %llu",
                      h->path, h->lines, expected, (unsigned long long)SONDE_MOST_UNPACKED_BYTES);
  uint8_t *out = SONDE_NEW(uint8_t, expected);
  if (!out) return sonde_fail_memory(error);
  sonde_status status = SONDE_OK;
  if (raw && expected) memcpy(out, h->bytes + h->data, expected);
  int code = Z_STREAM_END;
  size_t written = raw ? expected : 0, in_left = raw ? 0 : h->packed;
  // zlib counts in 32 bits: both ends are fed in pieces. One byte more than expected tells that
  // there are more.
  z_stream z = {0};
  const uint8_t *in = (const uint8_t *)h->bytes + h->data;
  if (!raw) code = inflateInit2(&z, h->packing == SONDE_PACKING_GZIP ? GZIP_BITS : ZLIB_BITS);
  while (!raw && code == Z_OK && written <= expected) {
    size_t give = in_left < UINT_MAX / 2 ? in_left : UINT_MAX / 2;
    size_t room = expected - written < UINT_MAX / 2 ? expected - written : UINT_MAX / 2;
    uint8_t beyond;
    z.next_in = (Bytef *)(uintptr_t)in, z.avail_in = (uInt)give;
    z.next_out = room ? out + written : &beyond, z.avail_out = room ? (uInt)room : 1;
    code = inflate(&z, Z_NO_FLUSH);
    size_t made = (room ? room : 1) - z.avail_out;
    in += give - z.avail_in, in_left -= give - z.avail_in, written += made;
    if (code == Z_OK && made == 0 && give == z.avail_in) code = Z_BUF_ERROR;
  }
  if (!raw) inflateEnd(&z);
  if (code == Z_MEM_ERROR)
    status = sonde_fail_memory(error);
  else if (code == Z_DATA_ERROR || code == Z_NEED_DICT)
    status =
        sonde_fail(error, SONDE_FORMAT,
                   "%.200s: the packed pixels after line %u are damaged behind byte %zu of %zu",
                   h->path, h->lines, written, expected);
  else if (code != Z_STREAM_END || written != expected)
    status = sonde_fail(error, SONDE_FORMAT,
                        "%.200s: the pixels after line %u unpack to %s%zu bytes, expected %zu",
                        h->path, h->lines, written > expected ? "more than " : "",
                        written > expected ? expected : written, expected);
  if (status) sonde_free(out);
  *pixels = status ? NULL : out;
  return status;
}

sonde_status sonde_pixels_save(const char *path, const sonde_sequence *s, const sonde_volume *v,
                               const uint8_t *pixels, size_t count, bool compressed,
                               sonde_error *error) {
  SONDE_ASSERT((s == NULL) != (v == NULL));
  bool mha = sonde_text_ends(path, ".mha");
  if (!mha && !sonde_text_ends(path, ".nrrd"))
    return sonde_fail(error, SONDE_ARGUMENT, "%.200s: expected a name that ends in %s", path,
                      s ? ".mha, .nrrd or .dcm" : ".mha or .nrrd");
  uint8_t *packed = NULL;
  sonde_file *file = NULL;
  sonde_status status = SONDE_OK;
  if (compressed) {
    // zlib counts in 32 bits: both ends are fed in pieces.
    z_stream z = {0};
    size_t room = count + count / 1000 + 1024, used = 0, taken = 0; // deflate's worst case
    packed = SONDE_NEW(uint8_t, room);
    int code = deflateInit2(&z, 6, Z_DEFLATED, mha ? ZLIB_BITS : GZIP_BITS, 8, Z_DEFAULT_STRATEGY);
    if (!packed || code != Z_OK) status = sonde_fail_memory(error);
    while (!status && code == Z_OK) {
      size_t give = count - taken < UINT_MAX / 2 ? count - taken : UINT_MAX / 2;
      size_t space = room - used < UINT_MAX / 2 ? room - used : UINT_MAX / 2;
      z.next_in = (Bytef *)(uintptr_t)(pixels + taken), z.avail_in = (uInt)give;
      z.next_out = packed + used, z.avail_out = (uInt)space;
      code = deflate(&z, taken + give == count ? Z_FINISH : Z_NO_FLUSH);
      taken += give - z.avail_in, used += space - z.avail_out;
    }
    SONDE_ASSERT(status || (code == Z_STREAM_END && taken == count));
    deflateEnd(&z);
    count = used;
  }
  if (!status) status = sonde_file_create(path, &file, error);
  if (!status) {
    if (s && mha) sonde_metaimage_write_sequence(file, s, compressed ? count : 0);
    if (s && !mha)
      sonde_nrrd_write_sequence(file, s, compressed, sonde_text_ends(path, ".seq.nrrd"));
    if (v && mha) sonde_metaimage_write_volume(file, v, compressed ? count : 0);
    if (v && !mha) sonde_nrrd_write_volume(file, v, compressed);
    sonde_file_write(file, compressed ? packed : pixels, count);
    status = sonde_file_commit(file, error);
  }
  sonde_free(packed);
  return status;
}
