#!/usr/bin/env bash
# sonde send to Orthanc, an archive that hospitals run: what an exam leaves for an archive, and a sequence, come
# back through its REST interface with the same data sets and pixels. Orthanc runs with a configuration of its
# own, on loopback ports that are free. Exit code 77 and the reason where it cannot start.
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/common.sh"
peer=
trap '[[ -z $peer ]] || kill -9 "$peer" 2>/dev/null || true; rm -rf "$work"' EXIT
orthanc=$(PATH=$PATH:/usr/sbin command -v Orthanc) || {
  echo "skipped: no Orthanc (Debian package orthanc)"
  exit 77
}
command -v storescu >/dev/null || { echo "skipped: no storescu (Debian package dcmtk)"; exit 77; }

start_orthanc() { # starts it on ports that nobody holds; false when it ends instead of answering
  local ports
  read -r -a ports < <(python3 -c 'import socket
s = [socket.create_server(("127.0.0.1", 0)) for _ in range(2)]
print(*[one.getsockname()[1] for one in s])')
  http=${ports[0]} dicom=${ports[1]}
  rm -rf "$work/archive"
  mkdir "$work/archive"
  cat >"$work/orthanc.json" <<END
{"Name": "sonde", "StorageDirectory": "$work/archive", "IndexDirectory": "$work/archive", "Plugins": [],
 "HttpPort": $http, "DicomPort": $dicom, "RemoteAccessAllowed": false, "AuthenticationEnabled": false,
 "DicomAet": "ARCHIVE", "DicomCheckCalledAet": true, "StorageCompression": false, "LimitFindResults": 0}
END
  "$orthanc" "$work/orthanc.json" >"$work/orthanc.txt" 2>&1 &
  peer=$!
  for ((i = 0; i < 3000; ++i)); do # it answers, or it has ended
    kill -0 "$peer" 2>/dev/null || { peer=; return 1; }
    { : <>"/dev/tcp/127.0.0.1/$http" && : <>"/dev/tcp/127.0.0.1/$dicom"; } 2>/dev/null && return 0
    sleep 0.1
  done
  return 1
}
for try in 1 2 3 4 5; do # another program may take a port between the look and the start
  start_orthanc && break
  ((try < 5)) && continue
  echo "skipped: Orthanc does not start: $(tail -5 "$work/orthanc.txt" 2>/dev/null)"
  exit 77
done

# An exam with a worksheet, and a part of its recording as a sequence.
mkdir exams protocols files
printf '%s\n' 'sonde_protocol: 1' 'id: one' 'title: One' 'text: One.' 'places:' \
  '- {title: Groin, at: {station: common_femoral}}' '- {title: Knee, at: {station: popliteal}, position: prone_bent}' >protocols/one.yaml
status=0
EXAM_ONCE_DIR=$PWD/exams EXAM_ONCE_MODEL=$MODEL EXAM_ONCE_CASES=$LIBRARY/cases EXAM_ONCE_PROTOCOLS=$PWD/protocols \
  EXAM_ONCE_SECONDS=0.2 EXAM_ONCE_TICKS=200 EXAM_ONCE_ROOM_AFTER=60 EXAM_ONCE_SHEET=1 timeout 900 "$EXAM_ONCE" run >"$out" 2>"$err" || status=$?
((status == 0)) || wrong "the exam: exit $status: $(<"$out")"
gives "tracked_frames>=2" replay exams/*/exam.rec --sequence exam.dcm --json
cp exams/*/*.dcm exam.dcm files
files=(files/*.dcm)
checks=$((checks + 1))
((${#files[@]} >= 3)) || wrong "the exam left ${files[*]} only"
gives "files>=${#files[@]} sent>=${#files[@]} sent<=${#files[@]}" send files --to "127.0.0.1:$dicom" --called ARCHIVE --json
# The same again is the same instance.
gives "sent>=1" send files/exam.dcm --to "127.0.0.1:$dicom" --called ARCHIVE --json
checks=$((checks + 1))
python3 "$here/orthanc.py" "http://127.0.0.1:$http" "${files[@]}" >"$out" 2>"$err" || wrong "Orthanc has something else: $(tail -3 "$err")"
cat "$out"
checks=$((checks + 1))
run send files/exam.dcm --to "127.0.0.1:$dicom" --called SOMEBODY
((status == 1)) && grep -q "was not stored" "$err" || wrong "an archive of another name: exit $status"
kill "$peer"
wait "$peer" || wrong "Orthanc ended with $?"
peer=
finish
