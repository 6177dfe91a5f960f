#!/usr/bin/env bash
# crash.sh quick|full|N [exam|generate|fit|cases|class]...: a program is killed at its disk calls, a
# write is torn, the disk is full from a call on, one call fails. Then the journals are recovered:
# no exam is lost that had begun, no decision that was told to be on the disk, no old output.
# quick takes some of the calls, full all of them, N every N-th.
set -euo pipefail
: "${SONDE:?}" "${EXAM_ONCE:?}" "${FAULTS:?}" "${MODEL:?}" "${DATA:?}" "${LIBRARY:?}"
mode=${1:-quick}
shift || true
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
tried=0 lost=0 wrong=0 refused=0
# An exam in two positions of the patient, so that it has two recordings.
mkdir "$work/protocols"
cat >"$work/protocols/two.yaml" <<'END'
sonde_protocol: 1
id: two
title: Two
text: Two.
places:
- {title: Groin, at: {station: common_femoral}}
- {title: Knee, at: {station: popliteal}, position: prone_bent}
END
export EXAM_ONCE_MODEL=$MODEL EXAM_ONCE_CASES=$LIBRARY/cases EXAM_ONCE_PROTOCOLS=$work/protocols
export EXAM_ONCE_SECONDS=0.4 EXAM_ONCE_ROOM_AFTER=0.1 EXAM_ONCE_DIR=$work/d DISK_FAULTS_UNDER=$work/d

complain() {
  echo "WRONG: $1"
  sed 's/^/    stderr: /' "$work/err" | tail -3
  wrong=$((wrong + 1))
}

# faulty HOW AT COMMAND...: sets status
faulty() {
  local how=$1 at=$2
  shift 2
  status=0
  { timeout 600 env LD_PRELOAD="$FAULTS" DISK_FAULTS_HOW="$how" DISK_FAULTS_AT="$at" \
    DISK_FAULTS_COUNT="$work/count" "$@" >"$work/told" 2>"$work/err" </dev/null; } 2>/dev/null ||
    status=$?
}

said() { grep -c "^$1\$" "$work/told" || true; }
member() { sed -n "s/^ *\"$1\": *\([0-9]*\),\{0,1\}\$/\1/p" "$work/json"; }

# After the fault: everything that was told is there.
check_exam() { # WHAT
  local what=$1 journals decided=0 file
  "$SONDE" exam --recover "$work/d" --cases "$LIBRARY/cases" --protocols "$work/protocols" --json \
    >"$work/json" 2>"$work/err" || complain "$what: recovery failed"
  journals=$(find "$work/d" -name exam.rec | wc -l)
  if (($(said begun) > journals - $(member never_began) || $(member exams) != journals)); then
    complain "$what: $(said begun) begun, $journals journals, $(member exams) listed, $(member never_began) not begun"
    lost=$((lost + 1))
  fi
  for file in "$work"/d/*/exam*.rec; do
    [[ -e $file ]] && decided=$((decided + $("$EXAM_ONCE" notes "$file" 2>/dev/null || echo 0)))
  done
  if (($(said decided) > decided)); then
    complain "$what: $(said decided) decisions told, $decided in the journal"
    lost=$((lost + 1))
  fi
  if (($(said kept) > 0)) && ! compgen -G "$work/d/*/report.html" >/dev/null; then
    complain "$what: kept, but there is no report"
    lost=$((lost + 1))
  fi
  [[ -z $(find "$work/d" -mindepth 2 -name '*.part-*') ]] ||
    complain "$what: $(find "$work/d" -mindepth 2 -name '*.part-*') is left"
  # A second look finds nothing new: the log has them all.
  "$SONDE" exam --recover "$work/d" --cases "$LIBRARY/cases" --protocols "$work/protocols" --json \
    >"$work/json" 2>"$work/err" || complain "$what: second recovery failed"
  (($(member added) + $(member derived) == 0)) || complain "$what: recovered twice"
}

fresh() { rm -rf "$work/d" && mkdir "$work/d"; }

exam_at() { # HOW AT
  fresh
  faulty "$1" "$2" "$EXAM_ONCE" run
  tried=$((tried + 1))
  if [[ $1 == kill || $1 == torn ]]; then
    ((status == 137 || status == 0)) || complain "exam, $1 at $2: exit $status"
  elif ((status != 0)); then
    ((status == 1)) || complain "exam, $1 at $2: exit $status, expected 1"
    [[ -s $work/err ]] || complain "exam, $1 at $2: nothing was said"
  fi
  (($(said begun) > 0)) || refused=$((refused + 1))
  check_exam "exam, $1 at $2"
}

