/**
 * @file solid.h
 * A hyperelastic, nearly incompressible solid of hexahedra and its contact with a rigid probe,
 * solved to equilibrium: what pressing costs in force, work and motion inside, whatever the path.
 * docs/solid.md, docs/solid_theory.md.
 */
#ifndef SONDE_SOLID_H
#define SONDE_SOLID_H

#include "sonde/interior.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Strain energies of the change of shape. */
typedef enum sonde_strain_energy {
  SONDE_ENERGY_OGDEN,
  SONDE_ENERGY_NEO_HOOKEAN,
  SONDE_ENERGY_FUNG
} sonde_strain_energy;
/** Their names on command lines, in this order. */
#define SONDE_STRAIN_ENERGY_NAMES "ogden", "neo-hookean", "fung"

/**
 * An isotropic material. With stretches l_i, J = l_1 l_2 l_3, S(a) = sum of (J^(-1/3) l_i)^a and
 * the mean volume ratio Jm of an element, energy per rest volume:
 *   Ogden        2 mu/a^2 (S(a) - 3) + K/2 (Jm - 1)^2
 *   neo-Hookean  mu/2 (S(2) - 3) + K/2 (Jm - 1)^2
 *   Fung         mu/(2 a) (exp(a (S(2) - 3)) - 1) + K/2 (Jm - 1)^2
 * Ogden 1972; Fung 1967; Simo, Taylor and Pister 1985 for Jm.
 */
typedef struct sonde_hyperelastic {
  sonde_strain_energy energy;
  double shear_pa; /**< mu > 0, at rest */
  double exponent; /**< a: of Ogden not 0, of Fung > 0; not used by neo-Hookean */
  double bulk_pa;  /**< K > 0 */
} sonde_hyperelastic;

/** Layers of a solid, and their names in files. */
typedef enum sonde_solid_layer {
  SONDE_SOLID_MUSCLE,
  SONDE_SOLID_FAT,
  SONDE_SOLID_SKIN,
  SONDE_SOLID_LAYERS
} sonde_solid_layer;
#define SONDE_SOLID_LAYER_NAMES "muscle", "fat", "skin"
/** Muscle 3.6 kPa, fat 1.1 kPa and skin 40 kPa with Ogden exponents 9, 8 and 9, K = 24 mu: the
 * materials of the finite-element study (docs/solid.md). @thread any */
SONDE_API sonde_hyperelastic sonde_hyperelastic_default(sonde_solid_layer layer);

/** How well moduli are known, by layer: shear modulus, then exponent. */
typedef struct sonde_moduli_certainty {
  double ln_sd[SONDE_SOLID_LAYERS][2];  /**< standard deviations of their logarithms */
  bool measured[SONDE_SOLID_LAYERS][2]; /**< the measurements say it, not what was assumed before */
} sonde_moduli_certainty;
/**
 * Writes the materials atomically as a table of one row per layer, which holds
 * layer,energy,shear_kpa,exponent,bulk_ratio, and where `certainty` is not NULL
 * ln_shear_sd,shear_from,ln_exponent_sd,exponent_from. @thread owner
 */
SONDE_API sonde_status sonde_moduli_save(const char *path,
                                         const sonde_hyperelastic layer[SONDE_SOLID_LAYERS],
                                         const sonde_moduli_certainty *certainty,
                                         const char *remark, sonde_error *error);
/** Reads its first five columns; every layer has to occur once. @return FORMAT, IO @thread owner */
SONDE_API sonde_status sonde_moduli_load(const char *path,
                                         sonde_hyperelastic layer[SONDE_SOLID_LAYERS],
                                         sonde_error *error);

/** A mesh of hexahedra. Corners 0-3 run round one face, 4-7 lie behind them; right-handed. */
typedef struct sonde_hexes {
  uint32_t node_count, count, face_count;
  sonde_vec3 *node;      /**< [node_count] at rest, m */
  uint32_t (*corner)[8]; /**< [count] */
  uint8_t *layer;        /**< [count] sonde_solid_layer */
  uint8_t *held;         /**< [node_count] bits 1 2 4: x y z stay */
  uint32_t (*face)[4];   /**< [face_count] skin, counter-clockwise seen from outside */
  uint32_t lines[3]; /**< of a bent grid: through the layers, along u, along v, with node (l, u, v)
                          at (l lines[1] + u) lines[2] + v; 0: no grid. It orders the factor */
} sonde_hexes;
SONDE_API void sonde_hexes_clear(sonde_hexes *mesh); /**< @thread owner */

