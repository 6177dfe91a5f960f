#!/usr/bin/env bash
# Long work shows progress on a terminal and is silent in a pipe. Nothing here depends on how long
# the work takes: a line is drawn when work begins, and when its share changes.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
if ! command -v script >/dev/null; then
  echo "script (util-linux) is missing"
  exit 77
fi

# shows WORD ARGUMENTS: in a pipe stderr is empty; on a terminal the progress line says WORD, and
# nothing of the line is left at the end.
shows() {
  local word=$1 command
  shift
  checks=$((checks + 1))
  run "$@"
  ((status == 0)) || wrong "sonde $*: exit $status, expected 0"
  [[ ! -s $err ]] || wrong "sonde $*: says something in a pipe"
  printf -v command '%q ' "$SONDE" "$@"
  script -qec "$command" /dev/null </dev/null >"$work/terminal" 2>&1 || true
  grep -qE -- "$word" "$work/terminal" || wrong "sonde $*: the terminal does not show '$word'"
  # behind the last erasure of the line only the result stands
  tr '\r' '\n' <"$work/terminal" | sed 's/\x1b\[K//g' | grep -vE '%|^$' | tail -1 >"$work/last"
  [[ -s $work/last ]] || wrong "sonde $*: the result is missing on the terminal"
}

shows 'making the thigh' generate --seed 3 -o generated.sonde
shows 'building the case' cases --check "$DATA/../cases/isolated-femoral.yaml"
shows 'moving' identify "$MODEL" --simulate slide --site 27 --speed-mm-s 60 --slide-mm 4 --rate-hz 400 \
  --depth-mm 2 -o slide.csv
shows 'pressing' press "$MODEL" --site 27 --depth-mm 2
shows 'drawing' image "$MODEL" --site 27 -o picture.png
shows '[0-9] % ' simulate "$DATA/../scenes/stack.yaml" -o sim --steps 20
shares=$(tr '\r' '\n' <"$work/terminal" | grep -oE '[0-9]+ % ' | sort -u | wc -l)
((shares >= 5)) || wrong "simulate shows $shares shares, expected 5 or more"
finish
