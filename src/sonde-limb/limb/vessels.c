// The graph of a limb's vessels: lines, branches, the order of its making, what its public header
// asks.
#include "limb/vessels_graph.h"

#include <string.h>

static const double VENOUS_PA = 10 * SONDE_PA_PER_MMHG, ARTERIAL_PA = 93 * SONDE_PA_PER_MMHG;

sonde_vec3 limb_at(const sonde_limb *limb, double level, double degrees, double f) {
  double p[3];
  limb_point(limb, level, degrees * DEGREE, f, p);
  return vec3(p[0], p[1], p[2]);
}

sonde_vec3 limb_below_fascia(const sonde_limb *limb, double level, double degrees, double depth) {
  double radius = limb_fascia_radius(limb, level, degrees * DEGREE);
  return limb_at(limb, level, degrees, (radius - depth) / radius);
}

void limb_place_of(const sonde_limb *limb, sonde_vec3 p, double *level, double *degrees,
                   double *f) {
  const double at[3] = {p.x, p.y, p.z};
  limb_polar(limb, at, level, degrees, f);
  *degrees /= DEGREE;
}

uint32_t limb_branch_find(const struct limb_vessels *v, const char *name) {
  for (uint32_t b = 0; b < v->branches; ++b)
    if (strcmp(v->branch[b].name, name) == 0) return b;
  return VESSEL_NONE;
}

double limb_branch_length(const struct limb_vessels *v, uint32_t b) {
  SONDE_ASSERT(b < v->branches && v->branch[b].count >= 2);
  return limb_branch_places(v, b)[v->branch[b].count - 1].arc;
}

uint32_t limb_branch_at_level(const struct limb_vessels *v, uint32_t b, double level) {
  SONDE_ASSERT(b < v->branches);
  double z = limb_z(v->limb, level), least = INFINITY;
  uint32_t nearest = 0;
  for (uint32_t k = 0; k < v->branch[b].count; ++k) {
    double off = fabs(limb_branch_point(v, b, k).z - z);
    if (off < least) least = off, nearest = k;
  }
  return nearest;
}

// ---- lines and branches -------------------------------------------------------------------------

void limb_line_through(const sonde_vec3 *knots, uint32_t count, vessel_line *line) {
  SONDE_ASSERT(count >= 2);
  line->count = 0;
  line->point[line->count++] = knots[0];
  sonde_vec3 last = knots[0];
  for (uint32_t k = 0; k + 1 < count; ++k) {
    // Hermite cubic over the chord; tangents of the parabola through three knots.
    sonde_vec3 a = knots[k], b = knots[k + 1];
    double h = fmax(v_distance(a, b), 1e-9);
    sonde_vec3 rise = v_scale(v_sub(b, a), 1 / h), before = rise, after = rise;
    if (k > 0) {
      double h0 = fmax(v_distance(knots[k - 1], a), 1e-9);
      sonde_vec3 r0 = v_scale(v_sub(a, knots[k - 1]), 1 / h0);
      before = v_scale(v_add(v_scale(r0, h), v_scale(rise, h0)), 1 / (h + h0));
    }
    if (k + 2 < count) {
      double h1 = fmax(v_distance(b, knots[k + 2]), 1e-9);
      sonde_vec3 r1 = v_scale(v_sub(knots[k + 2], b), 1 / h1);
      after = v_scale(v_add(v_scale(rise, h1), v_scale(r1, h)), 1 / (h + h1));
    }
    uint32_t fine = (uint32_t)ceil(8 * h / VESSEL_STEP) + 1;
    for (uint32_t i = 1; i <= fine; ++i) {
      double u = (double)i / fine, w = 1 - u;
      sonde_vec3 p = v_add(v_scale(a, w * w * (1 + 2 * u)), v_scale(b, u * u * (3 - 2 * u)));
      p = v_madd(p, h * u * w * w, before);
      p = v_madd(p, -h * u * u * w, after);
      if (v_distance(p, last) < VESSEL_STEP) continue;
      SONDE_ASSERT(line->count + 1 < VESSEL_LINE);
      line->point[line->count++] = last = p;
    }
  }
  // The end takes the place of a point that is nearer than half a step.
  if (line->count > 1 && v_distance(last, knots[count - 1]) < 0.5 * VESSEL_STEP) --line->count;
  line->point[line->count++] = knots[count - 1];
  SONDE_ASSERT(line->count >= 2);
}

static uint32_t nearest_place(const struct limb_vessels *v, uint32_t b, sonde_vec3 p) {
  uint32_t nearest = 0;
  double least = INFINITY;
  for (uint32_t k = 0; k < v->branch[b].count; ++k) {
    double d2 = v_norm2(v_sub(limb_branch_point(v, b, k), p));
    if (d2 < least) least = d2, nearest = k;
  }
  return nearest;
}

