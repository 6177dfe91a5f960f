// Token, document keys and handshake: see page_secret.h.
#include "stream/page_secret.h"

#include "files/png.h"
#include "sonde/stream.h"

#include <errno.h>
#include <sha1.h>
#include <string.h>
#include <sys/random.h>

enum { BLOCK = 64, LONGEST = 512 }; // bytes of a block; of a text that is hashed with a key

void page_sha1(const void *bytes, size_t count, unsigned char digest[PAGE_SHA1_BYTES]) {
  SONDE_ASSERT(bytes && digest);
  SHA1_CTX sum;
  SHA1Init(&sum);
  SHA1Update(&sum, bytes, count);
  SHA1Final(digest, &sum);
}

void page_hmac_sha1(const char *key, const char *text, unsigned char digest[PAGE_SHA1_BYTES]) {
  size_t key_size = strlen(key), text_size = strlen(text);
  SONDE_ASSERT(key_size <= BLOCK && text_size <= LONGEST);
  unsigned char inner[BLOCK + LONGEST], outer[BLOCK + PAGE_SHA1_BYTES];
  for (size_t i = 0; i < BLOCK; ++i) {
    unsigned char k = i < key_size ? (unsigned char)key[i] : 0;
    inner[i] = k ^ 0x36;
    outer[i] = k ^ 0x5c;
  }
  memcpy(inner + BLOCK, text, text_size);
  page_sha1(inner, BLOCK + text_size, outer + BLOCK);
  page_sha1(outer, sizeof outer, digest);
}

void page_accept_key(const char *key, char accept[PAGE_ACCEPT_TEXT]) {
  static const char GUID[] = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";
  char text[64 + sizeof GUID];
  unsigned char digest[PAGE_SHA1_BYTES];
  SONDE_ASSERT(strlen(key) <= 64);
  int size = snprintf(text, sizeof text, "%s%s", key, GUID);
  page_sha1(text, (size_t)size, digest);
  sonde_base64_write(digest, sizeof digest, accept);
}

static void write_digits(const unsigned char *bytes, char text[PAGE_SECRET_TEXT]) {
  for (size_t i = 0; i < (PAGE_SECRET_TEXT - 1) / 2; ++i)
    snprintf(text + 2 * i, 3, "%02x", (unsigned)bytes[i]);
}

void page_document_key(const char *token, const char *path, char key[PAGE_SECRET_TEXT]) {
  unsigned char digest[PAGE_SHA1_BYTES];
  SONDE_ASSERT(token && path && key);
  page_hmac_sha1(token, path, digest);
  write_digits(digest, key);
}

bool page_secret_equal(const char *secret, const char *given) {
  if (!secret || !given) return false;
  size_t size = strlen(secret), count = strlen(given);
  unsigned difference = size == count ? 0 : 1;
  for (size_t i = 0; i < count; ++i) // every character of `given`, whatever came before
    difference |=
        (unsigned)(unsigned char)given[i] ^ (unsigned)(unsigned char)secret[size ? i % size : 0];
  return difference == 0 && size > 0;
}

sonde_status sonde_page_token_make(char token[SONDE_PAGE_TOKEN], sonde_error *error) {
  unsigned char bytes[(SONDE_PAGE_TOKEN - 1) / 2];
  _Static_assert((int)SONDE_PAGE_TOKEN == (int)PAGE_SECRET_TEXT,
                 "a token is 128 bits in hexadecimal");
  SONDE_ASSERT(token);
  ssize_t got = getrandom(bytes, sizeof bytes, 0);
  if (got != (ssize_t)sizeof bytes)
    return sonde_fail(error, SONDE_IO, "the kernel gave no random bytes for the page's token: %s",
                      strerror(errno));
  write_digits(bytes, token);
  return SONDE_OK;
}

bool sonde_page_token_valid(const char *token) {
  return token && strlen(token) == SONDE_PAGE_TOKEN - 1 &&
         strspn(token, "0123456789abcdef") == SONDE_PAGE_TOKEN - 1;
}
