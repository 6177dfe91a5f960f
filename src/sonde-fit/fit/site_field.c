// Fields of the nodes interpolated between sites, and their roughness.
#include "fit/site_field.h"

#include "base/maths.h"
#include "base/order.h"
#include "tissue/model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double NEIGHBOUR_REACH = 1.75; // site spacings
static const double SLOPE_RIDGE = 1e-3;     // keeps a plane through a line or one point defined

sonde_status sonde_site_basis(const sonde_model *model, const sonde_site_table *sites,
                              double *basis, sonde_error *error) {
  uint32_t nodes = model->surface.vertex_count, count = sites->count;
  sonde_model shadow = *model; // borrows the mesh; own sites and fields
  shadow.site_count = count;
  shadow.sites = SONDE_NEW(sonde_site, count);
  shadow.k0_n_m3 = SONDE_NEW(double, nodes);
  shadow.xm_m = SONDE_NEW(double, nodes);
  shadow.shear_share = SONDE_NEW(double, nodes);
  shadow.limit_share = SONDE_NEW(double, nodes);
  sonde_status status = SONDE_OK;
  if (!shadow.sites || !shadow.k0_n_m3 || !shadow.xm_m || !shadow.shear_share ||
      !shadow.limit_share)
    status = sonde_fail_memory(error);
  if (!status) memcpy(shadow.sites, sites->sites, count * sizeof *shadow.sites);
  for (uint32_t s = 0; s < count && !status; s += 2) {
    uint32_t t = s + 1 < count ? s + 1 : s;
    for (uint32_t k = 0; k < count; ++k) {
      shadow.sites[k].k0_n_m3 = k == s ? exp(1.0) : 1.0;
      shadow.sites[k].xm_m = k == t ? exp(1.0) : 1.0;
    }
    status = sonde_model_interpolate(&shadow, error);
    for (uint32_t i = 0; i < nodes && !status; ++i) {
      SONDE_ASSERT(shadow.k0_n_m3[i] > 0 && shadow.xm_m[i] > 0);
      basis[(size_t)i * count + s] = log(shadow.k0_n_m3[i]);
      basis[(size_t)i * count + t] = log(shadow.xm_m[i]);
    }
  }
  sonde_free(shadow.sites);
  sonde_free(shadow.k0_n_m3);
  sonde_free(shadow.xm_m);
  sonde_free(shadow.shear_share);
  sonde_free(shadow.limit_share);
  return status;
}

typedef struct neighbour {
  double weight, u, v; // place in the site's axes, in spacings
} neighbour;

static neighbour neighbour_of(const sonde_site *site, const sonde_site *other, double spacing_m) {
  sonde_vec3 d = v_scale(v_sub(other->position_m, site->position_m), 1.0 / spacing_m);
  double distance = v_norm(d) / NEIGHBOUR_REACH;
  if (!(distance < 1)) return (neighbour){0};
  double fade = 1 - distance * distance;
  return (neighbour){fade * fade, v_dot(d, site->u), v_dot(d, site->v)};
}

sonde_status sonde_site_roughness(const sonde_site_table *sites, double *rows, sonde_error *error) {
  SONDE_ASSERT(sites->count > 0);
  double *nearest = SONDE_NEW(double, sites->count);
  if (!nearest) return sonde_fail_memory(error);
  // The spacing is the median distance between a site and its nearest neighbour.
  for (uint32_t s = 0; s < sites->count; ++s) {
    nearest[s] = INFINITY;
    for (uint32_t t = 0; t < sites->count; ++t)
      if (t != s)
        nearest[s] =
            fmin(nearest[s], v_distance(sites->sites[s].position_m, sites->sites[t].position_m));
  }
  qsort(nearest, sites->count, sizeof *nearest, sonde_compare_reals);
  double spacing_m = nearest[sites->count / 2];
  for (uint32_t s = 0; s < sites->count; ++s) {
    if (sites->count > 1 && spacing_m > 0) {
      // Row of a site: 1 for itself, minus the weights with which its neighbours predict it.
      double *row = &rows[(size_t)s * sites->count];
      const sonde_site *site = &sites->sites[s];
      double m[6] = {0}, total = 0;
      for (uint32_t t = 0; t < sites->count; ++t) {
        if (t == s) continue;
        neighbour n = neighbour_of(site, &sites->sites[t], spacing_m);
        m[0] += n.weight;
        m[1] += n.weight * n.u;
        m[2] += n.weight * n.v;
        m[3] += n.weight * n.u * n.u;
        m[4] += n.weight * n.u * n.v;
        m[5] += n.weight * n.v * n.v;
      }
      memset(row, 0, sites->count * sizeof *row);
      if (m[0] > 0) {
        m[3] += SLOPE_RIDGE * m[0];
        m[5] += SLOPE_RIDGE * m[0];
        // The symmetric 3x3 system m x = (1, 0, 0) by Cramer's rule: cross products of its rows.
        sonde_vec3 a = vec3(m[0], m[1], m[2]), b = vec3(m[1], m[3], m[4]),
                   c = vec3(m[2], m[4], m[5]);
        sonde_vec3 cross = v_cross(b, c);
        double determinant = v_dot(a, cross);
        SONDE_ASSERT(determinant > 0);
        sonde_vec3 x = v_scale(cross, 1.0 / determinant);
        for (uint32_t t = 0; t < sites->count; ++t) {
          if (t == s) continue;
          neighbour n = neighbour_of(site, &sites->sites[t], spacing_m);
          row[t] = -n.weight * (x.x + x.y * n.u + x.z * n.v);
          total += row[t];
        }
        SONDE_ASSERT(fabs(total + 1) < 1e-6);
        row[s] = -total;
      }
    }
  }
  sonde_free(nearest);
  return SONDE_OK;
}