# command_at HOW AT OUTPUT COMMAND...: the output is the old one or the new one.
command_at() {
  local how=$1 at=$2 output=$3
  shift 3
  fresh
  cp "$work/old" "$output"
  faulty "$how" "$at" "$@"
  tried=$((tried + 1))
  cmp -s "$output" "$work/old" || cmp -s "$output" "$work/new" || {
    complain "$*: $how at $at: the output is neither old nor new"
    lost=$((lost + 1))
  }
  if [[ $how != kill && $how != torn ]]; then
    ((status == 1)) || { ((status == 0)) && cmp -s "$output" "$work/new"; } ||
      complain "$*: $how at $at: exit $status"
    ((status == 0)) || [[ -s $work/err ]] || complain "$*: $how at $at: nothing was said"
    [[ -z $(find "$work/d" -name '*.part-*') ]] || complain "$*: $how at $at: something was left"
  fi
}

calls_of() { cat "$work/count"; }

# over CALLS HOWS FUNCTION...: every call, or some of them in turn.
over() {
  local calls=$1 hows=$2 every=1 k how
  shift 2
  [[ $mode != quick ]] || every=$((calls * $(wc -w <<<"$hows") / 3 + 1))
  [[ ! $mode =~ ^[0-9]+$ ]] || every=$mode
  local n=0
  for ((k = 0; k < calls; ++k)); do
    for how in $hows; do
      ((n++ % every == 0)) && "$@" "$how" "$k"
    done
  done
  return 0
}

case_exam() {
  fresh
  faulty none -1 "$EXAM_ONCE" run
  ((status == 0 && $(said kept) == 1 && $(said decided) == 2)) || complain 'an exam without faults'
  cp "$work"/d/*/report.html "$work/report" && cp "$work"/d/*/exam.json "$work/exam.json"
  local calls
  calls=$(calls_of)
  # What is derived is what was written: report and result of the journal, byte for byte.
  rm "$work"/d/*/report.html "$work"/d/*/exam.json "$work"/d/exams.sqlite
  check_exam 'an exam without files and log'
  cmp "$work/report" "$work"/d/*/report.html || complain 'the report is another one'
  cmp "$work/exam.json" "$work"/d/*/exam.json || complain 'the result is another one'
  echo "exam: $calls calls"
  over "$calls" 'kill torn full once' exam_at
}

writes() { # NAME OUTPUT COMMAND...
  local name=$1 output=$2 calls
  shift 2
  fresh
  faulty none -1 "$@"
  calls=$(calls_of)
  ((status == 0)) || complain "$name without faults"
  cp "$output" "$work/new"
  echo old >"$work/old"
  echo "$name: $calls calls"
  at_call() { command_at "$1" "$2" "$output" "${command[@]}"; }
  command=("$@")
  over "$calls" 'kill torn full once' at_call
}

case_generate() { writes generate "$work/d/leg" "$SONDE" generate --seed 3 -o "$work/d/leg"; }
case_cases() { writes cases "$work/d/case.yaml" "$SONDE" cases --generate 5 -o "$work/d/case.yaml"; }
case_fit() {
  writes fit "$work/d/fit" "$SONDE" fit "$DATA/indentation.csv" --surface "$DATA/skin.ply" \
    --sites "$DATA/sites.csv" --stages 1 -o "$work/d/fit"
}

# A learner's program dies at the same call again and again; the class starts it anew each time.
class_at() {
  fresh
  timeout -s INT 12 env LD_PRELOAD="$FAULTS" DISK_FAULTS_HOW="$1" DISK_FAULTS_AT="$2" \
    "$SONDE" class --learners 1 --port $((20000 + RANDOM % 20000)) --program "$work/learner" \
    >"$work/class" 2>"$work/err" </dev/null || true
  sleep 1 # the learners' programs are ending
  tried=$((tried + 1))
  cat "$work"/told.* >"$work/told" 2>/dev/null || true
  rm -f "$work"/told.*
  check_exam "class, $1 at $2"
}
case_class() {
  printf '#!/bin/sh\nexec %s run >%s/told.$$\n' "$EXAM_ONCE" "$work" >"$work/learner"
  chmod +x "$work/learner"
  fresh
  faulty none -1 "$EXAM_ONCE" run
  local calls
  calls=$(calls_of)
  echo "class: $calls calls of a learner"
  local saved=$mode
  mode=quick
  over "$calls" 'kill torn' class_at
  mode=$saved
}

for part in "${@:-exam}"; do "case_$part"; done
echo "operations tried: $tried, exams refused at the start: $refused, exams and outputs lost: $lost, wrong: $wrong"
((tried > 0 && lost == 0 && wrong == 0))
