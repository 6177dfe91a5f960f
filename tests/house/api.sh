#!/usr/bin/env bash
# api.sh ROOT LIBRARY NM: the shared library exports exactly the functions that the public headers
# declare.
set -euo pipefail
root=$1 library=$2 nm=$3
declared=$(mktemp) exported=$(mktemp)
trap 'rm -f "$declared" "$exported"' EXIT
cat "$root"/include/sonde/*.h | tr '\n' ' ' | grep -oE 'SONDE_API [^;({]*\(' |
  grep -oE 'sonde_[a-z0-9_]+ *\($' | tr -d ' (' | sort -u >"$declared"
"$nm" -D --defined-only "$library" | awk '{ print $3 }' | sed 's/@.*//' |
  grep -vE '^(_init|_fini|__asan.*|__odr.*|___asan.*)$' | sort -u >"$exported"
echo "$(wc -l <"$declared") functions declared, $(wc -l <"$exported") symbols exported"
missing=$(comm -23 "$declared" "$exported")
extra=$(comm -13 "$declared" "$exported")
[[ -z $missing ]] || printf 'declared but not exported: %s\n' $missing
[[ -z $extra ]] || printf 'exported but not declared: %s\n' $extra
[[ -s $declared && -z $missing && -z $extra ]]
