// Nerves and lymph nodes of the groin (docs/limb_vessels.md).
#include "limb/vessels.h"
#include "limb/vessels_graph.h"

typedef struct nerve_row {
  double level, degrees, f;
} nerve_row;

static void lay(struct limb_vessels *v, uint32_t which, const char *name, double width,
                double thickness, const sonde_vec3 *knot, uint32_t count) {
  SONDE_ASSERT(which < LIMB_NERVES && width >= thickness);
  limb_nerve *nerve = &v->nerve[which];
  vessel_line line;
  limb_line_through(knot, count, &line);
  *nerve = (limb_nerve){.half = 0.5 * (width - thickness), .radius = 0.5 * thickness};
  snprintf(nerve->name, sizeof nerve->name, "%s", name);
  uint32_t most = SONDE_COUNT_OF(nerve->point), every = line.count / most + 1;
  for (uint32_t k = 0; k < line.count && nerve->count < most; k += every)
    nerve->point[nerve->count++] = line.point[k];
  // Off vessels, bones and fascia; the line stays smooth.
  const double h = 2e-4, size = nerve->radius + 0.5 * nerve->half;
  for (int pass = 0; pass < 40; ++pass)
    for (uint32_t k = 0; k < nerve->count; ++k) {
      sonde_vec3 *p = &nerve->point[k], step = {0};
      for (int from = 0; from < 2; ++from) {
        // Room to the vessels, then to the bones: here and, where it lacks, to either side.
        const sonde_vec3 axis[2] = {{1, 0, 0}, {0, 1, 0}};
        double gap[5];
        for (int i = 0; i < 5 && (i == 0 || gap[0] < 0); ++i) {
          sonde_vec3 at = i == 0 ? *p : v_madd(*p, i % 2 ? h : -h, axis[(i - 1) / 2]);
          const double xyz[3] = {at.x, at.y, at.z};
          uint32_t branch;
          double arc, wall;
          if (from == 0)
            gap[i] = limb_vessels_lumen(v, at, &branch, &arc, &wall) - (wall + size + 0.0008);
          else
            gap[i] = limb_bone_distance(v->limb, xyz, NULL) - size - 0.002;
        }
        if (gap[0] >= 0) continue;
        sonde_vec3 out = v_unit(vec3(gap[1] - gap[2], gap[3] - gap[4], 0), vec3(0, 1, 0));
        step = v_madd(step, fmin(-0.6 * gap[0], 0.002), out);
      }
      double level, degrees, f;
      limb_place_of(v->limb, *p, &level, &degrees, &f);
      double over = size + 0.001 - (1 - f) * limb_fascia_radius(v->limb, level, degrees * DEGREE);
      if (over > 0)
        step = v_madd(step, -over, vec3(sin(degrees * DEGREE), cos(degrees * DEGREE), 0));
      *p = v_add(*p, step);
      if (k > 0 && k + 1 < nerve->count)
        *p = v_lerp(*p, v_lerp(nerve->point[k - 1], nerve->point[k + 1], 0.5), 0.1);
    }
  // Flat across the ray from the section's centre.
  for (uint32_t k = 0; k < nerve->count; ++k) {
    double level, degrees, f;
    limb_place_of(v->limb, nerve->point[k], &level, &degrees, &f);
    nerve->side[k] = vec3(cos(degrees * DEGREE), -sin(degrees * DEGREE), 0);
  }
}

static uint32_t knots_of(const sonde_limb *limb, const nerve_row *row, size_t count,
                         sonde_vec3 *knot) {
  for (size_t k = 0; k < count; ++k)
    knot[k] = limb_at(limb, row[k].level, row[k].degrees, row[k].f);
  return (uint32_t)count;
}

