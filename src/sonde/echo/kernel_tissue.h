// Tissue along one row of the march: labels, backscatter, attenuation, signed distances to the
// interfaces, textures. Included by kernel.c only.
#ifndef SONDE_SRC_ECHO_KERNEL_TISSUE_H
#define SONDE_SRC_ECHO_KERNEL_TISSUE_H

#include "base/base.h"
#include "echo/kernel.h"
#include "echo/kernel_muscles.h"
#include "echo/kernel_texture.h"
#include "echo/kernel_vessels.h"

// Backscatter over muscle (amplitude) and attenuation (dB/m/MHz one way); docs/echo.md.
static const float skin_tissue[2] = {2.2f, 100}, fat_tissue[2] = {0.40f, 50},
                   muscle_tissue[2] = {0.85f, 100}, bone_tissue[2] = {0.02f, 200};
static const float rough_tangent = 0.4f;  // angle at which fewer facets by 1/e look at the probe
static const float flank_octaves = 0.87f; // less per tangent of the slope
static const float outside_loss = 0.2f;

// Superficial fascia: half thickness, m, and brightness.
static const float superficial_m = 0.4e-3f, superficial_scatter = 1.6f;

// Share of a sheet's amplitude that its roughness sends back at every angle.
static const float rough_sheet = 0.25f;

// What coherent septa scatter besides, over their strength, and half the thickness of that.
static const float septum_body = 1.6f, septum_body_m = 0.28e-3f;

