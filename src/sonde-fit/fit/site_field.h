// How site parameters spread over the skin, and how smooth they should be.
#ifndef SONDE_SRC_FIT_SITE_FIELD_H
#define SONDE_SRC_FIT_SITE_FIELD_H

#include "fit/fit_inside.h"

// The model's interpolation written out: ln k0 of node i = sum_s basis[i * site_count + s] ln k0_s,
// and the same for ln xm. Asked from the tissue itself, so that both cannot differ.
sonde_status sonde_site_basis(const sonde_model *model, const sonde_site_table *sites,
                              double *basis, sonde_error *error);

// [site_count * site_count] row s: a site's value minus what a plane through its neighbours
// predicts there, a second difference on scattered sites. Rows sum to 0; a row is all 0 without
// neighbours.
sonde_status sonde_site_roughness(const sonde_site_table *sites, double *rows, sonde_error *error);

#endif
