#!/usr/bin/env bash
# --json of every command: one object, the promised keys, values within what they can be.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

statistics() { # PREFIX
  local key
  for key in mae_n sd_n rmse_n mean_force_n mae_percent; do printf '%s.%s:number ' "$1" "$key"; done
  printf '%s.count:integer %s.count>=1 %s.mae_n>=0 ' "$1" "$1" "$1"
}

errors="interaction:text $(statistics all)"
for probe in point linear; do errors+=" $(statistics probes.$probe)"; done
gives "$errors all.mae_percent<=2" fit "$DATA/indentation.csv" --surface "$DATA/skin.ply" \
  --sites "$DATA/sites.csv" --stages 1 -o model.sonde --json
[[ -s model.sonde ]] || wrong "sonde fit wrote no model"
gives "$errors interaction=simplified" predict "$MODEL" --measurements "$DATA/indentation.csv" \
  --sites "$DATA/sites.csv" --interaction simplified --json

press="force_n:number penetration_mm:number reaction_n:number contact_n:number steps:integer"
press+=" vein_area_ratio:number artery_area_ratio:number vein_area_ratio>=0 artery_area_ratio>=0"
gives "$press force_n>=19.8 force_n<=20.2 contact_n>=19.8 contact_n<=20.2 artery_area_ratio>=0.65
  vein_area_ratio<=0.1" \
  press "$MODEL" --site 27 --probe linear --force-n 20 --case healthy --image a.png --json
[[ $(head -c 4 a.png 2>/dev/null | tail -c 3) == PNG ]] || wrong "sonde press wrote no PNG"
gives "$press vein_area_ratio>=0.7" press "$MODEL" --site 27 --probe linear --force-n 20 \
  --case chronic --json
gives "$press penetration_mm>=4.999 penetration_mm<=5.001" press "$MODEL" --site 27 --probe point \
  --depth-mm 5 --json

gives "samples:integer samples>=400 normal_max_n:number" identify "$MODEL" --simulate ramp-hold \
  --site 27 --probe point --depth-mm 4 --speed-mm-s 40 --hold-s 0.05 --noise-n 0.05 --noise-mm 0.05 \
  -o ramp.csv --json
ramp="damping.normal_damping_ms.value:number damping.normal_damping_ms.value>=15"
ramp+=" damping.normal_damping_ms.value<=25 damping.stiffness_scale.value>=0.95"
gives "$ramp damping.stiffness_scale.value<=1.05 damping.samples>=400" identify "$MODEL" \
  --ramp-hold ramp.csv -o preset.json --json
gives "$press" press "$MODEL" --site 27 --probe point --depth-mm 3 --preset preset.json --json

gives "ticks:integer ticks>=1 deadline_misses:integer images:integer images>=1 hash:text" \
  run "$MODEL" --headless --seconds 1 --record a.rec --json
[[ -s a.rec ]] || wrong "sonde run recorded nothing"
gives "" replay a.rec --json
gives "" devices --json
bench="scene:text nodes:integer dt_s:number steps_per_s:number step_ms.median:number step_ms.p99:number"
bench+=" step_ms.max:number iterations:number relative_error:number stages_ms:object nodes>=4000"
gives "$bench" bench "$MODEL" --json
finish
