#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes the packages of a build once more and looks into them.
#   packages.sh BUILD_FOLDER MADE WORK_FOLDER      MADE: by make_packages.sh
# Packages for another processor are checked too; their programs run in QEMU. Exit code 77: it
# cannot run here, and the last line says why.
set -euo pipefail
build=$(realpath "$1") here=$(cd "$(dirname "$0")" && pwd)
sysroot=$(sed -n 's/^PLUMB_SYSROOT:PATH=//p' "$build/CMakeCache.txt")
multiarch=$(dpkg-architecture -qDEB_HOST_MULTIARCH) run=()
if [ -n "$sysroot" ]; then
  multiarch=aarch64-linux-gnu
  run=(qemu-aarch64-static -L "$sysroot"
    -E "LD_LIBRARY_PATH=/usr/lib/$multiarch/blas:/usr/lib/$multiarch/lapack")
fi
source=$(cd "$here/../.." && pwd)
. "$here/../support/left_out.sh"
require dh lintian
once=$(realpath "$2")
rm -rf "$3"
mkdir -p "$3"
cd "$3"
failed=0
check() { # NAME COMMAND...
  local name=$1
  shift
  if "$@" >check.log 2>&1; then
    echo "ok      $name"
  else
    failed=1
    echo "FAILED  $name"
    sed 's/^/        /' check.log
  fi
}

# Another place, time zone, language and umask must not show.
(umask 077 && TMPDIR=$(mktemp -d -p "$PWD") TZ=Asia/Tokyo LANG=de_DE \
  "$source/toolchain/package" --build "$build" --out twice >/dev/null)
check "two runs give the same bytes" diff -r "$once" twice
check "lintian finds no error" lintian --allow-root --fail-on error \
  --suppress-tags debug-file-with-no-debug-symbols "$once"/*.deb

mkdir tree
for package in plumb plumbd plumb-dicom plumb-virtual-sensor libplumb-dev; do
  dpkg-deb -x "$once/${package}"_*.deb "tree/$package"
done
check "binaries are hardened" "$here/hardening.sh" tree
cat check.log

every_library_is_depended_upon() {
  local package file library owner bad=0
  local -A owners=() # asking dpkg takes long, and the programs share most libraries
  for package in plumb plumbd plumb-dicom plumb-virtual-sensor; do
    depends=" $(dpkg-deb -f "$once/${package}"_*.deb Depends) "
    while IFS= read -r file; do
      case "$file" in *libOpenNI2.so* | *libOniFile.so*) continue ;; esac
      for library in $(readelf -dW "$file" 2>/dev/null | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p'); do
        [ -n "${owners[$library]+known}" ] || owners[$library]=$(
          for path in "$sysroot"{,/usr}/lib/"$multiarch/$library"; do
            dpkg-query ${sysroot:+--admindir="$sysroot/var/lib/dpkg"} -S "$path" 2>/dev/null || true
          done | sed 's/:.*//' | sort -u | head -1)
        owner=${owners[$library]}
        [[ $depends =~ [\ ,]"$owner"[\ ,\(] ]] ||
          { echo "$package: $library of '$owner' is not in Depends:$depends"; bad=1; }
      done
    done < <(find "tree/$package" -type f)
  done
  return $bad
}
check "every library used is in Depends" every_library_is_depended_upon

header_only_libraries_are_named() {
  local package library bad=0
  for package in plumb plumbd; do
    for library in cli11 eigen3 nlohmann-json3 tomlplusplus; do
      dpkg-deb -f "$once/${package}"_*.deb Static-Built-Using | grep -q "\b$library (= " ||
        { echo "$package does not name $library in Static-Built-Using"; bad=1; }
    done
  done
  return $bad
}
check "libraries that are headers only are named" header_only_libraries_are_named