static void share_node(struct limb_vessels *v, uint32_t node) {
  uint32_t with[16], count = 0;
  for (uint32_t b = 0; b < v->branches; ++b)
    for (uint32_t k = 0; k < v->branch[b].count && count < 16; ++k)
      if (limb_branch_places(v, b)[k].node == node) {
        with[count++] = b;
        break;
      }
  for (uint32_t i = 0; i < count; ++i)
    for (uint32_t j = 0; j < count; ++j) {
      uint16_t *pair = v->shared[with[i]][with[j]];
      if (i == j || pair[0] == node + 1 || pair[1] == node + 1) continue;
      pair[pair[0] ? 1 : 0] = (uint16_t)(node + 1);
    }
}

uint32_t limb_branch_add(struct limb_vessels *v, const vessel_spec *spec, const vessel_line *line,
                         uint32_t from, uint32_t to) {
  SONDE_ASSERT(to < line->count && from < to && v->branches < VESSEL_BRANCHES);
  SONDE_ASSERT(v->places + to - from + 1 <= VESSEL_POINTS);
  uint32_t number = v->branches++;
  vessel_branch *b = &v->branch[number];
  *b = (vessel_branch){.kind = spec->kind,
                       .first = v->places,
                       .count = to - from + 1,
                       .parent = spec->parent,
                       .joins = spec->joins,
                       .mate = spec->mate,
                       .layer = spec->layer};
  snprintf(b->name, sizeof b->name, "%s", spec->name);
  for (uint32_t k = 0; k < b->count; ++k) {
    vessel_place *place = &v->place[v->places++];
    double t = (double)k / (b->count - 1);
    *place = (vessel_place){0, spec->from + t * (spec->to - spec->from), spec->wall, 0};
    if (k == 0 && b->parent != VESSEL_NONE) {
      b->parent_at = nearest_place(v, b->parent, line->point[from]);
      place->node = limb_branch_places(v, b->parent)[b->parent_at].node;
    } else if (k + 1 == b->count && b->joins != VESSEL_NONE) {
      b->joins_at = nearest_place(v, b->joins, line->point[to]);
      place->node = limb_branch_places(v, b->joins)[b->joins_at].node;
    } else {
      SONDE_ASSERT(v->nodes < VESSEL_NODES);
      v->node[v->nodes] = line->point[from + k];
      place->node = v->nodes++;
    }
  }
  if (b->parent != VESSEL_NONE) share_node(v, v->place[b->first].node);
  if (b->joins != VESSEL_NONE) share_node(v, v->place[b->first + b->count - 1].node);
  double length = to > from ? VESSEL_STEP * (to - from) : 0;
  for (double at = 0.35 * spec->valves;
       spec->valves > 0 && at < length && b->valves < VESSEL_VALVES; at += spec->valves)
    b->valve[b->valves++] = at;
  return number;
}

sonde_status limb_vessels_make(sonde_limb *limb, sonde_error *error) {
  SONDE_ASSERT(limb && !limb->vessels);
  struct limb_vessels *v = SONDE_NEW(struct limb_vessels, 1);
  if (!v) return sonde_fail_memory(error);
  limb->vessels = v;
  v->limb = limb;
  v->draws = limb_vessel_draws(limb);
  limb_vessels_lay_arteries(v);
  sonde_status status = limb_vessels_relax(v, 60, true, false, error);
  if (status) return status;
  limb_vessels_lay_veins(v);
  limb_vessels_lay_deep_femoral(v);
  uint32_t great = limb_vessels_lay_great(v);
  limb_vessels_lay_tributaries(v, great);
  limb_vessels_lay_small(v, great);
  limb_vessels_lay_muscle_veins(v);
  // Where the fat is thin, a superficial vein is no wider than its layer.
  for (uint32_t b = 0; b < v->branches; ++b)
    for (uint32_t k = 8; k < v->branch[b].count && v->branch[b].layer != LAYER_DEEP; ++k) {
      vessel_place *place = &v->place[v->branch[b].first + k];
      double level, degrees, f;
      limb_place_of(limb, limb_branch_point(v, b, k), &level, &degrees, &f);
      double room = 0.5 * limb_fat(limb, level, degrees * DEGREE) - place->wall - 0.0006;
      if (v->branch[b].layer != LAYER_ANY) place->radius = fmin(place->radius, fmax(room, 0.0003));
    }
  status = limb_vessels_relax(v, 60, true, false, error);
  if (status) return status;
  limb_vessels_lay_perforators(v);
  status = limb_vessels_relax(v, 100, true, false, error);
  // What is crowded takes longer: on until every place keeps its distances, later also where a
  // companion vein has to leave its artery for it, at last where a vein has to bend as sharply as
  // the fascia below it.
  for (uint32_t more = 0; more < 25 && !status; ++more) {
    status = limb_vessels_count_faults(v, error);
    const sonde_limb_vessel_faults *f = &v->faults;
    if (status || f->walls + f->bone + f->fascia + f->eye == 0) break;
    status = limb_vessels_relax(v, 40, more < 6, more >= 15, error);
  }
  // Arcs along the lines as they lie now.
  for (uint32_t b = 0; b < v->branches; ++b) {
    vessel_place *place = &v->place[v->branch[b].first];
    place[0].arc = 0;
    for (uint32_t k = 1; k < v->branch[b].count; ++k)
      place[k].arc =
          place[k - 1].arc + v_distance(v->node[place[k - 1].node], v->node[place[k].node]);
    double length = place[v->branch[b].count - 1].arc;
    while (v->branch[b].valves > 0 && v->branch[b].valve[v->branch[b].valves - 1] >= length)
      --v->branch[b].valves;
  }
  if (!status) status = limb_vessels_count_faults(v, error);
  if (!status) status = limb_vessels_index(v, false, error);
  if (status) return status;
  limb_nerves_lay(v);
  limb_lymph_lay(v);
  return limb_vessels_index(v, true, error);
}

