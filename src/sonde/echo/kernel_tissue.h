// Tissue along one row of the march: labels, backscatter, attenuation, signed distances to the
// interfaces, textures. Included by kernel.c only.
#ifndef SONDE_SRC_ECHO_KERNEL_TISSUE_H
#define SONDE_SRC_ECHO_KERNEL_TISSUE_H

#include "base/base.h"
#include "echo/kernel.h"
#include "echo/kernel_muscles.h"
#include "echo/kernel_texture.h"
#include "interior/clot.h"

// Backscatter over muscle (amplitude) and attenuation (dB/m/MHz one way); docs/echo.md.
static const float skin_tissue[2] = {2.2f, 100}, fat_tissue[2] = {0.40f, 50},
                   muscle_tissue[2] = {0.75f, 100}, wall_tissue[2] = {1.9f, 110},
                   blood_tissue[2] = {0.06f, 18}, bone_tissue[2] = {0.02f, 200};
static const float wall_body = 0.5f;     // of a vessel's wall along the beam
static const float rough_tangent = 0.4f; // angle at which fewer facets by 1/e look at the probe
static const float outside_loss = 0.2f;
static const float node_loss = 60, haematoma_loss = 45, fluid_tissue[2] = {0.006f, 5};
static const float capsule_m = 0.3e-3f, capsule_scatter = 1.4f, hilum_scatter = 1.2f;

// Signed distance over the row, metres (negative inside): to first order (F - 1)/|grad F| of the
// ellipse F = 1.
INLINE floats wall_distance(floats a, floats b, floats half_a, floats half_b) {
  floats square = a * a + b * b, size = vsqrt(square);
  floats ga = a / half_a, gb = b / half_b, steep = vsqrt(ga * ga + gb * gb);
  floats distance = vselect(steep > 1e-3f, (size - 1) * size / vmax(steep, vset(1e-3f)), -half_a);
  floats beyond = (vabs(b) - 1) * half_b; // bounds the estimate beside a flat ellipse's tips
  distance = vselect((beyond > 0) & (beyond > distance), beyond, distance);
  return vselect(square > 400, vset(1), distance);
}

// sonde_clot_surface() for a vector of places.
INLINE floats clot_surface(uint32_t vessel, floats along, floats across) {
  floats sum = clot_bend * (clot_level - across * across), c, s;
  for (uint32_t k = 0; k < CLOT_WAVES; ++k) {
    const clot_wave *w = &clot_waves[k];
    floats turns = w->across * across + w->per_m * along + sonde_clot_start(vessel, k);
    turn(turns - vfloor(turns), &c, &s);
    sum += w->height * c;
  }
  return sum;
}

// Unevenness of a clot, dB: lumps of 2 mm and finer grain, and the layers in which it grew.
INLINE floats clot_grain(const tissue_vessel *it, knots *memory, floats theta, floats s,
                         floats depth, floats inward) {
  floats lump = texture(memory, theta, s * 400, depth * 600, 4 * TURNS_MUSCLE, 13);
  floats layer = sheet(inward * 2.2f + 0.6f * lump, 0.6f);
  return it->lumps_db * lump + it->layers_db * (layer - 0.3f);
}

INLINE void mark(ints mask, floats scatter, float loss, floats out[2]) {
  out[0] = vselect(mask, scatter, out[0]), out[1] = vselect(mask, vset(loss), out[1]);
}

INLINE void mark_both(ints mask, floats scatter, floats loss, floats out[2]) {
  out[0] = vselect(mask, scatter, out[0]), out[1] = vselect(mask, loss, out[1]);
}

// Superficial fascia: half thickness, m, and brightness.
static const float superficial_m = 0.4e-3f, superficial_scatter = 1.6f;

// Share of a sheet's amplitude that its roughness sends back at every angle.
static const float rough_sheet = 0.25f;

// What a point's texture depends on.
typedef struct tissue_point {
  knots *memory;
  const float *map; // fields of the tissue map
  floats theta, s, depth, across, up;
  floats facing; // how squarely the beam meets the layers, 0..1
  floats sheath; // of the bright fat around a vessel, 0..1
} tissue_point;

