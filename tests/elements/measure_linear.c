// measure_linear MODEL [EVERY [FINE_MM [EDGE_MM]]]: the linear elastic material that follows a
// thigh's measurements best, at every EVERY-th site (8): Young's moduli of fat and muscle and a
// membrane for the skin, fitted to both probes at once with errors over the mean force of the
// probe. The footprints are bonded, the femur holds, the cut ends do not move along the leg. Beside
// it the errors when every curve has a proportion of its own, which no linear material can beat.
#include "elements/moduli.h"
#include "base/base.h"
#include "base/clock.h"
#include "base/maths.h"
#include "sonde/tissue.h"

#include <stdlib.h>
#include <string.h>

enum { MOST_SITES = 64, MOST_NODES = 2000, PROBES = 2 };
static const double POISSON = 0.479;
static const char *const PROBE[PROBES] = {"point", "linear"};
static const double HALF[PROBES][2] = {{0.003, 0.003}, {0.030, 0.006}};

static void stop_on(sonde_status status, const sonde_error *error) {
  if (!status) return;
  fprintf(stderr, "%s\n", error->message);
  exit(1);
}

static const sonde_site *site_of(const sonde_model *model, uint32_t id) {
  for (uint32_t k = 0; k < model->site_count; ++k)
    if (model->sites[k].id == id) return &model->sites[k];
  return NULL;
}

// Mean absolute error, its share of the probe's mean force.
static void print_errors(const char *what, const sonde_model *model, const bool *taken,
                         const double (*stiffness)[PROBES]) {
  for (int p = 0; p < PROBES; ++p) {
    double sum = 0, force = 0, count = 0;
    for (uint32_t k = 0; k < model->datum_count; ++k) {
      const sonde_datum *d = &model->data[k];
      if (!taken[d->site] || strcmp(d->probe, PROBE[p]) != 0) continue;
      sum += fabs(stiffness[d->site][p] * d->penetration_m - d->force_n);
      force += d->force_n, ++count;
    }
    printf("%s, %s: %.3f N, %.1f %% of the mean force of %.2f N (%.0f rows)\n", what, PROBE[p],
           sum / count, 100 * sum / force, force / count, count);
  }
}

