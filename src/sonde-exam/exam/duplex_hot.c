// Blood, colour and spectrum of one image.
#include "exam/duplex.h"

#include "base/base.h"
#include "base/maths.h"
#include "echo/lines.h"
#include "echo/truth.h"

enum { GRID = SONDE_DUPLEX_GRID, PLACES = GRID * GRID };
static const double highest_hz = 5e6; // of Doppler pulses, whatever the image's
static const double dark_db = 60;     // lost behind bone and where no body is
static const double gap_m = 2e-3;     // between face and skin, from which a line is in air

void sonde_duplex_forget(sonde_duplex *d) {
  SONDE_ASSERT(d != NULL);
  d->seen = false, d->gated_s = (double)NAN;
  sonde_gate_forget(d->gate);
}

void sonde_duplex_follow(sonde_duplex *d, const sonde_duplex_moment *now) {
  SONDE_ASSERT(d && now && isfinite(now->time_s));
  const bool gated = now->controls->gated;
  if (now->controls->shown == SONDE_DUPLEX_OFF) d->seen = false;
  if (!gated) sonde_gate_forget(d->gate);
  // Patient and hand now; veins as probe and clots leave them.
  sonde_flow_def def = d->body.def;
  const sonde_circulation *c = now->circulation;
  if (c) {
    def.heart_rate_hz = c->heart_rate_hz, def.breath_rate_hz = c->breath_rate_hz;
    def.leak = c->valve_leak;
    if (c->valsalva_to_s > c->valsalva_from_s)
      def.valsalva_from_s = c->valsalva_from_s, def.valsalva_to_s = c->valsalva_to_s;
  }
  if (isfinite(now->hand.squeeze_s)) def.squeeze_from_s = now->hand.squeeze_s;
  if (isfinite(now->hand.breath_s)) def.deep_breath_from_s = now->hand.breath_s;
  sonde_flow_scene_narrow(d->scene, &def);
  sonde_flow flow = sonde_flow_scene_remember(d->scene).flow;
  const double most_s = 1; // the network does not run through what no image showed
  if (!(d->flows && now->time_s >= flow.time_s && now->time_s - flow.time_s <= most_s)) {
    flow = d->body, flow.def = def, flow.time_s = now->time_s;
    sonde_flow_settle(&flow);
    sonde_gate_forget(d->gate);
  }
  d->flows = true, flow.def = def;
  sonde_flow_scene_listen(d->scene, gated ? d->gate : NULL);
  sonde_flow_scene_show(d->scene, now->probe);
  sonde_flow_scene_run(d->scene, &flow, now->time_s);
}

const sonde_vessel_blood *sonde_duplex_blood(const sonde_duplex *d) {
  SONDE_ASSERT(d != NULL);
  return sonde_flow_scene_blood(d->scene);
}

// What the picture shows at a place of its plane, at its rim beside it.
static void look_at(const sonde_duplex *d, const sonde_image *image, sonde_vec3 place,
                    sonde_truth_pixel *pixel) {
  const double column = (place.x / image->width_m + 0.5) * image->width,
               row = (place.z - image->top_m) / image->height_m * image->height;
  (void)sonde_truth_at(d->echo, image, (uint32_t)clamp(column, 0, image->width - 1.0),
                       (uint32_t)clamp(row, 0, image->height - 1.0), pixel);
}

