// SPDX-License-Identifier: Apache-2.0
// What the clinic's directory says of a person who gives a name and a password.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "algo/base/message.hpp"
#include "web/model/account.hpp"

namespace plumb::web {

struct DirectoryAnswer {
  bool matches = false;      ///< Name and password belong together.
  std::optional<Role> role;  ///< By the person's groups; nothing: none of them may use this unit.
  /// Why it lets this person in with no password at all, such as for a locked account. Empty: it
  /// does not say so.
  Message refusal;
  Message
      failure;  ///< Why the question failed: none of the above is known then. Empty: it did not.
};

/// Asks without waiting; `done` is called on the loop's thread. False, without calling it, while
/// too many wait already.
using AskDirectory = std::function<bool(const std::string& name, std::string password,
                                        std::function<void(const DirectoryAnswer&)> done)>;

}  // namespace plumb::web
