// Inside of the room: draws keyed by what they are for, the making of a leg's frames, their files.
#ifndef SONDE_SRC_DATASET_H
#define SONDE_SRC_DATASET_H

#include "base/base.h"
#include "base/random.h"
#include "sonde/base_json.h"
#include "sonde/dataset.h"
#include "sonde/echo_scanner.h"
#include "sonde/sweep_truth.h"
#include "sonde/trainer_setup.h"

#include <sha2.h>

enum { SONDE_DATASET_PATH = 4096, SONDE_DATASET_TAR_BLOCK = 512 };

// What a random number is for. A number depends on the plan's seed, the leg, the press and this
// alone, so that neither the order of the work nor who does it changes it.
typedef enum sonde_dataset_purpose {
  SONDE_DATASET_FOR_PATIENT,
  SONDE_DATASET_FOR_SPECKLE,
  SONDE_DATASET_FOR_PLACE,
  SONDE_DATASET_FOR_HAND,
  SONDE_DATASET_FOR_FORCE,
  SONDE_DATASET_FOR_SCANNER,
  SONDE_DATASET_FOR_TIME
} sonde_dataset_purpose;
uint64_t sonde_dataset_key(uint64_t seed, uint32_t leg, uint32_t press,
                           sonde_dataset_purpose purpose);

// The patient of a leg: a case and its thigh. What cannot be built is drawn anew.
// @param[out] setup cleared by the caller, also after a failure
sonde_status sonde_dataset_draw_leg(const sonde_dataset_plan *plan, uint32_t leg,
                                    const char *bundled, sonde_case *patient,
                                    sonde_case_setup *setup, sonde_error *error);

// What a press starts with.
typedef struct sonde_dataset_press {
  sonde_pose start;     // world from probe, clear of the skin; it goes along +z
  bool along;           // looks along the vein
  char place[32];       // station, or segment of the vein
  double along_vein_m;  // from the groin end; NaN at a station
  double force_n, at_s; // of its last frame; time of heart and breath
  char scanner_name[64];
  sonde_scanner scanner;
  double aperture_m; // of its array
} sonde_dataset_press;
// One of the plan's scanners, from its file.
sonde_status sonde_dataset_scanner(const sonde_dataset_def *def, uint32_t which,
                                   sonde_scanner *scanner, sonde_error *error);
sonde_status sonde_dataset_draw_press(const sonde_dataset_def *def, uint32_t leg, uint32_t number,
                                      const sonde_case_setup *setup, double half_width_m,
                                      sonde_dataset_press *press, sonde_error *error);

// A vessel that the image plane of a frame meets.
typedef struct sonde_dataset_vessel {
  uint32_t number; // as in the labels
  const char *name;
  bool artery;
  sonde_vessel_state state;
  double tilt_rad;      // between the vessel and the plane's normal
  double x_m, z_m;      // its middle as the picture shows it, from the face's middle
  uint32_t lumen, clot; // pixels
} sonde_dataset_vessel;

// What is known of a frame beside its arrays.
typedef struct sonde_dataset_moment {
  uint32_t leg, press_number, frame;
  const sonde_case *patient;
  const sonde_case_setup *setup;
  const sonde_dataset_press *press;
  const sonde_truth *truth;
  sonde_pathology pathology; // of now
  sonde_pose pose;
  double force[3], torque[3]; // of the tissue on the probe, in its frame, N and N m
  double force_n, way_m;      // along the beam; since the press's first frame
  double residual;
  uint32_t jumps;
  uint32_t lines, samples; // of the envelope
  uint32_t vessel_count;
  sonde_dataset_vessel vessel[SONDE_BRANCHES + 2];
} sonde_dataset_moment;
// The JSON of a frame. @param[out] text [*count] freed by sonde_free()
sonde_status sonde_dataset_describe(const sonde_dataset_moment *moment, char **text, size_t *count,
                                    sonde_error *error);

// Green-Lagrange strain from rest of every pixel, in the probe's frame: xx yy zz xy xz yz; NaN in
// blood, bone and outside. @param[out] strain [height*width*6]
void sonde_dataset_strain(const sonde_interior *interior, sonde_pose probe,
                          const sonde_truth *truth, float *strain);

