// What a gate in the vessels of limbs reads off its spectrum, beside the truth of the network in
// the same gate: phasicity in the groin, reflux behind the knee with valves that leak. Usage:
// bench_gate TABLE.csv LIMB...
#include "sonde/flow_gate.h"
#include "sonde/limb_model.h"

#include "base/base.h"
#include "base/maths.h"

static const double shifted = 0.6; // of the base line
enum { COLUMNS = 1200, SLIDE = 20, BESIDE = 2 };

typedef struct course {
  uint32_t count;
  double mean[COLUMNS], truth[COLUMNS]; // by column, m/s along the beam
} course;

// The gate in the middle of a vein below a site, the probe along it, for 12 s; squeezed at 6 s.
static void listen(sonde_model *model, uint32_t site, sonde_interior *in, sonde_echo *echo,
                   double leak, double scale_m_s, course *c, double *slowest) {
  const sonde_site *place = sonde_model_site(model, site);
  SONDE_ASSERT(place != NULL);
  const sonde_pose across = sonde_site_pose(place, 0);
  sonde_pose along = across;
  along.rotation = q_mul(across.rotation, (sonde_quat){sqrt(0.5), 0, 0, sqrt(0.5)});
  sonde_pathology pathology;
  sonde_status status = sonde_pathology_preset("healthy", &pathology, NULL);
  sonde_vec3 *still = SONDE_NEW(sonde_vec3, model->surface.vertex_count);
  sonde_interior_update(in, &(sonde_interior_input){.positions_m = model->surface.vertices,
                                                    .contact_forces_n = still,
                                                    .world_from_probe = along,
                                                    .pathology = &pathology,
                                                    .dt_s = -1,
                                                    .tick = 1,
                                                    .face_half_x_m = 0.02,
                                                    .face_half_y_m = 0.01});
  // The vein below the middle of the face, and the probe moved over it.
  sonde_vessel_state vein;
  const bool there = sonde_interior_vessel_at_plane(in, 0, across, &vein);
  sonde_vec3 at = pose_apply_inverse(along, vein.centre_m);
  along.position = v_madd(along.position, at.y, q_rotate(along.rotation, vec3(0, 1, 0)));
  at.y = 0;
  sonde_image image;
  sonde_echo_settings settings = sonde_echo_settings_default();
  settings.depth_m = 0.06;
  if (!status) status = sonde_image_create(64, 64, &image, NULL);
  SONDE_ASSERT(!status && there);
  sonde_echo_render(echo, along, 0.04, &pathology, &settings, &image);
  sonde_image_clear(&image);
  sonde_flow_scene *scene = NULL;
  sonde_gate *gate = NULL;
  const sonde_limb *limb = sonde_limb_of(model);
  sonde_flow_def def = sonde_flow_def_default(limb);
  sonde_flow_def_hold(sonde_limb_pose_of(model), &def);
  def.leak = leak, def.squeeze_from_s = 6;
  sonde_flow flow;
  status = sonde_flow_scene_create(limb, in, &scene, NULL);
  if (!status) status = sonde_gate_create(&gate, NULL);
  if (!status) status = sonde_flow_start(&def, &flow, NULL);
  SONDE_ASSERT(!status);
  sonde_gate_settings s = sonde_gate_settings_default();
  s.x_m = at.x, s.z_m = at.z, s.scale_m_s = scale_m_s, s.filter_hz = 20;
  // The lean that sees more of the flow.
  const double steers[2] = {0.35, -0.35};
  sonde_gate_place where = {echo, 5e6, 0, 0};
  double best = 0;
  sonde_flow_scene_run(scene, &flow, 1);
  for (int k = 0; k < 2; ++k) {
    sonde_gate_settings tried = s;
    tried.steer_rad = steers[k];
    sonde_gate_put(gate, scene, &tried, &where);
    const double seen = fabs(sonde_gate_truth(gate, scene, echo));
    if (seen > best) best = seen, s.steer_rad = steers[k];
    // Room on the side to which the squeeze drives it.
    if (seen == best) s.baseline = sonde_gate_truth(gate, scene, echo) > 0 ? shifted : -shifted;
  }
  sonde_gate_forget(gate);
  sonde_flow_scene_listen(scene, gate);
  uint64_t first = 0, last = 0;
  *c = (course){0};
  static double truth[2 * COLUMNS]; // every 10 ms from 1 s on
  for (uint32_t n = 0; n < COLUMNS + 20; ++n) {
    sonde_gate_put(gate, scene, &s, &where);
    truth[n] = sonde_gate_truth(gate, scene, echo);
    sonde_flow_scene_run(scene, &flow, flow.time_s + SONDE_GATE_COLUMN_S);
    sonde_gate_column column[SONDE_GATE_COLUMNS];
    const uint32_t count = sonde_gate_columns(gate, column);
    for (uint32_t k = 0; k < count; ++k) {
      if (column[k].number <= last || c->count == COLUMNS) continue;
      if (!first) first = column[k].number;
      last = column[k].number;
      c->mean[c->count++] = (double)column[k].mean_m_s;
    }
  }
  // The truth in the middle of each column's window.
  const sonde_gate_spectrum axes = sonde_gate_axes(gate);
  for (uint32_t n = 0; n < c->count; ++n) {
    const double time_s = ((double)first + n) * SONDE_GATE_COLUMN_S - 0.5 * axes.window_s;
    const double x = clamp((time_s - 1) / SONDE_GATE_COLUMN_S, 0, COLUMNS + 18);
    c->truth[n] = truth[(int)x] + (x - floor(x)) * (truth[(int)x + 1] - truth[(int)x]);
  }
  *slowest = axes.slowest_m_s;
  sonde_gate_destroy(gate);
  sonde_flow_scene_destroy(scene);
  sonde_free(still);
}