files_are_there() {
  local file bad=0
  for file in plumb/usr/share/man/man1/plumb.1.gz plumbd/usr/share/man/man8/plumbd.8.gz \
    plumbd/usr/share/man/man5/plumb.toml.5.gz \
    plumb/usr/share/doc/plumb/{README.md.gz,changelog.gz,changelog.Debian.gz,copyright} \
    plumbd/usr/share/doc/plumbd/copyright \
    plumbd/lib/systemd/system/plumbd.{service,socket} plumbd/lib/udev/rules.d/60-plumb.rules \
    plumbd/usr/lib/sysusers.d/plumb.conf \
    plumbd/usr/lib/tmpfiles.d/plumb.conf; do
    [ -s "tree/$file" ] || { echo "missing: $file"; bad=1; }
  done
  for file in bin/plumb-dicomd lib/plumb/plumb-dicom-{reader,sender,writer} \
    lib/sysusers.d/plumb-dicom.conf; do
    [ -s "tree/plumb-dicom/usr/$file" ] || { echo "missing: $file"; bad=1; }
  done
  [ -s tree/plumb-dicom/lib/systemd/system/plumb-dicomd.service ] || { echo "no unit"; bad=1; }
  grep -q '^ExecStart=/usr/bin/plumbd' tree/plumbd/lib/systemd/system/plumbd.service ||
    { echo "the unit starts another program"; bad=1; }
  return $bad
}
check "manual, licence and units are in" files_are_there

dpkg-deb -e "$once"/plumbd_*.deb control
check "the configuration is a conffile" grep -qx /etc/plumb/plumb.toml control/conffiles
check "no maintainer script removes data" \
  bash -c '! grep -nE "rm .*/var/lib|deluser|userdel" control/postrm control/prerm'
check "the configuration as delivered is good" "${run[@]}" tree/plumbd/usr/bin/plumbd \
  --config tree/plumbd/etc/plumb/plumb.toml --check-config
# Every example in it too: a line "# key = ..." becomes one that counts.
(umask 077 && printf '%064d' 1 >peers.secret) # a file that an example names, and that is read
sed -E -e 's/^# ([a-z_]+ = )/\1/' -e "s|/etc/plumb/peers.secret|$PWD/peers.secret|" \
  tree/plumbd/etc/plumb/plumb.toml >examples.toml
check "its examples are good" "${run[@]}" tree/plumbd/usr/bin/plumbd \
  --config examples.toml --check-config

# Options in a page as man shows it, and those that --help prints.
shown() { MANWIDTH=1000 man -l "$1" 2>/dev/null | col -b; }
every_option_is_in_the_manual() {
  local command option bad=0 page
  page=$(shown tree/plumb/usr/share/man/man1/plumb.1.gz)
  for command in $("${run[@]}" tree/plumb/usr/bin/plumb --help |
    sed -n '/^Subcommands:/,/^$/s/^  \([a-z]\+\) .*/\1/p'); do
    grep -q "plumb $command" <<<"$page" || { echo "plumb $command is not in plumb.1"; bad=1; }
    for option in $("${run[@]}" tree/plumb/usr/bin/plumb "$command" --help |
      grep -oE '^ +(-h,)?--[a-z-]+' | grep -oE '\-\-[a-z-]+'); do
      grep -q -- "$option\b" <<<"$page" ||
        { echo "plumb $command $option is not in plumb.1"; bad=1; }
    done
  done
  [ -n "$command" ] || { echo "plumb --help lists no command"; bad=1; }
  page=$(shown tree/plumbd/usr/share/man/man8/plumbd.8.gz)
  for option in $("${run[@]}" tree/plumbd/usr/bin/plumbd --help |
    grep -oE '^ +(-h,)?--[a-z-]+' | grep -oE '\-\-[a-z-]+'); do
    grep -q -- "$option\b" <<<"$page" || { echo "plumbd $option is not in plumbd.8"; bad=1; }
  done
  return $bad
}
check "every command and option is in the manual" every_option_is_in_the_manual
every_key_is_in_the_manual() {
  local key bad=0 page keys
  page=$(shown tree/plumbd/usr/share/man/man5/plumb.toml.5.gz)
  keys=$(grep -ohE '[Tt]ake[A-Za-z_]*\((section, |button, |light, )?"[a-z_0-9]+"' \
    "$source/daemon/config/config.cpp" | grep -oE '"[a-z_0-9]+"' | tr -d '"' | sort -u)
  [ "$(wc -w <<<"$keys")" -ge 40 ] || { echo "only these keys were found: $keys"; bad=1; }
  for key in $keys; do
    grep -qw "$key" <<<"$page" || { echo "$key is not in plumb.toml.5"; bad=1; }
  done
  return $bad
}
check "every key of the configuration is in the manual" every_key_is_in_the_manual
man_pages_are_well_formed() {
  local page text=
  for page in tree/plumb*/usr/share/man/man*/*; do
    text+=$(LC_ALL=C.UTF-8 man --warnings -l -Tutf8 "$page" 2>&1 >/dev/null)
  done
  echo "$text"
  [ -z "$text" ]
}
check "the manual is well-formed" man_pages_are_well_formed
exit $failed
