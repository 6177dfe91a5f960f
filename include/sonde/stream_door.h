/**
 * @file stream_door.h
 * The door of a class: one port of the network with TLS, behind it the pages of the learners'
 * programs, which listen on this computer only (docs/class.md).
 */
#ifndef SONDE_STREAM_DOOR_H
#define SONDE_STREAM_DOOR_H

#include "sonde/base_json.h"
#include "sonde/stream.h"
#include "sonde/trainer_log.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sonde_door sonde_door;

enum {
  SONDE_DOOR_NAME = 48,        /**< bytes of a name with its end */
  SONDE_DOOR_ANSWER = 512,     /**< bytes of an answer with its end */
  SONDE_DOOR_CODE = 9,         /**< bytes of a code with its end: 40 bits */
  SONDE_DOOR_FINGERPRINT = 96, /**< bytes of a fingerprint with its end */
  SONDE_DOOR_TICKET = 33,      /**< bytes of a ticket with its end: 32 hexadecimal digits */
  SONDE_DOOR_IDENTITY = 16384  /**< bytes of key and certificates with their end */
};

/** Texts that the teacher's secret opens. */
typedef enum sonde_door_text {
  SONDE_DOOR_CLASS,      /**< /class.json: who is there */
  SONDE_DOOR_RESULTS,    /**< /results.json: of the class */
  SONDE_DOOR_TABLE,      /**< /results.csv */
  SONDE_DOOR_STATEMENTS, /**< /statements.jsonl: xAPI */
  SONDE_DOOR_TEXTS
} sonde_door_text;

typedef struct sonde_door_def {
  const char *address;       /**< IPv4 address of this computer, 0.0.0.0: all of them */
  uint16_t port;             /**< 0: any free port */
  const char *identity;      /**< PEM: private key, certificate, and those above it if any */
  const char *code;          /**< of who joins, as sonde_door_code_make() gives it */
  const char *teacher_token; /**< secret of the teacher's address */
  uint16_t first_port;       /**< of the learners' programs on 127.0.0.1: place 1; others follow */
  uint32_t places;           /**< how many */
  void *user;                /**< for the function below */
  /** Who knows the code asks for a place, or to watch the learner of that name. Called by the
   * door's thread, which serves nobody meanwhile.
   *  @param name UTF-8 without control characters, not empty
   *  @param answer for 200 one JSON object, else a sentence
   *  @return 200, or the HTTP status that refuses */
  int (*join)(void *user, const char *name, bool watches, char answer[SONDE_DOOR_ANSWER]);
  /** [places] secrets of the learners' addresses, kept by the caller while the door is open. A page
   * that has one may link a ticket of a learning management system, which then reads that learner's
   * results from the page of another site. NULL: no system may. */
  const char *const *learner_tokens;
  /** What the holder of a place's ticket may read, called by the door's thread.
   *  @param since_unix_s when the ticket was linked
   *  @param[out] answer one JSON object, which the door frees with sonde_free()
   *  @return 200, or the HTTP status that refuses with `answer` untouched */
  int (*follow)(void *user, uint32_t place, int64_t since_unix_s, char **answer);
} sonde_door_def;

/** A new private key (P-256) and a certificate that it signed itself, valid for ten years.
 *  @param[out] pem text @return IO when there are no random numbers @thread any */
SONDE_API sonde_status sonde_door_identity_make(char pem[SONDE_DOOR_IDENTITY], sonde_error *error);
/** A new code: 8 letters and digits that are not mistaken for each other. @return IO @thread any */
SONDE_API sonde_status sonde_door_code_make(char code[SONDE_DOOR_CODE], sonde_error *error);

/** Opens the port. What strangers do there costs the others nothing: connections, heads of requests
 *  and the time of each step are bounded, and nothing waits for a single connection.
 *  @return PORT, ARGUMENT for an address, a secret or an identity of another form @thread owner */
SONDE_API sonde_status sonde_door_open(const sonde_door_def *def, sonde_door **door,
                                       sonde_error *error);
/** The port that was opened. @thread any */
SONDE_API uint16_t sonde_door_port(const sonde_door *door);
/** SHA-256 of the certificate as a browser shows it: AB:CD:... @thread any */
SONDE_API void sonde_door_fingerprint(const sonde_door *door, char text[SONDE_DOOR_FINGERPRINT]);
/** How many wrong codes and teacher's secrets came so far. @thread any */
SONDE_API uint64_t sonde_door_wrong(sonde_door *door);
/** The newest version of a text, which is copied. @return MEMORY @thread any */
SONDE_API sonde_status sonde_door_publish(sonde_door *door, sonde_door_text which, const char *text,
                                          sonde_error *error);
/** Writes an exam of the log as one statement of xAPI 1.0.3. Equal exams give equal bytes.
 *  @param home address that names the system, e.g. the class's, with "/" at its end; less than 200
 *  characters @thread owner */
SONDE_API void sonde_door_statement(const sonde_log_entry *entry, const char *home,
                                    sonde_json_out *out);
/** Closes all connections and the port. NULL is ignored. @thread owner */
SONDE_API void sonde_door_close(sonde_door *door);

#ifdef __cplusplus
}
#endif
#endif
