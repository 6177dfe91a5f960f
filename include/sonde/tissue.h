/**
 * @file tissue.h
 * The thigh model (constant once built) and its file; the two-layer tissue: surface masses,
 * spring-dampers, nonlinear normal springs f(x)=x/(ax+b), a shear layer, in-plane stiffness.
 *
 * Notation of the paper in brackets. Normal spring per unit area, with indentation s along the
 * inward rest normal: p(s) = k0 s/(1 - (s/xm)^n); n = 1 is the paper's eq. (1)
 * [f = x/(a x + b), b = 1/k0, a = -1/(k0 xm)].
 */
#ifndef SONDE_TISSUE_H
#define SONDE_TISSUE_H

#include "sonde/tissue_gravity.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Deformable models: docs/tissue.md, volumetric ones docs/bulk.md. */
typedef enum sonde_model_kind {
  SONDE_TWO_LAYER,         /**< the paper's: masses and springs of the skin alone */
  SONDE_LATTICE,           /**< linear springs through the volume (Laffont 1997) */
  SONDE_THREE_LAYER,       /**< biphasic springs, volume force (Lee, Terzopoulos, Waters 1995) */
  SONDE_LINEAR_SOLID,      /**< linear elastic tetrahedra */
  SONDE_NEO_HOOKEAN_SOLID, /**< neo-Hookean tetrahedra */
  SONDE_CONDENSED_SOLID,   /**< the same as linear ones, condensed to the skin by K* */
} sonde_model_kind;
/** Their names in files and on command lines, in this order. */
#define SONDE_MODEL_KIND_NAMES "two-layer", "laffont", "lee", "linear", "neo-hookean", "condensed"

/** Layers of a volumetric body. */
typedef enum sonde_bulk_layer {
  SONDE_LAYER_FAT,
  SONDE_LAYER_MUSCLE,
  SONDE_LAYERS
} sonde_bulk_layer;

/** Parameters of a volumetric body; what its kind does not use is ignored. */
typedef struct sonde_bulk_law {
  double density_kg_m3;
  double damping_s;               /**< dampers: this time times the stiffness */
  double skin_n_m;                /**< membrane stiffness of the skin's springs (three layers) */
  double spring_pa[SONDE_LAYERS]; /**< modulus that the springs of a layer stand for; of a lattice
                                       that of muscle everywhere */
  double steepening, knee; /**< beyond the strain `knee` a spring is so many times as stiff */
  double volume_pa;        /**< of the volume force: pressure per change of volume */
  double young_pa[SONDE_LAYERS], poisson; /**< of solids */
  double stiffness_scale;                 /**< of everything; 1 */
} sonde_bulk_law;

/** What a volumetric model has besides its skin. Nodes that bone holds come behind all others. */
typedef struct sonde_bulk {
  uint32_t node_count; /**< that move: those of the skin first, then inner ones */
  uint32_t held_count, element_count;
  sonde_vec3 *node;            /**< [node_count + held_count] at rest, m */
  double *mass_kg, *area_m2;   /**< [node_count]; inner nodes have no area */
  double *shortest_m;          /**< [node_count] shortest edge at the node */
  uint32_t *start, *neighbour; /**< [node_count + 1], and moving nodes that share an edge, or
                                    share K* */
  uint32_t (*element)[4];      /**< [element_count] positively oriented tetrahedra */
  uint32_t *layer;             /**< [element_count] sonde_bulk_layer */
  sonde_bulk_law law;
} sonde_bulk;

/** Uniform parameters of the surface layer and of the material's damping. */
typedef struct sonde_surface_law {
  double edge_stiffness_n_m;        /**< k_s of a surface spring */
  double edge_damping_s;            /**< damper = this time times the stiffness */
  double edge_compression;          /**< chi in [0,1]: share of the stiffness left when shortened */
  double edge_pretension_n;         /**< T0 >= 0 */
  double tangential_stiffness_n_m3; /**< g_t per area: (I - NN^T) spring to the rest position */
  double inplane_stiffness_n_m;     /**< K between neighbours' tangential displacements (0: none) */
  double shear_stiffness_n_m;       /**< G of the shear layer (0: none) */
  double shear_limit;               /**< slope gm of the skin at which the layer becomes rigid */
  double normal_exponent;           /**< n of the normal springs: 1 (the paper's), 2 or 3 */
  double normal_damping_s;          /**< damper of normal and tangential springs = time x k0 */
  double surface_density_kg_m2;     /**< lumped mass per skin area */
  double guard;                     /**< theta: straight continuation of p(s) beyond theta*xm */
} sonde_surface_law;

