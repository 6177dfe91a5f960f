// What every test of the haptics and exam rooms needs; cmocka.h wants the first three before it.
#ifndef SONDE_TESTS_HAPTICS_TEST_H
#define SONDE_TESTS_HAPTICS_TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

#include "base/base.h"
#include "base/maths.h"

#include <string.h>

static inline sonde_pose pose_at(double x, double y, double z) {
  return (sonde_pose){vec3(x, y, z), quat_identity()};
}
// Rotation about an axis.
static inline sonde_quat quat_about(sonde_vec3 axis, double angle) {
  sonde_vec3 a = v_scale(v_unit(axis, vec3(1, 0, 0)), sin(angle / 2));
  return (sonde_quat){cos(angle / 2), a.x, a.y, a.z};
}

#endif
