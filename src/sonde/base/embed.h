// SONDE_EMBED(symbol, path): a file within the object, from symbol_begin to symbol_end, with a 0
// behind it. .incbin needs only the assembler; gcc and clang have no #embed here.
#ifndef SONDE_SRC_EMBED_H
#define SONDE_SRC_EMBED_H

#define SONDE_EMBED(symbol, path)                                                                  \
  __asm__(".pushsection .rodata\n"                                                                 \
          ".balign 16\n" #symbol "_begin:\n"                                                       \
          ".incbin \"" path "\"\n" #symbol "_end:\n"                                               \
          ".byte 0\n"                                                                              \
          ".popsection\n");                                                                        \
  extern const unsigned char symbol##_begin[] __attribute__((visibility("hidden")));               \
  extern const unsigned char symbol##_end[] __attribute__((visibility("hidden")))

#endif
