# orthanc.py URL FILE...: every DICOM file is in the Orthanc at URL, and nothing else is: the same elements
# as in the file, and frame by frame the same pixels through its REST interface.
import json
import struct
import sys
import urllib.request

url, paths = sys.argv[1], sys.argv[2:]
LONG = {b"OB", b"OW", b"SQ", b"UN", b"UT", b"UC", b"UR", b"OF", b"OD"}
UNDEFINED = 0xFFFFFFFF


def get(path):
    with urllib.request.urlopen(url + path, timeout=300) as answer:
        return answer.read()


def elements(data, at, end, where=()):
    """Yields (path of tags, kind, value) of an explicit little endian data set; yields the place behind it last."""
    while at < end:
        group, element = struct.unpack_from("<HH", data, at)
        if group == 0xFFFE:  # the end of an item or a sequence
            return at + 8
        vr = data[at + 4 : at + 6]
        if vr in LONG:
            length, at = struct.unpack_from("<I", data, at + 8)[0], at + 12
        else:
            length, at = struct.unpack_from("<H", data, at + 6)[0], at + 8
        tag = where + (group << 16 | element,)
        if vr != b"SQ":
            assert length != UNDEFINED, tag
            yield tag, vr, data[at : at + length]
            at += length
            continue
        stop, number = end if length == UNDEFINED else at + length, 0
        while at < stop:
            mark, size = struct.unpack_from("<II", data, at)
            at += 8
            if mark == 0xE0DDFFFE:
                break
            assert mark == 0xE000FFFE, tag
            inner = end if size == UNDEFINED else at + size
            at = yield from elements(data, at, inner, tag + (number,))
            number += 1
    return at


def data_set(data):
    assert data[128:132] == b"DICM"
    length = struct.unpack_from("<I", data, 140)[0]  # of the meta information, which an archive writes anew
    return [(tag, vr, value.rstrip(b"\0 ") if vr not in (b"OB", b"OW") else value)
            for tag, vr, value in elements(data, 144 + length, len(data))]


def text(found, tag):
    return next(value.decode() for path, _, value in found if path == (tag,))


stored = {}
for instance in json.loads(get("/instances")):
    data = get(f"/instances/{instance}/file")
    stored[text(data_set(data), 0x00080018)] = instance, data
assert len(stored) == len(paths), (len(stored), paths)
kinds = set()
for path in paths:
    with open(path, "rb") as file:
        own = data_set(file.read())
    instance, data = stored[text(own, 0x00080018)]
    assert data_set(data) == own, f"{path}: Orthanc has another data set"
    kinds.add(text(own, 0x00080016))
    tags = json.loads(get(f"/instances/{instance}/simplified-tags"))
    assert tags["PatientName"] == "Simulated^Patient" and tags["PatientID"] == text(own, 0x00100020), tags
    if not any(tag == (0x7FE00010,) for tag, _, _ in own):
        continue
    pixels = next(value for tag, _, value in own if tag == (0x7FE00010,))
    size = int(tags["Rows"]) * int(tags["Columns"])
    frames = json.loads(get(f"/instances/{instance}/frames"))
    assert len(frames) == int(tags.get("NumberOfFrames", 1)) > 0
    for k in frames:
        assert get(f"/instances/{instance}/frames/{k}/raw") == pixels[k * size : (k + 1) * size], (path, k)
studies = {text(data_set(data), 0x0020000D) for _, data in stored.values()}
assert len(json.loads(get("/studies"))) == len(studies)
print(f"{len(stored)} instances of {len(kinds)} kinds in {len(studies)} studies")
