#!/usr/bin/env bash
# Bad input: a clear sentence on stderr, exit 2, nothing written.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
in=$work/in
cp "$DATA"/*.ply "$in"
fit=(--surface "$in/skin.ply" --sites "$DATA/sites.csv" -o model.sonde)

# Surfaces.
head -c 20000 "$DATA/skin.ply" >"$in/short.ply"
rejects 'short\.ply' fit "$DATA/indentation.csv" --surface "$in/short.ply" --sites "$DATA/sites.csv" \
  -o model.sonde
rejects 'nowhere\.ply' fit "$DATA/indentation.csv" --surface nowhere.ply --sites "$DATA/sites.csv" \
  -o model.sonde
printf 'ply\nformat ascii 1.0\nelement vertex many\n' >"$in/odd.ply"
rejects 'odd\.ply:3' fit "$DATA/indentation.csv" --surface "$in/odd.ply" --sites "$DATA/sites.csv" \
  -o model.sonde

# Tables.
awk -F, -v OFS=, '/^#/ { print; next } { NF--; print }' "$DATA/indentation.csv" >"$in/column.csv"
rejects 'column\.csv.*force_n' fit "$in/column.csv" "${fit[@]}"
awk -F, -v OFS=, '/^#/ { print; next } ++n == 5 { $NF = "nan" } { print }' \
  "$DATA/indentation.csv" >"$in/nan.csv"
line=$(grep -n 'nan' "$in/nan.csv" | tail -1 | cut -d: -f1)
rejects "nan\\.csv:$line" fit "$in/nan.csv" "${fit[@]}"
rejects 'nowhere\.csv' fit nowhere.csv "${fit[@]}"
rejects 'inplane-n-m.*-1' fit "$DATA/indentation.csv" "${fit[@]}" --inplane-n-m -1
rejects 'tangential-n-m3.*1e9' fit "$DATA/indentation.csv" "${fit[@]}" --tangential-n-m3 1e9
: >"$in/empty.csv"
rejects 'empty\.csv' fit "$in/empty.csv" "${fit[@]}"
rejects 'empty\.csv' measure "$MODEL" --sites "$in/empty.csv" --probe linear --step-mm 2 --limit-n 10 \
  -o out.csv

# Tables whose text is right and whose content is not.
awk -F, -v OFS=, '/^#/ { print; next } ++n > 1 { $NF = -$NF } { print }' "$DATA/indentation.csv" >"$in/sign.csv"
rejects 'sign\.csv.*force_n.*sign' fit "$in/sign.csv" "${fit[@]}"
{ cat "$DATA/indentation.csv"; sed -n 12p "$DATA/indentation.csv"; } >"$in/twice.csv"
rejects 'twice\.csv:1830: repeats line 12' fit "$in/twice.csv" "${fit[@]}"
sed 's/linear/rect:60/' "$DATA/indentation.csv" >"$in/probe.csv"
rejects 'probe\.csv:2: column probe.*rect:AxB' fit "$in/probe.csv" "${fit[@]}"
awk -F, '/^#/ || !n++ || $9 < 5' "$DATA/indentation.csv" >"$in/few.csv"
# Another unit is never fitted, what no tissue does only when asked for.
change() { awk -F, -v OFS=, "NR > 1 { $1 } 1" "$DATA/indentation.csv" >"$in/$2.csv"; }
change '$9 /= 1000' metres
change '$10 *= 1000' millinewtons
change '$10 = 20 - $9/2' falling
change '$10 = 20*(1 - exp(-$9/6))' level
rejects 'metres\.csv:[0-9]+: column penetration_mm looks like metres' fit "$in/metres.csv" "${fit[@]}" \
  --accept-implausible
rejects 'column force_n looks like millinewtons' fit "$in/millinewtons.csv" "${fit[@]}"
rejects 'falling\.csv:2: site 0, probe linear: the force falls' fit "$in/falling.csv" "${fit[@]}"
rejects 'level\.csv:2: .*levels off.*accept-implausible' fit "$in/level.csv" "${fit[@]}"
rejects 'estimate-zero.*--stages 3' fit "$DATA/indentation.csv" "${fit[@]}" --estimate-zero
rejects 'none of the 128 curves' fit "$in/few.csv" "${fit[@]}"
awk -F, -v OFS=, '/^#/ { print; next } ++n == 8 { $2 += 30 } { print }' "$DATA/sites.csv" >"$in/off.csv"
rejects 'site 6 lies .* mm from the skin' measure "$MODEL" --sites "$in/off.csv" --probe linear -o out.csv
awk -F, -v OFS=, '/^#/ { print; next } ++n == 8 { $5 = -$5; $6 = -$6; $7 = -$7 } { print }' \
  "$DATA/sites.csv" >"$in/inward.csv"
rejects 'site 6: .*inward' measure "$MODEL" --sites "$in/inward.csv" --probe linear -o out.csv

# Places of sites.
place=(measure "$MODEL" --probe linear -o out.csv)
rejects 'one of --sites' "${place[@]}"
rejects 'one of --sites' "${place[@]}" --sites "$DATA/sites.csv" --bounds 0:90,80:200
rejects 'grid' "${place[@]}" --sites "$DATA/sites.csv" --grid 8x8
rejects 'grid expects' "${place[@]}" --bounds 0:90,80:200 --grid 8
rejects 'bounds expects' "${place[@]}" --bounds 0:90
rejects 'no skin' "${place[@]}" --bounds 0:90,80:2000
rejects 'rising' "${place[@]}" --bounds 90:0,80:200
rejects 'nowhere' "${place[@]}" --painted nowhere.csv
printf 'x_mm,y_mm,z_mm\n500,0,100\n500,50,100\n500,0,150\n' >"$in/region.csv"
rejects 'region\.csv: point 0 lies' "${place[@]}" --painted "$in/region.csv"
rejects 'quantum|quantise' "${place[@]}" --sites "$DATA/sites.csv" --quantise-mm 3
rejects 'rect:24x24' measure "$MODEL" --sites "$DATA/sites.csv" --probe rect:24 -o out.csv
rejects 'missing/' measure "$MODEL" --bounds 0:90,80:200 --save-sites missing/sites.csv

rejects 'nan\.csv' predict "$MODEL" --measurements "$in/nan.csv" --sites "$DATA/sites.csv"

# Model files: one flipped byte anywhere, a short file, another kind of file.
size=$(stat -c %s "$MODEL")
for place in 2 40 $((size / 3)) $((size / 2)) $((size - 3)); do
  cp "$MODEL" "$in/flipped.sonde"
  byte=$(od -An -tu1 -j "$place" -N 1 "$MODEL")
  printf "\\x$(printf %02x $((byte ^ 16)))" |
    dd of="$in/flipped.sonde" bs=1 seek="$place" conv=notrunc status=none
  rejects 'flipped\.sonde' press "$in/flipped.sonde" --site 27 --probe linear --depth-mm 2
done
head -c $((size / 2)) "$MODEL" >"$in/half.sonde"
rejects 'half\.sonde' press "$in/half.sonde" --site 27 --probe linear --depth-mm 2
rejects 'skin\.ply' press "$in/skin.ply" --site 27 --probe linear --depth-mm 2
rejects 'nowhere\.sonde' run nowhere.sonde --headless --seconds 1

# Names.
rejects 'linear' press "$MODEL" --site 27 --probe finger --depth-mm 2
rejects 'chronic' press "$MODEL" --site 27 --probe linear --depth-mm 2 --case plague
rejects 'site' press "$MODEL" --site 99999 --probe linear --depth-mm 2
rejects 'names no stations: give --site K' press "$MODEL" --depth-mm 2
rejects 'give one of --pose, --site and --station' image "$MODEL" --site 27 --station groin -o a.png
rejects 'linear' measure "$MODEL" --sites "$DATA/sites.csv" --probe finger --step-mm 2 --limit-n 10 \
  -o out.csv
rejects 'interaction|simplified' predict "$MODEL" --measurements "$DATA/indentation.csv" \
  --sites "$DATA/sites.csv" --interaction some
rejects 'scene' bench --scene moon
rejects 'dt expects a number from 0.0001 to 0.02' bench --scene ellipsoid --dt 1

# Numbers.
rejects 'depth-mm' press "$MODEL" --site 27 --probe linear --depth-mm deep
rejects 'force-n' press "$MODEL" --site 27 --probe linear --force-n nan
rejects 'force-n' press "$MODEL" --site 27 --probe linear --force-n -4
rejects 'stages' fit "$DATA/indentation.csv" "${fit[@]}" --stages 7
rejects 'seconds' run "$MODEL" --headless --seconds soon
rejects 'port' run "$MODEL" --port 70000

# Places that cannot be written.
rejects 'missing/' press "$MODEL" --site 27 --probe linear --depth-mm 2 --image missing/a.png
rejects 'missing/' measure "$MODEL" --sites "$DATA/sites.csv" --probe linear --step-mm 10 --limit-n 1 \
  -o missing/out.csv
# Long work asks for the place of its result before it reads its input.
rejects 'missing/out' measure absent.sonde --sites absent.csv --probe linear -o missing/out.csv
rejects 'missing/out' fit absent.csv --surface absent.ply --sites absent.csv -o missing/out.sonde
rejects 'missing/out' identify absent.sonde --slide absent.csv --site 1 -o missing/out.json
rejects 'missing/out' reconstruct absent.mha -o missing/out.mha
rejects 'deviation needs a sequence' slice volume.mha --pose 0,0,0,1,0,0,0 -o x.png --deviation y.png
rejects 'missing/out' slice absent.igs.mha --frame 1.5 -o missing/out.png
rejects 'missing/' run "$MODEL" --headless --seconds 0.2 --record missing/a.rec
rejects 'missing/' fit "$DATA/indentation.csv" --surface "$in/skin.ply" --sites "$DATA/sites.csv" \
  --stages 1 -o missing/model.sonde

# Recordings.
rejects 'skin\.ply' replay "$in/skin.ply"
rejects 'nowhere\.rec' replay nowhere.rec
rejects 'behind' replay nowhere.rec --csv x.csv --from 3 --to 2
rejects 'need --csv' replay nowhere.rec --from 1

# Generated thighs.
rejects 'girth-mm.*300 to 900' generate --girth-mm 100 -o out.sonde
rejects 'girth-mm.*muscle' generate --girth-mm 350 --fat-mm 35 -o out.sonde
rejects 'sex.*female or male' generate --sex other -o out.sonde
rejects 'axes ras or lps' generate --skin "$in/skin.ply" -o out.sonde
rejects 'go together' generate --femur "$in/skin.ply" -o out.sonde
rejects 'skin shows.*length of' generate --skin "$in/skin.ply" --axes ras -o out.sonde
rejects 'without --skin' generate --labels leg.nii --axes ras -o out.sonde
rejects 'needs --labels' generate --label-names names.txt -o out.sonde
rejects 'nowhere\.nii\.gz' generate --labels nowhere.nii.gz -o out.sonde
rejects '\.nii or \.nii\.gz' generate --labels "$in/skin.ply" -o out.sonde
echo 'no volume' >"$in/text.nii"
rejects 'no NIfTI header' generate --labels "$in/text.nii" -o out.sonde
echo '7 spleen' >"$in/names.txt"
rejects 'names\.txt:1: label 7' generate --labels nowhere.nii --label-names "$in/names.txt" -o out.sonde
rejects 'missing' generate --seed 1
rejects 'nowhere\.stl' generate --skin nowhere.stl --femur nowhere.stl -o out.sonde
rejects 'femur' generate --skin "$in/skin.ply" --femur "$in/skin.ply" -o out.sonde

# Records and presets of sonde identify.
columns=time_s,penetration_mm,slide_mm,normal_n
printf '%s\n0,0,0,0\n' $columns >"$in/lacks.csv"
rejects "lacks\\.csv:1.*tangential_n" identify "$MODEL" --ramp-hold "$in/lacks.csv" -o p.json
printf '%s,tangential_n\n0,0,0,0,0\n0,0,0,0,0\n' $columns >"$in/still.csv"
rejects 'still\.csv:3.*time_s' identify "$MODEL" --slide "$in/still.csv" -o p.json
printf '%s,tangential_n\n0,0,0,0,0\n1,0,0,0,0\n' $columns >"$in/few.csv"
rejects 'too short' identify "$MODEL" --ramp-hold "$in/few.csv" -o p.json
rejects 'ramp-hold' identify "$MODEL" -o p.json
rejects 'ramp-hold or slide, got .tap' identify "$MODEL" --simulate tap --site 27 -o out.csv
rejects 'no site 9999' identify "$MODEL" --simulate slide --site 9999 -o out.csv
printf '{"format": "sonde-preset", "version": 1,\n"mu_static": -1}' >"$in/odd.json"
rejects 'odd\.json:2: mu_static' press "$MODEL" --site 27 --depth-mm 2 --preset "$in/odd.json"
rejects 'odd\.json:2: mu_static' run "$MODEL" --headless --seconds 1 --preset "$in/odd.json"

# Cuts.
printf 'x_mm,y_mm,z_mm\n500,0,100\n500,50,100\n' >"$in/off_skin.csv"
rejects 'point 0 of the cut.*nearest node' cut "$MODEL" --path "$in/off_skin.csv" -o cut.sonde
printf 'x_mm,y_mm\n500,0\n' >"$in/two.csv"
rejects 'two\.csv:1: expected the header' cut "$MODEL" --path "$in/two.csv" -o cut.sonde
printf 'x_mm,y_mm,z_mm\n1,2\n' >"$in/few_numbers.csv"
rejects 'few_numbers\.csv:2: expected three' cut "$MODEL" --path "$in/few_numbers.csv" -o cut.sonde
rejects 'x,y,z:x,y,z' cut "$MODEL" --line 1,2,3 -o cut.sonde
rejects 'one of --line' cut "$MODEL" -o cut.sonde
rejects 'length-mm is missing' cut "$MODEL" --site 27 -o cut.sonde
rejects 'no site 9999' cut "$MODEL" --site 9999 --length-mm 40 -o cut.sonde
rejects '2 or more' cut "$MODEL" --line 0,0,0:0,0,0 -o cut.sonde

# Scenes.
printf 'sonde_scene: 1\nbodies:\n- {name: a, shape: {sphere_mm: 5}, mass_kg: -1}\n' >"$in/light.yaml"
rejects 'light\.yaml:3: mass_kg' simulate "$in/light.yaml" -o sim
printf 'sonde_scene: 1\nbodies:\n- {name: a, shape: {mesh: {file: gone.ply}}, mass_kg: 1}\n' \
  >"$in/gone.yaml"
rejects 'gone\.yaml:3:.*gone\.ply' simulate "$in/gone.yaml" -o sim
rejects 'nowhere\.yaml' simulate "$in/nowhere.yaml" -o sim
rejects 'DIR is missing' simulate "$DATA/../scenes/stack.yaml"
rejects 'either --steps or --seconds' simulate "$DATA/../scenes/stack.yaml" -o sim --steps 1 \
  --seconds 1

# A port that another program holds.
coproc HOLDER { "$HOLD_PORT"; }
read -r port <&"${HOLDER[0]}"
rejects "$port" run "$MODEL" --port "$port"
eval "exec ${HOLDER[1]}>&-"
# Cases and exams.
rejects '--case is missing' exam
rejects "no case 'nobody'" exam --case nobody
rejects "no protocol 'all', expected two_point, three_point, whole_leg, extended" exam --case healthy-lean --protocol all
rejects "no operator 'surgeon'" exam --case healthy-lean --operator surgeon
rejects 'from 1 to 100' exam --compare --seeds 0
rejects 'no such' exam --case ./absent.yaml
rejects 'no such' cases --check ./absent.yaml
rejects '-o FILE with' cases --generate 3
rejects 'first, easy or hard' cases --generate 3 --level odd -o x.yaml
sed 's/^level:.*/level: simple/' "$DATA/../cases/isolated-femoral.yaml" >"$work/in/level.yaml"
rejects 'level.yaml:4: level is .simple.' cases --check "$work/in/level.yaml"
sed 's/femoral_mid: clot/femoral_mid: compressible/; s/common_femoral: compressible/common_femoral: clot/' \
  "$DATA/../cases/isolated-femoral.yaml" >"$work/in/truth.yaml"
rejects 'the truth calls common_femoral clot' cases --check "$work/in/truth.yaml"
finish