void sonde_duplex_move(sonde_duplex *d, const sonde_duplex_moment *now, const sonde_image *image,
                       const sonde_colour_box *box, const float *coupling, uint32_t lines) {
  float towards[PLACES] = {0};
  double dark_from_m[GRID]; // how far from the face a line meets bone or no body
  const sonde_truth_view view = sonde_truth_view_of(d->echo);
  const sonde_quat turn = sonde_truth_pose(d->echo).rotation;
  const sight_lines straight = {view.radius_m, 0}, beams = {view.radius_m, box->steer_rad};
  const bool known = d->seen && now->time_s > d->seen_s && d->seen_aperture_m == view.aperture_m &&
                     d->seen_depth_m == view.depth_m;
  for (uint32_t i = 0; i < GRID; ++i) {
    const double along_m = view.aperture_m * ((i + 0.5) / GRID - 0.5);
    const sonde_vec3 beam = q_rotate(turn, sight_beam(beams, along_m));
    sonde_truth_pixel pixel;
    look_at(d, image, sight_place(straight, along_m, gap_m), &pixel);
    dark_from_m[i] = pixel.label == SONDE_LABEL_OUTSIDE ? 0 : INFINITY;
    for (uint32_t j = 0; j < GRID; ++j) {
      const uint32_t k = j * GRID + i;
      const double depth_m = view.depth_m * (j + 0.5) / GRID;
      look_at(d, image, sight_place(straight, along_m, depth_m), &pixel);
      if (pixel.label == SONDE_LABEL_OUTSIDE || pixel.label == SONDE_LABEL_BONE)
        dark_from_m[i] = fmin(dark_from_m[i], j * view.depth_m / GRID);
      const sonde_vec3 way = v_sub(pixel.rest_m, d->rest_m[k]);
      if (known && v_finite(way))
        towards[k] = (float)(v_dot(way, beam) / (now->time_s - d->seen_s));
      d->rest_m[k] = pixel.rest_m;
    }
  }
  d->seen = true, d->seen_s = now->time_s;
  d->seen_aperture_m = view.aperture_m, d->seen_depth_m = view.depth_m;
  for (uint32_t i = 0; i < SONDE_COLOUR_CELLS; ++i) {
    double xz[2];
    sonde_colour_place(box, i % SONDE_COLOUR_LINES, i / SONDE_COLOUR_LINES, xz);
    const sonde_vec3 place = sight_find(straight, vec3(xz[0], 0, xz[1]));
    const double share = place.x / view.aperture_m + 0.5;
    const double across = clamp(share * GRID - 0.5, 0, GRID - 1);
    const double down = clamp(place.z / view.depth_m * GRID - 0.5, 0, GRID - 1);
    const int x = (int)fmin(across, GRID - 2), y = (int)fmin(down, GRID - 2);
    const float a = (float)(across - x), b = (float)(down - y), *at = towards + y * GRID + x;
    d->cells[i].towards_m_s +=
        (1 - b) * ((1 - a) * at[0] + a * at[1]) + b * ((1 - a) * at[GRID] + a * at[GRID + 1]);
    if (!(share >= 0 && share <= 1) || place.z > dark_from_m[lround(across)])
      d->cells[i].loss_db = (float)dark_db;
    else if (coupling)
      d->cells[i].loss_db = -20 * log10f(fmaxf(coupling[lround(share * (lines - 1))], 1e-3f));
  }
}

// How far from the middle a box or a gate may be: within the picture, in a fan within its lines.
static double half_of(const sonde_truth_view *view, const sonde_image *image) {
  return 0.5 * (view->radius_m > 0 ? view->aperture_m : image->width_m);
}

void sonde_duplex_draw(sonde_duplex *d, const sonde_duplex_moment *now, const sonde_image *image,
                       double frequency_hz, const float *coupling, uint32_t lines,
                       sonde_frame_colour *out) {
  SONDE_ASSERT(d && now && image && out && out->over.pixels && lines > 1);
  const sonde_duplex_controls *c = now->controls;
  out->shown = SONDE_DUPLEX_OFF;
  if (!d->flows || c->shown == SONDE_DUPLEX_OFF) return;
  // The box within the picture, of a fan within its lines, and pulses as far apart as the scale
  // wants and the depth allows.
  sonde_colour_box box = c->box;
  const sonde_truth_view view = sonde_truth_view_of(d->echo);
  const double least_m = sonde_duplex_least_m, half_m = half_of(&view, image);
  box.radius_m = view.radius_m, box.steer_rad = view.radius_m > 0 ? 0 : box.steer_rad;
  box.left_m = clamp(box.left_m, -half_m, half_m - least_m);
  box.right_m = clamp(box.right_m, box.left_m + least_m, half_m);
  box.top_m = clamp(box.top_m, 0, view.depth_m - least_m);
  box.bottom_m = clamp(box.bottom_m, box.top_m + least_m, view.depth_m);
  sonde_colour_def def = sonde_colour_def_default();
  const double sound_m_s = 1540, most_hz = sound_m_s / (2 * box.bottom_m);
  def.frequency_hz = fmin(frequency_hz, highest_hz), def.persistence = 0;
  // Of the time that passed, so that a slow machine's colours do not stay longer.
  if (d->seen && now->time_s > d->seen_s)
    def.persistence =
        fmin(pow(sonde_duplex_persistence, (now->time_s - d->seen_s) / sonde_duplex_image_s), 0.95);
  def.pulse_hz =
      clamp(def.pulse_hz * c->scale_m_s / sonde_colour_limit(&def), 100, fmin(most_hz, 2e4));
  if (!sonde_colour_tune(d->colour, &def)) return;
  sonde_flow_scene_cells(d->scene, d->echo, &box, d->cells);
  const bool holds = d->seen;
  sonde_duplex_move(d, now, image, &box, coupling, lines);
  sonde_colour_next(d->colour, (uint64_t)llround(1e3 * now->time_s), holds);
  (void)sonde_colour_frame(d->colour, d->cells);
  sonde_colour_paint(d->colour, &box, c->gain_db, c->shown == SONDE_DUPLEX_POWER, image,
                     &out->over);
  out->shown = c->shown, out->box = box, out->limit_m_s = sonde_colour_limit(&def);
}

