/**
 * @file base.h
 * Common ground of every room: status codes, errors, plain geometric types, memory hook, log.
 *
 * Units inside Sonde are SI (m, kg, s, N, Pa, rad, Hz). A name carries its unit when its type does
 * not say it. Millimetres, decibels and degrees exist only at the boundary (files, CLI, page).
 */
#ifndef SONDE_BASE_H
#define SONDE_BASE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SONDE_VERSION_MAJOR 0
#define SONDE_VERSION_MINOR 1
#define SONDE_VERSION_PATCH 0
#define SONDE_VERSION_STRING "0.1.0"

/** Version of the option structs (..._def). Their ..._def_default() functions write it into
 * `version`, and what takes such a struct refuses another one: a program that was built with other
 * headers, or that did not begin with the default, is told so. */
#define SONDE_DEF_VERSION 1

/** Marks a symbol of the public interface; everything else stays hidden in the shared library. */
#if defined(__GNUC__)
#define SONDE_API __attribute__((visibility("default")))
#else
#define SONDE_API
#endif

/** Every status with its sentence; sonde_status_text() reads it from here. */
#define SONDE_STATUS_LIST(X)                                                                       \
  X(OK, "success")                                                                                 \
  X(ARGUMENT, "an argument is outside its allowed range")                                          \
  X(MEMORY, "memory could not be allocated")                                                       \
  X(IO, "a file could not be read or written")                                                     \
  X(FORMAT, "a file does not have the expected format")                                            \
  X(CHECKSUM, "a file is damaged: its checksum does not match")                                    \
  X(VERSION, "a file was written by an unsupported version")                                       \
  X(MESH, "a mesh is not usable: it is open, degenerate or not manifold")                          \
  X(NOT_FOUND, "no item has that name")                                                            \
  X(CONVERGENCE, "an iteration did not converge")                                                  \
  X(DEVICE, "a device is absent or failed")                                                        \
  X(PORT, "a network port could not be opened")                                                    \
  X(CANCELLED, "the work was cancelled; what was finished is kept")                                \
  X(MISMATCH, "two inputs do not belong together")                                                 \
  X(DISK, "the disk is full or failed")

/** Result of every cold function; 0 is success. */
typedef enum sonde_status {
#define SONDE_STATUS_ENUM(name, text) SONDE_##name,
  SONDE_STATUS_LIST(SONDE_STATUS_ENUM)
#undef SONDE_STATUS_ENUM
      SONDE_STATUS_COUNT
} sonde_status;

/** What went wrong: one sentence that names file, line and what was expected. */
typedef struct sonde_error {
  sonde_status status;
  char where[64];    /**< function that failed */
  char message[512]; /**< one sentence, no trailing newline */
} sonde_error;

/** Sentence of a status; never NULL. @thread any */
SONDE_API const char *sonde_status_text(sonde_status status);

/** Version of the library as "major.minor.patch". @thread any */
SONDE_API const char *sonde_version(void);

/** Pressures of blood are given in mmHg at the boundary. */
#define SONDE_PA_PER_MMHG 133.322387415

typedef struct sonde_vec3 {
  double x, y, z;
} sonde_vec3;

/** Row-major 3x3 matrix. */
typedef struct sonde_mat3 {
  double m[3][3];
} sonde_mat3;

/** Unit quaternion, scalar first. */
typedef struct sonde_quat {
  double w, x, y, z;
} sonde_quat;

/** Rigid transform a_from_b: p_a = rotation * p_b + position (m). */
typedef struct sonde_pose {
  sonde_vec3 position;
  sonde_quat rotation;
} sonde_pose;

/** Memory hook; NULL members select malloc and free. Set before any other call. */
typedef struct sonde_allocator {
  void *(*allocate)(size_t bytes, void *user);
  void (*release)(void *pointer, void *user);
  void *user;
} sonde_allocator;

/** Installs the memory hook. @thread owner, before any object exists */
SONDE_API void sonde_set_allocator(const sonde_allocator *allocator);

typedef enum sonde_log_level { SONDE_LOG_INFO, SONDE_LOG_WARNING } sonde_log_level;

/** Receives the library's remarks; the library itself never prints. */
typedef void (*sonde_log_fn)(sonde_log_level level, const char *message, void *user);

/** Installs the log callback (NULL: silence). @thread owner, before any object exists */
SONDE_API void sonde_set_log(sonde_log_fn log, void *user);

/** Progress of long work: fraction in [0,1]; return false to cancel. May be NULL where taken. */
typedef struct sonde_progress {
  bool (*report)(double fraction, const char *what, void *user);
  void *user;
} sonde_progress;

/**
 * Reads one real number in the C locale whatever locale the program has set.
 * @param end receives the first unread character; equals text when nothing was read
 * @thread any
 */
