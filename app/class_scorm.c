// A package of SCORM 1.2 (ADL 2001): a ZIP file with a manifest and the page that a learning
// management system opens in a frame. The page joins learner and class by a ticket (docs/class.md).
#include "class_scorm.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>
#include <zip.h>

// Content packaging 1.1.2 with ADL's extensions; adlcp:datafromlms comes to the page as
// cmi.launch_data. Who passes is the class's decision: there is no mastery score.
static const char MANIFEST[] =
    "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
    "<manifest identifier=\"sonde-class\" version=\"1.2\"\n"
    "    xmlns=\"http://www.imsproject.org/xsd/imscp_rootv1p1p2\"\n"
    "    xmlns:adlcp=\"http://www.adlnet.org/xsd/adlcp_rootv1p2\"\n"
    "    xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\"\n"
    "    xsi:schemaLocation=\"http://www.imsproject.org/xsd/imscp_rootv1p1p2 "
    "imscp_rootv1p1p2.xsd http://www.adlnet.org/xsd/adlcp_rootv1p2 adlcp_rootv1p2.xsd\">\n"
    "  <metadata>\n"
    "    <schema>ADL SCORM</schema>\n"
    "    <schemaversion>1.2</schemaversion>\n"
    "  </metadata>\n"
    "  <organizations default=\"class\">\n"
    "    <organization identifier=\"class\">\n"
    "      <title>Compression ultrasound of the leg</title>\n"
    "      <item identifier=\"exam\" identifierref=\"page\" isvisible=\"true\">\n"
    "        <title>Exam on the simulator</title>\n"
    "        <adlcp:datafromlms>%s</adlcp:datafromlms>\n"
    "      </item>\n"
    "    </organization>\n"
    "  </organizations>\n"
    "  <resources>\n"
    "    <resource identifier=\"page\" type=\"webcontent\" adlcp:scormtype=\"sco\" "
    "href=\"index.html\">\n"
    "      <file href=\"index.html\"/>\n"
    "    </resource>\n"
    "  </resources>\n"
    "</manifest>\n";

// ---- a ZIP file in memory, for the library that writes it

typedef struct archive {
  unsigned char bytes[1 << 21];
  size_t size, at; // written so far, where the next byte goes
} archive;

static voidpf archive_open(voidpf to, const char *name, int mode) {
  (void)name, (void)mode;
  return to;
}

static uLong archive_write(voidpf to, voidpf stream, const void *bytes, uLong count) {
  archive *a = stream;
  (void)to;
  if (count > sizeof a->bytes - a->at) return 0;
  memcpy(a->bytes + a->at, bytes, count);
  a->at += count;
  if (a->size < a->at) a->size = a->at;
  return count;
}

static long archive_tell(voidpf to, voidpf stream) {
  (void)to;
  return (long)((archive *)stream)->at;
}

static long archive_seek(voidpf to, voidpf stream, uLong offset, int origin) {
  archive *a = stream;
  (void)to;
  const size_t from = origin == ZLIB_FILEFUNC_SEEK_SET   ? 0
                      : origin == ZLIB_FILEFUNC_SEEK_CUR ? a->at
                                                         : a->size;
  if (offset > a->size - from) return -1;
  a->at = from + offset;
  return 0;
}

// Closing it needs nothing; what does not fit has been told by archive_write().
static int archive_good(voidpf to, voidpf stream) {
  (void)to, (void)stream;
  return 0;
}

// Files have the first date that ZIP knows, so that equal classes give equal packages.
static int add(zipFile zip, const char *name, const char *bytes, size_t size) {
  const zip_fileinfo about = {.tmz_date = {.tm_year = 1980, .tm_mday = 1}};
  assert(size > 0);
  int code = zipOpenNewFileInZip(zip, name, &about, NULL, 0, NULL, 0, NULL, Z_DEFLATED,
                                 Z_BEST_COMPRESSION);
  if (code == ZIP_OK) code = zipWriteInFileInZip(zip, bytes, (unsigned)size);
  return code == ZIP_OK ? zipCloseFileInZip(zip) : code;
}

sonde_status class_scorm_write(const char *path, const char *address, sonde_error *error) {
  static archive packed;
  char manifest[sizeof MANIFEST + SONDE_PAGE_ADDRESS], directory[4096], page[4200], *html = NULL;
  size_t size = 0;
  assert(path[0] && !strpbrk(address, "<>&"));
  if (!app_data_directory("scorm", directory, sizeof directory))
    return app_error(error, SONDE_NOT_FOUND,
                     "%s: the page of the package is not installed: %s; build with "
                     "SONDE_BUILD_WEB=ON",
                     path, directory);
  snprintf(page, sizeof page, "%s/index.html", directory);
  sonde_status status = sonde_file_load(page, &html, &size, error);
  if (status) return status;
  packed.size = packed.at = 0;
  zlib_filefunc_def io = {.zopen_file = archive_open,
                          .zwrite_file = archive_write,
                          .ztell_file = archive_tell,
                          .zseek_file = archive_seek,
                          .zclose_file = archive_good,
                          .zerror_file = archive_good,
                          .opaque = &packed};
  zipFile zip = zipOpen2(NULL, APPEND_STATUS_CREATE, NULL, &io);
  const int length = snprintf(manifest, sizeof manifest, MANIFEST, address);
  int code = zip ? add(zip, "imsmanifest.xml", manifest, (size_t)length) : ZIP_INTERNALERROR;
  if (code == ZIP_OK) code = add(zip, "index.html", html, size);
  const int closed = zip ? zipClose(zip, NULL) : code;
  sonde_free(html);
  if (code != ZIP_OK || closed != ZIP_OK)
    return app_error(error, SONDE_MEMORY, "%s: there is no memory to pack it", path);
  sonde_file *file = NULL;
  status = sonde_file_create(path, &file, error);
  if (status) return status;
  sonde_file_write(file, packed.bytes, packed.size);
  return sonde_file_commit(file, error);
}
