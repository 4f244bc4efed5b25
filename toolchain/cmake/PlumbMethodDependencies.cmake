# SPDX-License-Identifier: Apache-2.0
# What the method needs. Installed beside PlumbConfig.cmake: programs that link the library find the
# same.
include(CMakeFindDependencyMacro)
find_dependency(Threads)
find_dependency(Eigen3 3.4 NO_MODULE)
find_dependency(TBB)
find_dependency(fmt)
find_dependency(PkgConfig)
if(NOT TARGET PkgConfig::cairo)
  pkg_check_modules(cairo REQUIRED IMPORTED_TARGET GLOBAL cairo)
endif()

# Debian ships OpenCV's CMake package only with the whole of OpenCV (highgui, imgcodecs and their
# closure): here only the modules used.
find_path(PLUMB_OPENCV_INCLUDE opencv2/core.hpp PATH_SUFFIXES opencv4 REQUIRED)
foreach(module core imgproc flann features2d calib3d video)
  if(TARGET opencv_${module})
    continue()
  endif()
  find_library(PLUMB_OPENCV_${module} opencv_${module} REQUIRED)
  add_library(opencv_${module} UNKNOWN IMPORTED)
  set_target_properties(opencv_${module} PROPERTIES IMPORTED_LOCATION ${PLUMB_OPENCV_${module}}
    INTERFACE_INCLUDE_DIRECTORIES ${PLUMB_OPENCV_INCLUDE})
endforeach()
