// The same headers from C++.
#include <sonde/sonde.h>

#include <cstring>

int main() {
  static_assert(sizeof(sonde_vec3) == 3 * sizeof(double), "plain data");
  return std::strcmp(sonde_version(), SONDE_VERSION_STRING) != 0;
}
