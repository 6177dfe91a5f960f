// Messages of OpenIGTLink. Layouts: the protocol's documents, image.md, transform.md, sensor.md,
// string.md, status.md, capability.md and v3 header (extended header of 12 bytes, metadata).
#include "stream/igtl_message.h"

#include "base/bytes.h"
#include "base/maths.h"

#include <stdio.h>

enum {
  EXTENDED_BYTES = 12, // of version 2: sizes of itself and of the metadata, number of the message
  SIZE_AT = 42,        // of the body's size in the header; the CRC follows
  METADATA = 4,        // entries beside an image
};

static const uint64_t POLYNOMIAL = 0x42F0E1EBA9EA3693;
// Units as the protocol packs them: six bits of a unit, four of its exponent, behind four of a
// prefix. 11 is the newton.
static const uint64_t NEWTON = (uint64_t)11 << 54 | (uint64_t)1 << 50;
static const double MM = 1e3; // mm per m

void igtl_crc_begin(igtl_crc *crc) {
  for (unsigned b = 0; b < 256; ++b) {
    uint64_t rest = (uint64_t)b << 56;
    for (int bit = 0; bit < 8; ++bit) rest = rest << 1 ^ (rest >> 63 ? POLYNOMIAL : 0);
    crc->table[0][b] = rest;
  }
  // One zero byte more behind the byte.
  for (int k = 1; k < 8; ++k)
    for (unsigned b = 0; b < 256; ++b) {
      uint64_t before = crc->table[k - 1][b];
      crc->table[k][b] = before << 8 ^ crc->table[0][before >> 56];
    }
}

uint64_t igtl_crc_of(const igtl_crc *crc, const unsigned char *bytes, size_t count) {
  uint64_t rest = 0;
  for (; count >= 8; count -= 8, bytes += 8) {
    uint64_t eight = 0, sum = 0;
    for (int k = 0; k < 8; ++k) eight = eight << 8 | bytes[k];
    eight ^= rest;
    for (int k = 0; k < 8; ++k) sum ^= crc->table[k][eight >> 8 * k & 0xff];
    rest = sum;
  }
  for (; count > 0; --count, ++bytes) rest = rest << 8 ^ crc->table[0][rest >> 56 ^ *bytes];
  return rest;
}

static void put(bytes_cursor *out, int bytes, uint64_t value) {
  unsigned char b[8];
  for (int k = 0; k < bytes; ++k) b[k] = (unsigned char)(value >> 8 * (bytes - 1 - k) & 0xff);
  bytes_put(out, b, (size_t)bytes);
}

static void put_f32(bytes_cursor *out, double value) {
  float narrow = (float)value;
  uint32_t bits;
  memcpy(&bits, &narrow, sizeof bits);
  put(out, 4, bits);
}

static void put_point(bytes_cursor *out, sonde_vec3 p) {
  put_f32(out, p.x);
  put_f32(out, p.y);
  put_f32(out, p.z);
}

// A text of fixed size, filled up with zeros.
static void put_name(bytes_cursor *out, const char *name, size_t size) {
  char filled[20] = {0};
  SONDE_ASSERT(size <= sizeof filled && strlen(name) <= size);
  memcpy(filled, name, strlen(name));
  bytes_put(out, filled, size);
}

// Writes a message's header; size and CRC wait for finish(). @return where the message begins
static size_t begin(bytes_cursor *out, const igtl_style *style, const char *type,
                    const char *device) {
  const size_t start = out->count;
  const double whole_s = floor(style->unix_s);
  put(out, 2, (uint64_t)style->version);
  put_name(out, type, 12);
  put_name(out, device, 20);
  put(out, 4, (uint64_t)whole_s);
  put(out, 4, (uint64_t)((style->unix_s - whole_s) * 4294967296.0));
  put(out, 8, 0);
  put(out, 8, 0);
  SONDE_ASSERT(out->count - start == IGTL_HEAD_BYTES);
  if (style->version > 1)
    for (int k = 0; k < EXTENDED_BYTES; ++k) put(out, 1, 0);
  return start;
}

