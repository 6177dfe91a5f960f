// What the vectors' test gives to the kernels of each instruction set.
#ifndef SONDE_TEST_VECTOR_H
#define SONDE_TEST_VECTOR_H

#include <stdbool.h>
#include <stdint.h>

typedef struct vector_input {
  _Alignas(64) float a[16], b[16], record[8 * 32];
  int32_t index[16];
} vector_input;

typedef struct vector_output {
  _Alignas(64) float result[9][16], gathered[16], kept[32], column[10][16], record[64];
  double wide[2][8], sum;
  uint32_t bits, wide_bits;
  bool some;
} vector_output;

void vectors_of_base(const vector_input *in, vector_output *out);
void vectors_of_avx2(const vector_input *in, vector_output *out);
void vectors_of_avx512(const vector_input *in, vector_output *out);

#endif
