// One body of a scene file.
#include "scene/lattice.h"

#include "base/base.h"
#include "base/maths.h"
#include "geometry/internal.h"
#include "tissue/bulk/blocks.h"
#include "tissue/nodes.h"

#include <string.h>

void sonde_source_path(const sonde_scene_source *source, const char *name, char *path,
                       size_t size) {
  SONDE_ASSERT(name && size > 0);
  bool rooted = name[0] == '/';
  snprintf(path, size, "%s%s", rooted ? "" : source->directory, name);
}

static sonde_vec3 positive_size(sonde_reader *reader, sonde_place at, const char *what) {
  sonde_vec3 size = sonde_read_vector_at(reader, at, what, SONDE_SCENE_FAR_MM);
  if (!(size.x > 0 && size.y > 0 && size.z > 0))
    sonde_reader_fail(reader, at, SONDE_ARGUMENT, "%s must be three numbers above 0", what);
  return v_scale(size, 1e-3);
}

static void read_primitive(sonde_reader *reader, const char *key, sonde_place value, double edge_m,
                           sonde_mesh *mesh, sonde_error *error) {
  static const char *const CYLINDER[] = {"radius", "length", NULL};
  if (strcmp(key, "box_mm") == 0 || strcmp(key, "slab_mm") == 0) {
    sonde_vec3 size = positive_size(reader, value, key);
    if (!sonde_reader_good(reader)) return;
    sonde_shape_box(size, edge_m, mesh, error);
    bool slab = key[0] == 's'; // its top lies at z = 0
    for (uint32_t i = 0; slab && i < mesh->vertex_count; ++i) mesh->vertices[i].z -= 0.5 * size.z;
  } else if (strcmp(key, "sheet_mm") == 0) {
    if (sonde_read_count(reader, value) != 2) {
      sonde_reader_fail(reader, value, SONDE_FORMAT, "sheet_mm must be two lengths [x, y]");
      return;
    }
    double side[2];
    for (uint32_t k = 0; k < 2; ++k)
      side[k] = 1e-3 * sonde_read_real_at(reader, sonde_read_item(reader, value, k), key, 1e-3,
                                          SONDE_SCENE_FAR_MM);
    if (sonde_reader_good(reader)) sonde_shape_sheet(side[0], side[1], edge_m, mesh, error);
  } else if (strcmp(key, "sphere_mm") == 0) {
    double radius = 1e-3 * sonde_read_real_at(reader, value, key, 1e-3, SONDE_SCENE_FAR_MM);
    if (sonde_reader_good(reader))
      sonde_shape_ellipsoid(vec3(radius, radius, radius), edge_m, mesh, error);
  } else if (strcmp(key, "ellipsoid_mm") == 0) {
    sonde_vec3 radii = positive_size(reader, value, key);
    if (sonde_reader_good(reader)) sonde_shape_ellipsoid(radii, edge_m, mesh, error);
  } else {
    sonde_read_keys(reader, value, key, CYLINDER);
    double radius = 1e-3 * sonde_read_real(reader, value, "radius", 1e-3, SONDE_SCENE_FAR_MM, NAN);
    double length = 1e-3 * sonde_read_real(reader, value, "length", 1e-3, SONDE_SCENE_FAR_MM, NAN);
    if (sonde_reader_good(reader)) sonde_shape_cylinder(radius, length, edge_m, mesh, error);
  }
}

