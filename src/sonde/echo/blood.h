// How far the blood of a vessel has flowed.
#ifndef SONDE_SRC_ECHO_BLOOD_H
#define SONDE_SRC_ECHO_BLOOD_H

#include "echo/echo.h"

// A vessel's blood at the time of the flow.
sonde_vessel_blood sonde_blood_of(const sonde_echo *echo, uint32_t which);

#endif
