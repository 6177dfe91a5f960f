// What an elastic solid of tetrahedra may be.
#ifndef SONDE_SRC_KINDS_H
#define SONDE_SRC_KINDS_H

// How the volume change that lambda resists is averaged: not at all, which locks near a Poisson
// ratio of 0.5; over disjoint patches of about eight tetrahedra; or over those around every node.
typedef enum sonde_dilatation {
  SONDE_DILATATION_PATCH,
  SONDE_DILATATION_NODE,
  SONDE_DILATATION_ELEMENT
} sonde_dilatation;

// The laws of material.h.
typedef enum sonde_elastic_material { SONDE_LINEAR, SONDE_NEO_HOOKEAN } sonde_elastic_material;

#endif
