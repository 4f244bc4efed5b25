// Messages to the journal, or to stderr where there is none. Never a patient's code,
// nor anything that people typed.
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
};  ///< syslog's numbers

/// Field names in capitals, as the journal has them; "SCAN" becomes PLUMB_SCAN.
using LogFields = std::initializer_list<std::pair<std::string_view, std::string>>;

/// One line. Thread-safe, does not throw. Under systemd it goes to the journal with its fields,
/// else to stderr.
void Log(LogLevel level, std::string_view message, LogFields fields = {}) noexcept;

}  // namespace plumb
