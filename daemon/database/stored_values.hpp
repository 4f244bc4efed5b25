// SPDX-License-Identifier: Apache-2.0
// Times, numbers and names as stored in the columns of the database.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "algo/base/message.hpp"
#include "algo/base/names.hpp"
#include "web/model/account.hpp"
#include "web/model/wall_clock.hpp"

namespace plumb {

/// The appliance itself, as named in the audit log.
inline const Actor kSelf{.user = "plumbd", .address = ""};
/// The commands of `plumb`, which do not know who calls them.
inline const Actor kCommand{.user = "command line", .address = ""};

/// Microseconds since 1970.
[[nodiscard]] std::int64_t ToStored(WallClock::time_point time);
[[nodiscard]] WallClock::time_point FromStored(std::int64_t us);
/// The time now, as it is stored.
[[nodiscard]] std::int64_t StoredNow();

/// An id from outside; nothing if no record can have it. An absent id, bound to
/// a statement, matches no row.
[[nodiscard]] std::optional<std::int64_t> ParseId(std::string_view text);
/// The same. @throws StoreRefusal (kNotFound) naming what does not exist.
[[nodiscard]] std::int64_t RequireId(const std::string& text, const char* what);

/// "000042": the name of a scan's folder, and its id.
[[nodiscard]] std::string ScanId(std::int64_t id);

/// For the column beside the one with the English sentence; empty for a text that came from
/// outside.
[[nodiscard]] std::string MessageColumn(const Message& message);
/// @param column  Of MessageColumn(), or empty, as for what 0.2.0 wrote: then the message is the
///                English sentence.
[[nodiscard]] Message MessageIn(const std::string& column, std::string_view english);

[[noreturn]] void RefuseStoredName(const char* what, std::string_view name);
/// @throws DataError for a name that this version does not know.
template <typename Enum>
[[nodiscard]] Enum ParseStored(const char* what, std::string_view name) {
  if (const std::optional<Enum> value = Named<Enum>(name)) return *value;
  RefuseStoredName(what, name);
}

}  // namespace plumb
