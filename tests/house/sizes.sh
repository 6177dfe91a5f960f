#!/usr/bin/env bash
# sizes.sh ROOT: functions, files, headers and the density of asserts keep to the house's measures.
# Functions are found by the layout that clang-format gives them: they start in column 0 and their
# closing brace stands alone in column 0.
set -euo pipefail
root=$1
bad=0
fail() { echo "TOO MUCH: $1"; bad=$((bad + 1)); }

functions() { # FILE...: "length file:line name" per function
  awk '
    FNR == 1 { start = 0; open = 0 }
    /^[A-Za-z_]/ && !open && /^(typedef|struct|union|enum|extern)[ a-z_A-Z0-9]*{?$/ { start = 0; next }
    /^[A-Za-z_].*\(/ && !open && !start { start = FNR; text = "" }
    start && !open {
      text = text $0
      if ($0 ~ /;[ \t]*(\/\/.*)?$/ && $0 !~ /{/) { start = 0; next } # a declaration
      if ($0 ~ /= *{/) { start = 0; next }                            # a table
      if ($0 ~ /{/) {
        name = text; sub(/\(.*/, "", name); sub(/.*[ *]/, "", name)
        if ($0 ~ /}[ \t]*$/) { print FNR - start + 1, FILENAME ":" start, name; start = 0 }
        else open = 1
      }
      next
    }
    open && /^}/ { print FNR - start + 1, FILENAME ":" start, name; start = 0; open = 0 }
  ' "$@"
}

mapfile -t code < <(find "$root/src" "$root/app" "$root/include" -name '*.[ch]' | sort)
mapfile -t all < <(find "$root/src" "$root/app" "$root/include" "$root/tests" "$root/samples" \
  -name '*.[ch]' 2>/dev/null | sort)
list=$(mktemp)
trap 'rm -f "$list"' EXIT
functions "${code[@]}" | sort -n >"$list"
count=$(wc -l <"$list")
((count > 0)) || { echo "no functions found"; exit 1; }
at() { awk -v k="$1" 'NR == k { print $1 }' "$list"; }
median=$(at $(((count + 1) / 2))) p90=$(at $(((count * 9 + 9) / 10))) longest=$(tail -1 "$list")
echo "$count functions: median $median, p90 $p90, longest $longest"
((median <= 12)) || fail "the median function has $median lines, expected 12 or fewer"
((p90 <= 45)) || fail "one function in ten has $p90 lines or more, expected 45 or fewer"
while read -r length place name; do
  ((length <= 80)) || fail "$place: $name has $length lines, expected 80 or fewer"
done <"$list"

for file in "${all[@]}"; do
  lines=$(wc -l <"$file") limit=800
  [[ $file == *.h ]] && limit=250
  ((lines <= limit)) || fail "$file has $lines lines, expected $limit or fewer"
done
while read -r file; do
  lines=$(wc -l <"$file")
  ((lines <= 80)) || fail "$file has $lines lines, expected 80 or fewer in a sample"
done < <(find "$root/samples" -name '*.c' 2>/dev/null)

mapfile -t inside < <(find "$root/src" -name '*.[ch]')
lines=$(cat "${inside[@]}" | wc -l)
asserts=$(cat "${inside[@]}" | grep -v '#define' | grep -oE '\b(SONDE_ASSERT|_Static_assert)\(' | wc -l)
echo "$asserts asserts in $lines lines of src: $((asserts * 1000 / lines)) per 1000"
((asserts * 1000 >= 15 * lines)) || fail "fewer than 15 asserts per 1000 lines of src"
((bad == 0))
