// A solid with a probe: what may touch, the way of the probe in steps, reading the inside.
#include "equilibrium.h"

#include "base/base.h"
#include "haptics/motion.h"

#include <string.h>

enum { FINEST = 64 };
static const double least_contact_n_m3 = 1e6, most_contact_n_m3 = 1e13;
static const double skin_below_m = 0.06;  // skin of the zone is at most this far below the tip
static const double widest_ball_m = 0.03; // half width of a ball that touches
static const double turn_radius_m = 0.03; // way of the probe per turn

sonde_equilibrium_def sonde_equilibrium_def_default(void) {
  sonde_equilibrium_def def = {.version = SONDE_DEF_VERSION,
                               .contact_n_m3 = 1e9,
                               .zone_m = 15e-3,
                               .step_m = 3e-3,
                               .tolerance = 1e-8};
  for (int k = 0; k < SONDE_SOLID_LAYERS; ++k)
    def.layer[k] = sonde_hyperelastic_default((sonde_solid_layer)k);
  return def;
}

sonde_status sonde_equilibrium_check(const sonde_equilibrium_def *def, sonde_error *error) {
  sonde_status status = sonde_def_check("an equilibrium", def->version, error);
  static const char *const NAMES[] = {"muscle", "fat", "skin"};
  for (int k = 0; k < SONDE_SOLID_LAYERS && !status; ++k) {
    const sonde_hyperelastic *m = &def->layer[k];
    bool good = m->shear_pa > 0 && m->bulk_pa > 0 && isfinite(m->shear_pa) && isfinite(m->bulk_pa);
    if (m->energy == SONDE_ENERGY_OGDEN)
      good &= fabs(m->exponent) >= 0.1 && fabs(m->exponent) <= 40;
    if (m->energy == SONDE_ENERGY_FUNG) good &= m->exponent >= 1e-3 && m->exponent <= 100;
    if (!good)
      status = sonde_fail(error, SONDE_ARGUMENT,
                          "%s: shear modulus %g Pa, exponent %g, bulk modulus %g Pa: expected "
                          "positive moduli and an exponent of 0.1 to 40 (Ogden) or 0.001 to 100 "
                          "(Fung)",
                          NAMES[k], m->shear_pa, m->exponent, m->bulk_pa);
  }
  const sonde_bounded range[] = {
      {"rounding_m", def->rounding_m, 0, 0.05},
      {"contact_n_m3", def->contact_n_m3, least_contact_n_m3, most_contact_n_m3},
      {"zone_m", def->zone_m, 1e-3, 0.2},
      {"step_m", def->step_m, 1e-5, 0.1},
      {"tolerance", def->tolerance, 1e-12, 1e-2},
      {"friction", def->friction, 0, 10}};
  if (!status) status = sonde_bounded_check(range, SONDE_COUNT_OF(range), error);
  if (!status && def->bonded && def->friction > 0)
    status = sonde_fail(error, SONDE_ARGUMENT,
                        "friction %g: expected 0 of a bonded probe, which nothing slides on",
                        def->friction);
  return status;
}

// ---- making -------------------------------------------------------------------------------

