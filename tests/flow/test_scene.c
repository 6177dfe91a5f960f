// The network's flow in the vessels of a leg: conserved in the cells of a box, less in a vein that
// is pressed, none in one that is closed or filled with clot.
#include "sonde/flow_gate.h"

#include "fixture.h"
#include "interior/tube.h"

#include <math.h>
#include <string.h>

static const double length = 0.3, radius = 0.08;
static const double face_m = 0.06; // radius of a curved face
static sonde_colour_cell cells[SONDE_COLOUR_CELLS];

typedef struct leg {
  tube t;
  sonde_interior *in;
  sonde_echo *echo;
  sonde_pose pose;
  sonde_vec3 *still;
} leg;

// The interior keeps the address of the leg's model.
static void open_leg(leg *l) {
  *l = (leg){.t = tube_create(radius, 0.014, length, 0.012, 96, 60)};
  assert_int_equal(sonde_interior_create(&l->t.model, &l->in, NULL), SONDE_OK);
  sonde_interior_set_method(l->in, SONDE_INTERIOR_COLUMNS);
  l->still = SONDE_NEW(sonde_vec3, l->t.model.surface.vertex_count);
  l->pose = tube_pose(radius, length / 2);
  assert_int_equal(sonde_echo_create(l->in, NULL, &l->echo, NULL), SONDE_OK);
}

static void close_leg(leg *l) {
  sonde_echo_destroy(l->echo);
  sonde_interior_destroy(l->in);
  sonde_free(l->still);
  tube_clear(&l->t);
}

typedef struct found {
  double through, mean, cells_m3_s[2], artery; // mean: a velocity, others m3/s
  uint32_t count[2];
} found;

// The leg in a cuff, and its picture.
static void press(leg *l, const char *state, double cuff_pa) {
  sonde_pathology pathology;
  assert_int_equal(sonde_pathology_preset(state, &pathology, NULL), SONDE_OK);
  sonde_interior_update(l->in, &(sonde_interior_input){.positions_m = l->t.model.surface.vertices,
                                                       .contact_forces_n = l->still,
                                                       .world_from_probe = l->pose,
                                                       .pathology = &pathology,
                                                       .dt_s = -1,
                                                       .tick = 1,
                                                       .face_half_x_m = 0.02,
                                                       .face_half_y_m = 0.01,
                                                       .cuff_pa = cuff_pa});
  sonde_image image;
  sonde_echo_settings settings = sonde_echo_settings_default();
  assert_int_equal(sonde_image_create(64, 64, &image, NULL), SONDE_OK);
  sonde_echo_render(l->echo, l->pose, 0.04, &pathology, &settings, &image);
  sonde_image_clear(&image);
}

// Its flow after a beat, and what the cells of a box across it hold.
static found look(leg *l, const char *state, double cuff_pa) {
  press(l, state, cuff_pa);
  sonde_flow_scene *scene = NULL;
  assert_int_equal(sonde_flow_scene_create(NULL, l->in, &scene, NULL), SONDE_OK);
  sonde_flow_def def = sonde_flow_def_default(NULL);
  def.breath_pa = 0;
  sonde_flow_scene_narrow(scene, &def);
  sonde_flow flow;
  assert_int_equal(sonde_flow_start(&def, &flow, NULL), SONDE_OK);
  sonde_flow_scene_run(scene, &flow, 1.0);
  const sonde_colour_box box = {-0.02, 0.02, 0.005, 0.035, 0, 0};
  sonde_flow_scene_cells(scene, l->echo, &box, cells);
  found f = {.through = sonde_flow_through(&flow, SONDE_FLOW_FEMORAL, 0),
             .mean = sonde_flow_scene_velocity(scene, 0, l->pose),
             .artery = fabs(sonde_flow_scene_velocity(scene, 1, l->pose))};
  sonde_vessel_state artery;
  assert_true(sonde_interior_vessel_at_plane(l->in, 1, l->pose, &artery));
  f.artery *= SONDE_PI * artery.half_short_m * artery.half_long_m;
  const double cell = 0.04 / SONDE_COLOUR_LINES * 0.03 / SONDE_COLOUR_ROWS;
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) {
    if (cells[i].vessel > 1) continue;
    f.cells_m3_s[cells[i].vessel] += (double)cells[i].across_m_s * cell, ++f.count[cells[i].vessel];
    assert_near(cells[i].towards_m_s, 0, 1e-6); // the beam runs across
  }
  sonde_flow_scene_destroy(scene);
  return f;
}

