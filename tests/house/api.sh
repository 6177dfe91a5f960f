#!/usr/bin/env bash
# api.sh ROOT NM LIBRARY...: the shared libraries export exactly the functions and constants that the
# public headers declare (SONDE_API) and those that another library of the house calls (SONDE_LINK),
# each in one library, and each SONDE_LINK has such a caller.
set -euo pipefail
root=$1 nm=$2
shift 2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
declared() { # MACRO FILE...: the names that the declarations with MACRO introduce
  local macro=$1
  shift
  cat "$@" /dev/null | tr '\n' ' ' | grep -oE "$macro [^;({=]*[(;[]" |
    grep -oE 'sonde_[a-z0-9_]+ *[(;[]$' | tr -d ' (;[' | sort -u
}
symbols() { awk '$NF ~ /^[a-z]/ && $NF !~ /^(asan|tsan|ubsan)/ { sub(/@.*/, "", $NF); print $NF }' | sort -u; }
mapfile -t inner < <(find "$root/src" -name '*.h')
declared SONDE_API "$root"/include/sonde/*.h >"$work/api"
{ declared SONDE_LINK "${inner[@]}" || true; } >"$work/link"
for library; do
  "$nm" -D --defined-only "$library" | symbols >>"$work/all"
  "$nm" -D --undefined-only "$library" | symbols >>"$work/imported"
done
sort "$work/all" | uniq -d >"$work/twice"
sort -u "$work/all" >"$work/exported"
sort -u "$work/api" "$work/link" >"$work/named"
echo "$(wc -l <"$work/api") public functions, $(wc -l <"$work/link") for other libraries," \
  "$(wc -l <"$work/exported") symbols exported by $# libraries"
wrong=0
fault() { # SENTENCE: one line of standard input is one fault
  local name
  while read -r name; do
    echo "$name: $1"
    wrong=1
  done
}
fault "declared but not exported" < <(comm -23 "$work/named" "$work/exported")
fault "exported but not declared" < <(comm -13 "$work/named" "$work/exported")
fault "exported by two libraries" <"$work/twice"
fault "SONDE_LINK, but no other library calls it" < <(comm -23 "$work/link" <(sort -u "$work/imported"))
fault "both SONDE_API and SONDE_LINK" < <(comm -12 "$work/api" "$work/link")
[[ -s $work/api ]] && ((wrong == 0))
