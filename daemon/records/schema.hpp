// The tables of the store, and how older ones become today's.
#pragma once

#include "daemon/records/database.hpp"

namespace plumb {

inline constexpr int kSchemaVersion = 8;

/// Brings the database to kSchemaVersion, step by step, each in a transaction.
/// @throws DatabaseCorrupt if it was written by a newer Plumb, saying so.
void Migrate(Database& database);

}  // namespace plumb
