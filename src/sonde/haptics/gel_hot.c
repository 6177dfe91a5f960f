// The gel film: what moves it and what it does.
//
// Thin-film flow between the nodes of the skin (Reynolds): across an edge of length L and width w
// goes
//   q = w (h^3/(12 eta) (P_i - P_j)/L + h U.e/2),
// P the pressure of the probe and of the film's own weight, U the probe's velocity where it
// touches, h the film of the node that gives. Volume only changes hands; no node gives more than a
// sixteenth of what it has per edge and step, so that films stay positive and rough steps stay
// stable.
#include "base/base.h"
#include "base/maths.h"
#include "geometry/triangle.h"
#include "haptics/gel.h"

static const double weight_pa_m = 1e4; // density times gravity
static const double least_m = 1e-9;    // a film of molecules does not flow
static const double reach_m = 4e-3;    // gel fills half of that between face and skin, not all

void sonde_gel_put(sonde_gel *gel, sonde_vec3 centre_m, double radius_m, double volume_m3) {
  SONDE_ASSERT(radius_m >= 0.0 && volume_m3 >= 0.0 && v_finite(centre_m));
  const sonde_model *model = gel->model;
  const sonde_vec3 *skin_m = model->surface.vertices;
  uint32_t count = model->surface.vertex_count;
  double area = 0.0;
  for (uint32_t i = 0; i < count; ++i)
    if (v_distance(skin_m[i], centre_m) <= radius_m) area += model->area_m2[i];
  if (!(area > 0.0)) {
    uint32_t nearest = v_nearest(skin_m, count, centre_m);
    gel->film_m[nearest] += volume_m3 / model->area_m2[nearest];
    return;
  }
  for (uint32_t i = 0; i < count; ++i)
    if (v_distance(skin_m[i], centre_m) <= radius_m) gel->film_m[i] += volume_m3 / area;
}

void sonde_gel_wipe(sonde_gel *gel) {
  SONDE_ASSERT(gel != NULL);
  for (uint32_t i = 0; i < gel->model->surface.vertex_count; ++i)
    gel->film_m[i] = gel->moisture[i] = 0.0;
}

// Volume in dt_s, nothing where no film is on either side. Both sides are read before either is
// chosen: which one gives is a coin toss that no processor foresees.
static double flow(const sonde_gel *gel, sonde_vec3 probe_m_s, uint32_t edge, double dt_s) {
  const sonde_model *model = gel->model;
  uint32_t i = model->topology.edges[edge][0], j = model->topology.edges[edge][1];
  double hi = gel->film_m[i], hj = gel->film_m[j], pi = gel->push_pa[i], pj = gel->push_pa[j];
  double vi = hi * model->area_m2[i], vj = hj * model->area_m2[j];
  if (!(hi + hj > least_m)) return 0.0;
  double steep = pi - pj + weight_pa_m * (hi - hj);
  double film = steep >= 0.0 ? hi : hj;
  double rate = film * film * film * gel->drag[edge] * steep;
  if (pi + pj > 0.0) {
    sonde_vec3 along = v_sub(model->surface.vertices[j], model->surface.vertices[i]);
    double drift = gel->half_m[edge] * v_dot(probe_m_s, along);
    rate += drift * (drift >= 0.0 ? hi : hj);
  }
  double most = (rate >= 0.0 ? vi : vj) * (1.0 / 16.0), volume = rate * dt_s;
  return volume > most ? most : volume < -most ? -most : volume;
}

void sonde_gel_part(sonde_gel *gel, const sonde_vec3 *contact_n, sonde_vec3 probe_m_s, double dt_s,
                    uint32_t part, uint32_t parts) {
  SONDE_ASSERT(contact_n != NULL && dt_s > 0.0 && v_finite(probe_m_s) && part < parts);
  const sonde_topology *topology = &gel->model->topology;
  if (part == 0) {
    // The pressures before the flow are those of the probe.
    for (uint32_t i = 0; i < gel->model->surface.vertex_count; ++i) {
      double n2 = v_norm2(contact_n[i]);
      gel->push_pa[i] = n2 > 0.0 ? sqrt(n2) / gel->model->area_m2[i] : 0.0;
      gel->change_m3[i] = 0.0;
    }
  }
  uint32_t from = (uint32_t)((uint64_t)topology->edge_count * part / parts);
  uint32_t to = (uint32_t)((uint64_t)topology->edge_count * (part + 1) / parts);
  for (uint32_t e = from; e < to; ++e) {
    double volume = flow(gel, probe_m_s, e, dt_s);
    gel->change_m3[topology->edges[e][0]] -= volume;
    gel->change_m3[topology->edges[e][1]] += volume;
  }
  if (part + 1 < parts) return;
  for (uint32_t i = 0; i < gel->model->surface.vertex_count; ++i)
    if (gel->change_m3[i] < 0.0 || gel->change_m3[i] > 0.0)
      gel->film_m[i] = fmax(gel->film_m[i] + gel->change_m3[i] / gel->model->area_m2[i], 0.0);
  // Films lose gel to the air; skin that loses its film stays moist for a while.
  double decay = exp(-dt_s / gel->def.moist_s), loss = gel->def.drying_m_s * dt_s;
  for (uint32_t i = 0; i < gel->model->surface.vertex_count; ++i) {
    gel->film_m[i] = fmax(gel->film_m[i] - loss, 0.0);
    gel->moisture[i] = gel->film_m[i] > 0.0 ? 1.0 : gel->moisture[i] * decay;
  }
}

