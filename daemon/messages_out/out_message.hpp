// SPDX-License-Identifier: Apache-2.0
// One message to people outside, in the forms in which it travels.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "algo/base/message.hpp"
#include "daemon/messages_out/occasions.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {

struct OutMessage {
  std::string id;    ///< The same in each attempt: whoever gets it twice can tell.
  std::string unit;  ///< Name of the machine.
  WallClock::time_point time;
  OccasionKind kind = OccasionKind::kTest;
  bool is_repeated = false;
  Message text;
};

/// RFC 5322, with lines that end in CR LF. @param from, to  Checked addresses.
[[nodiscard]] std::string MailText(const OutMessage& message, const Catalogue& language,
                                   const std::string& from, const std::string& to);
/// RFC 5424, of the facility local0: a warning, or a notice if it is a test.
[[nodiscard]] std::string SyslogText(const OutMessage& message, const Catalogue& language);
/// As the C library writes to the socket of this machine, which not every reader of it takes
/// otherwise.
[[nodiscard]] std::string LocalSyslogText(const OutMessage& message, const Catalogue& language);
/// {"format": 1, "id", "time", "unit", "kind", "repeated", "text", "message": {id, arguments}}
[[nodiscard]] std::string WebhookBody(const OutMessage& message, const Catalogue& language);
/// "sha256=HEX": HMAC of the body.
[[nodiscard]] std::string WebhookSignature(std::string_view body, std::string_view secret);

}  // namespace plumb