// The median of five neighbours.
static double median(const course *c, uint32_t n) {
  double near[2 * BESIDE + 1];
  for (int i = -BESIDE; i <= BESIDE; ++i) {
    const double now = c->mean[(int)clamp((int)n + i, 0, c->count - 1.0)];
    int j = i + BESIDE;
    for (; j > 0 && near[j - 1] > now; --j) near[j] = near[j - 1];
    near[j] = now;
  }
  return near[BESIDE];
}

// Swing of means over a fifth of a second, over the mean, before the squeeze: read off and true.
static void phasicity(const course *c, double out[2]) {
  const uint32_t rest = 480;
  for (int truly = 0; truly < 2; ++truly) {
    double low = INFINITY, high = -INFINITY, sum = 0;
    for (uint32_t n = 0; n < rest; ++n) sum += truly ? c->truth[n] : median(c, n);
    for (uint32_t n = 0; n + SLIDE <= rest; ++n) {
      double now = 0;
      for (uint32_t k = n; k < n + SLIDE; ++k) now += (truly ? c->truth[k] : median(c, k)) / SLIDE;
      low = fmin(low, now), high = fmax(high, now);
    }
    out[truly] = (high - low) / fabs(sum / rest);
  }
}

// Time of blood that runs against the flow faster than the filter lets through: read off and true.
static void reflux(const course *c, double slowest, double out[2]) {
  double fastest = 0;
  for (uint32_t n = 0; n < c->count; ++n)
    if (fabs(c->truth[n]) > fabs(fastest)) fastest = c->truth[n];
  const double way = fastest < 0 ? -1 : 1;
  out[0] = out[1] = 0;
  for (uint32_t n = 0; n < c->count; ++n) {
    out[0] += way * median(c, n) < -slowest ? SONDE_GATE_COLUMN_S : 0;
    out[1] += way * c->truth[n] < -slowest ? SONDE_GATE_COLUMN_S : 0;
  }
}

int main(int argc, char **argv) {
  if (argc < 3) {
    fprintf(stderr, "usage: bench_gate TABLE.csv LIMB...\n");
    return 2;
  }
  FILE *table = fopen(argv[1], "w");
  bool good =
      table && fprintf(table, "limb,phasicity,true_phasicity,sound_s,true_sound_s,leaking_s,"
                              "true_leaking_s,slowest_cm_s\n") > 0;
  for (int i = 2; i < argc && good; ++i) {
    sonde_model *model = NULL;
    sonde_interior *in = NULL;
    sonde_echo *echo = NULL;
    sonde_error error = {0};
    sonde_status status = sonde_limb_model_load(argv[i], &model, &error);
    if (!status) status = sonde_interior_create(model, &in, &error);
    if (!status) status = sonde_echo_create(in, NULL, &echo, &error);
    if (status) {
      fprintf(stderr, "%s\n", error.message);
      return 1;
    }
    static course c;
    double swing[2], back[2][2], slowest;
    const uint32_t groin = 1, knee = 8;
    listen(model, groin, in, echo, 0, 0.2, &c, &slowest);
    phasicity(&c, swing);
    for (int leak = 0; leak < 2; ++leak) {
      // The scale as an examiner sets it: what the squeeze drives just fits above the base line.
      listen(model, knee, in, echo, leak, 0.5, &c, &slowest);
      double fastest = 0;
      for (uint32_t n = 0; n < c.count; ++n) fastest = fmax(fastest, fabs(c.truth[n]));
      listen(model, knee, in, echo, leak, 1.3 * fastest / (1 + shifted), &c, &slowest);
      reflux(&c, slowest, back[leak]);
    }
    good = fprintf(table, "%d,%.4f,%.4f,%.2f,%.2f,%.2f,%.2f,%.2f\n", i - 1, swing[0], swing[1],
                   back[0][0], back[0][1], back[1][0], back[1][1], 100 * slowest) > 0;
    sonde_echo_destroy(echo);
    sonde_interior_destroy(in);
    sonde_model_destroy(model);
  }
  if (table && fclose(table)) good = false;
  if (!good) fprintf(stderr, "%s: not written\n", argv[1]);
  return good ? 0 : 1;
}
