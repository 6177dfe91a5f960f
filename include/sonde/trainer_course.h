/**
 * @file trainer_course.h
 * The course: lessons as files, each with a leg of its own, places, a demonstration, practice whose
 * guidance fades, a quiz, and a proficiency bar that is taken from runs of the scripted expert:
 * docs/course.md.
 */
#ifndef SONDE_TRAINER_COURSE_H
#define SONDE_TRAINER_COURSE_H

#include "sonde/trainer_operator.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
  SONDE_LESSON_VERSION = 1,
  SONDE_LESSON_QUESTIONS = 4,
  SONDE_LESSON_CHOICES = 4,
  SONDE_LESSON_TURNS = 6,
  SONDE_BAR_RUNS = 100
};

/** How much of the truth is shown while a learner examines. */
typedef enum sonde_guidance_level {
  SONDE_GUIDANCE_FULL,  /**< places, forces, names, arrows, and why */
  SONDE_GUIDANCE_HINTS, /**< the next place by name; vessels by name; more when it is asked for */
  SONDE_GUIDANCE_EXAM,  /**< nothing */
  SONDE_GUIDANCE_LEVELS
} sonde_guidance_level;
/** "full", "hints", "exam". @thread any */
SONDE_API const char *sonde_guidance_level_name(sonde_guidance_level level);

/** A question of the quiz. */
typedef struct sonde_question {
  char ask[256];
  uint32_t choice_count;
  char choice[SONDE_LESSON_CHOICES][192];
  uint32_t right; /**< index of the choice */
  char why[512];  /**< said after the answer, whichever it was */
} sonde_question;

/** What repeated exams of the scripted expert came to; NaN where none was measured. */
typedef struct sonde_bar {
  uint32_t runs;                   /**< 0: not measured */
  double score_mean, score_sd;     /**< 0..100; sd of the runs, with n - 1 */
  double time_mean_s, time_sd_s;   /**< from the first to the last moment */
  double path_mean_m, path_sd_m;   /**< of the probe */
  double force_mean_n, force_sd_n; /**< greatest force of a run */
  double score;                    /**< least score that reaches the bar */
} sonde_bar;

/** A lesson. Plain data: a struct copy is a copy. */
typedef struct sonde_lesson {
  char title[96];
  char goal[512];  /**< what the learner can do afterwards */
  char film[1024]; /**< what is said before the demonstration begins */
  sonde_exam_protocol
      protocol;           /**< the places; its id is that of the lesson, "lesson-" before it */
  bool drawn;             /**< the patient is drawn, another one each time */
  sonde_case_level level; /**< of a drawn patient */
  sonde_case patient;     /**< else */
  bool doppler;           /**< colour is on, and the free hand squeezes the calf */
  uint32_t turn_count;
  sonde_guidance_level turn[SONDE_LESSON_TURNS]; /**< guidance of each repetition, in their order */
  uint32_t question_count;
  sonde_question question[SONDE_LESSON_QUESTIONS];
  uint64_t print; /**< of everything that the expert's runs depend on */
  sonde_bar bar;
} sonde_lesson;

typedef struct sonde_course {
  uint32_t count;
  sonde_lesson *lesson; /**< [count] in their order; owned */
} sonde_course;

/** Reads a lesson without a bar, and the case that it names beside its file.
 *  @return FORMAT, ARGUMENT, VERSION "file:line: what was expected"; IO @thread owner */
SONDE_API sonde_status sonde_lesson_load(const char *path, sonde_lesson *out, sonde_error *error);
/** All *.yaml of a directory in the order of their names, with the bars of its `bar.json`. A lesson
 *  that was changed after its bar was measured has none.
 *  @param[out] course released by sonde_course_clear()
 *  @return as sonde_lesson_load(); ARGUMENT for an id that is there twice; FORMAT for bars that
 *  cannot be read @thread owner */
SONDE_API sonde_status sonde_course_load(const char *directory, sonde_course *course,
                                         sonde_error *error);
SONDE_API void sonde_course_clear(sonde_course *course); /**< @thread owner */
/** Index of a lesson by its protocol's id, with "lesson-" or without; the count when there is none.
 *  @thread any */
SONDE_API uint32_t sonde_course_find(const sonde_course *course, const char *id);
/** The lesson's patient. @param seed of one that is drawn @thread any */
SONDE_API void sonde_lesson_patient(const sonde_lesson *lesson, uint64_t seed, sonde_case *out);

/** Lets the scripted expert examine the lesson's places `runs` times without guidance, each time
 *  with another hand (a drawn patient: each time another one), and takes the bar from that: the
 * mean score less two standard deviations, less what one press that has to be repeated costs, in
 * whole points.
 *  @param runs 2 to SONDE_BAR_RUNS @param directory of the case file @thread owner */
SONDE_API sonde_status sonde_lesson_measure(sonde_lesson *lesson, uint32_t runs,
                                            const char *directory, const sonde_progress *progress,
                                            sonde_error *error);
/** Writes the bars of all lessons that have one, atomically: `bar.json` of the course's directory.
 *  @thread owner */
SONDE_API sonde_status sonde_course_save_bars(const sonde_course *course, const char *path,
                                              sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
