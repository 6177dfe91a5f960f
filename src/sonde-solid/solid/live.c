// A live solid: making, and what belongs to which pass.
#include "live.h"

#include "base/base.h"
#include "haptics/motion.h"

#include <string.h>

enum { STUCK_MOST = 5 };    // passes without balance before a state comes anew from rest
enum { SETTLED_LEAST = 3 }; // passes in balance before a held probe needs none
// A probe that has gone in by less than 8 mm has a new factor after a quarter of that, but not
// before 0.8 mm: there the stiffness changes within a smaller way.
static const double shallow_m = 0.8e-3, shallow_share = 0.25;
// Force without balance that a pass leaves, over the contact's: with more the factor is stale, or
// the state lost; with less a state that comes from rest bears the hand.
static const double stale = 0.03, lost = 0.2, settled = 0.1;

sonde_solid_live_def sonde_solid_live_def_default(void) {
  return (sonde_solid_live_def){.version = SONDE_DEF_VERSION,
                                .solid = sonde_equilibrium_def_default(),
                                .pass_ticks = 20,
                                .factor_passes = 2,
                                .skin_steps = 3,
                                .skin_m = 20e-3,
                                .lead_passes = 1.5,
                                .refresh_m = 2e-3,
                                .pass_m = 3e-3,
                                .lag_m = 6e-3,
                                .ease_n_s = 5};
}

// Bulk, then nonlinear skin: hexahedra of the skin all of whose corners are in the patch or zone.
// The points of the contact.
static void arrange(sonde_solid_live *l) {
  const sonde_equilibrium *e = l->e;
  for (int skin = 0; skin < 2; ++skin)
    for (uint32_t h = 0; h < e->mesh->count; ++h) {
      bool inside = e->mesh->layer[h] == SONDE_SOLID_SKIN;
      for (int c = 0; c < 8; ++c)
        inside &= e->corner[h][c] == SONDE_HELD_CORNER || e->corner[h][c] >= sonde_patch_first(e);
      if (inside != skin) continue;
      l->is_skin[h] = inside;
      l->hex[l->bulk_count + l->skin_count] = h;
      ++*(inside ? &l->skin_count : &l->bulk_count);
    }
  for (uint32_t n = 0; n < l->point_count; ++n) {
    sonde_live_point *p = &l->point[n];
    const uint32_t face = e->face[n / SONDE_TOUCH_POINTS];
    sonde_vec3 rest[4];
    for (int c = 0; c < 4; ++c) {
      rest[c] = e->mesh->node[e->mesh->face[face][c]];
      p->node[c] = e->unknown[e->mesh->face[face][c]] - sonde_zone_first(e);
    }
    const double area = sonde_touch_point(rest, (int)(n % SONDE_TOUCH_POINTS), p->share);
    p->soft_m_n = 1 / (e->def.contact_n_m3 * area);
  }
  for (uint32_t k = 0; k < e->zone_count; ++k) l->skin[k] = e->mesh->node[e->zone_node[k]];
}

// @param spare factors whose memory is taken; NULL: none
static sonde_status reserve(sonde_solid_live *l, sonde_numeric *spare, sonde_error *error) {
  const sonde_equilibrium *e = l->e;
  const size_t side = sonde_live_side(l), zone = 3 * (size_t)e->zone_count;
  l->point_count = e->zone_faces * SONDE_TOUCH_POINTS;
  l->width = (uint32_t)(zone + 15) / 16 * 16;
  const struct {
    void **array;
    size_t count, size;
  } parts[] = {
      {(void **)&l->hex, e->mesh->count, sizeof *l->hex},
      {(void **)&l->is_skin, e->mesh->count, sizeof *l->is_skin},
      {(void **)&l->bulk_state, e->mesh->node_count, sizeof *l->bulk_state},
      {(void **)&l->pull, side, sizeof *l->pull},
      {(void **)&l->stretch, side, sizeof *l->stretch},
      {(void **)&l->ways, side, sizeof *l->ways},
      {(void **)&l->left, side, sizeof *l->left},
      {(void **)&l->right, side, sizeof *l->right},
      {(void **)&l->rest, side, sizeof *l->rest},
      {(void **)&l->trial, side, sizeof *l->trial},
      {(void **)&l->tangent, side * sonde_front_stride((uint32_t)side), sizeof *l->tangent},
      {(void **)&l->inverse, 2 * zone * sonde_front_stride((uint32_t)(2 * zone)),
       sizeof *l->inverse},
      {(void **)&l->shown[0].moved, e->mesh->node_count, sizeof *l->skin},
      {(void **)&l->shown[1].moved, e->mesh->node_count, sizeof *l->skin},
      {(void **)&l->shown[0].free_m, e->zone_count, sizeof *l->skin},
      {(void **)&l->shown[1].free_m, e->zone_count, sizeof *l->skin},
      {(void **)&l->shown[0].give_m_n, zone * l->width, sizeof(float)},
      {(void **)&l->shown[1].give_m_n, zone * l->width, sizeof(float)},
      {(void **)&l->point, l->point_count, sizeof *l->point},
      {(void **)&l->candidate, l->point_count, sizeof *l->candidate},
      {(void **)&l->rows, (size_t)l->point_count * l->width, sizeof *l->rows},
      {(void **)&l->moved, l->width, sizeof *l->moved},
      {(void **)&l->skin, e->zone_count, sizeof *l->skin},
  };
  for (size_t k = 0; k < SONDE_COUNT_OF(parts); ++k)
    if (!(*parts[k].array = sonde_calloc(parts[k].count, parts[k].size)))
      return sonde_fail_memory(error);
  sonde_status status = SONDE_OK;
  for (int k = 0; k < 2 && !status; ++k) {
    if (spare) l->bulk[k] = spare[k], spare[k] = (sonde_numeric){0};
    status = sonde_live_reserve(&l->bulk[k], e->symbolic, error);
  }
  l->e->numeric.kernels = l->bulk[0].kernels; // its only part that a live solid uses
  return status;
}

