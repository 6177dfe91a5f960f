#!/usr/bin/env bash
# sonde class: starts a program per learner, shows how they are doing, starts one again that died,
# gives up on one that cannot run, and leaves no program behind.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
set -m # a background job keeps its interrupt

rejects 'expected --learners N or --names' class
rejects 'from 1 to 16' class --learners 17
rejects '3 names' class --learners 2 --names A,B,C
rejects "two learners are called 'A'" class --names A,B,A
rejects 'names of 1 to' class --names A,,B
rejects 'leaves no room' class --learners 4 --port 65533
rejects 'cannot be the same' class --learners 2 -- --record exam.rec
rejects 'come after --' class --learners 2 bundled

free_port() { # of a run of six that look free
  local port=$((20000 + $$ % 20000 / 8 * 8)) i used
  while :; do
    used=0
    for i in 0 1 2 3 4 5; do
      if (exec 3<>"/dev/tcp/127.0.0.1/$((port + i))") 2>/dev/null; then used=1; fi
    done
    ((used)) || break
    port=$((port + 8))
  done
  echo "$port"
}

wait_for() { # WORDS: until the class has said them
  local i
  for ((i = 0; i < 6000; ++i)); do
    grep -qE -- "$1" "$out" && return
    sleep 0.1
  done
  wrong "sonde class never said '$1': $(tail -3 "$out")"
}

alive() { kill -0 "$1" 2>/dev/null; }

checks=$((checks + 1))
port=$(free_port)
"$SONDE" class --names 'Anna,Bo,C D' --port "$port" --program "$FAKE_LEARNER" >"$out" 2>"$err" </dev/null &
job=$!
wait_for "Anna: exam, case case-$port,"
wait_for "Bo: exam, case case-$((port + 1)),"
wait_for "C D: exam, case case-$((port + 2)),"
grep -qE "^C D: http://127.0.0.1:$((port + 2))/#[0-9a-f]{32}\$" "$out" || wrong "no address of the third learner"
(($(grep -oE '#[0-9a-f]{32}$' "$out" | sort -u | wc -l) == 6)) || wrong "learners share a token"
read -r first _ <"pid.$port"
if tr '\0' ' ' <"/proc/$first/cmdline" | grep -qE '[0-9a-f]{32}'; then wrong "the token is in the command line, for all to see"; fi
[[ $(cut -d' ' -f2- "pid.$((port + 2))") == 'C D' ]] || wrong "the name did not reach the program"

checks=$((checks + 1))
read -r first _ <"pid.$((port + 1))"
kill -KILL "$first"
wait_for 'Bo: was ended by signal 9 after [0-9]+ s; starting again \(1 of 3\)'
for ((i = 0; i < 6000; ++i)); do
  [[ $(grep -c "Bo: exam" "$out") -ge 2 ]] && break
  sleep 0.1
done
[[ $(grep -c "Bo: exam" "$out") -ge 2 ]] || wrong "Bo never came back"
read -r second _ <"pid.$((port + 1))"
[[ $first != "$second" ]] || wrong "Bo's program was not started again"
alive "$second" || wrong "Bo's second program does not run"

checks=$((checks + 1))
status=0
kill -INT "$job"
wait "$job" || status=$?
((status == 0)) || wrong "exit $status after Ctrl-C, expected 0"
for file in pid.*; do
  read -r process _ <"$file"
  if alive "$process"; then wrong "left $file running"; kill -KILL "$process"; fi
done

checks=$((checks + 1)) # one that cannot run ends with the program's own words
rm -f pid.*
run class --learners 2 --port "$port" --program "$FAKE_LEARNER" -- --die
((status == 1)) || wrong "exit $status when no program runs, expected 1"
grep -q 'Learner 2: ended with exit code 3 after 0 s: fake_learner: no probe is plugged in; given up' \
  "$out" || wrong "does not say why: $(tail -2 "$out")"
run class --learners 1 --program ./not-there
((status == 1)) || wrong "exit $status for a program that is not there, expected 1"
grep -q 'not-there cannot be started' "$out" || wrong "does not say that the program is not there"

checks=$((checks + 1)) # one that accepts and never answers does not stop the class
"$SONDE" class --learners 1 --port "$port" --program "$FAKE_LEARNER" -- --hang >"$out" 2>"$err" </dev/null &
job=$!
wait_for 'Learner 1: starting'
status=0
kill -TERM "$job"
wait "$job" || status=$?
((status == 0)) || wrong "exit $status after SIGTERM, expected 0"
finish
