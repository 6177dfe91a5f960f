#!/usr/bin/env bash
# sonde fit --cohort: one process, two shards, a run that was killed, and mpirun leave the
# same bytes; a subject that fails stops no other.
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$here/common.sh"
data=$(cd "$DATA" && pwd) in=$work/in
# Three subjects of 16 sites each and one whose measurements are no table.
head -17 "$data/sites.csv" >"$in/sites.csv"
part() { awk -F, -v scale="$1" 'NR == 1 || $1 + 0 <= 15 { if (NR > 1) $10 *= scale; print }' OFS=, "$data/indentation.csv"; }
part 1 >"$in/one.csv"
part 1.2 >"$in/two.csv"
part 0.9 >"$in/four.csv"
echo "site,probe,not a table" >"$in/three.csv"
{
  echo "# four legs"
  echo "subject,measurements,surface,sites,name"
  for id in one two three four; do echo "$id,$id.csv,$data/skin.ply,sites.csv,leg $id"; done
} >"$in/list.csv"
same() { # DIR: as the directory of one process
  checks=$((checks + 1))
  diff -rq whole "$1" >"$err" 2>&1 || wrong "$1 differs: $(<"$err")"
}

run fit --cohort "$in/list.csv" -o whole --json -- --stages 1
checks=$((checks + 1))
((status == 1)) || wrong "a subject failed: exit $status, expected 1"
"$CHECK_JSON" "subjects>=4" "subjects<=4" "fitted>=3" "fitted<=3" "failed>=1" "failed<=1" "kept<=0" whole=true <"$out" ||
  wrong "the JSON object"
grep -q "subject three failed" "$err" || wrong "stderr does not name the subject that failed"
[[ $(cd whole && echo *) == "cohort.csv cohort.json cohort.txt four.json four.sonde one.json one.sonde three.json two.json two.sonde" ]] ||
  wrong "the directory holds $(ls whole)"
grep -q '^three,failed,false,.*three.csv:1: ' whole/cohort.csv || wrong "the table does not say why three failed"
grep -q '^4 subjects, 3 fitted, 1 failed' whole/cohort.txt || wrong "the report"
checks=$((checks + 1))
# A subject's model and errors are those of sonde fit alone, and a leg of 1.2 times the forces is 1.2 times as stiff.
"$SONDE" fit "$in/one.csv" --surface "$data/skin.ply" --sites "$in/sites.csv" --name "leg one" --stages 1 \
  -o "$work/alone.sonde" --json >"$out" 2>"$err" || wrong "sonde fit alone"
cmp -s "$work/alone.sonde" whole/one.sonde || wrong "the model of subject one is not that of sonde fit alone"
python3 - "$out" whole/cohort.csv 2>"$err" <<'PY' || wrong "the table: $(tail -1 "$err")"
import csv, json, sys
alone = json.load(open(sys.argv[1]))
rows = {row["subject"]: row for row in csv.DictReader(open(sys.argv[2]))}
assert list(rows) == ["one", "two", "three", "four"]
assert float(rows["one"]["all_mae_n"]) == alone["all"]["mae_n"] > 0
assert abs(float(rows["two"]["all_mean_force_n"]) / float(rows["one"]["all_mean_force_n"]) - 1.2) < 1e-6
assert rows["three"]["all_mae_n"] == "" and "seconds" not in rows["one"]
PY

# Two shards, the second of which ends first: the last one writes the table and tells of the failure.
gives "shard>=2 shards<=2 made>=2 made<=2 whole=false" fit --cohort "$in/list.csv" -o shards --shard 2/2 --json -- --stages 1
run fit --cohort "$in/list.csv" -o shards --shard 1/2 -- --stages 1
((status == 1)) || wrong "the last shard: exit $status, expected 1"
same shards

# Killed at its second subject, then finished; what was whole stays untouched.
"$SONDE" fit --cohort "$in/list.csv" -o killed -- --stages 1 >"$out" 2>"$err" &
victim=$!
for ((i = 0; i < 3000; ++i)); do
  [[ -e killed/one.json ]] && break
  sleep 0.01
done
kill -9 "$victim"
wait "$victim" 2>/dev/null || true
before=$(stat -c %y killed/one.sonde)
run fit --cohort "$in/list.csv" -o killed -- --stages 1
checks=$((checks + 1))
[[ $(stat -c %y killed/one.sonde) == "$before" ]] || wrong "a whole subject was fitted again"
rm -f killed/.* 2>/dev/null || true
same killed

# Other measurements: that subject alone is fitted again.
part 1.1 >"$in/four.csv"
run fit --cohort "$in/list.csv" -o killed --json -- --stages 1
"$CHECK_JSON" "made>=2" "made<=2" "kept>=2" "kept<=2" whole=true <"$out" || wrong "other measurements"
part 0.9 >"$in/four.csv"

if command -v mpirun >/dev/null; then
  checks=$((checks + 1))
  sed '/^three/d' "$in/list.csv" >"$in/good.csv"
  run fit --cohort "$in/good.csv" -o good -- --stages 1
  ((status == 0)) || wrong "a cohort without failures: exit $status"
  mpirun --allow-run-as-root --oversubscribe -n 2 "$SONDE" fit --cohort "$in/good.csv" -o ranks -- --stages 1 \
    >"$out" 2>"$err" || wrong "mpirun: exit $?"
  grep -q "process 2 of 2: 1 subjects fitted now" "$out" || wrong "the ranks: $(<"$out")"
  diff -rq good ranks >"$err" 2>&1 || wrong "two ranks and one differ: $(<"$err")"
else
  wrong "openmpi-bin is not there, which starts ranks"
fi

rejects "I/N with 1" fit --cohort "$in/list.csv" -o x --shard 3/2
rejects "needs -o DIR" fit --cohort "$in/list.csv"
rejects "does not go behind --" fit --cohort "$in/list.csv" -o x -- --json
rejects "no such file" fit --cohort absent.csv -o x
printf 'subject,measurements\na,b.csv\na,c.csv\n' >"$in/twice.csv"
rejects "twice.csv:3: subject a stands there twice" fit --cohort "$in/twice.csv" -o x
printf 'subject,measurements\n../a,b.csv\n' >"$in/up.csv"
rejects "letters, digits" fit --cohort "$in/up.csv" -o x
printf 'subject,sites\n' >"$in/head.csv"
rejects "one column subject and one column measurements" fit --cohort "$in/head.csv" -o x
printf 'subject,measurements\na\n' >"$in/cells.csv"
rejects "cells.csv:2: 1 cells, expected 2" fit --cohort "$in/cells.csv" -o x
echo "subject,measurements$(printf ',name%.0s' {1..31})" >"$in/wide.csv"
rejects "wide.csv:1: 33 columns, expected at most 32" fit --cohort "$in/wide.csv" -o x
rejects "no folder has an indentation.csv" fit --cohort "$in" -o x
finish
