// The ring of a leg around a site, along the columns that the interior has from the bone to the
// skin.
#include "grid.h"

#include "base/base.h"
#include "interior/interior.h"

enum { ARC_PARTS = 720 };
static const double least_skin_m = 0.4e-3, least_fat_m = 1e-3, least_muscle_m = 2e-3;

typedef struct ring {
  const sonde_interior *in;
  double theta[SONDE_LINES_MOST]; // of the u lines
  sonde_lines u, v;               // ways from the site: round the leg, along its axis
  double s, slope;                // of the site; way along the axis per way round on its u axis
  double half_u, half_v, far_u, far_v; // the slope ends between footprint and far side
} ring;

static sonde_vec3 place_in_ring(const void *user, double level, uint32_t u, uint32_t v) {
  const ring *r = user;
  // Rows run along the footprint's axis, which may lean against the leg's section.
  const double lean = r->slope * r->u.at[u] *
                      smooth_step((r->far_u - fabs(r->u.at[u])) / (r->far_u - r->half_u)) *
                      smooth_step((r->far_v - fabs(r->v.at[v])) / (r->far_v - r->half_v));
  const double theta = r->theta[u], s = r->s + r->v.at[v] + lean;
  sonde_column_point at;
  sonde_interior_column(r->in, theta, s, &at);
  // Depths along the column; what is too thin for a hexahedron takes from the muscle.
  const double skin = fmax(at.fat_m / at.cosine, least_skin_m), all = at.radius_m - at.bone_m;
  const double muscle = fmin(fmax(at.muscle_m / at.cosine, skin + least_fat_m),
                             fmax(all - least_muscle_m, 0.6 * all));
  const double radius[4] = {at.bone_m, at.radius_m - muscle, at.radius_m - fmin(skin, 0.5 * muscle),
                            at.radius_m};
  const uint32_t below = level < 2 ? (uint32_t)level : 2;
  const double t = level - below, x = (1 - t) * radius[below] + t * radius[below + 1];
  const sonde_bend bend = sonde_bend_at(r->in, s);
  sonde_vec3 p = v_madd(r->in->origin, s, r->in->axis);
  p = v_madd(p, bend.x + x * cos(theta), r->in->e1);
  return v_madd(p, bend.y + x * sin(theta), r->in->e2);
}

sonde_status sonde_hexes_ring_check(const sonde_model *model, sonde_error *error) {
  if (model->femur.face_count == 0)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "the model has no bone that could hold the hyperelastic solid");
  if (model->edge_share != NULL)
    return sonde_fail(error, SONDE_ARGUMENT,
                      "the model's skin is cut, which the hyperelastic solid's cannot be");
  return SONDE_OK;
}

sonde_status sonde_hexes_ring(const sonde_model *model, const sonde_site *site,
                              const sonde_hexes_def *def, sonde_hexes *mesh, sonde_error *error) {
  SONDE_ASSERT(model != NULL && site != NULL && mesh != NULL);
  sonde_interior *in = NULL;
  sonde_status status = sonde_hexes_ring_check(model, error);
  if (!status) status = sonde_interior_create(model, &in, error);
  if (!status) status = sonde_hexes_ring_of(in, site, def, mesh, error);
  sonde_interior_destroy(in);
  return status;
}

sonde_status sonde_hexes_ring_of(const sonde_interior *in, const sonde_site *site,
                                 const sonde_hexes_def *def, sonde_hexes *mesh,
                                 sonde_error *error) {
  sonde_status status = sonde_hexes_check(def, error);
  if (!status && (def->fat == 0 || def->skin == 0))
    status = sonde_fail(error, SONDE_ARGUMENT,
                        "a ring has fat and skin: expected at least one "
                        "hexahedron through each");
  if (status) return status;
  sonde_column_point at;
  ring r = {.in = in, .half_u = 0, .half_v = 0, .far_u = 1, .far_v = 1};
  if (!sonde_interior_locate(in, site->position_m, &at))
    return sonde_fail(error, SONDE_ARGUMENT, "site %u lies beyond the ends of the leg", site->id);

  // The skin's section: way along it from the site.
  double arc[ARC_PARTS + 1];
  r.s = at.s;
  sonde_vec3 before = {0};
  for (uint32_t i = 0; i <= ARC_PARTS; ++i) {
    r.theta[0] = at.theta - SONDE_PI + 2 * SONDE_PI * i / ARC_PARTS;
    sonde_vec3 p = place_in_ring(&r, 3, 0, 0);
    arc[i] = i ? arc[i - 1] + v_distance(p, before) : 0;
    before = p;
  }
  const double middle = arc[ARC_PARTS / 2];
  for (uint32_t i = 0; i <= ARC_PARTS; ++i) arc[i] -= middle;

  // Lines; the footprint's axes are those of the site.
  const bool along = fabs(v_dot(site->u, in->axis)) > fabs(v_dot(site->v, in->axis));
  const double half_u = along ? def->half_v_m : def->half_u_m;
  const double half_v = along ? def->half_u_m : def->half_v_m;
  const double down = fmin(def->reach_m, at.s - in->s_low_m);
  const double up = fmin(def->reach_m, in->s_high_m - at.s);
  const sonde_vec3 spoke = v_madd(v_scale(in->e1, cos(at.theta)), sin(at.theta), in->e2);
  const sonde_vec3 round = v_cross(in->axis, spoke), across = along ? site->v : site->u;
  r.slope = clamp(v_dot(across, in->axis) / v_dot(across, round), -0.5, 0.5);
  r.half_u = half_u, r.half_v = half_v;
  r.far_u = fmin(arc[ARC_PARTS], -arc[0]), r.far_v = fmin(down, up);
  status = sonde_lines_make(def, half_u, -arc[0], arc[ARC_PARTS], &r.u, error);
  if (!status) status = sonde_lines_make(def, half_v, down, up, &r.v, error);
  if (!status) {
    for (uint32_t k = 0; k + 1 < r.u.count; ++k) {
      uint32_t i = 0;
      while (i + 2 <= ARC_PARTS && arc[i + 1] < r.u.at[k]) ++i;
      const double t = (r.u.at[k] - arc[i]) / (arc[i + 1] - arc[i]);
      r.theta[k] = at.theta - SONDE_PI + 2 * SONDE_PI * (i + t) / ARC_PARTS;
    }
    sonde_levels levels;
    sonde_levels_make(def->muscle, def->fat, def->skin, &levels);
    const sonde_grid_shape shape = {.levels = &levels,
                                    .u_count = r.u.count - 1,
                                    .v_count = r.v.count,
                                    .around = true,
                                    .place = place_in_ring,
                                    .user = &r};
    status = sonde_hexes_bend(&shape, mesh, error);
    // The ends stay in their planes, but for the tilt of the axis.
    const double x = fabs(in->axis.x), y = fabs(in->axis.y), z = fabs(in->axis.z);
    const uint8_t bit = z >= x && z >= y ? 4 : y >= x ? 2 : 1;
    for (uint32_t n = 0; n < mesh->node_count && !status; ++n)
      if (n % r.v.count == 0 || n % r.v.count == r.v.count - 1) mesh->held[n] |= bit;
  }
  return status;
}