/** How fine a mesh is. */
typedef struct sonde_hexes_def {
  uint32_t version;           /**< SONDE_DEF_VERSION, from sonde_hexes_def_default() */
  double half_u_m, half_v_m;  /**< footprint: lines of the mesh run along its border; 30 x 6 mm */
  double edge_m;              /**< of the skin's faces there; 5 mm */
  double growth;              /**< from face to face away from it, 1.05 to 3; 1.7 */
  double reach_m;             /**< along the leg, or half the side of a block; 150 mm */
  uint32_t muscle, fat, skin; /**< hexahedra through the layers; 4, 2, 1 */
} sonde_hexes_def;
SONDE_API sonde_hexes_def sonde_hexes_def_default(void); /**< @thread any */

/**
 * The ring of a leg around a site: from the bone, which holds it, to the skin, with the model's
 * layers; its ends do not move along the leg.
 * @param model with a bone: a thigh or a limb
 * @param[out] mesh zeroed and filled; sonde_hexes_clear()
 * @return ARGUMENT, MESH, MEMORY @thread owner
 */
SONDE_API sonde_status sonde_hexes_ring(const sonde_model *model, const sonde_site *site,
                                        const sonde_hexes_def *def, sonde_hexes *mesh,
                                        sonde_error *error);
/**
 * A block of layers under the plane z = 0, centred on the z axis, its base held, its sides free to
 * slide along themselves.
 * @param depth_m of all layers, skin_m and fat_m of the upper two; 0: none
 * @return ARGUMENT, MEMORY @thread owner
 */
SONDE_API sonde_status sonde_hexes_block(double depth_m, double skin_m, double fat_m,
                                         const sonde_hexes_def *def, sonde_hexes *mesh,
                                         sonde_error *error);

/** How a probe touches and when it is in equilibrium. */
typedef struct sonde_equilibrium_def {
  uint32_t version; /**< SONDE_DEF_VERSION, from sonde_equilibrium_def_default() */
  sonde_hyperelastic layer[SONDE_SOLID_LAYERS];
  bool bonded; /**< the skin under the footprint follows the probe rigidly from where it is at rest;
                    else it slides on the probe and leaves it freely */
  double friction;     /**< coefficient of Coulomb's friction of skin that slides, 0 to 10; 0 */
  double rounding_m;   /**< radius of a rounding around the probe's body, whose tip stays where it
                            is and whose sides grow by it; 0 */
  double contact_n_m3; /**< pressure of the contact per depth of the skin in the probe; 1e9 */
  double zone_m;       /**< skin that may touch: this far around the footprint; 15 mm */
  double step_m;       /**< the probe's way is solved in steps of at most this; 3 mm. With friction
                            the force depends on the way, and on its steps a little */
  double tolerance;    /**< largest residual over the contact's force; 1e-8 */
} sonde_equilibrium_def;
SONDE_API sonde_equilibrium_def sonde_equilibrium_def_default(void); /**< @thread any */

/** What the probe feels in equilibrium. */
typedef struct sonde_equilibrium_result {
  sonde_vec3 force_n;   /**< on the probe */
  sonde_vec3 torque_nm; /**< on the probe, about its origin */
  double tissue_j;      /**< strain energy */
  double contact_j;     /**< of the contact; without friction both together are the work that
                             pressing took */
  double slipped_j;     /**< what slip has taken on the way from the last pose to this one */
  double area_m2;       /**< skin in contact, at rest */
  double deepest_m;     /**< of the skin in the probe */
  double residual;      /**< over the contact's force, or what rounding allows of it */
  uint32_t steps;       /**< Newton steps of the whole solid */
  uint32_t inner_steps; /**< and of the contact on the condensed solid */
  uint32_t shifts;      /**< steps whose stiffness was made positive definite by a shift */
} sonde_equilibrium_result;

