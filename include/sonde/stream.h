/**
 * @file stream.h
 * The page: HTTP and WebSocket server on the loopback address, and its messages.
 */
#ifndef SONDE_STREAM_H
#define SONDE_STREAM_H

#include "sonde/exam.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sonde_page_server sonde_page_server;

typedef struct sonde_page_def {
  uint16_t port;              /**< 0: any free port */
  const char *data_directory; /**< serve the page from here instead of memory (development) */
  const char *model_path;     /**< for recordings and titles; may be NULL */
  double force_limit_n;       /**< shown on the page; 0: sonde_safety_limits_default() */
} sonde_page_def;

/** Serves the embedded page and one WebSocket (/ws) for a session: sends model, frames and images
 *  (latest frame wins, acknowledged by the client), takes probe goals and controls.
 *  Binds to 127.0.0.1 and checks Origin. @return SONDE_PORT when the port is in use */
SONDE_API sonde_status sonde_page_start(const sonde_page_def *def, sonde_session *session,
                                        sonde_page_server **server, sonde_error *error);
SONDE_API uint16_t sonde_page_port(const sonde_page_server *server);
SONDE_API uint32_t sonde_page_clients(const sonde_page_server *server);
/** Closes all connections and joins the threads. */
SONDE_API void sonde_page_stop(sonde_page_server *server);

#ifdef __cplusplus
}
#endif
#endif
