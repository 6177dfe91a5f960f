#!/usr/bin/env bash
# hot_symbols.sh ROOT BUILD OBJDUMP: nothing that the tick path can reach allocates, locks, prints or
# waits. The call graph is read from the disassembly of the built objects, started at every function
# of the hot files, and followed through the whole library; a function whose address is taken counts
# as called. Calls through pointers are not followed: what they may reach has to be hot itself.
set -euo pipefail
root=$1 build=$2 objdump=$3
forbidden='^(malloc|calloc|realloc|reallocarray|free|strdup|aligned_alloc|posix_memalign|mmap|munmap'
forbidden+='|pthread_(mutex|cond|rwlock|spin|barrier|create|join|once).*|mtx_.*|cnd_.*|sem_.*|syscall'
forbidden+='|_*(v|f|s|n|d|a)*printf(_chk)?|puts|putc|putchar|fputs|fputc|fwrite|fread|fopen(64)?|fclose'
forbidden+='|fflush|perror|write|read|open(64)?|close|ioctl|syslog|nanosleep|clock_nanosleep|usleep'
forbidden+='|sleep|poll|select|sched_yield|exit|abort|system|getenv|qsort|std(out|err|in))$'

object_of() { # src/<library>/<room>/<rest>.c
  local rest=${1#src/*/*/}
  local folder=${1%"/$rest"}
  echo "$build/$folder/CMakeFiles/sonde_${folder##*/}.dir/$rest.o"
}

# "object symbol..." per hot file: the object, then what this file may use all the same.
list=$(mktemp)
trap 'rm -f "$list"' EXIT
{
  grep -vE '^(#|$)' "$root/tests/house/hot_objects.txt" || true
  (cd "$root" && find src -name '*_hot.c' | sort)
} | while read -r path allowed; do
  object=$(object_of "$path")
  [[ -e $object ]] || { echo "$path: no object $object: the list and the build disagree" >&2; exit 1; }
  echo "$object $allowed"
done >"$list"
find "$build/src" -path '*/sonde_*.dir/kernel_*_hot.c.o' >>"$list" # written by models.cmake
[[ -s $list ]] || { echo "no hot files"; exit 1; }

data=$(mktemp) # names of constants and variables, which nobody calls
trap 'rm -f "$list" "$data"' EXIT
find "$build/src" -name '*.o' -path '*/sonde_*.dir/*' -print0 |
  xargs -0 "$objdump" -t | awk '$3 == "O" || $2 == "O" { print $NF }' >"$data"

find "$build/src" -name '*.o' -path '*/sonde_*.dir/*' -print0 | sort -z |
  xargs -0 "$objdump" -dr --no-show-raw-insn |
  awk -v list="$list" -v data="$data" -v forbidden="$forbidden" '
    BEGIN {
      while ((getline line < data) > 0) is_data[line] = 1
      while ((getline line < list) > 0) {
        n = split(line, word, " ")
        hot[word[1]] = 1
        for (i = 2; i <= n; ++i) allowed[word[1], word[i]] = 1
      }
    }
    function edge(to) { if (to != name) calls[object, name] = calls[object, name] " " to }
    function flush() { if (pending != "") edge(pending); pending = "" }
    / file format / { flush(); object = $1; sub(/:$/, "", object); next }
    /^[0-9a-f]+ <.*>:$/ {
      flush()
      name = $2; gsub(/[<>:]/, "", name)
      defined[object, name] = 1
      if (name ~ /^sonde_/) home[name] = object
      if (object in hot) root[object, name] = 1
      next
    }
    / R_[A-Z0-9_]+/ { # the true target of the instruction above
      pending = ""
      to = $3; sub(/[-+]0x[0-9a-f]+$/, "", to)
      if (to !~ /^\./) edge(to)
      next
    }
    /<[^+>]+>$/ { flush(); pending = $0; sub(/.*</, "", pending); sub(/>$/, "", pending); next }
    { flush() }
    function visit(o, f, from) {
      if ((o, f) in seen) return
      seen[o, f] = 1
      parent[o, f] = from
      queue[++last] = o SUBSEP f
    }
    function chain(key,   part, text) {
      for (text = ""; key != ""; key = parent[key]) {
        split(key, part, SUBSEP)
        text = part[2] (text == "" ? "" : " -> " text)
      }
      return text
    }
    END {
      flush()
      for (key in root) { split(key, part, SUBSEP); visit(part[1], part[2], "") }
      for (first = 1; first <= last; ++first) {
        key = queue[first]; split(key, part, SUBSEP)
        if ((part[1], part[2] ".cold") in defined) visit(part[1], part[2] ".cold", key)
        n = split(calls[key], callee, " ")
        for (i = 1; i <= n; ++i) {
          if ((part[1], callee[i]) in allowed || callee[i] == "sonde_assert_failed") continue
          if ((part[1], callee[i]) in defined) visit(part[1], callee[i], key)
          else if (callee[i] in home) visit(home[callee[i]], callee[i], key)
          else if (callee[i] ~ forbidden || (callee[i] ~ /^sonde_/ && !(callee[i] in is_data))) {
            text = chain(key) " -> " callee[i]
            if (!(text in told)) { print "on the tick path: " text; bad++ }
            told[text] = 1
          }
        }
      }
      print last + 0 " functions on the tick path, " bad + 0 " wrong calls"
      exit bad > 0 || last == 0
    }'
