# SPDX-License-Identifier: Apache-2.0
# systemd-analyze verify complains of programs that are not installed yet and of files of other
# units; what matters here are our own lines.
execute_process(COMMAND ${ANALYZE} verify --man=no --recursive-errors=no ${UNIT} ${SOCKET}
  OUTPUT_VARIABLE text ERROR_VARIABLE text)
string(REGEX MATCHALL "[^\n]*(Unknown|Failed to parse|Invalid|ignoring)[^\n]*" complaints "${text}")
if(complaints)
  message(FATAL_ERROR "${complaints}")
endif()
# There may be no administrator nearby: neither the service nor its socket may ever give up.
file(STRINGS ${UNIT} unlimited REGEX "^StartLimitIntervalSec=0$")
file(STRINGS ${SOCKET} socket_unlimited REGEX "^TriggerLimitIntervalSec=0$")
if(NOT unlimited OR NOT socket_unlimited)
  message(FATAL_ERROR
    "the units give up after some failures: "
    "expected StartLimitIntervalSec=0 and TriggerLimitIntervalSec=0")
endif()
