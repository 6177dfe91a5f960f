/**
 * @file sweep_frames.h
 * Tracked image sequences: reading and writing them, an image at any pose between their frames,
 * and how like two images are. Volumes are in sweep_volume.h.
 *
 * Memory holds metres; the files hold millimetres. Pixel (u, v) means the centre of the pixel in
 * column u and row v; u grows towards the marked side of the probe, v away from the probe (MF).
 */
#ifndef SONDE_SWEEP_FRAMES_H
#define SONDE_SWEEP_FRAMES_H

#include "sonde/echo.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Affine map a_from_b: p_a = M p_b + t, the rows of [M | t]. */
typedef struct sonde_affine {
  double m[3][4];
} sonde_affine;

/** A named text of a sequence or of one of its frames; one line each. */
typedef struct sonde_field {
  char *key, *value;
} sonde_field;

typedef struct sonde_tracked_frame {
  sonde_field *fields;
  uint32_t field_count, field_room;
  bool used;                     /**< has a pose and takes part; false until located */
  sonde_affine world_from_pixel; /**< pixel (u, v, 0) -> m */
} sonde_tracked_frame;

/** Frames of one size; owns everything it points to. */
typedef struct sonde_sequence {
  uint32_t width, height, count;
  char orientation[4]; /**< of the file: MF, UF, MN, UN, a third letter A; pixels are always MF */
  uint32_t clip[4];    /**< part of every frame that is used: column, row, width, height */
  sonde_tracked_frame file;    /**< fields of the whole file; no pose */
  sonde_tracked_frame *frames; /**< [count] */
  uint8_t *pixels;             /**< [count*height*width] */
} sonde_sequence;

/** Frame number that means the whole file. */
#define SONDE_WHOLE_FILE UINT32_MAX

/** Black frames without fields. @thread owner */
SONDE_API sonde_status sonde_sequence_create(uint32_t width, uint32_t height, uint32_t count,
                                             sonde_sequence *sequence, sonde_error *error);
SONDE_API void sonde_sequence_clear(sonde_sequence *sequence); /**< @thread owner */

/** Sets or replaces a field; key and value are copied.
 *  @param frame or SONDE_WHOLE_FILE @return MEMORY @thread owner */
SONDE_API sonde_status sonde_sequence_set(sonde_sequence *sequence, uint32_t frame, const char *key,
                                          const char *value, sonde_error *error);
/** Sets "<name>Transform" to 16 numbers and its status to OK.
 *  @param name such as ProbeToReference @param to_from_from in mm; from Image: mm from pixel
 *  @return MEMORY @thread owner */
SONDE_API sonde_status sonde_sequence_set_transform(sonde_sequence *sequence, uint32_t frame,
                                                    const char *name,
                                                    const sonde_affine *to_from_from,
                                                    sonde_error *error);

/**
 * Reads a MetaImage (.igs.mha) or NRRD (.igs.nrrd, .seq.nrrd) sequence of 8-bit grey frames, raw or
 * compressed, pixels in the same file. Frames whose status is INVALID are kept.
 * @return SONDE_FORMAT with file, line and what was expected
 * @thread owner
 */
SONDE_API sonde_status sonde_sequence_load(const char *path, sonde_sequence *sequence,
                                           sonde_error *error);
/**
 * Writes by the name's end: .mha, .seq.nrrd (four axes, as Slicer wants), .nrrd (three, as IGSIO
 * writes) or .dcm (sonde_sequence_save_dicom()). Equal sequences give equal bytes. @thread owner
 */
SONDE_API sonde_status sonde_sequence_save(const char *path, const sonde_sequence *sequence,
                                           bool compressed, sonde_error *error);

/** Transforms that hold for every frame. */
typedef struct sonde_calibration {
  uint32_t count;
  struct {
    char from[32], to[32];
    sonde_affine to_from_from; /**< in mm, as in the file; from Image: mm from pixel */
  } transforms[16];
  bool has_clip;
  uint32_t clip[4];
} sonde_calibration;

/** Reads the Transform elements and the clip rectangle of a PLUS configuration (XML), or the two
 *  matrices of a TUS-REC calib_matrix.csv. @thread owner */
SONDE_API sonde_status sonde_calibration_load(const char *path, sonde_calibration *calibration,
                                              sonde_error *error);

/** What sonde_sequence_locate() found. */
typedef struct sonde_located {
  uint32_t used, invalid, missing; /**< frames: with pose; status INVALID; without a way */
  char world[32];                  /**< the frame of reference that the poses are in */
} sonde_located;

/**
 * Gives every frame its pose by joining its transforms and the calibration's (either way round)
 * from Image to `world`; NULL takes the first of Reference, Tracker, World, Probe that is reached.
 * Frames whose image or needed transform is not OK are not used and counted.
 * @return SONDE_MISMATCH when no frame has a pose, SONDE_FORMAT for a transform without inverse
 * @thread owner
 */
SONDE_API sonde_status sonde_sequence_locate(sonde_sequence *sequence,
                                             const sonde_calibration *calibration,
                                             const char *world, sonde_located *located,
                                             sonde_error *error);

/** Pixel (u, v, 0) -> m for a picture of the probe's x-z plane, see docs/frames.md. @thread any */
SONDE_API sonde_affine sonde_slice_plane(sonde_pose world_from_probe, const sonde_image *image);
/** Gives a frame a picture of that plane: its pixels, ImageToProbe, ProbeToReference and an
 *  ImageStatus OK. @param image of the sequence's size @return ARGUMENT for another size, MEMORY
 *  @thread owner */
