// Inside of the model file: the writer that collects arrays and the reader that finds them by name.
#ifndef SONDE_SRC_MODEL_FILE_H
#define SONDE_SRC_MODEL_FILE_H

#include "sonde/tissue_anatomy.h"

#include <cjson/cJSON.h>

typedef struct sonde_model_writer {
  cJSON *arrays;
  char *blob;
  size_t used, room;
  bool failed;
} sonde_model_writer;

typedef struct sonde_model_reader {
  const char *path;
  const cJSON *header;
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

// The section `anatomy` of the header and its arrays; a model without anatomy has none.
void sonde_anatomy_put(sonde_model_writer *w, cJSON *header, const sonde_model *model);
sonde_status sonde_anatomy_take(const sonde_model_reader *r, sonde_model *model);

#endif
