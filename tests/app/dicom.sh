#!/usr/bin/env bash
# A recording as DICOM ultrasound multi-frame: the pixels of the MetaImage, no error by dciodvfy, and sent by
# sonde send to dcmtk's storescp; a worksheet as structured report. What is not installed is said.
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/common.sh"
trap 'kill $(jobs -p) 2>/dev/null || true; rm -rf "$work"' EXIT

run run "$MODEL" --headless --lockstep --seconds 0.2 --record "$work/in.rec"
((status == 0)) || { cat "$err" >&2; exit 1; }
gives "tracked_frames>=10 tracked_frames<=10" replay "$work/in.rec" --model "$MODEL" --sequence a.dcm --json
gives "tracked_frames>=10" replay "$work/in.rec" --model "$MODEL" --sequence a.igs.mha --json
checks=$((checks + 1))
python3 - a.dcm a.igs.mha 2>"$err" <<'PY' || wrong "the DICOM file holds other pixels than the MetaImage"
import sys, zlib
dicom, meta = (open(name, "rb").read() for name in sys.argv[1:])
head, pixels = meta.split(b"ElementDataFile = LOCAL\n", 1)
pixels = zlib.decompress(pixels)
assert len(pixels) == 10 * 512 * 512 and dicom.endswith(pixels) and dicom[128:132] == b"DICM"
# The table of the frames holds what the MetaImage says of each.
table = dicom[dicom.index(b"ImageToProbeTransform,"):].split(b"\n")[:11]
names = table[0].split(b",")
for k, row in enumerate(table[1:]):
    row = dict(zip(names, row.split(b",")))
    for name in (b"ProbeToReferenceTransform", b"force_normal_n", b"Timestamp"):
        assert b"Seq_Frame%04d_%s = %s\n" % (k, name, row[name]) in head, (k, name)
PY
if command -v dciodvfy >/dev/null; then
  checks=$((checks + 1))
  dciodvfy a.dcm >"$out" 2>&1 || true
  { grep -q USMultiFrameImage "$out" && ! grep -q '^Error' "$out"; } || wrong "dciodvfy: $(<"$out")"
else
  wrong "dicom3tools is not there, which validates DICOM files"
fi
rm a.igs.mha

if command -v storescp >/dev/null && command -v storescu >/dev/null; then
  mkdir "$work/store"
  port=$(python3 -c 'import socket
s = socket.create_server(("127.0.0.1", 0)); print(s.getsockname()[1])')
  storescp --output-directory "$work/store" "$port" >"$work/storescp.txt" 2>&1 &
  for ((i = 0; i < 100; ++i)); do
    (: <>"/dev/tcp/127.0.0.1/$port") 2>/dev/null && break
    sleep 0.1
  done
  cp a.dcm b.dcm
  gives "files>=2 files<=2 sent>=2 sent<=2" send . --to "127.0.0.1:$port" --json
  rm b.dcm
  checks=$((checks + 1))
  # The archive writes its own head; the end of the file is the pixels.
  stored=$(find "$work/store" -type f)
  [[ $stored == *USm.2.25.* ]] && cmp -s <(tail -c 2621440 a.dcm) <(tail -c 2621440 "$stored") ||
    wrong "the archive has not what was sent: $stored"
  kill %1
  wait %1 2>/dev/null || true
  checks=$((checks + 1))
  run send a.dcm --to "127.0.0.1:$port"
  ((status == 1)) && grep -q "was not stored at 127.0.0.1:$port" "$err" || wrong "an archive that is gone"
else
  wrong "dcmtk is not there, an archive to send to"
fi
# A worksheet's report: no error by dciodvfy, and dsrdump finds what was written where it may stand.
mkdir exams protocols
printf '%s\n' 'sonde_protocol: 1' 'id: one' 'title: One' 'text: One.' 'places:' \
  '- {title: Groin, at: {station: common_femoral}}' '- {title: Knee, at: {station: popliteal}, position: prone_bent}' >protocols/one.yaml
checks=$((checks + 1))
status=0
EXAM_ONCE_DIR=$PWD/exams EXAM_ONCE_MODEL=$MODEL EXAM_ONCE_CASES=$LIBRARY/cases EXAM_ONCE_PROTOCOLS=$PWD/protocols \
  EXAM_ONCE_SECONDS=0.2 EXAM_ONCE_TICKS=200 EXAM_ONCE_ROOM_AFTER=60 EXAM_ONCE_SHEET=1 timeout 900 "$EXAM_ONCE" run >"$out" 2>"$err" || status=$?
((status == 0)) || wrong "the exam: exit $status: $(<"$out")"
report=$(echo exams/*/worksheet.dcm)
checks=$((checks + 1))
dciodvfy "$report" >"$out" 2>&1 || true
{ grep -q '^ComprehensiveSR' "$out" && ! grep -q '^Error' "$out"; } || wrong "dciodvfy on the report: $(<"$out")"
dsrdump +Pl +Pc "$report" >"$out" 2>"$err" || wrong "dsrdump: $(<"$err")"
! grep -v 'VR checker does not support this Specific Character Set' "$err" || wrong "dsrdump: $(<"$err")"
for item in '125100' 'has concept mod CODE:(363698007' 'contains CODE:(121071.*not_compressible' \
  'has properties CODE:(age.*acute' 'has properties NUM:(reflux_time.*0.8' 'Größe: 9 mm' \
  'contains IMAGE:(with' 'has acq context NUM:(force' 'contains CODE:(121077.*proximal'; do
  checks=$((checks + 1))
  grep -q -- "$item" "$out" || wrong "the report does not say '$item': $(<"$out")"
done
# Its pictures are the files beside it.
dcmdump +P 0008,1155 "$report" >named.txt 2>/dev/null
for picture in exams/*/worksheet-*.dcm; do
  checks=$((checks + 1))
  uid=$(dcmdump +P 0008,0018 "$picture" 2>/dev/null | grep -o '2\.25\.[0-9]*')
  grep -qF "[$uid]" named.txt || wrong "the report does not name $picture"
done
checks=$((checks + 1))
status=0
PATH=/nowhere "$SONDE" send a.dcm --to localhost:104 2>"$err" >"$out" || status=$?
((status == 1)) && grep -q "Debian package dcmtk" "$err" || wrong "without storescu: exit $status"
rejects "expects HOST:PORT" send a.dcm --to localhost
rejects "expects HOST:PORT" send a.dcm --to -x:104
rejects "1 to 16 characters" send a.dcm --to localhost:104 --called ABCDEFGHIJKLMNOPQ
rejects "found no DICM" send "$work/in.rec" --to localhost:104
rejects "No such file" send absent.dcm --to localhost:104
rejects "no file that ends in .dcm" send "$work" --to localhost:104
rejects "missing/a.dcm" replay "$work/in.rec" --model "$MODEL" --sequence missing/a.dcm
finish
