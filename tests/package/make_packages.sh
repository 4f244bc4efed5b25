#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes the packages of a build, for the other tests of this folder.
#   make_packages.sh BUILD_FOLDER OUT_FOLDER
# Exit code 77: it cannot run here, and the last line says why.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
. "$here/../support/left_out.sh"
require dh
rm -rf "$2"
"$here/../../toolchain/package" --build "$1" --out "$2"
