#!/usr/bin/env bash
# abi.sh ROOT: says whether the public interface is the kept one, or has more (with SONDE_ABI_STRICT another one
# is red, as before a release); ./abi goes red on a small tree for a
# function that is gone, another parameter, another member, another value of a constant, and not for a new function.
set -euo pipefail
root=$1 wrong=0
"$root/abi" "$root" || [[ -z ${SONDE_ABI_STRICT:-} ]] || wrong=1
tree=$(mktemp -d)
trap 'rm -rf "$tree"' EXIT
mkdir -p "$tree/include/sonde" "$tree/tests/house"
header=$tree/include/sonde/a.h
cat >"$tree/clean.h" <<'END'
#ifndef A_H
#define A_H
#define SONDE_API __attribute__((visibility("default")))
typedef enum sonde_kind { SONDE_FIRST, SONDE_SECOND } sonde_kind;
typedef struct sonde_thing { int count; double length_m; sonde_kind kind; } sonde_thing;
SONDE_API int sonde_one(const sonde_thing *thing);
SONDE_API void sonde_two(const char *format, ...) __attribute__((format(printf, 1, 2)));
#endif
END
cp "$tree/clean.h" "$header"
"$root/abi" --keep "$tree" >/dev/null
expect() { # green|red SED WHAT
  local got=green
  sed "$2" "$tree/clean.h" >"$header"
  "$root/abi" "$tree" >/dev/null 2>&1 || got=red
  [[ $got == "$1" ]] || { echo "$3: expected $1, got $got"; wrong=1; }
}
expect green '' 'the kept interface'
expect green 's/^SONDE_API int.*/&\nSONDE_API int sonde_new(int a);/' 'a new function'
expect red '/sonde_two/d' 'a function that is gone'
expect red 's/(const sonde_thing \*thing)/(const sonde_thing *thing, int more)/' 'another parameter'
expect red 's/int count;/&  int more;/' 'a new member'
expect red 's/double length_m/float length_m/' 'a member of another type'
expect red 's/SONDE_FIRST, SONDE_SECOND/SONDE_SECOND, SONDE_FIRST/' 'constants in another order'
((wrong == 0))
