#!/usr/bin/env bash
# tidy.sh ROOT BUILD [FILE...]: clang-tidy with the checks of .clang-tidy finds nothing in the sources of
# src/ and app/ (or in FILE...) as BUILD compiles them.
set -euo pipefail
root=$1 build=$2
shift 2
tidy=$(command -v clang-tidy-14 || command -v clang-tidy)
files=("$@")
((${#files[@]})) || mapfile -t files < <(grep -oE '"file": "[^"]*"' "$build/compile_commands.json" |
  cut -d'"' -f4 | grep -E "^$root/(src|app)/" | sort -u)
((${#files[@]} > 0)) || { echo "no sources in $build/compile_commands.json"; exit 1; }
found=$(printf '%s\0' "${files[@]}" |
  xargs -0 -P "$(nproc)" -n 16 "$tidy" --quiet -p "$build" 2>/dev/null) || true
echo "${#files[@]} files"
[[ -z $found ]] || { echo "$found"; exit 1; }
