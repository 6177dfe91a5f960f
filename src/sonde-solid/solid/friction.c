// Friction of the zone's points from one pose to the next.
#include "base/base.h"
#include "equilibrium.h"

void sonde_friction_look(sonde_equilibrium *e, sonde_pose pose, const sonde_vec3 *u,
                         const double *v, sonde_friction_look_kind kind) {
  const sonde_mat3 back = m_transpose(q_matrix(pose.rotation));
  const double stiffness = e->def.contact_n_m3;
  for (uint32_t n = 0; n < e->zone_faces && e->stick; ++n) {
    sonde_vec3 rest[4], now[4];
    sonde_equilibrium_zone_face(e, u, v, n, rest, now);
    for (int p = 0; p < SONDE_TOUCH_POINTS; ++p) {
      sonde_stick *stick = &e->stick[SONDE_TOUCH_POINTS * n + (uint32_t)p];
      sonde_vec3 x = v_scale(pose.position, -1);
      sonde_mat3 bend;
      double shape[4], depth;
      (void)sonde_touch_point(rest, p, shape);
      for (int c = 0; c < 4; ++c) x = v_madd(x, shape[c], now[c]);
      x = m_mul_v(back, x);
      const bool in = sonde_touch_depth(&e->shape, x, 0, &depth, &stick->out, &bend);
      stick->limit_pa = in ? e->def.friction * stiffness * depth : 0;
      if (kind == SONDE_FRICTION_PRESSURE) continue;
      // Skin that slips takes its foothold along; the foothold of free skin is where the skin is.
      const sonde_vec3 pull = sonde_stick_pull(stick, x);
      const double way = v_norm(pull), most = stick->limit_pa / stiffness;
      const double share = kind == SONDE_FRICTION_FORGET || !in ? 0 : way > most ? most / way : 1;
      stick->foothold = v_madd(x, -share, pull);
    }
  }
}