static void test_conserves(void **unused) {
  (void)unused;
  leg l;
  open_leg(&l);
  const found rest = look(&l, "healthy", 0);
  print_message("at rest: %.3f ml/s in %u cells of %.3f; artery %.3f of %.3f\n",
                1e6 * rest.cells_m3_s[0], rest.count[0], 1e6 * rest.through,
                1e6 * rest.cells_m3_s[1], 1e6 * rest.artery);
  assert_near(rest.cells_m3_s[0] / rest.through, 1, 0.02);
  assert_near(rest.cells_m3_s[1] / rest.artery, 1, 0.05);
  const found pressed = look(&l, "healthy", 15 * SONDE_PA_PER_MMHG),
              closed = look(&l, "healthy", 45 * SONDE_PA_PER_MMHG);
  print_message("pressed: %.3f ml/s of %.3f in %u cells; closed: %u cells\n",
                1e6 * pressed.cells_m3_s[0], 1e6 * pressed.through, pressed.count[0],
                closed.count[0]);
  assert_true(pressed.count[0] > 0 && pressed.count[0] < 0.8 * rest.count[0]);
  assert_near(pressed.cells_m3_s[0] / pressed.through, 1, 0.05);
  assert_true(pressed.through < 0.95 * rest.through);
  assert_int_equal(closed.count[0], 0);
  assert_near(closed.mean, 0, 1e-15);
  assert_true(closed.count[1] > 0);
  const found clot = look(&l, "acute_occlusive", 0), partial = look(&l, "partial_mural", 0);
  print_message("clot: %.3f ml/s in %u cells; partial: %.3f ml/s in %u cells\n",
                1e6 * clot.cells_m3_s[0], clot.count[0], 1e6 * partial.cells_m3_s[0],
                partial.count[0]);
  assert_true(clot.cells_m3_s[0] < 0.02 * rest.through);
  assert_true(partial.count[0] > 0 && partial.count[0] < rest.count[0]);
  assert_near(partial.cells_m3_s[0] / partial.through, 1, 0.05);
  close_leg(&l);
}

// The spectrum of a gate over some seconds of steady flow along the vein: the mean of its columns,
// of its edges, how many columns have any flow, their brightness.
typedef struct heard {
  double mean, peak, truth, flows, grey;
  uint32_t columns;
  sonde_gate_spectrum axes;
} heard;

static heard listen(leg *l, sonde_flow_scene *scene, sonde_flow *flow,
                    const sonde_gate_settings *settings, double loss_db) {
  sonde_gate *gate = NULL;
  assert_int_equal(sonde_gate_create(&gate, NULL), SONDE_OK);
  const sonde_gate_place place = {l->echo, 5e6, 0, loss_db};
  heard h = {0};
  uint64_t seen = 0;
  double truths = 0;
  sonde_flow_scene_listen(scene, gate);
  for (int image = 0; image < 150; ++image) {
    sonde_gate_put(gate, scene, settings, &place);
    h.truth += sonde_gate_truth(gate, scene, l->echo), ++truths;
    sonde_flow_scene_run(scene, flow, flow->time_s + 0.02);
    sonde_gate_column column[SONDE_GATE_COLUMNS];
    const uint32_t count = sonde_gate_columns(gate, column);
    for (uint32_t n = 0; n < count; ++n) {
      if (column[n].number <= seen) continue;
      if (seen > 0) assert_int_equal(column[n].number, seen + 1);
      seen = column[n].number, ++h.columns;
      h.mean += (double)column[n].mean_m_s, h.peak += (double)column[n].peak_m_s;
      h.flows += column[n].mean_m_s != 0;
      for (int b = 0; b < SONDE_DOPPLER_BINS; ++b) h.grey += column[n].power[b];
    }
  }
  h.mean /= h.columns, h.peak /= h.columns, h.flows /= h.columns, h.truth /= truths;
  h.grey /= h.columns * SONDE_DOPPLER_BINS;
  h.axes = sonde_gate_axes(gate);
  sonde_flow_scene_listen(scene, NULL);
  sonde_gate_destroy(gate);
  return h;
}