// Metadata of version 2, then the sizes and the CRC of the body.
static void finish(bytes_cursor *out, const igtl_style *style, size_t start,
                   const char (*metadata)[2][24], uint32_t count) {
  size_t heads = 0, texts = 0;
  if (style->version > 1) {
    heads = out->count;
    put(out, 2, count);
    for (uint32_t i = 0; i < count; ++i) {
      put(out, 2, strlen(metadata[i][0]));
      put(out, 2, 3); // US-ASCII by the registry of character sets
      put(out, 4, strlen(metadata[i][1]));
    }
    heads = out->count - heads;
    texts = out->count;
    for (uint32_t i = 0; i < count; ++i)
      for (int k = 0; k < 2; ++k) bytes_put(out, metadata[i][k], strlen(metadata[i][k]));
    texts = out->count - texts;
  }
  if (!bytes_fit(out)) return;
  unsigned char *body = out->bytes + start + IGTL_HEAD_BYTES;
  const size_t size = out->count - start - IGTL_HEAD_BYTES;
  if (style->version > 1) {
    bytes_cursor extended = {body, EXTENDED_BYTES, 0};
    put(&extended, 2, EXTENDED_BYTES);
    put(&extended, 2, heads);
    put(&extended, 4, texts);
    put(&extended, 4, style->number);
  }
  bytes_cursor sizes = {out->bytes + start + SIZE_AT, 16, 0};
  put(&sizes, 8, size);
  put(&sizes, 8, igtl_crc_of(style->crc, body, size));
}

// `axis`: the probe's in Reference; `pixel_mm`: along x and z.
static void put_image(bytes_cursor *out, const sonde_frame *frame, const igtl_style *style,
                      const sonde_vec3 axis[3], const double pixel_mm[2]) {
  size_t start = begin(out, style, "IMAGE", "Image_Reference");
  put(out, 2, 1); // version of this message, whatever the header's
  put(out, 1, 1); // one number per pixel
  put(out, 1, 3); // unsigned, 8 bits
  put(out, 1, 1); // big-endian
  put(out, 1, 1); // axes are called right, anterior, superior
  put(out, 2, frame->width);
  put(out, 2, frame->height);
  put(out, 2, 1);
  // Columns along x, rows along z, and right-handed with them; then the middle of the picture.
  put_point(out, v_scale(axis[0], pixel_mm[0]));
  put_point(out, v_scale(axis[2], pixel_mm[1]));
  put_point(out, v_scale(axis[1], -pixel_mm[0]));
  const sonde_vec3 face = frame->snapshot.world_from_probe.position;
  put_point(out, v_scale(v_madd(face, frame->top_m + 0.5 * frame->height_m, axis[2]), MM));
  for (int k = 0; k < 3; ++k) put(out, 2, 0); // the part that is sent: all
  put(out, 2, frame->width);
  put(out, 2, frame->height);
  put(out, 2, 1);
  bytes_put(out, frame->pixels, (size_t)frame->width * frame->height);
  char metadata[METADATA][2][24] = {{"ContactForceN"}, {"FrameNumber"}, {"TimeS"}, {"DepthMm"}};
  const double value[METADATA] = {frame->snapshot.force_normal_n, style->number,
                                  frame->snapshot.time_s, MM * frame->height_m};
  for (int k = 0; k < METADATA; ++k)
    snprintf(metadata[k][1], sizeof *metadata[k], "%.9g", value[k]);
  finish(out, style, start, (const char(*)[2][24])metadata, METADATA);
}

// Columns of the rotation and the origin of a frame, mm.
static void put_transform(bytes_cursor *out, const igtl_style *style, const char *name,
                          const sonde_vec3 axis[3], sonde_vec3 origin_mm) {
  size_t start = begin(out, style, "TRANSFORM", name);
  for (int k = 0; k < 3; ++k) put_point(out, axis[k]);
  put_point(out, origin_mm);
  finish(out, style, start, NULL, 0);
}

static void put_force(bytes_cursor *out, const igtl_style *style, const char *name,
                      sonde_vec3 value) {
  size_t start = begin(out, style, "SENSOR", name);
  const double list[3] = {value.x, value.y, value.z};
  put(out, 1, 3);
  put(out, 1, 0); // status
  put(out, 8, NEWTON);
  for (int k = 0; k < 3; ++k) {
    uint64_t bits;
    memcpy(&bits, &list[k], sizeof bits);
    put(out, 8, bits);
  }
  finish(out, style, start, NULL, 0);
}

