// Explains system exceptions with their subject.
#pragma once

#include <exception>
#include <new>
#include <string>
#include <system_error>

namespace plumb {

/// Without this, a thread that cannot be started is reported as "Resource temporarily unavailable"
/// and exhausted memory as "std::bad_alloc", without naming the resource.
inline std::string Explain(const std::exception& error) {
  if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr)
    return "out of memory: close other programs, or raise the limit (MemoryMax)";
  const auto* system = dynamic_cast<const std::system_error*>(&error);
  if (system != nullptr && system->code() == std::errc::resource_unavailable_try_again)
    return "cannot start a thread: memory or the number of threads (TasksMax) is exhausted";
  return error.what();
}

}  // namespace plumb
