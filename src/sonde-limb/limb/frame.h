// Inside of the room limb. All functions here work on a right limb; the mirror of a left limb
// happens in the functions of sonde/limb.h only.
//
// A section is the plane of constant z at a level. Its polar frame has its centre at the centroid
// of the deep fascia's contour; angle from the front (0) through medial (pi/2), back, lateral; f is
// the fraction of the fascial radius in that direction. Radii, fat and centres are tables over
// level and angle, read by Catmull-Rom in level and in angle.
#ifndef SONDE_SRC_LIMB_FRAME_H
#define SONDE_SRC_LIMB_FRAME_H

#include "base/base.h"
#include "base/maths.h"
#include "sonde/limb.h"

// Levels of the tables: row r is at LIMB_TOP + r * LIMB_STEP. Angles: column c is at 2 pi c /
// count.
#define LIMB_TOP (-0.2)
#define LIMB_STEP 0.0125
enum { LIMB_ROWS = 177, LIMB_ANGLES = 72 };

typedef struct limb_surface {
  double x[LIMB_ROWS], y[LIMB_ROWS];     // centre of the section, m
  double fascia[LIMB_ROWS][LIMB_ANGLES]; // radius of the deep fascia, m
  double fat[LIMB_ROWS][LIMB_ANGLES];    // fat between fascia and skin along the ray, m
} limb_surface;

struct limb_vessels; // vessels.h
struct limb_bones;   // bones.h
struct limb_muscles; // muscles.h

struct sonde_limb {
  sonde_limb_body body;
  double scale; // of landmarks: thigh length / 430 mm
  limb_surface surface;
  struct limb_bones *bones;
  struct limb_vessels *vessels; // made after bones and surface, before muscles; may be NULL
  struct limb_muscles *muscles;
};

// As fmin() and fmax() of numbers, without a call.
static inline double least_of(double a, double b) { return a < b ? a : b; }
static inline double most_of(double a, double b) { return a > b ? a : b; }

// z of a level and level of a z; linear beyond the ends.
static inline double limb_z(const sonde_limb *limb, double level) {
  double thigh = limb->body.thigh_length_m, calf = limb->body.calf_length_m;
  return level <= 1 ? -thigh * level : -thigh - calf * (level - 1);
}
static inline double limb_level(const sonde_limb *limb, double z) {
  double thigh = limb->body.thigh_length_m, calf = limb->body.calf_length_m;
  return z >= -thigh ? -z / thigh : 1 + (-thigh - z) / calf;
}

// A point or direction of the right limb in the frame of the limb's own side, and back.
static inline sonde_vec3 limb_side_point(const sonde_limb *limb, sonde_vec3 p) {
  if (limb->body.side == SONDE_LIMB_LEFT) p.x = -p.x;
  return p;
}

// Centre of the section at a level; x and y only.
sonde_vec3 limb_centre(const sonde_limb *limb, double level);
// Radii from the centre: deep fascia, fat (along the ray), skin's outer face.
double limb_fascia_radius(const sonde_limb *limb, double level, double angle);
double limb_fat(const sonde_limb *limb, double level, double angle);
double limb_skin_radius(const sonde_limb *limb, double level, double angle);
// Distance of the superficial (saphenous) fascia outside the deep fascia along the ray, m: the deep
// layer of fat, in which the saphenous veins run. 0 < value < limb_fat.
double limb_deep_fat(const sonde_limb *limb, double level, double angle);
// The same of a whole thickness.
static inline double limb_deep_share(double fat_m) {
  return least_of(0.45 * fat_m, 0.003 + 0.2 * fat_m);
}
// Radii of the fascia and the skin and the fat between them, and the skin's a step of the level up
// and down and a step of the angle back and on.
typedef struct limb_radii {
  double fascia, fat, skin, up, down, back, on;
} limb_radii;
limb_radii limb_radii_at(const sonde_limb *limb, double level, double angle, double rise,
                         double turn);

// Polar to space and back.
void limb_point(const sonde_limb *limb, double level, double angle, double f, double xyz[3]);
void limb_polar(const sonde_limb *limb, const double xyz[3], double *level, double *angle,
                double *f);

// Volume of the muscles against those of a man of 1.70 m and 75 kg: Handsfield 2014 by stature and
// mass, less for women and for age above 60.
double limb_muscle_rule(const sonde_limb_body *body);

// Mean thickness of the fat over the femoral vessels at the groin, m: by sex and body mass.
double limb_groin_fat(const sonde_limb_body *body);
// Mean depth of the front wall of the common femoral artery under the deep fascia, m: what its
// depth under the skin leaves when skin and fat are taken away.
double limb_groin_cover(const sonde_limb_body *body);

// Fills surface of a limb whose body is drawn. @return ARGUMENT when fat leaves no room
sonde_status limb_surface_make(sonde_limb *limb, sonde_error *error);

// Signed distance to the nearest bone (negative inside), m; which bone in *which when not NULL.
// Exact near the surface within some 10 %, a lower bound of some use far away.
double limb_bone_distance(const sonde_limb *limb, const double xyz[3], int *which);

#endif
