// The answer to what the web asks to be changed.
#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace plumb::web {

enum class ChangeResult {
  kDone,
  kInvalid,   ///< The request makes no sense; the message says what was expected and found.
  kNotFound,  ///< No such patient, reference, scan or user.
  kConflict,  ///< Not in this state: "in state X, trying f(), requires Y".
  kRefused,   ///< This user may not, here: the one who made a reference does not approve it.
  kNoSpace,   ///< Disk full or read-only.
  kFailed,
};

/// The answer to a change.
struct Change {
  ChangeResult result = ChangeResult::kDone;
  std::string message;         ///< For people; empty when done.
  std::string id;              ///< Of what was made, where something was.
  std::filesystem::path file;  ///< Of what was written, where something was.
};
/// Called exactly once, on the loop thread: within the call that asked, or later.
using Done = std::function<void(const Change&)>;

}  // namespace plumb::web