// Layer by layer; levels 1 and 2 are the depths below dermis and fascia.
INLINE void layers(const tissue_job *job, const tissue_point *p, const floats *level,
                   floats out[2]) {
  ints in_fat = (level[1] >= 0) & (level[2] < 0), in_muscle = (level[1] >= 0) & (level[2] >= 0);
  floats fat_scatter = vset(job->plain ? fat_tissue[0] : 0),
         muscle_scatter = vset(job->plain ? 1 : 0);
  floats fat_loss = vset(fat_tissue[1]);
  const bool mapped = job->cells > 0 && !job->plain;
  // Muscles of a map: each with its own fibres, fat between them, sheaths around them.
  floats between = vset(0), sheaths = vset(0);
  if (!job->plain && vany(in_muscle)) {
    tile_grain g;
    floats square = p->facing * p->facing, gain = vset(1);
    if (mapped) {
      muscle_place at =
          place_in_muscles(job, p->memory, p->map + job->lines, p->theta, p->s, p->depth);
      const bool one = vall(at.which == at.which[0]);
      g = muscle_grain(job, at.which, one, p->across, p->up, p->s);
      square = cell_fact_at(job, CELL_FACING, at.which, one), square *= square;
      gain = cell_fact_at(job, CELL_GAIN, at.which, one);
      between = 1 - cell_fact_at(job, CELL_MUSCLE, at.which, one), sheaths = at.bright;
    } else {
      const float around = 26 * SONDE_TILE_SIDE * 0.159154943f;
      g = tile_at(job->tile[1], p->theta * around, p->s * 1250, (p->depth + 0.1f * p->s) * 4000);
    }
    muscle_scatter =
        muscle_tissue[0] * gain * (g.body + (rough_sheet + (1 - rough_sheet) * square) * g.facing);
  }
  between = vmax(between, p->sheath);
  if (!job->plain && (vany(in_fat) || vany(between > 0))) {
    tile_grain g = fat_grain(job->tile[0], p->theta, p->s, p->depth);
    floats square = p->facing * p->facing;
    fat_scatter = g.body + (rough_sheet + (1 - rough_sheet) * square) * g.facing;
  }
  if (!job->plain) {
    floats loose = 1.3f * fat_scatter + 0.1f;
    muscle_scatter = muscle_scatter + between * (loose - muscle_scatter) + sheaths;
  }
  if (job->oedema > 0 && vany(in_fat)) {
    floats fluid = clefts(p->memory, p->theta, p->s, p->depth, job->oedema);
    fat_scatter = (fat_scatter * (1 + job->oedema)) * (1 - fluid) + fluid_tissue[0] * fluid;
    fat_loss += fluid * (fluid_tissue[1] - fat_loss);
  }
  if (mapped) {
    floats thin = vmax(1 - vabs(vload(p->map)) * (1 / superficial_m), vset(0));
    fat_scatter += superficial_scatter * thin;
  }
  ints sheath = (level[1] >= 0) & (vabs(level[2] - 0.3e-3f) < 0.7e-3f);
  if (!job->plain && vany(sheath)) {
    floats more = fascia(p->memory, p->theta, p->s, level[2] - 0.3e-3f);
    fat_scatter += more, muscle_scatter += more;
  }
  mark_both(in_fat, fat_scatter, fat_loss, out);
  mark(in_muscle, muscle_scatter, muscle_tissue[1], out);
}

// Signed distance to the ellipsoid |q| = 1, m, to first order.
INLINE floats lesion_distance(const tissue_lesion *lesion, const floats q[3]) {
  floats square = vset(0), steep = vset(0);
  for (int k = 0; k < 3; ++k) {
    floats g = q[k] * lesion->per_half[k];
    square += q[k] * q[k], steep += g * g;
  }
  floats size = vsqrt(square);
  return (size - 1) * size / vmax(vsqrt(steep), vset(1));
}

