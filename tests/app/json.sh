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
gives "$press force_n>=11.98 force_n<=12.02 contact_n>=11.98 contact_n<=12.02 artery_area_ratio>=0.65
  vein_area_ratio<=0.1" \
  press "$MODEL" --site 27 --probe linear --force-n 12 --case healthy --image a.png --json
[[ $(head -c 4 a.png 2>/dev/null | tail -c 3) == PNG ]] || wrong "sonde press wrote no PNG"
gives "$press vein_area_ratio>=0.7" press "$MODEL" --site 27 --probe linear --force-n 12 \
  --case chronic --json
# Every force is met, also where the skin has two equilibria at a depth.
gives "$press force_n>=12.98 force_n<=13.02" press "$MODEL" --site 27 --force-n 13 --json
gives "$press penetration_mm>=4.999 penetration_mm<=5.001" press "$MODEL" --site 27 --probe point \
  --depth-mm 5 --json

gives "seed=7 sex=male nodes:integer nodes>=3000 closed:bool smallest_angle_deg>=15 volume_l:number
  parameters.girth-mm>=519.999 parameters.girth-mm<=520.001 landmarks.femoral_mid.site:integer
  landmarks.common_femoral.vein_depth_mm>=10" \
  generate --seed 7 --sex male --girth-mm 520 -o seven.sonde --section-svg seven.svg --json
[[ -s seven.sonde && -s seven.svg ]] || wrong "sonde generate wrote no model or drawing"
gives "$press" press seven.sonde --site 27 --depth-mm 5 --json

gives "seed=7 sex=male side=left parameters.bmi>=23.999 parameters.bmi<=24.001" \
  limb --seed 7 --sex male --bmi 24 --side left --atlas leg --levels 0.5,1.3 --skin scanned.stl --json
[[ -s leg/section_+0.50.svg && -s leg/section_+1.30.svg && -s leg/view.svg ]] || wrong "sonde limb drew nothing"
# The skin of that limb, which begins above the groin crease, read as a scan.
gives "side=left parameters.girth-calf-mm:number scan.girth_rms_percent<=3 scan.thigh_doubtful=true" \
  limb --scan-skin scanned.stl --axes lps --side left --sex male --json
gives "parameters.thigh-length-mm>=430 scan.thigh_doubtful=false" \
  limb --scan-skin scanned.stl --axes lps --side left --thigh-length-mm 430 --json

gives "samples:integer samples>=400 normal_max_n:number" identify "$MODEL" --simulate ramp-hold \
  --site 27 --probe point --depth-mm 4 --speed-mm-s 40 --hold-s 0.05 --noise-n 0.05 --noise-mm 0.05 \
  -o ramp.csv --json
ramp="damping.normal_damping_ms.value:number damping.normal_damping_ms.value>=15"
ramp+=" damping.normal_damping_ms.value<=25 damping.stiffness_scale.value>=0.95"
gives "$ramp damping.stiffness_scale.value<=1.05 damping.samples>=400" identify "$MODEL" \
  --ramp-hold ramp.csv -o preset.json --json
gives "$press" press "$MODEL" --site 27 --probe point --depth-mm 3 --preset preset.json --json

cut="nodes:integer nodes_before:integer split_edges>=5 length_mm>=30 closed:bool mass_change<=1e-12"
cut+=" mass_change>=-1e-12 force_before_n>=0.5 force_after_n>=0.5"
gives "$cut" cut "$MODEL" --site 27 --length-mm 40 --depth-mm 4 -o cut.sonde --json
gives "$press" press cut.sonde --site 27 --depth-mm 4 --image cut.png --json

gives "ticks:integer ticks>=1 deadline_misses:integer images:integer images>=1 hash:text" \
  run "$MODEL" --headless --seconds 1 --record a.rec --json
