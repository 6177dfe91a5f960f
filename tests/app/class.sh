#!/usr/bin/env bash
# sonde class: starts a program per learner, shows how they are doing, starts one again that died,
# gives up on one that cannot run, and leaves no program behind. With --listen: a port of the network
# that lets in who knows the code, and nobody else.
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/common.sh"
set -m # a background job keeps its interrupt

rejects 'expected --learners N or --names' class
rejects "from 1 to 32" class --learners 33
rejects '3 names' class --learners 2 --names A,B,C
rejects "two learners are called 'A'" class --names A,B,A
rejects 'names of 1 to' class --names A,,B
rejects 'leaves no room' class --learners 4 --port 65533
rejects 'cannot be the same' class --learners 2 -- --record exam.rec
rejects 'come after --' class --learners 2 bundled
rejects 'expects ADDRESS:PORT' class --learners 2 --data ../data0 --listen 127.0.0.1
rejects 'no address of this computer' class --learners 2 --data ../data0 --listen everywhere:0

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

python=python3
[[ -x /usr/bin/python3 ]] && python=/usr/bin/python3
client() { "$python" "$here/class_door.py" "$@"; }
answers() { # PATTERN WORDS...: what the class's door answers
  local got
  got=$(client "${@:2}" 2>&1 || true)
  grep -qE -- "$1" <<<"$got" || wrong "'${*:2}' got '${got:0:300}', expected $1"
}
open_class() { # WORDS...: a class on the network; sets job, at, code and secret
  "$SONDE" class --port "$port" --program "$FAKE_LEARNER" --listen 127.0.0.1:0 --data data "$@" >"$out" 2>"$err" </dev/null &
  job=$!
  wait_for '^Certificate: '
  at=$(sed -n 's/^Join at: //p' "$out") code=$(sed -n 's/^Code: //p' "$out")
  secret=$(sed -n 's/^Teacher: .*#//p' "$out")
}
end_class() {
  kill -INT "$job"
  wait "$job" || wrong "the class ended with $?"
}

checks=$((checks + 1)) # who joins gets a place and a program; the code and the secret open what they are for
rm -f pid.*
open_class --learners 2
[[ $(stat -c %a data/class.pem data/teacher.token | sort -u) == 600 ]] || wrong "others can read the class's secrets"
print=$(client fingerprint "$at")
grep -qF "SHA-256 $print" "$out" || wrong "the certificate is not the one whose fingerprint was printed"
compgen -G 'pid.*' >/dev/null && wrong "a program runs for nobody"
answers '^200 ' get "$at" ''
answers '^401 ' join "$at" AAAA-AAAA Anna
answers '^200 \{"place":1,"token":"[0-9a-f]{32}"\}' join "$at" "$code" Anna
wait_for "Anna: exam, case case-$port,"
answers '^409 Anna has a place already' join "$at" "$code" Anna
answers '^404 Zoe is not in this class' join "$at" "$code" Zoe watcher
watcher=$(client join "$at" "$code" Anna watcher | grep -oE '[0-9a-f]{32}')
answers '^200 \{"place":2,' join "$at" "${code,,}" 'Bo & Co'
wait_for "Bo & Co: exam, case case-$((port + 1)),"
answers '^503 all places' join "$at" "$code" Chris
answers '^401 ' get "$at" class.json "$watcher"
# The board is written once in a while: its count of wrong secrets follows them.
for ((i = 0; i < 1200; ++i)); do client get "$at" class.json "$secret" | grep -q '"wrong":2,' && break; sleep 0.1; done
answers '"wrong":2,.*"name":"Anna".*"name":"Bo & Co"' get "$at" class.json "$secret"
token=$(client get "$at" class.json "$secret" | grep -oE '"learner_token":"[0-9a-f]{32}"' | head -1 | grep -oE '[0-9a-f]{32}')
[[ -n $token && $token != "$watcher" ]] || wrong "a watcher has the learner's secret"
answers '^200 \{"trainee":"Anna"' get "$at" 1/status.json "$token"
answers '^404 ' get "$at" 2/status.json "$token" # the fake program's answer to a stranger
# A learning management system reads what its ticket's learner did since, and nobody else's.
ticket=0123456789abcdef0123456789abcdef
answers '^404 ' get "$at" "lms.json?ticket=$ticket"
answers '^401 ' get "$at" "lms?ticket=$ticket" "$watcher"
answers '^404 ' get "$at" "lms?ticket=0123" "$token"
answers '^200 ' get "$at" "lms?ticket=$ticket" "$token"
answers '^200 \{"since":"20[^"]+","exams":\[\]\}' get "$at" "lms.json?ticket=$ticket"

