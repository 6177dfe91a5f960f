// Inside of a gate in a scene.
#ifndef SONDE_SRC_FLOW_GATE_H
#define SONDE_SRC_FLOW_GATE_H

#include "flow/scene.h"
#include "flow/spectrum.h"
#include "sonde/flow_gate.h"

enum { GATE_SCATTERERS = 400, GATE_PULSES = 24 };

// In the gate's frame: across the beam in the image plane, beside it, along it into the body.
typedef struct gate_scatterer {
  double at_m[3], way[3]; // way: unit, of a positive speed
  double echo[2];
  scene_blood blood;
} gate_scatterer;

struct sonde_gate {
  bool put, drawn; // in a scene; scatterers have places
  sonde_gate_settings settings;
  double radius_m; // of the face, 0: flat
  double frequency_hz, pulse_hz, tissue_m_s, loss_db;
  uint64_t seed, numbers; // of random numbers since the scatterers were drawn
  double half_m[3];       // of the box that holds the scatterers
  double blood;           // amplitude of a scatterer
  double tissue, heard;   // amplitudes: of the tissue in the gate, and as it is heard by now
  double tissue_phase;
  uint64_t pulses, next; // since the columns began; number of the next pulse, from time 0
  double echo[SPECTRUM_MOST][2];
  uint64_t number; // of the last column
  uint32_t count;
  sonde_gate_column column[SONDE_GATE_COLUMNS]; // a ring, column n at n % SONDE_GATE_COLUMNS
  gate_scatterer scatterer[GATE_SCATTERERS];
};

// The gate's pulses of the step that the scene has just made (hot).
void gate_step(sonde_gate *gate, const sonde_flow_scene *scene, double step_s);

#endif
