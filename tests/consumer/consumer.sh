#!/usr/bin/env bash
# consumer.sh SOURCE BUILD: installs the build tree under a temporary prefix and uses it as somebody
# else would: by pkg-config and by find_package, shared and static, from C and C++; then runs the
# installed program away from the source tree.
set -euo pipefail
source_dir=$1 build=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
prefix=$work/prefix

cmake --install "$build" --prefix "$prefix" >"$work/install.log" || { cat "$work/install.log"; exit 1; }
pc=$(find "$prefix" -name sonde.pc)
export PKG_CONFIG_PATH
PKG_CONFIG_PATH=$(dirname "$pc")
libdir=$(pkg-config --variable=libdir sonde)
cd "$work"

# shellcheck disable=SC2046 # the flags are words
{
  echo "-- pkg-config, shared"
  cc -Wall -Wextra -Werror "$source_dir/main.c" -o pc_shared $(pkg-config --cflags --libs sonde) -lm
  LD_LIBRARY_PATH=$libdir ./pc_shared
  readelf -d pc_shared | grep -q 'NEEDED.*libsonde\.so\.[0-9]' || { echo "not linked shared"; exit 1; }
  echo "-- pkg-config, static"
  cc "$source_dir/main.c" -o pc_static $(pkg-config --cflags sonde) -Wl,-Bstatic -L"$libdir" -lsonde \
    -Wl,-Bdynamic $(pkg-config --static --libs sonde | sed 's/-lsonde//')
  if readelf -d pc_static | grep -q 'NEEDED.*libsonde'; then echo "not linked static"; exit 1; fi
  ./pc_static
}
[[ $(pkg-config --modversion sonde) == "$(./pc_static | sed 's/^libsonde \([^:]*\):.*/\1/')" ]]

echo "-- a program that steps needs libm, libz and libc only"
# shellcheck disable=SC2046
cc "$source_dir/../../samples/step_loop.c" -o step $(pkg-config --cflags sonde) -Wl,-Bstatic -L"$libdir" \
  -lsonde -Wl,-Bdynamic $(pkg-config --static --libs sonde | sed 's/-lsonde//')
readelf -d step | sed -n 's/.*NEEDED.*\[\(.*\)\]/\1/p' >needed
if grep -vE '^lib(m|z|c)\.so|^ld-linux' needed; then echo "the step needs more than libm, libz, libc"; exit 1; fi

echo "-- headers as C11, C17 and C++17"
(cd "$prefix/include" && find sonde -name '*.h' | sort | sed 's/.*/#include <&>/') >all.h
for language in 'c c11' 'c c17' 'c++ c++17'; do
  # shellcheck disable=SC2086 # language and standard are two words
  set -- $language
  "${CC:-cc}" -x "$1" -std="$2" -Wall -Wextra -Wpedantic -Werror -I"$prefix/include" -fsyntax-only all.h
done

echo "-- find_package"
cmake -S "$source_dir" -B cm -G Ninja -DCMAKE_PREFIX_PATH="$prefix" >cm.log 2>&1 || { cat cm.log; exit 1; }
cmake --build cm >cm.log 2>&1 || { cat cm.log; exit 1; }
cm/consumer_static
cm/consumer_shared
cm/consumer_cxx
cm/consumer_parts_static
cm/consumer_parts_shared

echo "-- installed program"
cd /
env -u SONDE_MODEL "$prefix/bin/sonde" press --site 27 --probe linear --depth-mm 3 --json \
  >"$work/press.json"
grep -q '"force_n"' "$work/press.json"
[[ -s $prefix/share/man/man1/sonde.1 ]]