// The solid at rest with its tangent, all at once; the probe is at a pose that touches nothing.
// @return false: there is no positive one
static bool begin_at_rest(sonde_solid_live *l, sonde_pose pose, sonde_live_tangent *shown) {
  sonde_equilibrium *e = l->e;
  memset(e->moved, 0, e->mesh->node_count * sizeof *e->moved);
  e->pose = pose;
  l->making = l->returns = false, l->shift = 0, l->stuck = l->settled = 0, l->rests = false;
  sonde_live_begin_factor(l);
  if (!sonde_live_share_factor(l, UINT64_MAX) || !sonde_live_forces(l)) return false;
  sonde_live_pull(l);
  return l->rests = shown->rests = sonde_live_show(l, shown);
}

sonde_status sonde_solid_live_create(const sonde_hexes *mesh, const sonde_probe *probe,
                                     sonde_pose start, const sonde_solid_live_def *def,
                                     sonde_solid_live **live, sonde_error *error) {
  return sonde_live_make(mesh, probe, start, def, NULL, live, error);
}

sonde_status sonde_live_make(const sonde_hexes *mesh, const sonde_probe *probe, sonde_pose start,
                             const sonde_solid_live_def *def, sonde_numeric *spare,
                             sonde_solid_live **live, sonde_error *error) {
  SONDE_ASSERT(mesh != NULL && probe != NULL && def != NULL && live != NULL);
  *live = NULL;
  sonde_status status = sonde_def_check("a live solid", def->version, error);
  const sonde_bounded range[] = {
      {"pass_ticks", def->pass_ticks, 1, 1000}, {"factor_passes", def->factor_passes, 1, 100},
      {"skin_steps", def->skin_steps, 1, 20},   {"skin_m", def->skin_m, 1e-3, 0.2},
      {"lead_passes", def->lead_passes, 0, 5},  {"refresh_m", def->refresh_m, 1e-5, 0.05},
      {"pass_m", def->pass_m, 1e-5, 0.05},      {"lag_m", def->lag_m, def->refresh_m, 0.1},
      {"ease_n_s", def->ease_n_s, 1e-3, 1e9}};
  if (!status) status = sonde_bounded_check(range, SONDE_COUNT_OF(range), error);
  if (!status && (def->solid.bonded || def->solid.friction > 0))
    status = sonde_fail(error, SONDE_ARGUMENT,
                        "bonded %d, friction %g: expected a probe that slides without friction",
                        def->solid.bonded, def->solid.friction);
  if (status) return status;
  sonde_solid_live *l = SONDE_NEW(sonde_solid_live, 1);
  if (!l) return sonde_fail_memory(error);
  l->def = *def;
  status = sonde_equilibrium_place(mesh, probe, start, &def->solid, def->skin_m, &l->e, error);
  if (!status) status = reserve(l, spare, error);
  if (!status) {
    l->before = l->asked_pose = l->felt_pose = start;
    arrange(l);
    // As many multiplications per pass as let the passes make a factor.
    l->slice = 1000000;
    while (sonde_symbolic_steps(l->e->symbolic, l->slice) > def->factor_passes)
      l->slice += l->slice / 16;
    if (!begin_at_rest(l, start, &l->shown[0]))
      status = sonde_fail(error, SONDE_CONVERGENCE, "the solid has no positive stiffness at rest");
    l->counts.factors = 0;
  }
  if (!status) {
    *live = l;
    return SONDE_OK;
  }
  sonde_solid_live_destroy(l);
  return status;
}

