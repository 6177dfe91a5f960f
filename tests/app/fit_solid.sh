#!/usr/bin/env bash
# sonde fit --solid: a coarse solid fitted to one site predicts another and a third probe; sonde solve takes its table of
# moduli; sonde press --solid finds the depth that bears the force of a depth; what does not fit together is refused.
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/common.sh"
fit=(fit "$DATA/indentation.csv" --surface "$DATA/skin.ply" --sites "$DATA/sites.csv" --solid)
gives "fitted.all.count>=6 fitted.all.count<=6 fitted.ln_rms<=0.1 left_out.all.count>=6 left_out.all.count<=6 left_out.ln_rms<=0.15 \
  never_fitted.all.count>=6 never_fitted.all.count<=6 moduli.muscle.shear_kpa>=1 moduli.muscle.shear_kpa<=8 moduli.skin.shear_measured:bool \
  rows>=6 rows<=6 converged:bool" \
  "${fit[@]}" --at 30 --check 27 --depths 3 --edge-mm 25 --growth 3 --unexplained 0.05 --also "$DATA/indentation_square.csv" \
  -o "$work/moduli.csv" --json
gives 'contact=bonded' solve "$MODEL" --site 27 --depths 1 --contact bonded --edge-mm 25 --growth 3 --moduli "$work/moduli.csv" --json
rejects 'goes without --fat' solve "$MODEL" --site 27 --depths 1 --moduli "$work/moduli.csv" --fat 1:8
gives 'tissue=solid site=27 penetration_mm=1 work_mj:number' press "$MODEL" --solid --site 27 --depth-mm 1 --moduli "$work/moduli.csv" --json
force=$(sed -n 's/.*"force_n": \([0-9.]*\),.*/\1/p' "$out")
gives 'penetration_mm>=0.999 penetration_mm<=1.001' press "$MODEL" --solid --site 27 --force-n "$force" --moduli "$work/moduli.csv" --json
gives 'contact=slip friction>=0.5 friction<=0.5' solve "$MODEL" --site 27 --depths 1 --friction 0.5 --edge-mm 25 --growth 3 \
  --moduli "$work/moduli.csv" --json
gives 'tissue=solid friction>=0.5 force_n>=0.0999 force_n<=0.1001' press "$MODEL" --solid --site 27 --force-n 0.1 --friction 0.5 \
  --moduli "$work/moduli.csv" --json
# The solid moves vessels and pictures: under 8 N the bundled thigh's vein closes, a fresh clot holds it open.
gives 'tissue=solid vein_area_ratio<=0.05 artery_area_ratio>=0.9' press "$MODEL" --solid --site 27 --force-n 8 --json
gives 'tissue=solid vein_area_ratio>=0.7 case=acute_occlusive' press "$MODEL" --solid --site 27 --force-n 8 \
  --case acute_occlusive --image "$work/inside.png" --json
[[ $(head -c 4 "$work/inside.png" | tail -c 3) == PNG ]] || wrong "press --solid --image wrote no PNG"
rejects '\--friction goes with --contact slip' solve "$MODEL" --site 27 --depths 1 --contact bonded --friction 0.5
for mu in -0.1 nan 11; do rejects '\--friction' solve "$MODEL" --site 27 --depths 1 --friction $mu; done
rejects '\--friction goes with --solid' press "$MODEL" --site 27 --depth-mm 1 --friction 0.5
rejects "\--solid goes without --preset" press "$MODEL" --solid --site 27 --depth-mm 1 --preset none.yaml
rejects "\--solid goes without --cuff-mmhg" press "$MODEL" --solid --site 27 --cuff-mmhg 30
rejects 'names no stations' press "$MODEL" --solid --depth-mm 1
rejects '\--moduli goes with --solid' press "$MODEL" --site 27 --depth-mm 1 --moduli "$work/moduli.csv"
rejects 'site 99 has no measurements' "${fit[@]}" --at 99 -o "$work/none.csv"
rejects '\--at: expected' "${fit[@]}" --at 1,x -o "$work/none.csv"
rejects '\--solid goes without' "${fit[@]}" --model linear -o "$work/none.csv"
rejects 'muscle-prior' "${fit[@]}" --muscle-prior -3:9 -o "$work/none.csv"
finish
