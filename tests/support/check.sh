# SPDX-License-Identifier: Apache-2.0
# For test scripts to source: one line for each check. The script ends with `exit $failed`.
failed=0
check() { # NAME EXPECTED-REGEX FOUND
  if [[ $3 =~ $2 ]]; then
    echo "ok      $1"
  else
    failed=1
    printf 'FAILED  %s: expected %s, found %s\n' "$1" "$2" "$3"
  fi
}
