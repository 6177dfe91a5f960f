// measure_condense MODEL [EDGE_MM [FINE_MM]]: times of a thigh of linear tetrahedra. Its mesh, its
// stiffness and factor, the condensation on the skin of the sites with its inverse, then for every
// site a flat square footprint of 24 mm pressed 10 mm deep, bonded and sliding, from the condensed
// compliance, and for one site from the whole solid.
#include "elements/condense.h"
#include "base/base.h"
#include "base/clock.h"
#include "base/maths.h"
#include "sonde/tissue.h"

#include <stdlib.h>
#include <string.h>

static void stop_on(sonde_status status, const sonde_error *error) {
  if (!status) return;
  fprintf(stderr, "%s\n", error->message);
  exit(1);
}

// Nodes of the list within the square footprint of a site and the plate's way to each.
static uint32_t footprint(const sonde_tetrahedra *t, const uint32_t *list, uint32_t count,
                          const sonde_site *site, uint32_t *places, double *gap) {
  uint32_t found = 0;
  double top = -INFINITY;
  for (uint32_t k = 0; k < count; ++k) {
    sonde_vec3 from = v_sub(t->node[list[k]], site->position_m);
    if (fabs(v_dot(from, site->u)) > 0.012 || fabs(v_dot(from, site->v)) > 0.012) continue;
    if (fabs(v_dot(from, site->normal)) > 0.02) continue;
    gap[found] = v_dot(from, site->normal), places[found++] = k;
    top = fmax(top, gap[found - 1]);
  }
  for (uint32_t k = 0; k < found; ++k) gap[k] = top - gap[k];
  return found;
}

int main(int argc, char **argv) {
  enum { MOST = 4096 };
  sonde_error error = {0};
  sonde_model *model = NULL;
  if (argc < 2) return 2;
  stop_on(sonde_model_load(argv[1], &model, &error), &error);
  sonde_vec3 *sites = calloc(model->site_count, sizeof *sites);
  for (uint32_t k = 0; k < model->site_count; ++k) sites[k] = model->sites[k].position_m;
  const double edge = argc > 2 ? strtod(argv[2], NULL) * 1e-3 : 0.010;
  sonde_tetrahedra_def how = {.edge_m = edge};
  if (argc > 3)
    how.growth = 0.8, how.fine = sites, how.fine_count = model->site_count,
    how.fine_edge_m = strtod(argv[3], NULL) * 1e-3, how.fine_reach_m = 0.015;

  double clock[6] = {sonde_clock_now()};
  sonde_tetrahedra t;
  stop_on(sonde_tetrahedralise(&model->surface, &model->femur, &how, &t, &error), &error);
  clock[1] = sonde_clock_now();
  // Kept: the skin, or only what lies within 35 mm of a site when the mesh is graded.
  uint32_t *kept = calloc(t.surface_count, sizeof *kept), count = 0;
  for (uint32_t i = 0; i < t.surface_count; ++i) {
    double nearest = v_distance(sites[v_nearest(sites, model->site_count, t.node[i])], t.node[i]);
    if (argc <= 3 || nearest < 0.02) kept[count++] = i;
  }
  const sonde_elastic_def def = {.mesh = &t, .last = kept, .last_count = count};
  sonde_elastic *solid;
  stop_on(sonde_elastic_create(&def, &solid, &error), &error);
  clock[2] = sonde_clock_now();
  double *young = calloc(t.count, sizeof *young);
  for (uint32_t k = 0; k < t.count; ++k) young[k] = 1e4;
  stop_on(sonde_elastic_set(solid, young, 0.479, 0, &error), &error);
  clock[3] = sonde_clock_now();
  sonde_condensed *condensed;
  sonde_condensed_times times;
  stop_on(sonde_condensed_create(solid, 0, &condensed, &times, &error), &error);
  double megabytes = 72e-6 * (double)count * (double)count;
  printf("mesh: %u nodes, %u tetrahedra, %.2f s\n", t.node_count, t.count, clock[1] - clock[0]);
  printf("pattern and analysis %.2f s; stiffness and factor %.2f s, %.0f MB\n", clock[2] - clock[1],
         clock[3] - clock[2], 4e-6 * (double)solid->symbolic->factor_size);
  printf("condensed on %u nodes: analysis %.2f s, factor %.2f s, inverse %.2f s; stiffness and "
         "compliance %.0f MB each\n",
         count, times.analysis_s, times.factor_s, times.inverse_s, megabytes);

  uint32_t *places = calloc(MOST, sizeof *places);
  double *gap = calloc(MOST, sizeof *gap), sum[2] = {0, 0}, force[2] = {0, 0}, nodes = 0;
  const double depth = 0.01;
  for (uint32_t k = 0; k < model->site_count; ++k) {
    uint32_t found = footprint(&t, kept, count, &model->sites[k], places, gap);
    nodes += (double)found / model->site_count;
    for (int sliding = 0; sliding < 2 && found; ++sliding) {
      const sonde_plate plate = {.places = places,
                                 .count = found,
                                 .inward = v_neg(model->sites[k].normal),
                                 .gap_m = sliding ? gap : NULL,
                                 .bonded = !sliding};
      double start = sonde_clock_now(), f;
      stop_on(sonde_condensed_press(condensed, &plate, &depth, 1, &f, NULL, &error), &error);
      sum[sliding] += (sonde_clock_now() - start) / model->site_count;
      force[sliding] += f / model->site_count;
    }
  }
  printf(
      "footprints of %.0f nodes: bonded %.3f ms a press (mean %.3f N), sliding %.3f ms (%.3f N)\n",
      nodes, 1e3 * sum[0], force[0], 1e3 * sum[1], force[1]);

  // The same press of the first site without condensation.
  sonde_elastic_scratch *scratch;
  stop_on(sonde_elastic_scratch_create(solid, &scratch, &error), &error);
  uint32_t found = footprint(&t, kept, count, &model->sites[0], places, gap);
  double *u = calloc(3 * (size_t)solid->count, sizeof *u);
  double *f = calloc(3 * (size_t)solid->count, sizeof *f), whole = 0, dense = 0;
  sonde_vec3 inward = v_neg(model->sites[0].normal);
  const sonde_plate plate = {.places = places, .count = found, .inward = inward, .bonded = true};
  stop_on(sonde_condensed_press(condensed, &plate, &depth, 1, &dense, NULL, &error), &error);
  for (uint32_t k = 0; k < found; ++k) {
    double *to = u + 3 * (size_t)solid->unknown[places[k] = kept[places[k]]];
    to[0] = depth * inward.x, to[1] = depth * inward.y, to[2] = depth * inward.z;
  }
  clock[4] = sonde_clock_now();
  stop_on(sonde_elastic_solve(solid, scratch, places, found, f, u, &error), &error);
  clock[5] = sonde_clock_now();
  for (uint32_t k = 0; k < found; ++k) {
    const double *from = f + 3 * (size_t)solid->unknown[places[k]];
    whole += v_dot(inward, vec3(from[0], from[1], from[2]));
  }
  printf("the whole solid: %.0f ms a press; forces %.6f and %.6f N, apart by %.1e\n",
         1e3 * (clock[5] - clock[4]), whole, dense, fabs(whole / dense - 1));
  free(u), free(f), free(places), free(gap), free(young), free(kept), free(sites);
  sonde_elastic_scratch_destroy(scratch);
  sonde_condensed_destroy(condensed);
  sonde_elastic_destroy(solid);
  sonde_tetrahedra_clear(&t);
  sonde_model_destroy(model);
  return 0;
}
