// MetaImage: "Key = Value" lines, the last one ElementDataFile = LOCAL, then the pixels.
#include "sweep/frames.h"

#include <string.h>

// Names that describe the pixels, each between two bars.
static const char OWNED[] =
    "|ObjectType|NDims|AnatomicalOrientation|BinaryData|BinaryDataByteOrderMSB"
    "|CenterOfRotation|CompressedData|CompressedDataSize|DimSize|ElementNumberOfChannels"
    "|ElementSpacing|ElementSize|ElementType|Kinds|Offset|Origin|Position|Rotation"
    "|Orientation|TransformMatrix|ElementByteOrderMSB|UltrasoundImageOrientation"
    "|ElementDataFile|CustomFieldNames|CustomFrameFieldNames|";

bool sonde_metaimage_owns(const char *key) { return sonde_header_among(key, OWNED); }

sonde_status sonde_metaimage_parse(sonde_header *h, sonde_error *error) {
  double spacing[3] = {1, 1, 1}, offset[3] = {0}, axes[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  // The lines up to that of the pixels.
  sonde_status status;
  for (bool last = false; !last;) {
    char *line;
    status = sonde_header_line(h, &line, error);
    if (status) return status;
    if (!line)
      return sonde_fail(error, SONDE_FORMAT,
                        "%.200s:%u: the file ends inside the header, expected ElementDataFile",
                        h->path, h->lines);
    char *equals = strchr(line, '=');
    if (!equals)
      return sonde_fail(error, SONDE_FORMAT, "%.200s:%u: expected 'Key = Value', found '%.60s'",
                        h->path, h->lines, line);
    *equals = 0;
    status = sonde_header_add(h, line, equals + 1, error);
    if (status) return status;
    const sonde_header_entry *e = &h->entries[h->entry_count - 1];
    if (h->entry_count == 1 && strcmp(e->key, "ObjectType") != 0 && strcmp(e->key, "NDims") != 0)
      return sonde_fail(error, SONDE_FORMAT,
                        "%.200s:1: expected 'ObjectType = Image' or 'NRRD', found '%.60s'", h->path,
                        e->key);
    last = strcmp(e->key, "ElementDataFile") == 0;
  }
  static const sonde_header_rule rules[] = {{"ObjectType", false, {"Image"}},
                                            {"NDims", true, {"3"}},
                                            {"BinaryData", false, {"True"}},
                                            {"ElementNumberOfChannels", false, {"1"}},
                                            {"ElementType", true, {"MET_UCHAR"}},
                                            {"CompressedData", false, {"True", "False"}},
                                            {"DimSize", true, {NULL}},
                                            {"ElementDataFile", true, {"LOCAL"}}};
  status = sonde_header_rules(h, rules, SONDE_COUNT_OF(rules), error);
  for (size_t i = 0; i < SONDE_COUNT_OF(rules) && !status; ++i) {
    const sonde_header_entry *e = sonde_header_find(h, rules[i].key);
    for (const sonde_header_entry *f = e; f && !status && ++f < h->entries + h->entry_count;)
      if (strcmp(e->key, f->key) == 0)
        status = sonde_fail(error, SONDE_FORMAT, "%.200s:%u: %s repeats line %u", h->path, f->line,
                            f->key, e->line);
  }
  if (status) return status;
  h->dimension = 3;
  h->list_axis = 2;
  h->packed = h->count - h->data;
  status = sonde_header_whole(h, sonde_header_find(h, "DimSize"), 3, 0, SONDE_FRAMES_MAX, h->size,
                              error);
  const sonde_header_entry *compressed = sonde_header_find(h, "CompressedData");
  const sonde_header_entry *size = sonde_header_find(h, "CompressedDataSize");
  if (compressed && strcmp(compressed->value, "True") == 0) h->packing = SONDE_PACKING_ZLIB;
  if (size && h->packing == SONDE_PACKING_ZLIB) {
    uint32_t bytes = 0;
    if (!status) status = sonde_header_whole(h, size, 1, 0, UINT32_MAX, &bytes, error);
    if (!status && bytes > h->packed)
      status = sonde_fail(error, SONDE_FORMAT,
                          "%.200s:%u: CompressedDataSize: expected %u bytes after line %u, found "
                          "%zu; is the file cut off?",
                          h->path, size->line, bytes, h->lines, h->packed);
    if (!status) h->packed = bytes;
  }
  // TransformMatrix holds the direction of one axis after the other.
  if (!status) status = sonde_header_reals(h, "ElementSpacing", 3, spacing, error);
  if (!status) status = sonde_header_reals(h, "Offset", 3, offset, error);
  if (!status) status = sonde_header_reals(h, "TransformMatrix", 9, axes, error);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) h->mm_from_voxel.m[i][k] = spacing[k] * axes[3 * k + i];
    h->mm_from_voxel.m[i][3] = offset[i];
  }
  return status;
}

