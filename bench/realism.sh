#!/usr/bin/env bash
# realism.sh BIN OUT_DIR [LEGS [VIEWS [FIRST]]]: can a detector that never saw a scanner tell its pictures from ours?
#
# Draws LEGS (20) limbs of different seeds, sexes and builds, and VIEWS (10) pictures of each in OUT_DIR/pictures with
# bench_pictures: stations from groin to ankle, every third view along the leg, the shipped linear scanners in turn.
# Limbs stay in OUT_DIR/models and are not drawn again. FIRST (1) is the first seed; SCANNERS="NAME..." in the
# environment replaces the scanners. Where ../shared (or SHARED) holds real stills and the tool, prints the areas below
# the receiver's curves. Needs python3-numpy and python3-pil.
set -euo pipefail
if [[ $# -lt 2 || ${1:-} == --help ]]; then
  sed -n '2,8s/^# \{0,1\}//p' "$0"
  exit 2
fi
bin=$1 out=$2 legs=${3:-20} views=${4:-10} first=${5:-1}
here=$(cd "$(dirname "$0")/.." && pwd)
shared=${SHARED:-$here/../shared}
files=()
for name in ${SCANNERS:-venous compact bright portable research arterial}; do files+=("$here/data/scanners/$name.yaml"); done
mkdir -p "$out/models"
rm -rf "$out/pictures"
mkdir -p "$out/pictures"

for ((leg = first; leg < first + legs; ++leg)); do
  sex=female
  ((leg % 2)) && sex=male
  model=$out/models/$leg.sonde
  [[ -e $model ]] ||
    "$bin/sonde" limb --seed "$leg" --sex "$sex" --bmi "$((19 + leg * 5 % 17))" --model "$model" >/dev/null
  "$bin/bench_pictures" "$model" "$out/pictures/$leg" "$views" "$leg" "${files[@]}"
done
echo "$(find "$out/pictures" -name '*.png' | wc -l) pictures of $legs limbs"
if [[ -e $shared/tools/realism.py && -d $shared/data ]]; then
  /usr/bin/python3 "$shared/tools/realism.py" "$shared/data" "$out/pictures" --by-size
else
  echo "no real stills beside the project: pictures only"
fi
