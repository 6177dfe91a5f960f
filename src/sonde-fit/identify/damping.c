// Damping and stiffness from ramps and holds; the dampers of edges only when the records tell.
#include "identify/inverse.h"

#include "base/maths.h"

enum { NORMAL, SCALE, EDGE, COUNT };

static void apply(const double *theta, sonde_surface_law *law, sonde_world_def *def,
                  double *scale) {
  (void)def;
  law->normal_damping_s = exp(theta[NORMAL]);
  law->edge_damping_s = exp(theta[EDGE]);
  *scale = exp(theta[SCALE]);
}

static uint32_t count_samples(const sonde_motion_record *record, const sonde_drive *drive) {
  SONDE_ASSERT(drive->count == record->count);
  return record->count;
}

static void compare(const sonde_motion_record *record, const sonde_drive *drive,
                    const double *normal_n, const double *tangential_n, double *residual) {
  (void)drive, (void)tangential_n;
  for (uint32_t k = 0; k < record->count; ++k)
    residual[k] = normal_n[k] - record->samples[k].normal_n;
}

// One iteration per tick feels live, but at 100 mm/s it shows 1.8 times the force of the converged
// step (docs/identify.md): here forces must be right.
sonde_world_def sonde_identify_world(void) {
  sonde_world_def def = sonde_world_def_default();
  def.newton_iterations = 5;
  def.pcg.relative_residual = 1e-3;
  def.pcg.absolute_residual = 1e-12;
  def.sleep_displacement_m = 5e-6;
  return def;
}

sonde_identify_options sonde_identify_options_default(void) {
  return (sonde_identify_options){.max_iterations = 12, .world = sonde_identify_world()};
}

sonde_status sonde_identify_damping(const sonde_model *model, const sonde_motion_record *records,
                                    uint32_t count, const sonde_identify_options *options,
                                    const sonde_progress *progress, sonde_damping_result *result,
                                    sonde_error *error) {
  sonde_identify_options fallback = sonde_identify_options_default();
  *result = (sonde_damping_result){0};
  if (!count) return sonde_fail(error, SONDE_ARGUMENT, "no record, expected at least one");
  const double low = 1e-6, high = 10; // s
  sonde_inverse in = {.model = model,
                      .records = records,
                      .record_count = count,
                      .options = options ? options : &fallback,
                      .progress = progress,
                      .parameter_count = EDGE,
                      .apply = apply,
                      .count = count_samples,
                      .compare = compare,
                      .step = {0.2, 0.05, 0.7}};
  for (int p = 0; p < COUNT; ++p) in.low[p] = log(low), in.high[p] = log(high);
  in.low[SCALE] = log(0.05);
  in.high[SCALE] = log(20);
  in.theta[NORMAL] = log(clamp(model->law.normal_damping_s, 1e-3, high));
  in.theta[EDGE] = log(clamp(model->law.edge_damping_s, 1e-5, high));
  sonde_status status = sonde_inverse_solve(&in, error);
  if (status) return status;
  // What the records say about the edges, at the place found without them.
  sonde_identify_options look = *in.options;
  look.max_iterations = 0;
  sonde_inverse all = in;
  all.options = &look;
  all.parameter_count = COUNT;
  all.iterations = 0;
  status = sonde_inverse_solve(&all, error);
  sonde_estimate edge = sonde_inverse_estimate(&all, EDGE);
  double sensitivity = all.sensitivity[EDGE];
  if (!status && edge.identified) { // otherwise it would only follow the noise
    all.options = in.options;
    status = sonde_inverse_solve(&all, error);
    if (sonde_inverse_estimate(&all, EDGE).identified) in = all;
    if (in.parameter_count == COUNT) edge = sonde_inverse_estimate(&in, EDGE);
  }
  in.simulations = in.simulations > all.simulations ? in.simulations : all.simulations;
  if (status) return status;
  *result = (sonde_damping_result){.normal_damping_s = sonde_inverse_estimate(&in, NORMAL),
                                   .stiffness_scale = sonde_inverse_estimate(&in, SCALE),
                                   .edge_damping_s = edge,
                                   .edge_sensitivity_n = sensitivity,
                                   .residual_n = in.rms,
                                   .iterations = in.iterations,
                                   .simulations = in.simulations,
                                   .samples = in.samples};
  return status;
}
