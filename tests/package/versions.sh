#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Which versions toolchain/image and toolchain/bundle accept. Nothing is built: each call has
# another mistake, which is found after that of the version.
set -euo pipefail
. "$(dirname "$0")/../support/check.sh"
source=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
echo >ca.pem
image() { # VERSION
  "$source/toolchain/image" --version "$1" --keyring ca.pem --board none 2>&1 || echo "code $?"
}
bundle() { # VERSION
  "$source/toolchain/bundle" --version "$1" --cert none --key none --out v.raucb 2>&1 ||
    echo "code $?"
}
for version in 0 0.2 0.2.1 10.20.30.40; do
  check "an image may have version $version" '^image: --board must' "$(image $version)"
  check "a bundle may have version $version" 'there is no such certificate' "$(bundle $version)"
done
for version in 0.2.1-rc1 v1.0.0 0.2.1~git1 1. .1 1..2 1.0a ' 1' '1 '; do
  expected="--version must be numbers .* and is '${version}'.*code 2"
  check "no image has version '$version'" "^image: $expected" "$(image "$version")"
  check "no bundle has version '$version'" "^bundle: $expected" "$(bundle "$version")"
done
for program in image bundle; do
  check "$program needs a version" "toolchain/$program --version VERSION.*code 2" "$($program '')"
done
exit $failed
