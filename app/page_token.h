// The secret of the page's address, kept from one run of the program to the next, so that a page
// which is open finds the program again.
#ifndef SONDE_APP_PAGE_TOKEN_H
#define SONDE_APP_PAGE_TOKEN_H

#include "app.h"

// The token that the environment variable names; else the one in directory/name, a file that only
// its owner can read; else a new one, which is written there.
// @return ARGUMENT: the variable is no token; IO: the file belongs to somebody else or cannot be
// written
sonde_status page_token_find(const char *directory, const char *name, const char *variable,
                             char token[SONDE_PAGE_TOKEN], sonde_error *error);
// Private key and certificate of a class in directory/name, a file that only its owner can read;
// new ones are written there when it is missing.
// @return IO: the file holds something else, can be read by others, or cannot be written
sonde_status page_identity_find(const char *directory, const char *name,
                                char pem[SONDE_DOOR_IDENTITY], sonde_error *error);

#endif
