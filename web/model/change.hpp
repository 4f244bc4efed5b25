// SPDX-License-Identifier: Apache-2.0
// The answer to a requested change.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <utility>

#include "algo/base/message.hpp"

namespace plumb {

enum class ChangeResult {
  kDone,
  kInvalid,   ///< The request is invalid; the message states what was expected and found.
  kNotFound,  ///< No such patient, reference, scan or user.
  kConflict,  ///< Not possible in this state: "in state X, trying f(), requires Y".
  kRefused,   ///< This user may not do it here: the author of a reference must not approve it.
  kNoSpace,   ///< Disk full or read-only.
  kFailed,
};

/// The answer to a change.
struct Change {
  ChangeResult result = ChangeResult::kDone;
  Message message;             ///< For people; empty when done.
  std::string id;              ///< Id of a new record, if any.
  std::filesystem::path file;  ///< Path of a new file, if any.
};
/// An answer with a message, mostly for a change that was not made.
[[nodiscard]] inline Change Refused(ChangeResult result, Message message) {
  return {.result = result, .message = std::move(message), .id = {}, .file = {}};
}
[[nodiscard]] inline Change Refused(ChangeResult result, const std::string& verbatim) {
  return Refused(result, Message::Verbatim(verbatim));
}
[[nodiscard]] inline Change DoneWith(std::string id) {
  return {.result = ChangeResult::kDone, .message = {}, .id = std::move(id), .file = {}};
}

/// Called exactly once, on the loop thread: during the request or later.
using Done = std::function<void(const Change&)>;

}  // namespace plumb
