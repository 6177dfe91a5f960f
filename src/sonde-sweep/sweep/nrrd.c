// NRRD: a magic line, "field: value" and "key:=value" lines, an empty line, then the pixels.
#include "sweep/frames.h"

#include <string.h>

// Names that describe the pixels, each between two bars.
static const char OWNED[] =
    "|dimension|type|encoding|endian|kinds|sizes|space|space dimension|space directions"
    "|space origin|space units|spacings|labels|centers|centerings|units|thicknesses|axis mins"
    "|axis maxs|content|number|measurement frame|data file|datafile|line skip|lineskip"
    "|byte skip|byteskip|ultrasound image orientation|DataNodeClassName|axis 0 index type"
    "|axis 0 index values|axis 3 index type|axis 3 index values|";

bool sonde_nrrd_owns(const char *key) { return sonde_header_among(key, OWNED); }

static sonde_status read_lines(sonde_header *h, sonde_error *error) {
  char *line;
  sonde_status status = sonde_header_line(h, &line, error);
  if (status) return status;
  if (strlen(line) != 8 || memcmp(line, "NRRD000", 7) != 0 || line[7] < '1' || line[7] > '5')
    return sonde_fail(error, SONDE_VERSION,
                      "%.200s:1: expected NRRD0001 to NRRD0005, found '%.20s'", h->path, line);
  for (;;) {
    status = sonde_header_line(h, &line, error);
    if (status) return status;
    if (!line)
      return sonde_fail(error, SONDE_FORMAT,
                        "%.200s:%u: the file ends inside the header, expected an empty line",
                        h->path, h->lines);
    if (!*line) return SONDE_OK;
    if (*line == '#') continue;
    // The first of ": " and ":=" divides a line.
    char *middle = strstr(line, ":"), *key = strstr(line, ":=");
    size_t length = middle && middle == key ? 2 : 1;
    if (!middle)
      return sonde_fail(error, SONDE_FORMAT,
                        "%.200s:%u: expected 'field: value' or 'key:=value', found '%.60s'",
                        h->path, h->lines, line);
    *middle = 0;
    status = sonde_header_add(h, line, middle + length, error);
    if (status) return status;
  }
}

// "(a,b,c)"; moves on; false when it is something else.
static bool read_vector(const char **text, double v[3]) {
  const char *at = *text + strspn(*text, " \t");
  for (int k = 0; k < 3; ++k) {
    if (*at++ != (k ? ',' : '(')) return false;
    const char *end;
    v[k] = sonde_parse_real(at, &end);
    if (end == at || !isfinite(v[k]) || fabs(v[k]) > 1e12) return false;
    at = end;
  }
  *text = at + 1;
  return *at == ')';
}

sonde_status sonde_nrrd_parse(sonde_header *h, sonde_error *error) {
  sonde_status status = read_lines(h, error);
  if (status) return status;
  static const sonde_header_rule rules[] = {
      {"type", true, {"unsigned char", "uchar", "uint8", "uint8_t"}},
      {"dimension", true, {"3", "4"}},
      {"encoding", true, {"raw", "gzip", "gz"}},
      {"sizes", true, {NULL}},
      {"line skip", false, {"0"}},
      {"byte skip", false, {"0"}}};
  status = sonde_header_rules(h, rules, SONDE_COUNT_OF(rules), error);
  const sonde_header_entry *apart = sonde_header_find(h, "data file");
  if (!apart) apart = sonde_header_find(h, "datafile");
  if (!status && apart)
    status = sonde_fail(error, SONDE_FORMAT,
                        "%.200s:%u: data file: the pixels are expected in the same file", h->path,
                        apart->line);
  if (status) return status;
  h->dimension = (uint32_t)(sonde_header_find(h, "dimension")->value[0] - '0');
  h->packed = h->count - h->data;
  bool raw = strcmp(sonde_header_find(h, "encoding")->value, "raw") == 0;
  h->packing = raw ? SONDE_PACKING_RAW : SONDE_PACKING_GZIP;
  // The first kind that is a list or a time tells the axis of the frames.
  const sonde_header_entry *kinds = sonde_header_find(h, "kinds");
  const char *text = kinds ? kinds->value : "";
  for (int axis = 0; *text && h->list_axis < 0; ++axis) {
    text += strspn(text, " \t");
    size_t length = strcspn(text, " \t");
    if (length == 4 && (memcmp(text, "list", 4) == 0 || memcmp(text, "time", 4) == 0))
      h->list_axis = axis;
    text += length;
  }
  if (h->list_axis >= (int)h->dimension)
    return sonde_fail(error, SONDE_FORMAT, "%.200s:%u: kinds: expected %u words, one per axis",
                      h->path, kinds->line, h->dimension);
  status = sonde_header_whole(h, sonde_header_find(h, "sizes"), h->dimension, 1, SONDE_FRAMES_MAX,
                              h->size, error);
  if (status || h->dimension != 3 || h->list_axis >= 0) return status;
  // The grid of a volume: its axes or their spacings, and its origin.
  const sonde_header_entry *axes = sonde_header_find(h, "space directions");
  const sonde_header_entry *origin = sonde_header_find(h, "space origin");
  double v[3], spacing[3] = {1, 1, 1};
  if (!axes) status = sonde_header_reals(h, "spacings", 3, spacing, error);
  text = axes ? axes->value : "";
  for (int k = 0; k < 3 && !status; ++k) {
    if (axes && !read_vector(&text, v))
      return sonde_fail(error, SONDE_FORMAT,
                        "%.200s:%u: space directions: expected three (x,y,z), found '%.60s'",
                        h->path, axes->line, axes->value);
    for (int i = 0; i < 3; ++i) h->mm_from_voxel.m[i][k] = axes ? v[i] : spacing[k] * (i == k);
  }
  text = origin ? origin->value : "";
  if (!status && origin && !read_vector(&text, v))
    return sonde_fail(error, SONDE_FORMAT,
                      "%.200s:%u: space origin: expected (x,y,z), found '%.60s'", h->path,
                      origin->line, origin->value);
  for (int i = 0; i < 3 && origin && !status; ++i) h->mm_from_voxel.m[i][3] = v[i];
  return status;
}

