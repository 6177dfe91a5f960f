// Depth of convex bodies by a second method, against which the tests compare the first.
#ifndef SONDE_TESTS_CONTACT_EXPAND_H
#define SONDE_TESTS_CONTACT_EXPAND_H

#include "contact/contact.h"

/**
 * Depth by an expanding polytope of fixed room (van den Bergen 2001): within `tolerance_m` of the
 * least distance that parts the bodies, unless `converged` says otherwise.
 */
sonde_depth_result convex_expand(const sonde_convex *a, sonde_pose world_from_a,
                                 const sonde_convex *b, sonde_pose world_from_b,
                                 double tolerance_m);

#endif
