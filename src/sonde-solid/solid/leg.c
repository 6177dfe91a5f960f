// A leg under a probe: places are made, walked to the probe, shown and freed.
#include "leg_place.h"

#include "base/base.h"
#include "base/clock.h"
#include "grid.h"
#include "haptics/motion.h"

#include <string.h>

static const double back_m = 0.15, above_m = 0.04; // a probe looks for skin from behind to ahead
static const double around_m = 70e-3;              // skin of the model that moves
static const double touching_m = 0.7e-3;           // skin so near to the probe touches it

sonde_solid_leg_def sonde_solid_leg_def_default(void) {
  sonde_solid_leg_def def = {.mesh = sonde_hexes_def_default(),
                             .live = sonde_solid_live_def_default(),
                             .stray_m = 5e-3,
                             .still_m = 1.5e-3,
                             .stray_rad = 0.35};
  def.mesh.edge_m = 10e-3; // coarser than offline: a pass has 20 ms
  return def;
}

sonde_status sonde_solid_leg_create(const sonde_solid_leg_def *def, sonde_solid_leg **leg,
                                    sonde_error *error) {
  SONDE_ASSERT(def != NULL && def->model && def->skin && def->probes && leg != NULL);
  *leg = NULL;
  sonde_status status = sonde_hexes_ring_check(def->model, error);
  if (!status) status = sonde_equilibrium_check(&def->live.solid, error);
  if (status) return status;
  SONDE_ASSERT(def->columns != NULL);
  *leg = SONDE_NEW(sonde_solid_leg, 1);
  if (!*leg) return sonde_fail_memory(error);
  (*leg)->def = *def;
  return SONDE_OK;
}

static void destroy_place(sonde_leg_place *place) {
  if (place == NULL) return;
  sonde_solid_tissue_destroy(place->tissue);
  sonde_solid_live_destroy(place->live);
  sonde_hexes_clear(&place->mesh);
  sonde_free(place->skin);
  sonde_free(place->skin_rest);
  sonde_free(place->shares);
  sonde_free(place);
}

// Frees the places that no longer serve and that nobody holds, or all of them.
static void retire(sonde_solid_leg *leg, sonde_leg_place *place, bool all) {
  if (place) place->next = leg->retired, leg->retired = place;
  for (sonde_leg_place **at = &leg->retired; *at;) {
    sonde_leg_place *one = *at;
    if (!all && (atomic_load(&one->readers) > 0 || atomic_load(&leg->working) == one)) {
      at = &one->next;
      continue;
    }
    *at = one->next;
    for (int k = 0; k < 2 && one->live && leg->spares < SONDE_LEG_SPARES; ++k) {
      leg->spare[leg->spares++] = one->live->bulk[k];
      one->live->bulk[k] = (sonde_numeric){0};
    }
    destroy_place(one);
  }
}

void sonde_solid_leg_destroy(sonde_solid_leg *leg) {
  if (!leg) return;
  retire(leg, leg->coming, false);
  retire(leg, leg->given_back, false);
  retire(leg, atomic_load(&leg->current), true);
  for (uint32_t k = 0; k < leg->spares; ++k) sonde_numeric_clear(&leg->spare[k]);
  sonde_free(leg);
}

// The skin of the model that the place moves.
static sonde_status find_skin(const sonde_solid_leg *leg, sonde_leg_place *place,
                              sonde_error *error) {
  const sonde_mesh *surface = &leg->def.model->surface;
  for (int pass = 0; pass < 2; ++pass) {
    uint32_t count = 0;
    for (uint32_t n = 0; n < surface->vertex_count; ++n) {
      const sonde_vec3 rest = surface->vertices[n];
      if (v_distance(rest, place->start.position) > around_m) continue;
      if (pass == 1) {
        place->skin[count] = n, place->skin_rest[count] = rest;
        place->shares[count] = sonde_solid_tissue_shares(place->tissue, rest);
      }
      ++count;
    }
    place->skin_count = count;
    if (pass == 1) break;
    place->skin = SONDE_NEW(uint32_t, count + 1);
    place->skin_rest = SONDE_NEW(sonde_vec3, count + 1);
    place->shares = SONDE_NEW(sonde_tissue_shares, count + 1);
    if (!place->skin || !place->skin_rest || !place->shares) return sonde_fail_memory(error);
  }
  return SONDE_OK;
}