void limb_vessels_destroy(struct limb_vessels *v) {
  if (!v) return;
  sonde_free(v->piece);
  sonde_free(v->cell);
  sonde_free(v->listed);
  sonde_free(v);
}

const char *limb_vessels_name(const struct limb_vessels *v, limb_part part, uint32_t index) {
  if (!v) return "";
  if (part == LIMB_PART_LUMEN || part == LIMB_PART_WALL || part == LIMB_PART_SHEATH)
    return index < v->branches ? v->branch[index].name : "";
  if (part == LIMB_PART_NERVE) return index < LIMB_NERVES ? v->nerve[index].name : "";
  return part == LIMB_PART_NODE ? "lymph node" : "";
}

// ---- what the public header asks ----------------------------------------------------------------

// A point or a direction between the limb's own frame and that of a right limb.
const sonde_limb_variants *sonde_limb_vessel_variants(const sonde_limb *limb) {
  SONDE_ASSERT(limb && limb->vessels);
  return &limb->vessels->draws.variants;
}

sonde_limb_vessel_faults sonde_limb_vessel_check(const sonde_limb *limb) {
  SONDE_ASSERT(limb && limb->vessels);
  return limb->vessels->faults;
}

uint32_t sonde_limb_vessel_count(const sonde_limb *limb) {
  SONDE_ASSERT(limb && limb->vessels);
  return limb->vessels->branches;
}

uint32_t sonde_limb_vessel_find(const sonde_limb *limb, const char *name) {
  SONDE_ASSERT(limb && name);
  return limb_branch_find(limb->vessels, name);
}

sonde_limb_vessel sonde_limb_vessel_get(const sonde_limb *limb, uint32_t vessel) {
  const struct limb_vessels *v = limb->vessels;
  SONDE_ASSERT(vessel < v->branches);
  const vessel_branch *b = &v->branch[vessel];
  sonde_limb_vessel out = {.kind = b->kind,
                           .parent = b->parent,
                           .joins = b->joins,
                           .mate = b->mate,
                           .length_m = limb_branch_length(v, vessel),
                           .points = b->count,
                           .valves = b->valves,
                           .pressure_pa = b->kind == SONDE_LIMB_ARTERY ? ARTERIAL_PA : VENOUS_PA};
  snprintf(out.name, sizeof out.name, "%s", b->name);
  if (b->parent != VESSEL_NONE)
    out.parent_arc_m = limb_branch_places(v, b->parent)[b->parent_at].arc;
  if (b->joins != VESSEL_NONE) out.joins_arc_m = limb_branch_places(v, b->joins)[b->joins_at].arc;
  return out;
}

sonde_limb_vessel_point sonde_limb_vessel_place(const sonde_limb *limb, uint32_t vessel,
                                                double arc_m) {
  const struct limb_vessels *v = limb->vessels;
  SONDE_ASSERT(vessel < v->branches && !isnan(arc_m));
  const vessel_place *place = limb_branch_places(v, vessel);
  uint32_t k = 0;
  while (k + 2 < v->branch[vessel].count && place[k + 1].arc < arc_m) ++k;
  const vessel_place *a = &place[k], *b = a + 1;
  double t = clamp((arc_m - a->arc) / fmax(b->arc - a->arc, 1e-12), 0, 1);
  double radius = a->radius + t * (b->radius - a->radius);
  sonde_vec3 from = v->node[a->node], to = v->node[b->node];
  return (sonde_limb_vessel_point){limb_side_point(limb, v_lerp(from, to, t)),
                                   limb_side_point(limb, v_unit(v_sub(to, from), vec3(0, 0, -1))),
                                   radius, a->wall + t * (b->wall - a->wall),
                                   SONDE_PI * radius * radius};
}

sonde_limb_valve sonde_limb_vessel_valve(const sonde_limb *limb, uint32_t vessel, uint32_t k) {
  const vessel_branch *b = &limb->vessels->branch[vessel];
  SONDE_ASSERT(k < b->valves);
  double radius = sonde_limb_vessel_place(limb, vessel, b->valve[k]).radius_m;
  return (sonde_limb_valve){b->valve[k], 2.4 * radius, 1.2 * radius};
}

sonde_limb_vessel_near sonde_limb_vessel_at(const sonde_limb *limb, sonde_vec3 point_m) {
  SONDE_ASSERT(limb && limb->vessels && v_finite(point_m));
  sonde_limb_vessel_near near = {0};
  near.lumen_m = limb_vessels_lumen(limb->vessels, limb_side_point(limb, point_m), &near.vessel,
                                    &near.arc_m, &near.wall_m);
  return near;
}
