#!/usr/bin/env bash
# gates_red.sh HOUSE CC NM OBJDUMP: every gate of the house goes red on a small tree that breaks its rule,
# and is green on the same tree without the fault.
set -euo pipefail
house=$1 cc=$2 nm=$3 objdump=$4
tree=$(mktemp -d)
wrong=0

kept=$tree.kept # a tree that keeps every rule, made once
trap 'rm -rf "$tree" "$kept"' EXIT
mkdir -p "$kept"/src/sonde/{base,world} "$kept"/src/sonde-exam/stream "$kept"/include/sonde "$kept"/app "$kept"/tests/house "$kept"/docs
printf '/** @thread any */\nSONDE_API int sonde_one(int a);\n' >"$kept/include/sonde/base.h"
echo '#include "sonde/base.h"' >"$kept/include/sonde/world.h"
printf '#include "base/base.h"\nint sonde_step(int a) {\n  SONDE_ASSERT(a);\n  return a;\n}\n' \
  >"$kept/src/sonde/world/step_hot.c"
echo '#include "sonde/base.h"' >"$kept/src/sonde/base/base.h"
echo '#include "sonde/world.h"' >"$kept/app/main.c"
: >"$kept/tests/house/hot_objects.txt"
printf '%s\n' '# group room | does | read' 'sonde base | memory | docs/base.md' \
  'sonde world | the step | docs/base.md' 'sonde-exam stream | the page | include/sonde/base.h' \
  >"$kept/src/rooms.txt"
: >"$kept/docs/base.md"
printf '%s\n' '# Rooms' '<!-- rooms: -->' '<!-- end of rooms -->' >"$kept/docs/architecture.md"
"$house/../../docs/rooms.sh" "$kept"

