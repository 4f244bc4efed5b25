# SPDX-License-Identifier: Apache-2.0
# find_package(Plumb): the method as a library, Plumb::plumb_algo.
include("${CMAKE_CURRENT_LIST_DIR}/PlumbMethodDependencies.cmake")
include("${CMAKE_CURRENT_LIST_DIR}/PlumbTargets.cmake")
