// Presses the linear probe 12 mm deep at the first site, cuts the skin beside it in mid-step and
// prints the force until it has settled again.  usage: sample_live_cut MODEL
#include "sonde/sonde.h"

#include <math.h>
#include <stdio.h>

typedef struct scene {
  sonde_model *model;
  sonde_state *state;
} scene;

static void release(scene *s) {
  sonde_state_destroy(s->state);
  sonde_model_destroy(s->model);
}

// Length of the force on the probe after some steps with the probe held.
static double hold(scene *s, const sonde_probe *probe, sonde_pose pose, int steps) {
  for (int k = 0; k < steps; ++k) sonde_step(s->state, probe, pose);
  sonde_vec3 f = sonde_state_contact(s->state)->force_n;
  return sqrt(f.x * f.x + f.y * f.y + f.z * f.z);
}

// The node of the skin that lies nearest the place a u + b v from the site.
static sonde_vec3 on_skin(const scene *s, const sonde_site *site, double a, double b) {
  const sonde_vec3 *x = sonde_state_positions(s->state);
  sonde_vec3 best = x[0], o = site->position_m, u = site->u, v = site->v;
  double least = INFINITY;
  for (uint32_t i = 0; i < s->model->surface.vertex_count; ++i) {
    double dx = x[i].x - (o.x + a * u.x + b * v.x), dy = x[i].y - (o.y + a * u.y + b * v.y);
    double dz = x[i].z - (o.z + a * u.z + b * v.z), d = dx * dx + dy * dy + dz * dz;
    if (d < least) least = d, best = x[i];
  }
  return best;
}

int main(int argc, char **argv) {
  scene now = {0}, next;
  sonde_probe probe = {0};
  sonde_cut_map map = {0};
  sonde_error error = {.message = "usage: sample_live_cut MODEL"};
  int result = 1;
  if (argc != 2 || sonde_model_load(argv[1], &now.model, &error) ||
      sonde_probe_create("linear", &probe, &error) ||
      sonde_state_create(now.model, NULL, &now.state, &error))
    goto done;
  const sonde_site site = now.model->sites[0];
  sonde_pose pose = sonde_site_pose(&site, 0.012);
  double before = hold(&now, &probe, pose, 500);
  const sonde_vec3 path[2] = {on_skin(&now, &site, -0.035, 0.01),
                              on_skin(&now, &site, 0.035, 0.01)};
  if (sonde_state_cut(now.state, path, 2, &next.model, &next.state, &map, &error)) goto done;
  release(&now);
  now = next;
  printf("before %.3f N, cut %.1f mm long, %u nodes split\n", before, map.length_m * 1e3,
         map.added);
  for (int k = 0; k < 5; ++k)
    printf("%3d ms after the cut %.3f N\n", 20 * (k + 1), hold(&now, &probe, pose, 20));
  double after = hold(&now, &probe, pose, 400);
  printf("at rest %.3f N: %.1f %% less\n", after, 100 * (1 - after / before));
  result = after < before && !sonde_state_flags(now.state) ? 0 : 1;
  error.message[0] = 0;
done:
  if (error.message[0]) fprintf(stderr, "%s\n", error.message);
  sonde_cut_map_clear(&map);
  release(&now);
  sonde_probe_clear(&probe);
  return result;
}
