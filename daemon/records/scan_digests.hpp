// The database's digests of the files of scans, and whether these files can be used.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/records/database.hpp"
#include "daemon/records/scan_files.hpp"

namespace plumb {

[[nodiscard]] std::vector<FileDigest> StoredDigests(Database& database, std::int64_t scan);
/// Within a transaction. A file that has a digest keeps it.
void StoreDigests(Database& database, std::int64_t scan, const std::vector<FileDigest>& files);
/// Within a transaction: why the files of a scan cannot be used; empty if they can. Changes are
/// recorded in the audit log.
void SetUnavailable(Database& database, std::int64_t scan, const std::string& before,
                    const std::string& now);

}  // namespace plumb
