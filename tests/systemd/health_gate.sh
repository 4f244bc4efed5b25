#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The health gate with programs of the test's own around it: only a healthy system is marked, each
# fault has its sentence, and only a release that has never been good is left.
#   health_gate.sh BUILD_FOLDER      plumb of the build does the self test
set -euo pipefail
. "$(dirname "$0")/../support/check.sh"
gate=$(cd "$(dirname "$0")/../../systemd" && pwd)/health-gate plumb=$(realpath "$1/daemon/plumb")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
mkdir bin state gate
for program in systemctl curl rauc; do
  printf '#!/bin/sh\necho "%s $*" >>%s/calls\n. %s/%s\n' $program "$work" "$work" $program \
    >bin/$program
done
ln -s "$plumb" bin/plumb
chmod +x bin/systemctl bin/curl bin/rauc
echo "0.2.0 one" >release
export PATH=$work/bin:$PATH PLUMB_STATE=$work/state PLUMB_GATE_STATE=$work/gate \
  PLUMB_RELEASE=$work/release PLUMB_GATE_WAIT=2 PLUMB_GATE_FRAMES=30
healthy() {
  : >calls
  rm -rf gate/*
  echo '[ "$1" = is-active ] && { [ "$2" = --quiet ] || echo active; }; true' >systemctl
  echo 'case "$*" in *https*) exit 35 ;; esac; echo "{\"status\":\"ok\"}"' >curl
  echo true >rauc
  export PLUMB_GATE_SELF_TEST=no
}
run() { # with the unit's UMask=
  (umask 077 && "$gate" "$@" >log 2>&1) && code=0 || code=$?
}
is_marked() { grep -c 'rauc status mark-good' calls || true; }

healthy
PLUMB_GATE_SELF_TEST=yes run
check "a healthy system with its self test" '^0 1 0.2.0 one$' "$code $(is_marked) $(cat gate/good)"
run roll-back
check "a release that was good is not left" '^0 $' "$code $(grep reboot calls || true)"
check "nor by the boot loader at a later start" '^2$' "$(is_marked)"
echo "0.2.1 two" >release
run roll-back
check "a new one is, and the boot loader takes the other at once" \
  '^0 rauc status mark-bad systemctl --no-block reboot $' \
  "$code $(grep -E 'reboot|mark-bad' calls | tr '\n' ' ')"
echo 'exit 1' >rauc
run roll-back
check "also where RAUC cannot mark it" '^0 .*cannot mark this system as bad' "$code $(cat log)"
check "the machine restarts then too" 'reboot' "$(tail -1 calls)"

# The database that this release has converted is no use for the system before.
convert() {
  rm -rf state/*
  mkdir state/before-checksums
  echo old >state/before-checksums/plumb.db
  for file in plumb.db plumb.db-wal plumb.db-mark plumb.db-seals rows.key; do
    echo new >"state/$file"
  done
  mkdir -p state/scans/000001 state/scans/000002
}
convert
: >calls
echo true >rauc
run roll-back
check "the system before gets its own database, and nothing starts this one again" \
  '^old old=new systemctl stop plumbd.socket plumbd.service$' \
  "$(cat state/plumb.db) old=$(cat state/before-restore-1/plumb.db) $(head -1 calls)"
check "and nothing that goes with the other" '^before-restore-1 plumb.db restored.json scans $' \
  "$(cd state && echo * | tr '\n' ' ')"
check "what was stored since stays" '^plumb.db plumb.db-mark plumb.db-seals plumb.db-wal rows.key $' \
  "$(cd state/before-restore-1 && echo * | tr '\n' ' ')"
check "it is noted as restored, for the log of the database that is back" \
  "^\\{\"backup\": \"$work/state/before-checksums/plumb.db\", \"sha256\": \"$(
    echo old | sha256sum | cut -d' ' -f1)\", \"scans\": 2, \"time\": [0-9]{16}\\}$" \
  "$(cat state/restored.json)"
check "plumbd's account, which is not root, can read that" '^644$' "$(stat -c %a state/restored.json)"
run roll-back
check "once" '^old$' "$(cat state/plumb.db)"
# PROGRAM OF_WHAT: fails once for a first argument of that pattern, and works otherwise.
failing() {
  rm -rf has-failed
  printf '#!/bin/sh\ncase "$1" in %s) mkdir %s/has-failed 2>/dev/null && exit 1 ;; esac\n' \
    "$2" "$work" >"bin/$1"
  printf 'exec /bin/%s "$@"\n' "$1" >>"bin/$1"
  chmod +x "bin/$1"
}
unchanged='before-checksums plumb.db plumb.db-mark plumb.db-seals plumb.db-wal rows.key scans'
for fault in "mv */state/plumb.db-seals" "mv */state/rows.key" "sync */restored.json" \
  "mv */before-checksums/plumb.db" "mv */before-checksums/plumb.db-since" \
  "mv */before-checksums"; do
  convert
  set -f; failing $fault; set +f
  run put-back
  check "what cannot be put back as a whole stays as it was ($fault)" \
    "^1 new old $unchanged \$" \
    "$code $(cat state/plumb.db state/before-checksums/plumb.db | xargs) $(
      cd state && echo * | tr '\n' ' ')"
  rm bin/mv bin/sync 2>/dev/null || true
  run put-back
  check "until it can be ($fault)" '^0 old new before-restore-1 plumb.db restored.json scans $' \
    "$code $(cat state/plumb.db state/before-restore-1/plumb.db | xargs) $(
      cd state && echo * | tr '\n' ' ')"
