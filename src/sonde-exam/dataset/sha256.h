// SHA-256 (FIPS 180-4), whose values tell whether a file is the one that was written.
#ifndef SONDE_SRC_SHA256_H
#define SONDE_SRC_SHA256_H

#include <stddef.h>
#include <stdint.h>

enum { SONDE_SHA256_TEXT = 65 }; // hexadecimal digits and a 0

typedef struct sonde_sha256 {
  uint32_t state[8];
  uint64_t bytes;
  uint8_t block[64];
} sonde_sha256;

void sonde_sha256_begin(sonde_sha256 *sum);
void sonde_sha256_add(sonde_sha256 *sum, const void *bytes, size_t count);
void sonde_sha256_end(sonde_sha256 *sum, char text[SONDE_SHA256_TEXT]);
// The sum of bytes that are all there.
void sonde_dataset_sum(const void *bytes, size_t count, char text[SONDE_SHA256_TEXT]);

#endif
