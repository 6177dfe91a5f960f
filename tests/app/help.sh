#!/usr/bin/env bash
# Help, unknown words, and the manual that the build made: every option of --help stands in the manual
# page and back, and in the table that --help --json prints.
man=$MANUAL
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
declare -A options=(
  [run]="--port --headless --seconds --record --json"
  [fit]="--surface --sites --stages -o --json"
  [generate]="--seed --sex --girth-mm --fat-mm --skin --femur --labels --axes --section-svg -o --json"
  [predict]="--measurements --sites --interaction --json"
  [measure]="--sites --probe --step-mm --limit-n -o --json"
  [identify]="--ramp-hold --slide --simulate --site --preset -o --json"
  [press]="--site --probe --force-n --depth-mm --image --case --preset --json"
  [solve]="--site --block --probe --depths --contact --csv --json"
  [image]="--pose --site --force-n --case --depth-mm --size -o --json"
  [cut]="--line --path --site --length-mm --offset-mm --turn-deg --depth-mm --probe -o --json"
  [simulate]="-o --steps --seconds --every --picture --resume --json"
  [reconstruct]="-o --leave-one-out --copy --config --json"
  [slice]="--pose --frame --hold-out -o --compare --stack --json"
  [replay]="--json"
  [send]="--to --called --calling --json"
  [bench]="--scene --haptics --device --json"
  [validate]="--quick --pressing --sites --json"
  [exam]="--case --protocol --operator --seed --compare -o --json"
  [scanner]="--model --evaluations --from -o --json"
  [course]="--measure --runs --lesson -o --json"
  [cases]="--check --generate --level -o --json"
  [doppler]="--vessel --squeeze-s --valsalva-s --clot --leak --angle-deg --csv -o --json"
  [devices]="--probe --json"
  [paper]="-o --output --quick --json"
  [class]="--learners --names --port"
)

listed() { grep -oE -- '(^|[^a-zA-Z0-9-])--[a-z][a-z-]*' | grep -oE -- '--[a-z-]+' | sort -u; }

run --help
((status == 0)) || wrong "sonde --help: exit $status"
cp "$out" "$work/help"
for verb in "${!options[@]}"; do
  checks=$((checks + 1))
  grep -qw "$verb" "$work/help" || wrong "sonde --help does not list $verb"
  run "$verb" --help
  ((status == 0)) || wrong "sonde $verb --help: exit $status"
  [[ -s $out && ! -s $err ]] || wrong "sonde $verb --help: belongs on stdout alone"
  for option in ${options[$verb]}; do
    grep -qE -- "(^|[^a-z-])$option([^a-z-]|$)" "$out" || wrong "sonde $verb --help misses $option"
  done
  # In mdoc "Fl -seconds" is --seconds.
  there=$(sed 's/Fl -\([a-z]\)/ --\1/g' "$man/sonde-$verb.1" | listed)
  here=$({ cat "$out"; [[ $verb != bench ]] || "$SONDE" bench --scene image --help
    [[ $verb != fit ]] || "$SONDE" fit --cohort list --help; } | listed)
  [[ $here == "$there" ]] ||
    wrong "sonde $verb: --help and manual differ: $(diff <(echo "$here") <(echo "$there") | grep '^[<>]' | tr '\n' ' ')"
  gives "command=$verb summary:text usage:text text:text" "$verb" --help --json
  table=$(sed -n 's/^ *"name": "\(--[^"]*\)",*$/\1/p; s/^ *"long_name": "\([^"]*\)",*$/--\1/p' "$out" | listed)
  for option in $table; do
    grep -qxF -- "$option" <<<"$here" || wrong "sonde $verb: --help misses $option of its table"
  done
  [[ -n $table ]] || wrong "sonde $verb --help --json lists no option"
  rejects 'frobnicate' "$verb" --frobnicate
done
rejects "did you mean 'press'" pres
rejects 'unknown command' somethingelse
rejects 'usage'
run --version
[[ $status == 0 && $(<"$out") =~ ^sonde\ [0-9]+\.[0-9]+\.[0-9]+$ ]] || wrong "sonde --version"
finish
