#!/usr/bin/env bash
# sonde simulate on the scenes that once lied: the picture shows what matters and names every body.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
hostile=$HOSTILE

# One of seven bodies falls for 1.5 s: 11 m below the others it is out of the view, which stays theirs.
gives "flagged_steps<=0" simulate "$hostile/fallen.yaml" -o fallen --no-frames --picture fallen.svg --json
for name in $(sed -n 's/^- {name: \([a-z_]*\), \(motion\|shape\).*/\1/p' "$hostile/fallen.yaml"); do
  grep -q ">$name\( (out of view)\)\?</text>" fallen.svg || wrong "the picture does not name $name"
done
(($(grep -c 'out of view' fallen.svg) == 1)) || wrong "expected one body out of view"
# The floor, 200 mm, is as wide as the picture.
span=$(grep '^<path' fallen.svg | grep -o '[ML][0-9.]*' | tr -d ML | sort -n | awk 'NR == 1 { low = $1 } END { print int($1 - low) }')
((span > 400)) || wrong "the bodies are $span pixels wide, expected most of the picture's 520"

# A spoilt run ends with 1 and says which body and when; its files and its JSON are there all the same.
run simulate "$hostile/sheet.yaml" -o sheet --no-frames --json
checks=$((checks + 1))
((status == 1)) || wrong "the sheet: exit $status, expected 1"
grep -q 'cannot be trusted: sheet turned inside out or went through itself at 0.06[0-9]* s' "$err" || wrong "the sheet is not named"
"$CHECK_JSON" flagged_steps\>=1 trusted:bool trouble:text <"$out" || wrong "the sheet: JSON"
[[ $(wc -l <sheet/bodies.csv) -ge 100 ]] || wrong "the sheet left no table"
# What begins inside another is told and is no fault.
gives "trusted:bool" simulate "$hostile/inside.yaml" -o inside --no-frames --json
grep -q 'ball was wholly inside block and was let out at 0 s' "$err" || wrong "the ball is not named"
finish
