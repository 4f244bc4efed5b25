// SPDX-License-Identifier: Apache-2.0
// Reports a crash of the program before it ends.
#pragma once

namespace plumb {

/// On SIGSEGV, SIGBUS, SIGILL, SIGFPE and SIGABRT the process writes the signal, the program's
/// version and build id and the return addresses to its standard error (under systemd the journal),
/// and then ends by that signal as usual. No data of the program is written. SIGXFSZ is ignored, so
/// that a write beyond the file size limit fails instead. Call it once, first in main(); `program`
/// and `version` must outlive the process's threads. Does nothing in builds with sanitizers, which
/// report crashes themselves.
void ReportCrashes(const char* program, const char* version);

}  // namespace plumb
