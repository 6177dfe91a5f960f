// Eq. (1) in the parameters of the estimation: theta = (ln k0, ln(xm - floor)). The floor is the
// deepest measured penetration over the guard, so that no datum meets the straight continuation.
#ifndef SONDE_SRC_FIT_LAW_H
#define SONDE_SRC_FIT_LAW_H

// Bounds of theta: k0 in 1e1..1e12 N/m^3, xm - floor in 1 um..100 m (straight for all purposes).
static const double LAW_LOW[2] = {2.302585092994046, -13.815510557964274};
static const double LAW_HIGH[2] = {27.631021115928547, 4.605170185988092};

typedef struct sonde_law {
  double k0_n_m3, xm_m;
  double above_m; // xm - floor = d xm / d theta[1]
} sonde_law;

sonde_law sonde_law_of(const double theta[2], double floor_m);
void sonde_law_log(double k0, double xm_m, double floor_m, double theta[2]);
// p(s) = k0 s/(1 - s/xm) and its derivative by xm; dp/d ln k0 = p.
double sonde_law_pressure(double k0, double xm_m, double s_m, double *by_xm);

#endif
