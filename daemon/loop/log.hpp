// SPDX-License-Identifier: Apache-2.0
// Messages to the journal, or to stderr without a journal. They never contain a patient's code or
// anything typed by a person.
#pragma once

#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

namespace plumb {

enum class LogLevel {
  kError = 3,
  kWarning = 4,
  kNotice = 5,
  kInfo = 6,
  kDebug = 7
};  ///< Numbers of syslog.

/// Field names in capitals, as in the journal; "SCAN" becomes PLUMB_SCAN.
using LogFields = std::initializer_list<std::pair<std::string_view, std::string>>;

/// Logs one line. Thread-safe, does not throw. Under systemd it goes to the journal with its
/// fields, otherwise to stderr.
void Log(LogLevel level, std::string_view message, LogFields fields = {}) noexcept;

}  // namespace plumb
