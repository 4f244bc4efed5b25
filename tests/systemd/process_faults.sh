#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The real plumbd, without a sensor: a configuration with a mistake, a crash, a limit of the size of
# files.
#   process_faults.sh BUILD_FOLDER
set -euo pipefail
. "$(dirname "$0")/../support/check.sh"
plumbd=$(realpath "$1/daemon/plumbd") plumb=$(realpath "$1/daemon/plumb")
work=$(mktemp -d)
cd "$work"
pid=
trap '[ -z "$pid" ] || kill -KILL "$pid" 2>/dev/null; rm -rf "$work"' EXIT
start() { # OPTIONS...: until it answers
  "$plumbd" --state "$work/state" --control "$work/control" --listen 127.0.0.1:0 "$@" >log 2>&1 &
  pid=$!
  for _ in $(seq 300); do
    "$plumb" --control control status >/dev/null 2>&1 && return
    sleep 0.1
  done
  echo "plumbd does not answer:"; cat log
  exit 1
}
page() { sed -n 's/.*the page is served at \(.*\)$/\1/p' log | tail -1; }

printf '[appliance]\nquotas = 3\n' >wrong.toml
set +e
check "--check-config says what is wrong" 'wrong.toml:2.*quotas' \
  "$("$plumbd" --config wrong.toml --check-config 2>&1)"
"$plumbd" --config wrong.toml --check-config >/dev/null 2>&1
check "and ends with 3" '^3$' "$?"
set -e
start --config wrong.toml
check "a wrong configuration is safe mode" '^fault$' \
  "$("$plumb" --control control status --get state)"
check "the status says why" 'configuration cannot be used.*wrong.toml.*quotas' \
  "$("$plumb" --control control status --get reason)"
check "so does its health" '"status":"[^"]*".*configuration cannot be used.*quotas' \
  "$(curl -sk "$(page)health")"
check "the page says why nobody can log in" \
  '"fault":"[^"]*configuration cannot be used.*quotas' "$(curl -sk "$(page)api/v1/session")"
check "and offers no first account" '"setup_required":false' "$(curl -sk "$(page)api/v1/session")"
check "the page without script says it" 'Out of order.*configuration cannot be used.*quotas' \
  "$(curl -sk "$(page)result")"
check "it is no health" '^503$' "$(curl -sk -o /dev/null -w '%{http_code}' "$(page)health")"
check "a press scans nothing" 'ignored' "$("$plumb" --control control press)"
check "nothing that is stored was touched" '^no database$' \
  "$([ -e state/plumb.db ] || echo "no database")"
kill -TERM "$pid"
wait "$pid" && code=0 || code=$?
check "it ends well" '^0$' "$code"

start
check "without a configuration it works" '^no_sensor$' \
  "$("$plumb" --control control status --get state)"
kill -SEGV "$pid"
wait "$pid" && code=0 || code=$?
pid=
check "a crash ends by its signal" '^139$' "$code"
check "and is reported" \
  'crashed: SIGSEGV, plumbd [0-9.]+, build id [0-9a-f]{40}; the calls:.*plumbd\(.*\+0x' "$(cat log)"
id=$(readelf -nW "$plumbd" | sed -n 's/.*Build ID: //p')
check "with the build id of the program" "$id" "$(cat log)"

rm -rf state
(
  ulimit -f 64
  exec "$plumbd" --state "$work/state" --control "$work/control2" --listen 127.0.0.1:0 >log 2>&1
) &
pid=$!
for _ in $(seq 300); do "$plumb" --control control2 status >status 2>&1 && break; sleep 0.1; done
check "files that may not grow are a fault, no end" 'state +(fault|no_sensor)' "$(cat status)"
kill -TERM "$pid"
wait "$pid" && code=0 || code=$?
pid=
check "it ends well again" '^0$' "$code"
exit $failed