// A gate in the vein has the blood's velocity along the beam at every lean of it, and folds where
// its axis ends; beside the vessel, in a clot and in a shadow it has noise and no flow.
static void test_gate(void **unused) {
  (void)unused;
  leg l;
  open_leg(&l);
  l.pose.rotation = q_mul(l.pose.rotation, (sonde_quat){sqrt(0.5), 0, 0, sqrt(0.5)});
  press(&l, "healthy", 0);
  sonde_flow_scene *scene = NULL;
  sonde_flow flow;
  sonde_flow_def def = sonde_flow_def_default(NULL);
  def.breath_pa = 0, def.heart_rate_hz = 5; // as good as steady
  assert_int_equal(sonde_flow_scene_create(NULL, l.in, &scene, NULL), SONDE_OK);
  assert_int_equal(sonde_flow_start(&def, &flow, NULL), SONDE_OK);
  sonde_flow_scene_run(scene, &flow, 0.5);
  sonde_vessel_state vein;
  assert_true(sonde_interior_vessel_at_plane(l.in, 0, tube_pose(radius, length / 2), &vein));
  const sonde_vec3 at = pose_apply_inverse(l.pose, vein.centre_m);
  sonde_gate_settings s = sonde_gate_settings_default();
  s.x_m = at.x, s.z_m = at.z;
  for (int k = 0; k < 3; ++k) {
    s.steer_rad = (k - 1) * 0.35, s.scale_m_s = 0.15;
    const heard h = listen(&l, scene, &flow, &s, 0);
    print_message("lean %3.0f: mean %.2f of %.2f cm/s, edge %.2f, %u columns, %.0f %% with flow\n",
                  s.steer_rad * 180 / SONDE_PI, 100 * h.mean, 100 * h.truth, 100 * h.peak,
                  h.columns, 100 * h.flows);
    assert_true(h.columns > 290);
    // Across the flow the spectrum is as wide on either side.
    if (k == 1) assert_true(fabs(h.mean) < 2e-3 && fabs(h.truth) < 1e-3);
    if (k != 1) assert_near(h.mean / h.truth, 1, 0.05);
    if (k != 1) assert_true(h.peak / h.truth > 1.1 && h.flows > 0.95);
  }
  // Base line at three quarters, range too small for the blood without it.
  heard h = listen(&l, scene, &flow, &s, 0);
  const double mean = h.mean, grey = h.grey;
  s.scale_m_s = 1.1 * fabs(mean), s.baseline = mean > 0 ? 0.6 : -0.6;
  h = listen(&l, scene, &flow, &s, 0);
  print_message("base line moved: %.2f of %.2f cm/s in %.1f to %.1f\n", 100 * h.mean, 100 * mean,
                100 * h.axes.low_m_s, 100 * (h.axes.low_m_s + 2 * h.axes.limit_m_s));
  assert_near(h.mean / mean, 1, 0.05);
  s.scale_m_s = 0.8 * fabs(mean), s.baseline = 0;
  h = listen(&l, scene, &flow, &s, 0);
  print_message("folded: %.2f of %.2f cm/s\n", 100 * h.mean, 100 * mean);
  assert_true(h.mean * mean < 0);
  s.scale_m_s = 0.15;
  h = listen(&l, scene, &flow, &s, 60);
  print_message("in a shadow: %.2f cm/s, grey %.1f instead of %.1f\n", 100 * h.mean, h.grey, grey);
  assert_true(h.flows < 0.02 && h.grey > 2 && h.grey < 0.8 * grey);
  s.z_m += 0.012;
  h = listen(&l, scene, &flow, &s, 0);
  assert_true(h.flows < 0.02 && h.truth == 0);
  sonde_flow_scene_destroy(scene);
  close_leg(&l);
}

// The leg with its vein along the picture, in as good as steady flow, and its vein's section there.
static void open_along(leg *l, sonde_flow_scene **scene, sonde_flow *flow,
                       sonde_vessel_state *vein) {
  open_leg(l);
  l->pose.rotation = q_mul(l->pose.rotation, (sonde_quat){sqrt(0.5), 0, 0, sqrt(0.5)});
  press(l, "healthy", 0);
  sonde_flow_def def = sonde_flow_def_default(NULL);
  def.breath_pa = 0, def.heart_rate_hz = 5;
  assert_int_equal(sonde_flow_scene_create(NULL, l->in, scene, NULL), SONDE_OK);
  assert_int_equal(sonde_flow_start(&def, flow, NULL), SONDE_OK);
  sonde_flow_scene_run(*scene, flow, 0.5);
  assert_true(sonde_interior_vessel_at_plane(l->in, 0, tube_pose(radius, length / 2), vein));
}

