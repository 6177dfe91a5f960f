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
: >"$in/empty.csv"
rejects 'empty\.csv' fit "$in/empty.csv" "${fit[@]}"
rejects 'empty\.csv' measure "$MODEL" --sites "$in/empty.csv" --probe linear --step-mm 2 --limit-n 10 \
  -o out.csv
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
rejects 'linear' measure "$MODEL" --sites "$DATA/sites.csv" --probe finger --step-mm 2 --limit-n 10 \
  -o out.csv
rejects 'interaction|simplified' predict "$MODEL" --measurements "$DATA/indentation.csv" \
  --sites "$DATA/sites.csv" --interaction some
rejects 'scene' bench --scene moon

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
rejects 'missing/' run "$MODEL" --headless --seconds 0.2 --record missing/a.rec
rejects 'missing/' fit "$DATA/indentation.csv" --surface "$in/skin.ply" --sites "$DATA/sites.csv" \
  --stages 1 -o missing/model.sonde

# Recordings.
rejects 'skin\.ply' replay "$in/skin.ply"
rejects 'nowhere\.rec' replay nowhere.rec

# A port that another program holds.
coproc HOLDER { "$HOLD_PORT"; }
read -r port <&"${HOLDER[0]}"
rejects "$port" run "$MODEL" --port "$port"
eval "exec ${HOLDER[1]}>&-"
finish
