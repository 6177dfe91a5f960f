#!/usr/bin/env bash
# The demonstration of a lesson on the bundled thigh: it waits to be begun, the expert goes from place
# to place with words for each step, what a press shows is said as the truth is, and it ends with what
# the case teaches; then the lesson is practised with the guidance of its repetition.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
mkdir -p course/cases exams
cat >course/cases/a.yaml <<'E'
sonde_case: 3
id: lesson-a
title: A
level: first
history: A history.
note: The note of the case.
thigh: bundled
vein: {stage: acute_occlusive, from: 0, to: 60}
truth:
  thrombosis: true
  diagnosis: Clot
  segments: {common_femoral: clot, femoral_proximal: clot, femoral_mid: compressible, femoral_distal: compressible, popliteal: compressible}
E
cat >course/01-a.yaml <<'E'
sonde_lesson: 1
id: a
title: A lesson
goal: A goal.
film: What is said first.
case: cases/a.yaml
places:
- {title: Upper place, text: Above., at: 30}
- {title: Lower place, text: Below., at: 130}
practice: [full, hints, exam]
E
status=0
EXAM_ONCE_DIR=$PWD/exams EXAM_ONCE_MODEL=$MODEL EXAM_ONCE_COURSE=$PWD/course EXAM_ONCE_CASES=$LIBRARY/cases \
  EXAM_ONCE_PROTOCOLS=$LIBRARY/protocols timeout 600 "$EXAM_ONCE" run >"$out" 2>"$err" || status=$?
((status == 0)) || wrong "exit $status, expected 0"
last=0
said() { # WORDS: stands in the output, behind what was found before
  checks=$((checks + 1))
  local at
  at=$(grep -nE -- "$1" "$out" | cut -d: -f1 | awk -v from="$last" '$1 > from { print; exit }')
  [[ -n $at ]] && last=$at || wrong "the film does not say '$1' after line $last: $(cat "$out")"
}
said 'waits: yes'
said 'words: Upper place\. Above\.'
said 'words: Straight down and slowly.*closes here at about [0-9]+ N'
said 'words: [0-9]+ N would have closed a healthy vein.*a clot fills it'
said 'words: Lower place\. Below\.'
said 'words: The walls touch at [0-9]+ N: there is no clot'
said 'words: Let go'
said 'words: That was all\. The note of the case\.'
said 'practises: lesson-a, repetition 3, exam, film is over'
said 'stores a picture: yes'
# It is there for an archive too: secondary capture of 1/2 of the session's 128 x 128 pixels.
checks=$((checks + 1))
picture=$(echo exams/*/worksheet-1.dcm)
[[ -e $picture && $(tail -c 4096 "$picture" | wc -c) == 4096 ]] || wrong "no DICOM file of the picture"
grep -aq '1\.2\.840\.10008\.5\.1\.4\.1\.1\.7' "$picture" || wrong "$picture is no secondary capture"
dciodvfy "$picture" >"$out" 2>&1 || true
{ grep -q '^SCImage' "$out" && ! grep -q '^Error' "$out"; } || wrong "dciodvfy: $(<"$out")"
finish
