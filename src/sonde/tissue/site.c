// Poses of a probe at measured sites.
#include "sonde/tissue.h"

#include "base/base.h"
#include "base/maths.h"

// The probe's axes in world: z into the tissue, x along u made orthogonal to it, y = z cross x.
sonde_pose sonde_site_pose(const sonde_site *site, double depth_m) {
  SONDE_ASSERT(site != NULL);
  sonde_vec3 z = v_neg(v_unit(site->normal, vec3(0, 0, 1)));
  sonde_vec3 spare = fabs(z.x) < 0.9 ? vec3(1, 0, 0) : vec3(0, 1, 0);
  sonde_vec3 fallback = v_unit(v_madd(spare, -v_dot(spare, z), z), spare);
  sonde_vec3 x = v_unit(v_madd(site->u, -v_dot(site->u, z), z), fallback);
  sonde_mat3 axes = m_columns(x, v_cross(z, x), z);
  return (sonde_pose){v_madd(site->position_m, depth_m, z), q_from_matrix(axes)};
}
