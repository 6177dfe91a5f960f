// Where the deep vessels run before they are moved apart: arteries by level, angle and fraction of
// the fascial radius, veins beside them (docs/limb_vessels.md).
#include "limb/vessels_graph.h"

static const double ARTERY_WALL = 0.001, VEIN_WALL = 0.00045, SMALL_WALL = 0.0004;
static const double WALL_GAP = 0.0008; // between the walls of an artery and its vein
static const double BONE_GAP = 0.0021;

// Value at x of the line through rows of x and value; constant beyond the ends.
static double along(const double (*rows)[2], size_t count, double x) {
  SONDE_ASSERT(count >= 2);
  if (x <= rows[0][0]) return rows[0][1];
  for (size_t k = 0; k + 1 < count; ++k)
    if (x <= rows[k + 1][0])
      return rows[k][1] +
             (rows[k + 1][1] - rows[k][1]) * (x - rows[k][0]) / (rows[k + 1][0] - rows[k][0]);
  return rows[count - 1][1];
}
#define ALONG(rows, x) along(rows, SONDE_COUNT_OF(rows), x)

// Radius at a height: changes from one step's to the next over 14 mm below its height.
typedef struct radius_step {
  double z, radius;
} radius_step;

static double radius_at(const radius_step *step, uint32_t count, double z) {
  double radius = step[0].radius;
  for (uint32_t k = 1; k < count; ++k) {
    double u = clamp((step[k].z - z) / 0.014, 0, 1);
    radius += (step[k].radius - step[k - 1].radius) * u * u * (3 - 2 * u);
  }
  return radius;
}

static void set_radii(struct limb_vessels *v, uint32_t b, const radius_step *step, uint32_t count) {
  for (uint32_t k = 0; k < v->branch[b].count; ++k)
    v->place[v->branch[b].first + k].radius = radius_at(step, count, limb_branch_point(v, b, k).z);
}

static uint32_t first_below(const vessel_line *line, double z) {
  uint32_t k = 1;
  while (k + 2 < line->count && line->point[k].z > z) ++k;
  return k;
}

// The point of the groin's section at x whose depth under the fascia along y is `cover`.
static sonde_vec3 groin_point(const sonde_limb *limb, double x, double z, double cover) {
  double level = limb_level(limb, z), angle = 0;
  sonde_vec3 c = limb_centre(limb, level);
  for (int k = 0; k < 12; ++k)
    angle = asin(clamp((x - c.x) / limb_fascia_radius(limb, level, angle), -0.95, 0.95));
  return vec3(x, c.y + limb_fascia_radius(limb, level, angle) * cos(angle) - cover, z);
}