// What a leg has, for its index and the card.
typedef struct sonde_dataset_tally {
  uint32_t frames, stopped, clots;
  uint32_t closure[11]; // frames by the main vein's area ratio, in tenths; [10]: not in the plane
  uint64_t pixels[SONDE_LABEL_COUNT];
} sonde_dataset_tally;

typedef struct sonde_dataset_file {
  char path[80]; // below the directory
  uint64_t bytes;
  char sha256[SHA256_DIGEST_STRING_LENGTH];
} sonde_dataset_file;

typedef struct sonde_dataset_files {
  sonde_dataset_file *list; // [count] freed by sonde_free()
  uint32_t count, room;
} sonde_dataset_files;
// One more, all zero; NULL: no memory.
sonde_dataset_file *sonde_dataset_new_file(sonde_dataset_files *files);
// As the member "files": path, bytes and sum of each.
void sonde_dataset_put_files(sonde_json_out *out, const sonde_dataset_files *files);

// The files of one leg while they are written.
typedef struct sonde_dataset_store {
  const sonde_dataset_def *def;
  uint32_t leg;
  sonde_file *tar; // one open tar file
  char last[100];  // name of its last member
  SHA2_CTX sum;
  uint64_t bytes;
  void *made; // of a format of the program
  sonde_dataset_files files;
} sonde_dataset_store;
sonde_status sonde_dataset_store_open(sonde_dataset_store *store, const sonde_dataset_def *def,
                                      uint32_t leg, sonde_error *error);
sonde_status sonde_dataset_store_put(sonde_dataset_store *store, const sonde_dataset_frame *frame,
                                     sonde_error *error);
// Everything of the leg gets its place. Closing frees, and removes what has none yet.
sonde_status sonde_dataset_store_commit(sonde_dataset_store *store, sonde_error *error);
void sonde_dataset_store_close(sonde_dataset_store *store);

// A file written at once, aside and renamed; what a killed writer left beside it goes.
sonde_status sonde_dataset_save(const char *path, const void *bytes, size_t count,
                                sonde_error *error);

// Header of a member of a tar file (POSIX ustar): a plain file of owner 0, dated 0.
void sonde_dataset_tar_header(uint8_t block[SONDE_DATASET_TAR_BLOCK], const char *name,
                              uint64_t bytes);
// An array as a file of NumPy (.npy, version 1.0) from its numbers. @return freed by sonde_free()
sonde_status sonde_dataset_npy(const sonde_dataset_array *array, uint8_t **bytes, size_t *count,
                               sonde_error *error);

// Makes the frames of a leg into a store.
sonde_status sonde_dataset_make_leg(const sonde_dataset_def *def, uint32_t leg,
                                    sonde_dataset_store *store, sonde_dataset_tally *tally,
                                    double share_from, double share_to, sonde_error *error);

// A file of the directory.
void sonde_dataset_path(const char *directory, const char *name, char path[SONDE_DATASET_PATH]);
// The plan, with the version and the format, lies in the directory: what is added later must be
// like what is there. @return MISMATCH
sonde_status sonde_dataset_keep_plan(const sonde_dataset_def *def, sonde_error *error);
// Says that a leg is whole.
sonde_status sonde_dataset_index_leg(const sonde_dataset_store *store,
                                     const sonde_dataset_tally *tally, sonde_error *error);
// The index of a leg when the leg is whole: the index reads, and its files have the sizes that
// stand in it. @param[out] root freed by sonde_json_free(), also of a leg that is not whole
bool sonde_dataset_is_whole(const sonde_dataset_def *def, uint32_t leg, sonde_json **root);

// Sums over the legs that are whole, and every file.
typedef struct sonde_dataset_contents {
  uint32_t legs;
  sonde_dataset_tally all;
  uint64_t bytes;
  sonde_dataset_files files;
} sonde_dataset_contents;
sonde_status sonde_dataset_add_file(sonde_dataset_contents *contents, const char *path,
                                    uint64_t bytes, const char *sha256, sonde_error *error);
sonde_status sonde_dataset_gather(const sonde_dataset_def *def, sonde_dataset_contents *contents,
                                  sonde_error *error);
// Manifest, sums and data card of a whole data set, whose files are added to the contents.
sonde_status sonde_dataset_finish(const sonde_dataset_def *def, sonde_dataset_contents *contents,
                                  sonde_error *error);

#endif
