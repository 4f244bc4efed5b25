// SPDX-License-Identifier: Apache-2.0
// The database's digests of the files of scans, and whether these files can be used.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "daemon/database/database.hpp"
#include "daemon/scan_files/scan_files.hpp"

namespace plumb {

[[nodiscard]] std::vector<FileDigest> StoredDigests(Database& database, std::int64_t scan);
/// Within a transaction. A file that has a digest keeps it.
void StoreDigests(Database& database, std::int64_t scan, const std::vector<FileDigest>& files);
/// Within a transaction: why the files of a scan cannot be used; empty if they can. Changes are
/// recorded in the audit log.
/// @param before  The English sentence that is stored.
void SetUnavailable(Database& database, std::int64_t scan, const std::string& before,
                    const Message& now);

}  // namespace plumb