sonde_status sonde_equilibrium_make(const sonde_hexes *mesh, const uint8_t *in_zone,
                                    const sonde_equilibrium_def *def,
                                    sonde_equilibrium **equilibrium, sonde_error *error) {
  SONDE_ASSERT(mesh != NULL && mesh->count > 0 && equilibrium != NULL);
  sonde_equilibrium *e = *equilibrium = SONDE_NEW(sonde_equilibrium, 1);
  if (!e) return sonde_fail_memory(error);
  e->mesh = mesh, e->def = *def, e->kernels = sonde_hex_kernels_find(NULL);
  const uint32_t nodes = mesh->node_count, *lines = mesh->lines, sheet = lines[1] * lines[2];
  e->unknown = SONDE_NEW(uint32_t, nodes);
  e->zone_node = SONDE_NEW(uint32_t, nodes);
  e->face = SONDE_NEW(uint32_t, mesh->face_count);
  e->corner = (uint32_t(*)[8])sonde_calloc(mesh->count, sizeof *e->corner);
  e->moved = SONDE_NEW(sonde_vec3, nodes);
  e->trial = SONDE_NEW(sonde_vec3, nodes);
  e->kept = SONDE_NEW(sonde_vec3, nodes);
  sonde_status status = sonde_fail_memory(error);
  if (!e->unknown || !e->zone_node || !e->face || !e->corner || !e->moved || !e->trial || !e->kept)
    goto done;
  // Unknowns, those of the patch and the zone last; faces, those of the zone first.
  for (int part = 0; part < 3; ++part)
    for (uint32_t n = 0; n < nodes; ++n) {
      if (part == 0) e->unknown[n] = SONDE_HELD_CORNER;
      if (mesh->held[n] == 7 || in_zone[n] != (part == 2 ? SONDE_IN_ZONE : part * SONDE_IN_PATCH))
        continue;
      if (part == 2) e->zone_node[e->zone_count++] = n;
      e->patch_count += part == 1, e->unknown[n] = e->unknown_count++;
    }
  for (uint32_t h = 0; h < mesh->count; ++h)
    for (int c = 0; c < 8; ++c) e->corner[h][c] = e->unknown[mesh->corner[h][c]];
  uint32_t others = mesh->face_count;
  for (uint32_t f = 0; f < mesh->face_count; ++f) {
    bool inside = true;
    for (int c = 0; c < 4; ++c) {
      const uint32_t at = e->unknown[mesh->face[f][c]];
      inside &= at != SONDE_HELD_CORNER && at >= sonde_zone_first(e);
    }
    if (inside)
      e->face[e->zone_faces++] = f;
    else
      e->face[--others] = f;
  }
  if (e->zone_count == 0 || sonde_patch_first(e) == 0) {
    status = sonde_fail(error, SONDE_ARGUMENT,
                        "%u of %u nodes may touch: expected some, and some that do not",
                        e->zone_count, e->unknown_count);
    goto done;
  }
  const size_t count = 3 * (size_t)e->unknown_count, side = 3 * (size_t)e->zone_count;
  double **vectors[] = {&e->force, &e->step,  &e->way,         &e->way_trial, &e->load,
                        &e->touch, &e->right, &e->touch_trial, &e->schur,     &e->matrix};
  const size_t size[] = {count, count, side, side,        side,
                         side,  side,  side, side * side, side * side};
  e->front = SONDE_NEW(float, sonde_front_stride((uint32_t)side) * side);
  bool all = e->front != NULL;
  for (size_t k = 0; k < SONDE_COUNT_OF(vectors); ++k)
    all &= (*vectors[k] = SONDE_NEW(double, size[k])) != NULL;
  e->imposed = SONDE_NEW(uint8_t, e->zone_count), e->target = SONDE_NEW(sonde_vec3, e->zone_count);
  sonde_vec3 *points = SONDE_NEW(sonde_vec3, e->unknown_count);
  if (all && e->imposed && e->target && points) {
    // Of a grid the lines are what cuts it well: near the probe they lie close together.
    for (uint32_t n = 0; n < nodes; ++n)
      if (e->unknown[n] != SONDE_HELD_CORNER)
        points[e->unknown[n]] =
            sheet ? vec3(n / sheet, n / lines[2] % lines[1], n % lines[2]) : mesh->node[n];
    const sonde_symbolic_def how = {.node_count = e->unknown_count,
                                    .last_count = e->patch_count + e->zone_count,
                                    .block = 3,
                                    .points = points,
                                    .element_count = mesh->count,
                                    .elements = (const uint32_t(*)[8])e->corner};
    status = sonde_symbolic_create(&how, &e->symbolic, error);
    if (!status && !e->patch_count) status = sonde_numeric_reserve(&e->numeric, e->symbolic, error);
  }
  sonde_free(points);
done:
  if (!status) return SONDE_OK;
  sonde_equilibrium_destroy(e);
  *equilibrium = NULL;
  return status;
}

void sonde_equilibrium_destroy(sonde_equilibrium *e) {
  if (!e) return;
  void *parts[] = {e->unknown, e->zone_node, e->face,  e->corner, e->moved,       e->trial,
                   e->kept,    e->force,     e->step,  e->way,    e->way_trial,   e->load,
                   e->touch,   e->right,     e->schur, e->matrix, e->touch_trial, e->imposed,
                   e->target,  e->front,     e->stick};
  for (size_t k = 0; k < SONDE_COUNT_OF(parts); ++k) sonde_free(parts[k]);
  sonde_surface_index_destroy(e->shape.hull);
  sonde_numeric_clear(&e->numeric);
  sonde_symbolic_destroy(e->symbolic);
  sonde_free(e);
}

