#!/usr/bin/env bash
# A sweep as the TUS-REC data sets hold it, HDF5 and a table of two matrices, gives the pictures and
# volumes of the same sweep as a MetaImage; what such files may have wrong is named.
set -euo pipefail
source "$(dirname "$0")/common.sh"

fail() { echo "WRONG: $1"; exit 1; }
python=python3
[[ -x /usr/bin/python3 ]] && python=/usr/bin/python3
cd "$work"
"$python" - <<'PY'
import math
import h5py
import numpy as np

count, rows, columns = 8, 30, 40
k, v, u = np.indices((count, rows, columns))
frames = ((3 * u + 5 * v + 7 * k) % 256).astype(np.uint8)
poses = np.tile(np.eye(4), (count, 1, 1))
for i in range(count):
    c, s = math.cos(0.01 * i), math.sin(0.01 * i)
    poses[i, :3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    poses[i, :3, 3] = [0.1 * i, 5, i]
scale = np.diag([0.2, 0.25, 1, 1])
tool = np.array([[0, -1, 0, 3], [1, 0, 0, -4], [0, 0, 1, 117], [0, 0, 0, 1.0]])
one = np.eye(4)
one[:2, 3] = 1  # their pixels count from 1

def write(name, frames, poses):
    with h5py.File(name, "w") as file:
        file["frames"], file["tforms"] = frames, poses

write("sweep.h5", frames, poses)
with open("calib_matrix.csv", "w") as table:
    for name, m in (("scaling_from_pixel_to_mm", scale),
                    ("spatial_calibration_from_image_coordinate_system_to_tracking_tool_coordinate_system", tool)):
        table.write(name + "\n" + "".join(",".join(repr(float(x)) for x in row) + "\n" for row in m))
with open("sweep.igs.mha", "wb") as file:
    head = f"ObjectType = Image\nNDims = 3\nDimSize = {columns} {rows} {count}\nElementType = MET_UCHAR\n"
    head += "UltrasoundImageOrientation = MFA\n"
    for i in range(count):
        numbers = " ".join(repr(float(x)) for x in (poses[i] @ tool @ scale @ one).ravel())
        head += f"Seq_Frame{i:04d}_ImageToTrackerTransform = {numbers}\n"
        head += f"Seq_Frame{i:04d}_ImageToTrackerTransformStatus = OK\n"
    file.write((head + "ElementDataFile = LOCAL\n").encode() + frames.tobytes())

lost = poses.copy()
lost[3] = np.nan
write("lost.h5", frames, lost)
write("colour.h5", np.stack([frames] * 3, -1), poses)
write("deep.h5", frames.astype(np.uint16), poses)
write("fewer.h5", frames, poses[:-1])
slanted = poses.copy()
slanted[2, 3] = [0, 0, 0, 2]
write("slanted.h5", frames, slanted)
with h5py.File("huge.h5", "w") as file:
    file.create_dataset("frames", (60000, 60000, 60000), "u1", chunks=(1, 1000, 1000))
    file["tforms"] = poses
with h5py.File("poses.h5", "w") as file:
    file["tforms"] = poses
PY
head -c 2000 sweep.h5 >cut.h5

for frame in 2 3.5; do
  "$SONDE" slice sweep.h5 --config calib_matrix.csv --frame "$frame" -o h5.png --json >h5.json
  "$SONDE" slice sweep.igs.mha --frame "$frame" -o mha.png --json >mha.json
  cmp h5.png mha.png || fail "another picture at frame $frame"
done
"$SONDE" reconstruct sweep.h5 --config calib_matrix.csv -o h5.mha --raw --spacing-mm 0.5 >h5.txt
"$SONDE" reconstruct sweep.igs.mha -o mha.mha --raw --spacing-mm 0.5 >mha.txt
voxels() { tail -c "$(sed -n 's/^DimSize = //p;/^ElementDataFile/q' "$1" | awk '{print $1 * $2 * $3}')" "$1"; }
cmp <(voxels h5.mha) <(voxels mha.mha) || fail "another volume"
[[ $(voxels h5.mha | tr -d '\0' | wc -c) -gt 1000 ]] || fail "an empty volume"
"$SONDE" reconstruct sweep.h5 --copy copy.igs.mha >/dev/null
tail -c 9600 sweep.igs.mha | cmp - <("$SONDE" reconstruct sweep.h5 --copy raw.igs.mha --raw >/dev/null && tail -c 9600 raw.igs.mha) ||
  fail "other pixels in a copy"
"$SONDE" reconstruct lost.h5 --config calib_matrix.csv -o lost.mha --json | grep -qE '"frames_used": ?7' || fail "a frame without a pose counts"

refuses() { # PATTERN FILE
  local status=0
  "$SONDE" slice "$2" --config calib_matrix.csv --frame 1 -o no.png >said 2>&1 || status=$?
  ((status == 2)) || fail "$2: exit $status, expected 2: $(head -1 said)"
  grep -qE -- "$1" said || fail "$2 says '$(head -1 said)', expected '$1'"
  [[ ! -e no.png ]] || fail "$2 leaves a picture"
}
refuses 'expected the data sets frames \[count\]\[height\]\[width\] and tforms' colour.h5
refuses 'expected the data sets frames' poses.h5
refuses 'expected 8-bit grey' deep.h5
refuses 'expected 8 matrices of 4 x 4' fewer.h5
refuses 'matrix 2: expected its last row to be 0 0 0 1' slanted.h5
refuses 'the file is too short' huge.h5
refuses 'expected an HDF5 file' cut.h5
refuses 'No such file' absent.h5
echo "a sweep in HDF5 is read as TUS-REC writes it"
