// The limb as the tissue map of a model: questions in the model's frame, answers of the limb.
#include "limb/map.h"

#include "limb/label.h"
#include "limb/muscles.h"
#include "sonde/limb_model.h"

// A point of the model's frame in that of a right limb.
static sonde_vec3 in_limb(const sonde_limb *limb, sonde_vec3 p) {
  return limb_side_point(limb, sonde_limb_to_model(limb, p));
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
  return OF[sonde_limb_at(limb, sonde_limb_to_model(limb, rest)).tissue];
}

// Where a point lies in the diagram: x and y from the section's centre, m.
typedef struct place {
  limb_row at;
  double x, y;
} place;

static place place_in(const sonde_limb *limb, sonde_vec3 rest) {
  sonde_vec3 p = in_limb(limb, rest);
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
  const sonde_limb *limb = self;
  const struct limb_muscles *m = limb->muscles;
  SONDE_ASSERT(m && room > 0 && seed);
  const place r = place_in(limb, rest);
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
  const sonde_limb *limb = self;
  const struct limb_muscles *m = limb->muscles;
  SONDE_ASSERT(seed < m->seed_count);
  const place r = place_in(limb, rest);
  limb_cell cell = {.cell = m->cell_of[seed], .seed = seed, .row = r.at.row};
  sonde_map_seed facts = {.cell = cell.cell,
                          .section = (uint32_t)limb_cell_compartment(cell.cell),
                          .muscle = cell.cell < SONDE_LIMB_MUSCLES,
                          .fibre = vec3(0, 0, 1),
                          .grain = vec3(0, 0, 1),
                          .out = vec3(1, 0, 0)};
  if (!facts.muscle) return facts;
  // The first seed of the cell in the row in which the muscle is thickest.
  limb_cell thick = {.cell = cell.cell, .seed = seed};
  while (thick.seed > 0 && m->cell_of[thick.seed - 1] == cell.cell) --thick.seed;
  for (uint32_t row = 0; row + 1 < LIMB_CELL_ROWS; ++row)
    if (m->area[row][cell.cell] > m->area[thick.row][cell.cell]) thick.row = row;
  const limb_seed *at = &m->seed[thick.row][thick.seed];
  const double level = LIMB_TOP + thick.row * LIMB_CELL_STEP;
  const sonde_vec3 c = limb_centre(limb, level),
                   beside = v_scale(vec3((double)at->x, (double)at->y, 0), m->radius[thick.row]);
  sonde_vec3 grain = limb_fibre(limb, &thick, v_add(vec3(c.x, c.y, limb_z(limb, level)), beside));
  facts.grain = limb_side_point(limb, vec3(grain.x, grain.y, -grain.z));
  facts.out = limb_side_point(limb, v_unit(beside, vec3(1, 0, 0)));
  sonde_vec3 fibre = limb_fibre(limb, &cell, in_limb(limb, rest));
  facts.fibre = limb_side_point(limb, vec3(fibre.x, fibre.y, -fibre.z));
  facts.pennation_rad = limb_muscle_table[cell.cell].pennation_deg * SONDE_PI / 180;
  return facts;
}

static void powers(const void *self, sonde_vec3 rest, uint32_t count, const uint32_t *seed,
                   double *power, sonde_vec3 *at) {
  const sonde_limb *limb = self;
  const place r = place_in(limb, rest);
  for (uint32_t k = 0; k < count; ++k) {
    double x, y;
    power[k] = power_at(limb->muscles, &r, seed[k], &x, &y);
    if (at) at[k] = v_add(rest, limb_side_point(limb, vec3(x - r.x, y - r.y, 0)));
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
