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

enum {
  SONDE_PAGE_TOKEN = 33,   /**< bytes of a token with its end: 128 bits in hexadecimal */
  SONDE_PAGE_ADDRESS = 64, /**< bytes of a page's address with its end */
  SONDE_PAGE_LINK = 208,   /**< bytes of a link with its end */
  SONDE_PAGE_ENTRY = 12289 /**< bytes of an entry with its end */
};

/** A new token from the kernel's random numbers. @return IO when there are none @thread any */
SONDE_API sonde_status sonde_page_token_make(char token[SONDE_PAGE_TOKEN], sonde_error *error);
/** Whether a text has the form of a token: 32 digits from 0-9a-f. NULL: false. @thread any */
SONDE_API bool sonde_page_token_valid(const char *token);

/** What the page asks of the program beside probe and scanner (docs/page_protocol.md). */
typedef enum sonde_page_ask {
  SONDE_PAGE_START_EXAM, /**< id (case), protocol, guidance, name (trainee) */
  SONDE_PAGE_DECIDE,     /**< id (segment), text (decision) */
  SONDE_PAGE_HINT,
  SONDE_PAGE_POSITION, /**< id (position) */
  SONDE_PAGE_FINISH_EXAM,
  SONDE_PAGE_LEAVE_EXAM,
  SONDE_PAGE_LIST_EXAMS,
  SONDE_PAGE_OPEN_REPLAY,  /**< id (exam) */
  SONDE_PAGE_SEEK,         /**< time_s */
  SONDE_PAGE_PLAY,         /**< playing, speed */
  SONDE_PAGE_COMMENT,      /**< time_s, text, name (author) */
  SONDE_PAGE_WORKSHEET,    /**< entry */
  SONDE_PAGE_START_LESSON, /**< id (lesson), turn, name (trainee) */
  SONDE_PAGE_DEMONSTRATE,  /**< id (lesson) */
  SONDE_PAGE_NEXT,         /**< of a demonstration: its words are read */
  SONDE_PAGE_EXPORT,       /**< id (exam), text (what, may be empty), turn (part, from 1) */
  SONDE_PAGE_EDIT,         /**< entry, of a client with the teacher's token only */
  SONDE_PAGE_ASKS
} sonde_page_ask;

/** One request; what it does not use is empty or 0. */
typedef struct sonde_page_request {
  sonde_page_ask ask;
  char id[64], protocol[64], guidance[16], name[164], text[1604]; /**< UTF-8 */
  double time_s, speed;
  uint32_t turn; /**< repetition of the lesson's practice, from 0 */
  bool playing;
  /** The whole message: one JSON object of at most 3 levels, of which nothing else was checked. */
  char entry[SONDE_PAGE_ENTRY];
} sonde_page_request;

/** Texts (JSON) that each client has in its newest version. */
typedef enum sonde_page_topic {
  SONDE_PAGE_GREETING, /**< further members of the hello, "key":value,..., without braces */
  SONDE_PAGE_EXAM,
  SONDE_PAGE_EXAMS,
  SONDE_PAGE_REPLAY,
  SONDE_PAGE_SHEET,  /**< the worksheet of the exam */
  SONDE_PAGE_FILES,  /**< what can be downloaded of a kept exam */
  SONDE_PAGE_DRAFT,  /**< of the case that is edited: to teachers only */
  SONDE_PAGE_STATUS, /**< not sent: GET /status.json */
  SONDE_PAGE_TOPICS
} sonde_page_topic;

typedef struct sonde_page_def {
  uint16_t port;               /**< 0: any free port */
  const char *token;           /**< secret of the learner's address; NULL: a new one */
  const char *teacher_token;   /**< of the teacher's address; NULL: a new one */
  const char *watcher_token;   /**< of who may only watch; NULL: nobody may */
  const char *data_directory;  /**< serve the page from here instead of memory (development) */
  const char *model_path;      /**< for recordings and titles; may be NULL */
  double force_limit_n;        /**< shown on the page; 0: sonde_safety_limits_default() */
  const char *exams_directory; /**< with ID/report.html, exam.json, ...; NULL: none */
  void *user;                  /**< for the function below, which may be NULL */
  /** A request of the client that controls; a comment or the list of exams, of any; an edit, of a
   *  teacher. Called by one thread at a time while the server's clients wait: copy it and return;
   *  call nothing of this header from it. */
  void (*request)(void *user, const sonde_page_request *request);
} sonde_page_def;

/** Serves the embedded page and one WebSocket (/ws) for a session: sends model, frames and images
 *  (latest frame wins, acknowledged by the client), takes probe goals and controls.
 *  Binds to 127.0.0.1 and checks Origin. Anyone may load the page itself; data and the WebSocket
 *  are for who knows the token of its address (docs/page_protocol.md).
 *  @return PORT when the port is in use, ARGUMENT for a token of another form @thread owner */
SONDE_API sonde_status sonde_page_start(const sonde_page_def *def, sonde_session *session,
                                        sonde_page_server **server, sonde_error *error);
/** Shows another session from now on: every client gets its thigh. After the return the server does
 *  not touch the session before. @thread owner */
SONDE_API sonde_status sonde_page_show(sonde_page_server *server, sonde_session *session,
                                       sonde_error *error);
/** Shows frames that come by sonde_page_post() instead of a session: nobody controls.
 *  @param model,probes borrowed until the next show or stop @thread owner */
SONDE_API sonde_status sonde_page_show_model(sonde_page_server *server, const sonde_model *model,
                                             const sonde_probe *probes, uint32_t probe_count,
                                             sonde_error *error);
/** A frame of the model shown by sonde_page_show_model(), and the controls it was made with.
 *  @return false without memory @thread owner */
SONDE_API bool sonde_page_post(sonde_page_server *server, const sonde_frame *frame,
                               const sonde_session_controls *controls);
/** New text of a topic, sent to every client when it differs; NULL: none.
 *  @return MEMORY @thread any */
SONDE_API sonde_status sonde_page_publish(sonde_page_server *server, sonde_page_topic topic,
                                          const char *json, sonde_error *error);
/** What clients are not told from now on: the name of the case (which they then cannot change), the
 *  vessels' areas in frames. @thread owner */
SONDE_API void sonde_page_conceal(sonde_page_server *server, bool pathology, bool areas);
/** A sentence for all clients. @thread any */
SONDE_API void sonde_page_tell(sonde_page_server *server, const char *sentence);
/** The address to open, with the learner's or the teacher's token: who reads it can take part.
 *  @thread any */
SONDE_API void sonde_page_address(const sonde_page_server *server, bool teacher,
                                  char address[SONDE_PAGE_ADDRESS]);
/** The address of a document ("/report/ID", "/exam/ID.csv") with a key that opens this document
 *  and nothing else, relative to the page's. @param path less than 160 characters @thread any */
SONDE_API void sonde_page_link(const sonde_page_server *server, const char *path,
                               char link[SONDE_PAGE_LINK]);
/** Closes all connections and joins the threads. @thread owner */
SONDE_API void sonde_page_stop(sonde_page_server *server);

#ifdef __cplusplus
}
#endif
#endif