// Rim and hilum, fluid, or clotted and liquid parts; a thin capsule.
INLINE void lesion(const tissue_lesion *it, knots *memory, const floats q[3], floats away,
                   floats theta, floats s, floats depth, floats out[2]) {
  ints in = away < 0;
  if (!vany(away < capsule_m)) return;
  if (it->kind != TISSUE_HAEMATOMA)
    mark_both((away >= 0) & (away < capsule_m), vset(capsule_scatter), out[1], out);
  if (it->kind == TISSUE_CYST) {
    mark(in, vmax(vset(it->scatter), vset(fluid_tissue[0])), fluid_tissue[1], out);
    return;
  }
  floats grain = texture(memory, theta, s * 400, depth * 500, 4 * TURNS_MUSCLE, 11);
  floats scatter = it->scatter * (1 + 0.3f * grain);
  if (it->kind == TISSUE_NODE) {
    floats hilum = q[0] * q[0] * 7 + q[1] * q[1] * 7 + q[2] * q[2] * 2 + 0.4f * grain;
    floats share = smooth(vmin(vmax((1.2f - hilum) * 2, vset(0)), vset(1)));
    mark(in, scatter + share * (hilum_scatter - scatter), node_loss, out);
    return;
  }
  floats lump = texture(memory, theta, s * 150, depth * 200, 2 * TURNS_MUSCLE, 12) + 0.5f * grain;
  floats liquid = smooth(vmin(vmax(0.1f - 3 * lump, vset(0)), vset(1)));
  mark(in, scatter * power2(1.5f * lump) * (1 - liquid) + fluid_tissue[0] * liquid, haematoma_loss,
       out);
}

// Walls hide lesions, lumina walls: branches begin in the lumen of their parents. Clot last.
INLINE void vessels(const tissue_job *job, knots *memory, const float *f, const floats *level,
                    const float *before, floats out[2]) {
  const uint32_t n = job->lines;
  for (uint32_t v = job->vessels; v-- > 0;) {
    const ints wall = level[v] < job->vessel[v].wall_m;
    if (vany(wall)) {
      // Where the beam grazes it, the wall is as grey as what lies around it.
      floats slope = vabs(level[v] - vload(before + v * n)) * job->rows_per_m;
      floats square = vmin(slope * slope, vset(1));
      floats scatter = vset(wall_tissue[0]);
      if (!job->plain) scatter = wall_body + (wall_tissue[0] - wall_body) * (square * square);
      mark(wall, scatter, wall_tissue[1], out);
    }
    mark(level[v] <= 0, vset(blood_tissue[0]), blood_tissue[1], out);
  }
  for (uint32_t v = 2; v < job->vessels; ++v)
    mark(level[v] <= 0, vset(blood_tissue[0]), blood_tissue[1], out);
  for (uint32_t v = 0; v < job->vessels; ++v) {
    const tissue_vessel *it = &job->vessel[v];
    if (!(it->clot_fraction > 0)) continue;
    const float *at = f + vessel_field_at(v, VESSEL_SHORT) * n;
    ints clot = (level[v] <= 0) & (vload(at + VESSEL_CLOT * n) >= 0.5f);
    floats theta = vload(f + PLANE_THETA * n), s = vload(f + PLANE_S * n),
           depth = vload(f + PLANE_DEPTH * n);
    if (!vany(clot)) continue;
    if (it->clot_fraction < 1)
      clot &= -vload(at) > 1 - 2 * it->clot_fraction + clot_surface(it->number, s, vload(at + n));
    floats scatter = vset(it->clot_scatter);
    if (!job->plain)
      scatter =
          scatter * power2(clot_grain(it, memory, theta, s, depth, vload(at)) * 0.16609640474f);
    if (v == 0 && job->webs > 0 && vany(clot))
      scatter =
          scatter * (1 - 0.6f * job->webs) + job->webs * webs(memory, theta, s, depth, vload(at));
    mark(clot, scatter, it->clot_loss, out);
  }
}

// Facets of the cortex scatter towards the probe; the fewer, the more the cortex is inclined. The
// distance to it grows along a line with the cosine of the angle between line and normal.
INLINE floats periosteum(const tissue_job *job, floats inside, floats before) {
  floats away = vabs(inside);
  ints near = away < job->rough_m;
  if (!vany(near)) return vset(0);
  floats cosine = vmin(vmax((inside - before) * job->rows_per_m, vset(0.05f)), vset(1));
  floats square = 1 / (cosine * cosine) - 1;                              // of the tangent
  floats fewer = square * (-1.442695f / (rough_tangent * rough_tangent)); // octaves
  floats size = power2(vmax(fewer, vset(-60)));
  return vonly(near, job->rough_bone * size * (1 - away / job->rough_m));
}