// The knots of the artery from the pelvis to the end of the tibioperoneal trunk.
static uint32_t main_artery(const struct limb_vessels *v, sonde_vec3 *knot) {
  const sonde_limb *limb = v->limb;
  const vessel_draws *d = &v->draws;
  const double mm = 1e-3 * limb->scale, r = d->radius[DIA_CFA] + ARTERY_WALL;
  // Depth of the centre below the fascia; a wide vein beside the artery needs as much.
  double cover = fmax(d->artery_cover, 0.0025) + r, head = 0;
  // Iliopsoas between artery and femoral head is 16 to 23 mm thick (view V1).
  for (; head < 0.08; head += 0.0005) {
    sonde_vec3 p = groin_point(limb, 15.5 * mm, 5 * mm, head);
    const double at[3] = {p.x, p.y, p.z};
    if (limb_bone_distance(limb, at, NULL) < 0) break;
  }
  cover = clamp(cover, head - r - 0.023, head - r - 0.016);
  cover = fmax(cover, d->radius[DIA_CFV] + 0.0055);
  uint32_t n = 0;
  knot[n++] = groin_point(limb, 6 * mm, 86 * mm, cover + 26 * mm);
  knot[n++] = groin_point(limb, 10 * mm, 48 * mm, cover + 9 * mm);
  knot[n++] = groin_point(limb, 14 * mm, 22 * mm, cover);
  knot[n++] = groin_point(limb, 17 * mm, -8 * mm, cover);
  knot[n++] = groin_point(limb, 19 * mm, d->bifurcation_z, cover + 2 * mm);
  const double femoral[][3] = {
      {0.15, 21, 0.81},    {0.25, 36, 0.71},  {0.35, 48, 0.69},  {0.45, 60, 0.67},
      {0.52, 70, 0.67},    {0.58, 83, 0.034}, {0.62, 93, 0.032}, {0.66, 106, 0.0265},
      {0.72, 135, 0.0145}, {0.80, 165, 0.42}, {0.90, 180, 0.50}, {1.0, 186, 0.52},
      {1.08, 182, 0.42},   {1.13, 172, 0.36}, {1.17, 155, 0.31}, {1.22, 135, 0.28}};
  double shift = d->hiatus - 0.72, turn = 3 * d->wander[0];
  for (size_t k = 0; k < SONDE_COUNT_OF(femoral); ++k) {
    double level = femoral[k][0], near = fmax(0, 1 - fabs(level - 0.68) / 0.2);
    if (level > d->trunk_end - 0.012 && k > 13) continue;
    double degrees = femoral[k][1] + turn * (level < 1 ? 1 : 0.3);
    level += shift * near;
    // In the canal the third number is the distance from the femur, m; elsewhere a fraction.
    double f = femoral[k][2], low = 0, high = 0.9;
    for (int step = 0; femoral[k][2] < 0.1 && step < 20; ++step) {
      f = 0.5 * (low + high);
      sonde_vec3 p = limb_at(limb, level, degrees, f);
      const double at[3] = {p.x, p.y, p.z};
      *(limb_bone_distance(limb, at, NULL) < femoral[k][2] ? &low : &high) = f;
    }
    knot[n++] = limb_at(limb, level, degrees, f);
  }
  knot[n++] = limb_at(limb, fmax(d->trunk_end, 1.145), 134, 0.28);
  return n;
}

// Adds a branch through knots.
static uint32_t add_through(struct limb_vessels *v, vessel_spec spec, const sonde_vec3 *knot,
                            uint32_t count) {
  vessel_line line;
  limb_line_through(knot, count, &line);
  return limb_branch_add(v, &spec, &line, 0, line.count - 1);
}

static vessel_spec artery(const char *name, double from, double to, uint32_t parent) {
  return (vessel_spec){name,        SONDE_LIMB_ARTERY,
                       from,        to,
                       parent,      VESSEL_NONE,
                       VESSEL_NONE, from > 0.0018 ? ARTERY_WALL : 0.0006,
                       LAYER_DEEP,  0};
}

