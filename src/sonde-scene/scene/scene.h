// Inside of a scene: what a file compiles to. Constant once loaded, but for the step's options.
#ifndef SONDE_SRC_SCENE_SCENE_H
#define SONDE_SRC_SCENE_SCENE_H

#include "sonde/scene.h"

#include "files/yaml.h"

// Limits of what a scene file and a snapshot may say; a step keeps to those of its options.
#define SONDE_SCENE_FAR_MM 1e5    // positions and sizes of a file
#define SONDE_SCENE_REACH_M 1e7   // positions of a motion
#define SONDE_SCENE_FASTEST 1e4   // m/s and rad/s
#define SONDE_SCENE_LONGEST_S 1e6 // of a file
#define SONDE_SCENE_LATEST_S 1e9  // of a motion
#define SONDE_SCENE_SHORTEST_DT_S 1e-9
enum { SONDE_SCENE_MOST_NEWTON = 1000, SONDE_SCENE_MOST_HALVINGS = 16 };

// A spring-damper between two nodes: force (stiffness * (length - rest) + damper * rate) along it.
typedef struct sonde_spring {
  double rest_m, stiffness_n_m, damper_n_s_m;
} sonde_spring;

// Bending of a sheet at an edge: moment stiffness * (angle - rest) + damper * rate between the
// faces.
typedef struct sonde_crease {
  uint32_t node[4]; // the edge's ends, then the corners opposite
  double rest_rad, stiffness_n_m, damper_n_m_s;
} sonde_crease;

// How a body meets others.
typedef struct sonde_material {
  char name[64];
  double stiffness_n_m3, damping_s; // damper per volume = time * stiffness
  double mu_static, mu_kinetic;
} sonde_material;

// Poses of the body's frame at times, ascending.
typedef struct sonde_path {
  uint32_t count;
  double *time_s;
  sonde_pose *pose;
} sonde_path;

typedef struct sonde_body {
  char name[64];
  sonde_body_kind kind;
  sonde_body_motion motion;
  sonde_place place; // in the file
  sonde_material material;
  sonde_mesh surface;     // rigid: about the centre; else vertices where they start
  bool closed;            // and without flaws: it may touch others
  uint32_t *surface_node; // [surface vertices] the node of each; NULL: they are the nodes
  sonde_mass mass;        // rigid: in the body's frame; else mass and centre only
  sonde_convex convex;    // rigid: the same when it is convex, else without vertices
  sonde_pose start;       // of the body's frame
  sonde_vec3 velocity_m_s, spin_rad_s;
  sonde_path path;
  uint32_t first_slot, slot_count;

  // deformable
  uint32_t node_count, spring_count;
  sonde_vec3 *node;     // [nodes] where they start
  double *node_mass_kg; // [nodes]
  uint8_t *held;        // [nodes]
  sonde_vec3 *load_n;   // [nodes] constant force
  uint32_t (*pairs)[2]; // [springs] first < second
  sonde_spring *spring; // [springs]
  uint32_t crease_count;
  sonde_crease *crease; // [creases] of a sheet
  double offset_m; // of a sheet: half its thickness; surface vertices stand so far off their nodes
  double self_m;   // distance within which parts of the body push each other; 0: they do not
  uint32_t middle_faces; // of the surface, its first: of a sheet the upper side, else all
  double *self_area_m2;  // [nodes] half of the area around each, where self_m > 0
  double bulk_n_m5;      // pressure per change of volume; 0: none
  double rest_volume_m3; // closed
  uint32_t first_pair;
  sonde_model *model; // two-layer
  sonde_model *solid; // volumetric, its nodes where they start
  bool sags;          // its weight deforms it; else its shape is the one under its weight
} sonde_body;

typedef struct sonde_touch {
  uint32_t a, b; // bodies
  sonde_touch_law law;
  double stiffness, damping;
  double mu_static, mu_kinetic, stribeck_m_s, bond_m, bond_damping_s;
  int bond_side; // 0: bonds live on the vertices of a, 1: of b
} sonde_touch;

// Where a pin holds a body: a node, or a point of the frame of a rigid body's centre.
typedef struct sonde_pin_end {
  uint32_t body;    // UINT32_MAX: the world
  uint32_t node;    // UINT32_MAX: rigid, or the world
  sonde_vec3 local; // rigid: from the centre in the body's axes; the world: the place
} sonde_pin_end;

typedef struct sonde_pin {
  sonde_pin_end end[2];
  double stiffness_n_m, damping_n_s_m;
  uint32_t attachment;
} sonde_pin;

struct sonde_scene {
  char title[128];
  sonde_vec3 gravity_m_s2;
  double duration_s;
  sonde_scene_step step;
  uint32_t body_count, touch_count, material_count;
  sonde_body *bodies;
  sonde_touch *touches;
  sonde_material *materials;
  sonde_pin *pins;
  uint32_t pin_count, attachment_count;
  uint32_t self_nodes; // nodes of the bodies that may touch themselves
  uint32_t slot_count, pair_count;
  uint32_t (*pairs)[2]; // [pair_count] slots
  uint64_t checksum;
};

