#!/usr/bin/env bash
# A data set has the same bytes whoever makes it: in one process, in shards, after a full disk and
# after a kill; what is half done is not taken for whole; what differs is named.
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

expect() { # STATUS WORD ARGUMENTS
  local wanted=$1 word=$2
  shift 2
  checks=$((checks + 1))
  run "$@"
  ((status == wanted)) || wrong "sonde $*: exit $status, expected $wanted"
  [[ -z $word ]] || cat "$out" "$err" | grep -qiE -- "$word" || wrong "sonde $*: does not say '$word'"
}
holds() { # TEST...
  checks=$((checks + 1))
  test "$@" || wrong "not true: $*"
}

cat >plan.yaml <<'PLAN'
sonde_dataset: 1
seed: 5
body: bundled
legs: 2
presses: 1
frames: 1
width: 48
height: 48
force_low_n: 0.5
force_high_n: 0.5
PLAN

# What cannot be is told before anything is made.
sed 's/^seed.*/seed: x/' plan.yaml >bad.yaml
expect 2 'bad.yaml:2: seed' dataset --plan bad.yaml -o none
printf 'scanners: [cat]\n' | cat plan.yaml - >bad.yaml
expect 2 "no scanner 'cat'" dataset --plan bad.yaml -o none
for shard in 0/2 3/2 1 1/2x; do expect 2 'I/N' dataset --plan plan.yaml --shard "$shard" -o none; done
expect 2 'one of -o' dataset --plan plan.yaml
expect 2 'no plan' dataset --check one --seed 1
holds ! -e none

# A disk that is full: exit 1, no leg that looks whole, no remains; then the same words go on.
trap '' XFSZ # a write beyond the limit fails instead of killing
status=0
(ulimit -f 200 && exec "$SONDE" dataset --plan plan.yaml -o one >"$out" 2>"$err" </dev/null) || status=$?
holds "$status" = 1
holds -z "$(ls one/index one/*.tar one/*.part-* 2>/dev/null | grep -v '^one/index:$' || true)"
expect 0 '2 of 2 legs \(2 made now\)' dataset --plan plan.yaml -o one

# A shard that was killed, with a leg cut short behind its index and a file left aside, and a leg that another made.
cp -r one two
rm two/manifest.json two/SHA256SUMS two/README.md two/card.json
head -c 1000 one/leg-000001.tar >two/leg-000001.tar
cp two/leg-000001.tar two/leg-000001.tar.part-00abcd
expect 0 '1 of 2 legs \(0 made now\)' dataset --plan two/plan.yaml --shard 1/2 -o two
holds ! -e two/manifest.json
expect 0 '2 of 2 legs \(1 made now\)' dataset --plan two/plan.yaml --shard 2/2 -o two
diff -r one two >&2 || wrong 'shards after a kill made other bytes than one process'
gives 'legs=2 legs_made=0 frames=2 whole:bool' dataset --plan plan.yaml -o two --json

# Members are sorted and have neither date nor owner; the sums are those of sha256sum.
tar --numeric-owner --full-time -tvf one/leg-000000.tar >members
holds "$(wc -l <members)" = 8
holds -z "$(grep -vE '^-rw-r--r-- 0/0 .* 1970-01-01 00:00:00 ' members || true)"
awk '{ print $NF }' members | LC_ALL=C sort -c || wrong 'members are not sorted'
(cd one && sha256sum --quiet -c SHA256SUMS) >&2 || wrong 'sha256sum finds another sum'
expect 0 '5 files' dataset --check one
expect 2 'another plan' dataset --plan plan.yaml --seed 6 -o one
expect 2 'another plan, format' dataset --plan plan.yaml --format folder -o one
printf 'x' | dd of=two/leg-000001.tar bs=1 seek=700 conv=notrunc status=none
expect 2 'leg-000001.tar: SHA-256' dataset --check two
rm two/card.json two/leg-000001.tar
expect 2 'cannot be read' dataset --check two

finish
