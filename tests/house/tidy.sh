#!/usr/bin/env bash
# tidy.sh ROOT BUILD [FILE...]: clang-tidy with the checks of .clang-tidy finds nothing in the sources of
# src/ and app/ (or in FILE...) as BUILD compiles them: once each, though tests compile some of them anew.
set -euo pipefail
root=$1 build=$2
shift 2
tidy=$(command -v clang-tidy-14 || command -v clang-tidy)
commands=$(mktemp -d)
trap 'rm -rf "$commands"' EXIT
awk 'BEGIN { RS = "}" }
  !match($0, /"file": "[^"]*"/) { printf "%s", $0; next }
  !seen[substr($0, RSTART, RLENGTH)]++ { printf "%s}", $0 }' "$build/compile_commands.json" >"$commands/compile_commands.json"
files=("$@")
((${#files[@]})) || mapfile -t files < <(grep -oE '"file": "[^"]*"' "$commands/compile_commands.json" |
  cut -d'"' -f4 | grep -E "^$root/(src|app)/" | sort)
((${#files[@]} > 0)) || { echo "no sources in $build/compile_commands.json"; exit 1; }
found=$(printf '%s\0' "${files[@]}" |
  xargs -0 -P "$(nproc)" -n 32 "$tidy" --quiet -p "$commands" 2>/dev/null) || true
echo "${#files[@]} files"
[[ -z $found ]] || { echo "$found"; exit 1; }