void limb_nerves_lay(struct limb_vessels *v) {
  SONDE_ASSERT(v->cells > 0);
  const sonde_limb *limb = v->limb;
  sonde_vec3 knot[24];
  uint32_t common = limb_branch_find(v, "common femoral artery"),
           femoral = limb_branch_find(v, "superficial femoral artery");
  uint32_t iliac = limb_branch_find(v, "external iliac artery"), n = 0;
  // Femoral nerve: 5 to 10 mm lateral of the artery and behind the fascia iliaca.
  const struct {
    uint32_t branch;
    double level, aside, behind;
  } row[] = {{iliac, -0.17, -0.016, 0.004},
             {iliac, -0.1, -0.015, 0.003},
             {common, -0.04, -0.0155, 0.003},
             {common, 0.01, -0.016, 0.003},
             {femoral, 0.06, -0.016, 0.004}};
  for (size_t k = 0; k < SONDE_COUNT_OF(row); ++k) {
    sonde_vec3 p =
        limb_branch_point(v, row[k].branch, limb_branch_at_level(v, row[k].branch, row[k].level));
    knot[n++] = vec3(p.x + row[k].aside, p.y - row[k].behind, limb_z(limb, row[k].level));
  }
  lay(v, 0, "femoral nerve", 0.008, 0.003, knot, n);
  // Saphenous nerve: along the artery, from its lateral to its medial front in the canal, then to
  // the skin's side.
  knot[0] = v->nerve[0].point[v->nerve[0].count - 1];
  n = 1;
  for (double level = 0.12; level < v->draws.hiatus - 0.06; level += 0.06) {
    uint32_t k = limb_branch_at_level(v, femoral, level);
    double turn = -75 + 120 * clamp((level - 0.3) / 0.3, 0, 1),
           reach = limb_branch_places(v, femoral)[k].radius + 0.0031;
    knot[n++] = v_madd(limb_branch_point(v, femoral, k), reach,
                       vec3(sin(turn * DEGREE), cos(turn * DEGREE), 0));
  }
  knot[n++] = limb_at(limb, v->draws.hiatus + 0.03, 100, 0.85);
  knot[n++] = limb_at(limb, 0.86, 110, 0.93);
  knot[n++] = limb_at(limb, 0.97, 110, 0.95);
  lay(v, 1, "saphenous nerve", 0.002, 0.002, knot, n);
  // Sciatic nerve, which splits 54 +- 14 mm above the crease.
  double split = 1 - (0.015 + 0.054 + 0.01 * v->draws.wander[3]) / limb->body.thigh_length_m;
  const nerve_row sciatic[] = {{0.02, 200, 0.42}, {0.12, 204, 0.44}, {0.25, 205, 0.45},
                               {0.5, 192, 0.5},   {0.75, 190, 0.56}, {split, 190, 0.62}};
  n = knots_of(limb, sciatic, SONDE_COUNT_OF(sciatic), knot);
  lay(v, 2, "sciatic nerve", 0.012, 0.006, knot, n);
  sonde_vec3 fork = v->nerve[2].point[v->nerve[2].count - 1];
  knot[0] = fork;
  n = 1;
  // Behind the popliteal vein, towards the skin of the fossa.
  uint32_t vein = limb_branch_find(v, "popliteal vein");
  for (double level = split + 0.05; level < 1.1; level += 0.05) {
    uint32_t k = limb_branch_at_level(v, vein, level);
    sonde_vec3 p = limb_branch_point(v, vein, k);
    double reach = limb_branch_places(v, vein)[k].radius + 0.0045;
    knot[n++] = vec3(p.x + 0.0005, p.y - reach, limb_z(limb, level));
  }
  const double down[][3] = {
      {1.2, 150, 0.34}, {1.35, 135, 0.33}, {1.5, 124, 0.36}, {1.75, 128, 0.57}, {1.97, 128, 0.7}};
  for (size_t k = 0; k < SONDE_COUNT_OF(down); ++k)
    knot[n++] = limb_at(limb, down[k][0], down[k][1], down[k][2]);
  lay(v, 3, "tibial nerve", 0.006, 0.0045, knot, n);
  const nerve_row peroneal[] = {{0, 0, 0},       {split + 0.05, 205, 0.68}, {0.95, 218, 0.75},
                                {1.0, 228, 0.8}, {1.05, 240, 0.84},         {1.09, 268, 0.88}};
  n = knots_of(limb, peroneal + 1, SONDE_COUNT_OF(peroneal) - 1, knot + 1) + 1;
  knot[0] = fork;
  lay(v, 4, "common peroneal nerve", 0.005, 0.003, knot, n);
}

