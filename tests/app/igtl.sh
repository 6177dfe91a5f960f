#!/usr/bin/env bash
# sonde run --igtl and --push: readers of this repository, the receiver of Debian's library and pyigtl where
# they are there, and a client that never reads. How many frames a second come is the machine's matter.
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/common.sh"
trap 'kill $(jobs -p) 2>/dev/null || true; rm -rf "$work"' EXIT
read_with() { timeout 100 python3 "$here/igtl_reader.py" "$@"; }

# keeps FILE EXPRESSION: the JSON object `o` of a reader keeps it.
keeps() {
  checks=$((checks + 1))
  python3 -c 'import json, sys
o = json.load(open(sys.argv[1]))
sys.exit(not eval(sys.argv[2]))' "$1" "$2" 2>"$err" || wrong "$2 does not hold for $(cut -c1-600 "$1")"
}

# The receiver that Debian ships as source text checks the CRC and says what it receives.
examples=/usr/share/doc/openigtlink-examples/examples/Receiver/ReceiveClient.cxx
receiver=
if [[ -e $examples && -e /usr/include/openigtlink/igtlImageMessage.h ]] && command -v g++ >/dev/null; then
  receiver=$CACHE/igtl_receive_client
  [[ -x $receiver ]] ||
    g++ -O0 -w -I/usr/include/openigtlink "$examples" -o "$receiver" -lOpenIGTLink -lpthread
fi

status=0
"$SONDE" run "$MODEL" --headless --seconds 3 --igtl 0 --json >"$work/run.json" 2>"$work/run.err" &
program=$!
for ((i = 0; i < 600; ++i)); do
  port=$(sed -n 's/^OpenIGTLink on 127.0.0.1 port \([0-9]*\)$/\1/p' "$work/run.err" 2>/dev/null || true)
  [[ -n $port ]] && break
  sleep 0.1
done
[[ -n $port ]] || { cat "$work/run.err" >&2; exit 1; }
mkfifo "$work/never"
read_with "$port" stuck <"$work/never" & # ends when the descriptor below is closed
exec 9>"$work/never"
read_with "$port" >"$work/one.json" & readers=$!
read_with "$port" v2 ask >"$work/two.json" & readers+=" $!"
read_with "$port" rubbish >"$work/rubbish.json" & readers+=" $!"
[[ -z $receiver ]] || { timeout 100 "$receiver" 127.0.0.1 "$port" >"$work/receiver.txt" 2>&1 & readers+=" $!"; }
wait "$program" || wrong "sonde run ended with $?"
# shellcheck disable=SC2086 # numbers of processes
wait $readers || wrong "a reader ended with $?"
exec 9>&-

"$CHECK_JSON" "igtl:object" <"$work/run.json" || wrong "the object of sonde run"
keeps "$work/run.json" 'o["igtl"]["frames"] == o["images"] and o["igtl"]["clients"] >= 4'
for reader in one two; do
  keeps "$work/$reader.json" 'o["wrong"] == 0 and o["frames"] >= 2 and o["missed"] == 0 and o["in_order"]'
  keeps "$work/$reader.json" 'o["kinds"]["IMAGE"] == o["frames"] and o["kinds"]["TRANSFORM"] == 2 * o["frames"]'
  keeps "$work/$reader.json" 'o["image"][5:8] == [512, 512, 1] and o["pixels"] == 512 * 512 and o["bright"] > 100'
  # The middle of the picture lies half its depth below the face, along z of the probe.
  keeps "$work/$reader.json" 'all(abs(o["image"][17 + k] - o["probe"][9 + k] - 25 * o["probe"][6 + k]) < 1e-3 for k in range(3))'
  # The force along the beam is that of the metrics.
  keeps "$work/$reader.json" 'abs(sum(-f * z for f, z in zip(o["force"][3:], o["probe"][6:9])) - o["metrics"]["force_normal_n"]) < 1e-4'
done
keeps "$work/one.json" 'o["versions"] == [1] and not o["metadata"]'
keeps "$work/two.json" 'o["versions"][-1] == 2 and o["metadata"]["DepthMm"] == "50"'
keeps "$work/two.json" 'float(o["metadata"]["ContactForceN"]) == o["metrics"]["force_normal_n"]'
keeps "$work/two.json" 'o["kinds"]["STATUS"] == 1 and o["kinds"]["CAPABILITY"] == 1'
keeps "$work/rubbish.json" 'o["frames"] <= 2'
if [[ -n $receiver ]]; then # it prints what it unpacked, which a wrong CRC prevents
  images=$(grep -c "Image_Reference" "$work/receiver.txt" || true)
  ((images >= 2)) || wrong "Debian's receiver got $images pictures"
else
  echo "not compared with Debian's receiver: openigtlink-examples and libopenigtlink-dev are not there"
fi

# A reader that listens itself.
read_with 0 listen most=2 >"$work/pushed.txt" &
reader=$!
for ((i = 0; i < 100; ++i)); do
  port=$(head -1 "$work/pushed.txt")
  [[ -n $port ]] && break
  sleep 0.1
done
gives "igtl:object" run "$MODEL" --headless --lockstep --seconds 0.1 --push "localhost:$port" --json
wait "$reader" || wrong "the reader that listens ended with $?"

rejects "expects a port from 0 to 65535" run "$MODEL" --headless --igtl 65536
rejects "expects a port from 0 to 65535" run "$MODEL" --headless --igtl nowhere:
rejects "no address of this computer" run "$MODEL" --headless --igtl nowhere:1
rejects "HOST:PORT" run "$MODEL" --headless --push localhost
for file in sonde_plus.xml sonde_slicer.mrml; do
  checks=$((checks + 1))
  python3 -c 'import sys, xml.etree.ElementTree as tree; tree.parse(sys.argv[1])' \
    "$DATA/../openigtlink/$file" 2>"$err" || wrong "$file is no XML"
done
finish
