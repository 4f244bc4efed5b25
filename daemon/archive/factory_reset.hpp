// SPDX-License-Identifier: Apache-2.0
// Reset to the state of delivery: requested on the page or the command line, carried out at the
// next start, before anything else opens the state folder.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "algo/base/message.hpp"
#include "web/model/account.hpp"
#include "web/model/settings.hpp"

namespace plumb {

/// In the state folder; systemd/factory-reset reads its kind too.
inline constexpr const char* kFactoryResetFile = "factory-reset.json";
/// By systemd/factory-reset: what it could not remove of a wipe, and why, a line each.
inline constexpr const char* kFactoryResetLeft = "factory-reset-left";

/// Records the request and who made it, durably. The file gets the folder's owner.
/// @throws IoError; what was written by then is withdrawn, or the message says that it may count.
void RequestFactoryReset(const std::filesystem::path& state, FactoryReset kind, const Actor& actor);

/// Withdraws a request that has not been carried out.
/// @param what  The reason, for people.
/// @returns `what`, with the addition that the reset may still take place if the request could not
///          be withdrawn.
[[nodiscard]] Message CancelFactoryReset(const std::filesystem::path& state, Message what);

/// Carries out a request; an interrupted one starts again. Keeping the records removes accounts,
/// paired displays, settings, bundles, what is remembered of channels of updates, and the keys of
/// page and browsers; wiping removes everything in the folder, and counts as done once nothing is
/// left in or outside it. The (new) audit log records who requested it.
/// @returns what was done, as a sentence; nothing without a request.
/// @throws DataError for a request that cannot be read, which changes nothing; IoError and its
///         kinds, after which the next start continues.
std::optional<Message> CarryOutFactoryReset(const std::filesystem::path& state);

}  // namespace plumb