// Superficial nodes round the saphenofemoral junction, deep ones medial of the common femoral vein.
void limb_lymph_lay(struct limb_vessels *v) {
  SONDE_ASSERT(v->cells > 0);
  const sonde_limb *limb = v->limb;
  uint32_t common = limb_branch_find(v, "common femoral vein");
  double junction = limb_level(limb, v->draws.junction_z), shift = 2 * v->draws.wander[4];
  const struct {
    double level, degrees;
    bool deep;
  } row[VESSEL_LYMPH] = {{-0.035, 8, false}, {-0.03, 62, false}, {0.03, 4, false},
                         {0.075, 66, false}, {-0.025, 0, true},  {0.01, 0, true}};
  for (uint32_t k = 0; k < VESSEL_LYMPH; ++k) {
    double radius = row[k].deep ? 0.0027 : 0.0025, level = junction + row[k].level;
    limb_lymph *node = &v->lymph[k];
    *node = (limb_lymph){{0}, {0, 0, 1}, 2 * radius, radius};
    if (row[k].deep) {
      uint32_t at = limb_branch_at_level(v, common, level);
      sonde_vec3 p = limb_branch_point(v, common, at);
      node->centre =
          vec3(p.x + limb_branch_places(v, common)[at].radius + radius + 0.003, p.y - 0.001, p.z);
    } else {
      double fat = limb_fat(limb, level, row[k].degrees * DEGREE);
      double room = fmin(radius, 0.42 * fat);
      node->radius = room, node->length = 2 * room;
      node->centre = limb_below_fascia(limb, level, row[k].degrees + shift, -0.55 * fat);
    }
    // Off the vessels.
    for (int pass = 0; pass < 30; ++pass) {
      uint32_t branch;
      double arc, wall,
          lack = limb_vessels_lumen(v, node->centre, &branch, &arc, &wall) - wall - node->radius -
                 0.0008;
      if (lack >= 0 || branch == VESSEL_NONE) break;
      sonde_limb_vessel_point near = {0};
      const vessel_place *place = limb_branch_places(v, branch);
      uint32_t i = 0;
      while (i + 1 < v->branch[branch].count && place[i].arc < arc) ++i;
      near.centre_m = v->node[place[i].node];
      sonde_vec3 away = v_sub(node->centre, near.centre_m);
      away.z = 0;
      node->centre = v_madd(node->centre, -lack + 1e-4, v_unit(away, vec3(1, 0, 0)));
    }
  }
}

uint32_t limb_nerve_bodies(const struct limb_vessels *v) {
  SONDE_ASSERT(v != NULL);
  return LIMB_NERVES + VESSEL_LYMPH;
}

limb_body limb_nerve_body(const struct limb_vessels *v, uint32_t which, sonde_vec3 p) {
  SONDE_ASSERT(which < LIMB_NERVES + VESSEL_LYMPH);
  if (which >= LIMB_NERVES) {
    const limb_lymph *node = &v->lymph[which - LIMB_NERVES];
    const sonde_vec3 side = v_unit(v_cross(node->axis, vec3(0, 1, 0)), vec3(1, 0, 0));
    return (limb_body){.centre = node->centre,
                       .axis = node->axis,
                       .side = side,
                       .wide = node->radius,
                       .thick = node->radius,
                       .length = node->length,
                       .node = true};
  }
  // Nerves run downwards: the piece at the point's height.
  const limb_nerve *nerve = &v->nerve[which];
  limb_body body = {.wide = nerve->half + nerve->radius, .thick = nerve->radius, .ends = true};
  if (nerve->count < 2) return body;
  uint32_t low = 0, high = nerve->count - 1;
  while (high - low > 1) {
    const uint32_t middle = (low + high) / 2;
    if (nerve->point[middle].z > p.z)
      low = middle;
    else
      high = middle;
  }
  const sonde_vec3 a = nerve->point[low], b = nerve->point[high];
  const double fall = a.z - b.z, t = fall > 1e-6 ? (a.z - p.z) / fall : 0;
  body.ends = t < 0 || t > 1;
  body.centre = v_lerp(a, b, clamp(t, 0, 1));
  body.axis = v_unit(v_sub(b, a), vec3(0, 0, -1));
  const sonde_vec3 side = v_lerp(nerve->side[low], nerve->side[high], clamp(t, 0, 1));
  body.side = v_unit(v_madd(side, -v_dot(side, body.axis), body.axis), vec3(1, 0, 0));
  return body;
}
