#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# What happens around plumbd's lives, with programs of the test's own in place of systemctl,
# systemd-run and sleep: pauses, counting, restarts of the machine, the light.
set -euo pipefail
. "$(dirname "$0")/../support/check.sh"
watch=$(cd "$(dirname "$0")/../../systemd" && pwd)/service-watch
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
mkdir bin
for program in systemctl systemd-run sleep; do
  printf '#!/bin/sh\necho "%s $*" >>%s/calls\n' $program "$work" >bin/$program
done
chmod +x bin/*
echo "100.5 1" >uptime
export PATH=$work/bin:$PATH PLUMB_WATCH_BOOT=$work/boot PLUMB_WATCH_KEPT=$work/kept \
  PLUMB_UPTIME=$work/uptime
called() { grep -c -- "$1" calls || true; }
life() { # RESULT SECONDS: one life of plumbd; the output is in `log`
  : >calls
  "$watch" before >log 2>&1
  echo "$(($(cut -d. -f1 uptime) + $2)).25 1" >uptime
  SERVICE_RESULT=$1 "$watch" after >>log 2>&1
}

life success 5
check "an end that was asked for: the light, no pause, no restart" '^1 1 0 0$' \
  "$(called 'systemctl stop plumb-light.service') $(called 'start plumb-light.service') \
$(called sleep) $(called reboot)"
check "without a restart nothing is to be forgotten" '^0$' "$(called systemd-run)"
check "the light goes out before plumbd starts and comes after it has ended" \
  '^systemctl stop.*start plumb-light.service $' "$(tr '\n' ' ' <calls)"
for i in 1 2 3; do
  life signal 5
  check "failure $i comes without a pause" '^0$' "$(called sleep)"
done
pauses=
for i in 4 5 6 7 8 9; do
  life signal 5
  pauses+="$(sed -n 's/^sleep //p' calls) "
  check "failure $i restarts nothing" '^0$' "$(called reboot)"
done
check "then the pauses grow, and stay within the unit's time to start" \
  '^10 20 40 50 50 50 $' "$pauses"
life watchdog 5
check "the tenth restarts the machine" '^1 .*10 times in a row: the machine restarts \(1 of 3\)' \
  "$(called 'systemctl --no-block reboot') $(cat log)"

restarted() { # the machine comes up again and plumbd fails ten times
  rm -rf boot
  echo "60.0 1" >uptime
  for _ in 1 2 3 4 5 6 7 8 9 10; do life exit-code 5; done
}
restarted; check "so does the next tenth" '\(2 of 3\)' "$(cat log)"
restarted; check "and the next" '\(3 of 3\)' "$(cat log)"
restarted; check "but no more" '^0 .*3 restarts of the machine did not help' \
  "$(called reboot) $(cat log)"
life exit-code 599
check "just under ten minutes is no success" '^11$' "$(cat boot/failures)"
life exit-code 600
check "a life of ten minutes resets the count" '^1 none$' \
  "$(cat boot/failures) $([ -e kept/restarts ] || echo none)"
restarted; check "and restarts of the machine help again" '\(1 of 3\)' "$(cat log)"
life success 1
check "an end that was asked for resets both, too" '^0 none$' \
  "$(cat boot/failures) $([ -e kept/restarts ] || echo none)"

restarted; restarted; restarted
check "three restarts are counted" '^3$' "$(cat kept/restarts)"
: >calls
"$watch" before
check "a life after them is to be noted after ten minutes" \
  '^systemd-run .*--on-active=600 .*service-watch well$' "$(grep systemd-run calls)"
"$watch" well # and then the power fails
restarted; check "a long life that a power cut ended resets the count" '\(1 of 3\)' "$(cat log)"
life exit-code 5
check "an end takes the note back" '^1$' \
  "$(grep -A99 systemd-run calls | grep -c 'systemctl stop plumb-well.timer')"

rm -rf boot kept && touch kept
for _ in 1 2 3 4 5 6 7 8 9 10; do life signal 5; done
check "no restart when it cannot be counted" '^0 .*not restarted, as that could not be counted' \
  "$(called reboot) $(cat log)"
echo "nonsense" >boot/failures
life signal 5
check "a damaged count is none" '^1$' "$(cat boot/failures)"
exit $failed
