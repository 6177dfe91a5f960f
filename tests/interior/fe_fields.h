// Displacements inside a leg under a bonded probe of 60 x 12 mm from an independent finite-element
// study (tests/data/fields_A), the leg that they belong to, and how far an interior is from them.
#ifndef SONDE_TEST_FE_FIELDS_H
#define SONDE_TEST_FE_FIELDS_H

#include "interior/tube.h"

#include <stdio.h>
#include <stdlib.h>

typedef struct fe_node {
  char layer[8];
  sonde_vec3 rest, move;
} fe_node;

static inline uint32_t read_field(int site, int penetration_mm, fe_node *nodes, uint32_t capacity) {
  char path[512], line[256];
  snprintf(path, sizeof path,
           SONDE_SOURCE_DIR "/tests/data/fields_A/displacement_site%02d_linear.csv", site);
  FILE *file = fopen(path, "r");
  uint32_t count = 0;
  if (file == NULL) return 0;
  while (fgets(line, sizeof line, file) != NULL && count < capacity) {
    fe_node *n = &nodes[count];
    int step, id;
    double v[6];
    if (sscanf(line, "%d,%d,%7[a-z],%lf,%lf,%lf,%lf,%lf,%lf", &step, &id, n->layer, &v[0], &v[1],
               &v[2], &v[3], &v[4], &v[5]) != 9 ||
        step != penetration_mm)
      continue;
    n->rest = v_scale(vec3(v[0], v[1], v[2]), 1e-3);
    n->move = v_scale(vec3(v[3], v[4], v[5]), 1e-3);
    ++count;
  }
  fclose(file);
  return count;
}

// The skin nodes come column by column along z; the leg is built from exactly these nodes.
static inline tube fe_leg(const fe_node *nodes, uint32_t count, sonde_vec3 **moved) {
  uint32_t skin = 0, rows = 0, first = 0;
  while (strcmp(nodes[first].layer, "skin") != 0) ++first;
  skin = count - first;
  while (rows < skin && (rows == 0 || nodes[first + rows].rest.z > 0)) ++rows;
  tube t = {.around = skin / rows, .rows = rows};
  sonde_vec3 *points = SONDE_NEW(sonde_vec3, skin);
  *moved = SONDE_NEW(sonde_vec3, skin + 2);
  for (uint32_t i = 0; i < t.around; ++i)
    for (uint32_t j = 0; j < rows; ++j) {
      const fe_node *n = &nodes[first + i * rows + j];
      points[j * t.around + i] = n->rest;
      (*moved)[j * t.around + i] = v_add(n->rest, n->move);
    }
  tube_surface(&t.model.surface, t.around, rows, points);
  memcpy(*moved + skin, t.model.surface.vertices + skin, 2 * sizeof **moved);
  tube_round(&t.model.femur, 48, 12, vec3(-9e-3, 9e-3, 0), vec3(-5e-3, 4e-3, 0.3), 0.014, 0.014);
  tube_finish(&t, 1.8e-3, 0.012);
  sonde_free(points);
  return t;
}

typedef struct site_row {
  sonde_vec3 at, normal, u, v;
  double fat_m;
} site_row;

static inline bool read_site(int site, site_row *row) {
  char line[512];
  FILE *file = fopen(SONDE_SOURCE_DIR "/data/thigh/sites.csv", "r");
  bool found = false;
  while (file != NULL && !found && fgets(line, sizeof line, file) != NULL) {
    double v[14];
    char *at = line;
    for (int i = 0; i < 14; ++i) v[i] = at != NULL ? strtod(strsep(&at, ","), NULL) : 0;
    if (line[0] == 's' || (int)v[0] != site) continue;
    row->at = v_scale(vec3(v[1], v[2], v[3]), 1e-3), row->normal = vec3(v[4], v[5], v[6]);
    row->u = vec3(v[7], v[8], v[9]), row->v = vec3(v[10], v[11], v[12]);
    row->fat_m = v[13] * 1e-3;
    found = true;
  }
  if (file != NULL) fclose(file);
  return found;
}

// Fat below every skin node from the study's muscle surface.
static inline void fe_layers(tube *t) {
  sonde_mesh muscle = {0};
  sonde_surface_index *index = NULL;
  sonde_error error;
  if (sonde_mesh_load(SONDE_SOURCE_DIR "/data/thigh/muscle_surface.ply", 1e-3, &muscle, &error) !=
      SONDE_OK)
    fail_msg("%s", error.message);
  assert_int_equal(sonde_surface_index_create(&muscle, &index, NULL), SONDE_OK);
  for (uint32_t i = 0; i < t->model.surface.vertex_count; ++i) {
    sonde_vec3 p = t->model.surface.vertices[i];
    double away = fabs(sonde_surface_closest(index, p).distance_m);
    t->model.muscle_depth_m[i] = fmax(away, 4e-3);
  }
  sonde_surface_index_destroy(index);
  sonde_mesh_clear(&muscle);
}

typedef struct tally {
  double error, plane_error, move;
  uint32_t used, plane;
} tally;

// Nodes below the skin: those that move over 1 mm, and those of the image plane (2 mm thick, as
// wide as the probe).
static inline tally compare(const sonde_interior *in, const fe_node *nodes, uint32_t count,
                            const site_row *site) {
  tally t = {0};
  for (uint32_t i = 0; i < count; ++i) {
    if (strcmp(nodes[i].layer, "skin") == 0) continue;
    sonde_vec3 d = v_sub(nodes[i].rest, site->at);
    double error = v_distance(sonde_interior_displacement(in, nodes[i].rest), nodes[i].move);
    bool plane = fabs(v_dot(d, site->v)) < 2e-3 && fabs(v_dot(d, site->u)) < 30e-3 &&
                 v_dot(d, site->normal) > -0.08;
    if (plane) t.plane_error += error, ++t.plane;
    if (v_norm(nodes[i].move) < 1e-3) continue;
    t.error += error, t.move += v_norm(nodes[i].move), ++t.used;
  }
  return t;
}

static const int field_sites[] = {9, 12, 18, 27, 30, 36, 45, 52};

#endif
