#!/usr/bin/env bash
# sizes.sh ROOT: functions, files, headers and the density of asserts keep to the house's measures.
# Functions are found by the layout that clang-format gives them: they start in column 0 and their
# closing brace stands alone in column 0.
set -euo pipefail
root=$1
# Per cent of the static functions that are called once: of the tree, with those whose address is taken once, of a room; lines;
# per 1000 lines.
MOST_SINGLE=27 MOST_RAW=35 MOST_OF_ROOM=45 MOST_HEAD=12 LEAST_ASSERTS=10
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
((median <= 20)) || fail "the median function has $median lines, expected 20 or fewer"
((p90 <= 50)) || fail "one function in ten has $p90 lines or more, expected 50 or fewer"
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

# A static function that its file names once besides the definition is a single use: a reader has to
# leave the caller for it. A function whose address stands in a table or is passed on cannot be written in place: it is
# counted apart. Comments, strings and declarations do not count.
single() { # FILE...: each function called once; "total, static functions, called once, used once or called once"
  awk '
    function close_file(  f) {
      for (f in line) {
        total++
        if (uses[f] - 1 - declared[f] > 1) continue
        once++
        if (calls[f] - 1 - declared[f] < 1) continue
        called++
        print "once", name ":" line[f], f
      }
      delete line; delete uses; delete calls; delete declared
    }
    FNR == 1 { if (NR > 1) close_file(); name = FILENAME; comment = 0; head = "" }
    {
      text = $0
      gsub(/"([^"\\]|\\.)*"/, "", text); sub(/\/\/.*/, "", text); gsub(/\/\*[^*]*\*\//, "", text)
      if (comment) { if (text !~ /\*\//) next; sub(/.*\*\//, "", text); comment = 0 }
      if (text ~ /\/\*/) { sub(/\/\*.*/, "", text); comment = 1 }
      rest = text
      while (match(rest, /[A-Za-z_][A-Za-z_0-9]*/)) {
        word = substr(rest, RSTART, RLENGTH); rest = substr(rest, RSTART + RLENGTH)
        uses[word]++
        if (rest ~ /^ *\(/) calls[word]++
      }
      if (head == "" && text ~ /^static / && text !~ /=/) { head = " "; first = FNR }
      if (head != "") {
        head = head text
        if (text ~ /[{;]/) {
          if (head ~ /\(/ && head !~ /=.*{/) {
            f = head; sub(/\(.*/, "", f); sub(/.*[ *]/, "", f)
            if (head ~ /;[ \t]*$/ && head !~ /{/) declared[f]++; else line[f] = first
          }
          head = ""
        }
      }
    }
    END { close_file(); print "total", total + 0, called + 0, once + 0 }
  ' "$@"
}
mapfile -t bodies < <(find "$root/src" "$root/app" -name '*.c')
single "${bodies[@]}" >"$list"
read -r _ total called once < <(tail -1 "$list")
share() { echo $((total ? 100 * $1 / total : 0)); }
echo "$called of $total static functions ($(share called) %) are called once and used nowhere else;" \
  "$once ($(share once) %) with those whose address is taken once"
((called * 100 <= MOST_SINGLE * total)) || fail "$called of $total static functions are called once, expected $MOST_SINGLE % or fewer"
((once * 100 <= MOST_RAW * total)) ||
  fail "$once of $total static functions are called once or have their address taken once, expected $MOST_RAW % or fewer"

for room in "$root"/src/*/*/ "$root/app/"; do
  mapfile -t inside < <(find "$room" -name '*.c')
  ((${#inside[@]} > 0)) || continue
  single "${inside[@]}" >"$list"
  read -r _ total called once < <(tail -1 "$list")
  ((total > 0)) || continue
  echo "${room#"$root"/}: $called of $total static functions ($(share called) %) are called once"
  # A room of a few functions has no share worth a bound.
  ((total < 15 || called * 100 <= MOST_OF_ROOM * total)) ||
    fail "${room#"$root"/}: $called of $total static functions are called once, expected $MOST_OF_ROOM % or fewer"
done

# The comment at the head of a file says what the file does; a table of its functions is no help.
for file in "${bodies[@]}"; do
  head=$(awk '!/^\/\// && !/^ ?\*/ && !/^\/\*/ { exit } { n++ } END { print n + 0 }' "$file")
  ((head <= MOST_HEAD)) || fail "$file begins with $head lines of comment, expected $MOST_HEAD or fewer"
done

asserts() { # PER_1000 WHAT FILE...
  local least=$1 what=$2 lines count
  shift 2
  lines=$(cat "$@" | wc -l)
  count=$(cat "$@" | grep -v '#define' | grep -oE '\b(SONDE_ASSERT|_Static_assert|assert)\(' | wc -l || true)
  ((count * 1000 >= least * lines)) || fail "$what: $count asserts in $lines lines, expected $least per 1000"
  echo "$what: $((count * 1000 / lines)) asserts per 1000 lines"
}
mapfile -t inside < <(find "$root/src" -name '*.[ch]')
asserts 15 src "${inside[@]}"
for room in "$root"/src/*/*/; do
  mapfile -t inside < <(find "$room" -name '*.[ch]')
  ((${#inside[@]} > 0)) || continue
  (($(cat "${inside[@]}" | wc -l) < 200)) || asserts "$LEAST_ASSERTS" "${room#"$root"/}" "${inside[@]}"
done
mapfile -t inside < <(find "$root/app" -name '*.[ch]')
(($(cat "${inside[@]}" | wc -l) < 200)) || asserts "$LEAST_ASSERTS" app/ "${inside[@]}"
((bad == 0))