// Whether a point of the probe's frame lies this far around the footprint, near the skin.
static bool is_beside(const sonde_probe *probe, double reach, sonde_vec3 p) {
  const bool ball = probe->ball_radius_m > 0;
  const double half_x = ball ? fmin(probe->ball_radius_m, widest_ball_m) : probe->half_x_m;
  const double half_y = ball ? half_x : probe->half_y_m;
  return fabs(p.x) < half_x + reach && fabs(p.y) < half_y + reach && fabs(p.z) < skin_below_m;
}

sonde_status sonde_equilibrium_create(const sonde_hexes *mesh, const sonde_probe *probe,
                                      sonde_pose start, const sonde_equilibrium_def *def,
                                      sonde_equilibrium **equilibrium, sonde_error *error) {
  return sonde_equilibrium_place(mesh, probe, start, def, 0, equilibrium, error);
}

sonde_status sonde_equilibrium_place(const sonde_hexes *mesh, const sonde_probe *probe,
                                     sonde_pose start, const sonde_equilibrium_def *def,
                                     double patch_m, sonde_equilibrium **equilibrium,
                                     sonde_error *error) {
  SONDE_ASSERT(mesh != NULL && probe != NULL && equilibrium != NULL);
  *equilibrium = NULL;
  sonde_status status = sonde_equilibrium_check(def, error);
  if (status) return status;
  const bool ball = probe->ball_radius_m > 0;
  // Lines of nodes along the footprint's border belong to it, though the skin's curvature moves
  // them.
  const double slack = 0.15 * (ball ? fmin(probe->ball_radius_m, widest_ball_m)
                                    : fmin(probe->half_x_m, probe->half_y_m));
  const double reach = def->bonded ? slack : def->rounding_m + def->zone_m;
  uint8_t *in_zone = SONDE_NEW(uint8_t, mesh->node_count);
  if (!in_zone) return sonde_fail_memory(error);
  for (uint32_t h = 0; h < mesh->count && patch_m > 0; ++h) {
    sonde_vec3 middle = vec3(0, 0, 0);
    for (int c = 0; c < 8; ++c) middle = v_madd(middle, 0.125, mesh->node[mesh->corner[h][c]]);
    if (mesh->layer[h] == SONDE_SOLID_SKIN &&
        is_beside(probe, patch_m, pose_apply_inverse(start, middle)))
      for (int c = 0; c < 8; ++c) in_zone[mesh->corner[h][c]] = SONDE_IN_PATCH;
  }
  for (uint32_t f = 0; f < mesh->face_count; ++f)
    for (int c = 0; c < 4; ++c) {
      const uint32_t n = mesh->face[f][c];
      if (is_beside(probe, reach, pose_apply_inverse(start, mesh->node[n])))
        in_zone[n] = SONDE_IN_ZONE;
    }
  status = sonde_equilibrium_make(mesh, in_zone, def, equilibrium, error);
  sonde_free(in_zone);
  if (status) return status;
  sonde_equilibrium *e = *equilibrium;
  e->shape = (sonde_touch_shape){.probe = probe, .rounding_m = def->rounding_m};
  e->start = e->pose = start;
  e->least_load_n = sonde_equilibrium_least_load(e);
  for (uint32_t k = 0; k < e->zone_count; ++k) e->imposed[k] = def->bonded;
  if (!ball && (def->rounding_m > 0 || patch_m > 0))
    status = sonde_surface_index_create(&probe->body.hull, &e->shape.hull, error);
  if (!status && def->friction > 0) {
    e->stick = SONDE_NEW(sonde_stick, SONDE_TOUCH_POINTS * (size_t)e->zone_faces);
    if (!e->stick) status = sonde_fail_memory(error);
    sonde_friction_look(e, start, e->moved, NULL, SONDE_FRICTION_FORGET);
  }
  if (!status) return SONDE_OK;
  sonde_equilibrium_destroy(e);
  *equilibrium = NULL;
  return status;
}

// ---- the probe's way ------------------------------------------------------------------------

double sonde_equilibrium_way(sonde_pose from, sonde_pose to) {
  const double turn = sonde_quat_angle(from.rotation, to.rotation);
  return v_distance(from.position, to.position) + turn_radius_m * turn;
}

