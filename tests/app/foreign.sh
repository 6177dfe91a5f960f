#!/usr/bin/env bash
# Sequences and volumes as written are read by the tools of others: teem's unu and VTK. What is not
# installed is skipped and said so; exit code 77 when neither is there.
set -euo pipefail
source "$(dirname "$0")/common.sh"

fail() { echo "WRONG: $1"; exit 1; }
unu=$(command -v unu || command -v teem-unu || true)
python=""
for p in /usr/bin/python3 python3; do
  if "$p" -c 'import vtkmodules.vtkIOImage' 2>/dev/null; then python=$p; break; fi
done
[[ $unu ]] || echo "SKIP: no unu (teem-apps)"
[[ $python ]] || echo "SKIP: no VTK for python3 (python3-vtk9)"
[[ $unu || $python ]] || exit 77

# Six frames of 40 x 30, pixel (u, v) of frame k holds (3 u + 5 v + 7 k) mod 256.
sequence() {
  printf 'ObjectType = Image\nNDims = 3\nDimSize = 40 30 6\nElementType = MET_UCHAR\n'
  printf 'UltrasoundImageOrientation = MFA\n'
  for k in 0 1 2 3 4 5; do
    printf 'Seq_Frame%04d_ImageToReferenceTransform = 0.2 0 0 0 0 0.2 0 0 0 0 1 %d 0 0 0 1\n' "$k" "$k"
    printf 'Seq_Frame%04d_ImageToReferenceTransformStatus = OK\n' "$k"
  done
  printf 'ElementDataFile = LOCAL\n'
  # One process writes all the bytes as octal escapes: one for each pixel would cost a minute.
  printf "$(awk 'BEGIN { for (k = 0; k < 6; ++k) for (v = 0; v < 30; ++v) for (u = 0; u < 40; ++u)
    printf "\\%03o", (3 * u + 5 * v + 7 * k) % 256 }')"
}
sequence >"$work/in.igs.mha"
tail -c 7200 "$work/in.igs.mha" >"$work/pixels"

# unu takes both kinds of NRRD, raw and packed, and gives back the very bytes.
unu_reads() { # FILE DIMENSION PIXELS
  [[ $unu ]] || return 0
  "$unu" head "$1" >"$work/head" || fail "unu head $1"
  grep -q "dimension: $2" "$work/head" || fail "$1: expected $2 axes"
  "$unu" save -f nrrd -e raw -i "$1" -o "$work/again.nhdr" >/dev/null 2>&1 ||
    fail "unu save $1"
  cmp "$work/again.raw" "$3" || fail "$1: unu reads other pixels"
}
vtk_reads() { # FILE PIXELS
  [[ $python ]] || return 0
  "$python" - "$1" "$2" <<'PY' || fail "$1: VTK reads it differently"
import sys
from vtkmodules.vtkIOImage import vtkMetaImageReader, vtkNrrdReader
from vtkmodules.vtkCommonCore import vtkObject
vtkObject.GlobalWarningDisplayOff()
path, pixels = sys.argv[1], open(sys.argv[2], "rb").read()
reader = vtkMetaImageReader() if path.endswith(".mha") else vtkNrrdReader()
if not reader.CanReadFile(path):
    sys.exit("VTK cannot read " + path)
reader.SetFileName(path)
reader.Update()
values = reader.GetOutput().GetPointData().GetScalars()
if values is None or values.GetNumberOfTuples() != len(pixels):
    sys.exit("VTK finds %s pixels" % (values and values.GetNumberOfTuples()))
if any(int(values.GetTuple1(i)) != pixels[i] for i in range(len(pixels))):
    sys.exit("VTK finds other pixels")
PY
}

for way in "" --raw; do
  for name in copy.igs.mha copy.igs.nrrd copy.seq.nrrd; do
    "$SONDE" reconstruct "$work/in.igs.mha" --copy "$work/$name" $way >/dev/null
  done
  unu_reads "$work/copy.igs.nrrd" 3 "$work/pixels"
  unu_reads "$work/copy.seq.nrrd" 4 "$work/pixels"
  vtk_reads "$work/copy.igs.mha" "$work/pixels"
  vtk_reads "$work/copy.igs.nrrd" "$work/pixels"
  for name in volume.mha volume.nrrd; do
    "$SONDE" reconstruct "$work/in.igs.mha" -o "$work/$name" --spacing-mm 0.4 $way >/dev/null
  done
  # The voxels are the end of a raw file.
  "$SONDE" reconstruct "$work/in.igs.mha" -o "$work/plain.mha" --spacing-mm 0.4 --raw >/dev/null
  voxels=$(sed -n 's/^DimSize = //p;/^ElementDataFile/q' "$work/plain.mha" | tr ' ' '*')
  tail -c "$((${voxels%\*}))" "$work/plain.mha" >"$work/voxels"
  unu_reads "$work/volume.nrrd" 3 "$work/voxels"
  vtk_reads "$work/volume.mha" "$work/voxels"
  vtk_reads "$work/volume.nrrd" "$work/voxels"
done
echo "sequences and volumes read by ${unu:-no unu} and ${python:+VTK}"
