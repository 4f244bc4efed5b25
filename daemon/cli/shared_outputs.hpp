// SPDX-License-Identifier: Apache-2.0
// A folder of outputs that several processes fill together, each output by one of them.
#pragma once

#include <filesystem>
#include <stop_token>
#include <string>

#include "drivers/files/descriptor.hpp"

namespace plumb {

/// The right to write one output of a folder, among all processes that use it. The system takes it
/// back when the process ends, however it ends. Its file stays in FOLDER/.locks: to remove it while
/// another process opens it would give the right to both.
class OutputLock {
 public:
  /// @throws IoError if the file system has no locks: without them work would be done twice.
  OutputLock(const std::filesystem::path& folder, const std::string& name);
  /// False: another process has it.
  [[nodiscard]] bool IsHeld() const { return is_held_; }

 private:
  Descriptor file_;
  bool is_held_ = false;
};

/// Pauses between two looks at what another process is doing. @throws Interrupted at once
void WaitForOthers(const std::stop_token& stop);

/// Removes the unfinished outputs of processes that were killed: hidden folders that no process has
/// locked. @throws IoError
void RemoveUnfinished(const std::filesystem::path& folder);

}  // namespace plumb
