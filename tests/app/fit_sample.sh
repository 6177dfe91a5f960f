#!/usr/bin/env bash
# sonde fit --sample: a table of known n, K and x_m gives them back; what is no such table is refused.
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/common.sh"
table() { # N NAME: K = 3 N/mm, x_m = 28 mm, 50 mm across, 30 mm high
  awk -v n="$1" 'BEGIN { print "Diameter: 50mm\nHeight: 30mm\nCompression (mm),Load (N)"
    for (i = 0; i <= 300; ++i) { s = i / 15; printf "%.6f,%.6f\n", s, 3 * s / (1 - (s / 28)^n) } }' >"$work/in/$2"
}
for n in 1 2 3; do
  table $n n$n.csv
  gives "count>=301 exponent>=$n exponent<=$n chosen.stiffness_n_mm>=2.9999 chosen.stiffness_n_mm<=3.0001 \
    chosen.asymptote_mm>=27.999 chosen.asymptote_mm<=28.001 chosen.held_out_percent<=0.01 \
    n1.held_out_percent<=100 n3.held_out_percent<=100 chosen.modulus_kpa>=45.8 chosen.modulus_kpa<=45.9" \
    fit --sample "$work/in/n$n.csv" --json
done
gives 'exponent>=2 exponent<=2 n1.a_per_n<=-0.0119 n1.b_mm_per_n>=0.333 chosen.modulus_kpa>=59' fit \
  --sample "$work/in/n1.csv" --exponent 2 --height-mm 40 --area-mm2 2000 --json
awk -F, 'NR > 3 { $2 = 50 } { print $1 "," $2 }' "$work/in/n1.csv" >"$work/in/flat.csv"
printf 'Compression,Load\n1,2\n' >"$work/in/units.csv"
rejects 'does not change' fit --sample "$work/in/flat.csv"
rejects 'names a compression and a force with their units' fit --sample "$work/in/units.csv"
rejects 'goes without measurements' fit --sample "$work/in/n1.csv" -o m.sonde
rejects 'exponent' fit --sample "$work/in/n1.csv" --exponent 4
finish
