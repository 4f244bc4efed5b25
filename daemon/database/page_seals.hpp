// SPDX-License-Identifier: Apache-2.0
// A file beside the database that lists the checksum each page had when it was last written. The
// checksum within a page cannot reveal that the disk lost a write, because the older page is
// intact.
#pragma once

#include <cstdint>
#include <filesystem>

#include "daemon/database/sealed_pages.hpp"

namespace plumb {

/// Appended to the name of the database's file.
inline constexpr const char* kSealsSuffix = "-seals";

/// Makes the list of a database that has none, such as one that was restored.
/// @throws DiskRefused
void MakeSeals(const std::filesystem::path& database);

[[nodiscard]] bool HasSeals(const std::filesystem::path& database);
/// @return -1 if there is no list, as for copies of a database, or it cannot be opened
[[nodiscard]] int OpenSeals(const std::filesystem::path& database, bool writes);
/// Not forced to the disk. @return whether it could be written
[[nodiscard]] bool NoteSeal(int seals, std::uint32_t page, std::uint64_t seal);
/// Whether a page that carries this checksum may be the one that was written last. A damaged or
/// missing entry proves nothing, and the page's own checksum has to do.
[[nodiscard]] bool IsLastSeal(int seals, std::uint32_t page, std::uint64_t seal);

}  // namespace plumb
