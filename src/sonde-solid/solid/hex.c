// The materials of the study, and which kernels evaluate elements.
#include "hex.h"

#include "base/base.h"
#include "base/vector.h"

sonde_hyperelastic sonde_hyperelastic_default(sonde_solid_layer layer) {
  static const double shear_pa[SONDE_SOLID_LAYERS] = {3.6e3, 1.1e3, 40e3};
  static const double exponent[SONDE_SOLID_LAYERS] = {9, 8, 9};
  SONDE_ASSERT(layer < SONDE_SOLID_LAYERS);
  return (sonde_hyperelastic){SONDE_ENERGY_OGDEN, shear_pa[layer], exponent[layer],
                              24 * shear_pa[layer]};
}

const sonde_hex_kernels *sonde_hex_kernels_find(const char *name) {
  const sonde_hex_kernels *known[] = {
#ifdef __x86_64__
      &sonde_hex_kernels_avx512, &sonde_hex_kernels_avx2,
#endif
      &sonde_hex_kernels_base};
  for (size_t k = 0; k < SONDE_COUNT_OF(known); ++k)
    if (sonde_vectors_serve(known[k]->name, name)) return known[k];
  return NULL;
}