SONDE_API sonde_status sonde_sequence_set_picture(sonde_sequence *sequence, uint32_t frame,
                                                  sonde_pose world_from_probe,
                                                  const sonde_image *image, sonde_error *error);

typedef enum sonde_slice_method {
  SONDE_SLICE_BRACKET, /**< between the nearest frames on both sides, weighted by distance */
  SONDE_SLICE_NEAREST, /**< the nearest frame alone */
  SONDE_SLICE_KRIGE    /**< from two frames on either side, each scale of the picture weighted by
                            how far it is alike from frame to frame, measured in the sweep */
} sonde_slice_method;

typedef struct sonde_slicer_options {
  sonde_slice_method method;
  bool along_sweep;  /**< join frames pixel to pixel instead of across, see below; KRIGE chooses
                          the better one itself */
  double gap_m;      /**< frames further apart are not joined; default 10 mm */
  double reach_m;    /**< how far a frame speaks for itself with none beyond; default 1 mm */
  uint32_t left_out; /**< frame that is not used, SONDE_WHOLE_FILE: none (default) */
  uint32_t
      left_out_beside; /**< used frames on either side of it that are left out too; default 0 */
  uint32_t threads;    /**< 0 (default): all cores; results do not depend on it */
  bool once;      /**< few pictures are made: without the copy of the frames (1.4 bytes for each
                       used pixel, BRACKET across only) that makes many fast; the pictures are
                       the same */
  bool deviation; /**< pictures show instead how sure they are: the expected error's standard
                       deviation in quarters of a grey level, at most 255 (63.75 grey levels) */
} sonde_slicer_options;

SONDE_API sonde_slicer_options sonde_slicer_options_default(void); /**< @thread any */

typedef struct sonde_slicer sonde_slicer;

/** KRIGE measures the likeness of the frames here, the left-out ones excluded.
 *  @param sequence borrowed, located @thread owner */
SONDE_API sonde_status sonde_slicer_create(const sonde_sequence *sequence,
                                           const sonde_slicer_options *options,
                                           sonde_slicer **slicer, sonde_error *error);
SONDE_API void sonde_slicer_destroy(sonde_slicer *slicer); /**< @thread owner */
/**
 * Fills an image straight from the frames: each pixel lies between the planes of two frames and
 * takes their values where a line through it meets them, weighted by the distance to the other.
 * The line lies half way between their normals; along the sweep it runs from a pixel of one frame
 * to the same pixel of the other.
 * @param known [height*width] 1 where frames reach, else 0 (and the pixel is black); may be NULL
 * @return pixels that frames reach
 * @thread owner
 */
SONDE_API uint64_t sonde_slicer_render(sonde_slicer *slicer, const sonde_affine *world_from_pixel,
                                       sonde_image *image, uint8_t *known);

/**
 * The picture that the sweep itself would hold at a place between its frames, by KRIGE: pixel (x,
 * y) is pixel (x, y) + corner of the frames. Frames are joined, and their distance counted, as
 * foretells the frames of the sweep best.
 * @param place frame number, 7.5 lies between frames 7 and 8
 * @return pixels that frames reach
 * @thread owner
 */
SONDE_API uint64_t sonde_slicer_render_place(sonde_slicer *slicer, double place,
                                             const sonde_affine *world_from_pixel,
                                             const uint32_t corner[2], sonde_image *image,
                                             uint8_t *known);

/** How like two images are, over the known pixels. */
typedef struct sonde_likeness {
  uint64_t count;
  double rms_grey, mae_grey, psnr_db, ncc;
  double ssim; /**< windows of 7 x 7 whose pixels are all known; NaN without one */
} sonde_likeness;

/** @param known [height*width] or NULL for all @thread any */
SONDE_API sonde_status sonde_image_likeness(const uint8_t *a, const uint8_t *b,
                                            const uint8_t *known, uint32_t width, uint32_t height,
                                            sonde_likeness *likeness, sonde_error *error);

/** Every frame with a neighbour on both sides made again from the others. */
typedef struct sonde_left_out {
  uint32_t frames;
  uint32_t along_sweep; /**< frames whose place was joined pixel to pixel */
  /** Pooled rms and mae; means of the other measures over the frames. KRIGE at the
   *  place in the sweep and from the pose alone, BRACKET, NEAREST, and the mean of the frames
   * before and after without their poses. */
  sonde_likeness place, krige, bracket, nearest, neighbours;
} sonde_left_out;

/**
 * Compares over the pixels that all ways reach and that some frame shows brighter than black.
 * Nothing of a left-out frame but its pose enters its picture. `options` gives the bracket's way,
 * gap and reach and how many frames beside are left out too.
 * @param refine_poses correct the poses first (sweep_poses.h), once for every tenth frame without
 *        the content of these frames
 * @return SONDE_MISMATCH when fewer than three frames are used
 * @thread owner
 */
SONDE_API sonde_status sonde_sequence_leave_one_out(const sonde_sequence *sequence,
                                                    const sonde_slicer_options *options,
                                                    bool refine_poses, sonde_left_out *result,
                                                    const sonde_progress *progress,
                                                    sonde_error *error);

#ifdef __cplusplus
}
#endif
#endif
