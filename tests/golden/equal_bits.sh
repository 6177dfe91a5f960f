#!/usr/bin/env bash
# equal_bits.sh ROOT BUILD COMPILER [EMULATOR]: builds test_golden.c and the part of the library that it
# needs with a compiler for another C library or processor, and runs it: its hashes are those of every
# build. The commands are those of BUILD at another level of optimisation. Where the processor is the
# same, objects that call nothing of the C library are those of BUILD; another one takes the base set of
# kernels only. An emulator leaves out what takes it minutes, but with SONDE_TEST_LONG.
set -euo pipefail
root=$1 build=$2 compiler=$3 emulator=${4-}
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
options=(-O1 -w -Wno-psabi -ffp-contract=off -fno-math-errno -std=gnu17 -D_GNU_SOURCE -DSONDE_BINARY_DIR='""')
for folder in tests/golden/plain include src/sonde src/sonde-files src/sonde-limb tests; do
  options+=("-I$root/$folder")
done

# The objects that the program takes out of the libraries: library and name of each.
libraries=("$build"/src/libsonde-{limb,files}.a "$build/src/libsonde.a")
cc "${options[@]}" "$root/tests/golden/test_golden.c" -o "$out/native" -Wl,-t -Wl,-t \
  "${libraries[@]}" -lm -lpthread -lz -lpng -ljpeg -lyaml >"$out/trace"
sed -nE 's,.*/lib(sonde[a-z-]*)\.a\)([a-z0-9_]+\.c\.o)$,\1 \2,p' "$out/trace" | sort -u >"$out/needed"
[[ -s $out/needed ]] || { echo "no object of the library is needed"; exit 1; }

# The objects of the build that call the C library, but to copy or set memory.
nm -A -u -f posix $(find "$build/src" -name '*.c.o' -path '*/sonde_*.dir/*') |
  awk -v "own=$(nm -f posix --defined-only "${libraries[@]}" 2>/dev/null | awk 'NF > 2 { print $1 }' | tr '\n' ' ')" '
    BEGIN { n = split(own " _GLOBAL_OFFSET_TABLE_ memcpy memset memmove memcmp", name, " "); for (i = 1; i <= n; ++i) known[name[i]] = 1 }
    !($2 in known) { sub(/:$/, "", $1); print $1 }' | sort -u >"$out/callers"

sed -nE 's/^ *"command": "(.*)",$/\1/p' "$build/compile_commands.json" |
  awk -v needed="$out/needed" -v compiler="$compiler" -v out="$out" -v build="$build" -v callers="$out/callers" \
    -v x86="$("$compiler" -dumpmachine | grep -c '^x86_64')" '
    BEGIN {
      while ((getline line < needed) > 0) is_needed[line] = 1
      while ((getline line < callers) > 0) calls[line] = 1
    }
    match($0, / -o src\/[^ ]*\.c\.o /) {
      object = flat = substr($0, RSTART + 4, RLENGTH - 5)
      split(object, part, "/")
      name = object; sub(/.*\//, "", name); gsub(/\//, "_", flat)
      if (!((part[2] " " name) in is_needed)) next
      if (x86 && !((build "/" object) in calls)) { print "cp", build "/" object, out "/" flat; next }
      if (/ -m(sse|avx)/) next
      flags = ""
      for (i = 1; i <= NF; ++i) if ($i ~ /^-([DI]|f|std)/) flags = flags " " $i
      print compiler, "-O1 -w -Wno-psabi" flags, "-o", out "/" flat, "-c", $NF
    }' >"$out/commands"
xargs -P 2 -I{} sh -c '{}' <"$out/commands"
ar rcs "$out/needed.a" "$out"/*.c.o
"$compiler" "${options[@]}" -static "$root/tests/golden/test_golden.c" "$out/needed.a" -o "$out/golden" -lm -lpthread
echo "$(grep -vc '^cp' "$out/commands") objects by $compiler"
if [[ -n $emulator && -z ${SONDE_TEST_LONG-} ]]; then export SONDE_GOLDEN_SHORT=1; fi
$emulator "$out/golden"
