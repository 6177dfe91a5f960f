// A port that is listened on, and what wakes the thread that waits for its sockets.
#ifndef SONDE_SRC_STREAM_PORT_H
#define SONDE_SRC_STREAM_PORT_H

#include "base/base.h"

// Opens a port that does not block. @param address IPv4 @param[out] port that was opened, for 0 any
// @param[out] listener,wake descriptors to be closed, -1: none was made; also after a failure
// @return PORT, ARGUMENT for an address that is none
sonde_status stream_port_open(const char *address, uint16_t *port, int *listener, int *wake,
                              sonde_error *error);
// Ends a wait for the socket `wake`. @thread any
void stream_port_wake(int wake);

#endif
