// SPDX-License-Identifier: Apache-2.0
// The protocol of the control socket: one JSON object per line for requests and answers.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "algo/base/message.hpp"
#include "daemon/control/attached_file.hpp"
#include "daemon/files/age_recipients.hpp"

namespace plumb {

inline constexpr std::size_t kMaxControlLine = 4096;  ///< Bytes of a request.

/// {"command": "status" | "press" | "watch" | "sim" | "backup" | "update" | "update-status" |
/// "restart" | "presence" | "monitor" | "test-message", "long": bool with press, "action" and,
/// optional, "argument": texts with sim, "folder": an absolute path with backup, and, optional,
/// "recipients": public keys, "name": NAME.raucb with update, whose message carries the open file
/// (SCM_RIGHTS)}
struct ControlRequest {
  enum class Kind {
    kStatus,
    kPress,
    kWatch,
    kSim,
    kBackup,
    kUpdate,
    kUpdateStatus,
    kRestart,
    kPresence,
    kMonitor,
    kTestMessage
  };
  Kind kind = Kind::kStatus;
  bool is_long = false;  ///< kPress
  bool starts = false;   ///< kMonitor: "action" is start, otherwise stop.
  std::string action;    ///< kSim: one of plug, unplug, stall, resume, error, next-scene, glitch,
                         ///< speed, mount, move.
  /// kSim: a serial, the kind and number of glitches, or the speed; words of letters, digits, -, _
  /// and dots.
  std::string argument;
  std::string folder = {};                        ///< kBackup: target folder or archive.
  AgeRecipients recipients = {};                  ///< kBackup: those for whom it is encrypted.
  std::string name = {};                          ///< kUpdate: name of the bundle.
  std::shared_ptr<const AttachedFile> file = {};  ///< kUpdate: the bundle, open for reading.
  bool operator==(const ControlRequest&) const = default;
};

/// @throws DataError stating what was expected: not a JSON object, unknown command, key or action,
///         a line too long.
[[nodiscard]] ControlRequest ParseControlRequest(std::string_view line);

/// The line without its end.
[[nodiscard]] std::string ControlRequestText(const ControlRequest& request);

/// Text that is not UTF-8, such as a path, does not make a line fail.
[[nodiscard]] std::string ControlLine(const nlohmann::json& json);

/// {"ok": true} or {"ok": false, "error": English text, "error_message": as in message_json.hpp}
[[nodiscard]] std::string ControlDone();
/// @param is_input  The error is in the request, not in the present state: adds "input": true.
[[nodiscard]] std::string ControlRefusal(const Message& why, bool is_input = false);

}  // namespace plumb
