// SPDX-License-Identifier: Apache-2.0
// Outputs that appear complete or not at all.
#pragma once

#include <filesystem>
#include <functional>
#include <string_view>
#include <vector>

#include "algo/base/message.hpp"

namespace plumb {

/// The files of one kind of output folder: an existing folder of that kind may be replaced. Or,
/// with `may_replace`, an output that is one file.
struct OutputKind {
  Message name;                  ///< For messages: say::output::Scene().
  std::string_view marker_file;  ///< Always present, such as "scene.json".
  std::vector<std::string_view>
      known_entries;  ///< All allowed entries at its top level, including the marker file.
  /// Set: the output is one file, and an existing file for which this is true may be replaced.
  std::function<bool(const std::filesystem::path&)> may_replace = {};
};

/// A folder that is written beside its target under a hidden name and replaces the target with
/// Commit(). Destroyed without Commit() (by an error or a stop request) it leaves nothing behind. A
/// killed process leaves the hidden folder, which the next output of the same name removes. Not
/// thread-safe.
class AtomicFolder {
 public:
  /// Creates the hidden folder, and missing parents of the target.
  /// @throws IoError if the target exists and is neither empty nor of this kind, or the system
  ///         refuses.
  AtomicFolder(const std::filesystem::path& target, OutputKind kind);
  ~AtomicFolder();
  AtomicFolder(const AtomicFolder&) = delete;
  AtomicFolder& operator=(const AtomicFolder&) = delete;

  /// The folder to write to.
  [[nodiscard]] const std::filesystem::path& path() const { return hidden_; }

  /// Flushes everything to the disk and moves it to the target; an older output there is removed.
  /// Call once.
  /// @throws IoError; the target is then unchanged.
  void Commit();
  /// The same for an output that is one file, which lies in the folder: everything else in there is
  /// removed.
  void CommitFile(const std::filesystem::path& file);

 private:
  void RemoveStale() const;
  void MakeHidden();
  void Discard();

  OutputKind kind_;
  std::filesystem::path target_;
  std::filesystem::path hidden_;
  std::vector<std::filesystem::path> made_parents_;  ///< Outermost first.
  /// Open and locked during the lifetime of this object, so that others see that it is in use.
  int lock_ = -1;
  bool committed_ = false;
};

/// The same for one file: `write` gets a hidden path beside the target.
/// @throws IoError, and the exceptions of `write`.
void WriteFileAtomically(const std::filesystem::path& target,
                         const std::function<void(const std::filesystem::path&)>& write);

}  // namespace plumb