// Returns the lanes in which a level changed sign since the row above.
INLINE ints paint(const tissue_job *job, uint32_t l) {
  const float *f = job->row + l;
  const uint32_t n = job->lines, levels = LAYER_LEVELS + job->vessels + job->lesions;
  floats depth = vload(f + PLANE_DEPTH * n), fat = vload(f + PLANE_FAT * n);
  floats muscle = vload(f + PLANE_MUSCLE * n);
  floats across = vload(f + PLANE_ACROSS * n), up = vload(f + PLANE_UP * n);
  floats theta = vload(f + PLANE_THETA * n), s = vload(f + PLANE_S * n), level[MOST_LEVELS];
  level[0] = depth, level[1] = depth - fat, level[2] = depth - muscle;
  level[3] = vload(f + PLANE_BONE * n) + (job->bone_radius_m - vsqrt(across * across + up * up));
  const float *map = f + map_field_at(job->vessels, job->lesions, 0) * n;
  level[4] = job->cells > 0 ? vload(map) : vset(-1);
  floats *wall = level + LAYER_LEVELS, *edge = wall + job->vessels;
  tissue_point point = {(knots *)(void *)(job->memory + (size_t)l * KNOT_FLOATS * TEXTURES),
                        map,
                        theta,
                        s,
                        depth,
                        across,
                        up,
                        vset(1),
                        vset(0)};
  // Depth grows along a line with the cosine between line and normal.
  if (job->rows_per_m > 0)
    point.facing = vmin(vabs(depth - vload(job->before + l)) * job->rows_per_m, vset(1));
  for (uint32_t v = 0; v < job->vessels; ++v) {
    const float *at = f + vessel_field_at(v, VESSEL_SHORT) * n, *half = at + VESSEL_HALF_SHORT * n;
    wall[v] = wall_distance(vload(at), vload(at + n), vload(half), vload(half + n));
    if (job->vessel[v].sheath_m > 0) {
      floats share = (job->vessel[v].wall_m + job->vessel[v].sheath_m - wall[v]) * 1000;
      point.sheath = vmax(point.sheath, vmin(share, vset(1)));
    }
  }
  floats tissue[2] = {vset(skin_tissue[0]), vset(skin_tissue[1])};
  layers(job, &point, level, tissue);
  for (uint32_t k = 0; k < job->lesions; ++k) {
    const float *at = f + lesion_field_at(job->vessels, k, 0) * n;
    floats q[3] = {vload(at), vload(at + n), vload(at + 2 * n)};
    edge[k] = lesion_distance(&job->lesion[k], q);
    lesion(&job->lesion[k], point.memory, q, edge[k], theta, s, depth, tissue);
  }
  vessels(job, point.memory, f, wall, job->before + LAYER_LEVELS * n + l, tissue);
  mark(level[3] > 0, vset(bone_tissue[0]), bone_tissue[1], tissue);
  mark(level[0] < 0, vset(0), outside_loss, tissue);
  vstore(job->scatter + l, tissue[0]), vstore(job->loss + l, tissue[1]);
  vstore(job->rough + l, periosteum(job, level[3], vload(job->before + 3 * n + l)));
  ints changed = vset_ints(0);
  for (uint32_t k = 0; k < levels; ++k) {
    floats last = vload(job->before + k * n + l);
    changed |= (level[k] < 0) ^ (last < 0);
    if (k == 2)
      for (int i = 1; i < FASCIA_SHEETS; ++i)
        changed |= (level[k] < fascia_sheet_m[i]) ^ (last < fascia_sheet_m[i]);
    vstore(job->level + k * n + l, level[k]);
  }
  for (uint32_t v = 0; v < job->vessels; ++v) {
    const float thick = job->vessel[v].wall_m;
    changed |= (wall[v] < thick) ^ (vload(job->before + (LAYER_LEVELS + v) * n + l) < thick);
  }
  return changed;
}

static void tissue(const tissue_job *job) {
  for (uint32_t l = 0; l < job->lines; l += ECHO_ALIGN) {
    bool crossed = false;
    for (uint32_t k = 0; k < ECHO_ALIGN; k += FLOATS) crossed = vany(paint(job, l + k)) || crossed;
    job->crossed[l / ECHO_ALIGN] = crossed;
  }
}

#endif
