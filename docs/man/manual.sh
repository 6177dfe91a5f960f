#!/usr/bin/env bash
# manual.sh SONDE DIR: writes the manual pages of the program into DIR, from the tables of options that
# `sonde COMMAND --help --json` prints and from what only a manual says: COMMAND.mdoc beside this file.
set -euo pipefail
export LC_ALL=C
sonde=$1 to=$2 here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
date='November 24, 2026'
mkdir -p "$to"
verbs=$("$sonde" --help | sed -n '/^commands:/,/^$/s/^  \([a-z]*\)  .*/\1/p')
for verb in $verbs; do
  {
    "$sonde" "$verb" --help --json
    [[ $verb != fit ]] || "$sonde" fit --cohort list --help --json
    [[ $verb != bench ]] || "$sonde" bench --scene image --help --json
  } | awk -v date="$date" -f "$here/manual.awk" >"$to/sonde-$verb.1"
  [[ -e $here/$verb.mdoc ]] && notes=$here/$verb.mdoc || notes=/dev/null
  # The usual sections where a command has none of its own, in the usual order.
  awk '
    function status() {
      if (!told++) print ".Sh EXIT STATUS\n0 on success, 1 when the work failed or was cancelled, 2 for bad input; then nothing was written."
    }
    /^\.Sh EXIT STATUS/ { told = 1 }
    /^\.Sh (EXAMPLES|SEE ALSO)/ { status() }
    /^\.Sh SEE ALSO/ { seen = 1 }
    { print }
    END { status(); if (!seen) print ".Sh SEE ALSO\n.Xr sonde 1" }' "$notes" >>"$to/sonde-$verb.1"
done
# The page of the program itself: sonde.mdoc with the list of commands where it says so.
"$sonde" --help | awk -v date="$date" -v notes="$here/sonde.mdoc" '
  /^  [a-z]+  / {
    verb[++n] = $1
    sub(/^ *[a-z]+ +/, "")
    item[n] = ".It Cm " verb[n] "\n" toupper(substr($0, 1, 1)) substr($0, 2) ", see\n.Xr sonde-" verb[n] " 1 ."
  }
  END {
    print ".Dd " date
    while ((getline line < notes) > 0)
      if (line == "@COMMANDS")
        for (k = 1; k <= n; ++k) print item[k]
      else if (line == "@PAGES") {
        for (k = 1; k <= n; ++k)
          for (j = 1; j < k; ++j)
            if (verb[k] < verb[j]) { t = verb[k]; verb[k] = verb[j]; verb[j] = t }
        for (k = 1; k <= n; ++k) print ".Xr sonde-" verb[k] " 1" (k < n ? " ," : "")
      } else
        print line
  }' >"$to/sonde.1"