int main(int argc, char **argv) {
  sonde_error error = {0};
  sonde_model *model = NULL;
  if (argc < 2) return 2;
  setvbuf(stdout, NULL, _IOLBF, 0);
  stop_on(sonde_model_load(argv[1], &model, &error), &error);
  const uint32_t every = argc > 2 ? (uint32_t)atoi(argv[2]) : 8;
  const double fine = argc > 3 ? strtod(argv[3], NULL) * 1e-3 : 0.003;
  bool taken[MOST_SITES] = {false};
  sonde_vec3 places[5 * MOST_SITES];
  uint32_t place_count = 0;
  for (uint32_t k = every / 2; k < model->site_count; k += every) {
    const sonde_site *s = &model->sites[k];
    if (s->id >= MOST_SITES) continue;
    taken[s->id] = true;
    for (int q = -2; q <= 2; ++q) places[place_count++] = v_madd(s->position_m, 0.012 * q, s->u);
  }
  double start = sonde_clock_now();
  const sonde_tetrahedra_def how = {.edge_m = argc > 4 ? strtod(argv[4], NULL) * 1e-3 : 0.016,
                                    .growth = 0.8,
                                    .fine = places,
                                    .fine_count = place_count,
                                    .fine_edge_m = fine,
                                    .fine_reach_m = 0.007};
  sonde_tetrahedra t;
  stop_on(sonde_tetrahedralise(&model->surface, &model->femur, &how, &t, &error), &error);

  // Layers by the depth below the skin; supports.
  uint32_t *group = calloc(t.count, sizeof *group);
  uint8_t *held = calloc(t.node_count, 1);
  sonde_surface_index *skin_index = NULL;
  stop_on(sonde_surface_index_create(&model->surface, &skin_index, &error), &error);
  for (uint32_t k = 0; k < t.count; ++k) {
    sonde_vec3 middle = vec3(0, 0, 0);
    for (int c = 0; c < 4; ++c) middle = v_madd(middle, 0.25, t.node[t.corner[k][c]]);
    sonde_surface_point p = sonde_surface_closest(skin_index, middle);
    double muscle = 0;
    for (int c = 0; c < 3; ++c)
      muscle += p.weight[c] * model->muscle_depth_m[model->surface.faces[p.face][c]];
    group[k] = p.distance_m > muscle;
  }
  double low = INFINITY, high = -INFINITY;
  for (uint32_t i = 0; i < t.node_count; ++i)
    low = fmin(low, t.node[i].z), high = fmax(high, t.node[i].z);
  for (uint32_t i = 0; i < t.node_count; ++i) {
    if (t.node[i].z < low + 1e-6 || t.node[i].z > high - 1e-6) held[i] = 4;
    if (i >= t.surface_count && i < t.surface_count + t.held_count) held[i] = 7;
  }
  // What was measured.
  static sonde_bonded_footprint prints[MOST_SITES * PROBES];
  static uint32_t nodes[MOST_SITES * PROBES][MOST_NODES];
  static uint32_t of_site[MOST_SITES * PROBES];
  static double best[MOST_SITES][PROBES], solved[MOST_SITES][PROBES];
  uint32_t count = 0, touched[PROBES] = {0};
  for (uint32_t id = 0; id < MOST_SITES; ++id)
    for (int p = 0; p < PROBES && taken[id]; ++p) {
      const sonde_site *s = site_of(model, id);
      double mean = 0, rows = 0, dd = 0, df = 0;
      for (uint32_t k = 0; k < model->datum_count; ++k)
        if (strcmp(model->data[k].probe, PROBE[p]) == 0) mean += model->data[k].force_n, ++rows;
      mean /= rows;
      for (uint32_t k = 0; k < model->datum_count; ++k) {
        const sonde_datum *d = &model->data[k];
        if (d->site != id || strcmp(d->probe, PROBE[p]) != 0) continue;
        dd += d->penetration_m * d->penetration_m, df += d->penetration_m * d->force_n;
      }
      if (!(dd > 0)) continue;
      best[id][p] = df / dd;
      sonde_bonded_footprint *to = &prints[count];
      *to = (sonde_bonded_footprint){.nodes = nodes[count],
                                     .inward = v_neg(s->normal),
                                     .stiffness_n_m = df / dd,
                                     .weight_m2 = dd / (mean * mean)};
      for (uint32_t i = 0; i < t.surface_count && to->count < MOST_NODES; ++i) {
        sonde_vec3 r = v_sub(t.node[i], s->position_m);
        if (fabs(v_dot(r, s->u)) <= HALF[p][0] && fabs(v_dot(r, s->v)) <= HALF[p][1] &&
            fabs(v_dot(r, s->normal)) < 0.025)
          nodes[count][to->count++] = i;
      }
      touched[p] += to->count;
      of_site[count++] = 2 * id + (uint32_t)p;
    }
  uint32_t *last = calloc(t.surface_count, sizeof *last), last_count = 0;
  uint8_t *listed = calloc(t.surface_count, 1);
  for (uint32_t k = 0; k < count; ++k)
    for (uint32_t i = 0; i < prints[k].count; ++i)
      if (!listed[prints[k].nodes[i]]++) last[last_count++] = prints[k].nodes[i];
  const sonde_elastic_def def = {.mesh = &t, .held = held, .last = last, .last_count = last_count};
  sonde_elastic *solid;
  stop_on(sonde_elastic_create(&def, &solid, &error), &error);
  solid->accuracy = 1e-4; // the work of a footprint is off by its square
  printf("%u nodes, %u tetrahedra, %.1f thousand million multiplications a factor, %.1f s\n",
         solid->count, t.count, 1e-9 * (double)solid->symbolic->macs, sonde_clock_now() - start);

  printf("%u curves; footprints of %.0f (point) and %.0f (linear) nodes\n", count,
         2.0 * touched[0] / count, 2.0 * touched[1] / count);
  print_errors("a proportion per curve", model, taken, (const double(*)[PROBES])best);

  double young[2] = {5e3, 1.2e4}, skin = 50, stiffness[MOST_SITES * PROBES];
  sonde_moduli_result result = {.stiffness = stiffness};
  start = sonde_clock_now();
  stop_on(
      sonde_moduli_fit(solid, POISSON, group, 2, prints, count, 0, young, &skin, &result, &error),
      &error);
  for (uint32_t k = 0; k < count; ++k) solved[of_site[k] / 2][of_site[k] % 2] = stiffness[k];
  printf("fat %.2f kPa, muscle %.2f kPa (Young), skin %.1f N/m; %u rounds, %.0f s\n",
         young[0] * 1e-3, young[1] * 1e-3, skin, result.rounds, sonde_clock_now() - start);
  print_errors("linear solid", model, taken, (const double(*)[PROBES])solved);
  sonde_surface_index_destroy(skin_index);
  sonde_elastic_destroy(solid);
  sonde_tetrahedra_clear(&t);
  sonde_model_destroy(model);
  free(group), free(held), free(last), free(listed);
  return 0;
}
