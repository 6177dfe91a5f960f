// Contact of the probe with the skin, and static equilibrium.
#include "../fixture.h"

typedef struct bench {
  sonde_model *model;
  sonde_state *state;
  sonde_probe probe;
} bench;

static bench make(const char *probe, sonde_world_def def) {
  bench b = {.model = fixture_model(4, NULL)};
  assert_int_equal(sonde_state_create(b.model, &def, &b.state, NULL), SONDE_OK);
  assert_int_equal(sonde_probe_create(probe, &b.probe, NULL), SONDE_OK);
  return b;
}

static void clear(bench *b) {
  sonde_probe_clear(&b->probe);
  sonde_state_destroy(b->state);
  sonde_model_destroy(b->model);
}

static void separated_means_no_force(void **state) {
  (void)state;
  bench b = make("linear", fixture_world_def());
  sonde_step(b.state, &b.probe, fixture_pose(-1e-5));
  const sonde_contact *c = sonde_state_contact(b.state);
  assert_int_equal(c->region_count, 0);
  assert_near(v_norm(c->force_n), 0, 0);
  assert_near(c->volume_m3, 0, 0);
  clear(&b);
}

// The probe's wrench is minus the sum of the nodes' forces and moments, for both laws.
static void action_equals_reaction(void **state) {
  (void)state;
  for (int law = 0; law < 2; ++law) {
    sonde_world_def def = fixture_world_def();
    def.contact_law = law ? SONDE_CONTACT_VOLUME : SONDE_CONTACT_FOUNDATION;
    def.newton_iterations = 1; // the force is found where the skin is before it moves
    bench b = make("linear", def);
    sonde_pose pose = fixture_pose(0.001);
    pose.position.y += 0.004; // off centre: a moment
    sonde_step(b.state, &b.probe, pose);
    const sonde_contact *c = sonde_state_contact(b.state);
    sonde_vec3 force = c->force_n, torque = c->torque_n_m;
    double size = v_norm(force);
    assert_true(size > 1e-3);
    for (uint32_t i = 0; i < b.model->surface.vertex_count; ++i) {
      sonde_vec3 f = sonde_state_contact_forces(b.state)[i];
      force = v_add(force, f);
      torque = v_add(torque, v_cross(v_sub(b.model->surface.vertices[i], pose.position), f));
    }
    assert_true(v_norm(force) < 1e-12 * size);
    assert_true(v_norm(torque) < 1e-12 * size);
    clear(&b);
  }
}

// Before the skin moves, the force is eq. (2) of the exact volume: kappa V (no velocity yet). The
// foundation integrates the same depth over its own points: equal for a covered face.
static void force_is_kappa_times_volume(void **state) {
  (void)state;
  const double tolerance[2] = {0.03, 0.005};
  for (int law = 0; law < 2; ++law) {
    sonde_world_def def = fixture_world_def();
    def.contact_law = law ? SONDE_CONTACT_VOLUME : SONDE_CONTACT_FOUNDATION;
    def.implicitness = 0;
    def.dt_s = 1e-6;
    bench b = make("square", def);
    sonde_step(b.state, &b.probe, fixture_pose(0.0045));
    const sonde_contact *c = sonde_state_contact(b.state);
    double force = v_dot(c->force_n, vec3(1, 0, 0));
    assert_true(c->volume_m3 > 1e-9);
    assert_near(force, def.contact_stiffness_n_m3 * c->volume_m3, tolerance[law] * force);
    clear(&b);
  }
}

// A probe that leaves fast is not held back: the damping never pulls.
static void never_pulls(void **state) {
  (void)state;
  for (int law = 0; law < 2; ++law) {
    sonde_world_def def = fixture_world_def();
    def.contact_law = law ? SONDE_CONTACT_VOLUME : SONDE_CONTACT_FOUNDATION;
    def.contact_damping_n_s_m3 = 1e9;
    bench b = make("square", def);
    for (int k = 0; k < 100; ++k) sonde_step(b.state, &b.probe, fixture_pose(5e-5 * k));
    for (int k = 0; k < 30; ++k) {
      sonde_step(b.state, &b.probe, fixture_pose(0.005 - 3e-4 * k));
      assert_true(v_dot(sonde_state_contact(b.state)->force_n, vec3(1, 0, 0)) >= 0);
    }
    clear(&b);
  }
}

