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
held=
# Nobody may remove what is in a folder that is held, not even root.
hold() { held=$1; if [ "$(id -u)" = 0 ]; then chattr +i "$1"; else chmod a-w "$1"; fi; }
release() {
  [ -z "$held" ] || if [ "$(id -u)" = 0 ]; then chattr -i "$held"; else chmod u+w "$held"; fi
  held=
}
trap '[ -z "$pid" ] || kill -KILL $pid 2>/dev/null; release; rm -rf "$work"' EXIT
PLUMB_GROUP=$(id -g)
mkdir -p bin data/journal/{this,earlier}
printf '#!/bin/sh\necho "$*" >>%s/journalctl.calls\n' "$work" >bin/journalctl
# plumb-dicomd: a file "runs" stands for the process, and what was received is listed as it stops.
cat >bin/systemctl <<SCRIPT
#!/bin/sh
echo "\$*: \$(ls $work/received | xargs)" >>$work/systemctl.calls
case "\$1" in
  stop) [ -e $work/sticks ] || rm -f $work/runs ;;
  is-active) [ -e $work/runs ] ;;
esac
SCRIPT
chmod +x bin/*
: >journalctl.calls
: >systemctl.calls
echo this >machine-id
export PATH=$work/bin:$PATH PLUMB_DATA=$work/data PLUMB_PLUMBD=$plumbd \
  PLUMB_MACHINE_ID=$work/machine-id
export PLUMB_STATE=$work/state PLUMB_ETC=$work/etc PLUMB_DELIVERED=$source/toolchain/plumb.toml \
  PLUMB_GROUP PLUMB_RECEIVED=$work/received
reset() { "$source/systemd/factory-reset" >reset.log 2>&1; }
start() { # how plumbd finds its state folder
  [ $# -gt 0 ] || set -- --state state
  reset
  "$plumbd" "$@" --control control --listen 127.0.0.1:0 >log 2>&1 &
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
check "the receiver goes on" '^$' "$(cat systemctl.calls)"
check "what belongs to the sensor stays" '^data$' "$(cat state/calibration/S1.yaml)"
check "what was received stays" '^image$' "$(cat received/study/1.dcm)"
check "the request is done" '^missing$' "$([ -e state/factory-reset.json ] || echo missing)"
end
configure
start
check "and not carried out again" '^# changed$' "$(cat etc/plumb.toml)"
end

# As plumb-dicomd names them; one more spool was in use before the reset that kept the records.
received=20260301-093000-0123456789abcdef
mkdir -p "spool two" before data/dicom link-to
for folder in "spool two" before data/dicom; do
  touch "$folder/$received".{dcm,json,part} "$folder/else.dcm"
done
printf '[dicom]\nspool = "%s"\nnone =\n' "$work/spool two" >etc/plumb.toml # no valid TOML
printf '[dicom]\nspool = "%s"\n' "$work/before" >etc/plumb.toml.before-reset
touch runs
"$plumb" factory-reset --wipe --yes --state state >out
start
check "wiped: nothing is received any more while it is removed" \
  '^stop plumb-dicomd.service: study$' "$(head -1 systemctl.calls)"
check "wiped: the receiver starts afterwards" '^--no-block start plumb-dicomd.service: $' \
  "$(tail -1 systemctl.calls)"
check "wiped: received files in other folders, and no other files there" \
  '^before/else.dcm data/dicom/else.dcm spool two/else.dcm $' \
  "$(find before data/dicom "spool two" -type f | sort | tr '\n' ' ')"
check "wiped: the journal of an earlier machine ID" '^this$' "$(ls data/journal)"
check "wiped: the configuration folder" '^plumb.toml$' "$(ls -A etc)"
check "wiped: the journal" '^-q --rotate --vacuum-time=1s$' "$(cat journalctl.calls)"
check "wiped: the sensor's files" '^missing$' "$([ -e state/calibration/S1.yaml ] || echo missing)"
check "wiped: what was received, but not its folder" '^empty$' \
  "$([ -d received ] && [ -z "$(ls -A received)" ] && echo empty)"
check "wiped: it is logged" 'factory reset: everything that was stored has been removed' \
  "$(cat log)"
check "wiped: a new setup code is made" 'setup code: ....-....' "$(cat log)"
end

# Something cannot be removed: the rest is, and no start says that all was.
wipe_while_held() { # FOLDER
  configure
  mkdir -p received/study state/scans/000001 state/profiles
  touch received/study/2.dcm state/scans/000001/x state/profiles/x before/"$received".dcm
  printf '[dicom]\nspool = "%s"\n' "$work/before" >etc/plumb.toml
  "$plumb" factory-reset --wipe --yes --state state >out
  hold "$1"
  start
}
say_it_remains() { # WHAT FILE
  check "held, $1: it is said" "cannot remove $2.*goes on at the next start" \
    "$("$plumb" --control control status)"
  check "held, $1: and not that all was removed" '^0$' "$(grep -c 'has been removed' log || true)"
  check "held, $1: the request stays" '^there$' "$([ -f state/factory-reset.json ] && echo there)"
  check "held, $1: what plumbd stores is removed" '^$' \
    "$(ls state | grep -E 'plumb.db|profiles' || true)"
}
expect_all_gone() { # WHAT
  check "$1: all is removed" 'everything that was stored has been removed' "$(cat log)"
  check "$1: and nothing of it is left" '^plumb.toml before/else.dcm$' \
    "$(ls -A etc received | grep -v : | xargs) $(find before -type f)"
  check "$1: the notes are gone" '^$' "$(ls -A state | grep -E 'left|factory' || true)"
}
for one in received/study before state/scans/000001; do
  wipe_while_held $one
  say_it_remains $one "$work/${one%/study}"
  check "held, $one: keys are removed" '^plumb.toml$' "$(ls etc)"
  end
  start
  say_it_remains "$one, again" "$work/${one%/study}"
  end
  release
  start
  expect_all_gone "$one, released"
  end
done
touch runs sticks
"$plumb" factory-reset --wipe --yes --state state >out
start
say_it_remains "a receiver that does not stop" "$work/received"
end
rm sticks
start
expect_all_gone "a receiver that stops"
end
rm -rf received
ln -s "$work/none" received
"$plumb" factory-reset --wipe --yes --state state >out
start
say_it_remains "a link whose disk is not there" "$work/received"
end
mkdir none
touch none/image
start
expect_all_gone "a link to a disk"
end
# A program that reads no configuration: where files lie is not known, so that it is kept.
configure
"$plumb" factory-reset --wipe --yes --state state >out
PLUMB_PLUMBD=false start
say_it_remains "a configuration that cannot be read" "$work/etc"
check "it is not removed" '^# changed$' "$(cat etc/plumb.toml)"
end
start
end

check "the receiver starts after plumbd, which a wipe is part of" '^After=plumbd.service$' \
  "$(grep -x 'After=plumbd.service' "$source/systemd/plumb-dicomd.service.in")"
# A state folder of its own, which only the configuration names.
unset PLUMB_STATE
own="$work/el\"se where"
for kind in keep-records wipe; do
  configure
  mkdir -p "$own/calibration"
  echo data >"$own/calibration/S1.yaml"
  printf '[appliance]\nstate = %s\n' "'$own'" >etc/plumb.toml
  "$plumb" factory-reset --$kind --yes --state "$own" >out
  start --config etc/plumb.toml
  check "$kind where the state folder is another: the configuration is delivered, but for that" \
    '^1 1$' "$(diff etc/plumb.toml "$PLUMB_DELIVERED" | grep -c '^[<>]' || true) $(
      diff etc/plumb.toml "$PLUMB_DELIVERED" | grep -c '^< state = ' || true)"
  check "$kind: the request there is done" '^missing$' \
    "$([ -e "$own/factory-reset.json" ] || echo missing)"
  check "$kind: it is logged" 'factory reset: ' "$(cat log)"
  end
done
check "and all that lay there is gone" '^missing$' "$([ -e "$own/calibration" ] || echo missing)"
export PLUMB_STATE=$work/state

configure
echo '{"kind":"half"}' >state/factory-reset.json
start
check "a request that cannot be read resets nothing" '^# changed$' "$(cat etc/plumb.toml)"
check "and plumbd runs and says so" \
  "cannot be read: .*expected the kind keep_records or wipe, found 'half'" "$(cat log)"
end
exit $failed
