// SHA-256 (FIPS 180-4): blocks of 64 bytes are mixed into eight words in 64 rounds.
#include "dataset/sha256.h"
#include "base/base.h"

#include <string.h>

static uint32_t turn(uint32_t x, int by) { return x >> by | x << (32 - by); }

void sonde_sha256_begin(sonde_sha256 *sum) {
  // Fractions of the square roots of the first eight primes.
  *sum = (sonde_sha256){.state = {0x6a09e667, 0xbb67ae85, 0x3c6ef372, 0xa54ff53a, 0x510e527f,
                                  0x9b05688c, 0x1f83d9ab, 0x5be0cd19}};
}

void sonde_sha256_add(sonde_sha256 *sum, const void *bytes, size_t count) {
  SONDE_ASSERT(sum && (bytes || count == 0));

  // Fractions of the cube roots of the first 64 primes.
  static const uint32_t K[64] = {
      0x428a2f98, 0x71374491, 0xb5c0fbcf, 0xe9b5dba5, 0x3956c25b, 0x59f111f1, 0x923f82a4,
      0xab1c5ed5, 0xd807aa98, 0x12835b01, 0x243185be, 0x550c7dc3, 0x72be5d74, 0x80deb1fe,
      0x9bdc06a7, 0xc19bf174, 0xe49b69c1, 0xefbe4786, 0x0fc19dc6, 0x240ca1cc, 0x2de92c6f,
      0x4a7484aa, 0x5cb0a9dc, 0x76f988da, 0x983e5152, 0xa831c66d, 0xb00327c8, 0xbf597fc7,
      0xc6e00bf3, 0xd5a79147, 0x06ca6351, 0x14292967, 0x27b70a85, 0x2e1b2138, 0x4d2c6dfc,
      0x53380d13, 0x650a7354, 0x766a0abb, 0x81c2c92e, 0x92722c85, 0xa2bfe8a1, 0xa81a664b,
      0xc24b8b70, 0xc76c51a3, 0xd192e819, 0xd6990624, 0xf40e3585, 0x106aa070, 0x19a4c116,
      0x1e376c08, 0x2748774c, 0x34b0bcb5, 0x391c0cb3, 0x4ed8aa4a, 0x5b9cca4f, 0x682e6ff3,
      0x748f82ee, 0x78a5636f, 0x84c87814, 0x8cc70208, 0x90befffa, 0xa4506ceb, 0xbef9a3f7,
      0xc67178f2};
  const uint8_t *from = bytes;
  while (count > 0) {
    const size_t used = sum->bytes % 64, room = 64 - used, some = count < room ? count : room;
    memcpy(sum->block + used, from, some);
    sum->bytes += some, from += some, count -= some;
    if (sum->bytes % 64 > 0) break;
    // The block is full: its words are spread to 64, and mixed into the sum in as many rounds.
    uint32_t w[64], s[8];
    for (int i = 0; i < 16; ++i)
      w[i] = (uint32_t)sum->block[4 * i] << 24 | (uint32_t)sum->block[4 * i + 1] << 16 |
             (uint32_t)sum->block[4 * i + 2] << 8 | sum->block[4 * i + 3];
    for (int i = 16; i < 64; ++i) {
      const uint32_t a = w[i - 15], b = w[i - 2];
      w[i] = w[i - 16] + (turn(a, 7) ^ turn(a, 18) ^ a >> 3) + w[i - 7] +
             (turn(b, 17) ^ turn(b, 19) ^ b >> 10);
    }
    memcpy(s, sum->state, sizeof s);
    for (int i = 0; i < 64; ++i) {
      const uint32_t one = s[7] + (turn(s[4], 6) ^ turn(s[4], 11) ^ turn(s[4], 25)) +
                           ((s[4] & s[5]) ^ (~s[4] & s[6])) + K[i] + w[i];
      const uint32_t two = (turn(s[0], 2) ^ turn(s[0], 13) ^ turn(s[0], 22)) +
                           ((s[0] & s[1]) ^ (s[0] & s[2]) ^ (s[1] & s[2]));
      memmove(s + 1, s, 7 * sizeof *s);
      s[4] += one, s[0] = one + two;
    }
    for (int k = 0; k < 8; ++k) sum->state[k] += s[k];
  }
}

void sonde_sha256_end(sonde_sha256 *sum, char text[SONDE_SHA256_TEXT]) {
  // A bit 1, zeros, and the number of bits in the last eight bytes of a block.
  uint8_t tail[72] = {0x80};
  const uint64_t bits = sum->bytes * 8;
  const size_t zeros = 1 + (119 - sum->bytes % 64) % 64;
  for (int k = 0; k < 8; ++k) tail[zeros + (size_t)k] = (uint8_t)(bits >> (56 - 8 * k));
  sonde_sha256_add(sum, tail, zeros + 8);
  SONDE_ASSERT(sum->bytes % 64 == 0);
  for (int k = 0; k < 8; ++k) snprintf(text + 8 * k, 9, "%08x", sum->state[k]);
}

void sonde_dataset_sum(const void *bytes, size_t count, char text[SONDE_SHA256_TEXT]) {
  sonde_sha256 sum;
  sonde_sha256_begin(&sum);
  sonde_sha256_add(&sum, bytes, count);
  sonde_sha256_end(&sum, text);
}
