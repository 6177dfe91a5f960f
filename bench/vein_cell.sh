#!/usr/bin/env bash
# vein_cell.sh [WALL_KPA DEVIATOR_KPA [LAST_MMHG]]: lumen area of a vein in a square of muscle, plane
# strain, by CalculiX (ccx, Debian: calculix-ccx). Without arguments: walls of 15, 30, 60 kPa.
#
# A quarter of a square of 100 mm whose sides carry the deviator; the lumen's pressure goes from 10
# mmHg down. Lumen, wall (0.5 mm) and materials (Ogden) are those of the study of vein compression.
# Prints CSV: wall kPa, deviator kPa, pressure over the mean outside mmHg, area mm^2, diameters mm;
# as far as the solution converges.
set -euo pipefail
if [[ ${1:-} == --help || ${1:-} == -h ]]; then
  sed -n '2,9s/^# \{0,1\}//p' "$0"
  exit 0
fi
command -v ccx >/dev/null || { echo "vein_cell.sh: no ccx; apt-get install calculix-ccx" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

deck() { # WALL DEVIATOR LAST
  awk -v wall="$1" -v deviator="$2" -v last="$3" '
    function place(i, j,   t, c, s, w, m, k) {
      t = pi / 2 * j / around; c = cos(t); s = sin(t)
      if (radius[i] > edge + 1e-9) {
        w = ((radius[i] - edge) / (half - edge)) ^ 1.5
        m = c > s ? c : s
        k = 1 - w + w / m # circles become the square
      } else k = 1
      px = radius[i] * c * k; py = radius[i] * s * k
    }
    function node(i, j, k) {
      if ((i, j, k) in id) return id[i, j, k]
      id[i, j, k] = ++nodes
      place(i, j); printf "%d,%.9g,%.9g,%g\n", nodes, px, py, k * 0.5 > "nodes"
      if (j == 0) print nodes "," > "bottom"
      if (j == around) print nodes "," > "left"
      return nodes
    }
    function element(i, j,   n, k) {
      n = 0
      for (k = 0; k <= 2; k += 2) {
        c[n++] = node(i, j, k); c[n++] = node(i + 2, j, k)
        c[n++] = node(i + 2, j + 2, k); c[n++] = node(i, j + 2, k)
      }
      for (k = 0; k <= 2; k += 2) {
        c[n++] = node(i + 1, j, k); c[n++] = node(i + 2, j + 1, k)
        c[n++] = node(i + 1, j + 2, k); c[n++] = node(i, j + 1, k)
      }
      c[n++] = node(i, j, 1); c[n++] = node(i + 2, j, 1)
      c[n++] = node(i + 2, j + 2, 1); c[n++] = node(i, j + 2, 1)
    }
    function material(name, mu, exponent, bulk) {
      printf "*MATERIAL,NAME=%s\n*HYPERELASTIC,OGDEN,N=1\n%g,%g,%g\n*SOLID SECTION,ELSET=%s,MATERIAL=%s\n",
        name, mu, exponent, 2 / bulk, name, name
    }
    function step(pressure, increment) {
      printf "*STEP,NLGEOM,INC=400\n*STATIC\n%g,1.,1e-4,%g\n", increment, increment
      print "*CONTROLS,PARAMETERS=FIELD\n0.5,0.03\n*DLOAD"
      printf "INSIDE,P6,%.9g\nRIGHT,P4,%.9g\nTOP,P4,%.9g\n", pressure * 1.33322e-4, -deviator * 1e-3, deviator * 1e-3
      print "*NODE PRINT,NSET=RING\nU\n*END STEP"
    }
    BEGIN {
      pi = atan2(0, -1); around = 28; half = 50; rings = 14
      start = wall == 15 ? 4.010 : wall == 30 ? 4.160 : 4.291
      edge = start + 0.5
      for (i = 0; i <= 4; ++i) radius[i] = start + 0.125 * i
      for (i = 1; i <= 2 * rings; ++i)
        radius[4 + i] = i % 2 ? 0.5 * edge * (half / edge) ^ ((i - 1) / 2 / rings) * (1 + (half / edge) ^ (1 / rings)) \
                              : edge * (half / edge) ^ (i / 2 / rings)
      for (a = 0; a < rings + 2; ++a)
        for (b = 0; b < around / 2; ++b) {
          element(2 * a, 2 * b)
          line = ++elements
          for (k = 0; k < 20; ++k) line = line "," (k == 15 ? "\n" : "") c[k]
          print line > (a < 2 ? "wall" : "muscle")
          if (a == 0) print elements "," > "inside"
          if (a == rings + 1) print elements "," > (b < around / 4 ? "right" : "top")
        }
      for (j = 0; j <= around; ++j) { place(0, j); print id[0, j, 0], px, py > "ring"; set = set id[0, j, 0] ",\n" }
      print "*NODE,NSET=ALL\n*INCLUDE,INPUT=nodes\n*ELEMENT,TYPE=C3D20R,ELSET=WALL\n*INCLUDE,INPUT=wall"
      print "*ELEMENT,TYPE=C3D20R,ELSET=MUSCLE\n*INCLUDE,INPUT=muscle\n*ELSET,ELSET=INSIDE\n*INCLUDE,INPUT=inside"
      print "*ELSET,ELSET=RIGHT\n*INCLUDE,INPUT=right\n*ELSET,ELSET=TOP\n*INCLUDE,INPUT=top"
      print "*NSET,NSET=BOTTOM\n*INCLUDE,INPUT=bottom\n*NSET,NSET=LEFT\n*INCLUDE,INPUT=left"
      printf "*NSET,NSET=RING\n%s", set
      material("WALL", wall * 1e-3, 8, wall * 1e-2) # MPa; bulk over shear modulus 10 and 60
      material("MUSCLE", 3.6e-3, 9, 0.216)
      print "*BOUNDARY\nALL,3,3\nBOTTOM,2,2\nLEFT,1,1"
      step(10, 0.1)
      step(last, 2 / (10 - last))
    }' >cell.inp
}

areas() { # WALL DEVIATOR LAST
  awk -v wall="$1" -v deviator="$2" -v last="$3" '
    function report(   k, x, y, ox, oy, area, pressure, wide) {
      if (!seen || time < 1 - 1e-9) return
      for (k = 1; k <= count; ++k) {
        x = x0[k] + ux[name[k]]; y = y0[k] + uy[name[k]]
        if (k == 1) wide = 2 * x; else area += 2 * (ox * y - x * oy)
        ox = x; oy = y
      }
      pressure = 10 + (last - 10) * (time - 1)
      printf "%g,%g,%.2f,%.3f,%.3f,%.3f\n", wall, deviator, pressure, area, wide, 2 * oy
    }
    FNR == NR { ++count; name[count] = $1; x0[count] = $2; y0[count] = $3; next }
    / time / { report(); time = $NF; seen = 1; next }
    NF == 4 { ux[$1] = $2; uy[$1] = $3 }
    END { report() }' ring cell.dat
}

cell() {
  cd "$work"
  rm -f ./*
  deck "$@"
  OMP_NUM_THREADS=1 ccx -i cell >log 2>&1 || true # ends with an error where it no longer converges
  [[ -s cell.dat ]] || { tail -5 log >&2; exit 1; }
  areas "$@"
}

echo "wall_kpa,deviator_kpa,pressure_mmhg,area_mm2,lateral_mm,depth_mm"
if (($# >= 2)); then
  cell "$1" "$2" "${3:--40}"
else
  for wall in 15 30 60; do for deviator in 0.05 0.5 2; do (cell $wall $deviator -40); done; done
fi
