// The tables of the store, and how older ones become today's.
#pragma once

#include "daemon/records/database.hpp"

namespace plumb {

inline constexpr int kSchemaVersion = 8;

/// The oldest schema whose programs can work with a database of kSchemaVersion: after an update was
/// left again, the version before it has to start with the data. A step that only adds tables, and
/// columns with a default, leaves it as it is; any other step sets it to its own number.
inline constexpr int kUsableFromSchema = 8;

/// Where the database itself says so, in the table `settings`.
inline constexpr const char* kUsableFromName = "usable_from_schema";

/// Brings the database to kSchemaVersion, step by step, each in a transaction. One of a newer Plumb
/// stays as it is if it says that this one can work with it.
/// @throws DatabaseCorrupt if it says nothing of the kind.
void Migrate(Database& database);

}  // namespace plumb
