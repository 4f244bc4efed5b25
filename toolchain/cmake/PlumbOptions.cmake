# SPDX-License-Identifier: Apache-2.0
# Flags that every target of Plumb shares, as one interface library.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()
find_program(PLUMB_CCACHE ccache)
if(PLUMB_CCACHE)
  # Paths below the checkout are taken relative to it, so that all checkouts share the objects.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env
    CCACHE_BASEDIR=${PROJECT_SOURCE_DIR} CCACHE_NOHASHDIR=1 ${PLUMB_CCACHE})
endif()

add_library(plumb_options INTERFACE)
target_include_directories(plumb_options INTERFACE
  $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:include/plumb>)
# -ffp-contract=off: no fused multiply-add behind our back, so results agree between machines.
target_compile_options(plumb_options INTERFACE
  $<BUILD_INTERFACE:-Wall;-Wextra;-Wshadow;-Wnon-virtual-dtor> -ffp-contract=off)
# The presets make warnings errors, but for what GCC 12 sees where nothing is: in inlined
# std::string and std::vector of its own library, and in optional and Eigen values that are set
# before use.
if(CMAKE_COMPILE_WARNING_AS_ERROR AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_compile_options(plumb_options INTERFACE
    $<BUILD_INTERFACE:-Wno-error=restrict>
    $<BUILD_INTERFACE:-Wno-error=stringop-overflow>
    $<BUILD_INTERFACE:-Wno-error=maybe-uninitialized>)
endif()

# Position-independent code, so that one set of objects serves the programs and the Python module.
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
target_compile_options(plumb_options INTERFACE $<BUILD_INTERFACE:-fno-semantic-interposition>)

# What Debian's hardening=+all asks for. Sanitizers bring their own checks and clash with these.
if(NOT PLUMB_SANITIZE)
  target_compile_options(plumb_options INTERFACE
    $<BUILD_INTERFACE:-fstack-protector-strong;-fstack-clash-protection>)
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    target_compile_options(plumb_options INTERFACE $<BUILD_INTERFACE:-fcf-protection>)
  endif()
  if(NOT CMAKE_BUILD_TYPE STREQUAL "Debug")
    target_compile_definitions(plumb_options INTERFACE $<BUILD_INTERFACE:_FORTIFY_SOURCE=2>)
  endif()
  target_link_options(plumb_options INTERFACE $<BUILD_INTERFACE:LINKER:-z,relro,-z,now>)
  include(CheckPIESupported)
  check_pie_supported()
endif()
# The sanitizer's library, which must come before any other that is preloaded.
set(PLUMB_SANITIZER_RUNTIME "")
foreach(pair address:libasan.so thread:libtsan.so)
  string(REPLACE ":" ";" pair ${pair})
  list(GET pair 0 sanitizer)
  if(PLUMB_SANITIZE MATCHES ${sanitizer})
    list(GET pair 1 library)
    execute_process(COMMAND ${CMAKE_CXX_COMPILER} -print-file-name=${library}
      OUTPUT_VARIABLE library OUTPUT_STRIP_TRAILING_WHITESPACE)
    file(REAL_PATH ${library} PLUMB_SANITIZER_RUNTIME)
  endif()
endforeach()
if(PLUMB_SANITIZE)
  target_compile_options(plumb_options INTERFACE -fsanitize=${PLUMB_SANITIZE}
    -fno-omit-frame-pointer -fno-sanitize-recover=undefined)
  target_link_options(plumb_options INTERFACE -fsanitize=${PLUMB_SANITIZE})
endif()
