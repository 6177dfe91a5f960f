#!/usr/bin/env bash
# manpages.sh ROOT: the manual pages are clean mdoc and every command has one.
set -euo pipefail
root=$1
mandoc -T lint -W warning "$root"/docs/man/*.1
for file in "$root"/app/cmd_*.c; do
  verb=$(basename "$file" .c) verb=${verb#cmd_}
  [[ -e $root/docs/man/sonde-$verb.1 ]] || { echo "no manual page for sonde $verb"; exit 1; }
  grep -q "sonde-$verb" "$root/docs/man/sonde.1" || { echo "sonde.1 misses sonde-$verb"; exit 1; }
done
