#!/usr/bin/env bash
# includes.sh ROOT: a room includes only itself and the rooms above it in src/rooms.txt; app/ and
# samples/ include public headers only.
set -euo pipefail
root=$1 list=$(mktemp)
trap 'rm -f "$list"' EXIT
public=$root/include/sonde
while read -r library room; do
  find "$root/src/$library/$room" "$public/$room.h" "$public/${room}_"*.h -name '*.[ch]' -printf "$room %p\n" 2>/dev/null || true
done < <(sed -nE 's/^([^# ]+) +([a-z_]+) .*/\1 \2/p' "$root/src/rooms.txt") >"$list"
find "$root/app" "$root/samples" -name '*.[ch]' -printf '- %p\n' >>"$list" 2>/dev/null || true

# A line with the room (- for an outsider), one with the path.
sed 's/ /\n/' "$list" |
  awk -v rooms="$(sed -nE 's/^[^# ]+ +([a-z_]+) .*/\1/p' "$root/src/rooms.txt" | tr '\n' ' ')" -v root="$root" '
    BEGIN { n = split(rooms, name, " "); for (i = 1; i <= n; ++i) rank[name[i]] = i }
    function complain(what) { print file ": includes \"" include "\": " what; bad++ }
    function is_there(path,   line, there) { there = (getline line <path) >= 0; close(path); return there }
    function near() { path = file; sub(/[^\/]*$/, include, path); if (!is_there(path)) complain("not in the same directory") }
    function of_room(   target) {
      if (include ~ /\.\./) { complain("no way up the tree"); return }
      if (include !~ /\//) { near(); return }
      target = include
      if (sub(/^sonde\//, "", target)) { sub(/\.h$/, "", target); sub(/_.*/, "", target) } # a room has further headers
      else sub(/\/.*/, "", target)
      if (!(target in rank)) complain("not a room")
      else if (rank[target] > rank[room]) complain("that room is below " room)
    }
    function of_outsider() {
      if (include ~ /^sonde\//) { if (!is_there(root "/include/" include)) complain("no such header") }
      else if (include ~ /\//) complain("only sonde/ headers are public")
      else near()
    }
    NR % 2 { room = $0; next }
    {
      file = $0
      files++
      while ((getline line <file) > 0) {
        if (line !~ /^[ \t]*#[ \t]*include/) continue
        include = line
        if (sub(/^[ \t]*#[ \t]*include[ \t]*"/, "", include)) { sub(/".*/, "", include); if (room == "-") of_outsider(); else of_room() }
        else if (room == "-" && line ~ /<sonde/) { include = "<sonde...>"; complain("use quotes") }
      }
      close(file)
    }
    END { print files + 0 " files, " bad + 0 " wrong includes"; exit bad > 0 || files == 0 }'
