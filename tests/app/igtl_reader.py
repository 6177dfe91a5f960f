"""igtl_reader.py PORT [ACTION...]: a reader of OpenIGTLink with the standard library alone.

Reads messages until the server closes and prints one JSON object: messages of each type, those with a
wrong CRC, frame numbers. Actions: "v2" sends a header of version 2 first, "ask" asks for status and
capabilities, "stuck" never reads and waits for the end of standard input, "rubbish" sends what is no
message, "listen" listens on PORT (0: any, printed first) instead of connecting, "most=N" ends after N frames.
"""
import json
import socket
import struct
import sys

POLYNOMIAL = 0x42F0E1EBA9EA3693
TABLE = []
for byte in range(256):
    rest = byte << 56
    for _ in range(8):
        rest = (rest << 1 ^ (POLYNOMIAL if rest >> 63 else 0)) & (1 << 64) - 1
    TABLE.append(rest)


def crc64(data):
    rest = 0
    for byte in data:
        rest = (rest << 8 & (1 << 64) - 1) ^ TABLE[rest >> 56 ^ byte]
    return rest


def header(version, kind, body=b""):
    return struct.pack(">H12s20sIIQQ", version, kind, b"reader", 0, 0, len(body), crc64(body)) + body


def whole(stream, count):
    data = bytearray()
    while len(data) < count:
        part = stream.recv(count - len(data))
        if not part:
            return None
        data += part
    return bytes(data)


def main():
    port, actions = int(sys.argv[1]), sys.argv[2:]
    most = min([int(a[5:]) for a in actions if a.startswith("most=")] + [1 << 30])
    if "listen" in actions:
        waiting = socket.create_server(("127.0.0.1", port))
        print(waiting.getsockname()[1], flush=True)
        waiting.settimeout(60)
        stream = waiting.accept()[0]
    else:
        stream = socket.create_connection(("127.0.0.1", port), timeout=60)
    if "stuck" in actions:
        sys.stdin.read()
        return
    if "rubbish" in actions:
        stream.sendall(b"GET / HTTP/1.1\r\nHost: sonde\r\n" + b"\r\n" * 40)
    if "v2" in actions:
        stream.sendall(header(2, b"STATUS", struct.pack(">HHII", 12, 2, 0, 1) + struct.pack(">HQ21s", 1, 0, b"") + b"\0\0"))
    if "ask" in actions:
        stream.sendall(header(1, b"GET_CAPABIL") + header(1, b"GET_STATUS", b"unread"))
    kinds, wrong, versions, frames, stamps, last, meta = {}, 0, set(), [], [], {}, {}
    while kinds.get("STRING", 0) < most:
        try:
            head = whole(stream, 58)
        except ConnectionResetError:
            head = None
        if head is None:
            break
        version, kind, name, seconds, fraction, size, crc = struct.unpack(">H12s20sIIQQ", head)
        body = whole(stream, size)
        if body is None:
            break
        kind, name = (text.rstrip(b"\0").decode() for text in (kind, name))
        # An image's CRC takes Python 50 ms: the first ones are checked.
        if kinds.get(kind, 0) < 2:
            wrong += crc64(body) != crc
        kinds[kind] = kinds.get(kind, 0) + 1
        versions.add(version)
        if version > 1:
            extended, heads, texts, _ = struct.unpack(">HHII", body[:12])
            end = len(body) - heads - texts
            listed, at = [], end + 2
            for _ in range(struct.unpack(">H", body[end : end + 2])[0]):
                listed.append(struct.unpack(">HHI", body[at : at + 8]))
                at += 8
            for key, _, value in listed:
                meta[body[at : at + key].decode()] = body[at + key : at + key + value].decode()
                at += key + value
            body = body[extended:end]
        last[name] = body
        if name == "Metrics":
            frames.append(json.loads(body[4:])["frame"])
            stamps.append(seconds + fraction / 2**32)
    out = {"kinds": kinds, "wrong": wrong, "versions": sorted(versions), "frames": len(frames), "metadata": meta}
    if frames:
        out["missed"] = frames[-1] - frames[0] + 1 - len(frames)
        out["in_order"] = frames == sorted(set(frames)) and stamps == sorted(stamps)
        image, force = last["Image_Reference"], last["ProbeForce"]
        out["image"] = struct.unpack(">HBBBBHHH12f6H", image[:72])
        out["pixels"] = len(image) - 72
        out["bright"] = max(image[72:])
        out["probe"] = struct.unpack(">12f", last["ProbeToReference"])
        out["to_probe"] = struct.unpack(">12f", last["ImageToProbe"])
        out["force"] = struct.unpack(">BBQ3d", force)
        out["metrics"] = json.loads(last["Metrics"][4:])
    print(json.dumps(out))


main()