/** A thigh's in-plane (N/m) and tangential (N/m^3) stiffness (docs/fit.md). */
#define SONDE_SKIN_INPLANE_N_M 35.0
#define SONDE_SKIN_TANGENTIAL_N_M3 1e5
/** Defaults with all documented values; see docs/tissue.md. @thread any */
SONDE_API sonde_surface_law sonde_surface_law_default(void);

/** A measured site. */
typedef struct sonde_site {
  uint32_t id;
  sonde_vec3 position_m;
  sonde_vec3 normal;  /**< outward, unit */
  sonde_vec3 u, v;    /**< footprint axes: u around the leg, v along it */
  double k0_n_m3;     /**< fitted, per area */
  double xm_m;        /**< fitted asymptote */
  double shear_share; /**< fitted G over the law's; 0 counts as 1 */
  double limit_share; /**< fitted gm over the law's; 0 counts as 1 */
} sonde_site;

/** One measured point: force against penetration. */
typedef struct sonde_datum {
  uint32_t site; /**< site id */
  char probe[24];
  double penetration_m;
  double force_n;
} sonde_datum;

/** Vessel along the leg: centre line in the rest thigh with a circular lumen. */
typedef struct sonde_vessel_point {
  sonde_vec3 centre_m;
  double radius_m;
  double depth_m; /**< of the centre below the skin */
} sonde_vessel_point;

enum { SONDE_VESSEL_POINTS = 64 };
typedef struct sonde_vessel {
  uint32_t count;
  sonde_vessel_point point[SONDE_VESSEL_POINTS];
} sonde_vessel;

/**
 * The thigh: everything that does not move. Built by sonde_model_build() or read from a file;
 * read-only afterwards and safe to share between threads. Arrays belong to the model.
 */
typedef struct sonde_model {
  char name[64];
  char provenance[256]; /**< e.g. that the data are synthetic */
  sonde_model_kind kind;
  sonde_mesh surface; /**< skin at rest, refined */
  sonde_topology topology;
  sonde_mesh femur;        /**< closed; of a limb all its bones */
  sonde_vec3 *bone_axis_m; /**< NULL, or [bone_axis_count] middles of the bones of a limb */
  uint32_t bone_axis_count, map_origin_count;
  sonde_gravity gravity; /**< of a limb in a position */
  sonde_surface_law law;
  sonde_vec3 *normal;     /**< [nodes] outward rest normals */
  double *area_m2;        /**< [nodes] */
  double *mass_kg;        /**< [nodes] */
  double *k0_n_m3;        /**< [nodes] per area */
  double *xm_m;           /**< [nodes] */
  double *shear_share;    /**< [nodes] G here over the law's; a face takes the mean */
  double *limit_share;    /**< [nodes] gm here over the law's; likewise */
  double *fat_depth_m;    /**< [nodes] depth of the skin/fat interface below the skin */
  double *muscle_depth_m; /**< [nodes] depth of the fat/muscle interface */
  double *bone_depth_m;   /**< [nodes] distance to the femur */
  double *edge_rest_m;    /**< [edges] */
  double *edge_share;     /**< [edges] share of the surface spring: 1/2 on lips; NULL: 1 */
  double *face_area_m2;   /**< [faces] */
  double (*face_half_cotangent)[3]; /**< [faces] of the angle at each corner */
  uint32_t (*face_edge)[3];         /**< [faces] edge opposite each corner */
  uint32_t site_count;
  sonde_site *sites;
  uint32_t datum_count;
  sonde_datum *data;         /**< the measurements it was fitted to */
  sonde_vessel vein, artery; /**< femoral vessels */
  /** NULL, or named anatomy (sonde/tissue_anatomy.h); released with the model by sonde_free. */
  struct sonde_thigh_anatomy *anatomy;
  struct sonde_tissue_map *map; /**< NULL, or what knows the tissue everywhere (tissue_anatomy.h) */
  double *map_origin;      /**< NULL, or [map_origin_count] numbers: what files keep of the map */
  struct sonde_bulk *bulk; /**< NULL, or of a volumetric model; released with it */
  uint64_t checksum;       /**< of the file's content; 0 before it is saved or loaded */
} sonde_model;

