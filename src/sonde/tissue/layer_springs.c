// Springs of layers in series: least squares over the 64 sites of the bundled thigh
// (docs/anatomy_theory.md).
#include "tissue/layer_springs.h"

#include "base/base.h"
#include "base/maths.h"

static const double fat_compliance = 1.688e-4, muscle_compliance = 4.963e-5; // m^2/N
static const double asymptote_share = 0.6726;
static const double least_fat_m = 0.002;
static const double shear_n_m = 15.74, shear_limit = 1.104;

void sonde_layer_springs(double fat_m, double muscle_m, double least_m, double stiffness,
                         double *k0_n_m3, double *xm_m) {
  SONDE_ASSERT(stiffness > 0 && least_m > 0);
  double fat = fmax(fat_m, least_fat_m), muscle = fmax(muscle_m, least_m - fat);
  muscle = fmax(muscle, 0);
  *k0_n_m3 = stiffness / (fat_compliance * fat + muscle_compliance * muscle);
  *xm_m = asymptote_share * (fat + muscle);
}

sonde_surface_law sonde_layered_law(double stiffness, double damping_s) {
  SONDE_ASSERT(stiffness > 0 && damping_s > 0);
  sonde_surface_law law = sonde_surface_law_default();
  law.edge_stiffness_n_m = 0;
  law.inplane_stiffness_n_m = SONDE_SKIN_INPLANE_N_M * stiffness;
  law.tangential_stiffness_n_m3 = SONDE_SKIN_TANGENTIAL_N_M3 * stiffness;
  law.shear_stiffness_n_m = shear_n_m * stiffness;
  law.shear_limit = shear_limit;
  law.normal_exponent = 2;
  law.normal_damping_s = damping_s;
  return law;
}
