// Operations of one vector type; vector.h includes this file for each.
#define PASTE(name, type) name##_##type
#define NAME(name, type) PASTE(name, type)
#define OF(name) NAME(name, VECTOR)
#define OF_MASK(name) NAME(name, MASK)

typedef VECTOR NAME(VECTOR, near) __attribute__((aligned(sizeof(NUMBER)), may_alias));

INLINE VECTOR OF(vload)(const NUMBER *p) { return *(const NAME(VECTOR, near) *)p; }
INLINE void OF(vstore)(NUMBER *p, VECTOR a) { *(NAME(VECTOR, near) *)p = a; }
INLINE VECTOR OF(vset)(NUMBER a) { return a - (VECTOR){0}; }
INLINE MASK OF_MASK(vset)(INTEGER a) { return a - (MASK){0}; }
INLINE MASK OF(vint)(VECTOR a) { return __builtin_convertvector(a, MASK); }
INLINE VECTOR OF_MASK(vreal)(MASK a) { return __builtin_convertvector(a, VECTOR); }
INLINE VECTOR OF(vonly)(MASK mask, VECTOR a) { return (VECTOR)(mask & (MASK)a); }

INLINE MASK OF_MASK(vselect)(MASK mask, MASK yes, MASK no) { return (mask & yes) | (~mask & no); }
INLINE VECTOR OF(vselect)(MASK mask, VECTOR yes, VECTOR no) {
#if defined(INSTRUCTION) && defined(__SSE4_1__) && !defined(__AVX2__)
  return (VECTOR)INSTRUCTION(blendv)((REGISTER)no, (REGISTER)yes, (REGISTER)mask);
#else
  return (VECTOR)((mask & (MASK)yes) | (~mask & (MASK)no));
#endif
}

INLINE VECTOR OF(vabs)(VECTOR a) {
  const INTEGER size = (INTEGER)(UINT64_MAX >> (65 - 8 * sizeof(NUMBER)));
  return (VECTOR)((MASK)a & size);
}

INLINE VECTOR OF(vfloor)(VECTOR a) {
#if defined(INSTRUCTION) && defined(__SSE4_1__) && !defined(__AVX2__)
  return (VECTOR)INSTRUCTION(floor)((REGISTER)a);
#else
  VECTOR i = OF_MASK(vreal)(OF(vint)(a));
  return i - OF(vonly)(i > a, OF(vset)(1));
#endif
}

INLINE VECTOR OF(vmax)(VECTOR a, VECTOR b) {
#ifdef INSTRUCTION
  return (VECTOR)INSTRUCTION(max)((REGISTER)a, (REGISTER)b);
#else
  return OF(vselect)(a > b, a, b);
#endif
}

INLINE VECTOR OF(vmin)(VECTOR a, VECTOR b) {
#ifdef INSTRUCTION
  return (VECTOR)INSTRUCTION(min)((REGISTER)a, (REGISTER)b);
#else
  return OF(vselect)(a < b, a, b);
#endif
}

INLINE VECTOR OF(vsqrt)(VECTOR a) {
#ifdef INSTRUCTION
  return (VECTOR)INSTRUCTION(sqrt)((REGISTER)a);
#else
  for (unsigned k = 0; k < sizeof a / sizeof(NUMBER); ++k)
    a[k] = (NUMBER)(sizeof(NUMBER) == 4 ? (double)__builtin_sqrtf((float)a[k])
                                        : __builtin_sqrt((double)a[k]));
  return a;
#endif
}

INLINE VECTOR OF(vinverse_sqrt)(VECTOR a) {
  // The exponent's half is a first guess; two steps of Newton's method follow with the constants
  // that make their largest error least (Moroz et al., 2018): a fraction of a root and a division.
  if (sizeof(NUMBER) == 8) return 1 / OF(vsqrt)(a);
  VECTOR y = (VECTOR)(0x5f200000 - ((MASK)a >> 1));
  y = y * (1.68191391f - 0.703952009f * a * y * y);
  return y * (1.50000036f - 0.500000053f * a * y * y);
}

INLINE VECTOR OF(vdot)(const VECTOR a[3], const VECTOR b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

INLINE NUMBER OF(vsum)(VECTOR a) {
  NUMBER sum = 0;
  for (unsigned k = 0; k < sizeof a / sizeof(NUMBER); ++k) sum += a[k];
  return sum;
}

INLINE uint32_t OF_MASK(vbits)(MASK mask) {
#ifdef MASK_BITS
  return (uint32_t)MASK_BITS(mask);
#elif defined(__SSE2__)
  // Words of 16 bytes in turn, the lanes' signs of each.
  union {
    MASK whole;
    float_x4 word[sizeof(MASK) / 16];
  } of = {mask};
  uint32_t set = 0;
  for (unsigned k = 0; k < sizeof(MASK) / 16; ++k)
    set |= (sizeof(NUMBER) == 4 ? (uint32_t)_mm_movemask_ps((__m128)of.word[k])
                                : (uint32_t)_mm_movemask_pd((__m128d)of.word[k]))
           << (16 / sizeof(NUMBER) * k);
  return set;
#else
  uint32_t set = 0;
  for (unsigned k = 0; k < sizeof(MASK) / sizeof(NUMBER); ++k) set |= (uint32_t)(mask[k] & 1) << k;
  return set;
#endif
}

#undef PASTE
#undef NAME
#undef OF
#undef OF_MASK
#undef VECTOR
#undef MASK
#undef NUMBER
#undef INTEGER
#undef INSTRUCTION
#undef REGISTER
#undef MASK_BITS