void limb_vessels_lay_arteries(struct limb_vessels *v) {
  const sonde_limb *limb = v->limb;
  const vessel_draws *d = &v->draws;
  const double *r = d->radius;
  sonde_vec3 knot[40];
  vessel_line line;
  limb_line_through(knot, main_artery(v, knot), &line);
  double hiatus = limb_z(limb, d->hiatus), third = limb_z(limb, d->trifurcation);
  const radius_step step[] = {{1, r[DIA_EIA]},
                              {d->ligament_z + 0.007, r[DIA_CFA]},
                              {d->bifurcation_z, r[DIA_SFA]},
                              {hiatus + 0.1, r[DIA_SFA_END]},
                              {hiatus, r[DIA_POPA]},
                              {third, r[DIA_TPA]}};
  const struct {
    const char *name;
    double end;
  } part[] = {{"external iliac artery", d->ligament_z},
              {"common femoral artery", d->bifurcation_z},
              {"superficial femoral artery", hiatus},
              {"popliteal artery", third},
              {"tibioperoneal trunk artery", -1}};
  uint32_t parent = VESSEL_NONE, from = 0, number[5];
  for (uint32_t k = 0; k < SONDE_COUNT_OF(part); ++k) {
    uint32_t to = k + 1 < SONDE_COUNT_OF(part) ? first_below(&line, part[k].end) : line.count - 1;
    vessel_spec spec = artery(part[k].name, r[DIA_CFA], r[DIA_CFA], parent);
    parent = number[k] = limb_branch_add(v, &spec, &line, from, to);
    set_radii(v, parent, step, SONDE_COUNT_OF(step));
    from = to;
  }

  // Deep femoral artery: lateral and behind, then to the back of the shaft.
  sonde_vec3 start = line.point[first_below(&line, d->bifurcation_z)];
  double below = limb_level(limb, start.z);
  knot[0] = start;
  knot[1] = v_add(start, vec3(-0.007, -0.009, -0.012));
  knot[2] = v_add(start, vec3(-0.010, -0.017, -0.030));
  const double deep[][3] = {
      {0.07, 20, 0.44}, {0.12, 38, 0.36}, {0.20, 60, 0.30}, {0.30, 85, 0.26}, {0.42, 110, 0.24}};
  for (uint32_t k = 0; k < SONDE_COUNT_OF(deep); ++k)
    knot[3 + k] = limb_at(limb, below + 0.02 + deep[k][0], deep[k][1], deep[k][2]);
  uint32_t profunda = add_through(
      v, artery("deep femoral artery", r[DIA_DFA], 0.55 * r[DIA_DFA], number[1]), knot, 8);
  knot[0] = limb_branch_point(v, profunda, 6);
  knot[1] = v_add(knot[0], vec3(-0.012, -0.001, -0.012));
  knot[2] = limb_at(limb, limb_level(limb, knot[0].z) + 0.06, 320, 0.62);
  knot[3] = limb_at(limb, limb_level(limb, knot[0].z) + 0.16, 318, 0.66);
  add_through(v, artery("lateral circumflex femoral artery", 0.0016, 0.0009, profunda), knot, 4);

  // The arteries of the calf.
  uint32_t popliteal = number[3], trunk = number[4];
  knot[0] = limb_branch_point(v, popliteal, v->branch[popliteal].count - 1);
  bool high = d->trifurcation < 1;
  uint32_t n = 1;
  if (high) knot[n++] = limb_at(limb, 1.0, 195, 0.42), knot[n++] = limb_at(limb, 1.08, 205, 0.34);
  const double front[][3] = {{1.155, 215, 0.20}, {1.19, 290, 0.22}, {1.25, 315, 0.35},
                             {1.5, 330, 0.38},   {1.75, 350, 0.54}, {1.86, 356, 0.7},
                             {1.94, 0, 0.75}};
  for (size_t k = 0; k < SONDE_COUNT_OF(front); ++k)
    knot[n++] = limb_at(limb, front[k][0], front[k][1], front[k][2]);
  add_through(v, artery("anterior tibial artery", r[DIA_ATA], 0.75 * r[DIA_ATA], popliteal), knot,
              n);
  knot[0] = limb_branch_point(v, trunk, v->branch[trunk].count - 1);
  double split = limb_level(limb, knot[0].z);
  const double tibial[][3] = {{split + 0.05, 114, 0.32}, {1.35, 102, 0.40}, {1.5, 100, 0.46},
                              {1.65, 106, 0.52},         {1.75, 118, 0.58}, {1.88, 126, 0.68},
                              {1.99, 122, 0.72}};
  for (size_t k = 0; k < SONDE_COUNT_OF(tibial); ++k)
    knot[1 + k] = limb_at(limb, tibial[k][0], tibial[k][1], tibial[k][2]);
  add_through(v, artery("posterior tibial artery", r[DIA_PTA], 0.8 * r[DIA_PTA], trunk), knot, 8);
  const double peroneal[][3] = {{split + 0.05, 165, 0.20}, {1.37, 205, 0.22}, {1.5, 225, 0.27},
                                {1.65, 231, 0.34},         {1.75, 235, 0.40}, {1.9, 242, 0.5}};
  for (size_t k = 0; k < SONDE_COUNT_OF(peroneal); ++k)
    knot[1 + k] = limb_at(limb, peroneal[k][0], peroneal[k][1], peroneal[k][2]);
  add_through(v, artery("peroneal artery", r[DIA_PERA], 0.7 * r[DIA_PERA], trunk), knot, 7);
}

// ---- veins beside arteries ----------------------------------------------------------------------

