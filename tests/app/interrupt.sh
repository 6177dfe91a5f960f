#!/usr/bin/env bash
# Ctrl-C during long work: the command ends before its work is done, with exit 1, says how
# much of the table it kept and leaves no temporary file.
# The interrupt comes once the command has used two seconds of processor time; the whole work
# takes minutes of it.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
checks=1
set -m # a background job keeps its interrupt
"$SONDE" measure "$MODEL" --sites "$DATA/sites.csv" --probe linear --step-mm 0.2 --limit-n 30 \
  -o long.csv >"$out" 2>"$err" </dev/null &
job=$!
used_ticks() { awk '{print $14 + $15}' "/proc/$job/stat" 2>/dev/null || echo gone; }
two_seconds=$((2 * $(getconf CLK_TCK)))
while [[ $(used_ticks) != gone ]] && (($(used_ticks) < two_seconds)); do sleep 0.05; done
if kill -INT "$job" 2>/dev/null; then
  status=0
  wait "$job" || status=$?
  ((status == 1)) || wrong "exit $status, expected 1"
  grep -q 'cancelled after [0-9]* of 64 sites' "$err" || wrong "does not say what is missing"
  [[ -z $(find . -name '*.part-*') ]] || wrong "left $(ls -A)"
else
  wrong "finished within two seconds of processor time: too short to be interrupted"
fi
finish