size_t igtl_encode_frame(const sonde_frame *frame, const igtl_style *style, unsigned char *bytes,
                         size_t capacity) {
  SONDE_ASSERT(frame && style && frame->pixels && frame->width > 0 && frame->height > 0 &&
               frame->width <= UINT16_MAX && frame->height <= UINT16_MAX);
  bytes_cursor out = {bytes, capacity, 0};
  const sonde_snapshot *s = &frame->snapshot;
  const sonde_quat q = s->world_from_probe.rotation;
  const sonde_vec3 turned[3] = {q_rotate(q, vec3(1, 0, 0)), q_rotate(q, vec3(0, 1, 0)),
                                q_rotate(q, vec3(0, 0, 1))};
  // From pixels to mm of the probe: columns along x, rows along z.
  const double pixel_mm[2] = {MM * frame->width_m / frame->width,
                              MM * frame->height_m / frame->height};
  const sonde_vec3 scaled[3] = {vec3(pixel_mm[0], 0, 0), vec3(0, 0, pixel_mm[1]),
                                vec3(0, -pixel_mm[0], 0)};
  put_image(&out, frame, style, turned, pixel_mm);
  put_transform(
      &out, style, "ImageToProbe", scaled,
      vec3(0.5 * (pixel_mm[0] - MM * frame->width_m), 0, MM * frame->top_m + 0.5 * pixel_mm[1]));
  put_transform(&out, style, "ProbeToReference", turned, v_scale(s->world_from_probe.position, MM));
  put_force(&out, style, "ProbeForce", s->force_n);
  put_force(&out, style, "ProbeRenderedForce", s->rendered_force_n);
  char text[256];
  int length = snprintf(text, sizeof text,
                        "{\"frame\":%u,\"time_s\":%.9g,\"force_normal_n\":%.9g,"
                        "\"penetration_mm\":%.9g,\"depth_mm\":%.9g}",
                        style->number, s->time_s, s->force_normal_n, MM * s->penetration_m,
                        MM * frame->height_m);
  SONDE_ASSERT(length > 0 && (size_t)length < sizeof text);
  size_t start = begin(&out, style, "STRING", "Metrics");
  put(&out, 2, 3); // US-ASCII
  put(&out, 2, (uint64_t)length);
  bytes_put(&out, text, (size_t)length);
  finish(&out, style, start, NULL, 0);
  return out.count;
}

size_t igtl_encode_reply(igtl_asked what, const igtl_style *style,
                         unsigned char bytes[IGTL_REPLY_BYTES]) {
  static const char *const types[] = {"IMAGE",  "TRANSFORM", "SENSOR",
                                      "STRING", "STATUS",    "CAPABILITY"};
  enum { TYPES = sizeof types / sizeof *types };
  bytes_cursor out = {bytes, IGTL_REPLY_BYTES, 0};
  size_t start;
  if (what == IGTL_STATUS) {
    start = begin(&out, style, "STATUS", "Sonde");
    put(&out, 2, 1); // OK
    put(&out, 8, 0);
    put_name(&out, "", 20);
    bytes_put(&out, "", 1);
  } else {
    start = begin(&out, style, "CAPABILITY", "Sonde");
    put(&out, 4, TYPES);
    for (int k = 0; k < TYPES; ++k) put_name(&out, types[k], 12);
  }
  finish(&out, style, start, NULL, 0);
  SONDE_ASSERT(bytes_fit(&out));
  return out.count;
}

bool igtl_head_read(const unsigned char bytes[IGTL_HEAD_BYTES], igtl_heard *heard) {
  const unsigned version = (unsigned)bytes[0] << 8 | bytes[1];
  const char *type = (const char *)bytes + 2;
  heard->version = version < 2 ? 1 : 2;
  heard->asked = strncmp(type, "GET_STATUS", 12) == 0    ? IGTL_STATUS
                 : strncmp(type, "GET_CAPABIL", 12) == 0 ? IGTL_CAPABILITY
                                                         : IGTL_NOTHING;
  heard->body = 0;
  for (int k = 0; k < 8; ++k) heard->body = heard->body << 8 | bytes[SIZE_AT + k];
  // A type is printable and filled up with zeros.
  bool text = type[0] != 0, ended = false;
  for (int k = 0; k < 12; ++k) {
    if (!type[k])
      ended = true;
    else if (ended || type[k] < '0' || type[k] > 'z')
      text = false;
  }
  return text && version >= 1 && version <= 3;
}
