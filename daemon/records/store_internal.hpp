// What the store's source files share.
#pragma once

#include <charconv>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "web/service/service_types.hpp"

namespace plumb::store {

/// Who the appliance is in the audit log.
inline const web::Actor kSelf{.user = "plumbd", .address = ""};
/// What a complete folder of a scan that was interrupted gets behind its number in set-aside.
inline constexpr const char* kInterruptedSuffix = "-interrupted";
inline constexpr std::string_view kInterrupted =
    "interrupted: the appliance was switched off or its disk refused the scan";

[[nodiscard]] inline std::int64_t ToStored(web::WallClock::time_point time) {
  return std::chrono::duration_cast<std::chrono::microseconds>(time.time_since_epoch()).count();
}
[[nodiscard]] inline web::WallClock::time_point FromStored(std::int64_t us) {
  return web::WallClock::time_point(
      std::chrono::duration_cast<web::WallClock::duration>(std::chrono::microseconds(us)));
}

/// An id as it comes from outside; nothing if it can be none of ours.
[[nodiscard]] inline std::optional<std::int64_t> ParseId(std::string_view text) {
  std::int64_t id = 0;
  if (text.empty() || text.size() > 15) return std::nullopt;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), id);
  if (error != std::errc() || end != text.data() + text.size() || id <= 0) return std::nullopt;
  return id;
}

/// "000042": the name of a scan's folder, and its id.
[[nodiscard]] std::string ScanId(std::int64_t id);

[[nodiscard]] const char* Name(web::ScanPurpose purpose);
[[nodiscard]] const char* Name(web::ScanOutcome outcome);
[[nodiscard]] const char* Name(web::Role role);
/// @throws DataError for a name that this version does not know.
[[nodiscard]] web::ScanPurpose ParsePurpose(std::string_view name);
[[nodiscard]] web::ScanOutcome ParseOutcome(std::string_view name);
[[nodiscard]] web::Role ParseRole(std::string_view name);

}  // namespace plumb::store
