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

while read -r lines file; do
  limit=800
  [[ $file == *.h ]] && limit=250
  [[ $file == total ]] || ((lines <= limit)) || fail "$file has $lines lines, expected $limit or fewer"
  [[ $file != "$root"/samples/*.c ]] || ((lines <= 80)) || fail "$file has $lines lines, expected 80 or fewer in a sample"
done < <(wc -l "${all[@]}")

# A static function that its file names once besides the definition is a single use: a reader has to
# leave the caller for it. A function whose address stands in a table or is passed on cannot be written in place: it is
# counted apart. Comments, strings and declarations do not count.
single() { # FILE...: each function called once; "room ROOM, static functions, called once"; "total, static functions, called once, used once or called once"
  awk -v root="$root/" '
    function close_file(  f, room) {
      room = substr(name, length(root) + 1)
      if (room ~ /^app/) room = "app/"; else match(room, /^[^\/]*\/[^\/]*\/[^\/]*\//) && room = substr(room, 1, RLENGTH)
      for (f in line) {
        total++
        of_room[room]++
        if (uses[f] - 1 - declared[f] > 1) continue
        once++
        if (calls[f] - 1 - declared[f] < 1) continue
        called++
        called_of[room]++
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
    END {
      close_file()
      for (f in of_room) print "room", f, of_room[f], called_of[f] + 0
      print "total", total + 0, called + 0, once + 0
    }
  ' "$@"
}
mapfile -t bodies < <(find "$root/src" "$root/app" -name '*.c')
single "${bodies[@]}" >"$list"
read -r _ total called once < <(tail -1 "$list")
echo "$called of $total static functions ($((total ? 100 * called / total : 0)) %) are called once and used nowhere else;" \
  "$once ($((total ? 100 * once / total : 0)) %) with those whose address is taken once"
((called * 100 <= MOST_SINGLE * total)) || fail "$called of $total static functions are called once, expected $MOST_SINGLE % or fewer"
((once * 100 <= MOST_RAW * total)) ||
  fail "$once of $total static functions are called once or have their address taken once, expected $MOST_RAW % or fewer"

while read -r _ room total called; do
  echo "$room: $called of $total static functions ($((total ? 100 * called / total : 0)) %) are called once"
  # A room of a few functions has no share worth a bound.
  ((total < 15 || called * 100 <= MOST_OF_ROOM * total)) ||
    fail "$room: $called of $total static functions are called once, expected $MOST_OF_ROOM % or fewer"
done < <(grep '^room ' "$list" | sort)

# The comment at the head of a file says what the file does; a table of its functions is no help.
while read -r head file; do
  ((head <= MOST_HEAD)) || fail "$file begins with $head lines of comment, expected $MOST_HEAD or fewer"
done < <(awk '
  function told() { if (file != "") print n + 0, file }
  FNR == 1 { told(); file = FILENAME; n = 0; ended = 0 }
  !/^\/\// && !/^ ?\*/ && !/^\/\*/ { ended = 1 }
  !ended { n++ }
  END { told() }' "${bodies[@]}")

mapfile -t inner < <(find "$root/src" "$root/app" -name '*.[ch]')
# "ROOM lines asserts" for src as a whole and for each room; what a macro is defined as does not count.
while read -r room lines count; do
  least=$LEAST_ASSERTS
  [[ $room == src ]] && least=15
  [[ $room == src ]] || ((lines >= 200)) || continue
  ((count * 1000 >= least * lines)) || fail "$room: $count asserts in $lines lines, expected $least per 1000"
  echo "$room: $((count * 1000 / lines)) asserts per 1000 lines"
done < <(awk -v root="$root/" '
    FNR == 1 {
      room = substr(FILENAME, length(root) + 1)
      if (room ~ /^app/) room = "app/"; else match(room, /^[^\/]*\/[^\/]*\/[^\/]*\//) && room = substr(room, 1, RLENGTH)
    }
    { lines[room]++ }
    !/#define/ {
      text = $0
      while (match(text, /(SONDE_ASSERT|_Static_assert|assert)\(/)) {
        if (RSTART == 1 || substr(text, RSTART - 1, 1) !~ /[A-Za-z0-9_]/) asserts[room]++
        text = substr(text, RSTART + RLENGTH)
      }
    }
    END {
      for (room in lines) {
        print room, lines[room], asserts[room] + 0
        if (room !~ /^app/) { all += lines[room]; said += asserts[room] }
      }
      print "src", all + 0, said + 0
    }' "${inner[@]}" | sort)
((bad == 0))
