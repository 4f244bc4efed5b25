#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# Runs inside the container that unit_in_container.sh boots: the installed service from its start to
# its stop. One line a check; then off.
exec >/checks/log 2>&1  # of the machine outside; the console is hung up when somebody may log in
plumb() { /usr/local/bin/plumb --control /run/plumb/control.sock "$@"; }
show() { systemctl show plumbd.service -p "$1" --value; }
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
status_of() { grep "^$1:" "/proc/$(show MainPID)/status" | tr -d ' \t'; }

check "account of sysusers" "uid=*(plumb) gid=*(plumb)*" "$(id plumb)"
check "folders of tmpfiles" "plumb plumb 700" "$(stat -c '%U %G %a' /var/lib/plumb)"
check "place for backups" "plumb plumb 700" "$(stat -c '%U %G %a' /var/lib/plumb-backup)"
check "unit is well-formed" "" \
  "$(systemd-analyze verify --man=no plumbd.service 2>&1 | grep -i plumb)"

begin=$(date +%s%N)
systemctl start plumbd.service
check "start waits for READY" "active running" "$(show ActiveState) $(show SubState)"
echo "CHECK time    from start to READY: $((($(date +%s%N) - begin) / 1000000)) ms"
await "virtual sensor in the sandbox" ready 20 plumb status --get state
await "status for systemd" "ready*" 5 show StatusText
check "runs as plumb" "plumb" "$(ps -o user= -p "$(show MainPID)")"
check "call filter" "Seccomp:2" "$(status_of Seccomp)"
check "no new privileges" "NoNewPrivs:1" "$(status_of NoNewPrivs)"
check "no capabilities" "CapBnd:0000000000000000" "$(status_of CapBnd)"
check "memory is never writable and executable" "yes" "$(show MemoryDenyWriteExecute)"
check "control socket is the unit's" "plumb plumb 660" \
  "$(stat -c '%U %G %a' /run/plumb/control.sock)"
check "page" '*"status":"ok"*' "$(curl -sk https://127.0.0.1:8080/health)"
check "files outside its folders" "*Read-only file system*" \
  "$(nsenter -t "$(show MainPID)" -m touch /usr/probe 2>&1)"

plumb press
await "frames" "1[0-9][0-9]" 30 plumb status --get scan.frames
plumb press
await "a scan in the sandbox" result 60 plumb status --get state
plumb press
await "more frames" "1[0-9][0-9]" 30 plumb status --get scan.frames
plumb press
await "compared with the first" in_tolerance 60 plumb status --get last_result.verdict
check "its files" "plumb plumb 700" "$(stat -c '%U %G %a' /var/lib/plumb/scans/000001)"
check "journal with fields" "000001" \
  "$(journalctl -u plumbd -o json PLUMB_SCAN=000001 | grep -o '"PLUMB_SCAN":"[0-9]*"' |
    head -1 | tr -dc 0-9)"
check "setup code in the journal" "*setup code: ????-????*" "$(journalctl -u plumbd -o cat)"

check "its own temporary folder takes no backup" "*visible to its service only*" \
  "$(plumb backup /tmp/backup 2>&1)"
mkdir -p /var/disk && mount --bind /var/disk /var/lib/plumb-backup &&
  chown plumb: /var/lib/plumb-backup
check "a disk that is mounted now takes a backup" \
  "backed up to /var/lib/plumb-backup/first: 2 scans*" \
  "$(plumb backup /var/lib/plumb-backup/first 2>&1)"
check "the backup lies on that disk" "/var/disk/first/backup.json" \
  "$(ls /var/disk/first/backup.json 2>&1)"

systemctl reload plumbd.service
await "reload" "*configuration was read again*" 10 journalctl -u plumbd -o cat
check "still active" "active running" "$(show ActiveState) $(show SubState)"

before=$(show MainPID)
kill -STOP "$before"
await "restarted by the watchdog" 1 40 show NRestarts
await "active again" "active running" 30 sh -c 'echo \
  $(systemctl show plumbd -p ActiveState --value) $(systemctl show plumbd -p SubState --value)'
check "reported in the journal" "*Watchdog timeout*" "$(journalctl -u plumbd -o cat)"
await "ready again" ready 20 plumb status --get state
check "both scans are still there" "000001 000002" "$(ls /var/lib/plumb/scans | xargs)"

systemctl stop plumbd.service
await "the light's service is run, which has no light here" "*inactive*success*" 10 sh -c 'echo \
  $(systemctl show plumb-light -p ActiveState --value) \
  $(systemctl show plumb-light -p Result --value)'
check "and was started by plumbd's end" "*plumb-light.service*" \
  "$(journalctl -u plumb-light -o short | tr '\n' ' ')"
check "stops cleanly" "inactive success 0" \
  "$(show ActiveState) $(show Result) $(show ExecMainStatus)"
await "the socket starts it" "*ready*" 20 plumb status
check "refused calls" "" \
  "$(journalctl -u plumbd -o cat | grep -iE 'SIGSYS|status=31|not permitted')"
journalctl -u plumbd --no-pager >/checks/journal
echo "CHECKS DONE"
systemctl poweroff --force
