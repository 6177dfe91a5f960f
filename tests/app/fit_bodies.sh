#!/usr/bin/env bash
# What sonde fit writes from a skin alone can be pressed and run, whatever the body; what a body
# without bone and vessels cannot give is refused with one sentence.
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/common.sh"
for body in forearm leg dome; do
  mkdir "$work/in/$body"
  awk -v kind=$body -v dir="$work/in/$body" -f "$here/bodies.awk"
done
fit() { # BODY MODEL OPTIONS
  gives 'all.count:integer stage1.parameters:integer model:text' fit "$work/in/$1/ind.csv" --surface "$work/in/$1/skin.ply" \
    --sites "$work/in/$1/sites.csv" --stages 1 --json -o "$2" "${@:3}"
}
usable() { # MODEL
  gives 'force_n>=0.1 penetration_mm>=5.99 penetration_mm<=6.01' press "$1" --site 4 --depth-mm 6 --json
  gives 'ticks>=150' run "$1" --headless --lockstep --seconds 0.2 --json
}
for body in forearm leg; do
  fit $body $body.sonde
  usable $body.sonde
  gives 'vein_area_ratio>=0.5' image $body.sonde --site 4 -o $body.png --json
done
fit dome dome.sonde
fit forearm other.sonde --body other
# The exponent kept by `--exponent auto` is the one of the least held-out error, and the model's.
gives 'exponents.n1.held_out_percent>=0 exponents.n3.held_out_percent>=0 normal_exponent>=1' fit "$work/in/forearm/ind.csv" \
  --surface "$work/in/forearm/skin.ply" --sites "$work/in/forearm/sites.csv" --stages 3 --exponent auto \
  --smoothness 0.1 --fine-mm 6 --json -o auto.sonde --report auto_page
says() { # WORDS REPORT: of the exponent, and no other words of who says it
  local row
  row=$(grep -o 'exponent of the normal springs.\{0,300\}' "$2"/index.html | head -1)
  [[ $row == *"$1"* ]] || wrong "the report says '$row', expected '$1'"
}
says 'chosen by the held-out error' auto_page
gives 'normal_exponent>=1 normal_exponent<=1 normal_exponent_from:text' fit "$work/in/forearm/ind.csv" \
  --surface "$work/in/forearm/skin.ply" --sites "$work/in/forearm/sites.csv" --stages 3 --exponent 1 \
  --smoothness 0.1 --fine-mm 6 --json -o auto.sonde --report given_page
says '"note":"given"' given_page
rm -rf auto.sonde auto_page given_page
rejects 'auto needs --stages 3' fit "$work/in/forearm/ind.csv" --surface "$work/in/forearm/skin.ply" \
  --sites "$work/in/forearm/sites.csv" --exponent auto -o never.sonde
rm -f ./*.png
for model in dome other; do
  usable $model.sonde
  rejects 'no bone, and so no vessels and no image' image $model.sonde --site 4 -o $model.png
  rejects 'no bone, and so no vessels and no image' press $model.sonde --site 4 --depth-mm 6 --image $model.png
done
finish
