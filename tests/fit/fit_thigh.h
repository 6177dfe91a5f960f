// The bundled thigh with parameters that need no fit.
#ifndef SONDE_TESTS_FIT_THIGH_H
#define SONDE_TESTS_FIT_THIGH_H

#include "fit_plate.h"

// Any nodal parameters will do; these vary from site to site.
static inline void set_uneven_parameters(bundled *b, const sonde_surface_law *law) {
  for (uint32_t s = 0; s < b->sites.count; ++s) {
    b->sites.sites[s].k0_n_m3 = 1e5 * (1 + 0.5 * sin(1.0 + s));
    b->sites.sites[s].xm_m = 0.045 + 0.01 * cos(2.0 * s);
  }
  sonde_error error;
  assert_ok(sonde_model_set_parameters(b->model, law, b->sites.sites, b->sites.count, &error),
            &error);
}

// A thigh with weak edges, whose equilibria are found quickly.
static inline bundled soft_thigh(void) {
  bundled b = bundled_load("indentation.csv", 8.0);
  sonde_surface_law law = sonde_surface_law_default();
  law.edge_stiffness_n_m = 10;
  law.tangential_stiffness_n_m3 = 2e5; // the simplified interaction knows none
  set_uneven_parameters(&b, &law);
  return b;
}

#endif