void sonde_read_shape(const sonde_scene_source *source, sonde_place at, sonde_mesh *mesh) {
  sonde_reader *reader = source->reader;
  static const char *const KEYS[] = {"box_mm",      "slab_mm", "sphere_mm", "ellipsoid_mm",
                                     "cylinder_mm", "mesh",    "probe",     "sheet_mm",
                                     "edge_mm",     NULL};
  static const char *const MESH_KEYS[] = {"file", "unit_mm", NULL};
  sonde_read_keys(reader, at, "shape", KEYS);
  double edge_m = 1e-3 * sonde_read_real(reader, at, "edge_mm", 0, SONDE_SCENE_FAR_MM, 0);
  const char *found = NULL;
  for (int k = 0; k < 8 && sonde_reader_good(reader); ++k)
    if (sonde_read_find(reader, at, KEYS[k])) {
      if (found)
        sonde_reader_fail(reader, at, SONDE_FORMAT, "shape has both %s and %s", found, KEYS[k]);
      found = KEYS[k];
    }
  if (!found) sonde_reader_fail(reader, at, SONDE_FORMAT, "shape names no body such as box_mm");
  if (!sonde_reader_good(reader)) return;
  sonde_place value = sonde_read_find(reader, at, found);
  sonde_error error = {0};
  char path[1024];
  if (strcmp(found, "mesh") == 0) {
    sonde_read_keys(reader, value, "mesh", MESH_KEYS);
    const char *file = sonde_read_text(reader, value, "file", true);
    double unit_mm = sonde_read_real(reader, value, "unit_mm", 1e-6, 1e6, 1);
    if (!sonde_reader_good(reader)) return;
    sonde_source_path(source, file, path, sizeof path);
    sonde_mesh_load(path, unit_mm * 1e-3, mesh, &error);
  } else if (strcmp(found, "probe") == 0) {
    const char *name = sonde_read_text_at(reader, value, "probe");
    if (!name) return;
    sonde_probe probe = {0};
    bool is_file = strchr(name, '.') != NULL;
    if (is_file) sonde_source_path(source, name, path, sizeof path);
    if (!sonde_probe_create(is_file ? path : name, &probe, &error))
      sonde_mesh_copy(&probe.body.hull, mesh, &error);
    sonde_probe_clear(&probe);
  } else
    read_primitive(reader, found, value, edge_m, mesh, &error);
  if (error.status) sonde_reader_pass(reader, value, &error);
  if (sonde_reader_good(reader) && sonde_mesh_check_areas(mesh, &error))
    sonde_reader_pass(reader, value, &error);
}

// A pose is position_mm: [x, y, z] and rotation: {axis: [x, y, z], angle_deg: a}.
static sonde_pose read_pose(sonde_reader *reader, sonde_place map) {
  static const char *const KEYS[] = {"axis", "angle_deg", NULL};
  sonde_vec3 position = v_scale(
      sonde_read_vector(reader, map, "position_mm", SONDE_SCENE_FAR_MM, vec3(0, 0, 0)), 1e-3);
  sonde_place at = sonde_read_find(reader, map, "rotation");
  if (!at) return (sonde_pose){position, quat_identity()};
  sonde_read_keys(reader, at, "rotation", KEYS);
  sonde_vec3 axis = sonde_read_vector(reader, at, "axis", 1e6, vec3(0, 0, 0));
  double half = sonde_read_real(reader, at, "angle_deg", -3600, 3600, NAN) * SONDE_PI / 360;
  if (!(v_norm(axis) > 0))
    sonde_reader_fail(reader, at, SONDE_ARGUMENT, "axis is missing or has no length");
  axis = v_scale(v_unit(axis, vec3(0, 0, 1)), sin(half));
  return (sonde_pose){position, {cos(half), axis.x, axis.y, axis.z}};
}

// Poses with times of a driven body.
static void read_path(sonde_reader *reader, sonde_place at, sonde_body *body) {
  static const char *const KEYS[] = {"time_s", "position_mm", "rotation", NULL};
  sonde_place list = sonde_read_find(reader, at, "path");
  uint32_t count = sonde_read_count(reader, list);
  if (count == 0)
    sonde_reader_fail(reader, at, SONDE_FORMAT, "a driven body needs a path of poses with times");
  if (!sonde_reader_good(reader)) return;
  body->path.time_s = SONDE_NEW(double, count);
  body->path.pose = SONDE_NEW(sonde_pose, count);
  if (!body->path.time_s || !body->path.pose) {
    sonde_reader_fail(reader, list, SONDE_MEMORY, "out of memory");
    return;
  }
  body->path.count = count;
  for (uint32_t i = 0; i < count; ++i) {
    sonde_place entry = sonde_read_item(reader, list, i);
    sonde_read_keys(reader, entry, "path", KEYS);
    body->path.time_s[i] = sonde_read_real(reader, entry, "time_s", 0, SONDE_SCENE_LONGEST_S, NAN);
    body->path.pose[i] = read_pose(reader, entry);
    if (i && !(body->path.time_s[i] > body->path.time_s[i - 1]))
      sonde_reader_fail(reader, entry, SONDE_ARGUMENT, "time_s must grow along the path");
  }
  body->start = sonde_path_pose(&body->path, 0);
}

