// SPDX-License-Identifier: Apache-2.0
// The tables of the store, and their migration from older versions.
#pragma once

#include "daemon/database/database.hpp"

namespace plumb {

inline constexpr int kSchemaVersion = 10;

/// The oldest schema whose programs can use a database of kSchemaVersion: after an update is rolled
/// back, the previous version has to start with the data. A migration that only adds tables, and
/// columns with a default, leaves it unchanged; any other migration sets it to its own number.
inline constexpr int kUsableFromSchema = 9;

/// Location of this statement in the database, in the table `settings`.
inline constexpr const char* kUsableFromName = "usable_from_schema";

/// Migrates a new database, or one of 0.1.0 or 0.2.0, to kSchemaVersion, each step in a
/// transaction. A database of a newer Plumb is left unchanged if it states that this version can
/// use it.
/// @throws DatabaseCorrupt otherwise, also for schemas that were never released.
void Migrate(Database& database);

/// Reads every table of the first version. @throws IoError and its kinds if Migrate() would throw,
/// the database is new, or a table is missing
void RequireUsable(Database& database);

}  // namespace plumb
