#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs a build into a small Debian and boots it in systemd-nspawn: plumbd.service with its whole
# sandbox, on the virtual sensor.
#   unit_in_container.sh BUILD_FOLDER WORK_FOLDER
# WORK_FOLDER keeps the Debian for the next time. Exit code 77: it cannot run here, and the last
# line says why.
set -euo pipefail
build=$(realpath "$1") source=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$2"
work=$(realpath "$2") root=$work/root

. "$source/../support/left_out.sh"
[ "$(id -u)" = 0 ] || skip "needs root"
require systemd-nspawn mmdebstrap

# The packages that the programs were linked with, from wherever this machine gets its own.
libraries=$(ldd "$build/daemon/plumbd" "$build/daemon/plumb" |
  awk '$3 ~ /^\// { print $3 }' | sort -u)
packages=$(for library in $libraries; do
  dpkg -S "$(realpath "$library")" "$library" 2>/dev/null || true
done |
  sed 's/:.*//' | sort -u | paste -sd,),systemd,systemd-sysv,udev,dbus,curl,procps,libopenni2-0
if [ "$(cat "$work/packages" 2>/dev/null)" != "$packages" ]; then
  rm -rf "$root" "$work/packages"
  (cat /etc/apt/sources.list /etc/apt/sources.list.d/debian.sources 2>/dev/null || true) |
    mmdebstrap --variant=minbase --include="$packages" --aptopt='APT::Install-Recommends "false"' \
      --dpkgopt='path-exclude=/usr/share/doc/*' --dpkgopt='path-exclude=/usr/share/man/*' \
      "$(. /etc/os-release && echo "$VERSION_CODENAME")" "$root" - ||
      skip "no Debian could be made: see above"
  echo "$packages" >"$work/packages"
fi

DESTDIR=$root cmake --install "$build" >/dev/null
DESTDIR=$root cmake --install "$build" --component virtual_sensor >/dev/null
install -m 755 "$source/in_container.sh" "$root/usr/local/bin/plumb-checks"
# The virtual sensor instead of a real one, and a watchdog that need not be waited for half a
# minute; the sandbox stays as it is.
mkdir -p "$root/etc/systemd/system/plumbd.service.d" \
  "$root/etc/systemd/system/multi-user.target.wants"
cat >"$root/etc/systemd/system/plumbd.service.d/test.conf" <<'UNIT'
[Service]
ExecStart=
ExecStart=/usr/local/bin/plumbd --simulated demo --sim-size 320x240 --sim-frames 120 \
  --sim-scenes 1 --state /var/lib/plumb
Environment=XDG_CACHE_HOME=/var/cache/plumb
CacheDirectory=plumb
WatchdogSec=3s
UNIT
cat >"$root/etc/systemd/system/plumb-checks.service" <<'UNIT'
[Unit]
After=multi-user.target
[Service]
Type=oneshot
ExecStart=/usr/local/bin/plumb-checks
UNIT
ln -sf ../plumb-checks.service \
  "$root/etc/systemd/system/multi-user.target.wants/plumb-checks.service"

rm -rf "$work/out"
mkdir "$work/out"
timeout -k 5 300 systemd-nspawn --directory="$root" --volatile=overlay \
  --bind="$work/out:/checks" --register=no --keep-unit --boot --quiet \
  --private-network </dev/null >"$work/console" 2>&1 || true
[ -e "$work/out/log" ] || {
  tail -5 "$work/console"
  skip "systemd does not boot in a container here: see above"
}
cat "$work/out/log"
if grep -q '^CHECK FAILED' "$work/out/log" || ! grep -q '^CHECKS DONE' "$work/out/log"; then
  tail -n 100 "$work/out/journal" || true
  exit 1
fi
