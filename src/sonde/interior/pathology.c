// Presets of the vein's state, found by name, lenient in separators and abbreviation.
#include "base/base.h"
#include "interior/interior.h"

#include <ctype.h>
#include <string.h>

enum { VENOUS_MMHG = 10, ARTERIAL_MMHG = 95 };

static const char *const names[] = {"healthy",
                                    "partial_mural",
                                    "free_floating",
                                    "acute_occlusive",
                                    "subacute_occlusive",
                                    "chronic_occlusive",
                                    "recanalised",
                                    NULL};

static const sonde_pathology presets[] = {
    {.name = "healthy", .lumen_scale = 1.0},
    {.name = "partial_mural",
     .thrombus_fraction = 0.45,
     .thrombus_modulus_pa = 12e3,
     .lumen_scale = 1.05,
     .echogenicity = 0.45},
    {.name = "free_floating",
     .thrombus_fraction = 0.45,
     .thrombus_modulus_pa = 6e3,
     .lumen_scale = 1.1,
     .echogenicity = 0.4,
     .form = SONDE_CLOT_FLOATING},
    {.name = "acute_occlusive",
     .thrombus_fraction = 1.0,
     .thrombus_modulus_pa = 6e3,
     .lumen_scale = 1.2,
     .echogenicity = 0.25},
    {.name = "subacute_occlusive",
     .thrombus_fraction = 1.0,
     .thrombus_modulus_pa = 24e3,
     .lumen_scale = 1.0,
     .echogenicity = 0.5},
    {.name = "chronic_occlusive",
     .thrombus_fraction = 1.0,
     .thrombus_modulus_pa = 45e3,
     .lumen_scale = 0.85,
     .echogenicity = 0.95},
    {.name = "recanalised",
     .thrombus_fraction = 0.65,
     .thrombus_modulus_pa = 45e3,
     .lumen_scale = 0.85,
     .echogenicity = 0.8,
     .form = SONDE_CLOT_RECANALISED},
};

const char *const *sonde_pathology_names(void) { return names; }

sonde_status sonde_pathology_preset(const char *name, sonde_pathology *pathology,
                                    sonde_error *error) {
  SONDE_ASSERT(pathology != NULL);
  SONDE_ASSERT(SONDE_COUNT_OF(presets) + 1 == SONDE_COUNT_OF(names));
  for (size_t k = 0; name != NULL && k < SONDE_COUNT_OF(presets); ++k) {
    // Same letters, '-' and ' ' read as '_'; a name may stop before a '_'.
    const char *known = presets[k].name;
    size_t i = 0;
    for (; name[i] != 0; ++i) {
      char c = name[i] == '-' || name[i] == ' ' ? '_' : (char)tolower((unsigned char)name[i]);
      if (c != known[i]) break;
    }
    if (name[i] != 0 || i == 0 || (known[i] != 0 && known[i] != '_')) continue;
    *pathology = presets[k];
    pathology->venous_pressure_pa = VENOUS_MMHG * SONDE_PA_PER_MMHG;
    pathology->arterial_pressure_pa = ARTERIAL_MMHG * SONDE_PA_PER_MMHG;
    return SONDE_OK;
  }
  char known[160] = "";
  for (size_t k = 0, used = 0; names[k] != NULL; ++k)
    used += (size_t)snprintf(known + used, sizeof known - used, "%s%s",
                             k == 0                 ? ""
                             : names[k + 1] == NULL ? " or "
                                                    : ", ",
                             names[k]);
  return sonde_fail(error, SONDE_NOT_FOUND, "unknown case '%s'; expected %s",
                    name != NULL ? name : "", known);
}
