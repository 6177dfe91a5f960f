// Set of differences {a - b} of two convex bodies in the frame of A, by its supports.
#ifndef SONDE_SRC_CONTACT_DIFFERENCE_H
#define SONDE_SRC_CONTACT_DIFFERENCE_H

#include "base/base.h"
#include "base/maths.h"
#include "geometry/internal.h"
#include "contact/contact.h"

typedef struct difference {
  const sonde_convex *a, *b;
  sonde_mat3 a_from_b, b_from_a;
  sonde_vec3 offset; // of b's origin in a's frame
  uint32_t last_a, last_b, work;
} difference;

static inline difference difference_make(const sonde_convex *a, sonde_pose world_from_a,
                                         const sonde_convex *b, sonde_pose world_from_b) {
  sonde_pose relative = pose_mul(pose_inverse(world_from_a), world_from_b);
  difference d = {.a = a, .b = b, .offset = relative.position};
  d.a_from_b = q_matrix(relative.rotation);
  d.b_from_a = m_transpose(d.a_from_b);
  return d;
}

// Farthest point of the set along a direction of A's frame; *on_a is the point of A in it.
static inline sonde_vec3 difference_support(difference *d, sonde_vec3 direction, sonde_vec3 *on_a) {
  d->last_a = sonde_convex_climb(d->a, direction, d->last_a, &d->work);
  d->last_b = sonde_convex_climb(d->b, v_neg(m_mul_v(d->b_from_a, direction)), d->last_b, &d->work);
  *on_a = d->a->hull.vertices[d->last_a];
  return v_sub(*on_a, v_add(m_mul_v(d->a_from_b, d->b->hull.vertices[d->last_b]), d->offset));
}

#endif
