// The limb as the tissue map of a model: questions in the model's frame, answers of the limb.
#include "limb/map.h"

#include "limb/label.h"
#include "limb/muscles.h"
#include "limb/pose.h"
#include "limb/vessels.h"
#include "sonde/limb_model.h"

#include <stdatomic.h>

// A point of the model's frame in that of a right limb: straight when the model is, else posed.
static sonde_vec3 as_held(const sonde_limb *limb, sonde_vec3 p) {
  return limb_side_point(limb, sonde_limb_to_model(limb, p));
}

// A point of the model's frame in that of a straight right limb. The maps of one picture ask for
// the same point one after the other: each thread remembers its last one.
static sonde_vec3 in_limb(const limb_held *held, sonde_vec3 p) {
  static _Thread_local struct {
    uint64_t number; // 0: none yet
    sonde_vec3 posed, rest;
  } last;
  const sonde_vec3 posed = as_held(held->limb, p);
  if (!held->pose) return posed;
  if (last.number != held->number || v_norm2(v_sub(last.posed, posed)) > 0) {
    (void)limb_pose_inverse(held->pose, posed, &last.rest);
    last.number = held->number, last.posed = posed;
  }
  return last.rest;
}

// A direction at a point of the straight right limb, in the model's frame; not of unit length.
static sonde_vec3 in_model(const limb_held *held, sonde_vec3 at, sonde_vec3 direction) {
  if (held->pose) {
    sonde_mat3 gradient = limb_pose_gradient(held->pose, at);
    direction = m_mul_v(gradient, direction);
  }
  return limb_side_point(held->limb, vec3(direction.x, direction.y, -direction.z));
}

static void depths(const void *self, sonde_vec3 rest, sonde_tissue_depths *d) {
  const limb_held *held = self;
  const sonde_vec3 p = in_limb(held, rest);
  limb_layers layers = limb_layers_at(held->limb, p);
  const double xyz[3] = {p.x, p.y, p.z};
  double bone = limb_bone_distance(held->limb, xyz, NULL);
  if (held->pose) { // bones keep their form
    const sonde_vec3 q = as_held(held->limb, rest);
    bone = INFINITY;
    for (uint32_t k = 0; k < SONDE_LIMB_BONES; ++k)
      bone = fmin(bone,
                  limb_one_bone(held->limb->bones, k, pose_apply_inverse(held->pose->bone[k], q)));
  }
  *d = (sonde_tissue_depths){layers.skin, layers.superficial, layers.fascia, bone};
}

static sonde_tissue tissue(const void *self, sonde_vec3 rest) {
  const limb_held *held = self;
  static const sonde_tissue OF[SONDE_LIMB_TISSUES] = {
      [SONDE_LIMB_SKIN] = SONDE_TISSUE_SKIN,
      [SONDE_LIMB_FAT] = SONDE_TISSUE_FAT,
      [SONDE_LIMB_FASCIA] = SONDE_TISSUE_FASCIA,
      [SONDE_LIMB_SUPERFICIAL_FASCIA] = SONDE_TISSUE_FASCIA,
      [SONDE_LIMB_SEPTUM] = SONDE_TISSUE_FASCIA,
      [SONDE_LIMB_MUSCLE] = SONDE_TISSUE_MUSCLE,
      [SONDE_LIMB_TENDON] = SONDE_TISSUE_TENDON,
      [SONDE_LIMB_SHEATH] = SONDE_TISSUE_FAT,
      [SONDE_LIMB_NODE] = SONDE_TISSUE_NODE,
      [SONDE_LIMB_NERVE] = SONDE_TISSUE_NERVE,
      [SONDE_LIMB_WALL] = SONDE_TISSUE_FAT,
      [SONDE_LIMB_LUMEN] = SONDE_TISSUE_FAT,
      [SONDE_LIMB_BONE] = SONDE_TISSUE_BONE};
  return OF[sonde_limb_at(held->limb, limb_side_point(held->limb, in_limb(held, rest))).tissue];
}

// Where a point lies in the diagram: x and y from the section's centre, m.
typedef struct place {
  limb_row at;
  double x, y;
} place;