// A place at rest where the probe's axis meets the skin.
static sonde_status make_place(sonde_solid_leg *leg, sonde_pose pose, uint32_t probe,
                               sonde_leg_place **out, sonde_error *error) {
  const sonde_probe *body = &leg->def.probes[probe];
  const sonde_vec3 axis = q_rotate(pose.rotation, vec3(0, 0, 1));
  const sonde_vec3 outside = v_madd(pose.position, -back_m, axis);
  sonde_surface_point hit;
  *out = NULL;
  if (sonde_surface_inside(leg->def.skin, outside) ||
      !sonde_surface_raycast(leg->def.skin, outside, axis, back_m + above_m, &hit))
    return sonde_fail(error, SONDE_NOT_FOUND, "there is no skin below the probe");
  sonde_leg_place *place = SONDE_NEW(sonde_leg_place, 1);
  if (!place) return sonde_fail_memory(error);
  place->asked = pose, place->probe = probe;
  place->start = (sonde_pose){hit.point_m, pose.rotation};
  const sonde_site site = {.position_m = hit.point_m,
                           .normal = v_scale(axis, -1),
                           .u = q_rotate(pose.rotation, vec3(1, 0, 0)),
                           .v = q_rotate(pose.rotation, vec3(0, 1, 0))};
  sonde_hexes_def mesh = leg->def.mesh;
  mesh.half_u_m = body->half_x_m, mesh.half_v_m = body->half_y_m;
  sonde_status status = sonde_hexes_ring_of(leg->def.columns, &site, &mesh, &place->mesh, error);
  if (!status && place->mesh.node_count > SONDE_LEG_NODES_MOST)
    status = sonde_fail(error, SONDE_ARGUMENT, "a ring of %u nodes, expected at most %d",
                        place->mesh.node_count, SONDE_LEG_NODES_MOST);
  if (!status) {
    sonde_numeric *spare = leg->spares >= 2 ? &leg->spare[leg->spares -= 2] : NULL;
    status = sonde_live_make(&place->mesh, body, place->start, &leg->def.live, spare, &place->live,
                             error);
    for (int k = 0; k < 2 && spare; ++k) sonde_numeric_clear(&spare[k]); // not taken
  }
  if (!status) status = sonde_equilibrium_tissue(place->live->e, &place->tissue, error);
  if (!status) status = find_skin(leg, place, error);
  if (status)
    destroy_place(place);
  else
    *out = place;
  return status;
}

bool sonde_solid_leg_work(sonde_solid_leg *leg) {
  SONDE_ASSERT(leg != NULL);
  // Announced first: what serves when it has been announced is not freed meanwhile.
  sonde_leg_place *place;
  do {
    place = atomic_load(&leg->current);
    atomic_store(&leg->working, place);
  } while (place != atomic_load(&leg->current));
  const double before_s = sonde_clock_cpu();
  const uint32_t factors = place ? place->live->counts.factors : 0;
  const bool worked = place && sonde_solid_live_work(place->live);
  if (worked) {
    const double spent_s = sonde_clock_cpu() - before_s;
    ++leg->passes.passes, leg->passes.factors += place->live->counts.factors - factors;
    leg->passes.pass_s += spent_s;
    leg->passes.pass_most_s = fmax(leg->passes.pass_most_s, spent_s);
  }
  atomic_store(&leg->working, NULL);
  return worked;
}

bool sonde_solid_leg_build(sonde_solid_leg *leg) {
  SONDE_ASSERT(leg != NULL);
  const uint32_t wanted = atomic_load_explicit(&leg->wanted, memory_order_acquire);
  if (wanted == atomic_load_explicit(&leg->built, memory_order_relaxed)) return false;
  const double before_s = sonde_clock_cpu();
  retire(leg, leg->given_back, false);
  leg->given_back = NULL;
  if (leg->step == SONDE_LEG_MAKE)
    (void)make_place(leg, leg->wanted_pose, leg->wanted_probe, &leg->coming, NULL);
  else
    sonde_live_walk(leg->coming->live, leg->wanted_pose);
  leg->builds.build_s += sonde_clock_cpu() - before_s;
  // Behind the first place: memory for the next one's factors, touched before it is wanted.
  const sonde_leg_place *made = atomic_load(&leg->current) == NULL ? leg->coming : NULL;
  atomic_store_explicit(&leg->built, wanted, memory_order_release);
  for (; made && leg->spares < 2; ++leg->spares) {
    sonde_numeric *spare = &leg->spare[leg->spares];
    if (sonde_live_reserve(spare, made->live->e->symbolic, NULL)) {
      sonde_numeric_clear(spare);
      break;
    }
    memset(spare->factor, 0, spare->factor_room * sizeof *spare->factor);
    memset(spare->front, 0, spare->front_room * sizeof(float));
    memset(spare->stack, 0, spare->stack_room * sizeof(float));
  }
  return true;
}

