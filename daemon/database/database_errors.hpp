// SPDX-License-Identifier: Apache-2.0
// What a database may refuse.
#pragma once

#include "algo/base/errors.hpp"

namespace plumb {

/// The file is not a database, or a damaged one.
class DatabaseCorrupt : public IoError {
 public:
  using IoError::IoError;
};

/// The disk is full or may not be written.
class DiskRefused : public IoError {
 public:
  using IoError::IoError;
};

/// Another process or connection holds it.
class DatabaseBusy : public IoError {
 public:
  using IoError::IoError;
};

/// A rule of the tables was violated: a name taken, an approved row changed.
class ConstraintBroken : public IoError {
 public:
  using IoError::IoError;
};

}  // namespace plumb
