#!/usr/bin/env bash
# ccx.sh SONDE: the same bonded press on the same mesh by CalculiX (ccx, Debian: calculix-ccx, a separate program) and by
# sonde solve: forces within 1 %.
set -euo pipefail
sonde=$1
command -v ccx >/dev/null || { echo "no ccx; apt-get install calculix-ccx"; exit 1; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
"$sonde" solve --block 20:2:6 --probe rect:10x10 --reach-mm 20 --edge-mm 2.5 --through 4:3:1 --skin 8:9 \
  --contact bonded --depths 2 --deck press.inp --csv press.csv >/dev/null
OMP_NUM_THREADS=1 ccx press >log 2>&1 || { tail -20 log; exit 1; }
ours=$(awk -F, 'NR == 2 { print $2 }' press.csv)
theirs=$(awk 'NF == 3 && $3 ~ /^-?[0-9.]+E/ { force = -$3 } END { print force }' press.dat)
awk -v a="$ours" -v b="$theirs" 'BEGIN {
  off = 100 * (a / b - 1)
  printf "sonde solve %.5f N, CalculiX %.5f N: %+.2f %%\n", a, b, off
  exit !(off > -1 && off < 1)
}'
