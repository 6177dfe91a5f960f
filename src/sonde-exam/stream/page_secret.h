// Secrets of the page: the token of its address, keys of single documents, and the answer to a
// WebSocket handshake. SHA-1 stands here because RFC 6455 asks for it; as HMAC-SHA1 (RFC 2104) it
// also makes the keys.
#ifndef SONDE_SRC_STREAM_PAGE_SECRET_H
#define SONDE_SRC_STREAM_PAGE_SECRET_H

#include "base/base.h"

enum {
  PAGE_SHA1_BYTES = 20,
  PAGE_SECRET_TEXT = 33, // 128 bits as 32 hexadecimal digits, and the end
  PAGE_ACCEPT_TEXT = 29, // 20 bytes in base64, and the end
};

// FIPS 180-4. @thread any
void page_sha1(const void *bytes, size_t count, unsigned char digest[PAGE_SHA1_BYTES]);
// RFC 2104 with SHA-1; `key` has at most 64 bytes. @thread any
void page_hmac_sha1(const char *key, const char *text, unsigned char digest[PAGE_SHA1_BYTES]);
// Sec-WebSocket-Accept of a Sec-WebSocket-Key (RFC 6455, 4.2.2); `key` has at most 64 characters.
// @thread any
void page_accept_key(const char *key, char accept[PAGE_ACCEPT_TEXT]);
// Key that opens the document at `path` and no other: the first 128 bits of HMAC-SHA1 of the path
// with the token. @thread any
void page_document_key(const char *token, const char *path, char key[PAGE_SECRET_TEXT]);
// Compares in a time that depends on the length of `given` alone. NULL and another length: false.
// @thread any
bool page_secret_equal(const char *secret, const char *given);

#endif
