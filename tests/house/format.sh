#!/usr/bin/env bash
# format.sh ROOT: every C file has the layout that clang-format 14 gives it by ROOT/.clang-format. Other
# versions lay out some lines differently, so that the version is part of the rule.
set -euo pipefail
root=$1
[[ -s $root/.clang-format ]] || { echo "no .clang-format in $root"; exit 1; }
command -v clang-format-14 >/dev/null || { echo "clang-format-14 is missing"; exit 1; }
directories=()
for name in src include app tests bench samples fuzz; do
  [[ ! -d $root/$name ]] || directories+=("$root/$name")
done
mapfile -t files < <(find "${directories[@]}" -name '*.[ch]' | sort)
((${#files[@]} > 0)) || { echo "no C files found"; exit 1; }
echo "${#files[@]} files"
clang-format-14 --style=file --dry-run --Werror "${files[@]}"
