#!/usr/bin/env bash
# docs/rooms.sh [--check] [ROOT]: writes the table of rooms in docs/architecture.md from
# src/rooms.txt. With --check it writes nothing and fails when the page's table is another one.
set -euo pipefail
check=false
if [[ ${1-} == --check ]]; then check=true; shift; fi
root=${1-$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)}
page=$root/docs/architecture.md
first='^<!-- rooms:' last='^<!-- end of rooms -->$'

link() { # PAGE: a page of docs/ as a link, any other file by its path
  local name=${1#docs/}
  if [[ $name == "$1" ]]; then printf '`%s`' "$1"; else printf '[%s](%s)' "$name" "$name"; fi
}

table() {
  local group room does pages page links
  echo
  echo '| library | room | does | read |'
  echo '|---|---|---|---|'
  while IFS='|' read -r room does pages; do
    read -r group room <<<"$room" # without blanks around
    read -r does <<<"$does"
    links=
    for page in $pages; do links+="${links:+, }$(link "$page")"; done
    echo "| \`$group\` | \`$room\` | $does | $links |"
  done < <(grep -vE '^(#|$)' "$root/src/rooms.txt")
  echo
}

if [[ $(grep -cE "$first" "$page") != 1 || $(grep -cE "$last" "$page") != 1 ]]; then
  echo "$page: expected one line '<!-- rooms: ...' and one line '<!-- end of rooms -->'" >&2
  exit 1
fi
new=$(mktemp)
trap 'rm -f "$new"' EXIT
{
  sed "/$first/q" "$page"
  table
  sed -n "/$last/,\$p" "$page"
} >"$new"
if $check; then
  diff -u "$page" "$new" || { echo "$page: run docs/rooms.sh" >&2; exit 1; }
else
  cmp -s "$page" "$new" || cat "$new" >"$page"
fi
