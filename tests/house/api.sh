#!/usr/bin/env bash
# api.sh ROOT NM LIBRARY... -- FOLDER...: the shared libraries export exactly the functions and constants
# that the public headers declare (SONDE_API) and those that another library of the house calls
# (SONDE_LINK), each in one library, and each SONDE_LINK has such a caller. The first library, libsonde,
# has at most 200 public functions, and another library or an object in the folders (programs, samples,
# benchmarks; not tests) calls each of them.
set -euo pipefail
MOST=200
root=$1 nm=$2
shift 2
libraries=()
while [[ $1 != -- ]]; do libraries+=("$1"); shift; done
shift
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
for library in "${libraries[@]}"; do
  "$nm" -D --defined-only "$library" | symbols >>"$work/all"
  "$nm" -D --undefined-only "$library" | symbols >>"$work/imported"
done
sort "$work/all" | uniq -d >"$work/twice"
sort -u "$work/all" >"$work/exported"
sort -u "$work/api" "$work/link" >"$work/named"
echo "$(wc -l <"$work/api") public functions, $(wc -l <"$work/link") for other libraries," \
  "$(wc -l <"$work/exported") symbols exported by ${#libraries[@]} libraries"
"$nm" -D --defined-only "${libraries[0]}" | symbols | comm -12 - "$work/api" >"$work/first"
{ cat "$work/imported"
  find "$@" -name '*.o' -exec "$nm" --undefined-only {} + | symbols; } | sort -u >"$work/called"
count=$(wc -l <"$work/first")
echo "$count public functions in ${libraries[0]##*/}, expected $MOST or fewer"
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
fault "public, but no program, sample, benchmark or other library calls it" < <(
  comm -23 "$work/first" "$work/called")
[[ -s $work/api ]] && ((wrong == 0 && count <= MOST))
