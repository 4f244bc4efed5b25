// SPDX-License-Identifier: Apache-2.0
// The rehearsal of a restore. Nobody here can open an encrypted backup again, so its stream is also
// given, before it is encrypted, to a process of its own that unpacks it into a scratch folder and
// opens it as plumbd does at a start.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>

#include "algo/base/message.hpp"
#include "daemon/archive/helper_process.hpp"

namespace plumb {

/// The side that writes the backup. It never waits longer than two minutes for the other one.
class Rehearsal {
 public:
  /// Starts the process: `plumb` beside this program, or along PATH.
  /// @param state  Gets the scratch folder, which is removed at the end.
  explicit Rehearsal(const std::filesystem::path& state);
  ~Rehearsal();
  Rehearsal(const Rehearsal&) = delete;
  Rehearsal& operator=(const Rehearsal&) = delete;

  /// Passes on a piece of the stream. Errors are kept for End().
  void Take(std::span<const std::uint8_t> bytes);
  /// After the last piece. @return why nothing was rehearsed; empty if it was
  /// @throws DataError if the backup could not be restored, with the reason
  [[nodiscard]] Message End();

 private:
  std::filesystem::path scratch_;
  std::optional<Descriptor> input_;
  std::optional<HelperProcess> process_;
  Message why_not_;
};

/// The other side: unpacks an archive as it comes, compares every file with its sum, opens the
/// store and compares its list of files with the sums. Takes at most half of the free room of the
/// disk, and never more than 2 GiB: beyond that, files of scans are compared, but stand in the
/// folder without their content.
/// @param scratch  Existing and empty; what was unpacked stays in it.
/// @throws DataError if it could not be restored; DiskRefused without room; Interrupted
void RehearseRestore(int input, const std::filesystem::path& scratch, const std::stop_token& stop);

}  // namespace plumb
