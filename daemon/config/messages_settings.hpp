// SPDX-License-Identifier: Apache-2.0
// Section [messages] of the configuration: who is notified of what needs attention, and how.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/config/config_section.hpp"

namespace plumb {

/// Messages go out over every channel that is configured; with none, there are no messages. Secrets
/// are read from their files whenever they are needed.
struct MessagesSettings {
  std::string language = "en";
  std::vector<std::string> mail_to;
  std::string mail_from;
  std::string mail_server;  ///< smtp:// (with STARTTLS) or smtps://; empty: the program `sendmail`.
  std::string mail_user;    ///< Empty: the server asks for none.
  std::filesystem::path mail_password_file;
  std::filesystem::path sendmail = "/usr/sbin/sendmail";
  std::string syslog;   ///< "local", unix:///PATH, udp://, tcp:// or tls://HOST:PORT; empty: none.
  std::string webhook;  ///< https://...; empty: none.
  std::filesystem::path webhook_secret_file;  ///< Of the signature; without it there is none.
  std::filesystem::path trusted;              ///< Certificates, PEM; empty: those of the system.
  int check_due_min = 9 * 60;  ///< Minutes after midnight by which a check must have passed.
  bool check_on_weekends = false;

  bool operator==(const MessagesSettings&) const = default;
};

/// The parts of scheme://HOST:PORT/PATH.
struct PlainUrl {
  std::string scheme, host, port, path;  ///< `port` and `path` may be empty.
  /// What is sent there leaves the machine.
  [[nodiscard]] bool LeavesTheMachine() const;
};
/// Nothing for what has user names, spaces, control characters or more than 1024 bytes.
[[nodiscard]] std::optional<PlainUrl> ParsePlainUrl(std::string_view text);

/// @throws DataError naming the key; also for keys that do not fit together.
[[nodiscard]] MessagesSettings ReadMessagesSettings(Section section);

}  // namespace plumb
