#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Which unit tests belong to a change, in this repository.
#   changed_tests.sh BUILD_FOLDER
set -euo pipefail
. "$(dirname "$0")/../support/check.sh"
source=$(cd "$(dirname "$0")/../.." && pwd)
of() { "$source/toolchain/changed-tests" "$build" "$@" 2>&1 | tr '\n' ' '; }
build=$1
check "a source: its folder's" '^plumb_test_verdict $' \
  "$(of algo/verdict/gates.cpp)"
check "a header: those of the folders that include it, too" \
  'plumb_test_markers .*plumb_test_replay .*plumb_test_simulator ' "$(of algo/types/marker.hpp)"
check "a folder of tests stands for the folders below" '^plumb_test_web $' "$(of web/api/scan_routes.cpp)"
check "a folder without tests: those that include its headers" 'plumb_test_tracking ' \
  "$(of algo/map/dense_view.cpp)"
check "a test: itself" '^plumb_test_base $' "$(of tests/unit/base/pose_test.cpp)"
check "a header of tests: those that include it, also by other headers" \
  'plumb_test_records ' "$(of tests/support/temp_folder.hpp)"
check "several changes" '^plumb_test_base plumb_test_verdict $' \
  "$(of tests/unit/base/pose_test.cpp algo/verdict/gates.cpp README.md)"
check "a source without a unit test is named" '^no unit test belongs to daemon/none/x.cpp $' \
  "$(of daemon/none/x.cpp)"
check "a document has none" '^$' "$(of README.md)"
exit $failed