static inline bool sonde_body_is_rigid(const sonde_body *body) {
  return body->kind == SONDE_BODY_RIGID;
}
// Whether a body weighs: the shape of a scanned thigh is the one under its weight.
static inline bool sonde_body_weighs(const sonde_body *body) {
  return (!body->model && !body->solid) || body->sags;
}
static inline bool sonde_body_is_convex(const sonde_body *body) {
  return body->convex.hull.vertex_count > 0;
}
// Pose of the body's frame at a time; the path's ends hold.
sonde_pose sonde_path_pose(const sonde_path *path, double time_s);

// What reading needs besides the text.
typedef struct sonde_scene_source {
  sonde_reader *reader;
  char directory[512]; // with the final slash, or empty
  const char *thigh;
} sonde_scene_source;

// Reads one entry of `bodies`; errors go to the reader.
void sonde_read_body(const sonde_scene_source *source, sonde_place at, const sonde_scene *scene,
                     sonde_body *body);
void sonde_body_clear(sonde_body *body);
// Reads `attachments`, after the bodies.
void sonde_read_attachments(sonde_reader *reader, sonde_place root, sonde_scene *scene);
bool sonde_bodies_attached(const sonde_scene *scene, uint32_t a, uint32_t b);
// Reads `shape` into a mesh (about the body's frame, m).
void sonde_read_shape(const sonde_scene_source *source, sonde_place at, sonde_mesh *mesh);
// Path of a file named in the scene.
void sonde_source_path(const sonde_scene_source *source, const char *name, char *path, size_t size);

// Nodes, springs, masses and surface of a lattice (entry `lattice` of a body).
void sonde_read_lattice(const sonde_scene_source *source, sonde_place at, sonde_body *body);
// Gives a sheet thickness: a closed surface around its nodes, and creases (entry `sheet`).
void sonde_read_sheet(sonde_reader *reader, sonde_place springs, sonde_body *body);
// Distance and areas of a deformable body's contact with itself (entry `self_contact_mm`).
void sonde_read_self(sonde_reader *reader, sonde_place at, sonde_body *body);
// Vertices of a sheet's surface, upper side first, off its nodes. @thread tick
void sonde_sheet_surface(const sonde_body *body, const sonde_vec3 *node, sonde_vec3 *vertices);
// Angle between the faces at a crease, 0 when flat, and its gradient by the four nodes.
double sonde_crease_angle(const sonde_crease *crease, const sonde_vec3 *x, sonde_vec3 gradient[4]);
// Node at a corner of a deformable body's face.
static inline uint32_t sonde_body_corner(const sonde_body *body, uint32_t face, int corner) {
  uint32_t vertex = body->surface.faces[face][corner];
  return body->surface_node ? body->surface_node[vertex] : vertex;
}
// Springs of a surface from its edges (entry `springs`).
void sonde_read_springs(const sonde_scene_source *source, sonde_place at, sonde_body *body);

// Volume over area of a closed surface, 0 for one that encloses nothing, and its area.
double sonde_mesh_thickness(const sonde_mesh *surface, double *area_m2);
// First flaw of a mesh that has to bound a solid; SONDE_MESH with the reason.
sonde_status sonde_mesh_check_solid(const sonde_mesh *mesh, sonde_error *error);
// First triangle without area; SONDE_MESH with its number.
sonde_status sonde_mesh_check_areas(const sonde_mesh *mesh, sonde_error *error);

// Primitives about the origin; edges no longer than edge_m where it is > 0.
sonde_status sonde_shape_box(sonde_vec3 size_m, double edge_m, sonde_mesh *mesh,
                             sonde_error *error);
sonde_status sonde_shape_ellipsoid(sonde_vec3 radii_m, double edge_m, sonde_mesh *mesh,
                                   sonde_error *error);
// Flat, in the plane z = 0, open.
sonde_status sonde_shape_sheet(double x_m, double y_m, double edge_m, sonde_mesh *mesh,
                               sonde_error *error);
sonde_status sonde_shape_cylinder(double radius_m, double length_m, double edge_m, sonde_mesh *mesh,
                                  sonde_error *error);

// A scene from text. @param name of the text in messages; its directory is that of other files
// @thread owner
sonde_status sonde_scene_parse(const char *text, const char *name, const char *thigh,
                               sonde_scene **scene, sonde_error *error);
// Index of a body, UINT32_MAX when absent. @thread any
uint32_t sonde_scene_find(const sonde_scene *scene, const char *name);
// @return ARGUMENT naming the value out of range @thread owner, while no state steps
sonde_status sonde_scene_set_step(sonde_scene *scene, const sonde_scene_step *step,
                                  sonde_error *error);
void sonde_scene_state_reset(sonde_scene_state *state); // @thread owner
// Nodes of a deformable body, world (m, m/s); NULL for a rigid body. @thread tick
const sonde_vec3 *sonde_scene_nodes(const sonde_scene_state *state, uint32_t body);
const sonde_vec3 *sonde_scene_node_velocities(const sonde_scene_state *state, uint32_t body);
// Overwrites the nodes of a deformable body; either may be NULL. @thread owner
void sonde_scene_set_nodes(sonde_scene_state *state, uint32_t body, const sonde_vec3 *positions,
                           const sonde_vec3 *velocities);

#endif
