# Shared by the tests of the program. Expects SONDE, CHECK_JSON, HOLD_PORT, MODEL, DATA in the
# environment; leaves the caller in an empty directory of its own.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/in" "$work/out"
cd "$work/out"
out=$work/stdout err=$work/stderr
bad=0 checks=0

wrong() {
  echo "WRONG: $1"
  sed 's/^/    stderr: /' "$err" | tail -5
  bad=$((bad + 1))
}

run() { # ARGUMENTS: runs sonde, keeps its output, sets status
  status=0
  timeout 900 "$SONDE" "$@" >"$out" 2>"$err" </dev/null || status=$?
}

# A fingerprint of everything that a command might have touched: names of all, size, number and times of files.
fingerprint() { find "$work/out" "$work/in" \( -type f -printf '%p %s %i %T@ %C@\n' \) -o -printf '%p %y %l\n'; }

# rejects WORD ARGUMENTS: sonde exits with 2, says WORD on stderr, prints nothing and writes nothing.
rejects() {
  local word=$1 before
  shift
  checks=$((checks + 1))
  before=$(fingerprint)
  run "$@"
  ((status == 2)) || wrong "sonde $*: exit $status, expected 2"
  grep -qiE -- "$word" "$err" || wrong "sonde $*: stderr does not say '$word'"
  [[ ! -s $out ]] || wrong "sonde $*: printed something on stdout"
  [[ $(fingerprint) == "$before" ]] || wrong "sonde $*: left something behind: $(ls -A "$work/out")"
}

# gives "CHECKS" ARGUMENTS: sonde exits with 0 and prints one JSON object that keeps the checks.
gives() {
  local list=$1
  shift
  checks=$((checks + 1))
  run "$@"
  ((status == 0)) || { wrong "sonde $*: exit $status, expected 0"; return; }
  # shellcheck disable=SC2086 # the checks are words
  "$CHECK_JSON" $list <"$out" || wrong "sonde $*: JSON"
}

finish() {
  echo "$checks checks, $bad wrong"
  ((checks > 0 && bad == 0))
}
