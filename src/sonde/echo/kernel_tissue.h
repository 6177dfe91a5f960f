// Tissue along one row of the march: labels, backscatter, attenuation, signed distances to the
// interfaces, textures in tissue coordinates. Included by kernel.c only.
//
// wall_distance        signed distance to a vessel's inner wall
// lesion_distance, lesion  node, cyst, haematoma
// clot_surface, clot_grain  a clot's free surface and unevenness
// vessels            walls, lumina, clots
// layers             skin, fat, muscle
// periosteum         the cortex's roughness
// paint              one vector of lines
#ifndef SONDE_SRC_ECHO_KERNEL_TISSUE_H
#define SONDE_SRC_ECHO_KERNEL_TISSUE_H

#include "echo/kernel.h"
#include "echo/kernel_texture.h"
#include "interior/clot.h"

// Backscatter over muscle (amplitude) and attenuation (dB/m/MHz one way); docs/echo.md.
static const float skin_tissue[2] = {2.2f, 100}, fat_tissue[2] = {0.40f, 50},
                   muscle_tissue[2] = {0.85f, 100}, wall_tissue[2] = {1.9f, 110},
                   blood_tissue[2] = {0.06f, 18}, bone_tissue[2] = {0.02f, 200};
static const float rough_tangent = 0.4f; // angle at which fewer facets by 1/e look at the probe
static const float outside_loss = 0.2f;
static const float node_loss = 60, haematoma_loss = 45, fluid_tissue[2] = {0.006f, 5};
static const float capsule_m = 0.3e-3f, capsule_scatter = 1.4f, hilum_scatter = 1.2f;

// Signed distance over the row, metres (negative inside): to first order (F - 1)/|grad F| of the
// ellipse F = 1.
INLINE vf wall_distance(vf a, vf b, vf half_a, vf half_b) {
  vf square = a * a + b * b, size = root(square);
  vf ga = a / half_a, gb = b / half_b, steep = root(ga * ga + gb * gb);
  vf distance = pick(steep > 1e-3f, (size - 1) * size / larger(steep, all(1e-3f)), -half_a);
  vf beyond = (size_of(b) - 1) * half_b; // bounds the estimate beside a flat ellipse's tips
  distance = pick((beyond > 0) & (beyond > distance), beyond, distance);
  return pick(square > 400, all(1), distance);
}

// sonde_clot_surface() for a vector of places.
INLINE vf clot_surface(uint32_t vessel, vf along, vf across) {
  vf sum = clot_bend * (clot_level - across * across), c, s;
  for (uint32_t k = 0; k < CLOT_WAVES; ++k) {
    const clot_wave *w = &clot_waves[k];
    vf turns = w->across * across + w->per_m * along + sonde_clot_start(vessel, k);
    turn(turns - below(turns), &c, &s);
    sum += w->height * c;
  }
  return sum;
}

// Unevenness of a clot, dB: lumps of 2 mm and finer grain, and the layers in which it grew.
INLINE vf clot_grain(const tissue_vessel *it, knots *memory, vf theta, vf s, vf depth, vf inward) {
  vf lump = texture(memory, theta, s * 400, depth * 600, 4 * TURNS_MUSCLE, 13);
  vf layer = sheet(inward * 2.2f + 0.6f * lump, 0.6f);
  return it->lumps_db * lump + it->layers_db * (layer - 0.3f);
}

INLINE void mark(vi mask, vf scatter, float loss, vf out[2]) {
  out[0] = pick(mask, scatter, out[0]), out[1] = pick(mask, all(loss), out[1]);
}

INLINE void mark_both(vi mask, vf scatter, vf loss, vf out[2]) {
  out[0] = pick(mask, scatter, out[0]), out[1] = pick(mask, loss, out[1]);
}

