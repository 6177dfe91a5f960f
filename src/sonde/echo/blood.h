// How far the blood of a vessel has flowed.
#ifndef SONDE_SRC_ECHO_BLOOD_H
#define SONDE_SRC_ECHO_BLOOD_H

#include "echo/echo.h"

// Mean speed of a vessel's blood along it at the time of the flow, m/s.
double sonde_blood_speed(const sonde_echo *echo, uint32_t which);

#endif