checks=$((checks + 1)) # strangers that hold every connection cost nobody else
mkfifo hold
client hostile "$at" 400 <hold >held &
stranger=$!
exec 9>hold
for ((i = 0; i < 1200; ++i)); do grep -q held held && break; sleep 0.1; done
answers '^200 \{"trainee":"Anna"' get "$at" 1/status.json "$token"
exec 9>&-
wait "$stranger" || true
end_class

checks=$((checks + 1)) # the same certificate and teacher's address next time, another code
before="$secret $code"
mkdir exams
"$SONDE" exam --recover exams >/dev/null # makes a log without exams
add_exams() { # "TRAINEE SCORE BROKEN_OFF DATE"...
  "$python" - "$@" <<'ROWS'
import sqlite3
import sys
log = sqlite3.connect("exams/exams.sqlite")
columns = [row[1:3] for row in log.execute("PRAGMA table_info(exams)")][1:]
for name, score, gone, date in (words.rsplit(" ", 3) for words in sys.argv[1:]):
    row = {"id": f"{date}-{name}", "trainee": name, "case_id": "healthy-lean", "case_title": "First walk", "protocol": "two_point",
           "guidance": "full", "date": date, "score": float(score), "passed": int(float(score) > 60), "correct": 1,
           "interrupted": int(gone), "seconds": 83.21}
    values = [row.get(column, "" if kind == "TEXT" else 0) for column, kind in columns]
    log.execute(f"INSERT INTO exams ({','.join(c for c, _ in columns)}) VALUES ({','.join('?' * len(columns))})", values)
log.commit()
ROWS
}
add_exams "Anna 41.5 0 2026-11-20T04:40:00Z" "Anna 88 0 2026-11-21T04:40:00Z" 'Bo, "B" 72.25 0 2026-11-22T04:40:00Z' "Bo 0 1 2026-11-23T04:40:00Z"
open_class --names 'Anna,Bo' --scorm class.zip -- --exams exams
[[ $(client fingerprint "$at") == "$print" && $secret == "${before% *}" && $code != "${before#* }" ]] ||
  wrong "another certificate or secret at the second start, or the same code"
wait_for "Bo: exam" # who is on the list has a program at once
answers '"trainee":"Anna".*"score":88,"passed":true,"correct":true,"seconds":83.21' get "$at" results.json "$secret"
client get "$at" results.csv "$secret" | tr -d '\r' >table
[[ $(grep -c . table) == 4 ]] || wrong "the table has $(grep -c . table) lines, expected a head and 3 exams"
grep -qF '"2026-11-22T04:40:00Z","Bo, ""B""","healthy-lean","First walk","two_point","full",72.2,1,1,83.2,0' table ||
  wrong "the table lacks Bo's exam: $(head -2 table)"
client get "$at" statements.jsonl "$secret" | sed '1s/^200 //' >statements
"$python" "$here/check_xapi.py" statements 4 || wrong "no statements of xAPI"
"$python" "$here/check_scorm.py" class.zip "$at" || wrong "no package of SCORM 1.2"
token=$(client get "$at" class.json "$secret" | grep -oE '"learner_token":"[0-9a-f]{32}"' | head -1 | grep -oE '[0-9a-f]{32}')
answers '^200 ' get "$at" "lms?ticket=$ticket" "$token"
answers '^200 \{"since":"20[^"]+","exams":\[\]\}' get "$at" "lms.json?ticket=$ticket" # Anna's older exams are not the system's
add_exams "Anna 91 0 2090-01-01T00:00:00Z" "Bo 17 0 2090-01-01T00:00:00Z" "Anna 0 1 2090-01-02T00:00:00Z" # ends, other's, broken off
for ((i = 0; i < 1200; ++i)); do client get "$at" "lms.json?ticket=$ticket" | grep -q '"score":91,' && break; sleep 0.1; done
answers '"exams":\[\{[^]]*"score":91,"passed":true,"correct":true,"seconds":83.21\}\]\}$' get "$at" "lms.json?ticket=$ticket"
answers '^401 ' get "$at" statements.jsonl "$watcher"
answers '^403 Chris is not on the list' join "$at" "$code" Chris
answers '^200 \{"place":2,' join "$at" "$code" Bo
end_class
chmod 644 data/class.pem
run class --learners 1 --port "$port" --program "$FAKE_LEARNER" --listen 127.0.0.1:0 --data data
((status != 0)) && grep -q 'only you can read' "$err" || wrong "took a key that others can read"
chmod 600 data/class.pem
run class --learners 1 --port "$port" --program "$FAKE_LEARNER" --listen 127.0.0.1:0 --data data --scorm not-there/class.zip
((status == 2)) && grep -q 'not-there' "$err" || wrong "exit $status for a package in a directory that is not there, expected 2"
run class --learners 1 --scorm class.zip
((status == 2)) && grep -q -- '--scorm needs --listen' "$err" || wrong "exit $status for a package without an address, expected 2"
finish