SONDE_API double sonde_parse_real(const char *text, const char **end);

/** FNV-1a 64-bit hash of bytes, continued from seed (0 starts a new one). @thread any */
SONDE_API uint64_t sonde_hash(uint64_t seed, const void *bytes, size_t count);

/** An output file that is being written. */
typedef struct sonde_file sonde_file;

/**
 * Opens a file for atomic writing: bytes go to a temporary file beside the place that `path` leads
 * to, sonde_file_commit() renames it onto that place, sonde_file_discard() removes it. Symbolic
 * links are followed and stay; the mode of a file that is replaced stays. What is not a regular
 * file (a pipe, a terminal, /dev/null, /dev/stdout) is written into as it is.
 * @param[out] file owned by the caller until commit or discard
 * @return IO for a path that cannot be used (no such directory, no permission, a directory), DISK
 *   for a full or failing disk
 * @thread owner
 */
SONDE_API sonde_status sonde_file_create(const char *path, sonde_file **file, sonde_error *error);
/**
 * Whether sonde_file_create() could write there: asked before long work, so that its result has a
 * place. Changes nothing.
 * @return SONDE_OK, or what sonde_file_create() would fail with @thread owner
 */
SONDE_API sonde_status sonde_file_check(const char *path, sonde_error *error);
/**
 * Opens a file for writing at its end, made when it is absent: bytes of it beyond the first `keep`
 * are cut off. There is no temporary file: commit and discard leave what was written.
 * @param keep at most the file's size
 * @return IO, DISK
 * @thread owner
 */
SONDE_API sonde_status sonde_file_extend(const char *path, uint64_t keep, sonde_file **file,
                                         sonde_error *error);
/** Appends bytes; a failure is remembered and reported by flush and commit. @thread owner */
SONDE_API void sonde_file_write(sonde_file *file, const void *bytes, size_t count);
/** printf onto the file; a failure is remembered and reported by flush and commit. @thread owner */
SONDE_API void sonde_file_printf(sonde_file *file, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
/** Hands what was written to the system, so that the end of the program cannot lose it.
 * @return the first failure so far, as sonde_file_create() @thread owner */
SONDE_API sonde_status sonde_file_flush(sonde_file *file, sonde_error *error);
/** Path of the temporary file, for a program that writes it instead; NULL when there is none.
 * Valid until commit or discard. @thread owner */
SONDE_API const char *sonde_file_temporary(const sonde_file *file);
/** Flushes, syncs, renames onto the target and frees; after a failure the target is as it was and
 * the temporary file is gone. @return as sonde_file_create() @thread owner */
SONDE_API sonde_status sonde_file_commit(sonde_file *file, sonde_error *error);
/** Removes the temporary file and frees; NULL is ignored. @thread owner */
SONDE_API void sonde_file_discard(sonde_file *file);
/** Removes the temporary files of `path` whose program was killed; those that are being written
 * stay. @return how many were removed @thread any */
SONDE_API uint32_t sonde_file_remove_abandoned(const char *path);

/** An output file in memory, for text that becomes part of something else; sonde_file_take() ends
 * it. @return MEMORY @thread owner */
SONDE_API sonde_status sonde_file_in_memory(sonde_file **file, sonde_error *error);
/** Gives what was written to such a file, with a terminating 0 beyond `*count`, and frees the file.
 * @param[out] bytes freed by sonde_free() @return MEMORY @thread owner */
SONDE_API sonde_status sonde_file_take(sonde_file *file, char **bytes, size_t *count,
                                       sonde_error *error);

/** Makes a directory when it is absent. @param mode of mkdir(2) @param parents also those above it
 * @return IO, DISK @thread owner */
SONDE_API sonde_status sonde_directory_make(const char *path, unsigned mode, bool parents,
                                            sonde_error *error);

/** Reads a whole file; `*bytes` gets a terminating 0 beyond `*count` and is freed by sonde_free.
 *  @thread any */
SONDE_API sonde_status sonde_file_load(const char *path, char **bytes, size_t *count,
                                       sonde_error *error);
/** A number of a struct that a user may give by its name: a list of these describes the struct. */
typedef struct sonde_parameter {
  const char *name; /**< as on the command line, with the unit */
  const char *text; /**< what it means */
  double unit;      /**< SI per unit */
  double low, high; /**< least and largest value, SI */
  size_t offset;    /**< of the member, a double */
} sonde_parameter;

/** The member of a struct that the parameter describes. @param of borrowed @thread any */
SONDE_API double *sonde_parameter_of(void *of, const sonde_parameter *parameter);

/** Releases memory handed out by the library; NULL is ignored. @thread any */
SONDE_API void sonde_free(void *pointer);

#ifdef __cplusplus
}
#endif
#endif
