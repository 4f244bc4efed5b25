// What a program leaves behind when it ends by a fault of its own.
#pragma once

namespace plumb {

/// On SIGSEGV, SIGBUS, SIGILL, SIGFPE and SIGABRT the process writes the signal, the program's
/// version and build id and the addresses of the calls to its standard error (under systemd the
/// journal), and then ends by that signal as it would have done. Nothing of what the program works
/// on is written. SIGXFSZ is ignored: a write beyond the limit of a file's size fails instead.
/// Call it once, first in main(); `program` and `version` must outlive the process's threads. Does
/// nothing about crashes in builds with sanitizers, which report by themselves.
void ReportCrashes(const char* program, const char* version);

}  // namespace plumb
