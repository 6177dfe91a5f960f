#!/usr/bin/env bash
# sonde run with devices: a simulated hand, a recording, and a fake Touch that is unplugged for a
# second and comes back. What it shows must not hang on the machine's pace.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

common="ticks>=1 force_scale:number force_max_n:number rendered_force_max_n:number faults:integer
  gel_ml:number"
gives "$common device=hand force_scale>=0.105 force_scale<=0.106 force_max_n>=1
  rendered_force_max_n<=1.5 gel_ml>=9.9 gel_ml<=10" run "$MODEL" --headless --lockstep --seconds 1.2 \
  --device hand --record hand.rec --json
gives "same=true" replay hand.rec --model "$MODEL" --json
gives "$common device=replay force_scale>=0.5 force_scale<=0.5" run "$MODEL" --headless --lockstep \
  --seconds 0.1 --device replay --from hand.rec --force-scale 0.5 --json
gives "ticks>=100 ticks<=100" run "$MODEL" --headless --lockstep --seconds 0.1 --no-gel \
  --circulation --posture standing --preset "$DATA/../presets/dry_skin.json" \
  --compare "$DATA/../presets/gel.json" --record presets.rec --json
gives "same=true" replay presets.rec --model "$MODEL" --json

# Lost and found: the program goes on, the fault was seen, and no force above 0.8 of a Touch's peak
# ever left.
export FAKE_TOUCH_LOG=$work/touch.log
gives "$common device=touch device_losses>=1 device_exchanges>=100 faults>=1" run "$MODEL" --headless \
  --seconds 11 --device touch --clutch 2 --device-library "$FAKE_TOUCH" --json
awk '{ if (NF != 2 || $1 > 2.64 || $2 > 2.64) exit 1 }' "$work/touch.log" ||
  wrong "forces of the fake Touch: $(cat "$work/touch.log")"

run run "$MODEL" --headless --device touch --device-library none.so
((status == 1)) || wrong "without the maker's library: exit $status, expected 1"
grep -q "library not found: none.so" "$err" || wrong "stderr does not say what is missing"
rejects "unknown device 'pen'" run "$MODEL" --device pen
rejects "real time" run "$MODEL" --headless --lockstep --device touch
rejects "belong together" run "$MODEL" --headless --device replay
rejects "not --headless" run "$MODEL" --headless --device page
rejects "no known limits" run "$MODEL" --limits nothing
rejects "neither a site nor a landmark" run "$MODEL" --headless --lockstep --device-at nowhere
rejects "posture expects supine, sitting or standing" run "$MODEL" --posture hanging
rejects "needs a --preset" run "$MODEL" --compare x.json
finish
