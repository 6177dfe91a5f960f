// Blood of the vessels in view.
#ifndef SONDE_SRC_ECHO_BLOOD_H
#define SONDE_SRC_ECHO_BLOOD_H

#include "echo/echo.h"

// How the blood of each vessel in view moves, once a frame: echo->moves.
void sonde_blood_find(sonde_echo *echo);

#endif
