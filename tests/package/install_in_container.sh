#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the packages with apt into a clean Debian that runs in systemd-nspawn, changes the
# configuration, upgrades, removes and purges them.
#   install_in_container.sh MADE WORK_FOLDER      MADE: by make_packages.sh
# The older packages are the same under a lower number, or those in $PLUMB_OLD_PACKAGES: of a real
# release, whose programs have left the state folder $PLUMB_OLD_STATE, if that is given. Then
# WORK_FOLDER/out/stages has the state folder before and after each change of packages.
# WORK_FOLDER keeps the Debian and what apt fetched for the next time. Exit code 77: it cannot run
# here, and the last line says why.
set -euo pipefail
made=$(realpath "$1") here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$2"
work=$(realpath "$2") root=$work/root
. "$here/../support/left_out.sh"
[ "$(id -u)" = 0 ] || skip "needs root"
require systemd-nspawn mmdebstrap dh

# A Debian with systemd, curl and polkit, which plumbd recommends, and nothing that Plumb needs.
sources=$(cat /etc/apt/sources.list /etc/apt/sources.list.d/debian.sources 2>/dev/null || true)
wanted=$(echo "2 $sources" | sha256sum)
if [ "$(cat "$work/wanted" 2>/dev/null)" != "$wanted" ]; then
  rm -rf "$root" "$work/wanted" "$work/cache"
  mmdebstrap --variant=minbase --include=systemd,systemd-sysv,udev,dbus,curl,polkitd \
    --aptopt='APT::Install-Recommends "false"' \
    --skip=cleanup/apt "$(. /etc/os-release && echo "$VERSION_CODENAME")" "$root" - <<<"$sources" ||
    skip "no Debian could be made: see above"
  echo "$wanted" >"$work/wanted"
fi

rm -rf "$work/out" "$work/debs"
mkdir -p "$work/out" "$work/debs" "$work/cache/archives/partial"
mkdir "$work/debs/old" "$work/debs/new"
cp "$made"/*.deb "$work/debs/new/"
for package in plumb plumbd; do
  if [ -n "${PLUMB_OLD_PACKAGES:-}" ]; then
    cp "$PLUMB_OLD_PACKAGES/${package}"_*.deb "$work/debs/old/"
    continue
  fi
  # The same under a lower number, for the upgrade.
  dpkg-deb -R "$work/debs/new/${package}"_*.deb "$work/debs/unpacked"
  sed -Ei 's/^Version: .*/Version: 0.0.1-1/; s/\bplumb \(= [^)]*\)/plumb (= 0.0.1-1)/' \
    "$work/debs/unpacked/DEBIAN/control"
  # dpkg asks about a changed configuration file only if the packaged one has changed as well.
  [ ! -f "$work/debs/unpacked/etc/plumb/plumb.toml" ] ||
    echo "# of the older package" >>"$work/debs/unpacked/etc/plumb/plumb.toml"
  dpkg-deb -Zgzip -z1 -b "$work/debs/unpacked" "$work/debs/old/" >/dev/null
  rm -r "$work/debs/unpacked"
done
if [ -n "${PLUMB_OLD_STATE:-}" ]; then cp -a "$PLUMB_OLD_STATE" "$work/debs/state"; fi
# The container has no network: what the packages depend on is fetched here.
for packages in old new; do
  apt-get -q -y -o Dir::State="$root/var/lib/apt" \
    -o Dir::State::status="$root/var/lib/dpkg/status" \
    -o Dir::Etc::sourcelist="$root/etc/apt/sources.list" \
    -o Dir::Etc::sourceparts="$root/etc/apt/sources.list.d" \
    -o Dir::Cache="$work/cache" -o APT::Sandbox::User=root --no-install-recommends \
    --download-only install "$work"/debs/$packages/plumb{,d}_*.deb >"$work/out/fetch" 2>&1 ||
    { tail -5 "$work/out/fetch"; exit 1; }
done

install -m 755 "$here/in_container.sh" "$work/debs/checks"
cat >"$root/etc/systemd/system/plumb-checks.service" <<'UNIT'
[Unit]
After=multi-user.target
[Service]
Type=oneshot
ExecStart=/debs/checks
UNIT
mkdir -p "$root/etc/systemd/system/multi-user.target.wants"
ln -sf ../plumb-checks.service \
  "$root/etc/systemd/system/multi-user.target.wants/plumb-checks.service"
ended=0
timeout -k 5 240 systemd-nspawn --directory="$root" --volatile=overlay \
  --bind="$work/out:/checks" --bind-ro="$work/debs:/debs" \
  --bind="$work/cache/archives:/var/cache/apt/archives" \
  --register=no --keep-unit --boot --quiet --private-network </dev/null >"$work/console" 2>&1 ||
  ended=$?
[ -e "$work/out/log" ] || {
  tail -5 "$work/console"
  skip "systemd does not boot in a container here: see above"
}
# With --keep-unit systemd-nspawn ends with this code when its machine restarts.
if [ "$ended" = 133 ]; then
  echo "CHECK ok      logind restarts the machine for plumbd: systemd-nspawn ended with 133" \
    >>"$work/out/log"
else
  echo "CHECK FAILED  logind restarts the machine for plumbd:" \
    "expected systemd-nspawn to end with 133, it ended with $ended" >>"$work/out/log"
fi
cat "$work/out/log"
if grep -q '^CHECK FAILED' "$work/out/log" || ! grep -q '^CHECKS DONE' "$work/out/log"; then
  tail -n 60 "$work/out/apt" "$work/out/journal" 2>/dev/null || true
  exit 1
fi
