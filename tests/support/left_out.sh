# SPDX-License-Identifier: Apache-2.0
# For test scripts to source: how a test says that it cannot run here. ctest counts 77 as skipped,
# and toolchain/test lists the reasons at its end.

# This machine does not permit it.
skip() { # REASON
  echo "skipped: $1"
  exit 77
}

# toolchain/install brings it, so its absence is a failure where PLUMB_REQUIRE_ALL is set.
require() { # PROGRAM...
  local program
  for program in "$@"; do
    command -v "$program" >/dev/null && continue
    echo "skipped: $program is missing: run toolchain/install"
    [ "${PLUMB_REQUIRE_ALL:-0}" = 0 ] && exit 77
    exit 1
  done
}
