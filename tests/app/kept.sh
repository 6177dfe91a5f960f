#!/usr/bin/env bash
# An exam of a case with a leg of its own, by a device that only one session can hold, the patient turned
# once: the log has it as scored, and sonde replay makes both parts again from the recording alone, to the
# same states and pixels.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
mkdir -p exams protocols cases
cp "$LIBRARY/cases/acute-common-femoral.yaml" cases
cat >protocols/two.yaml <<'END'
sonde_protocol: 1
id: two
title: Two
text: Two.
places:
- {title: Groin, at: {station: common_femoral}}
- {title: Knee, at: {station: popliteal}, position: prone_bent}
END
status=0
EXAM_ONCE_DIR=$PWD/exams EXAM_ONCE_MODEL=$MODEL EXAM_ONCE_CASES=$PWD/cases EXAM_ONCE_PROTOCOLS=$PWD/protocols \
  EXAM_ONCE_SECONDS=0.4 EXAM_ONCE_TICKS=200 EXAM_ONCE_ROOM_AFTER=60 timeout 900 "$EXAM_ONCE" run >"$out" 2>"$err" || status=$?
((status == 0)) || wrong "exit $status, expected 0"
checks=$((checks + 1))
[[ $(tail -1 "$out") == scored ]] || wrong "the log does not have the exam as scored: $(<"$out")"
# The leg comes from the recording: neither the library of cases nor the bundled thigh is asked.
for part in exams/*/exam.rec exams/*/exam-2.rec; do
  gives "same=true ended=true images>=1 same_images=true" replay "$part" --images --cases /nowhere --json
done
rejects "recorded on the model Leg of a case" replay exams/*/exam.rec --model "$MODEL"
finish
