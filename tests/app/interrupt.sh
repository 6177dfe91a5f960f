#!/usr/bin/env bash
# Ctrl-C during long work: the command ends soon, with exit 1, and leaves no file.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
checks=1
set -m # a background job keeps its interrupt
"$SONDE" measure "$MODEL" --sites "$DATA/sites.csv" --probe linear --step-mm 0.2 --limit-n 30 \
  -o long.csv >"$out" 2>"$err" </dev/null &
job=$!
sleep 1
if kill -INT "$job" 2>/dev/null; then
  start=$SECONDS status=0
  wait "$job" || status=$?
  ((SECONDS - start <= 20)) || wrong "ended only after $((SECONDS - start)) s"
  ((status == 1)) || wrong "exit $status, expected 1"
  [[ -z $(find . -name '*.part-*') ]] || wrong "left $(ls -A)"
else
  wrong "finished within a second: too short to be interrupted"
fi
finish