void sonde_solid_leg_await(sonde_solid_leg *leg, uint32_t told) {
  if (told & SONDE_LEG_PLACE) (void)sonde_solid_leg_build(leg);
  if (told & SONDE_LEG_PASS) (void)sonde_solid_leg_work(leg);
}

sonde_status sonde_solid_leg_recall(sonde_solid_leg *leg, const sonde_leg_moment *moment,
                                    sonde_error *error) {
  SONDE_ASSERT(leg != NULL && moment != NULL);
  const sonde_pose poses[] = {moment->last, moment->place, moment->asked[0], moment->asked[1]};
  bool usable = moment->probe < leg->def.probe_count && v_finite(moment->drift_m_s) &&
                (!moment->is_refused || sonde_pose_usable(moment->refused));
  for (size_t k = 0; k < SONDE_COUNT_OF(poses) && moment->placed; ++k)
    usable = usable && sonde_pose_usable(poses[k]);
  if (!usable) return sonde_fail(error, SONDE_FORMAT, "the saved moment of the solid is damaged");
  // What is under way comes to its end and is dropped.
  sonde_solid_leg_await(leg, SONDE_LEG_PLACE | SONDE_LEG_PASS);
  retire(leg, leg->coming, false);
  retire(leg, leg->given_back, false);
  leg->coming = leg->given_back = NULL, leg->step = SONDE_LEG_IDLE;
  leg->now = *moment;
  sonde_leg_place *place = atomic_load(&leg->current);
  const bool same = moment->placed && place && place->probe == moment->probe &&
                    memcmp(&place->asked, &moment->place, sizeof place->asked) == 0;
  if (!same) {
    atomic_store(&leg->current, NULL);
    retire(leg, place, false);
    if (!moment->placed) return SONDE_OK;
    const sonde_status status = make_place(leg, moment->place, moment->probe, &place, error);
    if (status) return status;
    atomic_store(&leg->current, place);
  }
  if (!sonde_live_rest(place->live, moment->asked))
    return sonde_fail(error, SONDE_CONVERGENCE, "the solid has no positive stiffness at rest");
  return SONDE_OK;
}

// ---- images -------------------------------------------------------------------------------

const sonde_interior_tissue *sonde_leg_place_tissue(sonde_leg_place *place,
                                                    const sonde_vec3 *moved) {
  sonde_solid_tissue_fill(place->tissue, place->live->e, moved);
  return place->tissue;
}

void sonde_leg_place_skin(const sonde_leg_place *place, sonde_pose pose, sonde_vec3 *skin_m,
                          sonde_vec3 *touching) {
  SONDE_ASSERT(place != NULL && skin_m != NULL && touching != NULL);
  for (uint32_t k = 0; k < place->skin_count; ++k) {
    const sonde_vec3 now =
        v_add(place->skin_rest[k], sonde_solid_tissue_moved(place->tissue, &place->shares[k]));
    double depth;
    sonde_vec3 out;
    sonde_mat3 bend;
    skin_m[place->skin[k]] = now;
    if (sonde_touch_depth(&place->live->e->shape, pose_apply_inverse(pose, now), touching_m, &depth,
                          &out, &bend))
      touching[place->skin[k]] = q_rotate(pose.rotation, out);
  }
}

void sonde_leg_place_give_back(sonde_leg_place *place) {
  if (place) atomic_fetch_sub(&place->readers, 1);
}

sonde_leg_counts sonde_solid_leg_count(const sonde_solid_leg *leg) {
  sonde_leg_counts counts = leg->counts;
  counts.passes = leg->passes.passes, counts.factors = leg->passes.factors;
  counts.pass_s = leg->passes.pass_s, counts.pass_most_s = leg->passes.pass_most_s;
  counts.build_s = leg->builds.build_s;
  return counts;
}