// Centre and inertia by density or by mass; without either a body that does not move freely
// weighs as water.
static void read_rigid(const sonde_scene_source *source, sonde_place at, sonde_body *body) {
  sonde_reader *reader = source->reader;
  bool mass = sonde_read_find(reader, at, "mass_kg"), free = body->motion == SONDE_BODY_FREE;
  if (mass && sonde_read_find(reader, at, "density_kg_m3"))
    sonde_reader_fail(reader, at, SONDE_FORMAT, "mass_kg and density_kg_m3 are both given");
  double density =
      mass ? 1 : sonde_read_real(reader, at, "density_kg_m3", 1e-6, 1e9, free ? NAN : 1000);
  double mass_kg = mass ? sonde_read_real(reader, at, "mass_kg", 1e-9, 1e9, NAN) : 0;
  sonde_read_shape(source, sonde_read_find(reader, at, "shape"), &body->surface);
  if (!sonde_reader_good(reader)) return;
  sonde_error error = {0};
  sonde_status status = sonde_mesh_check_solid(&body->surface, &error);
  if (!status) status = sonde_mesh_mass(&body->surface, density, &body->mass, &error);
  if (status) {
    sonde_reader_pass(reader, sonde_read_find(reader, at, "shape"), &error);
    return;
  }
  body->closed = true;
  if (mass) {
    double scale = mass_kg / body->mass.mass_kg;
    body->mass.mass_kg = mass_kg;
    body->mass.inertia_kg_m2 = m_scale(body->mass.inertia_kg_m2, scale);
  }
  for (uint32_t i = 0; i < body->surface.vertex_count; ++i)
    body->surface.vertices[i] = v_sub(body->surface.vertices[i], body->mass.centre_m);
  // A body that fills its hull but for a hundredth counts as convex: so does a ball of flat faces.
  static const double HULL = 1e-2; // what the hull may leave out, in thicknesses
  sonde_mesh_report own = {0}, hull = {0};
  double area_m2, tolerance_m = HULL * sonde_mesh_thickness(&body->surface, &area_m2);
  status = sonde_convex_hull_within(body->surface.vertices, body->surface.vertex_count, tolerance_m,
                                    &body->convex, &error);
  if (!status) status = sonde_mesh_inspect(&body->convex.hull, &hull, &error);
  if (!status) status = sonde_mesh_inspect(&body->surface, &own, &error);
  if (status)
    sonde_reader_pass(reader, at, &error);
  else if (own.volume_m3 < 0.99 * hull.volume_m3)
    sonde_convex_clear(&body->convex);
}

// A thigh of two layers, or one of springs or tetrahedra through its volume.
static void read_model(const sonde_scene_source *source, sonde_place at, sonde_body *body) {
  sonde_reader *reader = source->reader;
  const char *name = sonde_read_text(reader, at, "model", true);
  if (!name) return;
  char path[1024];
  bool bundled = strcmp(name, "thigh") == 0, solid = body->kind == SONDE_BODY_VOLUMETRIC;
  if (bundled && !source->thigh) {
    sonde_reader_fail(reader, sonde_read_find(reader, at, "model"), SONDE_NOT_FOUND,
                      "the bundled thigh was not found");
    return;
  }
  sonde_source_path(source, name, path, sizeof path);
  sonde_error error = {0};
  sonde_model **model = solid ? &body->solid : &body->model;
  sonde_status status = sonde_model_load(bundled ? source->thigh : path, model, &error);
  if (!status && solid != ((*model)->bulk != NULL))
    status = sonde_fail(&error, SONDE_ARGUMENT, "%.300s: a %s model, expected kind: %s", path,
                        solid ? "two-layer" : "volumetric", solid ? "two_layer" : "volumetric");
  if (!status) status = sonde_mesh_copy(&(*model)->surface, &body->surface, &error);
  uint32_t skin = body->surface.vertex_count, pairs = 0;
  sonde_nodes nodes = {0};
  if (!status) {
    nodes = sonde_model_nodes(*model);
    pairs = solid ? sonde_node_pairs(&nodes, NULL) : 0;
    status = sonde_body_allocate(body, nodes.count, pairs, &error);
  }
  if (!status && solid) {
    body->surface_node = SONDE_NEW(uint32_t, skin);
    if (!body->surface_node) status = sonde_fail_memory(&error);
  }
  if (status) {
    sonde_reader_pass(reader, sonde_read_find(reader, at, "model"), &error);
    return;
  }
  body->sags = sonde_read_bool(reader, at, "sags", false);
  memcpy(body->node, nodes.rest, nodes.count * sizeof *body->node);
  memcpy(body->node_mass_kg, nodes.mass_kg, nodes.count * sizeof *body->node_mass_kg);
  if (!solid) return;
  sonde_node_pairs(&nodes, body->pairs);
  for (uint32_t i = 0; i < skin; ++i) body->surface_node[i] = i;
}

typedef struct box {
  sonde_vec3 low, high;
  uint32_t nodes; // of the body in it
} box;

