#!/usr/bin/env bash
# equal_accuracy.sh SONDE DIR [MODULI]: what the explicit and the implicit step cost for the same error
# (docs/scene_theory.md). A cantilever of springs bends under its weight for 0.2 s; the way of its centre,
# every 5 ms, is compared with a fine run of its own (rms of the difference over rms of the way).
# Per stiffness and method the step is halved until the error is 1 % or less; prints one CSV row
# each, best of three runs.
set -euo pipefail
sonde=$1 dir=$2 end=0.2 wanted=0.01
mkdir -p "$dir"

scene() { # YOUNGS STEP
  cat >"$dir/scene.yaml" <<YAML
sonde_scene: 1
gravity_m_s2: [0, 0, -9.81]
contacts: none
step: {$2}
bodies:
- name: beam
  kind: lattice
  shape: {box_mm: [200, 20, 20]}
  lattice: {cell_mm: 10, youngs_pa: $1, damping_s: 2e-4}
  density_kg_m3: 1000
  held_mm: [[[-100, -10, -10], [-100, 10, 10]]]
YAML
}

# Sets ways (m, one per line) and cost (s) of a run with steps of 5 ms/2^k.
run() { # YOUNGS K STEP
  local dt json
  dt=$(awk "BEGIN { printf \"%.12g\", 0.005 / 2 ^ $2 }")
  scene "$1" "dt_s: $dt, $3"
  json=$("$sonde" simulate "$dir/scene.yaml" -o "$dir/run" --seconds $end --no-frames \
    --every $((1 << $2)) --json)
  number() { sed -n "s/.*\"$1\": \([^,]*\).*/\1/p" <<<"$json"; }
  ways=$(tail -n +2 "$dir/run/bodies.csv" | cut -d, -f6)
  cost=$(awk "BEGIN { print $(number ms_per_step) * $(number steps) * 1e-3 }")
}

error_of() { # EXACT WAYS
  paste <(echo "$1") <(echo "$2") | awk '
    $2 !~ /^-?[0-9.]+(e[-+]?[0-9]+)?$/ || $2 * $2 > 1 { bad = 1 }
    { sum += ($1 - $2) ^ 2; size += $1 ^ 2 }
    END { print bad ? 9 : sqrt(sum / size) }'
}

echo "youngs_pa,method,dt_s,error,cost_s"
for youngs in ${3:-1e4 1e5 1e6 1e7 1e8}; do
  run $youngs 8 "lambda: 0.5, newton: 3"
  exact=$ways
  while read -r method step; do
    for ((k = 0; k < 14; ++k)); do
      run $youngs $k "$step"
      error=$(error_of "$exact" "$ways")
      [[ $(awk "BEGIN { print ($error <= $wanted) }") == 1 ]] && break
    done
    best=$cost
    for _ in 1 2; do
      run $youngs $k "$step"
      best=$(awk "BEGIN { print ($cost < $best) ? $cost : $best }")
    done
    echo "$youngs,$method,$(awk "BEGIN { print 0.005 / 2 ^ $k }"),$error,$best"
  done <<'METHODS'
explicit method: explicit
symplectic method: symplectic
implicit lambda: 1, solver_relative: 1e-4
trapezoid lambda: 0.5, solver_relative: 1e-4
METHODS
done
