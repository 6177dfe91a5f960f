#!/usr/bin/env bash
# manpages.sh ROOT PAGES: the manual pages, which the build makes from the program's tables of options,
# are clean mdoc, every command has one, and every note of docs/man belongs to one.
set -euo pipefail
root=$1 pages=$2
mandoc -T lint -W warning "$pages"/*.1
for file in "$root"/app/cmd_*.c; do
  verb=$(basename "$file" .c) verb=${verb#cmd_}
  [[ -s $pages/sonde-$verb.1 ]] || { echo "no manual page for sonde $verb"; exit 1; }
  grep -q "sonde-$verb" "$pages/sonde.1" || { echo "sonde.1 misses sonde-$verb"; exit 1; }
done
for note in "$root"/docs/man/*.mdoc; do
  verb=$(basename "$note" .mdoc)
  [[ $verb == sonde || -e $root/app/cmd_$verb.c ]] || { echo "$note: no such command"; exit 1; }
done