fresh() { # that tree
  rm -rf "${tree:?}"/*
  cp -r "$kept"/. "$tree"
}
compile() { # ROOM FILE TEXT: the object where the gate looks for it
  local object=$tree/build/src/sonde/$1/CMakeFiles/sonde_$1.dir/$2.o
  mkdir -p "$(dirname "$object")"
  printf '%s\n' "$3" | "$cc" -O2 -x c -c -o "$object" -
}
library() { # TEXT [NAME]: a shared library, lib.so without a NAME
  printf '%s\n' "$1" | "$cc" -x c -shared -fPIC -nostdlib -o "$tree/${2:-lib}.so" -
}

expect() { # green|red WHAT COMMAND...
  local colour=$1 what=$2 got=green
  shift 2
  "$@" >/dev/null 2>&1 || got=red
  if [[ $got != "$colour" ]]; then
    echo "$what: expected $colour, got $got"
    wrong=$((wrong + 1))
  fi
}

includes=("$house/includes.sh" "$tree") rooms=("$house/rooms.sh" "$tree")
sizes=("$house/sizes.sh" "$tree")
hot=("$house/hot_symbols.sh" "$tree" "$tree/build" "$objdump")
api=("$house/api.sh" "$tree" "$nm" "$tree/lib.so" "$tree/user.so" -- "$tree/app") disk=("$house/disk.sh" "$tree")
format=("$house/format.sh" "$tree")
callers=("$house/callers.sh" "$tree")
cp "$house/../../.clang-format" "$tree"

fresh
expect green "includes, clean tree" "${includes[@]}"
expect green "sizes, clean tree" "${sizes[@]}"
echo '#include "stream/x.h"' >>"$tree/src/sonde/world/step_hot.c"
expect red "a room that includes a lower room" "${includes[@]}"
fresh; echo '#include "sonde/stream.h"' >>"$tree/include/sonde/world.h"
expect red "a public header that includes a lower one" "${includes[@]}"
fresh; echo '#include "base/base.h"' >>"$tree/app/main.c"
expect red "an app file that looks inside" "${includes[@]}"

fresh
expect green "rooms, clean tree" "${rooms[@]}"
sed -i '/stream/d' "$tree/docs/architecture.md"
expect red "a table of rooms that lacks one of the list" "${rooms[@]}"
fresh; sed -i 's/the step/many steps/' "$tree/src/rooms.txt"
expect red "a room that does something else in the table" "${rooms[@]}"
fresh; sed -i '/end of rooms/d' "$tree/docs/architecture.md"
expect red "a page without the place of the table" "${rooms[@]}"
fresh; mkdir "$tree/src/sonde/other"
expect red "a directory of src that is not listed" "${rooms[@]}"
docs=("$house/docs.sh" "$tree")
fresh; : >"$tree/README.md"; : >"$tree/CONTRIBUTING.md"; mkdir "$tree/docs/decisions"; : >"$tree/docs/decisions/1.md"
echo '[one](base.md) `src/sonde/world/step_hot.c` `sonde_step`' >"$tree/docs/a.md"
expect green "docs that name what is there" "${docs[@]}"
for fault in 's/step_hot/step/' 's/`sonde_step`/`sonde_stop`/' 's/base.md/other.md/'; do
  sed "$fault" "$tree/docs/a.md" >"$tree/docs/b.md"
  expect red "docs after $fault" "${docs[@]}"
done
for fault in '$a sonde other | rests | docs/base.md' '$a sonde base | memory | docs/base.md' \
  's/^sonde base/library base/' '/^sonde base/s/base.md/other.md/' '/^sonde base/s/[|].*/| |/'; do
  fresh; sed -i "$fault" "$tree/src/rooms.txt"
  "$house/../../docs/rooms.sh" "$tree"
  expect red "the list of rooms after $fault" "${rooms[@]}"
done

fresh; echo 'int sonde_disk(void);' >"$tree/src/sonde/base/disk.c"
expect green "disk, clean tree" "${disk[@]}"
echo 'void f(void) { rename("a", "b"); }' >>"$tree/app/main.c"
expect red "a call that changes the disk elsewhere" "${disk[@]}"

fresh
expect green "callers, clean tree" "${callers[@]}"
echo 'SONDE_API int sonde_two(int a); /**< a @thread tick */' >>"$tree/include/sonde/base.h"
expect green "a caller behind the declaration" "${callers[@]}"
echo 'SONDE_API int sonde_three(int a);' >>"$tree/include/sonde/base.h"
expect red "a function without a comment below one that has one" "${callers[@]}"
fresh; sed -i 's/any/reader/' "$tree/include/sonde/base.h"
expect red "a caller that is none of the three" "${callers[@]}"
fresh; sed -i 's/ @thread any//; s/;/; \/**< a *\//' "$tree/include/sonde/base.h"
expect red "a comment that names no caller" "${callers[@]}"

fresh
expect green "format, clean tree" "${format[@]}"
echo 'int  wide(void);' >>"$tree/app/main.c"
expect red "a line with two blanks where one belongs" "${format[@]}"
fresh; echo 'int *a; int *b;' >>"$tree/src/sonde/base/base.h"
expect red "a header with two declarations on a line" "${format[@]}"

fresh
cp "$house/../../.clang-tidy" "$tree"
tidy=("$house/tidy.sh" "$tree" "$tree")
printf '%s\n' '[{"directory": "'"$tree"'", "command": "cc -c app/main.c",' \
  '"file": "'"$tree"'/app/main.c"}]' >"$tree/compile_commands.json"
echo 'int equal(int a);' >"$tree/app/main.c"
expect green "clang-tidy, clean tree" "${tidy[@]}"
echo 'int equal(int a) { return a == a; }' >>"$tree/app/main.c"
expect red "a comparison of a number with itself" "${tidy[@]}"
fresh; cp "$house/../../Doxyfile" "$tree"; mkdir -p "$tree/bench" "$tree/data/thigh"
for page in README.md CONTRIBUTING.md bench/README.md data/thigh/CARD.md; do
  echo '# Page' >"$tree/$page"
done
expect green "doxygen, clean tree" "$house/doxygen.sh" "$tree"
sed -i 's/@thread any/@param b number @thread any/' "$tree/include/sonde/base.h"
expect red "a docstring of a parameter that is not there" "$house/doxygen.sh" "$tree"

words=("$house/words.sh" "$tree")
fresh; mkdir -p "$tree/tests/house"; cp "$house/words.txt" "$tree/tests/house"
expect green "names without words of another meaning" "${words[@]}"
printf 'int sonde_run_crew(int a) {\n  return a;\n}\n' >"$tree/src/sonde/world/crew_a.c"
expect red "a name with a word of another meaning" "${words[@]}"

fresh
{ echo 'int long_one(int a) {'; for i in {1..79}; do echo "  a += $i;"; done; echo '}'; } \
  >>"$tree/app/main.c"
expect red "a function of 81 lines" "${sizes[@]}"
fresh; for _ in {1..801}; do echo '//'; done >"$tree/app/long.c"
expect red "a file of 801 lines" "${sizes[@]}"
fresh; for _ in {1..251}; do echo '//'; done >"$tree/app/long.h"
expect red "a header of 251 lines" "${sizes[@]}"
fresh; sed -i /ASSERT/d "$tree/src/sonde/world/step_hot.c"
expect red "no asserts" "${sizes[@]}"
once='static int sonde_a(int a) {\n  return a;\n}\nint sonde_b(int a) { return sonde_a(a); }\n'
twice='int sonde_c(int a) { return sonde_a(a); }\n'
fresh; printf "$once$twice" >"$tree/src/sonde/world/once.c"
expect green "a helper with two uses" "${sizes[@]}"
fresh; printf "$once" >"$tree/src/sonde/world/once.c"
expect red "a helper with a single use" "${sizes[@]}"
fresh; { for i in {1..13}; do echo "// $i"; done; echo 'int sonde_a(int a);'; } >"$tree/app/head.c"
expect red "a head of 13 lines" "${sizes[@]}"
# Helpers 1 to TWICE are called twice; the address of another, or of as many others as are named, stands in a table.
tabled() { # TWICE NAME...
  local i twice=$1
  shift
  for ((i = 1; i <= twice; ++i)); do
    printf "static int twice_$i(int a) {\n  SONDE_ASSERT(a);\n  return a;\n}\nint sonde_t$i(int a) { return twice_$i(a) + twice_$i(1); }\n"
  done
  for i in "$@"; do printf "static int $i(int a) {\n  return a;\n}\nint (*const table_$i[])(int) = {$i};\n"; done
}
fresh; tabled 3 one >"$tree/src/sonde/world/once.c"
expect green "one helper of four whose address stands in a table" "${sizes[@]}"
fresh; tabled 3 one two three >"$tree/src/sonde/world/once.c"
expect red "half of the helpers with their address in a table" "${sizes[@]}"
single_of() { # COUNT: helpers that are called once
  for i in $(seq "$1"); do printf "static int once_$i(int a) {\n  return a;\n}\nint sonde_o$i(int a) { return once_$i(a); }\n"; done
}
fresh; { tabled 8; single_of 9; } >"$tree/src/sonde/world/once.c"; tabled 60 >"$tree/src/sonde/base/twice.c"
expect red "a room with more than half of its helpers called once" "${sizes[@]}"
fresh; { tabled 10; single_of 6; } >"$tree/src/sonde/world/once.c"; tabled 60 >"$tree/src/sonde/base/twice.c"
expect green "a room with a third of its helpers called once" "${sizes[@]}"
fresh; for i in {1..50}; do echo 'SONDE_ASSERT(1);'; done >"$tree/src/sonde/base/many.c"
for i in {1..400}; do echo "int sonde_$i;"; done >"$tree/src/sonde/world/few.c"
expect red "a room with few asserts" "${sizes[@]}"
fresh; for i in {1..400}; do echo "int sonde_$i;"; done >"$tree/app/few.c"
expect red "commands with few asserts" "${sizes[@]}"
fresh; for i in {1..400}; do ((i % 80)) && echo "int sonde_$i;" || echo 'assert(1);'; done >"$tree/app/few.c"
expect green "commands with asserts" "${sizes[@]}"

fresh
compile world step_hot.c 'double sin(double); double f(double a) { return sin(a); }'
expect green "hot object that only computes" "${hot[@]}"
for call in 'void *malloc(unsigned long); void *f(void) { return malloc(8); }' \
  'int printf(const char *, ...); void f(int a) { printf("%d %d", a, a); }' \
  'int pthread_mutex_lock(void *); void f(void *a) { pthread_mutex_lock(a); }' \
  'void free(void *); void g(void (*)(void *)); void f(void) { g(free); }' \
  'void sonde_nowhere(void); void f(void) { sonde_nowhere(); }'; do
  compile world step_hot.c "$call"
  expect red "hot object: $call" "${hot[@]}"
done
compile world step_hot.c 'int sonde_far(int); int f(int a) { return 1 + sonde_far(a); }'
compile base far.c 'static __attribute__((noinline)) int near(int a) { return a * a; }
  int sonde_far(int a) { return near(a) + 1; }'
expect green "hot object that calls what computes" "${hot[@]}"
compile base far.c 'int puts(const char *); static __attribute__((noinline)) int near(int a) {
    puts("x"); return a; } int sonde_far(int a) { return near(a) + 1; }'
