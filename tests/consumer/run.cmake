# SPDX-License-Identifier: Apache-2.0
# Installs the library into a folder of its own, builds a project against it and runs that.
file(REMOVE_RECURSE ${WORK})
file(COPY ${SOURCE}/../support/synthetic_scene.cpp ${SOURCE}/../support/synthetic_scene.hpp
  DESTINATION ${WORK}/scenes/tests/support)
set(options "-DCMAKE_PREFIX_PATH=${WORK}/prefix;-DSCENES=${WORK}/scenes")
foreach(step
    "${CMAKE_COMMAND};--install;${BUILD};--prefix;${WORK}/prefix;--component;dev"
    "${CMAKE_COMMAND};-S;${SOURCE};-B;${WORK}/build;-G;Ninja;${options}"
    "${CMAKE_COMMAND};--build;${WORK}/build"
    "${WORK}/build/consumer")
  execute_process(COMMAND ${step} RESULT_VARIABLE failed)
  if(failed)
    message(FATAL_ERROR "failed: ${step}")
  endif()
endforeach()
