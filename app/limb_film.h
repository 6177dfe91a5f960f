// A walk along the main vein of a limb as an animated picture of sections.
#ifndef SONDE_APP_LIMB_FILM_H
#define SONDE_APP_LIMB_FILM_H

#include "app.h"

// Writes the walk from the external iliac vein to the ankle as an APNG. @param pose NULL: at rest
sonde_status limb_film_write(const sonde_limb *limb, const sonde_limb_pose *pose, const char *path,
                             sonde_error *error);

#endif
