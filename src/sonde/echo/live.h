// Live pictures, each of which shows looks of those before.
#ifndef SONDE_SRC_LIVE_H
#define SONDE_SRC_LIVE_H

#include "sonde/echo.h"

#include "base/link.h"

// The next live picture shows all looks and nothing of those before. @thread of the renderer
SONDE_LINK void sonde_echo_begin_looks(sonde_echo *echo);

#endif
