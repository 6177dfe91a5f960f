#!/usr/bin/env bash
# words.sh ROOT: a word has one meaning. tests/house/words.txt lists words that no function, type or file may carry in
# its name but in the folders where the word has its meaning, and what to write instead.
set -euo pipefail
root=$1
wrong=0
cd "$root"
mapfile -t files < <(find src app include -name '*.[ch]' | sort)
((${#files[@]} > 0)) || { echo "no C files found"; exit 1; }

# "place name" of every file, function and type.
names() {
  printf '%s\n' "${files[@]}" | sed -E 's|.*/([^/]*)\.[ch]$|& \1|'
  awk '
    /^[A-Za-z_][^=]*\(/ && !/;[ \t]*$/ { # a definition begins in column 0
      name = $0; sub(/\(.*/, "", name); sub(/.*[ *]/, "", name)
      if (name ~ /^[a-z]/) print FILENAME ":" FNR, name
    }
    /^} [a-z_0-9]+;/ { name = $2; sub(/;.*/, "", name); print FILENAME ":" FNR, name }
    /^(struct|enum) [a-z_0-9]+ {/ { print FILENAME ":" FNR, $2 }
  ' "${files[@]}"
}
list=$(mktemp)
trap 'rm -f "$list"' EXIT
names >"$list"
while IFS=';' read -r word places instead; do
  read -r word <<<"$word"
  [[ -z $word || $word == \#* ]] && continue
  found=$(awk -v word="$word" -v places="$places" '
    BEGIN { n = split(places, place, " ") }
    {
      for (k = 1; k <= n; k++) if (index($1, place[k])) next
      m = split($2, part, "_")
      for (k = 1; k <= m; k++) if (part[k] == word) { print; next }
    }' "$list")
  [[ -z $found ]] && continue
  sed "s/\$/: \"$word\", write$instead/" <<<"$found"
  wrong=$((wrong + $(wc -l <<<"$found")))
done <tests/house/words.txt
echo "$wrong names carry a word of another meaning"
((wrong == 0))
