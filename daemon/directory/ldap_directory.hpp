// SPDX-License-Identifier: Apache-2.0
// One question to the clinic's directory by LDAP (RFC 4511): log in as the person, look for the
// person's groups.
#pragma once

#include <string>

#include "daemon/config/directory_settings.hpp"
#include "web/security/directory_answer.hpp"

namespace plumb {

/// Waits for the network, at most some ten seconds. An empty password never matches: a server would
/// take it for a visitor who gives no name. SIGPIPE must be ignored, as the loop does. Thread-safe;
/// throws only std::bad_alloc.
[[nodiscard]] web::DirectoryAnswer AskLdap(const DirectorySettings& settings,
                                           const std::string& name, const std::string& password);

}  // namespace plumb
