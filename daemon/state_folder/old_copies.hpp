// SPDX-License-Identifier: Apache-2.0
// Copies of the store that a restore or a conversion has left in the state folder: before-restore-N
// and before-checksums. They still hold patients and accounts.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace plumb {

/// Prefix of folders in the state folder that keep the files of a damaged database.
inline constexpr const char* kDamagedPrefix = "damaged-";

/// Sorted by name. Without copies of damaged databases (damaged-*), which cannot be searched.
[[nodiscard]] std::vector<std::filesystem::path> OldCopies(const std::filesystem::path& state);

/// Removes a patient, with all scans and their files, from a copy.
/// @throws StoreRefusal (kConflict) if the copy cannot be searched and must be removed first
void WipeFromCopy(const std::filesystem::path& copy, const std::string& patient_code);

/// Removes accounts and paired displays from a copy. @throws as above
void RemoveAccountsFromCopy(const std::filesystem::path& copy);

}  // namespace plumb
