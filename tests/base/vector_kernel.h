// Operations of base/vector.h on 16 numbers and on records, for one instruction set.
#include "base/vector_records.h"

#include "test_vector.h"

#include <string.h>

void VECTOR_TEST(const vector_input *in, vector_output *out) {
  memset(out, 0, sizeof *out);
  const float_x16 a = vload_float_x16(in->a), b = vload_float_x16(in->b);
  const float_x16 positive = vabs(a) + 1e-3f;
  vstore(out->result[0], vmax(a, b));
  vstore(out->result[1], vmin(a, b));
  vstore(out->result[2], vsqrt(positive));
  vstore(out->result[3], vinverse_sqrt(positive));
  vstore(out->result[4], vfloor(a));
  vstore(out->result[5], vselect(a > b, a, b));
  vstore(out->result[6], vonly(a > b, a));
  vstore(out->result[7], vreal(vint(a)));
  vstore(out->result[8], vdot(((float_x16[3]){a, b, positive}), ((float_x16[3]){b, a, a})));
  out->bits = vbits(a > b);
  out->some = vany(a > b) && !vany(a > vmax(a, b)) && vall(a <= vmax(a, b));
  out->sum = vsum(vwiden(a));
  double_x8 low, high;
  for (int k = 0; k < 8; ++k) low[k] = (double)a[k], high[k] = (double)positive[k];
  vstore(out->wide[0], vmax(low, vset_double_x8(0.25)));
  vstore(out->wide[1], vinverse_sqrt(high));
  out->wide_bits = vbits(low < 0);
  // As wide as the set.
  float *kept = out->kept;
  for (int k = 0; k < 16; k += FLOATS) {
    const floats x = vload(in->a + k);
    const uint32_t mask = vbits(x > vset(0));
    ints index;
    memcpy(&index, in->index + k, sizeof index);
    vstore(out->gathered + k, vgather(in->record, index));
    vcompress(mask, x, kept);
    kept += __builtin_popcount(mask);
  }
  memset(kept, 0, sizeof(float) * (size_t)(out->kept + 32 - kept));
  // Records of eight numbers at 16 places, their first four and six, and four of them back.
  int_x16 nodes;
  float_x16 four[4], six[6];
  memcpy(&nodes, in->index, sizeof nodes);
  vload_records(in->record, 8, &nodes, four);
  vload_six(in->record, &nodes, six);
  for (int c = 0; c < 4; ++c) vstore(out->column[c], four[c]);
  for (int c = 0; c < 6; ++c) vstore(out->column[4 + c], six[c]);
  vstore_records(out->record, 4, four);
}
