// Pictures of at most 256 colours as PNG (ISO 15948, colour type 3), several as its animation (APNG
// 1.0): chunks of length, name, bytes and CRC; every row without a filter, which suits areas of one
// colour.
#include "base/base.h"
#include "files/png.h"

#include <string.h>
#include <zlib.h>

typedef struct output {
  uint8_t *bytes;
  size_t used, room;
} output;

static void put_number(uint8_t *at, uint32_t value) {
  for (int k = 0; k < 4; ++k) at[k] = (uint8_t)(value >> (24 - 8 * k));
}

// A chunk; the sequence number of a frame's data stands before them.
static void put_chunk(output *out, const char *name, const uint32_t *sequence, const uint8_t *bytes,
                      size_t count) {
  size_t before = sequence ? 4 : 0;
  SONDE_ASSERT(out->used + 12 + before + count <= out->room);
  uint8_t *at = out->bytes + out->used;
  put_number(at, (uint32_t)(before + count));
  memcpy(at + 4, name, 4);
  if (sequence) put_number(at + 8, *sequence);
  if (count) memcpy(at + 8 + before, bytes, count);
  put_number(at + 8 + before + count, (uint32_t)crc32(0, at + 4, (uInt)(4 + before + count)));
  out->used += 12 + before + count;
}

sonde_status sonde_colours_encode(const sonde_colours *picture, uint8_t **bytes, size_t *count,
                                  sonde_error *error) {
  const sonde_colours *p = picture;
  SONDE_ASSERT(p && p->pixels && p->palette && bytes && count);
  SONDE_ASSERT(p->width > 0 && p->height > 0 && p->frames > 0);
  SONDE_ASSERT(p->colours > 0 && p->colours <= 256);
  size_t row = (size_t)p->width + 1, raw = row * p->height;
  uLong most = compressBound((uLong)raw);
  output out = {.room = 2048 + (size_t)p->frames * (most + 64)};
  uint8_t *rows = sonde_calloc(1, raw), *packed = sonde_calloc(1, most);
  out.bytes = sonde_calloc(1, out.room);
  *bytes = NULL, *count = 0;
  sonde_status status = rows && packed && out.bytes ? SONDE_OK : sonde_fail_memory(error);
  static const uint8_t SIGNATURE[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  uint8_t head[26] = {0};
  uint32_t sequence = 0;
  if (!status) {
    memcpy(out.bytes, SIGNATURE, out.used = sizeof SIGNATURE);
    put_number(head, p->width), put_number(head + 4, p->height);
    head[8] = 8, head[9] = 3; // bits, colour type
    put_chunk(&out, "IHDR", NULL, head, 13);
    put_number(head, p->frames), put_number(head + 4, 0); // 0: again and again
    if (p->frames > 1) put_chunk(&out, "acTL", NULL, head, 8);
    put_chunk(&out, "PLTE", NULL, p->palette[0], (size_t)3 * p->colours);
  }
  for (uint32_t f = 0; f < p->frames && !status; ++f) {
    for (uint32_t y = 0; y < p->height; ++y)
      memcpy(rows + y * row + 1, p->pixels + ((size_t)f * p->height + y) * p->width, p->width);
    if (p->frames > 1) {
      // Size, place 0 0, delay in ms; the frame stays and is replaced.
      memset(head, 0, sizeof head);
      put_number(head, p->width), put_number(head + 4, p->height);
      uint32_t ms = (uint32_t)(p->frame_s * 1000 + 0.5);
      head[16] = (uint8_t)(ms >> 8), head[17] = (uint8_t)ms, head[18] = 1000 >> 8,
      head[19] = 1000 & 255;
      put_chunk(&out, "fcTL", &sequence, head, 22);
      ++sequence;
    }
    uLong size = most;
    if (compress2(packed, &size, rows, (uLong)raw, 9) != Z_OK) {
      status = sonde_fail_memory(error);
      break;
    }
    put_chunk(&out, f ? "fdAT" : "IDAT", f ? &sequence : NULL, packed, size);
    if (f) ++sequence;
  }
  if (!status) put_chunk(&out, "IEND", NULL, NULL, 0);
  sonde_free(rows);
  sonde_free(packed);
  if (status) {
    sonde_free(out.bytes);
    return status;
  }
  *bytes = out.bytes, *count = out.used;
  return SONDE_OK;
}

sonde_status sonde_colours_save_png(const sonde_colours *picture, const char *path,
                                    sonde_error *error) {
  SONDE_ASSERT(path);
  uint8_t *bytes = NULL;
  size_t count = 0;
  sonde_file *file = NULL;
  sonde_status status = sonde_colours_encode(picture, &bytes, &count, error);
  if (!status) status = sonde_file_create(path, &file, error);
  if (!status) {
    sonde_file_write(file, bytes, count);
    status = sonde_file_commit(file, error);
  }
  sonde_free(bytes);
  return status;
}
