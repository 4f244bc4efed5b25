#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Tests that fail and pass when they are repeated, with a ctest of the test's own: it fails the tests
# that `first` names, and of these the ones in `second` when it is asked to run the failed ones again.
set -euo pipefail
. "$(dirname "$0")/../support/check.sh"
run_tests=$(cd "$(dirname "$0")/../../toolchain" && pwd)/run-tests
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
mkdir -p bin build/release/Testing/Temporary build/fuzz/Testing/Temporary
cat >bin/ctest <<'X'
#!/bin/bash
echo "ctest $*" >>calls
shift
preset=$1 which=first count=100
names=$(sed -n 's/.*-R \(.*\) --parallel 1.*/\1/p' <<<"$*")
[ -z "$names" ] || which=second count=$(grep -cE "$names" first)
log=build/$preset/Testing/Temporary/LastTestsFailed.log
failed=$(wc -l <$which)
[ ! -e broken ] || exit 8
[ "$failed" = 0 ] || cat -n $which | sed -E 's/^ *([0-9]+)\t/\1:/' >"$log"
for i in 1 2 3; do echo "$i/100 Test #$i: A.B ...............   Passed    0.01 sec"; done
echo "$((100 - failed))% tests passed, $failed tests failed out of $count"
[ "$failed" = 0 ]
X
chmod +x bin/ctest
export PATH=$work/bin:$PATH
begin() { rm -rf results calls; mkdir results; : >first; : >second; }
run() { "$run_tests" "$@" >out 2>&1 && code=0 || code=$?; }
summary() { said=$("$run_tests" --summary results 2>&1 | tr '\n' '|') && sum=0 || sum=$?; }

begin
run release results -L x
summary
check "where all pass, nothing is repeated" '^0 1 0$' "$code $(grep -c . calls) $sum"
check "ctest gets its arguments" '^ctest --preset release .* -L x$' "$(cat calls)"
check "its closing line ends the log" '^release: 100% tests passed, 0 tests failed out of 100.passed only when repeated: 0, at most 2 are accepted.$' "$said"
check "dots are left out" '^0$' "$(grep -c '\.\.\.\.' out || true)"

begin
printf '%s\n' 'Slow.One/0' Slow.Two+ >first
run release results
summary
check "two that pass when repeated are accepted" '^0 0$' "$code $sum"
check "they alone are repeated, one at a time" '-R .*Slow.*One.*Two.* --parallel 1$' "$(tail -1 calls)"
check "two of them" 'out of 2$' "$(tail -1 out)"
check "they are named and counted, with the closing line of all tests" \
  '^release: 98% tests passed, 2 tests failed out of 100.passed only when repeated: 2, at most 2 are accepted.  release: Slow.One/0.  release: Slow.Two..$' "$said"

echo Fuzz.png >first
run fuzz results
summary
check "a third one in another preset fails the run" '^0 1 .*repeated: 3,.*fuzz: Fuzz.png.$' \
  "$code $sum $said"

begin
printf '%s\n' Slow.One Broken.One >first
echo Broken.One >second
run release results
summary
check "one that fails again is a failure" '^8|1$' "$code"
check "the other one is named all the same" '^0 .*repeated: 1,.*release: Slow.One.$' "$sum $said"

begin
rm -f build/release/Testing/Temporary/LastTestsFailed.log
touch broken
run release results
check "a ctest that fails without a failed test fails" '^1 1 .*without a failed test' \
  "$code $(grep -c . calls) $(cat out)"
rm broken
exit $failed
