// SPDX-License-Identifier: Apache-2.0
// Explains system exceptions with their subject.
#pragma once

#include <exception>
#include <new>
#include <system_error>

#include "algo/base/errors.hpp"
#include "words/scan.hpp"

namespace plumb {

/// Without this, a thread that cannot be started is reported as "Resource temporarily unavailable"
/// and exhausted memory as "std::bad_alloc", without naming the resource.
inline Message Explain(const std::exception& error) {
  if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr) return say::scan::OutOfMemory();
  const auto* system = dynamic_cast<const std::system_error*>(&error);
  if (system != nullptr && system->code() == std::errc::resource_unavailable_try_again)
    return say::scan::NoThread();
  return MessageOf(error);
}

}  // namespace plumb