// Layer by layer; levels 1 and 2 are the depths below dermis and fascia.
INLINE void layers(const tissue_job *job, knots *memory, const vf *level, vf theta, vf s, vf depth,
                   vf out[2]) {
  vi in_fat = (level[1] >= 0) & (level[2] < 0), in_muscle = (level[1] >= 0) & (level[2] >= 0);
  vf fat_scatter = all(fat_tissue[0]), muscle_scatter = all(job->plain ? 1 : muscle_tissue[0]);
  vf fat_loss = all(fat_tissue[1]);
  if (!job->plain && any(in_fat)) fat_scatter += 2.2f * septa(memory, theta, s, depth);
  if (job->oedema > 0 && any(in_fat)) {
    vf fluid = clefts(memory, theta, s, depth, job->oedema);
    fat_scatter = (fat_scatter * (1 + job->oedema)) * (1 - fluid) + fluid_tissue[0] * fluid;
    fat_loss += fluid * (fluid_tissue[1] - fat_loss);
  }
  if (!job->plain && any(in_muscle))
    muscle_scatter = muscle_scatter * power2(bundles(memory, theta, s, depth) * 0.16609640474f);
  vi sheath = (level[1] >= 0) & (size_of(level[2]) < 0.7e-3f);
  if (!job->plain && any(sheath)) {
    vf more = fascia(memory, theta, s, level[2]);
    fat_scatter += more, muscle_scatter += more;
  }
  mark_both(in_fat, fat_scatter, fat_loss, out);
  mark(in_muscle, muscle_scatter, muscle_tissue[1], out);
}

// Signed distance to the ellipsoid |q| = 1, m, to first order.
INLINE vf lesion_distance(const tissue_lesion *lesion, const vf q[3]) {
  vf square = all(0), steep = all(0);
  for (int k = 0; k < 3; ++k) {
    vf g = q[k] * lesion->per_half[k];
    square += q[k] * q[k], steep += g * g;
  }
  vf size = root(square);
  return (size - 1) * size / larger(root(steep), all(1));
}

// Rim and hilum, fluid, or clotted and liquid parts; a thin capsule.
INLINE void lesion(const tissue_lesion *it, knots *memory, const vf q[3], vf away, vf theta, vf s,
                   vf depth, vf out[2]) {
  vi in = away < 0;
  if (!any(away < capsule_m)) return;
  if (it->kind != TISSUE_HAEMATOMA)
    mark_both((away >= 0) & (away < capsule_m), all(capsule_scatter), out[1], out);
  if (it->kind == TISSUE_CYST) {
    mark(in, larger(all(it->scatter), all(fluid_tissue[0])), fluid_tissue[1], out);
    return;
  }
  vf grain = texture(memory, theta, s * 400, depth * 500, 4 * TURNS_MUSCLE, 11);
  vf scatter = it->scatter * (1 + 0.3f * grain);
  if (it->kind == TISSUE_NODE) {
    vf hilum = q[0] * q[0] * 7 + q[1] * q[1] * 7 + q[2] * q[2] * 2 + 0.4f * grain;
    vf share = smooth(smaller(larger((1.2f - hilum) * 2, all(0)), all(1)));
    mark(in, scatter + share * (hilum_scatter - scatter), node_loss, out);
    return;
  }
  vf lump = texture(memory, theta, s * 150, depth * 200, 2 * TURNS_MUSCLE, 12) + 0.5f * grain;
  vf liquid = smooth(smaller(larger(0.1f - 3 * lump, all(0)), all(1)));
  mark(in, scatter * power2(1.5f * lump) * (1 - liquid) + fluid_tissue[0] * liquid, haematoma_loss,
       out);
}

// Walls hide lesions, lumina walls: branches begin in the lumen of their parents. Clot last.
INLINE void vessels(const tissue_job *job, knots *memory, const float *f, const vf *level,
                    vf out[2]) {
  const uint32_t n = job->lines;
  for (uint32_t v = job->vessels; v-- > 0;) {
    mark(level[v] < job->vessel[v].wall_m, all(wall_tissue[0]), wall_tissue[1], out);
    mark(level[v] <= 0, all(blood_tissue[0]), blood_tissue[1], out);
  }
  for (uint32_t v = 2; v < job->vessels; ++v)
    mark(level[v] <= 0, all(blood_tissue[0]), blood_tissue[1], out);
  for (uint32_t v = 0; v < job->vessels; ++v) {
    const tissue_vessel *it = &job->vessel[v];
    if (!(it->clot_fraction > 0)) continue;
    const float *at = f + vessel_field_at(v, VESSEL_SHORT) * n;
    vi clot = (level[v] <= 0) & (load(at + VESSEL_CLOT * n) >= 0.5f);
    vf theta = load(f + PLANE_THETA * n), s = load(f + PLANE_S * n),
       depth = load(f + PLANE_DEPTH * n);
    if (!any(clot)) continue;
    if (it->clot_fraction < 1)
      clot &= -load(at) > 1 - 2 * it->clot_fraction + clot_surface(it->number, s, load(at + n));
    vf scatter = all(it->clot_scatter);
    if (!job->plain)
      scatter =
          scatter * power2(clot_grain(it, memory, theta, s, depth, load(at)) * 0.16609640474f);
    if (v == 0 && job->webs > 0 && any(clot))
      scatter =
          scatter * (1 - 0.6f * job->webs) + job->webs * webs(memory, theta, s, depth, load(at));
    mark(clot, scatter, it->clot_loss, out);
  }
}

