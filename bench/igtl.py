"""igtl.py BIN [FRAMES [HZ]]: frames that readers of OpenIGTLink get beside a client that never reads.

Readers: two of the receiver that Debian's openigtlink-examples has as source text (built here with g++ and
libopenigtlink-dev; it prints a picture only after its CRC is right), pyigtl where PYTHONPATH has it. Prints
one JSON object.
"""
import json
import os
import socket
import subprocess
import sys
import tempfile
import time

# pyigtl keeps the newest message of a device only and compares no CRC: what it unpacks is counted here.
PYIGTL = """
import os, sys, time
import pyigtl
from pyigtl import messages
told, counted = [0], {True: 0, False: 0}
parse, unpack = messages.MessageBase.parse_header, messages.ImageMessage.unpack
def parse_header(header):
    told[0] = int.from_bytes(header[50:58], "big")
    return parse(header)
def count(message, fields, body):
    unpack(message, fields, body)
    counted[messages.CRC64(body) == told[0]] += 1
messages.MessageBase.parse_header = staticmethod(parse_header)
messages.ImageMessage.unpack = count
client = pyigtl.OpenIGTLinkClient(host="127.0.0.1", port=int(sys.argv[1]))
before, still = 0, 0
while still < 8:
    time.sleep(0.5)
    still = still + 1 if counted[True] == before and before else 0
    before = counted[True]
print(counted[True] if not counted[False] else -counted[False])
sys.stdout.flush()
os._exit(0)
"""


def main():
    folder, frames = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 3600
    hz = sys.argv[3] if len(sys.argv) > 3 else "60"
    with tempfile.TemporaryDirectory() as work:
        receiver = os.path.join(work, "receive")
        subprocess.run(["g++", "-w", "-O1", "-I/usr/include/openigtlink",
                        "/usr/share/doc/openigtlink-examples/examples/Receiver/ReceiveClient.cxx",
                        "-o", receiver, "-lOpenIGTLink", "-lpthread"], check=True)
        peers = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "shared", "peers", "python")
        paths = os.pathsep.join(filter(None, [os.environ.get("PYTHONPATH"), peers]))
        environment = {**os.environ, "PYTHONPATH": paths}
        has_pyigtl = subprocess.run(["/usr/bin/python3", "-c", "import pyigtl"], env=environment,
                                    capture_output=True).returncode == 0
        clients = 3 + has_pyigtl
        server = subprocess.Popen([os.path.join(folder, "bench_igtl"), str(frames), hz, str(clients)],
                                  stdout=subprocess.PIPE, text=True)
        port = server.stdout.readline().strip()
        stuck = socket.create_connection(("127.0.0.1", int(port)))
        outputs = [open(os.path.join(work, f"{k}.txt"), "w+") for k in range(2)]
        readers = [subprocess.Popen([receiver, "127.0.0.1", port], stdout=out, stderr=subprocess.STDOUT)
                   for out in outputs]
        other = has_pyigtl and subprocess.Popen(["/usr/bin/python3", "-c", PYIGTL, port], env=environment,
                                                stdout=subprocess.PIPE, text=True)
        result = json.loads(server.communicate()[0].strip().splitlines()[-1])
        stuck.close()
        for k, (reader, out) in enumerate(zip(readers, outputs)):
            reader.wait(timeout=20)
            out.seek(0)
            result[f"receiver_{k + 1}"] = out.read().count("Image_Reference")
        if other:
            result["pyigtl"] = int(other.communicate(timeout=30)[0])
        print(json.dumps(result))


main()