// A line of a curved face hears what a flat face's beam hears that leans as much through the same
// place: along the beam, and along the vein by the angle to that line.
static void test_fan_gate(void **unused) {
  (void)unused;
  static const double ANGLE[] = {-0.25, 0.12, 0.3};
  for (size_t k = 0; k < SONDE_COUNT_OF(ANGLE); ++k) {
    heard h[2];
    sonde_gate_settings s = sonde_gate_settings_default();
    s.scale_m_s = 0.15;
    for (int fan = 0; fan < 2; ++fan) {
      leg l;
      sonde_flow_scene *scene = NULL;
      sonde_flow flow;
      sonde_vessel_state vein;
      open_along(&l, &scene, &flow, &vein);
      const double z = pose_apply_inverse(l.pose, vein.centre_m).z;
      if (fan) {
        assert_int_equal(sonde_echo_set_radius(l.echo, face_m, NULL), SONDE_OK);
        press(&l, "healthy", 0);
      }
      s.x_m = fan ? ANGLE[k] * face_m : (face_m + z) * tan(ANGLE[k]);
      s.z_m = fan ? (face_m + z) / cos(ANGLE[k]) - face_m : z;
      s.steer_rad = fan ? 0.35 : ANGLE[k]; // of a fan nothing leans
      h[fan] = listen(&l, scene, &flow, &s, 0);
      sonde_flow_scene_destroy(scene);
      close_leg(&l);
    }
    print_message("line at %5.1f degrees: %.3f of %.3f cm/s, a flat face's %.3f of %.3f\n",
                  ANGLE[k] * 180 / SONDE_PI, 100 * h[1].mean, 100 * h[1].truth, 100 * h[0].mean,
                  100 * h[0].truth);
    assert_true(h[1].axes.settings.steer_rad == 0);
    assert_near(h[1].truth / h[0].truth, 1, 1e-6);
    assert_near(h[1].mean / h[0].mean, 1, 0.01);
    if (fabs(ANGLE[k]) > 0.2)
      assert_near(h[1].mean / h[1].truth, 1, 0.05); // else by the wall filter
  }
}

// However often pulses are sent, a column has those of 40 ms: slow blood is read as truly where the
// axis is ten times as wide as it needs.
static void test_window(void **unused) {
  (void)unused;
  leg l;
  sonde_flow_scene *scene = NULL;
  sonde_flow flow;
  sonde_vessel_state vein;
  open_along(&l, &scene, &flow, &vein);
  const sonde_vec3 at = pose_apply_inverse(l.pose, vein.centre_m);
  sonde_gate_settings s = sonde_gate_settings_default();
  s.x_m = at.x, s.z_m = at.z, s.steer_rad = 0.35, s.scale_m_s = 0.5, s.filter_hz = 20;
  const heard h = listen(&l, scene, &flow, &s, 0);
  print_message("%.0f pulses a second in %.0f ms: mean %.2f of %.2f cm/s\n", h.axes.pulse_hz,
                1e3 * h.axes.window_s, 100 * h.mean, 100 * h.truth);
  assert_near(h.axes.window_s, 0.04, 1e-4);
  assert_near(h.mean / h.truth, 1, 0.05);
  sonde_flow_scene_destroy(scene);
  close_leg(&l);
}