// Direction of the vein from its artery by level, degrees (leg from groin to the calf's upper end).
static const double VEIN_TURN[][2] = {{-0.2, 112}, {-0.05, 106}, {0.05, 116}, {0.15, 136},
                                      {0.25, 160}, {0.5, 180},   {0.65, 205}, {0.72, 230},
                                      {0.85, 210}, {1.0, 185},   {1.08, 160}, {1.2, 150}};

static sonde_vec3 beside(sonde_vec3 p, double distance, double degrees) {
  return v_madd(p, distance, vec3(sin(degrees * DEGREE), cos(degrees * DEGREE), 0));
}

static vessel_spec vein(const char *name, sonde_limb_vessel_kind kind, double from, double to,
                        uint32_t parent, double valves) {
  return (vessel_spec){name,       kind,        from,        to,
                       parent,     VESSEL_NONE, VESSEL_NONE, from > 0.002 ? VEIN_WALL : SMALL_WALL,
                       LAYER_DEEP, valves};
}

// A second vein on another side of the artery from level `from` to `to` of a vein.
static void lay_loop(struct limb_vessels *v, const char *name, uint32_t main,
                     uint32_t beside_artery, double from, double to, double turn) {
  sonde_vec3 knot[40];
  uint32_t a = limb_branch_at_level(v, main, from), e = limb_branch_at_level(v, main, to), n = 0;
  if (e < a + 6) return;
  double radius = 0.7 * limb_branch_places(v, main)[(a + e) / 2].radius;
  uint32_t every = (e - a) / 30 + 3;
  for (uint32_t k = a; n + 1 < SONDE_COUNT_OF(knot) && k + every / 2 < e; k += every) {
    double s = (double)(k - a) / (e - a), u = clamp(4.5 * fmin(s, 1 - s), 0, 1);
    sonde_vec3 p = limb_branch_point(v, main, k), q = p;
    uint32_t at = limb_branch_at_level(v, beside_artery, limb_level(v->limb, p.z));
    q = limb_branch_point(v, beside_artery, at);
    sonde_vec3 off = v_sub(p, q);
    double degrees = atan2(off.x, off.y) / DEGREE + turn * u * u * (3 - 2 * u);
    double reach = limb_branch_places(v, beside_artery)[at].radius + radius + ARTERY_WALL +
                   VEIN_WALL + WALL_GAP;
    double whole = hypot(off.x, off.y);
    knot[n++] = k == a ? p : beside(vec3(q.x, q.y, p.z), whole + u * (reach - whole), degrees);
  }
  knot[n++] = limb_branch_point(v, main, e);
  vessel_spec spec = vein(name, SONDE_LIMB_DEEP_VEIN, radius, radius, main, 0.05);
  spec.joins = main;
  add_through(v, spec, knot, n);
}

// Two veins beside an artery: the first from the end of `parent`, the second from the first.
static void lay_pair(struct limb_vessels *v, const char *name, const char *second, double radius,
                     uint32_t parent, const char *beside_artery, double turn, bool single,
                     double valves) {
  uint32_t a = limb_branch_find(v, beside_artery), count = v->branch[a].count, first = 0;
  SONDE_ASSERT(a != VESSEL_NONE && parent != VESSEL_NONE);
  sonde_vec3 knot[60], joint = limb_branch_point(v, parent, v->branch[parent].count - 1);
  for (uint32_t which = 0; which < (single ? 1u : 2u); ++which) {
    uint32_t n = 1, from = which == 0 ? 7 : 15;
    knot[0] = which == 0 ? joint : limb_branch_point(v, first, v->branch[first].count > 12 ? 6 : 1);
    // The second vein crosses in front of the artery's side that faces its skin.
    for (uint32_t k = from; k < count && n < SONDE_COUNT_OF(knot); k += 5) {
      double degrees, level, f, crossing = which == 0 ? 0 : clamp(1.3 - (k - from) / 10.0, 0, 1);
      sonde_vec3 p = limb_branch_point(v, a, k);
      limb_place_of(v->limb, p, &level, &degrees, &f);
      double reach = limb_branch_places(v, a)[k].radius + radius + 0.0006 + SMALL_WALL + WALL_GAP;
      double angle = degrees + turn + (which == 0 ? 0 : 180 - 90 * crossing);
      knot[n++] = beside(p, reach, angle);
    }
    vessel_spec spec = vein(which == 0 ? name : second, SONDE_LIMB_DEEP_VEIN, radius, 0.75 * radius,
                            which == 0 ? parent : first, valves);
    spec.mate = a;
    uint32_t b = add_through(v, spec, knot, n);
    if (which == 0) first = b;
  }
}

