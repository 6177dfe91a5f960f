// Bytes of the formats that need no library: POSIX ustar and NumPy's .npy.
#include "dataset/dataset.h"

#include <string.h>

void sonde_dataset_tar_header(uint8_t block[SONDE_DATASET_TAR_BLOCK], const char *name,
                              uint64_t bytes) {
  SONDE_ASSERT(strlen(name) < 100 && bytes < (uint64_t)1 << 33);
  memset(block, 0, SONDE_DATASET_TAR_BLOCK);
  char *text = (char *)block;
  snprintf(text, 100, "%s", name);
  snprintf(text + 100, 8, "%07o", 0644u);
  snprintf(text + 108, 8, "%07o", 0u);                            // owner
  snprintf(text + 116, 8, "%07o", 0u);                            // group
  snprintf(text + 124, 12, "%011llo", (unsigned long long)bytes); // octal digits
  snprintf(text + 136, 12, "%011o", 0u);                          // date
  memset(text + 148, ' ', 8); // the checksum counts as blanks in its own sum
  text[156] = '0';
  memcpy(text + 257,
         "ustar\0"
         "00",
         8);
  unsigned sum = 0;
  for (int k = 0; k < SONDE_DATASET_TAR_BLOCK; ++k) sum += block[k];
  snprintf(text + 148, 8, "%06o", sum);
}

sonde_status sonde_dataset_npy(const sonde_dataset_array *array, uint8_t **bytes, size_t *count,
                               sonde_error *error) {
  enum { HEAD = 128 };
  const uint16_t one = 1;
  SONDE_ASSERT(array && array->data && *(const uint8_t *)&one == 1); // little endian
  const size_t data = (size_t)array->bytes * array->rows * array->columns * array->parts;
  *bytes = SONDE_NEW(uint8_t, HEAD + data);
  if (!*bytes) return sonde_fail_memory(error);
  char parts[16] = "", head[HEAD];
  if (array->parts > 1) snprintf(parts, sizeof parts, ", %u", array->parts);
  const int used =
      snprintf(head, sizeof head, "{'descr': '%s', 'fortran_order': False, 'shape': (%u, %u%s), }",
               array->bytes == 4 ? "<f4" : "|u1", array->rows, array->columns, parts);
  memset(*bytes, ' ', HEAD);
  memcpy(*bytes, "\x93NUMPY\x01\x00\x76\x00", 10); // 118 bytes of head follow
  memcpy(*bytes + 10, head, (size_t)used);
  (*bytes)[HEAD - 1] = '\n';
  memcpy(*bytes + HEAD, array->data, data);
  *count = HEAD + data;
  return SONDE_OK;
}
