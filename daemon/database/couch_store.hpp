// SPDX-License-Identifier: Apache-2.0
// The profile of the treatment couch.
#pragma once

#include <string>

#include "daemon/database/store_database.hpp"
#include "web/model/couch.hpp"

namespace plumb {

/// Thread-safe. Changes throw StoreRefusal; everything throws IoError and its kinds.
class CouchStore {
 public:
  explicit CouchStore(StoreDatabase& database) : database_(database) {}

  /// @throws DataError for one that cannot be read: it is never replaced by a default.
  [[nodiscard]] CouchProfile Get();
  /// @param wanted  With the version that it replaces; kConflict if another one is in force.
  ///         Returns the new version.
  std::string Sign(const Actor& actor, const CouchProfile& wanted);

 private:
  StoreDatabase& database_;
};

}  // namespace plumb