void limb_vessels_lay_deep_femoral(struct limb_vessels *v) {
  uint32_t common = limb_branch_find(v, "common femoral vein");
  uint32_t popliteal = limb_branch_find(v, "popliteal vein");
  const vessel_draws *d = &v->draws;
  uint32_t a = limb_branch_find(v, "deep femoral artery"), n = 0;
  sonde_vec3 knot[60];
  double radius = d->radius[DIA_DFV];
  knot[n++] = limb_branch_point(v, common, v->branch[common].count - 1);
  const double side[][2] = {{0, 20}, {0.12, 40}, {0.3, 80}, {0.45, 110}};
  for (uint32_t k = 0; k < v->branch[a].count && n < SONDE_COUNT_OF(knot); k += 6) {
    sonde_vec3 p = limb_branch_point(v, a, k);
    if (p.z > knot[0].z - 0.022) continue;
    double reach = limb_branch_places(v, a)[k].radius + 2 * 0.0009 + 0.85 * radius + WALL_GAP;
    knot[n++] = beside(p, reach, ALONG(side, limb_level(v->limb, p.z)));
  }
  vessel_spec spec =
      vein("deep femoral vein", SONDE_LIMB_DEEP_VEIN, radius, 0.5 * radius, common, 0.06);
  spec.mate = a;
  uint32_t b = add_through(v, spec, knot, n);
  if (!d->variants.deep_popliteal_link) return;
  knot[0] = limb_branch_point(v, b, v->branch[b].count - 1);
  double level = limb_level(v->limb, knot[0].z);
  knot[1] = limb_at(v->limb, 0.5 * (level + 0.76), 150, 0.3);
  knot[2] = limb_branch_point(v, popliteal, limb_branch_at_level(v, popliteal, 0.79));
  spec = vein("deep femoral to popliteal vein", SONDE_LIMB_DEEP_VEIN, 0.5 * radius, 0.45 * radius,
              b, 0.06);
  spec.joins = popliteal;
  add_through(v, spec, knot, 3);
}

// Greatest radius of the popliteal vein: between the knee's bones and the fascia stand also the
// artery, the tibial nerve and what keeps them apart. A straight knee narrows the vein of a lean
// leg.
static double popliteal_room(const sonde_limb *limb, double artery_m) {
  double least = INFINITY;
  const double others = BONE_GAP + 2 * (artery_m + ARTERY_WALL) + WALL_GAP + 2 * VEIN_WALL +
                        0.0068; // 4.5 mm of nerve, 2.3 mm around it
  for (double level = 0.9; level < 1.06; level += 0.02) {
    double depth = 0.004, radius = limb_fascia_radius(limb, level, SONDE_PI);
    for (; depth < radius; depth += 0.0005) {
      sonde_vec3 p = limb_below_fascia(limb, level, 183, depth);
      const double at[3] = {p.x, p.y, p.z};
      if (limb_bone_distance(limb, at, NULL) < 0) break;
    }
    least = fmin(least, depth);
  }
  return fmax(0.5 * (least - others), 0.0018);
}

