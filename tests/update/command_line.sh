#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# `plumb update` with the real plumbd and RAUC itself, on a bus and a machine made of files: a good
# bundle, each bad one with its own sentence, the restart, and a machine that starts the previous
# system.
#   command_line.sh BUILD_FOLDER
set -euo pipefail
. "$(dirname "$0")/../support/check.sh"
. "$(dirname "$0")/../support/left_out.sh"
require rauc dbus-daemon openssl
[ "$(id -u)" = 0 ] && [ -w /dev/loop-control ] ||
  skip "needs root and loop devices: RAUC mounts bundles"
plumbd=$(realpath "$1/daemon/plumbd") plumb=$(realpath "$1/daemon/plumb") \
  here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
cd "$work"
pids=
trap 'kill -KILL $pids 2>/dev/null; rm -rf "$work"' EXIT
mkdir machine
"$here/make_bundles.sh" machine >made 2>&1 || { cat made; exit 1; }
# A signer whose certificate ends before the bundle is installed.
mkdir -p short/content
cat >short/ca.conf <<CONF
[ca]
default_ca=own
[own]
database=short/index
serial=short/serial
new_certs_dir=short
default_md=sha256
policy=any
[any]
commonName=supplied
CONF
: >short/index
echo 01 >short/serial
{
  openssl req -newkey rsa:2048 -nodes -subj "/CN=short" -keyout short/key -out short/csr
  ends=$(($(date +%s) + 10))
  openssl ca -batch -config short/ca.conf -in short/csr -out short/pem \
    -cert machine/pki/own-ca.pem \
    -keyfile machine/pki/own-ca.key -startdate "$(date -u -d '-1 hour' +%Y%m%d%H%M%SZ)" \
    -enddate "$(date -u -d "@$ends" +%Y%m%d%H%M%SZ)" -extfile <(
      printf '%s\n' basicConstraints=CA:FALSE keyUsage=digitalSignature extendedKeyUsage=codeSigning
    )
  cp machine/good.img short/content/rootfs.img
  printf '%s\n' '[update]' compatible=plumb-test version=9.1.0 '' '[bundle]' format=plain '' \
    '[image.rootfs]' filename=rootfs.img >short/content/manifest.raucm
  rauc --cert=short/pem --key=short/key bundle short/content machine/expired.raucb
} >made 2>&1 || { cat made; exit 1; }
cat >bus.conf <<CONF
<!DOCTYPE busconfig PUBLIC "-//freedesktop//DTD D-BUS Bus Configuration 1.0//EN"
 "http://www.freedesktop.org/standards/dbus/1.0/busconfig.dtd">
<busconfig><type>session</type><listen>unix:path=$work/bus</listen>
<policy context="default"><allow send_destination="*" eavesdrop="true"/><allow eavesdrop="true"/>
<allow own="*"/></policy></busconfig>
CONF
export DBUS_SYSTEM_BUS_ADDRESS=unix:path=$work/bus DBUS_STARTER_BUS_TYPE=system
dbus-daemon --nofork --config-file=bus.conf >bus.log 2>&1 & pids="$pids $!"
# The socket exists a moment before the bus listens: wait until it answers.
for _ in $(seq 100); do
  dbus-send --bus="unix:path=$work/bus" / org.freedesktop.DBus.Peer.Ping 2>/dev/null && break
  sleep 0.05
done
rauc --conf=machine/system.conf service --override-boot-slot=A >rauc.log 2>&1 & pids="$pids $!"

start() { # BOOT
  PLUMB_BOOT_ID=$1 "$plumbd" --state "$work/state" --control "$work/control" \
    --listen 127.0.0.1:0 >log 2>&1 &
  daemon=$!
  pids="$pids $daemon"
  for _ in $(seq 300); do
    "$plumb" --control control status >/dev/null 2>&1 && return
    sleep 0.1
  done
  echo "plumbd does not answer:"; cat log
  exit 1
}
run() { "$plumb" --control control update "$@" >out 2>&1 && code=0 || code=$?; }
seen() { echo "$code $(tr '\n' ' ' <out)"; }

run machine/good.raucb
check "no plumbd" '^5 .*cannot reach plumbd' "$(seen)"
start one
for _ in $(seq 50); do run machine/other.raucb; grep -q 'no program that installs' out || break; sleep 0.1; done
check "another machine" "^5 .*for another machine: it is for 'plumb-other-machine'" "$(seen)"
run machine/older.raucb
check "an older version" '^5 .*older than 0\.' "$(seen)"
run machine/stranger.raucb
check "a stranger's key" '^3 .*not signed by a key that this machine trusts' "$(seen)"
run machine/damaged.raucb
check "a damaged one" '^3 .*damaged on its way' "$(seen)"
run machine/truncated.raucb
check "half of one" '^3 .*truncated.raucb' "$(seen)"
check "none of them has touched a system" '^same$' \
  "$(cmp -s machine/slots/a.img machine/slots/b.img && echo same)"
run "$work"
check "a folder" '^3 .*not a regular file' "$(seen)"
run machine/none.raucb
check "a file that is missing" '^3 .*none.raucb cannot be read' "$(seen)"
cp machine/good.raucb notes.txt
run notes.txt
check "a file of another name" '^3 .*ends with .raucb' "$(seen)"
run
check "nothing at all" '^2 ' "$(seen)"
check "nothing is left of the refused ones" '^0$' "$(find state/updates -type f | wc -l)"

run machine/good.raucb --restart
check "a good one is installed" 'good.raucb is installed and starts at the next restart' "$(seen)"
check "and written to the other system" '^same$' \
  "$(cmp -s -n 1500000 machine/good.img machine/slots/b.img && echo same)"
check "a machine without logind says that it cannot restart" \
  '^5 .*cannot be restarted from here' "$(seen)"
for time in second third fourth fifth; do
  run machine/good.raucb
  check "a $time time" '^0 .*is installed' "$(seen)"
done
check "their copies are removed" '^0$' "$(find state/updates -name '*.raucb' | wc -l)"
# The time itself: the bundle comes after the end of its signer's certificate.
while [ "$(date +%s)" -le "$ends" ]; do sleep 0.2; done
check "the signer's certificate has ended" '^no$' \
  "$(openssl x509 -in short/pem -noout -checkend 0 >checkend && echo yes || echo no)"
run machine/expired.raucb
check "it was valid when the bundle was signed: the machine's clock does not count" \
  '^0 .*is installed' "$(seen)"

kill -TERM $daemon
wait $daemon || true
start two # the same system, though the other was installed
for _ in $(seq 50); do
  said=$("$plumb" --control control status --get rolled_back)
  [ -z "$said" ] || break
  sleep 0.1
done
check "a machine that starts the previous system says so" \
  'version 9.1.0 was installed, but the machine has gone back' "$said"
check "in the journal too" 'gone back to the previous system' "$(cat log)"
exit $failed
