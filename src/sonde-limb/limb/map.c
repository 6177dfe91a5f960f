// The limb as the tissue map of a model: questions in the model's frame, answers of the limb.
#include "limb/map.h"

#include "limb/muscles.h"
#include "limb/label.h"

// A point of the model's frame in that of a right limb.
static sonde_vec3 in_limb(const sonde_limb *limb, sonde_vec3 p) {
  return vec3(limb->body.side == SONDE_LIMB_LEFT ? -p.x : p.x, p.y, limb_z(limb, LIMB_TOP) - p.z);
}

static void depths(const void *self, sonde_vec3 rest, sonde_tissue_depths *d) {
  const sonde_limb *limb = self;
  sonde_vec3 p = in_limb(limb, rest);
  limb_layers layers = limb_layers_at(limb, p);
  const double xyz[3] = {p.x, p.y, p.z};
  *d = (sonde_tissue_depths){layers.skin, layers.superficial, layers.fascia,
                             limb_bone_distance(limb, xyz, NULL)};
}

static sonde_tissue tissue(const void *self, sonde_vec3 rest) {
  const sonde_limb *limb = self;
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
  sonde_vec3 p = vec3(rest.x, rest.y, limb_z(limb, LIMB_TOP) - rest.z);
  return OF[sonde_limb_at(limb, p).tissue];
}

// Where a point lies among the rows of the diagram: x and y from the section's centre.
typedef struct row_place {
  uint32_t row;
  double u, radius, x, y;
} row_place;

static row_place place_in(const sonde_limb *limb, sonde_vec3 rest) {
  const struct limb_muscles *m = limb->muscles;
  sonde_vec3 p = in_limb(limb, rest);
  double level = clamp(limb_level(limb, p.z), LIMB_TOP, 2);
  double at = clamp((level - LIMB_TOP) / LIMB_CELL_STEP, 0, LIMB_CELL_ROWS - 1.000001);
  sonde_vec3 c = limb_centre(limb, level);
  row_place r = {.row = (uint32_t)at, .x = p.x - c.x, .y = p.y - c.y};
  r.u = at - r.row;
  r.radius = (1 - r.u) * m->radius[r.row] + r.u * m->radius[r.row + 1];
  return r;
}

// A seed there, m from the section's centre, and |p - seed|^2 - weight.
static double power_at(const struct limb_muscles *m, const row_place *r, uint32_t seed, double *x,
                       double *y) {
  const limb_seed *a = &m->seed[r->row][seed], *b = &m->seed[r->row + 1][seed];
  double v = 1 - r->u, s = r->radius;
  *x = s * (v * (double)a->x + r->u * (double)b->x);
  *y = s * (v * (double)a->y + r->u * (double)b->y);
  double weight = v * (double)a->weight + r->u * (double)b->weight;
  double dx = r->x - *x, dy = r->y - *y;
  return dx * dx + dy * dy - s * s * weight;
}

static uint32_t seeds(const void *self, sonde_vec3 rest, double within_m, uint32_t room,
                      uint32_t *seed) {
  const sonde_limb *limb = self;
  const struct limb_muscles *m = limb->muscles;
  SONDE_ASSERT(m && room > 0 && seed);
  row_place r = place_in(limb, rest);
  double power[LIMB_SEEDS], x[LIMB_SEEDS], y[LIMB_SEEDS];
  const uint32_t active = m->active_count[r.row];
  uint32_t best = 0, count = 0;
  for (uint32_t i = 0; i < active; ++i) {
    power[i] = power_at(m, &r, m->active[r.row][i], &x[i], &y[i]);
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
    far[k] = away, seed[k] = m->active[r.row][i];
  }
  return count;
}

static sonde_map_seed seed_facts(const void *self, uint32_t seed, sonde_vec3 rest) {
  const sonde_limb *limb = self;
  const struct limb_muscles *m = limb->muscles;
  SONDE_ASSERT(seed < m->seed_count);
  row_place r = place_in(limb, rest);
  limb_cell cell = {.cell = m->cell_of[seed], .seed = seed, .row = r.row};
  sonde_map_seed facts = {.cell = cell.cell,
                          .section = (uint32_t)limb_cell_compartment(cell.cell),
                          .muscle = cell.cell < SONDE_LIMB_MUSCLES,
                          .fibre = vec3(0, 0, 1)};
  if (!facts.muscle) return facts;
  sonde_vec3 fibre = limb_fibre(limb, &cell, in_limb(limb, rest));
  facts.fibre = vec3(limb->body.side == SONDE_LIMB_LEFT ? -fibre.x : fibre.x, fibre.y, -fibre.z);
  facts.pennation_rad = limb_muscle_table[cell.cell].pennation_deg * SONDE_PI / 180;
  return facts;
}

static void powers(const void *self, sonde_vec3 rest, uint32_t count, const uint32_t *seed,
                   double *power, sonde_vec3 *at) {
  const sonde_limb *limb = self;
  row_place r = place_in(limb, rest);
  const double side = limb->body.side == SONDE_LIMB_LEFT ? -1 : 1;
  for (uint32_t k = 0; k < count; ++k) {
    double x, y;
    power[k] = power_at(limb->muscles, &r, seed[k], &x, &y);
    if (at) at[k] = vec3(rest.x + side * (x - r.x), rest.y + y - r.y, rest.z);
  }
}

static void destroy(sonde_tissue_map *map) {
  sonde_limb_destroy(map->self);
  sonde_free(map);
}

bool limb_map_is(const sonde_tissue_map *map) { return map && map->destroy == destroy; }

sonde_status limb_map_create(sonde_limb *limb, sonde_tissue_map **map, sonde_error *error) {
  SONDE_ASSERT(limb && map);
  *map = SONDE_NEW(sonde_tissue_map, 1);
  if (!*map) return sonde_fail_memory(error);
  **map = (sonde_tissue_map){.self = limb,
                             .depths = depths,
                             .tissue = tissue,
                             .seeds = seeds,
                             .seed = seed_facts,
                             .powers = powers,
                             .destroy = destroy};
  return SONDE_OK;
}