// Eq. (4) as the paper has it, linearised once, follows a press as Newton's method does.
static void equation_4_presses_like_newtons_method(void **state) {
  (void)state;
  double force[2];
  for (int k = 0; k < 2; ++k) {
    sonde_world_def def = fixture_world_def();
    def.newton_iterations = k ? 8 : 0;
    def.pcg.relative_residual = 1e-6;
    bench b = make("square", def);
    for (int t = 0; t < 60; ++t) sonde_step(b.state, &b.probe, fixture_pose(1e-4 * t));
    force[k] = v_norm(sonde_state_contact(b.state)->force_n);
    clear(&b);
  }
  assert_true(force[1] > 0.5);
  assert_near(force[0], force[1], 0.02 * force[1]);
}

static void two_bumps_are_two_regions(void **state) {
  (void)state;
  bench b = make("linear", fixture_world_def());
  uint32_t n = b.model->surface.vertex_count;
  sonde_vec3 *x = SONDE_NEW(sonde_vec3, n);
  for (uint32_t i = 0; i < n; ++i) {
    sonde_vec3 p = b.model->surface.vertices[i];
    // a valley along z at y = 0 leaves the skin on both sides of it in contact
    double valley = p.x > 0 ? 0.006 * exp(-p.y * p.y / (2 * 0.008 * 0.008)) : 0;
    x[i] = vec3(p.x - valley, p.y, p.z);
  }
  sonde_state_set(b.state, x, NULL);
  sonde_step(b.state, &b.probe, fixture_pose(0.0045));
  const sonde_contact *c = sonde_state_contact(b.state);
  assert_int_equal(c->region_count, 2);
  assert_near(c->region[0].volume_m3, c->region[1].volume_m3, 0.02 * c->volume_m3);
  assert_near(c->region[0].volume_m3 + c->region[1].volume_m3, c->volume_m3, 1e-12 * c->volume_m3);
  assert_true(c->region[0].centre_m.y * c->region[1].centre_m.y < 0);
  sonde_free(x);
  clear(&b);
}

// At equilibrium the tissue carries the probe: reaction equals contact force to 1e-6, the force
// grows with depth and the skin stays within the asymptote.
static void settled_reaction_equals_contact(void **state) {
  (void)state;
  bench b = make("square", fixture_world_def());
  double last = 0;
  for (double depth = 0.002; depth < 0.0121; depth += 0.002) {
    sonde_settle_result r = sonde_settle(b.state, &b.probe, fixture_pose(depth), 1e-8, 400);
    const sonde_contact *c = sonde_state_contact(b.state);
    assert_true(r.converged);
    assert_true(v_norm(v_sub(c->reaction_n, c->force_n)) < 1e-6 * r.contact_n);
    assert_near(r.reaction_n, r.contact_n, 1e-6 * r.contact_n);
    assert_true(c->force_n.x > last);
    last = c->force_n.x;
  }
  clear(&b);
}

// The volume law holds the probe as well: with the probe held, the tissue carries on average what
// the probe feels (the law's region changes from step to step, which makes it hum), and the force
// is of the size that the foundation gives.
static void volume_law_holds_the_probe(void **state) {
  (void)state;
  double force[2] = {0}, reaction[2] = {0};
  for (int law = 0; law < 2; ++law) {
    sonde_world_def def = fixture_world_def();
    def.contact_law = law ? SONDE_CONTACT_VOLUME : SONDE_CONTACT_FOUNDATION;
    bench b = make("square", def);
    for (int k = 0; k < 1500; ++k) {
      sonde_step(b.state, &b.probe, fixture_pose(fmin(0.006, 2e-5 * k)));
      if (k < 1000) continue;
      force[law] += sonde_state_contact(b.state)->force_n.x / 500;
      reaction[law] += sonde_state_contact(b.state)->reaction_n.x / 500;
    }
    assert_near(reaction[law], force[law], 0.02 * force[law]);
    clear(&b);
  }
  assert_near(force[1], force[0], 0.25 * force[0]);
}

