// SPDX-License-Identifier: Apache-2.0
#include "daemon/database/stored_values.hpp"

#include <algorithm>
#include <chrono>

#include <fmt/format.h>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "algo/base/parse_number.hpp"
#include "daemon/database/store_refusal.hpp"
#include "words/store.hpp"
#include "words/text.hpp"

namespace plumb {

std::int64_t ToStored(WallClock::time_point time) {
  return std::chrono::duration_cast<std::chrono::microseconds>(time.time_since_epoch()).count();
}

/// A damaged stamp may lie beyond what the clock can hold: then it is the end of that.
WallClock::time_point FromStored(std::int64_t us) {
  constexpr std::int64_t kMost_us =
      std::chrono::duration_cast<std::chrono::microseconds>(WallClock::duration::max()).count();
  return WallClock::time_point(std::chrono::duration_cast<WallClock::duration>(
      std::chrono::microseconds(std::clamp(us, -kMost_us, kMost_us))));
}

std::int64_t StoredNow() { return ToStored(WallClock::now()); }

std::optional<std::int64_t> ParseId(std::string_view text) {
  constexpr std::size_t kMaxDigits = 15;
  if (text.size() > kMaxDigits) return std::nullopt;
  const std::optional<std::int64_t> id = ParseNumber<std::int64_t>(text);
  return id && *id > 0 ? id : std::nullopt;
}

std::int64_t RequireId(const std::string& text, const char* what) {
  if (const std::optional<std::int64_t> id = ParseId(text)) return *id;
  throw StoreRefusal(ChangeResult::kNotFound, say::store::UnknownId(what, text.substr(0, 32)));
}

std::string ScanId(std::int64_t id) { return fmt::format("{:06}", id); }

std::string MessageColumn(const Message& message) {
  if (message.empty() || message.Is(say::text::kVerbatim)) return {};
  return MessageJson(message).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

Message MessageIn(const std::string& column, std::string_view english) {
  if (column.empty()) return Message::Verbatim(english);
  return MessageFromJson(ParseBoundedJsonOrNothing<nlohmann::ordered_json>(column), english);
}

void RefuseStoredName(const char* what, std::string_view name) {
  throw DataError(say::store::UnknownName(what, name.substr(0, 32)));
}

}  // namespace plumb
