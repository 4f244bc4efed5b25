#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A unit's provisioning file, from the data partition and from a stick, through plumbd --provision
# to what systemd reads; its recovery; and the appliance's screen.
#   unit_settings.sh BUILD_FOLDER
set -euo pipefail
. "$(dirname "$0")/../support/check.sh"
plumbd=$(realpath "$1/daemon/plumbd") source=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
mkdir -p data/provision state stick bin
printf '#!/bin/sh\nexec %q --state %q "$@"\n' "$plumbd" "$work/state" >bin/plumbd
printf '#!/bin/sh\necho "$@" >>%q\n' "$work/asked" >bin/systemctl
chmod +x bin/*
export PLUMB_DATA=$work/data PLUMB_RUN=$work/run PLUMB_HOST_NAME=$work/host-name \
  PLUMB_PLUMBD=$work/bin/plumbd PATH=$work/bin:$PATH
run() { "$source/systemd/unit-settings" "$@" >out 2>&1 && code=0 || code=$?; }

echo plumb >host-name
run
check "a unit without a file keeps its name" '^0 plumb$' "$code $(cat host-name)"
check "and has the time of UTC" '^/usr/share/zoneinfo/Etc/UTC$' "$(readlink run/plumb-localtime)"
printf '%s\n' '[unit]' 'serial = "PL-1"' 'host_name = "first"' 'time_zone = "America/Bogota"' \
  '[network]' \
  'address = "10.1.1.5/8"' 'time_servers = ["10.1.1.1"]' >data/provision/plumb-provision.toml
run
check "name" '^0 first$' "$code $(cat host-name)"
check "time zone" '^/usr/share/zoneinfo/America/Bogota -0500$' \
  "$(readlink run/plumb-localtime) $(TZ=:$work/run/plumb-localtime date -d @0 +%z)"
check "network" 'Address=10.1.1.5/8' "$(cat run/systemd/network/10-plumb.network)"
check "time servers" 'NTP=10.1.1.1' "$(cat run/systemd/timesyncd.conf.d/10-plumb.conf)"
check "serial number" '^PL-1$' "$(cat data/unit/serial)"
rm -r run
run
check "the next start: not taken over again, but applied" '^0  Address=10.1.1.5/8' \
  "$code $(cat out) $(grep Address run/systemd/network/10-plumb.network)"
printf '[network]\naddress = "10.1.1.5"\n' >data/provision/plumb-provision.toml
run
check "a mistake is reported with its line" \
  'plumb-provision.toml:2: network.address: expected an address with its prefix' "$(cat out)"
check "and the unit keeps what it had" 'Address=10.1.1.5/8' \
  "$(cat run/systemd/network/10-plumb.network)"

printf '[network]\naddress = "10.1.1.5/8"\n[display]\nname = "Room 1"\nkey_file = "display.key"\n' \
  >data/provision/plumb-provision.toml
printf '%063d' 0 >data/provision/display.key
run
check "a display's key that is too short is reported with its line" \
  'plumb-provision.toml:5: display.key_file: .* expected 64 digits .* found 63 characters' \
  "$(cat out)"
check "and nothing is taken over" '^$' "$(ls state)"
printf '%064d\n' 0 >data/provision/display.key
run
check "a display: its name is kept for the owner alone, its key is not" \
  '^0 .* 600 [0-9a-f]{64} Room 1$' \
  "$code $(cat out) $(stat -c %a state/provisioned-display) $(cat state/provisioned-display)"
check "and shown nowhere" '^none$' "$(grep -rq 0000000000 out state || echo none)"

printf '[unit]\nhost_name = "stranger"\n' >stick/plumb-provision.toml
run stick "$work/stick"
check "a stick changes nothing on a unit that has been provisioned" \
  '^0 .*left alone.* first$' "$code $(cat out) $(cat host-name)"
rm -r data
mkdir data
run stick "$work/stick"
check "but a new unit takes it over" '^0 stranger$' "$code $(cat host-name)"
check "and uses it at once" 'restart systemd-networkd.service.*try-restart plumbd.service' \
  "$(tr '\n' ' ' <asked)"
rm -r data stick/plumb-provision.toml
mkdir data
run stick "$work/stick"
check "a stick without a file is no matter" '^0 $' "$code $(cat out)"

# The stick as udev finds it: the folder stage takes the place of its file system.
echo vfat >type
mkdir stage
touch stage/v2.raucb
printf '#!/bin/sh\ncat %q\n' "$work/type" >bin/blkid
printf '#!/bin/sh\nfor place in "$@"; do :; done\ncp %q/* "$place"\n' "$work/stage" >bin/mount
printf '#!/bin/sh\nfor place in "$@"; do :; done\nrm -f "$place"/*\n' >bin/umount
chmod +x bin/*
usb_stick() { "$source/systemd/usb-stick" "$1" sdx1 >out 2>&1 && code=0 || code=$?; }
printf '[network]\naddress = "10.1.1.5"\n' >stage/plumb-provision.toml
usb_stick mount
check "a stick with rejected settings stays mounted" \
  '^0 .*was not taken over.*the stick stays mounted v2.raucb$' \
  "$code $(tr '\n' ' ' <out)$(basename run/plumb-stick/sdx1/*.raucb)"
usb_stick unmount
check "and is unmounted when it is pulled out" '^0 $' "$code $(ls run/plumb-stick)"
echo ntfs >type
usb_stick mount
check "another file system is left alone" '^1 .*left alone' "$code $(cat out)"
usb_stick unmount
check "and there is nothing to unmount" '^0 $' "$code $(cat out)"
rm -r data stage bin/blkid bin/mount bin/umount
mkdir data

cat >bin/grub-editenv <<'SCRIPT'
#!/bin/sh
if [ "$2" = list ]; then cat "$1"; else echo "$3" >>"$1"; fi
SCRIPT
chmod +x bin/grub-editenv
export PLUMB_UNIT_ENV=$work/unitenv PLUMB_MACHINE_ID=$work/machine-id
echo 11111111111111111111111111111111 >machine-id
run
check "without the boot loader's file no machine ID is kept" '^0 $' "$code $(cat out)"
: >unitenv
run
check "the first start's machine ID is kept" '^0 .*kept for the next ones MACHINE_ID=1{32}$' \
  "$code $(cat out unitenv | tr '\n' ' ' | xargs)"
run
check "a start that was handed it over says so" 'is that of the first start' "$(cat out)"
echo 22222222222222222222222222222222 >machine-id
run
check "and one with another ID" '^0 .*not that of the first start.* MACHINE_ID=1{32}$' \
  "$code $(cat out) $(cat unitenv)"
cat >bin/grub-editenv <<'SCRIPT'
#!/bin/sh
case "$2" in
  list) [ -s "$1" ] && cat "$1" ;;
  create) echo created >"$1" ;;
  set) [ -s "$1" ] && echo "$3" >>"$1" ;;
esac
SCRIPT
: >unitenv
run
check "a file that a power cut emptied is written again" \
  '^0 .*kept for the next ones created MACHINE_ID=2{32}$' \
  "$code $(cat out unitenv | tr '\n' ' ' | xargs)"
printf '#!/bin/sh\n[ "$2" = list ]\n' >bin/grub-editenv
run
check "a start goes on where it cannot be kept" '^0 .*cannot be kept' "$code $(cat out)"

cat >bin/grub-editenv <<'SCRIPT'
#!/bin/sh
file=$1 command=$2
shift 2
case "$command" in
  list) [ -s "$file" ] ;;
  create) echo created >"$file" ;;
  set) printf '%s\n' "$@" >>"$file" ;;
esac
SCRIPT
echo "root=PARTLABEL=root-b ro rauc.slot=B quiet" >cmdline
export PLUMB_BOOT_COUNTER=$work/grubenv PLUMB_CMDLINE=$work/cmdline
echo "A_OK=1" >grubenv
run
check "a boot counter that can be read stays" '^0 A_OK=1$' "$code $(cat grubenv)"
: >grubenv
run
check "one that a power cut emptied is replaced for the running system" \
  '^0 .*was replaced: only system B .* created ORDER=B A B_OK=1 B_TRY=1 A_OK=0 A_TRY=0 $' \
  "$code $(cat out grubenv | tr '\n' ' ')"
echo "root=/dev/sda1" >cmdline
: >grubenv
run
check "but not where that is not known" '^0 .*neither be read nor replaced.*0$' \
  "$code $(cat out) $(wc -c <grubenv)"
unset PLUMB_BOOT_COUNTER PLUMB_CMDLINE

mkdir -p data/provision
echo 480 >data/provision/burn-in
printf '#!/bin/sh\necho "$@"\nexit 1\n' >bin/plumb
chmod +x bin/plumb
"$source/systemd/burn-in" >out
report=$(tr '\n' ' ' <data/provision/burn-in.txt)
check "a burn-in that was requested is run" \
  "^doctor --burn-in 480 --burn-in-folder $work/data .*480 minutes: FAILED .exit code 1." "$report"
check "its report is in the journal too" '480 minutes: FAILED' "$(cat out)"
check "and it is not run again" '^burn-in.txt $' "$(ls data/provision | tr '\n' ' ')"
echo 1 >data/provision/burn-in
printf '#!/bin/sh\n' >bin/plumb
"$source/systemd/burn-in" >out
check "one that passes says so" '^burn-in of 1 minutes: passed' "$(cat data/provision/burn-in.txt)"

# Recovery: nothing happens to a unit whose plumbd works (here: another process holds the folder),
# and each file counts once.
printf '[recovery]\nlost_scans = 3\n' >stick/plumb-recovery.toml
: >asked
exec 9<state
flock -x 9
run stick "$work/stick"
check "a stick recovers nothing where plumbd works" \
  '^0 .*nothing was recovered or changed.*not carried out' "$code $(tr '\n' ' ' <out)"
check "and restarts nothing" '^$' "$(cat asked)"
[ ! -e state/scans-are-lost ] || failed=1
exec 9<&-
run stick "$work/stick"
check "in safe mode the number of lost scans is confirmed" '^0 3$' \
  "$code $(cat state/scans-are-lost)"
check "and plumbd starts again" 'restart plumbd.service' "$(tr '\n' ' ' <asked)"
rm state/scans-are-lost
: >asked
run stick "$work/stick"
check "but once" '^0 .*has been carried out' "$code $(cat out)"
check "without another start" '^$' "$(ls state | grep lost)$(cat asked)"
printf '[recovery]\nlost_scans = 1\n' >stick/plumb-recovery.toml
run stick "$work/stick"
check "a mistake of the recovery is reported with its line" \
  'plumb-recovery.toml:2: recovery.lost_scans: expected' "$(cat out)"
rm stick/plumb-recovery.toml
mkdir -p data/provision
printf '[recovery]\nlost_scans = 4\n' >data/provision/plumb-recovery.toml
: >asked
run
check "from the data partition, before plumbd starts" '^0 4 $' \
  "$code $(cat state/scans-are-lost) $(cat asked)"
rm state/scans-are-lost
printf '[recovery]\nlost_scans = 5\n' >data/provision/plumb-recovery.toml
mkdir data/unit/.recovered.new
run
check "nothing is carried out that could not be noted" '^0 .*nothing can be written to' \
  "$code $(cat out)$(ls state | grep lost || true)"
check "and no scan is confirmed" '^$' "$(ls state | grep lost || true)"
rm -r data/unit/.recovered.new data/provision

cat >bin/plumb <<'SCRIPT'
#!/bin/sh
case "$3" in
  state) echo ready ;;
  page.url) echo https://0.0.0.0:8080 ;;
  page.certificate) echo AB:CD ;;
esac
SCRIPT
printf '%s\n' '#!/bin/sh' 'echo "2: eth0 inet 10.1.1.5/8 scope global eth0"' \
  'echo "2: eth0 inet6 fd00::5/64 scope global"' \
  'echo "2: eth0 inet6 2001:db8::5/64 scope global"' >bin/ip
printf '#!/bin/sh\necho "setup code: ABCD-EFGH"\n' >bin/journalctl
printf '#!/bin/sh\ncat %q\n' "$work/session" >bin/curl
chmod +x bin/*
mkdir -p data/unit
echo PL-7 >data/unit/serial
echo "0.2.0 abc" >release
export PLUMB_RELEASE=$work/release
echo '{"setup_required":true}' >session
printf '[recovery]\nrestore = "no-backup"\n' >stick/plumb-recovery.toml
: >asked
run stick "$work/stick"
check "a unit without an account is stopped for it, and started again" \
  '^stop plumbd.socket plumbd.service .*restart plumbd.service $' "$(tr '\n' ' ' <asked)"
check "a backup that is none changes nothing" '^0 .*no-backup cannot be used.*as it was$' \
  "$code $(tr '\n' ' ' <out | sed 's/ $//')"
check "nothing is left of it" '^$' "$(ls -A state | grep -e recovery -e before || true)"
printf '#!/bin/sh\ncase "$1" in --recover) kill -TERM $PPID ;; esac\nexit 1\n' >bin/plumbd-killed
chmod +x bin/plumbd-killed
: >asked
PLUMB_PLUMBD=$work/bin/plumbd-killed run stick "$work/stick"
check "nor does it stay stopped where the stick is pulled out meanwhile" \
  '^1 stop plumbd.socket plumbd.service .*restart plumbd.service $' "$code $(tr '\n' ' ' <asked)"
rm stick/plumb-recovery.toml
screen=$("$source/systemd/console-screen" once)
for line in 'Page         https://10.1.1.5:8080/' 'Page         https://\[fd00::5\]:8080/' \
  'Certificate  AB:CD' 'Serial       PL-7' 'Version      0.2.0' \
  'State        ready' 'enter the setup code: ABCD-EFGH'; do
  check "the screen shows: $line" "$line" "$screen"
done
check "a public IPv6 address, which the sandbox blocks, is not shown" \
  '^none$' "$(grep -q 2001: <<<"$screen" || echo none)"
sed -i s/:8080/:9443/ bin/plumb
check "the screen shows another port" 'https://10.1.1.5:9443/' \
  "$("$source/systemd/console-screen" once)"
echo '{"setup_required":false}' >session
check "with an account no setup code" '^none$' \
  "$("$source/systemd/console-screen" once | grep -q 'setup code' || echo none)"
exit $failed
