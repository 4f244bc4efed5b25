// SPDX-License-Identifier: Apache-2.0
// Messages as they are stored and sent: {"id": "acceptance.coverage_low", "arguments": {...}}. A
// number with a unit is {"value": 3.2, "unit": "mm"}, a word is a message, text and counts are
// themselves.
#pragma once

#include <span>
#include <vector>

#include <nlohmann/json.hpp>

#include "algo/base/message.hpp"

namespace plumb {

[[nodiscard]] nlohmann::ordered_json MessageJson(const Message& message);
[[nodiscard]] nlohmann::ordered_json MessagesJson(std::span<const Message> messages);

/// Never throws for what was stored: what is not a message of this version becomes the English
/// sentence beside it.
[[nodiscard]] Message MessageFromJson(const nlohmann::ordered_json& json, std::string_view english);
/// @param messages  As of MessagesJson(); absent (null) in what 0.2.0 wrote.
/// @param english   The sentences beside them, in the same order; they decide how many there are.
[[nodiscard]] std::vector<Message> MessagesFromJson(const nlohmann::ordered_json& messages,
                                                    std::span<const std::string> english);

}  // namespace plumb