static void write_start(sonde_file *file, size_t packed) {
  sonde_file_printf(file,
                    "ObjectType = Image\nNDims = 3\nAnatomicalOrientation = RAI\n"
                    "BinaryData = True\nBinaryDataByteOrderMSB = False\n"
                    "CenterOfRotation = 0 0 0\nCompressedData = %s\n",
                    packed ? "True" : "False");
  if (packed) sonde_file_printf(file, "CompressedDataSize = %zu\n", packed);
}

static void write_fields(sonde_file *file, const char *prefix, const sonde_tracked_frame *frame) {
  for (uint32_t i = 0; i < frame->field_count; ++i)
    sonde_file_printf(file, "%s%s = %s\n", prefix, frame->fields[i].key, frame->fields[i].value);
}

void sonde_metaimage_write_sequence(sonde_file *file, const sonde_sequence *s, size_t packed) {
  SONDE_ASSERT(file != NULL && s != NULL);
  write_start(file, packed);
  sonde_file_printf(file,
                    "DimSize = %u %u %u\nElementNumberOfChannels = 1\nElementSpacing = 1 1 1\n"
                    "ElementType = MET_UCHAR\nKinds = domain domain list\nOffset = 0 0 0\n"
                    "TransformMatrix = 1 0 0 0 1 0 0 0 1\n",
                    s->width, s->height, s->count);
  if (s->orientation[0])
    sonde_file_printf(file, "UltrasoundImageOrientation = %s\n", s->orientation);
  write_fields(file, "", &s->file);
  for (uint32_t i = 0; i < s->count; ++i) {
    char prefix[32];
    snprintf(prefix, sizeof prefix, "Seq_Frame%04u_", i);
    write_fields(file, prefix, &s->frames[i]);
  }
  sonde_file_printf(file, "ElementDataFile = LOCAL\n");
}

void sonde_metaimage_write_volume(sonde_file *file, const sonde_volume *v, size_t packed) {
  SONDE_ASSERT(file != NULL && v != NULL);
  write_start(file, packed);
  sonde_vec3 axis[3], t = affine_column(&v->world_from_voxel, 3);
  double mm[3];
  for (int k = 0; k < 3; ++k) {
    sonde_vec3 column = affine_column(&v->world_from_voxel, k);
    mm[k] = 1e3 * v_norm(column);
    axis[k] = v_unit(column, vec3(k == 0, k == 1, k == 2));
  }
  sonde_file_printf(file,
                    "DimSize = %u %u %u\nElementSpacing = %.12g %.12g %.12g\n"
                    "ElementType = MET_UCHAR\nOffset = %.12g %.12g %.12g\nTransformMatrix =",
                    v->size[0], v->size[1], v->size[2], mm[0], mm[1], mm[2], 1e3 * t.x, 1e3 * t.y,
                    1e3 * t.z);
  for (int k = 0; k < 3; ++k)
    sonde_file_printf(file, " %.12g %.12g %.12g", axis[k].x, axis[k].y, axis[k].z);
  sonde_file_printf(file, "\nElementDataFile = LOCAL\n");
}