// Time stepping with the probe held ends where the static solver ends.
static void dynamics_end_in_the_static_solution(void **state) {
  (void)state;
  sonde_world_def def = fixture_world_def();
  def.sleep_displacement_m = 1e-9;
  bench b = make("square", def);
  for (int k = 0; k < 800; ++k) sonde_step(b.state, &b.probe, fixture_pose(fmin(0.006, 2e-5 * k)));
  double moving = sonde_state_contact(b.state)->force_n.x;
  sonde_settle_result r = sonde_settle(b.state, &b.probe, fixture_pose(0.006), 1e-9, 400);
  assert_true(r.converged);
  assert_near(moving, r.contact_n, 1e-3 * r.contact_n);
  clear(&b);
}

// 100 N on the square probe: no node reaches its asymptote.
static void indentation_stays_below_the_asymptote(void **state) {
  (void)state;
  bench b = make("square", fixture_world_def());
  double worst = 0, force = 0;
  for (double depth = 0; depth < 0.2 && force < 100; depth += 0.0005) {
    sonde_step(b.state, &b.probe, fixture_pose(depth));
    force = v_norm(sonde_state_contact(b.state)->force_n);
    for (uint32_t i = 0; i < b.model->surface.vertex_count; ++i) {
      sonde_vec3 u = v_sub(b.model->surface.vertices[i], sonde_state_positions(b.state)[i]);
      worst = fmax(worst, v_dot(u, b.model->normal[i]) / b.model->xm_m[i]);
    }
  }
  assert_true(force >= 100);
  assert_true(worst > 0.8 && worst < 1);
  clear(&b);
}

// A bonded footprint: held nodes are where they were put, the holder carries the whole force.
static void bonded_footprint_carries_the_force(void **state) {
  (void)state;
  bench b = make("point", fixture_world_def());
  uint32_t nodes[8], count = 0;
  sonde_vec3 place[8], force;
  for (uint32_t i = 0; i < b.model->surface.vertex_count && count < 8; ++i)
    if (v_distance(b.model->surface.vertices[i], vec3(FIXTURE_RADIUS_M, 0, 0)) < 0.006) {
      nodes[count] = i;
      place[count++] = v_add(b.model->surface.vertices[i], vec3(-0.004, 0, 0));
    }
  assert_true(count > 3);
  sonde_settle_result r = sonde_settle_bonded(b.state, nodes, place, count, 1e-10, 300, &force);
  assert_true(r.converged);
  for (uint32_t k = 0; k < count; ++k)
    assert_memory_equal(&sonde_state_positions(b.state)[nodes[k]], &place[k], sizeof *place);
  // The anchors of all nodes add up to what the holder feels.
  assert_true(v_norm(v_sub(force, sonde_state_contact(b.state)->reaction_n)) <
              1e-8 * v_norm(force));
  assert_true(force.x > 0);
  clear(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(separated_means_no_force),
                                     cmocka_unit_test(action_equals_reaction),
                                     cmocka_unit_test(force_is_kappa_times_volume),
                                     cmocka_unit_test(never_pulls),
                                     cmocka_unit_test(equation_4_presses_like_newtons_method),
                                     cmocka_unit_test(two_bumps_are_two_regions),
                                     cmocka_unit_test(settled_reaction_equals_contact),
                                     cmocka_unit_test(volume_law_holds_the_probe),
                                     cmocka_unit_test(dynamics_end_in_the_static_solution),
                                     cmocka_unit_test(indentation_stays_below_the_asymptote),
                                     cmocka_unit_test(bonded_footprint_carries_the_force)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
