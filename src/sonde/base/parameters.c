// Parameters of a struct by a list of names, units and ranges.
#include "base/parameters.h"

#include "base/base.h"

#include <math.h>

double *sonde_parameter_of(void *of, const sonde_parameter *parameter) {
  SONDE_ASSERT(of && parameter);
  return (double *)(void *)((char *)of + parameter->offset);
}

void sonde_parameters_forget(void *of, const sonde_parameter *list, size_t count) {
  for (size_t k = 0; k < count; ++k) *sonde_parameter_of(of, &list[k]) = NAN;
}

sonde_status sonde_parameters_check(const void *of, const sonde_parameter *list, size_t count,
                                    bool complete, sonde_error *error) {
  SONDE_ASSERT(of && list);
  const double slack = 1e-9; // 30 degrees or 3 mm may be a last bit beyond
  for (size_t k = 0; k < count; ++k) {
    const sonde_parameter *p = &list[k];
    double value = *(const double *)(const void *)((const char *)of + p->offset);
    if (value >= p->low - slack && value <= p->high + slack) continue;
    if (isnan(value) && !complete) continue;
    return sonde_fail(error, SONDE_ARGUMENT, "%s is %g, expected %g to %g (%s)", p->name,
                      value / p->unit, p->low / p->unit, p->high / p->unit, p->text);
  }
  return SONDE_OK;
}
