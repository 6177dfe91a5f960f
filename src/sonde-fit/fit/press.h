// Pressing a model at one site, as the experiment did: the equilibrium at a depth.
#ifndef SONDE_SRC_FIT_PRESS_H
#define SONDE_SRC_FIT_PRESS_H

#include "fit/cut.h"
#include "fit/fit_inside.h"
#include "sonde/world.h"

#include <stdatomic.h>

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
sonde_status sonde_press_pool_create(const sonde_model *model, double relative_residual,
                                     uint32_t max_iterations, uint32_t workers, sonde_press **pool,
                                     sonde_error *error);
void sonde_press_pool_destroy(sonde_press *pool, uint32_t workers);

// A footprint bonded to the skin at a site. With a shear layer the skin is cut along the
// footprint's sides, so that the forces do not depend on where the sides fall between the nodes;
// without one (the paper's model) the nodes under it are held. A volumetric model is filled anew
// with tetrahedra that are fine under the footprint.
typedef struct sonde_bonded {
  sonde_press press; // on the cut model, or on the model itself
  sonde_model *cut_model;
  uint32_t *held;
  uint32_t held_count;
  sonde_vec3 normal;
  double stiffness_n_m; // of a linear solid, once it is known; else 0
} sonde_bonded;

sonde_status sonde_bonded_create(const sonde_model *model, const sonde_site *site, double half_u_m,
                                 double half_v_m, double relative_residual, uint32_t max_iterations,
                                 sonde_bonded *bonded, sonde_error *error);
// The same with the model's own nodes: a volumetric one is not meshed anew.
sonde_status sonde_bonded_create_on(const sonde_model *model, const sonde_site *site,
                                    double half_u_m, double half_v_m, double relative_residual,
                                    uint32_t max_iterations, sonde_bonded *bonded,
                                    sonde_error *error);
void sonde_bonded_clear(sonde_bonded *bonded);
// Force along the normal with the held nodes moved by -depth normal, all others free; starts from
// the last equilibrium. NaN when none is found.
double sonde_bonded_force(sonde_bonded *bonded, double depth_m);

// Those forces at the rows of a plan's curve, in its order, into force_n[measurements]; rows behind
// a depth without equilibrium are NaN. @return CANCELLED
sonde_status sonde_bonded_curve(sonde_bonded *bonded, const sonde_fit_plan *plan, uint32_t curve,
                                const sonde_datum *data, const atomic_bool *stop, double *force_n,
                                sonde_error *error);

// Force along the normal with the convex body's face centred at the site moved by -to_m normal,
// pressed on slowly from the equilibrium at from_m. NaN when no equilibrium is found.
double sonde_press_probe(sonde_press *press, const sonde_site *site, const sonde_probe *probe,
                         double from_m, double to_m);

#endif