expect red "hot object that calls what prints further on" "${hot[@]}"
echo 'src/sonde/base/far.c puts' >"$tree/tests/house/hot_objects.txt"
expect green "the same with an exception" "${hot[@]}"
rm -r "$tree/build"
expect red "hot object that was not built" "${hot[@]}"

fresh; elementary=("$house/elementary.sh" "$tree/build" "$nm")
compile world step.c 'double floor(double); double sonde_math_sin(double);
  double f(double a) { return floor(a) + sonde_math_sin(a); }'
expect green "object that calls what is exact" "${elementary[@]}"
for call in 'double sin(double); double f(double a) { return sin(a); }' \
  'float powf(float, float); float f(float a) { return powf(a, 0.3f); }' \
  'double fmax(double, double); double (*f)(double, double) = fmax;' \
  '_Complex double f(_Complex double a) { return 1 / a; }'; do
  compile world step.c "$call"
  expect red "object: $call" "${elementary[@]}"
done

fresh; library 'int sonde_one(int a) { return a; }'
library 'int sonde_one(int); int sonde_user(int a) { return sonde_one(a); }' user
echo 'SONDE_API int sonde_user(int a);' >>"$tree/include/sonde/base.h"
expect green "library that keeps to its headers" "${api[@]}"
library 'int sonde_user(int a) { return a; }' user
expect red "public function that nobody calls" "${api[@]}"
echo 'int sonde_one(int); int main(void) { return sonde_one(1); }' | "$cc" -x c -c -o "$tree/app/main.o" -
expect green "public function that a program calls" "${api[@]}"
cp "$tree/include/sonde/base.h" "$tree/base.h"
many=$(for i in {2..201}; do echo "int sonde_n$i(int);"; done)
sed 's/^/SONDE_API /' <<<"$many" >>"$tree/include/sonde/base.h"
{ echo 'int sonde_one(int a) { return a; }'; sed 's/(int)/(int a)/; s/;$/ { return a; }/' <<<"$many"; } |
  "$cc" -x c -shared -fPIC -nostdlib -o "$tree/lib.so" -
{ echo "$many"; echo 'int sonde_one(int); int main(void) { return sonde_one(1)'; sed 's/int \(.*\)(int);/+ \1(1)/' <<<"$many"; echo '; }'; } |
  "$cc" -x c -c -o "$tree/app/main.o" -
