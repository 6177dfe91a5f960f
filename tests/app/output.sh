#!/usr/bin/env bash
# Output goes where the path leads: links stay, pipes and devices are written into; a full disk is
# exit 1 and leaves what was there.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

# expect STATUS WORD ARGUMENTS
expect() {
  local wanted=$1 word=$2
  shift 2
  checks=$((checks + 1))
  run "$@"
  ((status == wanted)) || wrong "sonde $*: exit $status, expected $wanted"
  [[ -z $word ]] || grep -qiE -- "$word" "$err" || wrong "sonde $*: stderr does not say '$word'"
}
holds() { # TEST...: a condition that must hold
  checks=$((checks + 1))
  test "$@" || wrong "not true: $*"
}

expect 0 '' generate --seed 1 -o whole.sonde
echo old >kept.sonde
ln -s kept.sonde link.sonde
ln -s "$work/out/new.sonde" dangling.sonde
expect 0 '' generate --seed 1 -o link.sonde
expect 0 '' generate --seed 1 -o dangling.sonde
holds -L link.sonde
holds -L dangling.sonde
cmp whole.sonde kept.sonde || wrong 'the file behind the link is not the new one'
cmp whole.sonde new.sonde || wrong 'a link that led to nothing was not followed'

mkfifo pipe
cat pipe >through.sonde &
expect 0 '' generate --seed 1 -o pipe
wait $!
holds -p pipe
cmp whole.sonde through.sonde || wrong 'the pipe carried something else'

# /dev/stdout, in a pipe and in a file that begins with something else.
"$SONDE" generate --seed 1 --json -o /dev/stdout 2>"$err" | cat >piped
head -c "$(stat -c %s whole.sonde)" piped | cmp - whole.sonde || wrong '/dev/stdout in a pipe'
{ printf 'head\n' && "$SONDE" generate --seed 1 --json -o /dev/stdout; } >both 2>"$err"
head -c 5 both | grep -q head || wrong '/dev/stdout in a file lost what stood there'
tail -c +6 both | head -c "$(stat -c %s whole.sonde)" | cmp - whole.sonde || wrong '/dev/stdout in a file'
checks=$((checks + 5))

expect 0 '' generate --seed 1 -o /dev/null
holds -c /dev/null
expect 1 'full.*No space left' generate --seed 1 -o /dev/full
holds -c /dev/full
checks=$((checks + 1))
status=0
"$SONDE" cases --json >/dev/full 2>"$err" || status=$?
((status == 1)) || wrong "results onto a full disk: exit $status, expected 1"

# A file that cannot grow: the old one stays whole, nothing is left beside it.
checks=$((checks + 1))
cp whole.sonde old.sonde
before=$(ls)
status=0
(ulimit -f 100 && exec "$SONDE" generate --seed 2 -o old.sonde) >"$out" 2>"$err" || status=$?
((status == 1)) || wrong "a disk that is full after 100 kB: exit $status, expected 1"
cmp whole.sonde old.sonde || wrong 'the old file was touched'
[[ $(ls) == "$before" ]] || wrong "something was left: $(ls)"

expect 2 'nowhere/x.sonde' generate --seed 1 -o nowhere/x.sonde
mkdir place
expect 2 'place.*directory' generate --seed 1 -o place
finish