[[ -s a.rec ]] || wrong "sonde run recorded nothing"
gives "ticks>=1 same:bool checks:integer" replay a.rec --json
gives "tracked_frames>=1" replay a.rec --sequence a.igs.mha --json
rejects 'expected at most' replay a.rec --csv late.csv --from 100
gives "world=Reference" slice a.igs.mha --frame 0 -o slice.png --json
gives "deviation_grey>=0" slice a.igs.mha --frame 0 -o slice.png --deviation sure.png --json
[[ -s sure.png ]] || wrong "sonde slice wrote no expected errors"
gives "images>=1 image_hash:text same_images:bool" replay a.rec --images --json
[[ -s a.rec.keys ]] || wrong "sonde run left no keyframes"
gives "rows>=1 pictures>=1" replay a.rec --csv a.csv --json-file a.json --frames a_png --json
"$CHECK_JSON" duration_s:number <a.json || wrong "sonde replay --json-file wrote no object"
[[ $(wc -l <a.csv) -ge 2 && $(ls a_png | wc -l) -ge 1 ]] || wrong "sonde replay exported nothing"
mkdir -p fake && printf '#!/bin/sh\nfor last; do :; done\ncat >"$last"\n' >fake/ffmpeg && chmod +x fake/ffmpeg
PATH=$PWD/fake:$PATH gives "film_frames>=1" replay a.rec --video a.mp4 --to 0.5 --json
[[ -s a.mp4 ]] || wrong "sonde replay --video wrote no film"
gives "" devices --json
gives "deadline_misses:integer energy_j:number max_force_n>=0 max_slew_n_per_s>=0 compute_us.p999:number" \
  bench "$MODEL" --haptics --device touch --seconds 1 --json

# A run in two parts ends as one in one, in all files.
simulate="steps:integer steps>=40 steps<=40 time_s:number hash:text flagged_steps<=0 ms_per_step:number"
for scene in stack four_kinds; do
  file=$DATA/../scenes/$scene.yaml
  gives "$simulate" simulate "$file" -o whole_$scene --steps 40 --every 5 --picture $scene.svg --json
  tail -1 $scene.svg | grep -q "^</svg>$" || wrong "$scene: the picture is not whole"
  gives "steps>=25 steps<=25" simulate "$file" -o parts_$scene --steps 25 --every 5 --json
  gives "$simulate" simulate "$file" -o parts_$scene --steps 40 --every 5 --resume --json
  diff -r whole_$scene parts_$scene >/dev/null || wrong "$scene: a resumed run differs"
done
gives "$simulate" simulate "$DATA/../scenes/thigh_drop.yaml" -o drop --steps 40 --every 40 --json
grep -q 'frames/thigh_000000040.vtp' drop/scene.pvd || wrong "scene.pvd misses the last frame"
bench="scene:text nodes:integer dt_s:number steps_per_s:number step_ms.median:number step_ms.p99:number"
bench+=" step_ms.max:number iterations:number relative_error:number stages_ms:object nodes>=4000"
gives "$bench" bench "$MODEL" --seconds 0.2 --repeat 1 --json
# A run shorter than the time of comparison is compared at its end; noise shows there.
ball=(bench --scene ellipsoid --nodes 492 --seconds 0.06 --repeat 1 --json)
gives "relative_error>=1e-6 relative_error<=1e-2" "${ball[@]}"
gives "relative_error>=0.02" "${ball[@]}" --disturb-nm 1e6

gives "id=seed-hard-7 level=hard thrombosis:bool vein_mm>=200 segments.femoral_mid:text" \
  cases --generate 7 --level hard -o seven.yaml --json
gives "id=seed-hard-7" cases --check seven.yaml --json
gives "lymph-node.level=easy healthy-lean.history:text" cases --json
# The novice is the quickest; two places.
gives "case=healthy-lean protocol=two_point operator=novice score<=60 passed:bool correct:bool
  coverage>=0 technique>=0 places>=3 time_s>=1 segments.common_femoral:text" \
  exam --case healthy-lean --protocol two_point --operator novice -o exams --json
[[ -s exams/healthy-lean-novice-1.json && -s exams/healthy-lean-novice-1.csv ]] || wrong "sonde exam wrote no result"
finish