sonde_status sonde_equilibrium_find(sonde_equilibrium *e, sonde_pose pose,
                                    sonde_equilibrium_result *result, sonde_error *error) {
  SONDE_ASSERT(e != NULL && result != NULL);
  const sonde_pose from = e->pose;
  const double way = sonde_equilibrium_way(from, pose);
  if (!isfinite(way)) return sonde_fail(error, SONDE_ARGUMENT, "the probe's pose is not finite");
  const size_t bytes = e->mesh->node_count * sizeof *e->moved;
  const size_t points = e->stick ? SONDE_TOUCH_POINTS * (size_t)e->zone_faces : 0;
  sonde_vec3 *begin = SONDE_NEW(sonde_vec3, e->mesh->node_count);
  sonde_stick *stuck = SONDE_NEW(sonde_stick, points + 1);
  sonde_status status = begin && stuck ? SONDE_OK : sonde_fail_memory(error);
  if (status) goto done;
  memcpy(begin, e->moved, bytes);
  if (points > 0) memcpy(stuck, e->stick, points * sizeof *stuck);
  const double whole = 1 / fmax(1, ceil(way / e->def.step_m - 1e-9));
  *result = (sonde_equilibrium_result){0};
  for (double done = 0, part = whole; done < 1 && !status;) {
    const double to = done + part > 1 - 1e-9 ? 1 : done + part;
    const sonde_pose next = to < 1 ? sonde_pose_blend(from, pose, to) : pose;
    memcpy(e->kept, e->moved, bytes);
    for (uint32_t k = 0; k < e->zone_count; ++k) {
      const sonde_vec3 rest = e->mesh->node[e->zone_node[k]];
      e->target[k] = v_sub(pose_apply(next, pose_apply_inverse(e->start, rest)), rest);
    }
    if (sonde_equilibrium_solve(e, next, result)) {
      done = to, part = fmin(2 * part, whole), e->pose = next;
      sonde_friction_look(e, next, e->moved, NULL, SONDE_FRICTION_SLIP);
      continue;
    }
    memcpy(e->moved, e->kept, bytes);
    part /= 2;
    if (part < whole / FINEST)
      status = sonde_fail(error, SONDE_CONVERGENCE,
                          "no equilibrium was found %.3f mm along the probe's way (residual %.1e)",
                          1e3 * way * to, result->residual);
  }
  sonde_touch outside = {0};
  for (uint32_t k = e->zone_faces; k < e->mesh->face_count && !status && !e->def.bonded; ++k) {
    sonde_vec3 rest[4], now[4];
    double f[12];
    sonde_equilibrium_face(e, e->moved, e->face[k], rest, now);
    if (sonde_touch_face(&e->shape, pose, e->def.contact_n_m3, NULL, rest, now, false, &outside, f,
                         NULL))
      status = sonde_fail(error, SONDE_CONVERGENCE,
                          "skin beyond the zone of %.1f mm around the footprint touches the probe",
                          1e3 * e->def.zone_m);
  }
  // Bonded: what holds the skin is what the probe feels.
  for (uint32_t k = 0; k < e->zone_count && !status && e->def.bonded; ++k) {
    const double *f = e->force + 3 * (size_t)(sonde_zone_first(e) + k);
    const sonde_vec3 hold = vec3(f[0], f[1], f[2]);
    const uint32_t n = e->zone_node[k];
    const sonde_vec3 arm = v_sub(v_add(e->mesh->node[n], e->moved[n]), e->pose.position);
    result->force_n = v_sub(result->force_n, hold);
    result->torque_nm = v_sub(result->torque_nm, v_cross(arm, hold));
  }
  if (status) sonde_equilibrium_restore(e, from, begin);
  if (status && points > 0) memcpy(e->stick, stuck, points * sizeof *stuck);
done:
  sonde_free(begin);
  sonde_free(stuck);
  return status;
}

// ---- reading ------------------------------------------------------------------------------

void sonde_equilibrium_restore(sonde_equilibrium *e, sonde_pose pose,
                               const sonde_vec3 *displacement_m) {
  SONDE_ASSERT(e != NULL && displacement_m != NULL);
  memcpy(e->moved, displacement_m, e->mesh->node_count * sizeof *e->moved);
  e->pose = pose, e->factored = false;
  sonde_friction_look(e, pose, e->moved, NULL, SONDE_FRICTION_FORGET);
}

const sonde_vec3 *sonde_equilibrium_state(const sonde_equilibrium *e) {
  SONDE_ASSERT(e != NULL);
  return e->moved;
}

void sonde_equilibrium_size(const sonde_equilibrium *e, uint32_t *unknowns,
                            uint32_t *zone_unknowns) {
  SONDE_ASSERT(e != NULL && unknowns != NULL && zone_unknowns != NULL);
  *unknowns = 3 * e->unknown_count, *zone_unknowns = 3 * e->zone_count;
}