// Colour before a curved face: the parabola of the vein's steady flow along each line, the truth of
// the cells and the estimate alike.
static void test_fan_colour(void **unused) {
  (void)unused;
  leg l;
  sonde_flow_scene *scene = NULL;
  sonde_flow flow;
  sonde_vessel_state vein;
  open_along(&l, &scene, &flow, &vein);
  assert_int_equal(sonde_echo_set_radius(l.echo, face_m, NULL), SONDE_OK);
  press(&l, "healthy", 0);
  const sonde_pose across = tube_pose(radius, length / 2);
  const sonde_vec3 at = pose_apply_inverse(l.pose, vein.centre_m);
  const sonde_colour_box box = {-0.017, 0.017, at.z - 0.008, at.z + 0.012, 0, face_m};
  sonde_flow_scene_cells(scene, l.echo, &box, cells);
  static double truth[SONDE_COLOUR_CELLS], shown[SONDE_COLOUR_CELLS];
  const double mean = sonde_flow_scene_velocity(scene, 0, across);
  double off = 0, most = 0, way = 0;
  uint32_t count = 0;
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) {
    double xz[2];
    sonde_colour_place(&box, i % SONDE_COLOUR_LINES, i / SONDE_COLOUR_LINES, xz);
    const sonde_vec3 d = v_sub(pose_apply(l.pose, vec3(at.x, 0, xz[1])), vein.centre_m);
    const double a = v_dot(d, vein.flat_axis) / vein.half_short_m,
                 b = v_dot(d, v_cross(vein.axis, vein.flat_axis)) / vein.half_long_m;
    truth[i] = shown[i] = 0;
    if (cells[i].vessel != 0) continue;
    truth[i] = 2 * mean * fmax(1 - a * a - b * b, 0) * xz[0] / hypot(xz[0], xz[1] + face_m);
    way += truth[i] * (double)cells[i].towards_m_s;
    ++count;
  }
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) {
    truth[i] = copysign(truth[i], way * truth[i]); // which way x runs
    most = fmax(most, fabs(truth[i]));
    if (cells[i].vessel == 0) off += pow((double)cells[i].towards_m_s - truth[i], 2);
  }
  off = sqrt(off / count) / most;
  // The estimate, the mean of some frames, where blood is faster than the wall filter.
  enum { FRAMES = 20 };
  sonde_colour_def def = sonde_colour_def_default();
  sonde_colour *colour = NULL;
  def.pulse_hz *= 1.3 * most / sonde_colour_limit(&def);
  assert_int_equal(sonde_colour_create(&def, &colour, NULL), SONDE_OK);
  for (int f = 0; f < FRAMES; ++f) {
    const sonde_colour_value *value = sonde_colour_frame(colour, cells);
    for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i)
      shown[i] += (double)value[i].velocity_m_s / FRAMES;
  }
  double rms = 0, sum[2] = {0, 0};
  uint32_t fast = 0;
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) {
    if (!(fabs(truth[i]) > 0.15 * sonde_colour_limit(&def))) continue;
    rms += pow(shown[i] - truth[i], 2), ++fast;
    sum[0] += fabs(truth[i]), sum[1] += shown[i] * copysign(1, truth[i]);
  }
  rms = sqrt(rms / fast) / most;
  print_message("%u cells, cells off by %.2f %%; estimate in %u: rms %.1f %%, mean %.1f %%\n",
                count, 100 * off, fast, 100 * rms, 100 * (sum[1] / sum[0] - 1));
  assert_true(count > 2000 && fast > 1000);
  assert_true(off < 0.02);
  assert_true(rms < 0.05);
  assert_near(sum[1] / sum[0], 1, 0.05);
  sonde_colour_destroy(colour);
  sonde_flow_scene_destroy(scene);
  close_leg(&l);
}

// What the picture's blood does over some seconds of the network, with a share of its inflow.
static sonde_vessel_blood run_on(sonde_flow_scene *scene, sonde_flow *flow, double share,
                                 double seconds) {
  flow->def.inflow_m3_s = share * sonde_flow_def_default(NULL).inflow_m3_s;
  sonde_flow_scene_show(scene, tube_pose(radius, length / 2));
  for (double until = flow->time_s + seconds; flow->time_s < until - 1e-6;)
    sonde_flow_scene_run(scene, flow, fmin(flow->time_s + 0.02, until));
  return sonde_flow_scene_blood(scene)[0];
}

