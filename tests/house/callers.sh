#!/usr/bin/env bash
# callers.sh ROOT: the comment of every function of the public headers says who may call it, by
# "@thread any", "@thread owner" or "@thread tick". The comment stands before the declaration (/** */)
# or behind it on its last line (/**< */); it belongs to one declaration.
set -euo pipefail
root=$1
awk '
  function finish() { # of a declaration, when what may follow it has been seen
    if (declaration == "") return
    count++
    if (declaration !~ /@thread[ \t]+(any|owner|tick)([^a-z_]|$)/) {
      name = declaration; sub(/.*SONDE_API/, "", name); sub(/\(.*/, "", name); sub(/.*[ *]/, "", name)
      print "who may call it is not said: " place ": " name
      bad++
    }
    declaration = ""
  }
  FNR == 1 { finish(); comment = ""; in_comment = in_declaration = 0 }
  in_comment { comment = comment " " $0; if (/\*\//) in_comment = 0; next }
  in_declaration { declaration = declaration " " $0; if (/;/) in_declaration = 0; next }
  /^[ \t]*\/\*\*/ { finish(); comment = $0; in_comment = !/\*\//; next }
  /^[ \t]*SONDE_API/ {
    finish(); declaration = comment " " $0; comment = ""; place = FILENAME ":" FNR
    in_declaration = !/;/
    next
  }
  { finish(); comment = "" }
  END { finish(); print count + 0 " functions, " bad + 0 " without a caller"; exit bad > 0 || count == 0 }
' "$root"/include/sonde/*.h
