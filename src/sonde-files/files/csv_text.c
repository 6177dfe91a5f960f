// Texts in CSV files.
#include "sonde/files.h"

#include "base/base.h"

void sonde_csv_put_text(sonde_file *file, const char *utf8) {
  SONDE_ASSERT(file && utf8);
  sonde_file_printf(file, "\"");
  for (const char *c = utf8; *c; ++c) sonde_file_printf(file, *c == '"' ? "\"\"" : "%c", *c);
  sonde_file_printf(file, "\"");
}
