// Pressing a model at one site, as the experiment did: the equilibrium at a depth.
#ifndef SONDE_SRC_FIT_PRESS_H
#define SONDE_SRC_FIT_PRESS_H

#include "fit/fit_inside.h"
#include "sonde/world.h"

// Scratch of one worker: a state of the model and positions of held nodes.
typedef struct sonde_press {
  const sonde_model *model;
  sonde_state *state;
  sonde_vec3 *position_m; // [nodes]
  double relative_residual;
  uint32_t max_iterations;
} sonde_press;

sonde_status sonde_press_create(const sonde_model *model, double relative_residual,
                                uint32_t max_iterations, sonde_press *press, sonde_error *error);
void sonde_press_clear(sonde_press *press);

// Creates and destroys one press per worker.
sonde_status sonde_press_crew_create(const sonde_model *model, double relative_residual,
                                     uint32_t max_iterations, uint32_t workers, sonde_press **crew,
                                     sonde_error *error);
void sonde_press_crew_destroy(sonde_press *crew, uint32_t workers);

// Force along the normal with the held nodes moved by -depth normal, all others free; starts from
// the state's present positions. NaN when no equilibrium is found.
double sonde_press_bonded(sonde_press *press, const sonde_site *site,
                          const sonde_footprint *footprint, double depth_m);
// The same with the convex body, its face's centre at the site moved by -depth normal.
double sonde_press_probe(sonde_press *press, const sonde_site *site, const sonde_probe *probe,
                         double depth_m);

#endif
