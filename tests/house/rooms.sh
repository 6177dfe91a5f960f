#!/usr/bin/env bash
# rooms.sh ROOT: src/rooms.txt lists every folder src/<library>/<room> once, with a library, what the room does
# and pages that exist, and the table of docs/architecture.md is the one that docs/rooms.sh writes.
set -euo pipefail
root=$1
here=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)
bad=0
complain() { echo "$1"; bad=$((bad + 1)); }

rooms=0 listed=$'\n' folders=$'\n'
while IFS='|' read -r head does pages; do
  read -r group room <<<"$head"
  [[ $room =~ ^[a-z_]+$ ]] || complain "src/rooms.txt: '$room' is no name of a room"
  [[ $group =~ ^sonde(-(exam|files|fit|limb|sweep|scene|solid))?$ ]] || complain "$room: '$group' is no library"
  [[ $listed != *$'\n'$room$'\n'* ]] || complain "$room: listed twice"
  [[ -d $root/src/$group/$room ]] || complain "$room: src/$group/$room does not exist"
  [[ $does == *[a-z]* && $pages == *[a-z]* ]] || complain "$room: expected what it does and a page"
  for page in $pages; do
    [[ -e $root/$page ]] || complain "$room: $page does not exist"
  done
  listed+=$room$'\n' folders+=$group/$room$'\n'
  rooms=$((rooms + 1))
done < <(grep -vE '^(#|$)' "$root/src/rooms.txt")
for folder in "$root"/src/*/*/; do
  folder=${folder#"$root/src/"} folder=${folder%/}
  [[ $folders == *$'\n'$folder$'\n'* ]] || complain "src/$folder: not in src/rooms.txt"
done
"$here/../../docs/rooms.sh" --check "$root" || bad=$((bad + 1))
echo "$rooms rooms, $bad wrong"
((rooms > 0 && bad == 0))