static place place_in(const sonde_limb *limb, sonde_vec3 p) {
  double level = clamp(limb_level(limb, p.z), LIMB_TOP, 2);
  sonde_vec3 c = limb_centre(limb, level);
  return (place){limb_row_at(limb->muscles, level), p.x - c.x, p.y - c.y};
}

// A seed there, m from the section's centre, and |p - seed|^2 - weight, m^2.
static double power_at(const struct limb_muscles *m, const place *p, uint32_t seed, double *x,
                       double *y) {
  const double radius = p->at.radius;
  float sx, sy, px = (float)(p->x / radius), py = (float)(p->y / radius);
  double power = (double)limb_seed_power(m, &p->at, seed, px, py, &sx, &sy);
  *x = radius * (double)sx, *y = radius * (double)sy;
  return radius * radius * power;
}

static uint32_t seeds(const void *self, sonde_vec3 rest, double within_m, uint32_t room,
                      uint32_t *seed) {
  const limb_held *held = self;
  const struct limb_muscles *m = held->limb->muscles;
  SONDE_ASSERT(m && room > 0 && seed);
  const place r = place_in(held->limb, in_limb(held, rest));
  double power[LIMB_SEEDS], x[LIMB_SEEDS], y[LIMB_SEEDS];
  const uint32_t active = m->active_count[r.at.row];
  uint32_t best = 0, count = 0;
  for (uint32_t i = 0; i < active; ++i) {
    power[i] = power_at(m, &r, m->active[r.at.row][i], &x[i], &y[i]);
    if (power[i] < power[best]) best = i;
  }
  // A cell is as far as its boundary with the cell of the point; insertion by that distance.
  double far[SONDE_MAP_SEEDS];
  room = room < SONDE_MAP_SEEDS ? room : SONDE_MAP_SEEDS;
  for (uint32_t i = 0; i < active; ++i) {
    double apart = hypot(x[i] - x[best], y[i] - y[best]) + 1e-6;
    double away = i == best ? 0 : 0.5 * (power[i] - power[best]) / apart;
    if (away > within_m || (count == room && away >= far[count - 1])) continue;
    uint32_t k = count < room ? count++ : count - 1;
    for (; k > 0 && far[k - 1] > away; --k) far[k] = far[k - 1], seed[k] = seed[k - 1];
    far[k] = away, seed[k] = m->active[r.at.row][i];
  }
  return count;
}

static sonde_map_seed seed_facts(const void *self, uint32_t seed, sonde_vec3 rest) {
  const limb_held *held = self;
  const struct limb_muscles *m = held->limb->muscles;
  SONDE_ASSERT(seed < m->seed_count);
  const sonde_vec3 p = in_limb(held, rest);
  const place r = place_in(held->limb, p);
  limb_cell cell = {.cell = m->cell_of[seed], .seed = seed, .row = r.at.row};
  sonde_map_seed facts = {.cell = cell.cell,
                          .section = (uint32_t)limb_cell_compartment(cell.cell),
                          .muscle = cell.cell < SONDE_LIMB_MUSCLES,
                          .fibre = vec3(0, 0, 1)};
  if (!facts.muscle) return facts;
  const sonde_vec3 fibre = limb_fibre(held->limb, &cell, p);
  facts.fibre = in_model(held, p, fibre);
  if (held->pose) facts.fibre = v_unit(facts.fibre, vec3(0, 0, 1));
  // Limbs run down where the model's z goes up: outward-going fibres go outward along z.
  static const double TOWARDS[] = {
      [LIMB_STRAP] = 0, [LIMB_OUTWARD] = 1, [LIMB_INWARD] = -1, [LIMB_CENTRAL] = 0.5};
  const limb_muscle *muscle = &limb_muscle_table[cell.cell];
  facts.pennation_rad = muscle->pennation_deg * SONDE_PI / 180;
  facts.lean = TOWARDS[muscle->pennate] * tan(facts.pennation_rad);
  return facts;
}

static void powers(const void *self, sonde_vec3 rest, uint32_t count, const uint32_t *seed,
                   double *power, sonde_vec3 *at) {
  const limb_held *held = self;
  const sonde_vec3 p = in_limb(held, rest);
  const place r = place_in(held->limb, p);
  for (uint32_t k = 0; k < count; ++k) {
    double x, y;
    power[k] = power_at(held->limb->muscles, &r, seed[k], &x, &y);
    if (at) at[k] = v_add(rest, in_model(held, p, vec3(x - r.x, y - r.y, 0)));
  }
}

