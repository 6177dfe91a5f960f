/**
 * @file sweep_dicom.h
 * Pictures as DICOM files: a tracked sequence as Ultrasound Multi-frame Image, a single picture as
 * Secondary Capture, both Explicit VR Little Endian, 8-bit grey, with a calibrated region. Files
 * are written, not read (docs/dicom.md).
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

#ifdef __cplusplus
}
#endif
#endif
