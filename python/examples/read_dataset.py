"""Reads a data set of `sonde dataset` with the standard library and NumPy alone, and measures it: how dark the
veins are in the picture, how their drawn areas agree with their closure, how the strain keeps the volume."""
import glob
import io
import json
import os
import struct
import sys
import tarfile
import zlib

import numpy as np


def grey_png(data):
    """An 8-bit grey PNG as an array (ISO 15948): chunks, inflated rows, the filter of each row undone."""
    at, packed = 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + length]
        if kind == b"IHDR":
            width, height, bits, colour = struct.unpack(">IIBB", body[:10])
            assert (bits, colour) == (8, 0), "expected 8-bit grey"
        if kind == b"IDAT":
            packed += body
        at += 12 + length
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, width + 1)
    out = np.zeros((height, width), np.uint8)
    above = np.zeros(width, int)
    for y, row in enumerate(rows):
        how, now = row[0], row[1:].astype(int)
        if how == 1:
            now = np.cumsum(now) % 256
        elif how == 2:
            now = (now + above) % 256
        elif how in (3, 4):
            left = corner = 0
            for x in range(width):
                up = above[x]
                if how == 3:
                    guess = (left + up) // 2
                else:
                    p = left + up - corner
                    guess = min((abs(p - left), 0, left), (abs(p - up), 1, up), (abs(p - corner), 2, corner))[2]
                left, corner = (now[x] + guess) % 256, up
                now[x] = left
        out[y], above = now, now
    return out


def decode(name, data):
    if name.endswith(".png"):
        return grey_png(data)
    if name.endswith(".npy"):
        return np.load(io.BytesIO(data), allow_pickle=False)
    return json.loads(data)


def frames(directory):
    """Every frame as a dictionary of its arrays and its `json`, from tar files or folders, in order."""
    for path in sorted(glob.glob(os.path.join(directory, "leg-*"))):
        frame, key = {}, None
        if os.path.isdir(path):
            members = ((n, open(os.path.join(path, n), "rb").read()) for n in sorted(os.listdir(path)))
        else:
            tar = tarfile.open(path)
            members = ((m.name, tar.extractfile(m).read()) for m in tar)
        for name, data in members:
            this, field = name.split(".", 1)
            if this != key and frame:
                yield frame
                frame = {}
            key = this
            frame["key"] = key
            frame[field.split(".")[0]] = decode(name, data)
        if frame:
            yield frame


def measure(frame):
    """Of one frame: for each vessel its area by the state and by the labels, mm2, where the section lies whole in the
    picture; mean grey value of open lumina and of the tissue within 2 mm; median of |volume ratio - 1|."""
    info, tissue = frame["json"], frame["tissue"]
    pairs = []
    for vessel in info["vessels"]:
        mask = frame["vessel"] == vessel["number"]
        inside = mask & np.isin(tissue, (6, 7, 9))
        edge = np.ones_like(mask)
        edge[1:-1, 1:-1] = False
        if vessel["tilt_deg"] < 45 and inside.any() and not (mask & edge).any() and not (mask & (tissue == 0)).any():
            area = vessel["area_mm2"] / np.cos(np.radians(vessel["tilt_deg"]))
            pairs.append((vessel["name"], area, vessel["drawn_mm2"], vessel["area_ratio"]))
    lumen = np.isin(tissue, (6, 9))
    reach = int(2 / info["pixel_mm"])
    near = np.zeros_like(lumen)
    for y, x in zip(*np.nonzero(lumen)):
        near[max(0, y - reach):y + reach + 1, max(0, x - reach):x + reach + 1] = True
    beside = near & np.isin(tissue, (2, 3))
    grey = [float(frame["image"][m].mean()) if m.any() else float("nan") for m in (lumen, beside)]
    e = frame["strain"][tissue == 3]
    e = e[np.isfinite(e).all(axis=1)].astype(float)
    c = 2 * e[:, [0, 3, 4, 3, 1, 5, 4, 5, 2]].reshape(-1, 3, 3) + np.eye(3)
    volume = np.sqrt(np.maximum(np.linalg.det(c), 0))
    return pairs, grey, float(np.median(np.abs(volume - 1))) if len(volume) else float("nan")


def main(directory):
    rows = []
    for frame in frames(directory):
        pairs, (lumen, beside), volume = measure(frame)
        print(f"{frame['key']}  {frame['json']['force_n']:6.2f} N  lumen {lumen:5.1f}  beside {beside:5.1f}  "
              f"volume {100 * volume:4.1f} %", end="")
        for name, area, drawn, ratio in pairs:
            print(f"  {name} {area:.1f}/{drawn:.1f} mm2 ({ratio:.2f})", end="")
        print()
        rows.append((pairs, lumen, beside, volume))
    return rows


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: read_dataset.py DIR")
    main(sys.argv[1])
