#!/usr/bin/env bash
# docs.sh ROOT: a source file that a page of docs/ names is there, a function named after it
# (`src/x.c` `f`) stands in it, and every link from page to page has its target.
set -euo pipefail
root=$1
wrong=0
cd "$root"
while IFS=: read -r page name; do
  IFS='`' read -r _ file _ function _ <<<"$name"
  if [[ ! -e $file ]]; then
    echo "$page: $file is not there"
    wrong=$((wrong + 1))
  elif [[ -n $function ]] && ! grep -qw -- "$function" "$file"; then
    echo "$page: $file has no $function"
    wrong=$((wrong + 1))
  fi
done < <(grep -oE '`(src|app|include|web|tests|bench|samples)/[A-Za-z0-9_./-]+\.(c|h|ts|sh|mjs)`( `[A-Za-z_0-9]+`)?' docs/*.md README.md CONTRIBUTING.md || true)
while IFS=: read -r page link; do
  target=${link#](}
  target=${target%%#*}
  target=${target%)}
  [[ $page == */* ]] && folder=${page%/*} || folder=.
  [[ -z $target || $target == *://* || -e $folder/$target ]] && continue
  echo "$page: the link to $target leads nowhere"
  wrong=$((wrong + 1))
done < <(grep -oE '\]\([^) ]+\)' docs/*.md docs/decisions/*.md README.md CONTRIBUTING.md || true)
echo "$wrong names or links of the documentation lead nowhere"
((wrong == 0))
