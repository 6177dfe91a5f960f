/**
 * @file sweep_dicom.h
 * Pictures as DICOM files: a tracked sequence as Ultrasound Multi-frame Image, a single picture as
 * Secondary Capture, both 8-bit grey, with a calibrated region; findings as Comprehensive SR. All
 * are Explicit VR Little Endian. Files are written, not read (docs/dicom.md).
 */
#ifndef SONDE_SWEEP_DICOM_H
#define SONDE_SWEEP_DICOM_H

#include "sonde/sweep_frames.h"

#ifdef __cplusplus
extern "C" {
#endif

/** What a file says beside its pixels; texts are UTF-8, NULL: nothing known. */
typedef struct sonde_dicom_about {
  const char *study;      /**< what the UIDs of study and series are made of, so that files of one
                               exam belong together; NULL: the pixels */
  const char *patient_id; /**< at most 64 characters; NULL: SIMULATED */
  const char *date;  /**< of study and picture, YYYY-MM-DD and, behind one character, HH:MM:SS */
  const char *title; /**< of the series, at most 64 characters */
  char side;         /**< of the leg: L, R; 0: not known */
  uint32_t series;   /**< its number, 0: 1; a series has files of one kind */
  uint32_t number;   /**< of the file within its series, 0: 1 */
} sonde_dicom_about;

/**
 * Writes the frames with their time stamps; the fields of every frame (poses, forces, truth) stand
 * in a private text. Equal input gives equal bytes.
 * @param about NULL: nothing is said
 * @return ARGUMENT when the frames have no ImageToProbe, differ in pixel size, or are more than a
 *         file takes (4 GiB of pixels) @thread owner
 */
SONDE_API sonde_status sonde_sequence_save_dicom(const char *path, const sonde_sequence *sequence,
                                                 const sonde_dicom_about *about,
                                                 sonde_error *error);
/** Writes one picture of known width and height. @return as sonde_file_create() @thread owner */
SONDE_API sonde_status sonde_image_save_dicom(const char *path, const sonde_image *image,
                                              const sonde_dicom_about *about, sonde_error *error);

/* ---- structured reports -------------------------------------------------------------------- */

/** Scheme of the house's own codes. */
#define SONDE_DICOM_SCHEME "99SONDE"

/** A coded word: at most 16 characters, the scheme that has it (DCM, SCT, UCUM,
 *  SONDE_DICOM_SCHEME), what it means (at most 64 characters). */
typedef struct sonde_dicom_code {
  const char *value, *scheme, *meaning;
} sonde_dicom_code;

typedef enum sonde_dicom_kind {
  SONDE_DICOM_CONTAINER, /**< what stands below it belongs together */
  SONDE_DICOM_TEXT,
  SONDE_DICOM_CODE,
  SONDE_DICOM_NUMBER,
  SONDE_DICOM_PICTURE /**< a picture that sonde_image_save_dicom() wrote */
} sonde_dicom_kind;

/** How an item stands to the one that it is below. */
typedef enum sonde_dicom_relation {
  SONDE_DICOM_CONTAINS,
  SONDE_DICOM_OBSERVED, /**< who or what observed */
  SONDE_DICOM_MODIFIES, /**< the name above is meant so */
  SONDE_DICOM_PROPERTY,
  SONDE_DICOM_ACQUIRED /**< how the picture above was taken */
} sonde_dicom_relation;

/** An item of a report; texts are borrowed. */
typedef struct sonde_dicom_item {
  uint32_t level; /**< 0: the report itself, the first and no other; it is below the nearest item
                       before it of a lower level, of at most one less */
  sonde_dicom_relation relation;
  sonde_dicom_kind kind;
  sonde_dicom_code name;
  sonde_dicom_code code; /**< of a CODE; the unit (UCUM) of a NUMBER */
  double number;
  const char *text;                     /**< of a TEXT: UTF-8, not empty */
  const sonde_image *image;             /**< of a PICTURE, and */
  const sonde_dicom_about *image_about; /**< what was said about it */
} sonde_dicom_item;

/**
 * Writes findings as Comprehensive SR, complete and not verified. Equal input gives equal bytes.
 * @param items [count] depth first, at least two
 * @param about with a date and a time
 * @return ARGUMENT without a date; as sonde_file_create() @thread owner
 */
SONDE_API sonde_status sonde_report_save_dicom(const char *path, const sonde_dicom_item *items,
                                               uint32_t count, const sonde_dicom_about *about,
                                               sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
