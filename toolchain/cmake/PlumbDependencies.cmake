# SPDX-License-Identifier: Apache-2.0
# Libraries of the system, each by its package's own config where it has one.
include(PlumbMethodDependencies)
find_package(nlohmann_json 3.11 REQUIRED)
# An enumeration goes into JSON by its name (algo/base/names.hpp), never as a number unnoticed.
set_property(TARGET nlohmann_json::nlohmann_json APPEND PROPERTY
  INTERFACE_COMPILE_DEFINITIONS JSON_DISABLE_ENUM_SERIALIZATION=1)
find_package(CLI11 REQUIRED)
find_package(PNG REQUIRED)
find_package(TIFF REQUIRED)
find_package(JPEG REQUIRED)
pkg_check_modules(pangocairo REQUIRED IMPORTED_TARGET pangocairo)
pkg_check_modules(zlib REQUIRED IMPORTED_TARGET zlib)
pkg_check_modules(lz4 REQUIRED IMPORTED_TARGET liblz4)
pkg_check_modules(zstd REQUIRED IMPORTED_TARGET libzstd)
pkg_check_modules(sqlite3 REQUIRED IMPORTED_TARGET sqlite3)
pkg_check_modules(yaml REQUIRED IMPORTED_TARGET yaml-cpp)
find_path(PLUMB_TOMLPP_INCLUDE toml++/toml.h REQUIRED)
add_library(tomlplusplus::tomlplusplus INTERFACE IMPORTED)
target_include_directories(tomlplusplus::tomlplusplus INTERFACE ${PLUMB_TOMLPP_INCLUDE})

if(PLUMB_WITH_DICOM)
  # The part of DCMTK that reads files; its own package names all of DCMTK.
  find_path(PLUMB_DCMTK_INCLUDE dcmtk/dcmdata/dctk.h REQUIRED)
  add_library(plumb_dcmtk INTERFACE)
  target_include_directories(plumb_dcmtk SYSTEM INTERFACE ${PLUMB_DCMTK_INCLUDE})
  foreach(part dcmdata oflog ofstd)
    find_library(PLUMB_DCMTK_${part} ${part} REQUIRED)
    target_link_libraries(plumb_dcmtk INTERFACE ${PLUMB_DCMTK_${part}})
  endforeach()
  # The part that speaks over a network.
  add_library(plumb_dcmtk_network INTERFACE)
  foreach(part dcmtls dcmnet)
    find_library(PLUMB_DCMTK_${part} ${part} REQUIRED)
    target_link_libraries(plumb_dcmtk_network INTERFACE ${PLUMB_DCMTK_${part}})
  endforeach()
  target_link_libraries(plumb_dcmtk_network INTERFACE plumb_dcmtk)
endif()

# Digests, of the command line too.
pkg_check_modules(sodium REQUIRED IMPORTED_TARGET libsodium)

# The appliance. Each hardware library can be left out.
if(PLUMB_WITH_APPLIANCE)
  pkg_check_modules(systemd REQUIRED IMPORTED_TARGET libsystemd)
  pkg_check_modules(microhttpd REQUIRED IMPORTED_TARGET libmicrohttpd)
  pkg_check_modules(gnutls REQUIRED IMPORTED_TARGET gnutls)
  pkg_check_modules(libzip REQUIRED IMPORTED_TARGET libzip)
  pkg_check_modules(libarchive REQUIRED IMPORTED_TARGET libarchive)
  pkg_check_modules(curl REQUIRED IMPORTED_TARGET libcurl)
endif()
if(PLUMB_WITH_OPENNI)
  pkg_check_modules(openni2 REQUIRED IMPORTED_TARGET libopenni2)
endif()
if(PLUMB_WITH_USB)
  pkg_check_modules(usb REQUIRED IMPORTED_TARGET libusb-1.0)
endif()
if(PLUMB_WITH_GPIO)
  # Version 2 has another interface.
  pkg_check_modules(gpiod REQUIRED IMPORTED_TARGET libgpiod<2)
endif()
if(PLUMB_BUILD_TESTS AND PLUMB_WITH_APPLIANCE)
  pkg_check_modules(umockdev REQUIRED IMPORTED_TARGET umockdev-1.0)
endif()