void sonde_solid_live_destroy(sonde_solid_live *l) {
  if (!l) return;
  void *parts[] = {l->hex,
                   l->is_skin,
                   l->bulk_state,
                   l->pull,
                   l->stretch,
                   l->ways,
                   l->left,
                   l->right,
                   l->rest,
                   l->trial,
                   l->tangent,
                   l->inverse,
                   l->shown[0].moved,
                   l->shown[1].moved,
                   l->shown[0].free_m,
                   l->shown[1].free_m,
                   l->shown[0].give_m_n,
                   l->shown[1].give_m_n,
                   l->point,
                   l->candidate,
                   l->rows,
                   l->moved,
                   l->skin};
  for (size_t k = 0; k < SONDE_COUNT_OF(parts); ++k) sonde_free(parts[k]);
  for (int k = 0; k < 2; ++k) sonde_numeric_clear(&l->bulk[k]);
  sonde_equilibrium_destroy(l->e);
  sonde_free(l);
}

// ---- passes ---------------------------------------------------------------------------------

// The tangent of the last pass serves on.
static void keep_tangent(const sonde_solid_live *l, sonde_live_tangent *next,
                         const sonde_live_tangent *last) {
  memcpy(next->free_m, last->free_m, l->e->zone_count * sizeof *next->free_m);
  memcpy(next->give_m_n, last->give_m_n,
         3 * (size_t)l->e->zone_count * l->width * sizeof *next->give_m_n);
  next->stiffness_n_m = last->stiffness_n_m;
}

// Where a pass goes: to where the probe will be in the middle of the time in which it serves, as
// far as the state and the factor of the bulk bear it.
// @return whether the probe will leave the skin at rest there, which the solid bears from any state
static bool aim(sonde_solid_live *l, sonde_pose motion, sonde_pose *pose) {
  const sonde_pose middle = l->bulk_pose[l->serves], from = l->e->pose;
  *pose = l->asked_pose;
  for (double lead = l->def.lead_passes; lead > 0; lead -= 1)
    *pose = sonde_pose_blend(*pose, pose_mul(motion, *pose), fmin(lead, 1));
  if (sonde_live_is_clear(l, *pose)) return true;
  const double way = sonde_equilibrium_way(from, *pose);
  if (way > l->def.pass_m) *pose = sonde_pose_blend(from, *pose, l->def.pass_m / way);
  const double lag = sonde_equilibrium_way(middle, *pose);
  if (lag > l->def.lag_m) *pose = sonde_pose_blend(middle, *pose, l->def.lag_m / lag);
  const bool limited = way > l->def.pass_m || lag > l->def.lag_m;
  l->counts.held += limited;
  return limited && sonde_live_is_clear(l, *pose);
}

bool sonde_solid_live_work(sonde_solid_live *l) {
  SONDE_ASSERT(l != NULL);
  const uint32_t asked = atomic_load_explicit(&l->asked, memory_order_acquire);
  if (asked == atomic_load_explicit(&l->done, memory_order_relaxed)) return false;
  sonde_equilibrium *e = l->e;
  sonde_live_tangent *next = &l->shown[asked & 1], *last = &l->shown[!(asked & 1)];
  const sonde_pose motion = pose_mul(l->asked_pose, pose_inverse(l->before));
  l->before = l->asked_pose;
  // A probe that touches nothing is followed by the solid at rest, wherever it goes.
  sonde_pose pose;
  const bool clear = aim(l, motion, &pose);
  bool found = true;
  if (clear) {
    memset(e->moved, 0, e->mesh->node_count * sizeof *e->moved);
    e->pose = l->asked_pose;
    if (l->of_rest[l->serves]) l->bulk_pose[l->serves] = e->pose;
    l->stuck = l->settled = 0, l->returns = false;
  }
  // One that is held needs no pass once some have had nothing to do.
  const bool held = !clear && l->settled >= SETTLED_LEAST && !l->making && !(l->shift > 0) &&
                    sonde_equilibrium_way(e->pose, pose) < sonde_live_still_m;
  if (held || (clear && l->rests)) {
    if (!next->rests || held) keep_tangent(l, next, last);
  } else {
    l->rests = false;
    if (clear) {
      l->ready = false;
      found = sonde_live_forces(l);
    } else {
      found = sonde_live_follow(l, pose);
      if (found) e->pose = pose;
    }
    // A factor begins when the probe has left the place of the latest one, when a pass has found no
    // step or the pass before has left forces without balance, when a shift has to make it positive
    // definite, when one was shifted, and once the solid is at rest. A walk has it at once and only
    // where the next step needs it: a factor costs as much as five passes.
    const double depth = sonde_equilibrium_way(e->start, e->pose);
    const double soon = fmin(l->def.refresh_m, fmax(shallow_m, shallow_share * depth));
    const bool comes = l->walks || l->returns;
    const double refresh = comes ? fmax(l->def.refresh_m, 0.75 * l->def.lag_m) : soon;
    const bool left = sonde_equilibrium_way(l->bulk_pose[l->serves], e->pose) > refresh;
    const bool astray = !found || (!comes && l->unbalance > stale);
    if (!l->making && (l->shift > 0 || l->is_shifted[l->serves] ||
                       (clear ? !l->of_rest[l->serves] : left || astray)))
      sonde_live_begin_factor(l);
    (void)sonde_live_share_factor(l, comes ? UINT64_MAX : l->slice);
    sonde_live_pull(l);
    if (!sonde_live_show(l, next)) {
      found = false;
      keep_tangent(l, next, last);
    }
    l->counts.kept += !found;
    l->stuck = clear || (found && l->unbalance < lost) ? 0 : l->stuck + 1;
    l->rests = clear && found && l->of_rest[l->serves] && !l->is_shifted[l->serves] && !l->making &&
               !(l->shift > 0);
    // A state that has lost its balance goes back to rest and follows the probe from there. Until
    // it is with the probe again the hand has the tangent from before.
    if (l->stuck > (l->returns ? STUCK_MOST : 0))
      l->returns = begin_at_rest(l, e->start, next), ++l->counts.returns;
    else if (l->unbalance < settled &&
             sonde_equilibrium_way(l->asked_pose, e->pose) <= l->def.pass_m)
      l->returns = false;
    if (l->returns) keep_tangent(l, next, last);
  }
  next->rests = l->rests && !l->returns;
  memcpy(next->moved, l->returns ? last->moved : e->moved, e->mesh->node_count * sizeof *e->moved);
  ++l->counts.passes;
  atomic_store_explicit(&l->done, asked, memory_order_release);
  return true;
}

