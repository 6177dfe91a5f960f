#!/usr/bin/env bash
# includes.sh ROOT: a room includes only itself and the rooms above it in src/rooms.txt; app/ and
# samples/ include public headers only.
set -euo pipefail
root=$1
mapfile -t rooms < <(sed -nE 's/^[^# ]+ +([a-z_]+) .*/\1/p' "$root/src/rooms.txt")
mapfile -t folders < <(sed -nE 's/^([^# ]+) +([a-z_]+) .*/\1\/\2/p' "$root/src/rooms.txt")
bad=0

rank() {
  local i
  for i in "${!rooms[@]}"; do
    [[ ${rooms[i]} == "$1" ]] && { echo "$i"; return; }
  done
  echo -1
}

complain() {
  echo "$1: includes \"$2\": $3"
  bad=$((bad + 1))
}

quoted_includes() { sed -n 's/^[ \t]*#[ \t]*include[ \t]*"\([^"]*\)".*/\1/p' "$1"; }

# A file of a room, inside (src/) or public (include/sonde/).
check_room_file() { # FILE RANK
  local include target
  while read -r include; do
    case $include in
    *..*) complain "$1" "$include" "no way up the tree" ;;
    sonde/*) target=${include#sonde/} target=${target%.h} target=${target%%_*} ;; # a room's second header
    */*) target=${include%%/*} ;;
    *) [[ -e $(dirname "$1")/$include ]] || complain "$1" "$include" "not in the same directory"
      continue ;;
    esac
    local other
    other=$(rank "${target-}")
    if ((other < 0)); then complain "$1" "$include" "not a room"
    elif ((other > $2)); then complain "$1" "$include" "that room is below ${rooms[$2]}"; fi
  done < <(quoted_includes "$1")
}

check_outsider() { # FILE
  local include
  while read -r include; do
    case $include in
    sonde/*) [[ -e $root/include/$include ]] || complain "$1" "$include" "no such header" ;;
    */*) complain "$1" "$include" "only sonde/ headers are public" ;;
    *) [[ -e $(dirname "$1")/$include ]] || complain "$1" "$include" "not in the same directory" ;;
    esac
  done < <(quoted_includes "$1")
  if grep -nE '^[ \t]*#[ \t]*include[ \t]*<sonde' "$1"; then complain "$1" "<sonde...>" "use quotes"; fi
}

files=0
for i in "${!rooms[@]}"; do
  while read -r file; do
    check_room_file "$file" "$i"
    files=$((files + 1))
  done < <(find "$root/src/${folders[i]}" "$root/include/sonde/${rooms[i]}.h" \
    "$root/include/sonde/${rooms[i]}_"*.h -name '*.[ch]' 2>/dev/null)
done
while read -r file; do
  check_outsider "$file"
  files=$((files + 1))
done < <(find "$root/app" "$root/samples" -name '*.[ch]' 2>/dev/null)

echo "$files files, $bad wrong includes"
((files > 0 && bad == 0))
