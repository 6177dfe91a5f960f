/**
 * @file stream_igtl.h
 * OpenIGTLink: pictures, poses and forces of a session for 3D Slicer, PLUS and other readers.
 *
 * Of each frame come, with one time stamp: IMAGE "Image_Reference", TRANSFORM "ImageToProbe" and
 * "ProbeToReference", SENSOR "ProbeForce" (of the tissue) and "ProbeRenderedForce" (given to the
 * hand), both in N along the axes of Reference, STRING "Metrics" (JSON). Lengths in messages are
 * mm; Reference is the model's frame (docs/stream_igtl.md).
 */
#ifndef SONDE_STREAM_IGTL_H
#define SONDE_STREAM_IGTL_H

#include "sonde/exam.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sonde_igtl_server sonde_igtl_server;

enum { SONDE_IGTL_CLIENTS = 8 /**< at most; one more is closed at once */ };

typedef struct sonde_igtl_def {
  bool listen;         /**< false: only push */
  const char *address; /**< IPv4 address to listen on; NULL: 127.0.0.1. The protocol knows no
                            password: whoever reaches the port gets the pictures */
  uint16_t port;       /**< 0: any free port; 18944 is the protocol's own */
  const char *push; /**< HOST:PORT of a reader that listens itself, connected to at once and, when
                         it is not there, again every second; NULL: none */
} sonde_igtl_def;

/** What went out since the start. */
typedef struct sonde_igtl_counts {
  uint32_t clients, joined; /**< now; in all */
  uint64_t frames;          /**< posted */
  uint64_t sent;            /**< handed to a client's socket as a whole, over all clients */
  uint64_t replaced;        /**< by a newer frame before its client took it, likewise */
} sonde_igtl_counts;

/**
 * Opens the port and starts the thread that waits for clients.
 * @return PORT when the port cannot be opened, ARGUMENT for an address that is none, NOT_FOUND for
 *         a host that has no address @thread owner
 */
SONDE_API sonde_status sonde_igtl_start(const sonde_igtl_def *def, sonde_igtl_server **server,
                                        sonde_error *error);
/** Port that is listened on; 0: none. @thread any */
SONDE_API uint16_t sonde_igtl_port(const sonde_igtl_server *server);
/**
 * A frame for every client; it is copied. A client that has not taken the frame before gets the
 * newest one instead, and none is waited for. Messages have header version 1 until that client
 * sends one of version 2; from then on version 2 with ContactForceN, FrameNumber, TimeS and DepthMm
 * beside the image. @return false without memory @thread any, one at a time
 */
SONDE_API bool sonde_igtl_post(sonde_igtl_server *server, const sonde_frame *frame);
SONDE_API sonde_igtl_counts sonde_igtl_counted(sonde_igtl_server *server); /**< @thread any */
/** Closes all connections; NULL is ignored. @thread owner */
SONDE_API void sonde_igtl_stop(sonde_igtl_server *server);

#ifdef __cplusplus
}
#endif
#endif