// Facets of the cortex scatter towards the probe; the fewer, the more the cortex is inclined. The
// distance to it grows along a line with the cosine of the angle between line and normal.
INLINE vf periosteum(const tissue_job *job, vf inside, vf before) {
  vf away = size_of(inside);
  vi near = away < job->rough_m;
  if (!any(near)) return all(0);
  vf cosine = smaller(larger((inside - before) * job->rows_per_m, all(0.05f)), all(1));
  vf square = 1 / (cosine * cosine) - 1;                              // of the tangent
  vf fewer = square * (-1.442695f / (rough_tangent * rough_tangent)); // octaves
  vf size = power2(larger(fewer, all(-60)));
  return only(near, job->rough_bone * size * (1 - away / job->rough_m));
}

// Returns the lanes in which a level changed sign since the row above.
INLINE vi paint(const tissue_job *job, uint32_t l) {
  const float *f = job->row + l;
  knots *memory = (knots *)(void *)(job->memory + (size_t)l * KNOT_FLOATS * TEXTURES);
  const uint32_t n = job->lines, levels = LAYER_LEVELS + job->vessels + job->lesions;
  vf depth = load(f + PLANE_DEPTH * n), fat = load(f + PLANE_FAT * n);
  vf muscle = load(f + PLANE_MUSCLE * n);
  vf across = load(f + PLANE_ACROSS * n), up = load(f + PLANE_UP * n);
  vf theta = load(f + PLANE_THETA * n), s = load(f + PLANE_S * n), level[MOST_LEVELS];
  level[0] = depth, level[1] = depth - fat, level[2] = depth - muscle;
  level[3] = job->bone_radius_m - root(across * across + up * up);
  vf *wall = level + LAYER_LEVELS, *edge = wall + job->vessels;
  for (uint32_t v = 0; v < job->vessels; ++v) {
    const float *at = f + vessel_field_at(v, VESSEL_SHORT) * n, *half = at + VESSEL_HALF_SHORT * n;
    wall[v] = wall_distance(load(at), load(at + n), load(half), load(half + n));
  }
  vf tissue[2] = {all(skin_tissue[0]), all(skin_tissue[1])};
  layers(job, memory, level, theta, s, depth, tissue);
  for (uint32_t k = 0; k < job->lesions; ++k) {
    const float *at = f + lesion_field_at(job->vessels, k, 0) * n;
    vf q[3] = {load(at), load(at + n), load(at + 2 * n)};
    edge[k] = lesion_distance(&job->lesion[k], q);
    lesion(&job->lesion[k], memory, q, edge[k], theta, s, depth, tissue);
  }
  vessels(job, memory, f, wall, tissue);
  mark(level[3] > 0, all(bone_tissue[0]), bone_tissue[1], tissue);
  mark(level[0] < 0, all(0), outside_loss, tissue);
  store(job->scatter + l, tissue[0]), store(job->loss + l, tissue[1]);
  store(job->rough + l, periosteum(job, level[3], load(job->before + 3 * n + l)));
  vi changed = all_of(0);
  for (uint32_t k = 0; k < levels; ++k) {
    changed |= (level[k] < 0) ^ (load(job->before + k * n + l) < 0);
    store(job->level + k * n + l, level[k]);
  }
  return changed;
}

static void tissue(const tissue_job *job) {
  for (uint32_t l = 0; l < job->lines; l += ECHO_ALIGN) {
    bool crossed = false;
    for (uint32_t k = 0; k < ECHO_ALIGN; k += W) crossed = any(paint(job, l + k)) || crossed;
    job->crossed[l / ECHO_ALIGN] = crossed;
  }
}

#endif
