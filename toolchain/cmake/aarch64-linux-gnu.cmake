# SPDX-License-Identifier: Apache-2.0
# Debian's cross compiler against an unpacked arm64 Debian; programs of the build run in QEMU. Used
# by toolchain/arm64.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(PLUMB_SYSROOT "$ENV{PLUMB_SYSROOT}" CACHE PATH "Debian arm64, unpacked")
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES PLUMB_SYSROOT)
set(CMAKE_SYSROOT "${PLUMB_SYSROOT}")
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
# BLAS and LAPACK lie in folders that update-alternatives chooses from, which never ran here.
foreach(library blas lapack)
  foreach(kind EXE SHARED)
    string(APPEND CMAKE_${kind}_LINKER_FLAGS_INIT
      " -Wl,-rpath-link,${PLUMB_SYSROOT}/usr/lib/aarch64-linux-gnu/${library}")
  endforeach()
endforeach()
find_program(PLUMB_QEMU qemu-aarch64-static REQUIRED)
set(CMAKE_CROSSCOMPILING_EMULATOR
  "${PLUMB_QEMU}" -L "${PLUMB_SYSROOT}" -E
  "LD_LIBRARY_PATH=/usr/lib/aarch64-linux-gnu/blas:/usr/lib/aarch64-linux-gnu/lapack")
set(ENV{PKG_CONFIG_DIR} "")
set(ENV{PKG_CONFIG_SYSROOT_DIR} "${PLUMB_SYSROOT}")
set(ENV{PKG_CONFIG_LIBDIR}
  "${PLUMB_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${PLUMB_SYSROOT}/usr/share/pkgconfig")
