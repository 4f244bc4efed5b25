// SPDX-License-Identifier: Apache-2.0
// Keyed digests of the rows that decide: who may do what, what is compared with what, and within
// which limits. A page's checksum notices what a disk changed; these notice what another program
// wrote, and a database that another unit's key signed.
//
// Triggers of the connection that writes keep the digests, so that no change can forget them. What
// no digest notices is a row that is replaced by an earlier one together with its digest.
#pragma once

#include <filesystem>
#include <string>

#include "daemon/database/database.hpp"

namespace plumb {

/// The columns of a kind never change, since an older version may go on with the database: new
/// columns need another kind.
enum class RowKind {
  kAccount,  ///< With its second factor and PIN.
  kDisplay,
  kSetting,
  kTemplate,
  kSession,
  kReference,
  kRoom,
  kCheck,
  kBaseline,
};

/// In the state folder; no backup has it.
inline constexpr const char* kRowKeyFile = "rows.key";
/// In the state folder; a person confirms for one start that the rows are right as they are.
inline constexpr const char* kRowsRightFile = "rows-are-right";

enum class RowsAre {
  kNew,       ///< Of a database that has just been made.
  kSigned,    ///< Every row has the digest that it was written with.
  kOlder,     ///< Of a version without digests.
  kRestored,  ///< Of a backup, which a person chose.
};

/// Compares every row with its digest and keeps the digests of a connection that writes from now
/// on. Rows without digests, restored ones, and those that a person has confirmed get theirs now,
/// with an entry in the audit log unless the database is new.
/// @throws DatabaseCorrupt naming the row that is not as it was written, or that is gone; IoError
void KeepRowDigests(Database& database, const std::filesystem::path& state, RowsAre rows);

/// For a connection that only reads. @throws DatabaseCorrupt if the key is gone
void UseRowKey(Database& database, const std::filesystem::path& state);

/// One row, by its id or name; one that does not exist is right. @throws DatabaseCorrupt
void RequireRow(Database& database, RowKind kind, const std::string& id);
/// All rows of a kind; none of them is gone. @throws DatabaseCorrupt
void RequireRows(Database& database, RowKind kind);
/// Of every kind. @throws DatabaseCorrupt
void RequireAllRows(Database& database);

}  // namespace plumb
