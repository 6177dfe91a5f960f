// SONDE_LINK marks a function of one library of the house that another library of the house calls.
// The shared library exports such a function, but no public header declares it, so that programs
// cannot rely on it.
#ifndef SONDE_SRC_LINK_H
#define SONDE_SRC_LINK_H

#define SONDE_LINK __attribute__((visibility("default")))

#endif
