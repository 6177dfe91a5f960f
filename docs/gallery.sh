#!/bin/sh
# Makes the pictures of docs/gallery.md anew. Usage: docs/gallery.sh SONDE MODEL OUT_DIR
# MODEL is the bundled thigh. Tells each picture's numbers, as sonde image does.
set -eu
if [ $# -ne 3 ]; then
  echo "usage: docs/gallery.sh SONDE MODEL OUT_DIR" >&2
  exit 2
fi
sonde=$1 model=$2 out=$3
models=$(mktemp -d)
trap 'rm -rf "$models"' EXIT
mkdir -p "$out"

# shoot NAME MODEL OPTIONS...
shoot() {
  name=$1 of=$2
  shift 2
  "$sonde" image "$of" --size 320x320 -o "$out/gallery_$name.png" "$@"
}

for state in healthy acute:acute_occlusive chronic:chronic_occlusive floating:free_floating \
  recanalised; do
  set -- "$model" --site 27 --depth-mm 50 --case "${state#*:}"
  shoot "${state%:*}_rest" "$@" --force-n 0.5
  shoot "${state%:*}_pressed" "$@" --force-n 7
done
shoot healthy_along "$model" --site 27 --depth-mm 50 --turn-deg 90 --force-n 2
shoot healthy_curved "$model" --site 27 --scanner abdominal --curved-mm 60 --aperture-mm 60 --frequency-mhz 4 \
  --focus-mm 40 --depth-mm 90 --force-n 2

"$sonde" generate --seed 3 --sex female --fat-mm 26 -o "$models/fat"
"$sonde" generate --seed 3 --sex male --fat-mm 5 -o "$models/lean"
shoot fat_rest "$models/fat" --site 12 --depth-mm 70
shoot fat_pressed "$models/fat" --site 12 --depth-mm 70 --force-n 16
shoot lean_rest "$models/lean" --site 12 --depth-mm 50
shoot lean_pressed "$models/lean" --site 12 --depth-mm 50 --force-n 6

"$sonde" generate --seed 7 --second-vein 1 -o "$models/more"
set -- "$models/more" --site 12 --depth-mm 50
shoot node "$@" --lesion node:5:12:13:8
shoot cyst "$@" --lesion cyst:8:30:16:10
shoot haematoma "$@" --lesion haematoma:-8:32:18:12
shoot saphenous_rest "$@" --clot great_saphenous:acute
shoot saphenous_pressed "$@" --clot great_saphenous:acute --force-n 5
shoot oedema "$@" --oedema 0.8
set -- "$models/more" --site 22 --depth-mm 50 --case chronic --webs 1
shoot webs "$@"
shoot webs_pressed "$@" --force-n 8

# Standard views of a limb; its first sites are the stations.
"$sonde" limb --seed 3 --sex female --bmi 24 --model "$models/leg.sonde" >"$models/table"
view() {
  name=$1 station=$2 depth=$3
  shift 3
  shoot "view_$name" "$models/leg.sonde" --site "$station" --depth-mm "$depth" "$@"
}
view groin 1 50 --force-n 1
view saphenous 2 50 --force-n 1
view confluence 3 50 --force-n 1
view thigh 5 60 --force-n 2
view thigh_pressed 5 60 --force-n 12
view groin_colour 1 50 --force-n 1 --colour
view groin_colour_along 1 50 --force-n 1 --turn-deg 90 --colour
view thigh_colour 5 60 --force-n 2 --colour
view thigh_colour_pressed 5 60 --force-n 12 --colour
view thigh_colour_slow 5 60 --force-n 2 --colour --scale-cm-s 2
view knee 8 50 --force-n 4
view knee_along 8 50 --turn-deg 90 --force-n 4
view tibial 10 50 --force-n 2
view gastrocnemius 12 50 --force-n 2
view thigh_bright 5 60 --force-n 2 --scanner bright
view thigh_compact 5 60 --force-n 2 --scanner compact
view thigh_plain 5 60 --force-n 2 --scanner plain

# Sections of a whole limb.
"$sonde" limb --seed 3 --levels 0.15,0.5,1.5 --atlas "$models/limb" >"$models/table"
for level in 0.15 0.50 1.50; do cp "$models/limb/section_+$level.svg" "$out/limb_$level.svg"; done

# Three limbs in layers, and a walk along a vein.
"$sonde" limb --seed 3 --atlas "$models/woman" >"$models/table"
"$sonde" limb --seed 8 --sex male --bmi 22 --atlas "$models/man" >"$models/table"
"$sonde" limb --seed 11 --sex female --bmi 36 --side left --atlas "$models/heavy" >"$models/table"
for leg in woman man heavy; do cp "$models/$leg/view.svg" "$out/limb_view_$leg.svg"; done
"$sonde" limb --seed 3 --position supine-turned --film "$out/limb_walk.png" >"$models/table"
