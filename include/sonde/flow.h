/**
 * @file flow.h
 * Blood flow in a limb's main veins, and what pulsed Doppler sees of it: a network of segments from
 * the calf to the right atrium, velocity profiles, the signal of a gate, its spectrum.
 * docs/flow.md, docs/flow_theory.md.
 *
 * Flow towards the heart is positive. Velocities are mean velocities over the lumen unless a name
 * says otherwise.
 */
#ifndef SONDE_FLOW_H
#define SONDE_FLOW_H

#include "sonde/limb_pose.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- network ------------------------------------------------------------------------------ */

/** Segments of the way to the heart from the calf up, and two that join it. */
typedef enum sonde_flow_segment {
  SONDE_FLOW_CALF, /**< tibial, peroneal and muscle veins taken together */
  SONDE_FLOW_POPLITEAL,
  SONDE_FLOW_FEMORAL,
  SONDE_FLOW_COMMON_FEMORAL,
  SONDE_FLOW_EXTERNAL_ILIAC,
  SONDE_FLOW_COMMON_ILIAC,
  SONDE_FLOW_DEEP_FEMORAL,    /**< joins the common femoral vein, as the next one does */
  SONDE_FLOW_GREAT_SAPHENOUS, /**< of thigh and calf */
  SONDE_FLOW_SEGMENTS
} sonde_flow_segment;

/** Name of a segment, such as "common-femoral". Never NULL. @thread any */
SONDE_API const char *sonde_flow_segment_name(sonde_flow_segment segment);

/** Veins side by side in a segment: the main one, where a gate lies, and its companions. */
enum { SONDE_FLOW_VEINS = 11 };

/** A patient's veins and what is done to them. */
typedef struct sonde_flow_def {
  double length_m[SONDE_FLOW_SEGMENTS];                  /**< of the segment, > 0 */
  double area_m2[SONDE_FLOW_SEGMENTS][SONDE_FLOW_VEINS]; /**< mean of each lumen at rest; the main
                                                            one's > 0, 0: no such companion */
  double closed[SONDE_FLOW_SEGMENTS][SONDE_FLOW_VEINS];  /**< share of each area that a clot or a
                                                              probe takes, 0 to 1 */
  /** Resistance over that of even lumina of these areas, > 0: above 1 where veins have narrow
   * places. */
  double narrow[SONDE_FLOW_SEGMENTS];
  /** Tissue whose small veins drain into the segment: it holds blood and takes its share of the
   * inflow. That of the common iliac vein lies in the pelvis, beyond the leg. */
  double tissue_m3[SONDE_FLOW_SEGMENTS];
  /** Pressure of the column of blood in the position, above that of lying: it widens and tautens
   * the veins, and does not drive the blood, since it stands in arteries and veins alike. -1e3 to
   * 3e4 */
  double column_pa[SONDE_FLOW_SEGMENTS];
  double leak;        /**< what valves leave open to blood that falls back: 0
                           competent to 1 none */
  double inflow_m3_s; /**< through the common femoral artery at rest, > 0; default 350 ml/min */
  double heart_rate_hz, breath_rate_hz; /**< default 1.15, 0.25 */
  double breath_pa;                     /**< swing of the pressure in the belly; default 47 */
  double deep_breath_from_s;            /**< a deep breath in and out in 5 s; default never */
  double squeeze_from_s, squeeze_pa;    /**< a hand on the calf for 1.5 s; default never */
  double valsalva_from_s, valsalva_to_s, valsalva_pa; /**< default never; 4000 Pa.
                                                                   From -INFINITY on: always */
} sonde_flow_def;

/** Typical veins, or those of a limb when it is not NULL: lengths, areas and companions of its
 * branches, the calf's volume, the inflow of its artery. @thread any */
SONDE_API sonde_flow_def sonde_flow_def_default(const sonde_limb *limb);
/** The veins of a limb in a position: columns of blood at the middles of the segments, their
 * lengths, the popliteal vein as wide as the knee's bend leaves it. NULL: straight and lying, which
 * changes nothing.
 * @param[in,out] def as sonde_flow_def_default() of the pose's limb gives it @thread any */
