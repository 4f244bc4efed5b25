#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A machine for RAUC made of files, its certificate authority, the one that takes over from it and a
# stranger's, and bundles good and bad. Keys live in FOLDER alone.
#   make_bundles.sh FOLDER
set -euo pipefail
source=$(cd "$(dirname "$0")/../.." && pwd)
cd "$1"
mkdir -p slots pki state
for name in own next stranger; do
  PLUMB_KEY_BITS=2048 "$source/toolchain/signing-keys" pki $name
done

bundle() { # NAME VERSION COMPATIBLE SIGNER FORMAT [IMAGE]: noise where no image is given
  rm -rf content
  mkdir content
  if [ $# -gt 5 ]; then
    cp "$6" content/rootfs.img
  else
    head -c 1500000 /dev/zero | openssl enc -aes-128-ctr \
      -K "$(printf '%032x' "${2//[^0-9]/}")" -iv "$(printf '%032x' 1)" >content/rootfs.img
  fi
  printf '%s\n' '[update]' "compatible=$3" "version=$2" '' '[bundle]' "format=$5" '' \
    '[image.rootfs]' filename=rootfs.img >content/manifest.raucm
  rm -f "$1.raucb"
  rauc --cert="pki/$4.pem" --key="pki/$4.key" bundle content "$1.raucb"
  cp content/rootfs.img "$1.img"
}
bundle good 9.1.0 plumb-test own plain
bundle older 0.0.9 plumb-test own plain
bundle other 9.1.0 plumb-other-machine own plain
bundle stranger 9.1.0 plumb-test stranger plain
bundle verity 9.1.0 plumb-test own verity
bundle strangers-verity 9.1.0 plumb-test stranger verity
# Systems that bring a keyring, where toolchain/image puts it.
system() { # NAME AUTHORITY...
  rm -rf root "$1.ext2"
  mkdir -p root/etc/rauc
  for name in "${@:2}"; do cat "pki/$name-ca.pem"; done >root/etc/rauc/ca.pem
  /sbin/mke2fs -q -t ext2 -d root "$1.ext2" 1400k
}
system both own next
system new next
bundle next 9.4.0 plumb-test next plain
bundle both-keys 9.2.0 plumb-test own plain both.ext2
bundle new-key 9.3.0 plumb-test next plain new.ext2
# One bit of what was signed; half of the file; one letter of the manifest inside the signature.
python3 - <<'PYTHON'
whole = bytearray(open("good.raucb", "rb").read())
open("truncated.raucb", "wb").write(whole[: len(whole) // 2])
whole[400_000] ^= 1
open("damaged.raucb", "wb").write(whole)
verity = bytearray(open("verity.raucb", "rb").read())
at = verity.rindex(b"verity-hash=") + 12
verity[at] = ord("0") if verity[at] != ord("0") else ord("1")
open("damaged-verity.raucb", "wb").write(verity)
PYTHON

head -c 2000000 /dev/zero >slots/a.img
cp slots/a.img slots/b.img
cat >boot-backend <<'SCRIPT'
#!/bin/sh
# RAUC's custom boot loader: its state is kept in files.
state=$(dirname "$0")/state
echo "$@" >>"$state/calls"
case "$1" in
  get-primary) cat "$state/primary" 2>/dev/null || echo A ;;
  set-primary) echo "$2" >"$state/primary"; echo good >"$state/state.$2" ;;
  get-state) cat "$state/state.$2" 2>/dev/null || echo good ;;
  set-state) echo "$3" >"$state/state.$2" ;;
  *) exit 1 ;;
esac
SCRIPT
chmod +x boot-backend
cat >system.conf <<CONF
[system]
compatible=plumb-test
bootloader=custom
mountprefix=$PWD/mount
statusfile=$PWD/state/status
max-bundle-download-size=100000000

[handlers]
bootloader-custom-backend=$PWD/boot-backend

[keyring]
path=$PWD/keyring.pem
check-purpose=codesign
use-bundle-signing-time=true

[slot.rootfs.0]
device=$PWD/slots/a.img
type=raw
bootname=A

[slot.rootfs.1]
device=$PWD/slots/b.img
type=raw
bootname=B
CONF
mkdir -p mount
cp pki/own-ca.pem keyring.pem