static void write_start(sonde_file *file, int dimension, bool packed) {
  sonde_file_printf(file,
                    "NRRD0004\n# Complete NRRD file format specification at:\n"
                    "# http://teem.sourceforge.net/nrrd/format.html\ntype: uint8\ndimension: %d\n"
                    "encoding: %s\nendian: little\n",
                    dimension, packed ? "gzip" : "raw");
}

void sonde_nrrd_write_sequence(sonde_file *file, const sonde_sequence *s, bool packed,
                               bool four_axes) {
  SONDE_ASSERT(file != NULL && s != NULL);
  write_start(file, four_axes ? 4 : 3, packed);
  if (four_axes) {
    sonde_file_printf(file,
                      "kinds: domain domain domain list\nlabels: \"x\" \"y\" \"z\" \"frame\"\n"
                      "sizes: %u %u 1 %u\nspace dimension: 3\n"
                      "space directions: (1,0,0) (0,1,0) (0,0,1) none\nspace origin: (0,0,0)\n"
                      "DataNodeClassName:=vtkMRMLScalarVolumeNode\naxis 3 index type:=numeric\n"
                      "axis 3 index values:=",
                      s->width, s->height, s->count);
    for (uint32_t i = 0; i < s->count; ++i) sonde_file_printf(file, i ? " %u" : "%u", i);
    sonde_file_printf(file, "\n");
  } else
    sonde_file_printf(file,
                      "kinds: domain domain list\nsizes: %u %u %u\nspace dimension: 2\n"
                      "space directions: (1,0) (0,1) none\nspace origin: (0,0)\n",
                      s->width, s->height, s->count);
  if (s->orientation[0])
    sonde_file_printf(file, "ultrasound image orientation:=%s\n", s->orientation);
  for (uint32_t i = 0; i < s->file.field_count; ++i) { // file-wide names are words with spaces
    const char *key = s->file.fields[i].key;
    if (strcmp(key, "UltrasoundImageType") == 0) key = "ultrasound image type";
    sonde_file_printf(file, "%s:=%s\n", key, s->file.fields[i].value);
  }
  for (uint32_t i = 0; i < s->count; ++i)
    for (uint32_t k = 0; k < s->frames[i].field_count; ++k)
      sonde_file_printf(file, "Seq_Frame%04u_%s:=%s\n", i, s->frames[i].fields[k].key,
                        s->frames[i].fields[k].value);
  sonde_file_printf(file, "\n");
}

void sonde_nrrd_write_volume(sonde_file *file, const sonde_volume *v, bool packed) {
  SONDE_ASSERT(file != NULL && v != NULL);
  write_start(file, 3, packed);
  sonde_file_printf(file, "sizes: %u %u %u\nspace dimension: 3\nspace directions:", v->size[0],
                    v->size[1], v->size[2]);
  for (int k = 0; k < 4; ++k) {
    sonde_vec3 mm = v_scale(affine_column(&v->world_from_voxel, k), 1e3);
    sonde_file_printf(file, "%s (%.12g,%.12g,%.12g)", k == 3 ? "\nspace origin:" : "", mm.x, mm.y,
                      mm.z);
  }
  sonde_file_printf(file, "\nkinds: domain domain domain\n\n");
}
