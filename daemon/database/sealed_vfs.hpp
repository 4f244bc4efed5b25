// SPDX-License-Identifier: Apache-2.0
// A layer below SQLite that gives each page of a database a checksum and compares it at each read.
#pragma once

#include <cstdint>

namespace plumb {

/// The name of SQLite's `system` ("unix-excl", "unix-none") with this layer. Thread-safe.
///
/// Pages get their checksum when they are written to the database's file. Pages in the log of
/// writes are compared with the log's own sums at each read; SQLite itself does so only when it
/// opens a log. Reading a page that is not as it was written is SQLITE_IOERR_DATA. After each
/// commit that reaches the disk, the database's mark is written. The connection must not write
/// pages before their commit (PRAGMA cache_spill = OFF) and must not use pages of another size than
/// kPageBytes.
[[nodiscard]] const char* SealedSystem(const char* system);

/// A parameter of a database's URI. 1: pages are kept in memory (kept_pages.hpp), so that each is
/// read from the disk and compared once.
inline constexpr const char* kKeepPages = "keep_pages";

/// The number of the last page that this thread found damaged; 0: it was in the log of writes.
[[nodiscard]] std::uint32_t LastUnsealedPage();

}  // namespace plumb
