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
    forms=$("$sonde" "$verb" --help --json)
    printf '%s\n' "$forms" | awk -v date="$date" -f "$here/manual.awk"
    notes=$here/$verb.mdoc
    [[ -e $notes ]] && cat "$notes"
    grep -qs '^\.Sh EXIT STATUS' "$notes" ||
      printf '.Sh EXIT STATUS\n0 on success, 1 when the work failed or was cancelled, 2 for bad input; then nothing was written.\n'
    grep -qs '^\.Sh SEE ALSO' "$notes" || printf '.Sh SEE ALSO\n.Xr sonde 1\n'
  } >"$to/sonde-$verb.1"
done
# The page of the program itself: the list of commands goes where sonde.mdoc says.
"$sonde" --help | awk -v date="$date" -v notes="$here/sonde.mdoc" '
  /^  [a-z]+  / { verb[++n] = $1; sub(/^ *[a-z]+ +/, ""); what[n] = $0 }
  END {
    print ".Dd " date
    while ((getline line < notes) > 0) {
      if (line == "@COMMANDS")
        for (k = 1; k <= n; ++k)
          printf ".It Cm %s\n%s%s, see\n.Xr sonde-%s 1 .\n", verb[k], toupper(substr(what[k], 1, 1)), substr(what[k], 2), verb[k]
      else if (line == "@PAGES") {
        close("sort")
        for (k = 1; k <= n; ++k) for (j = 1; j < k; ++j) if (verb[k] < verb[j]) { t = verb[k]; verb[k] = verb[j]; verb[j] = t }
        for (k = 1; k <= n; ++k) printf ".Xr sonde-%s 1%s\n", verb[k], k < n ? " ," : ""
      } else print line
    }
  }' >"$to/sonde.1"
