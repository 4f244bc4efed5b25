#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The list of known vulnerabilities: from the list of packages of a root file system, and a small
# export of the tracker with every state that it knows.
set -euo pipefail
. "$(dirname "$0")/../support/check.sh"
source=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
mkdir -p root/var/lib/dpkg
package() { # NAME VERSION [SOURCE]
  printf 'Package: %s\nStatus: install ok installed\nArchitecture: amd64\nVersion: %s\n' "$1" "$2"
  printf '%sMaintainer: x\nDescription: x\n\n' "${3:+Source: $3$'\n'}"
}
{
  package openssl 3.0.15-1~deb12u1
  package libssl3 3.0.15-1~deb12u1 openssl
  package libc6 2.36-9+b4 'glibc (2.36-9)'
  package zlib1g 1:1.2.13.dfsg-1 zlib
  package plumb 0.2.0-1 |
    sed 's/^Maintainer/Static-Built-Using: cli11 (= 2.1.2+ds-1), eigen3 (= 3.4.0-4)\n&/'
  package plumbd 0.2.0-1 plumb | sed 's/^Maintainer/Static-Built-Using: eigen3 (= 3.4.0-4)\n&/'
} >root/var/lib/dpkg/status
SOURCE_DATE_EPOCH=1700000000 "$source/toolchain/sbom" root 0.2.0 \
  "grub-efi-amd64-bin 2.06-13+deb12u1 amd64 grub2 2.06-13+deb12u1" >sbom.spdx
check "a package names its source" 'PackageName: libssl3' \
  "$(grep -B5 'built package from: openssl 3.0.15-1~deb12u1' sbom.spdx | tr '\n' ' ')"
check "a rebuilt package has its source's version" 'glibc 2.36-9$' "$(grep 'from: glibc' sbom.spdx)"
check "a library that is headers only is listed once" '^1 cli11 2.1.2.ds-1$' \
  "$(grep -c 'from: eigen3 3.4.0-4' sbom.spdx) $(sed -n 's/.*from: \(cli11 .*\)/\1/p' sbom.spdx)"
check "so is the boot loader, which is not in the root" '^1$' \
  "$(grep -c 'built package from: grub2 2.06-13+deb12u1$' sbom.spdx)"
check "so is what the page is made with" 'pkg:npm/three@[0-9.]+$' \
  "$(grep -o 'pkg:npm/three.*' sbom.spdx)"
check "a purl has no plain plus" '^0 1$' \
  "$(grep -c 'purl .*+' sbom.spdx || true) $(grep -c 'cli11@2.1.2%2Bds-1' sbom.spdx)"
check "each package is one that the document describes" '^same$' \
  "$([ "$(sed -n 's/^Relationship: SPDXRef-DOCUMENT DESCRIBES //p' sbom.spdx | sort -u)" \
    = "$(sed -n 's/^SPDXID: //p' sbom.spdx | grep -v DOCUMENT | sort)" ] && echo same)"
state() { # CVE SUITE STATUS URGENCY [FIXED-VERSION]
  printf '"%s": {"releases": {"%s": {"status": "%s", "urgency": "%s"%s}}}' "$1" "$2" "$3" "$4" \
    "${5:+, \"fixed_version\": \"$5\"}"
}
cat >tracker.json <<JSON
{"openssl": {
   $(state CVE-1-FIXED-LATER bookworm resolved medium 3.0.15-1~deb12u2),
   $(state CVE-1-FIXED-HERE bookworm resolved high 3.0.15-1~deb12u1),
   $(state CVE-1-FIXED-BEFORE bookworm resolved high 1.1.1n-0),
   $(state CVE-1-NEVER bookworm resolved high 0), $(state CVE-1-OTHER trixie open high)},
 "glibc": {
   $(state CVE-2-OPEN bookworm open low), $(state CVE-2-UNSURE bookworm undetermined high**),
   $(state CVE-2-FIXED-HERE bookworm resolved high 2.36-9)},
 "zlib": {$(state CVE-3-EPOCH bookworm resolved high 2.0)},
 "not-installed": {$(state CVE-4 bookworm open high)}}
JSON
run() { "$source/toolchain/cves" "$@" >out 2>&1 && code=0 || code=$?; }
run --sbom sbom.spdx --tracker tracker.json
check "a fixed version that waits is an exit code" '^1$' "$code"
check "those and no others, in order of what can be done" \
  '^CVE-1-FIXED-LATER CVE-2-UNSURE CVE-2-OPEN 7 $' "$(cut -d' ' -f1 out | tr '\n' ' ')"
check "its line says version, remedy and packages" \
  'medium +openssl 3.0.15-1~deb12u1 -> 3.0.15-1~deb12u2  \(libssl3, openssl\)' "$(head -1 out)"
check "its end counts" '^7 source packages, 3 known vulnerabilities in bookworm, 1 of them' \
  "$(tail -1 out)"
sed 's/~deb12u2/~deb12u1/' tracker.json >mended.json
run --sbom sbom.spdx --tracker mended.json
check "nothing waits" '^0 2 source' "$code $(grep -c '^CVE' out) $(grep -o source out | head -1)"
run --sbom sbom.spdx --tracker tracker.json --suite bullseye
check "a suite without an assessment is not an all-clear" \
  '^3 .*none is judged for bullseye' "$code $(cat out)"
run --sbom tracker.json --tracker tracker.json
check "no list of packages is no all-clear" '^3 .*expected an SPDX list' "$code $(cat out)"
echo '[]' >list.json
run --sbom sbom.spdx --tracker list.json
check "another file is reported" '^3 .*expected an object' "$code $(cat out)"
head -c 200 tracker.json >cut.json
run --sbom sbom.spdx --tracker cut.json
check "half a file is reported" '^3 cves: ' "$code $(cat out)"
exit $failed
