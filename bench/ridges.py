#!/usr/bin/env python3
"""ridges.py MM_PER_PIXEL X,Y,WIDTH,HEIGHT PICTURE...: statistics of the bright lines in a region of echographic pictures.

Prints per picture, and their median: lines per mm of depth, the length that a line's point lies on (length-weighted, mm),
the deviation of the lines' tilt (degrees), their grey level over that beside them, and the 5, 50 and 95 % grey levels.
A line is a ridge of the picture smoothed over 0.15 mm: where the second difference along the depth is least and more
than half a deviation below nought, and the grey level falls to either side. Needs Debian's python3-numpy and python3-pil.
"""
import sys

import numpy as np
from PIL import Image


def smooth(a, sigma):
    reach = int(3 * sigma + 1)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    for axis in (0, 1):
        wide = np.pad(a, [(reach, reach) if k == axis else (0, 0) for k in (0, 1)], mode="reflect")
        a = sum(w * np.take(wide, range(i, i + a.shape[axis]), axis=axis) for i, w in enumerate(kernel))
    return a


def lines_of(region, mm):
    """Ridge points as lists of (row, column), followed from column to column."""
    soft = smooth(region, 0.15 / mm)
    step = max(1, round(0.3 / mm))
    bend = np.zeros_like(soft)
    bend[step:-step] = soft[2 * step:] - 2 * soft[step:-step] + soft[: -2 * step]
    limit = -0.5 * bend.std()
    open_lines, done = [], []
    for x in range(soft.shape[1]):
        column, b = soft[:, x], bend[:, x]
        peaks = [y for y in range(step, len(column) - step)
                 if b[y] < limit and column[y] >= column[y - 1] and column[y] > column[y + 1]]
        still = []
        for line in open_lines:
            near = [y for y in peaks if abs(y - line[-1][0]) <= 1]
            if near:
                y = min(near, key=lambda v: abs(v - line[-1][0]))
                peaks.remove(y)
                line.append((y, x))
                still.append(line)
            else:
                done.append(line)
        open_lines = still + [[(y, x)] for y in peaks]
    return soft, [line for line in done + open_lines if len(line) * mm >= 0.8]


def measure(path, box, mm):
    x, y, width, height = box
    region = np.asarray(Image.open(path).convert("L"), float)[y:y + height, x:x + width]
    soft, lines = lines_of(region, mm)
    lengths = np.array([len(line) * mm for line in lines])
    points = sum(len(line) for line in lines)
    tilts = [np.degrees(np.arctan(np.polyfit([p[1] for p in line], [p[0] for p in line], 1)[0])) for line in lines]
    beside = smooth(region, 1.0 / mm)
    on = np.mean([soft[p] / max(beside[p], 1) for line in lines for p in line])
    return [points / (region.shape[1] * region.shape[0] * mm), (lengths ** 2).sum() / lengths.sum(),
            np.sqrt(np.average((tilts - np.average(tilts, weights=lengths)) ** 2, weights=lengths)), on,
            *np.percentile(region, [5, 50, 95])]


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    mm, box = float(sys.argv[1]), [int(v) for v in sys.argv[2].split(",")]
    rows = [measure(path, box, mm) for path in sys.argv[3:]]
    print("%-28s %9s %9s %8s %9s   %s" % ("picture", "lines/mm", "length mm", "tilt deg", "contrast", "grey 5 50 95 %"))
    for path, row in [*zip(sys.argv[3:], rows), ("median", np.median(rows, axis=0))]:
        print("%-28s %9.2f %9.1f %8.1f %9.2f   %3.0f %3.0f %3.0f" % (path.split("/")[-1], *row))


if __name__ == "__main__":
    main()