// Boxes reach 1e-9 m further, so that a face of a body can be named by its own coordinate.
static bool is_within(const box *b, sonde_vec3 p) {
  const double grow = 1e-9;
  return p.x >= b->low.x - grow && p.y >= b->low.y - grow && p.z >= b->low.z - grow &&
         p.x <= b->high.x + grow && p.y <= b->high.y + grow && p.z <= b->high.z + grow;
}

// A box that holds nodes of the body, by its lower and its upper corner.
static box read_box(sonde_reader *reader, sonde_place at, const sonde_body *body) {
  box found = {{0, 0, 0}, {0, 0, 0}, 0};
  if (sonde_read_count(reader, at) != 2) {
    sonde_reader_fail(reader, at, SONDE_FORMAT, "a box must be two corners [[x,y,z], [x,y,z]]");
    return found;
  }
  sonde_vec3 corner[2];
  for (uint32_t k = 0; k < 2; ++k)
    corner[k] = sonde_read_vector_at(reader, sonde_read_item(reader, at, k), "a corner",
                                     SONDE_SCENE_FAR_MM);
  sonde_vec3 a = corner[0], b = corner[1];
  if (!(a.x <= b.x && a.y <= b.y && a.z <= b.z))
    sonde_reader_fail(reader, at, SONDE_ARGUMENT,
                      "the first corner of a box must be the lower one");
  found.low = v_scale(a, 1e-3);
  found.high = v_scale(b, 1e-3);
  for (uint32_t i = 0; i < body->node_count; ++i) found.nodes += is_within(&found, body->node[i]);
  if (!found.nodes) sonde_reader_fail(reader, at, SONDE_ARGUMENT, "the box holds no node");
  return found;
}

static void read_deformable(const sonde_scene_source *source, sonde_place at, sonde_body *body) {
  static const char *const LOAD_KEYS[] = {"box_mm", "force_n", NULL};
  sonde_reader *reader = source->reader;
  sonde_place lattice = sonde_read_find(reader, at, "lattice");
  if (body->motion == SONDE_BODY_DRIVEN)
    sonde_reader_fail(reader, at, SONDE_FORMAT, "only a rigid body can be driven");
  if (body->kind == SONDE_BODY_TWO_LAYER || body->kind == SONDE_BODY_VOLUMETRIC)
    read_model(source, at, body);
  else if (body->kind == SONDE_BODY_LATTICE)
    sonde_read_lattice(source, at, body);
  else {
    sonde_read_shape(source, sonde_read_find(reader, at, "shape"), &body->surface);
    if (sonde_reader_good(reader)) sonde_read_springs(source, at, body);
  }
  if (lattice && body->kind != SONDE_BODY_LATTICE)
    sonde_reader_fail(reader, lattice, SONDE_FORMAT, "lattice belongs to a body of kind lattice");
  if (!sonde_reader_good(reader)) return;
  // The body moves to its place.
  for (uint32_t i = 0; i < body->node_count; ++i)
    body->node[i] = pose_apply(body->start, body->node[i]);
  for (uint32_t i = 0; i < body->surface.vertex_count; ++i)
    body->surface.vertices[i] = pose_apply(body->start, body->surface.vertices[i]);
  sonde_vec3 sum = vec3(0, 0, 0);
  double mass = 0;
  for (uint32_t i = 0; i < body->node_count; ++i) {
    mass += body->node_mass_kg[i];
    sum = v_madd(sum, body->node_mass_kg[i], body->node[i]);
  }
  body->mass = (sonde_mass){.mass_kg = mass, .centre_m = v_scale(sum, 1 / mass)};
  const sonde_bulk *bulk = body->solid ? body->solid->bulk : NULL;
  uint32_t inner = bulk ? bulk->node_count + bulk->held_count : 0;
  for (uint32_t i = 0; i < inner; ++i) // those that the bone holds too
    bulk->node[i] = pose_apply(body->start, bulk->node[i]);
  for (uint32_t i = 0; body->model && i < body->node_count; ++i) {
    body->model->surface.vertices[i] = body->node[i];
    body->model->normal[i] = q_rotate(body->start.rotation, body->model->normal[i]);
  }
  sonde_mesh_report report = {0};
  sonde_error error = {0};
  if (sonde_mesh_inspect(&body->surface, &report, &error)) sonde_reader_pass(reader, at, &error);
  body->closed = report.closed && report.outward;
  body->rest_volume_m3 = report.volume_m3;
  if (body->bulk_n_m5 > 0 && !body->closed)
    sonde_reader_fail(reader, at, SONDE_MESH, "bulk_n_m5 needs a closed mesh");
  sonde_read_self(reader, at, body);
  sonde_place held = sonde_read_find(reader, at, "held_mm");
  for (uint32_t k = 0, count = sonde_read_count(reader, held); k < count; ++k) {
    sonde_place entry = sonde_read_item(reader, held, k);
    box b = read_box(reader, entry, body);
    for (uint32_t i = 0; i < body->node_count; ++i) body->held[i] |= is_within(&b, body->node[i]);
  }
  if (body->motion == SONDE_BODY_FIXED) memset(body->held, 1, body->node_count);
  sonde_place loads = sonde_read_find(reader, at, "loads");
  for (uint32_t k = 0, count = sonde_read_count(reader, loads); k < count; ++k) {
    sonde_place entry = sonde_read_item(reader, loads, k);
    sonde_read_keys(reader, entry, "loads", LOAD_KEYS);
    box b = read_box(reader, sonde_read_find(reader, entry, "box_mm"), body);
    sonde_vec3 force = sonde_read_vector(reader, entry, "force_n", 1e9, vec3(0, 0, 0));
    for (uint32_t i = 0; b.nodes && i < body->node_count; ++i)
      if (is_within(&b, body->node[i]))
        body->load_n[i] = v_madd(body->load_n[i], 1.0 / b.nodes, force);
  }
}

