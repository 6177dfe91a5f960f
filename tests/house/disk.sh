#!/usr/bin/env bash
# disk.sh ROOT: src/sonde/base/disk.c is the only file of src/ and app/ that changes the disk, so that a test
# can let every such call fail. Files may be opened for reading anywhere.
set -euo pipefail
root=$1
cd "$root"
# app/page_token.c makes a secret that no other user can read, by link(2), which gives up when another
# program was first; what it loses is made again.
# app/exam_app_export.c removes an export, which is made again whenever it is wanted.
own='^(src/sonde/base/disk\.c|app/page_token\.c|app/exam_app_export\.c):'
calls='(fopen|freopen|creat|mkstemp|mkdir|rename|unlink|remove|rmdir|link|symlink|truncate|ftruncate|fsync|fdatasync)\('
found=$(grep -rnE "(^|[^_a-zA-Z0-9>.])$calls" --include='*.[ch]' src app | grep -vE "$own" |
  grep -vE 'fopen\([^,]*, "rb?"\)' | grep -vE ':[0-9]+: *//' || true)
found+=$(grep -rnE '(^|[^_a-zA-Z0-9>.])open(at)?\(' --include='*.[ch]' src app |
  grep -vE "$own" | grep -v 'O_RDONLY' | grep -vE ':[0-9]+: *//' || true)
[[ -z $found ]] || printf 'changes the disk beside base/disk.c: %s\n' "$found"
[[ -s src/sonde/base/disk.c && -z $found ]]
