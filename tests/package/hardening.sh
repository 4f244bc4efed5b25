#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Reads back from every ELF file below FOLDER what the build asked for. One line a file; exit code 1
# if anything is missing.
#   hardening.sh FOLDER
# Copies of Debian's own libraries are Debian's responsibility: they are listed but not checked.
set -euo pipefail
export LC_ALL=C
failed=0 files=0
while IFS= read -r -d '' file; do
  [ "$(head -c4 "$file" | od -An -c | tr -d ' ')" = '177ELF' ] || continue
  name=${file#"$1"/} missing=()
  case "$name" in *libOpenNI2.so* | *libOniFile.so*) echo "Debian's  $name"; continue ;; esac
  files=$((files + 1))
  header=$(readelf -hW "$file") segments=$(readelf -lW "$file") \
    dynamic=$(readelf -dW "$file") notes=$(readelf -nW "$file")
  symbols=$(readelf --dyn-syms -W "$file")
  has() { grep -Eq "$2" <<<"$1"; }
  has "$header" 'Type: +DYN' || missing+=(PIE)
  if ! has "$name" '\.so'; then has "$dynamic" 'FLAGS_1.*PIE' || missing+=("the PIE flag"); fi
  has "$segments" 'GNU_RELRO' || missing+=(RELRO)
  has "$dynamic" 'BIND_NOW|FLAGS_1.* NOW' || missing+=(BIND_NOW)
  has "$segments" 'GNU_STACK.* RW ' || missing+=("a stack that cannot be executed")
  has "$dynamic" 'RPATH|RUNPATH' && missing+=("freedom from search paths of the build")
  has "$symbols" '__stack_chk_fail' || missing+=("the stack protector")
  # The reader and the plug-in are small and call nothing that has a checked form.
  case "$name" in */bin/*) has "$symbols" '__[a-z]+_chk@' || missing+=(fortify)
    has "$symbols" '__glibcxx_assert_fail' ||
      missing+=("the checks of the standard library") ;; esac
  has "$notes" 'Build ID' || missing+=("a build id")
  # The code is made for CET. The note that says so of a whole program is lost to Debian 12's start
  # files (crti.o), which lack it.
  if has "$header" 'X86-64'; then
    [ "$(grep -aoP '\xf3\x0f\x1e\xfa' "$file" | wc -l)" -ge 50 ] ||
      missing+=("the landing pads of CET (endbr64)")
  fi
  if [ ${#missing[@]} -gt 0 ]; then
    failed=1
    printf 'FAILED    %s: expected, and not found: %s\n' "$name" "$(IFS=';'; echo "${missing[*]}")"
  else
    echo "ok        $name"
  fi
done < <(find "$1" -type f -print0 | sort -z)
[ "$files" -gt 0 ] || { echo "no ELF file of Plumb below $1"; exit 1; }
exit $failed
