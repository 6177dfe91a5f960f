// The network's flow in the vessels of a leg: conserved in the cells of a box, less in a vein that
// is pressed, none in one that is closed or filled with clot.
#include "sonde/flow_colour.h"

#include "fixture.h"
#include "interior/tube.h"

#include <math.h>

static const double length = 0.3, radius = 0.08;
static sonde_colour_cell cells[SONDE_COLOUR_CELLS];

typedef struct leg {
  tube t;
  sonde_interior *in;
  sonde_echo *echo;
  sonde_pose pose;
  sonde_vec3 *still;
} leg;

static leg open_leg(void) {
  leg l = {.t = tube_create(radius, 0.014, length, 0.012, 96, 60)};
  assert_int_equal(sonde_interior_create(&l.t.model, &l.in, NULL), SONDE_OK);
  sonde_interior_set_method(l.in, SONDE_INTERIOR_COLUMNS);
  l.still = SONDE_NEW(sonde_vec3, l.t.model.surface.vertex_count);
  l.pose = tube_pose(radius, length / 2);
  assert_int_equal(sonde_echo_create(l.in, NULL, &l.echo, NULL), SONDE_OK);
  return l;
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

// The leg in a cuff, its flow after a beat, and what the cells of a box across it hold.
static found look(leg *l, const char *state, double cuff_pa) {
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
  sonde_flow_scene *scene = NULL;
  assert_int_equal(sonde_flow_scene_create(NULL, l->in, &scene, NULL), SONDE_OK);
  sonde_flow_def def = sonde_flow_def_default(NULL);
  def.breath_pa = 0;
  sonde_flow_scene_narrow(scene, &def);
  sonde_flow flow;
  assert_int_equal(sonde_flow_start(&def, &flow, NULL), SONDE_OK);
  sonde_flow_scene_run(scene, &flow, 1.0);
  const sonde_colour_box box = {-0.02, 0.02, 0.005, 0.035, 0};
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
  leg l = open_leg();
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

int main(int argc, char **argv) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_conserves)};
  if (argc > 1) cmocka_set_test_filter(argv[1]);
  return cmocka_run_group_tests(tests, NULL, NULL);
}
