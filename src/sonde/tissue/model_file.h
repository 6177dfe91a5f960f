// Inside of the model file: the writer that collects arrays and the reader that finds them by name.
#ifndef SONDE_SRC_MODEL_FILE_H
#define SONDE_SRC_MODEL_FILE_H

#include "sonde/base_json.h"
#include "sonde/tissue_anatomy.h"

typedef struct sonde_model_writer {
  sonde_json_out header; // within its list `arrays`
  char *blob;
  size_t used, room;
  bool failed;
} sonde_model_writer;

typedef struct sonde_model_reader {
  const char *path;
  const sonde_json *header;
  const char *blob;
  size_t size;
  sonde_error *error;
} sonde_model_reader;

// Appends an array to the blob and describes it; a failure is kept in w->failed.
void sonde_model_put(sonde_model_writer *w, const char *name, const char *type, const char *unit,
                     uint32_t rows, uint32_t columns, const void *bytes);
// Bytes of a named array with `columns` columns; NULL after setting the error.
const void *sonde_model_take(const sonde_model_reader *r, const char *name, const char *type,
                             uint32_t columns, uint32_t *rows);

// The arrays of the anatomy, and its section of the header; a model without anatomy has neither.
void sonde_anatomy_put_arrays(sonde_model_writer *w, const sonde_thigh_anatomy *anatomy);
void sonde_anatomy_put_section(sonde_json_out *header, const sonde_thigh_anatomy *anatomy);
// Likewise of a volumetric model's inside; read when skin and law are there.
void sonde_bulk_put_arrays(sonde_model_writer *w, const sonde_model *model);
void sonde_bulk_put_section(sonde_json_out *header, const sonde_model *model);
sonde_status sonde_bulk_take(const sonde_model_reader *r, sonde_model *model);
sonde_status sonde_anatomy_take(const sonde_model_reader *r, sonde_model *model);

#endif
