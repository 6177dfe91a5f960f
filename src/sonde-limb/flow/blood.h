// Blood as the network and the profiles take it.
#ifndef SONDE_SRC_FLOW_BLOOD_H
#define SONDE_SRC_FLOW_BLOOD_H

#define BLOOD_PA_S 3.5e-3  // viscosity
#define BLOOD_KG_M3 1060.0 // density
#define BLOOD_M2_S (BLOOD_PA_S / BLOOD_KG_M3)

#endif
