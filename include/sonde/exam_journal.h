/**
 * @file exam_journal.h
 * The recording of an exam is its journal: the inputs of every tick, and notes between them that
 * say what the exam is about and what was decided. Result, report and log are derived from it:
 * docs/recording.md.
 */
#ifndef SONDE_EXAM_JOURNAL_H
#define SONDE_EXAM_JOURNAL_H

#include "sonde/base.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SONDE_NOTE_MOST_BYTES = 1 << 20 };

/** Kinds of notes; the text of each is one JSON object. */
typedef enum sonde_note_kind {
  SONDE_NOTE_SETUP = 1, /**< exam, trainee, case, protocol, guidance, date */
  SONDE_NOTE_DECISION,  /**< segment, decision */
  SONDE_NOTE_HINT,      /**< a hint was asked for */
  SONDE_NOTE_MARK,      /**< calipers: from, to */
  SONDE_NOTE_SCORE,     /**< the exam was finished and judged: the entry of the log */
  SONDE_NOTE_COMMENT,   /**< time_s, author, text */
  SONDE_NOTE_WORKSHEET  /**< an entry of the worksheet: sonde_worksheet_enter() */
} sonde_note_kind;

/** A note of a journal. */
typedef struct sonde_note {
  sonde_note_kind kind;
  uint64_t tick;    /**< ticks before it */
  const char *text; /**< terminated; owned by the list */
} sonde_note;

typedef struct sonde_notes {
  uint32_t count;
  sonde_note *list; /**< [count] in the order of writing */
  char *texts;      /**< owned here */
} sonde_notes;

/** Reads the notes of a recording, also of one that was cut off; none in those of versions
 * before 8.
 *  @param[out] notes released by sonde_notes_clear()
 *  @return FORMAT, CHECKSUM, VERSION for a file that is no recording; IO @thread owner */
SONDE_API sonde_status sonde_notes_load(const char *recording, sonde_notes *notes,
                                        sonde_error *error);
SONDE_API void sonde_notes_clear(sonde_notes *notes); /**< @thread owner */
/** The newest note of a kind; NULL: none. @thread any */
SONDE_API const sonde_note *sonde_notes_last(const sonde_notes *notes, sonde_note_kind kind);

/** Whether a program is recording into the file. @thread any */
SONDE_API bool sonde_recording_is_open(const char *recording);

/** How the recording of a running session goes. */
typedef struct sonde_recording_state {
  bool recording;
  bool finished;      /**< its end is on the disk */
  uint32_t notes;     /**< that are on the disk; while recording */
  bool in_trouble;    /**< the disk did not take the last bytes; they wait in memory */
  char reason[96];    /**< why, in the system's words */
  double unwritten_s; /**< of the exam that waits */
  bool lossy;         /**< inputs are missing for good: they can be played up to the loss only */
} sonde_recording_state;

#ifdef __cplusplus
}
#endif
#endif