bool sonde_live_rest(sonde_solid_live *l, const sonde_pose asked[2]) {
  SONDE_ASSERT(l != NULL && sonde_live_is_done(l));
  if (!l->rests && !begin_at_rest(l, asked[0], &l->shown[l->serving])) return false;
  sonde_live_tangent *shown = &l->shown[l->serving];
  if (!shown->rests) keep_tangent(l, shown, &l->shown[!l->serving]);
  memset(shown->moved, 0, l->e->mesh->node_count * sizeof *shown->moved);
  shown->rests = true;
  l->e->pose = l->bulk_pose[l->serves] = l->before = asked[0];
  for (uint32_t n = 0; n < l->point_count; ++n) l->point[n].load_n = 0;
  memcpy(l->skin, shown->free_m, l->e->zone_count * sizeof *l->skin);
  l->felt_n = l->felt_nm = l->easing_n = l->easing_nm = vec3(0, 0, 0);
  l->touches = l->adopts = false;
  l->asked_before = asked[0], l->asked_pose = asked[1];
  // The pass under way writes beside what serves.
  const uint32_t next = atomic_load(&l->done) + ((atomic_load(&l->done) & 1) == l->serving ? 1 : 2);
  atomic_store(&l->done, next - 1), atomic_store(&l->asked, next);
  return true;
}

void sonde_live_walk(sonde_solid_live *l, sonde_pose pose) {
  enum { PASSES_MOST = 60, SETTLING = 4 };
  SONDE_ASSERT(l != NULL && sonde_live_is_done(l));
  l->walks = true;
  l->before = l->asked_before = l->asked_pose = pose;
  for (int n = 0, there = 0; n < PASSES_MOST && there < SETTLING && !(n > 0 && l->rests); ++n) {
    atomic_fetch_add(&l->asked, 1);
    (void)sonde_solid_live_work(l);
    there += sonde_equilibrium_way(l->e->pose, pose) < sonde_live_still_m;
  }
  l->walks = false;
  l->serving = atomic_load(&l->asked) & 1;
  // The tick's contact begins where the skin is: of skin at rest deep inside the probe, what is
  // nearest are the probe's sides.
  for (uint32_t k = 0; k < l->e->zone_count; ++k) {
    const uint32_t node = l->e->zone_node[k];
    l->skin[k] = v_add(l->e->mesh->node[node], l->e->moved[node]);
  }
}

sonde_solid_live_counts sonde_solid_live_count(const sonde_solid_live *l) {
  SONDE_ASSERT(l != NULL);
  sonde_solid_live_counts counts = l->counts;
  counts.ticks = l->ticks, counts.late = l->late;
  return counts;
}

const sonde_vec3 *sonde_solid_live_state(const sonde_solid_live *l) {
  SONDE_ASSERT(l != NULL);
  return l->e->moved;
}