void sonde_duplex_hear(sonde_duplex *d, const sonde_duplex_moment *now, const sonde_image *image,
                       double frequency_hz, const float *coupling, uint32_t lines,
                       sonde_gate_column *column, sonde_gate_spectrum *out) {
  SONDE_ASSERT(d && now && image && column && out && lines > 1);
  *out = (sonde_gate_spectrum){.on = false};
  if (!d->flows || !now->controls->gated) return;
  sonde_gate_settings gate = now->controls->gate;
  const sonde_truth_view view = sonde_truth_view_of(d->echo);
  const double half_m = half_of(&view, image);
  gate.x_m = clamp(gate.x_m, -half_m, half_m), gate.z_m = fmin(gate.z_m, view.depth_m);
  sonde_gate_place place = {d->echo, fmin(frequency_hz, highest_hz), 0, 0};
  // The beam through the gate: where it leaves the face.
  const sight_lines straight = {view.radius_m, 0}, beams = {view.radius_m, gate.steer_rad};
  const double from_m = sight_find(beams, sight_place(straight, gate.x_m, gate.z_m)).x;
  // Down the beam to the gate: bone, or no body, or a face without gel.
  enum { STEPS = 12 };
  sonde_truth_pixel pixel = {.rest_m = {(double)NAN, (double)NAN, (double)NAN}};
  for (int k = 0; k <= STEPS; ++k) {
    const double depth_m = k > 0 ? gate.z_m * k / STEPS : fmin(gap_m, gate.z_m);
    const sonde_vec3 at = sight_place(beams, from_m, depth_m);
    const bool beside = !(fabs(at.x) < 0.5 * image->width_m);
    if (!beside) look_at(d, image, at, &pixel);
    if (beside || pixel.label == SONDE_LABEL_OUTSIDE || pixel.label == SONDE_LABEL_BONE)
      place.loss_db = dark_db;
  }
  const double share = from_m / view.aperture_m + 0.5;
  if (coupling && share >= 0 && share <= 1)
    place.loss_db -= 20 * log10(fmax((double)coupling[lround(share * (lines - 1))], 1e-3));
  // The tissue's way along the beam since the last picture, when the gate stayed where it was.
  const sonde_vec3 beam = q_rotate(sonde_truth_pose(d->echo).rotation, sight_beam(beams, from_m));
  const sonde_vec3 way = v_sub(pixel.rest_m, d->gate_rest_m);
  if (now->time_s > d->gated_s && d->gated_xz_m[0] == gate.x_m && d->gated_xz_m[1] == gate.z_m &&
      v_finite(way))
    place.tissue_m_s = v_dot(way, beam) / (now->time_s - d->gated_s);
  d->gate_rest_m = pixel.rest_m, d->gated_s = now->time_s;
  d->gated_xz_m[0] = gate.x_m, d->gated_xz_m[1] = gate.z_m;
  sonde_gate_put(d->gate, d->scene, &gate, &place);
  *out = sonde_gate_axes(d->gate);
  out->count = sonde_gate_columns(d->gate, column), out->column = column;
}