done
convert
touch state/before-checksums/good
run roll-back
check "a release that has been good keeps what it stored" '^new$' "$(cat state/plumb.db)"
convert
: >calls
run put-back
check "a package of the version before gets it, and nothing restarts" \
  '^0 old systemctl stop plumbd.socket plumbd.service$' "$code $(cat state/plumb.db calls | xargs)"
rm -rf state/*

rm gate/good
: >calls
run roll-back
check "on a machine where none was good, none is left" '^0 $' "$code $(cat calls)"

refused() { # NAME SENTENCE
  run
  check "$1" "^1 0 not marked good: $2" "$code $(is_marked) $(grep 'not marked' log || true)"
  check "$1: nothing is remembered" '^none$' "$([ -e gate/good ] || echo none)"
}
healthy; echo 'exit 7' >curl
refused "no page" "the page does not answer on port 8080"
healthy; echo '[ "$2" = --quiet ] && exit 3; echo failed' >systemctl
refused "no service" "plumbd.service is failed"
healthy; echo 'echo "{\"status\":\"failed\",\"reason\":\"storage: no\"}"' >curl
refused "a fault of the storage" "the page reports: .*storage: no"
healthy
PLUMB_STATE=$work/none refused "a state folder that cannot be written" "nothing can be written to"
healthy; rm bin/plumb
printf '#!/bin/sh\necho "out of memory"; exit 1\n' >bin/plumb
chmod +x bin/plumb
PLUMB_GATE_SELF_TEST=yes refused "a self test that fails" "the self test failed: out of memory"
healthy
printf '%s\n' '#!/bin/sh' 'mkdir -p "$5" 2>/dev/null' \
  '[ "$1" != compare ] || echo "{\"verdict\": \"in_tolerance\"}" >"$5/result.json"' >bin/plumb
PLUMB_GATE_SELF_TEST=yes refused "a self test with a wrong answer" "the self test's body moved"
healthy; echo 'exit 1' >rauc
run
check "RAUC refuses" '^1 .*RAUC cannot mark' "$code $(cat log)"

healthy
echo 'echo x >>asked
[ "$(wc -l <asked)" -gt 3 ] && echo "{\"status\":\"ok\"}" ||
  echo "{\"status\":\"failed\",\"reason\":\"storage: no\"}"' >curl
PLUMB_GATE_WAIT=10 run
check "a storage fault that goes away" '^0 1$' "$code $(is_marked)"

healthy
mkdir state/before-checksums
run
check "a good release will not go back to the older database" '^0 yes$' \
  "$code $([ -e state/before-checksums/good ] && echo yes)"
rm -r state/before-checksums

healthy; echo 'echo "{\"status\":\"failed\",\"reason\":\"sensor: unplug it\"}"' >curl
run
check "a fault of the sensor is not the release's" '^0 1$' "$code $(is_marked)"
healthy
printf '[web]\nlisten = "0.0.0.0:9443"\n' >plumb.toml
PLUMB_CONFIG=$work/plumb.toml run
check "the configured port is asked" '127.0.0.1:9443/health' "$(cat calls)"
exit $failed
