// A limb in a position; inside of pose*.c. All of a right limb, metres.
#ifndef SONDE_SRC_LIMB_POSE_H
#define SONDE_SRC_LIMB_POSE_H

#include "limb/bones.h"
#include "sonde/limb_pose.h"
#include "sonde/tissue.h"

enum { LIMB_BED_ROWS = 240 };
#define LIMB_BED_STEP 0.006
// The lowest layer, next to the bed, keeps this share of its height.
#define LIMB_SQUEEZED 0.4

struct sonde_limb_pose {
  const sonde_limb *limb;
  sonde_limb_setting setting;
  // Joints: the hip turns about the origin, the knee about an axis along x through `knee`.
  sonde_vec3 hip_axis; // unit
  double hip_angle;
  sonde_vec3 knee;
  double knee_angle;
  double roll;                       // tibia from the condyles' centre, against the straight knee
  sonde_pose bone[SONDE_LIMB_BONES]; // posed from rest
  // The bed: rows along its direction; each has the height of the lowest skin, the depth of tissue
  // that is squeezed below the bone, and the middle of the section across.
  bool bed;
  sonde_vec3 up, along, across; // orthonormal; up is against gravity, bed or not
  double first;                 // of the rows, along
  double low[LIMB_BED_ROWS], deep[LIMB_BED_ROWS], middle[LIMB_BED_ROWS], lies[LIMB_BED_ROWS];
  double centre[LIMB_BED_ROWS], half[LIMB_BED_ROWS]; // width of the cushion to either side
  double plane;                                      // height of the bed beside the limb
};

// Rest to posed before the bed has squeezed it, and with the bed.
sonde_vec3 limb_pose_joints(const sonde_limb_pose *pose, sonde_vec3 rest);
sonde_vec3 limb_pose_forward(const sonde_limb_pose *pose, sonde_vec3 rest);
// Columns: derivatives of the posed point by the rest point's x, y and z.
sonde_mat3 limb_pose_gradient(const sonde_limb_pose *pose, sonde_vec3 rest);
// The rest point whose posed point is nearest to `posed`, and how far that is: below the bound
// where the map is one to one. In the narrow gaps between two bones that a joint closes it is not.
#define LIMB_POSE_BOUND 4e-8
double limb_pose_inverse(const sonde_limb_pose *pose, sonde_vec3 posed, sonde_vec3 *rest);
// Lowest skin's height before and after it is squeezed, in the row of a posed point.
double limb_pose_bed_height(const sonde_limb_pose *pose, sonde_vec3 posed);
// Radius of a vein in the position against that at rest, at a rest point; 1 for arteries. What the
// bend of the knee does of it, and the rest by the pressure there.
double limb_pose_filling(const sonde_limb_pose *pose, uint32_t vessel, sonde_vec3 rest);
double limb_pose_knee(const sonde_limb_pose *pose, uint32_t vessel, sonde_vec3 rest);
// Posed place of the saphenofemoral junction of a mean limb, from where columns of blood count.
sonde_vec3 limb_pose_groin(const sonde_limb_pose *pose);
sonde_posture limb_pose_posture(sonde_limb_position position);

#endif