SONDE_API void sonde_flow_def_hold(const sonde_limb_pose *pose, sonde_flow_def *def);

/** Volumes, flows and valves of the segments: a value, to be copied freely. */
typedef struct sonde_flow {
  sonde_flow_def def;
  double time_s;
  double volume_m3[SONDE_FLOW_SEGMENTS];
  double rest_m3[SONDE_FLOW_SEGMENTS];   /**< volume at rest, open: areas grow with volumes */
  double empty_m3[SONDE_FLOW_SEGMENTS];  /**< volume at which the walls carry no pressure */
  double flow_m3_s[SONDE_FLOW_SEGMENTS]; /**< out of each segment, towards the heart */
  double open[SONDE_FLOW_SEGMENTS];      /**< how far the segment's valve is open, 0 to 1 */
} sonde_flow;

/**
 * Starts at t = 0 in the steady state, clots included, without breath, beat and manoeuvre.
 * @return ARGUMENT naming the value of the definition that is out of range
 * @thread any
 */
SONDE_API sonde_status sonde_flow_start(const sonde_flow_def *def, sonde_flow *flow,
                                        sonde_error *error);
/** The steady state of a network that was started, with what its definition says now of clots and
 *  columns, and valves open. @thread any (tick) */
SONDE_API void sonde_flow_settle(sonde_flow *flow);
/** One implicit step of dt_s (1e-5 to 1e-2). About a microsecond. @thread any (tick) */
SONDE_API void sonde_flow_step(sonde_flow *flow, double dt_s);
/** Blood through one of the veins of a segment, m3/s: conductances add up. @thread any (tick) */
SONDE_API double sonde_flow_through(const sonde_flow *flow, sonde_flow_segment segment,
                                    uint32_t vein);
/** Open area of one of the veins now, m2. @thread any (tick) */
SONDE_API double sonde_flow_area(const sonde_flow *flow, sonde_flow_segment segment, uint32_t vein);
/** Mean velocity in the open part of a segment's main vein, m/s; 0 when it is closed.
 * @thread any (tick) */
SONDE_API double sonde_flow_velocity(const sonde_flow *flow, sonde_flow_segment segment);
/** Pressure in a segment above the atmosphere's, Pa, with its column. @thread any (tick) */
SONDE_API double sonde_flow_pressure(const sonde_flow *flow, sonde_flow_segment segment);
/** Mean velocity in the common femoral artery at a share of the beat: triphasic. @thread any */
SONDE_API double sonde_flow_artery(double beat);

/* ---- profiles ----------------------------------------------------------------------------- */

enum { SONDE_FLOW_RINGS = 33, SONDE_FLOW_HARMONICS = 12 };

/** Parabola of a mean velocity: ring k lies at k/(SONDE_FLOW_RINGS - 1) of the radius; in an
 * ellipse the same along every radius, which is exact. @thread any (tick) */
SONDE_API void sonde_flow_steady(double mean_m_s, double profile_m_s[SONDE_FLOW_RINGS]);
/**
 * A profile after dt_s, when the pressure gradient gives it this mean: the axial momentum of rings
 * that rub on each other, implicit in time. Slow flow becomes the parabola, a pulse Womersley's
 * profile, a sudden push is blunt at first.
 * @param[in,out] profile_m_s any before the first step, such as a parabola's
 * @param radius_m of a round lumen; of an ellipse sqrt(2 a^2 b^2/(a^2 + b^2))
 * @thread any (tick)
 */
SONDE_API void sonde_flow_follow(double profile_m_s[SONDE_FLOW_RINGS], double radius_m,
                                 double mean_m_s, double dt_s);
/**
 * Womersley's profile of a periodic flow in a round tube.
 * @param mean_m_s [samples] mean velocity over one period, samples >= 2 SONDE_FLOW_HARMONICS
 * @param radius_m of the lumen; rate_hz of the beat, > 0
 * @param phase share of the period
 * @thread any
 */