static const double FAR_AWAY = 50; // in semi-axes

// A nerve, node or tendon, in this order, in the right limb's frame where it comes nearest to p.
static limb_body nearest(const sonde_limb *limb, uint32_t which, sonde_vec3 p) {
  const uint32_t nerves = limb->vessels ? limb_nerve_bodies(limb->vessels) : 0;
  if (which < nerves) return limb_nerve_body(limb->vessels, which, p);
  limb_body body = {.ends = true};
  const double level = clamp(limb_level(limb, p.z), LIMB_TOP, 2), step = 0.01;
  sonde_vec3 next;
  double wide, thick;
  if (!limb_tendon_body(limb, which - nerves, level, &body.centre, &body.wide, &body.thick))
    return body;
  if (limb_tendon_body(limb, which - nerves, level + step, &next, &wide, &thick))
    body.axis = v_unit(v_sub(next, body.centre), vec3(0, 0, -1));
  else if (limb_tendon_body(limb, which - nerves, level - step, &next, &wide, &thick))
    body.axis = v_unit(v_sub(body.centre, next), vec3(0, 0, -1));
  body.ends = false;
  return body;
}

static uint32_t bodies(const void *self, sonde_vec3 rest, double within_m, uint32_t room,
                       uint32_t *found) {
  const limb_held *held = self;
  const sonde_limb *limb = held->limb;
  const sonde_vec3 p = in_limb(held, rest);
  const uint32_t nerves = limb->vessels ? limb_nerve_bodies(limb->vessels) : 0;
  uint32_t count = 0;
  SONDE_ASSERT(room > 0 && found != NULL);
  // Cords run along the limb: where the point's height crosses them, or a bit above and below.
  for (uint32_t k = 0; k < nerves + limb_tendon_count() && count < room; ++k)
    for (int shift = -1; shift <= 1; ++shift) {
      const limb_body body = nearest(limb, k, vec3(p.x, p.y, p.z + 0.5 * shift * within_m));
      const double away = v_distance(body.centre, p) - fmax(body.wide, body.length);
      if (body.ends || away > within_m) continue;
      found[count++] = k;
      break;
    }
  // Cusps are numbered behind nerves and tendons.
  for (uint32_t k = 0; k < held->cusp_count && count < room; ++k)
    if (v_distance(held->cusps[k].root, p) < within_m + held->cusps[k].length_m)
      found[count++] = nerves + limb_tendon_count() + k;
  return count;
}

static sonde_map_body body(const void *self, uint32_t which, sonde_vec3 rest) {
  const limb_held *held = self;
  const sonde_limb *limb = held->limb;
  const sonde_vec3 p = in_limb(held, rest);
  const uint32_t nerves = limb->vessels ? limb_nerve_bodies(limb->vessels) : 0;
  const uint32_t cords = nerves + limb_tendon_count();
  if (which >= cords) {
    const limb_cusps *c = &held->cusps[which - cords];
    return (sonde_map_body){.tissue = SONDE_TISSUE_CUSPS,
                            .axis = v_unit(in_model(held, c->root, c->up), vec3(0, 0, -1)),
                            .half_m = {c->radius_m, c->radius_m, c->length_m}};
  }
  const limb_body b = nearest(limb, which, p);
  sonde_vec3 axis = in_model(held, p, b.axis);
  if (held->pose) axis = v_unit(axis, vec3(0, 0, 1));
  return (sonde_map_body){.tissue = b.node           ? SONDE_TISSUE_NODE
                                    : which < nerves ? SONDE_TISSUE_NERVE
                                                     : SONDE_TISSUE_TENDON,
                          .axis = axis,
                          .half_m = {b.wide, b.thick, b.length}};
}