// The picture's blood goes as far as the mean velocity takes it, to the heart in the vein and from
// it in the artery. Where little comes in, its red cells stick together in seconds, as far as the
// shear lets them, and part when it is fast again.
static void test_blood_of_pictures(void **unused) {
  (void)unused;
  leg l;
  sonde_flow_scene *scene = NULL;
  sonde_flow flow;
  sonde_vessel_state vein;
  open_along(&l, &scene, &flow, &vein);
  const sonde_pose across = tube_pose(radius, length / 2);
  const double heart = vein.axis.z > 0 ? -1 : 1; // the foot is at the greater z
  const sonde_vessel_blood before = run_on(scene, &flow, 1, 0.2);
  const double artery_m = sonde_flow_scene_blood(scene)[1].path_m;
  sonde_vessel_blood b = run_on(scene, &flow, 1, 1);
  const double mean = sonde_flow_scene_velocity(scene, 0, across);
  print_message("in 1 s %.2f of %.2f mm, artery %.2f mm; rouleaux %.3f, cusps %.2f\n",
                1e3 * heart * (b.path_m - before.path_m), 1e3 * mean,
                -1e3 * heart * (sonde_flow_scene_blood(scene)[1].path_m - artery_m), b.rouleaux,
                b.shut);
  assert_near(heart * (b.path_m - before.path_m) / mean, 1, 0.02);
  assert_near(heart * b.speed_m_s, mean, 1e-12);
  assert_true(-heart * (sonde_flow_scene_blood(scene)[1].path_m - artery_m) > 0.02);
  assert_true(b.rouleaux < 0.3 && b.shut < 0.4);
  const sonde_vessel_blood shortly = run_on(scene, &flow, 0.05, 1);
  b = run_on(scene, &flow, 0.05, 79);
  const double shear_per_s =
      8 * fabs(b.speed_m_s) / (3 * sqrt(vein.half_short_m * vein.half_long_m));
  const double settled = 1 / (1 + pow(shear_per_s / 8, 2));
  const sonde_vessel_blood again = run_on(scene, &flow, 1, 30);
  print_message("a twentieth comes in for 1 s: rouleaux %.3f; 80 s: %.3f of %.3f at %.2f cm/s; all "
                "again: %.3f\n",
                shortly.rouleaux, b.rouleaux, settled, 100 * b.speed_m_s, again.rouleaux);
  assert_true(settled > 0.3 && fabs(b.rouleaux - settled) < 0.02);
  assert_true(shortly.rouleaux < 0.3 * settled && again.rouleaux < 0.1 * settled);
  // A strain stops the blood at once; red cells take their seconds.
  flow.def.valsalva_from_s = flow.time_s, flow.def.valsalva_to_s = flow.time_s + 12;
  const sonde_vessel_blood stopped = run_on(scene, &flow, 1, 1), late = run_on(scene, &flow, 1, 8);
  print_message("strain for 1 s: %.2f cm/s, rouleaux %.3f; 9 s: %.2f cm/s, %.3f\n",
                100 * stopped.speed_m_s, stopped.rouleaux, 100 * late.speed_m_s, late.rouleaux);
  assert_true(fabs(stopped.speed_m_s) < 1e-3 && stopped.rouleaux < 0.2 && late.rouleaux > 0.6);
  sonde_flow_scene_destroy(scene);
  close_leg(&l);
}

// Blood that falls back through valves that leak a little brings their cusps together, and goes
// away from the heart.
static void test_cusps(void **unused) {
  (void)unused;
  leg l;
  sonde_flow_scene *scene = NULL;
  sonde_flow flow;
  sonde_vessel_state vein;
  open_along(&l, &scene, &flow, &vein);
  flow.def.leak = 0.3;
  flow.def.valsalva_from_s = flow.time_s + 0.1, flow.def.valsalva_to_s = flow.time_s + 5;
  sonde_vessel_blood back = {0};
  for (int k = 0; k < 60; ++k) {
    const sonde_vessel_blood b = run_on(scene, &flow, 1, 0.02);
    if (b.shut > back.shut) back = b;
  }
  print_message("falls back at %.2f cm/s: cusps %.2f\n", 100 * back.speed_m_s, back.shut);
  assert_true(back.speed_m_s * (vein.axis.z > 0 ? 1 : -1) > 2e-3 && back.shut > 0.6);
  sonde_flow_scene_destroy(scene);
  close_leg(&l);
}

static void test_cleans(void **unused) {
  (void)unused;
  const sonde_gate_settings usual = sonde_gate_settings_default();
  sonde_gate_settings wild = {NAN, INFINITY, 1, -9, 9, 0, 5, -1, 99};
  const sonde_gate_settings s = sonde_gate_clean(&wild, &usual), again = sonde_gate_clean(&s, &s);
  assert_true(s.x_m == usual.x_m && s.z_m == usual.z_m && s.length_m == 15e-3);
  assert_true(s.scale_m_s == 0.02 && s.baseline == 0.9 && s.filter_hz == 10 && s.gain_db == 30);
  assert_memory_equal(&s, &again, sizeof s);
  sonde_gate_destroy(NULL);
}

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_conserves),  cmocka_unit_test(test_gate),
      cmocka_unit_test(test_window),     cmocka_unit_test(test_fan_gate),
      cmocka_unit_test(test_fan_colour), cmocka_unit_test(test_blood_of_pictures),
      cmocka_unit_test(test_cusps),      cmocka_unit_test(test_cleans)};
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
