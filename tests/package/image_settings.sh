#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# What toolchain/image.overlay puts into a root file system, read by systemd's own tools: mounts and
# units. Needs neither root nor a Debian: the root is a few empty files. Exit code 77: it
# cannot run here, and the last line says why.
set -euo pipefail
. "$(dirname "$0")/../support/check.sh"
source=$(cd "$(dirname "$0")/../.." && pwd)
. "$source/tests/support/left_out.sh"
generator=/usr/lib/systemd/system-generators/systemd-fstab-generator
[ -x $generator ] || skip "needs systemd's fstab generator"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
mkdir -p bin root/{boot,etc,var/lib/dpkg} out/{normal,early,late}
touch root/boot/{vmlinuz-6.1,initrd.img-6.1} root/var/lib/dpkg/status ca.pem
cat >bin/chroot <<'SCRIPT'
#!/bin/sh
shift
case "$*" in
  "id -u plumb" | "id -g plumb") echo "${PLUMB_TEST_ID:-500}" ;;
  "id -u plumb-dicom" | "id -g plumb-dicom") echo "${PLUMB_TEST_DICOM_ID:-501}" ;;
esac
SCRIPT
chmod +x bin/chroot
export PATH=$work/bin:$PATH
overlay() {
  "$source/toolchain/image.overlay" root 0.2.0 ca.pem amd64 >log 2>&1 && code=0 || code=$?
}
PLUMB_TEST_ID=997 overlay
check "an account with another number is refused" '^1 .*not the number 500' "$code $(cat log)"
PLUMB_TEST_DICOM_ID=998 overlay
check "so is the receiver's" '^1 .*plumb-dicom has not the number 501' "$code $(cat log)"
overlay
check "the settings are made" '^0 $' "$code $(cat log)"

export SYSTEMD_FSTAB=$PWD/root/etc/fstab
export SYSTEMD_PROC_CMDLINE="root=PARTLABEL=root-a ro systemd.volatile=state"
$generator out/normal out/early out/late
check "a start needs its own partitions, and no other disk" \
  "^boot-efi.mount data.mount etc-plumb.mount tmp.mount var-lib-plumb.mount \
var-log-journal.mount \$" \
  "$(ls out/normal/local-fs.target.requires | tr '\n' ' ')"
check "nor does it wait for one" '^$' "$(find out/normal/local-fs.target.wants -name "*backup*")"
received=$(cat out/normal/var-lib-plumb*dicom.mount)
check "what is received lies on the data partition" \
  'What=/data/dicom.*Where=/var/lib/plumb-dicom' "$(tr '\n' ' ' <<<"$received")"
check "and is mounted once its folder is made" 'After=systemd-tmpfiles-setup.service' "$received"
mount=$(systemd-escape -p --suffix=mount /var/lib/plumb-dicom)
for order in Wants After; do
  check "plumbd, and a wipe before it, wait for that folder: $order" "^there$" \
    "$(sed '/^.Service/,$d' root/etc/systemd/system/plumbd.service.d/appliance.conf |
      grep -qxF "$order=$mount" && echo there)"
done
backup=$(cat out/normal/var-lib-plumb*backup.mount)
check "a disk for backups is found by its label" \
  'What=/dev/disk/by-label/plumb-backup.*Where=/var/lib/plumb-backup' "$(tr '\n' ' ' <<<"$backup")"
check "nothing on it is run" 'nosuid,nodev,noexec' "$backup"
rules=$(cat root/etc/udev/rules.d/*.rules)
check "it is mounted whenever it is plugged in" \
  'plumb-backup".*SYSTEMD_WANTS}[+]="plumb-backup-disk.service"' "$rules"
for label in $(grep -oE 'GOTO="[a-z_]+"' <<<"$rules" | cut -d'"' -f2 | sort -u); do
  check "the rules have the label $label" "LABEL=\"$label\"" "$rules"
done
named=$(grep -oE 'plumb-[a-z-]+@?[$a-z]*\.service' <<<"$rules" | sed 's/@.*/@.service/' | sort -u)
check "rules name services" \
  'plumb-backup-disk.service.*plumb-stick@.service' "$(tr '\n' ' ' <<<"$named")"
for unit in $named; do
  check "$unit is there" "^there$" "$([ -s "root/etc/systemd/system/$unit" ] && echo there)"
done
check "fsck repairs the data partition without prompting" ' fsck.repair=yes ' \
  "$(grep 'set CMD=' "$source/toolchain/image.grub.cfg")"
check "plumbd may not mark a system" '^send_member="InstallBundle" send_member="Info" $' \
  "$(grep -oE 'rauc.Installer".*send_member="[A-Za-z]*"' \
    root/usr/share/dbus-1/system.d/plumb-rauc.conf |
    grep -oE 'send_member="[A-Za-z]*"' | tr '\n' ' ')"
check "a wrong clock refuses no update" \
  'use-bundle-signing-time=true' "$(cat root/etc/rauc/system.conf)"
units=(root/etc/systemd/system/plumb-*.service)
check "units" '^[4-9]$' "${#units[@]}"
complaints=$(systemd-analyze verify --man=no --recursive-errors=no "${units[@]}" 2>&1 |
  grep -E 'Unknown|Failed to parse|Invalid|ignoring|Missing' || true)
check "are well-formed" '^$' "$complaints"
exit $failed
