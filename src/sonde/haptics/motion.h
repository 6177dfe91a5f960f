// Small motions of poses for the devices; hot.
#ifndef SONDE_SRC_MOTION_H
#define SONDE_SRC_MOTION_H

#include "base/link.h"
#include "base/maths.h"

// A probe's distance from the origin stays below this: meshes lie within 10 km of it, and a probe
// farther away would have speeds without number.
#define SONDE_POSE_REACH_M 1e5
// Whether every number is finite, the position within reach and the quaternion long enough to be a
// rotation.
SONDE_LINK bool sonde_pose_usable(sonde_pose pose);
// Angle of the rotation that takes a to b along the short arc, 0..pi.
SONDE_LINK double sonde_quat_angle(sonde_quat a, sonde_quat b);
// Along the short arc from a (t = 0) to b (t = 1).
SONDE_LINK sonde_quat sonde_quat_slerp(sonde_quat a, sonde_quat b, double t);
// From a towards b by a share t of the way, position straight and rotation along the short arc.
SONDE_LINK sonde_pose sonde_pose_blend(sonde_pose a, sonde_pose b, double t);
// From a towards b by at most `reach_m` and `rotation_rad`; arrives exactly.
SONDE_LINK sonde_pose sonde_pose_approach(sonde_pose a, sonde_pose b, double reach_m,
                                          double rotation_rad);

#endif