void limb_vessels_lay_veins(struct limb_vessels *v) {
  const sonde_limb *limb = v->limb;
  const vessel_draws *d = &v->draws;
  double *r = v->draws.radius;
  const double room = popliteal_room(limb, r[DIA_POPA]);
  r[DIA_POPV] = fmin(r[DIA_POPV], room), r[DIA_TPV] = fmin(r[DIA_TPV], 0.95 * r[DIA_POPV]);
  double hiatus = limb_z(limb, d->hiatus), split = limb_z(limb, fmin(1.13, d->trunk_end - 0.004));
  // Above the saphenofemoral junction the common femoral vein has its table's width. Below, and in
  // the femoral vein's upper part above mid-thigh, of which the table speaks, widths follow from
  // Murray's law, by which the lumina of a joint have r^k in balance.
  const double below = limb_murray_rest(r[DIA_CFV], r[DIA_GSV_ARCH]);
  const double upper = fmax(limb_murray_rest(below, r[DIA_DFV]), r[DIA_FV]);
  const radius_step step[] = {{1, r[DIA_EIV]},
                              {d->ligament_z, r[DIA_CFV]},
                              {d->junction_z - 0.004, below},
                              {d->confluence_z, upper},
                              {limb_z(limb, 0.25), 0.5 * (upper + r[DIA_FV])},
                              {limb_z(limb, 0.4), r[DIA_FV]},
                              {hiatus, r[DIA_POPV]},
                              {split, r[DIA_TPV]}};
  const struct {
    const char *name;
    double end, valves;
  } part[] = {{"external iliac vein", d->ligament_z, 0},
              {"common femoral vein", d->confluence_z, 0.05},
              {"femoral vein", hiatus, 0.09},
              {"popliteal vein", split, 0.08},
              {"tibioperoneal trunk vein", -1, 0.05}};
  vessel_line line;
  // The main vein's line, beside the artery as it lies now.
  line.count = 0;
  for (uint32_t b = 0; b < 5; ++b)
    for (uint32_t k = b > 0; k < v->branch[b].count; ++k) {
      sonde_vec3 p = limb_branch_point(v, b, k);
      double reach = limb_branch_places(v, b)[k].radius + ARTERY_WALL +
                     radius_at(step, SONDE_COUNT_OF(step), p.z) + VEIN_WALL + WALL_GAP;
      SONDE_ASSERT(line.count < VESSEL_LINE);
      line.point[line.count++] = beside(p, reach, ALONG(VEIN_TURN, limb_level(v->limb, p.z)));
    }
  uint32_t parent = VESSEL_NONE, from = 0, number[5];
  for (uint32_t k = 0; k < SONDE_COUNT_OF(part); ++k) {
    uint32_t to = k + 1 < SONDE_COUNT_OF(part) ? first_below(&line, part[k].end) : line.count - 1;
    vessel_spec spec =
        vein(part[k].name, SONDE_LIMB_DEEP_VEIN, r[DIA_FV], r[DIA_FV], parent, part[k].valves);
    spec.mate = k; // arteries 0 to 4 are those beside
    parent = number[k] = limb_branch_add(v, &spec, &line, from, to);
    set_radii(v, parent, step, SONDE_COUNT_OF(step));
    from = to;
  }

  // Second veins of the thigh and of the fossa.
  uint32_t femoral = number[2], popliteal = number[3];
  double place = limb_draw_uniform(limb->body.seed, 90), middle = place < 0.52   ? 0.45
                                                                  : place < 0.82 ? 0.58
                                                                                 : 0.3;
  double half = 0.5 * clamp(0.11 + 0.035 * d->wander[5], 0.05, 0.2) / limb->body.thigh_length_m;
  double a = fmax(0.16, middle - half), e = fmin(d->hiatus - 0.03, middle + half);
  if (d->variants.second_femoral & 1) lay_loop(v, "second femoral vein", femoral, 2, a, e, -125);
  if (d->variants.second_femoral & 2)
    lay_loop(v, d->variants.second_femoral == 3 ? "third femoral vein" : "second femoral vein",
             femoral, 2, a, e, 125);
  if (d->variants.second_popliteal == 1)
    lay_loop(v, "second popliteal vein", popliteal, 3, 1.02, 1.115, -110);
  if (d->variants.second_popliteal == 2)
    lay_loop(v, "second popliteal vein", popliteal, 3, d->hiatus + 0.05, 1.115, -110);

  lay_pair(v, "posterior tibial vein", "second posterior tibial vein", r[DIA_PTV], number[4],
           "posterior tibial artery", 90, d->variants.single_tibial, 0.025);
  lay_pair(v, "peroneal vein", "second peroneal vein", r[DIA_PERV], number[4], "peroneal artery",
           90, d->variants.single_peroneal, 0.03);
  lay_pair(v, "anterior tibial vein", "second anterior tibial vein", r[DIA_ATV], popliteal,
           "anterior tibial artery", 90, false, 0.03);
}
