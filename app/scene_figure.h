// A scene as it stands, as a drawing or a report.
#ifndef SONDE_APP_SCENE_FIGURE_H
#define SONDE_APP_SCENE_FIGURE_H

#include "sonde/sonde.h"

// All bodies in a parallel projection from above and the side, flat shaded, a colour each, with
// their names and the time. Up is against gravity, or z without any. A path that ends in .html gets
// a report with the same bodies, turned by hand, and their measures; any other an SVG drawing.
sonde_status scene_figure(const sonde_scene *scene, const sonde_scene_state *state,
                          const char *path, sonde_error *error);

#endif
