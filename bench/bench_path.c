// bench_path MODEL OUT.csv [SITE...]: the static press (sonde_settle_path) beside the stepping
// engine that presses the same way in 0.4 s and holds for 0.6 s, for the linear and the point probe
// at 5 to 25 mm. One row per press: site, probe, depth, both forces, jumps and Newton iterations of
// the static one. Without SITE: three sites spread over the model's list.
#include <sonde/sonde.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const double DEPTHS_M[] = {5e-3, 10e-3, 15e-3, 20e-3, 25e-3};
enum { DEPTHS = 5, PRESS_TICKS = 400, HOLD_TICKS = 600 };

static double force_along_beam(const sonde_state *state, const sonde_site *site) {
  sonde_vec3 f = sonde_state_contact(state)->force_n;
  return fabs(f.x * site->normal.x + f.y * site->normal.y + f.z * site->normal.z);
}

// Force of the engine in sessions' settings after a press and a hold.
static sonde_status press_in_time(const sonde_model *model, const sonde_probe *probe,
                                  const sonde_site *site, double depth_m, double *force_n,
                                  sonde_error *error) {
  sonde_world_def def = sonde_world_def_default();
  def.pcg = (sonde_pcg_options){5e-3, 1e-12, 200};
  sonde_state *state;
  sonde_status status = sonde_state_create(model, &def, &state, error);
  if (status) return status;
  for (int tick = 1; tick <= PRESS_TICKS + HOLD_TICKS; ++tick) {
    double share = fmin(1, (double)tick / PRESS_TICKS);
    sonde_step(state, probe, sonde_site_pose(site, share * depth_m));
  }
  *force_n = force_along_beam(state, site);
  sonde_state_destroy(state);
  return SONDE_OK;
}

static sonde_status compare(const sonde_model *model, const char *probe_name,
                            const sonde_site *site, FILE *out, sonde_error *error) {
  sonde_world_def def = sonde_world_def_default();
  sonde_state *state = NULL;
  sonde_probe probe;
  sonde_status status = sonde_probe_create(probe_name, &probe, error);
  if (status) return status;
  status = sonde_state_create(model, &def, &state, error);
  double from_m = -1e-3;
  for (int k = 0; k < DEPTHS && !status; ++k) {
    sonde_path_result r;
    double stepped_n = NAN;
    status = sonde_settle_path(state, &probe, sonde_site_pose(site, from_m),
                               sonde_site_pose(site, DEPTHS_M[k]), NULL, NULL, &r, error);
    if (!status) status = press_in_time(model, &probe, site, DEPTHS_M[k], &stepped_n, error);
    if (status) break;
    from_m = DEPTHS_M[k];
    fprintf(out, "%u,%s,%.0f,%.4f,%.4f,%u,%u\n", site->id, probe_name, 1e3 * from_m, r.force_n,
            stepped_n, r.jump_count, r.iterations);
    printf("site %2u %-6s %4.0f mm  static %8.4f N  stepped %8.4f N  %+6.2f %%  %u jumps\n",
           site->id, probe_name, 1e3 * from_m, r.force_n, stepped_n,
           100 * (r.force_n / stepped_n - 1), r.jump_count);
    fflush(stdout);
  }
  sonde_state_destroy(state);
  sonde_probe_clear(&probe);
  return status;
}

int main(int count, char **arguments) {
  if (count < 3) {
    fprintf(stderr, "usage: bench_path MODEL OUT.csv [SITE...]\n");
    return 2;
  }
  sonde_model *model = NULL;
  sonde_error error = {0};
  sonde_status status = sonde_model_load(arguments[1], &model, &error);
  FILE *out = status ? NULL : fopen(arguments[2], "w");
  if (!status && !out) perror(arguments[2]);
  if (out) fprintf(out, "site,probe,depth_mm,static_n,stepped_n,jumps,newton_iterations\n");
  for (uint32_t i = 0; out && i < model->site_count && !status; ++i) {
    uint32_t id = model->sites[i].id;
    bool wanted = count == 3 && i % (model->site_count / 3 + 1) == model->site_count / 6;
    for (int k = 3; k < count; ++k) wanted = wanted || strtoul(arguments[k], NULL, 10) == id;
    if (wanted) status = compare(model, "linear", &model->sites[i], out, &error);
    if (wanted && !status) status = compare(model, "point", &model->sites[i], out, &error);
  }
  if (status) fprintf(stderr, "bench_path: %s\n", error.message);
  if (out) fclose(out);
  sonde_model_destroy(model);
  return status || !out ? 1 : 0;
}