/** A solid with a probe on it; it keeps its state from one pose to the next. */
typedef struct sonde_equilibrium sonde_equilibrium;

/**
 * @param mesh,probe borrowed, must outlive it
 * @param start pose of the probe at which it touches the skin at rest
 * @return ARGUMENT, MEMORY @thread owner
 */
SONDE_API sonde_status sonde_equilibrium_create(const sonde_hexes *mesh, const sonde_probe *probe,
                                                sonde_pose start, const sonde_equilibrium_def *def,
                                                sonde_equilibrium **equilibrium,
                                                sonde_error *error);
SONDE_API void sonde_equilibrium_destroy(sonde_equilibrium *equilibrium); /**< @thread owner */

/**
 * Moves the probe from its last pose to this one and solves. A failed call leaves the last state.
 * @return CONVERGENCE when a step as short as 1/64 of step_m finds none, or when skin outside the
 *   zone touches @thread owner
 */
SONDE_API sonde_status sonde_equilibrium_find(sonde_equilibrium *equilibrium, sonde_pose pose,
                                              sonde_equilibrium_result *result, sonde_error *error);
/** Displacement (m) of a rest point; false outside of the mesh. @thread owner */
SONDE_API bool sonde_equilibrium_at(const sonde_equilibrium *equilibrium, sonde_vec3 rest_m,
                                    sonde_vec3 *displacement_m);
/**
 * What a state does to the inside of the leg: displacement and stress of any point, for
 * sonde_interior_input.tissue. A copy of the state; beside the mesh the nearest skin or bone
 * counts.
 * @param[out] tissue sonde_solid_tissue_destroy(); the mesh must outlive it
 * @return MEMORY @thread owner
 */
SONDE_API sonde_status sonde_equilibrium_tissue(const sonde_equilibrium *equilibrium,
                                                sonde_interior_tissue **tissue, sonde_error *error);
/** NULL is ignored. @thread owner */
SONDE_API void sonde_solid_tissue_destroy(sonde_interior_tissue *tissue);
/** Goes back to a state: displacements of all nodes and the pose that they belong to. The next
 * sonde_equilibrium_find() of that pose starts from there, with no friction yet. @thread owner */
SONDE_API void sonde_equilibrium_restore(sonde_equilibrium *equilibrium, sonde_pose pose,
                                         const sonde_vec3 *displacement_m);
/** [mesh node_count] displacements of the state; its own. @thread owner */
SONDE_API const sonde_vec3 *sonde_equilibrium_state(const sonde_equilibrium *equilibrium);

/** How the force against the probe's way changes: with the way, and with the materials. */
typedef struct sonde_force_change {
  double way_n_m;                        /**< tangent stiffness */
  double ln_shear_n[SONDE_SOLID_LAYERS]; /**< with ln mu, K/mu kept */
  double exponent_n[SONDE_SOLID_LAYERS]; /**< with the exponent; neo-Hookean 0 */
} sonde_force_change;
/**
 * At the state that sonde_equilibrium_find() has left: one solve with the factor of its last step.
 * With friction, what changes as long as its limits stay.
 * docs/solid_theory.md.
 * @param way unit, how the probe moves without turning; the force is minus its component along it
 * @return CONVERGENCE where the equilibrium has no positive stiffness @thread owner
 */
SONDE_API sonde_status sonde_equilibrium_change(sonde_equilibrium *equilibrium, sonde_vec3 way,
                                                sonde_force_change *change, sonde_error *error);
/** Writes a bonded state's mesh, laws and imposed displacements as a deck of CalculiX 2.20 (mm, N,
 * MPa), which prints the force that holds the footprint. @return ARGUMENT for a sliding probe or
 * Fung's law; IO @thread owner */
SONDE_API sonde_status sonde_equilibrium_export(const sonde_equilibrium *equilibrium,
                                                const char *path, sonde_error *error);
/** Unknowns of the whole solid and of the skin that may touch. @thread any */
SONDE_API void sonde_equilibrium_size(const sonde_equilibrium *equilibrium, uint32_t *unknowns,
                                      uint32_t *zone_unknowns);

#ifdef __cplusplus
}
#endif
#endif