void sonde_read_body(const sonde_scene_source *source, sonde_place at, const sonde_scene *scene,
                     sonde_body *body) {
  SONDE_ASSERT(source->reader && body);
  static const char *const KEYS[] = {"name",
                                     "kind",
                                     "shape",
                                     "motion",
                                     "position_mm",
                                     "rotation",
                                     "material",
                                     "mass_kg",
                                     "density_kg_m2",
                                     "density_kg_m3",
                                     "velocity_m_s",
                                     "spin_rad_s",
                                     "path",
                                     "springs",
                                     "lattice",
                                     "model",
                                     "held_mm",
                                     "loads",
                                     "sags",
                                     "self_contact_mm",
                                     NULL};
  static const char *const KINDS[] = {"rigid",     "springs",    "lattice",
                                      "two_layer", "volumetric", NULL};
  static const char *const MOTIONS[] = {"free", "fixed", "driven", NULL};
  sonde_reader *reader = source->reader;
  sonde_read_keys(reader, at, "a body", KEYS);
  const char *name = sonde_read_text(reader, at, "name", true);
  if (!sonde_reader_good(reader)) return;
  snprintf(body->name, sizeof body->name, "%s", name);
  if (strspn(name, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-") !=
          strlen(name) ||
      strlen(name) >= sizeof body->name)
    sonde_reader_fail(reader, sonde_read_find(reader, at, "name"), SONDE_FORMAT,
                      "name '%s': expected up to 63 letters, digits, _ and -", name);
  body->place = at;
  body->kind = (sonde_body_kind)sonde_read_choice(reader, at, "kind", KINDS, SONDE_BODY_RIGID);
  body->motion =
      (sonde_body_motion)sonde_read_choice(reader, at, "motion", MOTIONS, SONDE_BODY_FREE);
  body->start = read_pose(reader, at);
  body->velocity_m_s =
      sonde_read_vector(reader, at, "velocity_m_s", SONDE_SCENE_FASTEST, vec3(0, 0, 0));
  body->spin_rad_s =
      sonde_read_vector(reader, at, "spin_rad_s", SONDE_SCENE_FASTEST, vec3(0, 0, 0));
  const char *material = sonde_read_text(reader, at, "material", false);
  for (uint32_t i = 0; i < scene->material_count && material; ++i)
    if (strcmp(scene->materials[i].name, material) == 0) {
      body->material = scene->materials[i];
      material = NULL;
    }
  if (material)
    sonde_reader_fail(reader, sonde_read_find(reader, at, "material"), SONDE_NOT_FOUND,
                      "no material '%s'", material);
  if (body->motion == SONDE_BODY_DRIVEN) read_path(reader, at, body);
  if (!sonde_reader_good(reader)) return;
  if (sonde_body_is_rigid(body))
    read_rigid(source, at, body);
  else
    read_deformable(source, at, body);
}

void sonde_body_clear(sonde_body *body) {
  sonde_mesh_clear(&body->surface);
  sonde_convex_clear(&body->convex);
  sonde_free(body->surface_node);
  sonde_free(body->path.time_s);
  sonde_free(body->path.pose);
  sonde_free(body->node);
  sonde_free(body->node_mass_kg);
  sonde_free(body->held);
  sonde_free(body->load_n);
  sonde_free(body->pairs);
  sonde_free(body->spring);
  sonde_free(body->crease);
  sonde_free(body->self_area_m2);
  sonde_model_destroy(body->model);
  sonde_model_destroy(body->solid);
}
