// TLS of a class's door: the key and certificate that it makes, and the context of its connections.
// TLS 1.3 only: it has no renegotiation, so that reading never waits for writing and the reverse.
#include "stream/door.h"

#include "sonde/stream_door.h"

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

static sonde_status fail_tls(sonde_error *error, sonde_status status, const char *what) {
  char why[160] = "";
  ERR_error_string_n(ERR_get_error(), why, sizeof why);
  ERR_clear_error();
  return sonde_fail(error, status, "%s: %s", what, why);
}

// A certificate's extension in the notation of openssl.cnf.
static bool add_extension(X509 *certificate, int kind, const char *value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, certificate, certificate, NULL, NULL, 0);
  X509_EXTENSION *extension = X509V3_EXT_conf_nid(NULL, &context, kind, value);
  bool added = extension && X509_add_ext(certificate, extension, -1) == 1;
  X509_EXTENSION_free(extension);
  return added;
}

static bool fill_certificate(X509 *certificate, EVP_PKEY *key) {
  static const long LIFE_S = 10L * 365 * 24 * 3600;
  char host[65] = "", names[128];
  unsigned char serial[8] = {0};
  gethostname(host, sizeof host - 1);
  // A host's name is letters, digits and '-'; one with other characters stays out.
  bool named = host[0] && !host[strspn(host, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                             "0123456789-.")];
  snprintf(names, sizeof names, "IP:127.0.0.1,DNS:localhost%s%s", named ? ",DNS:" : "",
           named ? host : "");
  X509_NAME *subject = X509_get_subject_name(certificate);
  BIGNUM *number = NULL;
  bool good = getrandom(serial, sizeof serial, 0) == (ssize_t)sizeof serial;
  serial[0] &= 0x7f; // a positive number
  good = good && (number = BN_bin2bn(serial, sizeof serial, NULL)) != NULL &&
         BN_to_ASN1_INTEGER(number, X509_get_serialNumber(certificate)) != NULL;
  BN_free(number);
  return good && X509_set_version(certificate, X509_VERSION_3) == 1 &&
         X509_gmtime_adj(X509_getm_notBefore(certificate), -3600) &&
         X509_gmtime_adj(X509_getm_notAfter(certificate), LIFE_S) &&
         X509_set_pubkey(certificate, key) == 1 &&
         X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_ASC,
                                    (const unsigned char *)"Sonde class", -1, -1, 0) == 1 &&
         X509_set_issuer_name(certificate, subject) == 1 &&
         add_extension(certificate, NID_basic_constraints, "critical,CA:FALSE") &&
         add_extension(certificate, NID_ext_key_usage, "serverAuth") &&
         add_extension(certificate, NID_subject_alt_name, names) &&
         X509_sign(certificate, key, EVP_sha256()) > 0;
}

sonde_status sonde_door_identity_make(char pem[SONDE_DOOR_IDENTITY], sonde_error *error) {
  SONDE_ASSERT(pem);
  EVP_PKEY *key = EVP_EC_gen("P-256");
  X509 *certificate = X509_new();
  BIO *text = BIO_new(BIO_s_mem());
  char *bytes = NULL;
  long size = 0;
  if (key && certificate && text && fill_certificate(certificate, key) &&
      PEM_write_bio_PrivateKey(text, key, NULL, NULL, 0, NULL, NULL) == 1 &&
      PEM_write_bio_X509(text, certificate) == 1)
    size = BIO_get_mem_data(text, &bytes);
  bool made = size > 0 && size < SONDE_DOOR_IDENTITY;
  if (made) {
    memcpy(pem, bytes, (size_t)size);
    pem[size] = 0;
  }
  BIO_free(text);
  X509_free(certificate);
  EVP_PKEY_free(key);
  return made ? SONDE_OK : fail_tls(error, SONDE_IO, "the class's certificate could not be made");
}

sonde_status sonde_door_code_make(char code[SONDE_DOOR_CODE], sonde_error *error) {
  static const char LETTERS[33] = "ABCDEFGHJKLMNPQRSTUVWXYZ23456789"; // no I, O, 0, 1
  unsigned char bytes[SONDE_DOOR_CODE - 1];
  SONDE_ASSERT(code);
  if (getrandom(bytes, sizeof bytes, 0) != (ssize_t)sizeof bytes)
    return sonde_fail(error, SONDE_IO, "the kernel gave no random bytes for the class's code");
  for (size_t i = 0; i < sizeof bytes; ++i) code[i] = LETTERS[bytes[i] & 31];
  code[sizeof bytes] = 0;
  return SONDE_OK;
}

SSL_CTX *door_context_make(const char *identity, sonde_error *error) {
  SSL_CTX *context = SSL_CTX_new(TLS_server_method());
  BIO *text = BIO_new_mem_buf(identity, -1);
  EVP_PKEY *key = text ? PEM_read_bio_PrivateKey(text, NULL, NULL, NULL) : NULL;
  BIO_free(text);
  text = BIO_new_mem_buf(identity, -1);
  X509 *certificate = text ? PEM_read_bio_X509(text, NULL, NULL, NULL) : NULL, *above = NULL;
  bool good = context && key && certificate &&
              SSL_CTX_set_min_proto_version(context, TLS1_3_VERSION) == 1 &&
              SSL_CTX_use_certificate(context, certificate) == 1 &&
              SSL_CTX_use_PrivateKey(context, key) == 1 &&
              SSL_CTX_check_private_key(context) == 1 && SSL_CTX_set_num_tickets(context, 0) == 1;
  while (good && (above = PEM_read_bio_X509(text, NULL, NULL, NULL)))
    if (SSL_CTX_add0_chain_cert(context, above) != 1) {
      X509_free(above);
      good = false;
    }
  if (good) {
    SSL_CTX_set_mode(context, SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER |
                                  SSL_MODE_RELEASE_BUFFERS);
    SSL_CTX_set_session_cache_mode(context, SSL_SESS_CACHE_OFF);
    ERR_clear_error(); // of the end of the certificates
  } else {
    fail_tls(error, SONDE_ARGUMENT,
             "the class's identity is not a private key with its certificate in PEM");
    SSL_CTX_free(context);
    context = NULL;
  }
  BIO_free(text);
  X509_free(certificate);
  EVP_PKEY_free(key);
  return context;
}

void sonde_door_fingerprint(const sonde_door *door, char text[SONDE_DOOR_FINGERPRINT]) {
  unsigned char digest[EVP_MAX_MD_SIZE];
  unsigned count = 0;
  SONDE_ASSERT(door && text);
  X509_digest(SSL_CTX_get0_certificate(door->context), EVP_sha256(), digest, &count);
  text[0] = 0;
  for (unsigned i = 0; i < count && i < 32; ++i)
    snprintf(text + 3 * i - (i > 0), 4, "%s%02X", i ? ":" : "", (unsigned)digest[i]);
}