void sonde_gel_step(sonde_gel *gel, const sonde_vec3 *contact_n, sonde_vec3 probe_m_s,
                    double dt_s) {
  sonde_gel_part(gel, contact_n, probe_m_s, dt_s, 0, 1);
}

// The coefficient is linear in e^-film, so that its mean under the probe is the mean of that.
sonde_friction sonde_gel_friction(const sonde_gel *gel, const sonde_vec3 *contact_n,
                                  const sonde_friction *base) {
  SONDE_ASSERT(contact_n != NULL && base != NULL);
  double force = 0.0, bare = 0.0, moist = 0.0;
  for (uint32_t i = 0; i < gel->model->surface.vertex_count; ++i) {
    double n = v_norm(contact_n[i]);
    if (!(n > 0.0)) continue;
    double share = exp(-gel->film_m[i] / gel->def.lubricating_m);
    force += n;
    bare += n * share;
    moist += n * share * gel->moisture[i];
  }
  sonde_friction friction = *base;
  if (!(force > 0.0)) return friction;
  friction.gel_film = -log(fmax(bare / force, 1e-12));
  double stickier = 1.0 + gel->def.moist_stickiness * moist / fmax(bare, 1e-300);
  friction.mu_static *= stickier;
  friction.mu_kinetic *= stickier;
  return friction;
}

// What sonde_gel_coupling_of() looks at.
typedef struct look {
  const sonde_gel *gel;
  const double *film_m;
  const sonde_vec3 *skin_m, *contact_n;
} look;

static bool touches(const look *at, uint32_t node) { return v_norm2(at->contact_n[node]) > 0.0; }

// Share of sound at the place nearest to a point on the faces around a node.
static double share_around(const look *at, uint32_t node, sonde_vec3 point_m) {
  const sonde_topology *topology = &at->gel->model->topology;
  double nearest2 = INFINITY, share = 0.0;
  for (uint32_t k = topology->face_start[node]; k < topology->face_start[node + 1]; ++k) {
    const uint32_t *corner = at->gel->model->surface.faces[topology->face_list[k]];
    const sonde_vec3 *x = at->skin_m;
    double weight[3];
    sonde_triangle_closest(point_m, x[corner[0]], x[corner[1]], x[corner[2]], weight);
    sonde_vec3 gap = v_sub(v_scale(x[corner[0]], weight[0]), point_m);
    gap = v_madd(v_madd(gap, weight[1], x[corner[1]]), weight[2], x[corner[2]]);
    double gap2 = v_norm2(gap);
    if (gap2 >= nearest2) continue;
    nearest2 = gap2;
    // Skin ends its touch halfway from a node that touches to one that does not.
    double touching = 0.0, sum = 0.0;
    for (int c = 0; c < 3; ++c) {
      if (!touches(at, corner[c])) continue;
      touching += weight[c];
      sum += weight[c] * -expm1(-at->film_m[corner[c]] / at->gel->def.lubricating_m);
    }
    share = touching > 0.5 ? sum / touching : 2.0 * sum;
  }
  return share * fmax(fmin(2.0 * (1.0 - sqrt(nearest2) / reach_m), 1.0), 0.0);
}

void sonde_gel_coupling_of(const sonde_gel *gel, const double *film_m, uint32_t *near,
                           const sonde_vec3 *skin_m, const sonde_vec3 *contact_n,
                           const sonde_vec3 *point_m, uint32_t count, float *share) {
  SONDE_ASSERT(skin_m != NULL && contact_n != NULL && (count == 0 || (point_m && share)));
  const look at = {gel, film_m, skin_m, contact_n};
  // Nodes of the faces with a corner that touches are gathered once each: one beside several comes
  // with the first of them.
  const sonde_topology *topology = &gel->model->topology;
  uint32_t nodes = 0;
  for (uint32_t i = 0; i < topology->vertex_count; ++i) {
    if (!touches(&at, i)) continue;
    near[nodes++] = i;
    for (uint32_t k = topology->start[i]; k < topology->start[i + 1]; ++k) {
      uint32_t beside = topology->neighbour[k], first = topology->start[beside];
      if (touches(&at, beside)) continue;
      while (!touches(&at, topology->neighbour[first])) ++first;
      if (topology->neighbour[first] == i) near[nodes++] = beside;
    }
  }
  for (uint32_t k = 0; k < count; ++k) {
    double nearest2 = INFINITY;
    uint32_t node = 0;
    for (uint32_t t = 0; t < nodes; ++t) {
      double gap2 = v_norm2(v_sub(skin_m[near[t]], point_m[k]));
      if (gap2 < nearest2) nearest2 = gap2, node = near[t];
    }
    share[k] = nodes > 0 ? (float)share_around(&at, node, point_m[k]) : 0.0f;
  }
}

void sonde_gel_coupling(sonde_gel *gel, const sonde_vec3 *skin_m, const sonde_vec3 *contact_n,
                        const sonde_vec3 *point_m, uint32_t count, float *share) {
  sonde_gel_coupling_of(gel, gel->film_m, gel->near, skin_m, contact_n, point_m, count, share);
}

const double *sonde_gel_film(const sonde_gel *gel) { return gel->film_m; }

double sonde_gel_volume(const sonde_gel *gel) {
  SONDE_ASSERT(gel != NULL);
  double sum = 0.0;
  for (uint32_t i = 0; i < gel->model->surface.vertex_count; ++i)
    sum += gel->film_m[i] * gel->model->area_m2[i];
  return sum;
}