/** What a model is built from; zero means default where a default is named. */
typedef struct sonde_model_def {
  uint32_t version; /**< SONDE_DEF_VERSION, from sonde_model_def_default() */
  const char *name;
  const char *provenance;
  const sonde_mesh *skin;             /**< closed, outward, m */
  const sonde_mesh *fat_interface;    /**< skin/fat; NULL: 1.8 mm below the skin */
  const sonde_mesh *muscle_interface; /**< fat/muscle; NULL: 12 mm below the skin */
  const sonde_mesh *femur;            /**< NULL: a rod inside a limb, else none; empty: none */
  const sonde_site *sites;
  uint32_t site_count;
  const sonde_datum *data;
  uint32_t datum_count;
  double fine_edge_m;  /**< near footprints; default 3 mm */
  double fine_reach_m; /**< how far from a site's footprint; default 15 mm beyond 30 x 6 mm */
  sonde_surface_law law;
} sonde_model_def;

/** Def with defaults. @thread any */
SONDE_API sonde_model_def sonde_model_def_default(void);

/**
 * Refines the skin, measures layers, interpolates the sites' (ln k0, ln xm) over the surface,
 * places the femoral vessels. Sites without fitted values (k0 == 0) get 1.8e5 N/m^3 and 50 mm.
 * @param[out] model owned by the caller; sonde_model_destroy()
 * @thread owner
 */
SONDE_API sonde_status sonde_model_build(const sonde_model_def *def, sonde_model **model,
                                         sonde_error *error);
/** Re-interpolates site parameters and the law over an existing model. @thread owner */
SONDE_API sonde_status sonde_model_set_parameters(sonde_model *model, const sonde_surface_law *law,
                                                  const sonde_site *sites, uint32_t count,
                                                  sonde_error *error);
SONDE_API void sonde_model_destroy(sonde_model *model); /**< @thread owner */

/** Reads a model file; CHECKSUM when a byte is wrong, VERSION, FORMAT. @thread owner */
SONDE_API sonde_status sonde_model_load(const char *path, sonde_model **model, sonde_error *error);
/** Writes a model file atomically; sets model->checksum. Format: docs/model_file.md.
 *  @thread owner */
SONDE_API sonde_status sonde_model_save(sonde_model *model, const char *path, sonde_error *error);

/** What a cut did. Nodes and faces that were there keep their numbers. */
typedef struct sonde_cut_map {
  uint32_t node_count;  /**< before the cut */
  uint32_t added;       /**< nodes after it: node_count + added */
  uint32_t *origin;     /**< [added] node that node_count + k was split from */
  uint32_t *path;       /**< [path_count] nodes (before the cut) that it runs through, in order */
  uint32_t path_count;  /**< a closed path does not repeat its first node */
  uint32_t split_edges; /**< edges that became two */
  bool closed;          /**< it goes round and frees a flap */
  double length_m;      /**< at rest */
  uint64_t work;        /**< edges that the search for the path looked at */
} sonde_cut_map;

/**
 * Cuts the skin along a path: nodes on it are split, each copy keeps the faces of its side and
 * their share of area and mass; edges on it become two with half the spring each. Rest
 * positions, normals, k0, xm and all totals stay. The ends of the path inside the skin are tips and
 * are not split; a path that ends where it began frees a flap; crossing an earlier cut is allowed.
 * It follows the mesh's edges, within about half an edge of the path. docs/cutting.md.
 * @param position_m [nodes] where the nodes are now; NULL: at rest
 * @param path_m [count] 2 to 1,024 points on the skin at position_m, m
 * @param[out] cut a new model, owned by the caller; `model` stays as it is
 * @param[out] map NULL, or zeroed and filled; sonde_cut_map_clear()
 * @return ARGUMENT for a path that leaves the skin, crosses itself, is too short or cuts nothing
 * @thread owner
 */
SONDE_API sonde_status sonde_model_cut(const sonde_model *model, const sonde_vec3 *position_m,
                                       const sonde_vec3 *path_m, uint32_t count, sonde_model **cut,
                                       sonde_cut_map *map, sonde_error *error);
/** Releases the lists and zeroes the struct. @thread owner */
SONDE_API void sonde_cut_map_clear(sonde_cut_map *map);

/** The site with that id, NULL when absent. @thread any */
SONDE_API const sonde_site *sonde_model_site(const sonde_model *model, uint32_t id);
/** Pose of a probe that looks into the tissue at a site: origin on the rest skin moved by depth
 *  along -normal, z = -normal, x = the site's u. @thread any */
SONDE_API sonde_pose sonde_site_pose(const sonde_site *site, double depth_m);

/** Pressure of a normal spring of exponent n and its slope at indentation s, guard included.
 *  @thread any (tick) */
SONDE_API double sonde_normal_pressure(double exponent, double k0_n_m3, double xm_m, double guard,
                                       double s_m, double *slope_n_m3);

#ifdef __cplusplus
}
#endif
#endif