SONDE_API void sonde_flow_pulsed(const double *mean_m_s, uint32_t samples, double radius_m,
                                 double rate_hz, double phase,
                                 double profile_m_s[SONDE_FLOW_RINGS]);

/* ---- pulsed Doppler ----------------------------------------------------------------------- */

/** A spectrum is that of the pulses of so much time, at least of so many. */
#define SONDE_DOPPLER_WINDOW_S 0.04
enum { SONDE_DOPPLER_BINS = 128, SONDE_DOPPLER_PULSES = 128 };

/** A gate on a vessel and the chain behind it. */
typedef struct sonde_doppler_def {
  double frequency_hz, pulse_hz; /**< carrier, 1e6 to 2e7; pulse repetition, 500 to 2e4 */
  double angle_rad;              /**< between beam and flow towards the probe, 0 to pi */
  double gate_m, beam_m;         /**< length of the gate; standard deviation of the beam's width */
  double half_short_m, half_long_m; /**< of the lumen, the short one along the beam */
  double clutter_db, noise_db;      /**< of the walls' echo and of noise, over the blood's */
  double filter_hz;                 /**< frequencies below are removed */
  uint64_t seed;                    /**< of scatterers and noise */
} sonde_doppler_def;

SONDE_API sonde_doppler_def sonde_doppler_def_default(void); /**< @thread any */

typedef struct sonde_doppler sonde_doppler;
/** @return ARGUMENT naming the value, MEMORY. @thread owner */
SONDE_API sonde_status sonde_doppler_create(const sonde_doppler_def *def, sonde_doppler **doppler,
                                            sonde_error *error);
SONDE_API void sonde_doppler_destroy(sonde_doppler *doppler); /**< NULL is fine. @thread owner */
/** One pulse: the scatterers move by the profile for 1/pulse_hz. @thread tick */
SONDE_API void sonde_doppler_pulse(sonde_doppler *doppler,
                                   const double profile_m_s[SONDE_FLOW_RINGS]);

/** What the last pulses hold. */
typedef struct sonde_doppler_spectrum {
  double
      power[SONDE_DOPPLER_BINS]; /**< by velocity, from the lowest that is shown to the highest */
  double velocity_m_s[SONDE_DOPPLER_BINS]; /**< corrected by the angle */
  double mean_m_s; /**< power-weighted; what the filter took goes on evenly between its edges */
  double peak_m_s; /**< edge of the spectrum away from zero, 99 % of the power below it */
} sonde_doppler_spectrum;
/** Hann-weighted spectrum, wall filter applied; zeros until there are as many pulses. @thread tick
 */
SONDE_API void sonde_doppler_read(const sonde_doppler *doppler, sonde_doppler_spectrum *spectrum);
/** Mean velocity of the blood in the gate, by the beam's weight: what the mean of a spectrum
 * without walls, noise, filter and chance would be. @thread any */
SONDE_API double sonde_doppler_truth(const sonde_doppler *doppler,
                                     const double profile_m_s[SONDE_FLOW_RINGS]);
/** Velocity from the phase between neighbours of the last SONDE_DOPPLER_BINS pulses. @thread tick
 */
SONDE_API double sonde_doppler_phase_velocity(const sonde_doppler *doppler);
/** Slowest velocity whose spectrum keeps clear of the wall filter, into which a window blurs slower
 *  ones by two of its bins. @param limit_m_s the highest that is not folded @thread any */
static inline double sonde_doppler_slowest(double limit_m_s, double filter_hz, double window_s,
                                           double pulse_hz) {
  return 2 * limit_m_s * (filter_hz + 2 / window_s) / pulse_hz;
}
/** Highest velocity that is not folded: c pulse_hz / (4 f |cos angle|). @thread any */
SONDE_API double sonde_doppler_limit(const sonde_doppler_def *def);

#ifdef __cplusplus
}
#endif
#endif
