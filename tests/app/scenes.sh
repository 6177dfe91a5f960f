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
finish
