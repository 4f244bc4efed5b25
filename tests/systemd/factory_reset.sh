#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A factory reset outside the image: the command line asks for it, the unit's script and plumbd
# carry it out at the next start.
#   factory_reset.sh BUILD_FOLDER
set -euo pipefail
. "$(dirname "$0")/../support/check.sh"
plumb=$(realpath "$1/daemon/plumb") plumbd=$(realpath "$1/daemon/plumbd") \
  source=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
cd "$work"
pid=
trap '[ -z "$pid" ] || kill -KILL $pid 2>/dev/null; rm -rf "$work"' EXIT
PLUMB_GROUP=$(id -g)
mkdir -p bin data/journal
printf '#!/bin/sh\necho "$*" >>%s/journalctl.calls\n' "$work" >bin/journalctl
chmod +x bin/journalctl
: >journalctl.calls
export PATH=$work/bin:$PATH PLUMB_DATA=$work/data
export PLUMB_STATE=$work/state PLUMB_ETC=$work/etc PLUMB_DELIVERED=$source/toolchain/plumb.toml \
  PLUMB_GROUP PLUMB_RECEIVED=$work/received
start() {
  "$source/systemd/factory-reset" >reset.log 2>&1
  "$plumbd" --state state --control control --listen 127.0.0.1:0 >log 2>&1 &
  pid=$!
  for _ in $(seq 300); do
    "$plumb" --control control status >/dev/null 2>&1 && return
    sleep 0.1
  done
  echo "plumbd does not answer:"; cat log
  exit 1
}
end() { kill $pid; wait $pid || true; pid=; }
configure() {
  mkdir -p etc
  printf '# changed\n' >etc/plumb.toml
  echo secret >etc/backup.key
}
start
setup=$(grep -o 'setup code: .*' log)
port=$(grep -o '127.0.0.1:[0-9]*' log | head -1)
first="{\"code\":\"${setup#setup code: }\",\"name\":\"eva\","
first+='"password":"correct horse battery 7"}'
curl -sk -m 20 -H 'Content-Type: application/json' -d "$first" \
  "https://$port/api/v1/setup" >setup.out ||
  curl -s -m 20 -H 'Content-Type: application/json' -d "$first" \
    "http://$port/api/v1/setup" >setup.out
end
mkdir -p state/scans state/calibration
echo data >state/calibration/S1.yaml
mkdir -p received/study
echo image >received/study/1.dcm
start
check "with an account there is no setup code" '^0$' "$(grep -c 'setup code' log || true)"
end
configure
start
check "without a request nothing is touched" '^# changed secret$' \
  "$(cat etc/plumb.toml etc/backup.key | xargs -d '\n')"
end

"$plumb" factory-reset --wipe --state state >out 2>&1 && code=0 || code=$?
check "not without --yes" '^2 .*--yes' "$code $(cat out)"
"$plumb" factory-reset --wipe --keep-records --yes --state state >out 2>&1 && code=0 || code=$?
check "nor both kinds" '^2$' "$code"
"$plumb" factory-reset --wipe --yes --state "$work/none" >out 2>&1 && code=0 || code=$?
check "nor in a folder that is missing" '^3 .*none' "$code $(cat out)"
check "none of these asked for anything" '^missing$' \
  "$([ -e state/factory-reset.json ] || echo missing)"

"$plumb" factory-reset --keep-records --yes --state state >out
check "it says when it is carried out" 'next start of plumbd' "$(cat out)"
start
check "the configuration is the delivered one" '^same # changed secret$' \
  "$(cmp etc/plumb.toml "$PLUMB_DELIVERED" && echo same) $(cat etc/plumb.toml.before-reset \
    etc/backup.key | xargs -d '\n')"
check "the accounts are gone" 'setup code: ....-....' "$(cat log)"
check "it is logged" 'factory reset: records kept; 1 account,' "$(cat log)"
check "the journal is kept" '^$' "$(cat journalctl.calls)"
check "what belongs to the sensor stays" '^data$' "$(cat state/calibration/S1.yaml)"
check "what was received stays" '^image$' "$(cat received/study/1.dcm)"
check "the request is done" '^missing$' "$([ -e state/factory-reset.json ] || echo missing)"
end
configure
start
check "and not carried out again" '^# changed$' "$(cat etc/plumb.toml)"
end

"$plumb" factory-reset --wipe --yes --state state >out
start
check "wiped: the configuration folder" '^plumb.toml$' "$(ls -A etc)"
check "wiped: the journal" '^-q --rotate --vacuum-time=1s$' "$(cat journalctl.calls)"
check "wiped: the sensor's files" '^missing$' "$([ -e state/calibration/S1.yaml ] || echo missing)"
check "wiped: what was received, but not its folder" '^empty$' \
  "$([ -d received ] && [ -z "$(ls -A received)" ] && echo empty)"
check "wiped: it is logged" 'factory reset: everything that was stored has been removed' \
  "$(cat log)"
check "wiped: a new setup code is made" 'setup code: ....-....' "$(cat log)"
end

configure
echo '{"kind":"half"}' >state/factory-reset.json
start
check "a request that cannot be read resets nothing" '^# changed$' "$(cat etc/plumb.toml)"
check "and plumbd runs and says so" \
  "cannot be read: .*expected the kind keep_records or wipe, found 'half'" "$(cat log)"
end
exit $failed
