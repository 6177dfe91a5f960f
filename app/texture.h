// Statistics of a picture's texture, by which stills of a scanner and simulated ones are compared.
#ifndef SONDE_APP_TEXTURE_H
#define SONDE_APP_TEXTURE_H

#include "sonde/sonde.h"

enum { TEXTURE_FEATURES = 26, TEXTURE_QUANTILES = 3, TEXTURE_MOST_PATCHES = 4096 };

// Features of the patches of some pictures.
typedef struct texture_table {
  uint32_t patches, dark; // that count, that do not
  double feature[TEXTURE_FEATURES][TEXTURE_MOST_PATCHES];
} texture_table;

// Adds the patches of a picture, brought to a width of 512 pixels, of which dark ones do not count;
// at most `most` of them.
void texture_add(texture_table *table, const sonde_image *image, uint32_t most);
// Quantiles 10, 50 and 90 % of every feature; sorts the table.
void texture_quantiles(texture_table *table, double quantile[TEXTURE_FEATURES][TEXTURE_QUANTILES]);
const char *texture_name(uint32_t feature);

#endif
