# systemd-analyze verify complains of programs that are not installed yet and of files of other units; what matters here are our own lines.
execute_process(COMMAND ${ANALYZE} verify --man=no --recursive-errors=no ${UNIT} ${SOCKET} OUTPUT_VARIABLE text ERROR_VARIABLE text)
string(REGEX MATCHALL "[^\n]*(Unknown|Failed to parse|Invalid|ignoring)[^\n]*" complaints "${text}")
if(complaints)
  message(FATAL_ERROR "${complaints}")
endif()
