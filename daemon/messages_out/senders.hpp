// SPDX-License-Identifier: Apache-2.0
// The ways out: one attempt each. They wait for a network or a program, never for longer than half
// a minute, and end soon after a stop is requested.
#pragma once

#include <stop_token>
#include <string>

#include "daemon/config/messages_settings.hpp"
#include "daemon/messages_out/out_message.hpp"

namespace plumb {

// Each returns why the message was not taken; empty if it was. @throws IoError for a secret that
// cannot be read.
[[nodiscard]] std::string SendMail(const OutMessage& message, const MessagesSettings& settings,
                                   const std::stop_token& stop);
[[nodiscard]] std::string SendSyslog(const OutMessage& message, const MessagesSettings& settings,
                                     const std::stop_token& stop);
[[nodiscard]] std::string SendWebhook(const OutMessage& message, const MessagesSettings& settings,
                                      const std::stop_token& stop);

}  // namespace plumb
