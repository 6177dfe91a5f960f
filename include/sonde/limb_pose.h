/**
 * @file limb_pose.h
 * A limb in a position: bones turn rigidly at hip and knee, soft tissue follows and keeps its
 * volume, the bed flattens the side that lies on it, veins fill by gravity. docs/limb_pose.md.
 *
 * A posed point is in the frame of limb.h with the pelvis at rest: the hip joint stays at the
 * origin. Rest points are those of limb.h, of the straight limb.
 */
#ifndef SONDE_LIMB_POSE_H
#define SONDE_LIMB_POSE_H

#include "sonde/limb_vessels.h"

#ifdef __cplusplus
extern "C" {
#endif

/** A position with its joint angles, rad. */
typedef struct sonde_limb_setting {
  sonde_limb_position position; /**< says what lies on the bed, where down is, and how veins fill */
  double hip_flexion_rad;       /**< -0.18 to 1.05 */
  double hip_rotation_rad;      /**< outward, -0.35 to 0.79 */
  double hip_abduction_rad;     /**< -0.09 to 0.53 */
  double knee_flexion_rad;      /**< 0 to 1.31 */
} sonde_limb_setting;

/** "supine", "supine turned", "prone", "prone bent", "sitting", "standing". @thread any */
SONDE_API const char *sonde_limb_position_name(sonde_limb_position position);
/** A position with its usual angles. @thread any */
SONDE_API sonde_limb_setting sonde_limb_setting_usual(sonde_limb_position position);

/** A limb in a position; constant once made. */
typedef struct sonde_limb_pose sonde_limb_pose;

/**
 * Puts a limb in a position.
 * @param limb kept by the pose, not owned
 * @param[out] pose owned by the caller
 * @return ARGUMENT naming an angle out of range, or the level at which the tissue of this limb
 * would fold; MEMORY
 * @thread owner
 */
SONDE_API sonde_status sonde_limb_pose_create(const sonde_limb *limb,
                                              const sonde_limb_setting *setting,
                                              sonde_limb_pose **pose, sonde_error *error);
SONDE_API void
sonde_limb_pose_destroy(sonde_limb_pose *pose); /**< NULL is ignored. @thread owner */
/** @thread any */
SONDE_API sonde_limb_setting sonde_limb_pose_setting(const sonde_limb_pose *pose);

/** The posed point of a rest point, exact. @thread any; never waits, allocates nothing */
SONDE_API sonde_vec3 sonde_limb_pose_point(const sonde_limb_pose *pose, sonde_vec3 rest_m);
/**
 * The rest point of a posed point, by iteration.
 * @param[out] rest_m its posed point is within 1e-7 m of posed_m when true is returned
 * @return false: no rest point within the limb is there
 * @thread any; never waits, allocates nothing
 */
SONDE_API bool sonde_limb_pose_rest(const sonde_limb_pose *pose, sonde_vec3 posed_m,
                                    sonde_vec3 *rest_m);
/** The rotation and shift of a bone. @thread any */
SONDE_API sonde_pose sonde_limb_pose_bone(const sonde_limb_pose *pose, sonde_limb_bone bone);

/** Label of a posed point; veins as wide as they are in the position. A vein does not widen into an
 * artery, a nerve or bone. @thread any */
SONDE_API sonde_limb_label sonde_limb_pose_at(const sonde_limb_pose *pose, sonde_vec3 posed_m);
/** Distances of a posed point as sonde_limb_distance(), that to the vessel at the vessel's width at
 * rest; all infinite where no rest point is. @thread any */
SONDE_API sonde_limb_distances sonde_limb_pose_distance(const sonde_limb_pose *pose,
                                                        sonde_vec3 posed_m);
/** Fibres at a posed point, as sonde_limb_fibre(). @thread any */
SONDE_API bool sonde_limb_pose_fibre(const sonde_limb_pose *pose, sonde_vec3 posed_m,
                                     sonde_vec3 *direction);

/** Unit direction upwards, against gravity. @thread any */
SONDE_API sonde_vec3 sonde_limb_pose_up(const sonde_limb_pose *pose);
/** Height of a posed point above the bed, m; negative in the bed, infinite without one. @thread any
 */
SONDE_API double sonde_limb_pose_bed(const sonde_limb_pose *pose, sonde_vec3 posed_m);
/** Pressure in a vein at a posed point, Pa: that of the groin by position and the column of blood
 * below it. @thread any */
SONDE_API double sonde_limb_pose_pressure(const sonde_limb_pose *pose, sonde_vec3 posed_m);

/** Place on a vessel in the position, the lumen as it is filled there; arc is that of the limb at
 * rest. @thread any */
SONDE_API sonde_limb_vessel_point sonde_limb_pose_place(const sonde_limb_pose *pose,
                                                        uint32_t vessel, double arc_m);
/** Length of a vessel in the position, m. @thread any */
SONDE_API double sonde_limb_pose_length(const sonde_limb_pose *pose, uint32_t vessel);
/** Whether a probe at a pose (+z into the tissue, origin in the middle of its face) has room:
 * nothing of the limb, the bed or the other leg, which lies as its mirror, is within its body: 130
 * mm long, 45 x 12 mm at the face and 60 x 30 mm from 30 mm on. Its edges may sink 8 mm into the
 * skin.
 * @thread any */
SONDE_API bool sonde_limb_pose_reaches(const sonde_limb_pose *pose, sonde_pose probe);
/** The stations as they lie in this position. The probe looks at the first vein from the side of
 * the station, or from higher up where it would not have room; forces are scaled with the pressure
 * in the vein. @thread any */
SONDE_API void sonde_limb_pose_stations(const sonde_limb_pose *pose,
                                        sonde_limb_station stations[SONDE_LIMB_STATIONS]);

/** Closed surface of the skin in the position, as sonde_limb_skin(). @thread owner */
SONDE_API sonde_status sonde_limb_pose_skin(const sonde_limb_pose *pose, double edge_m,
                                            sonde_mesh *mesh, sonde_error *error);
/** Closed surface of a bone in the position, as sonde_limb_bone_mesh(). @thread owner */
SONDE_API sonde_status sonde_limb_pose_bone_mesh(const sonde_limb_pose *pose, sonde_limb_bone bone,
                                                 double edge_m, sonde_mesh *mesh,
                                                 sonde_error *error);

/** Draws the limb in layers as an SVG with pictures in it: muscles, vessels and nerves under
 * see-through muscles, superficial veins; from the front, the medial side and behind, with names.
 * @param pose of the limb, NULL: at rest @thread owner */
SONDE_API sonde_status sonde_limb_view_svg(const sonde_limb *limb, const sonde_limb_pose *pose,
                                           const char *path, sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
