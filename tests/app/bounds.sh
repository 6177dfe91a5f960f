#!/usr/bin/env bash
# Limits of input: what is too deep, too long, too far or too wide is refused with file and line or
# with the option and its range; exit 2, nothing written. No value is replaced in silence.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"
in=$work/in
head_of_scene=$'sonde_scene: 1\nbodies:\n'
ball='- {name: ball, shape: {sphere_mm: 5}, mass_kg: 1}'

# One document, not too deep, not too long, without a byte 0: scenes, cases, protocols, presets.
printf '%s%s\n---\n%s%s\n' "$head_of_scene" "$ball" "$head_of_scene" "$ball" >"$in/two.yaml"
rejects 'two\.yaml:4: a second document begins' simulate "$in/two.yaml" -o sim
printf '%s%s\n...\nnot: [yaml\n' "$head_of_scene" "$ball" >"$in/rest.yaml"
rejects 'rest\.yaml:[56]: (a second document|not YAML)' simulate "$in/rest.yaml" -o sim
for kind in simulate cases; do
  { printf 'title: '; head -c 100000 /dev/zero | tr '\0' '['; } >"$in/deep.yaml"
  arguments=(simulate "$in/deep.yaml" -o sim)
  [[ $kind == simulate ]] || arguments=(cases --check "$in/deep.yaml")
  rejects 'deep\.yaml:1: expected at most 32 levels of nesting' "${arguments[@]}"
done
{ cat "$DATA/../cases/isolated-femoral.yaml"; printf -- '---\nid: other\n'; } >"$in/second.yaml"
rejects 'second\.yaml:[0-9]+: a second document begins' cases --check "$in/second.yaml"
{ printf 'title: ['; awk 'BEGIN { for (i = 0; i < 600000; ++i) print "a," }'; printf ']\n'; } >"$in/many.yaml"
rejects 'many\.yaml:[0-9]+: expected at most 500000 values' simulate "$in/many.yaml" -o sim
head -c 5000000 /dev/zero | tr '\0' '#' >"$in/long.yaml"
rejects 'long\.yaml: is larger than a YAML file may be: expected at most 4 MiB' simulate \
  "$in/long.yaml" -o sim
rejects '/dev/zero: is larger than a YAML file may be' simulate /dev/zero -o sim
printf 'sonde_scene: 1\ntitle: a\0b\n' >"$in/zero.yaml"
rejects 'zero\.yaml:2: contains a zero byte' simulate "$in/zero.yaml" -o sim
head -c 100000 /dev/zero | tr '\0' '[' >"$in/deep.json"
rejects 'deep\.json:1: expected at most 32 levels' press "$MODEL" --site 27 --depth-mm 2 --preset \
  "$in/deep.json"

# Edges finer than a shape may have are refused, not coarsened.
for shape in 'box_mm: [80, 10, 10]' 'sphere_mm: 50' 'cylinder_mm: {radius: 20, length: 50}'; do
  printf '%s- {name: a, shape: {%s, edge_mm: 0.01}, mass_kg: 1}\n' "$head_of_scene" "$shape" \
    >"$in/fine.yaml"
  rejects 'fine\.yaml:3: edge_mm is 0\.01.*an edge_mm of 0\.[0-9]+ or more' simulate "$in/fine.yaml" \
    -o sim
done

# Poses, faces and probes.
image=(image "$MODEL" -o picture.png)
rejects '--pose expects X, Y and Z from -2000 to 2000 mm' "${image[@]}" --pose 1e9,0,0,1,0,0,0
rejects '--pose expects X, Y and Z from -2000 to 2000 mm' "${image[@]}" --pose 0,0,2001,1,0,0,0
rejects '--aperture-mm 200 is an arc of 573 degrees of --curved-mm 20, expected at most 180' \
  "${image[@]}" --site 27 --curved-mm 20 --aperture-mm 200
box() { # FILE SIDE: a box of that side as a mesh file
  local half=$(($2 / 2))
  {
    for z in -$half 0; do for y in -$half $half; do for x in -$half $half; do echo "v $x $y $z"; done; done; done
    printf 'f 1 3 2\nf 2 3 4\nf 5 6 7\nf 6 8 7\nf 1 2 5\nf 2 6 5\nf 3 7 4\nf 4 7 8\nf 1 5 3\nf 3 5 7\nf 2 4 6\nf 4 8 6\n'
  } >"$1"
}
box "$in/wide.obj" 4000000
rejects 'wide\.obj: the probe is 4e\+06 mm wide, expected at most 500' press "$MODEL" --site 27 \
  --probe "$in/wide.obj" --depth-mm 2
sed 's/000000/.0/g' "$in/wide.obj" | awk '/^v/ { print "v", $2 / 1e4, $3 / 1e4, $4 / 1e4; next } { print }' \
  >"$in/metres.obj"
rejects 'metres\.obj: the probe is .* mm wide, expected at least 1; is it in millimetres' press \
  "$MODEL" --site 27 --probe "$in/metres.obj" --depth-mm 2
box "$in/good.obj" 20
gives 'penetration_mm=2 probe=good force_n>=0.3 force_n<=0.6' press "$MODEL" --site 27 --probe "$in/good.obj" --depth-mm 2 --json

# Probes that end in a tip have a picture too; none of them ends the program.
tip() { # FILE X LENGTH: a pyramid 30 mm wide with its tip at x = X
  printf 'v -15 -15 -%s\nv 15 -15 -%s\nv 15 15 -%s\nv -15 15 -%s\nv %s 0 0\n' "$3" "$3" "$3" "$3" "$2" >"$1"
  printf 'f 1 4 3 2\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n' >>"$1"
}
tip "$in/upright.obj" 0 40
tip "$in/leaning.obj" 30 40
for name in upright leaning; do
  gives "penetration_mm=3 probe=$name" press "$MODEL" --site 27 --probe "$in/$name.obj" --depth-mm 3 \
    --image "$in/tip.png" --json
done

# Frames: the limit that was passed is the one that is named, and so is the option that helps.
sequence() { # FILE TRANSFORM: two frames of 4 x 4 pixels 100 m apart
  printf 'ObjectType = Image\nNDims = 3\nDimSize = 4 4 2\nElementType = MET_UCHAR\n'
  printf 'UltrasoundImageOrientation = MF\n'
  for f in 0 1; do
    printf 'Seq_Frame000%d_%sTransform = 0.1 0 0 %d  0 0.1 0 0  0 0 0.1 0  0 0 0 1\n' $f "$1" $((f * 100000))
    printf 'Seq_Frame000%d_%sTransformStatus = OK\n' $f "$1"
  done
  printf 'ElementDataFile = LOCAL\n'
  head -c 32 /dev/zero | tr '\0' 'x'
}
sequence ImageToReference >"$in/far.igs.mha"
rejects 'expected at most 16384 voxels along an axis.*try a spacing of' reconstruct "$in/far.igs.mha" \
  -o volume.mha
sequence ProbeToReference >"$in/lacks.igs.mha"
rejects 'no transforms lead from Image.*--config' reconstruct "$in/lacks.igs.mha" -o volume.mha
finish