// Layer by layer; levels 1 and 2 are the depths below dermis and fascia.
INLINE void layers(const tissue_job *job, const tissue_point *p, const floats *level,
                   septum *lobule, floats out[2]) {
  ints in_fat = (level[1] >= 0) & (level[2] < 0), in_muscle = (level[1] >= 0) & (level[2] >= 0);
  floats fat_scatter = vset(job->plain ? fat_tissue[0] : 0),
         muscle_scatter = vset(job->plain ? 1 : 0);
  floats fat_loss = vset(fat_tissue[1]);
  const bool mapped = job->cells > 0 && !job->plain;
  // Muscles of a map: each with its own fibres, fat between them, sheaths around them.
  floats between = vset(0), sheaths = vset(0);
  if (!job->plain && vany(in_muscle)) {
    tile_grain g;
    floats square = p->facing * p->facing, gain = vset(muscle_tissue[0]);
    if (mapped) {
      muscle_place at =
          place_in_muscles(job, p->gate, p->memory, p->map + job->lines, p->theta, p->s, p->depth);
      const bool one = vall(at.which == at.which[0]);
      g = muscle_grain(job, at.which, one, p->theta, p->s, p->depth);
      gain = gain * cell_fact_at(job, CELL_GAIN, at.which, one);
      between = 1 - cell_fact_at(job, CELL_MUSCLE, at.which, one), sheaths = at.bright;
    } else {
      g = muscle_grain(job, vset_ints(0), true, p->theta, p->s, p->depth);
    }
    muscle_scatter = gain * (g.body + (rough_sheet + (1 - rough_sheet) * square) * g.facing);
  }
  between = vmax(between, p->sheath);
  if (!job->plain && (vany(in_fat) || vany(between > 0))) {
    tile_grain g = fat_grain(job->tile[0], p->theta, p->s, p->depth);
    floats square = p->facing * p->facing;
    *lobule = septum_at(p->memory, p->theta, p->s, p->depth);
    lobule->size = vonly(in_fat, lobule->size);
    lobule->away = vselect(in_fat, lobule->away, vset(1)); // vectors differ in what they skip
    floats thin = vmax(1 - vabs(lobule->away) * (1 / septum_body_m), vset(0));
    fat_scatter = g.body + (rough_sheet + (1 - rough_sheet) * square) * g.facing +
                  septum_body * lobule->size * thin;
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
    floats thin = vmax(1 - vabs(field_at(job, p->map)) * (1 / superficial_m), vset(0));
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
  // Periosteum besides, which is seen along the flanks too.
  floats skin = job->periosteum * power2(vsqrt(square) * -flank_octaves);
  return vonly(near, (job->rough_bone * size + skin) * (1 - away / job->rough_m));
}

// Lanes in which a level changed sign since the row above, or the distance to the nearest septum.
typedef struct sign_changes {
  ints level, septum;
} sign_changes;

INLINE sign_changes paint(const tissue_job *job, const tissue_gate *gate, uint32_t l) {
  const uint32_t n = job->lines, levels = LAYER_LEVELS + job->vessels + job->lesions;
  floats depth = field_at(job, l + PLANE_DEPTH * n), fat = field_at(job, l + PLANE_FAT * n);
  floats muscle = field_at(job, l + PLANE_MUSCLE * n);
  floats across = field_at(job, l + PLANE_ACROSS * n), up = field_at(job, l + PLANE_UP * n);
  floats theta = field_at(job, l + PLANE_THETA * n), s = field_at(job, l + PLANE_S * n);
  floats level[MOST_LEVELS];
  level[0] = depth, level[1] = depth - fat, level[2] = depth - muscle;
  level[3] =
      field_at(job, l + PLANE_BONE * n) + (job->bone_radius_m - vsqrt(across * across + up * up));
  const uint32_t map = l + map_field_at(job->vessels, job->lesions, 0) * n;
  level[4] = job->cells > 0 ? field_at(job, map) : vset(-1);
  floats *wall = level + LAYER_LEVELS, *edge = wall + job->vessels;
  tissue_point point = {(knots *)(void *)(job->memory + (size_t)l * KNOT_FLOATS * TEXTURES),
                        gate,
                        map,
                        theta,
                        s,
                        depth,
                        vset(1),
                        vset(0)};
  // Depth grows along a line with the cosine between line and normal.
  if (job->rows_per_m > 0)
    point.facing = vmin(vabs(depth - vload(job->before + l)) * job->rows_per_m, vset(1));
  for (uint32_t v = 0; v < job->vessels; ++v) wall[v] = vset(1);
  for (uint32_t i = 0; i < gate->vessels; ++i) {
    const uint32_t v = gate->vessel[i], at = l + vessel_field_at(v, VESSEL_SHORT) * n;
    wall[v] = wall_distance(field_at(job, at), field_at(job, at + VESSEL_LONG * n),
                            field_at(job, at + VESSEL_HALF_SHORT * n),
                            field_at(job, at + VESSEL_HALF_LONG * n));
    if (job->vessel[v].sheath_m > 0) {
      floats share = (job->vessel[v].wall_m + job->vessel[v].sheath_m - wall[v]) * 1000;
      point.sheath = vmax(point.sheath, vmin(share, vset(1)));
    }
  }
  floats tissue[2] = {vset(skin_tissue[0]), vset(skin_tissue[1])};
  septum lobule = {vset(1), vset(0)};
  const bool shown = vany((level[0] >= 0) & (level[3] <= 0)); // neither air nor bone
  if (shown) layers(job, &point, level, &lobule, tissue);
  vstore(job->septum + l, lobule.away), vstore(job->septum_size + l, lobule.size);
  if (shown) bodies(job, &point, tissue);
  for (uint32_t k = 0; k < job->lesions; ++k) {
    const uint32_t at = l + lesion_field_at(job->vessels, k, 0) * n;
    floats q[3] = {field_at(job, at), field_at(job, at + n), field_at(job, at + 2 * n)};
    edge[k] = lesion_distance(&job->lesion[k], q);
    lesion(&job->lesion[k], point.memory, q, edge[k], theta, s, depth, tissue);
  }
  if (shown) vessels(job, &point, l, wall, tissue);
  mark(level[3] > 0, vset(bone_tissue[0]), bone_tissue[1], tissue);
  mark(level[0] < 0, vset(0), outside_loss, tissue);
  vstore(job->scatter + l, tissue[0]), vstore(job->loss + l, tissue[1]);
  vstore(job->rough + l, periosteum(job, level[3], vload(job->before + 3 * n + l)));
  ints changed = vset_ints(0);
  ints parted = (lobule.size > 0) & ((lobule.away < 0) ^ (vload(job->septum_before + l) < 0));
  for (uint32_t k = 0; k < levels; ++k) {
    floats last = vload(job->before + k * n + l);
    changed |= (level[k] < 0) ^ (last < 0);
    if (k == 2) changed |= (level[k] > 0) & (last < 2 * fascia_sheet_m[FASCIA_SHEETS - 1]);
    vstore(job->level + k * n + l, level[k]);
  }
  for (uint32_t i = 0; i < gate->vessels; ++i) {
    const uint32_t v = gate->vessel[i];
    const float thick = job->vessel[v].wall_m;
    changed |= (wall[v] < thick) ^ (vload(job->before + (LAYER_LEVELS + v) * n + l) < thick);
  }
  return (sign_changes){changed, parted};
}

static void tissue(const tissue_job *job) {
  for (uint32_t l = 0; l < job->lines; l += ECHO_ALIGN) {
    const uint32_t block = l / ECHO_ALIGN;
    uint32_t crossed = 0, parted = 0;
    for (uint32_t k = 0; k < ECHO_ALIGN; k += FLOATS) {
      const sign_changes at = paint(job, &job->gate[block], l + k);
      crossed |= (uint32_t)vbits(at.level) << k, parted |= (uint32_t)vbits(at.septum) << k;
    }
    job->crossed[block] = (uint16_t)crossed, job->parted[block] = (uint16_t)parted;
  }
}

#endif
