// The control socket's language: one JSON object a line, asked and answered.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace plumb {

inline constexpr std::size_t kMaxControlLine = 4096;  ///< Bytes of a request.

/// {"command": "status" | "press" | "watch" | "sim" | "backup", "long": bool with press, "action"
/// and, optional, "argument": texts with sim, "folder": an absolute path with backup}
struct ControlRequest {
  enum class Kind { kStatus, kPress, kWatch, kSim, kBackup };
  Kind kind = Kind::kStatus;
  bool is_long = false;  ///< kPress
  std::string
      action;  ///< kSim: one of plug, unplug, stall, resume, error, next-scene, glitch, speed.
  std::string argument;  ///< kSim: a serial, what kind of glitch and how often, or how fast; words
                         ///< of letters, digits, -, _ and dots.
  std::string folder = {};  ///< kBackup: where it is made.
  bool operator==(const ControlRequest&) const = default;
};

/// @throws DataError saying what was expected: no JSON object, unknown command, key or action, a
/// line too long.
[[nodiscard]] ControlRequest ParseControlRequest(std::string_view line);

/// The line, without its end.
[[nodiscard]] std::string ControlRequestText(const ControlRequest& request);

/// {"ok": true} or {"ok": false, "error": text}
[[nodiscard]] std::string ControlDone();
[[nodiscard]] std::string ControlRefusal(std::string_view error);

}  // namespace plumb
