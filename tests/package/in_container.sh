#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Runs inside the container that install_in_container.sh boots: the life of the packages under apt
# and dpkg. One line a check; then off.
exec >/checks/log 2>&1 </dev/null
export DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8
check() { # NAME EXPECTED FOUND
  case "$3" in
    $2) echo "CHECK ok      $1: $3" ;;
    *) echo "CHECK FAILED  $1: expected $2, found $3" ;;
  esac
}
await() { # NAME PATTERN SECONDS COMMAND...: until its output is like the pattern
  name=$1 pattern=$2 left=$(($3 * 10))
  shift 3
  while found=$("$@" 2>&1); [ "$left" -gt 0 ]; do
    case "$found" in $pattern) break ;; esac
    left=$((left - 1))
    sleep 0.1
  done
  check "$name" "$pattern" "$found"
}
health() {
  curl -fsSk https://127.0.0.1:8080/health 2>/dev/null || curl -fsS http://127.0.0.1:8080/health
}
apt() { apt-get -q -y --no-install-recommends "$@" >>/checks/apt 2>&1; echo $?; }
version() { plumbd --version | head -1; }
data=/var/lib/plumb
keep_stage() { # NAME: of a state folder that an older release has left
  [ -d /debs/state ] || return 0
  mkdir -p /checks/stages && cp -a "$data" "/checks/stages/$1"
}

begin=$(date +%s)
check "apt install ./plumbd.deb" 0 "$(apt install /debs/old/plumbd_*.deb)"
echo "CHECK time    apt install took $(($(date +%s) - begin)) s"
await "the service runs" "running" 20 systemctl show plumbd -p SubState --value
check "it starts at the boot" "enabled enabled" \
  "$(systemctl is-enabled plumbd.service plumbd.socket | xargs)"
await "page" '*"status":"ok"*' 20 health
check "account" "uid=*(plumb) gid=*(plumb)*" "$(id plumb)"
check "state folder" "plumb plumb 7[05]0" "$(stat -c '%U %G %a' /var/lib/plumb)"
check "configuration cannot be read by everybody" "root plumb 750" \
  "$(stat -c '%U %G %a' /etc/plumb)"
check "plumb can be added" 0 "$(apt install /debs/old/plumb_*.deb)"
check "plumb speaks to the service" "no_sensor" "$(plumb status --get state 2>&1)"
check "files are as delivered" "" "$(dpkg -V plumb plumbd 2>&1 | grep -v /usr/share/)"

if [ -d /debs/state ]; then
  systemctl stop plumbd.socket plumbd.service
  rm -rf "$data"
  cp -r /debs/state "$data"
  chown -R plumb:plumb "$data"
  chmod 750 "$data"
  systemctl start plumbd.socket plumbd.service
  await "page of the older package over its own data" '*"status":"ok"*' 20 health
fi
echo '# changed by the operator' >>/etc/plumb/plumb.toml
echo data >"$data/scans-of-the-operator"
keep_stage 1-older
before=$(systemctl show plumbd -p MainPID --value)
check "upgrade" 0 \
  "$(apt -o Dpkg::Options::=--force-confold install /debs/new/plumbd_*.deb /debs/new/plumb_*.deb)"
check "another version" "$(dpkg-deb -f /debs/new/plumbd_*.deb Version)" \
  "$(dpkg-query -W -f '${Version}' plumbd)"
check "the changed configuration is kept" "# changed by the operator" \
  "$(tail -1 /etc/plumb/plumb.toml)"
await "page after the upgrade" '*"status":"ok"*' 20 health
check "the service was started again" "yes" \
  "$([ "$(systemctl show plumbd -p MainPID --value)" != "$before" ] && echo yes)"

# The older packages get the database from before a conversion back. Where the older packages are not
# of a real release, nothing was converted.
keep_stage 2-newer
systemctl stop plumbd.socket plumbd.service
if [ ! -d /debs/state ]; then
  install -d -o plumb -g plumb "$data/before-checksums"
  cp -p "$data/plumb.db" "$data/before-checksums/plumb.db"
fi
systemctl start plumbd.socket plumbd.service
await "page before going back" '*"status":"ok"*' 20 health
check "the older packages" 0 "$(apt --allow-downgrades -o Dpkg::Options::=--force-confold install \
  /debs/old/plumbd_*.deb /debs/old/plumb_*.deb)"
await "page of the older package" '*"status":"ok"*' 20 health
keep_stage 3-older
check "the newer database is kept beside the one that is back" "yes" \
  "$([ -s "$data/before-restore-1/plumb.db" ] && echo yes)"
check "upgrade again" 0 \
  "$(apt -o Dpkg::Options::=--force-confold install /debs/new/plumbd_*.deb /debs/new/plumb_*.deb)"
await "page after the second upgrade" '*"status":"ok"*' 20 health
keep_stage 4-newer

check "remove" 0 "$(apt remove plumbd)"
check "the service is gone" "inactive" "$(systemctl is-active plumbd.service)"
check "the socket is gone" "inactive" "$(systemctl is-active plumbd.socket)"
check "data after remove" "data" "$(cat /var/lib/plumb/scans-of-the-operator)"
check "configuration after remove" "# changed by the operator" "$(tail -1 /etc/plumb/plumb.toml)"
check "purge asks nothing" 0 "$(apt purge plumbd)"
check "data after purge" "data" "$(cat /var/lib/plumb/scans-of-the-operator)"
check "database after purge" "/var/lib/plumb/plumb.db" "$(ls /var/lib/plumb/plumb.db)"
check "configuration after purge" "gone" "$([ -e /etc/plumb/plumb.toml ] || echo gone)"
check "unit links after purge" "" "$(find /etc/systemd/system -name 'plumbd*')"
check "installed again, with the old data" 0 "$(apt install /debs/new/plumbd_*.deb)"
await "page over the old data" '*"status":"ok"*' 20 health
check "the account kept its number" "plumb" "$(stat -c '%U' /var/lib/plumb/plumb.db)"
check "plumb again" 0 "$(apt install /debs/new/plumb_*.deb)"
check "another account may not restart the machine" "*uthentication required*" \
  "$(setpriv --reuid nobody --regid nogroup --clear-groups busctl call org.freedesktop.login1 \
    /org/freedesktop/login1 org.freedesktop.login1.Manager Reboot b false 2>&1)"
journalctl -u plumbd --no-pager >/checks/journal
echo "CHECKS DONE"
# The real logind and polkit, with the rule of the package: install_in_container.sh sees whether the
# machine restarts.
plumb update --restart
left=300
until [ "$(systemctl is-system-running)" = stopping ] || [ "$left" = 0 ]; do
  left=$((left - 1))
  sleep 0.1
done
[ "$left" -gt 0 ] || systemctl poweroff --force
