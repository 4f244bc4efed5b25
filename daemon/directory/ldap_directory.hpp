// SPDX-License-Identifier: Apache-2.0
// One question to the clinic's directory by LDAP (RFC 4511): log in as the person, look for the
// person's groups.
#pragma once

#include <stop_token>
#include <string>

#include "daemon/config/directory_settings.hpp"
#include "web/security/directory_answer.hpp"

namespace plumb {

/// Waits for the network: at most ten seconds once the server's name is known, some seconds for the
/// name. An empty password never matches: a server would take it for a visitor who gives no name.
/// SIGPIPE must be ignored, as the loop does. Thread-safe; does not throw.
/// @param stop  Ends the question once the server's name is known; the answer is then a failure.
[[nodiscard]] web::DirectoryAnswer AskLdap(const DirectorySettings& settings,
                                           const std::string& name, const std::string& password,
                                           const std::stop_token& stop);

}  // namespace plumb