expect red "library of 201 public functions" "${api[@]}"
sed -i '/sonde_n201/d' "$tree/include/sonde/base.h"
{ echo 'int sonde_one(int a) { return a; }'; grep -v n201 <<<"$many" | sed 's/(int)/(int a)/; s/;$/ { return a; }/'; } |
  "$cc" -x c -shared -fPIC -nostdlib -o "$tree/lib.so" -
expect green "library of 200 public functions" "${api[@]}"
mv "$tree/base.h" "$tree/include/sonde/base.h"; rm "$tree/app/main.o"
library 'int sonde_one(int a) { return a; }'
library 'int sonde_one(int); int sonde_user(int a) { return sonde_one(a); }' user
library 'int sonde_one(int a) { return a; } int helper(int a) { return a; }'
expect red "library that exports more" "${api[@]}"
library 'int sonde_other(int a) { return a; }'
expect red "library that lacks a declared function" "${api[@]}"
library 'int sonde_one(int a) { return a; } int sonde_link(int a) { return a; }'
echo 'SONDE_LINK int sonde_link(int a);' >>"$tree/src/sonde/base/base.h"
expect red "function for another library that no library calls" "${api[@]}"
library 'int sonde_one(int); int sonde_link(int); int sonde_user(int a) { return sonde_one(a) + sonde_link(a); }' user
expect green "function for another library that calls it" "${api[@]}"
library 'int sonde_link(int); int sonde_one(int a); int sonde_user(int a) { return sonde_link(a); }
  __attribute__((weak)) int sonde_one(int a) { return a; }' user
expect red "function that two libraries export" "${api[@]}"

if command -v node >/dev/null; then
  figures=(node "$house/../../bench/figures.mjs" check "$tree")
  fresh; mkdir -p "$tree/bench/figures" "$tree/docs"
  echo '{"date": "", "sources": ["src/sonde/base"], "digest": "", "values": {"one": {"ms": 1234.56}}}' \
    >"$tree/bench/figures/group.json"
  echo 'It takes <!--group.one.ms 1-->1,234.6<!----> ms.' >"$tree/docs/a.md"
  expect green "a document with the figure that was measured" "${figures[@]}"
  echo 'It takes <!--group.one.ms 1-->1,234.5<!----> ms.' >"$tree/docs/a.md"
  expect red "a document with another figure" "${figures[@]}"
  echo 'It takes <!--group.two.ms 1-->1<!----> ms.' >"$tree/docs/a.md"
  expect red "a document with a figure that nobody measured" "${figures[@]}"
  echo '{"date": "", "sources": ["src/sonde/base"], "digest": "", "values": {"output": "1 2"}}' >"$tree/bench/figures/solver.json"
  printf '<!--block solver-->\n```\n1 2\n```\n<!--end block-->\n' >"$tree/docs/a.md"
  expect green "a document with the table that was measured" "${figures[@]}"
  printf '<!--block solver-->\n```\n1 3\n```\n<!--end block-->\n' >"$tree/docs/a.md"
  expect red "a document with another table" "${figures[@]}"
fi

echo "$wrong gates of the wrong colour"
((wrong == 0))