static sonde_vec3 body_place(const void *self, uint32_t which, sonde_vec3 rest) {
  const limb_held *held = self;
  const sonde_limb *limb = held->limb;
  const sonde_vec3 p = in_limb(held, rest), outside = vec3(FAR_AWAY, FAR_AWAY, 0);
  const uint32_t nerves = limb->vessels ? limb_nerve_bodies(limb->vessels) : 0;
  const uint32_t cords = nerves + limb_tendon_count();
  if (which >= cords) {
    const limb_cusps *c = &held->cusps[which - cords];
    const sonde_vec3 d = v_sub(p, c->root);
    return vec3(v_dot(d, c->out) / c->radius_m, v_dot(d, v_cross(c->up, c->out)) / c->radius_m,
                v_dot(d, c->up) / c->length_m);
  }
  if (which >= nerves) {
    const double level = clamp(limb_level(limb, p.z), LIMB_TOP, 2);
    const sonde_vec3 c = limb_centre(limb, level);
    double at[2];
    if (!limb_tendon_place(limb, which - nerves, level, p.x - c.x, p.y - c.y, at)) return outside;
    return vec3(at[0], at[1], p.z);
  }
  const limb_body b = limb_nerve_body(limb->vessels, which, p);
  if (b.ends) return outside;
  const sonde_vec3 d = v_sub(p, b.centre);
  const double along = v_dot(d, b.axis);
  return vec3(v_dot(d, b.side) / b.wide, v_dot(d, v_cross(b.axis, b.side)) / b.thick,
              b.length > 0 ? along / b.length : p.z);
}

void limb_held_clear(limb_held *held) {
  sonde_limb_pose_destroy(held->pose);
  sonde_limb_destroy(held->limb);
  sonde_free(held->cusps);
  *held = (limb_held){0};
}

static void destroy(sonde_tissue_map *map) {
  limb_held_clear(map->self);
  sonde_free(map->self);
  sonde_free(map);
}

const limb_held *limb_map_held(const sonde_tissue_map *map) {
  return map && map->destroy == destroy ? map->self : NULL;
}

sonde_status limb_map_create(const limb_held *held, sonde_tissue_map **map, sonde_error *error) {
  SONDE_ASSERT(held->limb && map);
  const sonde_limb *limb = held->limb;
  const uint32_t vessels = limb->vessels ? sonde_limb_vessel_count(limb) : 0;
  uint32_t valves = 0;
  for (uint32_t v = 0; v < vessels; ++v) valves += sonde_limb_vessel_get(limb, v).valves;
  limb_held *self = SONDE_NEW(limb_held, 1);
  limb_cusps *cusps = SONDE_NEW(limb_cusps, valves + 1);
  *map = SONDE_NEW(sonde_tissue_map, 1);
  if (!*map || !self || !cusps) {
    sonde_free(*map);
    sonde_free(self);
    sonde_free(cusps);
    *map = NULL;
    return sonde_fail_memory(error);
  }
  static atomic_uint_least64_t made;
  *self = *held;
  self->cusps = cusps;
  // Cusps face each other across the vein on the line from the limb's middle, so that their edges
  // run along the skin.
  for (uint32_t v = 0; v < vessels; ++v) {
    const uint32_t count = sonde_limb_vessel_get(limb, v).valves;
    for (uint32_t k = 0; k < count; ++k) {
      const sonde_limb_valve valve = sonde_limb_vessel_valve(limb, v, k);
      const sonde_limb_vessel_point at = sonde_limb_vessel_place(limb, v, valve.arc_m);
      const sonde_vec3 root = limb_side_point(limb, at.centre_m);
      const sonde_vec3 up = limb_side_point(limb, v_scale(at.direction, -1));
      const sonde_vec3 c = limb_centre(limb, clamp(limb_level(limb, root.z), LIMB_TOP, 2));
      const sonde_vec3 away = vec3(root.x - c.x, root.y - c.y, 0);
      const sonde_vec3 out = v_unit(v_madd(away, -v_dot(away, up), up), vec3(0, 1, 0));
      cusps[self->cusp_count++] = (limb_cusps){root, up, out, at.radius_m, valve.cusp_m};
    }
  }
  self->number = atomic_fetch_add(&made, 1) + 1;
  **map = (sonde_tissue_map){.self = self,
                             .depths = depths,
                             .tissue = tissue,
                             .seeds = seeds,
                             .seed = seed_facts,
                             .powers = powers,
                             .bodies = bodies,
                             .body = body,
                             .body_place = body_place,
                             .destroy = destroy};
  return SONDE_OK;
}
